//! A table of cells, just as they stand in a file of measurements.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::cell::Cell;
use super::cells::Cells;
use super::delimiter::Delimiter;
use super::header::{counted, split_unit};
use super::text::Encoding;
use crate::error::{DataError, Error, Result};

/// A table of cells with the line that each row came from.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// The file.
    pub path: PathBuf,
    /// The columns, in the file's order; all have as many cells as there are `lines`.
    pub columns: Vec<Column>,
    /// Line of the file of each row, counted from 1; of files without lines the row itself.
    pub lines: Vec<u64>,
    /// How the file was understood.
    pub reading: Reading,
    /// SHA-256 of the file's bytes, in hexadecimal digits.
    pub sha256: String,
}

/// How a file was understood.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Reading {
    /// A text file.
    Text(TextReading),
    /// A Parquet file.
    Parquet(ParquetReading),
    /// A file of another format, with names for what is in it.
    Stored(StoredReading),
    /// A table that a program made in memory.
    Memory,
}

/// How a text file was understood.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TextReading {
    /// How its text is stored.
    pub encoding: Encoding,
    /// What stands between two cells.
    pub delimiter: Delimiter,
    /// Whether numbers have a comma for their decimal sign.
    pub decimal_comma: bool,
    /// The line of the header, counted from 1; of the first row where there is none.
    pub header_line: u64,
    /// Whether there is no header: columns are called `column 1` and so on.
    pub headless: bool,
    /// The column that was made to tell runs apart, where the header stands again before each.
    pub runs: Option<String>,
    /// Set where no column is a time, and a column `sample` was made that counts the rows.
    pub counted: Option<CountedRows>,
    /// What of the file was left out or read in another way, in sentences.
    pub notes: Vec<String>,
}

/// Rows that have no time, and what the file says of the time between them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CountedRows {
    /// Seconds from one to the next.
    pub every: Option<f64>,
    /// The line that says so.
    pub told_by: Option<String>,
}

/// How a Parquet file was understood.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ParquetReading {
    /// How many groups its rows are stored in.
    pub row_groups: usize,
    /// The program that wrote it, as it says.
    pub written_by: Option<String>,
    /// Rows up to the end of each group.
    #[serde(skip)]
    pub(super) ends: Vec<u64>,
}

/// How a file of named variables or sheets was understood.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StoredReading {
    /// The format: `MATLAB`, `HDF5`, `NumPy`, `Excel` or `Arrow`.
    pub format: &'static str,
    /// What was named behind a #.
    pub part: Option<String>,
    /// The column that was made to tell runs apart, where the file keeps them apart.
    pub runs: Option<String>,
}

impl Reading {
    /// The column that tells runs apart, where the file keeps them apart by itself.
    pub fn runs(&self) -> Option<&str> {
        match self {
            Reading::Stored(stored) => stored.runs.as_deref(),
            Reading::Text(text) => text.runs.as_deref(),
            _ => None,
        }
    }

    /// Set where the rows have no time, and `sample` counts them.
    pub fn counted(&self) -> Option<&CountedRows> {
        match self {
            Reading::Text(text) => text.counted.as_ref(),
            _ => None,
        }
    }

    /// Whether the columns have no names in the file.
    pub fn headless(&self) -> bool {
        matches!(self, Reading::Text(text) if text.headless)
    }

    /// What of the file was left out or read in another way, in sentences.
    pub fn notes(&self) -> &[String] {
        match self {
            Reading::Text(text) => &text.notes,
            Reading::Parquet(_) | Reading::Stored(_) | Reading::Memory => &[],
        }
    }

    /// Line of the header, in files that have lines.
    pub fn header_line(&self) -> Option<u64> {
        match self {
            Reading::Text(text) => Some(text.header_line),
            Reading::Parquet(_) | Reading::Stored(_) | Reading::Memory => None,
        }
    }

    /// What a place in the file is called: "line" or "row".
    pub fn noun(&self) -> &'static str {
        match self {
            Reading::Text(_) => "line",
            Reading::Parquet(_) | Reading::Stored(_) | Reading::Memory => "row",
        }
    }

    /// In words, for people.
    pub(crate) fn sentence(&self) -> String {
        match self {
            Reading::Text(text) => format!(
                "{}, {} between cells{}",
                text.encoding.name(),
                text.delimiter.name(),
                if text.decimal_comma { ", decimal commas" } else { "" }
            ),
            Reading::Parquet(parquet) => {
                let by = parquet.written_by.as_ref().map(|by| format!(", written by {by}"));
                format!(
                    "Parquet, {}{}",
                    counted(parquet.row_groups, "row group"),
                    by.unwrap_or_default()
                )
            }
            Reading::Stored(stored) => {
                let part = stored.part.as_ref().map(|part| format!(", of it `{part}`"));
                let runs = stored.runs.as_ref().map_or("", |_| ", runs kept apart in the file");
                format!("{}{}{runs}", stored.format, part.unwrap_or_default())
            }
            Reading::Memory => "a table in memory".to_string(),
        }
    }

    pub(super) fn decimal_comma(&self) -> bool {
        matches!(self, Reading::Text(text) if text.decimal_comma)
    }

    /// The group that holds a row, counted from 1 like the row.
    fn row_group(&self, row: Option<u64>) -> Option<u32> {
        match (self, row) {
            (Reading::Parquet(parquet), Some(row)) => {
                let before = parquet.ends.partition_point(|end| *end < row);
                u32::try_from(before + 1).ok()
            }
            _ => None,
        }
    }
}

/// One column of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// The header without its unit: `theta` of `theta [rad]`.
    pub name: String,
    /// The whole header as it stands in the file: `theta [rad]`.
    pub header: String,
    /// The unit that the header names; `1` when it says that there is none (`[-]`).
    pub unit: Option<String>,
    /// The cells, without blanks around them.
    pub cells: Cells,
}

/// A column under a header, which may name a unit as in files.
pub fn column_of(header: &str, cells: Cells) -> Column {
    let (name, unit) = split_unit(header);
    Column { name, header: header.to_string(), unit, cells }
}

impl Table {
    /// How many rows there are.
    pub fn rows(&self) -> usize {
        self.lines.len()
    }

    /// What a cell says as a number.
    pub fn cell(&self, column: &Column, row: usize) -> Cell {
        column.cells.number(row, self.reading.decimal_comma())
    }

    /// Whether a column is one of numbers, though some of its cells may be wrong: more of them
    /// are finite numbers than are anything else but missing.
    pub fn is_numeric(&self, column: &Column) -> bool {
        let (mut numbers, mut others) = (0, 0);
        for row in 0..column.cells.len() {
            match self.cell(column, row) {
                Cell::Number(_) => numbers += 1,
                Cell::Missing => {}
                _ => others += 1,
            }
        }
        numbers > others
    }

    /// A column as numbers, NaN where a cell is missing.
    ///
    /// # Errors
    /// The first cell that is text, infinite or too large, with its line and column.
    pub fn numbers(&self, column: &Column) -> Result<Vec<f64>> {
        if let Some(what) = column.cells.unread() {
            return Err(self.unread(column, what));
        }
        if let Some(numbers) =
            column.cells.as_numbers().filter(|n| !n.iter().any(|x| x.is_infinite()))
        {
            return Ok(numbers.to_vec());
        }
        (0..column.cells.len())
            .map(|row| match self.cell(column, row) {
                Cell::Number(number) => Ok(number),
                Cell::Missing => Ok(f64::NAN),
                wrong => Err(self.wrong_cell(column, row, wrong)),
            })
            .collect()
    }

    /// A column of things that are neither numbers nor names.
    pub(super) fn unread(&self, column: &Column, what: &str) -> Error {
        let hint = if what.contains("time") || what.contains("date") {
            "write times as numbers, such as seconds since the start; dates are not read"
        } else {
            "write a number in every cell, or null if nothing was measured"
        };
        let message = format!("the column holds {what}, not numbers");
        self.error(None, Some(&column.header), message, hint)
    }

    /// A run column of things that are neither numbers nor text.
    pub(super) fn names_no_run(&self, column: &Column, what: &str) -> Error {
        let message = format!("the column holds {what}, which name no run");
        self.error(None, Some(&column.header), message, "name runs by text or by whole numbers")
    }

    fn wrong_cell(&self, column: &Column, row: usize, cell: Cell) -> Error {
        let text = shortened(&column.cells.get(row));
        let (message, hint) = match cell {
            Cell::Infinite => (
                format!("`{text}` is infinite"),
                "leave the cell empty if nothing was measured".to_string(),
            ),
            Cell::TooLarge => (
                format!("`{text}` is too large for a number"),
                "write numbers below 1.8e308, or leave the cell empty".to_string(),
            ),
            _ => (format!("`{text}` is not a number"), hint_for(&text)),
        };
        self.error(self.lines.get(row).copied(), Some(&column.header), message, hint)
    }

    /// An error about this file; `line` is one of [`Table::lines`].
    pub fn error(
        &self,
        line: Option<u64>,
        column: Option<&str>,
        message: impl Into<String>,
        hint: impl Into<String>,
    ) -> Error {
        Error::Data(DataError {
            file: self.path.clone(),
            line,
            row_group: self.reading.row_group(line),
            column: column.map(str::to_string),
            message: message.into(),
            hint: hint.into(),
        })
    }

    /// The column called `name`: by its whole header, by its name without the unit, or,
    /// failing both, by its name in other capitals. `None` when there is no such column.
    ///
    /// # Errors
    /// More than one column answers to the name.
    pub fn find(&self, name: &str) -> Result<Option<&Column>> {
        let name = name.trim();
        let lower = name.to_lowercase();
        let rules: [&dyn Fn(&Column) -> bool; 3] =
            [&|column| column.header == name, &|column| column.name == name, &|column| {
                column.name.to_lowercase() == lower || column.header.to_lowercase() == lower
            }];
        for rule in rules {
            let found: Vec<&Column> = self.columns.iter().filter(|c| rule(c)).collect();
            match found.as_slice() {
                [] => {}
                [one] => return Ok(Some(one)),
                many => {
                    let same = many.iter().any(|column| column.header.contains(" (column "));
                    let headers: Vec<String> =
                        many.iter().map(|c| format!("`{}`", c.header)).collect();
                    return Err(self.error(
                        self.reading.header_line(),
                        Some(name),
                        if same {
                            format!("two columns are called `{name}`: {}", headers.join(" and "))
                        } else {
                            format!("`{name}` can be any of the columns {}", headers.join(" and "))
                        },
                        if same {
                            "give every column a name of its own, or name one as it is called here"
                        } else {
                            "name the column by its whole header"
                        },
                    ));
                }
            }
        }
        Ok(None)
    }
}

fn hint_for(text: &str) -> String {
    if text.contains('\n') {
        return "close the quotation mark that opens this cell".to_string();
    }
    let digits = text.starts_with(|c: char| c.is_ascii_digit());
    if digits && (text.contains(':') || text.matches(['-', '/']).count() == 2) {
        "write all times of a column in one form, such as 10:00:00.1, or as seconds since the start"
            .to_string()
    } else if digits && text.contains(',') {
        "write numbers without thousands separators, and with one decimal sign in the whole file"
            .to_string()
    } else {
        "write a number there, or leave the cell empty if nothing was measured".to_string()
    }
}

fn shortened(text: &str) -> String {
    if text.chars().count() <= 40 {
        return text.to_string();
    }
    text.chars().take(37).chain("...".chars()).collect()
}

/// An error about a data file.
pub(super) fn wrong(
    path: &Path,
    line: Option<u64>,
    column: Option<&str>,
    message: impl Into<String>,
    hint: impl Into<String>,
) -> Error {
    Error::Data(DataError {
        file: path.to_path_buf(),
        line,
        row_group: None,
        column: column.map(str::to_string),
        message: message.into(),
        hint: hint.into(),
    })
}
