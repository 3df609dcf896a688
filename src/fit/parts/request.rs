//! What the pass of a part is asked for, as bytes.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::super::driving::OwnInputs;
use super::super::gauge;
use super::super::loss::Loss;
use super::super::model::fingerprint;
use super::super::monitor::Silent;
use super::super::pass::{Problem, Stepping};
use super::super::segments::Segments;
use super::super::stream::Asked;
use super::super::tuning::{SegmentTuning, SettlingTuning, TangentTuning, Tuning};
use crate::data::{Packed, Sealed, sum};
use crate::dynamics::{Dynamics, Method};
use crate::error::{Error, ErrorKind, Result};
use crate::eval::Backend;
use crate::expr::System;

/// Samples of a segment, folds: more are nobody's.
const MOST: usize = 1 << 20;
/// Steps of an iteration, at most.
const STEPS: usize = 1000;
/// Steps of the integrator in a typical interval between samples, at most.
const SUBDIVIDED: f64 = 1e4;

/// The numbers of a pass: the law at which residuals are linearised, by which terms, how it is
/// integrated, and what the measurements weigh. The same for every part; it travels as bytes.
///
/// Made by the fit ([`Spec::fit_parts`](crate::Spec::fit_parts)), which hands it to its
/// [`Engine`](crate::Engine).
///
/// ```
/// use leverrier::{ErrorKind, PassRequest};
///
/// let error = PassRequest::from_bytes(b"LVpq, and something else").unwrap_err();
/// assert_eq!(error.kind(), ErrorKind::Model);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PassRequest {
    /// Of the system of the spec.
    fingerprint: String,
    /// Whether the scale of its momenta is settled by a unit of mass first.
    unit_mass: bool,
    /// Places of the terms that are left then, in the system that is left.
    terms: Vec<u32>,
    present: Numbers,
    by: Numbers,
    weights: Vec<f64>,
    loss: String,
    method: String,
    longest: f64,
    floor: f64,
    window: u64,
    typical: f64,
    by_runs: bool,
    segments: SegmentTuning,
    tangents: TangentTuning,
    settling: SettlingTuning,
}

/// Some terms by their places, and theta: their coefficients, then the inner parameters in them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Numbers {
    active: Vec<u32>,
    theta: Vec<f64>,
}

impl Numbers {
    fn of((dynamics, theta): (&Dynamics, &[f64])) -> Numbers {
        let active = dynamics.active().iter().map(|id| id.position() as u32).collect();
        Numbers { active, theta: theta.to_vec() }
    }

    fn compiled(&self, system: &System, method: Method) -> Result<Dynamics> {
        let positions: Vec<usize> = self.active.iter().map(|&k| k as usize).collect();
        if !positions.is_sorted_by(|a, b| a < b)
            || positions.last().is_some_and(|&last| last >= system.terms.len())
        {
            return Err(unfit("names terms that the spec does not have"));
        }
        let dynamics = Dynamics::of_runs(system, positions, Vec::new(), Backend::default());
        if self.theta.len() != dynamics.unknowns() {
            return Err(unfit("has not a number for every unknown"));
        }
        if method.needs_separable() && !dynamics.separable() {
            return Err(unfit("asks for an integrator that does not apply"));
        }
        dynamics.prepare(method);
        Ok(dynamics)
    }
}

fn unfit(what: &str) -> Error {
    Error::new(
        ErrorKind::InvalidArgument,
        format!("the request for a pass {what}"),
        "pass over the parts with the spec that is fitted, in the same version of the program",
    )
}

/// Terms of a system whose function space may have been narrowed, by their places in the whole.
fn places(system: &System, whole: &System) -> Result<Vec<u32>> {
    let mut from = 0;
    let mut found = Vec::with_capacity(system.terms.len());
    for term in &system.terms {
        let same = |other: &crate::expr::Term| {
            other.place == term.place && other.label == term.label && other.expr == term.expr
        };
        let next =
            whole.terms[from..].iter().position(same).map(|at| from + at).ok_or_else(|| {
                let message = format!("`{}` is no term of the spec", term.label);
                Error::new(ErrorKind::Internal, message, "report this")
            })?;
        found.push(next as u32);
        from = next + 1;
    }
    Ok(found)
}

impl PassRequest {
    pub(super) fn of(
        asked: &Asked,
        original: &System,
        (fingerprint, unit_mass): (&str, bool),
    ) -> Result<PassRequest> {
        let Asked { system, problem, present, by, typical, by_runs } = *asked;
        let terms = match unit_mass {
            true => match gauge::unit_mass(original) {
                Some(settled) => places(system, &settled)?,
                None => return Err(unfit("settles a scale that is not open")),
            },
            false => places(system, original)?,
        };
        Ok(PassRequest {
            fingerprint: fingerprint.to_string(),
            unit_mass,
            terms,
            present: Numbers::of(present),
            by: Numbers::of(by),
            weights: problem.weights.to_vec(),
            loss: problem.loss.row().name.to_string(),
            method: problem.stepping.method.row().name.to_string(),
            longest: problem.stepping.longest,
            floor: problem.floor,
            window: problem.window as u64,
            typical,
            by_runs,
            segments: problem.tuning.segments.clone(),
            tangents: problem.tuning.tangents.clone(),
            settling: problem.tuning.settling.clone(),
        })
    }

    /// Bytes that are the same for the same request and for no other.
    pub(super) fn mark(&self) -> Result<[u8; 16]> {
        Ok(sum(&self.sealed()?))
    }

    /// The bytes that [`PassRequest::from_bytes`] reads: `docs/formats.md`.
    ///
    /// # Errors
    /// None that is known.
    ///
    /// ```
    /// fn sent(request: &leverrier::PassRequest) -> leverrier::Result<Vec<u8>> {
    ///     request.to_bytes()
    /// }
    /// ```
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        self.sealed()
    }

    /// What [`PassRequest::to_bytes`] wrote.
    ///
    /// # Errors
    /// The bytes are of another kind or version, or damaged ([`ErrorKind::Model`]).
    ///
    /// ```
    /// assert!(leverrier::PassRequest::from_bytes(b"LVpq").is_err());
    /// ```
    pub fn from_bytes(bytes: &[u8]) -> Result<PassRequest> {
        PassRequest::unsealed(bytes)
    }

    /// Does what a pass needs the compiled motions for.
    pub(super) fn work<T>(
        &self,
        original: &System,
        pass: impl FnOnce(&Asked) -> Result<T>,
    ) -> Result<T> {
        if fingerprint(original) != self.fingerprint {
            return Err(unfit("is of another spec"));
        }
        let mut system = match self.unit_mass {
            true => gauge::unit_mass(original)
                .ok_or_else(|| unfit("settles a scale that is not open"))?,
            false => original.clone(),
        };
        let all = std::mem::take(&mut system.terms);
        let kept = self.terms.iter().map(|&k| all.get(k as usize).cloned());
        system.terms = kept.collect::<Option<_>>().ok_or_else(|| unfit("names no term"))?;
        let system = Arc::new(system);
        if self.weights.len() != system.observables().len() {
            return Err(unfit("has not a weight for every observable"));
        }
        let loss = Loss::by_name(&self.loss).ok_or_else(|| unfit("names no loss"))?;
        let method = Method::by_name(&self.method).ok_or_else(|| unfit("names no integrator"))?;
        let present = self.present.compiled(&system, method)?;
        let other = match self.by == self.present {
            true => None,
            false => Some(self.by.compiled(&system, method)?),
        };
        let tuning = Tuning {
            segments: self.segments.clone(),
            tangents: self.tangents.clone(),
            settling: self.settling.clone(),
            ..Tuning::default()
        };
        tuning.check()?;
        let problem = Problem {
            measured: &Packed::default(),
            segments: &Segments::default(),
            observed: system.observed,
            weights: &self.weights,
            loss,
            stepping: Stepping { method, longest: self.longest },
            floor: self.floor,
            stream: None,
            window: self.window as usize,
            parameters: &system.parameters,
            own: OwnInputs::default(),
            tuning: &tuning,
            halt: &Silent,
        };
        pass(&Asked {
            system: &system,
            problem: &problem,
            present: (&present, &self.present.theta),
            by: (other.as_ref().unwrap_or(&present), &self.by.theta),
            typical: self.typical,
            by_runs: self.by_runs,
        })
    }
}

impl Sealed for PassRequest {
    const MARK: &'static [u8; 4] = b"LVpq";
    const WHAT: &'static str = "request for a pass";

    fn checked(&self) -> std::result::Result<(), &'static str> {
        let positive = |x: &f64| x.is_finite() && *x > 0.0;
        let counts = self.window >= 2
            && self.window <= MOST as u64
            && (1..=MOST).contains(&self.segments.folds)
            && self.settling.steps <= STEPS
            && self.tangents.steps <= STEPS
            && self.settling.expected_from <= MOST;
        let numbers = self.weights.iter().all(positive)
            && positive(&self.longest)
            && self.longest * SUBDIVIDED >= self.typical
            && self.floor >= 0.0
            && self.typical >= 0.0
            && self.typical.is_finite();
        match counts && numbers {
            true => Ok(()),
            false => Err("their numbers are out of range"),
        }
    }
}
