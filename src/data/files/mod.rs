//! Files that programs for numbers write: each format is a row of [`KINDS`] and a file beside
//! this one. They are read whole.
//!
//! One file may hold several tables: what stands behind a # in its name says which, as in
//! `rig.mat#swings` or `rig.xlsx#Sheet2`.

#[cfg(feature = "arrow")]
mod arrow;
#[cfg(feature = "files")]
mod excel;
#[cfg(feature = "files")]
mod hdf5;
#[cfg(feature = "files")]
mod matlab;
#[cfg(feature = "files")]
mod numpy;
#[cfg(feature = "files")]
mod variables;

use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::table::{Table, wrong};
use crate::error::{Error, Result};

/// Reads the bytes of a file, and of what is named in it.
type Read = fn(&Path, &[u8], Option<&str>) -> Result<Table>;

/// A format of files.
#[derive(Debug)]
pub struct Kind {
    /// What it is called in a sentence.
    pub name: &'static str,
    /// What its files are called.
    endings: &'static [&'static str],
    /// Whether the first bytes of a file are those of this format.
    begins: fn(&[u8]) -> bool,
    /// The feature that it needs, and how it is then read.
    feature: &'static str,
    read: Option<Read>,
}

impl PartialEq for Kind {
    fn eq(&self, other: &Kind) -> bool {
        self.name == other.name
    }
}

impl Eq for Kind {}

/// Bytes that tell the format of a file.
pub(super) const FIRST: usize = 4096;

macro_rules! read {
    ($feature:literal, $($path:ident)::+) => {{
        #[cfg(feature = $feature)]
        let read: Option<Read> = Some($($path)::+);
        #[cfg(not(feature = $feature))]
        let read: Option<Read> = None;
        read
    }};
}

/// All formats but text and Parquet.
const KINDS: &[Kind] = &[
    Kind {
        name: "MATLAB",
        endings: &["mat"],
        begins: |bytes| {
            bytes.starts_with(b"MATLAB 5.0 MAT") || bytes.starts_with(b"MATLAB 7.3 MAT")
        },
        feature: "files",
        read: read!("files", matlab::read),
    },
    Kind {
        name: "HDF5",
        endings: &["h5", "hdf5", "hdf", "he5"],
        begins: |bytes| bytes.starts_with(b"\x89HDF\r\n\x1a\n"),
        feature: "files",
        read: read!("files", hdf5::read),
    },
    Kind {
        name: "NumPy array",
        endings: &["npy"],
        begins: |bytes| bytes.starts_with(b"\x93NUMPY"),
        feature: "files",
        read: read!("files", numpy::read),
    },
    Kind {
        name: "NumPy archive",
        endings: &["npz"],
        begins: |bytes| bytes.starts_with(b"PK\x03\x04") && contains(bytes, b".npy"),
        feature: "files",
        read: read!("files", numpy::read_archive),
    },
    Kind {
        name: "Excel",
        endings: &["xlsx", "xlsm", "xls", "ods"],
        begins: |bytes| {
            bytes.starts_with(b"PK\x03\x04")
                && (contains(bytes, b"[Content_Types].xml") || contains(bytes, b"xl/"))
        },
        feature: "files",
        read: read!("files", excel::read),
    },
    Kind {
        name: "Arrow",
        endings: &["feather", "arrow", "arrows", "ipc"],
        begins: |bytes| bytes.starts_with(b"ARROW1") || bytes.starts_with(b"FEA1"),
        feature: "arrow",
        read: read!("arrow", arrow::read),
    },
];

impl Kind {
    /// The format of a file by its name.
    pub(super) fn of_name(path: &Path) -> Option<&'static Kind> {
        let ending = path.extension()?.to_string_lossy().to_lowercase();
        KINDS.iter().find(|kind| kind.endings.contains(&ending.as_str()))
    }

    /// The format of a file by its first bytes.
    pub(super) fn of_bytes(bytes: &[u8]) -> Option<&'static Kind> {
        let first = bytes.get(..FIRST).unwrap_or(bytes);
        KINDS.iter().find(|kind| (kind.begins)(first))
    }

    /// Reads the bytes of a file; `path` is what errors call it, and may name a part.
    pub(super) fn read(&self, path: &Path, bytes: &[u8]) -> Result<Table> {
        if bytes.is_empty() {
            let hint = "export the measurements again";
            return Err(wrong(path, None, None, "the file is empty", hint));
        }
        match self.read {
            Some(read) => read(path, bytes, parted(path).1.as_deref()),
            None => Err(wrong(
                path,
                None,
                None,
                format!("this is a file of {}, which is left out of this program", self.name),
                format!("build it with the feature `{}`, or save the file as CSV", self.feature),
            )),
        }
    }
}

/// The file itself and the part of it that is named behind a #; a file with such a name is meant
/// where there is one.
pub(super) fn parted(path: &Path) -> (PathBuf, Option<String>) {
    let whole = || (path.to_path_buf(), None);
    let Some((file, part)) = path.to_str().and_then(|name| name.split_once('#')) else {
        return whole();
    };
    let known = Kind::of_name(Path::new(file)).is_some();
    if part.is_empty() || !known || path.exists() {
        return whole();
    }
    (PathBuf::from(file), Some(part.to_string()))
}

/// Bytes that a file may hold once it is decompressed, at most: measurements shrink to a twentieth
/// at best, columns that never change to a thousandth. More is a file that was made to fill the
/// memory.
pub(super) fn most_inflated(bytes: &[u8]) -> u64 {
    const FREELY: u64 = 64 << 20;
    const TIMES: u64 = 100;
    FREELY + TIMES * bytes.len() as u64
}

/// It holds more than that.
pub(super) const INFLATED: &str = "it holds over a hundred times more than its size";

/// SHA-256 of a file's bytes, in hexadecimal digits.
pub(super) fn digest(bytes: &[u8]) -> String {
    format!("{:x}", Sha256::digest(bytes))
}

fn contains(bytes: &[u8], what: &[u8]) -> bool {
    let first = bytes.get(..FIRST).unwrap_or(bytes);
    first.windows(what.len()).any(|window| window == what)
}

/// The file ends before it should.
pub(super) fn cut_off(path: &Path) -> Error {
    let hint = "copy it again, or close the program that writes it";
    wrong(path, None, None, "the file is cut off: it ends in the middle of the measurements", hint)
}

pub(super) fn damaged(path: &Path, what: &str) -> Error {
    let hint = "copy it again, or export the measurements again";
    wrong(path, None, None, format!("the file is damaged ({what})"), hint)
}
