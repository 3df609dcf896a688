//! Files that are compressed with gzip, such as `swings.csv.gz`.

use std::io::Read;
use std::path::{Path, PathBuf};

#[cfg(not(feature = "files"))]
use super::table::wrong;
use crate::error::{Error, Result};

/// The first bytes of such a file.
const MAGIC: &[u8] = b"\x1f\x8b\x08";

/// Whether the first bytes of a file are those of gzip.
pub(super) fn is_gzip(start: &[u8]) -> bool {
    start.starts_with(MAGIC)
}

/// The name that the file has once it is unpacked, where its own says that it is compressed.
pub(super) fn unpacked_name(path: &Path) -> Option<PathBuf> {
    let ending = path.extension()?.to_string_lossy().to_lowercase();
    (ending == "gz").then(|| path.with_extension(""))
}

/// All that a file holds.
///
/// # Errors
/// It is cut off or damaged, or holds far more than its size.
pub(super) fn unpacked(path: &Path, bytes: &[u8]) -> Result<Vec<u8>> {
    let most = super::files::most_inflated(bytes);
    let mut out = Vec::new();
    let read = reader(path, bytes)?.take(most + 1).read_to_end(&mut out);
    read.map_err(|error| failed(path, error))?;
    if out.len() as u64 > most {
        return Err(super::files::damaged(path, super::files::INFLATED));
    }
    Ok(out)
}

/// The first bytes that a file holds, at most so many.
///
/// # Errors
/// As [`unpacked`], as far as the first bytes show it.
pub(super) fn first(path: &Path, most: usize) -> Result<Vec<u8>> {
    let file = std::fs::File::open(path).map_err(|error| Error::file("read", path, error))?;
    let mut out = Vec::new();
    let read = reader(path, file)?.take(most as u64).read_to_end(&mut out);
    read.map_err(|error| failed(path, error))?;
    Ok(out)
}

/// What is read of a file that is compressed; of errors see [`failed`].
///
/// # Errors
/// This program is built without it.
#[cfg(feature = "files")]
pub(super) fn reader<'a, R: Read + Send + 'a>(
    _: &Path,
    bytes: R,
) -> Result<Box<dyn Read + Send + 'a>> {
    Ok(Box::new(flate2::read::MultiGzDecoder::new(bytes)))
}

/// What is read of a file that is compressed: nothing in this program.
#[cfg(not(feature = "files"))]
pub(super) fn reader<'a, R: Read + Send + 'a>(
    path: &Path,
    _: R,
) -> Result<Box<dyn Read + Send + 'a>> {
    let message = "this file is compressed with gzip, which is left out of this program";
    Err(wrong(path, None, None, message, "unpack it, or build with the feature `files`"))
}

/// The bytes of a file, compressed.
///
/// # Errors
/// This program is built without it.
#[cfg(feature = "files")]
pub(super) fn packed(path: &Path, bytes: &[u8]) -> Result<Vec<u8>> {
    use std::io::Write;
    let failed = |error| Error::file("write", path, error);
    let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    out.write_all(bytes).map_err(failed)?;
    out.finish().map_err(failed)
}

/// The bytes of a file, compressed: not by this program.
#[cfg(not(feature = "files"))]
pub(super) fn packed(path: &Path, _: &[u8]) -> Result<Vec<u8>> {
    Err(Error::new(
        crate::error::ErrorKind::NotBuiltIn,
        format!("{} would be compressed, which is left out of this program", path.display()),
        "build it with the feature `files`, or choose a name that ends in .csv",
    ))
}

/// Says what a failure to unpack means.
pub(super) fn failed(path: &Path, error: std::io::Error) -> Error {
    use std::io::ErrorKind::{InvalidData, InvalidInput, UnexpectedEof};
    match error.kind() {
        UnexpectedEof => super::files::cut_off(path),
        InvalidData | InvalidInput => super::files::damaged(path, "its gzip cannot be unpacked"),
        _ => Error::file("read", path, error),
    }
}
