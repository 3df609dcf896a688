//! Gradients by the reverse sweep: vector times Jacobian of the discrete map.
//!
//! The cost does not grow with the number of unknowns, apart from the sparse mixed derivatives.

use super::batch::{Batch, Scratch};
use super::drive::Drive;
use super::equations::Dynamics;
use super::implicit::Stages;
use super::integrate::advance_recording;
use super::methods::{Method, MethodKind, Tableau};
use super::splitting::{rescale, stages};
use crate::expr::Observed;

/// A forward pass with all that its reverse sweep needs.
#[derive(Debug, Clone)]
pub struct Recording {
    method: Method,
    steps: usize,
    lanes: usize,
    /// Times at the start, `[lanes]`.
    start: Vec<f64>,
    /// What inputs do from there on.
    drive: Drive,
    /// Step of each lane, `[lanes]`.
    step: Vec<f64>,
    /// States before every stage of a splitting, or every step otherwise, `[2n][lanes]` each.
    states: Vec<Vec<f64>>,
    /// Lanes that left the finite numbers.
    lost: Vec<bool>,
}

impl Recording {
    /// Advances `batch` as [`advance`](super::advance) does, and keeps the states on the way.
    /// Tangents that the batch may carry are advanced too, at their usual cost.
    pub fn advance(
        dynamics: &Dynamics,
        method: Method,
        batch: &mut Batch,
        span: &[f64],
        steps: usize,
        theta: &[f64],
        scratch: &mut Scratch,
    ) -> Recording {
        let (start, drive) = (batch.time.clone(), batch.drive.clone());
        let mut states = Vec::new();
        let mut record = |state: &[f64]| states.push(state.to_vec());
        advance_recording(dynamics, method, batch, span, steps, theta, scratch, Some(&mut record));
        Recording {
            method,
            steps,
            lanes: batch.lanes,
            start,
            drive,
            step: span.iter().map(|span| span / steps as f64).collect(),
            states,
            lost: (0..batch.lanes).map(|lane| !batch.is_finite(lane)).collect(),
        }
    }

    /// Takes the cotangent at the end, `[2n][lanes]`, to the cotangent at the start, in place,
    /// and adds the gradient by theta, summed over the lanes in order, to `gradient`, `[P]`.
    ///
    /// A lane that left the finite numbers adds nothing, and its cotangent becomes 0.
    pub fn pull_back(
        &self,
        dynamics: &Dynamics,
        theta: &[f64],
        cotangent: &mut [f64],
        gradient: &mut [f64],
        scratch: &mut Scratch,
    ) {
        self.clear_lost(cotangent);
        scratch.step.clone_from(&self.step);
        scratch.drive.clone_from(&self.drive);
        match &self.method.row().kind {
            MethodKind::Splitting(gammas) => {
                if dynamics.separable() {
                    self.sweep(dynamics, gammas, theta, cotangent, gradient, scratch);
                }
            }
            MethodKind::Implicit(tableau) | MethodKind::Explicit(tableau) => {
                self.sweep_stages(dynamics, tableau, theta, cotangent, gradient, scratch);
            }
        }
        self.clear_lost(cotangent);
    }

    fn clear_lost(&self, cotangent: &mut [f64]) {
        for row in cotangent.chunks_exact_mut(self.lanes.max(1)) {
            for (value, &lost) in row.iter_mut().zip(&self.lost) {
                if lost {
                    *value = 0.0;
                }
            }
        }
    }

    fn sweep(
        &self,
        dynamics: &Dynamics,
        gammas: &[f64],
        theta: &[f64],
        cotangent: &mut [f64],
        gradient: &mut [f64],
        scratch: &mut Scratch,
    ) {
        let lanes = self.lanes;
        let all: Vec<_> = stages(gammas, self.steps).collect();
        for (stage, state) in all.iter().zip(&self.states).rev() {
            let flow = if stage.drift { dynamics.drift() } else { dynamics.kick() };
            stage.prepare(&self.start, true, scratch);
            flow.evaluate(state, lanes, theta, true, scratch);
            let entries = &mut scratch.out[flow.rows * lanes..flow.outputs() * lanes];
            rescale(entries, &scratch.scale);
            let (q, p) = cotangent.split_at_mut(dynamics.degrees() * lanes);
            let (target, source) = if stage.drift { (&*q, p) } else { (&*p, q) };
            flow.pull(target, source, entries, gradient, lanes);
        }
    }

    fn sweep_stages(
        &self,
        dynamics: &Dynamics,
        tableau: &Tableau,
        theta: &[f64],
        cotangent: &mut [f64],
        gradient: &mut [f64],
        scratch: &mut Scratch,
    ) {
        let (lanes, field) = (self.lanes, dynamics.field());
        let count = tableau.weights.len();
        let mut stages = Stages::new(dynamics, tableau, lanes);
        for (step, state) in self.states.iter().enumerate().rev() {
            let at = step as f64;
            let weighed = if tableau.is_explicit() {
                stages.unroll(state, &self.start, at, theta, scratch);
                // mu_i = b_i lambda + sum over later j of a_ji (h J_j)^T mu_j.
                let mut weighed: Vec<Vec<f64>> = tableau
                    .weights
                    .iter()
                    .map(|b| cotangent.iter().map(|value| b * value).collect())
                    .collect();
                for j in (1..count).rev() {
                    let mut pulled = vec![0.0; cotangent.len()];
                    let entries = &stages.outputs[j][field.rows * lanes..];
                    field.pull(
                        &weighed[j],
                        &mut pulled,
                        entries,
                        &mut vec![0.0; theta.len()],
                        lanes,
                    );
                    for (i, weighed) in weighed.iter_mut().enumerate().take(j) {
                        let factor = tableau.matrix[j * count + i];
                        if factor != 0.0 {
                            weighed.iter_mut().zip(&pulled).for_each(|(w, x)| *w += factor * x);
                        }
                    }
                }
                weighed
            } else {
                stages.solve(state, &self.start, at, theta, scratch);
                stages.evaluate(state, &self.start, at, theta, scratch);
                stages.pull(cotangent)
            };
            for (output, weighed) in stages.outputs.iter().zip(&weighed) {
                field.pull(weighed, cotangent, &output[field.rows * lanes..], gradient, lanes);
            }
        }
    }
}

/// A gradient, and the cotangent where the trajectories start.
#[derive(Debug, Clone, PartialEq)]
pub struct PulledBack {
    /// d loss / d theta, `[P]`, summed over the lanes in order.
    pub gradient: Vec<f64>,
    /// d loss / d initial state, `[2n][lanes]`.
    pub cotangent: Vec<f64>,
}

/// Takes `cotangent`, d loss / d state at the end, `[2n][lanes]`, back to the start: the
/// transpose of the tangents of [`advance`](super::advance). See [`Recording`] to keep the
/// forward pass from which the loss was computed.
#[allow(clippy::too_many_arguments)]
pub fn pull_back(
    dynamics: &Dynamics,
    method: Method,
    start: &Batch,
    span: &[f64],
    steps: usize,
    theta: &[f64],
    cotangent: &[f64],
    scratch: &mut Scratch,
) -> PulledBack {
    let mut batch = Batch::new(dynamics.degrees(), start.lanes);
    batch.state.clone_from(&start.state);
    batch.time.clone_from(&start.time);
    batch.drive.clone_from(&start.drive);
    let recording = Recording::advance(dynamics, method, &mut batch, span, steps, theta, scratch);
    let mut out =
        PulledBack { gradient: vec![0.0; dynamics.unknowns()], cotangent: cotangent.to_vec() };
    recording.pull_back(dynamics, theta, &mut out.cotangent, &mut out.gradient, scratch);
    out
}

/// The transpose of `observe`: takes d loss / d observables, `[2n][lanes]`,
/// to d loss / d state in place, and adds the direct dependence on theta to `gradient`, `[P]`.
pub fn pull_back_observed(
    dynamics: &Dynamics,
    observed: Observed,
    batch: &Batch,
    theta: &[f64],
    cotangent: &mut [f64],
    gradient: &mut [f64],
    scratch: &mut Scratch,
) {
    let (lanes, degrees) = (batch.lanes, dynamics.degrees());
    let observables = cotangent.to_vec();
    if observed == Observed::Velocities {
        let flow = dynamics.drift();
        scratch.stand_at(batch);
        flow.evaluate(&batch.state, lanes, theta, true, scratch);
        let entries = &scratch.out[flow.rows * lanes..flow.outputs() * lanes];
        cotangent[degrees * lanes..].fill(0.0);
        let source = &mut cotangent[flow.inputs.start * lanes..];
        flow.pull(&observables[degrees * lanes..], source, entries, gradient, lanes);
    }
    if let Some(instrument) = dynamics.instrument() {
        scratch.stand_at(batch);
        instrument.evaluate(&batch.state, lanes, theta, true, scratch);
        let entries = &scratch.out[instrument.rows * lanes..instrument.outputs() * lanes];
        instrument.pull(&observables, cotangent, entries, gradient, lanes);
    }
}
