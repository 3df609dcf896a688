//! A spec with its data and its model file, as they lie in a folder.

pub mod asked;
pub mod bench;
pub mod checked;
pub mod learned;
pub mod ledger;
pub mod lock;
pub mod measurements;
pub mod memory;
pub mod page;
pub mod revise;
pub mod undo;
pub mod written;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use self::measurements::whole_or_sample;
use crate::data::{
    self, Cells, Column, ColumnMap, DataReport, Dataset, FileSource, Mapping, ObservableMap, Table,
};
use crate::diagnose::context::foreign;
use crate::diagnostic::Diagnostic;
use crate::dynamics::Method;
use crate::error::{Error, ErrorKind, Result};
use crate::expr::{self, Compiled, System};
use crate::fit::model::FORMAT;
use crate::fit::{Law, Model};

/// Rows that show what the columns of a large file hold.
const HEAD: usize = 10_000;

/// Larger files than this are not specs.
const LARGEST_SPEC: u64 = 16 << 20;

/// Whoever wants to hear what is worth knowing beside a result.
pub trait Listener {
    /// Warnings and notes about the text of a spec.
    fn diagnostics(&self, name: &str, text: &str, diagnostics: &[Diagnostic]);

    /// A warning, about the data for one.
    fn warning(&self, text: &str);
}

/// A spec that was read and compiled.
pub struct Project {
    pub path: PathBuf,
    pub text: String,
    pub compiled: Compiled,
}

/// What a model was made from and where its motion starts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    pub spec: FileDigest,
    pub data: FileDigest,
    /// Largest |value| of each state component in the data (q, then p); 0 where unknown.
    pub ranges: Vec<f64>,
    /// Time and state (q, then p) of the first complete sample.
    pub start: Option<(f64, Vec<f64>)>,
}

/// A file's name, without its folder, and its SHA-256 in hexadecimal digits.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileDigest {
    pub name: String,
    pub sha256: String,
}

/// The model file: the model and its origin side by side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelFile {
    #[serde(flatten)]
    pub model: Model,
    pub origin: Origin,
}

/// The law of a spec, learned or known from the start, with the file that it was read from.
pub struct ProjectLaw {
    pub law: Law,
    /// `None` for a fully known system.
    pub file: Option<ModelFile>,
}

impl ProjectLaw {
    /// Largest |value| of each state component in the data that it was learned from.
    pub fn ranges(&self) -> &[f64] {
        self.file.as_ref().map_or(&[], |file| &file.origin.ranges)
    }
}

impl Project {
    /// Reads and compiles a spec.
    ///
    /// # Errors
    /// The file cannot be read or is not text, or everything that is wrong with the spec.
    pub fn open(path: &Path) -> Result<Self> {
        let failed = |error| Error::file("read", path, explained(error, NO_SPEC));
        let about = std::fs::metadata(path).map_err(failed)?;
        if about.is_dir() {
            return Err(failed(std::io::Error::other("it is a folder; name the spec in it")));
        }
        if about.len() > LARGEST_SPEC {
            let message = format!("it has {} MB and is no spec", about.len() >> 20);
            return Err(failed(std::io::Error::other(message)));
        }
        let bytes = std::fs::read(path).map_err(failed)?;
        let text = String::from_utf8(bytes).map_err(|_| {
            failed(std::io::Error::other("it is not a text file in UTF-8; a spec is plain text"))
        })?;
        let name = path.display().to_string();
        let compiled = expr::build(&name, &text)?;
        Ok(Project { path: path.to_path_buf(), text, compiled })
    }

    pub fn name(&self) -> String {
        self.path.display().to_string()
    }

    pub fn system(&self) -> &Arc<System> {
        &self.compiled.system
    }

    /// `pendulum.ham` has its model in `pendulum.model.json`.
    pub fn model_path(&self) -> PathBuf {
        self.path.with_extension("model.json")
    }

    /// The file of measurements: the one asked for, or the spec's.
    pub fn data_path(&self, asked: Option<&Path>) -> Result<PathBuf> {
        if let Some(path) = asked {
            return Ok(path.to_path_buf());
        }
        let Some(data) = &self.compiled.data else {
            return Err(Error::new(
                ErrorKind::DataNotNamed,
                format!("{} does not name its data", self.name()),
                "write `data \"file.csv\" { time t }` in it, or give a file",
            ));
        };
        let folder = self.path.parent().unwrap_or(Path::new(""));
        Ok(folder.join(&data.file))
    }

    /// Reads the measurements as the spec says; a sample of them if they do not fit in memory.
    pub fn data(&self, asked: Option<&Path>) -> Result<(Dataset, DataReport)> {
        whole_or_sample(self, asked)
    }

    /// Reads all measurements as the spec says.
    pub fn read(&self, asked: Option<&Path>) -> Result<(Dataset, DataReport)> {
        let path = self.data_path(asked)?;
        let mut table = data::read(&path).map_err(|error| not_there(error, &path))?;
        let mut mapping = self.mapping(&table)?;
        if self.pairs() {
            mapping.run = Some(number_pairs(&mut table, mapping.run.as_deref())?);
        }
        data::dataset(&table, &mapping)
    }

    /// The measurements as a source that is read anew in every pass.
    pub fn source(&self, asked: Option<&Path>) -> Result<FileSource> {
        let path = self.data_path(asked)?;
        let head = data::head(&path, HEAD).map_err(|error| not_there(error, &path))?;
        FileSource::new(&path, &self.mapping(&head)?, self.pairs())
    }

    /// Whether every two rows are one run.
    fn pairs(&self) -> bool {
        self.compiled.data.as_ref().is_some_and(|columns| columns.pairs)
    }

    fn mapping(&self, table: &Table) -> Result<Mapping> {
        let columns = self.compiled.data.as_ref();
        let mut mapping = Mapping {
            time: columns.and_then(|c| c.time.as_ref()).map(|time| ColumnMap {
                column: time.column.clone(),
                scale: time.scale,
                offset: 0.0,
            }),
            run: columns.and_then(|c| c.run.clone()),
            observables: Vec::new(),
        };
        let observed =
            columns.map_or_else(|| self.system().observed_columns(), |c| c.observables.clone());
        // Coordinates alone will do. But a momentum that is named, of which there are others, or
        // that a column left over may hold under another name, is missed.
        let degrees = self.system().degrees();
        let second = observed.get(degrees..).unwrap_or(&[]);
        let usual = self.system().observed_columns();
        let mut missed = second.iter().any(|column| !usual.contains(column));
        for name in second.iter().flat_map(|column| &column.candidates) {
            missed |= table.find(name)?.is_some();
        }
        let first = observed.iter().take(degrees).flat_map(|column| &column.candidates);
        let mut taken: Vec<&str> = first.map(String::as_str).collect();
        taken.extend(mapping.run.as_deref());
        match &mapping.time {
            Some(time) => taken.push(&time.column),
            None => taken.extend(data::TIME_NAMES),
        }
        let mut held = Vec::new();
        for name in taken {
            held.extend(table.find(name)?.map(|column| column.header.clone()));
        }
        missed |= table.columns.iter().any(|c| !held.contains(&c.header) && table.is_numeric(c));
        mapping.observables = observed
            .into_iter()
            .enumerate()
            .map(|(row, column)| ObservableMap {
                name: column.name,
                columns: column.candidates,
                scale: column.scale,
                offset: 0.0,
                required: missed || row < degrees,
            })
            .collect();
        Ok(mapping)
    }

    /// The fitted model beside the spec, or the spec's own numbers when it is fully known.
    pub fn law(&self, asked: Option<&Path>) -> Result<ProjectLaw> {
        let system = self.system();
        let path = asked.map_or_else(|| self.model_path(), Path::to_path_buf);
        let fully_known = system.terms.is_empty();
        if asked.is_none() && fully_known && (system.parameters.is_empty() || !path.exists()) {
            // A fit of it knows the noise. It is not asked for: the law stands in the spec.
            let fitted = std::fs::read(&path).ok();
            let file = fitted
                .and_then(|bytes| serde_json::from_slice::<ModelFile>(&bytes).ok())
                .filter(|file| checked::wrong_in_model(file).is_none())
                .filter(|file| file.model.law(system).is_some());
            return Ok(ProjectLaw { law: Law::known(system.clone())?, file });
        }
        let again = format!("run `leverrier fit {}`", self.name());
        let wrong = |message: String, hint: String| Error::model(&path, message, hint);
        let bytes = match std::fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                let message = "there is no model yet".to_string();
                return Err(wrong(message, format!("{again} first")));
            }
            Err(error) => return Err(Error::file("read", &path, error)),
        };
        let value: serde_json::Value = serde_json::from_slice(&bytes).map_err(|error| {
            let what =
                if error.is_eof() { "the file is cut off" } else { "this is not a model file" };
            wrong(format!("{what} ({error})"), format!("{again} to write it anew"))
        })?;
        match value.get("format").and_then(|format| format.as_str()) {
            Some(FORMAT) => {}
            Some(other) => {
                let message = format!("its format is `{other}`, but this version reads `{FORMAT}`");
                return Err(wrong(message, format!("{again} to write it anew")));
            }
            None => {
                let message = "this is not a model file".to_string();
                return Err(wrong(message, format!("{again} to write one")));
            }
        }
        let file: ModelFile = serde_json::from_value(value).map_err(|error| {
            wrong(format!("the file is damaged ({error})"), format!("{again} to write it anew"))
        })?;
        if let Some(problem) = checked::wrong_in_model(&file) {
            let message = format!("the file is damaged: {problem}");
            return Err(wrong(message, format!("{again} to write it anew")));
        }
        let other = format!(
            "this model was fitted to another spec (`{}`, or {} before it was edited)",
            file.model.system,
            self.name()
        );
        let method = &file.model.integrator.method;
        if Method::by_name(method).is_none() {
            let message = format!("the model was fitted with an unknown integrator `{method}`");
            return Err(wrong(message, format!("{again} to write it anew")));
        }
        self.law_of(file).ok_or_else(|| wrong(other, format!("{again} again")))
    }

    /// The law of a model that was learned for this spec.
    ///
    /// # Errors
    /// The model belongs to another spec.
    pub fn learned(&self, model: &Model) -> Result<Law> {
        model.law(self.system()).ok_or_else(foreign)
    }

    /// The law that a model says; none when it belongs to another spec.
    pub fn law_of(&self, file: ModelFile) -> Option<ProjectLaw> {
        Some(ProjectLaw { law: file.model.law(self.system())?, file: Some(file) })
    }
}

/// Adds a column that numbers the pairs: every two rows (of one run) are one.
fn number_pairs(table: &mut Table, run: Option<&str>) -> Result<String> {
    let runs = match run {
        Some(name) => table.find(name)?.map(|column| column.cells.clone()),
        None => None,
    };
    if table.rows() % 2 == 1 {
        return Err(table.error(
            table.lines.last().copied(),
            None,
            format!("there are {} rows, but pairs need an even number", table.rows()),
            "the last row has no partner: add it, or remove the row",
        ));
    }
    let cells: Cells = (0..table.rows())
        .map(|row| match &runs {
            Some(runs) => format!("{}/{}", runs.get(row - row % 2), row / 2 + 1),
            None => format!("{}", row / 2 + 1),
        })
        .collect();
    let mut name = "pair".to_string();
    while table.find(&name)?.is_some() {
        name.push('_');
    }
    table.columns.push(Column { name: name.clone(), header: name.clone(), unit: None, cells });
    Ok(name)
}

const NO_SPEC: &str = "there is no such file; `leverrier new DATA.csv` writes a first spec";
const NO_DATA: &str = "there is no such file; the spec's `data` line names it, as seen from the \
                       spec's folder, or give another file";

fn not_there(error: Error, path: &Path) -> Error {
    match error {
        Error::File { source, .. } => Error::file("read", path, explained(source, NO_DATA)),
        other => other,
    }
}

/// Says what to do about a file that is not there.
fn explained(error: std::io::Error, advice: &str) -> std::io::Error {
    match error.kind() {
        std::io::ErrorKind::NotFound => std::io::Error::new(error.kind(), advice.to_string()),
        _ => error,
    }
}

/// A file's name and digest.
pub fn digest(path: &Path, bytes: &[u8]) -> FileDigest {
    let name = checked::file_name(path.file_name());
    FileDigest { name, sha256: format!("{:x}", Sha256::digest(bytes)) }
}

/// Refuses to overwrite a file unless that is asked for.
pub fn refuse_overwrite(path: &Path, force: bool) -> Result<()> {
    if force || !path.exists() {
        return Ok(());
    }
    // Terminals, pipes and the like are there to be written to.
    if std::fs::metadata(path).is_ok_and(|about| !about.is_file() && !about.is_dir()) {
        return Ok(());
    }
    Err(Error::new(
        ErrorKind::AlreadyExists,
        format!("{} exists", path.display()),
        "overwrite it deliberately, or choose another name",
    ))
}
