//! The slow evaluator: walks the graph at every point.

use std::collections::HashMap;

use super::{Backend, Evaluator, Inputs};
use crate::expr::{Expr, Graph, Symbol};

/// Expressions with the graph that they live in.
pub(super) struct Reference {
    graph: Graph,
    inputs: Inputs,
    outputs: Vec<Expr>,
}

impl Reference {
    pub(super) fn new(graph: &Graph, inputs: &Inputs, outputs: &[Expr]) -> Self {
        Reference { graph: graph.clone(), inputs: inputs.clone(), outputs: outputs.to_vec() }
    }
}

impl Evaluator for Reference {
    fn outputs(&self) -> usize {
        self.outputs.len()
    }

    fn backend(&self) -> Backend {
        Backend::Reference
    }

    fn evaluate(
        &self,
        points: &[f64],
        uniform: &[f64],
        lanes: usize,
        out: &mut [f64],
        _: &mut Vec<f64>,
    ) {
        let mut values: HashMap<Symbol, f64> =
            self.inputs.uniform.iter().copied().zip(uniform.iter().copied()).collect();
        for lane in 0..lanes {
            for (row, &symbol) in self.inputs.varying.iter().enumerate() {
                values.insert(symbol, points[row * lanes + lane]);
            }
            let of = |symbol: Symbol| values.get(&symbol).copied().unwrap_or(f64::NAN);
            for (row, &output) in self.outputs.iter().enumerate() {
                out[row * lanes + lane] = self.graph.value(output, &of);
            }
        }
    }
}
