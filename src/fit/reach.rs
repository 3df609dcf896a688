//! How far a law is held against its data for the sake of its numbers.
//!
//! Segments grow in a fit for as long as the law follows them within the noise. A law of a real rig
//! lacks something: the segments that it follows so may be too short to tell its numbers, and what
//! they tell then is the noise. Longer ones leave more than noise and tell more nevertheless. What
//! is best is said by the errors of the numbers, in which what the law lacks is counted by the
//! memory of the residuals ([`scores`](super::scores)): the length counts that has the smallest.
//! Where numbers of two lengths differ by more than both errors, what the law lacks has gone into
//! those of the shorter ones, and the longer count.

use std::sync::Arc;

use super::column::Column;
use super::monitor::Monitor;
use super::options::{Options, Trainer};
use super::segments::longest_run;
use super::train::{Extent, Round, Training};
use super::warned::{of_law, of_residuals, of_windows};
use super::windowed::{Held, Number};
use super::{Model, conclude, fit, gauge, per_run, prune};
use crate::data::Dataset;
use crate::error::Result;
use crate::expr::{System, TermId};

/// Learns as [`fit`](super::fit) does; where the law does not follow the data to their end, its
/// numbers are then taken from the segments that determine them best, with errors that count what
/// the law lacks. Says what is doubtful about them: [`Model::warnings`].
///
/// A window that the options ask for is that of the model, and is reached from shorter ones.
///
/// # Errors
///
/// As [`fit`](super::fit).
pub fn fit_as_far_as_it_tells(
    system: &Arc<System>,
    dataset: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Model> {
    let plain = || fit(system, dataset, options, monitor);
    if !is_plain(system, dataset, options) {
        return plain();
    }
    let asked = options.window.map(|window| window.clamp(2, longest_run(dataset).max(2)));
    let longest = asked.unwrap_or_else(|| longest_run(dataset).min(options.tuning.course.longest));
    let mut first = options.clone();
    first.window = None;
    first.tuning.course.longest = first.tuning.course.longest.min(longest);
    let mut model = fit(system, dataset, &first, monitor)?;
    let elsewhere = |model: &Model| asked.is_some_and(|asked| model.evidence.window != asked);
    if model.evidence.window > longest {
        model = plain()?;
    }
    let law = model.law(system).filter(|law| law.dynamics().unknowns() > 0);
    let held = law.map(|law| Held::of(&law, dataset, &first)).transpose()?.flatten();
    let Some(followed) = held else {
        return if elsewhere(&model) { plain() } else { Ok(model) };
    };
    let period = followed.period();
    let mut counts = followed.clone();
    let mut all = vec![followed.clone()];
    let mut window = followed.window();
    // Beyond holes that the law does not follow through, its numbers are those of another minimum.
    let ends = followed.training.law().reach().bridged > 0.0;
    while window < longest && !ends && !monitor.stopped() {
        window = (2 * window).min(longest);
        monitor.stage(&format!("numbers from segments of {window} samples"), 0.9);
        let last = all.last().unwrap_or(&followed);
        let Ok(Some(next)) = longer(last, window, monitor) else { break };
        if next.held.is_lost(&followed) && asked.is_none() {
            break;
        }
        all.push(next.held.clone());
        let short = period.is_some_and(|period| counts.duration() < LEAST_OF_PERIOD * period);
        let another = short || next.held.disagrees(&counts) || next.held.tells_more(&counts);
        if asked.is_some() || another {
            (counts, model) = (next.held, next.model);
        }
    }
    if elsewhere(&model) {
        return plain();
    }
    let resolved = counts.is_above_resolution();
    let of_residuals = of_residuals(&counts.residuals, dataset);
    if counts.window() > followed.window() || (resolved && counts.residuals.are_correlated()) {
        counts.give_errors(&mut model);
    }
    model.warnings = of_law(&counts.training.law, &model, &counts.training.states);
    if asked.is_none() && !ends {
        model.warnings.extend(of_windows(&all, &counts, longest, period));
    }
    model.warnings.extend(of_residuals.into_iter().filter(|_| resolved));
    Ok(model)
}

/// Numbers are taken from no segment shorter than this part of a period of the fastest motion
/// where the data have longer ones: an arc of 36 degrees is bent by 5 percent of its length, and
/// less hardly tells a force from noise.
const LEAST_OF_PERIOD: f64 = 0.1;

/// Whether all is known of a system that this needs: data in memory, a factor of all unknowns that
/// all runs share, and a scale of its energy.
fn is_plain(system: &System, dataset: &Dataset, options: &Options) -> bool {
    /// Numbers of a state and of the law together, at most.
    const MOST: usize = 64;
    options.trainer == Trainer::GaussNewton
        && 2 * system.degrees() + system.terms.len() + system.parameters.len() <= MOST
        && dataset.samples() <= options.tuning.course.all_at_once
        && per_run::own(&system.parameters).is_empty()
        && system.measures.is_empty()
        && gauge::settle_scale(system, dataset).is_none()
}

/// A law over longer segments, and its model.
struct Reached<'a> {
    held: Held<'a>,
    model: Model,
}

/// The law refitted to longer segments, and the terms that these ask for; `None` where they do not
/// determine it.
fn longer<'a>(
    start: &Held<'a>,
    window: usize,
    monitor: &dyn Monitor,
) -> Result<Option<Reached<'a>>> {
    let mut training = start.training.clone();
    training.extent = Extent::Near;
    training.recut(window)?;
    let mut refit = training.refit(monitor);
    training.take(&mut refit);
    // A splitting that does for the law may not do for the space that terms are looked for in.
    training.sharpen();
    let mut round = training.rounds(monitor)?;
    prune::prune(&mut training, &mut round, monitor);
    training.finish(&mut round, monitor);
    let Some(held) = honest(training, &mut round, monitor) else { return Ok(None) };
    let model = conclude::conclude(&held.training, &round);
    Ok(Some(Reached { held, model }))
}

/// The training as it stands, without terms that pay only if residuals are taken for independent:
/// the square of a coefficient over its variance has to exceed what the criterion asks for.
fn honest<'a>(
    mut training: Training<'a>,
    round: &mut Round,
    monitor: &dyn Monitor,
) -> Option<Held<'a>> {
    let mut held = Held::at(&training)?;
    let searched = training.law.support().len();
    while training.options.sparse {
        let price = (round.refit.sums().rows.max(1) as f64).ln();
        let pays = |id: TermId| price + round.columns.costs[Column::from(id)];
        let weakest = (held.numbers().into_iter())
            .filter_map(|(number, value, error)| match number {
                Number::Coefficient(id) => Some((id, (value / error).powi(2))),
                Number::Parameter(_) => None,
            })
            .filter(|(id, _)| !round.columns.required.contains(&Column::from(*id)))
            .filter(|(id, square)| *square < pays(*id))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((id, _)) = weakest else { break };
        if !prune::taken_out(&mut training, round, id, monitor) {
            break;
        }
        held = Held::at(&training)?;
    }
    if training.law.support().len() < searched {
        prune::kept_first(&training, round);
    }
    Some(held)
}
