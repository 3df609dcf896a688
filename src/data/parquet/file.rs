//! A Parquet file, opened, checked and read block by block.

use std::collections::HashSet;
use std::fs::File;
use std::path::{Path, PathBuf};

use parquet::basic::Compression;
use parquet::column::reader::ColumnReader;
use parquet::errors::ParquetError;
use parquet::file::reader::{ChunkReader, FileReader, SerializedFileReader};
use sha2::{Digest, Sha256};

use super::super::cells::Cells;
use super::super::format::hash_file;
use super::super::guard;
use super::super::header::split_unit;
use super::super::table::{Column, ParquetReading, Reading, Table, wrong};
use super::decode::{ColumnKind, decode};
use crate::error::{DataError, Error, Result};

/// The first and the last four bytes of every Parquet file.
pub(in crate::data) const MAGIC: &[u8; 4] = b"PAR1";
/// Footer: length of the table of contents and the mark.
const FOOTER: u64 = 8;

/// Reads a whole file.
///
/// # Errors
/// The file is not Parquet, is cut off or damaged, has no columns or no rows, two columns of
/// the same name, or a compression that this program was built without.
pub(in crate::data) fn read(path: &Path) -> Result<Table> {
    let mut blocks = Blocks::open(path)?;
    whole(&mut blocks, hash_file(path)?)
}

/// The same from the bytes of a file; `path` is what errors call it.
pub(in crate::data) fn read_bytes(path: &Path, bytes: &[u8]) -> Result<Table> {
    let mut blocks = Blocks::new(path, bytes::Bytes::copy_from_slice(bytes))?;
    whole(&mut blocks, format!("{:x}", Sha256::digest(bytes)))
}

fn whole(blocks: &mut Blocks, sha256: String) -> Result<Table> {
    let mut all = blocks.headers();
    while let Some(block) = blocks.next(usize::MAX)? {
        for (column, more) in all.columns.iter_mut().zip(block.columns) {
            column.cells.append(more.cells);
        }
        all.lines.extend(block.lines);
    }
    all.sha256 = sha256;
    Ok(all)
}

/// A file that is read a block of rows at a time.
pub(in crate::data) struct Blocks {
    path: PathBuf,
    file: Box<dyn FileReader>,
    headers: Vec<Column>,
    kinds: Vec<ColumnKind>,
    wanted: Vec<bool>,
    reading: ParquetReading,
    /// Row group of the next block, and readers of its columns once it has begun.
    group: usize,
    readers: Vec<Option<ColumnReader>>,
    /// Rows before the next block.
    row: u64,
}

impl Blocks {
    /// Opens a file, to be read from its first row.
    pub(in crate::data) fn open(path: &Path) -> Result<Blocks> {
        let file = File::open(path).map_err(|error| Error::file("read", path, error))?;
        Blocks::new(path, file)
    }

    fn new<R: ChunkReader + 'static>(path: &Path, source: R) -> Result<Blocks> {
        let ends = |at: u64| {
            source.get_bytes(at, MAGIC.len()).is_ok_and(|bytes| bytes.as_ref() == MAGIC.as_slice())
        };
        let length = source.len();
        let stop = |message: &str, hint: &str| Err(wrong(path, None, None, message, hint));
        if length == 0 {
            return stop("the file is empty", "export the measurements again");
        }
        if !ends(0) {
            return stop(
                "this is not a Parquet file: it does not begin with PAR1",
                "export the measurements as Parquet or CSV, and name the file accordingly",
            );
        }
        if length < FOOTER + MAGIC.len() as u64 || !ends(length - MAGIC.len() as u64) {
            return stop(
                "the file is cut off: the table of contents at its end is missing",
                "copy it again, or close the program that writes it",
            );
        }
        let file = guarded(|| SerializedFileReader::new(source))
            .map_err(|error| damaged(path, None, None, &error))?;
        Blocks::check(path, Box::new(file))
    }

    fn check(path: &Path, file: Box<dyn FileReader>) -> Result<Blocks> {
        let about = file.metadata();
        let schema = about.file_metadata().schema_descr();
        let mut headers = Vec::new();
        let mut seen = HashSet::new();
        for column in schema.columns() {
            let header = column.path().string();
            if !seen.insert(header.clone()) {
                return Err(wrong(
                    path,
                    None,
                    Some(&header),
                    format!("two columns are called `{header}`"),
                    "give every column a name of its own",
                ));
            }
            let (name, unit) = match split_unit(&header) {
                (name, unit) if !name.is_empty() => (name, unit),
                _ => (header.clone(), None),
            };
            headers.push(Column { name, header, unit, cells: Cells::default() });
        }
        let rows = |group: usize| u64::try_from(about.row_group(group).num_rows()).unwrap_or(0);
        let mut end = 0;
        let ends: Vec<u64> = (0..about.num_row_groups())
            .map(|group| {
                end += rows(group);
                end
            })
            .collect();
        if headers.is_empty() || end == 0 {
            return Err(wrong(
                path,
                None,
                None,
                if headers.is_empty() { "there are no columns" } else { "there are no rows" },
                "add the measurements, one row per sample",
            ));
        }
        let written_by = about.file_metadata().created_by().map(str::to_string);
        Ok(Blocks {
            path: path.to_path_buf(),
            kinds: schema.columns().iter().map(|column| ColumnKind::of(column)).collect(),
            wanted: vec![true; headers.len()],
            headers,
            reading: ParquetReading { row_groups: ends.len(), written_by, ends },
            file,
            group: 0,
            readers: Vec::new(),
            row: 0,
        })
    }

    /// Rows of the whole file.
    pub(in crate::data) fn rows(&self) -> u64 {
        self.reading.ends.last().copied().unwrap_or(0)
    }

    /// How much of the file was read, 0 to 1.
    pub(in crate::data) fn fraction(&self) -> f64 {
        self.row as f64 / self.rows().max(1) as f64
    }

    /// Leaves all other columns unread.
    pub(in crate::data) fn only(&mut self, wanted: impl Fn(&Column) -> bool) {
        self.wanted = self.headers.iter().map(wanted).collect();
    }

    /// The columns without their cells.
    pub(in crate::data) fn headers(&self) -> Table {
        Table {
            path: self.path.clone(),
            columns: self.headers.clone(),
            lines: Vec::new(),
            reading: Reading::Parquet(self.reading.clone()),
            sha256: String::new(),
        }
    }

    /// The next rows, at most `most` of them; none at the end. A block never holds rows of two
    /// row groups, so it may be shorter.
    ///
    /// # Errors
    /// The file is damaged there.
    pub(in crate::data) fn next(&mut self, most: usize) -> Result<Option<Table>> {
        loop {
            let Some(&end) = self.reading.ends.get(self.group) else { return Ok(None) };
            let left = usize::try_from(end - self.row).unwrap_or(usize::MAX);
            if left > 0 {
                return self.block(left.min(most)).map(Some);
            }
            self.group += 1;
            self.readers.clear();
        }
    }

    fn block(&mut self, count: usize) -> Result<Table> {
        if self.readers.is_empty() {
            self.begin_group()?;
        }
        let first = self.row + 1;
        let mut table = self.headers();
        let schema = self.file.metadata().file_metadata().schema_descr_ptr();
        let columns = table.columns.iter_mut().zip(&self.kinds);
        for (at, (reader, (column, &kind))) in self.readers.iter_mut().zip(columns).enumerate() {
            let Some(reader) = reader else {
                column.cells.push_unread(kind.other(), count);
                continue;
            };
            let nullable = schema.column(at).max_def_level();
            let broken = |error: &ParquetError| {
                damaged(&self.path, Some((first, self.group)), Some(&column.header), error)
            };
            let read = guarded(|| decode(reader, kind, nullable, count, &mut column.cells))
                .map_err(|error| broken(&error))?;
            if read != count || column.cells.len() != count {
                return Err(broken(&ParquetError::EOF(format!("{read} of {count} cells"))));
            }
        }
        self.row += count as u64;
        table.lines = (first..=self.row).collect();
        Ok(table)
    }

    fn begin_group(&mut self) -> Result<()> {
        let place = Some((self.row + 1, self.group));
        let path = &self.path;
        let group = guarded(|| self.file.get_row_group(self.group))
            .map_err(|error| damaged(path, place, None, &error))?;
        self.readers = Vec::with_capacity(self.headers.len());
        let asked = self.headers.iter().zip(self.kinds.iter().zip(&self.wanted));
        for (at, (column, (kind, wanted))) in asked.enumerate() {
            if !wanted || matches!(kind, ColumnKind::Other(_)) {
                self.readers.push(None);
                continue;
            }
            let codec = self.file.metadata().row_group(self.group).column(at).compression();
            if let Some(name) = unknown(codec) {
                return Err(wrong(
                    path,
                    None,
                    Some(&column.header),
                    format!("it is compressed with {name}, which this program was built without"),
                    "write it with the compression snappy, lz4_raw, gzip or none",
                ));
            }
            let reader = guarded(|| group.get_column_reader(at))
                .map_err(|error| damaged(path, place, Some(&column.header), &error))?;
            self.readers.push(Some(reader));
        }
        Ok(())
    }
}

/// Decodes; what panics is damage.
fn guarded<T>(work: impl FnOnce() -> parquet::errors::Result<T>) -> parquet::errors::Result<T> {
    let contradict = || ParquetError::General("its parts contradict each other".into());
    guard::guarded(work).unwrap_or_else(|| Err(contradict()))
}

/// The name of a compression that cannot be read.
fn unknown(codec: Compression) -> Option<&'static str> {
    match codec {
        Compression::ZSTD(_) if !cfg!(feature = "zstd") => Some("zstd"),
        Compression::BROTLI(_) => Some("brotli"),
        Compression::LZO => Some("lzo"),
        _ => None,
    }
}

/// The file cannot be decoded: row and row group (counted from 0) where it was being read.
fn damaged(
    path: &Path,
    place: Option<(u64, usize)>,
    column: Option<&str>,
    error: &ParquetError,
) -> Error {
    let what = match error {
        ParquetError::External(source) => match source.downcast_ref::<std::io::Error>() {
            Some(error) => return Error::file("read", path, error.kind().into()),
            None => source.to_string(),
        },
        other => other.to_string(),
    };
    Error::Data(DataError {
        file: path.to_path_buf(),
        line: place.map(|(row, _)| row),
        row_group: place.and_then(|(_, group)| u32::try_from(group + 1).ok()),
        column: column.map(str::to_string),
        message: format!("the file is damaged ({what})"),
        hint: "copy it again, or export the measurements again".to_string(),
    })
}
