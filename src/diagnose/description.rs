//! Stories compared: by what they leave over segments that all of them follow, and what they cost.

use rayon::prelude::*;

use super::autocorrelation::Noise;
use super::story::Story;
use super::tuning::Tuning;

/// What stories leave over segments that all of them follow, and what they cost: twice the nats of
/// their description, but for what all have in common.
pub(super) fn description_lengths(stories: &[&Story], tuning: &Tuning) -> Vec<f64> {
    let windows = stories.iter().map(|story| story.model.law.window());
    let (Some(window), Some(noise)) = (windows.min(), least_noise(stories)) else {
        return Vec::new();
    };
    let squares: Vec<(f64, f64)> =
        stories.par_iter().map(|story| story.squares(window, &noise)).collect();
    let mean = squares.iter().map(|(loss, rows)| loss / rows).fold(f64::INFINITY, f64::min);
    let negligible = stories.iter().map(|story| story.negligible).fold(0.0, f64::max);
    let least = negligible.max(tuning.scan.least_variance);
    let variance = if mean.is_finite() { mean.max(least) } else { 1.0 };
    let variance = variance * noise.autocorrelation_time;
    let known = |loss: f64, rows: f64| match is_computed(stories) {
        true => loss.max(rows) / noise.autocorrelation_time,
        false => loss / variance,
    };
    let both = stories.iter().zip(&squares);
    both.map(|(story, &(loss, rows))| {
        known(loss, rows) + story.price() + story.standing().len() as f64 * rows.max(2.0).ln()
    })
    .collect()
}

/// Whether one of some stories leaves of computed data what steps and digits do. That is no white
/// noise that a further change could be told by: what is below it is as good as nothing.
pub(super) fn is_computed(stories: &[&Story]) -> bool {
    stories.iter().any(|story| story.explains && story.model.is_computed())
}

/// The noise of the story that leaves the least of it: what all are judged by. Where a story leaves
/// nothing but correlated noise of whole runs, it is that of a story that explains whole runs: over
/// short segments every model leaves less. Where stories leave what their steps do, it is the most
/// that any does.
fn least_noise(stories: &[&Story]) -> Option<Noise> {
    let size = |noise: &Noise| noise.log_size();
    let at_steps = stories.iter().filter(|story| story.explains && story.model.at_steps);
    let most = at_steps.map(|story| story.model.noise()).max_by(|a, b| size(a).total_cmp(&size(b)));
    if most.is_some() {
        return most;
    }
    let correlated = |story: &&&Story| story.explains && story.model.autocorrelation_time > 1.0;
    let any = stories.iter().any(|story| correlated(&story));
    let judged = stories.iter().filter(|story| story.explains || !any);
    let noises = judged.map(|story| story.model.noise());
    noises.min_by(|a, b| size(a).total_cmp(&size(b)))
}

/// Judges all stories by the noise of the one that leaves the least of it.
pub(super) fn agree_on_noise(stories: &mut [Story]) {
    let Some(noise) = least_noise(&stories.iter().collect::<Vec<_>>()) else { return };
    stories.par_iter_mut().filter(|story| story.model.noise() != noise).for_each(|story| {
        story.hold_against(noise.clone());
    });
}

/// Sorts stories by their description length, the shortest first; those that explain the same stay
/// in their order, which is that of their ranking.
pub(super) fn sort_by_description_length(stories: &mut Vec<Story>, tuning: &Tuning) {
    let lengths = description_lengths(&stories.iter().collect::<Vec<_>>(), tuning);
    let mut both: Vec<(f64, Story)> = lengths.into_iter().zip(stories.drain(..)).collect();
    let least = both.iter().map(|(length, _)| *length).fold(f64::INFINITY, f64::min);
    let step = tuning.ranking.same;
    // Whole numbers are exact in an f64 up to 9e15.
    both.sort_by_key(|(length, _)| ((length - least) / step).floor().min(1e15) as u64);
    stories.extend(both.into_iter().map(|(_, story)| story));
}
