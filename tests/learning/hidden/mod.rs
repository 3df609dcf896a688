//! Effects hidden in simulated measurements, and whether they are named: what the benchmark
//! and the test of its representative part share.

pub(crate) mod bases;
pub(crate) mod design;
pub(crate) mod making;
pub(crate) mod outcome;
pub(crate) mod pairs;
pub(crate) mod score;
pub(crate) mod strangers;
pub(crate) mod terms;
pub(crate) mod wholes;

use leverrier::internals::data::Dataset;
use leverrier::internals::expr::{Compiled, System, build};
use leverrier::internals::fit::{Model, Options, Silent, fit};
use leverrier::internals::simulate::Simulator;
use leverrier::internals::spec::effects::by_name;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use bases::Base;

/// Runs of a data set, and samples of a run.
pub(crate) const RUNS: usize = 8;
/// Samples of a run.
pub(crate) const SAMPLES: usize = 200;
/// A hidden effect moves the samples by this part of their spread (root mean square).
pub(crate) const REACH: f64 = 0.2;
/// Runs put aside.
const HELD_OUT: f64 = 0.25;

/// Measurements of a system with something hidden, and the spec of one who does not know.
pub(crate) struct Case {
    /// The spec.
    pub text: String,
    /// The same, compiled.
    pub compiled: Compiled,
    /// What the model is fitted to.
    pub training: Dataset,
    /// What it is not fitted to.
    pub held_out: Dataset,
    /// True noise of each observable.
    pub noise: Vec<f64>,
}

/// Starts of the runs, drawn from the base's box.
fn starts(base: &Base, seed: u64) -> Vec<Vec<f64>> {
    let mut generator = Pcg64::seed_from_u64(seed ^ 0x9e37_79b9);
    let mut draw = || base.starts.iter().map(|&(a, b)| generator.random_range(a..b)).collect();
    (0..RUNS).map(|_| draw()).collect()
}

fn times(base: &Base) -> Vec<f64> {
    (0..SAMPLES).map(|i| base.step * i as f64).collect()
}

fn compiled(name: &str, text: &str) -> Compiled {
    build(name, text).unwrap_or_else(|error| panic!("{text}\n{error}"))
}

/// The spec of someone who knows the base and nothing else.
pub(crate) fn space(base: &Base) -> Compiled {
    compiled("learned", &format!("{}{}", base.variables, base.space))
}

/// The statement of an effect of the catalogue with plain values of its inner parameters.
pub(crate) fn statement(effect: &str, on: &[&str]) -> String {
    let row = by_name(effect).unwrap_or_else(|| panic!("{effect} is not in the catalogue"));
    let values: Vec<f64> = row.parameters.iter().map(|scan| scan.example).collect();
    let arguments: Vec<String> = on.iter().map(|&name| name.to_string()).collect();
    row.statement(&arguments, &values)
}

/// Root mean square difference of two data sets, in parts of the spread of the first.
fn difference(first: &Dataset, second: &Dataset) -> f64 {
    let spread = spreads(first);
    let (mut sum, mut count) = (0.0, 0.0);
    for (a, b) in first.runs.iter().zip(&second.runs) {
        for ((a, b), spread) in a.values.iter().zip(&b.values).zip(&spread) {
            sum += a.iter().zip(b).map(|(x, y)| ((x - y) / spread).powi(2)).sum::<f64>();
            count += a.len() as f64;
        }
    }
    (sum / count).sqrt()
}

/// Standard deviation of every column.
pub(crate) fn spreads(data: &Dataset) -> Vec<f64> {
    (0..data.observables.len())
        .map(|row| {
            let all: Vec<f64> =
                data.runs.iter().flat_map(|r| r.values[row].iter().copied()).collect();
            let mean = all.iter().sum::<f64>() / all.len() as f64;
            (all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / all.len() as f64).sqrt()
        })
        .collect()
}

/// Trajectories of a system whose learned terms all have one coefficient.
fn motion(system: &System, starts: &[Vec<f64>], times: &[f64], strength: f64) -> Option<Dataset> {
    let active = system.term_ids();
    let coefficients = vec![strength; active.len()];
    let parameters: Vec<f64> = system.parameters.iter().map(|p| p.start).collect();
    let simulator = Simulator::new(system, &active, &coefficients, &parameters).ok()?;
    let data = simulator.trajectories(starts, times).ok()?.dataset(system);
    let tame = data.runs.iter().flat_map(|run| run.values.iter().flatten());
    tame.into_iter().all(|x| x.abs() < 50.0).then_some(data)
}

/// Clean measurements with a statement hidden, at the strength that moves the samples by
/// `reach`. Without a statement the bare base.
fn hide(base: &Base, statement: &str, reach: f64, seed: u64) -> Dataset {
    let truth = |more: &str| compiled("truth", &format!("{}{}{more}\n", base.variables, base.law));
    let (starts, times) = (starts(base, seed), times(base));
    let bare = truth("").system;
    let plain = motion(&bare, &starts, &times, 0.0).expect("the base does not diverge");
    if statement.is_empty() {
        return plain;
    }
    let system = truth(statement).system;
    // The reach grows with the strength, roughly; bisection on a logarithmic scale.
    let (mut low, mut high) = (1e-4f64, 10.0f64);
    let mut best = None;
    for _ in 0..14 {
        let strength = (low * high).sqrt();
        match motion(&system, &starts, &times, strength) {
            Some(data) if difference(&plain, &data) <= reach => {
                low = strength;
                best = Some(data);
            }
            _ => high = strength,
        }
    }
    best.unwrap_or_else(|| panic!("{statement} diverges at any strength in {}", base.name))
}

/// Adds noise in parts of each column's spread; returns its standard deviations.
fn spoil(data: &mut Dataset, noise: f64, seed: u64) -> Vec<f64> {
    let sigma: Vec<f64> = spreads(data).iter().map(|spread| noise * spread).collect();
    let mut generator = Pcg64::seed_from_u64(seed);
    for run in &mut data.runs {
        for (values, sigma) in run.values.iter_mut().zip(&sigma) {
            for x in values {
                let draw: f64 = StandardNormal.sample(&mut generator);
                *x += sigma * draw;
            }
        }
    }
    sigma
}

/// Measurements as one who knows only the base gets them.
pub(crate) fn case(base: &Base, statement: &str, noise: f64, seed: u64) -> Case {
    case_reaching(REACH, base, statement, noise, seed)
}

/// The same with another reach of what is hidden.
pub(crate) fn case_reaching(
    reach: f64,
    base: &Base,
    statement: &str,
    noise: f64,
    seed: u64,
) -> Case {
    measured(base, hide(base, statement, reach, seed), noise, seed)
}

/// Measurements of a law in which everything is known, as one who knows only the base gets them.
pub(crate) fn case_of(base: &Base, truth: &str, noise: f64, seed: u64) -> Case {
    let system = compiled("truth", truth).system;
    let data = motion(&system, &starts(base, seed), &times(base), 0.0);
    measured(base, data.expect("the law does not diverge"), noise, seed)
}

/// The same from clean measurements of any origin.
pub(crate) fn measured(base: &Base, data: Dataset, noise: f64, seed: u64) -> Case {
    let mut data = data;
    let sigma = spoil(&mut data, noise, seed);
    let text = format!("{}{}", base.variables, base.space);
    let split = data.split_held_out(HELD_OUT, seed);
    Case {
        compiled: compiled("learned", &text),
        text,
        training: split.training,
        held_out: split.held_out,
        noise: sigma,
    }
}

impl Case {
    /// Leaves of a plane's measurements those of its first coordinate, to one with this spec.
    pub(crate) fn see_first(&mut self, text: &str) {
        for data in [&mut self.training, &mut self.held_out] {
            for run in &mut data.runs {
                run.values = vec![run.values[0].clone(), run.values[2].clone()];
            }
            data.observables = vec![data.observables[0].clone(), data.observables[2].clone()];
        }
        self.noise = vec![self.noise[0], self.noise[2]];
        self.compiled = compiled("learned", text);
        self.text = text.to_string();
    }

    /// The model of the spec.
    pub(crate) fn fit(&self) -> Model {
        fit(&self.compiled.system, &self.training, &Options::default(), &Silent)
            .unwrap_or_else(|error| panic!("{error}"))
    }
}
