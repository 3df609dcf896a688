//! Going on from a model: the spec got a term more or less, and most numbers are known already.

use super::law::Law;
use super::model::Model;
use super::monitor::Monitor;
use super::options::{Options, Trainer};
use super::{conclude, course, fit, gauge, per_run};
use crate::data::Dataset;
use crate::error::Result;

/// Learns as [`fit`] does, from a law that is nearly right: the search begins at its support,
/// and takes terms in, out, or in exchange for as long as that pays. What is learned is `start`'s
/// system; a term of its support may have no coefficient yet (zero).
///
/// # Errors
///
/// As [`fit`].
pub fn resume(
    start: &Law,
    dataset: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Model> {
    options.tuning.check()?;
    let system = start.system();
    let dataset = &*per_run::grouped(system, dataset)?;
    let fits = start.noise().len() == system.observed_count();
    let large = system.terms.len() > options.tuning.course.largest_factor
        || options.trainer == Trainer::FirstOrder;
    if large || !fits {
        return fit(system, dataset, options, monitor);
    }
    if let Some(settled) = gauge::settle_scale(system, dataset) {
        if settled.system.terms.is_empty() && settled.system.parameters.is_empty() {
            return fit(system, dataset, options, monitor);
        }
        let start = start.on(&settled.system);
        let (training, round) = course::train_on(&start, dataset, options, monitor)?;
        let mut model = conclude::conclude(&training, &round);
        settled.restore(system, &mut model);
        return Ok(model);
    }
    let (training, round) = course::train_on(start, dataset, options, monitor)?;
    Ok(conclude::conclude(&training, &round))
}
