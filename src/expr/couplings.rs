//! Which coordinates a system couples, as sentences: what a loop with a wrong end, or over all
//! pairs, is seen by before anything is fitted.

use std::collections::{BTreeSet, HashSet};

use super::graph::{Expr, Graph, Node, Symbol};
use super::system::System;

/// Coordinates from which on couplings are told.
const MANY: usize = 12;
/// Coordinates that are named.
const NAMED: usize = 4;

/// Names of the coordinates that each coordinate stands in one summand with, where there are
/// `many` coordinates or more, and not all with all.
pub(crate) fn touching(system: &System, many: usize) -> Option<HashSet<[&str; 2]>> {
    let degrees = system.degrees();
    let pairs = if degrees >= many { pairs(system) } else { return None };
    let name = |site: usize| system.coordinates.get(site).map_or("", |own| own.name.as_str());
    let both = |&(a, b): &(usize, usize)| [[name(a), name(b)], [name(b), name(a)]];
    (pairs.len() < degrees * (degrees - 1) / 2).then(|| pairs.iter().flat_map(both).collect())
}

/// What is to be said of the couplings of a system with many degrees of freedom.
pub(super) fn sentences(system: &System) -> Vec<String> {
    let degrees = system.degrees();
    if degrees < MANY {
        return Vec::new();
    }
    let pairs = pairs(system);
    let mut others = vec![0; degrees];
    pairs.iter().flat_map(|&(a, b)| [a, b]).for_each(|site| others[site] += 1);
    let all = degrees * (degrees - 1) / 2;
    if pairs.len() == all {
        let (n, terms) = (degrees as f64, system.terms.len() as f64);
        let transition = 8.0 * n * n * (n + terms) + 4.0 * n * terms * terms;
        let megabytes = 8.0 * terms * terms / 1e6;
        return vec![format!(
            "Every coordinate is coupled to every other: {} terms for {all} pairs, about \
             {transition:.0e} multiplications for each transition, and {megabytes:.0} MB for each \
             triangular factor. If only neighbours are meant, take the second index from the \
             first, as in `(q[i+1] - q[i])^2 for i in 1..{}`.",
            system.terms.len(),
            degrees - 1
        )];
    }
    let usual = usual(&others);
    let few: Vec<usize> = (0..degrees).filter(|&site| others[site] < usual).collect();
    let name = |site: &usize| format!("`{}`", system.coordinates[*site].name);
    let mut sentences =
        vec![format!("{} pairs of {degrees} coordinates, most with {usual} others.", pairs.len())];
    if !few.is_empty() && pairs.len() + 1 >= degrees {
        let named: Vec<String> = few.iter().take(NAMED).map(name).collect();
        let more = few.len().saturating_sub(NAMED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        sentences.push(format!(
            "Fewer at {}{more}: there the couplings end. If they are meant to close, the terms \
             from the last back to the first are missing.",
            named.join(", ")
        ));
    }
    sentences
}

/// The number of others that most have.
fn usual(others: &[usize]) -> usize {
    let count = |of: usize| others.iter().filter(|&&other| other == of).count();
    let counts = others.iter().collect::<BTreeSet<_>>().into_iter();
    counts.map(|&of| (count(of), of)).max().map_or(0, |(_, of)| of)
}

/// Pairs of coordinates that stand in one summand together, each once.
fn pairs(system: &System) -> BTreeSet<(usize, usize)> {
    let mut parts: Vec<Expr> = system.terms.iter().map(|term| term.expr).collect();
    parts.extend([system.kinetic, system.potential, system.hamiltonian]);
    parts.extend(&system.forces);
    let mut pairs = BTreeSet::new();
    while let Some(part) = parts.pop() {
        if let Node::Sum { terms, .. } = system.graph.node(part) {
            parts.extend(terms.iter().map(|(term, _)| *term));
            continue;
        }
        let sites = sites(&system.graph, part);
        for (at, &a) in sites.iter().enumerate() {
            pairs.extend(sites[at + 1..].iter().map(|&b| (a, b)));
        }
    }
    pairs
}

/// Coordinates of the symbols of an expression, ascending.
fn sites(graph: &Graph, expr: Expr) -> Vec<usize> {
    let site = |symbol: Symbol| match symbol {
        Symbol::Coordinate(i) | Symbol::Momentum(i) => Some(i),
        _ => None,
    };
    let sites: BTreeSet<usize> = graph.symbols(&[expr]).into_iter().filter_map(site).collect();
    sites.into_iter().collect()
}
