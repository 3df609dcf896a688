//! One long trajectory of Hénon-Heiles: the fourth-order method by hand, by the batched
//! evaluator and in machine code, and the Taylor series.
//!
//! `cargo bench --bench trajectory`; times are for 20,000 steps of 0.01, or for the same span.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use leverrier::dynamics::systems::SYSTEMS;
use leverrier::dynamics::{Batch, Dynamics, Method, Scratch, advance, taylor};
use leverrier::eval::Backend;

const STEPS: usize = 20_000;
const STEP: f64 = 0.01;

/// Forest and Ruth's method as one writes it.
fn by_hand(state: &mut [f64; 4]) {
    let outer = 1.0 / (2.0 - 2.0_f64.cbrt());
    let weights = [outer, 1.0 - 2.0 * outer, outer];
    let drifts = [
        0.5 * weights[0] * STEP,
        0.5 * (weights[0] + weights[1]) * STEP,
        0.5 * (weights[1] + weights[2]) * STEP,
        0.5 * weights[2] * STEP,
    ];
    let [mut x, mut y, mut u, mut v] = *state;
    for _ in 0..STEPS {
        for (drift, weight) in drifts.iter().zip(weights) {
            x += drift * u;
            y += drift * v;
            let kick = weight * STEP;
            u -= kick * (x + 2.0 * x * y);
            v -= kick * (y + x * x - y * y);
        }
        x += drifts[3] * u;
        y += drifts[3] * v;
    }
    *state = [x, y, u, v];
}

fn trajectories(criterion: &mut Criterion) {
    let row = SYSTEMS.iter().find(|row| row.name == "Henon-Heiles").expect("a row of the table");
    let system = (row.build)();
    let mut group = criterion.benchmark_group("Henon-Heiles");
    group.throughput(Throughput::Elements(STEPS as u64)).sample_size(20);
    group.bench_function("fourth order by hand", |bencher| {
        let mut state = [0.1, 0.2, 0.35, 0.1];
        bencher.iter(|| by_hand(black_box(&mut state)));
    });
    for backend in [Backend::Batched, Backend::Machine] {
        let dynamics = Dynamics::new(&system, &[], backend);
        let method = Method::by_name("forest-ruth").expect("a row of the table");
        let mut batch = Batch::new(2, 1);
        batch.set(0, 0.0, row.start);
        let mut scratch = Scratch::new();
        let span = [STEPS as f64 * STEP];
        group.bench_function(format!("fourth order, {backend:?}"), |bencher| {
            bencher.iter(|| {
                advance(&dynamics, method, &mut batch, &span, STEPS, &[], &mut scratch);
            });
        });
        group.bench_function(format!("Taylor series, {backend:?}"), |bencher| {
            let times = [0.0, span[0]];
            bencher.iter(|| taylor(&dynamics, &[], black_box(row.start), &times, 0.0));
        });
    }
    group.finish();
}

criterion_group!(benches, trajectories);
criterion_main!(benches);
