//! One long trajectory of Hénon-Heiles: the fourth-order method by hand, by the batched
//! evaluator and in machine code, and the Taylor series.
//!
//! `cargo bench --bench trajectory`; times are for 20,000 steps of 0.01, or for the same span.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a benchmark that fails stops"
)]

#[path = "../examples/peers/by_hand.rs"]
mod by_hand;

use std::hint::black_box;

use by_hand::by_hand;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use leverrier::internals::dynamics::systems::SYSTEMS;
use leverrier::internals::dynamics::{Batch, Dynamics, Method, Scratch, advance, taylor};
use leverrier::internals::eval::Backend;

const STEPS: usize = 20_000;
const STEP: f64 = 0.01;

fn trajectories(criterion: &mut Criterion) {
    let row = SYSTEMS.iter().find(|row| row.name == "Henon-Heiles").expect("a row of the table");
    let system = (row.build)();
    let mut group = criterion.benchmark_group("Henon-Heiles");
    group.throughput(Throughput::Elements(STEPS as u64)).sample_size(20);
    group.bench_function("fourth order by hand", |bencher| {
        let mut state = [0.1, 0.2, 0.35, 0.1];
        bencher.iter(|| by_hand(black_box(&mut state), STEP, STEPS));
    });
    for backend in [Backend::Batched, Backend::Machine] {
        let dynamics = Dynamics::known(&system, backend);
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
