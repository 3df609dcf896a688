//! What a fitted model is written as for others to read and run.
//!
//! A format is one file of this folder and one row of [`EXPORTERS`].

mod assemble;
mod c;
mod code;
mod equations;
pub mod escape;
mod json;
mod latex;
pub mod letters;
mod mathml;
mod model;
pub mod number;
mod pretty;
mod python;
mod rust;
pub mod tex;

pub use assemble::{export, notes, pretty, simplified};
pub use equations::{equations_json, finite};
pub use mathml::{Formula, formulas};
pub use pretty::{Pretty, PrettyNumber};

use crate::dynamics::Tableau;
use crate::error::{Error, ErrorKind, Result};
use crate::expr::System;
use crate::fit::Law;

/// A fitted model and where it comes from: everything that an exporter may write.
pub struct Export<'a> {
    /// What was learned, of which system. The step of the generated simulators is its longest.
    pub law: &'a Law,
    /// The model as people read it.
    pub pretty: &'a Pretty,
    /// The integrator that the model was fitted with.
    pub integrator: ExportedIntegrator,
    /// What the model was made from.
    pub provenance: Provenance,
    /// A typical start: the time, and q_1 .. q_n, p_1 .. p_n.
    pub start: Option<(f64, Vec<f64>)>,
}

/// An integrator, as far as generated code has to know it.
#[derive(Debug, Clone, PartialEq)]
pub struct ExportedIntegrator {
    /// Its name in the crate, as in "leapfrog".
    pub name: String,
    /// The global error falls with this power of the step.
    pub order: u32,
    /// How one step is taken, with its numbers.
    pub kind: IntegratorKind,
}

/// How an integrator takes one step.
#[derive(Debug, Clone, PartialEq)]
pub enum IntegratorKind {
    /// A composition of steps drift, kick, drift of lengths `weights[i]` h; for dynamics in
    /// which dq/dt depends on p and t only, dp/dt on q and t only. The time stands still
    /// during drift and kick and moves on between them.
    Splitting {
        /// Lengths of the parts in units of the step, in the order in which they are taken.
        weights: Vec<f64>,
    },
    /// Implicit Runge-Kutta (Gauss-Legendre).
    Implicit(&'static Tableau),
    /// Explicit Runge-Kutta.
    Explicit(&'static Tableau),
}

/// What a model was made from.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Provenance {
    /// Version of this crate.
    pub version: String,
    /// Name and SHA-256 (hexadecimal) of the spec.
    pub spec: (String, String),
    /// Name and SHA-256 (hexadecimal) of the data; `None` for a fully known system.
    pub data: Option<(String, String)>,
    /// Seed of the random numbers of the fit.
    pub seed: u64,
}

impl Provenance {
    /// One line for each fact, to be escaped for where it is to stand.
    fn lines(&self) -> Vec<String> {
        let mut lines = vec![
            format!("Leverrier {}", self.version),
            format!("spec {} (SHA-256 {})", self.spec.0, self.spec.1),
        ];
        if let Some((name, hash)) = &self.data {
            lines.push(format!("data {name} (SHA-256 {hash})"));
        }
        lines.push(format!("seed {}", self.seed));
        lines
    }
}

/// What an exporter writes.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// One text, for standard output or a file.
    Text(String),
    /// Several files: path relative to a folder of their own, with `/` between its parts, and text.
    Files(Vec<(String, String)>),
}

/// One format.
pub struct Exporter {
    /// Its name on the command line.
    pub name: &'static str,
    /// Usual file extension of the text, or what the folder holds.
    pub writes: &'static str,
    /// One line of help.
    pub description: &'static str,
    /// Writes the model; an error when the model cannot be expressed in the format.
    pub export: fn(&Export) -> Result<Output>,
}

/// Every format. A new one is one file and one row here.
pub static EXPORTERS: &[Exporter] = &[
    Exporter {
        name: "latex",
        writes: "tex",
        description: "equations as a LaTeX fragment for amsmath",
        export: latex::fragment,
    },
    Exporter {
        name: "latex-document",
        writes: "tex",
        description: "a LaTeX document that compiles: equations, coefficients, provenance",
        export: latex::document,
    },
    Exporter {
        name: "mathml",
        writes: "html",
        description: "equations as MathML, one element each",
        export: mathml::export,
    },
    Exporter {
        name: "rust",
        writes: "a Cargo project",
        description: "a standalone simulator in Rust, without dependencies, with its own tests",
        export: rust::export,
    },
    Exporter {
        name: "c",
        writes: "a header, a source and an example",
        description: "the model and its integrator in C99",
        export: c::export,
    },
    Exporter {
        name: "python",
        writes: "py",
        description: "a Python module of SymPy expressions with a small simulator",
        export: python::export,
    },
    Exporter {
        name: "json",
        writes: "json",
        description: "everything, for programs (format leverrier.export/1)",
        export: json::export,
    },
];

/// Looks a format up; the error lists those that exist.
pub fn exporter(name: &str) -> Result<&'static Exporter> {
    EXPORTERS.iter().find(|row| row.name == name).ok_or_else(|| {
        let names: Vec<_> = EXPORTERS.iter().map(|row| row.name).collect();
        Error::new(
            ErrorKind::UnknownName,
            format!("there is no export format `{name}`"),
            format!("choose one of {}", names.join(", ")),
        )
    })
}

impl Export<'_> {
    /// Where the simulators start unless told otherwise: time and state.
    fn start_or_default(&self) -> (f64, Vec<f64>) {
        let size = 2 * self.system().degrees();
        match &self.start {
            Some((time, state))
                if state.len() == size && state.iter().chain([time]).all(|x| x.is_finite()) =>
            {
                (*time, state.clone())
            }
            _ => (0.0, (0..size).map(|i| 0.1 / (1.0 + i as f64)).collect()),
        }
    }

    fn system(&self) -> &System {
        self.law.system()
    }

    /// Step of the integrator, in the unit of time.
    fn step(&self) -> f64 {
        self.law.stepping().longest
    }

    /// Standard deviation of the noise of each observable, by name; empty when unknown.
    fn noise(&self) -> Vec<(String, f64)> {
        let noise = self.law.noise().iter().copied();
        self.system().observables().into_iter().zip(noise).collect()
    }
}
