//! Measurements for a system with parts that nobody measures: columns in which nothing is.

use crate::data::{Dataset, Run};
use crate::expr::System;

/// For each observable of the wider system its place among those of the narrower one, whose
/// coordinates come first in both; none for what nobody measures.
fn places(narrow: &System, wide: &System) -> Vec<Option<usize>> {
    let (n, m) = (narrow.degrees(), wide.degrees());
    let of = |i: usize| match i.checked_sub(m) {
        None => (i < n).then_some(i),
        Some(i) => (i < n).then_some(n + i),
    };
    (0..2 * m).map(of).collect()
}

/// The same measurements in the order of the wider system's observables.
pub(super) fn widened(dataset: &Dataset, narrow: &System, wide: &System) -> Dataset {
    let places = places(narrow, wide);
    let run = |run: &Run| {
        let column = |place: &Option<usize>| match place {
            Some(at) => run.values[*at].clone(),
            None => vec![f64::NAN; run.times.len()],
        };
        Run { values: places.iter().map(column).collect(), ..run.clone() }
    };
    Dataset {
        observables: wide.observables(),
        runs: dataset.runs.iter().map(run).collect(),
        inputs: dataset.inputs.clone(),
    }
}

/// The noise of the wider system's observables, at most that of the narrower system's.
pub(super) fn at_most(noise: &[f64], most: &[f64], narrow: &System, wide: &System) -> Vec<f64> {
    let both = noise.iter().zip(places(narrow, wide));
    let least = |(noise, place): (&f64, Option<usize>)| {
        place.and_then(|at| most.get(at)).map_or(*noise, |most| noise.min(*most))
    };
    both.map(least).collect()
}

/// The noise of the narrower system's observables.
pub(super) fn narrowed(noise: &[f64], narrow: &System, wide: &System) -> Vec<f64> {
    let mut out = vec![1.0; 2 * narrow.degrees()];
    for (place, noise) in places(narrow, wide).into_iter().zip(noise) {
        if let Some(slot) = place.and_then(|at| out.get_mut(at)) {
            *slot = *noise;
        }
    }
    out
}
