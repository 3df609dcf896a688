//! The answer: what a chain of effects explains, and whether something without a name explains more.

use std::fmt::Write as _;

use super::candidates::unnamed;
use super::chain::{Chain, Question};
use super::comparison::strongest_map;
use super::diagnosis::{Diagnosis, Verdict};
use super::misfit::squares;
use super::ranking::ranking;
use super::refit::RankedEffect;
use super::tuning::TUNING;
use crate::error::Result;
use crate::fit::Model;

/// The verdict when named effects explain something.
///
/// # Errors
///
/// When the data do not suffice to ask for terms without a name.
pub fn explained(question: &Question, diagnosis: &mut Diagnosis, chain: Chain) -> Result<()> {
    let effects: Vec<&RankedEffect> = chain.links.iter().map(|link| &link.refit.effect).collect();
    let Some((first, then)) = effects.split_first() else { return Ok(()) };
    diagnosis.verdict = Verdict::Missing;
    diagnosis.reason = format!(
        "{} takes the error on held-out runs from {:.2} to {:.2} times the noise",
        first.effect, first.held_out_error_before, first.held_out_error_after
    );
    for next in then {
        let _ = write!(
            diagnosis.reason,
            ", {} after it to {:.2}",
            next.effect, next.held_out_error_after
        );
    }
    diagnosis.further = then.iter().map(|&next| next.clone()).collect();
    if chain.left == 0.0 && chain.links.len() == 1 {
        return Ok(());
    }
    let tuning = &TUNING.verdict;
    question.monitor.stage("terms without a name", 0.9);
    let unnamed = best_unnamed(question, &chain)?;
    let better = unnamed.as_ref().is_some_and(|(_, more)| *more > TUNING.ranking.indistinguishable);
    let short = chain.error > tuning.reaches && chain.left > tuning.negligible;
    let endless = chain.open && chain.links.len() == tuning.effects;
    if better || endless || chain.left > tuning.leaves || short {
        diagnosis.verdict = Verdict::Unexplained;
        diagnosis.reason = match &unnamed {
            Some((best, _)) if better => {
                format!("`{}` explains it better than any effect of the catalogue", best.snippet)
            }
            _ => format!(
                "the best effects of the catalogue ({}) leave {:.0} % of the misfit, {:.2} times \
                 the noise",
                effects.iter().map(|one| one.effect.as_str()).collect::<Vec<_>>().join(", "),
                100.0 * chain.left,
                chain.error
            ),
        };
        diagnosis.unnamed_explains_more = better;
        diagnosis.unnamed = unnamed.map(|(best, _)| best);
    }
    diagnosis.shape = chain.shape;
    Ok(())
}

/// The best term without a name, and by how much it explains more than a chain, prices paid.
fn best_unnamed(question: &Question, chain: &Chain) -> Result<Option<(RankedEffect, f64)>> {
    let &Question { scope, context, held_out, monitor } = question;
    let all = unnamed(&mut scope.clone(), context.dataset);
    let Ok(found) = ranking(context, held_out, &all, TUNING.ranking.later_refits, monitor) else {
        return Ok(None);
    };
    let Some(best) = found.effects.into_iter().next() else { return Ok(None) };
    let window = found.window.min(chain.window);
    let (of_best, least) = squares(&best.refit.context(context), window);
    let last = chain.links.last().map(|last| last.refit.context(context));
    let (of_chain, other) =
        last.as_ref().map_or((f64::INFINITY, least), |last| squares(last, window));
    let more = (of_chain - of_best) / least.min(other) + chain.price() - best.price;
    Ok(Some((best.refit.effect, more)))
}

/// The verdict when no candidate explains anything, asked over segments of `window` samples.
///
/// # Errors
///
/// When the data do not suffice to ask for a residual force.
pub fn unexplained(
    question: &Question,
    diagnosis: &mut Diagnosis,
    model: &Model,
    window: usize,
) -> Result<()> {
    if !resolved(question, model) {
        diagnosis.reason = "what is left is at the limit of what the integrator and the digits of \
                            the data resolve"
            .to_string();
    } else if let Some(shape) = strongest_map(&question.context.with_window(window))? {
        diagnosis.verdict = Verdict::Unexplained;
        diagnosis.reason = format!(
            "the force on {} depends on {} in a way that no effect of the catalogue has",
            shape.on, shape.against
        );
        diagnosis.shape = Some(shape);
    }
    Ok(())
}

/// Whether the noise of some observable is above what the integrator and rounding leave.
fn resolved(question: &Question, model: &Model) -> bool {
    let mut known = question.context.law.noise().iter().zip(&model.noise);
    known.any(|(noise, of)| *noise > TUNING.verdict.resolved * of.resolution)
}
