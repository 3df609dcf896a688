//! Statements lowered onto a system that stands: what a candidate adds to it.
//!
//! A [`Scope`] lowers a spec once. Statements are then lowered with the names, units and terms
//! that stand, and leave an [`Extension`]. Terms and inner parameters of the system keep their
//! places in every extension of it; new ones come after them.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::lagrangian::Lagrangian;
use super::terms::DraftTerm;
use super::value::Value;
use super::{Compiled, Lowering, Named};
use crate::diagnostic::{Diagnostic, Severity, Span};
use crate::error::{Error, Result};
use crate::expr::graph::{Expr, Graph, Symbol};
use crate::expr::identity::{Mark, ParameterId, TermId};
use crate::expr::system::{Bounds, Constraint, Parameter, Place, System, Term};
use crate::expr::unit::Unit;
use crate::spec::ast::SyntaxTree;
use crate::spec::resolve::{Resolved, resolve};

/// What statements add to the system of a spec.
#[derive(Debug, Clone)]
pub struct Extension {
    /// The graph that the changes belong to.
    graph: Graph,
    changes: Changes,
    /// Of the system that it extends.
    mark: Mark,
}

/// How a system changes, by places in the extended system: what stands there is replaced, new
/// places come behind those that stand. A member of a family that statements write out is theirs.
#[derive(Debug, Clone)]
struct Changes {
    terms: Vec<(usize, Term)>,
    /// With all starts.
    parameters: Vec<(usize, (Parameter, Vec<f64>))>,
    /// Known parts, as they are then.
    known: Vec<(Place, Expr)>,
    energy_unit: Option<Unit>,
}

impl Extension {
    /// What changes nothing in a system.
    pub fn of_nothing(base: &System) -> Extension {
        let graph = base.graph.clone();
        Extension::of_number(graph, Vec::new(), Vec::new(), Vec::new(), None, base)
    }

    /// What making a number an inner parameter changes in a system.
    pub(super) fn of_number(
        graph: Graph,
        terms: Vec<(usize, Term)>,
        parameters: Vec<(usize, (Parameter, Vec<f64>))>,
        known: Vec<(Place, Expr)>,
        energy_unit: Option<Unit>,
        base: &System,
    ) -> Extension {
        let changes = Changes { terms, parameters, known, energy_unit };
        Extension { graph, changes, mark: Mark::of(base) }
    }

    /// Its terms as the extended system names them; expressions are of a graph of its own.
    pub fn terms(&self) -> impl Iterator<Item = (TermId, &Term)> {
        self.changes.terms.iter().map(|(k, term)| (self.mark.term(*k, term), term))
    }

    /// Inner parameters that it adds, as the extended system names them, with their starts.
    pub fn parameters(&self) -> impl Iterator<Item = (ParameterId, &Parameter, &[f64])> {
        let all = self.changes.parameters.iter();
        all.map(|(j, (parameter, starts))| {
            (self.mark.parameter(*j, parameter), parameter, starts.as_slice())
        })
    }

    /// The symbols in some of its expressions.
    pub fn symbols(&self, exprs: &[Expr]) -> Vec<Symbol> {
        self.graph.symbols(exprs)
    }

    /// One of its terms in another graph, some symbols as numbers.
    pub fn import(&self, term: &Term, into: &mut Graph, values: &HashMap<Symbol, f64>) -> Term {
        imported(term, &self.graph, into, values)
    }

    /// The system with it; `base` is the system in whose scope it was lowered.
    pub fn onto(&self, base: &System) -> System {
        let mut system = base.clone();
        let changes = self.changes.imported(&self.graph, &mut system.graph);
        changes.apply(&mut system);
        system
    }
}

fn imported(term: &Term, from: &Graph, into: &mut Graph, values: &HashMap<Symbol, f64>) -> Term {
    let mut import = |expr| into.import(from, expr, values);
    let expr = import(term.expr);
    let also = term.also.iter().map(|&(place, expr)| (place, import(expr))).collect();
    Term { expr, also, ..term.clone() }
}

impl Changes {
    fn imported(&self, from: &Graph, into: &mut Graph) -> Changes {
        let none = HashMap::new();
        let terms = self.terms.iter().map(|(k, term)| (*k, imported(term, from, into, &none)));
        let terms = terms.collect();
        let known = self.known.iter();
        let known = known.map(|&(place, expr)| (place, into.import(from, expr, &none))).collect();
        Changes { terms, known, ..self.clone() }
    }

    /// Changes a system whose graph is that of the changes.
    fn apply(self, system: &mut System) {
        put(&mut system.terms, self.terms);
        put(&mut system.parameters, self.parameters.into_iter().map(|(j, (p, _))| (j, p)));
        for (place, expr) in self.known {
            let standing = match place {
                Place::Kinetic => Some(&mut system.kinetic),
                Place::Potential => Some(&mut system.potential),
                Place::Hamiltonian => Some(&mut system.hamiltonian),
                Place::Force(i) => system.forces.get_mut(i),
                Place::Rate(i) => {
                    let mut hidden = system.hidden.iter_mut();
                    let of = hidden.find(|hidden| hidden.coordinate == i);
                    of.and_then(|hidden| hidden.rate.as_mut())
                }
                Place::Sensor(i) => system.sensors.get_mut(i),
            };
            if let Some(standing) = standing {
                *standing = expr;
            }
        }
    }
}

/// Puts values at their places, new ones at the end.
fn put<T>(list: &mut Vec<T>, values: impl IntoIterator<Item = (usize, T)>) {
    for (at, value) in values {
        match list.get_mut(at) {
            Some(standing) => *standing = value,
            None => list.push(value),
        }
    }
}

/// A spec with what its lowering knew at the end, ready for more statements.
#[derive(Clone)]
pub struct Scope {
    compiled: Compiled,
    standing: Standing,
    /// How many statements of each kind were lowered.
    lowered: Counts,
}

/// How many statements of each kind a spec has.
#[derive(Clone, Copy)]
struct Counts {
    constants: usize,
    parameters: usize,
    energies: usize,
    forces: usize,
    sensors: usize,
    hidden: usize,
    holonomic: usize,
}

/// What a lowering leaves that does not borrow from the syntax tree.
#[derive(Clone)]
struct Standing {
    graph: Graph,
    dependence: Vec<u8>,
    constants: Vec<Option<Named>>,
    parameters: Vec<Option<Named>>,
    drafts: Vec<DraftTerm>,
    index: HashMap<(Option<Place>, Expr), usize>,
    shared: HashMap<String, Option<usize>>,
    flow: Option<Vec<(Symbol, Expr)>>,
    known: Vec<(Place, Value, Span)>,
    constraints: Vec<Constraint>,
    lagrangian: Lagrangian,
    expected: u128,
}

impl Scope {
    /// The scope of a spec without errors.
    pub fn of(compiled: &Compiled) -> Scope {
        let expanded = crate::spec::expand(&compiled.spec, &mut Vec::new());
        let resolved = resolve(&expanded, &mut Vec::new());
        let mut lowering = Lowering::of_compiled(&resolved, compiled);
        lowering.define_constants(0);
        lowering.define_parameters(0);
        lowering.find_shared();
        lowering.motion(&resolved.energies, &resolved.forces);
        lowering.holonomic();
        lowering.internal_states(&resolved.hidden);
        lowering.measures();
        lowering.instruments(&resolved.sensors);
        // The system was made by the same steps: its graph begins with all of this one's.
        lowering.graph = compiled.system.graph.clone();
        let standing = Standing::of(lowering);
        Scope { compiled: compiled.clone(), standing, lowered: Counts::of(&resolved) }
    }

    /// The spec, and what it means. In the syntax tree of an extended spec the places of new
    /// statements are those in their own text.
    pub fn compiled(&self) -> &Compiled {
        &self.compiled
    }

    /// What some statements add; the scope stays as it is.
    ///
    /// # Errors
    /// [`Error::Spec`] with what is wrong with the statements.
    pub fn extension(&mut self, statements: &str) -> Result<Extension> {
        // The graph grows in its place, and is cut back; the rest is small.
        let graph = std::mem::take(&mut self.standing.graph);
        let dependence = std::mem::take(&mut self.standing.dependence);
        let own = (graph.len(), dependence.len());
        let standing = Standing { graph, dependence, ..self.standing.clone() };
        let (result, mut standing) = self.lower(standing, statements);
        let extension = result.map(|(changes, _)| {
            let mut graph = Graph::new();
            let changes = changes.imported(&standing.graph, &mut graph);
            Extension { graph, changes, mark: Mark::of(&self.compiled.system) }
        });
        standing.graph.truncate(own.0);
        standing.dependence.truncate(own.1);
        self.standing.graph = standing.graph;
        self.standing.dependence = standing.dependence;
        extension
    }

    /// The scope with some statements in it.
    ///
    /// # Errors
    /// [`Error::Spec`] with what is wrong with the statements.
    pub fn with(&self, statements: &str) -> Result<Scope> {
        let (result, standing) = self.lower(self.standing.clone(), statements);
        let (changes, spec) = result?;
        let expanded = crate::spec::expand(&spec, &mut Vec::new());
        let lowered = Counts::of(&resolve(&expanded, &mut Vec::new()));
        let mut compiled = Compiled { spec, ..self.compiled.clone() };
        compiled.energy_unit = changes.energy_unit;
        let starts = changes.parameters.iter().map(|(j, (_, starts))| (*j, starts.clone()));
        put(&mut compiled.starts, starts);
        let mut system = System::clone(&compiled.system);
        system.graph = standing.graph.clone();
        changes.apply(&mut system);
        compiled.system = Arc::new(system);
        Ok(Scope { compiled, standing, lowered })
    }

    /// The scope with parameters that may go no further than these bounds.
    pub fn bounded(mut self, bounds: impl IntoIterator<Item = (ParameterId, Bounds)>) -> Scope {
        let system = Arc::make_mut(&mut self.compiled.system);
        for (id, bounds) in bounds {
            if let Some(parameter) = system.parameters.get_mut(id.position()) {
                parameter.bounds = parameter.bounds.within(bounds);
            }
        }
        self
    }

    /// Lowers some statements from where the spec's own ended: what they change, the syntax tree
    /// of the whole, and what stands then.
    fn lower(
        &self,
        standing: Standing,
        statements: &str,
    ) -> (Result<(Changes, SyntaxTree)>, Standing) {
        let (tree, mut diagnostics) = crate::spec::spec(statements);
        let mut spec = self.compiled.spec.clone();
        spec.statements.extend(tree.statements);
        spec.lost.extend(tree.lost);
        let expanded = crate::spec::expand(&spec, &mut diagnostics);
        let resolved = resolve(&expanded, &mut diagnostics);
        if let Some(hidden) = resolved.hidden.get(self.lowered.hidden) {
            let span = Span::new(0, statements.len());
            diagnostics.push(
                Diagnostic::error(span, format!("`{}` would move unseen", hidden.of.name.text))
                    .label("such a part cannot be added to a model that stands")
                    .hint("write it into the spec, and fit that"),
            );
        }
        if let Some(new) = resolved.holonomic().nth(self.lowered.holonomic) {
            diagnostics.push(
                Diagnostic::error(new.span, "a constraint on the motion cannot be tried")
                    .label("it changes which motions there are")
                    .hint("write it into the spec, and fit that"),
            );
        }
        let mut lowering = Lowering::of_compiled(&resolved, &self.compiled);
        standing.into_lowering(&mut lowering);
        let sound = |list: &[crate::diagnostic::Diagnostic]| {
            list.iter().all(|diagnostic| diagnostic.severity != Severity::Error)
        };
        let changes = sound(&diagnostics).then(|| self.changes(&mut lowering));
        diagnostics.append(&mut lowering.diagnostics);
        let result = match changes {
            Some(changes) if sound(&diagnostics) => Ok((changes, spec.clone())),
            _ => {
                diagnostics.retain(|diagnostic| diagnostic.severity == Severity::Error);
                // Related places are of the spec, not of these statements.
                diagnostics.iter_mut().for_each(|diagnostic| diagnostic.related.clear());
                let name = self.compiled.system.name.clone();
                Err(Error::Spec { name, text: statements.to_string(), diagnostics })
            }
        };
        (result, Standing::of(lowering))
    }

    /// Lowers what is in a spec beyond the scope's own.
    fn changes(&self, lowering: &mut Lowering) -> Changes {
        let (from, resolved) = (self.lowered, lowering.resolved);
        lowering.define_constants(from.constants);
        let new = lowering.define_parameters(from.parameters);
        lowering.find_shared();
        lowering.share_standing(&self.standing.shared);
        let energies = beyond(&resolved.energies, from.energies);
        let stood = (lowering.known_energy(), lowering.drafts.len());
        lowering.motion(energies, &[]);
        if lowering.changes_velocities(stood.0, stood.1) {
            let forces = first(&resolved.forces, self.lowered.forces);
            let of_force = |place: Place| matches!(place, Place::Force(_));
            lower_again(lowering, of_force, |lowering| lowering.motion(&[], forces));
        }
        lowering.motion(&[], beyond(&resolved.forces, from.forces));
        let is = |&(place, value, _): &(Place, Value, Span)| (place, value.expr);
        let moves = lowering.known.iter().map(is).ne(self.standing.known.iter().map(is))
            || lowering.drafts != self.standing.drafts;
        if moves && (lowering.flow.is_some() || !resolved.hidden.is_empty()) {
            let (hidden, sensors) =
                (&resolved.hidden, first(&resolved.sensors, self.lowered.sensors));
            lowering.flow = None;
            lower_again(lowering, Place::follows_motion, |lowering| {
                lowering.flow();
                lowering.internal_states(hidden);
                lowering.measures();
                lowering.instruments(sensors);
            });
        }
        lowering.instruments(beyond(&resolved.sensors, from.sensors));
        let canonical = lowering.canonical_unit();
        let energy = lowering.energy_unit(canonical);
        lowering.check_known(energy, canonical.is_some());
        let energy_unit = energy.map(|(unit, _)| unit);
        let same_unit = energy_unit == self.compiled.energy_unit;
        let all = lowering.drafts.iter().enumerate();
        let changed =
            all.filter(|(k, draft)| !same_unit || self.standing.drafts.get(*k) != Some(*draft));
        let (places, drafts): (Vec<usize>, Vec<DraftTerm>) =
            changed.map(|(k, draft)| (k, draft.clone())).unzip();
        let terms = places.into_iter().zip(lowering.finish_terms(drafts, energy_unit)).collect();
        let parameters = (from.parameters..).zip(new).collect();
        let known = self.known_parts(lowering);
        let mut changes = Changes { terms, parameters, known, energy_unit };
        lowering.unique_names();
        if !resolved.constraints.is_empty() {
            self.constrain(lowering, &mut changes);
        }
        changes
    }

    /// Applies all constraints: those that stand may speak of new terms, new ones of terms that
    /// stand.
    fn constrain(&self, lowering: &mut Lowering, changes: &mut Changes) {
        let system = &self.compiled.system;
        let mut terms = system.terms.clone();
        put(&mut terms, changes.terms.drain(..));
        let parameters = system.parameters.iter().cloned();
        let mut parameters: Vec<(Parameter, Vec<f64>)> =
            parameters.zip(self.compiled.starts.iter().cloned()).collect();
        put(&mut parameters, changes.parameters.drain(..));
        lowering.constrain(&mut terms, &mut parameters);
        let terms = terms.into_iter().enumerate();
        changes.terms.extend(terms.filter(|(k, term)| system.terms.get(*k) != Some(term)));
        let parameters = parameters.into_iter().enumerate();
        let changed =
            |(j, one): &(usize, (Parameter, Vec<f64>))| system.parameters.get(*j) != Some(&one.0);
        changes.parameters.extend(parameters.filter(changed));
    }

    /// Known parts that are not what they were.
    fn known_parts(&self, lowering: &mut Lowering) -> Vec<(Place, Expr)> {
        let were = &self.standing.known;
        let is = |&(place, value, _): &(Place, Value, Span)| (place, value.expr);
        if lowering.known.iter().map(is).eq(were.iter().map(is)) {
            return Vec::new();
        }
        let all = lowering.known.iter().chain(were);
        let mut places: Vec<Place> = all.map(|(place, ..)| *place).collect();
        places.sort_unstable();
        places.dedup();
        places.into_iter().map(|place| (place, lowering.known_part(place))).collect()
    }
}

/// Lowers the statements of some places again, into the places of their terms: what they name of
/// the motion is that of the extended model.
fn lower_again(
    lowering: &mut Lowering,
    of: impl Fn(Place) -> bool,
    again: impl FnOnce(&mut Lowering),
) {
    let places = lowering.drafts.iter().enumerate().filter(|(_, draft)| of(draft.place));
    let places: Vec<usize> = places.map(|(k, _)| k).collect();
    for draft in &mut lowering.drafts {
        draft.also.retain(|part| !of(part.place));
    }
    lowering.index.retain(|_, at| !places.contains(at));
    for at in lowering.shared.values_mut() {
        *at = at.filter(|at| !places.contains(at));
    }
    lowering.known.retain(|(place, ..)| !of(*place));
    let end = lowering.drafts.len();
    again(lowering);
    let drafts = lowering.drafts.split_off(end);
    let moved = |at: &mut usize| {
        if let Some(&place) = at.checked_sub(end).and_then(|i| places.get(i)) {
            *at = place;
        }
    };
    lowering.index.values_mut().for_each(moved);
    lowering.shared.values_mut().flatten().for_each(moved);
    for (&k, draft) in places.iter().zip(drafts) {
        if let Some(standing) = lowering.drafts.get_mut(k) {
            *standing = draft;
        }
    }
}

/// What a scope lowered of a list, which has more behind it.
fn first<T>(all: &[T], count: usize) -> &[T] {
    all.get(..count).unwrap_or(all)
}

/// What stands in a list behind what a scope lowered.
fn beyond<T>(all: &[T], count: usize) -> &[T] {
    all.get(count..).unwrap_or_default()
}

impl Counts {
    fn of(resolved: &Resolved) -> Counts {
        Counts {
            constants: resolved.constants.len(),
            parameters: resolved.parameters.len(),
            energies: resolved.energies.len(),
            forces: resolved.forces.len(),
            sensors: resolved.sensors.len(),
            hidden: resolved.hidden.len(),
            holonomic: resolved.holonomic().count(),
        }
    }
}

impl Standing {
    fn of(lowering: Lowering) -> Standing {
        Standing {
            graph: lowering.graph,
            dependence: lowering.dependence,
            constants: lowering.constants,
            parameters: lowering.parameters,
            drafts: lowering.drafts,
            index: lowering.index,
            shared: lowering.shared,
            flow: lowering.flow,
            known: lowering.known,
            constraints: lowering.constraints,
            lagrangian: lowering.lagrangian,
            expected: lowering.expected,
        }
    }

    /// Begins a lowering where another ended.
    fn into_lowering(self, lowering: &mut Lowering) {
        lowering.graph = self.graph;
        lowering.dependence = self.dependence;
        lowering.constants = self.constants;
        lowering.parameters = self.parameters;
        lowering.drafts = self.drafts;
        lowering.index = self.index;
        lowering.shared = self.shared;
        lowering.flow = self.flow;
        lowering.known = self.known;
        lowering.constraints = self.constraints;
        lowering.lagrangian = self.lagrangian;
        lowering.expected = self.expected;
    }
}

impl<'a> Lowering<'a> {
    /// A lowering of a spec that was compiled, or of more than it: implied units are known.
    fn of_compiled(resolved: &'a Resolved<'a>, compiled: &Compiled) -> Self {
        let energy = compiled.energy_unit.filter(|_| resolved.implied_momenta);
        let mut lowering = Lowering::new(resolved, energy);
        lowering.freed.clone_from(&compiled.freed);
        lowering.starts = compiled.starts.iter().filter_map(|s| s.first().copied()).collect();
        lowering
    }

    /// Names of coefficients that only now stand in several spans: terms that have them already
    /// are the first to share.
    fn share_standing(&mut self, before: &HashMap<String, Option<usize>>) {
        let new = self.shared.keys().filter(|name| !before.contains_key(*name));
        let new: HashSet<String> = new.cloned().collect();
        for (k, draft) in self.drafts.iter().enumerate().filter(|_| !new.is_empty()) {
            let root = |name: &String| name.split('[').next().unwrap_or(name).to_string();
            if let Some(name) = draft.name.as_ref().filter(|name| new.contains(&root(name))) {
                self.shared.insert(name.clone(), Some(k));
            }
        }
    }
}
