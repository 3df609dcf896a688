//! What expressions are compiled to.

use std::sync::OnceLock;

use crate::error::{Error, ErrorKind, Result};

/// Names the backend of the whole program: `batched` runs the portable evaluators in place of
/// machine code.
pub const VARIABLE: &str = "LEVERRIER_BACKEND";

/// Which evaluator to compile to: a row of [`BACKENDS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Backend {
    /// One point after the other, node by node; the truth that the others are held against.
    Reference,
    /// The portable evaluator: a tape of instructions, each over a block of points.
    Batched,
    /// Machine code made at run time, on x86-64 with AVX2; elsewhere, and where it cannot be
    /// made, the tape. Results are those of the tape to the last bit.
    Machine,
}

/// Every backend, with its name.
pub const BACKENDS: &[(&str, Backend)] = &[
    ("reference", Backend::Reference),
    ("batched", Backend::Batched),
    ("machine", Backend::Machine),
];

impl Backend {
    /// What the environment variable [`VARIABLE`] names; `None` where it is not set.
    ///
    /// # Errors
    ///
    /// The variable has a value that is no name of [`BACKENDS`].
    pub fn requested() -> Result<Option<Backend>> {
        let Some(name) = std::env::var_os(VARIABLE).filter(|name| !name.is_empty()) else {
            return Ok(None);
        };
        let known = BACKENDS.iter().find(|(known, _)| name == *known);
        let names: Vec<&str> = BACKENDS.iter().map(|(name, _)| *name).collect();
        known.map(|(_, backend)| Some(*backend)).ok_or_else(|| {
            Error::new(
                ErrorKind::UnknownName,
                format!("{VARIABLE} is `{}`, which is no evaluator", name.to_string_lossy()),
                format!("set it to one of {}, or leave it out", names.join(", ")),
            )
        })
    }
}

/// What the environment asks for, or else machine code. It is looked at once: all of a program
/// runs on one backend, unless a caller names another.
impl Default for Backend {
    fn default() -> Backend {
        static CHOSEN: OnceLock<Backend> = OnceLock::new();
        *CHOSEN.get_or_init(|| Backend::requested().ok().flatten().unwrap_or(Backend::Machine))
    }
}
