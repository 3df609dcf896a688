//! Files of specs, and of measurements as a spec says.

use std::path::{Path, PathBuf};

use crate::data::{
    self, Cells, Column, ColumnMap, DataReport, Dataset, FilePart, FileSource, InputMap, Mapping,
    NamedFile, ObservableMap, Reading, Suspicion, SuspicionKind, Table, TakenColumns,
};
use crate::error::{Error, ErrorKind, Result};
use crate::expr::{Compiled, DataColumns, ObservedColumn, System, unseen};

/// Rows that show what the columns of a large file hold.
const HEAD: usize = 10_000;

/// Larger files than this are not specs.
const LARGEST_SPEC: u64 = 16 << 20;

/// The text of a spec.
///
/// # Errors
/// The file cannot be read or is not text.
pub(crate) fn spec_text(path: &Path) -> Result<String> {
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
    String::from_utf8(bytes).map_err(|_| {
        failed(std::io::Error::other("it is not a text file in UTF-8; a spec is plain text"))
    })
}

/// What a name stands for: files, and the columns that a `data` statement says they have.
pub(crate) struct Named<'a> {
    pub path: PathBuf,
    pub columns: Option<&'a DataColumns>,
}

/// What a file is read with: its table, or the first rows of it, and which column holds what.
struct Mapped<'a> {
    file: NamedFile,
    table: Table,
    mapping: Mapping,
    columns: Option<&'a DataColumns>,
}

/// The files of all names, each with its columns; `read` reads them, whole or their first rows.
///
/// # Errors
/// A file cannot be read, or those of one name have different columns.
fn each<'a, T>(
    compiled: &Compiled,
    names: &[Named<'a>],
    read: impl Fn(&Path) -> Result<Table>,
    mut take: impl FnMut(Mapped<'a>) -> Result<T>,
) -> Result<Vec<T>> {
    let mut groups = Vec::with_capacity(names.len());
    for name in names {
        groups.push(data::files_of(&name.path)?);
    }
    // One file alone has its runs by their own names; of several each lends them its own.
    if groups.len() > 1 {
        let mut all: Vec<NamedFile> = groups.concat();
        data::name_apart(&mut all);
        let mut named = all.into_iter();
        groups.iter_mut().flatten().zip(&mut named).for_each(|(file, named)| *file = named);
    }
    let mut out = Vec::new();
    for (name, files) in names.iter().zip(groups) {
        let mut first: Option<TakenColumns> = None;
        for file in files {
            let table = read(&file.path).map_err(|error| not_there(error, &file.path))?;
            let mut mapping = mapping(compiled, name.columns, &table)?;
            mapping.file.clone_from(&file.name);
            let taken = TakenColumns::of(&table, &mapping);
            match &first {
                Some(first) => first.agrees(&taken)?,
                None => first = Some(taken),
            }
            out.push(take(Mapped { file, table, mapping, columns: name.columns })?);
        }
    }
    Ok(out)
}

/// What stands for all names: the only one, or all of them in a row.
fn in_a_row(names: &[Named]) -> PathBuf {
    let mut names = names.iter();
    let first = names.next().map_or_else(PathBuf::new, |name| name.path.clone());
    let rest = names.map(|name| {
        let file = name.path.file_name().unwrap_or_default();
        format!(", {}", file.to_string_lossy())
    });
    let rest: String = rest.collect();
    if rest.is_empty() { first } else { PathBuf::from(format!("{}{rest}", first.display())) }
}

/// All measurements of some files, in memory.
///
/// # Errors
/// A file cannot be read, or has not the columns that the spec asks for.
pub(crate) fn read(compiled: &Compiled, names: &[Named]) -> Result<(Dataset, DataReport)> {
    let mut named = false;
    let mut parts = each(compiled, names, data::read, |mapped| {
        named |= mapped.file.name.is_some();
        of_table(mapped.table, mapped.mapping, pairs(mapped.columns))
    })?;
    let (mut dataset, mut report) = match parts.pop() {
        Some(only) if parts.is_empty() && !named => only,
        last => {
            parts.extend(last);
            data::together(&in_a_row(names), parts)
        }
    };
    data::as_parts_of_the_middle(&mut dataset);
    look_at_measures(&compiled.system, &dataset, &mut report);
    Ok((dataset, report))
}

fn of_table(mut table: Table, mut mapping: Mapping, pairs: bool) -> Result<(Dataset, DataReport)> {
    if pairs {
        mapping.run = Some(number_pairs(&mut table, mapping.run.as_deref())?);
    }
    data::count_times(&mut table, &mut mapping, pairs)?;
    data::dataset(&table, &mapping)
}

/// What measures show needs no column of its own; what nothing shows is said.
fn look_at_measures(system: &System, dataset: &Dataset, report: &mut DataReport) {
    if system.measures.is_empty() {
        return;
    }
    let names = system.observables();
    let state = names.get(..2 * system.degrees()).unwrap_or(&[]);
    let needless =
        |one: &Suspicion| one.kind == SuspicionKind::Empty && state.contains(&one.observable);
    let empty = report.suspicious.iter().filter(|one| needless(one));
    let said: Vec<String> = empty.map(Suspicion::sentence).collect();
    report.suspicious.retain(|one| !needless(one));
    report.warnings.retain(|sentence| !said.contains(sentence));
    let measured = |row: usize| {
        let mut cells = dataset.runs.iter().filter_map(|run| run.values.get(row)).flatten();
        cells.any(|x| x.is_finite())
    };
    let silent = unseen(system, measured).into_iter().filter(|i| !system.is_hidden(*i));
    for variable in silent.filter_map(|i| system.coordinates.get(i)) {
        report.warnings.push(format!(
            "Nothing that is measured depends on `{0}`: name its column in the spec's data block, or \
             say with `measure` what a column shows of it.",
            variable.name
        ));
    }
}

/// Measurements in columns that have names, found as those of a file are; `time` and `run` are
/// columns to take in place of those that the spec names.
///
/// # Errors
/// A column that the spec asks for is missing, or is not as long as the first.
pub(crate) fn of_columns(
    compiled: &Compiled,
    columns: &[(&str, Values)],
    time: Option<&str>,
    run: Option<&str>,
) -> Result<(Dataset, DataReport)> {
    let named = columns.iter().map(|(name, values)| (name.to_string(), *values));
    let table = in_memory(named)?;
    let said = compiled.data.first();
    let mut mapping = mapping(compiled, said, &table)?;
    if let Some(column) = time {
        let scale = mapping.time.map_or(1.0, |time| time.scale);
        mapping.time = Some(ColumnMap { scale, ..ColumnMap::plain(column) });
        mapping.every = None;
    }
    mapping.run = run.map(str::to_string).or(mapping.run);
    let (mut dataset, mut report) = of_table(table, mapping, pairs(said))?;
    data::as_parts_of_the_middle(&mut dataset);
    look_at_measures(&compiled.system, &dataset, &mut report);
    Ok((dataset, report))
}

/// Measurements in the order and the units of a spec's observables, of which the momenta may go
/// without, then its inputs; with the run of every sample, if there are several.
///
/// # Errors
/// There are too many or too few of them, or one is not as long as the times.
pub(crate) fn of_samples(
    compiled: &Compiled,
    times: &[f64],
    runs: Option<Values>,
    values: &[&[f64]],
) -> Result<(Dataset, DataReport)> {
    let observables = compiled.system.observables();
    let inputs = compiled.system.measured_inputs();
    let seen = |row: &usize| !compiled.system.is_hidden(*row);
    let degrees = (0..compiled.system.degrees()).filter(seen).count();
    let driving = inputs.iter().map(|input| input.name.clone());
    let given = values.len().checked_sub(inputs.len());
    let measures = compiled.system.measures.len();
    let all = 2 * degrees + measures;
    // What measures show may be all that there is.
    let part = if measures > 0 { measures } else { degrees };
    let Some(measured) = given.filter(|given| [part, all].contains(given)) else {
        let named = observables.iter().enumerate().filter(|(row, _)| seen(row));
        let wanted: Vec<String> = named.map(|(_, name)| name.clone()).chain(driving).collect();
        return Err(Error::new(
            ErrorKind::InvalidArgument,
            format!("{} columns of values for {}", values.len(), wanted.join(", ")),
            match measures {
                0 => {
                    "give the coordinates, or coordinates and momenta, then every input, in this order"
                }
                _ => {
                    "give the measures, or coordinates, momenta and measures, then every input, in \
                      this order"
                }
            },
        ));
    };
    let unused = |name: &str| {
        let mut name = name.to_string();
        while observables.contains(&name) || inputs.iter().any(|input| input.name == name) {
            name.push('_');
        }
        name
    };
    let (time, run) = (unused("t"), unused("run"));
    let mut columns = vec![(time.clone(), Values::Numbers(times))];
    columns.extend(runs.map(|runs| (run.clone(), runs)));
    let skipped = if measures > 0 && measured < all { 2 * degrees } else { 0 };
    let seen_rows = (0..observables.len()).filter(seen);
    let given: Vec<usize> = seen_rows.skip(skipped).take(measured).collect();
    let named = observables.iter().enumerate().filter(|(row, _)| given.contains(row));
    let named = named.map(|(_, name)| name.clone()).chain(driving).zip(values);
    columns.extend(named.map(|(name, values)| (name, Values::Numbers(values))));
    let mut table = in_memory(columns.into_iter())?;
    let mut mapping = Mapping {
        time: Some(ColumnMap::plain(time)),
        every: None,
        run: runs.map(|_| run),
        file: None,
        observables: observables.iter().map(ObservableMap::plain).collect(),
        inputs: Vec::new(),
        groups: compiled.system.groupings(),
    };
    mapping.inputs = (inputs.iter())
        .map(|input| InputMap { column: ObservableMap::plain(&input.name), between: input.between })
        .collect();
    for (row, absent) in mapping.observables.iter_mut().enumerate() {
        if !given.contains(&row) {
            (absent.required, absent.columns) = (false, Vec::new());
        }
    }
    if pairs(compiled.data.first()) && runs.is_none() {
        mapping.run = Some(number_pairs(&mut table, None)?);
    }
    data::dataset(&table, &mapping)
}

/// The cells of a column in memory.
///
/// ```
/// use leverrier::{Data, Spec, Values};
///
/// let spec = Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2 }")?;
/// let runs = ["a", "a", "b", "b"].map(String::from);
/// let columns = [
///     ("t", Values::Numbers(&[0.0, 0.1, 0.0, 0.1])),
///     ("q", Values::Numbers(&[1.0, 0.9, 0.5, f64::NAN])),
///     ("p", Values::Numbers(&[0.0, -0.1, 0.0, -0.05])),
///     ("run", Values::Text(&runs)),
/// ];
/// assert_eq!(Data::from_columns(&spec, &columns, None, Some("run"))?.runs(), 2);
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Values<'a> {
    /// Numbers; NaN where nothing was measured.
    Numbers(&'a [f64]),
    /// Text: names of runs. Numbers may be written as text, too.
    Text(&'a [String]),
    /// So many cells of a kind that cannot be read, such as "dates": an error only where the
    /// column is asked for.
    Unreadable(&'static str, usize),
}

fn in_memory<'a>(columns: impl Iterator<Item = (String, Values<'a>)>) -> Result<Table> {
    let mut out: Vec<Column> = Vec::new();
    for (name, values) in columns {
        let cells = match values {
            Values::Numbers(numbers) => Cells::from(numbers.to_vec()),
            Values::Text(text) => text.iter().collect(),
            Values::Unreadable(what, count) => Cells::unreadable(what, count),
        };
        let first = out.first().map_or(cells.len(), |column| column.cells.len());
        if cells.len() != first {
            return Err(Error::new(
                ErrorKind::InvalidArgument,
                format!("{} values in the column `{name}`, but {first} before it", cells.len()),
                "give one value for each sample, NaN where nothing was measured",
            ));
        }
        out.push(data::column_of(&name, cells));
    }
    let rows = out.first().map_or(0, |column| column.cells.len());
    Ok(Table {
        path: PathBuf::new(),
        columns: out,
        lines: (1..=rows as u64).collect(),
        reading: Reading::Memory,
        sha256: String::new(),
    })
}

/// The measurements of some files as a source that is read anew in every pass.
///
/// # Errors
/// As [`read`].
pub(crate) fn source(compiled: &Compiled, names: &[Named]) -> Result<FileSource> {
    let parts = each(
        compiled,
        names,
        |path| data::head(path, HEAD),
        |mapped| {
            let pairs = pairs(mapped.columns);
            let with_errors = mapped.mapping.observables.iter().find(|one| one.error.is_some());
            if let Some(one) = with_errors {
                return Err(Error::new(
                    ErrorKind::InvalidArgument,
                    format!(
                        "the standard errors of {} cannot be read from a file that is read part by \
                         part",
                        one.name
                    ),
                    "leave `error` and its column away, or read less data at once",
                ));
            }
            Ok(FilePart { path: mapped.file.path, mapping: mapped.mapping, pairs })
        },
    )?;
    FileSource::of_parts(&in_a_row(names), parts)
}

/// The inputs alone of a file, run by run.
///
/// # Errors
/// As [`read`].
pub(crate) fn read_inputs(compiled: &Compiled, path: &Path) -> Result<Dataset> {
    let mut table = data::read(path).map_err(|error| not_there(error, path))?;
    let mut mapping = mapping(compiled, compiled.data.first(), &table)?;
    mapping.observables.clear();
    // A file of inputs alone is one run, unless it has the column.
    if let Some(run) = &mapping.run
        && table.find(run)?.is_none()
    {
        mapping.run = None;
    }
    data::count_times(&mut table, &mut mapping, false)?;
    Ok(data::dataset(&table, &mapping)?.0)
}

/// Whether every two rows are one run.
fn pairs(columns: Option<&DataColumns>) -> bool {
    columns.is_some_and(|columns| columns.pairs)
}

/// The column that a file which keeps its runs apart has for them.
fn runs_of_file(columns: Option<&DataColumns>, table: &Table) -> Option<String> {
    table.reading.runs().filter(|_| !pairs(columns)).map(str::to_string)
}

fn mapping(compiled: &Compiled, columns: Option<&DataColumns>, table: &Table) -> Result<Mapping> {
    let system = &compiled.system;
    let mut mapping = Mapping {
        time: columns.and_then(|c| c.time.as_ref()).map(|time| ColumnMap {
            column: time.column.clone(),
            scale: time.scale,
            offset: 0.0,
        }),
        every: columns.and_then(|c| c.every),
        run: columns.and_then(|c| c.run.clone()).or_else(|| runs_of_file(columns, table)),
        file: None,
        observables: Vec::new(),
        inputs: Vec::new(),
        groups: system.groupings(),
    };
    let observed = columns.map_or_else(|| system.observed_columns(), |c| c.observables.clone());
    // Coordinates alone will do. But a momentum whose column the spec names, or of which there
    // are others, has to have one too, unless the spec says that it was not measured.
    let degrees = system.degrees();
    let second = observed.get(degrees..2 * degrees).unwrap_or(&[]);
    let usual = system.observed_columns();
    let named = |column: &ObservedColumn| !column.candidates.is_empty() && !usual.contains(column);
    let mut some_measured = second.iter().any(named);
    for name in second.iter().flat_map(|column| &column.candidates) {
        some_measured |= table.find(name)?.is_some();
    }
    mapping.observables = observed
        .into_iter()
        .enumerate()
        .map(|(row, column)| ObservableMap {
            required: !system.is_hidden(row)
                && match row {
                    // What a measure shows may do in the place of a coordinate.
                    row if row < degrees => {
                        system.measures.is_empty()
                            || named(&column) && !column.candidates.is_empty()
                    }
                    row if row < 2 * degrees => some_measured && !column.candidates.is_empty(),
                    _ => !column.candidates.is_empty(),
                },
            name: column.name,
            columns: column.candidates,
            scale: column.scale,
            offset: 0.0,
            error: column.error.map(|error| ColumnMap {
                column: error.column,
                scale: error.scale,
                offset: 0.0,
            }),
        })
        .collect();
    let driving = columns.map_or_else(|| system.input_columns(), |c| c.inputs.clone());
    mapping.inputs = system
        .inputs
        .iter()
        .zip(driving)
        .map(|(input, column)| InputMap {
            column: ObservableMap {
                required: true,
                name: column.name,
                columns: column.candidates,
                scale: column.scale,
                offset: 0.0,
                error: None,
            },
            between: input.between,
        })
        .collect();
    Ok(mapping)
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

const NO_DATA: &str = "there is no such file; the spec's `data` line names it, as seen from the \
                       spec's folder, or give another file";

fn not_there(error: Error, path: &Path) -> Error {
    match error {
        Error::File { source, .. } => Error::file("read", path, explained(source, NO_DATA)),
        other => other,
    }
}

/// Says what to do about a file that is not there.
pub(crate) fn explained(error: std::io::Error, advice: &str) -> std::io::Error {
    match error.kind() {
        std::io::ErrorKind::NotFound => std::io::Error::new(error.kind(), advice.to_string()),
        _ => error,
    }
}

const NO_SPEC: &str = "there is no such file; `leverrier new DATA.csv` writes a first spec";
