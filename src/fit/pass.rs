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
use super::segments::{Segment, Segments, blocks};
use crate::data::Dataset;
use crate::dynamics::{Batch, Dynamics, Method, Scratch, advance, observe};
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
    /// State columns and residuals before elimination, `[row][state + 1][lane]`.
    original: Vec<f64>,
    /// What each residual adds to the estimate of the variance, `[row][lane]`.
    scales: Vec<f64>,
    /// Squared norm of each column of theta before elimination.
    touched: Vec<f64>,
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
            original: Vec::new(),
            scales: vec![0.0; samples * observables * lanes],
            touched: vec![0.0; kept],
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
                self.scales[row * lanes + lane] = problem.loss.scale(residual);
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
        for row in self.values.chunks_exact(columns * lanes) {
            self.original.extend_from_slice(&row[..self.state * lanes]);
            self.original.extend_from_slice(&row[(columns - 1) * lanes..]);
            let columns = row[self.state * lanes..].chunks_exact(lanes);
            for (squares, column) in self.touched.iter_mut().zip(columns) {
                *squares += column.iter().map(|x| x * x).sum::<f64>();
            }
        }
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
            let known: f64 = (i + 1..self.state).map(|j| self.at(i, j, lane) * step[j]).sum();
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

    /// Adds losses, squares and degrees of freedom of the lanes; after elimination.
    ///
    /// The leverage of a measured value on the states is |J_row R_s^-1|^2.
    fn sum_up(&self, sums: &mut Sums) {
        let (lanes, state) = (self.lanes, self.state);
        let mut solved = vec![0.0; state];
        for lane in 0..lanes {
            if !self.losses[lane].is_finite() {
                sums.exploded += 1;
                continue;
            }
            sums.loss += self.losses[lane];
            sums.rows += self.independent(lane);
            let norms: Vec<f64> = (0..state.min(self.rows))
                .map(|c| (0..=c).map(|r| self.at(r, c, lane).powi(2)).sum::<f64>().sqrt())
                .collect();
            for (row, values) in self.original.chunks_exact((state + 1) * lanes).enumerate() {
                let residual = values[state * lanes + lane];
                let mut leverage = 0.0;
                let mut measured = residual != 0.0;
                for (c, &norm) in norms.iter().enumerate() {
                    let entry = values[c * lanes + lane];
                    measured |= entry != 0.0;
                    let known: f64 = (0..c).map(|r| self.at(r, c, lane) * solved[r]).sum();
                    let pivot = self.at(c, c, lane);
                    solved[c] =
                        if pivot.abs() > 1e-12 * norm { (entry - known) / pivot } else { 0.0 };
                    leverage += solved[c] * solved[c];
                }
                if measured {
                    let observable = row % self.observables;
                    sums.squares[observable] += self.scales[row * lanes + lane];
                    sums.freedom[observable] += 1.0 - leverage;
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
