//! Effects that the user suspects: the `candidates` of a spec, beside those of the catalogue.

use std::collections::BTreeSet;

use super::candidates::{Candidate, Origin, extended};
use crate::expr::{Bounds, Compiled, Expr, Place, Symbol, System, build};

/// Values of one bounded inner parameter that are tried; of several together.
const POINTS: usize = 24;
const TOGETHER: usize = 64;

/// The spec's own candidates that the model does not hold yet.
///
/// An inner parameter that only the candidate uses is tried over its bounds, where it has both,
/// else at the starts that the spec lists.
pub(super) fn candidates(name: &str, text: &str, base: &Compiled) -> Vec<Candidate> {
    let held: BTreeSet<&str> =
        base.system.terms.iter().filter_map(|term| term.effect.as_deref()).collect();
    let used = parameters_of(&base.system, None);
    base.candidates
        .iter()
        .filter(|own| !held.contains(own.name.as_str()))
        .filter_map(|own| {
            let compiled = build(name, &extended(text, &format!("effect {}", own.name))).ok()?;
            let system = compiled.system;
            let terms: Vec<usize> = (0..system.terms.len())
                .filter(|&k| system.terms[k].effect.as_deref() == Some(own.name.as_str()))
                .collect();
            if terms.is_empty() {
                return None;
            }
            let parameters: Vec<usize> =
                parameters_of(&system, Some(&terms)).difference(&used).copied().collect();
            let axes: Vec<Vec<f64>> = parameters
                .iter()
                .map(|&j| axis(system.parameters[j].bounds, &compiled.starts[j], parameters.len()))
                .collect();
            let on = acts_on(&system, &terms);
            let grid = every_choice(&axes);
            let (origin, label) = (Origin::Spec, own.name.clone());
            Some(Candidate { origin, label, on, system, terms, parameters, grid })
        })
        .collect()
}

/// Inner parameters of some terms; of all that a system holds, known parts too, where none are
/// named.
fn parameters_of(system: &System, terms: Option<&[usize]>) -> BTreeSet<usize> {
    let exprs: Vec<Expr> = match terms {
        Some(terms) => terms
            .iter()
            .flat_map(|&k| system.terms[k].parts().map(|(_, expr)| expr).collect::<Vec<_>>())
            .collect(),
        None => [system.kinetic, system.potential, system.hamiltonian]
            .into_iter()
            .chain(system.forces.iter().copied())
            .chain(system.sensors.iter().copied())
            .chain(system.terms.iter().flat_map(|term| term.parts().map(|(_, expr)| expr)))
            .collect(),
    };
    let symbols = system.graph.symbols(&exprs);
    let parameter = |symbol: &Symbol| match symbol {
        Symbol::Parameter(j) => Some(*j),
        _ => None,
    };
    symbols.iter().filter_map(parameter).collect()
}

fn axis(bounds: Bounds, starts: &[f64], together: usize) -> Vec<f64> {
    let (lower, upper) = (bounds.lower, bounds.upper);
    if !(lower.is_finite() && upper.is_finite() && lower < upper) {
        return starts.to_vec();
    }
    let most = (TOGETHER as f64).powf(1.0 / together as f64) as usize;
    let count = POINTS.min(most).max(2);
    // The ends of the range are where a parameter means nothing, as often as not.
    (0..count).map(|i| lower + (upper - lower) * (i as f64 + 0.5) / count as f64).collect()
}

/// All combinations of one value from each axis.
pub(super) fn every_choice(axes: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut grid: Vec<Vec<f64>> = vec![Vec::new()];
    for axis in axes {
        grid = grid
            .iter()
            .flat_map(|head| axis.iter().map(|&x| [head.clone(), vec![x]].concat()))
            .collect();
    }
    grid
}

/// Names of the coordinates and observables that terms act on.
fn acts_on(system: &System, terms: &[usize]) -> Vec<String> {
    let observables = system.observables();
    let mut on = BTreeSet::new();
    for (place, expr) in terms.iter().flat_map(|&k| system.terms[k].parts()) {
        match place {
            Place::Force(i) => {
                on.insert(system.coordinates[i].name.clone());
            }
            Place::Sensor(i) => {
                on.insert(observables[i].clone());
            }
            _ => {
                on.extend(system.graph.symbols(&[expr]).iter().filter_map(|symbol| match symbol {
                    Symbol::Coordinate(i) | Symbol::Momentum(i) => {
                        Some(system.coordinates[*i].name.clone())
                    }
                    _ => None,
                }))
            }
        }
    }
    on.into_iter().collect()
}
