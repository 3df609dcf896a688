//! The model file: a learned model beside what it was made from.

use std::path::Path;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::checked::wrong_in_model;
use super::origin::Origin;
use crate::data::write_atomically;
use crate::dynamics::Method;
use crate::error::{Error, Result};
use crate::expr::System;
use crate::fit::model::{FORMAT, READ};
use crate::fit::{Law, Model};

/// The model file: the model and its origin side by side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ModelFile {
    #[serde(flatten)]
    pub model: Model,
    pub origin: Origin,
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
    if let Some(problem) = wrong_in_model(&file.model, &file.origin) {
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
