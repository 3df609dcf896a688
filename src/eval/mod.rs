//! Evaluators: expressions compiled to functions that run over many points at once.

mod advance;
mod aligned;
mod arrays;
mod backend;
mod conjugate;
mod eights;
mod elementary;
mod instruction;
#[cfg(target_arch = "x86_64")]
mod jit;
mod lane_reflections;
mod lanes;
mod lower;
mod power;
mod processor;
mod reference;
mod reflect;
mod series;
mod steps;
mod tape;
mod uniform;

pub(crate) use advance::add_series;
pub use aligned::Aligned;
pub(crate) use arrays::{
    Compared, add, add_carrying, add_multiple, add_products, add_squares, add_weighted_rows,
    compare, leverages, multiply, sum_with_multiple,
};
pub use backend::{BACKENDS, Backend, VARIABLE};
pub(crate) use conjugate::{Lower, conjugate_gradients};
pub(crate) use eights::{
    Eight, NOWHERE, add_entry_squares, add_gathered, add_lower, add_multiples, add_outer,
    add_scattered, factorise, solve_lower, solve_upper, squares, weigh_entries,
};
pub(crate) use instruction::{Instruction, Slot, Value};
pub(crate) use lane_reflections::{LaneReflections, reflect_lanes};
pub(crate) use lanes::{
    REGISTER, add_weighted, add_weighted_pair, mark_broken, rescale, set_weighted, sum_squares,
    weigh,
};
pub(crate) use lower::Lowered;
pub use processor::InstructionSet;
pub(crate) use reflect::{GROUP, Reflections, product, reflect};
pub(crate) use series::Series;
pub(crate) use steps::{Pace, StepSource, Steps, compile_steps};

use self::uniform::Uniforms;
use crate::expr::{Expr, Function, Graph, Symbol};

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

    /// What the function really runs on.
    fn backend(&self) -> Backend;

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

    /// The same after an evaluation of this function with the same uniform numbers, the same
    /// number of lanes and this workspace, if it is not empty: what is the same at every point
    /// need not be computed again.
    fn evaluate_again(
        &self,
        points: &[f64],
        uniform: &[f64],
        lanes: usize,
        out: &mut [f64],
        workspace: &mut Vec<f64>,
    ) {
        self.evaluate(points, uniform, lanes, out, workspace);
    }
}

/// Compiles expressions to a function of the inputs. A symbol that is not among them is NaN.
pub fn compile(
    graph: &Graph,
    inputs: &Inputs,
    outputs: &[Expr],
    backend: Backend,
) -> Box<dyn Evaluator> {
    compile_for(graph, inputs, outputs, backend, InstructionSet::widest())
}

/// The same for an instruction set that need not be the widest; one that the processor lacks
/// is replaced by the widest that it has. Results do not depend on it.
pub fn compile_for(
    graph: &Graph,
    inputs: &Inputs,
    outputs: &[Expr],
    backend: Backend,
    set: InstructionSet,
) -> Box<dyn Evaluator> {
    if backend == Backend::Reference {
        return Box::new(reference::Reference::new(graph, inputs, outputs));
    }
    let lowered = Lowered::new(graph, inputs, outputs);
    let uniforms = Uniforms::new(graph, inputs, &lowered.slots);
    #[cfg(target_arch = "x86_64")]
    if backend == Backend::Machine
        && let Some(machine) = jit::Machinecode::new(&lowered, uniforms.clone(), set)
    {
        return Box::new(machine);
    }
    Box::new(tape::Tape::new(&lowered, uniforms, set))
}

/// Code for a long straight line that is run for one point at a time.
fn for_one_point(lowered: &Lowered, uniforms: Uniforms, backend: Backend) -> Box<dyn Evaluator> {
    #[cfg(target_arch = "x86_64")]
    if backend == Backend::Machine
        && let Some(machine) = jit::Machinecode::for_one_point(lowered, uniforms.clone())
    {
        return Box::new(machine);
    }
    let _ = backend;
    Box::new(tape::Tape::new(lowered, uniforms, InstructionSet::widest()))
}

/// How long the code of a function is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Length {
    /// Instructions of a point.
    pub instructions: usize,
    /// Their time, in units of one multiplication.
    pub cost: u32,
    /// Numbers that are computed once a call.
    pub uniform: usize,
}

/// The length of the code that [`compile`] makes of expressions for the batched backends.
pub fn length(graph: &Graph, inputs: &Inputs, outputs: &[Expr]) -> Length {
    let lowered = Lowered::new(graph, inputs, outputs);
    Length { instructions: lowered.code.len(), cost: lowered.cost(), uniform: lowered.slots.len() }
}

/// function(x) of every number of `from`, into `to`, as the batched backends compute it.
pub fn apply(set: InstructionSet, function: Function, from: &[f64], to: &mut [f64]) {
    elementary::apply(set, function, from, to);
}

/// bases^exponents number by number, into `to`, as the batched backends compute it.
pub fn powers(set: InstructionSet, bases: &[f64], exponents: &[f64], to: &mut [f64]) {
    power::powers(set, bases, exponents, to);
}
