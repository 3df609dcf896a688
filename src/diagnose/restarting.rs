//! States of segments that started beside their best place, started again.

use std::collections::HashMap;

use super::law_on_data::LawOnData;
use super::settling::problem;
use crate::dynamics::{Batch, Dynamics, Scratch, advance};
use crate::fit::driving::{Standing, drive};
use crate::fit::pass;
use crate::fit::segments::{Segment, Segments};
use crate::fit::states::States;

/// Starts segments again that leave far more than most do, each from where the one before it in its
/// run goes on to, and keeps what leaves less; whether anything does. A state of which only a part
/// is measured may settle beside its best place where samples are far apart.
pub(super) fn restarted(
    model: &LawOnData,
    segments: &Segments,
    law: (&Dynamics, &[f64]),
    states: &mut States,
) -> bool {
    let measured = &model.data.packed;
    let seen = |row: usize| measured.column(row).iter().any(|x| x.is_finite());
    if (0..2 * model.system().degrees()).all(seen) {
        return false;
    }
    let ends = segments.list.iter().enumerate();
    let before: HashMap<(usize, usize), usize> =
        ends.map(|(at, segment)| ((segment.run, segment.last + 1), at)).collect();
    let tuning = &model.tuning().states;
    let mut moved = false;
    for _ in 0..tuning.restarts {
        let left = left_of_each(model, segments, law, states);
        let most = tuning.outlying * middle(&left).max(1.0);
        let outliers = segments.list.iter().enumerate().filter_map(|(at, segment)| {
            let &before = before.get(&(segment.run, segment.first))?;
            (left[at] > most && left[before] <= most).then_some((at, before))
        });
        let outliers: Vec<(usize, usize)> = outliers.collect();
        let list: Vec<Segment> = outliers.iter().map(|&(at, _)| segments.list[at]).collect();
        if list.is_empty() {
            break;
        }
        let starts = outliers.iter().map(|&(_, before)| (segments.list[before], states.of(before)));
        let mut tried = gone_on(model, law, &starts.collect::<Vec<_>>());
        let count = list.len();
        let few = Segments { list, folds: std::iter::once(0..count).collect() };
        pass::settle(&problem(model, &few, &model.law.weights()), law.0, law.1, &mut tried);
        let now = left_of_each(model, &few, law, &tried);
        let mut any = false;
        for (place, &(at, _)) in outliers.iter().enumerate() {
            if now[place] < left[at] {
                states.of_mut(at).copy_from_slice(tried.of(place));
                any = true;
            }
        }
        if !any {
            break;
        }
        moved = true;
    }
    moved
}

/// Mean weighted square of the residuals of each segment; infinite where its motion was lost.
fn left_of_each(
    model: &LawOnData,
    segments: &Segments,
    (dynamics, theta): (&Dynamics, &[f64]),
    states: &States,
) -> Vec<f64> {
    let weights = model.law.weights();
    let residuals = pass::residuals(&problem(model, segments, &weights), dynamics, theta, states);
    let mean = |segment: Vec<Vec<f64>>| {
        let (mut sum, mut count) = (0.0, 0.0);
        for x in segment.iter().flatten().filter(|x| x.is_finite()) {
            sum += x * x;
            count += 1.0;
        }
        if count > 0.0 { sum / count } else { f64::INFINITY }
    };
    residuals.into_iter().map(mean).collect()
}

/// The median.
fn middle(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    let place = values.len() / 2;
    if values.is_empty() {
        return f64::INFINITY;
    }
    *values.select_nth_unstable_by(place, f64::total_cmp).1
}

/// Where motions that start with some segments are at the first sample behind them.
fn gone_on(
    model: &LawOnData,
    (dynamics, theta): (&Dynamics, &[f64]),
    starts: &[(Segment, &[f64])],
) -> States {
    let measured = &model.data.packed;
    let stepping = model.law.stepping();
    let mut batch = Batch::new(model.system().degrees(), starts.len());
    for (lane, (segment, state)) in starts.iter().enumerate() {
        let start = measured.times_of(segment.run)[segment.first];
        batch.set(lane, measured.clock_of(segment.run).time(start), state);
    }
    let longest = starts.iter().map(|(segment, _)| segment.samples()).max().unwrap_or(0);
    let mut span = vec![0.0; starts.len()];
    let mut scratch = Scratch::new();
    for sample in 0..longest {
        let place = |segment: &Segment| {
            let sample = segment.first + sample;
            (sample <= segment.last).then_some(Standing { run: segment.run, sample, ends: false })
        };
        drive(&mut batch, measured, starts.iter().map(|(segment, _)| place(segment)));
        for ((segment, _), span) in starts.iter().zip(&mut span) {
            let times = measured.times_of(segment.run);
            *span = place(segment).map_or(0.0, |at| times[at.sample + 1] - times[at.sample]);
        }
        let steps = stepping.steps(&span);
        advance(dynamics, stepping.method, &mut batch, &span, steps, theta, &mut scratch);
    }
    (0..starts.len()).map(|lane| batch.get(lane)).collect()
}
