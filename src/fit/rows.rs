//! Rows of a linearised block: weighted residuals and their derivatives, with the states
//! eliminated.

use std::ops::Range;

use nalgebra::DMatrix;

use super::block::Block;
use super::blocking::BLOCKING;
use super::loss::Loss;
use super::motion::{Motion, Propagation};
use super::pass::{Problem, Sums};
use crate::dynamics::{Dynamics, Scratch, observe};
use crate::eval::{
    Aligned, Compared, InstructionSet, LaneReflections, REGISTER, add_products, add_squares,
    compare, leverages, reflect_lanes, sum_squares, weigh,
};

/// Weighted residuals and derivatives of a block of segments, `[row][column][lane]`.
///
/// Rows are (sample, observable); columns are the initial state, then theta, then the
/// residual "measured - predicted". What was not measured is a row of zeros.
pub(super) struct DesignRows {
    pub(super) values: Aligned,
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) lanes: usize,
    /// Dimension of the state.
    pub(super) state: usize,
    /// Loss of each lane; infinite where the trajectory diverged.
    pub(super) losses: Vec<f64>,
    /// Measured values of each lane.
    pub(super) measured: Vec<usize>,
    observables: usize,
    /// State columns before elimination, `[row][state][lane]`.
    original: Aligned,
    /// What each row was multiplied by, `[row][lane]`; zero where nothing was measured.
    weights: Aligned,
    /// What each residual adds to the estimate of the variance, `[row][lane]`.
    scales: Aligned,
    /// One over the diagonal of R_s after elimination, zero where a state is not determined,
    /// `[state][lane]`.
    inverse: Vec<f64>,
    /// Squared norm of each column of theta before elimination.
    pub(super) touched: Vec<f64>,
    /// Whether the state itself is what is measured. Theta has not moved the first sample then,
    /// and its rows have nothing by theta.
    pub(super) shown: bool,
}

impl DesignRows {
    /// Follows a block of segments from `states`, `[lane][state]`.
    pub(super) fn integrate(
        problem: &Problem,
        propagation: Propagation,
        block: &Block,
        states: &[f64],
        scratch: &mut Scratch,
    ) -> DesignRows {
        let (dynamics, theta) = propagation.by.unwrap_or(propagation.present);
        let (degrees, lanes) = (dynamics.degrees(), block.lanes());
        let state = 2 * degrees;
        let observables = problem.weights.len();
        let kept = if propagation.by.is_some() { dynamics.unknowns() } else { 0 };
        let columns = state + kept + 1;
        let size = block.samples * observables;
        // Every number that is looked at is written by `take` and `eliminate_states`.
        let mut rows = DesignRows {
            values: scratch.lend(size * columns * lanes),
            rows: size,
            columns,
            lanes,
            state,
            losses: vec![0.0; lanes],
            measured: block.counts.clone(),
            observables,
            original: scratch.lend(size * state * lanes),
            weights: scratch.lend(size * lanes),
            scales: scratch.lend(size * lanes),
            inverse: Vec::new(),
            touched: vec![0.0; kept],
            shown: dynamics.shows_state(problem.observed),
        };
        let mut motion = Motion::new(problem, propagation, kept, block, scratch);
        for (lane, (&time, state)) in
            block.starts.iter().zip(states.chunks_exact(state)).enumerate()
        {
            motion.set(lane, time, state);
        }
        let size = if rows.shown { 0 } else { observables * lanes };
        let mut out = vec![0.0; size];
        let mut tangent = scratch.lend(size * (state + kept));
        for sample in 0..block.samples {
            if sample > 0 {
                motion.advance(block.span(sample), scratch);
            }
            motion.drive(block.driving(sample));
            motion.stand(block, sample);
            let batch = &motion.batch;
            if rows.shown {
                rows.take(problem, dynamics, block, sample, &batch.state, &batch.tangent);
                continue;
            }
            let observed = problem.observed;
            observe(dynamics, observed, batch, theta, &mut out, Some(&mut tangent), scratch);
            rows.take(problem, dynamics, block, sample, &out, &tangent);
        }
        scratch.take_back(tangent);
        motion.recycle(scratch);
        rows
    }

    /// Gives the memory back, for other rows.
    pub(super) fn recycle(self, scratch: &mut Scratch) {
        for memory in [self.scales, self.weights, self.original, self.values] {
            scratch.take_back(memory);
        }
    }

    /// Takes one sample of every lane in.
    fn take(
        &mut self,
        problem: &Problem,
        dynamics: &Dynamics,
        block: &Block,
        sample: usize,
        out: &[f64],
        tangent: &[f64],
    ) {
        let lanes = self.lanes;
        let set = InstructionSet::widest();
        for observable in 0..self.observables {
            let row = sample * self.observables + observable;
            let weight = problem.weights[observable];
            let predicted = &out[observable * lanes..][..lanes];
            let values = &mut self.values[row * self.columns * lanes..][..self.columns * lanes];
            let (derivatives, residuals) = values.split_at_mut((self.columns - 1) * lanes);
            let weights = &mut self.weights[row * lanes..][..lanes];
            let scales = &mut self.scales[row * lanes..][..lanes];
            let measured = block.measured(sample, observable);
            let near;
            let measured = match dynamics.period(observable) {
                None => measured,
                Some(period) => {
                    near = nearest_turn(measured, predicted, period);
                    &near[..]
                }
            };
            let precise = block.precisions(sample, observable).map(|precisions| {
                let times = |values: &[f64]| -> Vec<f64> {
                    values.iter().zip(precisions).map(|(x, precision)| x * precision).collect()
                };
                (precisions, times(measured), times(predicted))
            });
            let (measured, predicted) = match &precise {
                Some((_, measured, predicted)) => (&measured[..], &predicted[..]),
                None => (measured, predicted),
            };
            let losses = &mut self.losses[..];
            if problem.loss.is_squares() {
                let out = Compared { residuals, weights, squares: scales, losses };
                compare(set, out, measured, predicted, weight);
            } else {
                let lost = &mut vec![0.0; lanes][..];
                let mut out = Compared { residuals, weights, squares: scales, losses: lost };
                compare(set, out.again(), measured, predicted, weight);
                add_robust(problem.loss, out, losses);
            }
            if let Some((precisions, ..)) = &precise {
                weights.iter_mut().zip(*precisions).for_each(|(weight, by)| *weight *= by);
            }
            let from = &tangent[observable * derivatives.len()..][..derivatives.len()];
            let known = if self.shown && sample == 0 { self.state * lanes } else { from.len() };
            // An diverged lane has NaN derivatives; its weight is zero.
            weigh(set, &mut derivatives[..known], &from[..known], weights);
        }
    }

    fn row(&self, row: usize, column: usize) -> &[f64] {
        &self.row_from(row, column)[..self.lanes]
    }

    /// A row from a column on, `[column][lane]`.
    pub(super) fn row_from(&self, row: usize, column: usize) -> &[f64] {
        let at = row * self.columns;
        &self.values[(at + column) * self.lanes..(at + self.columns) * self.lanes]
    }

    fn at(&self, row: usize, column: usize, lane: usize) -> f64 {
        self.row(row, column)[lane]
    }

    /// Weighted residuals of a lane before elimination, `[observable][sample]`; zero where nothing
    /// was measured.
    pub(super) fn residuals(&self, lane: usize, samples: usize) -> Vec<Vec<f64>> {
        let of = |observable: usize| {
            let row = |sample| sample * self.observables + observable;
            (0..samples).map(|sample| self.at(row(sample), self.columns - 1, lane)).collect()
        };
        (0..self.observables).map(of).collect()
    }

    /// Takes diverged lanes out: all their rows become zero.
    fn zero_lost_lanes(&mut self) {
        let lost: Vec<usize> =
            (0..self.lanes).filter(|&lane| !self.losses[lane].is_finite()).collect();
        if !lost.is_empty() {
            for row in self.values.chunks_exact_mut(self.lanes) {
                lost.iter().for_each(|&lane| row[lane] = 0.0);
            }
        }
    }

    /// Householder reflections, each lane with its own, all lanes at once. Below the diagonal of
    /// the states stands what is left of the reflections: nobody reads it. The first rows by theta
    /// are what the states respond with, if that is `responses`; else they may stay as they were.
    pub(super) fn eliminate_states(&mut self, responses: bool) {
        self.zero_lost_lanes();
        let (lanes, columns) = (self.lanes, self.columns);
        let set = InstructionSet::widest();
        let width = self.state * lanes;
        let rows = self.values.chunks_exact_mut(columns * lanes);
        let first = if self.shown { self.observables } else { 0 };
        for (at, (row, original)) in rows.zip(self.original.chunks_exact_mut(width)).enumerate() {
            original.copy_from_slice(&row[..width]);
            if at >= first {
                add_squares(set, &mut self.touched, &row[width..], lanes);
            } else if responses {
                row[width..(columns - 1) * lanes].fill(0.0);
            }
        }
        // So many lanes at a time that all their rows stay in the cache.
        let lane_bytes = self.rows * columns * size_of::<f64>();
        let part =
            (BLOCKING.elimination_bytes / lane_bytes.max(1)).max(1).next_multiple_of(REGISTER);
        for from in (0..lanes).step_by(part) {
            self.eliminate_among(from..(from + part).min(lanes), first, responses);
        }
        self.inverse = self.inverse_pivots();
    }

    /// The same for some of the lanes. Before row `first`, row k has nothing by states but state k.
    fn eliminate_among(&mut self, among: Range<usize>, first: usize, responses: bool) {
        let (lanes, columns) = (self.lanes, self.columns);
        let set = InstructionSet::widest();
        let pivots = self.state.min(self.rows);
        let stride = columns * lanes;
        let mut diagonal = vec![0.0; pivots * among.len()];
        let mut factors = vec![0.0; pivots * lanes];
        let mut norm = vec![0.0; among.len()];
        for (pivot, diagonal) in diagonal.chunks_exact_mut(among.len()).enumerate() {
            // v = (alpha - beta, rest); I - v v' / (norm^2 - alpha beta).
            let head = pivot * stride + pivot * lanes;
            sum_squares(set, &mut norm, &self.values[head + among.start..], stride);
            let factor = &mut factors[pivot * lanes..][..lanes];
            let heads = &mut self.values[head..][among.clone()];
            let heads = heads.iter_mut().zip(&norm).zip(&mut factor[among.clone()]);
            for (((head, norm), factor), diagonal) in heads.zip(diagonal) {
                let alpha = *head;
                let beta = -norm.sqrt().copysign(alpha);
                let size = norm - alpha * beta;
                *factor = if size > 0.0 { -1.0 / size } else { 0.0 };
                *head = alpha - beta;
                *diagonal = beta;
            }
            let dense = first.saturating_sub(pivot);
            let by = LaneReflections { factors: factor, lanes, columns, dense, heads: true };
            // Without columns by theta the residuals stand next to the states.
            let last = if columns == self.state + 1 { columns } else { self.state };
            reflect_lanes(set, &mut self.values[head..], by, 1..last - pivot, among.clone());
        }
        if columns > self.state + 1 {
            let values = &mut self.values[..];
            let (dense, factors) = (first, &factors[..]);
            let by = LaneReflections { factors, lanes, columns, dense, heads: true };
            reflect_lanes(set, values, by, columns - 1..columns, among.clone());
            let by = LaneReflections { heads: responses || !self.shown, ..by };
            reflect_lanes(set, values, by, self.state..columns - 1, among.clone());
        }
        for (pivot, diagonal) in diagonal.chunks_exact(among.len()).enumerate() {
            let head = pivot * stride + pivot * lanes;
            self.values[head..][among.clone()].copy_from_slice(diagonal);
        }
    }

    /// One over the diagonal of R_s, zero where a state is not determined, `[column][lane]`.
    fn inverse_pivots(&self) -> Vec<f64> {
        let (lanes, set) = (self.lanes, InstructionSet::widest());
        let mut inverse = Vec::with_capacity(self.state * lanes);
        let mut squares = vec![0.0; lanes];
        for c in 0..self.state.min(self.rows) {
            squares.fill(0.0);
            for r in 0..=c {
                let row = self.row(r, c);
                add_products(set, &mut squares, row, row);
            }
            let determined = |(&pivot, &squares): (&f64, &f64)| {
                if pivot * pivot > 1e-24 * squares { 1.0 / pivot } else { 0.0 }
            };
            inverse.extend(self.row(c, c).iter().zip(&squares).map(determined));
        }
        inverse
    }

    /// The Gauss-Newton steps of the states, `[state][lane]`, after elimination, theta held.
    pub(super) fn state_steps(&self) -> Vec<f64> {
        let mut steps = vec![0.0; self.state * self.lanes];
        self.solve(self.columns - 1, &mut steps);
        steps
    }

    /// R_s^-1 times a column, `[state][lane]`, after elimination: the step of the states for that
    /// of the residuals, and for one of theta what they go back by when it grows by one, if
    /// elimination was asked for responses.
    pub(super) fn solve(&self, column: usize, solved: &mut [f64]) {
        let (lanes, set) = (self.lanes, InstructionSet::widest());
        solved.fill(0.0);
        for (i, inverse) in self.inverse.chunks_exact(lanes).enumerate().rev() {
            let (left, known) = solved.split_at_mut((i + 1) * lanes);
            let step = &mut left[i * lanes..];
            for (j, known) in (i + 1..).zip(known.chunks_exact(lanes)) {
                add_products(set, step, self.row(i, j), known);
            }
            let target = self.row(i, column);
            for ((step, target), inverse) in step.iter_mut().zip(target).zip(inverse) {
                *step = (target - *step) * inverse;
            }
        }
    }

    /// By how much the squares of each lane fall if its state takes the step.
    pub(super) fn promised(&self) -> Vec<f64> {
        let mut squares = vec![0.0; self.lanes];
        for i in 0..self.state.min(self.rows) {
            let row = self.row(i, self.columns - 1);
            squares.iter_mut().zip(row).for_each(|(sum, x)| *sum += x * x);
        }
        squares
    }

    /// What elimination leaves of a lane, `[row][theta, residual]`, and the squared norm of each
    /// column of theta before it; after elimination with responses.
    pub(super) fn left_of(&self, lane: usize) -> (DMatrix<f64>, Vec<f64>) {
        let (width, state) = (self.columns - self.state, self.state.min(self.rows));
        let at = |row: usize, column: usize| self.at(row, self.state + column, lane);
        let left = DMatrix::from_fn(self.rows - state, width, |row, k| at(state + row, k));
        let squares = |k: usize| (0..self.rows).map(|row| at(row, k).powi(2)).sum();
        (left, (0..width - 1).map(squares).collect())
    }

    /// Number of states that a lane's measurements determine, after elimination or before.
    pub(super) fn independent(&self, lane: usize) -> usize {
        self.measured[lane].saturating_sub(self.state)
    }

    /// Adds losses, squares and degrees of freedom of all lanes; after elimination.
    pub(super) fn sum_up(&self, sums: &mut Sums) {
        self.sum_up_each(std::slice::from_mut(sums), |_| 0);
    }

    /// The same, to the sums that each lane belongs to.
    ///
    /// The leverage of a measured value on the states is |J_row R_s^-1|^2.
    pub(super) fn sum_up_each(&self, all: &mut [Sums], of: impl Fn(usize) -> usize) {
        let (lanes, state, columns) = (self.lanes, self.state, self.columns);
        let set = InstructionSet::widest();
        for lane in 0..lanes {
            let sums = &mut all[of(lane)];
            if self.losses[lane].is_finite() {
                sums.loss += self.losses[lane];
                sums.rows += self.independent(lane);
            } else {
                sums.diverged += 1;
            }
        }
        let inverse = &self.inverse;
        let mut solved = vec![0.0; state * lanes];
        let mut leverage = vec![0.0; lanes];
        for (row, derivatives) in self.original.chunks_exact(state * lanes).enumerate() {
            let determined = &derivatives[..inverse.len()];
            leverages(set, &mut leverage, &mut solved, determined, &self.values, inverse, columns);
            let observable = row % self.observables;
            let scales = &self.scales[row * lanes..][..lanes];
            let weights = &self.weights[row * lanes..][..lanes];
            for lane in 0..lanes {
                if weights[lane] != 0.0 && self.losses[lane].is_finite() {
                    let sums = &mut all[of(lane)];
                    sums.squares[observable] += scales[lane];
                    sums.freedom[observable] += 1.0 - leverage[lane];
                }
            }
        }
    }
}

/// What was measured of an angle, the whole turns of which are lost, in the turn that is nearest to
/// the predicted one.
fn nearest_turn(measured: &[f64], predicted: &[f64], period: f64) -> Vec<f64> {
    let near = |(measured, predicted): (&f64, &f64)| {
        let turns = ((predicted - measured) / period).round();
        // A lane that is lost is no turn away from anything.
        if turns.is_finite() { measured + period * turns } else { *measured }
    };
    measured.iter().zip(predicted).map(near).collect()
}

/// What a robust loss makes of squares: each residual and its weight shrink, and the residual
/// costs less.
fn add_robust(loss: Loss, compared: Compared, losses: &mut [f64]) {
    let row = loss.row();
    let Compared { residuals, weights, squares: scales, losses: of_squares } = compared;
    for lane in 0..losses.len() {
        let residual = residuals[lane];
        if weights[lane] == 0.0 {
            // Nothing was measured, or the lane is lost.
            losses[lane] += of_squares[lane];
            continue;
        }
        let robust = (row.weight)(residual).sqrt();
        losses[lane] += (row.value)(residual);
        scales[lane] = loss.scale(residual);
        weights[lane] *= robust;
        residuals[lane] *= robust;
    }
}
