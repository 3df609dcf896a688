//! Leverrier learns the equation of motion behind measurements.
//!
//! Data flow one way, and a module imports only what stands above it in this list:
//!
//! | module | takes | gives |
//! |---|---|---|
//! | `error`, `diagnostic` | | one error type, messages that point into a user's text |
//! | `data` | a CSV file | runs of samples with true times, and a report on them |
//! | `spec` | the text of a spec | a syntax tree, or all that is wrong with it |
//! | `expr` | a syntax tree | a `System`: expressions, function space, units |
//! | `eval` | expressions | functions over many points at once |
//! | `dynamics` | a system | trajectories, with exact derivatives of the discrete map |
//! | `fit` | a system and data | a sparse `Model` with uncertainties |
//! | `diagnose` | a model before its data | where it fails, and which named effect is missing |
//! | `simplify` | a model | the expression that a physicist would print |
//! | `simulate` | a known law | trajectories near machine precision, and what an instrument makes of them |
//! | `export` | a model and its simplified form | LaTeX, MathML, Rust, C, Python, JSON |
//! | `report` | all of it | text for people |
//! | `project` | the files of a folder | spec, data, model and ledger; additions, undoing, exports |
//! | `studio` | a spec | the same in a browser, on this machine |
//! | `cli` | a command line | the above, with files and a terminal at the edges |
//!
//! The method starts from Sparse Symplectically Integrated Neural Networks (DiPietro, Xiong and
//! Zhu, NeurIPS 2020), "the paper" in these pages: H = T(p) + V(q) is a sum of candidate terms,
//! integrated by a symplectic method inside the loss, with few coefficients that are not zero.
//!
//! ```
//! use leverrier::internals::data::{Dataset, Run};
//! use leverrier::internals::fit::{Options, Silent, fit};
//!
//! // A swing measured without noise: q'' = -q, a sample every 0.1.
//! let times: Vec<f64> = (0..60).map(|i| 0.1 * i as f64).collect();
//! let values = vec![times.iter().map(|t| t.cos()).collect(), times.iter().map(|t| -t.sin()).collect()];
//! let run = Run { name: "1".into(), lines: vec![0; times.len()], times, values };
//! let data = Dataset { observables: vec!["q".into(), "p".into()], runs: vec![run] };
//!
//! let spec = "coordinates q; momenta p\nT = p^2/2\nV = span{ poly(q; 4), cos(q) }";
//! let compiled = leverrier::internals::expr::build("swing", spec)?;
//! let model = fit(&compiled.system, &data, &Options::default(), &Silent)?;
//! assert_eq!(model.terms.len(), 1);
//! assert_eq!(model.terms[0].term, "q^2");
//! assert!((model.terms[0].coefficient - 0.5).abs() < 1e-9);
//! # Ok::<(), leverrier::Error>(())
//! ```

// What only a feature uses is not worth a mark of its own: with all of them on, nothing is dead.
#![cfg_attr(not(all(feature = "studio", feature = "parquet")), allow(dead_code, unused_imports))]

#[cfg(feature = "cli")]
mod cli;
mod data;
mod diagnose;
mod diagnostic;
mod dynamics;
mod error;
mod eval;
#[cfg(feature = "export")]
mod export;
mod expr;
mod fit;
#[cfg(feature = "cli")]
mod project;
#[cfg(feature = "cli")]
mod report;
#[cfg(feature = "export")]
mod simplify;
mod simulate;
mod spec;
#[cfg(feature = "studio")]
mod studio;

pub use diagnostic::{Diagnostic, Severity, Span};
pub use error::{DataError, Error, ErrorKind, Result};

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
