//! What may be asked of the next run, and the answer.

use serde::Serialize;

use crate::simulate::Interval;

/// What the new run is for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Goal {
    /// To distinguish the rivals.
    Rivals,
    /// To measure a coefficient or inner parameter of the only model: the one named, or the one
    /// with the largest relative standard error.
    Coefficient(Option<String>),
}

/// What the new run may be. What is left open is taken from the measurements so far.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Allowed {
    /// Where each component of the state (q, then p) may start.
    pub start: Vec<Option<Interval>>,
    /// What each component may not leave as long as the run lasts.
    pub motion: Vec<Option<Interval>>,
    /// Time of the first sample.
    pub from: Option<f64>,
    /// Times from the first to the last sample that are tried.
    pub durations: Vec<f64>,
    /// Times between samples that are tried.
    pub steps: Vec<f64>,
}

/// The next run worth measuring, and how it was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Plan {
    /// The rivals, with what the measurements so far say about them; empty for a coefficient.
    pub rivals: Vec<Standing>,
    /// The coefficient that is to be measured.
    pub coefficient: Option<Sought>,
    /// The run to make.
    pub best: Proposal,
    /// Others that would do, the best first.
    pub alternatives: Vec<Proposal>,
    /// What a repeat of an earlier run would bring, on average over them.
    pub repeat: Option<Expected>,
    /// Pairs of rivals that no run within the bounds distinguishes: if the first is true, the
    /// second explains all that could be seen.
    pub indistinguishable: Vec<(String, String)>,
    /// Where a run may start.
    pub start_bounds: Vec<Bound>,
    /// What the motion may not leave.
    pub motion_bounds: Vec<Bound>,
    /// Runs that were tried.
    pub evaluated: usize,
    /// Why the search ended, in a sentence.
    pub stop: String,
}

/// A rival before the new run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Standing {
    /// `viscous_drag(theta)`.
    pub effect: String,
    /// The statement that adds it to the spec.
    pub snippet: String,
    /// How much worse than the best of them it explains the measurements so far: deviance, with
    /// a price for every unknown.
    pub excess_deviance: f64,
}

/// A coefficient or inner parameter that is to be measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sought {
    /// Its name, or its term.
    pub what: String,
    /// Its value so far.
    pub value: f64,
    /// Its standard error so far; infinite (null in files) where nothing is known.
    pub standard_error: f64,
}

/// A number with a name.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Named {
    /// Component of the state, or observable.
    pub name: String,
    /// In the spec's unit.
    pub value: f64,
}

/// Bounds of a component of the state.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bound {
    /// Component of the state.
    pub name: String,
    /// The smallest value.
    pub lower: f64,
    /// The largest value.
    pub upper: f64,
}

/// A run that could be made.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Proposal {
    /// Coordinates, then momenta.
    pub start: Vec<Named>,
    /// What the instruments would show of it.
    pub observed: Vec<Named>,
    /// Whether it starts without momentum.
    pub at_rest: bool,
    /// Time of the first sample.
    pub from: f64,
    /// Time from the first to the last sample.
    pub duration: f64,
    /// Time between samples.
    pub step: f64,
    /// Number of samples.
    pub samples: usize,
    /// What it would bring.
    pub expected: Expected,
}

/// What a run would bring.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Expected {
    /// For each pair of rivals.
    pub gains: Vec<Gain>,
    /// Of the coefficient, with the run; infinite (null in files) where it stays unknown.
    pub standard_error: Option<f64>,
}

/// Evidence against one rival if another is true.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Gain {
    /// The rival that is true.
    pub truth: String,
    /// The rival that the run speaks against.
    pub against: String,
    /// Expected growth of the difference of their deviances, both refitted to all measurements:
    /// the odds grow by a factor of exp(deviance / 2).
    pub deviance: f64,
    /// Probability that the true one is then ahead by enough to be distinguished.
    pub power: f64,
}
