//! `leverrier diagnose`: what is missing.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::console::Console;
use super::diagnosis_options::DiagnosisArguments;
use super::progress::Progress;
use super::splitting::SplitArguments;
use super::workspace::Workspace;
use crate::diagnose::LawOnData;
use crate::diagnose::diagnosis::{self, Diagnosis};
use crate::diagnose::instrument::detect;
use crate::diagnose::sufficiency;
use crate::error::Result;
use crate::report::{DiagnosisContext, diagnosis_text};

/// Say which physical effect a model lacks, or that nothing is missing.
///
/// Every effect of the catalogue is tested on every coordinate and pair that it can act on (a
/// score test, corrected for the number of tests); the best are fitted in full and ranked.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier diagnose pendulum.ham\n  \
    leverrier diagnose pendulum.ham --held-out 0.5 --format json\n\n\
    `leverrier effects` lists what is tested; `leverrier add` puts one into the spec.")]
pub(super) struct Arguments {
    /// The spec.
    pub spec: PathBuf,
    #[command(flatten)]
    pub diagnosis: DiagnosisArguments,
    #[command(flatten)]
    pub splitting: SplitArguments,
}

/// Runs the command.
pub(super) fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let workspace = Workspace::open(&arguments.spec, &arguments.splitting.asked()?, console)?;
    let progress = Progress::new();
    let (spec, split) = (&workspace.spec, &workspace.split);
    let (training, options) = (&split.training, arguments.diagnosis.options().tuned());
    let lacking = sufficiency::lacking(spec.system(), training, workspace.held_out(), &options);
    let (diagnosis, terms, detections) = match (lacking, workspace.held_out()) {
        (None, Some(held_out)) => {
            let (model, terms) = workspace.model(&progress)?;
            let (base, law) = (spec.compiled(), spec.learned(&model)?);
            let diagnosis =
                diagnosis::diagnose(base, &law, training, held_out, &options, &progress)?;
            (diagnosis, terms, detect(&LawOnData::of(law, training, &options)))
        }
        (lacking, _) => {
            let diagnosis = Diagnosis::too_little(lacking.unwrap_or_default());
            (diagnosis, "none was fitted", Vec::new())
        }
    };
    drop(progress);
    let found: Vec<&str> = detections.iter().map(|found| found.sentence.as_str()).collect();
    let about = DiagnosisContext { how: &split.how, terms, spec: spec.name(), detections: &found };
    let text = diagnosis_text(&diagnosis, &about, console.width());
    let mut object = json!({
        "format": "leverrier.diagnose/2",
        "system": spec.system().name,
        "split": workspace.split_json(),
        "terms_from": terms,
        "detections": detections,
    });
    if let (Some(object), Value::Object(fields)) = (object.as_object_mut(), json!(diagnosis)) {
        object.extend(fields);
    }
    console.result(&text, &object)
}
