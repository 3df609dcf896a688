//! What rounding of the readings explains.
//!
//! The error of a rounded reading goes with what was read: of a motion that returns it is the same
//! turn after turn, and looks like a force or a hum to statistics that take errors for independent.
//! What of a story that may be is asked of readings that the model without it would give, rounded
//! like those that were recorded.

use super::instrument::coarse_steps;
use super::law_on_data::{LawOnData, Measurements};
use super::refit::{Precision, fitted};
use super::settling::{Settled, settle};
use super::window::longest;
use crate::data::Dataset;

/// Whether rounding alone may explain what a model with changes explains more than one without;
/// never where no column is rounded to coarse steps.
pub(super) fn is_of_rounding(without: &LawOnData, with: &LawOnData) -> bool {
    let steps = coarse_steps(without);
    if steps.iter().all(Option::is_none) {
        return false;
    }
    let whole = |model: &LawOnData, data: &Dataset| -> Option<f64> {
        let data = Measurements::of(data, model.options);
        let model = model.with_data(&data).with_window(longest(model));
        let found = fitted(&settle(model.clone()), &model.law, Precision::Full)?;
        found.sums.loss.is_finite().then_some(found.sums.loss)
    };
    let fall = |data: &Dataset| Some(whole(without, data)? - whole(with, data)?);
    let by_rounding = fall(&rounded(without, &steps));
    let found = fall(&without.data.dataset);
    let times = without.tuning().instrument.rounding_margin;
    found.zip(by_rounding).is_some_and(|(found, by_rounding)| found < times * by_rounding)
}

/// The readings that a model predicts of whole runs, in the steps of each column that has coarse
/// ones.
fn rounded(model: &LawOnData, steps: &[Option<f64>]) -> Dataset {
    let settled = settle(model.with_window(longest(model)));
    let residuals = settled.residuals();
    let Settled { model, segments, .. } = settled;
    let mut data = model.data.dataset.into_owned();
    let noise = model.law.noise();
    for (segment, left) in segments.list.iter().zip(&residuals) {
        let Some(run) = data.runs.get_mut(segment.run) else { continue };
        for ((values, step), (left, noise)) in
            run.values.iter_mut().zip(steps).zip(left.iter().zip(noise))
        {
            for (value, left) in values.iter_mut().skip(segment.first).zip(left) {
                let off = -left * noise;
                if off.is_finite() {
                    // A reading is a whole number of steps from any other.
                    *value += step.map_or(off, |step| (off / step).round() * step);
                }
            }
        }
    }
    data
}
