//! Several files in one, for the browser to save.

use std::io::{Cursor, Write};

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use crate::error::{Error, Result};

/// A zip archive of files: names with forward slashes, and texts.
pub fn zip(folder: &str, files: &[(String, String)]) -> Result<Vec<u8>> {
    let failed =
        |error: String| Error::fit(format!("cannot pack {folder}: {error}"), "export it again");
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, text) in files {
        archive
            .start_file(format!("{folder}/{name}"), SimpleFileOptions::default())
            .map_err(|error| failed(error.to_string()))?;
        archive.write_all(text.as_bytes()).map_err(|error| failed(error.to_string()))?;
    }
    let done = archive.finish().map_err(|error| failed(error.to_string()))?;
    Ok(done.into_inner())
}
