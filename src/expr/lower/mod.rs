//! From a spec to the system that it describes: names become symbols, spans become terms.

mod bounds;
mod candidates;
mod delays;
mod extension;
mod hidden;
mod holonomic;
mod lagrangian;
mod loops;
mod measures;
mod names;
mod numbers;
mod sensors;
mod substitution;
mod terms;
mod units;
mod value;

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::columns::{self, DataColumns};
use super::graph::{Expr, Graph, Symbol};
use super::system::{Bounds, Constraint, Observed, Parameter, Per, Place, System, Term, Variable};
use super::unit::Unit;
use crate::data::visible;
use crate::diagnostic::{Diagnostic, Severity, Span};
use crate::error::{Error, Result};
use crate::spec::ast::{EnergyPart, ExpressionKind, SyntaxTree, UnitText};
use crate::spec::resolve::{Declared, Energy, Force, Resolved, Sensor, resolve};
pub use candidates::DeclaredCandidate;
pub use extension::{Extension, Scope};
use lagrangian::Lagrangian;
pub use numbers::KnownNumber;
use terms::DraftTerm;
use value::Value;

/// How many terms a function space may have.
pub const MOST_TERMS: u128 = 200_000;

/// How many parts of expressions a spec may expand to.
const MOST_STEPS: u64 = 5_000_000;

/// A spec that has no errors, and everything that was made of it.
#[derive(Debug, Clone)]
pub struct Compiled {
    /// Its syntax tree.
    pub spec: SyntaxTree,
    /// What it means.
    pub system: Arc<System>,
    /// Start values of each parameter, one or more; the first is also in the system.
    pub starts: Vec<Vec<f64>>,
    /// Unit of H and of time, where they are known.
    pub energy_unit: Option<Unit>,
    /// Unit of time, where it is known.
    pub time_unit: Option<Unit>,
    /// Where the measurements are: what each `data` statement says.
    pub data: Vec<DataColumns>,
    /// The user's own effects, which are no part of the system until they are added.
    pub candidates: Vec<candidates::DeclaredCandidate>,
    /// Warnings and notes, in the order of the text.
    pub warnings: Vec<Diagnostic>,
    /// The text that it was read from.
    pub text: String,
    /// How many statements of the syntax tree stand in that text; others were added.
    written: usize,
    /// The inner parameter that was a known number, and its value.
    freed: Option<(String, f64)>,
}

/// Reads a spec and builds the system it describes.
///
/// `name` is what the text is called in messages, usually its path.
///
/// # Errors
/// [`Error::Spec`] with everything that is wrong with the text, in its order.
pub fn build(name: &str, text: &str) -> Result<Compiled> {
    let (spec, diagnostics) = crate::spec::spec(text);
    compiled(name, text, spec, diagnostics, None)
}

/// The system of a syntax tree. `freed` is an inner parameter that a known number was made to,
/// with the value that it had.
fn compiled(
    name: &str,
    text: &str,
    spec: SyntaxTree,
    mut diagnostics: Vec<Diagnostic>,
    freed: Option<(String, f64)>,
) -> Result<Compiled> {
    let expanded = crate::spec::expand(&spec, &mut diagnostics);
    let resolved = resolve(&expanded, &mut diagnostics);
    let sound =
        resolved.coordinates.len() == resolved.momenta.len() && !resolved.coordinates.is_empty();
    let mut built = None;
    if sound {
        let mut lowering = Lowering::new(&resolved, None);
        lowering.freed.clone_from(&freed);
        let mut pieces = lowering.run();
        let implied = pieces.implied_unit.filter(|_| resolved.implied_momenta);
        if implied.is_some() {
            // The known part tells the unit of H, and so the units of the implied momenta.
            lowering = Lowering::new(&resolved, implied);
            lowering.freed.clone_from(&freed);
            pieces = lowering.run();
        }
        let data = columns::resolve(&mut lowering, &pieces.system);
        diagnostics.append(&mut lowering.diagnostics);
        built = Some((pieces, data));
        diagnostics.extend(candidates::check(&spec));
    }
    diagnostics.sort_by_key(|d| (d.span, std::cmp::Reverse(d.severity)));
    let failed = diagnostics.iter().any(|d| d.severity == Severity::Error);
    match built {
        Some((pieces, data)) if !failed => Ok(Compiled {
            system: Arc::new(pieces.system),
            starts: pieces.starts,
            energy_unit: pieces.energy_unit,
            time_unit: pieces.time_unit,
            data,
            candidates: candidates::list(&spec, text),
            warnings: diagnostics,
            text: text.to_string(),
            written: spec.statements.len(),
            freed,
            spec,
        }),
        _ => {
            diagnostics.retain(|d| d.severity == Severity::Error);
            Err(Error::Spec { name: name.to_string(), text: text.to_string(), diagnostics })
        }
    }
}

/// What an expression belongs to: decides which names may stand in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Context {
    /// Constants, starts and bounds: numbers only.
    Number,
    Energy(EnergyPart),
    /// L, or T where it is a function of coordinates and velocities.
    Velocities(EnergyPart),
    Force,
    /// The law of an internal state.
    Rate,
    Sensor,
    /// What a column shows on any curve, whose velocities and accelerations stand for themselves.
    Curve,
}

/// A name that stands for a number: a constant or a parameter.
#[derive(Debug, Clone, Copy)]
struct Named {
    expr: Expr,
    unit: Option<Unit>,
}

/// The state of lowering one spec.
pub(super) struct Lowering<'a> {
    pub(super) resolved: &'a Resolved<'a>,
    pub(super) diagnostics: Vec<Diagnostic>,
    graph: Graph,
    coordinates: Vec<Option<Unit>>,
    momenta: Vec<Option<Unit>>,
    velocities: Vec<Option<Unit>>,
    pub(super) time: Option<Unit>,
    inputs: Vec<Option<Unit>>,
    constants: Vec<Option<Named>>,
    parameters: Vec<Option<Named>>,
    /// The first start of every parameter.
    starts: Vec<f64>,
    context: Context,
    /// The definition that is lowered: it may name those before it.
    defining: Option<usize>,
    /// The measure that is lowered: it may name those before it.
    measuring: Option<usize>,
    /// Index names and their values, innermost last.
    indices: Vec<(String, i64)>,
    steps: u64,
    reported: HashSet<(Span, String)>,
    /// For each node of the graph, what it depends on.
    dependence: Vec<u8>,
    drafts: Vec<DraftTerm>,
    /// Terms by place (energy: none) and expression without its factor.
    index: HashMap<(Option<Place>, Expr), usize>,
    /// The effect whose statements are lowered.
    effect: Option<String>,
    /// Coefficients that stand in several places, and the terms that have them.
    shared: HashMap<String, Option<usize>>,
    /// Time derivatives of the state by the model, once a sensor asks for them.
    flow: Option<Vec<(Symbol, Expr)>>,
    /// Known parts: place, value, where they stand.
    known: Vec<(Place, Value, Span)>,
    constraints: Vec<Constraint>,
    lagrangian: Lagrangian,
    expected: u128,
    /// An inner parameter that was a known number, with its value: units go by that.
    freed: Option<(String, f64)>,
}

/// What lowering leaves.
struct Pieces {
    system: System,
    starts: Vec<Vec<f64>>,
    energy_unit: Option<Unit>,
    time_unit: Option<Unit>,
    /// Unit of H as the known parts tell it, where the variables do not.
    implied_unit: Option<Unit>,
}

impl<'a> Lowering<'a> {
    fn new(resolved: &'a Resolved<'a>, energy: Option<Unit>) -> Self {
        let mut lowering = Lowering {
            resolved,
            diagnostics: Vec::new(),
            graph: Graph::new(),
            coordinates: Vec::new(),
            momenta: Vec::new(),
            velocities: Vec::new(),
            time: None,
            inputs: Vec::new(),
            constants: Vec::new(),
            parameters: Vec::new(),
            starts: Vec::new(),
            context: Context::Number,
            defining: None,
            measuring: None,
            indices: Vec::new(),
            steps: 0,
            reported: HashSet::new(),
            dependence: Vec::new(),
            drafts: Vec::new(),
            index: HashMap::new(),
            effect: None,
            shared: HashMap::new(),
            flow: None,
            known: Vec::new(),
            constraints: Vec::new(),
            lagrangian: Lagrangian::default(),
            expected: 0,
            freed: None,
        };
        lowering.time = resolved.time.and_then(|(_, unit)| lowering.unit(unit));
        lowering.coordinates = lowering.units_of(&resolved.coordinates);
        lowering.momenta = lowering.units_of(&resolved.momenta);
        lowering.velocities = lowering.units_of(&resolved.velocities);
        lowering.inputs = resolved.inputs.iter().map(|input| lowering.unit(input.unit)).collect();
        if let (Some(energy), Some(time)) = (energy, lowering.time) {
            for (momentum, coordinate) in lowering.momenta.iter_mut().zip(&lowering.coordinates) {
                let unit = coordinate.and_then(|q| energy.times(time)?.over(q));
                *momentum = momentum.or(unit);
            }
        }
        lowering
    }

    /// Adds a diagnostic, unless the same one stands there already (loops repeat them).
    pub(super) fn report(&mut self, diagnostic: Diagnostic) {
        if self.reported.insert((diagnostic.span, diagnostic.message.clone())) {
            self.diagnostics.push(diagnostic);
        }
    }

    pub(super) fn unit(&mut self, text: Option<&UnitText>) -> Option<Unit> {
        let text = text?;
        match Unit::parse(&text.text) {
            Ok(unit) => Some(unit),
            Err(message) => {
                self.report(
                    Diagnostic::error(text.site.0, format!("[{}] is not a unit", text.text))
                        .label(message)
                        .hint("write for example [rad/s], [kg*m^2/s^2] or [N m]"),
                );
                None
            }
        }
    }

    fn units_of(&mut self, list: &[Declared]) -> Vec<Option<Unit>> {
        list.iter().map(|declared| self.unit(declared.unit.as_ref())).collect()
    }

    fn run(&mut self) -> Pieces {
        self.define_constants(0);
        let parameters = self.define_parameters(0);
        let canonical = self.canonical_unit();
        self.check_velocities();
        self.check_bodies();
        self.find_shared();
        self.motion(&self.resolved.energies, &self.resolved.forces);
        self.holonomic();
        // Internal states may depend on velocities, and what the instrument adds on the whole
        // motion.
        self.internal_states(&self.resolved.hidden);
        self.measures();
        self.instruments(&self.resolved.sensors);
        let energy_unit = self.energy_unit(canonical);
        self.check_known(energy_unit, canonical.is_some());
        let drafts = std::mem::take(&mut self.drafts);
        let mut terms = self.finish_terms(drafts, energy_unit.map(|(unit, _)| unit));
        let mut parameters = parameters;
        self.unique_names();
        self.constrain(&mut terms, &mut parameters);
        self.check_holonomic(&terms);
        let system = self.system(terms, &parameters);
        Pieces {
            system,
            starts: parameters.into_iter().map(|(_, starts)| starts).collect(),
            energy_unit: energy_unit.map(|(unit, _)| unit),
            time_unit: self.time,
            implied_unit: energy_unit.map(|(unit, _)| unit).filter(|_| canonical.is_none()),
        }
    }

    /// Statements about energies and forces: what moves.
    fn motion(&mut self, energies: &[Energy], forces: &[Force]) {
        for energy in energies {
            self.effect = energy.effect.map(str::to_string);
            if self.resolved.is_of_velocities(energy) {
                self.context = Context::Velocities(energy.part);
                self.velocity_side(energy.part, energy.value, false);
                continue;
            }
            self.context = Context::Energy(energy.part);
            let place = match energy.part {
                EnergyPart::Kinetic => Place::Kinetic,
                EnergyPart::Potential => Place::Potential,
                EnergyPart::Hamiltonian | EnergyPart::Lagrangian => Place::Hamiltonian,
            };
            self.side(place, energy.value, false);
        }
        self.legendre_transform();
        self.context = Context::Force;
        for force in forces {
            self.effect = force.effect.map(str::to_string);
            self.force(force);
        }
    }

    /// Statements about sensors.
    fn instruments(&mut self, sensors: &[Sensor]) {
        self.context = Context::Sensor;
        for sensor in sensors {
            self.effect = sensor.effect.map(str::to_string);
            self.sensor(sensor);
        }
    }

    /// All known parts of one place, added.
    fn known_part(&mut self, place: Place) -> Expr {
        let parts: Vec<(f64, Expr)> = (self.known.iter())
            .filter(|(at, ..)| *at == place)
            .map(|(_, value, _)| (1.0, value.expr))
            .collect();
        self.graph.linear(0.0, &parts)
    }

    fn system(&mut self, terms: Vec<Term>, parameters: &[(Parameter, Vec<f64>)]) -> System {
        let resolved = self.resolved;
        let variables = |list: &[Declared], units: &[Option<Unit>]| -> Vec<Variable> {
            list.iter()
                .zip(units)
                .map(|(declared, unit)| Variable {
                    name: declared.name.clone(),
                    unit: *unit,
                    unit_text: (declared.unit.as_ref().map(|text| text.text.clone()))
                        .or_else(|| unit.map(|unit| unit.to_string())),
                })
                .collect()
        };
        let coordinates = variables(&resolved.coordinates, &self.coordinates);
        let momenta = variables(&resolved.momenta, &self.momenta);
        let velocities = variables(&resolved.velocities, &self.velocities);
        let kinetic = self.known_part(Place::Kinetic);
        let potential = self.known_part(Place::Potential);
        let hamiltonian = self.known_part(Place::Hamiltonian);
        let degrees = coordinates.len();
        let forces = (0..degrees).map(|i| self.known_part(Place::Force(i))).collect();
        let measures = self.measures_of_system();
        let observables = 2 * degrees + measures.len();
        let sensors = (0..observables).map(|i| self.known_part(Place::Sensor(i))).collect();
        let hidden = self.hidden_parts();
        System {
            name: resolved.title.as_deref().map_or_else(|| "system".to_string(), visible),
            graph: std::mem::take(&mut self.graph),
            observed: if velocities.is_empty() { Observed::Momenta } else { Observed::Velocities },
            coordinates,
            declared_bodies: resolved.declared_bodies(),
            momenta,
            velocities,
            time: Variable {
                name: resolved.time_name(),
                unit: self.time,
                unit_text: resolved.time.and_then(|(_, unit)| unit).map(|unit| unit.text.clone()),
            },
            inputs: self.input_variables(),
            hidden,
            parameters: parameters.iter().map(|(parameter, _)| parameter.clone()).collect(),
            kinetic,
            potential,
            hamiltonian,
            forces,
            sensors,
            constraints: self.constraints.clone(),
            measures,
            terms,
        }
    }

    /// The numbers behind `constant` statements, in the order of the text, after the `first` ones.
    fn define_constants(&mut self, first: usize) {
        for (i, constant) in self.resolved.constants.iter().enumerate().skip(first) {
            if self.resolved.definitions.get(i).copied().flatten().is_some() {
                self.require_names(constant.value);
                self.constants.push(None);
                continue;
            }
            self.defining = Some(i);
            let value = self.number(constant.value);
            self.defining = None;
            let value =
                value.map(|(value, unit, _)| Named { expr: self.graph.number(value), unit });
            // What is wrong with it was said: uses of the name need not say it again.
            self.constants.push(value);
        }
    }

    /// The `param` statements after the `first` ones, with their starts.
    fn define_parameters(&mut self, first: usize) -> Vec<(Parameter, Vec<f64>)> {
        let mut out = Vec::new();
        self.starts.truncate(first);
        for (i, parameter) in self.resolved.parameters.iter().enumerate().skip(first) {
            let starts: Vec<_> =
                parameter.starts.iter().filter_map(|start| self.number(start)).collect();
            let bounds = self.limits(parameter.bounds);
            let expr = self.graph.symbol(Symbol::Parameter(i));
            // A bare number takes the unit of the others.
            let bounds_units = bounds.1.clone();
            let written: Vec<(Unit, Span)> = starts
                .iter()
                .map(|&(_, unit, span)| (unit, span))
                .chain(bounds_units)
                .filter_map(|(unit, span)| unit.map(|unit| (unit, span)))
                .filter(|(unit, _)| *unit != Unit::ONE)
                .collect();
            if let Some((&(unit, at), others)) = written.split_first() {
                for &(other, span) in others {
                    if !unit.agrees(other) {
                        self.clash((unit, at), (other, span), "one parameter has one unit");
                    }
                }
            }
            let unit = written.first().map(|&(unit, _)| unit);
            self.parameters.push(Some(Named { expr, unit }));
            let bounds = bounds.0;
            for &(start, _, span) in &starts {
                if bounds.clamp(start) != start {
                    self.report(
                        Diagnostic::error(span, "this start is outside the bounds")
                            .label(format!("{start} is not in {}..{}", bounds.lower, bounds.upper))
                            .hint("start inside the bounds"),
                    );
                }
            }
            let mut starts: Vec<f64> = starts.iter().map(|&(start, ..)| start).collect();
            if starts.is_empty() {
                // Only numbers of runs go without a start.
                starts.push(bounds.clamp(1.0));
            }
            self.starts.push(starts.first().copied().unwrap_or(0.0));
            let text = parameter.starts.iter().find_map(|start| match &start.kind {
                ExpressionKind::Quantity(_, unit) => Some(unit.text.clone()),
                _ => None,
            });
            let record = Parameter {
                name: parameter.name.text.clone(),
                start: starts.first().copied().unwrap_or(0.0),
                bounds,
                per: parameter.per.map(|per| Per::of(&per.text)),
                unit,
                unit_text: text.or_else(|| unit.map(|unit| unit.to_string())),
            };
            out.push((record, starts));
        }
        out
    }

    /// Two units that should agree and do not.
    fn clash(&mut self, first: (Unit, Span), second: (Unit, Span), hint: &str) {
        let ((a, at_a), (b, at_b)) = (first, second);
        let hint = if a.same_kind(b) {
            "both measure the same; write all units in one size"
        } else {
            hint
        };
        self.report(
            Diagnostic::error(at_b, format!("units clash: [{a}] and [{b}]"))
                .label(format!("in [{b}]"))
                .hint(hint)
                .related(at_a, format!("in [{a}]")),
        );
    }

    fn limits(&mut self, limits: Option<&crate::spec::ast::Limits>) -> LimitValues {
        let mut bounds = Bounds::FREE;
        let mut units = Vec::new();
        let Some(limits) = limits else { return (bounds, units) };
        for (side, into) in [(&limits.lower, &mut bounds.lower), (&limits.upper, &mut bounds.upper)]
        {
            if let Some((value, unit, span)) = side.as_ref().and_then(|side| self.number(side)) {
                *into = value;
                units.push((unit, span));
            }
        }
        if bounds.lower > bounds.upper {
            self.report(
                Diagnostic::error(limits.site.0, "the lower bound is above the upper one")
                    .label(format!("from {} to {}", bounds.lower, bounds.upper))
                    .hint("write the smaller one first"),
            );
        }
        (bounds, units)
    }
}

/// Bounds, and the units that were written with them.
type LimitValues = (Bounds, Vec<(Option<Unit>, Span)>);
