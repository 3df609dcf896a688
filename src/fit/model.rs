//! The learned model: what a fit returns, what the model file holds.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::column::Column;
use super::distribution::Distribution;
use super::gauss_newton::StopReason;
use super::hidden::HiddenMotion;
use super::law::Law;
use super::pass::Stepping;
use super::warning::Warning;
use crate::dynamics::Method;
use crate::error::{Error, ErrorKind, Result};
use crate::expr::{ParameterId, Place, System, Term, TermId};

/// Version of the model file's layout.
pub const FORMAT: &str = "leverrier.model/2";
/// Versions that are read.
pub const READ: [&str; 2] = ["leverrier.model/1", FORMAT];

/// A learned model, with what is known about how well it is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Model {
    /// Always [`FORMAT`].
    pub format: String,
    /// Version of the program that wrote it.
    pub version: String,
    /// Name of the system.
    pub system: String,
    /// Hash of everything in the spec that has a meaning to the fit; comments do not count.
    pub fingerprint: String,
    /// The support: every term whose coefficient is not zero.
    pub terms: Vec<LearnedTerm>,
    /// The inner parameters that occur in the support.
    pub parameters: Vec<LearnedParameter>,
    /// Covariance of the coefficients of `terms`, then of `parameters`; `null` where infinite.
    #[serde(with = "finite_or_null")]
    pub covariance: Vec<Vec<f64>>,
    /// Noise of each observable, in the order of the system's observables.
    pub noise: Vec<Noise>,
    /// What was found of everything that nobody measures, at the start and the end of every run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub hidden: Vec<HiddenMotion>,
    /// How trajectories were integrated.
    pub integrator: IntegratorRecord,
    /// What the fit rests on.
    pub evidence: Evidence,
    /// The best model of every size: error against number of terms.
    pub front: Vec<FrontPoint>,
    /// Other supports whose criterion is close, best first.
    pub runners_up: Vec<RunnerUp>,
    /// Exchanges of a term that these data can hardly tell from the model.
    pub alternatives: Vec<Exchange>,
    /// What these data cannot learn at all, in sentences.
    pub unlearnable: Vec<String>,
    /// Why its numbers may not be what they look like, where that was asked.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<Warning>,
    /// L1 penalty and the coefficients at it, along the path.
    pub path: Vec<PathEntry>,
    /// Why training ended.
    pub stop: Stop,
    /// The inner parameters of which runs have values of their own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub distributions: Vec<Distribution>,
}

/// A term of the support.
///
/// ```
/// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
/// let law = spec.fit(&spec.data()?)?;
/// for term in law.terms() {
///     println!("{}: {} +- {} {}", term.place, term.coefficient, term.standard_error, term.term);
/// }
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LearnedTerm {
    /// "T", "V", "H" or "force theta".
    pub place: String,
    /// The term in the mini-language, without its coefficient.
    pub term: String,
    /// The name that the spec gives the coefficient.
    pub name: Option<String>,
    /// Coefficient, in units of `unit`.
    pub coefficient: f64,
    /// Standard error of the coefficient, in the same unit; `null` in the file where infinite.
    #[serde(with = "finite_or_null_one")]
    pub standard_error: f64,
    /// How often the term is chosen when the data are resampled, 0 to 1; `None` where there is
    /// nothing to draw from, as in one whole run.
    #[serde(deserialize_with = "Option::deserialize")]
    pub inclusion: Option<f64>,
    /// Unit of the coefficient, where units were given.
    pub unit: Option<String>,
}

/// An inner parameter that occurs in the model.
///
/// ```
/// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
/// let law = spec.fit(&spec.data()?)?;
/// assert!(law.parameters().is_empty()); // no `param` in this spec
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LearnedParameter {
    /// As written in the spec.
    pub name: String,
    /// Learned value, in units of `unit`.
    pub value: f64,
    /// Standard error, in the same unit; `null` in the file where infinite.
    #[serde(with = "finite_or_null_one")]
    pub standard_error: f64,
    /// Unit of the parameter, where one was given.
    pub unit: Option<String>,
}

/// Noise of one observable.
///
/// ```
/// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
/// let law = spec.fit(&spec.data()?)?;
/// for noise in law.noise() {
///     println!("{} is known to {}", noise.observable, noise.standard_deviation);
/// }
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// Name of the observable.
    pub observable: String,
    /// Standard deviation, in the observable's unit.
    pub standard_deviation: f64,
    /// Rounding and the integrator's error, in the observable's unit.
    pub resolution: f64,
}

/// The integrator that the fit ended with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IntegratorRecord {
    /// Name of the method, as in "leapfrog".
    pub method: String,
    /// No step was longer, in the spec's unit of time.
    pub longest_step: f64,
    /// Why this one.
    pub reason: String,
}

fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

/// What the fit rests on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Runs of the data set.
    pub runs: usize,
    /// Samples of all runs.
    pub samples: usize,
    /// Segments that the runs were cut into.
    pub segments: usize,
    /// Samples of the first search, where the data were many: terms were looked
    /// for on so many drawn at random, then chosen and fitted on all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub searched_first: Option<usize>,
    /// Samples of the longest segment.
    pub window: usize,
    /// The longest hole that a segment bridges, in the unit of time; 0 where none does.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub bridged: f64,
    /// Independent residuals.
    pub residuals: usize,
    /// Segments whose predicted trajectory left the finite numbers.
    #[serde(alias = "exploded")]
    pub diverged: usize,
    /// Root mean square of the residuals in units of the noise.
    pub error: f64,
    /// Members of the function space.
    pub function_space: usize,
    /// Coefficients and inner parameters of the model.
    pub learned: usize,
    /// Value of the criterion for the model (a deviance; smaller is better).
    pub criterion: f64,
    /// How the support was chosen, in words.
    pub selection: String,
    /// Name of the loss, a row of [`LOSSES`](super::LOSSES).
    pub loss: String,
    /// Supports that the last search tried.
    pub supports_tried: usize,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// The best model with a given number of terms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrontPoint {
    /// Its terms, in the mini-language.
    pub terms: Vec<String>,
    /// Root mean square of the residuals in units of the noise.
    pub error: f64,
    /// Value of the criterion (a deviance; smaller is better).
    pub criterion: f64,
    /// Whether it is the model.
    pub chosen: bool,
}

/// A support that came close.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunnerUp {
    /// Term and coefficient.
    pub terms: Vec<(String, f64)>,
    /// How much worse than the model, in units of the criterion (a deviance).
    pub difference: f64,
}

/// A term of the model and one that could stand in its place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Exchange {
    /// The term of the model.
    pub term: String,
    /// The term that could stand in its place.
    pub instead: String,
    /// How much worse the criterion (a deviance) gets by the exchange.
    pub difference: f64,
}

/// One penalty of the L1 path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PathEntry {
    /// Penalty on a coefficient times the norm of its column.
    pub lambda: f64,
    /// Term and coefficient of every term that is not zero at this penalty.
    pub coefficients: Vec<(String, f64)>,
}

/// Why training ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stop {
    /// What ended the last refit.
    pub reason: StopReason,
    /// The reason in a sentence.
    pub sentence: String,
    /// Rounds of training: search and refit.
    pub rounds: usize,
    /// Gauss-Newton iterations of the last refit.
    pub iterations: usize,
}

/// What a law says, as a model's record holds it; [`Model::law`] reads it back.
impl Law {
    /// Its terms, each with how often it is chosen; `inclusion` is of every column of the function
    /// space.
    pub(super) fn recorded_terms(&self, inclusion: Option<&[f64]>) -> Vec<LearnedTerm> {
        let recorded =
            |((id, term, coefficient), standard_error): ((TermId, &Term, f64), f64)| LearnedTerm {
                place: place_name(self.system(), term.place),
                term: term.label.clone(),
                name: term.name.clone(),
                coefficient,
                standard_error,
                inclusion: inclusion.map(|all| all[Column::from(id)]),
                unit: term.unit_text.clone(),
            };
        self.terms().zip(self.standard_errors()).map(recorded).collect()
    }

    /// The inner parameters that are `used`.
    pub(super) fn recorded_parameters(&self, used: &[ParameterId]) -> Vec<LearnedParameter> {
        let errors = self.standard_errors().split_off(self.support().len());
        let recorded = |id: &ParameterId| {
            let parameter = &self.system().parameters[id.position()];
            LearnedParameter {
                name: parameter.name.clone(),
                value: self.parameters()[id.position()],
                standard_error: errors[id.position()],
                unit: parameter.unit_text.clone(),
            }
        };
        used.iter().map(recorded).collect()
    }

    /// Covariance of its coefficients, then of the inner parameters that are `used`, row by row;
    /// infinite where it is not known.
    pub(super) fn recorded_covariance(&self, used: &[ParameterId]) -> Vec<Vec<f64>> {
        let terms = self.support().len();
        let places: Vec<usize> =
            (0..terms).chain(used.iter().map(|id| terms + id.position())).collect();
        let entry = |a: usize, b: usize| self.covariance().map_or(f64::INFINITY, |all| all[(a, b)]);
        places.iter().map(|&a| places.iter().map(|&b| entry(a, b)).collect()).collect()
    }

    /// How its trajectories are integrated, and why.
    pub(super) fn recorded_integrator(&self, reason: &str) -> IntegratorRecord {
        IntegratorRecord {
            method: self.stepping().method.row().name.to_string(),
            longest_step: self.stepping().longest,
            reason: reason.to_string(),
        }
    }
}

impl Model {
    /// The law that the record is of.
    ///
    /// `None` when the model belongs to another spec, or is damaged.
    pub fn law(&self, system: &Arc<System>) -> Option<Law> {
        if self.fingerprint != fingerprint(system) {
            return None;
        }
        let mut terms = Vec::with_capacity(self.terms.len());
        let mut known: HashMap<&str, Vec<TermId>> = HashMap::new();
        for (id, term) in system.terms_with_ids() {
            known.entry(&term.label).or_default().push(id);
        }
        for learned in &self.terms {
            let there = |id: &&TermId| {
                let place = system.term(**id).map(|term| place_name(system, term.place));
                place.as_ref() == Some(&learned.place)
            };
            let first = known.get(learned.term.as_str())?.iter().find(there)?;
            terms.push((*first, learned.coefficient));
        }
        // Where a term was put back into the record, it is the first there, not in the system.
        let mut order: Vec<usize> = (0..terms.len()).collect();
        order.sort_by_key(|&place| terms[place].0);
        order.extend(terms.len()..terms.len() + system.parameters.len());
        let recorded = self.full_covariance(system);
        let size = order.len();
        let covariance = DMatrix::from_fn(size, size, |a, b| recorded[(order[a], order[b])]);
        let method = Method::by_name(&self.integrator.method)?;
        let stepping = Stepping { method, longest: self.integrator.longest_step };
        let noise = self.noise.iter().map(|noise| noise.standard_deviation).collect();
        let known = (stepping, self.evidence.window);
        let law =
            Law::new(system.clone(), terms, self.parameter_values(system), noise, known).ok()?;
        // A record without noise has no resolution either.
        let resolution: Vec<f64> = self.noise.iter().map(|noise| noise.resolution).collect();
        let resolved = resolution.len() == system.observed_count();
        let law = if resolved { law.with_resolution(resolution) } else { law };
        let law = law.with_bridged(self.evidence.bridged);
        let law = law.with_distributions(self.distributions.clone());
        let law = law.with_hidden(self.hidden.clone());
        law.with_covariance(covariance).ok()
    }

    /// The same, saying so where the model belongs to another spec.
    ///
    /// # Errors
    ///
    /// The model belongs to another spec, or is damaged; [`ErrorKind::Model`].
    pub fn law_of(&self, system: &Arc<System>) -> Result<Law> {
        self.law(system).ok_or_else(|| {
            Error::new(
                ErrorKind::Model,
                "the model belongs to another spec",
                "fit the spec again, then ask what is missing",
            )
        })
    }

    /// The value of every inner parameter of the system: learned, or its start.
    pub fn parameter_values(&self, system: &System) -> Vec<f64> {
        system
            .parameters
            .iter()
            .map(|p| {
                let learned = self.parameters.iter().find(|l| l.name == p.name);
                learned.map_or(p.start, |l| l.value)
            })
            .collect()
    }

    /// Covariance of the coefficients, then of all inner parameters of the system
    /// (those that the model does not use have none).
    fn full_covariance(&self, system: &System) -> DMatrix<f64> {
        let terms = self.terms.len();
        let size = terms + system.parameters.len();
        let place = |row: usize| -> Option<usize> {
            if row < terms {
                return Some(row);
            }
            let name = &system.parameters[row - terms].name;
            self.parameters.iter().position(|p| &p.name == name).map(|j| terms + j)
        };
        DMatrix::from_fn(size, size, |a, b| match (place(a), place(b)) {
            (Some(a), Some(b)) => {
                self.covariance.get(a).and_then(|row| row.get(b)).copied().unwrap_or(f64::INFINITY)
            }
            _ => 0.0,
        })
    }
}

/// "T", "V", "H", or "force" and its coordinate.
pub fn place_name(system: &System, place: Place) -> String {
    system.place_name(place)
}

/// A hash of what a system means: variables, known parts, function space, parameters.
pub fn fingerprint(system: &System) -> String {
    let names = system.names();
    let text = |expr| system.graph.text(expr, &names);
    let mut hash = Sha256::new();
    let mut line = |words: &[&str]| {
        for word in words {
            hash.update(word.as_bytes());
            hash.update([0]);
        }
        hash.update(b"\n");
    };
    let variables = system.coordinates.iter().chain(&system.momenta).chain(&system.velocities);
    for variable in variables {
        line(&[&variable.name, variable.unit_text.as_deref().unwrap_or("")]);
    }
    for part in &system.hidden {
        let name = system.coordinates.get(part.coordinate).map_or("", |of| of.name.as_str());
        line(&["hidden", name, &part.rate.map(text).unwrap_or_default()]);
    }
    for input in &system.inputs {
        line(&["input", &input.variable.name, input.between.keyword()]);
    }
    line(&["T", &text(system.kinetic)]);
    line(&["V", &text(system.potential)]);
    line(&["H", &text(system.hamiltonian)]);
    for &force in &system.forces {
        line(&["force", &text(force)]);
    }
    for measure in &system.measures {
        let period = measure.period.map(|period| period.to_string()).unwrap_or_default();
        line(&["measure", &measure.variable.name, &measure.text, &period]);
    }
    for (place, &sensor) in system.sensors.iter().enumerate() {
        if !system.graph.is_zero(sensor) {
            line(&[&place_name(system, Place::Sensor(place)), &text(sensor)]);
        }
    }
    for constraint in &system.constraints {
        line(&["constraint", &text(constraint.expr)]);
    }
    for term in &system.terms {
        line(&[&place_name(system, term.place), &term.label]);
    }
    for parameter in &system.parameters {
        match &parameter.per {
            None => line(&["param", &parameter.name]),
            Some(per) => line(&["param", &parameter.name, "per", per.word()]),
        }
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// JSON has no infinity: it is written as null.
pub(super) mod finite_or_null_one {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        value.is_finite().then_some(*value).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
    }
}

mod finite_or_null {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(
        rows: &[Vec<f64>],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let rows: Vec<Vec<Option<f64>>> = rows
            .iter()
            .map(|row| row.iter().map(|x| x.is_finite().then_some(*x)).collect())
            .collect();
        rows.serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<Vec<f64>>, D::Error> {
        let rows = Vec::<Vec<Option<f64>>>::deserialize(deserializer)?;
        Ok(rows
            .into_iter()
            .map(|row| row.into_iter().map(|x| x.unwrap_or(f64::INFINITY)).collect())
            .collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::build;

    #[test]
    fn a_record_is_read_back_as_the_law_that_it_was_written_from() {
        let text = "coordinates q\nmomenta p\nT = p^2/2\nparam a = 1\nparam b = 2\n\
                    V = span{ q^2, q^4, cos(a*q), cos(b*q) }";
        let system = build("spec", text).unwrap_or_else(|error| panic!("{error}")).system;
        let (ids, inner) = (system.term_ids(), system.parameter_ids());
        let method = Method::by_name("leapfrog").expect("a method");
        let known = (Stepping { method, longest: 0.05 }, 9);
        let terms = vec![(ids[0], 0.5), (ids[2], -0.25)];
        let law = Law::new(system.clone(), terms, vec![1.25, 2.0], vec![0.01, 0.02], known);
        let used = [inner[0]];
        let spread = DMatrix::from_fn(3, 3, |a, b| if a == b { 4.0 } else { 0.1 });
        let law = law.expect("its own terms").with_covariance_of(&used, &spread);
        let covariance = law.recorded_covariance(&used);
        assert_eq!(covariance[2], [0.1, 0.1, 4.0]);
        let model: Model = serde_json::from_value(serde_json::json!({
            "format": FORMAT, "version": "", "system": "spec",
            "fingerprint": fingerprint(&system),
            "terms": law.recorded_terms(Some(&[0.9, 0.1, 0.8, 0.0])),
            "parameters": law.recorded_parameters(&used),
            "covariance": covariance,
            "noise": [
                { "observable": "q", "standard_deviation": 0.01, "resolution": 1e-9 },
                { "observable": "p", "standard_deviation": 0.02, "resolution": 1e-9 },
            ],
            "integrator": law.recorded_integrator("asked for"),
            "evidence": {
                "runs": 1, "samples": 9, "segments": 1, "window": 9, "residuals": 14,
                "exploded": 0, "error": 1.0, "function_space": 4, "learned": 3,
                "criterion": 0.0, "selection": "", "loss": "squares", "supports_tried": 1,
                "seed": 0,
            },
            "front": [], "runners_up": [], "alternatives": [], "unlearnable": [], "path": [],
            "stop": { "reason": "converged", "sentence": "", "rounds": 1, "iterations": 1 },
        }))
        .expect("a record");
        assert_eq!((model.terms[1].standard_error, model.terms[1].inclusion), (2.0, Some(0.8)));
        let read = model.law(&system).expect("of its own system");
        assert_eq!(
            read.terms().map(|(id, _, x)| (id, x)).collect::<Vec<_>>(),
            [(ids[0], 0.5), (ids[2], -0.25)]
        );
        assert_eq!((read.parameters(), read.noise()), (law.parameters(), law.noise()));
        assert_eq!((read.stepping(), read.window()), (law.stepping(), law.window()));
        assert_eq!(read.covariance(), law.covariance());
    }
}
