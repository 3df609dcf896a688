//! The model in the language of others, as text and as folders.

use std::path::Path;

use super::{Project, ProjectLaw, digest};
use crate::data::write_atomically;
use crate::error::{Error, ErrorKind, Result};
use crate::export::{self, Export, Output, Provenance};
use crate::report::present;

/// A law in one of the formats of [`EXPORTERS`](export::EXPORTERS).
pub fn output(project: &Project, law: &ProjectLaw, name: &str) -> Result<Output> {
    let row = export::exporter(name)?;
    let pretty = present::pretty(&present::simplified(&law.law, law.ranges()));
    (row.export)(&the_export(project, law, &pretty))
}

/// A law as the exporters take it.
pub fn the_export<'a>(
    project: &'a Project,
    law: &'a ProjectLaw,
    pretty: &'a export::Pretty,
) -> Export<'a> {
    let mut out = present::export(&law.law, pretty);
    let own = digest(&project.path, project.text.as_bytes());
    out.provenance = Provenance {
        version: env!("CARGO_PKG_VERSION").to_string(),
        spec: (own.name, own.sha256),
        data: None,
        seed: 0,
    };
    if let Some(file) = &law.file {
        out.provenance.data =
            Some((file.origin.data.name.clone(), file.origin.data.sha256.clone()));
        out.provenance.seed = file.model.evidence.seed;
        out.start = file.origin.start.clone();
    }
    out
}

/// Writes a folder whole or not at all: into a temporary one beside it, which takes its name.
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
    let staging = tempfile::Builder::new()
        .prefix(".leverrier-")
        .tempdir_in(parent)
        .map_err(|error| Error::file("create", folder, std::io::Error::from(error.kind())))?;
    let inside = staging.path().join("export");
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
