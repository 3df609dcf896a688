//! Whole fits: the paper's Hénon-Heiles pairs and its chain of five masses.
//!
//! `cargo bench --bench fit`; one core: `RAYON_NUM_THREADS=1`.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a benchmark that fails stops"
)]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use leverrier::internals::data::Dataset;
use leverrier::internals::expr::build;
use leverrier::internals::fit::{Options, Silent, fit};
use leverrier::internals::simulate::{NoiseLevel, Simulator, add_noise, consecutive_pairs};

const HENON_HEILES: &str = "coordinates q[1..2]\nmomenta p[1..2]\n\
    T = (p[1]^2 + p[2]^2)/2\nV = (q[1]^2 + q[2]^2)/2 + q[1]^2*q[2] - q[2]^3/3\n";
const SPRINGS: &str = "coordinates q[1..5]\nmomenta p[1..5]\n\
    T = sum(p[i]^2/(1 + 0.6*i) for i in 1..5)\n\
    V = sum((0.2 + 0.1*i)*(q[i+1] - q[i])^2 for i in 1..4) + 0.35*q[1]^2 + 0.45*q[5]^2\n";

/// Pairs 0.1 apart, cut from ten trajectories.
fn pairs(law: &str, degrees: usize, count: usize, sigma: f64) -> Dataset {
    let law = build("law", law).expect("a sound spec");
    let times: Vec<f64> = (0..=count / 10).map(|i| i as f64 * 0.1).collect();
    let starts: Vec<Vec<f64>> = (0..10)
        .map(|i| {
            let angle = |c: usize| 2.4 * i as f64 + 1.7 * c as f64 + 0.3;
            (0..2 * degrees).map(|c| 0.28 * angle(c).sin()).collect()
        })
        .collect();
    let simulator = Simulator::known(&law.system);
    let runs = simulator.trajectories(&starts, &times).expect("bounded motion");
    let mut data = consecutive_pairs(&runs.dataset(&law.system));
    if sigma > 0.0 {
        let noise = vec![NoiseLevel::Absolute(sigma); 2 * degrees];
        add_noise(&mut data, &noise, 1).expect("a positive sigma");
    }
    data
}

/// (name, law, degrees of freedom, family of both T and V, pairs, noise)
const CASES: [(&str, &str, usize, &str, usize, f64); 7] = [
    ("Henon-Heiles, clean, degree 3", HENON_HEILES, 2, "tensor 3", 5000, 0.0),
    ("Henon-Heiles, noisy, degree 3", HENON_HEILES, 2, "tensor 3", 5000, 0.005),
    ("Henon-Heiles, noisy, degree 6", HENON_HEILES, 2, "tensor 6", 5000, 0.005),
    ("Henon-Heiles, noisy, degree 10", HENON_HEILES, 2, "tensor 10", 5000, 0.005),
    ("springs, noisy, degree 2", SPRINGS, 5, "pairs 2", 800, 0.005),
    ("springs, noisy, degree 4", SPRINGS, 5, "pairs 4", 800, 0.005),
    ("springs, noisy, degree 6", SPRINGS, 5, "pairs 6", 800, 0.005),
];

fn fits(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("fit");
    group.sample_size(10);
    for (name, law, degrees, family, count, sigma) in CASES {
        let data = pairs(law, degrees, count, sigma);
        let (family, degree) = family.split_once(' ').expect("a family and a degree");
        let space = format!(
            "coordinates q[1..{degrees}]\nmomenta p[1..{degrees}]\n\
             T = span{{ {family}(p; {degree}) }}\nV = span{{ {family}(q; {degree}) }}\n"
        );
        let space = build("space", &space).expect("a sound spec");
        let options = Options::default();
        group.bench_function(name, |bencher| {
            bencher.iter(|| black_box(fit(&space.system, &data, &options, &Silent)));
        });
    }
    group.finish();
}

criterion_group!(benches, fits);
criterion_main!(benches);
