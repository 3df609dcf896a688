//! What nobody measures: where it starts in every segment, and what is found of it.

use serde::{Deserialize, Serialize};

use super::driving;
use super::law::Law;
use super::segments::Segment;
use super::states::States;
use super::train::Training;
use crate::data::Packed;
use crate::dynamics::{Batch, Scratch, advance};

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

/// Carries hidden coordinates on from one segment to those behind it on the same clock: the spec
/// says where they are at the first of all times.
pub(super) fn carry(law: &Law, measured: &Packed, segments: &[Segment], states: &mut States) {
    let system = law.system();
    let moves = system.hidden.iter().any(|part| part.rate.is_none());
    // Across a gap nothing tells what an input did.
    if !moves || !system.inputs.is_empty() || segments.len() < 2 {
        return;
    }
    let n = system.degrees();
    let time = |segment: &Segment, sample: usize| {
        measured.clock_of(segment.run).time(measured.times_of(segment.run)[sample])
    };
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
            for at in [part.coordinate, n + part.coordinate] {
                state[at] = reached[at];
            }
        }
    }
}
