//! Effects that the user suspects: the `candidates` of a spec, beside those of the catalogue.

use std::collections::BTreeSet;

use super::grid::every_choice;
use super::{Candidate, Origin, one_of, terms_of};
use crate::diagnose::tuning::Candidates;
use crate::expr::{
    Bounds, Compiled, Expr, Extension, ParameterId, Place, Scope, Symbol, System, TermId,
};

/// The spec's own candidates that the model does not hold yet.
///
/// An inner parameter that only the candidate uses is tried over its bounds, where it has both,
/// else at the starts that the spec lists.
pub(super) fn candidates(scope: &mut Scope, tuning: &Candidates) -> Vec<Candidate> {
    let system = &scope.compiled().system;
    let held: BTreeSet<&str> = system.terms.iter().filter_map(|t| t.effect.as_deref()).collect();
    let own = scope.compiled().candidates.iter().map(|own| own.name.clone());
    let labels: Vec<String> = own.filter(|name| !held.contains(name.as_str())).collect();
    if labels.is_empty() {
        return Vec::new();
    }
    let used = parameters_in_use(system);
    let candidate = |label: String| {
        let extension = scope.extension(&format!("effect {label}")).ok()?;
        let terms = terms_of(&extension, |term| term.effect.as_ref() == Some(&label));
        if terms.is_empty() {
            return None;
        }
        let exprs: Vec<Expr> = parts(&extension, &terms).map(|(_, expr)| expr).collect();
        let base = scope.compiled();
        let mut ids = base.system.parameter_ids();
        ids.extend(extension.parameters().map(|(id, ..)| id));
        ids.sort_unstable();
        ids.dedup();
        let own = parameters_among(&extension.symbols(&exprs));
        let parameters: Vec<ParameterId> = ids
            .into_iter()
            .filter(|id| own.difference(&used).any(|&j| j == id.position()))
            .collect();
        let points = points(parameters.len(), tuning);
        let axes: Vec<Vec<f64>> =
            parameters.iter().map(|&id| axis(base, &extension, id, points)).collect();
        let on = acts_on(&base.system, &extension, &terms);
        let grid = every_choice(&axes);
        Some(Candidate {
            origin: Origin::Spec,
            label,
            on,
            arguments: Vec::new(),
            extension,
            terms,
            parameters,
            grid,
            choice: 0.0,
            second: None,
        })
    };
    let mut all: Vec<Candidate> = labels.into_iter().filter_map(candidate).collect();
    one_of(&mut all);
    all
}

/// Where some terms of an extension stand, and what their coefficients multiply there.
fn parts<'a>(
    extension: &'a Extension,
    terms: &'a [TermId],
) -> impl Iterator<Item = (Place, Expr)> + 'a {
    extension.terms().filter(|(id, _)| terms.contains(id)).flat_map(|(_, term)| term.parts())
}

/// Positions of the inner parameters in the known parts and in all terms of a system.
fn parameters_in_use(system: &System) -> BTreeSet<usize> {
    let exprs: Vec<Expr> = [system.kinetic, system.potential, system.hamiltonian]
        .into_iter()
        .chain(system.forces.iter().copied())
        .chain(system.sensors.iter().copied())
        .chain(system.terms.iter().flat_map(|term| term.parts().map(|(_, expr)| expr)))
        .collect();
    parameters_among(&system.graph.symbols(&exprs))
}

fn parameters_among(symbols: &[Symbol]) -> BTreeSet<usize> {
    let parameter = |symbol: &Symbol| match symbol {
        Symbol::Parameter(j) => Some(*j),
        _ => None,
    };
    symbols.iter().filter_map(parameter).collect()
}

/// Values of an inner parameter that are tried, so many `points` where it is bounded.
fn axis(base: &Compiled, extension: &Extension, id: ParameterId, points: usize) -> Vec<f64> {
    let own = extension.parameters().find(|(own, ..)| *own == id);
    let own = own.map(|(_, parameter, starts)| (parameter.bounds, starts));
    let standing = || {
        let starts = base.starts.get(id.position())?;
        Some((base.system.parameter(id)?.bounds, starts.as_slice()))
    };
    own.or_else(standing).map_or(Vec::new(), |(bounds, starts)| values(bounds, starts, points))
}

/// Points of each of so many bounded inner parameters `together`.
fn points(together: usize, tuning: &Candidates) -> usize {
    let most = (tuning.declared_points_together as f64).powf(1.0 / together as f64) as usize;
    tuning.declared_points.min(most).max(2)
}

fn values(bounds: Bounds, starts: &[f64], count: usize) -> Vec<f64> {
    let (lower, upper) = (bounds.lower, bounds.upper);
    if !(lower.is_finite() && upper.is_finite() && lower < upper) {
        return starts.to_vec();
    }
    // The ends of the range are where a parameter means nothing, as often as not.
    (0..count).map(|i| lower + (upper - lower) * (i as f64 + 0.5) / count as f64).collect()
}

/// Names of the coordinates and observables that terms act on.
fn acts_on(system: &System, extension: &Extension, terms: &[TermId]) -> Vec<String> {
    let observables = system.observables();
    let mut on = BTreeSet::new();
    for (place, expr) in parts(extension, terms) {
        match place {
            Place::Force(i) => {
                on.insert(system.coordinates[i].name.clone());
            }
            Place::Sensor(i) => {
                on.insert(observables[i].clone());
            }
            _ => on.extend(extension.symbols(&[expr]).iter().filter_map(|symbol| match symbol {
                Symbol::Coordinate(i) | Symbol::Momentum(i) => {
                    Some(system.coordinates[*i].name.clone())
                }
                _ => None,
            })),
        }
    }
    on.into_iter().collect()
}
