//! `leverrier diagnose`: what is missing.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::bench::{Bench, Splitting};
use super::console::Console;
use super::progress::Progress;
use crate::diagnose::missing::{self, Diagnosis};
use crate::error::Result;
use crate::report::diagnosis_text;

/// Say which physical effect a model lacks, or that nothing is missing.
///
/// Every effect of the catalogue is tried on every coordinate and pair that it can act on; the
/// leaders are fitted in full and ranked.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier diagnose pendulum.ham\n  \
    leverrier diagnose pendulum.ham --unseen 0.5 --format json\n\n\
    `leverrier effects` lists what is tried; `leverrier add` puts one into the spec.")]
pub struct Arguments {
    /// The spec.
    pub spec: PathBuf,
    #[command(flatten)]
    pub splitting: Splitting,
}

/// Runs the command.
pub fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let bench = Bench::open(&arguments.spec, &arguments.splitting, console)?;
    let progress = Progress::new();
    let (model, terms) = bench.model(&progress)?;
    let (project, split) = (&bench.project, &bench.split);
    let diagnosis = match bench.unseen() {
        Some(unseen) => missing::diagnose(
            &project.name(),
            &project.text,
            &project.compiled,
            &model,
            &split.training,
            unseen,
            &progress,
        )?,
        None => Diagnosis::too_little("no samples are left to judge an effect on".to_string()),
    };
    drop(progress);
    let text = diagnosis_text(&diagnosis, &split.how, terms, &project.name(), console.width());
    let mut object = json!({
        "format": "leverrier.diagnose/1",
        "system": project.system().name,
        "split": bench.split_json(),
        "terms_from": terms,
    });
    if let (Some(object), Value::Object(fields)) = (object.as_object_mut(), json!(diagnosis)) {
        object.extend(fields);
    }
    console.result(&text, &object)
}
