//! Excel: sheets of cells, the header in their first row.

use std::io::Cursor;
use std::path::Path;

use calamine::{DataRef, Reader, Xlsx};
use csv::StringRecord;

use super::super::cell::format_number;
use super::super::guard::guarded;
use super::super::read::TableBuilder;
use super::super::table::{Reading, StoredReading, Table, column_of, wrong};
use super::{INFLATED, damaged, digest, most_inflated};
use crate::error::{Error, Result};

/// What workbooks of Excel before 2007 begin with.
const OLD: &[u8] = b"\xD0\xCF\x11\xE0";

/// Reads a sheet: the one that is named, or the only one with numbers; sheets with the same
/// columns are runs.
///
/// # Errors
/// The file is of another kind, is damaged, or has no such sheet, none with numbers, or several
/// that differ.
pub(super) fn read(path: &Path, bytes: &[u8], part: Option<&str>) -> Result<Table> {
    let stop = |message: &str, hint: &str| Err(wrong(path, None, None, message, hint));
    if bytes.starts_with(OLD) {
        return stop("this is a workbook of an old Excel", "save it as .xlsx, or the sheet as CSV");
    }
    if super::contains(bytes, b"application/vnd.oasis") {
        return stop("this is a sheet of OpenDocument", "save it as .xlsx, or the sheet as CSV");
    }
    // What the table of contents says; a part that holds more than that is not read to its end.
    let inflated = guarded(|| {
        let archive = zip::ZipArchive::new(Cursor::new(bytes)).ok()?;
        archive.decompressed_size()
    });
    if inflated.flatten().is_some_and(|size| size > u128::from(most_inflated(bytes))) {
        return Err(damaged(path, INFLATED));
    }
    let open = || Xlsx::new(Cursor::new(bytes));
    let mut book = match guarded(open) {
        Some(Ok(book)) => book,
        Some(Err(calamine::XlsxError::Password)) => {
            return stop("the workbook is protected by a password", "save it without, or as CSV");
        }
        _ => {
            return stop(
                "this is not a whole workbook of Excel: its parts cannot be read",
                "copy it again, or save the sheet as CSV",
            );
        }
    };
    let names = book.sheet_names();
    let listed = || names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    let named = |part: &str| {
        let same = |name: &&String| name.as_str() == part;
        names.iter().find(same).or_else(|| names.iter().find(|n| n.eq_ignore_ascii_case(part)))
    };
    let chosen = match part {
        Some(part) => match named(part) {
            Some(name) => vec![name.clone()],
            None => {
                let message = format!("there is no sheet `{part}`");
                return stop(&message, &format!("there are {}", listed()));
            }
        },
        None => names.clone(),
    };
    let mut sheets: Vec<(String, Table)> = Vec::new();
    let mut failed: Option<Error> = None;
    for name in chosen {
        let sheet = guarded(|| sheet(path, &mut book, &name));
        match sheet.unwrap_or_else(|| Err(damaged(path, "a sheet contradicts itself"))) {
            Ok(table) if part.is_some() || table.columns.iter().any(|c| table.is_numeric(c)) => {
                sheets.push((name, table));
            }
            Ok(_) => {}
            Err(error) => failed = failed.or(Some(error)),
        }
    }
    let headers = |table: &Table| -> Vec<String> {
        table.columns.iter().map(|column| column.header.clone()).collect()
    };
    if !sheets.array_windows().all(|[(_, a), (_, b)]| headers(a) == headers(b)) {
        let found: Vec<String> = sheets.iter().map(|(name, _)| format!("`{name}`")).collect();
        return stop(
            &format!("there are several tables: the sheets {}", found.join(", ")),
            &format!(
                "name one of them behind a #, as in `file.xlsx#{}`",
                sheets.first().map_or("", |(name, _)| name.as_str())
            ),
        );
    }
    let several = sheets.len() > 1;
    let mut all: Option<Table> = None;
    let mut runs: Vec<String> = Vec::new();
    for (name, table) in sheets {
        runs.extend(std::iter::repeat_n(name, table.rows()));
        match &mut all {
            None => all = Some(table),
            Some(all) => {
                for (column, more) in all.columns.iter_mut().zip(table.columns) {
                    column.cells.append(more.cells);
                }
                all.lines.extend(table.lines);
            }
        }
    }
    let Some(mut table) = all else {
        return match failed {
            Some(error) => Err(error),
            None => stop("no sheet has numbers", "write one row per sample under a header"),
        };
    };
    let mut run = None;
    if several {
        let mut name = "run".to_string();
        while table.columns.iter().any(|column| column.name == name) {
            name.push('_');
        }
        table.columns.push(column_of(&name, runs.into_iter().collect()));
        run = Some(name);
    }
    let part = part.map(str::to_string);
    table.reading = Reading::Stored(StoredReading { format: "Excel", part, runs: run });
    table.sha256 = digest(bytes);
    Ok(table)
}

/// The cells of a sheet, laid out as those of a text file are.
fn sheet(path: &Path, book: &mut Xlsx<Cursor<&[u8]>>, name: &str) -> Result<Table> {
    let broken = |_| damaged(path, "a sheet cannot be read");
    let mut cells = book.worksheet_cells_reader(name).map_err(broken)?;
    let mut rows: Vec<(u64, StringRecord)> = Vec::new();
    let mut row: Vec<String> = Vec::new();
    let mut at = 0;
    loop {
        let next = cells.next_cell().map_err(broken)?;
        let place = next.as_ref().map(|cell| cell.get_position());
        if place.is_none_or(|(line, _)| line != at) && !row.iter().all(String::is_empty) {
            rows.push((u64::from(at) + 1, StringRecord::from(row.clone())));
        }
        let Some(cell) = next else { break };
        let (line, column) = cell.get_position();
        if line != at {
            row.clear();
            at = line;
        }
        let column = column as usize;
        if row.len() <= column {
            row.resize(column + 1, String::new());
        }
        if let Some(place) = row.get_mut(column) {
            *place = text(cell.get_value());
        }
    }
    if rows.is_empty() {
        let hint = "give a header that names the columns, and one row per sample";
        return Err(wrong(path, None, None, format!("the sheet `{name}` is empty"), hint));
    }
    let (columns, lines) = TableBuilder::of_rows(path, rows)?;
    Ok(Table {
        path: path.to_path_buf(),
        columns,
        lines,
        reading: Reading::Memory,
        sha256: String::new(),
    })
}

/// A cell as it would stand in a text file.
fn text(cell: &DataRef) -> String {
    match cell {
        DataRef::Int(number) => number.to_string(),
        DataRef::Float(number) => format_number(*number),
        DataRef::String(text) => text.trim().to_string(),
        DataRef::SharedString(text) => text.trim().to_string(),
        DataRef::Bool(truth) => u8::from(*truth).to_string(),
        // A sheet counts in days; their rounding is less than a microsecond.
        DataRef::DateTime(date) if date.is_duration() || date.as_f64() < 1.0 => {
            let microseconds = (date.as_f64() * 86_400e6).round();
            let seconds = (microseconds / 1e6).floor();
            let (hours, rest) = ((seconds / 3600.0).floor(), seconds % 3600.0);
            format!(
                "{hours}:{:02}:{:02}.{:06}",
                (rest / 60.0).floor(),
                rest % 60.0,
                microseconds % 1e6
            )
        }
        DataRef::DateTime(date) => {
            let (year, month, day, hour, minute, second, milli) = date.to_ymd_hms_milli();
            format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02}.{milli:03}")
        }
        DataRef::DateTimeIso(text) | DataRef::DurationIso(text) => text.clone(),
        // `#N/A` and its like: nothing was measured, or nothing came out.
        DataRef::Error(_) | DataRef::Empty => String::new(),
    }
}
