//! Writing folders whole or not at all.

use std::path::Path;

use super::beside::TemporaryFolder;
use super::write::write_atomically;
use crate::error::{Error, ErrorKind, Result};

/// Writes a folder whole or not at all: into a temporary one beside it, which takes its name.
///
/// # Errors
/// The folder is not empty (unless with `force`), or the disk says no.
pub fn write_folder(folder: &Path, files: &[(String, String)], force: bool) -> Result<()> {
    let occupied = match std::fs::read_dir(folder) {
        Ok(mut entries) => entries.next().is_some(),
        Err(_) if folder.exists() => {
            return Err(Error::new(
                ErrorKind::AlreadyExists,
                format!("{} is not a folder", folder.display()),
                "name a folder that does not exist yet",
            ));
        }
        Err(_) => false,
    };
    if occupied && !force {
        return Err(Error::new(
            ErrorKind::AlreadyExists,
            format!("the folder {} is not empty", folder.display()),
            "write into it deliberately, or choose another folder",
        ));
    }
    let failed = |path: &Path| {
        let path = path.to_path_buf();
        move |error| Error::file("write", &path, error)
    };
    let parent = match folder.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if occupied {
        // Into what is there: file by file, each of them whole.
        for (name, text) in files {
            let path = folder.join(name);
            if let Some(inner) = path.parent() {
                std::fs::create_dir_all(inner).map_err(failed(inner))?;
            }
            write_atomically(&path, text.as_bytes())?;
        }
        return Ok(());
    }
    let temporary = TemporaryFolder::create(parent)
        .map_err(|error| Error::file("create", folder, std::io::Error::from(error.kind())))?;
    let inside = temporary.inside();
    for (name, text) in files {
        let path = inside.join(name);
        if let Some(inner) = path.parent() {
            std::fs::create_dir_all(inner).map_err(failed(folder))?;
        }
        std::fs::write(&path, text).map_err(failed(&folder.join(name)))?;
    }
    if folder.exists() {
        std::fs::remove_dir(folder).map_err(failed(folder))?;
    }
    std::fs::rename(&inside, folder).map_err(failed(folder))
}
