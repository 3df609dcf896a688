//! How long segments may become: as long as a model follows its data.

use super::context::{Context, Settled};
use super::misfit::{error, error_of};
use super::refit::Refit;
use super::tuning::TUNING;
use crate::fit::segments::longest_run;
use crate::fit::tuning::TUNING as FIT;

/// Twice as long segments, if the model keeps to all of them, or leaves an error that is negligible,
/// in units of the noise; `None` where it does not, or where there are none.
pub fn longer(context: &Context, negligible: f64) -> Option<usize> {
    let window =
        (2 * context.law.window()).min(longest_run(context.dataset).min(TUNING.states.longest));
    if window <= context.law.window() {
        return None;
    }
    let (_, lost) = error(context, context.law.window());
    let (far, more) = error(context, window);
    (more <= lost && far < TUNING.ranking.strays.max(negligible)).then_some(window)
}

/// The longest segments, in samples, that the model with an effect follows as well as those half
/// as long.
pub fn followed(refit: &Refit, settled: &Settled) -> usize {
    let context = refit.context(&settled.context);
    let longest = longest_run(context.dataset).min(TUNING.states.longest);
    let mut window = context.law.window();
    if window >= longest {
        return window;
    }
    let (mut present, mut lost) = error_of(&refit.left_of(settled));
    while window < longest {
        let next = (2 * window).min(longest);
        let (longer, more) = error(&context, next);
        if more > lost || longer.is_nan() || longer > FIT.course.follows * present.max(1.0) {
            break;
        }
        (window, present, lost) = (next, longer, more);
    }
    window
}
