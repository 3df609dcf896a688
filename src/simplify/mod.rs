//! From a fitted model to the expression that a physicist would print.
//!
//! Each part of the model (T, V, H, forces) is brought to a normal form, written
//! in a few ways (as it was specified, expanded, as springs, with waves merged),
//! its learned numbers [snap] to nice ones where their uncertainty allows, the e-graph
//! applies the [rules], and the shortest result is kept. Every step but snapping is checked
//! against the original at sampled points, and is left out where it fails.

mod analysis;
mod check;
mod code;
pub mod cost;
mod emit;
mod form;
mod lang;
pub mod measured;
mod normal;
mod numbers;
mod part;
mod quantity;
pub mod rules;
pub mod shape;
pub mod snap;
mod springs;
mod text;

use std::collections::HashMap;

use nalgebra::DMatrix;

pub use code::for_machines;
pub use measured::Measured;
pub use snap::{NiceNumber, Tolerance};
pub use text::{Style, significant, uncertain};

use crate::expr::{Expr, Graph, Names, Place, Symbol, System};
use crate::fit::Law;
use crate::fit::own_values::is_said;
use check::Samples;
use egg::RecExpr;
use lang::Math;
use normal::{Atom, Atoms, Polynomial};
use numbers::Numbers;
use quantity::Quantity;

/// A law with the covariance of its numbers.
#[derive(Clone, Copy)]
struct FittedLaw<'a> {
    law: &'a Law,
    /// Of the coefficients, then all inner parameters; zero for what is exact.
    covariance: &'a DMatrix<f64>,
}

/// What simplification may do.
#[derive(Debug, Clone, PartialEq)]
pub struct SimplifyOptions {
    /// How far a number may be moved to be printed as a nice one.
    pub tolerance: Tolerance,
    /// Iterations of the e-graph. There is no time limit: results must not depend on load.
    pub iterations: usize,
    /// Nodes of the e-graph.
    pub nodes: usize,
    /// Largest |value| in the data of each state component (q, then p), where known; for
    /// the comparison of polynomials with Taylor's.
    pub ranges: Vec<f64>,
}

impl Default for SimplifyOptions {
    fn default() -> Self {
        let tolerance = Tolerance::default();
        SimplifyOptions { tolerance, iterations: 12, nodes: 6_000, ranges: Vec::new() }
    }
}

/// A simplified model.
#[derive(Debug, Clone)]
pub struct Simplified {
    /// The graph of the parts' expressions.
    pub graph: Graph,
    /// T, V, H and forces, in this order; those that are zero are left out.
    pub parts: Vec<Part>,
    /// `Symbol::Coefficient(j)` of a `pretty` expression is `numbers[j]`. None is negative.
    pub numbers: Vec<DerivedNumber>,
    /// Every learned number that is printed as another one.
    pub snaps: Vec<Snap>,
    /// Names of the state's variables, from the system.
    pub names: Names,
    /// How it went.
    pub info: Info,
}

/// T, V, H or a force.
#[derive(Debug, Clone)]
pub struct Part {
    /// Which part of the model.
    pub place: Place,
    /// The normal form with the fitted numbers. For energies without its constant.
    pub exact: Expr,
    /// The form for print; its numbers are placeholders, see [`Simplified::numbers`].
    /// For energies equal to the model up to a constant.
    pub pretty: Expr,
    /// Sentences on what the part looks like.
    pub shape: Vec<String>,
}

/// A number of a printed form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DerivedNumber {
    /// The number; the nice one where it snapped, see [`Snap`] for what it was.
    pub value: f64,
    /// By the delta method from the covariance of the fit; zero for what is exact or snapped.
    pub standard_error: f64,
    /// The nice number that is printed in its place.
    pub snapped: Option<NiceNumber>,
}

/// What a number was replaced by.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// In the mini-language, or a phrase: "the same as the coefficient of ...".
    pub text: String,
    /// Its value.
    pub value: f64,
}

/// A learned number that is printed as another one. The fitted model keeps it.
#[derive(Debug, Clone, PartialEq)]
pub struct Snap {
    /// `coefficient of q^2`.
    pub what: String,
    /// |value| as fitted; signs stand in the expression.
    pub from: f64,
    /// Standard error of `from`.
    pub standard_error: f64,
    /// What is printed.
    pub to: Target,
    /// |from - to| in standard errors; zero where the number has no uncertainty.
    pub sigmas: f64,
}

/// Why the rewriting stopped; of several parts, the worst.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum SaturationEnd {
    /// No rewrite says anything new.
    #[default]
    Saturated,
    /// At [`SimplifyOptions::iterations`].
    Iterations,
    /// At [`SimplifyOptions::nodes`].
    Nodes,
    /// The form is a long list of terms and was not rewritten.
    TooLarge,
}

/// How the simplification went.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Info {
    /// Iterations of all e-graphs.
    pub iterations: usize,
    /// Classes of all e-graphs.
    pub classes: usize,
    /// Why the rewriting ended.
    pub stop: SaturationEnd,
    /// Points at which the result was compared with the model.
    pub checked_points: usize,
    /// Largest difference of a printed form from the model before snapping, relative to the
    /// largest value.
    pub largest_difference: f64,
    /// Forms that failed the comparison and were not used.
    pub rejected: usize,
}

/// A form that passed the checks.
struct SnapCandidate<'a> {
    cost: f64,
    expr: RecExpr<Math>,
    numbers: Numbers<'a>,
    snaps: Vec<Snap>,
}

/// Simplifies a law. A number whose covariance is not known is printed as it is.
pub fn simplify(law: &Law, options: &SimplifyOptions) -> Simplified {
    let size = law.support().len() + law.parameters().len();
    let unknown = DMatrix::from_diagonal_element(size, size, f64::INFINITY);
    let fitted = &FittedLaw { law, covariance: law.covariance().unwrap_or(&unknown) };
    let system = &**law.system();
    let names = system.names();
    let mut info = Info::default();
    let mut graph = Graph::new();
    let mut emitter = emit::Emitter::default();
    let mut found = Vec::new();
    let mut snaps: Vec<Snap> = Vec::new();
    for place in places(system) {
        let Some(raw) = SpecifiedPart::new(fitted, place) else { continue };
        let samples = Samples::new(fitted, place);
        let mut best: Option<SnapCandidate> = None;
        let mut forms = Vec::new();
        for expands in [false, true] {
            let (mut atoms, form) = raw.normal(fitted, expands);
            for &plan in part::PLANS {
                let energy = place == Place::Potential || place == Place::Hamiltonian;
                if plan.springs && !(expands && energy) {
                    continue;
                }
                let mut numbers = Numbers::new(fitted.covariance, options.tolerance);
                let written = part::write(plan, &form, &mut atoms, &mut numbers, &names);
                let Some((written, worth)) = written else { continue };
                let new = check_and_rewrite(&written, &samples, numbers, options, &mut info);
                let Some(mut new) = new else { continue };
                new.cost -= worth;
                if best.as_ref().is_none_or(|old| new.cost < old.cost - 1e-9) {
                    best = Some(new);
                }
            }
            forms.push((atoms, form));
        }
        let Some((atoms, form)) = forms.pop() else { continue };
        let shape = shapes(fitted, options, place, &atoms, &form, &names);
        let (expr, numbers, snapped) = match best {
            Some(best) => (best.expr, best.numbers, best.snaps),
            // Nothing passed: the plain list of terms, numbers as fitted.
            None => {
                let exact = Tolerance { sigmas: 0.0, relative: 0.0, probability: 0.0 };
                let mut numbers = Numbers::new(fitted.covariance, exact);
                let (mut atoms, form) = raw.normal(fitted, false);
                let plain = form::FormStyle { springs: false, waves: false };
                let written = part::write(plain, &form, &mut atoms, &mut numbers, &names);
                (written.unwrap_or_default().0, numbers, Vec::new())
            }
        };
        emitter.collect(&expr, &numbers, found.len());
        found.push((place, expr, atoms, form, shape));
        for snap in snapped {
            if !snaps.contains(&snap) {
                snaps.push(snap);
            }
        }
    }
    emitter.prepare(&mut graph, system.degrees());
    // All printed forms first: what is built later must not change their order.
    let pretty: Vec<Expr> = found
        .iter()
        .enumerate()
        .map(|(index, (_, expr, ..))| emitter.build(&mut graph, expr, index))
        .collect();
    let mut parts = Vec::new();
    for ((place, _, atoms, form, shape), pretty) in found.into_iter().zip(pretty) {
        let exact = atoms.expression(&mut graph, &form);
        parts.push(Part { place, exact, pretty, shape });
    }
    Simplified { graph, parts, numbers: emitter.numbers, snaps, names, info }
}

fn places(system: &System) -> Vec<Place> {
    let forces = (0..system.degrees()).map(Place::Force);
    // Sensors are parts of the instrument: nothing of the motion is in them to simplify.
    [Place::Kinetic, Place::Potential, Place::Hamiltonian].into_iter().chain(forces).collect()
}

/// A part as it was specified: the known expression and the learned terms.
struct SpecifiedPart {
    known: Expr,
    /// (place in the law's support, term).
    terms: Vec<(usize, Expr)>,
    energy: bool,
}

impl SpecifiedPart {
    /// `None` where the part is zero.
    fn new(fitted: &FittedLaw, place: Place) -> Option<Self> {
        let system = fitted.law.system();
        let known = match place {
            Place::Kinetic => system.kinetic,
            Place::Potential => system.potential,
            Place::Hamiltonian => system.hamiltonian,
            Place::Force(i) => *system.forces.get(i)?,
            Place::Rate(i) => system.internal(i)?.rate?,
            Place::Sensor(i) => *system.sensors.get(i)?,
        };
        let terms: Vec<(usize, Expr)> = (fitted.law.terms().enumerate())
            .filter_map(|(k, (_, term, _))| Some((k, term.part(place)?)))
            .collect();
        let empty = terms.is_empty() && system.graph.is_zero(known);
        let energy = place.is_energy();
        (!empty).then_some(SpecifiedPart { known, terms, energy })
    }

    fn normal(&self, fitted: &FittedLaw, expands: bool) -> (Atoms, Polynomial) {
        let law = fitted.law;
        let mut atoms = Atoms::new(law.system().degrees(), expands);
        let number = |symbol| match symbol {
            Symbol::Parameter(i) => {
                let value = law.parameters().get(i).copied()?;
                Some(Quantity::fitted(law.support().len() + i, value))
            }
            _ => None,
        };
        let graph = &law.system().graph;
        let mut cache = HashMap::new();
        let mut form = atoms.expand(graph, self.known, &number, &mut cache);
        for &(k, term) in &self.terms {
            let term = atoms.expand(graph, term, &number, &mut cache);
            let value = law.coefficients().get(k).copied().unwrap_or(0.0);
            // What a constraint says is not learned.
            let said = law.support().get(k).is_some_and(|&id| is_said(law.system(), id));
            let coefficient =
                if said { Quantity::known(value) } else { Quantity::fitted(k, value) };
            form.add_scaled(&term, &coefficient);
        }
        if self.energy {
            // A constant in an energy has no effect.
            form.0.remove(&Vec::new());
        }
        (atoms, form)
    }
}

/// Compares a written form with the model, and what the rewrites make of it with the form.
fn check_and_rewrite<'a>(
    written: &RecExpr<Math>,
    samples: &Samples,
    numbers: Numbers<'a>,
    options: &SimplifyOptions,
    info: &mut Info,
) -> Option<SnapCandidate<'a>> {
    let as_fitted = |row: usize| numbers.rows[row].fitted.value;
    let difference = samples.against_model(written, &as_fitted);
    let as_printed = |row: usize| numbers.printed_value(row);
    let nice = part::with_nice_numbers(written, &numbers);
    let (cost, expr) = part::rewritten(&nice, options, info);
    let change = samples.between(written, &expr, &as_printed);
    if difference > check::ROUNDING || change > check::ROUNDING {
        info.rejected += 1;
        return None;
    }
    info.checked_points = info.checked_points.max(samples.len());
    info.largest_difference = info.largest_difference.max(difference).max(change);
    let mut used: Vec<usize> = written
        .items()
        .filter_map(|(_, node)| match node {
            Math::Fitted(row) => Some(row.0),
            _ => None,
        })
        .collect();
    used.sort_unstable();
    used.dedup();
    let snaps = used.iter().filter_map(|&row| numbers.rows[row].snap.clone()).collect();
    Some(SnapCandidate { cost, expr, numbers, snaps })
}

/// Sentences on polynomials in one variable that look like a known function.
fn shapes(
    fitted: &FittedLaw,
    options: &SimplifyOptions,
    place: Place,
    atoms: &Atoms,
    form: &Polynomial,
    names: &Names,
) -> Vec<String> {
    let mut out = Vec::new();
    for (component, symbol) in fitted.law.system().state().into_iter().enumerate() {
        let mut powers = Vec::new();
        let mut alone = true;
        for (monomial, quantity) in &form.0 {
            match monomial[..] {
                [(atom, exponent)] if atoms.get(atom) == &Atom::Symbol(symbol) => {
                    let exponent = exponent.value();
                    alone &= exponent.fract() == 0.0 && (1.0..64.0).contains(&exponent);
                    powers.push(shape::Power {
                        power: exponent.max(0.0) as usize,
                        value: quantity.value,
                        standard_error: quantity.standard_error(fitted.covariance),
                    });
                }
                // Functions may hold the variable; then nothing is said.
                _ => {
                    alone &= monomial.iter().all(|&(atom, _)| match atoms.get(atom) {
                        Atom::Symbol(other) => *other != symbol,
                        _ => false,
                    })
                }
            }
        }
        if !alone || powers.len() < 2 {
            continue;
        }
        powers.sort_by_key(|power| power.power);
        let range = options.ranges.get(component).copied();
        if let Some(likeness) = shape::recognise(&powers, range) {
            out.push(likeness.sentence(&names.of(symbol), place, &powers));
        }
    }
    out
}

impl Simplified {
    /// The printed H at a state (q, then p; a further number is the time, otherwise 0), with
    /// the printed numbers. It differs from the model by a constant and by what snapped.
    pub fn pretty_value(&self, state: &[f64]) -> f64 {
        let energies = self.parts.iter().filter(|part| part.place.is_energy());
        energies.map(|part| self.part_value(part, state)).sum()
    }

    /// The printed form of one part at a state.
    pub fn part_value(&self, part: &Part, state: &[f64]) -> f64 {
        let degrees = self.names.coordinates.len();
        let at = |i: usize| state.get(i).copied().unwrap_or(f64::NAN);
        self.graph.value(part.pretty, &|symbol| match symbol {
            Symbol::Coordinate(i) => at(i),
            Symbol::Momentum(i) => at(degrees + i),
            Symbol::Time => state.get(2 * degrees).copied().unwrap_or(0.0),
            // An input is at rest where nothing is said about it.
            Symbol::Input(..) | Symbol::Delayed(..) => 0.0,
            Symbol::Coefficient(j) => {
                self.numbers.get(j).map_or(f64::NAN, DerivedNumber::printed_value)
            }
            Symbol::Velocity(_) | Symbol::Parameter(_) => f64::NAN,
        })
    }
}
