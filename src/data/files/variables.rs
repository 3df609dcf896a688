//! Named variables, as programs for numbers keep them, and the table of samples that they make.
//!
//! A group (a struct, the group of a hierarchy, an archive of arrays) whose members are arrays is
//! a table: vectors are columns, a matrix is one column for each of its components, a single
//! number or text stands in every row. Lists (cells, arrays of structs), groups that are alike,
//! times of two axes and arrays of three are runs.

use std::path::Path;

use super::super::cells::Cells;
use super::super::header::{counted, split_unit};
use super::super::mapping::TIME_NAMES;
use super::super::table::{Column, Reading, StoredReading, Table, wrong};
use crate::error::{Error, Result};

/// What a name stands for.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Variable {
    /// Numbers, the last axis running fastest.
    Numbers { shape: Vec<usize>, values: Vec<f64> },
    /// Texts, one below the other.
    Text(Vec<String>),
    /// Variables that have names.
    Group(Vec<(String, Variable)>),
    /// Variables that are numbered.
    List(Vec<Variable>),
    /// Something that is no measurement.
    Unreadable(&'static str),
}

/// Cells of a table, at most: more is not held in memory.
const MOST_CELLS: usize = 1 << 30;
/// Groups inside groups, at most.
const DEEPEST: usize = 32;

/// Columns of one run.
struct Frame {
    /// What it is called; nothing where it is the only one.
    run: String,
    rows: usize,
    columns: Vec<(String, Cells)>,
}

/// What keeps variables from being a table: a sentence and what to do.
struct NoTable(String, String);

type Frames = std::result::Result<Vec<Frame>, NoTable>;

impl Variable {
    /// From numbers whose first axis runs fastest.
    pub(super) fn of_columns(shape: Vec<usize>, values: Vec<f64>) -> Variable {
        if shape.iter().filter(|length| **length != 1).count() < 2 {
            return Variable::Numbers { shape, values };
        }
        // Position of every element among the values, the last axis running fastest.
        let mut strides = Vec::with_capacity(shape.len());
        let mut stride = 1;
        for length in &shape {
            strides.push(stride);
            stride *= length;
        }
        let mut index = vec![0; shape.len()];
        let mut at = 0;
        let mut out = Vec::with_capacity(values.len());
        for _ in 0..values.len() {
            out.push(values.get(at).copied().unwrap_or(f64::NAN));
            let axes = index.iter_mut().zip(&shape).zip(&strides).rev();
            for ((place, length), stride) in axes {
                *place += 1;
                at += stride;
                if *place < *length {
                    break;
                }
                at -= *place * stride;
                *place = 0;
            }
        }
        Variable::Numbers { shape, values: out }
    }

    /// The variable that a path of names leads to, `group/name`; lists are numbered from 1.
    fn part(&self, path: &str) -> std::result::Result<&Variable, NoTable> {
        let mut here = self;
        for name in path.split(['/', '.']).filter(|name| !name.is_empty()) {
            let found = match here {
                Variable::Group(members) => members
                    .iter()
                    .find(|(own, _)| own == name)
                    .or_else(|| members.iter().find(|(own, _)| own.eq_ignore_ascii_case(name)))
                    .map(|(_, member)| member),
                Variable::List(parts) => {
                    name.parse::<usize>().ok().and_then(|number| parts.get(number.checked_sub(1)?))
                }
                _ => None,
            };
            here = found.ok_or_else(|| {
                NoTable(
                    format!("there is nothing called `{name}`"),
                    format!("there are {}", here.contents()),
                )
            })?;
        }
        Ok(here)
    }

    /// The names of what is inside, for people.
    fn contents(&self) -> String {
        const SHOWN: usize = 20;
        match self {
            Variable::Group(members) if members.is_empty() => "no variables".to_string(),
            Variable::Group(members) => {
                let names = members.iter().take(SHOWN).map(|(name, _)| format!("`{name}`"));
                let mut names: Vec<String> = names.collect();
                if members.len() > SHOWN {
                    names.push(format!("{} more", members.len() - SHOWN));
                }
                names.join(", ")
            }
            Variable::List(parts) => format!("parts 1 to {}", parts.len()),
            _ => "no names inside it".to_string(),
        }
    }

    /// Whether it has more than one number, or something that might.
    fn measures(&self) -> bool {
        match self {
            Variable::Numbers { values, .. } => values.len() > 1,
            Variable::Group(members) => members.iter().any(|(_, member)| member.measures()),
            Variable::List(parts) => parts.iter().any(Variable::measures),
            Variable::Text(_) | Variable::Unreadable(_) => false,
        }
    }

    /// Lengths of the axes that have more than one place.
    fn axes(&self) -> Vec<usize> {
        match self {
            Variable::Numbers { shape, .. } => {
                shape.iter().copied().filter(|length| *length != 1).collect()
            }
            _ => Vec::new(),
        }
    }

    /// One place of an axis, counted among [`Variable::axes`]; the other axes stay.
    fn slice(&self, axis: usize, place: usize) -> Variable {
        let (axes, Variable::Numbers { values, .. }) = (self.axes(), self) else {
            return self.clone();
        };
        let inner: usize = axes.iter().skip(axis + 1).product();
        let length = axes.get(axis).copied().unwrap_or(1).max(1);
        let taken = values.chunks(inner.max(1) * length);
        let values =
            taken.flat_map(|block| block.iter().skip(place * inner).take(inner).copied()).collect();
        let shape = axes.iter().enumerate().filter(|(at, _)| *at != axis).map(|(_, n)| *n);
        Variable::Numbers { shape: shape.collect(), values }
    }
}

/// The table of what a file holds, or of the part of it that is named.
///
/// # Errors
/// There is no such part, there are no arrays, or there are several tables.
pub(super) fn table(
    path: &Path,
    format: &'static str,
    root: &Variable,
    part: Option<&str>,
    sha256: String,
) -> Result<Table> {
    let stop =
        |NoTable(message, hint): NoTable| -> Error { wrong(path, None, None, message, hint) };
    let chosen = root.part(part.unwrap_or_default()).map_err(stop)?;
    let last = part.and_then(|part| part.rsplit(['/', '.']).next()).unwrap_or("column");
    let frames = frames(last, chosen, 0).map_err(stop)?;
    let mut names: Vec<String> = Vec::new();
    for (name, _) in frames.iter().flat_map(|frame| &frame.columns) {
        if !names.contains(name) {
            names.push(name.clone());
        }
    }
    let rows: usize = frames.iter().map(|frame| frame.rows).sum();
    if rows == 0 || names.is_empty() {
        let hint = "save the times and what was measured as arrays of the same length";
        return Err(wrong(path, None, None, "there are no rows of measurements", hint));
    }
    if rows.saturating_mul(names.len()) > MOST_CELLS {
        let message = format!("{rows} rows of {} columns are too many to hold", names.len());
        return Err(wrong(path, None, None, message, "save it as Parquet, which is read in parts"));
    }
    let runs = frames.iter().any(|frame| !frame.run.is_empty()).then(|| {
        let mut name = "run".to_string();
        while names.contains(&name) {
            name.push('_');
        }
        name
    });
    let labels: Cells = (frames.iter())
        .flat_map(|frame| std::iter::repeat_n(frame.run.as_str(), frame.rows))
        .collect();
    let mut columns: Vec<(String, Cells)> =
        names.into_iter().map(|name| (name, Cells::default())).collect();
    for frame in frames {
        let mut own = frame.columns;
        for (name, cells) in &mut columns {
            match own.iter().position(|(other, _)| other == name) {
                Some(at) => cells.append(own.swap_remove(at).1),
                None => (0..frame.rows).for_each(|_| cells.push_missing()),
            }
        }
    }
    columns.extend(runs.clone().map(|name| (name, labels)));
    let columns = columns.into_iter().map(|(header, cells)| {
        let (name, unit) = match split_unit(&header) {
            (name, unit) if !name.is_empty() => (name, unit),
            _ => (header.clone(), None),
        };
        Column { name, header, unit, cells }
    });
    Ok(Table {
        path: path.to_path_buf(),
        columns: columns.collect(),
        lines: (1..=rows as u64).collect(),
        reading: Reading::Stored(StoredReading { format, part: part.map(str::to_string), runs }),
        sha256,
    })
}

fn frames(name: &str, variable: &Variable, depth: usize) -> Frames {
    if depth > DEEPEST {
        return Err(NoTable(
            "its groups stand too deep inside each other".to_string(),
            "save the measurements as arrays with names".to_string(),
        ));
    }
    match variable {
        Variable::Group(members) => group(members, depth),
        Variable::List(parts) => {
            numbered(parts.iter().map(|part| frames(name, part, depth + 1)), parts.len())
        }
        Variable::Numbers { .. } => match variable.axes().first() {
            Some(&rows) if variable.axes().len() < 3 => {
                Ok(vec![Frame { run: String::new(), rows, columns: columns(name, variable, rows) }])
            }
            _ => Err(nothing_in(&format!("`{name}`"))),
        },
        Variable::Text(_) | Variable::Unreadable(_) => Err(nothing_in(&format!("`{name}`"))),
    }
}

fn nothing_in(what: &str) -> NoTable {
    NoTable(
        format!("{what} holds no arrays of numbers that could be a table"),
        "save the times and what was measured as arrays of the same length, each with a name"
            .to_string(),
    )
}

fn too_large() -> NoTable {
    NoTable(
        "there are more rows and columns than can be held".to_string(),
        "save the measurements as Parquet, which is read in parts".to_string(),
    )
}

/// Parts that are runs, called by their numbers.
fn numbered(parts: impl Iterator<Item = Frames>, count: usize) -> Frames {
    let mut out = Vec::new();
    let mut cells = 0_usize;
    for (at, part) in parts.enumerate() {
        let part = match part {
            Ok(part) => part,
            Err(NoTable(message, hint)) if count > 1 => {
                return Err(NoTable(format!("part {} of {count}: {message}", at + 1), hint));
            }
            Err(no) => return Err(no),
        };
        for frame in &part {
            cells = cells.saturating_add(frame.rows.saturating_mul(frame.columns.len()));
        }
        if cells > MOST_CELLS {
            return Err(too_large());
        }
        out.extend(part.into_iter().map(|frame| within(&(at + 1).to_string(), frame)));
    }
    Ok(if count == 1 && out.len() == 1 { alone(out) } else { out })
}

/// A frame of a run inside another.
fn within(run: &str, frame: Frame) -> Frame {
    let run = if frame.run.is_empty() { run.to_string() } else { format!("{run}/{}", frame.run) };
    Frame { run, ..frame }
}

/// The only frame needs no name.
fn alone(mut frames: Vec<Frame>) -> Vec<Frame> {
    if let [only] = frames.as_mut_slice() {
        only.run.clear();
    }
    frames
}

fn group(members: &[(String, Variable)], depth: usize) -> Frames {
    let list = |variable: &Variable| match variable {
        Variable::List(parts) => Some(parts.len()),
        _ => None,
    };
    let mut lists =
        members.iter().filter(|(_, member)| list(member).is_some() && member.measures());
    if let Some((first, parts)) = lists.next() {
        let runs = list(parts).unwrap_or(0);
        if let Some((other, parts)) = lists.find(|(_, parts)| list(parts) != Some(runs)) {
            return Err(NoTable(
                format!(
                    "`{first}` has {}, but `{other}` has {}",
                    counted(runs, "part"),
                    list(parts).unwrap_or(0)
                ),
                "save one part for each run, or name the variable behind a #".to_string(),
            ));
        }
        let of_run = |run: usize| {
            let own = |(name, member): &(String, Variable)| match member {
                Variable::List(parts) if parts.len() == runs => {
                    Some((name.clone(), parts.get(run)?.clone()))
                }
                Variable::List(_) => None,
                other => Some((name.clone(), other.clone())),
            };
            members.iter().filter_map(own).collect::<Vec<_>>()
        };
        let parts = (0..runs).map(|run| {
            // A list of groups alone is a list of runs; what stands beside it is shared.
            let mut own = of_run(run);
            if let [(_, Variable::Group(inner))] = own.as_slice() {
                own = inner.clone();
            }
            group(&own, depth + 1)
        });
        return numbered(parts, runs);
    }
    let arrays = || members.iter().filter(|(_, member)| !member.axes().is_empty());
    if arrays().next().is_none() {
        return groups(members, depth);
    }
    let is_time = |name: &str| TIME_NAMES.contains(&split_unit(name).0.to_lowercase().as_str());
    let time = arrays().find(|(name, _)| is_time(name)).map(|(_, time)| time);
    if let Some((runs, samples)) = runs_of_arrays(time, arrays().map(|(_, array)| array)) {
        let of_run = |run: usize| {
            let own = |(name, member): &(String, Variable)| {
                if let Variable::Text(lines) = member
                    && lines.len() == runs
                    && runs != samples
                {
                    return (
                        name.clone(),
                        Variable::Text(lines.get(run).cloned().into_iter().collect()),
                    );
                }
                let axes = member.axes();
                let axis = match axes.as_slice() {
                    [only] if *only == runs && runs != samples => Some(0),
                    [first, second] if [*first, *second] == [runs, samples] => Some(0),
                    [first, second] if [*first, *second] == [samples, runs] => Some(1),
                    [first, second, _] if [*first, *second] == [runs, samples] => Some(0),
                    [first, _, third] if [*first, *third] == [samples, runs] => Some(2),
                    _ => None,
                };
                (name.clone(), axis.map_or_else(|| member.clone(), |axis| member.slice(axis, run)))
            };
            members.iter().map(own).collect::<Vec<_>>()
        };
        let parts = (0..runs).map(|run| group(&of_run(run), depth + DEEPEST / 4));
        return numbered(parts, runs);
    }
    let rows = match time.map(Variable::axes) {
        Some(axes) => axes.first().copied().unwrap_or(0),
        None => most_frequent(arrays().flat_map(|(_, array)| array.axes())),
    };
    if rows.saturating_mul(members.len()) > MOST_CELLS {
        return Err(too_large());
    }
    let columns = members.iter().flat_map(|(name, member)| columns(name, member, rows));
    Ok(vec![Frame { run: String::new(), rows, columns: columns.collect() }])
}

/// Numbers of runs and of samples, where one axis of the arrays counts runs: the times have two
/// axes, or there is an array with an axis for runs, one for samples and one for components.
fn runs_of_arrays<'a>(
    time: Option<&Variable>,
    mut arrays: impl Iterator<Item = &'a Variable>,
) -> Option<(usize, usize)> {
    let time = time?;
    match time.axes().as_slice() {
        [first, second] => {
            // Time rises along the samples.
            let Variable::Numbers { values, .. } = time else { return None };
            let row = values.get(..*second)?;
            let rises = row.is_sorted_by(|before, after| before < after);
            Some(if rises { (*first, *second) } else { (*second, *first) })
        }
        [samples] => arrays.find_map(|array| match array.axes().as_slice() {
            [runs, second, _] if second == samples => Some((*runs, *samples)),
            [first, _, runs] if first == samples => Some((*runs, *samples)),
            _ => None,
        }),
        _ => None,
    }
}

/// The length that most axes have; of several the largest.
fn most_frequent(lengths: impl Iterator<Item = usize>) -> usize {
    let mut counts = std::collections::BTreeMap::<usize, usize>::new();
    lengths.for_each(|length| *counts.entry(length).or_default() += 1);
    counts
        .into_iter()
        .max_by_key(|(length, count)| (*count, *length))
        .map_or(0, |(length, _)| length)
}

/// Groups that are alike are runs.
fn groups(members: &[(String, Variable)], depth: usize) -> Frames {
    let inner = |variable: &Variable| {
        matches!(variable, Variable::Group(_) | Variable::List(_)) && variable.measures()
    };
    let mut found: Vec<(&String, Vec<Frame>)> = Vec::new();
    let mut failed = None;
    for (name, member) in members.iter().filter(|(_, member)| inner(member)) {
        match frames(name, member, depth + 1) {
            Ok(frames) => found.push((name, frames)),
            Err(no) => failed = Some(no),
        }
    }
    let headers = |frames: &[Frame]| {
        let names =
            frames.iter().flat_map(|frame| frame.columns.iter().map(|(name, _)| name.clone()));
        names.collect::<std::collections::BTreeSet<String>>()
    };
    let alike = found.array_windows().all(|[(_, a), (_, b)]| headers(a) == headers(b));
    match found.len() {
        0 => Err(failed.unwrap_or_else(|| nothing_in("it"))),
        _ if !alike => {
            let names: Vec<String> = found.iter().map(|(name, _)| format!("`{name}`")).collect();
            Err(NoTable(
                format!("there are several tables: {}", names.join(", ")),
                format!(
                    "name one of them behind a #, as in `file#{}`",
                    found.first().map_or("", |(name, _)| name.as_str())
                ),
            ))
        }
        count => {
            found.sort_by_key(|(name, _)| counting_order(name));
            let out: Vec<Frame> = found
                .into_iter()
                .flat_map(|(name, frames)| {
                    frames.into_iter().map(
                        move |frame| {
                            if count > 1 { within(name, frame) } else { frame }
                        },
                    )
                })
                .collect();
            let rows = |frame: &Frame| frame.rows;
            let shared: Vec<&(String, Variable)> =
                members.iter().filter(|(_, member)| !inner(member)).collect();
            Ok(out
                .into_iter()
                .map(|mut frame| {
                    let rows = rows(&frame);
                    for (name, member) in &shared {
                        if frame.columns.iter().all(|(other, _)| other != name) {
                            frame.columns.extend(columns(name, member, rows));
                        }
                    }
                    frame
                })
                .collect())
        }
    }
}

/// Names in the order of the numbers at their ends: `run_2` before `run_10`.
fn counting_order(name: &str) -> (String, u64, String) {
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let number = name.strip_prefix(stem).and_then(|digits| digits.parse().ok()).unwrap_or(0);
    (stem.to_string(), number, name.to_string())
}

/// The columns that a variable is, in a table of so many rows.
fn columns(name: &str, variable: &Variable, rows: usize) -> Vec<(String, Cells)> {
    let one = |cells: Cells| vec![(name.to_string(), cells)];
    let several = |count: usize, cells: &dyn Fn(usize) -> Vec<f64>| {
        let (base, unit) = split_unit(name);
        let unit = unit.map_or(String::new(), |unit| format!(" [{unit}]"));
        let column = |at: usize| (format!("{base}_{}{unit}", at + 1), Cells::from(cells(at)));
        (0..count).map(column).collect::<Vec<_>>()
    };
    let of = |variable: Variable| match variable {
        Variable::Numbers { values, .. } => values,
        _ => Vec::new(),
    };
    match variable {
        Variable::Numbers { values, .. } => match variable.axes().as_slice() {
            [] => match values.first() {
                Some(value) => one(Cells::from(vec![*value; rows])),
                None => Vec::new(),
            },
            [length] if *length == rows => one(Cells::from(values.clone())),
            [length, count] if *length == rows => several(*count, &|at| of(variable.slice(1, at))),
            [count, length] if *length == rows => several(*count, &|at| of(variable.slice(0, at))),
            _ => one(Cells::unreadable("an array of another length than the times", rows)),
        },
        Variable::Text(lines) => match lines.as_slice() {
            [only] => one(std::iter::repeat_n(only.as_str(), rows).collect()),
            many if many.len() == rows => one(many.iter().collect()),
            _ => Vec::new(),
        },
        Variable::Unreadable(what) => one(Cells::unreadable(what, rows)),
        Variable::Group(_) | Variable::List(_) => Vec::new(),
    }
}
