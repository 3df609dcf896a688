//! Writing files whole or not at all, and data sets as CSV.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::beside::TemporaryFile;
use super::cell::format_number;
use super::table::wrong;
use super::{Dataset, Run};
use crate::error::{Error, ErrorKind, Result};

/// How a data set is laid out in a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Header of the run column, which comes first; none when there is only one run.
    pub run: Option<String>,
    /// Name of the time column.
    pub time: String,
    /// Unit of time for the header.
    pub time_unit: Option<String>,
    /// Unit of each observable for the header; may be shorter than the observables.
    pub units: Vec<Option<String>>,
}

impl Default for Layout {
    /// Columns `run`, `t` and the observables, without units.
    fn default() -> Self {
        Layout {
            run: Some("run".to_string()),
            time: "t".to_string(),
            time_unit: None,
            units: Vec::new(),
        }
    }
}

/// A data set as CSV: one row per sample, every number with as many digits as it takes to
/// read the same bits back, and empty cells where nothing was measured.
///
/// # Errors
/// A time or value is infinite, or there are several runs and no run column. The `path` is
/// what such errors call the file.
pub fn to_csv(path: &Path, data: &Dataset, layout: &Layout) -> Result<Vec<u8>> {
    check_runs(layout, data.runs.len())?;
    // A line must not begin with the mark of a comment.
    let comment = |name: &str| name.starts_with(['#', '%']);
    let quoted = data.runs.iter().any(|run| comment(&run.name));
    let mut writer = csv::WriterBuilder::new()
        .quote_style(if quoted { csv::QuoteStyle::NonNumeric } else { csv::QuoteStyle::Necessary })
        .from_writer(Vec::new());
    let unwritable =
        |error: csv::Error| Error::file("write", path, std::io::Error::other(error.to_string()));
    let header = headers(&data.observables, layout);
    writer.write_record(&header).map_err(unwritable)?;
    let mut line: u64 = 1;
    let mut record: Vec<String> = Vec::with_capacity(header.len());
    for run in &data.runs {
        check_finite(path, run, line + 1, layout, &data.observables)?;
        line += run.times.len() as u64;
        for (sample, since) in run.times.iter().enumerate() {
            record.clear();
            record.extend(layout.run.iter().map(|_| run.name.clone()));
            record.push(format_number(run.clock.time(*since)));
            record.extend(run.values.iter().map(|column| {
                column.get(sample).map_or(String::new(), |value| format_number(*value))
            }));
            writer.write_record(&record).map_err(unwritable)?;
        }
    }
    writer.into_inner().map_err(|error| {
        Error::file("write", path, std::io::Error::other(error.error().to_string()))
    })
}

/// Several runs need a column that tells them apart.
pub(super) fn check_runs(layout: &Layout, runs: usize) -> Result<()> {
    if layout.run.is_none() && runs > 1 {
        return Err(Error::new(
            ErrorKind::InvalidArgument,
            format!("{runs} runs need a run column to be written to one file"),
            "name a run column, or write one run",
        ));
    }
    Ok(())
}

/// Whether every number of a run can stand in a file; its first sample is on line `first`.
pub(super) fn check_finite(
    path: &Path,
    run: &Run,
    first: u64,
    layout: &Layout,
    observables: &[String],
) -> Result<()> {
    let columns = std::iter::once(&run.times).chain(&run.values);
    let names = std::iter::once(&layout.time).chain(observables);
    for (column, name) in columns.zip(names) {
        if let Some(sample) = column.iter().position(|x| x.is_infinite()) {
            let time = run.time(sample);
            return Err(wrong(
                path,
                Some(first + sample as u64),
                Some(name),
                format!("the value of run {} at time {time} is infinite", run.name),
                "a file of measurements has finite numbers only; nothing was written",
            ));
        }
    }
    Ok(())
}

/// The headers of the file: run, time, observables, with their units.
pub(super) fn headers(observables: &[String], layout: &Layout) -> Vec<String> {
    let with_unit = |name: &str, unit: Option<&String>| match unit {
        Some(unit) => format!("{name} [{unit}]"),
        None => name.to_string(),
    };
    let mut headers: Vec<String> = layout.run.iter().cloned().collect();
    headers.push(with_unit(&layout.time, layout.time_unit.as_ref()));
    for (at, name) in observables.iter().enumerate() {
        headers.push(with_unit(name, layout.units.get(at).and_then(Option::as_ref)));
    }
    headers
}

/// Writes a data set as CSV, whole or not at all.
///
/// # Errors
/// As [`to_csv`] and [`write_atomically`].
pub fn write_csv(path: &Path, data: &Dataset, layout: &Layout) -> Result<()> {
    write_atomically(path, &to_csv(path, data, layout)?)
}

/// Writes a file whole or not at all: into a temporary file beside it, which then takes its
/// name. A file that was there keeps its permissions, and a link keeps pointing to it.
/// What is not a regular file (a terminal, a pipe) is written directly.
///
/// # Errors
/// The folder does not exist or cannot be written, or the disk is full.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    let failed = |error| Error::file("write", path, error);
    // Through a link to the file itself; a file that does not exist yet is its own target.
    let target = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let old = std::fs::metadata(&target).ok();
    if let Some(old) = &old {
        if old.is_dir() {
            return Err(failed(std::io::Error::other("it is a folder")));
        }
        if old.permissions().readonly() {
            return Err(failed(std::io::Error::other("it is read-only")));
        }
        if !old.is_file() {
            return std::fs::OpenOptions::new()
                .write(true)
                .open(&target)
                .and_then(|mut file| file.write_all(bytes).and_then(|()| file.flush()))
                .map_err(failed);
        }
    }
    let folder = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
        _ => PathBuf::from("."),
    };
    if !folder.is_dir() {
        let message = format!("there is no folder {}", folder.display());
        return Err(failed(std::io::Error::other(message)));
    }
    let mut beside = TemporaryFile::create(&folder).map_err(failed)?;
    beside.file.write_all(bytes).and_then(|()| beside.file.sync_all()).map_err(failed)?;
    if let Some(old) = old {
        beside.file.set_permissions(old.permissions()).map_err(failed)?;
    }
    beside.rename(&target).map_err(failed)
}
