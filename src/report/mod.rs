//! Results as people read them.

#[cfg(feature = "cli")]
mod data;
#[cfg(feature = "cli")]
mod design;
#[cfg(feature = "cli")]
mod diagnosis;
#[cfg(feature = "cli")]
mod diagnostic;
pub mod document;
mod figures;
pub mod html;
#[cfg(feature = "cli")]
pub mod layout;
pub mod plots;
pub mod present;
#[cfg(feature = "cli")]
mod space;
#[cfg(feature = "cli")]
mod text;
pub mod warnings;

use serde_json::{Value, json};

#[cfg(feature = "cli")]
pub use design::design_text;
#[cfg(feature = "cli")]
pub use diagnosis::{
    CoefficientChange, DiagnosisContext, RevisionSummary, compare_text, diagnosis_text,
    discovery_text, revision_text,
};
pub use figures::Drawing;
#[cfg(feature = "cli")]
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
            "warnings": warnings::to_json(self.model),
            "elapsed": self.elapsed,
        })
    }
}
