//! A law and a diagnosis as programs read them.

use crate::diagnose::diagnosis::Diagnosis;
pub use crate::export::{equations_json, export, finite, notes, pretty, simplified};

/// How many effects were tested, and what the p-values are corrected for.
pub fn tested(diagnosis: &Diagnosis) -> String {
    format!(
        "{} effects of the catalogue were tested, with {} choices of where they act and of their \
         inner parameters; p-values are corrected for that many tests (look-elsewhere correction).",
        diagnosis.candidates, diagnosis.tests
    )
}
