//! `leverrier undo` and `history`: the revisions of a spec.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Value, json};

use super::console::Console;
use super::ledger::{BY_HAND, Judged, Ledger, date};
use crate::data::write_atomically;
use crate::error::{Error, Result};
use crate::report::layout::{WIDTH, table, wrapped};

/// Bring back the spec as it was before the last `add` or `remove`.
#[derive(Args)]
#[command(after_help = "Examples:\n  leverrier undo pendulum.ham")]
pub struct Undo {
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
pub struct History {
    /// The spec.
    pub spec: PathBuf,
    /// Print the text of this revision, undone ones too.
    #[arg(long, value_name = "NUMBER")]
    pub show: Option<usize>,
}

/// Runs `undo`.
pub fn undo(arguments: &Undo, console: &Console) -> Result<()> {
    let path = &arguments.spec;
    let text = spec_text(path)?;
    let mut ledger = Ledger::open(path)?;
    let lost = ledger.recover(&text);
    let newest = |ledger: &Ledger| {
        let at = ledger.current()?;
        ledger.revisions.get(at).map(|revision| (revision.action.clone(), revision.spec.clone()))
    };
    let edited = newest(&ledger).is_some_and(|(action, spec)| spec != text || action == BY_HAND);
    if edited && !arguments.force {
        return Err(Error::usage(
            format!("{} was edited by hand since the last revision", path.display()),
            "give --force to go back nevertheless; the edited text stays in the ledger, and \
             `history --show NUMBER` prints it",
        ));
    }
    let nothing = || {
        let what = format!("there is nothing to undo in {}", path.display());
        match lost.first() {
            Some(lost) => Error::usage(
                format!("{what}: `{lost}` never came to its end"),
                "the spec is as it was before; `leverrier add` does it again",
            ),
            None => Error::usage(what, "`leverrier add` and `leverrier remove` make revisions"),
        }
    };
    if edited {
        // Into the ledger before the spec goes: whatever happens then, the text is kept.
        let mut kept = ledger.clone();
        kept.know(&text);
        let mut ahead = kept.clone();
        while newest(&ahead).is_some_and(|(action, _)| action == BY_HAND) {
            ahead.take_back().ok_or_else(nothing)?;
        }
        ahead.clone().take_back().ok_or_else(nothing)?;
        kept.write(path)?;
        ledger = ahead;
    }
    let (undone, restored) = ledger.take_back().ok_or_else(nothing)?;
    // A spec without its ledger is understood (as an earlier revision), the reverse is not.
    write_atomically(path, restored.as_bytes())?;
    ledger.write(path)?;
    // The model belongs to the text that is gone.
    let model = path.with_extension("model.json");
    let removed = model.exists();
    if removed {
        std::fs::remove_file(&model).map_err(|error| Error::file("remove", &model, error))?;
    }
    let again = if removed { "; its model is removed: fit again" } else { "" };
    let mut text = format!("Undone: {undone}. {} is as it was before{again}.", path.display());
    if edited {
        text.push_str(" What was edited by hand is in the ledger: see `leverrier history`.");
    }
    let object = json!({
        "format": "leverrier.undo/1",
        "spec": path.display().to_string(),
        "undone": undone,
        "edits_kept": edited,
        "model_removed": removed,
    });
    let width = console.width().map_or(WIDTH, |width| usize::from(width).max(40));
    console.result(&wrapped(&text, width, 2), &object)
}

/// Runs `history`.
pub fn history(arguments: &History, console: &Console) -> Result<()> {
    let path = &arguments.spec;
    let text = spec_text(path)?;
    let mut ledger = Ledger::open(path)?;
    let lost = ledger.recover(&text);
    let current = ledger.current();
    if let Some(number) = arguments.show {
        let Some(revision) = ledger.revisions.get(number) else {
            return Err(Error::usage(
                format!("{} has no revision {number}", path.display()),
                format!("`leverrier history {}` lists them", path.display()),
            ));
        };
        let object = json!({
            "format": "leverrier.revision/1",
            "number": number,
            "revision": revision,
        });
        return console.result(&revision.spec, &object);
    }
    let error = |judged: &Option<Judged>| {
        let error = judged.as_ref().and_then(|j| j.unseen_error);
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
        let header = ["", "time (UTC)", "action", "unseen error before", "after", ""];
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
        "format": "leverrier.history/1",
        "spec": path.display().to_string(),
        "edited_by_hand": edited,
        "revisions": revisions,
    });
    console.result(&out, &object)
}

/// The text of a spec that need not compile.
fn spec_text(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).map_err(|error| Error::file("read", path, error))
}
