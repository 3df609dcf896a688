//! Several files in one, for the browser to save.

use std::io::{Cursor, Write};

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use crate::error::{Error, ErrorKind, Result};

/// A zip archive of files: names with forward slashes, and what they hold.
pub(super) fn zip(folder: &str, files: &[(String, impl AsRef<[u8]>)]) -> Result<Vec<u8>> {
    let failed = |error: String| {
        Error::new(ErrorKind::Export, format!("cannot pack {folder}: {error}"), "export it again")
    };
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        archive
            .start_file(format!("{folder}/{name}"), SimpleFileOptions::default())
            .map_err(|error| failed(error.to_string()))?;
        archive.write_all(bytes.as_ref()).map_err(|error| failed(error.to_string()))?;
    }
    let done = archive.finish().map_err(|error| failed(error.to_string()))?;
    Ok(done.into_inner())
}
