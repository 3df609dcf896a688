//! Going on from a model: the spec got a term more or less, and most numbers are known already.

use super::model::Model;
use super::monitor::Monitor;
use super::options::{Options, Trainer};
use super::{LARGEST_FACTOR, conclude, course, fit, gauge};
use crate::data::Dataset;
use crate::error::Result;
use crate::expr::System;

/// What a fit goes on from; a term of the support may have no coefficient yet (zero).
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// Terms of the system to begin with, sorted.
    pub support: Vec<usize>,
    /// One coefficient for each term of the system; zero outside the support.
    pub coefficients: Vec<f64>,
    /// One value for each inner parameter of the system.
    pub parameters: Vec<f64>,
    /// Noise of each observable.
    pub noise: Vec<f64>,
    /// Samples of the longest segment.
    pub window: usize,
}

impl Start {
    /// What a model knows of a system that has more terms, or fewer: terms are known by their
    /// place and label, inner parameters by their names.
    pub fn of(model: &Model, system: &System) -> Start {
        let mut start = Start {
            support: Vec::new(),
            coefficients: vec![0.0; system.terms.len()],
            parameters: model.parameter_values(system),
            noise: model.noise.iter().map(|noise| noise.standard_deviation).collect(),
            window: model.evidence.window,
        };
        for (k, term) in system.terms.iter().enumerate() {
            let place = system.place_name(term.place);
            let known = model.terms.iter().find(|t| t.term == term.label && t.place == place);
            if let Some(known) = known {
                start.coefficients[k] = known.coefficient;
                start.support.push(k);
            }
        }
        start
    }

    /// Takes terms in whose coefficients are to be found.
    pub fn with(mut self, terms: impl IntoIterator<Item = usize>) -> Start {
        let (size, support) = (self.coefficients.len(), &mut self.support);
        support.extend(terms.into_iter().filter(|&k| k < size));
        support.sort_unstable();
        support.dedup();
        self
    }

    /// The same for the system without one of its terms.
    fn without(&self, term: usize) -> Start {
        let mut shorter = self.clone();
        shorter.coefficients.remove(term);
        shorter.support.retain(|&k| k != term);
        shorter.support.iter_mut().filter(|k| **k > term).for_each(|k| *k -= 1);
        shorter
    }
}

/// Learns as [`fit`] does, from a model that is nearly right: the search begins at its support,
/// and takes terms in, out, or in exchange for as long as that pays.
///
/// # Errors
///
/// As [`fit`].
pub fn resume(
    system: &System,
    dataset: &Dataset,
    options: &Options,
    start: &Start,
    monitor: &dyn Monitor,
) -> Result<Model> {
    let fits = start.coefficients.len() == system.terms.len()
        && start.parameters.len() == system.parameters.len()
        && start.noise.len() == 2 * system.degrees();
    let large = system.terms.len() > LARGEST_FACTOR || options.trainer == Trainer::FirstOrder;
    if large || !fits {
        return fit(system, dataset, options, monitor);
    }
    if let Some(settled) = gauge::settle_scale(system, dataset) {
        if settled.system.terms.is_empty() && settled.system.parameters.is_empty() {
            return fit(system, dataset, options, monitor);
        }
        let start = start.without(settled.term);
        let (training, round) =
            course::train_on(&settled.system, dataset, options, &start, monitor)?;
        let mut model = conclude::conclude(&training, &round);
        settled.restore(system, &mut model);
        return Ok(model);
    }
    let (training, round) = course::train_on(system, dataset, options, start, monitor)?;
    Ok(conclude::conclude(&training, &round))
}
