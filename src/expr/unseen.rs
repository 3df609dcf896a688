//! Hidden parts that nothing measured depends on.

use super::graph::{Expr, Symbol};
use super::system::{Place, System};

/// A sentence for every hidden part that acts on nothing that is measured, whatever the learned
/// coefficients: nothing can be learned of it.
pub(super) fn without_influence(system: &System) -> Vec<String> {
    if system.hidden.is_empty() {
        return Vec::new();
    }
    let n = system.degrees();
    let all = system.term_ids();
    let mut whole = system.clone();
    let (Ok(energy), Ok(forces), Ok(rates)) =
        (whole.energy(&all), whole.force(&all), whole.rates(&all))
    else {
        return Vec::new();
    };
    let graph = &mut whole.graph;
    // What each component of the state moves by.
    let state = system.state();
    let mut moved_by: Vec<Vec<Symbol>> = Vec::with_capacity(2 * n);
    for (i, &symbol) in state.iter().enumerate() {
        let coordinate = i % n;
        let law = rates.iter().find(|(at, _)| *at == coordinate).map(|(_, rate)| *rate);
        let parts: Vec<Expr> = match (i < n, law) {
            (true, Some(rate)) => vec![rate],
            (false, Some(_)) => Vec::new(),
            (true, None) => vec![graph.derivative(energy, state[n + i])],
            (false, None) => {
                vec![graph.derivative(energy, state[coordinate]), forces[coordinate]]
            }
        };
        debug_assert_eq!(state[i], symbol);
        moved_by.push(graph.symbols(&parts));
    }
    // What instruments show, then all that it depends on.
    let sensors = (0..2 * n).filter(|&i| !system.is_hidden(i));
    let mut seen: Vec<bool> = (0..2 * n).map(|i| !system.is_hidden(i)).collect();
    let mut shown: Vec<Expr> = sensors.filter_map(|i| system.sensors.get(i).copied()).collect();
    let terms = system.terms.iter().flat_map(|term| term.parts());
    shown.extend(terms.filter(|(place, _)| matches!(place, Place::Sensor(_))).map(|(_, e)| e));
    let mut wanted = system.graph.symbols(&shown);
    loop {
        for (i, by) in moved_by.iter().enumerate() {
            if seen[i] {
                wanted.extend(by);
            }
        }
        let before = seen.iter().filter(|seen| **seen).count();
        for (seen, symbol) in seen.iter_mut().zip(&state) {
            *seen |= wanted.contains(symbol);
        }
        if seen.iter().filter(|seen| **seen).count() == before {
            break;
        }
    }
    let silent =
        system.hidden.iter().filter(|part| !seen[part.coordinate] && !seen[n + part.coordinate]);
    silent
        .map(|part| {
            format!(
                "Anything of {}: it is hidden, and nothing that is measured depends on it.",
                system.coordinates[part.coordinate].name
            )
        })
        .collect()
}
