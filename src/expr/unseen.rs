//! Parts of the motion that nothing measured depends on.

use super::columns::DataColumns;
use super::graph::{Expr, Symbol};
use super::system::{Place, System};

/// A sentence for everything that acts on nothing that is measured, whatever the learned
/// coefficients: nothing can be learned of it. Where there are measures, coordinates without a
/// column of their own are those that the spec says to have none.
pub(super) fn without_influence(system: &System, columns: &[DataColumns]) -> Vec<String> {
    let no_column = |i: usize| {
        let mut of = columns.iter().filter_map(|columns| columns.observables.get(i));
        !columns.is_empty() && of.all(|observed| observed.candidates.is_empty())
    };
    if system.hidden.is_empty() && !(0..2 * system.degrees()).any(no_column) {
        return Vec::new();
    }
    let silent = unseen(system, |i| !system.is_hidden(i) && !no_column(i));
    let sentence = |i: usize| {
        let why = if system.is_hidden(i) { "it is hidden" } else { "no column holds it" };
        let name = &system.coordinates[i].name;
        format!("Anything of {name}: {why}, and nothing that is measured depends on it.")
    };
    silent.into_iter().map(sentence).collect()
}

/// Coordinates that act on nothing that is measured, whatever the learned coefficients; neither
/// they nor their momenta are `measured` themselves, in the order of [`System::observables`].
pub(crate) fn unseen(system: &System, measured: impl Fn(usize) -> bool) -> Vec<usize> {
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
    let sensors = (0..system.observed_count()).filter(|&i| measured(i));
    let mut seen: Vec<bool> = (0..2 * n).map(&measured).collect();
    let mut shown: Vec<Expr> = sensors.filter_map(|i| system.sensors.get(i).copied()).collect();
    let terms = system.terms.iter().flat_map(|term| term.parts());
    let shows = |place: Place| matches!(place, Place::Sensor(i) if measured(i));
    shown.extend(terms.filter(|(place, _)| shows(*place)).map(|(_, e)| e));
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
    (0..n).filter(|&i| !seen[i] && !seen[n + i]).collect()
}
