//! Which column of a file holds what: the mapping, and its columns found in a table.

use super::table::{Column, Table};
use super::{Interpolation, MeasuredInput};
use crate::error::{Error, Result};

/// Which columns of a file are time, run and observables.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mapping {
    /// The time column; without one, the usual names are tried ([`TIME_NAMES`]).
    pub time: Option<ColumnMap>,
    /// Time from one sample of a run to the next, where no column holds the time; [`count_times`]
    /// then makes one, from zero in each run.
    ///
    /// [`count_times`]: super::count_times
    pub every: Option<f64>,
    /// The column that names the run of each row; without one, the file is one run.
    pub run: Option<String>,
    /// What the runs are called after where this is one of several files: the run of a file that
    /// is one bears this name, others theirs behind it, as in `swing_1/3`.
    pub file: Option<String>,
    /// What is observed, coordinates first.
    pub observables: Vec<ObservableMap>,
    /// What drives the motion.
    pub inputs: Vec<InputMap>,
    /// Columns that tell apart groups of runs with numbers of their own: the same cell in all rows
    /// of a run; `None` where every run is a group.
    pub groups: Vec<Option<String>>,
}

impl Mapping {
    /// The name of a run, by the cell that names it in its file; `None` where the file is one run.
    pub(super) fn run_name(&self, within: Option<&str>) -> String {
        match (&self.file, within) {
            (Some(file), Some(within)) => format!("{file}/{within}"),
            (Some(file), None) => file.clone(),
            (None, within) => within.unwrap_or("1").to_string(),
        }
    }
}

/// An input, the column that holds it, and what it does between its samples.
#[derive(Debug, Clone, PartialEq)]
pub struct InputMap {
    /// Where it stands; its column is required.
    pub column: ObservableMap,
    /// What it does between its samples.
    pub between: Interpolation,
}

impl InputMap {
    /// What it is of a data set.
    pub(super) fn measured(&self) -> MeasuredInput {
        MeasuredInput { name: self.column.name.clone(), between: self.between }
    }
}

/// A column and its conversion: `scale * cell + offset` is in the spec's unit.
#[derive(Debug, Clone, PartialEq)]
pub struct ColumnMap {
    /// Name or whole header of the column.
    pub column: String,
    /// Spec's units per unit of the file.
    pub scale: f64,
    /// What a cell of zero means, in the spec's unit.
    pub offset: f64,
}

impl ColumnMap {
    /// A column that needs no conversion.
    pub fn plain(column: impl Into<String>) -> Self {
        ColumnMap { column: column.into(), scale: 1.0, offset: 0.0 }
    }
}

/// An observable, the columns that may hold it, and its conversion as in [`ColumnMap`].
#[derive(Debug, Clone, PartialEq)]
pub struct ObservableMap {
    /// Name of the variable.
    pub name: String,
    /// Names or headers of columns, the first that exists is taken; none where it is known that
    /// nothing was measured.
    pub columns: Vec<String>,
    /// Spec's units per unit of the file.
    pub scale: f64,
    /// What a cell of zero means, in the spec's unit.
    pub offset: f64,
    /// Whether the column must exist; otherwise every value is NaN without it.
    pub required: bool,
    /// The column that holds the standard error of each value, where one does.
    pub error: Option<ColumnMap>,
}

impl ObservableMap {
    /// A required observable in the column of its own name, without conversion.
    pub fn plain(name: impl Into<String>) -> Self {
        let name = name.into();
        ObservableMap {
            columns: vec![name.clone()],
            name,
            scale: 1.0,
            offset: 0.0,
            required: true,
            error: None,
        }
    }
}

/// What time columns are usually called.
pub const TIME_NAMES: &[&str] = &["t", "time", "timestamp", "seconds", "zeit", "temps"];

/// The time column with its scale and offset.
pub(super) fn time_column<'a>(
    table: &'a Table,
    mapping: &Mapping,
) -> Result<(&'a Column, f64, f64)> {
    if let Some(map) = &mapping.time {
        return match table.find(&map.column)? {
            Some(column) => Ok((column, map.scale, map.offset)),
            None => Err(missing_column(table, &map.column, "the time")),
        };
    }
    for name in TIME_NAMES {
        if let Some(column) = table.find(name)? {
            return Ok((column, 1.0, 0.0));
        }
    }
    if table.reading.headless() {
        return Err(no_header(table));
    }
    Err(table.error(
        table.reading.header_line(),
        None,
        format!("no column holds the time; there are {}", listed(table)),
        "name it in the spec, as in `data \"file.csv\" { time t [s] }`, or say how far apart the \
         samples are, as in `{ every 10 [ms] }`",
    ))
}

/// The column of an observable; none when it need not exist.
pub(super) fn observable_column<'a>(
    table: &'a Table,
    observable: &ObservableMap,
) -> Result<Option<&'a Column>> {
    for name in &observable.columns {
        if let Some(column) = table.find(name)? {
            return Ok(Some(column));
        }
    }
    if observable.required {
        let name = observable.columns.first().unwrap_or(&observable.name);
        return Err(missing_column(table, name, &observable.name));
    }
    Ok(None)
}

/// Says which observables no column was found for, and which columns might have been meant;
/// `None` when all have one or are known to have none.
pub(super) fn without_column(table: &Table, mapping: &Mapping) -> Result<Option<String>> {
    let mut missing = Vec::new();
    let mut used = Vec::new();
    for observable in &mapping.observables {
        match observable_column(table, observable)? {
            Some(column) => used.push(column.header.as_str()),
            None if observable.columns.is_empty() => {}
            None => missing.push(observable.name.as_str()),
        }
    }
    if missing.is_empty() {
        return Ok(None);
    }
    for map in mapping.observables.iter().filter_map(|observable| observable.error.as_ref()) {
        used.extend(table.find(&map.column)?.map(|column| column.header.as_str()));
    }
    for input in &mapping.inputs {
        used.extend(observable_column(table, &input.column)?.map(|column| column.header.as_str()));
    }
    used.push(&time_column(table, mapping)?.0.header);
    if let Some(run) = &mapping.run {
        used.extend(table.find(run)?.map(|column| column.header.as_str()));
    }
    let spare = table
        .columns
        .iter()
        .find(|column| !used.contains(&column.header.as_str()) && table.is_numeric(column));
    Ok(spare.map(|spare| {
        let (names, first) = (missing.join(", "), missing.first().copied().unwrap_or_default());
        format!(
            "No column is called {names}: taken as not measured. If `{}` holds it, write \
             `{first} = {}` in the spec's data block; if nothing does, `{first} not measured`.",
            spare.header, spare.name
        )
    }))
}

/// The columns have no names.
fn no_header(table: &Table) -> Error {
    table.error(
        table.reading.header_line(),
        None,
        format!(
            "the first row holds numbers, so there is no header; the columns are called {}",
            listed(table)
        ),
        "add a first line that names the columns, such as `t,theta,omega`, or write these names \
         into the spec",
    )
}

/// There is no column `name`, which `what` asks for; with the names that come near.
pub(super) fn missing_column(table: &Table, name: &str, what: &str) -> Error {
    if table.reading.headless() {
        return no_header(table);
    }
    let mut near: Vec<(f64, &str)> = table
        .columns
        .iter()
        .map(|column| {
            let similar = strsim::jaro_winkler(&column.name.to_lowercase(), &name.to_lowercase());
            (similar, column.name.as_str())
        })
        .filter(|(similar, _)| *similar > 0.8)
        .collect();
    near.sort_by(|a, b| b.0.total_cmp(&a.0));
    let names: Vec<String> = near.iter().take(3).map(|(_, name)| format!("`{name}`")).collect();
    let hint = if names.is_empty() {
        "name one of these columns in the spec's `data` line".to_string()
    } else {
        format!("did you mean {}? The spec's `data` line names the columns", names.join(" or "))
    };
    let purpose = if name == what { String::new() } else { format!(" for {what}") };
    table.error(
        table.reading.header_line(),
        Some(name),
        format!("there is no column `{name}`{purpose}; there are {}", listed(table)),
        hint,
    )
}

/// The headers of a table: the first thirty, and how many more there are.
pub fn listed(table: &Table) -> String {
    const SHOWN: usize = 30;
    let mut names: Vec<String> =
        table.columns.iter().take(SHOWN).map(|column| format!("`{}`", column.header)).collect();
    if let Some(more) = table.columns.len().checked_sub(SHOWN).filter(|more| *more > 0) {
        names.push(format!("{more} more"));
    }
    names.join(", ")
}

/// A column as numbers in the spec's unit, NaN where a cell is missing.
pub(super) fn converted(
    table: &Table,
    column: &Column,
    scale: f64,
    offset: f64,
) -> Result<Vec<f64>> {
    let mut numbers = table.numbers(column)?;
    for (row, number) in numbers.iter_mut().enumerate() {
        let missing = number.is_nan();
        *number *= scale;
        // Adding zero would turn -0 into 0.
        if offset != 0.0 {
            *number += offset;
        }
        if !missing && !number.is_finite() {
            return Err(table.error(
                table.lines.get(row).copied(),
                Some(&column.header),
                format!(
                    "`{}` is too large when converted to the spec's unit",
                    column.cells.get(row)
                ),
                "look at the unit of this column",
            ));
        }
    }
    Ok(numbers)
}
