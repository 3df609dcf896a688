//! Evaluators: expressions compiled to functions that run over many points at once.

mod lower;
mod reference;
mod tape;

pub(crate) use lower::{Instruction, Lowered, Slot, Value};

use crate::expr::{Expr, Graph, Symbol};

/// Where a compiled function takes a symbol's value from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Inputs {
    /// Symbols with a value of their own at every point, in the order of the rows of `points`.
    pub varying: Vec<Symbol>,
    /// Symbols with one value for all points, in the order of `uniform`.
    pub uniform: Vec<Symbol>,
}

/// A function compiled from expressions.
pub trait Evaluator: Send + Sync {
    /// Number of output rows.
    fn outputs(&self) -> usize;

    /// Evaluates every output at every point.
    ///
    /// `points` is `[varying symbol][lane]`, row after row of `lanes` values;
    /// `uniform` one value a symbol; `out` is `[output][lane]`.
    /// `workspace` is scratch memory that the evaluator sizes itself; one a thread.
    fn evaluate(
        &self,
        points: &[f64],
        uniform: &[f64],
        lanes: usize,
        out: &mut [f64],
        workspace: &mut Vec<f64>,
    );
}

/// Which evaluator to compile to: a row of [`BACKENDS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Backend {
    /// One point after the other, node by node; the truth that the others are held against.
    Reference,
    /// A tape of instructions, each over a block of points.
    #[default]
    Batched,
}

/// Every backend, with its name.
pub const BACKENDS: &[(&str, Backend)] =
    &[("reference", Backend::Reference), ("batched", Backend::Batched)];

/// Compiles expressions to a function of the inputs. A symbol that is not among them is NaN.
pub fn compile(
    graph: &Graph,
    inputs: &Inputs,
    outputs: &[Expr],
    backend: Backend,
) -> Box<dyn Evaluator> {
    match backend {
        Backend::Reference => Box::new(reference::Reference::new(graph, inputs, outputs)),
        Backend::Batched => Box::new(tape::Tape::new(graph, inputs, outputs)),
    }
}
