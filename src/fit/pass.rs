//! One pass over the data: every segment is integrated, compared with its measurements, and
//! its unknown initial state is eliminated. What is left is one triangular factor.
//!
//! With J_s and J the derivatives of a segment's residuals r by its initial state and by
//! theta, Householder reflections bring `[J_s J r]` to `[R_s * *; 0 J' r']`. The rows `[J' r']`
//! no longer know the state; they are what the factor takes in (variable projection:
//! Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973, in Kaufman's form).

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::arrowhead;
use super::block::Block;
use super::blocking::BLOCKING;
use super::driving::OwnInputs;
use super::factor::Factor;
use super::gathered::Gathered;
use super::loss::Loss;
use super::monitor::Monitor;
use super::motion::{Equations, Propagation};
use super::per_run::{self, Eliminated};
use super::rounding::{ABSORBED, WHOLE_STEPS};
use super::rows::DesignRows;
use super::segments::{Segment, Segments, blocks};
use super::settling::{Responses, TangentRequest, expected_steps, settled, steps_of_few};
use super::states::States;
use super::stream::Stream;
use super::tuning::Tuning;
use crate::data::Packed;
use crate::dynamics::{Dynamics, KeptScratch, Method, Scratch};
use crate::expr::{Observed, Parameter};

/// Steps from one sample to the next, at most: a second of work.
const MOST_STEPS: f64 = 1e7;

/// How trajectories are integrated between samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stepping {
    /// Method of integration.
    pub method: Method,
    /// No step is longer.
    pub longest: f64,
}

impl Stepping {
    /// Steps that the longest of some spans takes, one at least. What would take more than
    /// [`MOST_STEPS`] is crossed in longer ones, which follow no motion.
    pub fn steps(&self, spans: &[f64]) -> usize {
        let longest = spans.iter().fold(0.0f64, |most, span| most.max(span.abs()));
        let steps = (longest / self.longest * (1.0 - WHOLE_STEPS)).ceil();
        steps.clamp(1.0, MOST_STEPS) as usize
    }
}

/// What a pass works on.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    /// The measurements; observables in the order of the system's.
    pub measured: &'a Packed,
    /// The stretches of measurement that are integrated.
    pub segments: &'a Segments,
    /// What the second half of the observables is.
    pub observed: Observed,
    /// One over the noise of each observable.
    pub weights: &'a [f64],
    /// What a weighted residual costs.
    pub loss: Loss,
    /// How trajectories are integrated between samples.
    pub stepping: Stepping,
    /// Weighted residuals below this are rounding or the integrator's own error.
    pub floor: f64,
    /// All data, where they are larger than memory; measurements and segments are then a sample.
    pub stream: Option<&'a Stream<'a>>,
    /// Samples of a segment, at most, that the data are cut into.
    pub window: usize,
    /// The inner parameters of the system, if runs have some of them for themselves; else none.
    pub parameters: &'a [Parameter],
    /// What runs have for themselves in the present pass.
    pub own: OwnInputs<'a>,
    /// The numbers that passes go by.
    pub tuning: &'a Tuning,
    /// Who may end a pass before it has seen all segments: nothing is known of its sums then.
    pub halt: &'a dyn Monitor,
}

/// Sums over all segments at the best states for a theta.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Sums {
    /// Sum of the loss over all weighted residuals.
    pub loss: f64,
    /// Segments whose trajectory left the finite numbers.
    pub diverged: usize,
    /// Segments whose states were still moving when they were left.
    pub unsettled: usize,
    /// What a last step of states that are only nearly settled takes off; `loss` is that after it.
    pub promised: f64,
    /// Measured values minus what the states take up: the number of independent residuals.
    pub rows: usize,
    /// For each observable, the sum of weighted squares (clipped for robust losses).
    pub squares: Vec<f64>,
    /// For each observable, the measured values minus their leverage on the states.
    pub freedom: Vec<f64>,
}

impl Sums {
    pub(super) fn new(observables: usize) -> Sums {
        Sums { squares: vec![0.0; observables], freedom: vec![0.0; observables], ..Sums::default() }
    }

    /// Of segments that were not looked at.
    fn unfinished(observables: usize, segments: usize) -> Sums {
        Sums { loss: f64::INFINITY, diverged: segments, ..Sums::new(observables) }
    }

    pub(super) fn add(&mut self, other: &Sums) {
        self.loss += other.loss;
        self.diverged += other.diverged;
        self.unsettled += other.unsettled;
        self.promised += other.promised;
        self.rows += other.rows;
        for (a, b) in self.squares.iter_mut().zip(&other.squares) {
            *a += b;
        }
        for (a, b) in self.freedom.iter_mut().zip(&other.freedom) {
            *a += b;
        }
    }
}

/// Improves the states for a theta that is held, and sums up what is left.
///
/// Gauss-Newton for each segment by itself; a step that does not pay is shortened.
pub fn settle(problem: &Problem, dynamics: &Dynamics, theta: &[f64], states: &mut States) -> Sums {
    if let Some(stream) = problem.stream {
        let law = (dynamics, theta);
        return stream.pass(problem, law, law).sums;
    }
    if per_run::has(problem, dynamics) {
        let law = (dynamics, theta);
        return arrowhead::settle_and_linearise(problem, law, law, states, false).sums;
    }
    let width = width(problem, 2 * dynamics.degrees() + 1);
    let parts: Vec<Sums> = problem
        .segments
        .list
        .par_chunks(width)
        .zip(states.all_mut().par_chunks_mut((width * 2 * dynamics.degrees()).max(1)))
        .with_max_len(1)
        .map_init(KeptScratch::new, |scratch, (segments, states)| {
            if problem.halt.halted() {
                return Sums::unfinished(problem.weights.len(), segments.len());
            }
            let block = Block::gather(problem, segments);
            let (rows, taken) = settled(problem, (dynamics, theta), None, &block, states, scratch);
            let mut sums = Sums::new(problem.weights.len());
            rows.sum_up(&mut sums);
            sums.unsettled = taken.unsettled;
            rows.recycle(scratch);
            sums
        })
        .collect();
    let mut total = Sums::new(problem.weights.len());
    parts.iter().for_each(|sums| total.add(sums));
    total
}

/// Weighted residuals of every segment at settled states, `[segment][observable][sample]`; not a
/// number where nothing was measured, or where the trajectory left the finite numbers.
pub fn residuals(
    problem: &Problem,
    dynamics: &Dynamics,
    theta: &[f64],
    states: &States,
) -> Vec<Vec<Vec<f64>>> {
    if per_run::has(problem, dynamics) {
        let law = (dynamics, theta);
        return arrowhead::with_numbers(problem, law, states, |problem| {
            residuals(problem, dynamics, theta, states)
        });
    }
    let width = width(problem, 2 * dynamics.degrees() + 1);
    blocks(0..problem.segments.list.len(), width)
        .into_par_iter()
        .map_init(KeptScratch::new, |scratch, range| {
            let segments = &problem.segments.list[range.clone()];
            if problem.halt.halted() {
                let observables = problem.weights.len();
                let nothing = |one: &Segment| vec![vec![f64::NAN; one.samples()]; observables];
                return segments.iter().map(nothing).collect::<Vec<_>>();
            }
            let block = Block::gather(problem, segments);
            let propagation = Propagation { present: (dynamics, theta), by: None };
            let rows =
                DesignRows::integrate(problem, propagation, &block, states.part(range), scratch);
            let of = |(lane, segment): (usize, &Segment)| {
                let mut values = rows.residuals(lane, segment.samples());
                for (observable, out) in values.iter_mut().enumerate() {
                    let measured = problem.measured.values_of(observable, segment.run);
                    for (x, at) in out.iter_mut().zip(segment.first..) {
                        if !measured[at].is_finite() || !rows.losses[lane].is_finite() {
                            *x = f64::NAN;
                        }
                    }
                }
                values
            };
            segments.iter().enumerate().map(of).collect::<Vec<_>>()
        })
        .flatten_iter()
        .collect()
}

/// The problem, linearised at theta and at settled states: unknowns are increments of theta.
pub struct Linearised {
    /// One factor for each fold of the segments.
    pub folds: Vec<Factor>,
    /// Sums over all segments at that theta.
    pub sums: Sums,
    /// Where the best states go when theta does, if that was asked for.
    pub responses: Option<Responses>,
    /// What is left of the numbers that runs have for themselves, in the order of the runs.
    pub eliminated: Vec<Eliminated>,
}

impl Linearised {
    /// What the folds left, put together in their order.
    pub(super) fn of(
        folds: impl IntoIterator<Item = FoldResult>,
        observables: usize,
    ) -> Linearised {
        let mut all =
            Linearised { sums: Sums::new(observables), ..Linearised::nothing(0, observables) };
        all.folds.clear();
        for FoldResult { factor, sums, responses } in folds {
            all.sums.add(&sums);
            all.folds.push(factor);
            join(&mut all.responses, responses);
        }
        all
    }

    /// A pass that was not finished: no rows, an infinite loss.
    pub(super) fn nothing(unknowns: usize, observables: usize) -> Linearised {
        let sums = Sums { loss: f64::INFINITY, ..Sums::new(observables) };
        let folds = vec![Factor::new(unknowns)];
        Linearised { folds, sums, responses: None, eliminated: Vec::new() }
    }

    /// All folds together.
    pub fn merged(&self) -> Factor {
        let columns = self.folds.first().map_or(0, Factor::columns);
        Factor::together(columns, self.folds.iter().map(|fold| (fold, 1)))
    }
}

/// Linearises the residuals of all segments by theta and eliminates the states.
pub fn linearise(
    problem: &Problem,
    dynamics: &Dynamics,
    theta: &[f64],
    states: &States,
) -> Linearised {
    let law = (dynamics, theta);
    if let Some(stream) = problem.stream {
        return stream.pass(problem, law, law);
    }
    if per_run::has(problem, dynamics) {
        return arrowhead::linearise(problem, law, states);
    }
    let parts = Parts::of(problem, dynamics);
    let starts = parts.ranges().map(|range| states.part(range.clone())).collect();
    let nothing = FoldPass::new(dynamics.unknowns(), problem.weights.len());
    parts.each(problem, &nothing, starts, |part, segments, starts, range, scratch| {
        part.take(problem, law, segments, &starts[range], scratch);
    })
}

/// Settles the states for the present model and linearises by `whole`, in which the present
/// model is one of many: its theta has zeros for all other terms.
pub fn settle_and_linearise(
    problem: &Problem,
    present: (&Dynamics, &[f64]),
    whole: (&Dynamics, &[f64]),
    states: &mut States,
) -> Linearised {
    if let Some(stream) = problem.stream {
        return stream.pass(problem, present, whole);
    }
    if per_run::has(problem, whole.0) {
        return arrowhead::settle_and_linearise(problem, present, whole, states, false);
    }
    let steps = expected_steps(problem, present, whole.0, states);
    let part = FoldPass { steps, ..FoldPass::new(whole.0.unknowns(), problem.weights.len()) };
    settle_and_take_all(problem, present, whole, &part, states, None)
}

/// The same by the present model itself, with the responses of the states where segments are long
/// and memory allows.
///
/// `extrapolated` are the states where the responses of a pass before expect them: most are settled
/// there. If `nearly`,
/// it will do if a step is left that promises next to nothing; the loss is then what this step is
/// expected to leave.
pub fn settle_linearise_and_respond(
    problem: &Problem,
    (dynamics, theta): (&Dynamics, &[f64]),
    states: &mut States,
    extrapolated: Option<&States>,
    nearly: bool,
) -> Linearised {
    let law = (dynamics, theta);
    if let Some(stream) = problem.stream {
        return stream.pass(problem, law, law);
    }
    if per_run::has(problem, dynamics) {
        return arrowhead::settle_and_linearise(problem, law, law, states, nearly);
    }
    let steps = expected_steps(problem, law, dynamics, states);
    let (unknowns, size) = (dynamics.unknowns(), 2 * dynamics.degrees());
    let responses = (problem.segments.longest() > BLOCKING.responses_above)
        .then(|| Responses::of(states.len(), size, unknowns))
        .flatten();
    let part = FoldPass::new(unknowns, problem.weights.len());
    let part = FoldPass { steps, responses, nearly, ..part };
    settle_and_take_all(problem, law, law, &part, states, extrapolated)
}

fn settle_and_take_all(
    problem: &Problem,
    present: Equations,
    whole: Equations,
    nothing: &FoldPass,
    states: &mut States,
    extrapolated: Option<&States>,
) -> Linearised {
    let size = 2 * present.0.degrees();
    let parts = Parts::of(problem, whole.0);
    let mut rest = states.all_mut();
    let mut split = |range: &Range<usize>| rest.split_off_mut(..range.len() * size);
    let starts = parts.ranges();
    let starts = starts
        .filter_map(|range| {
            Some((split(range)?, extrapolated.map(|extrapolated| extrapolated.part(range.clone()))))
        })
        .collect();
    parts.each(
        problem,
        nothing,
        starts,
        |part, segments, (starts, extrapolated), range, scratch| {
            let extrapolated = extrapolated.map(|extrapolated| &extrapolated[range.clone()]);
            part.settle_and_take(
                problem,
                (present, whole),
                segments,
                &mut starts[range],
                extrapolated,
                scratch,
            );
        },
    )
}

/// The folds in parts that threads take one after the other. They depend on the segments and the
/// number of unknowns alone, never on the number of threads.
struct Parts {
    /// Of each part its fold, and its range in the list of segments.
    parts: Vec<(usize, Range<usize>)>,
    /// Segments of a block.
    width: usize,
    /// Numbers of a state.
    size: usize,
}

/// Parts of a fold that threads take one after the other, at most.
pub(super) fn shares(unknowns: usize) -> usize {
    if unknowns <= BLOCKING.parts_up_to { BLOCKING.parts_of_a_fold } else { 1 }
}

impl Parts {
    fn of(problem: &Problem, dynamics: &Dynamics) -> Parts {
        let (size, unknowns) = (2 * dynamics.degrees(), dynamics.unknowns());
        let width = width(problem, size + unknowns + 1);
        let rows_each = (problem.segments.longest() * problem.weights.len()).max(1);
        let least = BLOCKING.part_rows.div_ceil(rows_each);
        let folds = problem.segments.folds.iter().enumerate();
        let parts = folds.flat_map(|(fold, range)| {
            let each = range.len().div_ceil(shares(unknowns)).max(least).next_multiple_of(width);
            blocks(range.clone(), each).into_iter().map(move |part| (fold, part))
        });
        Parts { parts: parts.collect(), width, size }
    }

    fn ranges(&self) -> impl Iterator<Item = &Range<usize>> {
        self.parts.iter().map(|(_, range)| range)
    }

    /// One pass over all parts, block after block, each beginning with `nothing`: `take` gets the
    /// segments of a block, the states of its part and the range of the block's own among them.
    fn each<S: Send>(
        &self,
        problem: &Problem,
        nothing: &FoldPass,
        starts: Vec<S>,
        take: impl Fn(&mut FoldPass, &[Segment], &mut S, Range<usize>, &mut Scratch) + Sync,
    ) -> Linearised {
        let halted = AtomicBool::new(false);
        let done: Vec<(usize, FoldResult)> = self
            .parts
            .par_iter()
            .zip(starts)
            .with_max_len(1)
            .map_init(KeptScratch::new, |scratch, ((fold, part), mut starts)| {
                let segments = &problem.segments.list[part.clone()];
                let mut pass = nothing.clone();
                for range in blocks(0..segments.len(), self.width) {
                    if problem.halt.halted() {
                        halted.store(true, Ordering::Relaxed);
                        break;
                    }
                    let own = range.start * self.size..range.end * self.size;
                    take(&mut pass, &segments[range], &mut starts, own, scratch);
                }
                (*fold, pass.finish())
            })
            .collect();
        if halted.load(Ordering::Relaxed) {
            return Linearised::nothing(nothing.touched.len(), problem.weights.len());
        }
        let folds = problem.segments.folds.len();
        let mut parts: Vec<Vec<FoldResult>> = (0..folds).map(|_| Vec::new()).collect();
        done.into_iter().for_each(|(fold, left)| parts[fold].push(left));
        let folds: Vec<FoldResult> =
            parts.into_par_iter().filter_map(FoldResult::together).collect();
        Linearised::of(folds, problem.weights.len())
    }
}

/// One fold of the data, while its segments go by.
#[derive(Clone)]
pub(super) struct FoldPass {
    factor: Factor,
    sums: Sums,
    responses: Option<Responses>,
    gathered: Gathered,
    touched: Vec<f64>,
    /// Most steps that the states of a block took so far, or are expected to take: those of the
    /// next may take as many.
    steps: Option<usize>,
    /// Whether nearly settled states will do.
    nearly: bool,
}

impl FoldPass {
    pub(super) fn new(unknowns: usize, observables: usize) -> FoldPass {
        FoldPass {
            factor: Factor::new(unknowns),
            sums: Sums::new(observables),
            responses: None,
            gathered: Gathered::new(unknowns + 1),
            touched: vec![0.0; unknowns],
            steps: None,
            nearly: false,
        }
    }

    /// Takes a block of segments in, at states that are settled.
    fn take(
        &mut self,
        problem: &Problem,
        law: Equations,
        segments: &[Segment],
        states: &[f64],
        scratch: &mut Scratch,
    ) {
        let block = Block::gather(problem, segments);
        let propagation = Propagation { present: law, by: Some(law) };
        let mut rows = DesignRows::integrate(problem, propagation, &block, states, scratch);
        rows.eliminate_states(self.responses.is_some());
        self.take_rows(rows, scratch);
    }

    /// Settles a block of segments for the present model and takes it in, linearised by another
    /// model of the same motion.
    pub(super) fn settle_and_take(
        &mut self,
        problem: &Problem,
        (present, by): (Equations, Equations),
        segments: &[Segment],
        states: &mut [f64],
        extrapolated: Option<&[f64]>,
        scratch: &mut Scratch,
    ) {
        let expected = self.steps.or(steps_of_few(by.0));
        let block = Block::gather(problem, segments);
        let responses = self.responses.is_some();
        let by = TangentRequest {
            law: by,
            expected,
            extrapolated,
            responses,
            nearly: responses && self.nearly,
        };
        let (rows, taken) = settled(problem, present, Some(by), &block, states, scratch);
        self.steps = self.steps.max(Some(taken.steps));
        self.sums.unsettled += taken.unsettled;
        self.sums.loss -= taken.promised;
        self.sums.promised += taken.promised;
        self.take_rows(rows, scratch);
    }

    fn take_rows(&mut self, rows: DesignRows, scratch: &mut Scratch) {
        rows.sum_up(&mut self.sums);
        if let Some(responses) = &mut self.responses {
            responses.take(&rows);
        }
        self.gathered.take(&rows, &mut self.factor);
        self.touched.iter_mut().zip(&rows.touched).for_each(|(all, part)| *all += part);
        rows.recycle(scratch);
    }

    /// Brings all rows into the factor, so that none take memory.
    pub(super) fn flush(&mut self) {
        self.gathered.release(&mut self.factor);
    }

    /// What all of them leave, without columns that the states have absorbed.
    pub(super) fn finish(mut self) -> FoldResult {
        self.flush();
        let FoldPass { mut factor, sums, responses, touched, .. } = self;
        factor.zero_columns(|k, norm| norm <= ABSORBED * touched[k].sqrt());
        FoldResult { factor, sums, responses }
    }
}

/// What one fold of the data leaves, or a part of it.
pub(super) struct FoldResult {
    pub factor: Factor,
    pub sums: Sums,
    pub responses: Option<Responses>,
}

impl FoldResult {
    /// What the parts of a fold leave, in their order; `None` where there are no parts.
    pub(super) fn together(mut parts: Vec<FoldResult>) -> Option<FoldResult> {
        if parts.len() < 2 {
            return parts.pop();
        }
        let columns = parts[0].factor.columns();
        let factor = Factor::together(columns, parts.iter().map(|part| (&part.factor, 1)));
        let mut parts = parts.into_iter();
        let mut all = FoldResult { factor, ..parts.next()? };
        for FoldResult { sums, responses, .. } in parts {
            all.sums.add(&sums);
            join(&mut all.responses, responses);
        }
        Some(all)
    }
}

/// Responses of further segments, where there are any.
fn join(known: &mut Option<Responses>, more: Option<Responses>) {
    match (known.as_mut(), more) {
        (Some(known), Some(more)) => known.append(&more),
        (_, more) => *known = more,
    }
}

fn width(problem: &Problem, columns: usize) -> usize {
    block_width(problem, problem.segments.longest(), columns)
}

/// Segments of at most `samples` samples that are worked on side by side.
pub(super) fn block_width(problem: &Problem, samples: usize, columns: usize) -> usize {
    let lane_bytes = samples * problem.weights.len() * columns * 8;
    let most = if 2 * BLOCKING.lanes * lane_bytes <= BLOCKING.small_block_bytes {
        2 * BLOCKING.lanes
    } else {
        BLOCKING.lanes
    };
    (BLOCKING.block_bytes / lane_bytes.max(1)).clamp(4, most) / 4 * 4
}
