//! What an expression costs: to read it, and to compute it.

use egg::{CostFunction, Id, Language};

use super::lang::{Math, Rational};
use crate::expr::{Expr, Graph, Node};

/// Description length for people: how much there is to read and to remember.
pub struct ReadingCost;

impl CostFunction<Math> for ReadingCost {
    type Cost = f64;

    fn cost<C: FnMut(Id) -> f64>(&mut self, node: &Math, mut costs: C) -> f64 {
        let own = match node {
            // A number with an uncertainty is read digit by digit.
            Math::Fitted(_) => 6.0,
            Math::Rational(rational) => rational_length(*rational),
            Math::Variable(_) | Math::Pi => 1.0,
            Math::Apply(..) => 2.0,
            Math::Add(_) | Math::Raise(_) => 1.0,
            Math::Multiply(_) => 0.7,
            Math::Negate(_) => 0.4,
        };
        node.fold(own, |sum, child| sum + costs(child))
    }
}

fn rational_length(rational: Rational) -> f64 {
    let digits = |n: u64| n.max(1).ilog10() as f64;
    let (numerator, denominator) = (rational.0.numer(), rational.0.denom());
    let fraction = if *denominator == 1 { 0.0 } else { 0.5 + digits(denominator.unsigned_abs()) };
    let minus = if *numerator < 0 { 0.5 } else { 0.0 };
    1.0 + digits(numerator.unsigned_abs()) + fraction + minus
}

/// Time for a machine, in multiplications; a shared part is computed once.
pub fn machine(graph: &Graph, exprs: &[Expr]) -> f64 {
    graph
        .topological(exprs)
        .into_iter()
        .map(|part| match graph.node(part) {
            Node::Number(_) | Node::Symbol(_) => 0.0,
            Node::Sum { constant, terms } => {
                let scaled = terms.iter().filter(|(_, c)| c.value().abs() != 1.0).count();
                let added = terms.len() - usize::from(constant.value() == 0.0);
                (scaled + added) as f64
            }
            Node::Product(parts) => {
                let powers: f64 = parts.iter().map(|(_, e)| power(e.value())).sum();
                powers + parts.len() as f64 - 1.0
            }
            Node::Power(..) => 30.0,
            Node::Apply(function, _) => f64::from(function.row().cost),
        })
        .sum()
}

/// Multiplications of a power by repeated squaring; a division for a negative exponent.
fn power(exponent: f64) -> f64 {
    let size = exponent.abs();
    let division = if exponent < 0.0 { 4.0 } else { 0.0 };
    if size.fract() == 0.0 && size <= 64.0 {
        let n = size as u64;
        division + f64::from(n.max(1).ilog2() + n.count_ones() - 1)
    } else if size == 0.5 {
        division + 4.0
    } else {
        30.0
    }
}
