//! `leverrier compare`: where a model fails.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::console::Console;
use super::progress::Progress;
use super::splitting::SplitArguments;
use super::workspace::Workspace;
use crate::diagnose::comparison;
use crate::diagnose::instrument::detect;
use crate::diagnose::noise_floor::noise_floor;
use crate::diagnose::{LawOnData, Measurements, Options};
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
pub struct Arguments {
    /// The spec.
    pub spec: PathBuf,
    #[command(flatten)]
    pub splitting: SplitArguments,
}

/// Runs the command.
pub fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let workspace = Workspace::open(&arguments.spec, &arguments.splitting.asked()?, console)?;
    let progress = Progress::new();
    let (model, terms) = workspace.model(&progress)?;
    let (law, options) = (workspace.spec.learned(&model)?, Options::default());
    let training = LawOnData::of(law, &workspace.split.training, &options);
    let detections = detect(&training);
    // A model that fails takes a part of what it lacks for noise; the floor is the instrument's.
    let training = training.with_noise(noise_floor(&training));
    let held_out = workspace.held_out().map(|data| Measurements::of(data, &options));
    let held_out = held_out.map(|data| training.with_data(&data));
    let mut comparison = comparison::compare(&training, held_out.as_ref())?;
    comparison.findings.extend(detections.iter().map(|found| found.sentence.clone()));
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
