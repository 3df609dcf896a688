//! The lines of a text file, divided into header, units, rows, and what is left out.

use std::path::Path;

use csv::StringRecord;

use super::delimiter::Delimiter;
use super::header::counted;
use super::layout::{self, Layout};
use super::table::wrong;
use crate::error::Result;

/// A line that is not blank.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line<'a> {
    /// Its number in the file.
    pub number: u64,
    /// Without the mark of a comment.
    pub text: &'a str,
    comment: bool,
}

/// A text divided into what is what.
pub(super) struct LaidOut<'a> {
    /// The header, where it is not the first of the lines.
    pub header: Option<(u64, StringRecord)>,
    pub units: Option<StringRecord>,
    /// The lines of measurements.
    pub lines: Vec<(u64, &'a str)>,
    pub delimiter: Delimiter,
    pub headless: bool,
    /// Lines of measurements before which the header stands again, as it does where runs begin.
    pub begins: Vec<usize>,
    pub notes: Vec<String>,
}

/// The lines with something in them, and what the first says about the delimiter.
pub(super) fn numbered(text: &str) -> (Vec<Line<'_>>, Option<Delimiter>) {
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
    let lines = numbered.filter_map(|(number, line)| {
        let start = line.trim_start();
        // `#N/A` is a spreadsheet's missing cell, not a comment.
        let comment = start.starts_with(['#', '%']) && !start.starts_with("#N/A");
        let text = if comment { start.trim_start_matches(['#', '%']) } else { line };
        (!start.is_empty()).then_some(Line { number, text, comment })
    });
    (lines.collect(), said)
}

/// Lines below a table, at most.
pub(super) const MOST_BELOW: usize = 20;
/// How many lines are looked at to learn how a file is written.
pub(super) const LOOKED_AT: usize = 400;

pub(super) fn laid_out<'a>(
    path: &Path,
    all: &[Line<'a>],
    said: Option<Delimiter>,
) -> Result<LaidOut<'a>> {
    let lines: Vec<(u64, &str)> =
        all.iter().filter(|line| !line.comment).map(|line| (line.number, line.text)).collect();
    if lines.is_empty() {
        let message = match all {
            [] => "the file is empty",
            _ => "the file has only comment lines",
        };
        let hint = "give a header that names the columns, and one row per sample";
        return Err(wrong(path, None, None, message, hint));
    }
    let delimiter = said.unwrap_or_else(|| sniff(&lines));
    let first = |lines: &[(u64, &str)], delimiter: Delimiter| -> Vec<StringRecord> {
        lines.iter().take(LOOKED_AT).map(|(_, line)| record(line, delimiter)).collect()
    };
    let plain = |lines, delimiter| LaidOut {
        header: None,
        units: None,
        lines,
        delimiter,
        headless: false,
        begins: Vec::new(),
        notes: Vec::new(),
    };
    let quotes = |line: &(u64, &str)| line.1.matches('"').count() % 2 == 1;
    let spanned = lines.iter().take(2).any(quotes);
    if spanned || layout::is_plain(&first(&lines, delimiter)) {
        let header = lines.first().map_or("", |(_, line)| *line);
        let mut out = plain(lines, delimiter);
        out.divide(header);
        out.leave_footer_out();
        return Ok(out);
    }
    let find = |lines: &[(u64, &'a str)]| {
        let of = |delimiter: Delimiter| Some((delimiter, layout::find(&first(lines, delimiter))?));
        let mut best: Option<(Delimiter, Layout)> = None;
        for found in
            Delimiter::all().filter(|one| said.is_none_or(|said| said == *one)).filter_map(of)
        {
            if best.as_ref().is_none_or(|(_, best)| found.1.fit > best.fit) {
                best = Some(found);
            }
        }
        best.map(|(one, layout)| match layout.width {
            1 => (said.unwrap_or(Delimiter::Comma), layout),
            _ => (one, layout),
        })
    };
    let Some((mut delimiter, mut layout)) = find(&lines) else {
        return Ok(plain(lines, delimiter));
    };
    let mut lines = lines;
    if layout.header.is_none() {
        // A header that is itself a comment, as NumPy writes it.
        let before = lines.get(layout.first).map_or(0, |(number, _)| *number);
        let comments = all.iter().take_while(|line| line.number < before || line.comment);
        let comments = comments.filter(|line| line.number < before);
        let with: Vec<(u64, &str)> = comments
            .map(|line| (line.number, line.text))
            .chain(lines.iter().copied().skip(layout.first))
            .collect();
        let above = (with.len() + layout.first).saturating_sub(lines.len());
        if let Some((found, header)) = find(&with).filter(|(_, found)| found.header.is_some()) {
            (lines, delimiter, layout) = (with, found, header);
        } else if layout.width > 1
            && let Some((line, header)) =
                with_blanks(with.get(..above).unwrap_or_default(), layout.width)
        {
            let mut out = LaidOut::of(lines, delimiter, &layout);
            (out.header, out.headless) = (Some((line, header)), false);
            return Ok(out);
        }
    }
    Ok(LaidOut::of(lines, delimiter, &layout))
}

/// The last line above the rows that names as many columns as they have, between blanks or commas,
/// whatever stands between their cells.
fn with_blanks(lines: &[(u64, &str)], width: usize) -> Option<(u64, StringRecord)> {
    let names = |line: &str, delimiter: Delimiter| {
        let record = record(line, delimiter);
        let all = record.iter().all(layout::is_text);
        (all && record.len() == width).then_some(record)
    };
    let found = |(number, line): &(u64, &str)| {
        Delimiter::all().find_map(|delimiter| Some((*number, names(line, delimiter)?)))
    };
    lines.iter().rev().find_map(found)
}

impl<'a> LaidOut<'a> {
    fn of(lines: Vec<(u64, &'a str)>, delimiter: Delimiter, layout: &Layout) -> LaidOut<'a> {
        let cells = |at: usize| lines.get(at).map(|(_, line)| names(line, delimiter, layout.width));
        let rows: Vec<(u64, &str)> = lines.get(layout.first..).unwrap_or_default().to_vec();
        let line_of = |at: usize| lines.get(at).map_or(0, |(number, _)| *number);
        let mut notes = Vec::new();
        let header = match layout.header.and_then(|at| Some((at, cells(at)?))) {
            Some((at, mut header)) => {
                if let Some(above) = layout.above.and_then(cells) {
                    header = layout::joined(&header, &above);
                }
                let over: Vec<&str> = header.iter().skip(layout.width).collect();
                if over.iter().any(|name| !name.is_empty()) {
                    notes.push(format!("no cells under {}: left out.", over.join(", ")));
                }
                if header.len() > layout.width {
                    header.truncate(layout.width);
                }
                if at > 0 {
                    let last = line_of(at - 1);
                    notes.push(format!(
                        "{} above the header left out, up to line {last}.",
                        counted(at, "line")
                    ));
                }
                (line_of(at), header)
            }
            None => {
                if let Some(before) = layout.first.checked_sub(1) {
                    notes.push(format!(
                        "lines without numbers left out, up to line {}.",
                        line_of(before)
                    ));
                }
                (
                    line_of(layout.first),
                    (1..=layout.width).map(|at| format!("column {at}")).collect(),
                )
            }
        };
        let mut out = LaidOut {
            header: Some(header),
            units: layout.units.and_then(cells),
            headless: layout.header.is_none(),
            lines: rows,
            delimiter,
            begins: Vec::new(),
            notes,
        };
        if let Some((_, text)) = layout.header.and_then(|at| lines.get(at)) {
            out.divide(text);
        }
        if layout.counts {
            out.leave_footer_out();
        }
        out
    }

    /// Divides the rows where the header stands again, with what is above and below it there.
    fn divide(&mut self, header: &str) {
        let begins = usize::from(self.header.is_none());
        let again = |line: &&(u64, &str)| line.1 == header;
        if !self.lines.iter().skip(begins).any(|line| again(&line)) {
            return;
        }
        let delimiter = self.delimiter;
        let mut kept: Vec<(u64, &str)> = Vec::new();
        let mut waits = false;
        for (at, line) in self.lines.drain(..).enumerate() {
            if at < begins {
                kept.push(line);
            } else if again(&&line) {
                let above = |row: &(u64, &str)| !layout::measures(&record(row.1, delimiter));
                while kept.len() > begins && kept.last().is_some_and(above) {
                    kept.pop();
                }
                waits = true;
            } else if !waits || layout::measures(&record(line.1, delimiter)) {
                if waits {
                    self.begins.push(kept.len());
                }
                waits = false;
                kept.push(line);
            }
        }
        self.lines = kept;
    }

    /// Leaves out what stands below a table whose first column holds numbers.
    fn leave_footer_out(&mut self) {
        let begins = usize::from(self.header.is_none());
        let delimiter = self.delimiter;
        let rows = self.lines.get(begins..).unwrap_or_default();
        let first = rows.first().map(|(_, line)| record(line, delimiter));
        // Where the first column stays the same from row to row it names runs, in any words.
        let second = rows.get(1).map(|(_, line)| record(line, delimiter));
        let first = first.as_ref().and_then(|row| row.get(0)).unwrap_or_default();
        let second = second.as_ref().and_then(|row| row.get(0)).unwrap_or_default();
        if rows.len() < 3 || layout::is_text(first) || first == second {
            return;
        }
        let below =
            layout::footer(rows.iter().map(|(_, line)| *line), |line| record(line, delimiter));
        let kept = self.lines.len() - below;
        if let Some((line, _)) =
            self.lines.get(kept).filter(|_| kept > begins && below <= MOST_BELOW)
        {
            self.notes.push(format!(
                "{} below the table left out, from line {line} on.",
                counted(below, "line")
            ));
            self.lines.truncate(kept);
        }
    }
}

/// The names in a header: between blanks they may have blanks themselves, if two or more stand
/// between columns, or before a unit behind a slash.
fn names(line: &str, delimiter: Delimiter, width: usize) -> StringRecord {
    // `DEF="t / s"` defines the first name.
    let line = match line.split_once("=\"") {
        Some((word, _)) if word.chars().all(char::is_alphanumeric) => {
            line.get(word.len() + 1..).unwrap_or(line)
        }
        _ => line,
    };
    let plain = record(line, delimiter);
    if delimiter != Delimiter::Blanks || layout::filled(&plain) <= width {
        return plain;
    }
    let wide: StringRecord =
        line.trim().split("  ").map(str::trim).filter(|cell| !cell.is_empty()).collect();
    if wide.len() == width {
        return wide;
    }
    let slashed = record(&line.replace(" / ", "/"), delimiter);
    if slashed.len() == width { slashed } else { plain }
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

/// One line by itself as cells.
fn record(line: &str, delimiter: Delimiter) -> StringRecord {
    let line = delimiter.tidy(line);
    let mut record = StringRecord::new();
    // A failure leaves the record empty, and the whole file is parsed with errors later.
    let _ = builder(delimiter).from_reader(line.as_bytes()).read_record(&mut record);
    record
}

pub(super) fn builder(delimiter: Delimiter) -> csv::ReaderBuilder {
    let mut builder = csv::ReaderBuilder::new();
    builder.delimiter(delimiter.byte()).has_headers(false).flexible(true).trim(csv::Trim::All);
    builder
}
