//! Symplectic splitting: compositions of drift, kick, drift.

use super::batch::{Batch, Scratch};
use super::equations::Dynamics;
use super::flow::Flow;
use crate::eval::{InstructionSet, Pace, add_carrying, add_multiple};

/// Sees the states before every stage or step.
pub(super) type Recorder<'a> = &'a mut dyn FnMut(&[f64]);

/// One stage of a splitting method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SplittingStage {
    /// q += coefficient h v, or else p -= coefficient h g.
    pub drift: bool,
    pub coefficient: f64,
    /// Time of evaluation, in steps from the start.
    pub time: f64,
}

/// The stages of `steps` equal steps of a composition of leapfrog steps.
///
/// The drift that ends one leapfrog step and the one that begins the next are one stage: the
/// momenta and the time are the same. Time stands still during drift and kick and moves on
/// between them, which keeps every leapfrog step symmetric and so the order of the composition.
pub(super) fn stages(gammas: &[f64], steps: usize) -> impl Iterator<Item = SplittingStage> {
    let mut start = 0.0;
    let mut before = 0.0;
    let mut first = Vec::with_capacity(2 * gammas.len());
    for &gamma in gammas {
        let coefficient = 0.5 * (before + gamma);
        first.push(SplittingStage { drift: true, coefficient, time: start });
        first.push(SplittingStage { drift: false, coefficient: gamma, time: start + 0.5 * gamma });
        start += gamma;
        before = gamma;
    }
    let joint = 0.5 * (before + gammas.first().copied().unwrap_or(0.0));
    let stage = move |at: usize| {
        let (step, place) = (at / first.len(), at % first.len());
        let stage = first[place];
        let coefficient = if step > 0 && place == 0 { joint } else { stage.coefficient };
        SplittingStage { coefficient, time: step as f64 + stage.time, ..stage }
    };
    (0..2 * gammas.len() * steps).map(stage).chain(last(gammas, steps))
}

/// The drift that ends the last step.
fn last(gammas: &[f64], steps: usize) -> Option<SplittingStage> {
    let gamma = gammas.last().filter(|_| steps > 0)?;
    Some(SplittingStage { drift: true, coefficient: 0.5 * gamma, time: steps as f64 })
}

/// Advances a batch; `scratch.step` holds the step of each lane. `record` sees the state before
/// every stage.
///
/// What rounding takes from a state is carried on from stage to stage, so that the error of
/// rounding does not grow with the number of steps.
pub(super) fn advance(
    dynamics: &Dynamics,
    gammas: &[f64],
    batch: &mut Batch,
    steps: usize,
    theta: &[f64],
    scratch: &mut Scratch,
    mut record: Option<Recorder>,
) {
    scratch.carry.clear();
    scratch.carry.resize(batch.state.len(), 0.0);
    scratch.again.iter_mut().for_each(Vec::clear);
    let few = batch.lanes <= FEW_LANES && !batch.has_tangents() && record.is_none();
    if few && run_loop(dynamics, gammas, batch, steps, theta, scratch) {
        if let Some(last) = last(gammas, steps) {
            apply(dynamics, last, batch, theta, scratch);
        }
        return;
    }
    for stage in stages(gammas, steps) {
        if let Some(record) = &mut record {
            record(&batch.state);
        }
        apply(dynamics, stage, batch, theta, scratch);
    }
}

/// Up to this many trajectories are followed one after the other, if there is machine code for
/// it: that is faster than short rows.
const FEW_LANES: usize = 8;

/// All stages but the last drift, in machine code; the same to the last bit. Returns false, and
/// does nothing, where there is no such code or it does not pay.
fn run_loop(
    dynamics: &Dynamics,
    gammas: &[f64],
    batch: &mut Batch,
    steps: usize,
    theta: &[f64],
    scratch: &mut Scratch,
) -> bool {
    let per_step = 2 * gammas.len();
    let first: Vec<SplittingStage> = stages(gammas, 1).take(per_step).collect();
    // The drifts that begin the later steps are longer.
    let second = stages(gammas, 2).nth(per_step);
    let scale =
        |stage: &SplittingStage, h: f64| if stage.drift { 1.0 } else { -1.0 } * stage.coefficient * h;
    // A stage that does not move is not for machine code to find.
    let moves = |h: &f64| first.iter().all(|stage| scale(stage, *h) != 0.0);
    if !scratch.step.iter().all(moves) {
        return false;
    }
    let Some(code) = dynamics.step_loop(per_step, steps * batch.lanes) else { return false };
    let times: Vec<f64> = first.iter().map(|stage| stage.time).collect();
    for lane in 0..batch.lanes {
        let (step, start) = (scratch.step[lane], batch.time[lane]);
        let mut scales: Vec<f64> = first.iter().map(|stage| scale(stage, step)).collect();
        let mut state = batch.get(lane);
        let at = |row: usize| row * batch.lanes + lane;
        let mut carry: Vec<f64> = (0..state.len()).map(|row| scratch.carry[at(row)]).collect();
        let pace = Pace { scales: &scales, times: &times, step, start, first: 0.0, steps: 1 };
        code.run(&mut state, &mut carry, theta, &pace);
        if let Some(second) = &second {
            scales[0] = scale(second, step);
        }
        let (first, steps) = (1.0, steps - 1);
        let pace = Pace { scales: &scales, times: &times, step, start, first, steps };
        code.run(&mut state, &mut carry, theta, &pace);
        for (row, (state, carry)) in state.into_iter().zip(carry).enumerate() {
            batch.state[at(row)] = state;
            scratch.carry[at(row)] = carry;
        }
    }
    true
}

/// One drift or kick of the states, and of the tangents if there are any.
fn apply(
    dynamics: &Dynamics,
    stage: SplittingStage,
    batch: &mut Batch,
    theta: &[f64],
    scratch: &mut Scratch,
) {
    let (lanes, degrees, columns) = (batch.lanes, batch.degrees(), batch.columns());
    let tangents = batch.has_tangents();
    let flow = if stage.drift { dynamics.drift() } else { dynamics.kick() };
    let probed = dynamics.probed(stage.drift).filter(|_| tangents);
    let timed = flow.timed() || probed.is_some_and(Flow::timed);
    stage.prepare(&batch.time, timed, scratch);
    let part = usize::from(stage.drift);
    std::mem::swap(&mut scratch.workspace, &mut scratch.again[part]);
    flow.evaluate_again(&batch.state, lanes, theta, tangents, scratch);
    std::mem::swap(&mut scratch.workspace, &mut scratch.again[part]);
    let size = if tangents { flow.outputs() } else { flow.rows } * lanes;
    let Scratch { out, scale, carry, .. } = scratch;
    let out = &mut out[..size];
    let half = degrees * lanes;
    let set = InstructionSet::widest();
    let target = if stage.drift { 0..half } else { half..2 * half };
    let (state, carry) = (&mut batch.state[target.clone()], &mut carry[target]);
    add_carrying(set, state, carry, &out[..half], scale);
    if !tangents {
        return;
    }
    rescale(out, scale);
    let entries = &out[half..];
    let half = degrees * columns * lanes;
    let (q, p) = batch.tangent.split_at_mut(half);
    let (target, source) = if stage.drift { (q, &*p) } else { (p, &*q) };
    flow.push(target, source, entries, 2 * degrees, columns, lanes);

    let Some(probed) = probed else { return };
    // In the middle of the change, which keeps the step symmetric.
    let mut middle = batch.state.clone();
    let changed = if stage.drift { 0 } else { degrees * lanes };
    for (state, change) in middle[changed..].iter_mut().zip(&out[..flow.rows * lanes]) {
        *state -= 0.5 * change;
    }
    probed.evaluate(&middle, lanes, theta, true, scratch);
    let Scratch { out, scale, .. } = scratch;
    let out = &mut out[..probed.outputs() * lanes];
    rescale(out, scale);
    let (q, p) = batch.tangent.split_at_mut(half);
    let (target, source) = if stage.drift { (q, &*p) } else { (p, &*q) };
    probed.push(target, source, &out[probed.rows * lanes..], 2 * degrees, columns, lanes);
}

impl SplittingStage {
    /// Sets the factors of the change from the step of each lane and, for what is `timed`, the
    /// times of evaluation.
    pub(super) fn prepare(self, start: &[f64], timed: bool, scratch: &mut Scratch) {
        let Scratch { time, since, scale, step, .. } = scratch;
        let sign = if self.drift { 1.0 } else { -1.0 };
        scale.clear();
        scale.extend(step.iter().map(|step| sign * self.coefficient * step));
        if timed {
            time.clear();
            time.extend_from_slice(&start[..step.len()]);
            add_multiple(InstructionSet::widest(), time, step, self.time);
            since.clear();
            since.extend(step.iter().map(|step| self.time * step));
        }
    }
}

/// Multiplies each row by the scale of its lanes; a lane with scale 0 does not move, whatever
/// stands in the row.
pub(super) fn rescale(rows: &mut [f64], scale: &[f64]) {
    crate::eval::rescale(InstructionSet::widest(), rows, scale);
}
