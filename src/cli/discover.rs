//! `leverrier discover`: the loop, to the noise floor.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::console::Console;
use super::diagnosis_options::DiagnosisArguments;
use super::ledger::{HeldOutErrors, Ledger};
use super::progress::Progress;
use super::project::ModelFile;
use super::project::fitting::{origin, write_model};
use super::project::lock::Lock;
use super::splitting::SplitArguments;
use super::workspace::Workspace;
use crate::data::write_atomically;
use crate::diagnose::diagnosis::Verdict;
use crate::diagnose::discover::{Discovery, discover};
use crate::diagnose::sufficiency;
use crate::error::Result;
use crate::facade::DiscoveryOptions;
use crate::fit::{Monitor as _, Options, Silent};
use crate::report::discovery_text;
use crate::report::layout::{WIDTH, wrapped};

/// Diagnose, add what is missing, fit again, until what is left is noise or nothing is clear of it.
///
/// What is clear of an explanation that leaves more than noise is added, too, and it is said how
/// much that is.
///
/// Every addition becomes a statement of the spec and a revision of its ledger; `undo` takes
/// them back one by one.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier discover pendulum.ham\n  \
    leverrier discover pendulum.ham --dry-run --format json")]
pub(super) struct Arguments {
    /// The spec.
    pub spec: PathBuf,
    /// Say what would be added, and leave the spec as it is.
    #[arg(long)]
    pub dry_run: bool,
    #[command(flatten)]
    pub diagnosis: DiagnosisArguments,
    #[command(flatten)]
    pub splitting: SplitArguments,
}

/// Runs the command.
pub(super) fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    // Who only looks writes nothing, and need not wait.
    let lock = (!arguments.dry_run)
        .then(|| Lock::take(&arguments.spec, &Silent, |what| console.message(what)));
    let _lock = lock.transpose()?;
    let workspace = Workspace::open(&arguments.spec, &arguments.splitting.asked()?, console)?;
    let spec = &workspace.spec;
    let options = DiscoveryOptions {
        fit: Options { parameter_starts: spec.compiled().starts.clone(), ..Options::default() },
        diagnosis: arguments.diagnosis.options(),
    }
    .tuned();
    let training = &workspace.split.training;
    let lacking =
        sufficiency::lacking(spec.system(), training, workspace.held_out(), &options.diagnosis);
    let (None, Some(held_out)) = (&lacking, workspace.held_out()) else {
        return too_little(&workspace, &lacking.unwrap_or_default(), console);
    };
    let progress = Progress::new();
    let (name, text) = (spec.name(), spec.text());
    let found = discover(name, text, training, held_out, &options, &progress)?;
    let written = !arguments.dry_run && !found.steps.is_empty();
    if written {
        keep(&workspace, &found, &progress)?;
    }
    drop(progress);
    let text = discovery_text(&found, &workspace.split.how, written, spec.name(), console.width());
    let mut object = json!({
        "format": "leverrier.discover/2",
        "system": spec.system().name,
        "split": workspace.split_json(),
        "written": written,
    });
    if let (Some(object), Value::Object(fields)) = (object.as_object_mut(), json!(found)) {
        object.extend(fields);
    }
    console.result(&text, &object)
}

/// Nothing was done, for nothing could have been judged.
fn too_little(workspace: &Workspace, why: &str, console: &Console) -> Result<()> {
    let object = json!({
        "format": "leverrier.discover/2",
        "system": workspace.spec.system().name,
        "split": workspace.split_json(),
        "written": false,
        "steps": [],
        "stop": why,
        "interrupted": false,
        "verdict": Verdict::TooLittleData,
        "text": workspace.spec.text(),
        "model": null,
        "held_out_error": [null, null],
    });
    let text = format!("Too little data to say: {why}.\n\nSplit: {}", workspace.split.how);
    let width = console.width().map_or(WIDTH, |width| usize::from(width).max(40));
    console.result(&wrapped(&text, width, 2), &object)
}

/// Writes the spec, its ledger and the model of all measurements.
fn keep(workspace: &Workspace, found: &Discovery, progress: &Progress) -> Result<()> {
    let old = &workspace.spec;
    let spec = old.edited(found.text.clone())?;
    // Who is in a hurry gets the numbers of the training part.
    let whole = match progress.halted() {
        true => found.model.clone(),
        false => workspace.refit(&spec, &found.model, &workspace.dataset, progress)?,
    };
    let mut ledger = Ledger::open(old.file())?;
    ledger.know(old.text());
    let mut text = old.text().to_string();
    for step in &found.steps {
        text = step.written_into(&text);
        let judged = |error: f64| HeldOutErrors {
            held_out_error: Some(error),
            samples: found.model.evidence.window,
            ..HeldOutErrors::unknown()
        };
        ledger.push(
            format!("add {}", step.effect),
            text.clone(),
            Some(judged(step.held_out_error_before)),
            Some(judged(step.held_out_error_after)),
        );
    }
    ledger.write(old.file())?;
    write_atomically(old.file(), spec.text().as_bytes())?;
    let file =
        ModelFile { origin: origin(&spec, &workspace.dataset, &workspace.about), model: whole };
    write_model(&spec.model_path(), &file)
}
