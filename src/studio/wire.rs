//! What goes to the page. It is the page's own affair and changes without notice.

use serde::Serialize;
use serde_json::{Value, json};

use super::files;
use crate::diagnose::diagnosis::{Diagnosis, RankedEffect};
use crate::diagnostic::Diagnostic;
use crate::error::Error;
use crate::export::EXPORTERS;
use crate::project::ledger::{BY_HAND, HeldOutErrors, Ledger, date};
use crate::report::html::{self, Page};
use crate::report::plots::{Medium, PLOTS, Plot, PlotData, draw, number};
use crate::report::present;
use crate::spec::effects::by_name;

/// More diagnostics of one text than this are counted.
const SHOWN: usize = 50;

/// What is being done.
#[derive(Serialize)]
pub(super) struct Job<'a> {
    pub what: &'a str,
    pub stage: &'a str,
    /// 0 to 1.
    pub fraction: f64,
    pub background: bool,
}

/// Something that was done, or failed.
#[derive(Serialize)]
pub(super) struct Message {
    /// Counts messages, so that one can be told from the same again.
    number: u64,
    failed: bool,
    text: String,
    hint: Option<String>,
}

impl Message {
    pub(super) fn done(number: u64, text: &str) -> Self {
        Message { number, failed: false, text: text.to_string(), hint: None }
    }

    pub(super) fn failed(number: u64, error: &Error) -> Self {
        let Failure { message, hint, .. } = failure(error);
        Message { number, failed: true, text: message, hint }
    }
}

/// Why something cannot be done.
#[derive(Serialize)]
pub(super) struct Failure {
    message: String,
    hint: Option<String>,
}

/// An error in words.
pub(super) fn failure(error: &Error) -> Failure {
    match error {
        Error::Refused { message, hint, .. } => {
            Failure { message: message.clone(), hint: Some(hint.clone()) }
        }
        Error::Spec { diagnostics, .. } => {
            let count = diagnostics.len();
            let noun = if count == 1 { "an error".to_string() } else { format!("{count} errors") };
            let message = format!("the spec has {noun}");
            Failure { message, hint: Some("they stand below its text".to_string()) }
        }
        other => Failure { message: other.to_string(), hint: None },
    }
}

/// What is wrong with a text: places in characters as the page counts them (UTF-16).
pub(super) fn diagnostics(all: &[Diagnostic], text: &str) -> Value {
    let units = |at: usize| text.get(..at.min(text.len())).map_or(0, |t| t.encode_utf16().count());
    let rows = all.iter().take(SHOWN).map(|diagnostic| {
        let span = diagnostic.span;
        let (line, column) = diagnostic.place(text);
        json!({
            "severity": diagnostic.severity,
            "message": diagnostic.message,
            "label": diagnostic.label,
            "hint": diagnostic.hint,
            "line": line,
            "column": column,
            "start": units(span.start),
            "end": units(span.end.max(span.start)),
        })
    });
    rows.collect()
}

/// The spec as it lies in its folder.
pub(super) fn spec(name: &str, text: &str) -> Value {
    let formats: Vec<&str> = EXPORTERS.iter().map(|row| row.name).collect();
    json!({ "name": name, "text": text, "hash": files::hash(text), "formats": formats })
}

/// The law and what is said about it, in HTML.
pub(super) fn law(page: &Page) -> Value {
    let parts = html::parts(page);
    let last = page.material.comparison.horizons.last();
    json!({
        "title": page.title,
        "cards": parts.cards,
        "equations": parts.equations,
        "numbers": parts.numbers,
        "findings": parts.findings,
        "data": parts.data,
        "error": last.map(|last| last.held_out.unwrap_or(last.training)),
        "held_out": last.is_some_and(|last| last.held_out.is_some()),
    })
}

/// Plots that are drawn as soon as a step is judged; the others need all predictions anew.
const FIRST: &[&str] = &["horizons", "path", "front", "ledger"];

/// Every plot, drawn.
pub(super) fn figures(material: &PlotData) -> Value {
    PLOTS.iter().map(|row| drawn(row, material)).collect()
}

/// The plots that take no time; of the others, that they will come.
pub(super) fn first_figures(material: &PlotData) -> Value {
    let rows = PLOTS.iter().map(|row| match FIRST.contains(&row.name) {
        true => drawn(row, material),
        false => json!({ "plot": row.name, "title": row.title, "pending": true }),
    });
    rows.collect()
}

fn drawn(row: &Plot, material: &PlotData) -> Value {
    let figures = (row.figures)(material);
    json!({
        "plot": row.name,
        "title": row.title,
        "absent": row.absent,
        "figures": figures.iter().map(|figure| json!({
            "id": figure.id,
            "title": figure.title,
            "caption": figure.caption,
            "svg": draw(figure, Medium::Page),
        })).collect::<Vec<_>>(),
    })
}

/// The question what is missing, before it is answered: `pending`, `running`, `stopped`, or
/// `none` to ask it of.
pub(super) fn undiagnosed(state: &str) -> Value {
    json!({ "state": state })
}

/// The answer.
pub(super) fn missing(diagnosis: &Diagnosis) -> Value {
    json!({
        "state": "answered",
        "verdict": diagnosis.verdict,
        "reason": capital(&diagnosis.reason),
        "leaders": diagnosis.ranking.iter().map(leader).collect::<Vec<_>>(),
        "indistinguishable": present::indistinguishable(diagnosis),
        "partial": (!diagnosis.partial.is_empty()).then(|| present::in_part(diagnosis)),
        "further": diagnosis.further.iter().map(|leader| &leader.effect).collect::<Vec<_>>(),
        "unnamed": diagnosis.unnamed.as_ref().map(leader),
        "tested": (diagnosis.candidates > 0).then(|| present::tested(diagnosis)),
    })
}

fn leader(leader: &RankedEffect) -> Value {
    let name = leader.effect.split('(').next().unwrap_or("");
    let p_value = match leader.p_value {
        p if p < 1e-12 => "< 10⁻¹²".to_string(),
        p => number(p, 2),
    };
    json!({
        "effect": leader.effect,
        "snippet": leader.snippet,
        "physics": by_name(name).map(|row| row.physics),
        "p_value": p_value,
        "deviance": leader.deviance,
        "before": leader.held_out_error_before,
        "after": leader.held_out_error_after,
    })
}

/// Every step of the spec, and what undoing would take back.
pub(super) fn ledger(ledger: &Ledger, text: &str) -> Value {
    let mut ledger = ledger.clone();
    ledger.recover(text);
    let current = ledger.current();
    let error =
        |judged: &Option<HeldOutErrors>| judged.as_ref().and_then(|judged| judged.held_out_error);
    let newest = current.and_then(|at| ledger.revisions.get(at));
    let edited = newest.is_some_and(|r| r.spec != text || r.action == BY_HAND);
    let by_hand = |ledger: &Ledger| {
        let newest = ledger.current().and_then(|at| ledger.revisions.get(at));
        newest.is_some_and(|revision| revision.action == BY_HAND)
    };
    let mut ahead = ledger.clone();
    while edited && by_hand(&ahead) {
        if ahead.take_back().is_none() {
            break;
        }
    }
    json!({
        "steps": ledger.revisions.iter().enumerate().map(|(at, revision)| json!({
            "date": date(revision.time),
            "action": revision.action,
            "before": error(&revision.before),
            "after": error(&revision.after),
            "undone": revision.undone,
            "current": Some(at) == current,
        })).collect::<Vec<_>>(),
        "edited": edited,
        "undo": ahead.take_back().map(|(action, _)| action),
    })
}

/// A sentence begins with a capital letter, unless with a name, and is ended by whoever prints it.
pub(super) fn capital(text: &str) -> String {
    let word = text.split_whitespace().next().unwrap_or("");
    if word.contains(['_', '(', '^']) {
        return text.trim().trim_end_matches('.').to_string();
    }
    let mut letters = text.trim().trim_end_matches('.').chars();
    let first: String = letters.next().map(|c| c.to_uppercase().collect()).unwrap_or_default();
    first + letters.as_str()
}
