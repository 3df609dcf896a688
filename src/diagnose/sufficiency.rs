//! Whether measurements can carry a verdict at all.

use super::context::Context;
use super::tuning::TUNING;
use crate::data::Dataset;
use crate::expr::System;
use crate::fit::segments::{cut, packed};

/// What no model could make up for: fewer measured values than a verdict asks for even if the
/// initial state of every run were all that is unknown. A sentence, or none.
pub fn lacking(system: &System, training: &Dataset, held_out: Option<&Dataset>) -> Option<String> {
    let seen = independent(system, training);
    if seen < TUNING.sufficiency.residuals {
        return Some(short_of("the training part", seen, TUNING.sufficiency.residuals));
    }
    let Some(held_out) = held_out.filter(|data| !data.runs.is_empty()) else {
        return Some(
            "no samples are left to judge an effect on: put some aside, or measure more runs"
                .to_string(),
        );
    };
    let judge = independent(system, held_out);
    (judge < TUNING.sufficiency.held_out_residuals)
        .then(|| short_of("the held-out part", judge, TUNING.sufficiency.held_out_residuals))
}

/// The same of a model, whose segments may be shorter than the runs.
pub(super) fn lacking_beside(training: &Context, held_out: &Context) -> Option<String> {
    let unknowns = training.law.support().len() + training.law.parameters().len();
    let (_, _, sums) = training.settle(training.law.window());
    let seen = sums.rows.saturating_sub(unknowns);
    if seen < TUNING.sufficiency.residuals {
        return Some(short_of("the training part", seen, TUNING.sufficiency.residuals));
    }
    let (_, _, sums) = held_out.settle(held_out.law.window());
    (sums.rows < TUNING.sufficiency.held_out_residuals)
        .then(|| short_of("the held-out part", sums.rows, TUNING.sufficiency.held_out_residuals))
}

/// Measured values beyond those that the initial states of uninterrupted stretches take up.
fn independent(system: &System, data: &Dataset) -> usize {
    let state = 2 * system.degrees();
    let measured = packed(data);
    let segments = cut(&measured, measured.longest_run());
    let measured = |segment: &crate::fit::segments::Segment| {
        let columns = data.runs[segment.run].values.iter();
        columns
            .flat_map(|column| &column[segment.first..=segment.last])
            .filter(|x| x.is_finite())
            .count()
            .saturating_sub(state)
    };
    segments.list.iter().map(measured).sum()
}

fn short_of(part: &str, found: usize, least: usize) -> String {
    format!(
        "{part} has {found} independent residuals, and a verdict takes {least}: measure longer \
         runs, or more of them"
    )
}
