//! Residual force without a name: piecewise linear in one variable.
//!
//! A hat is 1 at its centre and falls to 0 at its neighbours' centres; a force that is a sum of
//! hats is any piecewise linear function. Its coefficients are the residual force at the
//! centres, with error bands, from the same scores as named effects.

use crate::expr::{Bounds, Expr, Function, Graph, Place, System, Term};

/// Centres of hats over the values of a variable: even over all but the part `outermost` of them on
/// either side.
///
/// Empty when the values do not spread.
pub(super) fn centres(values: &mut Vec<f64>, count: usize, outermost: f64) -> Vec<f64> {
    values.retain(|x| x.is_finite());
    if values.len() < 2 * count || count < 2 {
        return Vec::new();
    }
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[(share * (values.len() - 1) as f64).round() as usize];
    let (lower, upper) = (at(outermost), at(1.0 - outermost));
    // A spread that is rounding is none.
    if upper - lower <= 1e-12 * upper.abs().max(lower.abs()) {
        return Vec::new();
    }
    (0..count).map(|i| lower + (upper - lower) * i as f64 / (count - 1) as f64).collect()
}

/// The hat functions of `variable` around the centres; the outermost ones stay 1 beyond them.
pub(super) fn hats(graph: &mut Graph, variable: Expr, centres: &[f64]) -> Vec<Expr> {
    let abs = Function::ABS;
    let Some(width) = centres.windows(2).map(|pair| pair[1] - pair[0]).next() else {
        return Vec::new();
    };
    // Distances to all centres; the second difference of |x - c| / (2 width) is the hat.
    let (first, last) = (centres[0], centres[centres.len() - 1]);
    let held = clamped(graph, variable, first, last, abs);
    centres
        .iter()
        .map(|&centre| {
            let parts: Vec<(f64, Expr)> = [(0.5, -width), (-1.0, 0.0), (0.5, width)]
                .into_iter()
                .map(|(factor, shift)| {
                    let distance = graph.linear(-(centre + shift), &[(1.0, held)]);
                    (factor / width, graph.apply(abs, distance))
                })
                .collect();
            graph.linear(0.0, &parts)
        })
        .collect()
}

/// min(max(x, lower), upper) = (lower + upper + |x - lower| - |x - upper|) / 2.
fn clamped(graph: &mut Graph, x: Expr, lower: f64, upper: f64, abs: Function) -> Expr {
    let from_lower = graph.linear(-lower, &[(1.0, x)]);
    let from_upper = graph.linear(-upper, &[(1.0, x)]);
    let parts = [(0.5, graph.apply(abs, from_lower)), (-0.5, graph.apply(abs, from_upper))];
    graph.linear(0.5 * (lower + upper), &parts)
}

/// Terms of a force on one coordinate, one for each expression.
pub(super) fn force_terms(coordinate: usize, exprs: &[Expr], system: &System) -> Vec<Term> {
    exprs
        .iter()
        .map(|&expr| Term {
            place: Place::Force(coordinate),
            expr,
            also: Vec::new(),
            effect: None,
            label: system.graph.text(expr, &system.names()),
            name: None,
            bounds: Bounds::FREE,
            unit: None,
            unit_text: None,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::Symbol;

    #[test]
    fn hats_are_one_at_their_centres_and_sum_to_one() {
        let mut graph = Graph::new();
        let q = graph.symbol(Symbol::Coordinate(0));
        let centres = [-1.0, 0.5, 2.0, 3.5];
        let hats = hats(&mut graph, q, &centres);
        let value = |expr, x: f64| graph.value(expr, &|_| x);
        for (i, &hat) in hats.iter().enumerate() {
            for (j, &centre) in centres.iter().enumerate() {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((value(hat, centre) - expected).abs() < 1e-12);
            }
        }
        for x in [-9.0, -1.0, 0.0, 0.7, 2.2, 3.4, 80.0] {
            let sum: f64 = hats.iter().map(|&hat| value(hat, x)).sum();
            assert!((sum - 1.0).abs() < 1e-9, "{x}");
        }
    }

    #[test]
    fn centres_need_a_spread() {
        assert!(centres(&mut vec![2.0; 50], 5, 0.01).is_empty());
        let mut even: Vec<f64> = (0..=1000).map(|i| i as f64 / 1000.0).collect();
        let centres = centres(&mut even, 5, 0.01);
        assert!((centres[0] - 0.01).abs() < 1e-12 && (centres[4] - 0.99).abs() < 1e-12);
    }
}
