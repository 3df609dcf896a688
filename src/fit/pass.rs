//! One pass over the data: every segment is integrated, compared with its measurements, and
//! its unknown initial state is eliminated. What is left is one triangular factor.
//!
//! With J_s and J the derivatives of a segment's residuals r by its initial state and by
//! theta, Householder reflections bring `[J_s J r]` to `[R_s * *; 0 J' r']`. The rows `[J' r']`
//! no longer know the state; they are what the factor takes in (variable projection:
//! Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973, in Kaufman's form).

use std::ops::Range;

use rayon::prelude::*;

use super::block::Block;
use super::factor::Factor;
use super::gathered::Gathered;
use super::loss::Loss;
use super::rows::Rows;
use super::segments::{LANES, Segment, Segments, blocks};
use super::states::States;
use super::stream::Stream;
use crate::data::Dataset;
use crate::dynamics::{Dynamics, KeptScratch, Method, Scratch};
use crate::expr::Observed;

/// How trajectories are integrated between samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stepping {
    /// Method of integration.
    pub method: Method,
    /// No step is longer.
    pub longest: f64,
}

/// What a pass works on.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    /// The measurements; observables in the order of the system's.
    pub dataset: &'a Dataset,
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
    /// All data, where they are larger than memory; dataset and segments are then a sample.
    pub stream: Option<&'a Stream<'a>>,
    /// Samples of a segment, at most, that the data are cut into.
    pub window: usize,
}

/// Rows of short segments by few columns: such blocks may be twice as wide.
const SMALL_BYTES: usize = 128 << 10;
/// Bytes that the rows of one block may take.
const BLOCK_BYTES: usize = 12 << 20;
/// Steps of the inner search for the states.
const STATE_STEPS: usize = 8;
/// States are settled when the next step promises less than this part of the loss.
const SETTLED: f64 = 1e-7;
/// Derivatives are approximate: where the next step promises nothing, the loss may be this part
/// above the least that was seen.
const NEARLY: f64 = 1e-4;
/// A column that keeps less than this of itself is what the initial states do, but for rounding.
const ABSORBED: f64 = 1e-12;
/// ... or less than this part of what rounding makes of it.
const ROUNDING: f64 = 0.03;

/// Sums over all segments at the best states for a theta.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sums {
    /// Sum of the loss over all weighted residuals.
    pub loss: f64,
    /// Segments whose trajectory left the finite numbers.
    pub exploded: usize,
    /// Segments whose states were still moving when their steps were used up.
    pub restless: usize,
    /// Measured values minus what the states take up: the number of independent residuals.
    pub rows: usize,
    /// For each observable, the sum of weighted squares (clipped for robust losses).
    pub squares: Vec<f64>,
    /// For each observable, the measured values minus their leverage on the states.
    pub freedom: Vec<f64>,
}

impl Sums {
    fn new(observables: usize) -> Sums {
        Sums { squares: vec![0.0; observables], freedom: vec![0.0; observables], ..Sums::default() }
    }

    fn add(&mut self, other: &Sums) {
        self.loss += other.loss;
        self.exploded += other.exploded;
        self.restless += other.restless;
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
    let width = width(problem, 2 * dynamics.degrees() + 1);
    let parts: Vec<Sums> = problem
        .segments
        .list
        .par_chunks(width)
        .zip(states.all_mut().par_chunks_mut((width * 2 * dynamics.degrees()).max(1)))
        .map_init(KeptScratch::new, |scratch, (segments, states)| {
            let block = Block::gather(problem.dataset, segments, problem.weights.len());
            let (rows, taken) = settled(problem, (dynamics, theta), None, &block, states, scratch);
            let mut sums = Sums::new(problem.weights.len());
            rows.sum_up(&mut sums);
            sums.restless = taken.restless;
            rows.recycle(scratch);
            sums
        })
        .collect();
    let mut total = Sums::new(problem.weights.len());
    parts.iter().for_each(|sums| total.add(sums));
    total
}

/// A dynamics with the theta that it moves by.
pub(super) type Law<'a> = (&'a Dynamics, &'a [f64]);

/// What a block moves by, and what its motion is derived by.
#[derive(Clone, Copy)]
pub(super) struct Laws<'a> {
    /// The present model.
    pub(super) present: Law<'a>,
    /// The same motion as one of many, by whose theta there are to be derivatives.
    pub(super) by: Option<Law<'a>>,
}

/// What it took to settle the states of a block.
struct Taken {
    steps: usize,
    /// Lanes that were still moving at the end.
    restless: usize,
}

/// Rows of a block at settled states, freed of these: without columns for theta, or with those of
/// `by`.
///
/// Rows by theta are dear. They are computed where `by` expects the states to be settled; if that
/// was too soon, once more at the end.
fn settled(
    problem: &Problem,
    present: Law,
    by: Option<(Law, Option<usize>)>,
    block: &Block,
    states: &mut [f64],
    scratch: &mut Scratch,
) -> (Rows, Taken) {
    let size = 2 * present.0.degrees();
    let lanes = block.lanes();
    let mut trial = states.to_vec();
    let mut best = vec![f64::INFINITY; lanes];
    let mut step = vec![0.0; size * lanes];
    let mut length = vec![1.0; lanes];
    let mut settled = vec![false; lanes];
    let mut taken = 0;
    while taken < STATE_STEPS {
        let here = by.filter(|&(_, expected)| expected == Some(taken)).map(|(law, _)| law);
        let laws = Laws { present, by: here };
        let mut rows = Rows::integrate(problem, laws, block, &trial, scratch);
        rows.eliminate_states();
        let steps = rows.state_steps();
        let mut improved = 0;
        for lane in 0..lanes {
            let loss = rows.losses[lane];
            let rounding = problem.floor.powi(2) * rows.measured[lane] as f64;
            let still = rows.promised(lane) <= SETTLED * loss + ROUNDING * rounding;
            let lower = loss < best[lane] || still && loss <= best[lane] * (1.0 + NEARLY);
            if lower || settled[lane] {
                improved += 1;
                let own = lane * size..(lane + 1) * size;
                states[own.clone()].copy_from_slice(&trial[own]);
                best[lane] = loss;
                let taken = step.chunks_exact_mut(lanes).zip(steps.chunks_exact(lanes));
                taken.for_each(|(step, taken)| step[lane] = taken[lane]);
                length[lane] = 1.0;
                settled[lane] = still;
            } else {
                // The last step overshot: a quarter of it.
                length[lane] *= 0.25;
                settled[lane] = !best[lane].is_finite() || length[lane] < 1e-3;
            }
            for i in 0..size {
                let part = if settled[lane] { 0.0 } else { length[lane] };
                trial[lane * size + i] = states[lane * size + i] + part * step[i * lanes + lane];
            }
        }
        if settled.iter().all(|&done| done) && improved == lanes {
            // The rows at hand are those of the settled states.
            if by.is_none() || here.is_some() {
                return (rows, Taken { steps: taken, restless: 0 });
            }
            rows.recycle(scratch);
            break;
        }
        rows.recycle(scratch);
        taken += 1;
    }
    let laws = Laws { present, by: by.map(|(law, _)| law) };
    let mut rows = Rows::integrate(problem, laws, block, states, scratch);
    rows.eliminate_states();
    let restless = settled.iter().filter(|&&done| !done).count();
    (rows, Taken { steps: taken, restless })
}

/// Weighted residuals of every segment at settled states, `[segment][observable][sample]`; not a
/// number where nothing was measured, or where the trajectory left the finite numbers.
pub fn residuals(
    problem: &Problem,
    dynamics: &Dynamics,
    theta: &[f64],
    states: &States,
) -> Vec<Vec<Vec<f64>>> {
    let width = width(problem, 2 * dynamics.degrees() + 1);
    blocks(0..problem.segments.list.len(), width)
        .into_par_iter()
        .map_init(KeptScratch::new, |scratch, range| {
            let segments = &problem.segments.list[range.clone()];
            let block = Block::gather(problem.dataset, segments, problem.weights.len());
            let laws = Laws { present: (dynamics, theta), by: None };
            let rows = Rows::integrate(problem, laws, &block, states.part(range), scratch);
            let of = |(lane, segment): (usize, &Segment)| {
                let mut values = rows.residuals(lane, segment.samples());
                let run = &problem.dataset.runs[segment.run];
                for (out, measured) in values.iter_mut().zip(&run.values) {
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
}

impl Linearised {
    /// What the folds left, put together in their order.
    pub(super) fn of(parts: Vec<(Factor, Sums)>, observables: usize) -> Linearised {
        let mut sums = Sums::new(observables);
        let mut folds = Vec::with_capacity(parts.len());
        for (factor, part) in parts {
            sums.add(&part);
            folds.push(factor);
        }
        Linearised { folds, sums }
    }

    /// A pass that was not finished: no rows, an infinite loss.
    pub(super) fn nothing(unknowns: usize, observables: usize) -> Linearised {
        let sums = Sums { loss: f64::INFINITY, ..Sums::new(observables) };
        Linearised { folds: vec![Factor::new(unknowns)], sums }
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
    let starts = problem.segments.folds.iter().map(|fold| states.part(fold.clone())).collect();
    each_fold(problem, dynamics, starts, |part, segments, starts, range, scratch| {
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
    let expected = match is_few(whole.0) {
        true => Some(1),
        false => expected_steps(problem, present, states),
    };
    let size = 2 * present.0.degrees();
    let mut rest = states.all_mut();
    let split = |fold: &Range<usize>| rest.split_off_mut(..fold.len() * size);
    let starts = problem.segments.folds.iter().filter_map(split).collect();
    each_fold(problem, whole.0, starts, |part, segments, starts, range, scratch| {
        let states = &mut starts[range];
        part.steps = part.steps.or(expected);
        part.settle_and_take(problem, present, whole, segments, states, scratch);
    })
}

/// Of few columns a needless try costs less than to look how many steps the states take.
fn is_few(dynamics: &Dynamics) -> bool {
    dynamics.unknowns() <= 4 * dynamics.degrees()
}

/// Steps that the states of a few segments take, for each block to know when rows by theta are
/// worth while; of so few that they cost little beside all.
fn expected_steps(problem: &Problem, present: Law, states: &States) -> Option<usize> {
    const FEW: usize = 16;
    const PART: usize = 32;
    let few = (states.len() / PART).min(FEW);
    if few == 0 {
        return None;
    }
    let segments = &problem.segments.list[..few];
    let block = Block::gather(problem.dataset, segments, problem.weights.len());
    let mut tried = states.part(0..few).to_vec();
    let (_, taken) = settled(problem, present, None, &block, &mut tried, &mut KeptScratch::new());
    Some(taken.steps)
}

/// One pass over every fold, block after block: `take` gets the segments of a block, the states
/// of its fold and the range of the block's own among them.
fn each_fold<S: Send>(
    problem: &Problem,
    dynamics: &Dynamics,
    starts: Vec<S>,
    take: impl Fn(&mut FoldPass, &[Segment], &mut S, Range<usize>, &mut Scratch) + Sync,
) -> Linearised {
    let (unknowns, observables) = (dynamics.unknowns(), problem.weights.len());
    let size = 2 * dynamics.degrees();
    let width = width(problem, size + unknowns + 1);
    let parts: Vec<(Factor, Sums)> = problem
        .segments
        .folds
        .par_iter()
        .zip(starts)
        .map_init(KeptScratch::new, |scratch, (fold, mut starts)| {
            let segments = &problem.segments.list[fold.clone()];
            let mut part = FoldPass::new(unknowns, observables);
            for range in blocks(0..segments.len(), width) {
                let own = range.start * size..range.end * size;
                take(&mut part, &segments[range], &mut starts, own, scratch);
            }
            part.finish()
        })
        .collect();
    Linearised::of(parts, observables)
}

/// What one fold of the data leaves, while its segments go by.
pub(super) struct FoldPass {
    factor: Factor,
    sums: Sums,
    gathered: Gathered,
    touched: Vec<f64>,
    /// Most steps that the states of a block took so far, or are expected to take: those of the
    /// next may take as many.
    steps: Option<usize>,
}

impl FoldPass {
    pub(super) fn new(unknowns: usize, observables: usize) -> FoldPass {
        FoldPass {
            factor: Factor::new(unknowns),
            sums: Sums::new(observables),
            gathered: Gathered::new(unknowns + 1),
            touched: vec![0.0; unknowns],
            steps: None,
        }
    }

    /// Takes a block of segments in, at states that are settled.
    fn take(
        &mut self,
        problem: &Problem,
        law: Law,
        segments: &[Segment],
        states: &[f64],
        scratch: &mut Scratch,
    ) {
        let block = Block::gather(problem.dataset, segments, problem.weights.len());
        let laws = Laws { present: law, by: Some(law) };
        let mut rows = Rows::integrate(problem, laws, &block, states, scratch);
        rows.eliminate_states();
        self.take_rows(rows, scratch);
    }

    /// Settles a block of segments for the present model and takes it in, linearised by another
    /// model of the same motion.
    pub(super) fn settle_and_take(
        &mut self,
        problem: &Problem,
        present: Law,
        by: Law,
        segments: &[Segment],
        states: &mut [f64],
        scratch: &mut Scratch,
    ) {
        let expected = self.steps.or(is_few(by.0).then_some(1));
        let block = Block::gather(problem.dataset, segments, problem.weights.len());
        let (rows, taken) =
            settled(problem, present, Some((by, expected)), &block, states, scratch);
        self.steps = self.steps.max(Some(taken.steps));
        self.sums.restless += taken.restless;
        self.take_rows(rows, scratch);
    }

    fn take_rows(&mut self, rows: Rows, scratch: &mut Scratch) {
        rows.sum_up(&mut self.sums);
        self.gathered.take(&rows, &mut self.factor);
        self.touched.iter_mut().zip(&rows.touched).for_each(|(all, part)| *all += part);
        rows.recycle(scratch);
    }

    /// Brings all rows into the factor, so that none take memory.
    pub(super) fn flush(&mut self) {
        self.gathered.flush(&mut self.factor);
    }

    /// The factor and the sums.
    pub(super) fn finish(mut self) -> (Factor, Sums) {
        self.flush();
        let touched = self.touched;
        self.factor.silence(|k, norm| norm <= ABSORBED * touched[k].sqrt());
        (self.factor, self.sums)
    }
}

fn width(problem: &Problem, columns: usize) -> usize {
    block_width(problem, problem.segments.longest(), columns)
}

/// Segments of at most `samples` samples that are worked on side by side.
pub(super) fn block_width(problem: &Problem, samples: usize, columns: usize) -> usize {
    let lane_bytes = samples * problem.weights.len() * columns * 8;
    let most = if 2 * LANES * lane_bytes <= SMALL_BYTES { 2 * LANES } else { LANES };
    (BLOCK_BYTES / lane_bytes.max(1)).clamp(4, most) / 4 * 4
}
