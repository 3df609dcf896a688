//! `leverrier export`: the model in the language of others.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::console::Console;
use super::project::{Law, Project, digest, refuse_overwrite};
use crate::data::write_atomically;
use crate::dynamics::{Dynamics, Method};
use crate::error::{Error, Result};
use crate::eval::Backend;
use crate::export::{self, EXPORTERS, Export, Output, Provenance};
use crate::expr::System;
use crate::report::present;

/// Step of an exported simulator of a known system, in the spec's unit of time.
const KNOWN_STEP: f64 = 0.01;

/// Write the model as LaTeX, code or data for others to read and run.
///
/// Takes the fitted model beside the spec; a fully known spec needs none.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier export pendulum.ham latex                    to standard output\n  \
    leverrier export pendulum.ham latex --document -o pendulum.tex\n  \
    leverrier export pendulum.ham rust -o pendulum-simulator\n  \
    leverrier export pendulum.ham python > pendulum.py")]
pub struct Arguments {
    /// The spec.
    pub spec: PathBuf,
    /// The format.
    #[arg(value_parser = EXPORTERS.iter().map(|row| row.name).collect::<Vec<_>>())]
    pub to: String,
    /// File, or folder for `rust` and `c`; by default standard output, or a folder beside the spec.
    #[arg(short, long, value_name = "PATH")]
    pub output: Option<PathBuf>,
    /// With latex: a whole document instead of a fragment.
    #[arg(long)]
    pub document: bool,
    /// Write into what is already there.
    #[arg(long)]
    pub force: bool,
    /// The model file, if it is not beside the spec.
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
}

/// Runs the command.
pub fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let name = match (arguments.document, arguments.to.as_str()) {
        (true, "latex") => "latex-document",
        (true, other) if other != "latex-document" => {
            return Err(Error::usage(
                format!("--document does not go with {other}"),
                "leave it out, or export latex",
            ));
        }
        (_, name) => name,
    };
    let row = export::exporter(name)?;
    let project = Project::open(&arguments.spec)?;
    let law = project.law(arguments.model.as_deref())?;
    let pretty = present::pretty(&present::of_law(&law.fitted(project.system()), law.ranges()));
    let output = (row.export)(&the_export(&project, &law, &pretty)?)?;
    match output {
        Output::Text(text) => match &arguments.output {
            None if !console.is_json() => console.text(&text),
            None => {
                let object = json!({
                    "format": "leverrier.export-command/1", "to": name, "text": text,
                });
                console.result("", &object)
            }
            Some(path) => {
                refuse_overwrite(path, arguments.force)?;
                write_atomically(path, text.as_bytes())?;
                written(console, name, path, &[])
            }
        },
        Output::Files(files) => {
            let folder = arguments.output.clone().unwrap_or_else(|| default_folder(&project, name));
            write_folder(&folder, &files, arguments.force)?;
            let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
            written(console, name, &folder, &names)
        }
    }
}

fn written(console: &Console, to: &str, path: &Path, files: &[&str]) -> Result<()> {
    let object = json!({
        "format": "leverrier.export-command/1",
        "to": to,
        "path": path.display().to_string(),
        "files": files,
    });
    let list: String = files.iter().map(|file| format!("\n  {file}")).collect();
    console.result(&format!("Written to {}{list}", path.display()), &object)
}

/// `pendulum.ham` becomes `pendulum-rust`.
fn default_folder(project: &Project, format: &str) -> PathBuf {
    let stem = project.path.file_stem().map_or("model".into(), |stem| stem.to_string_lossy());
    project.path.with_file_name(format!("{stem}-{format}"))
}

/// A law as the exporters take it.
pub fn the_export<'a>(
    project: &'a Project,
    law: &'a Law,
    pretty: &'a export::Pretty,
) -> Result<Export<'a>> {
    let fitted = law.fitted(project.system());
    let (method, step) = match &law.file {
        Some(file) => {
            let used = &file.model.integrator;
            let method = Method::by_name(&used.method).ok_or_else(|| {
                Error::fit(
                    format!("the model was fitted with an unknown integrator `{}`", used.method),
                    "fit it again",
                )
            })?;
            (method, used.longest_step)
        }
        None => known_integrator(project.system())?,
    };
    let mut out = present::export(&fitted, &law.errors, pretty, method, step);
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
        out.noise =
            file.model.noise.iter().map(|n| (n.observable.clone(), n.standard_deviation)).collect();
    }
    Ok(out)
}

/// Nothing tells how accurate a known system must be: a high order and a short step.
fn known_integrator(system: &System) -> Result<(Method, f64)> {
    let separable = Dynamics::new(system, &[], Backend::default()).separable();
    let name = if separable { "suzuki-umeno-8" } else { "gauss-legendre-6" };
    let method = Method::by_name(name)
        .ok_or_else(|| Error::fit(format!("there is no integrator `{name}`"), "report this"))?;
    Ok((method, KNOWN_STEP))
}

/// Writes a folder whole or not at all: into a temporary one beside it, which takes its name.
fn write_folder(folder: &Path, files: &[(String, String)], force: bool) -> Result<()> {
    let occupied = match std::fs::read_dir(folder) {
        Ok(mut entries) => entries.next().is_some(),
        Err(_) if folder.exists() => {
            return Err(Error::usage(
                format!("{} is not a folder", folder.display()),
                "name a folder that does not exist yet with -o",
            ));
        }
        Err(_) => false,
    };
    if occupied && !force {
        return Err(Error::usage(
            format!("the folder {} is not empty", folder.display()),
            "give --force to write into it, or another folder with -o",
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
