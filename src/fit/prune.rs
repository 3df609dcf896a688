//! The last look at a support: terms that do not pay their price are taken out.
//!
//! The search compares supports on a factor in which the coefficients are absolute. On clean
//! data the weights are near 1e15, and rounding in that factor can hide that a term does
//! nothing. Here the same criterion is asked again, of the model linearised at its own
//! coefficients, where nothing cancels.

use super::column::Column;
use super::criterion::Criterion;
use super::monitor::Monitor;
use super::per_run::own;
use super::train::{Round, Training};
use super::uncertainty::{covariance, undetermined};
use crate::expr::{Symbol, Term, TermId};

/// Takes terms out one by one, the weakest first, and refits after each.
pub(super) fn prune(training: &mut Training, round: &mut Round, monitor: &dyn Monitor) {
    if !training.options.sparse {
        return;
    }
    let searched = training.law.support().len();
    while let Some(weakest) = superfluous(training, round) {
        let mut fewer = training.clone();
        fewer.law = fewer.law.without_term(weakest);
        let mut refit = fewer.refit(monitor);
        if refit.sums().diverged > round.refit.sums().diverged {
            break;
        }
        fewer.take(&mut refit);
        *training = fewer;
        round.refit = refit;
    }
    if training.law.support().len() < searched {
        // What is reported as chosen is what was kept.
        let kept = training.law.columns();
        let candidates = &mut round.search.candidates;
        if let Some(kept) = candidates.iter().position(|c| c.support == kept) {
            candidates[..=kept].rotate_right(1);
        }
    }
}

/// The term whose absence betters the criterion most, if there is one.
fn superfluous(training: &Training, round: &Round) -> Option<TermId> {
    let refit = &round.refit;
    let floor = training.floor().max(round.criterion.floor);
    let criterion = Criterion { floor };
    let rows = refit.sums().rows;
    let factor = refit.linearised.merged();
    let open = undetermined(&factor);
    // What the data leave open stays as it is: it must not hide what the others do.
    let rest: Vec<Column> = Column::all(factor.columns()).filter(|k| !open.contains(k)).collect();
    let inverse = covariance(&factor.select(&rest), 1.0);
    let variance = |k: Column| {
        let place = rest.iter().position(|&other| other == k);
        place.map_or(f64::INFINITY, |place| inverse[(place, place)])
    };
    let value = |squares: f64, unknowns: usize| criterion.value(squares, rows, unknowns, 0.0);
    let unknowns = refit.theta.len();
    let present = value(refit.sums().loss, unknowns);
    let change = |(place, (id, _, coefficient)): (usize, (TermId, &Term, f64))| {
        // What the sum of squares grows by when the others take over as well as they can.
        let growth = coefficient.powi(2) / variance(Column::new(place));
        let without = value(refit.sums().loss + growth, unknowns.saturating_sub(1));
        (id, without - present - round.columns.costs[Column::from(id)])
    };
    // Where what runs have for themselves does all that a coefficient does, it stands for both.
    let system = training.system();
    let own = own(&system.parameters);
    let shared = |term: &Term| {
        let symbols = system.graph.symbols(&[term.expr]);
        !own.iter().any(|&j| symbols.contains(&Symbol::Parameter(j)))
    };
    (training.law.terms())
        .enumerate()
        .filter(|(place, (_, term, _))| shared(term) || rest.contains(&Column::new(*place)))
        .map(change)
        .filter(|(_, change)| *change < 0.0)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(id, _)| id)
}
