//! The four systems of DiPietro, Xiong and Zhu (2020): their laws, their data as the paper's
//! code makes them, and what is measured of a fit. Shared by the tests of recovery and by the
//! program that prints the table.

pub(crate) mod bound;
pub(crate) mod figures;

use std::sync::Arc;

use leverrier::internals::data::Dataset;
use leverrier::internals::expr::{Compiled, System, build};
use leverrier::internals::fit::{self, Model, Options, Silent};
use leverrier::internals::simulate::{
    InitialDistribution, Interval as Side, NoiseLevel, Simulator, add_noise, consecutive_pairs,
    draw,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Time between the samples of every data set of the paper.
pub(crate) const STEP: f64 = 0.1;
/// Standard deviation of the noise of every noisy data set.
pub(crate) const SIGMA: f64 = 0.005;

/// A law: its spec, and the terms that an exact fit has.
pub(crate) struct Law {
    pub spec: String,
    /// Part, term and coefficient.
    pub terms: Vec<(&'static str, String, f64)>,
}

/// Compiles a spec.
pub(crate) fn system(spec: &str) -> Arc<System> {
    match build("spec", spec) {
        Ok(Compiled { system, .. }) => system,
        Err(error) => panic!("{error}\n{spec}"),
    }
}

/// A spec that searches two function spaces.
pub(crate) fn space(variables: &str, kinetic: &str, potential: &str) -> Arc<System> {
    system(&format!("{variables}\nT = span{{ {kinetic} }}\nV = span{{ {potential} }}"))
}

const TWO: &str = "coordinates q[1..2]\nmomenta p[1..2]";
const FIVE: &str = "coordinates q[1..5]\nmomenta p[1..5]";

/// The bivariate spaces of the paper's sections 4.2 and 4.3.
pub(crate) fn tensor(degree: u32) -> Arc<System> {
    space(TWO, &format!("tensor(p; {degree})"), &format!("tensor(q; {degree})"))
}

/// The five-variable spaces of the paper's section 4.4.
pub(crate) fn pairs(degree: u32) -> Arc<System> {
    space(FIVE, &format!("pairs(p; {degree})"), &format!("pairs(q; {degree})"))
}

fn law(variables: &str, energies: &str, terms: &[(&'static str, &str, f64)]) -> Law {
    let terms = terms.iter().map(|&(place, term, value)| (place, term.to_string(), value));
    Law { spec: format!("{variables}\n{energies}"), terms: terms.collect() }
}

fn side(lower: f64, upper: f64) -> Side {
    Side { lower, upper }
}

/// Section 4.3.
pub(crate) fn henon_heiles() -> Law {
    law(
        TWO,
        "T = (p[1]^2 + p[2]^2)/2\nV = (q[1]^2 + q[2]^2)/2 + q[1]^2*q[2] - q[2]^3/3",
        &[
            ("T", "p[1]^2", 0.5),
            ("T", "p[2]^2", 0.5),
            ("V", "q[1]^2", 0.5),
            ("V", "q[2]^2", 0.5),
            ("V", "q[1]^2*q[2]", 1.0),
            ("V", "q[2]^3", -1.0 / 3.0),
        ],
    )
}

/// 5,000 pairs at chaotic energies.
pub(crate) fn henon_heiles_pairs(count: usize, sigma: f64, seed: u64) -> Dataset {
    let sampling = InitialDistribution {
        intervals: vec![side(-1.0, 1.0), side(-0.5, 1.0), side(-1.0, 1.0), side(-1.0, 1.0)],
        energy: Some(side(1.0 / 12.0, 1.0 / 6.0)),
    };
    runs(&henon_heiles(), &sampling, count, 2, sigma, seed)
}

/// Section 4.2.
pub(crate) fn coupled() -> Law {
    law(
        TWO,
        "T = (p[1]^2 + p[2]^2)/2\nV = (q[1]^2 + q[2]^2 + q[1]^2*q[2]^2)/2",
        &[
            ("T", "p[1]^2", 0.5),
            ("T", "p[2]^2", 0.5),
            ("V", "q[1]^2", 0.5),
            ("V", "q[2]^2", 0.5),
            ("V", "q[1]^2*q[2]^2", 0.5),
        ],
    )
}

fn anywhere(components: usize) -> InitialDistribution {
    InitialDistribution { intervals: vec![side(-1.0, 1.0); components], energy: None }
}

/// 500 consecutive pairs of one clean motion.
pub(crate) fn coupled_clean(seed: u64) -> Dataset {
    consecutive_pairs(&runs(&coupled(), &anywhere(4), 1, 501, 0.0, seed))
}

/// 200 noisy runs to t = 0.3, sampled every 0.1.
pub(crate) fn coupled_noisy(sigma: f64, seed: u64) -> Dataset {
    runs(&coupled(), &anywhere(4), 200, 4, sigma, seed)
}

/// Section 4.4: random masses and springs.
pub(crate) fn mass_spring(seed: u64) -> Law {
    let mut generator = Pcg64::seed_from_u64(seed ^ 0x6d61_7373);
    let mut uniform =
        |lower: f64, upper: f64| lower + (upper - lower) * generator.random_range(0.0..1.0);
    let k: Vec<f64> = (0..6).map(|_| uniform(0.05, 0.4)).collect();
    let m: Vec<f64> = (0..5).map(|_| uniform(1.0, 5.0)).collect();
    let length = 1.5;
    let mut terms = Vec::new();
    let mut kinetic = Vec::new();
    let mut potential = vec![format!("{}*q[1]^2", k[0]), format!("{}*({length} - q[5])^2", k[5])];
    for i in 0..5 {
        kinetic.push(format!("p[{}]^2/{}", i + 1, m[i]));
        terms.push(("T", format!("p[{}]^2", i + 1), 0.5 / m[i]));
        terms.push(("V", format!("q[{}]^2", i + 1), (k[i] + k[i + 1]) / 2.0));
    }
    for (i, stiffness) in k.iter().enumerate().take(5).skip(1) {
        potential.push(format!("{stiffness}*(q[{}] - q[{i}])^2", i + 1));
        terms.push(("V", format!("q[{i}]*q[{}]", i + 1), -stiffness));
    }
    terms.push(("V", "q[5]".to_string(), -k[5] * length));
    let spec =
        format!("{FIVE}\nT = ({})/2\nV = ({})/2", kinetic.join(" + "), potential.join(" + "));
    Law { spec, terms }
}

/// 800 consecutive pairs of one motion, each copy of each sample with its own noise.
pub(crate) fn mass_spring_pairs(law: &Law, sigma: f64, seed: u64) -> Dataset {
    let mut intervals: Vec<Side> =
        [0.25, 0.5, 0.75, 1.0, 1.25].iter().map(|&q| side(q, q)).collect();
    intervals.extend(vec![side(-0.1, 0.1); 5]);
    let mut data = consecutive_pairs(&runs(
        law,
        &InitialDistribution { intervals, energy: None },
        1,
        801,
        0.0,
        seed,
    ));
    noisy(&mut data, sigma, seed);
    data
}

/// Section 4.1: g = l = 1, m = 2.
pub(crate) fn pendulum() -> Law {
    law(
        "coordinates q\nmomenta p",
        "T = p^2/4\nV = -2*cos(q)",
        &[("T", "p^2", 0.25), ("V", "cos(q)", -2.0)],
    )
}

/// 200 consecutive pairs from 1.4 at rest.
pub(crate) fn pendulum_pairs() -> Dataset {
    let sampling =
        InitialDistribution { intervals: vec![side(1.4, 1.4), side(0.0, 0.0)], energy: None };
    consecutive_pairs(&runs(&pendulum(), &sampling, 1, 201, 0.0, 0))
}

/// The three spaces of the pendulum.
pub(crate) enum PendulumSpace {
    /// Cubic T, shifted sine V.
    Sine,
    /// Cubic and shifted sine for both.
    Mixed,
    /// Quintic polynomials.
    Polynomial,
}

/// The spec of one of the pendulum's spaces.
pub(crate) fn pendulum_space(which: &PendulumSpace) -> Arc<System> {
    let (variables, kinetic, potential) = match which {
        PendulumSpace::Sine => (
            "coordinates q\nmomenta p\nparam a = 0\nparam b = 0",
            "poly(p; 3)",
            "sin((1 + a)*q + b)",
        ),
        PendulumSpace::Mixed => (
            "coordinates q\nmomenta p\nparam a = 0\nparam b = 0\nparam c = 0\nparam d = 0",
            "poly(p; 3), sin((1 + c)*p + d)",
            "poly(q; 3), sin((1 + a)*q + b)",
        ),
        PendulumSpace::Polynomial => ("coordinates q\nmomenta p", "poly(p; 5)", "poly(q; 5)"),
    };
    space(variables, kinetic, potential)
}

/// Runs of a law from random starts.
fn runs(
    law: &Law,
    sampling: &InitialDistribution,
    count: usize,
    samples: usize,
    sigma: f64,
    seed: u64,
) -> Dataset {
    let system = system(&law.spec);
    let nature = Simulator::known(&system);
    let starts = draw(&nature, sampling, count, 0.0, seed).expect("states in the intervals");
    let times: Vec<f64> = (0..samples).map(|i| STEP * i as f64).collect();
    let trajectories = nature.trajectories(&starts, &times).expect("bounded motion");
    let mut data = trajectories.dataset(&system);
    noisy(&mut data, sigma, seed);
    data
}

fn noisy(data: &mut Dataset, sigma: f64, seed: u64) {
    if sigma > 0.0 {
        let all = vec![NoiseLevel::Absolute(sigma); data.observables.len()];
        add_noise(data, &all, seed).expect("a positive width");
    }
}

/// A fit with the defaults, as every figure is made.
pub(crate) fn learn(system: &Arc<System>, data: &Dataset) -> Model {
    learn_with(system, data, &Options::default())
}

/// A fit with other options than the defaults.
pub(crate) fn learn_with(system: &Arc<System>, data: &Dataset, options: &Options) -> Model {
    fit::fit(system, data, options, &Silent).unwrap_or_else(|error| panic!("{error}"))
}
