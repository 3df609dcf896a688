//! Gauss-Newton for a fixed support: damped, within bounds, states eliminated.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::bounded::solve_bounded;
use super::factor::Factor;
use super::monitor::Monitor;
use super::pass::{Linearised, Problem, Sums, settle_and_linearise};
use super::states::States;
use crate::dynamics::Dynamics;
use crate::expr::Bounds;

/// Why an iteration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// The next step would change nothing that the data can see.
    Converged,
    /// No step of any length lowered the loss.
    NoProgress,
    /// The allowed number of iterations was used up.
    IterationLimit,
    /// Ctrl-C; the best so far was kept.
    Interrupted,
}

impl StopReason {
    /// A sentence for people.
    pub fn sentence(self) -> &'static str {
        match self {
            StopReason::Converged => {
                "converged: a further step would change nothing the data can see"
            }
            StopReason::NoProgress => "stopped: no step of any length lowered the loss",
            StopReason::IterationLimit => "stopped at the iteration limit",
            StopReason::Interrupted => "interrupted: the best model so far was kept",
        }
    }
}

/// The best theta of one support.
pub struct Refit {
    /// Coefficients of the support, then the inner parameters that it uses.
    pub theta: Vec<f64>,
    /// Initial states of the segments, settled at `theta`.
    pub states: States,
    /// The problem linearised at `theta`.
    pub linearised: Linearised,
    /// Gauss-Newton iterations that were taken.
    pub iterations: usize,
    /// Why they ended.
    pub stop: StopReason,
}

impl Refit {
    /// Sums over all segments at `theta`.
    pub fn sums(&self) -> &Sums {
        &self.linearised.sums
    }
}

const ITERATIONS: usize = 40;
/// Converged when a step promises less than this part of the loss.
pub const CONVERGED: f64 = 1e-9;

/// Minimises the loss over theta within `bounds` (one for each of theta), from `start`, until a
/// step promises less than the part `promise` of it.
///
/// Levenberg's damping is added only after a full step has failed, and grows until one pays. An
/// inner parameter moves by no more than its own size at a step: far from there the linearised
/// problem says nothing about it.
pub fn refit(
    problem: &Problem,
    dynamics: &Dynamics,
    bounds: &[Bounds],
    start: &[f64],
    mut states: States,
    promise: f64,
    monitor: &dyn Monitor,
) -> Refit {
    let mut theta: Vec<f64> = start.iter().zip(bounds).map(|(&x, bound)| bound.clamp(x)).collect();
    let at = |theta: &[f64], states: &mut States| {
        settle_and_linearise(problem, (dynamics, theta), (dynamics, theta), states)
    };
    let mut linearised = at(&theta, &mut states);
    let coefficients = dynamics.active().len();
    let mut trial_states = States::default();
    let mut damping = 0.0;
    let mut iterations = 0;
    loop {
        let stopped = monitor.stopped();
        if stopped || iterations == ITERATIONS || theta.is_empty() {
            let stop = match (stopped, theta.is_empty()) {
                (true, _) => StopReason::Interrupted,
                (_, true) => StopReason::Converged,
                _ => StopReason::IterationLimit,
            };
            return Refit { theta, states, linearised, iterations, stop };
        }
        iterations += 1;
        let factor = linearised.merged();
        let outcome = loop {
            let near: Vec<Bounds> = (0..theta.len())
                .map(|k| match k < coefficients {
                    true => bounds[k],
                    false => bounds[k].near(theta[k], theta[k].abs().max(start[k].abs())),
                })
                .collect();
            let step = step(&factor, &theta, &near, damping);
            let sums = &linearised.sums;
            if invisible(step.promise, promise, sums, problem.floor) {
                break Some(StopReason::Converged);
            }
            let trial: Vec<f64> = theta.iter().zip(&step.change).map(|(x, d)| x + d).collect();
            trial_states.clone_from(&states);
            let next = at(&trial, &mut trial_states);
            let (sums, trial_sums) = (&linearised.sums, &next.sums);
            let sane = trial_sums.exploded <= sums.exploded && trial_sums.loss.is_finite();
            let fewer = trial_sums.exploded < sums.exploded;
            if sane && (fewer || trial_sums.loss < sums.loss) {
                theta = trial;
                std::mem::swap(&mut states, &mut trial_states);
                linearised = next;
                damping = if damping > 1e-6 { damping * 0.1 } else { 0.0 };
                break None;
            }
            if monitor.stopped() {
                break Some(StopReason::Interrupted);
            }
            damping = (damping * 10.0).max(1e-4);
            if damping > 1e8 {
                break Some(StopReason::NoProgress);
            }
        };
        if let Some(stop) = outcome {
            return Refit { theta, states, linearised, iterations, stop };
        }
    }
}

/// Whether the data cannot see a step that promises to lower the loss by so much: it is less than
/// the part `promise` of it, or less than rounding.
pub(super) fn invisible(fall: f64, promise: f64, sums: &Sums, floor: f64) -> bool {
    fall <= promise * sums.loss + 1e-3 * floor.powi(2) * sums.rows as f64
}

struct Step {
    change: Vec<f64>,
    /// How much the linearised loss falls.
    promise: f64,
}

/// `min |J d - r|^2 + damping |norm d|^2` with theta + d within bounds.
fn step(factor: &Factor, theta: &[f64], bounds: &[Bounds], damping: f64) -> Step {
    let mut damped = factor.clone();
    if damping > 0.0 {
        let norms = factor.norms();
        let mut rows = nalgebra::DMatrix::zeros(norms.len(), norms.len() + 1);
        for (k, norm) in norms.iter().enumerate() {
            rows[(k, k)] = damping.sqrt() * norm.max(f64::MIN_POSITIVE);
        }
        damped.push(&rows, 0);
    }
    let shifted =
        |k: usize| Bounds { lower: bounds[k].lower - theta[k], upper: bounds[k].upper - theta[k] };
    let change = solve_bounded(&damped, shifted).values;
    let before = factor.squares(&DVector::zeros(theta.len()));
    let after = factor.squares(&change);
    Step { change: change.as_slice().to_vec(), promise: before - after }
}
