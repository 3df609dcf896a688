//! `leverrier add` and `remove`: a spec and its effects, step by step.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::asked::{self, Asked};
use super::bench::{Bench, Splitting, errors};
use super::console::Console;
use super::fit::{origin, write_model};
use super::ledger::{Judged, Ledger};
use super::progress::Progress;
use super::project::{ModelFile, Project};
use crate::data::write_atomically;
use crate::diagnose::compare::windows;
use crate::diagnose::context::Context;
use crate::diagnose::floor::noise_floor;
use crate::error::{Error, Result};
use crate::expr;
use crate::fit::{Model, Start};
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

/// Take an effect or a term out of a spec, learn again, and show before and after.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier remove pendulum.ham viscous_drag\n  \
    leverrier remove pendulum.ham stiffness        a term that the spec calls so")]
pub struct Remove {
    /// The spec.
    pub spec: PathBuf,
    /// The effect, with what it is on where there is a choice; or the name of a term.
    pub effect: String,
    #[command(flatten)]
    pub splitting: Splitting,
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
    let project = edited(&bench, text)?;
    let system = project.system();
    // What is known stays known: only the new terms are without numbers.
    let of_effect = |k: &usize| system.terms[*k].effect.as_deref() == Some(asked.label.as_str());
    let mut start = Start::of(&model, system).with((0..system.terms.len()).filter(of_effect));
    for (value, parameter) in start.parameters.iter_mut().zip(&system.parameters) {
        if let Some((_, best)) = asked.values.iter().find(|(name, _)| *name == parameter.name) {
            *value = parameter.bounds.clamp(*best);
        }
    }
    let after = bench.resume(&project, &start, &progress)?;
    let revision =
        Revision { action: format!("add {}", asked.label), label: &asked.label, adds: true };
    revise(&bench, &model, &revision, &project, &after, progress, console)
}

/// Runs `remove`.
pub fn remove(arguments: &Remove, console: &Console) -> Result<()> {
    let bench = Bench::open(&arguments.spec, &arguments.splitting, console)?;
    let text = &bench.project.text;
    let (label, shorter) = match Asked::new(&arguments.effect, &bench.project) {
        // A term may bear the name of an effect, but an effect is what is meant first.
        Ok(asked) if asked.place(text).is_some() => {
            let place = asked.place(text).map(|statement| statement.site.0).unwrap_or_default();
            (asked.label, edit::remove(text, place))
        }
        asked => match (edit::remove_term(text, &arguments.effect), asked) {
            (Some(shorter), _) => (arguments.effect.clone(), shorter),
            (None, Err(error)) => return Err(not_there(arguments, &bench, error)),
            (None, Ok(asked)) => {
                return Err(Error::usage(
                    format!("{} does not have `{}`", bench.project.name(), asked.label),
                    removable(text),
                ));
            }
        },
    };
    let project = edited(&bench, shorter)?;
    let progress = Progress::new();
    let (model, _) = bench.model(&progress)?;
    let after = bench.fit(&project, &progress)?;
    let revision = Revision { action: format!("remove {label}"), label: &label, adds: false };
    revise(&bench, &model, &revision, &project, &after, progress, console)
}

/// An unknown name: the spec's own terms may be what was meant.
fn not_there(arguments: &Remove, bench: &Bench, error: Error) -> Error {
    let names = edit::term_names(&bench.project.text);
    match crate::spec::nearest(&arguments.effect, names.iter().map(String::as_str)) {
        Some(near) => Error::usage(
            format!("{} has no term `{}`", bench.project.name(), arguments.effect),
            format!("did you mean `{near}`?"),
        ),
        None => error,
    }
}

/// What `remove` can take out of a spec, in a sentence.
fn removable(text: &str) -> String {
    let mut names = asked::effects_of(text);
    names.extend(edit::term_names(text));
    if names.is_empty() {
        return "it has no effect and no named term: edit the spec by hand".to_string();
    }
    format!("what can be removed: {}", names.join(", "))
}

/// The project with another text; what is wrong with that is said of the edit, not of the file.
fn edited(bench: &Bench, text: String) -> Result<Project> {
    let old = &bench.project;
    let compiled = expr::build(&old.name(), &text).map_err(|error| match error {
        Error::Spec { diagnostics, .. } => Error::usage(
            format!("{} cannot be without it, or with it: {}", old.name(), first(&diagnostics)),
            "nothing was changed; edit the spec by hand",
        ),
        other => other,
    })?;
    Ok(Project { path: old.path.clone(), text, compiled })
}

fn first(diagnostics: &[crate::diagnostic::Diagnostic]) -> String {
    diagnostics.first().map_or(String::new(), |diagnostic| diagnostic.message.clone())
}

/// What is done to a spec.
struct Revision<'a> {
    /// `add viscous_drag(theta)`.
    action: String,
    /// `viscous_drag(theta)`.
    label: &'a str,
    adds: bool,
}

/// Writes an edited and learned spec with its model and ledger, and shows what it brought.
fn revise(
    bench: &Bench,
    before: &Model,
    revision: &Revision,
    project: &Project,
    after: &Model,
    progress: Progress,
    console: &Console,
) -> Result<()> {
    let old = &bench.project;
    let whole = bench.refit(project, after, &bench.dataset, &progress)?;
    let (was, is) = judge(bench, before, project, after)?;
    drop(progress);
    let mut ledger = Ledger::open(&old.path)?;
    ledger.know(&old.text);
    ledger.push(revision.action.clone(), project.text.clone(), Some(was.clone()), Some(is.clone()));
    // The ledger first: whatever happens then, the old text is kept.
    ledger.write(&old.path)?;
    write_atomically(&old.path, project.text.as_bytes())?;
    let file = ModelFile { origin: origin(project, &bench.dataset, &bench.about), model: whole };
    write_model(&project.model_path(), &file)?;

    let mut effect = Vec::new();
    let (warranted, why) = if revision.adds {
        effect = effect_terms(before, project, after, revision.label);
        added(&was, &is, &effect)
    } else {
        removed(&was, &is)
    };
    let moved = moved(before, after);
    let revised = Revised {
        action: &revision.action,
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

/// Both models on the unseen runs, in the same units: the noise floor of the better of the two.
fn judge(
    bench: &Bench,
    before: &Model,
    project: &Project,
    after: &Model,
) -> Result<(Judged, Judged)> {
    let data = bench.unseen().unwrap_or(&bench.split.unseen);
    let old = Context::new(bench.project.system(), before, data)?;
    let new = Context::new(project.system(), after, data)?;
    let noise = floor_of_both(bench, (&old, before), (&new, after));
    let names = project.system().observables();
    let noise_of: Vec<(String, f64)> = names.into_iter().zip(noise.iter().copied()).collect();
    let samples = old.window.max(new.window);
    let of = |context: &Context| {
        if bench.unseen().is_none() {
            return Judged { samples, noise: noise_of.clone(), ..Judged::unknown() };
        }
        let error = errors(context, &noise, &[samples]);
        Judged {
            unseen_error: error.first().map(|e| e.1),
            noise_floor: 1.0,
            samples,
            horizons: errors(context, &noise, &windows(data)),
            noise: noise_of.clone(),
        }
    };
    Ok((of(&old), of(&new)))
}

/// The smaller noise floor of two models on the training part, for each observable.
fn floor_of_both(bench: &Bench, old: (&Context, &Model), new: (&Context, &Model)) -> Vec<f64> {
    let floor = |(context, model): (&Context, &Model)| {
        noise_floor(&context.with_data(&bench.split.training), model)
    };
    floor(old).into_iter().zip(floor(new)).map(|(a, b)| a.min(b)).collect()
}

/// Terms of an effect in a model, then its inner parameters: name, value, standard error.
fn effect_terms(
    before: &Model,
    project: &Project,
    model: &Model,
    label: &str,
) -> Vec<(String, f64, f64)> {
    let system = project.system();
    let Some((active, _)) = model.active(system) else { return Vec::new() };
    let known = |name: &String| before.parameters.iter().any(|old| old.name == *name);
    let inner = model.parameters.iter().filter(|p| !known(&p.name));
    let inner: Vec<(String, f64, f64)> =
        inner.map(|p| (p.name.clone(), p.value, p.standard_error)).collect();
    let terms = active
        .iter()
        .zip(&model.terms)
        .filter(|(k, _)| system.terms.get(**k).is_some_and(|t| t.effect.as_deref() == Some(label)))
        .map(|(_, term)| {
            let name = term.name.clone().unwrap_or_else(|| term.term.clone());
            (name, term.coefficient, term.standard_error)
        });
    let terms: Vec<(String, f64, f64)> = terms.collect();
    // Without its terms a number inside them means nothing.
    if terms.is_empty() { terms } else { [terms, inner].concat() }
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

/// How the coefficients and inner parameters of the model before moved.
fn moved(before: &Model, after: &Model) -> Vec<Moved> {
    let parameters = before.parameters.iter().map(|old| {
        let new = after.parameters.iter().find(|p| p.name == old.name);
        Moved {
            place: "param".to_string(),
            term: old.name.clone(),
            before: old.value,
            before_error: old.standard_error,
            after: new.map(|p| p.value),
            after_error: new.map(|p| p.standard_error),
        }
    });
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
        .chain(parameters)
        .collect()
}
