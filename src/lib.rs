//! Leverrier learns the equation of motion behind measurements: a sparse Hamiltonian, and the
//! forces that are not in it, each coefficient with its uncertainty.
//!
//! Data flow one way, and a layer of the crate imports only what stands above it in this list:
//!
//! | layer | takes | gives |
//! |---|---|---|
//! | `error`, `diagnostic` | | one error type, messages that point into a user's text |
//! | `data` | a CSV or Parquet file | runs of samples with true times, and a report on them |
//! | `spec` | the text of a spec | a syntax tree, or all that is wrong with it |
//! | `expr` | a syntax tree | a `System`: expressions, function space, units |
//! | `eval` | expressions | functions over many points at once |
//! | `dynamics` | a system | trajectories, with exact derivatives of the discrete map |
//! | `simulate` | a known law | trajectories near machine precision, and what an instrument makes of them |
//! | `fit` | a system and data | a sparse `Model` with uncertainties |
//! | `diagnose` | a model on its data | where it fails, and which named effect is missing |
//! | `simplify` | a model | the expression that a physicist would print |
//! | `export` | a model and its simplified form | LaTeX, MathML, Rust, C, Python, JSON |
//! | `facade` | a spec and data | the public types: [`Spec`], [`Data`], [`Law`] |
//! | `report` | all of it | text, plots and pages for people |
//! | `project` | the files of a folder | spec, data, model and ledger; additions, undoing, exports |
//! | `studio` | a spec | the same in a browser, on this machine |
//! | `cli` | a command line | the above, with files and a terminal at the edges |
//!
//! The method starts from Sparse Symplectically Integrated Neural Networks (DiPietro, Xiong and
//! Zhu, NeurIPS 2020), "the paper" in these pages: H = T(p) + V(q) is a sum of candidate terms,
//! integrated by a symplectic method inside the loss, with few coefficients that are not zero.
//!
//! ```
//! use leverrier::Spec;
//!
//! // What is known of a pendulum on a bench, and what is to be learned.
//! let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
//! // The measurements that it names: a CSV file beside it. A quarter is held out.
//! let (training, held_out) = spec.data()?.split(0.25, 0)?;
//! let law = spec.fit(&training)?;
//! // Its long predictions fail on the held-out runs, for want of an effect that it can name.
//! assert!(law.compare(&held_out)?.horizons().last().unwrap().error > 3.0);
//! let diagnosis = law.diagnose(&training, &held_out)?;
//! assert_eq!(diagnosis.missing(), Some("viscous_drag(q)"));
//! // With it, the law predicts to the noise.
//! let law = law.with("viscous_drag(q)")?.fit(&training)?;
//! let motion = law.predict(&[1.0, 0.0], &[0.0, 0.5, 1.0])?;
//! assert!(motion.column("q").unwrap()[2] < 0.7);
//! # Ok::<(), leverrier::Error>(())
//! ```
//!
//! [`Spec`], [`Data`] and [`Law`] are the way in. Errors read as a sentence and have a
//! [`kind`](Error::kind).
//!
//! # Features
//!
//! Without default features the crate reads specs and CSV files, fits, predicts, compares and
//! diagnoses. `export` adds the simplified form of a law and its exports, `parquet` (and `zstd`)
//! Parquet files, `files` those of MATLAB, HDF5, NumPy and Excel, `arrow` those of Arrow,
//! `figures` the figures of the report as SVG, `cli` the program `leverrier`, `pictures` its
//! figures as PNG, and `studio` its page in the browser. All but `zstd` are on by default.

// What only a feature uses is not worth a mark of its own: with all of them on, nothing is dead.
#![cfg_attr(
    not(all(feature = "arrow", feature = "files", feature = "parquet", feature = "studio")),
    allow(dead_code, unused_imports)
)]

// What users write is read without an index that could be wrong: in the layers that read their
// text and files none is allowed. The numeric layers index: the sizes of their arrays are their
// own, set where the arrays are made, and a wrong one is a mistake of ours that must stop.
#[cfg(feature = "cli")]
#[deny(clippy::indexing_slicing)]
mod cli;
#[deny(clippy::indexing_slicing)]
mod data;
mod diagnose;
mod diagnostic;
mod dynamics;
mod error;
mod eval;
#[cfg(feature = "export")]
mod export;
mod expr;
#[deny(clippy::indexing_slicing)]
mod facade;
mod fit;
#[cfg(feature = "cli")]
#[deny(clippy::indexing_slicing)]
mod project;
#[cfg(feature = "figures")]
mod report;
#[cfg(feature = "export")]
mod simplify;
mod simulate;
#[deny(clippy::indexing_slicing, clippy::string_slice)]
mod spec;
#[cfg(feature = "studio")]
#[deny(clippy::indexing_slicing)]
mod studio;

pub use data::{PartPlace, PartSampling, PartSurvey};
pub use diagnostic::{Diagnostic, Severity, Span};
pub use dynamics::Method;
pub use error::{DataError, Error, ErrorKind, Result};
pub use facade::{Comparison, Data, Design, DesignOptions, Diagnosis, DiagnosisOptions};
pub use facade::{Discovery, DiscoveryOptions, Effect, Horizon, Law, Spec, Trajectory, Values};
pub use facade::{LocalParts, Part, VectorField, Verdict};
pub use fit::distribution::{Distribution, OwnValue, Unusual};
pub use fit::hidden::HiddenMotion;
pub use fit::model::{LearnedParameter, LearnedTerm, Noise};
pub use fit::parts::{Engine, PassFactor, PassRequest};
pub use fit::tuning;
pub use fit::{Flag, Loss, Monitor, Options, Selection, Silent, Trainer, Tuning};
#[cfg(feature = "figures")]
pub use report::Drawing;

/// The README's examples, run as tests.
#[cfg(all(doctest, feature = "export"))]
#[doc = include_str!("../README.md")]
struct Readme;

/// The layers as they are, for this crate's own program, tests, benchmarks and examples.
///
/// Nothing in here is promised: any of it may change or go in any version.
#[doc(hidden)]
#[allow(missing_docs)]
pub mod internals {
    #[cfg(feature = "cli")]
    pub mod cli {
        pub use crate::cli::*;
    }
    pub mod data {
        pub use crate::data::*;
    }
    pub mod diagnose {
        pub use crate::diagnose::*;
    }
    pub mod diagnostic {
        pub use crate::diagnostic::*;
    }
    pub mod dynamics {
        pub use crate::dynamics::*;
    }
    pub mod error {
        pub use crate::error::*;
    }
    pub mod eval {
        pub use crate::eval::*;
    }
    #[cfg(feature = "export")]
    pub mod export {
        pub use crate::export::*;
    }
    pub mod expr {
        pub use crate::expr::*;
    }
    pub mod fit {
        pub use crate::fit::*;
    }
    #[cfg(feature = "cli")]
    pub mod project {
        pub use crate::project::ledger::Ledger;
    }
    #[cfg(feature = "figures")]
    pub mod report {
        pub use crate::report::*;
    }
    #[cfg(feature = "export")]
    pub mod simplify {
        pub use crate::simplify::*;
    }
    pub mod simulate {
        pub use crate::simulate::*;
    }
    pub mod spec {
        pub use crate::spec::*;
    }
}
