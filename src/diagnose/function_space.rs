//! Changes beside the whole function space of the spec.
//!
//! While something else was missing, the fit left out terms that the law has, and kept others that
//! bent to the misfit. So sets of changes are looked for with all terms of the function space free,
//! and of these a story keeps the ones that pay for themselves.

use nalgebra::DVector;

use super::candidates::{Candidate, left_out};
use super::effect::RankedEffect;
use super::misfit::is_resolved;
use super::refit::{Precision, fitted};
use super::settling::settle;
use super::story::{Member, Question, Story, p_value};
use crate::error::Result;
use crate::expr::TermId;
use crate::fit::Law;
use crate::fit::column::Column;
use crate::fit::factor::Factor;
use crate::fit::own_values::may_be_left_out;

/// The function space of a spec beside a law that has a part of it.
pub(super) struct FunctionSpace {
    /// Terms that the law does not have.
    left_out: Vec<Candidate>,
}

impl FunctionSpace {
    /// That of a question; empty where the spec has too many terms to have all of them free.
    pub(super) fn of(question: &Question) -> FunctionSpace {
        let most = question.model.tuning().candidates.left_out;
        FunctionSpace { left_out: left_out(question.scope, &question.model.law, most) }
    }

    /// Whether the law has all of it.
    pub(super) fn is_whole(&self) -> bool {
        self.left_out.is_empty()
    }

    /// A story with all terms free, those that its law does not have beginning with nothing.
    ///
    /// # Errors
    ///
    /// When the story is not that of the question.
    pub(super) fn all_free<'a>(&self, story: &Story<'a>) -> Result<Story<'a>> {
        let mut terms = self.left_out.iter().flat_map(|one| &one.terms);
        let begin = |law: Law, &id: &TermId| law.with_term(id, 0.0);
        let law = terms.try_fold(story.model.law.clone(), begin)?;
        Ok(story.with_law(law))
    }

    /// A story that has all terms free with those that pay for themselves; of them these are
    /// members that the law did not have.
    pub(super) fn pruned<'a>(&self, story: Story<'a>, question: &Question<'a, '_>) -> Story<'a> {
        let settled = settle(story.model.clone());
        let Some(found) = fitted(&settled, &settled.model.law, Precision::Ranking) else {
            return with_own_terms(story, &self.left_out);
        };
        let rows = found.sums.rows.max(2) as f64;
        let variance = story.variance_of(&found.sums);
        let system = story.scope.compiled().system.clone();
        // One by which the story would not stand is no member of it.
        let clear = story.model.tuning().verdict.standard_errors.powi(2);
        let mut open: Vec<(TermId, f64)> = Vec::new();
        for one in &self.left_out {
            let Some(own) = one.left_out() else { continue };
            let ids = system.terms_with_ids().filter(|(_, term)| own.is(term));
            open.extend(ids.map(|(id, _)| (id, one.price_of_number(rows).max(clear))));
        }
        // What a story leaves that explains nothing says nothing of the model's own terms.
        if story.explains {
            let mut standing = story.standing();
            standing.retain(|&id| {
                may_be_left_out(&system, id) && open.iter().all(|(other, _)| *other != id)
            });
            open.extend(standing.into_iter().map(|id| (id, rows.ln())));
        }
        // What is left at the limit of what data resolve is no noise that a term could be told by.
        let tells_apart = is_resolved(&story.model) && !story.model.is_computed();
        let limit = if tells_apart { 0.0 } else { rows };
        let law = without_idle(&found.law, found.factor, open, (variance, limit));
        if law.terms().count() == story.model.law.terms().count() {
            return with_own_terms(story, &self.left_out);
        }
        let shorter = story.with_law(law).fitted_again(question);
        let kept = if story.explains && !shorter.explains { story } else { shorter };
        with_own_terms(kept, &self.left_out)
    }
}

/// A story with those of some terms of the spec as members that its law has.
fn with_own_terms<'a>(mut story: Story<'a>, own: &[Candidate]) -> Story<'a> {
    let system = story.scope.compiled().system.clone();
    let rows = story.sums.rows.max(2) as f64;
    for one in own {
        let Some(left_out) = one.left_out() else { continue };
        let ids = system.terms_with_ids().filter(|(_, term)| left_out.is(term));
        let terms: Vec<TermId> = ids.map(|(id, _)| id).collect();
        let numbers: Option<Vec<(f64, f64)>> =
            terms.iter().map(|&id| story.model.law.coefficient_with_error(id)).collect();
        let Some(numbers) = numbers else { continue };
        let clear = numbers.iter().map(|(value, error)| (value / error).powi(2)).sum();
        let effect = RankedEffect::of_term(one, numbers, (p_value(clear), own.len() as f64));
        let price = one.price_of_number(rows);
        let (parameters, ranges) = (Vec::new(), Vec::new());
        let (named, positive) = (true, false);
        story.members.push(Member { effect, terms, parameters, ranges, price, named, positive });
    }
    story
}

/// A law without those of some terms that take less off the squares than their price, in units of
/// `variance`, or nothing beyond a `limit`; the least first, the other numbers moving with each.
fn without_idle(
    law: &Law,
    mut factor: Factor,
    open: Vec<(TermId, f64)>,
    (variance, limit): (f64, f64),
) -> Law {
    let dynamics = law.dynamics();
    let theta = DVector::from_vec(law.theta(&dynamics));
    if theta.len() != factor.columns() {
        return law.clone();
    }
    // From here on the unknowns are the numbers themselves, no steps from where they are.
    factor.shift(&-theta);
    let place = |id: TermId| dynamics.active().iter().position(|&own| own == id);
    let mut kept: Vec<Column> = Column::all(factor.columns()).collect();
    let mut open: Vec<(TermId, Column, f64)> = open
        .into_iter()
        .filter_map(|(id, price)| Some((id, Column::new(place(id)?), price)))
        .collect();
    let mut law = law.clone();
    loop {
        let least = factor.select(&kept).least();
        let gains = open.iter().enumerate().map(|(at, (_, column, price))| {
            let others: Vec<Column> = kept.iter().copied().filter(|one| one != column).collect();
            let more = factor.select(&others).least();
            let beyond = (more - limit).max(0.0).min(more - least);
            (beyond / variance - price, at)
        });
        let Some((gain, at)) = gains.min_by(|a, b| a.0.total_cmp(&b.0)) else { return law };
        if gain >= 0.0 {
            return law;
        }
        let (id, column, _) = open.remove(at);
        kept.retain(|one| *one != column);
        law = law.without_term(id);
    }
}
