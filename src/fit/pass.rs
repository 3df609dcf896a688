//! One pass over the data: every segment is integrated, compared with its measurements, and
//! its unknown initial state is eliminated. What is left is one triangular factor.
//!
//! With J_s and J the derivatives of a segment's residuals r by its initial state and by
//! theta, Householder reflections bring `[J_s J r]` to `[R_s * *; 0 J' r']`. The rows `[J' r']`
//! no longer know the state; they are what the factor takes in (variable projection:
//! Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973, in Kaufman's form).

use rayon::prelude::*;

use super::factor::Factor;
use super::gathered::Gathered;
use super::loss::Loss;
use super::rows::Rows;
use super::segments::{Segment, Segments, blocks};
use crate::data::Dataset;
use crate::dynamics::{Dynamics, Method, Scratch};
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
}

/// Segments side by side in one block, at most.
const LANES: usize = 64;
/// Bytes that the rows of one block may take.
const BLOCK_BYTES: usize = 12 << 20;
/// Steps of the inner search for the states.
const STATE_STEPS: usize = 8;
/// States are settled when the next step promises less than this part of the loss.
const SETTLED: f64 = 1e-7;
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
        self.rows += other.rows;
        for (a, b) in self.squares.iter_mut().zip(&other.squares) {
            *a += b;
        }
        for (a, b) in self.freedom.iter_mut().zip(&other.freedom) {
            *a += b;
        }
    }
}

/// The initial state of every segment, in the order of the segments, 2n numbers each.
pub type States = Vec<Vec<f64>>;

/// Improves the states for a theta that is held, and sums up what is left.
///
/// Gauss-Newton for each segment by itself; a step that does not pay is shortened.
pub fn settle(problem: &Problem, dynamics: &Dynamics, theta: &[f64], states: &mut States) -> Sums {
    let width = width(problem, 2 * dynamics.degrees() + dynamics.unknowns() + 1);
    let parts: Vec<(Vec<Vec<f64>>, Sums)> = blocks(0..problem.segments.list.len(), width)
        .into_par_iter()
        .map_init(Scratch::new, |scratch, range| {
            let mut local = states[range.clone()].to_vec();
            let sums = settle_block(
                problem,
                dynamics,
                theta,
                &problem.segments.list[range],
                &mut local,
                scratch,
            );
            (local, sums)
        })
        .collect();
    let mut total = Sums::new(problem.weights.len());
    states.clear();
    for (local, sums) in parts {
        states.extend(local);
        total.add(&sums);
    }
    total
}

fn settle_block(
    problem: &Problem,
    dynamics: &Dynamics,
    theta: &[f64],
    segments: &[Segment],
    states: &mut [Vec<f64>],
    scratch: &mut Scratch,
) -> Sums {
    let size = 2 * dynamics.degrees();
    let lanes = segments.len();
    let mut trial: Vec<Vec<f64>> = states.to_vec();
    let mut best = vec![f64::INFINITY; lanes];
    let mut step = vec![vec![0.0; size]; lanes];
    let mut length = vec![1.0; lanes];
    let mut sums = Sums::new(problem.weights.len());
    let mut settled = vec![false; lanes];
    for _ in 0..STATE_STEPS {
        let mut rows = Rows::integrate(problem, dynamics, theta, segments, &trial, false, scratch);
        rows.eliminate_states();
        let mut improved = 0;
        for lane in 0..lanes {
            let loss = rows.losses[lane];
            if loss < best[lane] || settled[lane] {
                improved += 1;
                states[lane].clone_from(&trial[lane]);
                best[lane] = loss;
                step[lane] = rows.state_step(lane);
                length[lane] = 1.0;
                let rounding = problem.floor.powi(2) * rows.measured[lane] as f64;
                settled[lane] = rows.promised(lane) <= SETTLED * loss + ROUNDING * rounding;
            } else {
                // The last step overshot: a quarter of it.
                length[lane] *= 0.25;
                settled[lane] = !best[lane].is_finite() || length[lane] < 1e-3;
            }
            for i in 0..size {
                let part = if settled[lane] { 0.0 } else { length[lane] };
                trial[lane][i] = states[lane][i] + part * step[lane][i];
            }
        }
        if settled.iter().all(|&done| done) && improved == lanes {
            // The rows at hand are those of the settled states.
            rows.sum_up(&mut sums);
            return sums;
        }
    }
    let mut rows = Rows::integrate(problem, dynamics, theta, segments, states, false, scratch);
    rows.eliminate_states();
    rows.sum_up(&mut sums);
    sums
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
        .map_init(Scratch::new, |scratch, range| {
            let (segments, states) = (&problem.segments.list[range.clone()], &states[range]);
            let rows = Rows::integrate(problem, dynamics, theta, segments, states, false, scratch);
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
    /// All folds together.
    pub fn merged(&self) -> Factor {
        let columns = self.folds.first().map_or(0, Factor::columns);
        let mut all = Factor::new(columns);
        for fold in &self.folds {
            all.merge(fold);
        }
        all
    }
}

/// Linearises the residuals of all segments by theta and eliminates the states.
pub fn linearise(
    problem: &Problem,
    dynamics: &Dynamics,
    theta: &[f64],
    states: &States,
) -> Linearised {
    let unknowns = dynamics.unknowns();
    let size = 2 * dynamics.degrees();
    let width = width(problem, size + unknowns + 1);
    let folds = &problem.segments.folds;
    let parts: Vec<(Factor, Sums)> = folds
        .par_iter()
        .map_init(Scratch::new, |scratch, fold| {
            let mut factor = Factor::new(unknowns);
            let mut sums = Sums::new(problem.weights.len());
            let mut gathered = Gathered::new(unknowns + 1);
            let mut touched = vec![0.0; unknowns];
            for range in blocks(fold.clone(), width) {
                let segments = &problem.segments.list[range.clone()];
                let states = &states[range];
                let mut rows =
                    Rows::integrate(problem, dynamics, theta, segments, states, true, scratch);
                rows.eliminate_states();
                rows.sum_up(&mut sums);
                gathered.take(&rows, &mut factor);
                touched.iter_mut().zip(&rows.touched).for_each(|(all, part)| *all += part);
            }
            gathered.flush(&mut factor);
            factor.silence(|k, norm| norm <= ABSORBED * touched[k].sqrt());
            (factor, sums)
        })
        .collect();
    let mut sums = Sums::new(problem.weights.len());
    let mut factors = Vec::with_capacity(parts.len());
    for (factor, part) in parts {
        sums.add(&part);
        factors.push(factor);
    }
    Linearised { folds: factors, sums }
}

fn width(problem: &Problem, columns: usize) -> usize {
    let samples = problem.segments.list.iter().map(|s| s.samples()).max().unwrap_or(1);
    let lane_bytes = samples * problem.weights.len() * columns * 8;
    (BLOCK_BYTES / lane_bytes.max(1)).clamp(4, LANES) / 4 * 4
}
