//! Symbolic derivatives against differences of values.

use crate::support::shape;
use leverrier::internals::expr::{Expr, FUNCTIONS, Function, Graph, Symbol};
use proptest::prelude::*;

const X: Symbol = Symbol::Coordinate(0);

/// Fourth-order difference quotient, and how far quotients of two widths disagree.
fn slope(f: &dyn Fn(f64) -> f64, x: f64) -> (f64, f64) {
    let quotient =
        |h: f64| (f(x - 2.0 * h) - 8.0 * f(x - h) + 8.0 * f(x + h) - f(x + 2.0 * h)) / (12.0 * h);
    let (wide, narrow) = (quotient(2e-3), quotient(1e-3));
    (narrow, (wide - narrow).abs())
}

#[test]
fn every_function_has_its_derivatives() {
    for (function, row) in Function::all().zip(FUNCTIONS) {
        let mut graph = Graph::new();
        let x = graph.symbol(X);
        let value = graph.apply(function, x);
        let first = graph.derivative(value, X);
        let second = graph.derivative(first, X);
        let (low, high) = row.domain.sample_interval();
        for i in 1..60 {
            let at = low + (high - low) * f64::from(i) / 60.0;
            if at.abs() < 0.01 {
                continue; // abs and sign have a corner or a jump here
            }
            let of = |expr: Expr| {
                let graph = &graph;
                move |x: f64| graph.value(expr, &|_| x)
            };
            for (expr, derivative) in [(value, first), (first, second)] {
                let (difference, doubt) = slope(&of(expr), at);
                let found = of(derivative)(at);
                assert!(
                    (difference - found).abs() < 1e-8 * (1.0 + found.abs()) + 10.0 * doubt,
                    "{} at {at}: {found} against {difference}",
                    row.name
                );
            }
        }
    }
}

#[test]
fn odd_and_even_rows_are_odd_and_even() {
    for row in FUNCTIONS {
        let (low, high) = row.domain.sample_interval();
        for x in [0.17, 0.53, 0.92] {
            let (right, left) = ((row.value)(x), (row.value)(-x));
            if row.odd {
                assert_eq!(left, -right, "{}", row.name);
            }
            if row.even {
                assert_eq!(left, right, "{}", row.name);
            }
            if !row.odd && !row.even && low < -x && x < high {
                assert!(left != right && left != -right, "{} has a symmetry", row.name);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn derivatives_are_the_limits_of_differences(shape in shape(), at in 0.1..1.1_f64) {
        let mut graph = Graph::new();
        let expr = shape.build(&mut graph);
        let symbols = [X, Symbol::Momentum(0), Symbol::Time, Symbol::Coefficient(0)];
        let gradient = graph.gradient(expr, &symbols);
        let point = [at, -0.45, 0.8, 0.6];
        for (i, &derivative) in gradient.iter().enumerate() {
            let of = |expr: Expr, x: f64| {
                let mut point = point;
                point[i] = x;
                graph.value(expr, &|symbol| {
                    symbols.iter().position(|&s| s == symbol).map_or(0.3, |i| point[i])
                })
            };
            let (difference, doubt) = slope(&|x| of(expr, x), point[i]);
            let found = of(derivative, point[i]);
            let scale = 1.0 + found.abs() + of(expr, point[i]).abs();
            // Where differences of two widths disagree, a corner or a pole is near.
            if difference.is_finite() && found.is_finite() && doubt < 1e-6 * scale {
                prop_assert!(
                    (difference - found).abs() < 1e-7 * scale + 10.0 * doubt,
                    "by {:?}: {} against {}", symbols[i], found, difference
                );
            }
        }
    }

    #[test]
    fn hessians_are_symmetric(shape in shape(), at in 0.1..1.1_f64) {
        let mut graph = Graph::new();
        let expr = shape.build(&mut graph);
        let symbols = [X, Symbol::Momentum(0), Symbol::Time];
        let hessian = graph.hessian(expr, &symbols);
        let of = |expr: Expr| graph.value(expr, &|symbol| match symbol {
            X => at,
            Symbol::Momentum(_) => -0.45,
            Symbol::Time => 0.8,
            _ => 0.3,
        });
        for (i, row) in hessian.iter().enumerate() {
            for (&here, across) in row.iter().zip(&hessian) {
                let (a, b) = (of(here), of(across[i]));
                if a.is_finite() && b.is_finite() {
                    prop_assert!((a - b).abs() <= 1e-8 * (1.0 + a.abs()), "{} {}", a, b);
                }
            }
        }
    }
}
