//! Where a model fails: error by horizon, drift of the energy, residual force.

use serde::Serialize;

use super::context::Context;
use super::hats::{centres, force_terms, hats};
use crate::data::Dataset;
use crate::dynamics::{Batch, Scratch, advance};
use crate::error::Result;
use crate::expr::{Expr, Symbol, System, Term};
use crate::fit::pass::Sums;
use crate::fit::segments::{cut, longest_run, typical_step};

/// A model held against measurements.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Error against length of prediction, shortest first.
    pub horizons: Vec<Horizon>,
    /// Noise of each observable, in its unit; `None` where it was not measured.
    pub noise_floor: Vec<(String, Option<f64>)>,
    /// Residual force on each coordinate against each variable.
    pub maps: Vec<ResidualMap>,
    /// How the energy changes along every run.
    pub energy: Vec<EnergyDrift>,
    /// The worst, in plain sentences.
    pub findings: Vec<String>,
}

/// Error of predictions of one length, each from its best initial state.
///
/// Root mean square over all observables in units of the noise: 1 is the noise floor. The
/// freedom that the initial state takes up is paid for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Horizon {
    /// Samples of a prediction, the first included.
    pub samples: usize,
    /// In the spec's unit of time.
    pub duration: f64,
    /// Error on the runs that the model was trained on.
    pub training: f64,
    /// `None` without held-out runs.
    pub held_out: Option<f64>,
    /// The same for the guess that nothing moves.
    pub baseline: f64,
    /// Predictions that left the finite numbers.
    pub exploded: usize,
}

/// The force that is missing (or too much), piecewise linear in one variable.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResidualMap {
    /// Coordinate that the force acts on.
    pub on: String,
    /// Variable that the force is shown against.
    pub against: String,
    /// (value of the variable, force, standard error).
    pub points: Vec<(f64, f64, f64)>,
    /// Fall of the deviance that the whole map would bring, and its degrees of freedom.
    pub deviance: f64,
    /// Degrees of freedom of the map.
    pub degrees: usize,
    /// Chance that noise does as well.
    pub p_value: f64,
}

/// How the model's energy changes along the measurements of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EnergyDrift {
    /// Name of the run.
    pub run: String,
    /// Energy at the first point.
    pub first: f64,
    /// Energy at the last point.
    pub last: f64,
    /// Slope over time and its standard error.
    pub rate: f64,
    /// Standard error of `rate`.
    pub rate_error: f64,
}

/// Hats of one map.
const HATS: usize = 9;
/// Maps below this chance are spoken of (after the number of maps is paid for).
const SIGNIFICANT: f64 = 1e-3;

/// Compares a model with the runs that it was trained on, and with held-out ones.
pub fn compare(training: &Context, held_out: Option<&Context>) -> Result<Comparison> {
    let horizons = horizons(training, held_out);
    let maps = residual_maps(training)?;
    let energy = energy_drift(training);
    let names = training.system().observables();
    let noise = training.law.noise().iter().zip(training.dataset.measured());
    let noise = noise.map(|(noise, measured)| (measured > 0).then_some(*noise));
    let noise_floor = names.into_iter().zip(noise).collect();
    let findings = findings(training, &horizons, &maps, &energy);
    Ok(Comparison { horizons, noise_floor, maps, energy, findings })
}

/// Error in units of the noise over segments of `window` samples, and segments that exploded;
/// NaN where too few are left to say.
pub fn error(context: &Context, window: usize) -> (f64, usize) {
    error_of(&context.settle(window).2)
}

/// The same of sums that are at hand.
pub(super) fn error_of(sums: &Sums) -> (f64, usize) {
    let freedom: f64 = sums.freedom.iter().sum();
    let squares: f64 = sums.squares.iter().sum();
    let error = if freedom < 1.0 { f64::NAN } else { (squares / freedom).sqrt() };
    (error, sums.exploded)
}

/// Lengths of prediction in samples: 2, 4, 8, ... and the longest run.
pub fn windows(dataset: &Dataset) -> Vec<usize> {
    let longest = longest_run(dataset);
    let mut windows: Vec<usize> =
        std::iter::successors(Some(2), |w| Some(2 * w)).take_while(|&w| w < longest).collect();
    windows.push(longest);
    windows
}

fn horizons(training: &Context, held_out: Option<&Context>) -> Vec<Horizon> {
    let step = typical_step(training.dataset);
    windows(training.dataset)
        .into_iter()
        .map(|samples| {
            let (seen, exploded) = error(training, samples);
            Horizon {
                samples,
                duration: step * (samples - 1) as f64,
                training: seen,
                held_out: held_out.map(|context| error(context, samples).0),
                baseline: baseline(training, samples),
                exploded,
            }
        })
        .collect()
}

/// The guess that nothing moves: each segment's mean, in units of the noise.
fn baseline(context: &Context, window: usize) -> f64 {
    let (mut squares, mut freedom) = (0.0, 0.0);
    for segment in cut(&context.measured, window).list {
        let run = &context.dataset.runs[segment.run];
        for (values, noise) in run.values.iter().zip(context.law.noise()) {
            let seen: Vec<f64> = values[segment.first..=segment.last]
                .iter()
                .copied()
                .filter(|x| x.is_finite())
                .collect();
            if seen.len() < 2 {
                continue;
            }
            let mean = seen.iter().sum::<f64>() / seen.len() as f64;
            squares += seen.iter().map(|x| ((x - mean) / noise).powi(2)).sum::<f64>();
            freedom += (seen.len() - 1) as f64;
        }
    }
    (squares / f64::max(freedom, 1.0)).sqrt()
}

/// Residual force on every coordinate against every coordinate, momentum, the energy and time.
pub fn residual_maps(context: &Context) -> Result<Vec<ResidualMap>> {
    let mut system = System::clone(context.system());
    let variables = variables(context, &mut system);
    let mut terms: Vec<Term> = Vec::new();
    let mut layout = Vec::new();
    for on in 0..system.degrees() {
        for (name, expr, centres) in &variables {
            let functions = hats(&mut system.graph, *expr, centres);
            let start = terms.len();
            terms.extend(force_terms(on, &functions, &system));
            layout.push((on, name.clone(), centres.clone(), start..terms.len()));
        }
    }
    if terms.is_empty() {
        return Ok(Vec::new());
    }
    let scores = context.settled().probe(system, &terms)?.scores;
    Ok(layout
        .into_iter()
        .map(|(on, against, centres, columns)| {
            let score = scores.group(&columns.collect::<Vec<_>>());
            ResidualMap {
                on: context.system().coordinates[on].name.clone(),
                against,
                points: centres
                    .iter()
                    .zip(score.coefficients.iter().zip(&score.standard_errors))
                    .map(|(&x, (&force, &error))| (x, force, error))
                    .collect(),
                deviance: score.deviance,
                degrees: score.degrees,
                p_value: score.p_value,
            }
        })
        .collect())
}

/// Variables that the force may depend on: name, expression, centres of hats over the data.
fn variables(context: &Context, system: &mut System) -> Vec<(String, Expr, Vec<f64>)> {
    let (segments, states, _) = context.settle(context.law.window());
    let n = system.degrees();
    let mut variables = Vec::new();
    for (row, symbol) in system.state().into_iter().enumerate() {
        let mut values: Vec<f64> = states.iter().map(|state| state[row]).collect();
        let measured = context.dataset.runs.iter().flat_map(|run| run.values[row].iter());
        if row < n {
            values.extend(measured);
        }
        let name = if row < n { &system.coordinates[row] } else { &system.momenta[row - n] };
        let centres = centres(&mut values, HATS);
        if !centres.is_empty() {
            let name = name.name.clone();
            variables.push((name, system.graph.symbol(symbol), centres));
        }
    }
    let mut times: Vec<f64> = segments
        .list
        .iter()
        .flat_map(|s| {
            let run = &context.dataset.runs[s.run];
            (s.first..=s.last).map(|at| run.time(at))
        })
        .collect();
    let pairs = longest_run(context.dataset) <= 2;
    let times = if pairs { Vec::new() } else { centres(&mut times, HATS) };
    if !times.is_empty() {
        variables.push((system.time.name.clone(), system.graph.symbol(Symbol::Time), times));
    }
    variables
}

/// Energy of the model at the measured states of every run: (time, energy) of each segment's
/// middle, sorted by time; one list a run.
pub fn energies(context: &Context) -> Vec<Vec<(f64, f64)>> {
    let dynamics = context.law.dynamics();
    let theta = context.law.theta(&dynamics);
    let (segments, states, _) = context.settle(context.law.window());
    let mut scratch = Scratch::new();
    let mut points: Vec<Vec<(f64, f64)>> = vec![Vec::new(); context.dataset.runs.len()];
    for (segment, state) in segments.list.iter().zip(&states) {
        let run = &context.dataset.runs[segment.run];
        let times = &run.times;
        let mut batch = Batch::new(context.system().degrees(), 1);
        batch.set(0, run.time(segment.first), state);
        // The middle of a segment is where its state is known best.
        let middle = 0.5 * (times[segment.last] - times[segment.first]);
        let steps = (middle / context.law.stepping().longest).ceil().max(1.0) as usize;
        let method = context.law.stepping().method;
        advance(&dynamics, method, &mut batch, &[middle], steps, &theta, &mut scratch);
        let mut energy = [f64::NAN];
        dynamics.energy(&batch, &theta, &mut energy, &mut scratch);
        if energy[0].is_finite() {
            points[segment.run].push((run.time(segment.first) + middle, energy[0]));
        }
    }
    for points in &mut points {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    points
}

/// Energy along every run, as a straight line over time.
fn energy_drift(context: &Context) -> Vec<EnergyDrift> {
    let runs = context.dataset.runs.iter();
    runs.zip(energies(context))
        .filter(|(_, points)| points.len() >= 3)
        .map(|(run, points)| {
            let (rate, rate_error) = slope(&points);
            EnergyDrift {
                run: run.name.clone(),
                first: points[0].1,
                last: points[points.len() - 1].1,
                rate,
                rate_error,
            }
        })
        .collect()
}

/// Slope of a straight line through points, and its standard error.
fn slope(points: &[(f64, f64)]) -> (f64, f64) {
    let n = points.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / n;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    let xx: f64 = points.iter().map(|p| (p.0 - x).powi(2)).sum();
    let xy: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    let slope = xy / xx.max(f64::MIN_POSITIVE);
    let left: f64 = points.iter().map(|p| (p.1 - y - slope * (p.0 - x)).powi(2)).sum();
    (slope, (left / (n - 2.0).max(1.0) / xx.max(f64::MIN_POSITIVE)).sqrt())
}

/// Three decimals, or as many digits of what is smaller or larger.
fn short(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || (0.01..1e4).contains(&size) {
        format!("{value:.3}")
    } else {
        format!("{value:.2e}")
    }
}

fn findings(
    context: &Context,
    horizons: &[Horizon],
    maps: &[ResidualMap],
    energy: &[EnergyDrift],
) -> Vec<String> {
    let mut out = Vec::new();
    if let (Some(first), Some(last)) = (horizons.first(), horizons.last()) {
        let growth = last.training / first.training.max(1e-9);
        out.push(if first.samples == last.samples {
            format!(
                "the error over {} samples is {:.2} times the noise",
                last.samples, last.training
            )
        } else if growth < 1.2 {
            format!(
                "the error stays at {:.2} times the noise from {} samples to {}",
                last.training, first.samples, last.samples
            )
        } else {
            format!(
                "the error grows from {:.2} times the noise over {} samples to {:.2} over {}",
                first.training, first.samples, last.training, last.samples
            )
        });
    }
    let mut worst: Vec<&ResidualMap> =
        maps.iter().filter(|map| map.p_value * (maps.len() as f64) < SIGNIFICANT).collect();
    worst.sort_by(|a, b| {
        (b.deviance / b.degrees as f64).total_cmp(&(a.deviance / a.degrees as f64))
    });
    for map in worst.iter().take(4) {
        let peak = map
            .points
            .iter()
            .filter(|p| p.2.is_finite())
            .max_by(|a, b| (a.1 / a.2).abs().total_cmp(&(b.1 / b.2).abs()));
        if let Some(&(at, force, error)) = peak {
            out.push(format!(
                "the force on {} is off by {} ({:.0} standard errors) where {} is near {}",
                map.on,
                short(force),
                (force / error).abs(),
                map.against,
                short(at)
            ));
        }
    }
    let drifting: Vec<&EnergyDrift> =
        energy.iter().filter(|e| e.rate.abs() > 4.0 * e.rate_error && e.rate_error > 0.0).collect();
    if let Some(most) = drifting.iter().max_by(|a, b| a.rate.abs().total_cmp(&b.rate.abs())) {
        let how = if most.rate < 0.0 { "loses" } else { "gains" };
        out.push(format!(
            "run {} {how} energy: from {:.4} to {:.4}, in {} of {} runs the energy drifts",
            most.run,
            most.first,
            most.last,
            drifting.len(),
            context.dataset.runs.len()
        ));
    }
    out
}
