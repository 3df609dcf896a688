//! The search for the best run: points spread over the bounds, then a compass.

use super::criterion::{Criterion, PlannedRun, Question, Sampling};
use crate::diagnose::tuning::Design;
use crate::fit::Monitor;
use crate::simulate::Interval;

/// A run and what it would bring.
#[derive(Debug, Clone)]
pub(super) struct EvaluatedRun {
    /// q, then p.
    pub start: Vec<f64>,
    /// Index of its sampling.
    pub sampling: usize,
    /// As [`Criterion::evaluate`] says it.
    pub values: Vec<f64>,
    /// The larger the better.
    pub score: f64,
}

/// What a search came to.
pub(super) struct SearchResult {
    /// The best of each neighbourhood, rounded; the best first.
    pub found: Vec<EvaluatedRun>,
    /// For each pair of rivals whether some run distinguishes them.
    pub live: Vec<bool>,
    /// Runs that were evaluated.
    pub evaluated: usize,
    /// Why it ended, in a sentence.
    pub stop: String,
}

/// Searches the starts within `bounds` (q, then p) and the samplings.
pub(super) fn search(
    criterion: &Criterion,
    samplings: &[Sampling],
    bounds: &[Interval],
    monitor: &dyn Monitor,
) -> SearchResult {
    let tuning = &criterion.options.tuning.design;
    let points = points(bounds, samplings.len() > 1, tuning);
    let mut all: Vec<EvaluatedRun> = Vec::new();
    let mut evaluated = 0;
    let mut stopped = false;
    for (s, sampling) in samplings.iter().enumerate() {
        for chunk in points.chunks(tuning.batch) {
            stopped = stopped || !all.is_empty() && monitor.stopped();
            if stopped {
                break;
            }
            monitor.stage("trying runs", 0.5 + 0.2 * s as f64 / samplings.len() as f64);
            evaluated += chunk.len();
            all.extend(judged(criterion, s, sampling, chunk));
        }
    }
    let live = live(criterion, &all);
    rank(criterion, &live, &mut all);
    let Some(best) = all.first().map(|found| found.score) else {
        let stop = "no run was possible".to_string();
        return SearchResult { found: all, live, evaluated, stop };
    };
    // The cheapest sampling that is about as good as the best.
    let chosen = all
        .iter()
        .filter(|found| about_as_good(found.score, best, tuning.enough))
        .map(|found| found.sampling)
        .min_by_key(|&s| samplings[s].times.len())
        .unwrap_or(0);
    let mut seeds: Vec<EvaluatedRun> = Vec::new();
    let rests = |found: &EvaluatedRun| at_rest(&found.start);
    let mut resting = 0;
    for found in all.iter().filter(|found| found.sampling == chosen) {
        let near =
            |other: &EvaluatedRun| distance(&found.start, &other.start, bounds) < tuning.apart;
        let first_at_rest = rests(found) && resting == 0;
        if first_at_rest || seeds.len() < tuning.neighbourhoods && !seeds.iter().any(near) {
            resting += usize::from(rests(found));
            seeds.push(found.clone());
        }
    }
    let mut steps = vec![tuning.first_step; seeds.len()];
    let mut round = 0;
    while !stopped && round < tuning.rounds && steps.iter().any(|&step| step >= tuning.last_step) {
        monitor.stage("moving the best", 0.7 + 0.2 * round as f64 / tuning.rounds as f64);
        round += 1;
        let mut polls: Vec<Vec<f64>> = Vec::new();
        let mut of: Vec<usize> = Vec::new();
        for (i, (seed, &step)) in seeds.iter().zip(&steps).enumerate() {
            if step >= tuning.last_step {
                polls.extend(around(seed, step, bounds));
                of.resize(polls.len(), i);
            }
        }
        evaluated += polls.len();
        let mut moved = vec![false; seeds.len()];
        for (found, i) in values(criterion, &samplings[chosen], &polls).into_iter().zip(of) {
            let Some((start, values)) = found else { continue };
            let score = score(criterion, &live, &values);
            if score > seeds[i].score {
                seeds[i] = EvaluatedRun { start, sampling: chosen, values, score };
                moved[i] = true;
            }
        }
        for (step, moved) in steps.iter_mut().zip(moved) {
            *step *= if moved { 1.0 } else { 0.5 };
        }
        stopped = monitor.stopped();
    }
    let stop = if stopped {
        "interrupted: the best so far was kept".to_string()
    } else if steps.iter().any(|&step| step >= tuning.last_step) {
        "the best start was still moving when the search had used up its rounds".to_string()
    } else {
        "moving the best start by a hundredth of its bounds gains nothing more".to_string()
    };
    for s in (0..samplings.len()).filter(|&s| s != chosen) {
        seeds.extend(all.iter().find(|found| found.sampling == s).cloned());
    }
    let mut found: Vec<EvaluatedRun> = Vec::new();
    for seed in seeds {
        let rounded: Vec<f64> =
            seed.start.iter().zip(bounds).map(|(&x, b)| round_to(x, b)).collect();
        let s = seed.sampling;
        if found.iter().any(|other| other.sampling == s && other.start == rounded) {
            continue;
        }
        found.extend(judged(criterion, s, &samplings[s], &[rounded]));
    }
    rank(criterion, &live, &mut found);
    SearchResult { found, live, evaluated, stop }
}

/// Whether a score is about as good as the best: brings the part `enough` of it. Standard errors
/// have negative scores.
pub(super) fn about_as_good(score: f64, best: f64, enough: f64) -> bool {
    if best >= 0.0 { score >= enough * best } else { enough * score >= best }
}

/// What a run is worth: the growth of the deviance for the pair where it grows least, or the
/// standard error with a minus.
pub(super) fn score(criterion: &Criterion, live: &[bool], values: &[f64]) -> f64 {
    match criterion.question {
        Question::Unknown(_) => -values.first().copied().unwrap_or(f64::INFINITY),
        Question::Rivals => {
            let of = |all: bool| {
                let counted = values.iter().zip(live).filter(move |(_, live)| all || **live);
                counted.map(|(value, _)| *value).fold(f64::INFINITY, f64::min)
            };
            if live.contains(&true) { of(false) } else { of(true) }
        }
    }
}

/// Whether a run starts without momentum.
pub(super) fn at_rest(start: &[f64]) -> bool {
    start[start.len() / 2..].iter().all(|p| *p == 0.0)
}

fn live(criterion: &Criterion, all: &[EvaluatedRun]) -> Vec<bool> {
    let count = if criterion.question == Question::Rivals { criterion.pairs().len() } else { 1 };
    let hopeless = criterion.options.tuning.design.hopeless;
    (0..count).map(|k| all.iter().any(|found| found.values[k] >= hopeless)).collect()
}

fn rank(criterion: &Criterion, live: &[bool], all: &mut [EvaluatedRun]) {
    for found in all.iter_mut() {
        found.score = score(criterion, live, &found.values);
    }
    all.sort_by(|a, b| b.score.total_cmp(&a.score));
}

fn values(
    criterion: &Criterion,
    sampling: &Sampling,
    starts: &[Vec<f64>],
) -> Vec<Option<(Vec<f64>, Vec<f64>)>> {
    let planned: Vec<PlannedRun> =
        starts.iter().map(|start| PlannedRun { start: start.clone(), sampling }).collect();
    let judged = criterion.evaluate(&planned);
    judged.into_iter().zip(starts).map(|(v, start)| v.map(|v| (start.clone(), v))).collect()
}

fn judged(
    criterion: &Criterion,
    at: usize,
    sampling: &Sampling,
    starts: &[Vec<f64>],
) -> Vec<EvaluatedRun> {
    let found = values(criterion, sampling, starts).into_iter().flatten();
    found.map(|(start, values)| EvaluatedRun { start, sampling: at, values, score: 0.0 }).collect()
}

/// Starts spread over the bounds, some of them at rest where that is allowed, and the corners.
///
/// The points are multiples of powers of the inverse of the root of x^(d+1) = x + 1, the golden
/// ratio in d dimensions, which leave no large hole (Roberts, "The unreasonable effectiveness
/// of quasirandom sequences", 2018).
fn points(bounds: &[Interval], several: bool, tuning: &Design) -> Vec<Vec<f64>> {
    let count = if several { tuning.points_of_several } else { tuning.points };
    let degrees = bounds.len() / 2;
    let rest = bounds[degrees..].iter().all(|b| b.lower <= 0.0 && b.upper >= 0.0);
    let place = |unit: &[f64]| -> Vec<f64> {
        unit.iter().zip(bounds).map(|(u, b)| b.lower + u * (b.upper - b.lower)).collect()
    };
    let mut points: Vec<Vec<f64>> = spread(bounds.len(), count).iter().map(|u| place(u)).collect();
    if rest {
        let still = |unit: &Vec<f64>| {
            let mut start = place(&[unit.as_slice(), &vec![0.0; degrees]].concat());
            start[degrees..].fill(0.0);
            start
        };
        points.extend(spread(degrees, count.min(tuning.points_at_rest)).iter().map(still));
    }
    if bounds.len() <= 4 {
        let corner = |k: usize| -> Vec<f64> {
            (0..bounds.len()).map(|i| if k >> i & 1 == 1 { 1.0 } else { 0.0 }).collect()
        };
        points.extend((0..1 << bounds.len()).map(|k| place(&corner(k))));
    }
    points
}

fn spread(dimensions: usize, count: usize) -> Vec<Vec<f64>> {
    let mut ratio: f64 = 2.0;
    for _ in 0..64 {
        ratio = (1.0 + ratio).powf(1.0 / (dimensions as f64 + 1.0));
    }
    let at = |i: usize, k: usize| (0.5 + i as f64 * ratio.powi(-(k as i32 + 1))).fract();
    (1..=count).map(|i| (0..dimensions).map(|k| at(i, k)).collect()).collect()
}

/// The compass around a start; one at rest stays at rest.
fn around(seed: &EvaluatedRun, step: f64, bounds: &[Interval]) -> Vec<Vec<f64>> {
    let free = if at_rest(&seed.start) { bounds.len() / 2 } else { bounds.len() };
    let mut out = Vec::new();
    for (i, side) in bounds.iter().enumerate().take(free) {
        for sign in [-1.0, 1.0] {
            let mut start = seed.start.clone();
            let moved = start[i] + sign * step * (side.upper - side.lower);
            start[i] = moved.clamp(side.lower, side.upper);
            if start[i] != seed.start[i] {
                out.push(start);
            }
        }
    }
    out
}

fn distance(a: &[f64], b: &[f64], bounds: &[Interval]) -> f64 {
    let parts = a.iter().zip(b).zip(bounds);
    parts.fold(0.0, |most: f64, ((x, y), side)| {
        let width = side.upper - side.lower;
        if width > 0.0 { most.max((x - y).abs() / width) } else { most }
    })
}

/// A number that can be set on a bench: to a fiftieth of the bounds or finer, and within them.
pub(super) fn round_to(x: f64, side: &Interval) -> f64 {
    let width = side.upper - side.lower;
    if !(width > 0.0 && width.is_finite()) {
        return x;
    }
    let digits = -(width / 50.0).log10().floor() as i32;
    let unit = 10f64.powi(digits);
    let mut rounded = (x * unit).round() / unit;
    if rounded < side.lower {
        rounded = (side.lower * unit).ceil() / unit;
    } else if rounded > side.upper {
        rounded = (side.upper * unit).floor() / unit;
    }
    // No minus before a zero.
    rounded.clamp(side.lower, side.upper) + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_leave_no_large_hole_and_some_rest() {
        let side = Interval { lower: -1.0, upper: 3.0 };
        let all = points(&[side, side], false, &Design::default());
        assert!(all.iter().flatten().all(|x| (-1.0..=3.0).contains(x)));
        assert!(all.iter().filter(|start| at_rest(start)).count() >= 64);
        for i in 0..20 {
            for j in 0..20 {
                let target = [-1.0 + 0.2 * i as f64, -1.0 + 0.2 * j as f64];
                let near = all.iter().map(|x| distance(x, &target, &[side, side]));
                assert!(near.fold(1.0, f64::min) < 0.1, "{target:?}");
            }
        }
    }

    #[test]
    fn starts_are_rounded_within_their_bounds() {
        for (x, lower, upper, rounded) in [
            (0.123_456, -1.0, 1.0, 0.12),
            (0.999, 0.0, 0.9991, 0.99),
            (-0.001, -1.0, 1.0, 0.0),
            (1234.5, 0.0, 5000.0, 1200.0),
            (0.7, 0.7, 0.7, 0.7),
        ] {
            let got = round_to(x, &Interval { lower, upper });
            assert_eq!(got, rounded, "{x}");
            assert!(got != 0.0 || got.is_sign_positive());
        }
    }
}
