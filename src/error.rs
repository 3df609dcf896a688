//! The one error type of the crate. Every variant reads as a sentence and says what to do.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::diagnostic::Diagnostic;

/// What a function of this crate returns that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// Whatever can go wrong between a user's files and a result.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A spec has errors; all of them, in the order of the text.
    #[error("{}", summary(name, diagnostics))]
    Spec {
        /// What the text is called, usually its path.
        name: String,
        /// The whole text that the spans of `diagnostics` point into.
        text: String,
        /// What is wrong with it, in the order of the text; at least one is an error.
        diagnostics: Vec<Diagnostic>,
    },
    /// A data file cannot be used as it is.
    #[error("{0}")]
    Data(DataError),
    /// A fit cannot be done, or ended without a model.
    #[error("{message}; {hint}")]
    Fit {
        /// What is wrong.
        message: String,
        /// What to do about it.
        hint: String,
    },
    /// A model file does not belong to the spec, or cannot be read.
    #[error("{}: {message}; {hint}", path.display())]
    Model {
        /// Path of the model file.
        path: PathBuf,
        /// What is wrong.
        message: String,
        /// What to do about it.
        hint: String,
    },
    /// The operating system said no.
    #[error("cannot {action} {}: {source}", path.display())]
    File {
        /// What was being done: "read", "write", "create".
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the operating system answered.
        source: std::io::Error,
    },
    /// The command line asks for something that does not exist.
    #[error("{message}; {hint}")]
    Usage {
        /// What is wrong.
        message: String,
        /// What to do about it.
        hint: String,
    },
    /// Ctrl-C before there was anything to keep.
    #[error("stopped before there was a result to keep; start the command again to go on")]
    Interrupted,
}

impl Error {
    /// The operating system refused `action` ("read", "write", "create") on `path`.
    pub fn file(action: &'static str, path: &Path, source: std::io::Error) -> Self {
        Error::File { action, path: path.to_path_buf(), source }
    }

    /// A fit cannot be done: what is wrong, and what to do.
    pub fn fit(message: impl Into<String>, hint: impl Into<String>) -> Self {
        Error::Fit { message: message.into(), hint: hint.into() }
    }

    /// The command line is wrong: what is wrong, and what to do.
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
    /// Path of the file.
    pub file: PathBuf,
    /// Line of the file, counted from 1 (the header is a line too); of files without lines
    /// the row, counted from 1.
    pub line: Option<u64>,
    /// Row group of a Parquet file, counted from 1; none for files that have lines.
    pub row_group: Option<u32>,
    /// Name of the column.
    pub column: Option<String>,
    /// What is wrong.
    pub message: String,
    /// What to do about it.
    pub hint: String,
}

impl fmt::Display for DataError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        match (self.line, self.row_group) {
            (Some(row), Some(group)) => write!(f, ", row {row} (row group {group})")?,
            (Some(line), None) => write!(f, ", line {line}")?,
            (None, _) => {}
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
