//! A spec with its data and its model file, as they lie in a folder.

pub mod bench;
pub mod exporting;
pub mod fitting;
pub mod ledger;
pub mod lock;
pub mod measurements;
pub mod memory;
pub mod page;
pub mod revise;
pub mod undo;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use self::measurements::whole_or_sample;
use crate::data::{DataReport, Dataset, FileSource};
use crate::diagnose::context::foreign;
use crate::diagnostic::Diagnostic;
use crate::error::{Error, ErrorKind, Result};
use crate::expr::{self, Compiled, System};
use crate::facade::checked::wrong_in_model;
pub use crate::facade::model_file::{ModelFile, digest};
use crate::facade::{measured, model_file};
use crate::fit::{Law, Model};

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
        let text = measured::spec_text(path)?;
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
        measured::read(&self.compiled, &self.data_path(asked)?)
    }

    /// The measurements as a source that is read anew in every pass.
    pub fn source(&self, asked: Option<&Path>) -> Result<FileSource> {
        measured::source(&self.compiled, &self.data_path(asked)?)
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
                .filter(|file| wrong_in_model(file).is_none())
                .filter(|file| file.model.law(system).is_some());
            return Ok(ProjectLaw { law: Law::known(system.clone())?, file });
        }
        let again = format!("run `leverrier fit {}`", self.name());
        let (law, file) = model_file::read(&path, &self.name(), system, &again)?;
        Ok(ProjectLaw { law, file: Some(file) })
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
