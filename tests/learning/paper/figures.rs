//! What is measured of a fit: support, errors of coefficients and of predictions.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use leverrier::internals::data::Dataset;
use leverrier::internals::dynamics::{Dynamics, Method, StepControl, Stop, simulate};
use leverrier::internals::eval::Backend;
use leverrier::internals::expr::System;
use leverrier::internals::fit::Model;
use leverrier::internals::report::present;
use leverrier::internals::simplify::{Simplified, Style};
use leverrier::internals::simulate::{InitialDistribution, Interval as Side, Simulator, draw};

use super::{Law, STEP, system};

/// Estimate minus truth and standard error of every coefficient, in the order of the law's
/// terms; `None` unless the support is exact.
pub(crate) fn deviations(law: &Law, model: &Model) -> Option<Vec<(f64, f64)>> {
    if model.terms.len() != law.terms.len() {
        return None;
    }
    law.terms
        .iter()
        .map(|(place, label, value)| {
            let found = model.terms.iter().find(|t| t.place == *place && t.term == *label)?;
            Some((found.coefficient - value, found.standard_error))
        })
        .collect()
}

/// The support in words, for messages.
pub(crate) fn support(model: &Model) -> String {
    let terms = model.terms.iter();
    let words = terms.map(|t| format!("{} {:+.6} {}", t.place, t.coefficient, t.term));
    words.collect::<Vec<_>>().join(", ")
}

/// Largest error of a coefficient; panics with the support unless that is exact.
pub(crate) fn largest_error(law: &Law, model: &Model) -> f64 {
    let deviations = deviations(law, model)
        .unwrap_or_else(|| panic!("the support is not exact: {}", support(model)));
    deviations.iter().fold(0.0, |most, (error, _)| most.max(error.abs()))
}

/// Largest error of a coefficient in its standard errors.
pub(crate) fn largest_in_standard_errors(law: &Law, model: &Model) -> f64 {
    let deviations = deviations(law, model)
        .unwrap_or_else(|| panic!("the support is not exact: {}", support(model)));
    deviations.iter().fold(0.0, |most, (error, width)| most.max((error / width).abs()))
}

/// The trajectories of a law and of a learned model from the same starts.
pub(crate) struct Predicted {
    /// `[run][sample][component]`.
    pub truth: Vec<Vec<Vec<f64>>>,
    pub learned: Vec<Vec<Vec<f64>>>,
    /// The true energy along the true and along the learned motion.
    pub true_energy: Vec<Vec<f64>>,
    pub learned_energy: Vec<Vec<f64>>,
}

/// Follows a law and what was learned of it, both near machine precision.
pub(crate) fn predict(
    law: &Law,
    space: &Arc<System>,
    model: &Model,
    starts: &[Vec<f64>],
    times: &[f64],
) -> Predicted {
    let known = system(&law.spec);
    let nature = Simulator::known(&known);
    let learned = model.law(space).expect("the model's own spec");
    let learned = learned.simulator();
    let follow = |simulator: &Simulator| {
        simulator.trajectories(starts, times).unwrap_or_else(|error| panic!("{error}")).states
    };
    let (truth, learned) = (follow(&nature), follow(&learned));
    let energies = |runs: &[Vec<Vec<f64>>]| -> Vec<Vec<f64>> {
        runs.iter().map(|states| nature.energies(states, 0.0)).collect()
    };
    let (true_energy, learned_energy) = (energies(&truth), energies(&learned));
    Predicted { truth, learned, true_energy, learned_energy }
}

/// Mean absolute error of each component of a prediction one step ahead.
pub(crate) fn one_step(
    law: &Law,
    space: &Arc<System>,
    model: &Model,
    starts: &[Vec<f64>],
) -> Vec<f64> {
    let both = predict(law, space, model, starts, &[0.0, STEP]);
    let components = starts.first().map_or(0, Vec::len);
    let mut mean = vec![0.0; components];
    for (truth, learned) in both.truth.iter().zip(&both.learned) {
        for (sum, (a, b)) in mean.iter_mut().zip(truth[1].iter().zip(&learned[1])) {
            *sum += (a - b).abs() / starts.len() as f64;
        }
    }
    mean
}

/// Mean over the coordinates and mean over the momenta.
pub(crate) fn halves(components: &[f64]) -> (f64, f64) {
    let n = components.len() / 2;
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len().max(1) as f64;
    (mean(&components[..n]), mean(&components[n..]))
}

/// Clean starts for predictions: uniform between -1 and 1.
pub(crate) fn fresh_starts(law: &Law, count: usize, seed: u64) -> Vec<Vec<f64>> {
    let known = system(&law.spec);
    let nature = Simulator::known(&known);
    let side = Side { lower: -1.0, upper: 1.0 };
    let sampling = InitialDistribution { intervals: vec![side; 2 * known.degrees()], energy: None };
    draw(&nature, &sampling, count, 0.0, seed).expect("no energy asked for")
}

/// The first sample of every run.
pub(crate) fn first_samples(data: &Dataset) -> Vec<Vec<f64>> {
    data.runs.iter().map(|run| run.values.iter().map(|column| column[0]).collect()).collect()
}

/// Largest |value| of each component.
pub(crate) fn ranges(data: &Dataset) -> Vec<f64> {
    (0..data.observables.len())
        .map(|row| {
            let cells = data.runs.iter().flat_map(|run| &run.values[row]);
            cells.fold(0.0, |most: f64, x| most.max(x.abs()))
        })
        .collect()
}

/// What is printed of a model.
pub(crate) fn simplified(space: &Arc<System>, model: &Model, data: &Dataset) -> Simplified {
    let law = model.law(space).expect("the model's own spec");
    present::simplified(&law, &ranges(data))
}

/// The printed equations.
pub(crate) fn printed(space: &Arc<System>, model: &Model, data: &Dataset) -> String {
    simplified(space, model, data).text(Style::default())
}

/// A shifted sine c sin(w q + b) in its one form with w > 0, c < 0 and b in [0, 2 pi):
/// amplitude, wave number, phase.
pub(crate) fn canonical_sine(amplitude: f64, wave: f64, phase: f64) -> (f64, f64, f64) {
    let (mut amplitude, mut wave, mut phase) = (amplitude, wave, phase);
    if wave < 0.0 {
        (amplitude, wave, phase) = (-amplitude, -wave, -phase);
    }
    if amplitude > 0.0 {
        (amplitude, phase) = (-amplitude, phase + PI);
    }
    (amplitude, wave, phase.rem_euclid(TAU))
}

/// Largest error of the pendulum's four numbers: 1/4, -2, wave number 1, phase pi/2.
/// `None` unless T is p^2 alone and V the sine alone.
pub(crate) fn pendulum_error(model: &Model) -> Option<f64> {
    let kinetic: Vec<_> = model.terms.iter().filter(|t| t.place == "T").collect();
    let potential: Vec<_> = model.terms.iter().filter(|t| t.place == "V").collect();
    let ([kinetic], [potential]) = (&kinetic[..], &potential[..]) else { return None };
    if kinetic.term != "p^2" || !potential.term.starts_with("sin(") {
        return None;
    }
    let value = |name: &str| model.parameters.iter().find(|p| p.name == name).map(|p| p.value);
    let (amplitude, wave, phase) =
        canonical_sine(potential.coefficient, 1.0 + value("a")?, value("b")?);
    let errors = [kinetic.coefficient - 0.25, amplitude + 2.0, wave - 1.0, phase - PI / 2.0];
    Some(errors.iter().fold(0.0, |most, e| most.max(e.abs())))
}

/// Mean absolute error one step ahead in p of the best quintic potential, found from the law:
/// the least-squares fit of a q + b q^3 to the pendulum's 2 sin(q) where the data lie.
pub(crate) fn best_quintic(data: &Dataset) -> f64 {
    let at: Vec<f64> =
        data.runs.iter().map(|run| (run.values[0][0] + run.values[0][1]) / 2.0).collect();
    let sum = |f: &dyn Fn(f64) -> f64| at.iter().map(|&q| f(q)).sum::<f64>();
    let (qq, qc, cc) = (sum(&|q| q * q), sum(&|q| q.powi(4)), sum(&|q| q.powi(6)));
    let (qs, cs) = (sum(&|q| q * 2.0 * q.sin()), sum(&|q| q.powi(3) * 2.0 * q.sin()));
    let determinant = qq * cc - qc * qc;
    let (a, b) = ((qs * cc - cs * qc) / determinant, (qq * cs - qc * qs) / determinant);
    sum(&|q| (STEP * (2.0 * q.sin() - a * q - b * q.powi(3))).abs()) / at.len() as f64
}

/// Bytes of the model file, and of what a prediction needs of it: a number and a term's place
/// in the function space for every learned coefficient.
pub(crate) fn bytes(model: &Model) -> (usize, usize) {
    let file = serde_json::to_vec(model).expect("a model is plain data").len();
    (file, model.evidence.learned * (size_of::<f64>() + size_of::<u32>()))
}

/// Largest relative stray of the true energy along the learned motion, integrated with
/// `method` in steps of [`STEP`] to the time `until`.
pub(crate) fn energy_stray(
    law: &Law,
    space: &Arc<System>,
    model: &Model,
    method: Method,
    start: &[f64],
    until: f64,
) -> f64 {
    let learned = model.law(space).expect("the model's own spec");
    let dynamics = Dynamics::new(space, learned.support(), Backend::Batched).expect("its terms");
    let values = dynamics.parameters().iter().filter_map(|&id| learned.parameter(id));
    let theta: Vec<f64> = learned.coefficients().iter().copied().chain(values).collect();
    let samples = (until / STEP).round() as usize;
    let times: Vec<f64> = (0..=samples).map(|i| STEP * i as f64).collect();
    let pace = StepControl::PerInterval(1);
    let run = simulate(&dynamics, method, &theta, &[start.to_vec()], &times, pace).remove(0);
    assert_eq!(run.stop, Stop::Finished, "{} loses the motion", method.row().name);
    let known = system(&law.spec);
    let energies = Simulator::known(&known).energies(&run.states, 0.0);
    let first = energies[0];
    energies.iter().fold(0.0, |most: f64, e| most.max(((e - first) / first).abs()))
}
