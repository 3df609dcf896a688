//! Effects that explain a misfit together, each the best after those before it.

use super::candidates::candidates;
use super::comparison::{ResidualMap, strongest_map};
use super::context::Context;
use super::evidence::Judged;
use super::misfit::{excess, squares};
use super::ranking::{Ranking, ranking};
use super::tuning::TUNING;
use super::window::longer;
use crate::data::Dataset;
use crate::error::Result;
use crate::expr::Scope;
use crate::fit::Monitor;

/// What is asked: what a model before its data misses.
pub struct Question<'a, 'b> {
    /// The spec of the model.
    pub scope: &'b Scope,
    /// The model before the runs that it was fitted to, residuals weighed by the noise floor.
    pub context: &'b Context<'a>,
    /// Other runs.
    pub held_out: &'a Dataset,
    /// Told how far it is.
    pub monitor: &'b dyn Monitor,
}

/// Effects that together explain what the model misses, each the best after those before it.
pub struct Chain {
    /// The model with the first effect, with the first two, and so on.
    pub links: Vec<Judged>,
    /// Samples of a segment at the end.
    pub window: usize,
    /// Squares that are left in excess of the noise, in parts of those at the start.
    pub left: f64,
    /// Error that is left, in units of the noise.
    pub error: f64,
    /// Whether candidates still explain more than noise would.
    pub open: bool,
    /// The force that is left, where it shows most.
    pub shape: Option<ResidualMap>,
}

impl Chain {
    /// What all its unknowns cost.
    pub fn price(&self) -> f64 {
        self.links.iter().map(|link| link.price).sum()
    }
}

/// The chain that explains the most; `None` where nothing was ranked.
///
/// With two effects missing, a flexible third may stand in for a part of each and be ranked first
/// alone: unless the first effect leaves nothing, the next ones may begin a chain too.
///
/// # Errors
///
/// When the data do not suffice to ask for a residual force.
pub fn best_chain(question: &Question, first: Ranking) -> Result<Option<Chain>> {
    let mut best: Option<Chain> = None;
    for effect in first.effects.into_iter().take(TUNING.verdict.beginnings) {
        let chain = chain(question, effect, first.window)?;
        let more = match &best {
            Some(best) => explains_more(question, &chain, best),
            None => true,
        };
        if more {
            best = Some(chain);
        }
        let alone = |chain: &Chain| chain.left == 0.0 && chain.links.len() == 1;
        if best.as_ref().is_some_and(alone) || question.monitor.stopped() {
            break;
        }
    }
    Ok(best)
}

/// Goes on from an effect with the best next one until nothing significant is left.
fn chain(question: &Question, first: Judged, window: usize) -> Result<Chain> {
    let &Question { scope, context, held_out, monitor } = question;
    let mut scope = scope.clone();
    let mut window = window;
    let mut links = Vec::new();
    let mut last = first;
    let (open, explained) = loop {
        let mut present = last.refit.context(context).with_window(window);
        // What explains everything goes on to explain it over longer segments.
        let enough = loop {
            if excess(&last.refit.left_of_all(&present)) > 0.0 {
                break false;
            }
            match longer(&present) {
                Some(longer) => present = present.with_window(longer),
                None => break true,
            }
        };
        window = present.law.window();
        if enough {
            links.push(last);
            break (false, true);
        }
        scope = scope.with(&last.refit.effect.snippet)?;
        let more = candidates(&mut scope, context.dataset);
        let present = present.with_law(present.law.on(&scope.compiled().system));
        let next = ranking(&present, held_out, &more, TUNING.ranking.later_refits, monitor);
        links.push(last);
        // A model that loses the motion answers no further question.
        let Ok(next) = next else { break (true, false) };
        let open = !next.effects.is_empty();
        let best = next.effects.into_iter().next();
        match best.filter(|best| best.merit(next.variance) > 0.0) {
            Some(best) if links.len() < TUNING.verdict.effects && !monitor.stopped() => {
                window = next.window;
                last = best;
            }
            _ => break (open, false),
        }
    };
    let end = links.last().map_or_else(|| context.clone(), |last| last.refit.context(context));
    let end = end.with_window(window);
    let at_end = match links.last() {
        _ if explained => 0.0,
        Some(last) => excess(&last.refit.left_of_all(&end)),
        None => excess(&end.settle(window).2),
    };
    let (shape, left) = if at_end > 0.0 {
        let at_start = excess(&context.settle(window).2).max(f64::MIN_POSITIVE);
        (strongest_map(&end)?, at_end / at_start)
    } else {
        (None, 0.0)
    };
    let error = (1.0 + at_end).sqrt();
    Ok(Chain { links, window, left, error, open, shape })
}

/// Whether a chain explains more than another on segments of one length, prices paid; two that
/// explain the same are left in their order.
fn explains_more(question: &Question, chain: &Chain, than: &Chain) -> bool {
    let window = chain.window.min(than.window);
    let (Some(ours), Some(theirs)) = (chain.links.last(), than.links.last()) else {
        return than.links.is_empty();
    };
    let context = |link: &Judged| link.refit.context(question.context);
    let (ours, one) = squares(&context(ours), window);
    let (theirs, other) = squares(&context(theirs), window);
    (theirs - ours) / one.min(other) > chain.price() - than.price() + TUNING.ranking.same
}
