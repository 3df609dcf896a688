//! Speed of a diagnosis with the whole catalogue, against the number of samples.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use leverrier::diagnose::missing::diagnose;
use leverrier::expr::build;
use leverrier::fit::{Options, Silent, fit};
use leverrier::simulate::Simulator;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

const VARIABLES: &str = "coordinates x, y\nmomenta px, py\n";
const LAW: &str = "T = (px^2 + py^2)/2\nV = x^2/2 + 0.7*y^2\nforce x += -0.04*px\n";
const SPACE: &str = "T = (px^2 + py^2)/2\nV = span{ x^2, y^2 }\n";
/// Samples of a run.
const RUN: usize = 250;

fn whole_catalogue(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("diagnose a two-dimensional trap with a drag");
    group.sample_size(10);
    for samples in [1_250usize, 2_500, 5_000, 10_000] {
        let truth = build("truth", &format!("{VARIABLES}{LAW}")).expect("a sound spec");
        let mut generator = Pcg64::seed_from_u64(1);
        // As many runs again are unseen.
        let starts: Vec<Vec<f64>> = (0..2 * samples / RUN)
            .map(|_| (0..4).map(|_| generator.random_range(-1.0..1.0)).collect())
            .collect();
        let times: Vec<f64> = (0..RUN).map(|i| 0.1 * i as f64).collect();
        let simulator = Simulator::new(&truth.system, &[], &[], &[]);
        let motion = simulator.trajectories(&starts, &times).expect("it stays finite");
        let mut data = motion.dataset(&truth.system);
        for x in data.runs.iter_mut().flat_map(|run| run.values.iter_mut()).flatten() {
            let draw: f64 = StandardNormal.sample(&mut generator);
            *x += 0.01 * draw;
        }
        let split = data.split_unseen(0.5, 1);
        let text = format!("{VARIABLES}{SPACE}");
        let learned = build("learned", &text).expect("a sound spec");
        let model = fit(&learned.system, &split.training, &Options::default(), &Silent)
            .expect("a model is found");
        group.throughput(Throughput::Elements(samples as u64));
        group.bench_function(BenchmarkId::from_parameter(samples), |bencher| {
            bencher.iter(|| {
                diagnose(
                    "learned",
                    &text,
                    &learned,
                    &model,
                    &split.training,
                    &split.unseen,
                    &Silent,
                )
            });
        });
    }
    group.finish();
}

criterion_group!(benches, whole_catalogue);
criterion_main!(benches);
