//! Statistics that are promised: how often intervals hold the truth, p-values where nothing is
//! hidden, how often a term that is chosen belongs to the law. Every case has a seed, which is its
//! number.

use leverrier::internals::data::Dataset;
use leverrier::internals::diagnose::candidates::candidates;
use leverrier::internals::diagnose::diagnosis::{Verdict, diagnose};
use leverrier::internals::diagnose::noise_floor::noise_floor;
use leverrier::internals::diagnose::scan::scan;
use leverrier::internals::diagnose::settling::settle;
use leverrier::internals::diagnose::{LawOnData, Options};
use leverrier::internals::expr::{Compiled, Scope, build};
use leverrier::internals::fit::{self, Model, Silent, fit};
use leverrier::internals::simulate::Simulator;
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

/// A law, what is known of it, and the numbers that are not.
pub(crate) struct Promised {
    /// What it is called.
    pub name: &'static str,
    head: &'static str,
    law: &'static str,
    space: &'static str,
    /// Learned terms and their true coefficients; others of the space are not in the law.
    truth: &'static [(&'static str, f64)],
    amplitude: f64,
}

/// The laws. One is a row.
pub(crate) const LAWS: &[Promised] = &[
    Promised {
        name: "pendulum",
        head: "coordinates q\nmomenta p\n",
        law: "T = p^2/2\nV = -cos(q)\n",
        space: "T = p^2/2\nV = span{ cos(q) }\nforce q += span{ -p }\n",
        truth: &[("cos(q)", -1.0)],
        amplitude: 1.3,
    },
    Promised {
        name: "Duffing",
        head: "coordinates q\nmomenta p\n",
        law: "T = p^2/2\nV = q^2/2 + q^4/4\n",
        space: "T = span{ p^2 }\nV = span{ poly(q; 4) }\n",
        truth: &[("p^2", 0.5), ("q^2", 0.5), ("q^4", 0.25)],
        amplitude: 1.1,
    },
    Promised {
        name: "trap",
        head: "coordinates x, y\nmomenta px, py\n",
        law: "T = (px^2 + py^2)/2\nV = x^2/2 + 0.7*y^2\n",
        space: "T = (px^2 + py^2)/2\nV = span{ x^2, y^2, x^2*y }\n",
        truth: &[("x^2", 0.5), ("y^2", 0.7)],
        amplitude: 1.0,
    },
];

const RUNS: usize = 5;
const SAMPLES: usize = 60;
/// Standard deviation of the noise.
const NOISE: f64 = 0.02;

fn compiled(text: &str) -> Compiled {
    build("promised", text).unwrap_or_else(|error| panic!("{text}\n{error}"))
}

/// Measurements of a law with a noise of its own for each seed, whose neighbours are correlated by
/// `memory`: 0 for white noise.
fn measured(row: &Promised, seed: u64, memory: f64) -> Dataset {
    let law = compiled(&format!("{}{}", row.head, row.law));
    let mut random = Pcg64::seed_from_u64(seed);
    let degrees = law.system.degrees();
    let mut start = || -> Vec<f64> {
        (0..2 * degrees).map(|_| row.amplitude * random.random_range(-1.0..1.0)).collect()
    };
    let starts: Vec<Vec<f64>> = (0..RUNS).map(|_| start()).collect();
    let times: Vec<f64> = (0..SAMPLES).map(|at| 0.1 * at as f64).collect();
    let simulator = Simulator::known(&law.system);
    let mut data = simulator.trajectories(&starts, &times).expect("bounded").dataset(&law.system);
    for values in data.runs.iter_mut().flat_map(|run| &mut run.values) {
        let mut last: f64 = StandardNormal.sample(&mut random);
        for value in values {
            *value += NOISE * last;
            let next: f64 = StandardNormal.sample(&mut random);
            last = memory * last + (1.0 - memory * memory).sqrt() * next;
        }
    }
    data
}

fn learned(row: &Promised, data: &Dataset) -> (Compiled, Model) {
    let space = compiled(&format!("{}{}", row.head, row.space));
    let model = fit(&space.system, data, &fit::Options::default(), &Silent).expect("a model");
    (space, model)
}

/// What the fits of some seeds say of the numbers of a law.
#[derive(Debug, Default, Clone)]
pub(crate) struct Coverage {
    /// Coefficients of the law that were chosen.
    pub intervals: usize,
    /// Of these, how many lie within 1, 1.96 and 3 standard errors of the truth.
    pub within: [usize; 3],
    /// Terms of the law that were not chosen.
    pub lost: usize,
    /// By tenths of the inclusion frequency: terms that were chosen, and how many of them belong to
    /// the law.
    pub inclusion: [(usize, usize); 10],
}

impl Coverage {
    pub(crate) fn of(row: &Promised, seeds: std::ops::Range<u64>) -> Self {
        let mut all = Coverage::default();
        for seed in seeds {
            let (_, model) = learned(row, &measured(row, seed, 0.0));
            for term in &model.terms {
                let truth = row.truth.iter().find(|(name, _)| *name == term.term);
                if let Some(inclusion) = term.inclusion {
                    let tenth = ((inclusion * 10.0) as usize).min(9);
                    all.inclusion[tenth].0 += 1;
                    all.inclusion[tenth].1 += usize::from(truth.is_some());
                }
                let Some((_, value)) = truth else { continue };
                all.intervals += 1;
                let off = (term.coefficient - value).abs() / term.standard_error;
                for (count, width) in all.within.iter_mut().zip([1.0, 1.959_964, 3.0]) {
                    *count += usize::from(off < width);
                }
            }
            let has = |name: &str| model.terms.iter().any(|term| term.term == name);
            all.lost += row.truth.iter().filter(|(name, _)| !has(name)).count();
        }
        all
    }

    pub(crate) fn share(&self, at: usize) -> f64 {
        self.within[at] as f64 / self.intervals.max(1) as f64
    }
}

/// p-values of single candidates before any correction, for data in which nothing is hidden.
///
/// One candidate a case, so that the cases are independent; which one goes round with the seed.
pub(crate) fn p_values(row: &Promised, seeds: std::ops::Range<u64>) -> Vec<f64> {
    let options = Options::default();
    seeds
        .map(|seed| {
            let data = measured(row, 1_000_000 + seed, 0.0);
            let (space, model) = learned(row, &data);
            let law = model.law_of(&space.system).expect("its own");
            let law = LawOnData::of(law, &data, &options);
            let law = law.with_noise(noise_floor(&law));
            let mut scope = Scope::of(&space);
            let mut all = candidates(&mut scope, &data, &options.tuning.candidates);
            // Those without inner numbers have one p-value; the best of a grid is not uniform.
            all.retain(|candidate| candidate.grid.len() == 1 && candidate.parameters.is_empty());
            let scored = scan(&settle(law), None, &all).expect("scores").scored;
            assert!(scored.len() > 20, "{} scores", scored.len());
            scored[(seed as usize * 7919) % scored.len()].score.p_value
        })
        .collect()
}

/// How often something is told of measurements in which nothing is hidden, with white noise or
/// noise with a memory, which the options then know of.
pub(crate) fn told(row: &Promised, seeds: std::ops::Range<u64>, memory: f64) -> (usize, usize) {
    let mut options = Options::default();
    if memory > 0.0 {
        // What `--correlated-noise` sets.
        options.tuning.autocorrelation.largest = 4.0;
    }
    let (mut missing, mut unexplained) = (0, 0);
    for seed in seeds {
        let data = measured(row, 2_000_000 + seed, memory);
        let split = data.split_held_out(0.25, seed);
        let (space, model) = learned(row, &split.training);
        let law = model.law_of(&space.system).expect("its own");
        let found = diagnose(&space, &law, &split.training, &split.held_out, &options, &Silent);
        match found.expect("a diagnosis").verdict {
            Verdict::Missing => missing += 1,
            Verdict::Unexplained => unexplained += 1,
            _ => {}
        }
    }
    (missing, unexplained)
}

/// The largest distance of the distribution of some numbers from the even one on 0 to 1, and the
/// probability that even numbers are as far (Kolmogorov and Smirnov; the series of Stephens,
/// J. Roy. Stat. Soc. B 32, 1970).
pub(crate) fn kolmogorov_smirnov(values: &[f64]) -> (f64, f64) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let count = sorted.len() as f64;
    let distance = sorted.iter().enumerate().fold(0.0, |most: f64, (at, value)| {
        most.max(value - at as f64 / count).max((at + 1) as f64 / count - value)
    });
    let scaled = (count.sqrt() + 0.12 + 0.11 / count.sqrt()) * distance;
    let term = |k: i32| {
        let sign = if k % 2 == 1 { 1.0 } else { -1.0 };
        sign * (-2.0 * f64::from(k * k) * scaled * scaled).exp()
    };
    (distance, (2.0 * (1..100).map(term).sum::<f64>()).clamp(0.0, 1.0))
}
