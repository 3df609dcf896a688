//! `leverrier undo` and `history`: the revisions of a spec.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::console::Console;
use super::console::usage;
use super::ledger::{HeldOutErrors, Ledger, date};
use super::project::lock::Lock;
use super::project::undo::{self, spec_text};
use crate::error::Result;
use crate::fit::Silent;
use crate::report::layout::{WIDTH, table, wrapped};

/// Bring back the spec as it was before the last `add` or `remove`.
#[derive(Args)]
#[command(after_help = "Examples:\n  leverrier undo pendulum.ham")]
pub(super) struct Undo {
    /// The spec.
    pub spec: PathBuf,
    /// Also when the spec was edited by hand since; the edits stay in the ledger.
    #[arg(long)]
    pub force: bool,
}

/// List the revisions of a spec.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier history pendulum.ham\n  \
    leverrier history pendulum.ham --show 2        the spec as revision 2 left it")]
pub(super) struct History {
    /// The spec.
    pub spec: PathBuf,
    /// Print the text of this revision, undone ones too.
    #[arg(long, value_name = "NUMBER")]
    pub show: Option<usize>,
}

/// Runs `undo`.
pub(super) fn undo(arguments: &Undo, console: &Console) -> Result<()> {
    let path = &arguments.spec;
    let lock = Lock::take(path, &Silent, |what| console.message(what))?;
    let undone = undo::undo(path, arguments.force)?;
    drop(lock);
    let again = if undone.model_removed { "; its model is removed: fit again" } else { "" };
    let mut text =
        format!("Undone: {}. {} is as it was before{again}.", undone.action, path.display());
    if undone.edits_kept {
        text.push_str(" What was edited by hand is in the ledger: see `leverrier history`.");
    }
    let object = json!({
        "format": "leverrier.undo/1",
        "spec": path.display().to_string(),
        "undone": undone.action,
        "edits_kept": undone.edits_kept,
        "model_removed": undone.model_removed,
    });
    let width = console.width().map_or(WIDTH, |width| usize::from(width).max(40));
    console.result(&wrapped(&text, width, 2), &object)
}

/// Runs `history`.
pub(super) fn history(arguments: &History, console: &Console) -> Result<()> {
    let path = &arguments.spec;
    let text = spec_text(path)?;
    let mut ledger = Ledger::open(path)?;
    let lost = ledger.recover(&text);
    let current = ledger.current();
    if let Some(number) = arguments.show {
        let Some(revision) = ledger.revisions.get(number) else {
            return Err(usage(
                format!("{} has no revision {number}", path.display()),
                format!("`leverrier history {}` lists them", path.display()),
            ));
        };
        let object = json!({
            "format": "leverrier.revision/2",
            "number": number,
            "revision": revision,
        });
        return console.result(&revision.spec, &object);
    }
    let error = |judged: &Option<HeldOutErrors>| {
        let error = judged.as_ref().and_then(|j| j.held_out_error);
        error.map_or(String::new(), |error| format!("{error:.2}"))
    };
    let rows: Vec<Vec<String>> = ledger
        .revisions
        .iter()
        .enumerate()
        .map(|(at, r)| {
            let mark = match r.undone {
                true => "undone",
                false if Some(at) == current => "now",
                false => "",
            };
            let (before, after) = (error(&r.before), error(&r.after));
            vec![at.to_string(), date(r.time), r.action.clone(), before, after, mark.into()]
        })
        .collect();
    let edited = current.and_then(|at| ledger.revisions.get(at)).is_some_and(|r| r.spec != text);
    let width = console.width().map_or(WIDTH, |width| usize::from(width).max(40));
    let mut out = if rows.is_empty() {
        format!("{} has no revisions yet.", path.display())
    } else {
        let header = ["", "time (UTC)", "action", "held-out error before", "after", ""];
        table(&header, rows, &[0, 3, 4], width)
    };
    let mut note = |sentence: &str| {
        out.push_str("\n\n");
        out.push_str(&wrapped(sentence, width, 2));
    };
    if edited {
        note("The spec was edited by hand since.");
    }
    if let Some(first) = lost.first() {
        note(&format!(
            "The spec is as it was before `{first}`, which counts as undone: it never came to its \
             end, or was taken back by hand."
        ));
    }
    let revisions: Vec<Value> = ledger
        .revisions
        .iter()
        .enumerate()
        .map(|(at, r)| {
            json!({
                "number": at, "action": r.action, "time": r.time, "undone": r.undone,
                "current": Some(at) == current, "before": r.before, "after": r.after, "spec": r.spec,
            })
        })
        .collect();
    let object = json!({
        "format": "leverrier.history/2",
        "spec": path.display().to_string(),
        "edited_by_hand": edited,
        "revisions": revisions,
    });
    console.result(&out, &object)
}
