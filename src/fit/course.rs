//! The course of a training: the best of several starts, rounds on a part of the data, rounds on
//! all of them, and segments that grow for as long as the model follows them.

use super::gauss_newton::StopReason;
use super::law::Law;
use super::monitor::Monitor;
use super::options::Options;
use super::train::{Extent, Round, Training};
use std::sync::Arc;

use crate::data::Dataset;
use crate::error::{Error, Result};
use crate::expr::{ParameterId, System};

/// Trains from the spec's start, or from the best of several starts, on growing segments.
pub(crate) fn train<'a>(
    system: &Arc<System>,
    dataset: &Dataset,
    options: &'a Options,
    monitor: &dyn Monitor,
) -> Result<(Training<'a>, Round)> {
    let mut training = best_start(Training::new(system, dataset, options)?, monitor)?;
    monitor.stage("searching the function space", 0.2);
    come_near(&mut training, monitor)?;
    let round = training.rounds(monitor)?;
    lengthen(training, round, monitor)
}

/// Where there are many segments, a part of them brings the model near: the rounds that follow
/// take all of them and search the whole space once more, but need not come from far.
fn come_near(training: &mut Training, monitor: &dyn Monitor) -> Result<()> {
    let unknowns = training.system().terms.len() + training.system().parameters.len();
    let part = training.options.tuning.course.first_segments.max(2 * unknowns);
    if training.stream.is_some() || training.segments.list.len() < 2 * part {
        return Ok(());
    }
    let states = std::mem::take(&mut training.states);
    let segments = training.thin(part);
    training.extent = Extent::Rough;
    let rough = training.rounds(monitor);
    training.extent = Extent::Whole;
    training.reweigh = true;
    training.segments = segments;
    training.states = states;
    rough.map(|_| ())
}

/// The end of every training: longer segments, the last look at the support.
fn lengthen<'a>(
    mut training: Training<'a>,
    mut round: Round,
    monitor: &dyn Monitor,
) -> Result<(Training<'a>, Round)> {
    if training.options.window.is_none() {
        (training, round) = grow(training, round, monitor)?;
    }
    super::prune::prune(&mut training, &mut round, monitor);
    training.finish(&mut round, monitor);
    Ok((training, round))
}

/// Trains on from a law: its numbers, its noise and its length of segments are the start,
/// and the support is searched around it.
pub(crate) fn train_on<'a>(
    start: &Law,
    dataset: &Dataset,
    options: &'a Options,
    monitor: &dyn Monitor,
) -> Result<(Training<'a>, Round)> {
    let mut training = Training::new(start.system(), dataset, options)?;
    training.extent = Extent::Near;
    // Its steps were chosen for other data: those of a first round choose better ones.
    training.start_from(&start.clone().with_stepping(training.law().stepping()));
    let longest = training.measured.longest_run().max(2);
    let mut window = start.window();
    if !start.system().hidden.is_empty() {
        // Short segments tell nothing of what acts unseen.
        window = window.max(options.tuning.segments.hidden);
    }
    training.recut(options.window.unwrap_or(window).clamp(2, longest))?;
    training.sharpen();
    monitor.stage("refining the model", 0.2);
    // A number inside a new term can move only once the term has a coefficient.
    let mut refit = training.refit(monitor);
    training.take(&mut refit);
    let round = training.rounds(monitor)?;
    lengthen(training, round, monitor)
}

/// Doubles the length of the segments for as long as the model follows them.
fn grow<'a>(
    mut training: Training<'a>,
    mut round: Round,
    monitor: &dyn Monitor,
) -> Result<(Training<'a>, Round)> {
    let longest = training.measured.longest_run().min(training.options.tuning.course.longest);
    while training.law().window() < longest && round.refit.stop != StopReason::Interrupted {
        if monitor.stopped() {
            round.refit.stop = StopReason::Interrupted;
            break;
        }
        let window = (2 * training.law().window()).min(longest);
        let fraction = 0.4 + 0.5 * window as f64 / longest as f64;
        monitor.stage(&format!("segments of {window} samples"), fraction);
        let mut longer = training.clone();
        longer.recut(window)?;
        let next = match longer.rounds(monitor) {
            Err(Error::Interrupted) => {
                round.refit.stop = StopReason::Interrupted;
                break;
            }
            next => next?,
        };
        let follows = (longer.law().noise().iter())
            .zip(training.law().noise().iter().zip(&longer.accuracy.resolution))
            .all(|(new, (old, floor))| {
                *new <= training.options.tuning.course.follows
                    * old.max(training.options.tuning.course.above_resolution * floor)
            });
        if !follows || next.refit.sums().diverged > round.refit.sums().diverged {
            break;
        }
        training = longer;
        round = next;
    }
    Ok((training, round))
}

/// Tries several starts of the inner parameters on a part of the data; keeps the best.
fn best_start<'a>(first: Training<'a>, monitor: &dyn Monitor) -> Result<Training<'a>> {
    let starts = super::starts::starts(first.system(), first.options);
    if starts.len() < 2 {
        return Ok(first);
    }
    let ids = first.system().parameter_ids();
    let mut best: Option<(f64, Training)> = None;
    for (i, start) in starts.iter().enumerate() {
        monitor.stage(
            "fitting from several starts of the parameters",
            0.2 * i as f64 / starts.len() as f64,
        );
        let mut trial = first.clone();
        let values: Vec<(ParameterId, f64)> = ids.iter().copied().zip(start.clone()).collect();
        trial.law.set_parameters(&values);
        trial.thin(first.options.tuning.course.start_segments);
        let Ok(round) = trial.rounds(monitor) else { continue };
        let unknowns = round.refit.theta.len();
        let choice = trial.law.columns().into_iter().map(|k| round.columns.costs[k]).sum();
        // The criterion in absolute units: every try has its own estimate of the noise.
        let rows = round.refit.sums().rows;
        let noise: f64 = trial.law.noise().iter().map(|s| s.ln()).sum::<f64>();
        let scale = 2.0 * noise / trial.law.noise().len() as f64;
        let value =
            rows as f64 * scale + round.criterion.value(rows as f64, rows, unknowns, choice);
        let better = best.as_ref().is_none_or(|(least, _)| value < *least);
        if better && value.is_finite() {
            best = Some((value, trial));
        }
        if monitor.stopped() {
            break;
        }
    }
    let Some((_, winner)) = best else { return Ok(first) };
    let mut training = first;
    training.law = winner.law;
    training.accuracy = winner.accuracy;
    Ok(training)
}
