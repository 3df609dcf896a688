//! Implicit Runge-Kutta steps: Newton's method for the stages, tangents by the implicit
//! function theorem.
//!
//! The unknowns of a step are k_i = h f(Y_i, t + c_i h) with Y_i = z + sum_j a_ij k_j. With
//! M = d(k - h f)/dk, the tangent of the step is 1 + sum_i W_i h J_i by z, and sum_i W_i h m_i
//! by theta, where W = (b_1 1 .. b_s 1) M^-1, J = df/dz and m = df/dtheta.

use nalgebra::{DMatrix, DVector};

use super::batch::{Batch, Scratch};
use super::equations::Dynamics;
use super::explicit::{add_parts, combined, set_stage};
use super::flow::Flow;
use super::methods::Tableau;
use super::splitting::rescale;

/// More iterations than Newton's method takes from any start that it can finish from.
const ITERATIONS: usize = 40;
/// Full steps; those after them are averaged.
const FULL: usize = 12;
/// Turns to and fro among the averaged steps that tell a jump from a search without an end.
const TURNS: usize = 2;
/// Relative update below which an update that does not shrink any more is rounding.
const NEARLY_SOLVED: f64 = 1e-7;

/// Advances a batch; `scratch.step` holds the step of each lane. `record` sees the
/// state before every step. A lane whose stage equations
/// cannot be solved becomes NaN.
pub(super) fn advance(
    dynamics: &Dynamics,
    tableau: &Tableau,
    batch: &mut Batch,
    steps: usize,
    theta: &[f64],
    scratch: &mut Scratch,
    record: &mut dyn FnMut(&[f64]),
) {
    let start = batch.time.clone();
    let mut stages = Stages::new(dynamics, tableau, batch.lanes);
    for step in 0..steps {
        record(&batch.state);
        stages.solve(&batch.state, &start, step as f64, theta, scratch);
        if batch.has_tangents() {
            stages.evaluate(&batch.state, &start, step as f64, theta, scratch);
            stages.push(batch);
        }
        add_parts(&mut batch.state, tableau.weights, &stages.slopes);
    }
}

/// The stages of one step, all lanes at once.
pub(super) struct Stages<'a> {
    field: &'a Flow,
    tableau: &'a Tableau,
    lanes: usize,
    /// k, `[stage][2n * lanes]`.
    pub slopes: Vec<Vec<f64>>,
    /// h f, h J and h m at each stage, `[stage][output * lanes]`.
    pub outputs: Vec<Vec<f64>>,
}

impl<'a> Stages<'a> {
    pub(super) fn new(dynamics: &'a Dynamics, tableau: &'a Tableau, lanes: usize) -> Stages<'a> {
        let field = dynamics.field();
        let count = tableau.weights.len();
        Stages {
            field,
            tableau,
            lanes,
            slopes: vec![vec![0.0; field.rows * lanes]; count],
            outputs: vec![vec![0.0; field.outputs() * lanes]; count],
        }
    }

    /// Values and derivatives at the present stages of the step that begins `step` steps from
    /// `start`.
    pub(super) fn evaluate(
        &mut self,
        state: &[f64],
        start: &[f64],
        step: f64,
        theta: &[f64],
        scratch: &mut Scratch,
    ) {
        let count = self.slopes.len();
        let mut place = vec![0.0; state.len()];
        for (stage, output) in self.outputs.iter_mut().enumerate() {
            let row = &self.tableau.matrix[stage * count..(stage + 1) * count];
            let at = combined(&mut place, state, row, &self.slopes);
            set_stage(scratch, start, step + self.tableau.nodes[stage]);
            self.field.evaluate(at, self.lanes, theta, true, scratch);
            let size = output.len();
            output.copy_from_slice(&scratch.out[..size]);
            rescale(output, &scratch.scale);
        }
    }

    /// The slopes of explicit stages, one after the other; the outputs are then current.
    pub(super) fn unroll(
        &mut self,
        state: &[f64],
        start: &[f64],
        step: f64,
        theta: &[f64],
        scratch: &mut Scratch,
    ) {
        self.slopes.iter_mut().for_each(|slope| slope.fill(0.0));
        // After i evaluations the first i slopes are right.
        for stage in 0..self.slopes.len() {
            self.evaluate(state, start, step, theta, scratch);
            let size = self.slopes[stage].len();
            self.slopes[stage].copy_from_slice(&self.outputs[stage][..size]);
        }
    }

    /// Solves for the slopes.
    ///
    /// Where the force jumps, as that of dry friction that holds, Newton's method goes to and
    /// fro across the jump. The mean of its iterates then tends to the slopes at the jump (the
    /// sliding solution of Filippov, Differential Equations with Discontinuous Righthand Sides,
    /// 1988, chapter 2), up to a part of one step's change.
    pub(super) fn solve(
        &mut self,
        state: &[f64],
        start: &[f64],
        step: f64,
        theta: &[f64],
        scratch: &mut Scratch,
    ) {
        let (lanes, rows) = (self.lanes, self.field.rows);
        self.slopes.iter_mut().for_each(|slope| slope.fill(0.0));
        let mut size = vec![f64::INFINITY; lanes];
        let mut solved = vec![false; lanes];
        let mut turns = vec![0; lanes];
        let mut last: Vec<Option<DVector<f64>>> = vec![None; lanes];
        for iteration in 0..ITERATIONS {
            let part = 1.0 / (iteration.saturating_sub(FULL) + 1) as f64;
            self.evaluate(state, start, step, theta, scratch);
            for lane in (0..lanes).filter(|&lane| !solved[lane]).collect::<Vec<_>>() {
                let residual = self.residual(lane);
                let update = self.matrix(lane).lu().solve(&residual);
                let Some(update) = update.filter(|u| u.iter().all(|x| x.is_finite())) else {
                    self.slopes.iter_mut().for_each(|s| s[lane] = f64::NAN);
                    solved[lane] = true;
                    continue;
                };
                let mut relative: f64 = 0.0;
                for (i, change) in update.iter().enumerate() {
                    let (stage, row) = (i / rows, i % rows);
                    let slope = &mut self.slopes[stage][row * lanes + lane];
                    *slope -= part * change;
                    let scale = slope.abs() + state[row * lanes + lane].abs();
                    if *change != 0.0 {
                        relative = relative.max(change.abs() / scale);
                    }
                }
                if iteration >= FULL {
                    let back = |last: &DVector<f64>| last.dot(&update) < 0.0;
                    turns[lane] += usize::from(last[lane].as_ref().is_some_and(back));
                    last[lane] = Some(update);
                }
                let stalled = relative >= 0.5 * size[lane] && relative < NEARLY_SOLVED;
                solved[lane] = relative <= f64::EPSILON || stalled;
                size[lane] = relative;
            }
            if solved.iter().all(|&solved| solved) {
                return;
            }
        }
        for lane in (0..lanes).filter(|&lane| !solved[lane] && turns[lane] < TURNS) {
            self.slopes.iter_mut().for_each(|s| s[lane] = f64::NAN);
        }
    }

    /// k - h f of one lane.
    fn residual(&self, lane: usize) -> DVector<f64> {
        let (lanes, rows) = (self.lanes, self.field.rows);
        DVector::from_fn(self.slopes.len() * rows, |i, _| {
            let at = (i % rows) * lanes + lane;
            self.slopes[i / rows][at] - self.outputs[i / rows][at]
        })
    }

    /// M of one lane.
    fn matrix(&self, lane: usize) -> DMatrix<f64> {
        let (lanes, rows, count) = (self.lanes, self.field.rows, self.slopes.len());
        let mut matrix = DMatrix::identity(count * rows, count * rows);
        for (stage, output) in self.outputs.iter().enumerate() {
            for (entry, &(row, column)) in self.field.jacobian.iter().enumerate() {
                let slope = output[(rows + entry) * lanes + lane];
                for other in 0..count {
                    let factor = self.tableau.matrix[stage * count + other];
                    matrix[(stage * rows + row, other * rows + column)] -= factor * slope;
                }
            }
        }
        matrix
    }

    /// W^T v of one lane for the columns v of `of`, `[2n][any]`; `None` where M is singular.
    fn weigh(&self, lane: usize, of: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let rows = self.field.rows;
        let right = DMatrix::from_fn(self.slopes.len() * rows, of.ncols(), |i, j| {
            self.tableau.weights[i / rows] * of[(i % rows, j)]
        });
        self.matrix(lane).transpose().lu().solve(&right)
    }

    /// Multiplies the tangents by the Jacobian of the step; the outputs must be current.
    fn push(&self, batch: &mut Batch) {
        let (lanes, rows, columns) = (self.lanes, self.field.rows, batch.columns());
        let identity = DMatrix::identity(rows, rows);
        // W as `[stage][from][to][lane]` and the Jacobian of the step as `[to][from][lane]`.
        let mut weights = vec![f64::NAN; self.slopes.len() * rows * rows * lanes];
        let mut jacobian = vec![0.0; rows * rows * lanes];
        for lane in 0..lanes {
            let Some(w) = self.weigh(lane, &identity) else { continue };
            for i in 0..self.slopes.len() * rows {
                for to in 0..rows {
                    weights[(i * rows + to) * lanes + lane] = w[(i, to)];
                }
            }
        }
        for (output, weights) in self.outputs.iter().zip(weights.chunks(rows * rows * lanes)) {
            let entries = output[rows * lanes..].chunks_exact(lanes);
            for (&(row, column), entry) in self.field.jacobian.iter().zip(entries) {
                for to in 0..rows {
                    let weight = &weights[(row * rows + to) * lanes..][..lanes];
                    add_product(&mut jacobian[(to * rows + column) * lanes..], weight, entry);
                }
            }
        }
        let old = batch.tangent.clone();
        for to in 0..rows {
            for from in 0..rows {
                let factor = &jacobian[(to * rows + from) * lanes..][..lanes];
                let target = &mut batch.tangent[to * columns * lanes..][..columns * lanes];
                let source = &old[from * columns * lanes..][..columns * lanes];
                for (t, s) in target.chunks_exact_mut(lanes).zip(source.chunks_exact(lanes)) {
                    add_product(t, s, factor);
                }
            }
        }
        if columns == rows {
            return;
        }
        for (output, weights) in self.outputs.iter().zip(weights.chunks(rows * rows * lanes)) {
            let entries = output[(rows + self.field.jacobian.len()) * lanes..].chunks_exact(lanes);
            for (&(row, unknown), entry) in self.field.mixed.iter().zip(entries) {
                for to in 0..rows {
                    let weight = &weights[(row * rows + to) * lanes..][..lanes];
                    let into = (to * columns + rows + unknown) * lanes;
                    add_product(&mut batch.tangent[into..], weight, entry);
                }
            }
        }
    }

    /// The cotangents of the slopes' functions h f, W^T cotangent, `[stage][2n * lanes]`; NaN
    /// where M is singular. The outputs must be current.
    pub(super) fn pull(&self, cotangent: &[f64]) -> Vec<Vec<f64>> {
        let (lanes, rows) = (self.lanes, self.field.rows);
        let mut out = vec![vec![f64::NAN; rows * lanes]; self.slopes.len()];
        for lane in 0..lanes {
            let of = DMatrix::from_fn(rows, 1, |row, _| cotangent[row * lanes + lane]);
            let Some(weighed) = self.weigh(lane, &of) else { continue };
            for (i, value) in weighed.iter().enumerate() {
                out[i / rows][(i % rows) * lanes + lane] = *value;
            }
        }
        out
    }
}

/// target += a * b, lane by lane.
fn add_product(target: &mut [f64], a: &[f64], b: &[f64]) {
    for ((t, a), b) in target.iter_mut().zip(a).zip(b) {
        *t += a * b;
    }
}
