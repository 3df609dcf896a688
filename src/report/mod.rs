//! Results as people read them.

mod data;
mod design;
mod diagnosis;
mod diagnostic;
pub mod document;
pub mod html;
pub mod layout;
pub mod plots;
pub mod present;
mod space;
mod text;

use serde_json::{Value, json};

pub use design::design_text;
pub use diagnosis::{
    CoefficientChange, DiagnosisContext, RevisionSummary, compare_text, diagnosis_text,
    discovery_text, revision_text,
};
pub use text::{fit_text, seconds};

use crate::expr::System;
use crate::fit::Model;
use crate::simplify::{Simplified, Style};

/// Everything that is printed about a fit.
pub struct FitReport<'a> {
    /// What was fitted.
    pub system: &'a System,
    /// What was learned.
    pub model: &'a Model,
    /// Its printed form.
    pub simplified: Simplified,
    /// For each observable, whether anything was measured of it.
    pub measured: Vec<bool>,
    /// Seconds that the fit took.
    pub elapsed: f64,
}

impl FitReport<'_> {
    /// `leverrier.fit/1`, without what only the command knows.
    pub fn to_json(&self) -> Value {
        json!({
            "format": "leverrier.fit/1",
            "system": self.system.name,
            "hamiltonian": present::equations_json(&self.simplified, Style::default()),
            "model": self.model,
            "elapsed": self.elapsed,
        })
    }
}
