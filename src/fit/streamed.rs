//! Fits to data that are larger than memory.
//!
//! The support is looked for on a sample first, where a search costs nothing; then the whole
//! function space is linearised on all data, the support is chosen again on that factor, and
//! refitted on all data, in the rounds of the ordinary trainer.

use super::conclude::conclude;
use super::course::train;
use super::gauss_newton::StopReason;
use super::model::Model;
use super::monitor::Monitor;
use super::options::{Options, Trainer};
use super::segments::typical_step;
use super::stream::{Passes, Stream};
use super::{prune, screening};
use std::sync::Arc;

use crate::data::Survey;
use crate::error::Result;
use crate::expr::System;

/// Learns from passes over data and their survey.
///
/// # Errors
///
/// As [`fit`](super::fit), and whatever goes wrong while the data are passed over.
pub(super) fn learn(
    system: &Arc<System>,
    passes: &dyn Passes,
    survey: &Survey,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Model> {
    if options.trainer == Trainer::FirstOrder
        || system.terms.len() > options.tuning.course.largest_factor
    {
        // Screening works on the sample; what it leaves is small enough for all data.
        return screening::among_survivors(system, &survey.sample, options, monitor, |narrowed| {
            on_all(narrowed, passes, survey, options, monitor)
        });
    }
    on_all(system, passes, survey, options, monitor)
}

fn on_all(
    system: &Arc<System>,
    passes: &dyn Passes,
    survey: &Survey,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Model> {
    let sample = &survey.sample;
    let (sampled, mut first) = train(system, sample, options, monitor)?;
    if first.refit.stop == StopReason::Interrupted || monitor.stopped() {
        first.refit.stop = StopReason::Interrupted;
        return Ok(conclude(&sampled, &first));
    }
    let stream = Stream::new(passes, system, survey, typical_step(sample), monitor);
    let guard = Guard { monitor, stream: &stream };
    let mut training = sampled.clone();
    training.stream = Some(&stream);
    // More data ask for a better integrator.
    training.sharpen();
    let mut outcome = training.rounds(&guard);
    if let Ok(round) = &mut outcome
        && !guard.stopped()
    {
        prune::prune(&mut training, round, &guard);
        training.finish(round, &guard);
    }
    if let Some(failure) = stream.failure() {
        return Err(failure);
    }
    match outcome {
        Ok(round) if round.refit.sums().loss.is_finite() => Ok(conclude(&training, &round)),
        // Stopped before all data were seen once: the model of the sample is the best so far.
        _ if monitor.stopped() => {
            first.refit.stop = StopReason::Interrupted;
            Ok(conclude(&sampled, &first))
        }
        Ok(round) => Ok(conclude(&training, &round)),
        Err(error) => Err(error),
    }
}

/// Stops when the source fails, too.
struct Guard<'a> {
    monitor: &'a dyn Monitor,
    stream: &'a Stream<'a>,
}

impl Monitor for Guard<'_> {
    fn stage(&self, what: &str, fraction: f64) {
        self.monitor.stage(what, fraction);
    }

    fn stopped(&self) -> bool {
        self.monitor.stopped() || self.stream.failed()
    }

    fn halted(&self) -> bool {
        self.monitor.halted()
    }
}
