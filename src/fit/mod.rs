//! Training: from measurements and a function space to a sparse model.
//!
//! [`fit`] is the whole of it, and [`fit_stream`] for data larger than memory. The parts, in the
//! order in which data pass through them: segments are cut ([`segments`]), integrated and their
//! unknown initial states eliminated by variable projection ([`pass`]), gathered in a triangular
//! factor ([`factor`]) on which the support is searched ([`path`], [`support`]) and refitted
//! ([`gauss_newton`]); rounds of this are [`train`]. [`refit`] fits the numbers of a law again and
//! searches nothing.

mod arrowhead;
mod banded;
mod block;
mod blocking;
pub mod bounded;
pub mod column;
mod compiled;
mod conclude;
pub(crate) mod course;
pub mod criterion;
mod curve;
pub mod distribution;
pub mod driving;
pub mod elimination;
pub mod factor;
pub mod first_order;
mod gathered;
mod gauge;
pub mod gauss_newton;
pub mod held_out;
pub mod hidden;
mod inversion;
mod law;
mod local;
pub mod loss;
pub(crate) mod masses;
pub mod memory;
pub mod model;
mod momenta;
pub mod monitor;
mod motion;
mod noise_estimate;
pub mod options;
pub mod own_values;
pub mod parts;
pub mod pass;
pub mod path;
pub mod per_run;
mod prune;
mod reach;
pub mod rectangle;
pub mod refit;
pub mod resume;
pub mod round;
mod rounding;
mod rows;
pub mod scales;
pub mod scores;
pub mod screening;
pub mod segments;
pub mod selection;
pub mod settling;
mod shown;
pub mod starts;
pub mod states;
pub mod stepping;
pub mod stream;
mod streamed;
pub mod support;
pub mod train;
pub mod tuning;
pub(crate) mod tuning_check;
pub mod uncertainty;
mod warned;
pub mod warning;
pub(crate) mod windowed;

pub use gauss_newton::StopReason;
pub use law::Law;
pub use loss::{LOSSES, Loss};
pub use model::Model;
pub use monitor::{Flag, Monitor, Silent};
pub use options::{Options, Selection, Trainer};
pub use pass::Stepping;
pub use reach::fit_as_far_as_it_tells;
pub use resume::resume;
pub use tuning::Tuning;
pub use warning::Warning;

use std::sync::Arc;

use self::blocking::BLOCKING;
use self::stream::Whole;
use crate::data::{Dataset, InMemory, Source, Survey, survey};
use crate::error::{Error, ErrorKind, Result};
use crate::expr::System;

/// Learns the coefficients and inner parameters of `system` from `dataset`.
///
/// Of a system in which everything is known there is still the noise to learn, and how long
/// the law follows the measurements.
///
/// The observables of the data are those of [`System::observables`], in that order and in
/// the spec's units. The result does not depend on the number of threads. Data of many samples
/// are searched as in [`fit_stream`], first on a sample.
///
/// # Errors
///
/// [`Error::Refused`](crate::error::Error::Refused) when the data do not suffice, or the function
/// space takes more memory than allowed, with what to do.
pub fn fit(
    system: &Arc<System>,
    dataset: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Model> {
    options.tuning.check()?;
    let dataset = &*per_run::grouped(system, dataset)?;
    settled(system, dataset, |system| learn(system, dataset, options, monitor))
}

/// The same from data that need not fit in memory: `survey` is what a first pass over `source`
/// found. Terms are first looked for on the survey's sample, then chosen and fitted on all data.
/// A pass leaves what a pass over the same data in memory leaves, up to rounding; the model is
/// that of [`fit`] within a few hundredths of the standard errors, since the weights of the last
/// round may come from the sample.
///
/// # Errors
///
/// As [`fit`], and whatever goes wrong while the source is read.
pub fn fit_stream(
    system: &Arc<System>,
    source: &dyn Source,
    survey: &Survey,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Model> {
    options.tuning.check()?;
    whole_runs(system)?;
    without_measures(system)?;
    settled(system, &survey.sample, |system| {
        memory::check(system, options)?;
        streamed::learn(system, &Whole(source), survey, options, monitor)
    })
}

/// Settles what no data can tell, learns, and says what was settled.
fn settled(
    system: &Arc<System>,
    dataset: &Dataset,
    learn: impl Fn(&Arc<System>) -> Result<Model>,
) -> Result<Model> {
    if let Some(settled) = gauge::settle_scale(system, dataset) {
        if settled.system.terms.is_empty() && settled.system.parameters.is_empty() {
            return Err(Error::new(
                ErrorKind::NotIdentifiable,
                "without momenta and known parts the only term sets the scale of H",
                "put more terms into `span{ ... }`, or measure momenta",
            ));
        }
        let mut model = learn(&settled.system)?;
        settled.restore(system, &mut model);
        return Ok(model);
    }
    learn(system)
}

fn learn(
    system: &Arc<System>,
    dataset: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Model> {
    if let Some(model) = local::learn(system, dataset, options, monitor)? {
        return Ok(model);
    }
    memory::check(system, options)?;
    let per_run = !per_run::own(&system.parameters).is_empty();
    if options.trainer == Trainer::FirstOrder {
        whole_runs(system)?;
        without_measures(system)?;
        return screening::first_order(system, dataset, options, monitor);
    }
    if system.terms.len() > options.tuning.course.largest_factor && options.sparse {
        whole_runs(system)?;
        without_measures(system)?;
        return screening::working_set(system, dataset, options, monitor);
    }
    let whole = per_run || !system.measures.is_empty();
    if dataset.samples() > options.tuning.course.all_at_once && !whole {
        // The early rounds on a sample, the last ones on all data.
        let source = InMemory::new(dataset, BLOCKING.chunk);
        let survey = survey(&source, options.tuning.course.sampled, options.seed, &|_| true)?;
        return streamed::learn(system, &Whole(&source), &survey, options, monitor);
    }
    let (training, round) = course::train(system, dataset, options, monitor)?;
    Ok(conclude::conclude(&training, &round))
}

/// That first guesses need no look at whole runs, as those from measures do.
fn without_measures(system: &System) -> Result<()> {
    let Some(measure) = system.measures.first() else { return Ok(()) };
    Err(Error::new(
        ErrorKind::NotApplicable,
        format!(
            "`{}` is a measure, which takes all data in memory and the second-order trainer",
            measure.variable.name
        ),
        "fit fewer samples or terms, allow more memory, or give the coordinates columns of their \
         own",
    ))
}

/// That the data can be passed over run by run, where runs have numbers of their own.
fn whole_runs(system: &System) -> Result<()> {
    let Some(parameter) = system.parameters.iter().find(|parameter| parameter.per.is_some()) else {
        return Ok(());
    };
    Err(Error::new(
        ErrorKind::InvalidArgument,
        format!("`{}` is a number of each run, which takes all data in memory", parameter.name),
        "fit fewer samples or terms, allow more memory, or share the number between the runs",
    ))
}
