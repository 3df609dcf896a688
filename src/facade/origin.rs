//! What a model was made from: its spec, its data, and where its motion starts.

use std::ffi::OsStr;
use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::data::{DataReport, Dataset, is_invisible};
use crate::expr::{Observed, System};

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

/// A file's name and digest.
pub(crate) fn digest(path: &Path, bytes: &[u8]) -> FileDigest {
    let name = file_name(path.file_name());
    FileDigest { name, sha256: format!("{:x}", Sha256::digest(bytes)) }
}

/// A file's name without its folder, as model files hold it: what cannot be seen is `\u{fffd}`.
fn file_name(name: Option<&OsStr>) -> String {
    let name = name.map(OsStr::to_string_lossy).unwrap_or_default();
    name.chars().map(|c| if is_visible(c) { c } else { '\u{fffd}' }).collect()
}

pub(super) fn is_visible(c: char) -> bool {
    !c.is_control() && !is_invisible(c)
}
