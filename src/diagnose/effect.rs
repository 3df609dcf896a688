//! What is said of a change that a spec may lack: an effect with its numbers, or another number.

use serde::Serialize;

use super::candidates::{Candidate, LeftOut, NumberChange};
use super::times::times;
use crate::error::Result;
use crate::expr::Scope;
use crate::spec::edit;

/// An effect that was refitted in full and ranked.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RankedEffect {
    /// `viscous_drag(theta)`.
    pub effect: String,
    /// Coordinates or observables that it is on.
    pub on: Vec<String>,
    /// The statement that adds it to the spec.
    pub snippet: String,
    /// Coefficient of each of its terms, then its inner parameters.
    pub coefficient: Vec<f64>,
    /// Standard errors, in the order of `coefficient`.
    pub standard_error: Vec<f64>,
    /// Probability that noise makes the least clear coefficient as clear (Wald's test), corrected
    /// for all candidates and grid points.
    pub p_value: f64,
    /// How many these were.
    pub tests: f64,
    /// Fall of the training deviance in the full refit.
    pub deviance: f64,
    /// The number of the spec that should be another one, where it is that and no effect.
    pub number: Option<NumberChange>,
    /// The term of the spec that it is, where it is one that the fit left out and no effect:
    /// `snippet` is empty.
    pub left_out: Option<LeftOut>,
    /// In units of the noise.
    pub held_out_error_before: f64,
    /// The same with the effect in the model.
    pub held_out_error_after: f64,
    /// As a member of a story: what would explain as much in its place.
    pub indistinguishable: Vec<String>,
}

impl RankedEffect {
    /// A term of the spec that the fit left out, with the numbers of its coefficients and their
    /// errors, and the probability that noise does as well, which is to be corrected for so many
    /// tests.
    pub(super) fn of_term(
        term: &Candidate,
        numbers: Vec<(f64, f64)>,
        (p_value, tests): (f64, f64),
    ) -> RankedEffect {
        let (coefficient, standard_error) = numbers.into_iter().unzip();
        RankedEffect {
            effect: term.label.clone(),
            on: term.on.clone(),
            snippet: String::new(),
            coefficient,
            standard_error,
            p_value: (p_value * tests).min(1.0),
            tests,
            deviance: 0.0,
            number: None,
            left_out: term.left_out().cloned(),
            held_out_error_before: f64::NAN,
            held_out_error_after: f64::NAN,
            indistinguishable: Vec::new(),
        }
    }

    /// A scope with it: its statement stands there, or the number is an inner parameter.
    ///
    /// # Errors
    /// It makes no sense in the scope.
    pub fn added_to(&self, scope: &Scope) -> Result<Scope> {
        match &self.number {
            Some(change) => {
                let value = self.coefficient.last().copied().unwrap_or(change.was);
                scope.freed(&change.known, value)
            }
            None if self.left_out.is_some() => Ok(scope.clone()),
            None => scope.with(&self.snippet),
        }
    }

    /// What it does to predictions of held-out runs, as the end of a sentence; empty where they
    /// were not looked at.
    pub fn gain(&self) -> String {
        let (before, after) = (self.held_out_error_before, self.held_out_error_after);
        if !(before.is_finite() && after.is_finite()) {
            return String::new();
        }
        let (before, after) = (times(before), times(after));
        format!(", which takes the error on held-out runs from {before} to {after} times the noise")
    }

    /// The text of a spec with it: its statement, or the number changed. A number must have been
    /// found in this text, and be changed before statements are added.
    pub fn written_into(&self, text: &str) -> String {
        written_into(text, &self.snippet, self.number.as_ref(), &self.coefficient)
    }
}

/// The text of a spec with a statement, or with a number changed to the last of the coefficients;
/// as it is where there is no statement.
pub(super) fn written_into(
    text: &str,
    statement: &str,
    number: Option<&NumberChange>,
    coefficient: &[f64],
) -> String {
    match number {
        Some(change) => {
            change.known.edited(text, coefficient.last().copied().unwrap_or(change.was))
        }
        None if statement.is_empty() => text.to_string(),
        None => edit::insert(text, statement),
    }
}
