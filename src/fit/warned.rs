//! What is doubtful about the numbers of a model.

use super::law::Law;
use super::model::Model;
use super::states::States;
use super::warning::{OfWindow, Warning};
use super::windowed::{Held, Known, Number, Residuals, SIGNIFICANT, differ, is_significant};
use crate::data::Dataset;
use crate::expr::{Place, Symbol};

/// Correlation of neighbouring residuals from which on they are far from white: a quarter of what
/// one leaves is known from the one before it.
const FAR_FROM_WHITE: f64 = 0.5;

/// A run stands out that leaves twice what the others do.
const STANDS_OUT: f64 = 2.0;

/// What the residuals say: that they are no noise, and that one run has most of them.
pub(super) fn of_residuals(found: &Residuals, dataset: &Dataset) -> Vec<Warning> {
    let white = found.neighbours.iter().filter(|(_, correlation, pairs)| {
        *correlation > FAR_FROM_WHITE && is_significant(*correlation, *pairs)
    });
    let mut warnings: Vec<Warning> = white
        .map(|(observable, correlation, _)| Warning::NotWhite {
            observable: observable.clone(),
            correlation: *correlation,
        })
        .collect();
    let total: f64 = found.runs.iter().map(|(squares, _)| squares).sum();
    let count: usize = found.runs.iter().map(|(_, count)| count).sum();
    let apart = found.runs.iter().zip(&dataset.runs).filter_map(|((squares, own), run)| {
        let others = (total - squares) / (count - own).max(1) as f64;
        let ratio = squares / *own as f64 / others;
        // The cube root of a mean square of k values is nearly normal (Wilson and Hilferty, Proc.
        // Natl. Acad. Sci. 17, 1931).
        let part = 2.0 / (9.0 * *own as f64);
        let deviations = (ratio.cbrt() - (1.0 - part)) / part.sqrt();
        let error_of_run = ratio.sqrt();
        let stands =
            *own > 0 && count > *own && error_of_run > STANDS_OUT && deviations > SIGNIFICANT;
        (stands && error_of_run.is_finite())
            .then(|| Warning::OneRun { run: run.name.clone(), error: error_of_run })
    });
    let apart: Vec<Warning> = apart.collect();
    if apart.len() == 1 {
        warnings.extend(apart);
    }
    warnings
}

/// What its numbers say against a law: `states` are some of its motion.
pub(super) fn of_law(law: &Law, model: &Model, states: &States) -> Vec<Warning> {
    let system = law.system();
    let mut warnings = Vec::new();
    for ((_, term, value), learned) in law.terms().zip(&model.terms) {
        let free = term.bounds.lower < term.bounds.upper;
        if free && (value == term.bounds.lower || value == term.bounds.upper) {
            let name = learned.name.clone().unwrap_or_else(|| learned.term.clone());
            warnings.push(Warning::AtBound { name, value });
        }
    }
    for id in law.dynamics().parameters() {
        let parameter = &system.parameters[id.position()];
        let value = law.parameters()[id.position()];
        if value == parameter.bounds.lower || value == parameter.bounds.upper {
            warnings.push(Warning::AtBound { name: parameter.name.clone(), value });
        }
    }
    warnings.extend(negative_masses(law, states));
    warnings.extend(feeding(law, model, states));
    warnings
}

/// Standard deviations of zero from which a coefficient has a sign.
const HAS_A_SIGN: f64 = 2.0;

/// The energy of a law at a state.
fn energy(law: &Law, state: &[f64]) -> f64 {
    let system = law.system();
    let of = |symbol: Symbol| value_of(law, state, symbol);
    let value = |expr| system.graph.value(expr, &of);
    let known: f64 = [system.kinetic, system.potential, system.hamiltonian].map(value).iter().sum();
    let learned = law.terms().flat_map(|(_, term, coefficient)| {
        let parts = term.parts().filter(|(place, _)| place.is_energy());
        parts.map(move |(_, expr)| (coefficient, expr)).collect::<Vec<_>>()
    });
    known + learned.map(|(coefficient, expr)| coefficient * value(expr)).sum::<f64>()
}

/// The value of a symbol at a state; time and inputs stand still.
fn value_of(law: &Law, state: &[f64], symbol: Symbol) -> f64 {
    let degrees = law.system().degrees();
    match symbol {
        Symbol::Coordinate(i) => state.get(i).copied().unwrap_or(f64::NAN),
        Symbol::Momentum(i) => state.get(degrees + i).copied().unwrap_or(f64::NAN),
        Symbol::Parameter(j) => law.parameters().get(j).copied().unwrap_or(f64::NAN),
        _ => 0.0,
    }
}

/// The size of a momentum over some states.
fn size_of_momentum(law: &Law, states: &States, i: usize) -> f64 {
    let at = law.system().degrees() + i;
    let squares: f64 = states
        .iter()
        .filter_map(|state| state.get(at))
        .filter(|p| p.is_finite())
        .map(|p| p * p)
        .sum();
    (squares / states.len().max(1) as f64).sqrt()
}

/// The energy at a state with one momentum set to another value.
fn energy_at(law: &Law, state: &[f64], i: usize, momentum: f64) -> f64 {
    let mut state = state.to_vec();
    if let Some(place) = state.get_mut(law.system().degrees() + i) {
        *place = momentum;
    }
    energy(law, &state)
}

/// Coordinates whose momentum lowers the energy, on the whole.
fn negative_masses(law: &Law, states: &States) -> Vec<Warning> {
    let system = law.system();
    let of = |i: usize| {
        let size = size_of_momentum(law, states, i);
        let bent = |state: &[f64]| {
            let at = |p: f64| energy_at(law, state, i, p);
            at(size) + at(-size) - 2.0 * at(0.0)
        };
        let all: f64 = states.iter().map(bent).sum();
        let moves = system.internal(i).is_none();
        (moves && size > 0.0 && all < 0.0)
            .then(|| Warning::NegativeMass { coordinate: system.coordinates[i].name.clone() })
    };
    (0..system.degrees()).filter_map(of).collect()
}

/// Whether a force on a coordinate goes by its speed and by where it is: what is fed in at one
/// place may be taken out at another, as in a motion that sustains itself.
fn bounded_elsewhere(law: &Law, i: usize) -> bool {
    let graph = &law.system().graph;
    law.terms().any(|(_, term, _)| {
        let symbols = graph.symbols(&[term.expr]);
        matches!(term.place, Place::Force(on) if on == i)
            && symbols.contains(&Symbol::Momentum(i))
            && symbols.iter().any(|symbol| matches!(symbol, Symbol::Coordinate(_)))
    })
}

/// Forces by the own speed alone that drive the motion.
fn feeding(law: &Law, model: &Model, states: &States) -> Vec<Warning> {
    let system = law.system();
    let mut warnings = Vec::new();
    for ((_, term, coefficient), learned) in law.terms().zip(&model.terms) {
        let Place::Force(i) = term.place else { continue };
        let symbols = system.graph.symbols(&[term.expr]);
        let own = |symbol: &Symbol| {
            matches!(symbol, Symbol::Momentum(j) if *j == i)
                || matches!(symbol, Symbol::Parameter(_))
        };
        let drag = symbols.contains(&Symbol::Momentum(i)) && symbols.iter().all(own);
        let drag = drag && !bounded_elsewhere(law, i);
        let size = size_of_momentum(law, states, i);
        let signed = coefficient.abs() > HAS_A_SIGN * learned.standard_error;
        if !drag || size.is_nan() || size <= 0.0 || !signed {
            continue;
        }
        let power = |state: &[f64]| {
            // Both directions: what a force that is the same in both does, motion gives back.
            let velocity = |p: f64| {
                let step = 1e-3 * size;
                let (up, down) = (p + step, p - step);
                (energy_at(law, state, i, up) - energy_at(law, state, i, down)) / (2.0 * step)
            };
            let force = |p: f64| {
                let mut state = state.to_vec();
                state[system.degrees() + i] = p;
                let of = |symbol: Symbol| value_of(law, &state, symbol);
                coefficient * system.graph.value(term.expr, &of)
            };
            force(size) * velocity(size) + force(-size) * velocity(-size)
        };
        if states.iter().map(power).sum::<f64>() > 0.0 {
            warnings.push(Warning::FeedsEnergy {
                term: learned.term.clone(),
                coordinate: system.coordinates[i].name.clone(),
                coefficient,
                standard_error: learned.standard_error,
            });
        }
    }
    warnings
}

/// What segments of different length say of each other: `all` by their length, the first of them
/// those that the law follows within the noise, of `longest` samples at most; the numbers are from
/// those that count.
pub(super) fn of_windows(
    all: &[Held],
    counts: &Held,
    longest: usize,
    period: Option<f64>,
) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let Some(followed) = all.first() else { return warnings };
    let brief = period.is_some_and(|period| followed.duration() < period);
    if followed.window() < longest && brief {
        warnings.push(Warning::FollowsBriefly {
            samples: followed.window(),
            time: followed.duration(),
            period,
            numbers_from: counts.window(),
        });
    }
    let of = |held: &Held, known: &Known| OfWindow {
        samples: held.window(),
        value: known.1,
        standard_error: known.2,
    };
    let shorter = all.iter().filter(|held| held.window() < counts.window());
    for long in counts.numbers() {
        let mut others = shorter.clone().rev().flat_map(|held| {
            held.numbers().into_iter().map(move |known| (held, known)).collect::<Vec<_>>()
        });
        if let Some((held, short)) = others.find(|(_, known)| differ(known, &long)) {
            warnings.push(Warning::WindowsDisagree {
                name: name_of(&counts.training.law, long.0),
                short: of(held, &short),
                long: of(counts, &long),
            });
        }
    }
    warnings
}

/// What a number is called.
fn name_of(law: &Law, number: Number) -> String {
    let system = law.system();
    let name = match number {
        Number::Coefficient(id) => {
            system.term(id).map(|term| term.name.clone().unwrap_or_else(|| term.label.clone()))
        }
        Number::Parameter(id) => system.parameter(id).map(|parameter| parameter.name.clone()),
    };
    name.unwrap_or_default()
}
