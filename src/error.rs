//! The one error type of the crate. It reads as a sentence and says what to do; its kind is for
//! programs.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::diagnostic::Diagnostic;

/// What a function of this crate returns that can fail.
///
/// ```
/// fn terms(text: &str) -> leverrier::Result<usize> {
///     Ok(leverrier::Spec::parse(text)?.terms().len())
/// }
///
/// assert_eq!(terms("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2, q^4 }")?, 2);
/// # Ok::<(), leverrier::Error>(())
/// ```
pub type Result<T> = std::result::Result<T, Error>;

/// Whatever can go wrong between a user's files and a result.
///
/// For people it is a sentence with its remedy ([`Display`](fmt::Display)); for programs there
/// is [`kind`](Error::kind), and in some variants the place.
///
/// ```
/// use leverrier::{Error, ErrorKind};
///
/// let error = Error::new(ErrorKind::InvalidArgument, "noise must be zero or more", "give 0.01");
/// assert_eq!(error.to_string(), "noise must be zero or more; give 0.01");
/// assert_eq!(error.kind(), ErrorKind::InvalidArgument);
/// assert_eq!(error.hint(), Some("give 0.01"));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
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
    /// The user stopped it before there was anything to keep.
    #[error("stopped before there was a result to keep; start the command again to go on")]
    Interrupted,
    /// What was asked for cannot be done, for the reason that `kind` names.
    #[error("{}{message}; {hint}", place(path))]
    Refused {
        /// Which case it is.
        kind: ErrorKind,
        /// The file that it is about, where it is about one.
        path: Option<PathBuf>,
        /// What is wrong.
        message: String,
        /// What to do about it.
        hint: String,
    },
}

/// What went wrong, for programs: the cases that a caller may want to treat differently.
///
/// ```
/// use leverrier::ErrorKind;
///
/// # fn fit() -> leverrier::Result<f64> {
/// #     Err(leverrier::Error::new(ErrorKind::InsufficientData, "too few", "measure more"))
/// # }
/// match fit() {
///     Ok(coefficient) => println!("{coefficient}"),
///     Err(error) if error.kind() == ErrorKind::InsufficientData => println!("measure longer"),
///     Err(error) => eprintln!("{error}"),
/// }
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorKind {
    /// The text of a spec is wrong.
    Spec,
    /// A data file cannot be used as it is.
    Data,
    /// A model or ledger is damaged, of another version, or belongs to another spec.
    Model,
    /// The operating system refused to read, write or create a file.
    File,
    /// The user stopped it.
    Interrupted,
    /// The command line is wrong.
    Usage,
    /// A name (of an effect, a coefficient, a component of the state, a format) that is not known.
    UnknownName,
    /// A name that fits several things.
    Ambiguous,
    /// A value out of its range, or values that do not go together.
    InvalidArgument,
    /// Something that exists but does not apply to this system, such as an effect or a method.
    NotApplicable,
    /// The measurements do not suffice for what is asked.
    InsufficientData,
    /// What is asked cannot be known from these measurements, however many there are.
    NotIdentifiable,
    /// A search ended without a result: no model, no run worth measuring.
    NothingFound,
    /// There is nothing to do: it is done already, or there is nothing to undo.
    NothingToDo,
    /// The spec does not say where its measurements are, and no file was given.
    DataNotNamed,
    /// A trajectory leaves the finite numbers.
    NotFinite,
    /// A law has no Taylor series there, or none that can be followed.
    TaylorSeries,
    /// No initial states of the wanted energies were found.
    EnergyRange,
    /// The work takes more memory than is allowed.
    MemoryLimit,
    /// A file or folder stands where something would be written.
    AlreadyExists,
    /// A file was changed by somebody else since it was read or written here.
    ChangedMeanwhile,
    /// It belongs to a feature of this crate that is not switched on.
    NotBuiltIn,
    /// A model cannot be written in a format, or a figure cannot be drawn.
    Export,
    /// What is asked for is still being worked on.
    NotReady,
    /// A place where the program must not read or write.
    Forbidden,
    /// The threads that were asked for cannot be started.
    Threads,
    /// A network port of this machine cannot be used.
    Port,
    /// The operating system lacks something else that is needed.
    System,
    /// A fault of this crate, worth a report.
    Internal,
}

impl Error {
    /// The operating system refused `action` ("read", "write", "create") on `path`.
    pub(crate) fn file(action: &'static str, path: &Path, source: std::io::Error) -> Self {
        Error::File { action, path: path.to_path_buf(), source }
    }

    /// What was asked for cannot be done: what is wrong, and what to do.
    ///
    /// ```
    /// use leverrier::{Error, ErrorKind};
    ///
    /// let error = Error::new(ErrorKind::InvalidArgument, "the mass is negative", "give 0.2");
    /// assert_eq!(error.to_string(), "the mass is negative; give 0.2");
    /// ```
    pub fn new(kind: ErrorKind, message: impl Into<String>, hint: impl Into<String>) -> Self {
        Error::Refused { kind, path: None, message: message.into(), hint: hint.into() }
    }

    /// A model or ledger cannot be used: its path, what is wrong, and what to do.
    pub(crate) fn model(path: &Path, message: impl Into<String>, hint: impl Into<String>) -> Self {
        let (message, hint) = (message.into(), hint.into());
        Error::Refused { kind: ErrorKind::Model, path: Some(path.to_path_buf()), message, hint }
    }

    /// What went wrong, for programs.
    ///
    /// ```
    /// use leverrier::{ErrorKind, Spec};
    ///
    /// assert_eq!(Spec::open("nowhere.ham").unwrap_err().kind(), ErrorKind::File);
    /// assert_eq!(Spec::parse("V = foo").unwrap_err().kind(), ErrorKind::Spec);
    /// ```
    pub fn kind(&self) -> ErrorKind {
        match self {
            Error::Spec { .. } => ErrorKind::Spec,
            Error::Data(_) => ErrorKind::Data,
            Error::File { .. } => ErrorKind::File,
            Error::Interrupted => ErrorKind::Interrupted,
            Error::Refused { kind, .. } => *kind,
        }
    }

    /// What to do about it, where that stands apart from what is wrong.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = q^2")?;
    /// let error = spec.without("viscous_drag(q)").unwrap_err();
    /// assert!(error.hint().is_some_and(|hint| hint.starts_with("name one of its")));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn hint(&self) -> Option<&str> {
        match self {
            Error::Data(error) => Some(&error.hint),
            Error::Refused { hint, .. } => Some(hint),
            Error::Spec { diagnostics, .. } => diagnostics.first()?.hint.as_deref(),
            Error::File { .. } | Error::Interrupted => None,
        }
    }

    /// The messages about a spec, in the order of its text; none for other errors.
    ///
    /// ```
    /// use leverrier::Spec;
    ///
    /// assert!(!Spec::parse("V = foo").unwrap_err().diagnostics().is_empty());
    /// assert!(Spec::open("nowhere.ham").unwrap_err().diagnostics().is_empty());
    /// ```
    pub fn diagnostics(&self) -> &[Diagnostic] {
        match self {
            Error::Spec { diagnostics, .. } => diagnostics,
            _ => &[],
        }
    }

    /// Adds to its hint in parentheses, such as how the remedy is spelt where the user is.
    pub(crate) fn with_remedy(mut self, remedy: &str) -> Self {
        if let Error::Refused { hint, .. } = &mut self {
            hint.push_str(&format!(" ({remedy})"));
        }
        self
    }
}

/// What is wrong with a data file, and where.
///
/// ```
/// use leverrier::{Data, Error, Spec};
///
/// let spec = Spec::parse("coordinates x; momenta px\nT = px^2/2\nV = span{ x^2 }")?;
/// if let Err(Error::Data(error)) = Data::open("examples/damped-pendulum/swings.csv", &spec) {
///     println!("{}: {}; {}", error.file.display(), error.message, error.hint);
/// }
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct DataError {
    /// Path of the file; empty for a table in memory.
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
        let in_memory = self.file.as_os_str().is_empty();
        match in_memory {
            true => f.write_str("the table")?,
            false => write!(f, "{}", self.file.display())?,
        }
        match (self.line, self.row_group) {
            (Some(row), Some(group)) => write!(f, ", row {row} (row group {group})")?,
            (Some(row), None) if in_memory => write!(f, ", row {row}")?,
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

fn place(path: &Option<PathBuf>) -> String {
    path.as_ref().map_or_else(String::new, |path| format!("{}: ", path.display()))
}
