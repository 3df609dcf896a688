//! The course of a training: the best of several starts, rounds on a part of the data, rounds on
//! all of them, and segments that grow for as long as the model follows them.

use super::gauss_newton::StopReason;
use super::law::Law;
use super::monitor::Monitor;
use super::options::Options;
use super::segments::Reach;
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
        (training, round) = bridge(training, round, monitor)?;
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
        match followed(longer, &training, &mut round, monitor) {
            Some(longer) => (training, round) = longer,
            None => break,
        }
    }
    Ok((training, round))
}

/// Segments bridge holes that are no longer than this many of the longest segment: numbers that
/// follow the motion through that are off by a part of the noise in each, and over four times as
/// long still by less than the motion.
const BRIDGED: f64 = 4.0;

/// Joins segments across holes for as long as the model follows, once it follows all of them up to
/// their holes: records with a hole after every few samples, as those of stars by seasons, know
/// more than the pieces do. What drives the motion is not known in a hole.
fn bridge<'a>(
    mut training: Training<'a>,
    mut round: Round,
    monitor: &dyn Monitor,
) -> Result<(Training<'a>, Round)> {
    let most = training.options.tuning.course.longest;
    let follows = training.law().window() >= training.measured.longest_run().min(most);
    if !follows || training.stream.is_some() || training.measured.driven().0 > 0 {
        return Ok((training, round));
    }
    loop {
        let samples = training.segments.longest();
        let time = training.segments.longest_time(&training.measured);
        let reach = Reach { window: (2 * samples).min(most), bridged: BRIDGED * time };
        let mut longer = training.clone();
        longer.recut_to(reach)?;
        if longer.segments.longest_time(&longer.measured) <= time
            || round.refit.stop == StopReason::Interrupted
        {
            return Ok((training, round));
        }
        monitor.stage("segments that bridge holes", 0.9);
        match followed(longer, &training, &mut round, monitor) {
            Some(longer) => (training, round) = longer,
            None => return Ok((training, round)),
        }
    }
}

/// A training on longer segments than another, where the model follows these; `None` where it does
/// not, or where the round before is all that there is time for.
fn followed<'a>(
    mut longer: Training<'a>,
    training: &Training<'a>,
    round: &mut Round,
    monitor: &dyn Monitor,
) -> Option<(Training<'a>, Round)> {
    let next = match longer.rounds(monitor) {
        Err(Error::Interrupted) => {
            round.refit.stop = StopReason::Interrupted;
            return None;
        }
        // No motion of the law reaches the ends of these.
        Err(_) => return None,
        Ok(next) => next,
    };
    let tuning = &training.options.tuning.course;
    let before = training.law().noise().iter().zip(&longer.accuracy.resolution);
    let allowed =
        before.map(|(old, floor)| tuning.follows * old.max(tuning.above_resolution * floor));
    let follows = longer.law().noise().iter().zip(allowed).all(|(new, most)| *new <= most);
    let diverges = next.refit.sums().diverged > round.refit.sums().diverged;
    (follows && !diverges).then_some((longer, next))
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
