//! How supports are compared: fit against description length.

use std::collections::BTreeMap;

use crate::expr::{Expr, Graph, Node, Symbol};

/// The criterion of a support: smaller is better.
///
/// `rows log(squares / rows + floor^2) + unknowns log(rows) + choice`: the Bayesian information
/// criterion (Schwarz, Ann. Stat. 6, 1978) with the price of the choice among many supports
/// (as in Chen and Chen, Biometrika 95, 2008, eq. 2.2, gamma = 1), see [`choice_costs`].
/// Residuals below the floor (rounding, the integrator's own error) earn nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criterion {
    /// In units of the weighted residuals.
    pub floor: f64,
}

impl Criterion {
    /// `choice` is the sum of the support's [`choice_costs`].
    pub fn value(&self, squares: f64, rows: usize, unknowns: usize, choice: f64) -> f64 {
        let n = rows.max(1) as f64;
        let variance = (squares / n + self.floor * self.floor).max(f64::MIN_POSITIVE);
        n * variance.ln() + unknowns as f64 * n.ln() + choice
    }

    /// Whether two sums of squares are the same to the criterion: they differ by less than any
    /// term costs, a deviance of `same`, or both are below the floor.
    pub fn agree(&self, a: f64, b: f64, rows: usize, same: f64) -> bool {
        let value = |squares: f64| self.value(squares, rows, 0, 0.0);
        (value(a) - value(b)).abs() < same || a.max(b) <= rows as f64 * self.floor.powi(2)
    }
}

/// What naming each term costs: 2 log(levels * terms of the same complexity).
///
/// First the complexity is named, then the term among its equals, so that simple terms are
/// cheap however large the space is (Rissanen, Automatica 14, 1978). The probabilities
/// exp(-cost / 2) sum to one: a term that is noise gets in about once in a thousand fits.
pub fn choice_costs(complexity: &[u32]) -> Vec<f64> {
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    for &level in complexity {
        *counts.entry(level).or_default() += 1;
    }
    let levels = counts.len() as f64;
    complexity.iter().map(|level| 2.0 * (levels * counts[level] as f64).ln()).collect()
}

/// Total degree of a monomial, and its like for other terms: every state or time is one,
/// a whole power that many, a function one more than its argument.
pub fn complexity(graph: &Graph, expr: Expr) -> u32 {
    let mut known = std::collections::HashMap::new();
    for part in graph.topological(&[expr]) {
        let value: u32 = match graph.node(part) {
            Node::Number(_) | Node::Symbol(Symbol::Parameter(_) | Symbol::Coefficient(_)) => 0,
            Node::Symbol(_) => 1,
            Node::Sum { terms, .. } => terms.iter().map(|(t, _)| known[t]).fold(0, add),
            Node::Product(parts) => parts
                .iter()
                .map(|(base, exponent)| {
                    // Larger ones would not fit into the number, and are as far from simple.
                    let size = exponent.value().abs().ceil().min(1e6) as u32;
                    let odd = u32::from(exponent.value() < 0.0 || exponent.value().fract() != 0.0);
                    known[base].saturating_mul(size).saturating_add(odd)
                })
                .fold(0, add),
            Node::Power(base, exponent) => add(known[base], known[exponent]).saturating_add(1),
            Node::Apply(_, argument) => known[argument].saturating_add(1),
        };
        known.insert(part, value);
    }
    known[&expr]
}

fn add(a: u32, b: u32) -> u32 {
    a.saturating_add(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::Function;

    #[test]
    fn the_prices_of_the_terms_are_those_of_one_code() {
        let costs = choice_costs(&[1, 1, 2, 2, 2, 5]);
        let total: f64 = costs.iter().map(|cost| (-cost / 2.0).exp()).sum();
        assert!((total - 1.0).abs() < 1e-12);
    }

    #[test]
    fn complexity_is_the_degree() {
        let mut graph = Graph::new();
        let q = graph.symbol(Symbol::Coordinate(0));
        let p = graph.symbol(Symbol::Momentum(0));
        let cubic = graph.product(-2.5, &[(q, 2.0), (p, 1.0)]);
        assert_eq!(complexity(&graph, cubic), 3);
        let cos = graph.apply(Function::COS, q);
        assert_eq!(complexity(&graph, cos), 2);
        let inverse = graph.power(q, -1.0);
        assert_eq!(complexity(&graph, inverse), 2);
    }
}
