//! What `check` prints: the expanded function space, its units, and what cannot be learned.

use std::collections::BTreeSet;

use serde::Serialize;

use super::columns::DataColumns;
use super::couplings;
use super::graph::Expr;
use super::independence::{Dependence, MOST_EXAMINED, dependences};
use super::lower::Compiled;
use super::print::Names;
use super::system::{Bounds, Observed, Place, System};
use crate::diagnostic::Diagnostic;

/// One learned term, as plain data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpaceTerm {
    /// `T`, `V`, `H`, `force q` or `sensor q`; several where one coefficient stands in several.
    pub place: String,
    /// The term in the syntax of the mini-language, without its coefficient; one for each place.
    pub label: String,
    /// Name of the coefficient: the user's, or c1, c2, ...
    pub name: String,
    /// Unit of the coefficient, where it is known.
    pub unit: Option<String>,
    /// `>= 0`, `-1..5`; empty where there is no bound.
    pub bounds: String,
    /// The effect that it came with: `viscous_drag(theta)`.
    pub effect: Option<String>,
}

/// One part that is known.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpaceKnown {
    /// `T`, `V`, `H`, or `force q`; `0` for a constraint on the motion.
    pub place: String,
    /// In the syntax of the mini-language.
    pub expression: String,
}

/// One inner parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpaceParameter {
    /// As written in the spec.
    pub name: String,
    /// What has a value of its own: `run`, or the column that tells groups of runs apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub per: Option<String>,
    /// Start values, one or more.
    pub starts: Vec<f64>,
    /// Its unit, where it is known.
    pub unit: Option<String>,
    /// `>= 0`, `-1..5`; empty where there is no bound.
    pub bounds: String,
}

/// A variable and its unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpaceVariable {
    /// As written in the spec.
    pub name: String,
    /// Its unit, where one was given.
    pub unit: Option<String>,
}

/// A measured input.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpaceInput {
    /// As written in the spec.
    pub name: String,
    /// Its unit, where one was given.
    pub unit: Option<String>,
    /// `hold`, `linear`, `spline` or `band_limited`.
    pub between_samples: &'static str,
}

/// What a column shows that is no part of the state.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpaceMeasure {
    /// As written in the spec.
    pub name: String,
    /// Its unit, where one was given.
    pub unit: Option<String>,
    /// As it was written.
    pub expression: String,
    /// What it is compared modulo, in its unit: a whole turn of an angle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period: Option<f64>,
}

/// A spec written out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FunctionSpace {
    /// Name of the system.
    pub system: String,
    /// What moves.
    pub coordinates: Vec<SpaceVariable>,
    /// Conjugate momenta, one for each coordinate.
    pub momenta: Vec<SpaceVariable>,
    /// Measured velocities; empty where momenta are measured.
    pub velocities: Vec<SpaceVariable>,
    /// What is measured and drives the motion.
    pub inputs: Vec<SpaceInput>,
    /// What columns show that is no part of the state.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub measures: Vec<SpaceMeasure>,
    /// Unit of H, where it is known.
    pub energy_unit: Option<String>,
    /// Parts that are not learned.
    pub known: Vec<SpaceKnown>,
    /// The function space; the order is that of [`System::terms`].
    pub terms: Vec<SpaceTerm>,
    /// Inner parameters.
    pub parameters: Vec<SpaceParameter>,
    /// Sentences: which coordinates are coupled, where there are many.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub couplings: Vec<String>,
    /// Sentences: what no measurement can tell.
    pub cannot_be_learned: Vec<String>,
    /// Warnings and notes about the text.
    pub warnings: Vec<Diagnostic>,
}

/// Bounds as a reader writes them.
fn bounds_text(bounds: Bounds) -> String {
    match (bounds.lower.is_finite(), bounds.upper.is_finite()) {
        (false, false) => String::new(),
        (true, false) => format!(">= {}", bounds.lower),
        (false, true) => format!("<= {}", bounds.upper),
        (true, true) if bounds.lower == bounds.upper => format!("= {}", bounds.lower),
        (true, true) => format!("{}..{}", bounds.lower, bounds.upper),
    }
}

impl System {
    /// `T`, `V`, `H`, or `force q[2]`.
    pub fn place_name(&self, place: Place) -> String {
        match place {
            Place::Kinetic => "T".to_string(),
            Place::Potential => "V".to_string(),
            Place::Hamiltonian => "H".to_string(),
            Place::Force(i) => {
                let name = self.coordinates.get(i).map_or("?", |variable| variable.name.as_str());
                format!("force {name}")
            }
            Place::Rate(i) => {
                let name = self.coordinates.get(i).map_or("?", |variable| variable.name.as_str());
                format!("rate {name}")
            }
            Place::Sensor(i) => {
                let observables = self.observables();
                format!("sensor {}", observables.get(i).map_or("?", String::as_str))
            }
        }
    }
}

impl FunctionSpace {
    /// Writes a compiled spec out, and examines what can be learned.
    pub fn new(compiled: &Compiled) -> FunctionSpace {
        let system = &compiled.system;
        let names = system.names();
        let variables = |list: &[super::system::Variable]| -> Vec<SpaceVariable> {
            let plain = |v: &super::system::Variable| SpaceVariable {
                name: v.name.clone(),
                unit: v.unit_text.clone(),
            };
            list.iter().map(plain).collect()
        };
        let input = |input: &super::system::InputVariable| SpaceInput {
            name: input.variable.name.clone(),
            unit: input.variable.unit_text.clone(),
            between_samples: input.between.keyword(),
        };
        let measure = |measure: &super::system::Measure| SpaceMeasure {
            name: measure.variable.name.clone(),
            unit: measure.variable.unit_text.clone(),
            expression: measure.text.clone(),
            period: measure.period,
        };
        let mut known = Vec::new();
        let fixed = [
            (Place::Kinetic, system.kinetic),
            (Place::Potential, system.potential),
            (Place::Hamiltonian, system.hamiltonian),
        ];
        let forces = system.forces.iter().enumerate().map(|(i, &expr)| (Place::Force(i), expr));
        // What measures show is listed with them, as it was written.
        let sensors = system.sensors.iter().enumerate().take(2 * system.degrees());
        let sensors = sensors.map(|(i, &expr)| (Place::Sensor(i), expr));
        let rates = system.known_rates();
        for (place, expr) in fixed.into_iter().chain(forces).chain(rates).chain(sensors) {
            if !system.graph.is_zero(expr) {
                let expression = system.graph.text(expr, &names);
                known.push(SpaceKnown { place: system.place_name(place), expression });
            }
        }
        known.extend(system.constraints.iter().map(|constraint| SpaceKnown {
            place: "0".to_string(),
            expression: system.graph.text(constraint.expr, &names),
        }));
        let term = |(term, name): (&super::system::Term, &String)| SpaceTerm {
            place: join(term.parts().map(|(place, _)| system.place_name(place))),
            label: join(
                std::iter::once(term.label.clone())
                    .chain(term.also.iter().map(|&(_, expr)| system.graph.text(expr, &names))),
            ),
            name: name.clone(),
            effect: term.effect.clone(),
            unit: term.unit_text.clone(),
            bounds: bounds_text(term.bounds),
        };
        let parameter =
            |(parameter, starts): (&super::system::Parameter, &Vec<f64>)| SpaceParameter {
                name: parameter.name.clone(),
                per: parameter.per.as_ref().map(|per| per.word().to_string()),
                starts: starts.clone(),
                unit: parameter.unit_text.clone(),
                bounds: bounds_text(parameter.bounds),
            };
        FunctionSpace {
            system: system.name.clone(),
            coordinates: variables(&system.coordinates),
            momenta: variables(&system.momenta),
            velocities: variables(&system.velocities),
            inputs: system.inputs.iter().map(input).collect(),
            measures: system.measures.iter().map(measure).collect(),
            energy_unit: compiled.energy_unit.map(|unit| unit.to_string()),
            known,
            terms: system.terms.iter().zip(&names.coefficients).map(term).collect(),
            parameters: system.parameters.iter().zip(&compiled.starts).map(parameter).collect(),
            couplings: couplings::sentences(system),
            cannot_be_learned: gauge(system, &compiled.data, &names),
            warnings: compiled.warnings.clone(),
        }
    }
}

fn join(parts: impl Iterator<Item = String>) -> String {
    parts.collect::<Vec<_>>().join(", ")
}

/// What no measurement can tell, as sentences.
fn gauge(system: &System, columns: &[DataColumns], names: &Names) -> Vec<String> {
    let mut out = vec![
        "A constant in H: only derivatives of H move anything, so energies are known up to a constant."
            .to_string(),
    ];
    out.extend(super::unseen::without_influence(system, columns));
    if system.observed == Observed::Velocities {
        let zero = |expr| system.graph.is_zero(expr);
        let nothing_known =
            zero(system.kinetic) && zero(system.potential) && zero(system.hamiltonian);
        if nothing_known && system.forces.iter().all(|&force| zero(force)) {
            out.push(
                "The overall scale of H: velocities are measured and no part of H is known, \
                 so H and all momenta may be multiplied by one number; make a part of T known."
                    .to_string(),
            );
        }
        let linear = |i: usize| {
            let momentum = super::graph::Symbol::Momentum(i);
            system.terms.iter().any(|term| {
                term.place == Place::Kinetic
                    && matches!(system.graph.node(term.expr), super::graph::Node::Symbol(s) if *s == momentum)
            })
        };
        let shifted: Vec<&str> = (0..system.degrees())
            .filter(|&i| linear(i))
            .map(|i| system.momenta[i].name.as_str())
            .collect();
        if !shifted.is_empty() {
            out.push(format!(
                "The zero of {}: velocities are measured, so a momentum may be shifted by a constant; \
                 the term linear in it only sets that shift.",
                shifted.join(", ")
            ));
        }
    }
    match dependences(system) {
        None if system.terms.len() > MOST_EXAMINED => out.push(format!(
            "Not examined: whether the {} terms are independent (done up to {MOST_EXAMINED}).",
            system.terms.len()
        )),
        None => out.push(
            "Not examined: whether the terms are independent (too few random states lie in their domains)."
                .to_string(),
        ),
        Some(found) => out.extend(found.iter().map(|found| dependence_text(system, names, found))),
    }
    out
}

/// "The coefficients c1, c2 apart from each other: ... moves nothing".
fn dependence_text(system: &System, names: &Names, dependence: &Dependence) -> String {
    let rounded = |factor: f64| format!("{factor:.9e}").parse().unwrap_or(factor);
    let mut terms = dependence.combination.clone();
    terms.sort_by_key(|&(k, _)| k);
    let places: BTreeSet<Place> =
        terms.iter().flat_map(|&(k, _)| system.terms[k].parts().map(|part| part.0)).collect();
    // With its largest factor positive and its smallest 1, a combination is easiest to read.
    let smallest = terms.iter().fold(f64::INFINITY, |least, (_, factor)| least.min(factor.abs()));
    let sign = terms.first().map_or(1.0, |&(_, factor)| factor.signum());
    let mut graph = system.graph.clone();
    let mut parts = Vec::new();
    for &at in &places {
        let inside: Vec<(f64, Expr)> = (terms.iter())
            .filter_map(|&(k, factor)| {
                Some((rounded(sign * factor / smallest), system.terms[k].part(at)?))
            })
            .collect();
        let sum = graph.linear(0.0, &inside);
        parts.push(format!("{} in {}", graph.text(sum, names), system.place_name(at)));
    }
    let coefficients: Vec<&str> =
        terms.iter().filter_map(|&(k, _)| names.coefficients.get(k).map(String::as_str)).collect();
    format!(
        "The coefficients {} apart from each other: {} moves nothing; take one of these terms away.",
        coefficients.join(", "),
        parts.join(" together with ")
    )
}
