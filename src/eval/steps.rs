//! Many steps of one trajectory without leaving compiled code.

use super::Inputs;
use crate::expr::{Expr, Graph, Symbol};

/// A composition of drifts and kicks.
pub(crate) struct StepSource<'a> {
    /// Where the expressions are.
    pub graph: &'a Graph,
    /// Coordinates, then as many momenta.
    pub state: &'a [Symbol],
    /// What the coordinates change by, and its inputs: of the state and the time.
    pub drift: (&'a [Expr], Inputs),
    /// What the momenta change by.
    pub kick: (&'a [Expr], Inputs),
    /// Whether each stage of a step is a drift.
    pub stages: &'a [bool],
}

/// How far [`Steps::run`] goes.
pub(crate) struct Pace<'a> {
    /// Factor of the change of each stage; none is 0.
    pub scales: &'a [f64],
    /// Time of each stage, in steps from the beginning of its step.
    pub times: &'a [f64],
    /// Length of a step.
    pub step: f64,
    /// Time at step 0.
    pub start: f64,
    /// Number of the step that comes first.
    pub first: f64,
    /// Number of steps.
    pub steps: usize,
}

/// A composition, compiled.
pub(crate) trait Steps: Send + Sync {
    /// Moves a state on. `state` and what it carries (see [`super::add_carrying`]) have a
    /// number for each component.
    fn run(&self, state: &mut [f64], carry: &mut [f64], uniform: &[f64], pace: &Pace);
}

/// Machine code for a composition; `None` where there can be none.
pub(crate) fn compile_steps(source: &StepSource) -> Option<Box<dyn Steps>> {
    #[cfg(target_arch = "x86_64")]
    if let Some(machine) = super::jit::steps::MachineSteps::new(source) {
        return Some(Box::new(machine));
    }
    let _ = source;
    None
}
