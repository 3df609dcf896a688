//! The model file: a learned model, and what it was made from.

use std::path::Path;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::checked::{file_name, wrong_in_model};
use crate::data::{DataReport, Dataset, write_atomically};
use crate::dynamics::Method;
use crate::error::{Error, Result};
use crate::expr::{Observed, System};
use crate::fit::model::{FORMAT, READ};
use crate::fit::{Law, Model};

/// What a model was made from and where its motion starts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Origin {
    pub spec: FileDigest,
    pub data: FileDigest,
    /// Largest |value| of each state component in the data (q, then p); 0 where unknown.
    pub ranges: Vec<f64>,
    /// Time and state (q, then p) of the first complete sample.
    pub start: Option<(f64, Vec<f64>)>,
}

/// A file's name, without its folder, and its SHA-256 in hexadecimal digits.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct FileDigest {
    pub name: String,
    pub sha256: String,
}

/// The model file: the model and its origin side by side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ModelFile {
    #[serde(flatten)]
    pub model: Model,
    pub origin: Origin,
}

/// Where a model comes from: the file and text of its spec, and its measurements.
pub(crate) fn origin(
    system: &System,
    (spec, text): (&Path, &str),
    dataset: &Dataset,
    about: &DataReport,
) -> Origin {
    let source = about.source.as_ref();
    let name = file_name(source.and_then(|s| s.file.file_name()));
    Origin {
        spec: digest(spec, text.as_bytes()),
        data: FileDigest { name, sha256: source.map_or_else(String::new, |s| s.sha256.clone()) },
        ranges: ranges(system, about),
        start: first_state(system, dataset),
    }
}

/// Largest |value| of each state component; 0 for momenta that were not measured.
pub(crate) fn ranges(system: &System, about: &DataReport) -> Vec<f64> {
    let n = system.degrees();
    let largest = about.columns.iter().enumerate().map(|(at, column)| {
        if at >= n && system.observed == Observed::Velocities {
            return 0.0;
        }
        let ends = [column.minimum, column.maximum];
        ends.into_iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()))
    });
    largest.collect()
}

fn first_state(system: &System, dataset: &Dataset) -> Option<(f64, Vec<f64>)> {
    if system.observed == Observed::Velocities {
        return None;
    }
    dataset.runs.iter().find_map(|run| {
        (0..run.times.len()).find_map(|at| {
            let state: Vec<f64> = run.values.iter().filter_map(|c| c.get(at).copied()).collect();
            let complete =
                state.len() == 2 * system.degrees() && state.iter().all(|x| x.is_finite());
            complete.then(|| (run.time(at), state))
        })
    })
}

/// Writes a model file, whole or not at all.
pub(crate) fn write(path: &Path, file: &ModelFile) -> Result<()> {
    let mut bytes = serde_json::to_vec_pretty(file)
        .map_err(|error| Error::file("write", path, std::io::Error::other(error)))?;
    bytes.push(b'\n');
    write_atomically(path, &bytes)
}

/// Reads a model file that belongs to a system; `spec` is what errors call its spec, and `again`
/// how to fit it.
///
/// # Errors
/// There is no such file, it is damaged, or it belongs to another spec.
pub(crate) fn read(
    path: &Path,
    spec: &str,
    system: &Arc<System>,
    again: &str,
) -> Result<(Law, ModelFile)> {
    let wrong = |message: String, hint: String| Error::model(path, message, hint);
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            let message = "there is no model yet".to_string();
            return Err(wrong(message, format!("{again} first")));
        }
        Err(error) => return Err(Error::file("read", path, error)),
    };
    parse(path, &bytes, spec, system, again)
}

/// The same from the bytes of a file; `path` is what errors call it.
///
/// # Errors
/// As [`read`].
pub(crate) fn parse(
    path: &Path,
    bytes: &[u8],
    spec: &str,
    system: &Arc<System>,
    again: &str,
) -> Result<(Law, ModelFile)> {
    let wrong = |message: String, hint: String| Error::model(path, message, hint);
    let value: serde_json::Value = serde_json::from_slice(bytes).map_err(|error| {
        let what = if error.is_eof() { "the file is cut off" } else { "this is not a model file" };
        wrong(format!("{what} ({error})"), format!("{again} to write it anew"))
    })?;
    match value.get("format").and_then(|format| format.as_str()) {
        Some(known) if READ.contains(&known) => {}
        Some(other) => {
            let message = format!("its format is `{other}`, but this version reads `{FORMAT}`");
            return Err(wrong(message, format!("{again} to write it anew")));
        }
        None => {
            let message = "this is not a model file".to_string();
            return Err(wrong(message, format!("{again} to write one")));
        }
    }
    let mut file: ModelFile = serde_json::from_value(value).map_err(|error| {
        wrong(format!("the file is damaged ({error})"), format!("{again} to write it anew"))
    })?;
    file.model.format = FORMAT.to_string();
    if let Some(problem) = wrong_in_model(&file) {
        let message = format!("the file is damaged: {problem}");
        return Err(wrong(message, format!("{again} to write it anew")));
    }
    let other = format!(
        "this model was fitted to another spec (`{}`, or {} before it was edited)",
        file.model.system, spec
    );
    let method = &file.model.integrator.method;
    if Method::by_name(method).is_none() {
        let message = format!("the model was fitted with an unknown integrator `{method}`");
        return Err(wrong(message, format!("{again} to write it anew")));
    }
    let law = file.model.law(system).ok_or_else(|| wrong(other, format!("{again} again")))?;
    Ok((law, file))
}

/// A file's name and digest.
pub(crate) fn digest(path: &Path, bytes: &[u8]) -> FileDigest {
    let name = file_name(path.file_name());
    FileDigest { name, sha256: format!("{:x}", Sha256::digest(bytes)) }
}
