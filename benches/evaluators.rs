//! Evaluators: the gradient of a dense polynomial by hand and by every backend and instruction
//! set, the elementary functions beside the standard library's.
//!
//! `cargo bench --bench evaluators`; times are for 100,000 points.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a benchmark that fails stops"
)]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use leverrier::internals::eval::{Backend, Inputs, InstructionSet, apply, compile_for};
use leverrier::internals::expr::{Expr, Function, Graph, Symbol};

const POINTS: usize = 100_000;
const DEGREE: usize = 6;

/// Every monomial up to a degree in each of two variables, with a coefficient of its own; on
/// request sin and exp of them besides.
fn gradient(functions: bool) -> (Graph, Inputs, Vec<Expr>, Vec<f64>) {
    let mut graph = Graph::new();
    let variables = [Symbol::Coordinate(0), Symbol::Coordinate(1)];
    let [x, y] = variables.map(|symbol| graph.symbol(symbol));
    let mut parts = Vec::new();
    let terms = (DEGREE + 1) * (DEGREE + 1);
    for k in 1..terms {
        let c = graph.symbol(Symbol::Coefficient(k));
        let powers = [(k / (DEGREE + 1)) as f64, (k % (DEGREE + 1)) as f64];
        parts.push((1.0, graph.product(1.0, &[(c, 1.0), (x, powers[0]), (y, powers[1])])));
    }
    if functions {
        let product = graph.multiply(x, y);
        for (name, inside) in [("sin", x), ("exp", y), ("sin", product)] {
            let function = Function::by_name(name).expect("a row of the table");
            parts.push((0.3, graph.apply(function, inside)));
        }
    }
    let energy = graph.linear(0.0, &parts);
    let outputs = variables.map(|symbol| graph.derivative(energy, symbol)).to_vec();
    let inputs = Inputs {
        varying: variables.to_vec(),
        uniform: (1..terms).map(Symbol::Coefficient).collect(),
    };
    let coefficients = (1..terms).map(|k| 0.1 * (1.7 * k as f64).sin()).collect();
    (graph, inputs, outputs, coefficients)
}

/// The same as one writes it: powers first, then the sums.
fn by_hand(c: &[f64], x: &[f64], y: &[f64], out: &mut [f64]) {
    let (first, second) = out.split_at_mut(x.len());
    for lane in 0..x.len() {
        let (mut px, mut py) = ([1.0; DEGREE + 1], [1.0; DEGREE + 1]);
        for k in 1..=DEGREE {
            px[k] = px[k - 1] * x[lane];
            py[k] = py[k - 1] * y[lane];
        }
        let (mut by_x, mut by_y) = (0.0, 0.0);
        for i in 0..=DEGREE {
            for j in 0..=DEGREE {
                let k = i * (DEGREE + 1) + j;
                if i > 0 {
                    by_x += c[k - 1] * i as f64 * px[i - 1] * py[j];
                }
                if j > 0 {
                    by_y += c[k - 1] * j as f64 * px[i] * py[j - 1];
                }
            }
        }
        (first[lane], second[lane]) = (by_x, by_y);
    }
}

fn evaluators(criterion: &mut Criterion) {
    let points: Vec<f64> = (0..2 * POINTS).map(|i| (0.37 * i as f64).sin()).collect();
    let mut out = vec![0.0; 2 * POINTS];
    for (name, functions) in [("gradient", false), ("gradient with sin and exp", true)] {
        let (graph, inputs, outputs, coefficients) = gradient(functions);
        let mut group = criterion.benchmark_group(name);
        group.throughput(Throughput::Elements(POINTS as u64)).sample_size(20);
        if !functions {
            let (x, y) = points.split_at(POINTS);
            group.bench_function("by hand", |bencher| {
                bencher.iter(|| by_hand(black_box(&coefficients), x, y, &mut out));
            });
        }
        for backend in [Backend::Batched, Backend::Machine] {
            for set in InstructionSet::available() {
                if set == InstructionSet::Plain {
                    continue;
                }
                let function = compile_for(&graph, &inputs, &outputs, backend, set);
                let mut workspace = Vec::new();
                group.bench_function(format!("{backend:?}, {set:?}"), |bencher| {
                    bencher.iter(|| {
                        function.evaluate(
                            &points,
                            black_box(&coefficients),
                            POINTS,
                            &mut out,
                            &mut workspace,
                        );
                    });
                });
            }
            group.bench_function(format!("{backend:?}, compilation"), |bencher| {
                let set = InstructionSet::widest();
                bencher.iter(|| compile_for(&graph, &inputs, &outputs, backend, set).outputs());
            });
        }
        group.finish();
    }
}

fn functions(criterion: &mut Criterion) {
    let x: Vec<f64> = (0..4096).map(|i| 0.01 + 0.005 * f64::from(i)).collect();
    let mut out = vec![0.0; x.len()];
    let mut group = criterion.benchmark_group("functions");
    group.throughput(Throughput::Elements(x.len() as u64)).sample_size(20);
    for function in Function::all() {
        let row = function.row();
        group.bench_function(format!("{}, widest", row.name), |bencher| {
            bencher.iter(|| apply(InstructionSet::widest(), function, black_box(&x), &mut out));
        });
        group.bench_function(format!("{}, standard library", row.name), |bencher| {
            bencher.iter(|| {
                out.iter_mut().zip(black_box(&x)).for_each(|(out, &x)| *out = (row.value)(x));
            });
        });
    }
    group.finish();
}

criterion_group!(benches, evaluators, functions);
criterion_main!(benches);
