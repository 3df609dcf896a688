//! Every backend computes the same function, whatever the expression and the number of points.

mod support;

use leverrier::eval::{BACKENDS, Inputs, compile};
use leverrier::expr::{Expr, Graph, Symbol};
use proptest::prelude::*;
use support::{Shape, shape};

/// Two varying symbols of each kind and two uniform ones, one of them in each list.
fn inputs() -> Inputs {
    Inputs {
        varying: vec![Symbol::Momentum(0), Symbol::Coordinate(0), Symbol::Time],
        uniform: vec![Symbol::Coefficient(0), Symbol::Parameter(0)],
    }
}

/// Points inside (-1.2, 1.2), no two lanes alike.
fn points(lanes: usize) -> Vec<f64> {
    (0..3 * lanes).map(|i| 1.2 * (1.0 + 0.37 * i as f64).sin()).collect()
}

fn evaluate(
    graph: &Graph,
    inputs: &Inputs,
    outputs: &[Expr],
    lanes: usize,
    uniform: &[f64],
) -> Vec<Vec<f64>> {
    let points = points(lanes);
    BACKENDS
        .iter()
        .map(|&(_, backend)| {
            let function = compile(graph, inputs, outputs, backend);
            assert_eq!(function.outputs(), outputs.len());
            let mut out = vec![7.0; outputs.len() * lanes];
            let mut workspace = vec![f64::NAN; 3];
            function.evaluate(&points, uniform, lanes, &mut out, &mut workspace);
            // Whatever the workspace holds from before does not matter.
            let mut again = vec![-7.0; out.len()];
            function.evaluate(&points, uniform, lanes, &mut again, &mut workspace);
            assert!(out.iter().zip(&again).all(|(a, b)| a.to_bits() == b.to_bits()));
            out
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn all_backends_agree(
        shapes in prop::collection::vec(shape(), 1..4),
        lanes in prop::sample::select(vec![1_usize, 127, 128, 129, 300]),
    ) {
        let mut graph = Graph::new();
        let outputs: Vec<Expr> = shapes.iter().map(|shape| shape.build(&mut graph)).collect();
        let uniform = [0.7, -0.3];
        let results = evaluate(&graph, &inputs(), &outputs, lanes, &uniform);
        let points = points(lanes);
        for (row, &output) in outputs.iter().enumerate() {
            for lane in 0..lanes {
                let of = |symbol| match symbol {
                    Symbol::Momentum(0) => points[lane],
                    Symbol::Coordinate(0) => points[lanes + lane],
                    Symbol::Time => points[2 * lanes + lane],
                    Symbol::Coefficient(0) => uniform[0],
                    Symbol::Parameter(0) => uniform[1],
                    _ => f64::NAN,
                };
                let truth = graph.value(output, &of);
                // Parts may be far larger than their sum: that much of it is rounding.
                let size = support::largest_part(&graph, output, &of);
                for ((name, _), result) in BACKENDS.iter().zip(&results) {
                    let value = result[row * lanes + lane];
                    let agree = if truth.is_finite() && size < 1e100 {
                        (value - truth).abs() <= 1e-11 * (1.0 + size)
                    } else {
                        // Overflow may come earlier or later; what is undefined stays so.
                        !truth.is_nan() || !value.is_finite()
                    };
                    prop_assert!(agree, "{}: {} against {}", name, value, truth);
                }
            }
        }
    }
}

#[test]
fn corner_cases_agree() {
    let mut graph = Graph::new();
    let q = graph.symbol(Symbol::Coordinate(0));
    let c = graph.symbol(Symbol::Coefficient(0));
    let unknown = graph.symbol(Symbol::Coordinate(7));
    let number = graph.number(2.5);
    let zero = graph.number(0.0);
    let impossible = graph.power(zero, -1.0);
    let long = graph.power(q, 70.0);
    let root = graph.power(q, -0.5);
    // The same output twice, an input as it is, numbers, a symbol that is no input.
    let outputs = [q, q, number, c, unknown, impossible, long, root];
    for lanes in [1, 127, 128, 129, 300] {
        let results = evaluate(&graph, &inputs(), &outputs, lanes, &[1.5, 0.0]);
        for (a, b) in results[0].iter().zip(&results[1]) {
            assert!(a == b || (a.is_nan() && b.is_nan()) || (a - b).abs() < 1e-13 * a.abs());
        }
        assert!(results.iter().all(|r| r[4 * lanes].is_nan() && r[5 * lanes].is_infinite()));
    }
    let results = evaluate(&graph, &inputs(), &[], 5, &[1.0, 1.0]);
    assert!(results.iter().all(Vec::is_empty));
    let results = evaluate(&graph, &inputs(), &outputs, 0, &[1.0, 1.0]);
    assert!(results.iter().all(Vec::is_empty));
}

#[test]
fn deep_expressions_do_not_exhaust_the_stack() {
    let mut graph = Graph::new();
    let mut expr = Shape::Symbol(0).build(&mut graph);
    let sin = leverrier::expr::Function::by_name("sin").unwrap();
    for _ in 0..50_000 {
        expr = graph.apply(sin, expr);
    }
    let results = evaluate(&graph, &inputs(), &[expr], 2, &[0.0, 0.0]);
    assert!(results.iter().flatten().all(|x| x.is_finite()));
}
