//! Symplectic splitting: compositions of drift, kick, drift.

use super::batch::{Batch, Scratch};
use super::equations::Dynamics;

/// One stage of a splitting method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stage {
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
pub fn stages(gammas: &[f64], steps: usize) -> impl Iterator<Item = Stage> {
    let substeps = (0..steps).flat_map(move |step| {
        let mut start = 0.0;
        gammas.iter().enumerate().flat_map(move |(i, &gamma)| {
            let before = match i.checked_sub(1) {
                Some(previous) => gammas[previous],
                None if step == 0 => 0.0,
                None => gammas[gammas.len() - 1],
            };
            let time = step as f64 + start;
            start += gamma;
            [
                Stage { drift: true, coefficient: 0.5 * (before + gamma), time },
                Stage { drift: false, coefficient: gamma, time: time + 0.5 * gamma },
            ]
        })
    });
    let last = gammas.last().filter(|_| steps > 0).map(|&gamma| Stage {
        drift: true,
        coefficient: 0.5 * gamma,
        time: steps as f64,
    });
    substeps.chain(last)
}

/// Advances a batch; `scratch.step` holds the step of each lane. `record` sees the state before
/// every stage.
pub fn advance(
    dynamics: &Dynamics,
    gammas: &[f64],
    batch: &mut Batch,
    steps: usize,
    theta: &[f64],
    scratch: &mut Scratch,
    record: &mut dyn FnMut(&[f64]),
) {
    for stage in stages(gammas, steps) {
        record(&batch.state);
        apply(dynamics, stage, batch, theta, scratch);
    }
}

/// One drift or kick of the states, and of the tangents if there are any.
fn apply(
    dynamics: &Dynamics,
    stage: Stage,
    batch: &mut Batch,
    theta: &[f64],
    scratch: &mut Scratch,
) {
    let (lanes, degrees, columns) = (batch.lanes, batch.degrees(), batch.columns());
    let tangents = batch.has_tangents();
    let flow = if stage.drift { dynamics.drift() } else { dynamics.kick() };
    stage.prepare(&batch.time, scratch);
    flow.evaluate(&batch.state, lanes, theta, tangents, scratch);
    let size = if tangents { flow.outputs() } else { flow.rows } * lanes;
    let Scratch { out, scale, .. } = scratch;
    let out = &mut out[..size];
    rescale(out, scale);

    let (values, entries) = out.split_at(flow.rows * lanes);
    let (q, p) = batch.state.split_at_mut(degrees * lanes);
    let target = if stage.drift { q } else { p };
    for (state, change) in target.iter_mut().zip(values) {
        *state += change;
    }
    if !tangents {
        return;
    }
    let half = degrees * columns * lanes;
    let (q, p) = batch.tangent.split_at_mut(half);
    let (target, source) = if stage.drift { (q, &*p) } else { (p, &*q) };
    flow.push(target, source, entries, 2 * degrees, columns, lanes);

    let Some(probed) = dynamics.probed(stage.drift) else { return };
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

impl Stage {
    /// Sets the times of evaluation and the factors of the change from the step of each lane.
    pub fn prepare(self, start: &[f64], scratch: &mut Scratch) {
        let Scratch { time, scale, step, .. } = scratch;
        time.clear();
        time.extend(start.iter().zip(&*step).map(|(t, h)| t + self.time * h));
        let sign = if self.drift { 1.0 } else { -1.0 };
        scale.clear();
        scale.extend(step.iter().map(|h| sign * self.coefficient * h));
    }
}

/// Multiplies each row by the scale of its lanes; a lane with scale 0 does not move, whatever
/// stands in the row.
pub fn rescale(rows: &mut [f64], scale: &[f64]) {
    if scale.is_empty() {
        return;
    }
    for row in rows.chunks_exact_mut(scale.len()) {
        for (value, &factor) in row.iter_mut().zip(scale) {
            *value = if factor == 0.0 { 0.0 } else { *value * factor };
        }
    }
}
