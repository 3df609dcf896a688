//! Gauss-Newton for a fixed support: damped, within bounds, states eliminated.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::bounded::solve_bounded;
use super::column::Column;
use super::factor::Factor;
use super::monitor::Monitor;
use super::pass::{Linearised, Problem, Sums, settle_linearise_and_respond};
use super::per_run;
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
                "converged: a further step would change nothing that the data resolve"
            }
            StopReason::NoProgress => "stopped: no step of any length lowered the loss",
            StopReason::IterationLimit => "stopped at the iteration limit",
            StopReason::Interrupted => "interrupted: the best model so far was kept",
        }
    }
}

/// What a step has to promise to be taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastGain {
    /// Part of the loss.
    pub part: f64,
    /// Weighted squares beside that.
    pub squares: f64,
}

impl From<f64> for LeastGain {
    fn from(part: f64) -> LeastGain {
        LeastGain { part, squares: 0.0 }
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

/// Minimises the loss over theta within `bounds` (one for each of theta), from `start`, until a
/// step promises less than the least gain.
///
/// Levenberg's damping is added only after a full step has failed, and grows until one pays. An
/// inner parameter moves by no more than its own size at a step: far from there the linearised
/// problem says nothing about it. The states go with theta at every step, to where they are then
/// expected to be best.
pub fn refit(
    problem: &Problem,
    dynamics: &Dynamics,
    bounds: &[Bounds],
    start: &[f64],
    states: States,
    least: LeastGain,
    monitor: &dyn Monitor,
) -> Refit {
    let tuning = &problem.tuning.refit;
    // A step that is not looked at to its end is not taken, and the point before it stays.
    let halting = Problem { halt: monitor, ..*problem };
    let minimisation = Minimisation { problem, halting: &halting, dynamics };
    let theta: Vec<f64> = start.iter().zip(bounds).map(|(&x, bound)| bound.clamp(x)).collect();
    let mut here = minimisation.first(theta, states);
    let coefficients = dynamics.active().len();
    let mut damping = 0.0;
    let mut iterations = 0;
    loop {
        let stopped = monitor.stopped();
        if stopped || iterations == tuning.iterations || here.theta.is_empty() {
            let stop = match (stopped, here.theta.is_empty()) {
                (true, _) => StopReason::Interrupted,
                (_, true) => StopReason::Converged,
                _ => StopReason::IterationLimit,
            };
            return minimisation.end(here, iterations, stop);
        }
        iterations += 1;
        let mut factor = here.linearised.merged();
        let outcome = loop {
            let theta = &here.theta;
            let near: Vec<Bounds> = (0..theta.len())
                .map(|k| match k < coefficients {
                    true => bounds[k],
                    false => bounds[k].near(theta[k], theta[k].abs().max(start[k].abs())),
                })
                .collect();
            let step = step(&factor, theta, &near, damping);
            if invisible(
                step.promise,
                least,
                &here.linearised.sums,
                (problem.floor, tuning.rounding),
            ) {
                if here.is_rough() {
                    here = minimisation.settled(here);
                    factor = here.linearised.merged();
                    continue;
                }
                break Some(StopReason::Converged);
            }
            let next = minimisation.moved(&here, &step.change);
            let (sums, trial_sums) = (&here.linearised.sums, &next.linearised.sums);
            let sane = trial_sums.diverged <= sums.diverged && trial_sums.loss.is_finite();
            let fewer = trial_sums.diverged < sums.diverged;
            if sane && (fewer || trial_sums.loss < sums.loss) {
                here = next;
                damping = if damping > tuning.least_damping {
                    damping * tuning.less_damping
                } else {
                    0.0
                };
                break None;
            }
            if monitor.stopped() {
                break Some(StopReason::Interrupted);
            }
            damping = (damping * tuning.more_damping).max(tuning.first_damping);
            if damping > tuning.most_damping {
                break Some(StopReason::NoProgress);
            }
        };
        if let Some(stop) = outcome {
            return minimisation.end(here, iterations, stop);
        }
    }
}

/// A point that the search has come to.
struct Point {
    theta: Vec<f64>,
    states: States,
    linearised: Linearised,
}

impl Point {
    /// Whether some states have a last small step to take.
    fn is_rough(&self) -> bool {
        self.linearised.sums.promised > 0.0
    }
}

struct Minimisation<'a> {
    problem: &'a Problem<'a>,
    /// The same, whose passes may end early.
    halting: &'a Problem<'a>,
    dynamics: &'a Dynamics,
}

impl Minimisation<'_> {
    fn first(&self, theta: Vec<f64>, states: States) -> Point {
        self.at(self.problem, theta, states, None, true)
    }

    fn at(
        &self,
        problem: &Problem,
        theta: Vec<f64>,
        mut states: States,
        extrapolated: Option<&States>,
        nearly: bool,
    ) -> Point {
        let law = (self.dynamics, &theta[..]);
        let linearised =
            settle_linearise_and_respond(problem, law, &mut states, extrapolated, nearly);
        Point { theta, states, linearised }
    }

    /// Theta moved by a step, and the states with it.
    fn moved(&self, from: &Point, change: &[f64]) -> Point {
        let theta: Vec<f64> = from.theta.iter().zip(change).map(|(x, d)| x + d).collect();
        self.extrapolated(self.halting, from, theta, change, true)
    }

    /// The same theta, its states settled to the last.
    fn settled(&self, rough: Point) -> Point {
        self.extrapolated(self.problem, &rough, rough.theta.clone(), &[], false)
    }

    /// The states extrapolated to where they are expected to be best after a change of theta.
    fn extrapolated(
        &self,
        problem: &Problem,
        from: &Point,
        theta: Vec<f64>,
        change: &[f64],
        nearly: bool,
    ) -> Point {
        let extrapolated = from.linearised.responses.as_ref().map(|responses| {
            let mut states = from.states.clone();
            responses.follow(&mut states, change);
            states
        });
        let mut states = from.states.clone();
        per_run::follow(self.problem, &from.linearised, &mut states, change);
        self.at(problem, theta, states, extrapolated.as_ref(), nearly)
    }

    fn end(&self, here: Point, iterations: usize, stop: StopReason) -> Refit {
        let unfinished = here.is_rough() && stop != StopReason::Interrupted;
        let here = if unfinished { self.settled(here) } else { here };
        let Point { theta, states, linearised } = here;
        Refit { theta, states, linearised, iterations, stop }
    }
}

/// Whether the data cannot see a step that promises to lower the loss by so much: it is less than
/// the least gain, or than the part `rounding` of the squares of the floor.
pub(super) fn invisible(
    fall: f64,
    least: LeastGain,
    sums: &Sums,
    (floor, rounding): (f64, f64),
) -> bool {
    fall <= least.part * sums.loss + least.squares + rounding * floor.powi(2) * sums.rows as f64
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
        |k: Column| Bounds { lower: bounds[k].lower - theta[k], upper: bounds[k].upper - theta[k] };
    let change = solve_bounded(&damped, shifted).values;
    let before = factor.squares(&DVector::zeros(theta.len()));
    let after = factor.squares(&change);
    Step { change: change.as_slice().to_vec(), promise: before - after }
}
