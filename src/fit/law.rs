//! What was learned, of which system: the one record that every later step starts from.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::column::Column;
use super::distribution::Distribution;
use super::hidden::HiddenMotion;
use super::pass::Stepping;
use super::segments::{Reach, SHORTEST};
use crate::dynamics::{Dynamics, Method};
use crate::error::{Error, ErrorKind, Result};
use crate::eval::Backend;
use crate::expr::{Bounds, ParameterId, Symbol, System, Term, TermId};
use crate::simulate::Simulator;

/// Longest step of a law that is known from the start, in the spec's unit of time: nothing tells
/// how accurate it must be. At a frequency omega a method of order eight errs by about (0.01
/// omega)^9 of the motion in a step, which is below rounding up to omega = 2.
const KNOWN_STEP: f64 = 0.01;

/// A system with a number for everything in it: learned, or known from the start.
///
/// All lists belong together: there is one coefficient for each term of the support, one value for
/// each inner parameter of the system, and the covariance is of both. What was learned of another
/// system comes in by [`Law::on`] alone.
#[derive(Debug, Clone)]
pub struct Law {
    system: Arc<System>,
    /// Ascending, each once.
    support: Vec<TermId>,
    coefficients: Vec<f64>,
    parameters: Vec<f64>,
    covariance: Option<DMatrix<f64>>,
    noise: Vec<f64>,
    resolution: Vec<f64>,
    stepping: Stepping,
    reach: Reach,
    /// Values of the inner parameters that runs have for themselves, as far as they are known.
    distributions: Arc<Vec<Distribution>>,
    /// Where what nobody measures was in the runs that it was learned from.
    hidden: Arc<Vec<HiddenMotion>>,
}

impl Law {
    /// The law of a system with the given terms and their coefficients, and one value for each of
    /// its inner parameters; the covariance is not known.
    ///
    /// `noise` is the standard deviation of each observable's noise, in the observable's unit and
    /// in the order of [`System::observables`]; empty where it is not known. Trajectories are
    /// integrated by `stepping`, over segments of `window` samples, at most.
    ///
    /// # Errors
    ///
    /// A term belongs to another system or comes twice, or a list has not the system's length.
    pub fn new(
        system: Arc<System>,
        mut terms: Vec<(TermId, f64)>,
        parameters: Vec<f64>,
        noise: Vec<f64>,
        (stepping, window): (Stepping, usize),
    ) -> Result<Law> {
        terms.sort_by_key(|(id, _)| *id);
        let (support, coefficients): (Vec<TermId>, Vec<f64>) = terms.into_iter().unzip();
        system.positions(&support)?;
        let once = support.windows(2).all(|pair| pair[0] != pair[1]);
        let whole = parameters.len() == system.parameters.len()
            && (noise.is_empty() || noise.len() == system.observed_count());
        if !once || !whole {
            return Err(Error::new(
                ErrorKind::InvalidArgument,
                format!("the numbers of a law do not fit the system `{}`", system.name),
                "give each term once, one value for each inner parameter, and the noise of each \
                 observable",
            ));
        }
        let resolution = vec![0.0; system.observed_count()];
        let covariance = None;
        Ok(Law {
            system,
            support,
            coefficients,
            parameters,
            covariance,
            noise,
            resolution,
            stepping,
            reach: Reach::of(window),
            distributions: Arc::default(),
            hidden: Arc::default(),
        })
    }

    /// The law of a system in which no term is unknown, its inner parameters exactly at their
    /// starts.
    ///
    /// # Errors
    ///
    /// The table of integrators lacks the one for such laws.
    pub fn known(system: Arc<System>) -> Result<Law> {
        let separable = Dynamics::known(&system, Backend::default()).separable();
        // Nothing tells how accurate it must be: a high order and a short step.
        let name = if separable { "suzuki-umeno-8" } else { "gauss-legendre-6" };
        let method = Method::by_name(name).ok_or_else(|| {
            Error::new(
                ErrorKind::Internal,
                format!("there is no integrator `{name}`"),
                "report this",
            )
        })?;
        let stepping = Stepping { method, longest: KNOWN_STEP };
        let parameters: Vec<f64> = system.parameters.iter().map(|p| p.start).collect();
        let covariance = DMatrix::zeros(parameters.len(), parameters.len());
        Law::new(system, Vec::new(), parameters, Vec::new(), (stepping, SHORTEST))?
            .with_covariance(covariance)
    }

    /// The same with the covariance of the coefficients of the support, then of all inner
    /// parameters: zero for what is exact, infinite for what the data leave open.
    ///
    /// # Errors
    ///
    /// The matrix has another size.
    pub fn with_covariance(mut self, covariance: DMatrix<f64>) -> Result<Law> {
        let size = self.support.len() + self.parameters.len();
        if covariance.shape() != (size, size) {
            return Err(Error::new(
                ErrorKind::InvalidArgument,
                format!("the covariance of {size} numbers has the shape {:?}", covariance.shape()),
                "give one row for each term of the support, then for each inner parameter",
            ));
        }
        self.covariance = Some(covariance);
        Ok(self)
    }

    /// The same with the covariance of its coefficients, then of the inner parameters that are
    /// `used`; the others have none.
    pub fn with_covariance_of(mut self, used: &[ParameterId], covariance: &DMatrix<f64>) -> Law {
        let terms = self.support.len();
        let size = terms + self.parameters.len();
        let places: Vec<usize> =
            (0..terms).chain(used.iter().map(|id| terms + id.position())).collect();
        let mut all = DMatrix::zeros(size, size);
        for (a, &row) in places.iter().enumerate() {
            for (b, &column) in places.iter().enumerate() {
                all[(row, column)] = covariance[(a, b)];
            }
        }
        self.covariance = Some(all);
        self
    }

    /// What it is of.
    pub fn system(&self) -> &Arc<System> {
        &self.system
    }

    /// Terms of the model, ascending.
    pub fn support(&self) -> &[TermId] {
        &self.support
    }

    /// The coefficient of each term of [`Law::support`].
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Terms of the model with their coefficients, ascending.
    pub fn terms(&self) -> impl Iterator<Item = (TermId, &Term, f64)> {
        let of = |(&id, &value): (&TermId, &f64)| (id, &self.system.terms[id.position()], value);
        self.support.iter().zip(&self.coefficients).map(of)
    }

    /// The coefficient of a term: zero outside the support, `None` for a term of another system.
    pub fn coefficient(&self, id: TermId) -> Option<f64> {
        self.system.term(id)?;
        let place = self.support.binary_search(&id);
        Some(place.map_or(0.0, |place| self.coefficients[place]))
    }

    /// The masses 1 / (d^2 H / dp^2) at rest, one a coordinate; 1 where there is none.
    pub(crate) fn masses(&self) -> Option<Vec<f64>> {
        let mut system = System::clone(&self.system);
        let energy = system.energy(&self.support).ok()?;
        let each = self.coefficient_of_each_term();
        let of = |symbol| match symbol {
            Symbol::Coefficient(k) => each.get(k).copied().unwrap_or(0.0),
            Symbol::Parameter(j) => self.parameters.get(j).copied().unwrap_or(0.0),
            _ => 0.0,
        };
        let mass = |i: usize| {
            let velocity = system.graph.derivative(energy, Symbol::Momentum(i));
            let inverse = system.graph.derivative(velocity, Symbol::Momentum(i));
            let mass = 1.0 / system.graph.value(inverse, &of);
            if mass.is_finite() && mass > 0.0 { mass } else { 1.0 }
        };
        Some((0..self.system.degrees()).map(mass).collect())
    }

    /// One coefficient for each term of the whole function space, in its order; zero outside the
    /// support.
    pub fn coefficient_of_each_term(&self) -> Vec<f64> {
        let mut each = vec![0.0; self.system.terms.len()];
        for (id, &value) in self.support.iter().zip(&self.coefficients) {
            each[id.position()] = value;
        }
        each
    }

    /// Values of the inner parameters that runs, or groups of runs, have for themselves: of those
    /// that the law was learned from.
    pub fn distributions(&self) -> &[Distribution] {
        &self.distributions
    }

    /// The same with such values.
    pub(super) fn with_distributions(mut self, distributions: Vec<Distribution>) -> Law {
        self.distributions = Arc::new(distributions);
        self
    }

    /// Where what nobody measures was in the runs that it was learned from, as far as it is known.
    pub(crate) fn hidden(&self) -> &[HiddenMotion] {
        &self.hidden
    }

    /// The same with such motions.
    pub(super) fn with_hidden(mut self, motions: Vec<HiddenMotion>) -> Law {
        self.hidden = Arc::new(motions);
        self
    }

    /// One value for each inner parameter of the system, in its order. One that runs have for
    /// themselves stands there with its mean over the runs.
    pub fn parameters(&self) -> &[f64] {
        &self.parameters
    }

    /// The value of an inner parameter; `None` for one of another system.
    pub fn parameter(&self, id: ParameterId) -> Option<f64> {
        self.system.parameter(id).map(|_| self.parameters[id.position()])
    }

    /// Covariance of the coefficients of the support, then of all inner parameters, where it is
    /// known: zero for what is exact, infinite for what the data leave open.
    pub fn covariance(&self) -> Option<&DMatrix<f64>> {
        self.covariance.as_ref()
    }

    /// Standard errors of the coefficients of the support, then of all inner parameters; infinite
    /// where nothing is known.
    pub fn standard_errors(&self) -> Vec<f64> {
        let size = self.support.len() + self.parameters.len();
        match &self.covariance {
            Some(covariance) => covariance.diagonal().iter().map(|x| x.sqrt()).collect(),
            None => vec![f64::INFINITY; size],
        }
    }

    /// A coefficient with its standard error; `None` outside the support.
    pub fn coefficient_with_error(&self, id: TermId) -> Option<(f64, f64)> {
        let at = self.support.binary_search(&id).ok()?;
        Some((self.coefficients[at], self.error_at(at)))
    }

    /// An inner parameter with its standard error; `None` for one of another system.
    pub fn parameter_with_error(&self, id: ParameterId) -> Option<(f64, f64)> {
        let value = self.parameter(id)?;
        Some((value, self.error_at(self.support.len() + id.position())))
    }

    fn error_at(&self, at: usize) -> f64 {
        let covariance = self.covariance.as_ref();
        covariance.map_or(f64::INFINITY, |covariance| covariance[(at, at)].sqrt())
    }

    /// Standard deviation of the noise of each observable, in its unit; empty where not known.
    pub fn noise(&self) -> &[f64] {
        &self.noise
    }

    /// One over the noise of each observable: what residuals are weighed by.
    pub fn weights(&self) -> Vec<f64> {
        self.noise.iter().map(|s| 1.0 / s.max(f64::MIN_POSITIVE)).collect()
    }

    /// The error of each observable below which residuals mean nothing, in its unit: what the
    /// integrator and the digits of the data resolve; zero where it is not known.
    pub fn resolution(&self) -> &[f64] {
        &self.resolution
    }

    /// How trajectories are integrated.
    pub fn stepping(&self) -> Stepping {
        self.stepping
    }

    /// Samples of the segments that it was learned from, at most.
    pub fn window(&self) -> usize {
        self.reach.window
    }

    /// The same, and the holes that they bridged.
    pub fn reach(&self) -> Reach {
        self.reach
    }

    /// The same with one more term; one that it has already gets the coefficient.
    ///
    /// # Errors
    ///
    /// The term belongs to another system.
    pub fn with_term(mut self, id: TermId, coefficient: f64) -> Result<Law> {
        self.system.positions(&[id])?;
        match self.support.binary_search(&id) {
            Ok(place) => self.coefficients[place] = coefficient,
            Err(place) => {
                self.support.insert(place, id);
                self.coefficients.insert(place, coefficient);
            }
        }
        self.covariance = None;
        Ok(self)
    }

    /// The same without a term; that of another system, or one outside the support, changes
    /// nothing.
    pub fn without_term(mut self, id: TermId) -> Law {
        if let Ok(place) = self.support.binary_search(&id) {
            self.support.remove(place);
            self.coefficients.remove(place);
            self.covariance = None;
        }
        self
    }

    /// What it says of a system with more terms, or fewer: terms are known by their place and
    /// label, inner parameters by their names; those that are new have their start values.
    pub fn on(&self, system: &Arc<System>) -> Law {
        let (mut support, mut coefficients) = (Vec::new(), Vec::new());
        for (id, term) in system.terms_with_ids() {
            let known = self.terms().find(|(own, other, _)| {
                *own == id || other.place == term.place && other.label == term.label
            });
            if let Some((_, _, value)) = known {
                support.push(id);
                coefficients.push(value);
            }
        }
        let value = |parameter: &crate::expr::Parameter| {
            let own = self.system.parameters.iter().position(|p| p.name == parameter.name);
            own.map_or(parameter.start, |j| self.parameters[j])
        };
        Law {
            support,
            coefficients,
            parameters: system.parameters.iter().map(value).collect(),
            covariance: None,
            noise: self.noise_on(system, 1.0),
            resolution: self.of_observables(&self.resolution, system, 0.0),
            stepping: self.stepping,
            reach: self.reach,
            distributions: self.distributions.clone(),
            hidden: self.hidden.clone(),
            system: system.clone(),
        }
    }

    /// The noise of each observable of a system that may have other coordinates: `new` for those
    /// that this law's system does not have.
    pub fn noise_on(&self, system: &System, new: f64) -> Vec<f64> {
        self.of_observables(&self.noise, system, new)
    }

    fn of_observables(&self, values: &[f64], system: &System, new: f64) -> Vec<f64> {
        let own = self.system.observables();
        if own.len() == system.observed_count() || values.len() != own.len() {
            return values.to_vec();
        }
        let value = |name: &String| own.iter().position(|other| other == name);
        let names = system.observables();
        names.iter().map(|name| value(name).map_or(new, |at| values[at])).collect()
    }

    /// The same with other inner parameters, as far as there are values.
    pub fn with_parameters(mut self, values: impl IntoIterator<Item = (ParameterId, f64)>) -> Law {
        for (id, value) in values {
            if self.system.parameter(id).is_some() {
                self.parameters[id.position()] = value;
            }
        }
        self.covariance = None;
        self
    }

    /// Makes these terms the support, with their coefficients.
    pub(super) fn set_support(&mut self, terms: &[(TermId, f64)]) {
        debug_assert!(terms.is_sorted_by_key(|(id, _)| *id));
        (self.support, self.coefficients) = terms.iter().copied().unzip();
        self.covariance = None;
    }

    /// Sets some of the inner parameters.
    pub(super) fn set_parameters(&mut self, values: &[(ParameterId, f64)]) {
        for (id, value) in values {
            self.parameters[id.position()] = *value;
        }
        self.covariance = None;
    }

    /// Takes its numbers from the unknowns of its own dynamics.
    pub(super) fn set_theta(&mut self, dynamics: &Dynamics, theta: &[f64]) {
        let size = self.support.len();
        self.coefficients.copy_from_slice(&theta[..size]);
        for (id, &value) in dynamics.parameters().iter().zip(&theta[size..]) {
            self.parameters[id.position()] = value;
        }
        self.covariance = None;
    }

    pub(super) fn set_noise(&mut self, noise: Vec<f64>) {
        self.noise = noise;
    }

    pub(super) fn set_reach(&mut self, reach: Reach) {
        self.reach = reach;
    }

    pub(super) fn set_stepping(&mut self, stepping: Stepping) {
        self.stepping = stepping;
    }

    /// The same before data of other noise, one number for each observable.
    pub fn with_noise(mut self, noise: Vec<f64>) -> Law {
        debug_assert_eq!(noise.len(), self.system.observed_count());
        self.noise = noise;
        self
    }

    /// The same with what the integrator and the digits of the data resolve of each observable.
    pub fn with_resolution(mut self, resolution: Vec<f64>) -> Law {
        debug_assert_eq!(resolution.len(), self.system.observed_count());
        self.resolution = resolution;
        self
    }

    /// The same over segments of another length, in samples.
    pub fn with_window(mut self, window: usize) -> Law {
        self.reach.window = window;
        self
    }

    /// The same over segments that bridge holes up to this one, in the unit of time.
    pub fn with_bridged(mut self, bridged: f64) -> Law {
        self.reach.bridged = bridged;
        self
    }

    /// The same integrated in another way.
    pub fn with_stepping(mut self, stepping: Stepping) -> Law {
        self.stepping = stepping;
        self
    }

    /// Its equations of motion.
    pub fn dynamics(&self) -> Dynamics {
        Dynamics::of_positions(&self.system, self.positions(), Vec::new(), Backend::default())
    }

    /// The same for runs that have some of its inner parameters for themselves.
    pub(crate) fn dynamics_of_runs(&self) -> Dynamics {
        Dynamics::of_runs(&self.system, self.positions(), Vec::new(), Backend::default())
    }

    /// Allowed values of the unknowns of a dynamics of its system.
    pub(crate) fn bounds(&self, dynamics: &Dynamics) -> Vec<Bounds> {
        let System { terms, parameters, .. } = &*self.system;
        let coefficients = dynamics.active().iter().map(|id| terms[id.position()].bounds);
        let inner = dynamics.parameters().iter().map(|id| parameters[id.position()].bounds);
        coefficients.chain(inner).collect()
    }

    /// Positions of its terms in the system.
    pub(crate) fn positions(&self) -> Vec<usize> {
        self.support.iter().map(|id| id.position()).collect()
    }

    /// The columns of its coefficients in the factor of the whole function space.
    pub(super) fn columns(&self) -> Vec<Column> {
        self.support.iter().copied().map(Column::from).collect()
    }

    /// Its numbers as the unknowns of a dynamics that has its terms: the coefficients of the
    /// dynamics' active terms (zero outside the support), then its inner parameters.
    pub fn theta(&self, dynamics: &Dynamics) -> Vec<f64> {
        let each = self.coefficient_of_each_term();
        let coefficient = |id: &TermId| each.get(id.position()).copied().unwrap_or(0.0);
        let coefficients = dynamics.active().iter().map(coefficient);
        let parameters = dynamics.parameters().iter().map(|id| self.parameters[id.position()]);
        coefficients.chain(parameters).collect()
    }

    /// Its motion, to be simulated.
    pub fn simulator(&self) -> Simulator<'_> {
        let dynamics = self.dynamics();
        let theta = self.theta(&dynamics);
        Simulator::with(&self.system, dynamics, theta)
    }
}
