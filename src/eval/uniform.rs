//! The numbers that are the same at every point, computed once a call.

use rustc_hash::FxHashMap;

use super::Inputs;
use super::instruction::Slot;
use crate::expr::{Expr, Function, Graph, Node, Number, Symbol, raise};

/// The program that computes every slot from the uniform inputs.
#[derive(Clone)]
pub(super) struct Uniforms {
    steps: Vec<Step>,
    /// (factor, (step, exponent) of each part).
    slots: Vec<(f64, Vec<(usize, f64)>)>,
}

/// A step of the program; operands are earlier steps.
#[derive(Clone)]
enum Step {
    Number(f64),
    /// A row of `uniform`; `None` for a symbol that is no input.
    Uniform(Option<usize>),
    Sum(f64, Vec<(usize, f64)>),
    Product(Vec<(usize, f64)>),
    Power(usize, usize),
    Apply(Function, usize),
}

impl Uniforms {
    pub(super) fn new(graph: &Graph, inputs: &Inputs, slots: &[Slot]) -> Uniforms {
        let roots: Vec<Expr> =
            slots.iter().flat_map(|slot| slot.parts.iter().map(|&(e, _)| e)).collect();
        let row_of: FxHashMap<Symbol, usize> =
            inputs.uniform.iter().enumerate().map(|(i, &s)| (s, i)).collect();
        let mut place: FxHashMap<Expr, usize> = FxHashMap::default();
        let mut steps = Vec::new();
        for expr in graph.topological(&roots) {
            let pairs = |list: &[(Expr, Number)]| -> Vec<(usize, f64)> {
                list.iter().map(|(e, c)| (place[e], c.value())).collect()
            };
            let step = match graph.node(expr) {
                Node::Number(number) => Step::Number(number.value()),
                Node::Symbol(symbol) => Step::Uniform(row_of.get(symbol).copied()),
                Node::Sum { constant, terms } => Step::Sum(constant.value(), pairs(terms)),
                Node::Product(parts) => Step::Product(pairs(parts)),
                Node::Power(base, exponent) => Step::Power(place[base], place[exponent]),
                Node::Apply(function, argument) => Step::Apply(*function, place[argument]),
            };
            place.insert(expr, steps.len());
            steps.push(step);
        }
        let part = |&(e, exponent): &(Expr, f64)| (place[&e], exponent);
        let slots =
            slots.iter().map(|slot| (slot.factor, slot.parts.iter().map(part).collect())).collect();
        Uniforms { steps, slots }
    }

    /// Number of slots.
    pub(super) fn len(&self) -> usize {
        self.slots.len()
    }

    /// Computes the slots; each is handed to `store` with its index. `values` is scratch
    /// memory of [`Uniforms::scratch`] numbers.
    pub(super) fn evaluate(
        &self,
        uniform: &[f64],
        values: &mut [f64],
        mut store: impl FnMut(usize, f64),
    ) {
        let product = |values: &[f64], parts: &[(usize, f64)]| match *parts {
            [] => 1.0,
            [(i, 1.0)] => values[i],
            _ => parts.iter().map(|&(i, e)| raise(values[i], e)).product(),
        };
        for (at, step) in self.steps.iter().enumerate() {
            values[at] = match step {
                Step::Number(value) => *value,
                Step::Uniform(row) => {
                    row.and_then(|row| uniform.get(row)).copied().unwrap_or(f64::NAN)
                }
                Step::Sum(constant, terms) => {
                    constant + terms.iter().map(|&(i, c)| c * values[i]).sum::<f64>()
                }
                Step::Product(parts) => product(values, parts),
                Step::Power(base, exponent) => values[*base].powf(values[*exponent]),
                Step::Apply(function, argument) => (function.row().value)(values[*argument]),
            };
        }
        for (at, (factor, parts)) in self.slots.iter().enumerate() {
            store(at, factor * product(values, parts));
        }
    }

    /// Numbers of scratch memory that [`Uniforms::evaluate`] takes.
    pub(super) fn scratch(&self) -> usize {
        self.steps.len()
    }
}
