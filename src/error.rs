//! The one error type of the crate. Every variant reads as a sentence and says what to do.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::diagnostic::Diagnostic;

pub type Result<T> = std::result::Result<T, Error>;

/// Whatever can go wrong between a user's files and a result.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A spec has errors; all of them, in the order of the text.
    #[error("{}", summary(name, diagnostics))]
    Spec {
        /// What the text is called, usually its path.
        name: String,
        text: String,
        diagnostics: Vec<Diagnostic>,
    },
    /// A data file cannot be used as it is.
    #[error("{0}")]
    Data(DataError),
    /// A fit cannot be done, or ended without a model.
    #[error("{message}; {hint}")]
    Fit { message: String, hint: String },
    /// A model file does not belong to the spec, or cannot be read.
    #[error("{}: {message}; {hint}", path.display())]
    Model { path: PathBuf, message: String, hint: String },
    /// The operating system said no.
    #[error("cannot {action} {}: {source}", path.display())]
    File {
        /// What was being done: "read", "write", "create".
        action: &'static str,
        path: PathBuf,
        source: std::io::Error,
    },
    /// The command line asks for something that does not exist.
    #[error("{message}; {hint}")]
    Usage { message: String, hint: String },
    /// Ctrl-C before there was anything to keep.
    #[error("stopped before there was a result to keep; start the command again to go on")]
    Interrupted,
}

impl Error {
    pub fn file(action: &'static str, path: &Path, source: std::io::Error) -> Self {
        Error::File { action, path: path.to_path_buf(), source }
    }

    pub fn fit(message: impl Into<String>, hint: impl Into<String>) -> Self {
        Error::Fit { message: message.into(), hint: hint.into() }
    }

    pub fn usage(message: impl Into<String>, hint: impl Into<String>) -> Self {
        Error::Usage { message: message.into(), hint: hint.into() }
    }

    /// The process's exit code: 1 failed, 2 wrong usage.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Usage { .. } => 2,
            _ => 1,
        }
    }
}

/// What is wrong with a data file, and where.
#[derive(Debug, Clone, PartialEq)]
pub struct DataError {
    pub file: PathBuf,
    /// Line of the file, counted from 1 (the header is a line too).
    pub line: Option<u64>,
    /// Name of the column.
    pub column: Option<String>,
    pub message: String,
    pub hint: String,
}

impl fmt::Display for DataError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ", line {line}")?;
        }
        if let Some(column) = &self.column {
            write!(f, ", column `{column}`")?;
        }
        write!(f, ": {}; {}", self.message, self.hint)
    }
}

impl From<DataError> for Error {
    fn from(error: DataError) -> Self {
        Error::Data(error)
    }
}

fn summary(name: &str, diagnostics: &[Diagnostic]) -> String {
    match diagnostics {
        [] => format!("{name} cannot be used"),
        [one] => format!("{name}: {one}"),
        [first, rest @ ..] => format!("{name}: {first} (and {} more errors)", rest.len()),
    }
}
