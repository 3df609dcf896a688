//! A model that follows its data by the help of some composed terms.

use super::expression::Composed;
use super::leaves::Leaves;
use super::search::Search;
use super::statements::candidate_of;
use super::states::Along;
use crate::diagnose::candidates::Candidate;
use crate::diagnose::law_on_data::LawOnData;
use crate::diagnose::refit::{Precision, Refit, Start, refit_whole};
use crate::diagnose::scan::Scored;
use crate::diagnose::score_test::Score;
use crate::diagnose::settling::{Settled, settle, settle_moving};
use crate::diagnose::window::followed;
use crate::error::Result;
use crate::expr::Scope;
use crate::fit::column::Column;

/// The longest segments of a few samples over which the model is off by a
/// small part of the spread of the data: there its misfit is linear in what causes it.
pub(super) fn linear<'a>(model: &LawOnData<'a>) -> Settled<'a> {
    let spread = model.spreads();
    let tuning = &model.tuning().composed;
    let mut window = tuning.shortest;
    let mut best = settle_moving(model.with_window(window));
    while window < tuning.window {
        window *= 2;
        let longer = settle_moving(model.with_window(window));
        let lost = longer.sums.diverged > best.sums.diverged;
        if lost || relative_error(&longer, &spread) > tuning.largest_error {
            break;
        }
        best = longer;
    }
    best
}

/// Root mean square of what predictions are off by beside noise, in parts of the spread of the
/// observable where that is most.
fn relative_error(settled: &Settled, spread: &[f64]) -> f64 {
    let sums = &settled.sums;
    let noise = settled.model.law.noise();
    let of = |i: usize| {
        let excess = (sums.squares[i] / sums.freedom[i].max(1.0) - 1.0).max(0.0);
        if spread[i] > 0.0 { excess.sqrt() * noise[i] / spread[i] } else { 0.0 }
    };
    (0..noise.len().min(spread.len())).map(of).fold(0.0, f64::max)
}

/// A model with some composed terms in it, fitted in full.
pub(super) struct Around<'a> {
    /// The model on the longest segments that it follows.
    pub(super) settled: Settled<'a>,
    /// Coefficients of the composed terms.
    coefficients: Vec<f64>,
    /// Columns of the unknowns that the model had before.
    kept: Vec<Column>,
}

impl<'a> Around<'a> {
    /// Fits a model with some terms, first over the segments of `settled`, then over longer ones.
    /// `None` where that brings nothing.
    ///
    /// # Errors
    ///
    /// When a term is not of its own system.
    pub(super) fn of(
        scope: &mut Scope,
        leaves: &Leaves,
        settled: &Settled<'a>,
        terms: &[(Composed, f64)],
    ) -> Result<Option<Around<'a>>> {
        // Inner numbers stay as they are: the terms need not be what is missing.
        let fixed: Vec<Composed> = terms.iter().map(|(term, _)| term.clone()).collect();
        let Some(candidate) = candidate_of(scope, leaves, &fixed, true) else { return Ok(None) };
        let coefficients: Vec<f64> = terms.iter().map(|(_, c)| *c).collect();
        if candidate.terms.len() != coefficients.len() {
            return Ok(None);
        }
        let scored = scored(coefficients);
        let start = Start::scored(&settled.model, &candidate, &scored)?;
        let Some(mut refit) = refit_whole(settled, &candidate, start, Precision::Ranking) else {
            return Ok(None);
        };
        let window = followed(&refit, settled).min(settled.model.tuning().composed.followed);
        if window > settled.model.law.window() {
            let longer = settle(settled.model.with_window(window));
            let again = refit_whole(&longer, &candidate, refit.into(), Precision::Ranking);
            let Some(again) = again else { return Ok(None) };
            refit = again;
        }
        Ok(Some(Around::from(&refit, &candidate, &settled.model, window)))
    }

    fn from(
        refit: &Refit,
        candidate: &Candidate,
        like: &LawOnData<'a>,
        window: usize,
    ) -> Around<'a> {
        let window = window.max(like.law.window());
        let settled = settle(refit.on(like).with_window(window));
        let law = &settled.model.law;
        let dynamics = law.dynamics();
        let active = dynamics.active().iter().enumerate();
        let kept = active.filter(|(_, id)| !candidate.terms.contains(id)).map(|(place, _)| place);
        let count = dynamics.active().len();
        let inner = dynamics.parameters().iter().enumerate();
        let inner = inner.filter(|(_, id)| !candidate.parameters.contains(id));
        let kept = kept.chain(inner.map(|(place, _)| count + place)).map(Column::new).collect();
        let of = |id| law.coefficient(id).unwrap_or(0.0);
        let coefficients = candidate.terms.iter().map(|&id| of(id)).collect();
        Around { settled, coefficients, kept }
    }

    /// Scores around this motion, for which what its composed terms do is to be explained again.
    pub(super) fn search(&self, leaves: &Leaves, terms: &[(Composed, f64)]) -> Search<'a> {
        let fitted = terms.iter().zip(&self.coefficients);
        let restored: Vec<(Composed, f64)> =
            fitted.map(|((term, _), &coefficient)| (term.clone(), coefficient)).collect();
        let spacing = self.settled.model.tuning().composed.second_spacing;
        Search::of(&self.settled, leaves, &self.kept, spacing, Along::Model, &restored)
    }
}

/// Coefficients as a score would have them.
fn scored(coefficients: Vec<f64>) -> Scored {
    let degrees = coefficients.len();
    let standard_errors = vec![f64::INFINITY; degrees];
    let score = Score { deviance: 0.0, degrees, coefficients, standard_errors, p_value: 1.0 };
    Scored { candidate: 0, values: Vec::new(), score, p_value: 1.0, tests: 1.0, merit: 0.0 }
}
