//! From a table to a data set: the columns that a spec asks for, grouped into runs.

use std::borrow::Cow;
use std::collections::HashMap;

use super::cells::entry;
use super::clock::{Clock, Since, is_far};
use super::counted as times;
use super::driving;
use super::errors;
use super::grouping;
use super::header::counted;
use super::mapping::{
    Mapping, converted, missing_column, observable_column, time_column, without_column,
};
use super::order::{Order, judge};
use super::report::DataReport;
use super::table::{Column, Table};
use super::{Dataset, Run};
use crate::error::{Error, Result};

/// What run columns are usually called; only used to give hints.
const RUN_NAMES: &[&str] = &["run", "trial", "experiment", "trajectory", "series", "id"];

/// Picks, converts, groups and orders: from the cells of a file to runs of samples.
///
/// ConvertedColumns of one run need not stand together. ConvertedColumns in which nothing was
/// measured are left out; so are runs with a single sample. Whatever was put right is said in the
/// report.
///
/// # Errors
/// A column that does not exist, a cell that is not a number, a sample without a time or a
/// run, time running backwards, two different samples at one time, or no run with two
/// samples.
pub fn dataset(table: &Table, mapping: &Mapping) -> Result<(Dataset, DataReport)> {
    let time = time_column(table, mapping)?;
    let times = converted(table, time.0, time.1, time.2)?;
    let mut values = Vec::with_capacity(mapping.observables.len());
    let mut sources = Vec::with_capacity(mapping.observables.len());
    for observable in &mapping.observables {
        let column = observable_column(table, observable)?;
        values.push(match column {
            Some(column) => converted(table, column, observable.scale, observable.offset)?,
            None => vec![f64::NAN; table.rows()],
        });
        sources.push(column.map(|column| column.header.clone()));
    }
    for input in &mapping.inputs {
        let column = observable_column(table, &input.column)?;
        values.push(match column {
            Some(column) => converted(table, column, input.column.scale, input.column.offset)?,
            None => vec![f64::NAN; table.rows()],
        });
        sources.push(column.map(|column| column.header.clone()));
    }
    for (column, map) in errors::columns(table, mapping)? {
        values.push(converted(table, column, map.scale, 0.0)?);
    }
    let rows = ConvertedColumns { table, mapping, time: time.0, scale: time.1, times, values };
    let mut notes = Notes::default();
    let groups: Vec<(String, Vec<usize>)> = rows
        .grouped(&mut notes)?
        .into_iter()
        .map(|(name, members)| {
            (mapping.run_name(mapping.run.as_ref().map(|_| name.as_str())), members)
        })
        .collect();
    let falling = rows.falling(&groups);
    let mut runs = Vec::with_capacity(groups.len());
    for (name, members) in groups {
        let members = rows.ordered(&name, members, falling, &mut notes)?;
        if let [only] = members.as_slice() {
            notes.single.push((name, rows.line(*only)));
        } else if !members.is_empty() {
            runs.push(rows.run(name, &members, &mut notes)?);
        }
    }
    // Dropping doubled rows can leave a single sample too.
    runs.retain(|run| {
        let keep = run.times.len() > 1;
        if !keep {
            let line = run.lines.first().copied().unwrap_or(0);
            notes.single.push((run.name.clone(), line));
        }
        keep
    });
    let copies = without_copies(&mut runs);
    if runs.is_empty() {
        let (message, hint) = match notes.single.len() {
            0 => (
                "nothing was measured in any row".to_string(),
                "look whether the columns of the spec are the ones with the measurements",
            ),
            1 => ("there is only one sample; motion takes two".to_string(), "add more rows"),
            many => (
                format!("each of the {many} runs has only one sample; motion takes two"),
                "look whether the run column is the right one: its cells are the same in all \
                 rows of a run",
            ),
        };
        let line = notes.single.first().map(|(_, line)| *line);
        return Err(table.error(line, mapping.run.as_deref(), message, hint));
    }
    let mut data = Dataset {
        observables: mapping.observables.iter().map(|o| o.name.clone()).collect(),
        runs,
        inputs: Vec::new(),
    };
    errors::take_errors(&mut data, table, mapping)?;
    driving::take_inputs(&mut data, table, mapping)?;
    grouping::take_groups(&mut data, table, mapping)?;
    let mut sentences = table.reading.notes().to_vec();
    sentences.extend(notes.sentences(table.reading.noun()));
    sentences.extend(copies);
    sentences.extend(driving::about_gaps(&data, table));
    sentences.extend(without_column(table, mapping)?);
    sentences.extend(times::note(table, mapping)?);
    let report = DataReport::of_file(&data, table, sources, sentences);
    Ok((data, report))
}

/// What was put right on the way, for the report.
#[derive(Default)]
struct Notes {
    empty: usize,
    late: Vec<(String, u64, usize)>,
    doubled: Vec<(u64, u64)>,
    single: Vec<(String, u64)>,
}

impl Notes {
    fn sentences(&self, place: &str) -> Vec<String> {
        let mut sentences = Vec::new();
        if self.empty > 0 {
            sentences
                .push(format!("{} without any measurement left out.", counted(self.empty, "row")));
        }
        if let Some((run, line, _)) = self.late.first() {
            let late = self.late.iter().map(|(_, _, late)| late).sum();
            sentences.push(format!(
                "{} out of order put in the order of time; the first is {place} {line} of run {run}.",
                counted(late, "row")
            ));
        }
        if let Some((line, other)) = self.doubled.first() {
            sentences.push(format!(
                "{} at the time of another, and not in conflict with it, merged; the first is \
                 {place} {line} into {place} {other}.",
                counted(self.doubled.len(), "row")
            ));
        }
        if let Some((run, line)) = self.single.first() {
            sentences.push(format!(
                "{} with a single sample left out; the first is run {run} at {place} {line}.",
                counted(self.single.len(), "run")
            ));
        }
        sentences
    }
}

/// Samples that a run has at least to be told from others that are alike by chance: a few coarse
/// readings may be the same twice.
const TELLING: usize = 8;

/// Leaves out every run with the very samples of an earlier one: the same measurement listed twice
/// is no second measurement, and would make results seem more certain than they are. Says so.
///
/// Runs in which nothing moves stay: they are alike without being copies.
pub(super) fn without_copies(runs: &mut Vec<Run>) -> Option<String> {
    // Names of runs that are copies, with the names of what they are copies of.
    let mut copies: Vec<(String, String)> = Vec::new();
    let mut first: HashMap<Vec<u64>, Vec<usize>> = HashMap::new();
    let mut kept: Vec<Run> = Vec::with_capacity(runs.len());
    for run in runs.drain(..) {
        let moves = |values: &Vec<f64>| values.array_windows().any(|[a, b]| a != b);
        if run.times.len() < TELLING || !run.values.iter().any(moves) {
            kept.push(run);
            continue;
        }
        let ends = [run.values.iter().filter_map(|v| v.first()).collect::<Vec<_>>(), {
            run.values.iter().filter_map(|v| v.last()).collect()
        }];
        let key = ends.concat().into_iter().map(|x| x.to_bits()).collect();
        let alike = first.entry(key).or_default();
        match alike.iter().filter_map(|&at| kept.get(at)).find(|other| is_copy(&run, other)) {
            Some(other) => copies.push((run.name, other.name.clone())),
            None => {
                alike.push(kept.len());
                kept.push(run);
            }
        }
    }
    *runs = kept;
    copies.first().map(|(copy, of)| {
        format!(
            "{} with the very samples of another counted once; the first is run {copy}, a copy of \
             run {of}.",
            counted(copies.len(), "run")
        )
    })
}

/// Whether two runs have the same values, to the bit, at the same times from their starts.
fn is_copy(run: &Run, other: &Run) -> bool {
    let same = |a: &[f64], b: &[f64]| {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
    };
    let since = |run: &Run| -> Vec<f64> {
        run.times.first().map_or(Vec::new(), |start| run.times.iter().map(|t| t - start).collect())
    };
    run.values.len() == other.values.len()
        && run.values.iter().zip(&other.values).all(|(a, b)| same(a, b))
        && (same(&run.times, &other.times) || same(&since(run), &since(other)))
}

/// The converted columns of the file, row by row.
struct ConvertedColumns<'a> {
    table: &'a Table,
    mapping: &'a Mapping,
    time: &'a Column,
    /// Spec's units of time per unit of the file.
    scale: f64,
    times: Vec<f64>,
    /// `values[observable][row]`
    values: Vec<Vec<f64>>,
}

impl ConvertedColumns<'_> {
    /// Time of a row; not a number where there is none.
    fn time_of(&self, row: usize) -> f64 {
        entry(&self.times, row)
    }

    fn line(&self, row: usize) -> u64 {
        self.table.lines.get(row).copied().unwrap_or(0)
    }

    fn error(&self, row: usize, column: &str, message: String, hint: &str) -> Error {
        self.table.error(Some(self.line(row)), Some(column), message, hint)
    }

    /// The rows of every run, in the order of the file.
    fn grouped(&self, notes: &mut Notes) -> Result<Vec<(String, Vec<usize>)>> {
        let run = match &self.mapping.run {
            None => None,
            Some(name) => match self.table.find(name)? {
                Some(column) => Some(column),
                None => return Err(missing_column(self.table, name, "the run")),
            },
        };
        let mut groups: Vec<(String, Vec<usize>)> = Vec::new();
        if let Some((column, what)) = run.and_then(|c| c.cells.unread().map(|what| (c, what))) {
            return Err(self.table.names_no_run(column, what));
        }
        let mut places: HashMap<Cow<'_, str>, usize> = HashMap::new();
        for row in 0..self.table.rows() {
            if self.values.iter().all(|column| entry(column, row).is_nan()) {
                notes.empty += 1;
                continue;
            }
            if self.time_of(row).is_nan() {
                return Err(self.error(
                    row,
                    &self.time.header,
                    "this sample has no time".to_string(),
                    "give its time, or remove the row",
                ));
            }
            let name = run.map_or(Cow::Borrowed("1"), |column| column.cells.get(row));
            if let (true, Some(column)) = (name.is_empty(), run) {
                return Err(self.error(
                    row,
                    &column.header,
                    "this sample belongs to no run".to_string(),
                    "give the name of its run",
                ));
            }
            match places.get(&name).and_then(|place| groups.get_mut(*place)) {
                Some((_, members)) => members.push(row),
                None => {
                    places.insert(name.clone(), groups.len());
                    groups.push((name.into_owned(), vec![row]));
                }
            }
        }
        Ok(groups)
    }

    fn times_of(&self, members: &[usize]) -> Vec<f64> {
        members.iter().map(|row| self.time_of(*row)).collect()
    }

    /// Whether time runs backwards in every run that has two samples.
    fn falling(&self, groups: &[(String, Vec<usize>)]) -> bool {
        groups
            .iter()
            .filter(|(_, members)| members.len() > 1)
            .all(|(_, members)| judge(&self.times_of(members)) == Order::Falling)
    }

    /// The rows of one run in the order of time.
    fn ordered(
        &self,
        name: &str,
        mut members: Vec<usize>,
        falling: bool,
        notes: &mut Notes,
    ) -> Result<Vec<usize>> {
        let row = |at: usize| members.get(at).copied().unwrap_or(0);
        let (first, late) = match judge(&self.times_of(&members)) {
            Order::Rising => return Ok(members),
            Order::Shuffled { first, late } => (first, late),
            // A few rows may stand in falling order by chance; a whole recording does not.
            Order::Falling if !falling && members.len() < 4 => (1, members.len() - 1),
            Order::Falling => {
                return Err(self.error(
                    row(1),
                    &self.time.header,
                    format!(
                        "time runs backwards, from {} to {}",
                        self.time_of(row(0)),
                        self.time_of(row(1))
                    ),
                    "order the rows by rising time, and look whether the clock counts down",
                ));
            }
            Order::Restarted { at } => return Err(self.restarted(row(at - 1), row(at))),
        };
        notes.late.push((name.to_string(), self.line(row(first)), late));
        members.sort_by(|a, b| self.time_of(*a).total_cmp(&self.time_of(*b)));
        Ok(members)
    }

    fn restarted(&self, before: usize, at: usize) -> Error {
        let named = self
            .table
            .columns
            .iter()
            .find(|column| RUN_NAMES.contains(&column.name.to_lowercase().as_str()));
        let hint = match (&self.mapping.run, named) {
            (Some(_), _) => {
                "give each recording a run name of its own, or sort the rows if it is one recording"
                    .to_string()
            }
            (None, Some(column)) => format!(
                "if column `{0}` names the recording, write `run {0}` into the spec's `data` \
                 line; if this is one recording, sort its rows by time",
                column.name
            ),
            (None, None) => "add a column that names the run of each row, and write `run` and its \
                             name into the spec's `data` line; if this is one recording, sort \
                             its rows by time"
                .to_string(),
        };
        self.error(
            at,
            &self.time.header,
            format!(
                "time jumps back from {} to {}, over times that were already recorded",
                self.time_of(before),
                self.time_of(at)
            ),
            &hint,
        )
    }

    /// One run from its rows in the order of time; rows at the same time are merged when
    /// they do not contradict each other.
    fn run(&self, name: String, members: &[usize], notes: &mut Notes) -> Result<Run> {
        let mut run = Run {
            name,
            times: Vec::with_capacity(members.len()),
            values: vec![Vec::with_capacity(members.len()); self.values.len()],
            lines: Vec::with_capacity(members.len()),
            clock: Clock::default(),
            inputs: Vec::new(),
            groups: Vec::new(),
            errors: Vec::new(),
        };
        let mut rows = Vec::with_capacity(members.len());
        for &row in members {
            let same = run.times.last().is_some_and(|time| *time == self.time_of(row));
            if same {
                let line = run.lines.last().copied().unwrap_or(0);
                for (column, values) in run.values.iter_mut().zip(&self.values) {
                    let (Some(kept), new) = (column.last_mut(), entry(values, row)) else {
                        continue;
                    };
                    if kept.is_nan() {
                        *kept = new;
                    } else if !new.is_nan() && new != *kept {
                        return Err(self.error(
                            row,
                            &self.time.header,
                            format!(
                                "{}s {line} and {} are two different samples of run {} at \
                                 time {}",
                                self.table.reading.noun(),
                                self.line(row),
                                run.name,
                                self.time_of(row)
                            ),
                            "remove one, give the time with more digits, or name the run column",
                        ));
                    }
                }
                notes.doubled.push((self.line(row), line));
                continue;
            }
            rows.push(row);
            run.times.push(self.time_of(row));
            for (column, values) in run.values.iter_mut().zip(&self.values) {
                column.push(entry(values, row));
            }
            run.lines.push(self.line(row));
        }
        if let ([first, second, ..], Some(&row)) = (run.times.as_slice(), rows.first())
            && is_far(*first, *second)
        {
            let since = Since::new(self.table, self.time, row, *first, self.scale);
            for (time, row) in run.times.iter_mut().zip(rows) {
                *time = since.of(self.table, self.time, row, *time);
            }
            run.clock = since.clock(self.time);
        }
        Ok(run)
    }
}
