//! One pass over the data: every segment is integrated, compared with its measurements, and
//! its unknown initial state is eliminated. What is left is one triangular factor.
//!
//! With J_s and J the derivatives of a segment's residuals r by its initial state and by
//! theta, Householder reflections bring `[J_s J r]` to `[R_s * *; 0 J' r']`. The rows `[J' r']`
//! no longer know the state; they are what the factor takes in (variable projection:
//! Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973, in Kaufman's form).

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::factor::Factor;
use super::loss::Loss;
use super::segments::{Segment, blocks};
use crate::data::Dataset;
use crate::dynamics::{Batch, Dynamics, Method, Scratch, advance, observe};
use crate::expr::Observed;

/// How trajectories are integrated between samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stepping {
    pub method: Method,
    /// No step is longer.
    pub longest: f64,
}

/// What a pass works on.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    pub dataset: &'a Dataset,
    pub segments: &'a [Segment],
    pub observed: Observed,
    /// One over the noise of each observable.
    pub weights: &'a [f64],
    pub loss: Loss,
    pub stepping: Stepping,
}

/// Segments side by side in one block, at most.
const LANES: usize = 64;
/// Bytes that the rows of one block may take.
const BLOCK_BYTES: usize = 12 << 20;
/// Blocks are gathered in at most this many groups, one factor each: the folds of the data.
pub const GROUPS: usize = 16;
/// Steps of the inner search for the states.
const STATE_STEPS: usize = 8;

/// Sums over all segments at the best states for a theta.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sums {
    /// Sum of the loss over all weighted residuals.
    pub loss: f64,
    /// Segments whose trajectory left the finite numbers.
    pub exploded: usize,
    /// Measured values minus what the states take up: the number of independent residuals.
    pub rows: usize,
    /// For each observable, the sum of weighted squares (robust weights included).
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
pub fn settle(
    problem: &Problem,
    dynamics: &Dynamics,
    theta: &[f64],
    states: &mut States,
) -> Sums {
    let width = width(problem, 2 * dynamics.degrees() + dynamics.unknowns() + 1);
    let parts: Vec<(Vec<Vec<f64>>, Sums)> = blocks(problem.segments.len(), width)
        .into_par_iter()
        .map_init(Scratch::new, |scratch, range| {
            let mut local = states[range.clone()].to_vec();
            let sums = settle_block(
                problem,
                dynamics,
                theta,
                &problem.segments[range],
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
    for _ in 0..STATE_STEPS {
        let mut rows = Rows::integrate(problem, dynamics, theta, segments, &trial, false, scratch);
        let losses = rows.losses.clone();
        rows.eliminate_states();
        let mut moving = false;
        for lane in 0..lanes {
            let better = losses[lane] < best[lane];
            if better {
                let fresh = rows.state_step(lane);
                let promised = rows.promised(lane);
                moving |= promised > 1e-9 * losses[lane] && losses[lane] > 1e-28;
                states[lane].clone_from(&trial[lane]);
                best[lane] = losses[lane];
                step[lane] = fresh;
                length[lane] = 1.0;
            } else if best[lane].is_finite() {
                // The last step overshot (or there was none left to take): a quarter of it.
                length[lane] *= 0.25;
            }
            for i in 0..size {
                trial[lane][i] = states[lane][i] + length[lane] * step[lane][i];
            }
        }
        if !moving {
            break;
        }
    }
    let rows = Rows::integrate(problem, dynamics, theta, segments, states, false, scratch);
    rows.sum_up(&mut sums);
    sums
}

/// The problem, linearised at theta and at settled states: unknowns are increments of theta.
pub struct Linearised {
    /// One factor for each fold of the segments.
    pub groups: Vec<Factor>,
    pub sums: Sums,
}

impl Linearised {
    /// All folds together.
    pub fn merged(&self) -> Factor {
        let columns = self.groups.first().map_or(0, Factor::columns);
        let mut all = Factor::new(columns);
        for group in &self.groups {
            all.merge(group);
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
    let all = blocks(problem.segments.len(), width);
    let groups = GROUPS.min(all.len()).max(1);
    // Block b belongs to fold b mod groups: every fold sees all of the data's lengths and runs.
    let parts: Vec<(Factor, Sums)> = (0..groups)
        .into_par_iter()
        .map_init(Scratch::new, |scratch, group| {
            let mut factor = Factor::new(unknowns);
            let mut sums = Sums::new(problem.weights.len());
            let mut gathered = Gathered::new(unknowns + 1);
            for range in all.iter().skip(group).step_by(groups) {
                let segments = &problem.segments[range.clone()];
                let states = &states[range.clone()];
                let mut rows =
                    Rows::integrate(problem, dynamics, theta, segments, states, true, scratch);
                rows.sum_up(&mut sums);
                rows.eliminate_states();
                gathered.take(&rows, &mut factor);
            }
            gathered.flush(&mut factor);
            (factor, sums)
        })
        .collect();
    let mut sums = Sums::new(problem.weights.len());
    let mut factors = Vec::with_capacity(parts.len());
    for (factor, part) in parts {
        sums.add(&part);
        factors.push(factor);
    }
    Linearised { groups: factors, sums }
}

fn width(problem: &Problem, columns: usize) -> usize {
    let samples = problem.segments.iter().map(|s| s.samples()).max().unwrap_or(1);
    let lane_bytes = samples * problem.weights.len() * columns * 8;
    (BLOCK_BYTES / lane_bytes.max(1)).clamp(4, LANES) / 4 * 4
}

/// Weighted residuals and derivatives of a block of segments, `[row][column][lane]`.
///
/// Rows are (sample, observable); columns are the initial state, then theta, then the
/// residual "measured - predicted". What was not measured is a row of zeros.
struct Rows {
    values: Vec<f64>,
    rows: usize,
    columns: usize,
    lanes: usize,
    /// Dimension of the state.
    state: usize,
    /// Loss of each lane; infinite where the trajectory exploded.
    losses: Vec<f64>,
    /// Measured values of each lane.
    measured: Vec<usize>,
    observables: usize,
}

impl Rows {
    fn integrate(
        problem: &Problem,
        dynamics: &Dynamics,
        theta: &[f64],
        segments: &[Segment],
        states: &[Vec<f64>],
        by_theta: bool,
        scratch: &mut Scratch,
    ) -> Rows {
        let (degrees, lanes) = (dynamics.degrees(), segments.len());
        let state = 2 * degrees;
        let observables = problem.weights.len();
        let unknowns = dynamics.unknowns();
        let mut batch = Batch::with_tangents(degrees, lanes, unknowns);
        let kept = if by_theta { unknowns } else { 0 };
        let columns = state + kept + 1;
        let samples = segments.iter().map(|s| s.samples()).max().unwrap_or(0);
        let mut rows = Rows {
            values: vec![0.0; samples * observables * columns * lanes],
            rows: samples * observables,
            columns,
            lanes,
            state,
            losses: vec![0.0; lanes],
            measured: vec![0; lanes],
            observables,
        };
        for (lane, (segment, start)) in segments.iter().zip(states).enumerate() {
            batch.set(lane, problem.dataset.runs[segment.run].times[segment.first], start);
        }
        let mut span = vec![0.0; lanes];
        let mut out = vec![0.0; state * lanes];
        let mut tangent = vec![0.0; state * batch.columns() * lanes];
        for sample in 0..samples {
            if sample > 0 {
                for (lane, segment) in segments.iter().enumerate() {
                    let times = &problem.dataset.runs[segment.run].times;
                    let at = segment.first + sample;
                    span[lane] = if at <= segment.last { times[at] - times[at - 1] } else { 0.0 };
                }
                let longest = span.iter().fold(0.0f64, |m, s| m.max(s.abs()));
                let steps = (longest / problem.stepping.longest * (1.0 - 1e-9)).ceil().max(1.0);
                let method = problem.stepping.method;
                advance(dynamics, method, &mut batch, &span, steps as usize, theta, scratch);
            }
            let observed = problem.observed;
            observe(dynamics, observed, &batch, theta, &mut out, Some(&mut tangent), scratch);
            rows.take(problem, segments, sample, &out, &tangent, batch.columns());
        }
        rows
    }

    /// Takes one sample of every lane in.
    fn take(
        &mut self,
        problem: &Problem,
        segments: &[Segment],
        sample: usize,
        out: &[f64],
        tangent: &[f64],
        tangent_columns: usize,
    ) {
        let lanes = self.lanes;
        let mut scale = vec![0.0; lanes];
        for observable in 0..self.observables {
            let row = sample * self.observables + observable;
            let base = row * self.columns * lanes;
            let last = base + (self.columns - 1) * lanes;
            for (lane, segment) in segments.iter().enumerate() {
                scale[lane] = 0.0;
                let at = segment.first + sample;
                if at > segment.last {
                    continue;
                }
                let measured = problem.dataset.runs[segment.run].values[observable][at];
                if !measured.is_finite() {
                    continue;
                }
                let weight = problem.weights[observable];
                let residual = weight * (measured - out[observable * lanes + lane]);
                self.measured[lane] += 1;
                if !residual.is_finite() {
                    self.losses[lane] = f64::INFINITY;
                    continue;
                }
                let robust = (problem.loss.row().weight)(residual).sqrt();
                self.losses[lane] += (problem.loss.row().value)(residual);
                scale[lane] = weight * robust;
                self.values[last + lane] = residual * robust;
            }
            for column in 0..self.columns - 1 {
                let from = (observable * tangent_columns + column) * lanes;
                let into = base + column * lanes;
                let target = &mut self.values[into..into + lanes];
                for ((t, d), s) in target.iter_mut().zip(&tangent[from..from + lanes]).zip(&scale) {
                    // An exploded lane has NaN derivatives; its weight is zero.
                    *t = if *s == 0.0 { 0.0 } else { d * s };
                }
            }
        }
    }

    fn at(&self, row: usize, column: usize, lane: usize) -> f64 {
        self.values[(row * self.columns + column) * self.lanes + lane]
    }

    /// Takes exploded lanes out: all their rows become zero.
    fn silence(&mut self) {
        let lost: Vec<usize> =
            (0..self.lanes).filter(|&lane| !self.losses[lane].is_finite()).collect();
        if !lost.is_empty() {
            for row in self.values.chunks_exact_mut(self.lanes) {
                lost.iter().for_each(|&lane| row[lane] = 0.0);
            }
        }
    }

    /// Householder reflections, each lane with its own, all lanes at once.
    fn eliminate_states(&mut self) {
        self.silence();
        let (lanes, columns) = (self.lanes, self.columns);
        let mut norm = vec![0.0; lanes];
        let mut factor = vec![0.0; lanes];
        let mut dot = vec![0.0; lanes];
        for pivot in 0..self.state.min(self.rows) {
            let at = |row: usize, column: usize| (row * columns + column) * lanes;
            norm.fill(0.0);
            for row in pivot..self.rows {
                let column = &self.values[at(row, pivot)..][..lanes];
                for (n, x) in norm.iter_mut().zip(column) {
                    *n += x * x;
                }
            }
            // v = (alpha - beta, rest); I - v v' / (norm^2 - alpha beta).
            let head = at(pivot, pivot);
            let mut beta = vec![0.0; lanes];
            for lane in 0..lanes {
                let alpha = self.values[head + lane];
                beta[lane] = -norm[lane].sqrt().copysign(alpha);
                let size = norm[lane] - alpha * beta[lane];
                factor[lane] = if size > 0.0 { 1.0 / size } else { 0.0 };
                self.values[head + lane] = alpha - beta[lane];
            }
            for column in pivot + 1..columns {
                dot.fill(0.0);
                for row in pivot..self.rows {
                    let v = &self.values[at(row, pivot)..][..lanes];
                    let x = &self.values[at(row, column)..][..lanes];
                    for ((d, v), x) in dot.iter_mut().zip(v).zip(x) {
                        *d += v * x;
                    }
                }
                for (d, f) in dot.iter_mut().zip(&factor) {
                    *d *= f;
                }
                for row in pivot..self.rows {
                    let (left, right) = self.values.split_at_mut(at(row, column));
                    let v = &left[at(row, pivot)..][..lanes];
                    for ((x, d), v) in right[..lanes].iter_mut().zip(&dot).zip(v) {
                        *x -= d * v;
                    }
                }
            }
            for row in pivot + 1..self.rows {
                self.values[at(row, pivot)..][..lanes].fill(0.0);
            }
            self.values[head..head + lanes].copy_from_slice(&beta);
        }
    }

    /// The Gauss-Newton step of a lane's state, after elimination, theta held.
    fn state_step(&self, lane: usize) -> Vec<f64> {
        let last = self.columns - 1;
        let mut step = vec![0.0; self.state];
        for i in (0..self.state.min(self.rows)).rev() {
            let pivot = self.at(i, i, lane);
            let norm = (0..=i).map(|row| self.at(row, i, lane).powi(2)).sum::<f64>().sqrt();
            if pivot.abs() <= 1e-12 * norm {
                continue;
            }
            let known: f64 =
                (i + 1..self.state).map(|j| self.at(i, j, lane) * step[j]).sum();
            step[i] = (self.at(i, last, lane) - known) / pivot;
        }
        step
    }

    /// By how much the squares of a lane fall if its state takes the step.
    fn promised(&self, lane: usize) -> f64 {
        let last = self.columns - 1;
        (0..self.state.min(self.rows)).map(|i| self.at(i, last, lane).powi(2)).sum()
    }

    /// Number of states that a lane's measurements determine, after elimination or before.
    fn independent(&self, lane: usize) -> usize {
        self.measured[lane].saturating_sub(self.state)
    }

    /// Adds losses, squares and degrees of freedom of the lanes, before elimination.
    fn sum_up(&self, sums: &mut Sums) {
        let last = self.columns - 1;
        let mut leverage = vec![0.0; self.rows];
        for lane in 0..self.lanes {
            if !self.losses[lane].is_finite() {
                sums.exploded += 1;
                continue;
            }
            sums.loss += self.losses[lane];
            sums.rows += self.independent(lane);
            let design = DMatrix::from_fn(self.rows, self.state, |r, c| self.at(r, c, lane));
            leverage.fill(0.0);
            if self.rows >= self.state {
                let q = design.col_piv_qr();
                let rank = (0..self.state)
                    .filter(|&k| q.r()[(k, k)].abs() > 1e-12 * q.r()[(0, 0)].abs())
                    .count();
                let q = q.q();
                for (row, h) in leverage.iter_mut().enumerate() {
                    *h = (0..rank).map(|k| q[(row, k)].powi(2)).sum();
                }
            }
            for row in 0..self.rows {
                let residual = self.at(row, last, lane);
                let used = (0..self.columns).any(|c| self.at(row, c, lane) != 0.0);
                if used {
                    let observable = row % self.observables;
                    sums.squares[observable] += residual * residual;
                    sums.freedom[observable] += 1.0 - leverage[row];
                }
            }
        }
    }
}

/// Rows on their way into a factor, gathered until a product of matrices pays.
struct Gathered {
    width: usize,
    blocks: Vec<(Vec<f64>, usize)>,
    rows: usize,
    count: usize,
}

impl Gathered {
    fn new(width: usize) -> Gathered {
        Gathered { width, blocks: Vec::new(), rows: 0, count: 0 }
    }

    /// Takes the rows below the eliminated states.
    fn take(&mut self, rows: &Rows, factor: &mut Factor) {
        let kept = rows.rows.saturating_sub(rows.state);
        if kept == 0 {
            return;
        }
        // Column-major within the block: [column][row][lane].
        let mut block = Vec::with_capacity(kept * rows.lanes * self.width);
        for column in rows.state..rows.columns {
            for row in rows.state..rows.rows {
                let at = (row * rows.columns + column) * rows.lanes;
                block.extend_from_slice(&rows.values[at..at + rows.lanes]);
            }
        }
        self.rows += kept * rows.lanes;
        self.count += (0..rows.lanes)
            .filter(|&lane| rows.losses[lane].is_finite())
            .map(|lane| rows.independent(lane))
            .sum::<usize>();
        self.blocks.push((block, kept * rows.lanes));
        if self.rows >= (4 * self.width).max(512) {
            self.flush(factor);
        }
    }

    fn flush(&mut self, factor: &mut Factor) {
        let mut stacked = DMatrix::zeros(self.rows, self.width);
        let mut start = 0;
        for (block, rows) in self.blocks.drain(..) {
            for (column, values) in block.chunks_exact(rows).enumerate() {
                stacked.view_mut((start, column), (rows, 1)).copy_from_slice(values);
            }
            start += rows;
        }
        factor.push(&mut stacked, self.count);
        self.rows = 0;
        self.count = 0;
    }
}
