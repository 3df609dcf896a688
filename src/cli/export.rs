//! `leverrier export`: the model in the language of others.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::console::Console;
use super::console::usage;
use super::project::{Spec, refuse_overwrite};
use crate::data::{write_atomically, write_folder};
use crate::error::Result;
use crate::export::{EXPORTERS, Output};

/// Write the model as LaTeX, code or data for others to read and run.
///
/// Takes the fitted model beside the spec; a fully known spec needs none.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier export pendulum.ham latex                    to standard output\n  \
    leverrier export pendulum.ham latex --document -o pendulum.tex\n  \
    leverrier export pendulum.ham rust -o pendulum-simulator\n  \
    leverrier export pendulum.ham python > pendulum.py")]
pub(super) struct Arguments {
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
pub(super) fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let name = match (arguments.document, arguments.to.as_str()) {
        (true, "latex") => "latex-document",
        (true, other) if other != "latex-document" => {
            return Err(usage(
                format!("--document does not go with {other}"),
                "leave it out, or export latex",
            ));
        }
        (_, name) => name,
    };
    let spec = Spec::open(&arguments.spec)?;
    let law = spec.law(arguments.model.as_deref())?;
    match law.exported(name)? {
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
            let folder = arguments.output.clone().unwrap_or_else(|| default_folder(&spec, name));
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
fn default_folder(spec: &Spec, format: &str) -> PathBuf {
    let stem = spec.file().file_stem().map_or("model".into(), |stem| stem.to_string_lossy());
    spec.file().with_file_name(format!("{stem}-{format}"))
}
