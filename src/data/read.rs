//! Reading a text file of measurements as people really have it.

use std::path::Path;

use csv::StringRecord;
use sha2::{Digest, Sha256};

use super::cell::{Cell, parse_cell};
use super::cells::Cells;
use super::header::{counted, split_unit};
use super::layout;
use super::lines::{LOOKED_AT, LaidOut, Line, builder, laid_out, numbered};
use super::mapping::TIME_NAMES;
use super::moment::{Order, moment, seconds_of};
use super::table::{Column, CountedRows, Reading, Table, TextReading, column_of, wrong};
use super::text::decode;
use super::told_rate::seconds_between;
use super::unit_words::known_unit;
use crate::error::Result;

/// Reads measurements from the bytes of a text file, which errors call `path`: cells between
/// commas, tabs, semicolons, bars or blanks under a header. Comment lines (`#`, `%`) and blank
/// lines are skipped; a header that is itself a comment, as NumPy writes it, is found; so are what
/// stands above a header and below a table ([`layout`]).
///
/// # Errors
/// The file is not text, is empty, has no rows, or has rows of different lengths.
pub(super) fn read_bytes(path: &Path, bytes: &[u8]) -> Result<Table> {
    let (text, encoding) = decode(bytes).map_err(|not| {
        wrong(
            path,
            Some(not.line),
            None,
            format!("this is not a text file: it has {}", not.what),
            "export the measurements as CSV",
        )
    })?;
    let (lines, said) = numbered(&text);
    let mut laid_out = laid_out(path, &lines, said)?;
    let (builder, again) = TableBuilder::parse(path, &laid_out)?;
    let (header_line, mut columns, rows) = builder.finish(path)?;
    let runs = (!again.is_empty()).then(|| run_column(&mut columns, &rows, &again));
    let mut notes = std::mem::take(&mut laid_out.notes);
    notes.extend(without_thousands(&mut columns));
    // Before clocks are read: their digits are written with points.
    let decimal_comma = has_decimal_comma(&columns);
    notes.extend(columns.iter_mut().filter_map(clocks_to_seconds));
    notes.extend(columns.iter_mut().filter_map(without_marked));
    notes.extend(columns.iter_mut().filter_map(without_tails));
    let count = count_of_rows(&columns, rows.len(), decimal_comma);
    let counted = count.is_some().then(|| CountedRows::told(&lines, rows.first().copied()));
    if let Some(count) = count {
        columns.push(count);
        notes.push("no column rises as a time does: `sample` counts the rows.".to_string());
    }
    Ok(Table {
        path: path.to_path_buf(),
        reading: Reading::Text(TextReading {
            encoding,
            delimiter: laid_out.delimiter,
            decimal_comma,
            header_line,
            headless: laid_out.headless,
            runs,
            counted,
            notes,
        }),
        columns,
        lines: rows,
        sha256: format!("{:x}", Sha256::digest(bytes)),
    })
}

/// A column that counts the runs which begin at some lines; gives its name.
fn run_column(columns: &mut Vec<Column>, rows: &[u64], begins: &[u64]) -> String {
    let mut name = "run".to_string();
    while columns.iter().any(|column| column.name == name) {
        name.push('_');
    }
    let run = |line: &u64| 1 + begins.partition_point(|begin| begin <= line);
    let cells: Cells = rows.iter().map(|line| run(line).to_string()).collect();
    columns.push(column_of(&name, cells));
    name
}

/// Clock times and dates become seconds; says so.
fn clocks_to_seconds(column: &mut Column) -> Option<String> {
    let first = column.cells.iter().find(|cell| parse_cell(cell, true) != Cell::Missing)?;
    moment(&first, Order::MonthFirst).or_else(|| moment(&first, Order::DayFirst))?;
    drop(first);
    let cells: Vec<String> = column.cells.iter().map(std::borrow::Cow::into_owned).collect();
    let missing = |cell: &str| parse_cell(cell, true) == Cell::Missing;
    let (seconds, since) = seconds_of(cells.iter().map(String::as_str), missing)?;
    column.cells = seconds.into_iter().collect();
    column.unit = Some("s".to_string());
    Some(format!("`{}` read as seconds {since}.", column.header))
}

/// What the column is called that counts the rows.
pub(super) const SAMPLE: &str = "sample";

/// A column that counts the rows, where no other is a time, by its name or because it rises.
fn count_of_rows(columns: &[Column], rows: usize, decimal_comma: bool) -> Option<Column> {
    let is_time = |column: &Column| {
        let name = column.name.to_lowercase();
        let cells = column.cells.len().min(LOOKED_AT);
        let mut last = None;
        let (mut up, mut steps) = (0, 0);
        for row in 0..cells {
            let Cell::Number(number) = column.cells.number(row, decimal_comma) else { continue };
            up += usize::from(last.is_some_and(|last| number > last));
            steps += usize::from(last.is_some());
            last = Some(number);
        }
        // Where every few rows are a run of their own, time falls often.
        name == SAMPLE || TIME_NAMES.contains(&name.as_str()) || 5 * up > 3 * steps
    };
    if rows < 3 || columns.iter().any(is_time) {
        return None;
    }
    Some(column_of(SAMPLE, (0..rows).map(|row| row.to_string()).collect()))
}

impl CountedRows {
    /// With what the lines above the first row say.
    fn told(lines: &[Line], first: Option<u64>) -> CountedRows {
        let above = lines.iter().take_while(|line| first.is_none_or(|first| line.number < first));
        let told = above.filter_map(|line| Some((line.text.trim(), seconds_between(line.text)?)));
        match told.last() {
            Some((text, seconds)) => {
                CountedRows { every: Some(seconds), told_by: Some(super::visible(text)) }
            }
            None => CountedRows { every: None, told_by: None },
        }
    }
}

/// Readings that the instrument marked as doubtful (`1.2*`) are left out; says so.
fn without_marked(column: &mut Column) -> Option<String> {
    let marked = |cell: &str| {
        let number = cell.trim_end_matches(MARKS).trim_end();
        number.len() < cell.len() && matches!(parse_cell(number, true), Cell::Number(_))
    };
    let count = column.cells.iter().filter(|cell| marked(cell)).count();
    // Where most have a mark it is no doubt.
    if count == 0 || 2 * count > column.cells.len() {
        return None;
    }
    let kept = |cell: std::borrow::Cow<'_, str>| match marked(&cell) {
        true => String::new(),
        false => cell.into_owned(),
    };
    let cells: Cells = column.cells.iter().map(kept).collect();
    column.cells = cells;
    Some(format!(
        "{} of `{}` marked as doubtful (such as `1.2*`) left out.",
        counted(count, "cell"),
        column.header
    ))
}

/// Units and errors behind the numbers of a whole column (`0.1 s`, `1.5 ± 0.1`) are taken off; says
/// so.
fn without_tails(column: &mut Column) -> Option<String> {
    let divided = |cell: &str| {
        let error = cell.find('±').or_else(|| cell.find("+/-"));
        let unit = || cell.trim_end_matches(|c: char| !c.is_ascii_digit() && c != '.').len();
        let (number, tail) = cell.split_at_checked(error.unwrap_or_else(unit))?;
        let is_number = matches!(parse_cell(number, true), Cell::Number(_));
        let tail = if error.is_some() { "±" } else { tail.trim() };
        (is_number && !tail.is_empty()).then(|| (number.trim().to_string(), tail.to_string()))
    };
    let missing = |cell: &str| parse_cell(cell, true) == Cell::Missing;
    let present = || column.cells.iter().filter(|cell| !missing(cell));
    let (_, tail) = divided(&present().next()?)?;
    let unit = known_unit(&tail).filter(|_| tail != "±");
    if unit.is_none() && tail != "±" {
        return None;
    }
    let same = |cell: &str| divided(cell).is_some_and(|(_, other)| other == tail);
    if !present().all(|cell| same(&cell)) {
        return None;
    }
    let number =
        |cell: std::borrow::Cow<'_, str>| divided(&cell).map_or_else(String::new, |row| row.0);
    let cells: Cells = column.cells.iter().map(number).collect();
    column.cells = cells;
    column.unit = column.unit.take().or(unit);
    Some(format!("`{tail}` behind the numbers of `{}` taken off.", column.header))
}

/// Marks behind a number that its instrument doubts.
const MARKS: [char; 6] = ['*', '†', '!', '?', '~', '#'];

/// The columns while they are being filled, row by row.
pub(super) struct TableBuilder {
    header_line: u64,
    columns: Vec<Column>,
    lines: Vec<u64>,
}

impl TableBuilder {
    fn parse(path: &Path, laid_out: &LaidOut) -> Result<(Self, Vec<u64>)> {
        let (lines, delimiter) = (&laid_out.lines, laid_out.delimiter);
        // The parser sees only lines with cells, so that its line numbers lead back to
        // ours; quoted cells may still span several of them.
        let mut text = String::new();
        for (_, line) in lines {
            text.push_str(&delimiter.tidy(line));
            text.push('\n');
        }
        let mut reader = builder(delimiter).from_reader(text.as_bytes());
        let mut record = StringRecord::new();
        let mut rows: Option<TableBuilder> = None;
        if let Some((line, header)) = &laid_out.header {
            rows = Some(TableBuilder::begin(*line, header));
        }
        if let (Some(rows), Some(units)) = (&mut rows, &laid_out.units) {
            rows.take_units(units);
        }
        loop {
            let more = reader.read_record(&mut record).map_err(|error| {
                let message = format!("the row cannot be divided into cells ({error})");
                wrong(path, None, None, message, "export the measurements as CSV")
            })?;
            if !more {
                break;
            }
            let index = record.position().map_or(1, csv::Position::line);
            let line = usize::try_from(index.saturating_sub(1))
                .ok()
                .and_then(|index| lines.get(index))
                .map_or(0, |(number, _)| *number);
            match &mut rows {
                None => rows = Some(TableBuilder::begin(line, &record)),
                Some(rows) => rows.add(path, line, &record)?,
            }
        }
        let rows = rows.ok_or_else(|| {
            let hint = "give a header that names the columns, and one row per sample";
            wrong(path, None, None, "the file is empty", hint)
        })?;
        let line_of = |at: &usize| lines.get(*at).map(|(number, _)| *number);
        Ok((rows, laid_out.begins.iter().filter_map(line_of).collect()))
    }

    /// The columns of the rows of a sheet, and the row of each cell.
    #[cfg(feature = "files")]
    pub(super) fn of_rows(
        path: &Path,
        rows: Vec<(u64, StringRecord)>,
    ) -> Result<(Vec<Column>, Vec<u64>)> {
        let first: Vec<StringRecord> =
            rows.iter().take(LOOKED_AT).map(|(_, row)| row.clone()).collect();
        let found = layout::find(&first).filter(|_| !layout::is_plain(&first));
        let row = |at: usize| rows.get(at).map(|(_, row)| row);
        let header = found.as_ref().map_or(Some(0), |found| found.header);
        let begins = found.as_ref().map_or(1, |found| found.first);
        let above = found.as_ref().and_then(|found| row(found.above?));
        let (line, names) = match header.and_then(|at| rows.get(at)) {
            Some((line, names)) => {
                (*line, above.map_or_else(|| names.clone(), |above| layout::joined(names, above)))
            }
            None => {
                let width = found.as_ref().map_or(0, |found| found.width);
                (0, (1..=width).map(|at| format!("column {at}")).collect())
            }
        };
        let mut builder = TableBuilder::begin(line, &names);
        if let Some(units) = found.as_ref().and_then(|found| row(found.units?)) {
            builder.take_units(units);
        }
        let said = |row: &StringRecord| layout::is_text(row.get(0).unwrap_or_default());
        let first = |at: usize| row(at).and_then(|row| row.get(0));
        let counts = rows.get(begins).is_some_and(|(_, row)| !said(row))
            && first(begins) != first(begins + 1);
        let below =
            rows.iter().skip(begins).rev().take_while(|(_, row)| counts && said(row)).count();
        let below = if below > super::lines::MOST_BELOW { 0 } else { below };
        for (line, row) in rows.iter().take(rows.len() - below).skip(begins) {
            let mut row = row.clone();
            while row.len() < builder.columns.len() {
                row.push_field("");
            }
            builder.add(path, *line, &row)?;
        }
        let (_, mut columns, lines) = builder.finish(path)?;
        columns.iter_mut().for_each(|column| drop(clocks_to_seconds(column)));
        Ok((columns, lines))
    }

    fn begin(line: u64, header: &StringRecord) -> Self {
        let width = header
            .iter()
            .enumerate()
            .filter(|(_, cell)| !cell.is_empty())
            .last()
            .map_or(0, |(at, _)| at + 1);
        let mut columns: Vec<Column> = Vec::with_capacity(width);
        let mut seen = std::collections::HashMap::new();
        header.iter().take(width).for_each(|cell| *seen.entry(cell).or_insert(0) += 1);
        for (at, cell) in header.iter().take(width).enumerate() {
            let mut column = match cell {
                "" => column_of(&format!("column {}", at + 1), Cells::default()),
                // A name has one line, and no quotation mark, so that a spec can name it.
                cell if cell.contains(['\n', '\r', '"']) => {
                    let words: Vec<&str> = cell.split_whitespace().collect();
                    column_of(&words.join(" ").replace('"', "'"), Cells::default())
                }
                cell => column_of(cell, Cells::default()),
            };
            if column.name.is_empty() {
                (column.name, column.unit) = (column.header.clone(), None);
            }
            if !cell.is_empty() && seen.get(cell).is_some_and(|count| *count > 1) {
                column.header = format!("{} (column {})", column.header, at + 1);
            }
            columns.push(column);
        }
        TableBuilder { header_line: line, columns, lines: Vec::new() }
    }

    fn add(&mut self, path: &Path, line: u64, record: &StringRecord) -> Result<()> {
        // Spreadsheets leave rows of nothing but delimiters at the end.
        if record.iter().all(str::is_empty) {
            return Ok(());
        }
        let expected = self.columns.len();
        let extra = record.iter().skip(expected).any(|surplus| !surplus.is_empty());
        if record.len() < expected || extra {
            let hint = if record.iter().any(|cell| cell.contains('\n')) {
                "close the quotation mark that is open there".to_string()
            } else if record.len() == expected + 1 && self.lines.is_empty() {
                format!(
                    "name every column in the header, or remove the cell that is too many; if the \
                     first cells number the rows, begin the header with a name for them: `row`, \
                     then `{}`",
                    self.columns.first().map_or("", |column| column.header.as_str())
                )
            } else {
                "write one cell per column, and leave a cell empty where nothing was measured"
                    .to_string()
            };
            return Err(wrong(
                path,
                Some(line),
                None,
                format!(
                    "this row has {}, but the header names {}",
                    counted(record.len(), "cell"),
                    counted(expected, "column")
                ),
                hint,
            ));
        }
        let bracketed = |cell: &str| matches!(split_unit(cell), (name, Some(_)) if name.is_empty());
        if self.lines.is_empty() && record.iter().all(|cell| cell.is_empty() || bracketed(cell)) {
            self.take_units(record);
            return Ok(());
        }
        for (column, cell) in self.columns.iter_mut().zip(record.iter()) {
            column.cells.push(cell);
        }
        self.lines.push(line);
        Ok(())
    }

    /// Takes the units from a row of them (`[s],[rad]`) under the header.
    fn take_units(&mut self, record: &StringRecord) {
        for (column, cell) in self.columns.iter_mut().zip(record.iter()) {
            let inside = match split_unit(cell) {
                (name, Some(unit)) if name.is_empty() => unit,
                _ => cell.to_string(),
            };
            column.unit = column.unit.take().or((!inside.is_empty()).then_some(inside));
        }
    }

    fn finish(self, path: &Path) -> Result<(u64, Vec<Column>, Vec<u64>)> {
        if self.lines.is_empty() {
            return Err(wrong(
                path,
                Some(self.header_line),
                None,
                "there is a header, but no row of measurements below it",
                "add the measurements, one row per sample",
            ));
        }
        Ok((self.header_line, self.columns, self.lines))
    }
}

/// Points between thousands are taken out, where some number has a decimal comma behind them
/// (`1.234,5`); says so.
fn without_thousands(columns: &mut [Column]) -> Option<String> {
    let shows = |cell: &str| cell.contains(',') && is_grouped(cell);
    let shown = columns.iter().flat_map(|column| column.cells.iter()).find(|cell| shows(cell))?;
    let note =
        format!("points between thousands (such as `{}`) taken out.", super::visible(&shown));
    for column in columns {
        if column.cells.iter().any(|cell| is_grouped(&cell)) {
            let plain = |cell: std::borrow::Cow<'_, str>| match is_grouped(&cell) {
                true => cell.replace('.', ""),
                false => cell.into_owned(),
            };
            let cells: Cells = column.cells.iter().map(plain).collect();
            column.cells = cells;
        }
    }
    Some(note)
}

/// Whether a number has points between its thousands: `1.234` or `-12.345.678,9`.
fn is_grouped(cell: &str) -> bool {
    let digits = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
    let unsigned = cell.trim_start_matches(['+', '-', '−']);
    let (whole, behind) = unsigned.split_once(',').unwrap_or((unsigned, ""));
    let mut groups = whole.split('.');
    let first = groups.next().unwrap_or_default();
    let rest: Vec<&str> = groups.collect();
    (1..=3).contains(&first.len())
        && digits(first)
        && digits(behind)
        && !rest.is_empty()
        && rest.iter().all(|group| group.len() == 3 && digits(group))
}

/// Whether numbers have a decimal comma: some only make sense with one, and none has a
/// decimal point.
fn has_decimal_comma(columns: &[Column]) -> bool {
    let mut commas = false;
    for cell in columns.iter().flat_map(|column| column.cells.iter()) {
        if cell.contains(',') {
            commas |= matches!(parse_cell(&cell, true), Cell::Number(_));
        } else if cell.contains('.') && matches!(parse_cell(&cell, false), Cell::Number(_)) {
            return false;
        }
    }
    commas
}
