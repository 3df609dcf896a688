//! What nobody measures: where it starts in every segment, and what is found of it.

use serde::{Deserialize, Serialize};

use super::driving;
use super::law::Law;
use super::segments::Segment;
use super::states::States;
use super::train::Training;
use crate::data::Packed;
use crate::dynamics::{Batch, Scratch, advance};
use crate::expr::Hidden;

/// Runs of which the hidden motion is recorded, at most.
const RECORDED: usize = 100;

/// Where something that nobody measures was in a run, by the fit.
///
/// ```
/// let part = leverrier::HiddenMotion {
///     name: "z".to_string(),
///     unit: Some("m".to_string()),
///     run: "1".to_string(),
///     times: (0.0, 5.0),
///     values: (0.1, -0.3),
/// };
/// assert_eq!(part.values.1, -0.3);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HiddenMotion {
    /// Name of the coordinate, its momentum or the internal state.
    pub name: String,
    /// Its unit, where one was given.
    pub unit: Option<String>,
    /// Number of the run, counted from 1 in the order of the data.
    pub run: String,
    /// First and last time of the run, in the spec's unit.
    pub times: (f64, f64),
    /// Its values then.
    pub values: (f64, f64),
}

/// What was found of everything that nobody measures, run by run.
pub(super) fn motions(training: &Training) -> Vec<HiddenMotion> {
    let system = training.system();
    let (law, measured) = (training.law(), &training.measured);
    if system.hidden.is_empty() || training.stream.is_some() {
        return Vec::new();
    }
    let n = system.degrees();
    let mut parts: Vec<usize> = system.hidden.iter().map(|part| part.coordinate).collect();
    let momenta = system.hidden.iter().filter(|part| part.rate.is_none());
    parts.extend(momenta.map(|part| n + part.coordinate));
    let dynamics = law.dynamics();
    let theta = law.theta(&dynamics);
    let mut scratch = Scratch::new();
    let mut out = Vec::new();
    for run in 0..measured.runs().min(RECORDED) {
        let of_run = training.segments.list.iter().enumerate().filter(|(_, s)| s.run == run);
        let Some((first, from)) = of_run.clone().min_by_key(|(_, s)| s.first) else { continue };
        let Some((last, to)) = of_run.max_by_key(|(_, s)| s.last) else { continue };
        let (times, clock) = (measured.times_of(run), measured.clock_of(run));
        let mut batch = Batch::new(n, 1);
        batch.set(0, clock.time(times[to.first]), training.states.of(last));
        for at in to.first..to.last {
            let place = driving::Standing { run, sample: at, ends: false };
            driving::drive(&mut batch, measured, std::iter::once(Some(place)));
            let span = [times[at + 1] - times[at]];
            let (steps, method) = (law.stepping().steps(&span), law.stepping().method);
            advance(&dynamics, method, &mut batch, &span, steps, &theta, &mut scratch);
        }
        let (start, end) = (training.states.of(first), batch.get(0));
        let variables: Vec<_> = system.coordinates.iter().chain(&system.momenta).collect();
        out.extend(parts.iter().map(|&part| HiddenMotion {
            name: variables[part].name.clone(),
            unit: variables[part].unit_text.clone(),
            run: (run + 1).to_string(),
            times: (clock.time(times[from.first]), clock.time(times[to.last])),
            values: (start[part], end[part]),
        }));
    }
    out
}

/// Where a coordinate that nobody measures was, by a law, at a time that is near another.
pub(super) struct Known {
    /// How near.
    pub(super) apart: f64,
    /// The coordinate and its momentum.
    pub(super) values: (f64, f64),
}

/// Where a law saw a hidden coordinate at the end of a run that is nearest to a time; `None` where
/// it has not seen it, or saw several runs at a time: each then has a motion of its own.
pub(super) fn known_near(law: &Law, part: &Hidden, time: f64) -> Option<Known> {
    if part.rate.is_some() || law.hidden().is_empty() {
        return None;
    }
    let system = law.system();
    let of = |name: &str| -> Vec<&HiddenMotion> {
        let mut motions: Vec<_> = law.hidden().iter().filter(|m| m.name == name).collect();
        motions.sort_by(|a, b| a.times.0.total_cmp(&b.times.0));
        motions
    };
    let places = of(&system.coordinates[part.coordinate].name);
    let momenta = of(&system.momenta[part.coordinate].name);
    let one_clock = places.windows(2).all(|pair| pair[1].times.0 >= pair[0].times.1);
    if !one_clock || places.len() != momenta.len() {
        return None;
    }
    let ends = places.iter().zip(&momenta).flat_map(|(q, p)| {
        [(q.times.0, q.values.0, p.values.0), (q.times.1, q.values.1, p.values.1)]
    });
    let nearest = ends.min_by(|a, b| (a.0 - time).abs().total_cmp(&(b.0 - time).abs()));
    nearest.map(|(at, q, p)| Known { apart: (at - time).abs(), values: (q, p) })
}

/// The time at the first sample of a segment, on the clock of its run.
pub(super) fn start_of(measured: &Packed, segment: &Segment) -> f64 {
    time_of(measured, segment, segment.first)
}

fn time_of(measured: &Packed, segment: &Segment, sample: usize) -> f64 {
    measured.clock_of(segment.run).time(measured.times_of(segment.run)[sample])
}

/// Carries hidden coordinates on from one segment to those behind it on the same clock: the spec
/// says where they are at the first of all times. Not where a law saw them at a nearer time.
pub(super) fn carry(law: &Law, measured: &Packed, segments: &[Segment], states: &mut States) {
    let system = law.system();
    let moves = system.hidden.iter().any(|part| part.rate.is_none());
    // Across a gap nothing tells what an input did.
    if !moves || !system.inputs.is_empty() || segments.len() < 2 {
        return;
    }
    let n = system.degrees();
    let time = |segment: &Segment, sample: usize| time_of(measured, segment, sample);
    let mut order: Vec<usize> = (0..segments.len()).collect();
    order.sort_by(|&a, &b| {
        time(&segments[a], segments[a].first).total_cmp(&time(&segments[b], segments[b].first))
    });
    let dynamics = law.dynamics();
    let theta = law.theta(&dynamics);
    let mut scratch = Scratch::new();
    for pair in order.windows(2) {
        let (before, after) = (segments[pair[0]], segments[pair[1]]);
        let (start, end) = (time(&before, before.first), time(&after, after.first));
        // Runs that begin together are not one after the other.
        if end < time(&before, before.last) {
            continue;
        }
        let mut batch = Batch::new(n, 1);
        batch.set(0, start, states.of(pair[0]));
        let intervals = (end - start) / measured.typical_step().max(f64::MIN_POSITIVE);
        let steps = intervals.ceil().clamp(1.0, 1e6) as usize;
        let span = [end - start];
        let each = law.stepping().steps(&[span[0] / steps as f64]);
        let method = law.stepping().method;
        advance(&dynamics, method, &mut batch, &span, steps * each, &theta, &mut scratch);
        if !batch.is_finite(0) {
            continue;
        }
        let reached = batch.get(0);
        let state = states.of_mut(pair[1]);
        for part in system.hidden.iter().filter(|part| part.rate.is_none()) {
            if known_near(law, part, end).is_some_and(|known| known.apart <= end - start) {
                continue;
            }
            for at in [part.coordinate, n + part.coordinate] {
                state[at] = reached[at];
            }
        }
    }
}
