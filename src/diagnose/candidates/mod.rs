//! Effects that may be missing, ready to be tried: each lowered once onto the system that stands,
//! its inner parameters on a grid.

pub mod composed;
mod declared;
mod grid;
mod left_out;
mod numbers;
mod ranges;
mod unnamed;

use std::collections::{BTreeSet, HashMap};

pub use grid::Reach;
pub use left_out::{LeftOut, left_out};
pub use numbers::NumberChange;
pub use ranges::InnerRange;
pub use unnamed::unnamed;

use super::tuning::Candidates;
use crate::data::Dataset;
use crate::error::Result;
use crate::expr::{
    Extension, KnownNumber, Parameter, ParameterId, Scope, Symbol, System, Term, TermId, touching,
};
use crate::fit::Law;
use crate::spec::effects::{ActsOn, EffectRow, Instance, ScanBy, by_name, instances};

/// Something that may be missing, ready to be tried.
pub struct Candidate {
    /// Where it comes from.
    pub origin: Origin,
    /// `viscous_drag(theta)`.
    pub label: String,
    /// Names of the coordinates or observables that it is on.
    pub on: Vec<String>,
    /// What stands between the parentheses of its label: names, or bodies.
    pub arguments: Vec<String>,
    /// What it adds to the system, inner parameters as parameters.
    pub extension: Extension,
    /// Its terms in the system with it.
    pub terms: Vec<TermId>,
    /// Its inner parameters in the system with it.
    pub parameters: Vec<ParameterId>,
    /// Values of the inner parameters that are tried; one empty choice without any.
    pub grid: Vec<Vec<f64>>,
    /// What it costs to say which of its kind it is, in nats: the logarithm of how many candidates
    /// of its kind (of the catalogue, of the spec, without a name, known numbers) were tried. Grid
    /// points are not in it.
    pub choice: f64,
    /// What stands beside it where it is there twice, with other inner numbers, if it can be.
    pub second: Option<Box<Candidate>>,
}

/// Where a candidate comes from.
#[derive(Debug, Clone)]
pub enum Origin {
    /// A row of the catalogue.
    Catalogue(&'static EffectRow),
    /// The `candidates` of the spec.
    Spec,
    /// A term without a name of its own.
    Unnamed {
        /// The statement; its inner parameters may stand between braces.
        statement: String,
        /// Names of the inner parameters, in their order.
        parameters: Vec<String>,
    },
    /// A term of the spec that the law does not have.
    LeftOut(LeftOut),
    /// A known number of the spec, learned in its place: an inner parameter and no term.
    Number {
        /// The number.
        number: Box<KnownNumber>,
        /// What a change of it does to the system, to first order; of the extension's graph.
        probe: Box<Term>,
    },
}

/// Everything of the catalogue that the system allows, and the spec's own candidates, except
/// what the spec holds already; then its known numbers.
pub fn candidates(scope: &mut Scope, dataset: &Dataset, tuning: &Candidates) -> Vec<Candidate> {
    let mut all = declared::candidates(scope, tuning);
    let system = scope.compiled().system.clone();
    let held: BTreeSet<String> = system.terms.iter().filter_map(|t| t.effect.clone()).collect();
    let reach = Reach::of(&system, dataset, tuning);
    let standing = system.parameters.len();
    let scene = system.scene();
    // What has states of its own is no term of a system that stands.
    let instances = instances(&scene).into_iter().filter(|instance| !instance.effect.has_states());
    let touching = touching(&system, tuning.pair_coordinates);
    // Of what is measured with a coordinate, the coordinate.
    let (observables, degrees) = (&scene.observables, scene.coordinates.len());
    let places: HashMap<&str, usize> =
        observables.iter().enumerate().map(|(at, name)| (name.as_str(), at)).collect();
    let site = |name: &str| match places.get(name) {
        Some(at) if *at < 2 * degrees => scene.coordinates.get(at % degrees).map(String::as_str),
        _ => None,
    };
    let touch = |instance: &Instance| {
        let (Some(touching), [a, b]) = (&touching, instance.arguments.as_slice()) else {
            return true;
        };
        if !matches!(
            instance.effect.on,
            ActsOn::Pair | ActsOn::OrderedPair | ActsOn::ObservablePair
        ) {
            return true;
        }
        match (site(a), site(b)) {
            (Some(a), Some(b)) => a == b || touching.contains(&[a, b]),
            _ => true,
        }
    };
    let instances = instances.filter(touch);
    let first = all.len();
    let mut ready = |instance: Instance, second: Option<Box<Candidate>>| {
        let (row, label, arguments) = (instance.effect, instance.label(), instance.arguments);
        let mut on: Vec<String> = arguments.iter().flat_map(|one| scene.members(one)).collect();
        on.retain(|name| row.on != ActsOn::Driven || scene.coordinates.contains(name));
        let extension = scope.extension(&instance.statement).ok()?;
        let terms = terms_of(&extension, |term| term.effect.as_ref() == Some(&label));
        let parameters = extension.parameters().map(|(id, ..)| id);
        let parameters = parameters.filter(|id| id.position() >= standing).collect();
        let scans: Vec<ScanBy> = row.parameters.iter().map(|scan| scan.by).collect();
        let grid = if row.on.is_of_bodies() && !scans.is_empty() {
            let bodies: Vec<Vec<String>> = match row.on {
                ActsOn::Body => vec![on.clone()],
                _ => arguments.iter().map(|one| scene.members(one)).collect(),
            };
            reach.grid_of_bodies(&scans, &bodies)
        } else if row.on == ActsOn::Driven {
            reach.grid(&scans, arguments.last().map_or("", String::as_str))
        } else {
            reach.grid(&scans, on.first().map_or("", String::as_str))
        };
        let found = !terms.is_empty();
        let origin = Origin::Catalogue(row);
        let choice = 0.0;
        found.then_some(Candidate {
            origin,
            label,
            on,
            arguments,
            extension,
            terms,
            parameters,
            grid,
            choice,
            second,
        })
    };
    // A second one of an effect is none as long as the first is not there.
    let is_alone = |row: &EffectRow, arguments: &[String]| {
        let first = row.second_of.and_then(by_name);
        first.is_some_and(|first| !held.contains(&first.label(arguments)))
    };
    for instance in instances {
        let Instance { effect: row, arguments, .. } = &instance;
        if held.contains(&instance.label()) || is_alone(row, arguments) {
            continue;
        }
        let second = row.second().map(|row| Instance::of(row, arguments.clone()));
        let second = second.filter(|second| !held.contains(&second.label()));
        let second = second.and_then(|second| ready(second, None)).map(Box::new);
        all.extend(ready(instance, second));
    }
    one_of(&mut all[first..]);
    all.extend(numbers::candidates(scope, dataset, tuning));
    all
}

/// Says of candidates of one kind that each is one of them.
fn one_of(kind: &mut [Candidate]) {
    let choice = (kind.len().max(1) as f64).ln();
    kind.iter_mut().for_each(|candidate| candidate.choice = choice);
}

/// The terms of an extension that are `wanted`.
pub(super) fn terms_of(extension: &Extension, wanted: impl Fn(&Term) -> bool) -> Vec<TermId> {
    extension.terms().filter(|(_, term)| wanted(term)).map(|(id, _)| id).collect()
}

impl Candidate {
    /// The system with it; `base` is the system that it was made for.
    pub fn system(&self, base: &System) -> System {
        self.extension.onto(base)
    }

    /// Its inner parameters, each as it or the system `base` declares it.
    pub fn parameters_in<'a>(&'a self, base: &'a System) -> impl Iterator<Item = &'a Parameter> {
        self.parameters.iter().filter_map(|&id| {
            let own = self.extension.parameters().find(|(own, ..)| *own == id);
            own.map(|(_, parameter, _)| parameter).or_else(|| base.parameter(id))
        })
    }

    /// What one number of it costs beside so many residuals: twice the nats of the Bayesian
    /// information criterion and of the choice among its kind.
    pub fn price_of_number(&self, residuals: f64) -> f64 {
        2.0 * self.choice + residuals.ln()
    }

    /// Columns that it has in a score test.
    pub fn columns(&self) -> usize {
        match &self.origin {
            Origin::Number { .. } => 1,
            _ => self.terms.len(),
        }
    }

    /// Whether its name says the sign of its coefficients: none is negative.
    pub fn is_positive(&self) -> bool {
        matches!(self.origin, Origin::Catalogue(row) if row.positive)
    }

    /// The known number that it is, where it is one.
    pub fn number(&self) -> Option<&KnownNumber> {
        match &self.origin {
            Origin::Number { number, .. } => Some(&**number),
            _ => None,
        }
    }

    /// The term of the spec that it is, where it is one that the law does not have.
    pub fn left_out(&self) -> Option<&LeftOut> {
        match &self.origin {
            Origin::LeftOut(term) => Some(term),
            _ => None,
        }
    }

    /// Where the search for a known number begins, when a score test says how far off it is: a
    /// number that is off keeps its sign and its size.
    pub fn start_of_number(&self, change: f64) -> Option<f64> {
        let value = self.number()?.value;
        let most = 0.5 * value.abs();
        Some(value + change.clamp(-most, most))
    }

    /// A scope with it, inner parameters at some values: its statement stands there, or the known
    /// number is an inner parameter.
    ///
    /// # Errors
    /// The scope is not that of the system that it was made for, and it makes no sense there.
    pub fn added_to(&self, scope: &Scope, values: &[f64]) -> Result<Scope> {
        match &self.origin {
            Origin::Number { number, .. } => {
                scope.freed(number, values.first().copied().unwrap_or(number.value))
            }
            Origin::LeftOut(_) => Ok(scope.clone()),
            _ => scope.with(&self.snippet(values)),
        }
    }

    /// The statement that adds it, its inner parameters at some values; for a known number, the
    /// statement that it stands in with its new value; empty where it stands in the spec.
    pub fn snippet(&self, values: &[f64]) -> String {
        match &self.origin {
            Origin::Catalogue(row) => row.statement(&self.arguments, values),
            Origin::Spec => format!("effect {}", self.label),
            Origin::LeftOut(_) => String::new(),
            Origin::Unnamed { statement, parameters } => {
                let declared = |(name, value): (&String, &f64)| format!("param {name} = {value}; ");
                let declared: String = parameters.iter().zip(values).map(declared).collect();
                let bare = |text: String, name: &String| text.replace(&format!("{{{name}}}"), name);
                format!("{declared}{}", parameters.iter().fold(statement.clone(), bare))
            }
            Origin::Number { number, .. } => {
                number.rewritten(values.first().copied().unwrap_or(number.value), &[])
            }
        }
    }

    /// The effect's terms at one choice of its inner parameters, in the graph of `into`: what
    /// changes the motion of a model, to first order.
    pub fn probes(&self, into: &mut System, law: &Law, values: &[f64]) -> Vec<Term> {
        if let Origin::Number { number, probe } = &self.origin {
            let own =
                self.parameters.iter().map(|id| (Symbol::Parameter(id.position()), number.value));
            let mut numbers: HashMap<Symbol, f64> = own.collect();
            numbers.extend((0..into.terms.len()).map(|k| (Symbol::Coefficient(k), 0.0)));
            let learned = law.support().iter().zip(law.coefficients());
            numbers.extend(learned.map(|(id, &c)| (Symbol::Coefficient(id.position()), c)));
            return vec![self.extension.import(probe, &mut into.graph, &numbers)];
        }
        if let Origin::LeftOut(_) = &self.origin {
            let standing = into.terms_with_ids().filter(|(id, _)| self.terms.contains(id));
            return standing.map(|(_, term)| term.clone()).collect();
        }
        let own = self.parameters.iter().zip(values);
        let own = own.map(|(id, &value)| (Symbol::Parameter(id.position()), value));
        // A term may name what the law has to say (`rate(p)` is a force): what it left out is 0.
        let left_out = (0..into.terms.len()).map(Symbol::Coefficient);
        let mut numbers: HashMap<Symbol, f64> = left_out.map(|symbol| (symbol, 0.0)).collect();
        for id in law.support() {
            numbers.remove(&Symbol::Coefficient(id.position()));
        }
        numbers.extend(own);
        let own = self.extension.terms().filter(|(id, _)| self.terms.contains(id));
        own.map(|(_, term)| self.extension.import(term, &mut into.graph, &numbers)).collect()
    }
}
