//! Whether measurements can carry a verdict at all.

use super::law_on_data::{LawOnData, Measurements};
use super::options::Options;
use super::settling::settle;
use super::tuning::Sufficiency;
use crate::data::Dataset;
use crate::expr::System;
use crate::fit::segments::{Reach, Segment, cut};

/// What no model could make up for: fewer measured values than a verdict asks for even if the
/// initial state of every run were all that is unknown. A sentence, or none.
pub fn lacking(
    system: &System,
    training: &Dataset,
    held_out: Option<&Dataset>,
    options: &Options,
) -> Option<String> {
    let training = Measurements::of(training, options);
    let seen = independent(system, &training, options);
    let least = &options.tuning.sufficiency;
    if let Some(reason) = too_few_to_learn(seen, least) {
        return Some(reason);
    }
    let Some(held_out) = held_out.filter(|data| !data.runs.is_empty()) else {
        return Some(
            "no samples are left to judge an effect on: put some aside, or measure more runs"
                .to_string(),
        );
    };
    let held_out = Measurements::of(held_out, options);
    too_few_to_judge(independent(system, &held_out, options), least)
}

/// The same of a law, whose segments may be shorter than the runs.
pub(super) fn lacking_beside(training: &LawOnData, held_out: &Measurements) -> Option<String> {
    let unknowns = training.law.support().len() + training.law.parameters().len();
    let least = &training.tuning().sufficiency;
    let seen = settle(training.clone()).sums.rows.saturating_sub(unknowns);
    if let Some(reason) = too_few_to_learn(seen, least) {
        return Some(reason);
    }
    let held_out = training.with_data(held_out);
    too_few_to_judge(settle(held_out).sums.rows, least)
}

/// Measured values beyond those that the initial states of uninterrupted stretches take up.
fn independent(system: &System, data: &Measurements, options: &Options) -> usize {
    let state = 2 * system.degrees();
    let whole = Reach::of(data.packed.longest_run());
    let segments = cut(&data.packed, whole, &options.fit.segments);
    let measured = |segment: &Segment| {
        let columns = data.dataset.runs[segment.run].values.iter();
        columns
            .flat_map(|column| &column[segment.first..=segment.last])
            .filter(|x| x.is_finite())
            .count()
            .saturating_sub(state)
    };
    segments.list.iter().map(measured).sum()
}

fn too_few_to_learn(found: usize, least: &Sufficiency) -> Option<String> {
    (found < least.residuals).then(|| short_of("the training part", found, least.residuals))
}

fn too_few_to_judge(found: usize, least: &Sufficiency) -> Option<String> {
    let least = least.held_out_residuals;
    (found < least).then(|| short_of("the held-out part", found, least))
}

fn short_of(part: &str, found: usize, least: usize) -> String {
    format!(
        "{part} has {found} independent residuals, and a verdict takes {least}: measure longer \
         runs, or more of them"
    )
}
