//! `leverrier add`, `remove`, `undo` and `history`: a spec and its effects, step by step.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Value, json};

use super::asked::Asked;
use super::bench::{Bench, Splitting, errors};
use super::console::Console;
use super::fit::{origin, write_model};
use super::ledger::{Judged, Ledger, date};
use super::progress::Progress;
use super::project::{ModelFile, Project};
use crate::data::write_atomically;
use crate::diagnose::compare::windows;
use crate::diagnose::context::Context;
use crate::error::{Error, Result};
use crate::expr;
use crate::fit::Model;
use crate::report::layout::{WIDTH, table, wrapped};
use crate::report::present;
use crate::report::{Moved, Revised, revision_text};
use crate::spec::edit;

/// Add an effect to a spec, learn again, and show before and after on unseen runs.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier add pendulum.ham viscous_drag\n  \
    leverrier add pendulum.ham \"coupling_spring(q1, q2)\"\n  \
    leverrier add pendulum.ham \"harmonic_drive(theta; frequency = 2.5)\"\n\n\
    Comments and layout of the spec stay; `leverrier undo pendulum.ham` takes it back.")]
pub struct Add {
    /// The spec.
    pub spec: PathBuf,
    /// The effect: its name, and what it is on where there is a choice.
    pub effect: String,
    #[command(flatten)]
    pub splitting: Splitting,
}

/// Take an effect out of a spec, learn again, and show before and after on unseen runs.
#[derive(Args)]
#[command(after_help = "Examples:\n  leverrier remove pendulum.ham viscous_drag")]
pub struct Remove {
    /// The spec.
    pub spec: PathBuf,
    /// The effect: its name, and what it is on where there is a choice.
    pub effect: String,
    #[command(flatten)]
    pub splitting: Splitting,
}

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
#[command(after_help = "Examples:\n  leverrier history pendulum.ham")]
pub struct History {
    /// The spec.
    pub spec: PathBuf,
}

/// Standard errors that the coefficient of a warranted effect is from zero, at least.
const CLEAR: f64 = 4.0;
/// Rise of the unseen error up to which a removal costs nothing.
const FREE: f64 = 1.02;

/// Runs `add`.
pub fn add(arguments: &Add, console: &Console) -> Result<()> {
    let bench = Bench::open(&arguments.spec, &arguments.splitting, console)?;
    let mut asked = Asked::new(&arguments.effect, &bench.project)?;
    if asked.place(&bench.project.text).is_some() {
        return Err(Error::usage(
            format!("{} has `{}` already", bench.project.name(), asked.label),
            format!(
                "`leverrier remove` takes it out; `leverrier fit {}` learns it",
                bench.project.name()
            ),
        ));
    }
    let progress = Progress::new();
    let (model, _) = bench.model(&progress)?;
    if asked.open {
        let context = Context::new(bench.project.system(), &model, &bench.split.training)?;
        asked.scanned(&bench.project, &context)?;
    }
    let text = edit::insert(&bench.project.text, &asked.statement);
    revise(&bench, &model, &format!("add {}", asked.label), &asked.label, text, progress, console)
}

/// Runs `remove`.
pub fn remove(arguments: &Remove, console: &Console) -> Result<()> {
    let bench = Bench::open(&arguments.spec, &arguments.splitting, console)?;
    let asked = Asked::new(&arguments.effect, &bench.project)?;
    let Some(statement) = asked.place(&bench.project.text) else {
        return Err(Error::usage(
            format!("{} does not have `{}`", bench.project.name(), asked.label),
            "its `effect` statements are what can be removed",
        ));
    };
    let progress = Progress::new();
    let (model, _) = bench.model(&progress)?;
    let text = edit::remove(&bench.project.text, statement.site.0);
    let action = format!("remove {}", asked.label);
    revise(&bench, &model, &action, &asked.label, text, progress, console)
}

/// Learns the edited spec, writes it with its model and ledger, and shows what it brought.
fn revise(
    bench: &Bench,
    before: &Model,
    action: &str,
    label: &str,
    text: String,
    progress: Progress,
    console: &Console,
) -> Result<()> {
    let old = &bench.project;
    let compiled = expr::build(&old.name(), &text)?;
    let project = Project { path: old.path.clone(), text, compiled };
    let after = bench.fit(&project, &progress)?;
    let whole = bench.refit(&project, &after, &bench.dataset, &progress)?;
    let (was, is) = judge(bench, before, &project, &after)?;
    drop(progress);
    let mut ledger = Ledger::open(&old.path)?;
    ledger.know(&old.text);
    ledger.push(action.to_string(), project.text.clone(), Some(was.clone()), Some(is.clone()));
    // The ledger first: whatever happens then, the old text is kept.
    ledger.write(&old.path)?;
    write_atomically(&old.path, project.text.as_bytes())?;
    let file = ModelFile { origin: origin(&project, &bench.dataset, &bench.about), model: whole };
    write_model(&project.model_path(), &file)?;

    let mut effect = Vec::new();
    let (warranted, why) = if action.starts_with("add ") {
        effect = effect_terms(&project, &after, label);
        added(&was, &is, &effect)
    } else {
        removed(&was, &is)
    };
    let moved = moved(before, &after);
    let revised = Revised {
        action,
        how: &bench.split.how,
        before: &was.horizons,
        after: &is.horizons,
        moved: &moved,
        effect: &effect,
        warranted,
        why: &why,
    };
    show(bench, &revised, &was, &is, console)
}

fn show(
    bench: &Bench,
    revised: &Revised,
    was: &Judged,
    is: &Judged,
    console: &Console,
) -> Result<()> {
    let adds = revised.action.starts_with("add ");
    let object = json!({
        "format": if adds { "leverrier.add/1" } else { "leverrier.remove/1" },
        "system": bench.project.system().name,
        "action": revised.action,
        "split": bench.split_json(),
        "before": was,
        "after": is,
        "effect": revised.effect.iter().map(|(term, value, error)| json!({
            "term": term, "coefficient": value, "standard_error": present::finite(*error),
        })).collect::<Vec<_>>(),
        "moved": revised.moved,
        "warranted": revised.warranted,
        "reason": revised.why,
        "spec": bench.project.name(),
        "model_file": bench.project.model_path().display().to_string(),
        "ledger": Ledger::path(&bench.project.path).display().to_string(),
    });
    console.result(&revision_text(revised, console.width()), &object)
}

/// Both models on the unseen runs, in units of the smaller noise of the two.
fn judge(
    bench: &Bench,
    before: &Model,
    project: &Project,
    after: &Model,
) -> Result<(Judged, Judged)> {
    let data = bench.unseen().unwrap_or(&bench.split.unseen);
    let old = Context::new(bench.project.system(), before, data)?;
    let new = Context::new(project.system(), after, data)?;
    let noise: Vec<f64> = old.noise.iter().zip(&new.noise).map(|(a, b)| a.min(*b)).collect();
    let samples = old.window.max(new.window);
    let of = |context: &Context| {
        if bench.unseen().is_none() {
            return Judged { unseen_error: None, noise_floor: 1.0, samples, horizons: Vec::new() };
        }
        let error = errors(context, &noise, &[samples]);
        Judged {
            unseen_error: error.first().map(|e| e.1),
            noise_floor: 1.0,
            samples,
            horizons: errors(context, &noise, &windows(data)),
        }
    };
    Ok((of(&old), of(&new)))
}

/// Terms of an effect in a model: name, coefficient, standard error.
fn effect_terms(project: &Project, model: &Model, label: &str) -> Vec<(String, f64, f64)> {
    let system = project.system();
    let Some((active, _)) = model.active(system) else { return Vec::new() };
    active
        .iter()
        .zip(&model.terms)
        .filter(|(k, _)| system.terms.get(**k).is_some_and(|t| t.effect.as_deref() == Some(label)))
        .map(|(_, term)| {
            let name = term.name.clone().unwrap_or_else(|| term.term.clone());
            (name, term.coefficient, term.standard_error)
        })
        .collect()
}

const NO_JUDGE: &str = "there are no unseen runs to judge it on";

/// Whether an addition pays; `None` without unseen runs.
fn added(was: &Judged, is: &Judged, effect: &[(String, f64, f64)]) -> (Option<bool>, String) {
    if effect.is_empty() {
        return (Some(false), "the fit does not choose it: its coefficient is zero".to_string());
    }
    let Some((was, is)) = was.unseen_error.zip(is.unseen_error) else {
        return (None, NO_JUDGE.to_string());
    };
    let clear = effect.iter().map(|(_, x, s)| (x / s).abs()).fold(0.0, f64::max);
    let how = if is < was {
        format!("the unseen error falls from {was:.2} to {is:.2} times the noise")
    } else {
        format!("the unseen error does not fall: {was:.2} times the noise before, {is:.2} after")
    };
    let why = format!("{how}, and its coefficient is {clear:.0} standard errors from zero");
    (Some(is < was && clear > CLEAR), why)
}

/// Whether a removal costs nothing; `None` without unseen runs.
fn removed(was: &Judged, is: &Judged) -> (Option<bool>, String) {
    let Some((was, is)) = was.unseen_error.zip(is.unseen_error) else {
        return (None, NO_JUDGE.to_string());
    };
    let free = is <= FREE * was;
    let how = if free { "does not rise" } else { "rises" };
    let why = format!("the unseen error {how}: {was:.2} times the noise before, {is:.2} after");
    (Some(free), why)
}

/// How the coefficients of terms that both models have moved.
fn moved(before: &Model, after: &Model) -> Vec<Moved> {
    before
        .terms
        .iter()
        .map(|old| {
            let new = after.terms.iter().find(|t| t.term == old.term && t.place == old.place);
            Moved {
                place: old.place.clone(),
                term: old.term.clone(),
                before: old.coefficient,
                before_error: old.standard_error,
                after: new.map(|t| t.coefficient),
                after_error: new.map(|t| t.standard_error),
            }
        })
        .collect()
}

/// Runs `undo`.
pub fn undo(arguments: &Undo, console: &Console) -> Result<()> {
    let path = &arguments.spec;
    let text = spec_text(path)?;
    let mut ledger = Ledger::open(path)?;
    let edited =
        ledger.current().and_then(|at| ledger.revisions.get(at)).is_some_and(|r| r.spec != text);
    if edited && !arguments.force {
        return Err(Error::usage(
            format!("{} was edited by hand since the last revision", path.display()),
            "give --force to go back nevertheless; the edited text stays in the ledger",
        ));
    }
    if edited {
        ledger.know(&text);
    }
    let nothing = || {
        Error::usage(
            format!("there is nothing to undo in {}", path.display()),
            "`leverrier add` and `leverrier remove` make revisions",
        )
    };
    let (Some(current), Some(previous)) = (ledger.current(), ledger.previous()) else {
        return Err(nothing());
    };
    let restored = ledger.revisions.get(previous).ok_or_else(nothing)?.spec.clone();
    let mut undone = String::new();
    if let Some(revision) = ledger.revisions.get_mut(current) {
        revision.undone = true;
        undone.clone_from(&revision.action);
    }
    write_atomically(path, restored.as_bytes())?;
    ledger.write(path)?;
    // The model belongs to the text that is gone.
    let model = path.with_extension("model.json");
    let removed = model.exists();
    if removed {
        std::fs::remove_file(&model).map_err(|error| Error::file("remove", &model, error))?;
    }
    let again = if removed { "; its model is removed: fit again" } else { "" };
    let text = format!("Undone: {undone}. {} is as it was before{again}.", path.display());
    let object = json!({
        "format": "leverrier.undo/1",
        "spec": path.display().to_string(),
        "undone": undone,
        "model_removed": removed,
    });
    console.result(&text, &object)
}

/// Runs `history`.
pub fn history(arguments: &History, console: &Console) -> Result<()> {
    let path = &arguments.spec;
    let text = spec_text(path)?;
    let ledger = Ledger::open(path)?;
    let current = ledger.current();
    let error = |judged: &Option<Judged>| {
        let error = judged.as_ref().and_then(|j| j.unseen_error);
        error.map_or(String::new(), |error| format!("{error:.2}"))
    };
    let rows: Vec<Vec<String>> = ledger
        .revisions
        .iter()
        .enumerate()
        .map(|(at, r)| {
            let mark = if r.undone {
                "undone"
            } else if Some(at) == current {
                "now"
            } else {
                ""
            };
            vec![
                at.to_string(),
                date(r.time),
                r.action.clone(),
                error(&r.before),
                error(&r.after),
                mark.into(),
            ]
        })
        .collect();
    let edited = current.and_then(|at| ledger.revisions.get(at)).is_some_and(|r| r.spec != text);
    let width = console.width().map_or(WIDTH, |width| usize::from(width).max(40));
    let mut out = if rows.is_empty() {
        format!("{} has no revisions yet.", path.display())
    } else {
        table(
            &["", "time (UTC)", "action", "unseen error before", "after", ""],
            rows,
            &[0, 3, 4],
            width,
        )
    };
    if edited {
        out.push_str("\n\n");
        out.push_str(&wrapped("The spec was edited by hand since.", width, 2));
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
