//! Speed of a diagnosis with the whole catalogue, against the number of samples.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a benchmark that fails stops"
)]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};

#[path = "../examples/growth/trap.rs"]
mod trap;

fn whole_catalogue(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("diagnose a two-dimensional trap with a drag");
    group.sample_size(10);
    for samples in [1_250usize, 2_500, 5_000, 10_000] {
        let trap = trap::Trap::new(samples);
        group.throughput(Throughput::Elements(samples as u64));
        group.bench_function(BenchmarkId::from_parameter(samples), |bencher| {
            bencher.iter(|| trap.diagnose());
        });
    }
    group.finish();
}

criterion_group!(benches, whole_catalogue);
criterion_main!(benches);
