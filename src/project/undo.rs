//! Taking the last revision of a spec back.

use std::path::Path;

use super::ledger::{BY_HAND, Ledger};
use crate::data::write_atomically;
use crate::error::{Error, ErrorKind, Result};

/// What was taken back.
pub(crate) struct Undone {
    /// The action.
    pub action: String,
    /// Whether a text that was edited by hand went into the ledger.
    pub edits_kept: bool,
    /// Whether the model of the text that is gone was there.
    pub model_removed: bool,
}

/// Brings back the spec as it was before the last revision. `force`: also when it was edited by
/// hand since; the edits stay in the ledger.
///
/// # Errors
/// There is nothing to undo, or it was edited by hand.
pub(crate) fn undo(path: &Path, force: bool) -> Result<Undone> {
    let text = spec_text(path)?;
    let mut ledger = Ledger::open(path)?;
    let lost = ledger.recover(&text);
    let newest = |ledger: &Ledger| {
        let at = ledger.current()?;
        ledger.revisions.get(at).map(|revision| (revision.action.clone(), revision.spec.clone()))
    };
    let edited = newest(&ledger).is_some_and(|(action, spec)| spec != text || action == BY_HAND);
    if edited && !force {
        return Err(Error::new(
            ErrorKind::ChangedMeanwhile,
            format!("{} was edited by hand since the last revision", path.display()),
            "go back nevertheless if that is meant; the edited text stays in the ledger",
        ));
    }
    let nothing = || {
        let what = format!("there is nothing to undo in {}", path.display());
        match lost.first() {
            Some(lost) => Error::new(
                ErrorKind::NothingToDo,
                format!("{what}: `{lost}` never came to its end"),
                "the spec is as it was before; `leverrier add` does it again",
            ),
            None => Error::new(
                ErrorKind::NothingToDo,
                what,
                "`leverrier add` and `leverrier remove` make revisions",
            ),
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
    if let Err(error) = ledger.write(path) {
        // Refused is not half done: as far as the disk lets it, the spec is as it was.
        let _ = write_atomically(path, text.as_bytes());
        return Err(error);
    }
    // The model belongs to the text that is gone.
    let model = path.with_extension("model.json");
    let removed = model.exists();
    if removed {
        std::fs::remove_file(&model).map_err(|error| Error::file("remove", &model, error))?;
    }
    Ok(Undone { action: undone, edits_kept: edited, model_removed: removed })
}

/// The text of a spec that need not compile.
pub(crate) fn spec_text(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).map_err(|error| Error::file("read", path, error))
}
