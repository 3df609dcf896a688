//! Times that no column holds: a sample every so often, counted from zero in each run.

use std::collections::HashMap;

use super::cells::Cells;
use super::mapping::{ColumnMap, Mapping, TIME_NAMES};
use super::table::{Table, column_of};
use crate::error::Result;

/// The column that is made of counted times.
const COUNTED: &str = "(counted time)";

/// Rows that were counted so far.
pub(super) struct Counter {
    period: f64,
    /// Samples per unit of time, where that is a whole number: dividing by it gives the very times
    /// that a file would have.
    rate: Option<f64>,
    pairs: bool,
    /// Rows of a run stand together: a run that ended does not come back.
    in_order: bool,
    rows: u64,
    of_run: HashMap<String, u64>,
}

impl Counter {
    /// Where a mapping asks for it; with `pairs`, every two rows are one run.
    pub(super) fn of(mapping: &Mapping, pairs: bool, in_order: bool) -> Option<Counter> {
        let period = mapping.every?;
        let rate = (1.0 / period).round();
        let whole = (rate * period - 1.0).abs() < 4.0 * f64::EPSILON;
        Some(Counter {
            period,
            rate: whole.then_some(rate),
            pairs,
            in_order,
            rows: 0,
            of_run: HashMap::new(),
        })
    }

    /// Adds the times of the next rows as a column, in the spec's unit. Rows in which nothing was
    /// measured count too: time passes over them.
    pub(super) fn add(&mut self, table: &mut Table, run: Option<&str>) -> Result<()> {
        let run = match run {
            Some(name) if !self.pairs => table.find(name)?,
            _ => None,
        };
        let times: Vec<f64> = (0..table.rows())
            .map(|row| {
                self.rows += 1;
                let place = match run {
                    _ if self.pairs => (self.rows - 1) % 2,
                    Some(column) => self.place(&column.cells.get(row)),
                    None => self.rows - 1,
                };
                self.rate.map_or(place as f64 * self.period, |rate| place as f64 / rate)
            })
            .collect();
        table.columns.push(column_of(COUNTED, Cells::from(times)));
        Ok(())
    }

    /// The place of the next row of a run, counted from 0.
    fn place(&mut self, run: &str) -> u64 {
        if let Some(count) = self.of_run.get_mut(run) {
            *count += 1;
            return *count;
        }
        if self.in_order {
            self.of_run.clear();
        }
        self.of_run.insert(run.to_string(), 0);
        0
    }
}

/// Gives all rows of a table their times, where a mapping says that they are counted.
///
/// # Errors
/// The run column can be any of several.
pub fn count_times(table: &mut Table, mapping: &mut Mapping, pairs: bool) -> Result<()> {
    if let Some(mut counter) = Counter::of(mapping, pairs, false) {
        counter.add(table, mapping.run.as_deref())?;
        mapping.time = Some(counted());
    }
    Ok(())
}

/// The column of counted times.
pub(super) fn counted() -> ColumnMap {
    ColumnMap::plain(COUNTED)
}

/// Says so, where a column might have been meant for the time.
pub(super) fn note(table: &Table, mapping: &Mapping) -> Result<Option<String>> {
    if mapping.every.is_none() {
        return Ok(None);
    }
    for name in TIME_NAMES {
        if let Some(column) = table.find(name)? {
            return Ok(Some(format!(
                "Times are counted, as `every` in the spec's data block says; the column `{}` is \
                 not read as the time.",
                column.header
            )));
        }
    }
    Ok(None)
}
