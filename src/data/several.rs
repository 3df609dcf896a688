//! Measurements from several files, put together.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::Dataset;
use super::mapping::{Mapping, observable_column, time_column};
use super::quality::Suspicion;
use super::report::{DataReport, FileReport};
use super::select::without_copies;
use super::table::{Column, Table, wrong};
use super::unit_words::known_unit;
use crate::error::Result;

/// What the columns of a file were taken for.
#[derive(Debug, Clone)]
pub struct TakenColumns {
    file: PathBuf,
    /// What for, and the header and unit of the column, where there is one.
    columns: Vec<(String, Option<HeaderAndUnit>)>,
}

type HeaderAndUnit = (String, Option<String>);

impl TakenColumns {
    /// Of a table, by a mapping.
    pub fn of(table: &Table, mapping: &Mapping) -> TakenColumns {
        let about = |column: &Column| (column.header.clone(), column.unit.clone());
        // A column that is missing, or one of several, is told by who reads it.
        let mut columns = Vec::new();
        if mapping.every.is_none() {
            let time = time_column(table, mapping).ok().map(|found| about(found.0));
            columns.push(("the time".to_string(), time));
        }
        if let Some(run) = &mapping.run {
            columns.push(("the run".to_string(), table.find(run).ok().flatten().map(about)));
        }
        let inputs = mapping.inputs.iter().map(|input| &input.column);
        for observable in mapping.observables.iter().chain(inputs) {
            let found = observable_column(table, observable).ok().flatten();
            columns.push((format!("`{}`", observable.name), found.map(about)));
        }
        TakenColumns { file: table.path.clone(), columns }
    }

    /// That another file of the same kind has the same columns, in the same units.
    ///
    /// # Errors
    /// It has not; both are named.
    pub fn agrees(&self, other: &TakenColumns) -> Result<()> {
        let first = self.file.display();
        let unit = |unit: &Option<String>| {
            unit.as_ref().map(|unit| known_unit(unit).unwrap_or_else(|| unit.clone()))
        };
        for ((what, one), (_, two)) in self.columns.iter().zip(&other.columns) {
            let (message, column) = match (one, two) {
                (Some((header, a)), Some((other, b))) => match (unit(a), unit(b)) {
                    (Some(a), Some(b)) if a != b => (
                        format!(
                            "{what} is in [{b}] here (`{other}`), but in [{a}] in {first} (`{header}`)"
                        ),
                        other,
                    ),
                    _ => continue,
                },
                (Some((header, _)), None) => {
                    (format!("no column holds {what} here, but `{header}` does in {first}"), header)
                }
                (None, Some((header, _))) => {
                    (format!("`{header}` holds {what} here, but no column does in {first}"), header)
                }
                (None, None) => continue,
            };
            let hint = "write the files alike, or give each kind a `data` statement of its own";
            return Err(wrong(&other.file, None, Some(column), message, hint));
        }
        Ok(())
    }
}

/// Puts the measurements of several files together, in their order; `name` stands for all of them.
pub fn together(name: &Path, parts: Vec<(Dataset, DataReport)>) -> (Dataset, DataReport) {
    let mut all = Dataset::default();
    let mut notes: Vec<(String, Vec<PathBuf>)> = Vec::new();
    let mut headers: Vec<Option<String>> = Vec::new();
    let mut sources: Vec<FileReport> = Vec::new();
    let mut taken: HashSet<String> = HashSet::new();
    for (data, report) in parts {
        let file = report.source.as_ref().map(|source| source.file.clone()).unwrap_or_default();
        // What deserves a look is judged on all together.
        let known: Vec<String> = report.suspicious.iter().map(Suspicion::sentence).collect();
        for sentence in report.warnings.into_iter().filter(|sentence| !known.contains(sentence)) {
            match notes.iter_mut().find(|(other, _)| *other == sentence) {
                Some((_, files)) => files.push(file.clone()),
                None => notes.push((sentence, vec![file.clone()])),
            }
        }
        headers.resize(report.columns.len().max(headers.len()), None);
        for (header, column) in headers.iter_mut().zip(report.columns) {
            *header = header.take().or(column.header);
        }
        sources.extend(report.source);
        (all.observables, all.inputs) = (data.observables, data.inputs);
        for mut run in data.runs {
            let plain = run.name.clone();
            let mut number = 1;
            while !taken.insert(run.name.clone()) {
                number += 1;
                run.name = format!("{plain} ({number})");
            }
            all.runs.push(run);
        }
    }
    let copies = without_copies(&mut all.runs);
    let mut report = DataReport::of(&all);
    for (column, header) in report.columns.iter_mut().zip(headers) {
        column.header = header;
    }
    let several = |(sentence, files): (String, Vec<PathBuf>)| match files.as_slice() {
        [one] => format!("{}: {sentence}", one.display()),
        [first, ..] => format!("{} and {} more: {sentence}", first.display(), files.len() - 1),
        [] => sentence,
    };
    report.warnings.splice(0..0, notes.into_iter().map(several).chain(copies));
    report.source = of_all(name, &sources);
    (all, report)
}

/// One report on several files; its hash is that of their names and hashes.
pub(super) fn of_all(name: &Path, sources: &[FileReport]) -> Option<FileReport> {
    let mut hash = Sha256::new();
    for source in sources {
        let file = source.file.file_name().unwrap_or_default().to_string_lossy();
        hash.update(format!("{}  {file}\n", source.sha256));
    }
    Some(FileReport {
        file: name.to_path_buf(),
        sha256: format!("{:x}", hash.finalize()),
        rows: sources.iter().map(|source| source.rows).sum(),
        files: sources.len(),
        reading: sources.first()?.reading.clone(),
    })
}
