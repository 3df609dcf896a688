//! Every backend computes the same function, whatever the expression and the number of points.

use crate::support::{Shape, shape};
use leverrier::internals::dynamics::systems;
use leverrier::internals::eval::{
    BACKENDS, Backend, Inputs, InstructionSet, compile, compile_for, length,
};
use leverrier::internals::expr::{Expr, Graph, Symbol};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;

/// Two varying symbols of each kind and two uniform ones, one of them in each list.
fn inputs() -> Inputs {
    Inputs {
        varying: vec![Symbol::Momentum(0), Symbol::Coordinate(0), Symbol::Time],
        uniform: vec![Symbol::Coefficient(0), Symbol::Parameter(0)],
    }
}

/// The reference, and every other backend on every instruction set of this processor: those
/// compute the same bits.
fn same_bits(
    graph: &Graph,
    inputs: &Inputs,
    outputs: &[Expr],
    lanes: usize,
    uniform: &[f64],
    expected: &[f64],
) {
    let points = points(lanes);
    for backend in [Backend::Batched, Backend::Machine] {
        for set in InstructionSet::available() {
            let function = compile_for(graph, inputs, outputs, backend, set);
            let mut out = vec![7.0; outputs.len() * lanes];
            function.evaluate(&points, uniform, lanes, &mut out, &mut Vec::new());
            for (a, b) in expected.iter().zip(&out) {
                let same = a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
                assert!(same, "{backend:?} {set:?}: {b:e} against {a:e}");
            }
        }
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
        same_bits(&graph, &inputs(), &outputs, lanes, &uniform, &results[1]);
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
                // A sum may be far smaller than its parts, and a power magnify what that leaves.
                let near = crate::support::rounding(&graph, output, &of);
                for ((name, _), result) in BACKENDS.iter().zip(&results) {
                    let value = result[row * lanes + lane];
                    let agree = if truth.is_finite() && near.is_finite() {
                        (value - truth).abs() <= near
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

/// Of nearly all values it is known how far rounding may carry them, and that is not far.
#[test]
fn rounding_is_bounded() {
    let mut runner = TestRunner::deterministic();
    let (mut finite, mut bounded, mut sharp) = (0, 0, 0);
    for _ in 0..4_000 {
        let shape = shape().new_tree(&mut runner).expect("a shape").current();
        let mut graph = Graph::new();
        let output = shape.build(&mut graph);
        let of = |symbol| match symbol {
            Symbol::Momentum(0) => 0.83,
            Symbol::Coordinate(0) => -0.62,
            Symbol::Time => 1.13,
            Symbol::Coefficient(0) => 0.7,
            _ => -0.3,
        };
        let value = graph.value(output, &of);
        if value.is_finite() {
            let near = crate::support::rounding(&graph, output, &of);
            finite += 1;
            bounded += usize::from(near.is_finite());
            sharp += usize::from(near <= 1e-11 * (1.0 + value.abs()));
        }
    }
    assert!(100 * bounded > 99 * finite, "{bounded} of {finite}");
    assert!(100 * sharp > 99 * finite, "{sharp} of {finite}");
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
        for (a, b) in results[1..].iter().flat_map(|r| results[0].iter().zip(r)) {
            assert!(a == b || (a.is_nan() && b.is_nan()) || (a - b).abs() < 1e-13 * a.abs());
        }
        same_bits(&graph, &inputs(), &outputs, lanes, &[1.5, 0.0], &results[1]);
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
    let sin = leverrier::internals::expr::Function::by_name("sin").unwrap();
    for _ in 0..50_000 {
        expr = graph.apply(sin, expr);
    }
    let results = evaluate(&graph, &inputs(), &[expr], 2, &[0.0, 0.0]);
    assert!(results.iter().flatten().all(|x| x.is_finite()));
}

/// Far more values at once than there are registers, needed in an order of no use.
#[test]
fn values_that_find_no_register_are_kept() {
    (0..8).for_each(crowded);
}

fn crowded(seed: usize) {
    let mut graph = Graph::new();
    let symbols = [Symbol::Coordinate(0), Symbol::Time, Symbol::Momentum(0)];
    let [q, t, p] = symbols.map(|symbol| graph.symbol(symbol));
    let tanh = leverrier::internals::expr::Function::by_name("tanh").unwrap();
    let mut pool: Vec<Expr> = (0..90)
        .map(|k| {
            let part = 0.0005 * k as f64;
            let sum = graph.linear(0.05 + part, &[(0.03, q), (0.01 + part, t), (-part, p)]);
            if k % 30 == 7 { graph.apply(tanh, sum) } else { sum }
        })
        .collect();
    for round in 0..400 {
        let pick =
            |k: usize| pool[(round * (31 + 2 * seed) + k * 53 + seed + round * round * 11) % 90];
        // Sums of bare products: both factors may have left their registers.
        let mut parts = vec![(0.4, pick(0))];
        for k in 1..3 {
            parts.push((1.0, graph.multiply(pick(2 * k), pick(2 * k + 1))));
        }
        pool[(round * 41) % 90] = graph.linear(0.01, &parts);
    }
    for lanes in [1, 40] {
        let results = evaluate(&graph, &inputs(), &pool, lanes, &[0.7, 0.0]);
        same_bits(&graph, &inputs(), &pool, lanes, &[0.7, 0.0], &results[1]);
        for (a, b) in results[0].iter().zip(&results[1]) {
            assert!((a - b).abs() <= 1e-11 * (1.0 + a.abs()), "{a:e} {b:e}");
        }
    }
}

/// The polynomial of the comparisons with other tools: degree 6 in each of two variables.
fn dense_gradient() -> (Graph, Inputs, Vec<Expr>) {
    let mut graph = Graph::new();
    let variables = [Symbol::Coordinate(0), Symbol::Coordinate(1)];
    let [x, y] = variables.map(|symbol| graph.symbol(symbol));
    let mut parts = Vec::new();
    for k in 1..49 {
        let c = graph.symbol(Symbol::Coefficient(k));
        let (i, j) = ((k / 7) as f64, (k % 7) as f64);
        parts.push((1.0, graph.product(1.0, &[(c, 1.0), (x, i), (y, j)])));
    }
    let energy = graph.linear(0.0, &parts);
    let outputs = variables.map(|symbol| graph.derivative(energy, symbol)).to_vec();
    let uniform = (1..49).map(Symbol::Coefficient).collect();
    (graph, Inputs { varying: variables.to_vec(), uniform }, outputs)
}

#[test]
fn polynomials_are_nested_when_that_is_shorter() {
    let (graph, inputs, outputs) = dense_gradient();
    // 42 terms in each component: 41 fused steps, and two inputs.
    assert_eq!(length(&graph, &inputs, &outputs).cost, 84);
    // With every monomial asked for as well, the sums take one step a term.
    let mut graph = graph;
    let mut all = outputs.clone();
    for output in &outputs {
        for coefficient in &inputs.uniform {
            all.push(graph.derivative(*output, *coefficient));
        }
    }
    let both = length(&graph, &inputs, &all);
    assert!(both.cost <= 84 + 84 + 48, "{both:?}");
}

#[test]
fn tapes_of_the_known_systems_do_not_grow() {
    // The cost of the gradient of H: inputs, and one for each multiplication or addition.
    let pinned = [
        ("harmonic oscillator", 2),
        ("pendulum", 10),
        ("Henon-Heiles", 9),
        ("Kepler", 17),
        ("coupled quartic oscillators", 8),
    ];
    let mut found = Vec::new();
    for (name, _) in pinned {
        let row = systems::SYSTEMS.iter().find(|row| row.name == name).unwrap();
        let mut system = (row.build)();
        let parts = [system.kinetic, system.potential, system.hamiltonian];
        let energy = system.graph.sum(&parts);
        let state = system.state();
        let outputs: Vec<Expr> =
            state.iter().map(|&symbol| system.graph.derivative(energy, symbol)).collect();
        let inputs = Inputs { varying: state, uniform: Vec::new() };
        found.push((name, length(&system.graph, &inputs, &outputs).cost));
    }
    assert_eq!(found, pinned);
}

#[cfg(target_arch = "x86_64")]
#[test]
fn machine_code_runs_where_it_can_and_not_elsewhere() {
    let (graph, inputs, outputs) = dense_gradient();
    for set in InstructionSet::available() {
        let function = compile_for(&graph, &inputs, &outputs, Backend::Machine, set);
        let expected =
            if set == InstructionSet::Plain { Backend::Batched } else { Backend::Machine };
        assert_eq!(function.backend(), expected);
    }
}
