//! Learning from a folder's files, and the model file that comes of it.

use std::path::Path;
use std::sync::Arc;

use super::{FileDigest, ModelFile, Origin, Project, checked, digest};
use crate::data::{DataReport, Dataset, write_atomically};
use crate::error::{Error, ErrorKind, Result};
use crate::expr::{Observed, System};
use crate::fit::{self, Model, Monitor, Options};

/// Fits on the given number of threads.
pub fn learn(
    system: &Arc<System>,
    dataset: &Dataset,
    options: &Options,
    threads: Option<usize>,
    monitor: &dyn Monitor,
) -> Result<Model> {
    on_threads(threads, || fit::fit(system, dataset, options, monitor))
}

/// Does the work on the given number of threads; on all cores by default.
pub fn on_threads<T: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<T> + Send,
) -> Result<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build().map_err(
        |error| {
            Error::new(
                ErrorKind::Threads,
                format!("cannot start the threads: {error}"),
                "ask for fewer",
            )
        },
    )?;
    pool.install(work)
}

/// Where a model comes from.
pub fn origin(project: &Project, dataset: &Dataset, about: &DataReport) -> Origin {
    let source = about.source.as_ref();
    let name = checked::file_name(source.and_then(|s| s.file.file_name()));
    Origin {
        spec: digest(&project.path, project.text.as_bytes()),
        data: FileDigest { name, sha256: source.map_or_else(String::new, |s| s.sha256.clone()) },
        ranges: ranges(project.system(), about),
        start: first_state(project.system(), dataset),
    }
}

/// Largest |value| of each state component; 0 for momenta that were not measured.
pub fn ranges(system: &System, about: &DataReport) -> Vec<f64> {
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
            complete.then(|| (run.times[at], state))
        })
    })
}

/// Writes a model file, whole or not at all.
pub fn write_model(path: &Path, file: &ModelFile) -> Result<()> {
    let mut bytes = serde_json::to_vec_pretty(file)
        .map_err(|error| Error::file("write", path, std::io::Error::other(error)))?;
    bytes.push(b'\n');
    write_atomically(path, &bytes)
}
