//! The formats of files of measurements.

use std::io::Read;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::files::{self, Kind};
use super::gzip;
use super::parquet;
use super::table::Table;
use super::write::{Layout, to_csv};
use super::{Dataset, read as text};
use crate::error::{Error, ErrorKind, Result};

/// How a file of measurements is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Text: CSV and what is like it.
    Text,
    /// Parquet.
    Parquet,
    /// One of the others, compressed with gzip.
    Gzip,
    /// Another, which is read whole.
    Stored(&'static Kind),
}

/// What Parquet files are called.
const PARQUET: &[&str] = &["parquet", "parq", "pq"];

impl Format {
    /// By the name that a file has or will have.
    pub fn of_name(path: &Path) -> Format {
        let (path, _) = files::parted(path);
        if gzip::unpacked_name(&path).is_some() {
            return Format::Gzip;
        }
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        match ending {
            Some(ending) if PARQUET.contains(&ending.as_str()) => Format::Parquet,
            _ => Kind::of_name(&path).map_or(Format::Text, Format::Stored),
        }
    }

    /// By the first bytes of a file: what they say counts more than its name.
    pub fn of_bytes(path: &Path, start: &[u8]) -> Format {
        match Kind::of_bytes(start) {
            _ if start.starts_with(parquet::MAGIC) => Format::Parquet,
            _ if gzip::is_gzip(start) => Format::Gzip,
            Some(kind) => Format::Stored(kind),
            // Somebody else may have unpacked it.
            None => Format::of_name(gzip::unpacked_name(path).as_deref().unwrap_or(path)),
        }
    }

    /// By the file itself.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn of_file(path: &Path) -> Result<Format> {
        let failed = |error| Error::file("read", path, error);
        let mut start = Vec::new();
        let file = std::fs::File::open(files::parted(path).0).map_err(failed)?;
        file.take(files::FIRST as u64).read_to_end(&mut start).map_err(failed)?;
        Ok(Format::of_bytes(path, &start))
    }
}

/// Reads a file of measurements: text as in CSV, Parquet, or a file of MATLAB, HDF5, NumPy, Excel
/// or Arrow, each of which may be compressed with gzip; of one with several tables the part that is
/// named behind a # (`rig.mat#swings`).
///
/// Text has cells between commas, tabs, semicolons, bars or blanks under a header. Comment
/// lines (`#`, `%`) and blank lines are skipped; a header that is itself a comment, as NumPy
/// writes it, is found. Parquet files have one row per sample; nulls are missing cells.
///
/// # Errors
/// The file cannot be read, is of neither kind, is empty, has no header or no rows, has rows of
/// different lengths, two columns with the same header, or is cut off or damaged.
pub fn read(path: &Path) -> Result<Table> {
    let file = file_of(path);
    match std::fs::metadata(&file) {
        // A pipe can be read only once.
        Ok(about) if about.is_file() && Format::of_file(path)? == Format::Parquet => {
            parquet::read(path)
        }
        _ => {
            let bytes = std::fs::read(file).map_err(|error| Error::file("read", path, error))?;
            read_bytes(path, &bytes)
        }
    }
}

/// Reads measurements from the bytes of a file; `path` is what errors call it.
///
/// # Errors
/// As [`read`].
pub fn read_bytes(path: &Path, bytes: &[u8]) -> Result<Table> {
    match Format::of_bytes(path, bytes) {
        Format::Text => text::read_bytes(path, bytes),
        Format::Parquet => parquet::read_bytes(path, bytes),
        Format::Stored(kind) => kind.read(path, bytes),
        Format::Gzip => {
            let inner = gzip::unpacked(path, bytes)?;
            if gzip::is_gzip(&inner) {
                return Err(files::damaged(path, "it is compressed twice"));
            }
            let mut table = read_bytes(path, &inner)?;
            table.sha256 = files::digest(bytes);
            Ok(table)
        }
    }
}

/// Whether a name is one of a table that can be read: CSV, Parquet and the like.
pub(super) fn is_table(path: &Path) -> bool {
    const TEXT: &[&str] = &["csv", "tsv"];
    let path = gzip::unpacked_name(path).unwrap_or_else(|| path.to_path_buf());
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    let text = ending.is_some_and(|ending| TEXT.contains(&ending.as_str()));
    text || Format::of_name(&path) != Format::Text
}

/// The file itself, where a part of it may be named behind a #.
pub fn file_of(path: &Path) -> PathBuf {
    files::parted(path).0
}

/// SHA-256 of a file's bytes, in hexadecimal digits, without taking it into memory.
pub(super) fn hash_file(path: &Path) -> Result<String> {
    let failed = |error| Error::file("read", path, error);
    let mut file = std::fs::File::open(file_of(path)).map_err(failed)?;
    let mut hash = Sha256::new();
    let mut buffer = vec![0; 1 << 20];
    loop {
        match file.read(&mut buffer).map_err(failed)? {
            0 => return Ok(format!("{:x}", hash.finalize())),
            read => hash.update(buffer.get(..read).unwrap_or_default()),
        }
    }
}

/// A data set in the format that the name of the file asks for.
///
/// # Errors
/// As [`to_csv`].
pub fn to_bytes(path: &Path, data: &Dataset, layout: &Layout) -> Result<Vec<u8>> {
    match Format::of_name(path) {
        Format::Text => to_csv(path, data, layout),
        Format::Stored(kind) => Err(Error::new(
            ErrorKind::NotBuiltIn,
            format!(
                "{} would be a file of {}, which is read but not written",
                path.display(),
                kind.name
            ),
            "choose a name that ends in .csv or .parquet",
        )),
        Format::Parquet => parquet::to_parquet(path, data, layout),
        Format::Gzip => {
            let inner = gzip::unpacked_name(path).unwrap_or_default();
            gzip::packed(path, &to_bytes(&inner, data, layout)?)
        }
    }
}
