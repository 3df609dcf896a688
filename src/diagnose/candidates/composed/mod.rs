//! Composed terms: expressions over coordinates, momenta and the spec's own subexpressions that
//! explain what a model misses, found by symbolic search.
//!
//! 1. `leaves`: what expressions begin from; `shapes`: functions of one leaf; `library`: both
//!    together, evaluated at states of the model's own trajectories.
//! 2. `responses`: what any force would do to all predictions, from one pass over the data.
//! 3. `enumerate`: products of the library's parts in V, T, H, every force and every sensor, in
//!    the order of their description length; each distinct one is scored.
//! 4. `refine`: the inner numbers of the leaders.
//! 5. `front`: one or two terms, price against what is left;
//! 6. `sets`: composed terms beside named candidates (`named`, `entries`), any number of them
//!    chosen together on one Gram matrix (`gram`).
//!
//! The scores are of first order, and a large misfit is not linear in what causes it. So leaders
//! are first fitted in full, together, until the model follows the data; around that motion, what
//! they do is added to the residuals again and every term is asked to do it alone. What is left of
//! the error of linearisation is then of second order in noise.

mod actions;
mod around;
mod course;
mod entries;
mod enumerate;
mod expression;
mod fine;
mod first_order;
mod found_set;
mod front;
mod gram;
mod idle;
mod inner_products;
mod leaves;
mod library;
mod named;
pub mod proposed;
mod refine;
mod responses;
mod search;
pub mod sets;
mod shapes;
mod statements;
mod states;
#[cfg(test)]
mod tests;

use self::around::{Around, linear};
use self::enumerate::enumerate;
use self::front::{Choice, chosen_terms, together};
use self::leaves::Leaves;
use self::library::Library;
use self::refine::refined_leaders;
use self::search::Search;
use self::statements::candidate_of;
use self::states::Along;
use super::Candidate;
use crate::diagnose::law_on_data::LawOnData;
use crate::error::Result;
use crate::expr::Scope;
use crate::fit::Monitor;
use crate::fit::column::Column;

/// What a search for composed terms found.
pub struct Composition {
    /// The front of price against what is left, the best place of it first.
    pub candidates: Vec<Candidate>,
    /// Distinct expressions that were scored.
    pub distinct: usize,
}

/// The composed terms that explain best what a model misses, as candidates for the ranking: the
/// front of price against what is left, the best place of it first.
///
/// # Errors
///
/// When a leader's terms are not of its own system.
pub fn composed(
    scope: &mut Scope,
    model: &LawOnData,
    monitor: &dyn Monitor,
) -> Result<Vec<Candidate>> {
    Ok(composition(scope, model, monitor)?.candidates)
}

/// The same, with how many expressions were looked at.
///
/// # Errors
///
/// As for [`composed`].
pub fn composition(
    scope: &mut Scope,
    model: &LawOnData,
    monitor: &dyn Monitor,
) -> Result<Composition> {
    let tuning = &model.tuning().composed;
    let nothing = Composition { candidates: Vec::new(), distinct: 0 };
    // Responses of this kind know nothing of what holds a motion to constraints, nor of what
    // columns show beside the state.
    let system = model.system();
    let unlike = !system.constraints.is_empty() || !system.measures.is_empty();
    if unlike || system.degrees() > tuning.coordinates {
        return Ok(nothing);
    }
    monitor.stage("terms composed from the variables", 0.0);
    let model = &model.thinned(model.data.most.min(model.tuning().scan.samples));
    let settled = linear(model);
    let leaves = Leaves::of(model.system(), tuning);
    let kept: Vec<Column> = Column::all(settled.model.law.dynamics().unknowns()).collect();
    let first = Search::of(&settled, &leaves, &kept, tuning.first_spacing, Along::Model, &[]);
    if first.responses.rows == 0 {
        return Ok(nothing);
    }
    let library = Library::of(&leaves, &first.jets, tuning);
    let variance = first.variance(first.responses.squares);
    let seen = enumerate(&library, &first.responses, variance, tuning, monitor);
    let distinct = seen.distinct;
    let mut terms = refined_leaders(&first, seen.found);
    let mut chosen = chosen_terms(&first, &terms);
    let few = &terms[..terms.len().min(tuning.joined)];
    let variance = first.best_variance(few);
    let mut leaders = together(few, &first, variance);
    for _ in 0..tuning.rounds {
        if monitor.stopped() || leaders.is_empty() {
            break;
        }
        monitor.stage("leaders among composed terms", 0.8);
        let Some(around) = Around::of(scope, &leaves, &settled, &leaders)? else { break };
        let search = around.search(&leaves, &leaders);
        let again = terms.into_iter().map(|(term, _)| term).collect();
        terms = refined_leaders(&search, search.scored(again));
        chosen = chosen_terms(&search, &terms);
        let best = chosen.first().map_or(Vec::new(), Choice::with_coefficients);
        let same = best.len() == leaders.len()
            && best.iter().all(|(term, _)| leaders.iter().any(|(l, _)| l.has_form_of(term)));
        if same {
            break;
        }
        leaders = best;
    }
    let candidates = chosen
        .iter()
        .take(tuning.candidates)
        .filter_map(|choice| candidate_of(scope, &leaves, &choice.terms, false));
    Ok(Composition { candidates: candidates.collect(), distinct })
}
