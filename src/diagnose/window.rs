//! How long segments may become: as long as a model follows its data.

use super::law_on_data::LawOnData;
use super::misfit::{error, error_of};
use super::refit::Refit;
use super::settling::Settled;
use crate::fit::segments::longest_run;

/// Samples of segments twice as long, or of whole runs; `None` where they are that already.
pub(super) fn doubled(model: &LawOnData) -> Option<usize> {
    let window = (2 * model.law.window()).min(longest(model));
    (window > model.law.window()).then_some(window)
}

/// Twice as long segments, if the model keeps to all of them; `None` where it does not, or where
/// there are none.
pub(super) fn longer(model: &LawOnData) -> Option<usize> {
    let window = doubled(model)?;
    let (_, lost) = error(model, model.law.window());
    let (far, more) = error(model, window);
    (more <= lost && far < model.tuning().ranking.largest_error).then_some(window)
}

/// Samples of the longest segments that a law on data is held against.
pub(super) fn longest(model: &LawOnData) -> usize {
    longest_run(&model.data.dataset).min(model.tuning().states.longest)
}

/// The longest segments, in samples, that the model with an effect follows as well as those half
/// as long.
pub(super) fn followed(refit: &Refit, settled: &Settled) -> usize {
    let model = refit.on(&settled.model);
    let longest = longest(&model);
    let mut window = model.law.window();
    if window >= longest {
        return window;
    }
    let (mut present, mut lost) = error_of(&refit.left_of(settled));
    while window < longest {
        let next = (2 * window).min(longest);
        let (longer, more) = error(&model, next);
        if more > lost
            || longer.is_nan()
            || longer > model.options.fit.course.follows * present.max(1.0)
        {
            break;
        }
        (window, present, lost) = (next, longer, more);
    }
    window
}
