//! A spec with its data and its model file, as they lie in a folder: what the commands and the
//! studio work on.

pub(crate) mod fitting;
pub(crate) mod ledger;
pub(crate) mod lock;
pub(crate) mod measurements;
pub(crate) mod memory;
pub(crate) mod page;
pub(crate) mod revise;
pub(crate) mod undo;
pub(crate) mod workspace;

use std::path::{Path, PathBuf};

use self::measurements::whole_or_sample;
use crate::data::{DataReport, Dataset, FileSource};
use crate::diagnostic::Diagnostic;
use crate::error::{Error, ErrorKind, Result};
use crate::facade::checked::wrong_in_model;
pub(crate) use crate::facade::measured::read_inputs;
pub(crate) use crate::facade::model_file::ModelFile;
pub(crate) use crate::facade::origin::digest;
pub(crate) use crate::facade::{Law, Spec};
use crate::facade::{measured, model_file};
use crate::fit::{self, Model};

/// Whoever wants to hear what is worth knowing beside a result.
pub(crate) trait Listener {
    /// Warnings and notes about the text of a spec.
    fn diagnostics(&self, name: &str, text: &str, diagnostics: &[Diagnostic]);

    /// A warning, about the data for one.
    fn warning(&self, text: &str);
}

/// What lies in the folder of a spec that was read from a file.
impl Spec {
    /// `pendulum.ham` has its model in `pendulum.model.json`.
    pub(crate) fn model_path(&self) -> PathBuf {
        self.file().with_extension("model.json")
    }

    /// The measurements as the spec says; a sample of them if they do not fit in memory.
    pub(crate) fn measurements(&self, asked: Option<&Path>) -> Result<(Dataset, DataReport)> {
        whole_or_sample(self, asked)
    }

    /// All measurements as the spec says.
    pub(crate) fn read(&self, asked: Option<&Path>) -> Result<(Dataset, DataReport)> {
        measured::read(self.compiled(), &self.named(asked)?)
    }

    /// The measurements as a source that is read anew in every pass.
    pub(crate) fn source(&self, asked: Option<&Path>) -> Result<FileSource> {
        measured::source(self.compiled(), &self.named(asked)?)
    }

    /// The fitted model beside the spec, or the spec's own numbers when it is fully known.
    pub(crate) fn law(&self, asked: Option<&Path>) -> Result<Law> {
        let system = self.system();
        let path = asked.map_or_else(|| self.model_path(), Path::to_path_buf);
        let fully_known = system.terms.is_empty();
        if asked.is_none() && fully_known && (system.parameters.is_empty() || !path.exists()) {
            // A fit of it knows the noise. It is not asked for: the law stands in the spec.
            let fitted = std::fs::read(&path).ok();
            let file = fitted
                .and_then(|bytes| serde_json::from_slice::<ModelFile>(&bytes).ok())
                .filter(|file| wrong_in_model(&file.model, &file.origin).is_none())
                .filter(|file| file.model.law(system).is_some());
            return Ok(Law::of(self, fit::Law::known(system.clone())?, file));
        }
        let again = format!("run `leverrier fit {}`", self.name());
        let (numbers, file) = model_file::read(&path, self.name(), system, &again)?;
        Ok(Law::of(self, numbers, Some(file)))
    }

    /// The numbers of a model that was learned for this spec.
    ///
    /// # Errors
    /// The model belongs to another spec.
    pub(crate) fn learned(&self, model: &Model) -> Result<fit::Law> {
        model.law_of(self.system())
    }

    /// The law that a model says; none when it belongs to another spec.
    pub(crate) fn law_of(&self, file: ModelFile) -> Option<Law> {
        Some(Law::of(self, file.model.law(self.system())?, Some(file)))
    }
}

/// Refuses to overwrite a file unless that is asked for.
pub(crate) fn refuse_overwrite(path: &Path, force: bool) -> Result<()> {
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
