//! Known numbers that may be off: constants of the spec, and numbers in its expressions.

use std::collections::{BTreeSet, HashMap};

use serde::Serialize;

use super::{Candidate, Origin, one_of};
use crate::data::{Dataset, MeasuredInput};
use crate::diagnose::tuning::Candidates;
use crate::expr::{Graph, KnownNumber, ParameterId, Place, Scope, Symbol, System, Term};

/// A number of the spec that should be another one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NumberChange {
    /// The constant's name, or what stands in the spec.
    pub name: String,
    /// What it is in the spec; what it should be is the coefficient.
    pub was: f64,
    /// Where it stands in the spec: line, from 1.
    pub line: usize,
    /// Column, from 1.
    pub column: usize,
    /// The number itself.
    #[serde(skip)]
    pub known: KnownNumber,
}

impl NumberChange {
    /// The change of a number to what its candidate's fit says.
    pub fn of(known: &KnownNumber) -> NumberChange {
        let KnownNumber { name, value, line, column, .. } = known.clone();
        NumberChange { name, was: value, line, column, known: known.clone() }
    }
}

/// Every known number that moves something, once: of numbers that act in the same way, as the
/// mass and the 2 in p^2/(2*mass) do, the one with a name, or else the first.
pub(super) fn candidates(scope: &Scope, dataset: &Dataset, tuning: &Candidates) -> Vec<Candidate> {
    let system = scope.compiled().system.clone();
    if system.terms.len() > tuning.number_terms {
        return Vec::new();
    }
    let mut numbers = scope.numbers();
    numbers.sort_by_key(|number| !number.is_named());
    numbers.truncate(tuning.numbers);
    let states = states(&system, dataset, tuning.number_states);
    let mut seen: Vec<Vec<f64>> = Vec::new();
    let mut all = Vec::new();
    for number in numbers {
        let Ok((extension, probe)) = scope.extension_of(&number) else { continue };
        let mut graph = system.graph.clone();
        let values = HashMap::from([(Symbol::Parameter(system.parameters.len()), number.value)]);
        let local = extension.import(&probe, &mut graph, &values);
        let change = motion(&system, &mut graph, &local, &states);
        let moves = change.iter().any(|x| x.is_finite() && *x != 0.0);
        if !moves || seen.iter().any(|other| are_alike(other, &change, tuning.same_number)) {
            continue;
        }
        seen.push(change);
        let parameters: Vec<ParameterId> = extension.parameters().map(|(id, ..)| id).collect();
        all.push(Candidate {
            label: format!("number({})", number.label()),
            on: acts_on(&system, &graph, &local),
            arguments: vec![number.label()],
            extension,
            terms: Vec::new(),
            parameters,
            grid: vec![Vec::new()],
            choice: 0.0,
            second: None,
            origin: Origin::Number { number: Box::new(number), probe: Box::new(probe) },
        });
    }
    one_of(&mut all);
    all
}

/// Derivatives of an input that states go on with: its value, and as many as are ever kept.
const RATES: usize = 4;

/// Up to `most` measured states: coordinates, then momenta, the time, the inputs with their
/// derivatives. What was not measured is a number of size 1.
fn states(system: &System, dataset: &Dataset, most: usize) -> Vec<Vec<f64>> {
    let n = 2 * system.degrees();
    let runs: Vec<_> = dataset.runs.iter().filter(|run| !run.times.is_empty()).collect();
    let each = most.div_ceil(runs.len().max(1));
    let places = MeasuredInput::places(&dataset.inputs).0;
    let mut out = Vec::new();
    for run in runs {
        let count = run.times.len();
        for k in 0..each.min(count) {
            let at = k * count / each.min(count);
            let cell = |row: usize| {
                let value = run.values.get(row).and_then(|cells| cells.get(at)).copied();
                value.filter(|value| value.is_finite())
            };
            // No two of them in a ratio that a system could have a reason for.
            let missing = |row: usize| 0.4 + ((1 + row) as f64 * 1.7 + at as f64).sin();
            let mut state: Vec<f64> =
                (0..n).map(|row| cell(row).unwrap_or_else(|| missing(row))).collect();
            state.push(run.times[at]);
            for (place, input) in places.iter().zip(&dataset.inputs) {
                for order in 0..RATES {
                    let kept = order < input.between.columns();
                    let column = run.inputs.get(place + order).filter(|_| kept);
                    state.push(column.map_or(1.0, |column| column[at]));
                }
            }
            out.push(state);
        }
    }
    out.truncate(most);
    out
}

/// What a term does at some states: the gradient of its energy, its forces, and what it adds to
/// sensors, one state after another.
fn motion(system: &System, graph: &mut Graph, term: &Term, states: &[Vec<f64>]) -> Vec<f64> {
    let n = 2 * system.degrees();
    let energies: Vec<_> =
        term.parts().filter(|(place, _)| place.is_energy()).map(|(_, expr)| expr).collect();
    let energy = graph.sum(&energies);
    let mut rows: Vec<_> =
        system.state().into_iter().map(|symbol| graph.derivative(energy, symbol)).collect();
    for i in 0..system.degrees() {
        rows.extend(term.part(Place::Force(i)));
    }
    for i in 0..n {
        rows.extend(term.part(Place::Sensor(i)));
    }
    let value = |state: &Vec<f64>| -> Vec<f64> {
        let of = |symbol| match symbol {
            Symbol::Coordinate(i) => state[i],
            Symbol::Momentum(i) => state[n / 2 + i],
            Symbol::Time => state[n],
            Symbol::Input(i, order) => state.get(n + 1 + RATES * i + order).copied().unwrap_or(1.0),
            // It was measured at another time: a number unlike that of the present.
            Symbol::Delayed(i, order, _) => {
                let of = |order| state.get(n + 1 + RATES * i + order).copied().unwrap_or(1.0);
                0.6 * of(order) - 0.4 * of(order + 1)
            }
            Symbol::Parameter(j) => system.parameters.get(j).map_or(1.0, |one| one.start),
            Symbol::Velocity(_) | Symbol::Coefficient(_) => 1.0,
        };
        rows.iter().map(|&row| graph.value(row, &of)).collect()
    };
    states.iter().flat_map(value).collect()
}

/// Whether two lists of numbers are multiples of each other, where both are finite: the squared
/// sine of the angle between them is below `apart`.
fn are_alike(a: &[f64], b: &[f64], apart: f64) -> bool {
    if a.len() != b.len() {
        return false;
    }
    // Sizes may be those of astronomy.
    let largest = |list: &[f64]| {
        list.iter().filter(|x| x.is_finite()).fold(f64::MIN_POSITIVE, |m, x| m.max(x.abs()))
    };
    let (of_a, of_b) = (largest(a), largest(b));
    let (mut aa, mut ab, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b).filter(|(x, y)| x.is_finite() && y.is_finite()) {
        let (x, y) = (x / of_a, y / of_b);
        aa += x * x;
        ab += x * y;
        bb += y * y;
    }
    aa > 0.0 && bb > 0.0 && aa * bb - ab * ab <= apart * aa * bb
}

/// Names of the coordinates and observables that a term acts on.
pub(super) fn acts_on(system: &System, graph: &Graph, term: &Term) -> Vec<String> {
    let observables = system.observables();
    let mut on = BTreeSet::new();
    for (place, expr) in term.parts() {
        match place {
            Place::Force(i) => {
                on.insert(i);
            }
            Place::Sensor(i) => {
                on.insert(i + system.degrees());
            }
            _ => on.extend(graph.symbols(&[expr]).iter().filter_map(|symbol| match symbol {
                Symbol::Coordinate(i) | Symbol::Momentum(i) => Some(*i),
                _ => None,
            })),
        }
    }
    let name = |i: usize| match i.checked_sub(system.degrees()) {
        Some(row) => observables[row].clone(),
        None => system.coordinates[i].name.clone(),
    };
    on.into_iter().map(name).collect()
}
