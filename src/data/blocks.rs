//! A file of measurements as tables of some rows, one after the other.

use std::fs::File;
use std::io::{Read, Seek};
use std::path::{Path, PathBuf};

use super::cells::Cells;
use super::files;
use super::format::{self, Format};
use super::gzip;
use super::parquet;
use super::read::{SAMPLE, read_bytes};
use super::table::{Reading, Table, column_of, wrong};
use super::text::Encoding;
use crate::error::{Error, Result};

/// Bytes of text that are looked at to learn how a file is written.
const FIRST: usize = 1 << 20;
/// Bytes of text that are turned into a table at a time.
const BLOCK: usize = 1 << 21;

/// A file that is read a table at a time.
pub(super) enum Blocks {
    Text(Box<TextBlocks>),
    Parquet(Box<parquet::Blocks>),
    /// What is read whole, until it is handed on.
    Whole(Option<Table>),
}

impl Blocks {
    pub(super) fn open(path: &Path) -> Result<Blocks> {
        Ok(match Format::of_file(path)? {
            Format::Text => Blocks::Text(Box::new(TextBlocks::open(path)?)),
            Format::Parquet => Blocks::Parquet(Box::new(parquet::Blocks::open(path)?)),
            Format::Stored(_) => Blocks::Whole(Some(format::read(path)?)),
            Format::Gzip => match Format::of_bytes(path, &gzip::first(path, files::FIRST)?) {
                Format::Text => Blocks::Text(Box::new(TextBlocks::open(path)?)),
                _ => Blocks::Whole(Some(format::read(path)?)),
            },
        })
    }

    /// Rows (of text an estimate), columns, and whether it is text.
    pub(super) fn extent(&mut self) -> Result<(u64, u64, bool)> {
        match self {
            Blocks::Parquet(blocks) => {
                let table = blocks.headers();
                Ok((blocks.rows(), table.columns.len() as u64, false))
            }
            Blocks::Whole(table) => {
                let extent = |table: &Table| (table.rows() as u64, table.columns.len() as u64);
                let (rows, columns) = table.as_ref().map_or((0, 0), extent);
                Ok((rows, columns, false))
            }
            Blocks::Text(blocks) => {
                let total = blocks.bytes();
                let pending = blocks.pending.len().max(1) as u64;
                let lines = blocks.pending.iter().filter(|byte| **byte == b'\n').count() as u64;
                let columns = blocks.next()?.map_or(0, |table| table.columns.len() as u64);
                Ok(((lines as f64 * total as f64 / pending as f64) as u64, columns, true))
            }
        }
    }

    /// Bytes of its text, about; none of other formats.
    pub(super) fn text_bytes(&self) -> u64 {
        match self {
            Blocks::Text(blocks) => blocks.bytes(),
            _ => 0,
        }
    }

    /// Leaves columns with other headers unread, where the format allows it.
    pub(super) fn only(&mut self, headers: &[String]) {
        if let Blocks::Parquet(blocks) = self {
            blocks.only(|column| headers.contains(&column.header));
        }
    }

    /// The next rows, about `most` of them; none at the end.
    pub(super) fn next(&mut self, most: usize) -> Result<Option<Table>> {
        match self {
            Blocks::Text(blocks) => blocks.next(),
            Blocks::Parquet(blocks) => blocks.next(most),
            Blocks::Whole(table) => Ok(table.take()),
        }
    }

    /// How much of the file was read, 0 to 1.
    pub(super) fn fraction(&self) -> f64 {
        match self {
            Blocks::Text(blocks) => blocks.fraction(),
            Blocks::Parquet(blocks) => blocks.fraction(),
            Blocks::Whole(table) => f64::from(u8::from(table.is_none())),
        }
    }
}

/// Text: blocks of whole lines, each read under the header of the file.
pub(super) struct TextBlocks {
    path: PathBuf,
    /// The text, unpacked where the file is compressed.
    input: Box<dyn Read + Send>,
    /// The same file: how far it was read.
    file: File,
    packed: bool,
    /// Everything before the first row of cells.
    prefix: Vec<u8>,
    prefix_lines: u64,
    /// Lines before the next block.
    line: u64,
    pending: Vec<u8>,
    ended: bool,
    made: MadeColumns,
    /// Bytes of text that were read.
    read: u64,
    /// Bytes of the file.
    total: u64,
}

impl TextBlocks {
    fn open(path: &Path) -> Result<TextBlocks> {
        let failed = |error| Error::file("read", path, error);
        let mut file = File::open(path).map_err(failed)?;
        let mut start = Vec::new();
        (&file).take(3).read_to_end(&mut start).map_err(failed)?;
        file.rewind().map_err(failed)?;
        let packed = gzip::is_gzip(&start);
        // It has the same place in the file.
        let same = file.try_clone().map_err(failed)?;
        let input: Box<dyn Read + Send> =
            if packed { gzip::reader(path, same)? } else { Box::new(same) };
        let total = file.metadata().map_err(failed)?.len();
        let mut blocks = TextBlocks {
            path: path.to_path_buf(),
            input,
            file,
            packed,
            prefix: Vec::new(),
            prefix_lines: 0,
            line: 0,
            pending: Vec::new(),
            ended: false,
            made: MadeColumns::default(),
            read: 0,
            total,
        };
        blocks.fill(FIRST)?;
        let head = read_bytes(path, blocks.whole_lines())?;
        blocks.made = MadeColumns::of(&head.reading, blocks.whole_lines());
        if let Reading::Text(text) = head.reading
            && !matches!(text.encoding, Encoding::Utf8 | Encoding::Latin1)
        {
            return Err(wrong(
                path,
                None,
                None,
                "UTF-16 text cannot be read part by part",
                "save the file as UTF-8 or as Parquet",
            ));
        }
        blocks.prefix_lines = head.lines.first().map_or(0, |line| line.saturating_sub(1));
        let mut ends = blocks.pending.iter().enumerate().filter(|(_, byte)| **byte == b'\n');
        let end = match usize::try_from(blocks.prefix_lines) {
            Ok(0) | Err(_) => 0,
            Ok(lines) => ends.nth(lines - 1).map_or(0, |(at, _)| at + 1),
        };
        let rest = blocks.pending.split_off(end);
        blocks.prefix = std::mem::replace(&mut blocks.pending, rest);
        blocks.line = blocks.prefix_lines;
        Ok(blocks)
    }

    /// Reads on until at least `bytes` are pending, and a line among them is whole.
    fn fill(&mut self, bytes: usize) -> Result<()> {
        let mut want = bytes;
        while !self.ended && (self.pending.len() < want || !self.pending.contains(&b'\n')) {
            want = want.max(self.pending.len() + 1);
            let more = (want - self.pending.len()).max(1 << 16) as u64;
            let read = (&mut self.input).take(more).read_to_end(&mut self.pending);
            let read = read.map_err(|error| match self.packed {
                true => gzip::failed(&self.path, error),
                false => Error::file("read", &self.path, error),
            })?;
            self.read += read as u64;
            self.ended = read == 0;
        }
        Ok(())
    }

    /// How much of the file was read, 0 to 1.
    fn fraction(&self) -> f64 {
        let place = (&self.file).stream_position().unwrap_or(self.total);
        place as f64 / self.total.max(1) as f64
    }

    /// Bytes of all its text, about: what is unpacked so far goes on as it began.
    fn bytes(&self) -> u64 {
        match self.packed {
            true => (self.read as f64 / self.fraction().max(1e-9)) as u64,
            false => self.total,
        }
    }

    fn whole_lines(&self) -> &[u8] {
        let end = match self.pending.iter().rposition(|byte| *byte == b'\n') {
            Some(at) if !self.ended => at + 1,
            _ => self.pending.len(),
        };
        self.pending.get(..end).unwrap_or(&[])
    }

    fn next(&mut self) -> Result<Option<Table>> {
        loop {
            self.fill(BLOCK)?;
            let length = self.whole_lines().len();
            if length == 0 {
                return Ok(None);
            }
            let rest = self.pending.split_off(length);
            let lines = std::mem::replace(&mut self.pending, rest);
            let before = self.line;
            self.line += lines.iter().filter(|byte| **byte == b'\n').count() as u64;
            if !holds_cells(&lines) {
                continue;
            }
            let prefix = self.prefix_lines;
            let place = |line: u64| if line > prefix { line - prefix + before } else { line };
            let bytes = [self.prefix.as_slice(), &lines].concat();
            let table = match read_bytes(&self.path, &bytes) {
                Ok(mut table) => {
                    table.lines.iter_mut().for_each(|line| *line = place(*line));
                    self.made.go_on(&mut table, &lines);
                    table
                }
                Err(Error::Data(mut error)) => {
                    error.line = error.line.map(place);
                    return Err(Error::Data(error));
                }
                Err(other) => return Err(other),
            };
            return Ok(Some(table));
        }
    }
}

/// Columns that no file has but that are made of where its rows stand: they go on from one block
/// to the next.
#[derive(Default)]
struct MadeColumns {
    /// The column that tells runs apart, where the header stands again before each.
    runs: Option<String>,
    header: Vec<u8>,
    /// Whether rows are counted.
    counts: bool,
    /// Runs that ended, and rows, before the next block.
    ended: u64,
    rows: u64,
}

impl MadeColumns {
    /// Of the first lines of a file.
    fn of(reading: &Reading, lines: &[u8]) -> MadeColumns {
        let header = reading.header_line().and_then(|line| usize::try_from(line).ok());
        let mut lines = lines.split(|byte| *byte == b'\n');
        let header = header.and_then(|line| lines.nth(line.checked_sub(1)?)).unwrap_or_default();
        MadeColumns {
            runs: reading.runs().map(str::to_string),
            header: header.trim_ascii().to_vec(),
            counts: reading.counted().is_some(),
            ended: 0,
            rows: 0,
        }
    }

    /// Puts the columns of the next block in the place of those that were made of it alone.
    fn go_on(&mut self, table: &mut Table, lines: &[u8]) {
        let (runs, counted) = (table.reading.runs().map(str::to_string), table.reading.counted());
        if self.counts {
            let own = counted.is_some();
            table.columns.retain(|column| !(own && column.name == SAMPLE));
            let rows = (self.rows..).take(table.rows()).map(|row| row as f64);
            table.columns.push(column_of(SAMPLE, Cells::from(rows.collect::<Vec<f64>>())));
        }
        self.rows += table.rows() as u64;
        let Some(name) = &self.runs else { return };
        let within = |row: usize| {
            let column = table.columns.iter().find(|column| Some(&column.header) == runs.as_ref());
            column.and_then(|column| column.cells.get(row).parse::<u64>().ok()).unwrap_or(1)
        };
        let numbers: Vec<u64> = (0..table.rows()).map(within).collect();
        table.columns.retain(|column| Some(&column.header) != runs.as_ref());
        let cells: Cells = numbers.iter().map(|run| (self.ended + run).to_string()).collect();
        table.columns.push(column_of(name, cells));
        self.ended += numbers.last().map_or(0, |last| last.saturating_sub(1));
        // A header at the end of a block begins a run whose rows stand in the next.
        let mut backwards = lines.rsplit(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
        let last = backwards.find(|line| !line.is_empty());
        self.ended += u64::from(last == Some(&self.header));
    }
}

/// Whether there is a line that is neither blank, nor a comment, nor delimiters alone.
fn holds_cells(lines: &[u8]) -> bool {
    lines.split(|byte| *byte == b'\n').any(|line| {
        let line = line.trim_ascii();
        let comment =
            line.starts_with(b"#") && !line.starts_with(b"#N/A") || line.starts_with(b"%");
        !comment && line.iter().any(|byte| !b",;\t| \"".contains(byte))
    })
}
