//! `leverrier compare`: where a model fails.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::console::Console;
use super::progress::Progress;
use super::splitting::SplitArguments;
use super::workspace::Workspace;
use crate::diagnose::Options;
use crate::diagnose::comparison::Compared;
use crate::error::Result;
use crate::report::compare_text;

/// Show where a model fails: errors by horizon, energy drift, the force that is missing.
///
/// The runs are split; the model's numbers are learned from one part and judged on the other.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier compare pendulum.ham\n  \
    leverrier compare pendulum.ham --held-out 0.5 --seed 3\n  \
    leverrier compare pendulum.ham --format json")]
pub(super) struct Arguments {
    /// The spec.
    pub spec: PathBuf,
    #[command(flatten)]
    pub splitting: SplitArguments,
}

/// Runs the command.
pub(super) fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let workspace = Workspace::open(&arguments.spec, &arguments.splitting.asked()?, console)?;
    let progress = Progress::new();
    let (model, terms) = workspace.model(&progress)?;
    progress.nothing_to_keep()?;
    let (law, options) = (workspace.spec.learned(&model)?, Options::default());
    let (training, held_out) = (&workspace.split.training, workspace.held_out());
    let compared = Compared::new(law, training, held_out, &options, None)?;
    let Compared { comparison, detections, .. } = compared;
    drop(progress);
    let time = &workspace.spec.system().time;
    let unit = time.unit_text.as_deref().unwrap_or("");
    let text = compare_text(&comparison, &workspace.split.how, terms, unit, console.width());
    let mut object = json!({
        "format": "leverrier.compare/2",
        "system": workspace.spec.system().name,
        "split": workspace.split_json(),
        "terms_from": terms,
        "detections": detections,
    });
    if let (Some(object), serde_json::Value::Object(fields)) =
        (object.as_object_mut(), json!(comparison))
    {
        object.extend(fields);
    }
    console.result(&text, &object)
}
