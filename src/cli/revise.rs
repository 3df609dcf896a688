//! `leverrier add` and `remove`: a spec and its effects, step by step.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::console::Console;
use super::ledger::Ledger;
use super::progress::Progress;
use super::project::lock::Lock;
use super::project::revise::{self, RevisionOutcome};
use super::splitting::SplitArguments;
use super::workspace::Workspace;
use crate::error::Result;
use crate::fit::Silent;
use crate::report::present;
use crate::report::{RevisionSummary, revision_text};

/// Add an effect to a spec, learn again, and show before and after on held-out runs.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier add pendulum.ham viscous_drag\n  \
    leverrier add pendulum.ham \"coupling_spring(q1, q2)\"\n  \
    leverrier add pendulum.ham \"harmonic_drive(theta; frequency = 2.5)\"\n\n\
    Comments and layout of the spec stay; `leverrier undo pendulum.ham` takes it back.")]
pub(super) struct Add {
    /// The spec.
    pub spec: PathBuf,
    /// The effect: its name, and what it is on where there is a choice.
    pub effect: String,
    #[command(flatten)]
    pub splitting: SplitArguments,
}

/// Take an effect or a term out of a spec, learn again, and show before and after.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier remove pendulum.ham viscous_drag\n  \
    leverrier remove pendulum.ham stiffness        a term that the spec calls so")]
pub(super) struct Remove {
    /// The spec.
    pub spec: PathBuf,
    /// The effect, with what it is on where there is a choice; or the name of a term.
    pub effect: String,
    #[command(flatten)]
    pub splitting: SplitArguments,
}

/// Runs `add`.
pub(super) fn add(arguments: &Add, console: &Console) -> Result<()> {
    let _lock = Lock::take(&arguments.spec, &Silent, |what| console.message(what))?;
    let workspace = Workspace::open(&arguments.spec, &arguments.splitting.asked()?, console)?;
    let progress = Progress::new();
    let revision = revise::add(&workspace, None, &arguments.effect, &progress)?;
    drop(progress);
    revision.keep(&workspace)?;
    show(&workspace, &revision, console)
}

/// Runs `remove`.
pub(super) fn remove(arguments: &Remove, console: &Console) -> Result<()> {
    let _lock = Lock::take(&arguments.spec, &Silent, |what| console.message(what))?;
    let workspace = Workspace::open(&arguments.spec, &arguments.splitting.asked()?, console)?;
    let progress = Progress::new();
    let revision = revise::remove(&workspace, None, &arguments.effect, &progress)?;
    drop(progress);
    revision.keep(&workspace)?;
    show(&workspace, &revision, console)
}

fn show(workspace: &Workspace, revision: &RevisionOutcome, console: &Console) -> Result<()> {
    let revised = RevisionSummary {
        action: &revision.action,
        how: &workspace.split.how,
        before: &revision.was.horizons,
        after: &revision.is.horizons,
        moved: &revision.moved,
        effect: &revision.effect,
        supported: revision.supported,
        why: &revision.why,
    };
    let object = json!({
        "format": if revision.adds { "leverrier.add/2" } else { "leverrier.remove/2" },
        "system": workspace.spec.system().name,
        "action": revision.action,
        "split": workspace.split_json(),
        "before": revision.was,
        "after": revision.is,
        "effect": revision.effect.iter().map(|(term, value, error)| json!({
            "term": term, "coefficient": value, "standard_error": present::finite(*error),
        })).collect::<Vec<_>>(),
        "moved": revision.moved,
        "supported": revision.supported,
        "reason": revision.why,
        "spec": workspace.spec.name(),
        "model_file": workspace.spec.model_path().display().to_string(),
        "ledger": Ledger::path(workspace.spec.file()).display().to_string(),
    });
    console.result(&revision_text(&revised, console.width()), &object)
}
