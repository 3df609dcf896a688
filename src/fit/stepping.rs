//! How accurately to integrate: as the noise asks for, and no more.

use super::options::Options;
use super::pass::Stepping;
use super::train::Training;
use crate::data::Dataset;
use crate::dynamics::{Dynamics, Method};
use crate::expr::System;

/// An integrator with what it can resolve.
pub struct Choice {
    pub stepping: Stepping,
    /// For each observable, the error below which residuals mean nothing.
    pub resolution: Vec<f64>,
}

/// Rounding of each observable: a few units in the last place of its largest value.
pub fn rounding(dataset: &Dataset, observables: usize) -> Vec<f64> {
    (0..observables)
        .map(|row| {
            let largest = dataset
                .runs
                .iter()
                .filter_map(|run| run.values.get(row))
                .flatten()
                .filter(|x| x.is_finite())
                .fold(0.0f64, |m, x| m.max(x.abs()));
            8.0 * f64::EPSILON * largest.max(f64::MIN_POSITIVE / f64::EPSILON)
        })
        .collect()
}

/// For the first round, whose model is rough anyway.
pub fn coarse(_system: &System, options: &Options, typical: f64) -> Stepping {
    let method = options.method.or(Method::by_name("forest-ruth")).expect("a row of METHODS");
    Stepping { method, longest: options.longest_step.unwrap_or(typical) }
}

pub fn choose(training: &Training, _dynamics: &Dynamics, _theta: &[f64]) -> Choice {
    let fine = training.noise.iter().all(|s| *s < 1e-4);
    let method = Method::by_name(if fine { "suzuki-umeno-8" } else { "forest-ruth" }).expect("row");
    Choice {
        stepping: Stepping { method, longest: training.stepping.longest },
        resolution: rounding(training.dataset, training.noise.len()),
    }
}

/// Why the integrator of a finished training is the right one, in a sentence.
pub fn reason(training: &Training) -> String {
    let given = training.options.method.is_some() || training.options.longest_step.is_some();
    if given { "as asked for".to_string() } else { "its error is below the noise".to_string() }
}
