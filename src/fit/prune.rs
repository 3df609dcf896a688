//! The last look at a support: terms that do not pay their price are taken out.
//!
//! The search compares supports on a factor in which the coefficients are absolute. On clean
//! data the weights are near 1e15, and rounding in that factor can hide that a term does
//! nothing. Here the same criterion is asked again, of the model linearised at its own
//! coefficients, where nothing cancels.
//!
//! Few instruments read a ten-thousandth of a column. What is left of data that are finer are
//! their digits and the errors of an integrator, which are no white noise: they do not average
//! out, and an integrator's look like forces. There a term has to show above them in the motion
//! itself, and not on the mean of many samples alone.

use std::collections::HashMap;

use super::column::Column;
use super::criterion::Criterion;
use super::monitor::Monitor;
use super::per_run::own;
use super::train::{Round, Training};
use super::uncertainty::{covariance, undetermined};
use crate::expr::{Expr, Symbol, Term, TermId};

/// Takes terms out one by one, the weakest first, and refits after each.
pub(super) fn prune(training: &mut Training, round: &mut Round, monitor: &dyn Monitor) {
    if !training.options.sparse {
        return;
    }
    let searched = training.law.support().len();
    while let Some((weakest, pays)) = superfluous(training, round) {
        if !taken_out(training, round, weakest, monitor) {
            break;
        }
        if pays {
            training.below_precision.push(weakest);
        }
    }
    if training.law.support().len() < searched {
        kept_first(training, round);
    }
}

/// Takes a term out and refits the rest; whether its motion allowed that.
pub(super) fn taken_out(
    training: &mut Training,
    round: &mut Round,
    term: TermId,
    monitor: &dyn Monitor,
) -> bool {
    let mut fewer = training.clone();
    fewer.law = fewer.law.without_term(term);
    let mut refit = fewer.refit(monitor);
    if refit.sums().diverged > round.refit.sums().diverged {
        return false;
    }
    fewer.take(&mut refit);
    *training = fewer;
    round.refit = refit;
    true
}

/// What is reported as chosen is what was kept.
pub(super) fn kept_first(training: &Training, round: &mut Round) {
    let kept = training.law.columns();
    let candidates = &mut round.search.candidates;
    if let Some(kept) = candidates.iter().position(|c| c.support == kept) {
        candidates[..=kept].rotate_right(1);
    }
}

/// Residuals of one observable, where all are finer than instruments are: a term that takes fewer
/// squares of the noise away than that is below the precision of the data. None where noise is
/// noise.
fn below_precision(training: &Training, rows: usize) -> f64 {
    let finest = training.options.tuning.conclusion.clean;
    let noise = training.law.noise();
    let measured = noise.iter().zip(&training.spread).enumerate();
    let seen = |row: usize| training.measured.column(row).iter().any(|x| x.is_finite());
    let measured: Vec<bool> = (measured.filter(|(row, _)| seen(*row)))
        .map(|(_, (noise, spread))| *noise < finest * spread)
        .collect();
    let clean = !measured.is_empty() && measured.iter().all(|fine| *fine);
    if clean { rows as f64 / measured.len() as f64 } else { 0.0 }
}

/// For each term with inner parameters that nothing else of the law has, the columns of these;
/// none where measures, constraints or hidden parts may speak of any.
fn inner_of_one(training: &Training) -> HashMap<Column, Vec<Column>> {
    let (system, dynamics) = (training.system(), training.law.dynamics());
    let symbols = |term: &Term| {
        let parts: Vec<Expr> = term.parts().map(|(_, expr)| expr).collect();
        system.graph.symbols(&parts)
    };
    let terms: Vec<_> = training.law.terms().map(|(_, term, _)| symbols(term)).collect();
    let known = [system.kinetic, system.potential, system.hamiltonian].into_iter();
    let known: Vec<Expr> =
        known.chain(system.forces.iter().chain(&system.sensors).copied()).collect();
    let known = system.graph.symbols(&known);
    let mut inner: HashMap<Column, Vec<Column>> = HashMap::new();
    let elsewhere = system.measures.len() + system.constraints.len() + system.hidden.len();
    if elsewhere > 0 {
        return inner;
    }
    for (at, id) in dynamics.parameters().iter().enumerate() {
        let symbol = Symbol::Parameter(id.position());
        let mut users = terms.iter().enumerate().filter(|(_, own)| own.contains(&symbol));
        if let (Some((place, _)), None) = (users.next(), users.next())
            && !known.contains(&symbol)
        {
            let column = Column::new(dynamics.active().len() + at);
            inner.entry(Column::new(place)).or_default().push(column);
        }
    }
    inner
}

/// The term whose absence betters the criterion most, if there is one, or else the weakest of those
/// below the precision of the data; and whether it pays by the criterion.
fn superfluous(training: &Training, round: &Round) -> Option<(TermId, bool)> {
    let refit = &round.refit;
    let floor = training.floor().max(round.criterion.floor);
    let criterion = Criterion { floor };
    let rows = refit.sums().rows;
    let factor = refit.linearised.merged();
    let open = undetermined(&factor);
    // What the data leave open stays as it is: it must not hide what the others do.
    let rest: Vec<Column> = Column::all(factor.columns()).filter(|k| !open.contains(k)).collect();
    let inverse = covariance(&factor.select(&rest), 1.0);
    // Inner parameters that a term has for itself go with it. They take over nothing: near a limit
    // in which they and the coefficient are one number, its error says nothing of the term.
    let inner = inner_of_one(training);
    let variance = |k: Column| {
        let gone = inner.get(&k).map_or(&[][..], Vec::as_slice);
        let left: Vec<Column> = rest.iter().copied().filter(|at| !gone.contains(at)).collect();
        let place = left.iter().position(|&other| other == k)?;
        Some(match left.len() == rest.len() {
            true => inverse[(place, place)],
            false => covariance(&factor.select(&left), 1.0)[(place, place)],
        })
    };
    let value = |squares: f64, unknowns: usize| criterion.value(squares, rows, unknowns, 0.0);
    let unknowns = refit.theta.len();
    let present = value(refit.sums().loss, unknowns);
    let precision = below_precision(training, rows) * refit.sums().loss / rows.max(1) as f64;
    let change = |(place, (id, _, coefficient)): (usize, (TermId, &Term, f64))| {
        // What the sum of squares grows by when the others take over as well as they can.
        let column = Column::new(place);
        let growth = coefficient.powi(2) / variance(column).unwrap_or(f64::INFINITY);
        let gone = 1 + inner.get(&column).map_or(0, Vec::len);
        let without = value(refit.sums().loss + growth, unknowns.saturating_sub(gone));
        (id, without - present - round.columns.costs[Column::from(id)], growth)
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
        .filter(|(_, (id, ..))| !round.columns.required.contains(&Column::from(*id)))
        .filter(|(place, (_, term, _))| shared(term) || rest.contains(&Column::new(*place)))
        .map(change)
        .filter(|(_, change, growth)| *change < 0.0 || *growth < precision)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(id, change, _)| (id, change >= 0.0))
}
