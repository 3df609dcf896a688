//! Reading a text file of measurements as people really have it.

use std::path::Path;

use csv::StringRecord;
use sha2::{Digest, Sha256};

use super::cell::{Cell, parse_cell};
use super::cells::Cells;
use super::delimiter::Delimiter;
use super::header::{counted, split_unit};
use super::table::{Column, Reading, Table, TextReading, wrong};
use super::text::decode;
use crate::error::Result;

/// Reads measurements from the bytes of a text file, which errors call `path`: cells between
/// commas, tabs, semicolons, bars or blanks under a header. Comment lines (`#`, `%`) and blank
/// lines are skipped; a header that is itself a comment, as NumPy writes it, is found.
///
/// # Errors
/// The file is not text, is empty, has no header or no rows, has rows of different lengths,
/// or two columns with the same header.
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
    let Lines { lines, delimiter } = header_and_rows(path, &text)?;
    let (header_line, columns, rows) =
        TableBuilder::parse(path, &lines, delimiter)?.finish(path)?;
    Ok(Table {
        path: path.to_path_buf(),
        reading: Reading::Text(TextReading {
            encoding,
            delimiter,
            decimal_comma: has_decimal_comma(&columns),
            header_line,
        }),
        columns,
        lines: rows,
        sha256: format!("{:x}", Sha256::digest(bytes)),
    })
}

/// The lines that hold cells, the header first, each with its number in the file.
struct Lines<'a> {
    lines: Vec<(u64, &'a str)>,
    delimiter: Delimiter,
}

fn header_and_rows<'a>(path: &Path, text: &'a str) -> Result<Lines<'a>> {
    // A lone carriage return ends lines in files from very old programs.
    let end = if text.contains('\n') { '\n' } else { '\r' };
    let mut numbered = (1..)
        .zip(text.split(end))
        .map(|(number, line)| (number, line.trim_end_matches(['\r', '\x1a'])))
        .peekable();
    let said = match numbered.peek() {
        Some((_, line)) => declared_delimiter(line),
        None => None,
    };
    if said.is_some() {
        numbered.next();
    }
    let mut comment = None;
    let mut lines: Vec<(u64, &str)> = Vec::new();
    for (number, line) in numbered {
        let start = line.trim_start();
        if start.is_empty() {
            continue;
        }
        // `#N/A` is a spreadsheet's missing cell, not a comment.
        if start.starts_with(['#', '%']) && !start.starts_with("#N/A") {
            if lines.is_empty() {
                comment = Some((number, start.trim_start_matches(['#', '%'])));
            }
        } else {
            lines.push((number, line));
        }
    }
    if lines.is_empty() {
        let message = match comment {
            Some(_) => "the file has only comment lines",
            None => "the file is empty",
        };
        let hint = "give a header that names the columns, and one row per sample";
        return Err(wrong(path, None, None, message, hint));
    }
    let delimiter = said.unwrap_or_else(|| sniff(&lines));
    if !is_numeric(&lines, delimiter) {
        return Ok(Lines { lines, delimiter });
    }
    let first = lines.first().map(|(number, _)| *number);
    if let Some(comment) = comment {
        lines.insert(0, comment);
        let delimiter = said.unwrap_or_else(|| sniff(&lines));
        let cells = |at: usize| lines.get(at).map(|(_, line)| record(line, delimiter).len());
        if cells(0) == cells(1) {
            return Ok(Lines { lines, delimiter });
        }
    }
    Err(wrong(
        path,
        first,
        None,
        "the first row holds numbers, so there is no header",
        "add a first line that names the columns, such as `t,theta,omega`",
    ))
}

/// What a first line `sep=;` says.
fn declared_delimiter(line: &str) -> Option<Delimiter> {
    let said = line.trim_matches('"').strip_prefix("sep=")?;
    let mut characters = said.chars();
    match (characters.next(), characters.next()) {
        (Some(one), None) => Delimiter::from_char(one),
        _ => None,
    }
}

fn sniff(lines: &[(u64, &str)]) -> Delimiter {
    let first: Vec<&str> = lines.iter().take(200).map(|(_, line)| *line).collect();
    Delimiter::sniff(&first)
}

fn is_numeric(lines: &[(u64, &str)], delimiter: Delimiter) -> bool {
    let Some((_, line)) = lines.first() else {
        return false;
    };
    let record = record(line, delimiter);
    let mut numbers = 0;
    for cell in &record {
        match parse_cell(cell, true) {
            Cell::Number(_) | Cell::Infinite | Cell::TooLarge => numbers += 1,
            Cell::Missing => {}
            Cell::Text => return false,
        }
    }
    numbers > 0
}

/// One line by itself as cells.
fn record(line: &str, delimiter: Delimiter) -> StringRecord {
    let line = delimiter.tidy(line);
    let mut record = StringRecord::new();
    // A failure leaves the record empty, and the whole file is parsed with errors later.
    let _ = builder(delimiter).from_reader(line.as_bytes()).read_record(&mut record);
    record
}

fn builder(delimiter: Delimiter) -> csv::ReaderBuilder {
    let mut builder = csv::ReaderBuilder::new();
    builder.delimiter(delimiter.byte()).has_headers(false).flexible(true).trim(csv::Trim::All);
    builder
}

/// The columns while they are being filled, row by row.
pub(super) struct TableBuilder {
    header_line: u64,
    columns: Vec<Column>,
    lines: Vec<u64>,
}

impl TableBuilder {
    fn parse(path: &Path, lines: &[(u64, &str)], delimiter: Delimiter) -> Result<Self> {
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
                None => rows = Some(TableBuilder::begin(path, line, &record)?),
                Some(rows) => rows.add(path, line, &record)?,
            }
        }
        rows.ok_or_else(|| {
            let hint = "give a header that names the columns, and one row per sample";
            wrong(path, None, None, "the file is empty", hint)
        })
    }

    pub(super) fn begin(path: &Path, line: u64, header: &StringRecord) -> Result<Self> {
        let width = header
            .iter()
            .enumerate()
            .filter(|(_, cell)| !cell.is_empty())
            .last()
            .map_or(0, |(at, _)| at + 1);
        let mut columns: Vec<Column> = Vec::with_capacity(width);
        let mut seen = std::collections::HashSet::new();
        for (at, cell) in header.iter().take(width).enumerate() {
            let header =
                if cell.is_empty() { format!("column {}", at + 1) } else { cell.to_string() };
            if !seen.insert(header.clone()) {
                return Err(wrong(
                    path,
                    Some(line),
                    Some(&header),
                    format!("two columns are called `{header}`"),
                    "give every column a name of its own",
                ));
            }
            let (name, unit) = match split_unit(&header) {
                (name, unit) if !name.is_empty() => (name, unit),
                _ => (header.clone(), None),
            };
            columns.push(Column { name, header, unit, cells: Cells::default() });
        }
        Ok(TableBuilder { header_line: line, columns, lines: Vec::new() })
    }

    pub(super) fn add(&mut self, path: &Path, line: u64, record: &StringRecord) -> Result<()> {
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
                "name every column in the header, or remove the cell that is too many".to_string()
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
        if self.lines.is_empty() && self.take_units(record) {
            return Ok(());
        }
        for (column, cell) in self.columns.iter_mut().zip(record.iter()) {
            column.cells.push(cell);
        }
        self.lines.push(line);
        Ok(())
    }

    /// How many columns there are.
    pub(super) fn width(&self) -> usize {
        self.columns.len()
    }

    /// Takes the units from a row of them (`[s],[rad]`) under the header.
    fn take_units(&mut self, record: &StringRecord) -> bool {
        let inside = |cell: &str| match split_unit(cell) {
            (name, Some(unit)) if name.is_empty() => Some(unit),
            _ => None,
        };
        let all = record.iter().all(|cell| cell.is_empty() || inside(cell).is_some());
        if all {
            for (column, cell) in self.columns.iter_mut().zip(record.iter()) {
                column.unit = column.unit.take().or_else(|| inside(cell));
            }
        }
        all
    }

    pub(super) fn finish(self, path: &Path) -> Result<(u64, Vec<Column>, Vec<u64>)> {
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
