//! Groups of runs that have numbers of their own: springs, rigs, days.

use std::collections::HashMap;

use super::mapping::{Mapping, missing_column};
use super::table::{Column, Table};
use super::{Dataset, Run};
use crate::error::Result;

/// Notes of every run which groups it belongs to.
///
/// # Errors
/// A column that is not there, a cell that is empty, or a run that changes its group.
pub(super) fn take_groups(data: &mut Dataset, table: &Table, mapping: &Mapping) -> Result<()> {
    if mapping.groups.is_empty() {
        return Ok(());
    }
    let rows: HashMap<u64, usize> =
        (0..).zip(&table.lines).map(|(row, line)| (*line, row)).collect();
    for by in &mapping.groups {
        let column = match by {
            Some(name) => match table.find(name)? {
                Some(column) => Some(column),
                None => return Err(missing_column(table, name, "the groups of runs")),
            },
            None => None,
        };
        for run in &mut data.runs {
            let group = match column {
                Some(column) => group_of(run, column, table, &rows)?,
                None => String::new(),
            };
            run.groups.push(group);
        }
    }
    Ok(())
}

fn group_of(
    run: &Run,
    column: &Column,
    table: &Table,
    rows: &HashMap<u64, usize>,
) -> Result<String> {
    let cell = |line: &u64| rows.get(line).map(|row| column.cells.get(*row));
    let first = run.lines.first().and_then(cell).unwrap_or_default();
    for line in &run.lines {
        let here = cell(line).unwrap_or_default();
        let wrong = |message, hint| table.error(Some(*line), Some(&column.header), message, hint);
        if here.is_empty() {
            return Err(wrong(
                format!("run {} belongs to no group by `{}`", run.name, column.name),
                "name its group in every row of the run",
            ));
        }
        if here != first {
            return Err(wrong(
                format!("`{}` changes from {first} to {here} within run {}", column.name, run.name),
                "a run belongs to one group: name another column, or give each recording a run \
                 name of its own",
            ));
        }
    }
    Ok(first.into_owned())
}
