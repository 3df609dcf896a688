//! What a program builds on: a spec, measurements, the law that they give, and what it says.
//!
//! The types are thin: each holds what the layers before it give, and asks them.

pub(crate) mod checked;
mod comparison;
pub(crate) mod components;
mod data;
pub(crate) mod design;
mod diagnosis;
mod discovery;
pub(crate) mod effect;
#[cfg(feature = "export")]
pub(crate) mod exports;
pub(crate) mod held_out;
mod json;
mod law;
pub(crate) mod measured;
pub(crate) mod model_file;
mod options;
pub(crate) mod origin;
mod parts;
mod spec;
mod trajectory;
mod vector_field;

pub use comparison::{Comparison, Horizon};
pub use data::Data;
pub use design::{Design, DesignOptions};
pub use diagnosis::{Diagnosis, Effect, Verdict};
pub use discovery::Discovery;
pub use law::Law;
pub use measured::Values;
pub use options::{DiagnosisOptions, DiscoveryOptions};
pub use parts::{LocalParts, Part};
pub use spec::Spec;
pub use trajectory::Trajectory;
pub use vector_field::VectorField;
