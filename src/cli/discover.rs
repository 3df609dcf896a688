//! `leverrier discover`: the loop, to the noise floor.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::bench::Bench;
use super::console::Console;
use super::ledger::{HeldOutErrors, Ledger};
use super::progress::Progress;
use super::project::fitting::{origin, write_model};
use super::project::lock::Lock;
use super::project::{ModelFile, Project};
use super::splitting::Splitting;
use crate::data::write_atomically;
use crate::diagnose::diagnosis::Verdict;
use crate::diagnose::discover::{Discovery, discover};
use crate::diagnose::sufficiency;
use crate::error::Result;
use crate::expr;
use crate::fit::{Options, Silent};
use crate::report::discovery_text;
use crate::report::layout::{WIDTH, wrapped};
use crate::spec::edit::insert;

/// Diagnose, add what is missing, fit again, until no effect lowers the error on held-out runs.
///
/// Every addition becomes a statement of the spec and a revision of its ledger; `undo` takes
/// them back one by one.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier discover pendulum.ham\n  \
    leverrier discover pendulum.ham --dry-run --format json")]
pub struct Arguments {
    /// The spec.
    pub spec: PathBuf,
    /// Say what would be added, and leave the spec as it is.
    #[arg(long)]
    pub dry_run: bool,
    #[command(flatten)]
    pub splitting: Splitting,
}

/// Runs the command.
pub fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    // Who only looks writes nothing, and need not wait.
    let lock = (!arguments.dry_run)
        .then(|| Lock::take(&arguments.spec, &Silent, |what| console.message(what)));
    let _lock = lock.transpose()?;
    let bench = Bench::open(&arguments.spec, &arguments.splitting.asked()?, console)?;
    let system = bench.project.system();
    let lacking = sufficiency::lacking(system, &bench.split.training, bench.held_out());
    let (None, Some(held_out)) = (&lacking, bench.held_out()) else {
        return too_little(&bench, &lacking.unwrap_or_default(), console);
    };
    let project = &bench.project;
    let options =
        Options { parameter_starts: project.compiled.starts.clone(), ..Options::default() };
    let progress = Progress::new();
    let found = discover(
        &project.name(),
        &project.text,
        &bench.split.training,
        held_out,
        &options,
        &progress,
    )?;
    let written = !arguments.dry_run && !found.steps.is_empty();
    if written {
        keep(&bench, &found, &progress)?;
    }
    drop(progress);
    let text = discovery_text(&found, &bench.split.how, written, &project.name(), console.width());
    let mut object = json!({
        "format": "leverrier.discover/2",
        "system": project.system().name,
        "split": bench.split_json(),
        "written": written,
    });
    if let (Some(object), Value::Object(fields)) = (object.as_object_mut(), json!(found)) {
        object.extend(fields);
    }
    console.result(&text, &object)
}

/// Nothing was done, for nothing could have been judged.
fn too_little(bench: &Bench, why: &str, console: &Console) -> Result<()> {
    let object = json!({
        "format": "leverrier.discover/2",
        "system": bench.project.system().name,
        "split": bench.split_json(),
        "written": false,
        "steps": [],
        "stop": why,
        "interrupted": false,
        "verdict": Verdict::TooLittleData,
        "text": bench.project.text,
        "model": null,
        "held_out_error": [null, null],
    });
    let text = format!("Too little data to say: {why}.\n\nSplit: {}", bench.split.how);
    let width = console.width().map_or(WIDTH, |width| usize::from(width).max(40));
    console.result(&wrapped(&text, width, 2), &object)
}

/// Writes the spec, its ledger and the model of all measurements.
fn keep(bench: &Bench, found: &Discovery, progress: &Progress) -> Result<()> {
    let old = &bench.project;
    let compiled = expr::build(&old.name(), &found.text)?;
    let project = Project { path: old.path.clone(), text: found.text.clone(), compiled };
    let whole = bench.refit(&project, &found.model, &bench.dataset, progress)?;
    let mut ledger = Ledger::open(&old.path)?;
    ledger.know(&old.text);
    let mut text = old.text.clone();
    for step in &found.steps {
        text = insert(&text, &step.snippet);
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
    ledger.write(&old.path)?;
    write_atomically(&old.path, project.text.as_bytes())?;
    let file = ModelFile { origin: origin(&project, &bench.dataset, &bench.about), model: whole };
    write_model(&project.model_path(), &file)
}
