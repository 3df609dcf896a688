//! Putting an effect into a spec or taking one out: the spec, its model and its ledger.

use super::fitting::{origin, write_model};
use super::ledger::{HeldOutErrors, Ledger};
use super::workspace::{Workspace, errors};
use super::{ModelFile, Spec};
use crate::data::write_atomically;
use crate::diagnose::comparison::windows;
use crate::diagnose::hidden::start_of;
use crate::diagnose::noise_floor::{no_less_than_rough, noise_floor};
use crate::diagnose::times::times;
use crate::diagnose::{LawOnData, Measurements, Options};
use crate::diagnostic::Diagnostic;
use crate::error::{Error, ErrorKind, Result};
use crate::expr::Term;
use crate::facade::effect::{NamedEffect, effects_of};
use crate::fit::{Law, Model, Monitor};
use crate::report::CoefficientChange;
use crate::spec::edit;

/// Standard errors that the coefficient of a supported effect is from zero, at least.
const CLEAR: f64 = 4.0;
/// Rise of the held-out error up to which a removal costs nothing.
const FREE: f64 = 1.02;

/// An edited spec that was learned and judged, and is not written yet.
pub(crate) struct RevisionOutcome {
    /// `add viscous_drag(theta)`.
    pub action: String,
    pub adds: bool,
    /// The edited spec.
    pub spec: Spec,
    /// Its model from the training part.
    pub training: Model,
    /// Its model from all measurements.
    pub whole: Model,
    /// The model before and after on the held-out runs, in the same units.
    pub was: HeldOutErrors,
    pub is: HeldOutErrors,
    /// How earlier coefficients moved.
    pub moved: Vec<CoefficientChange>,
    /// Terms of the effect, then its inner parameters: name, value, standard error.
    pub effect: Vec<(String, f64, f64)>,
    /// Whether it pays; `None` without held-out runs.
    pub supported: Option<bool>,
    /// Why, in a sentence.
    pub why: String,
}

/// Adds an effect. `known` is the model of the training part, where it is at hand.
///
/// # Errors
/// The effect does not exist, cannot act here, or is there already.
pub(crate) fn add(
    workspace: &Workspace,
    known: Option<&Model>,
    effect: &str,
    monitor: &dyn Monitor,
) -> Result<RevisionOutcome> {
    let mut asked = NamedEffect::new(effect, workspace.spec.text(), workspace.spec.system())?;
    if asked.place(workspace.spec.text()).is_some() {
        return Err(Error::new(
            ErrorKind::NothingToDo,
            format!("{} has `{}` already", workspace.spec.name(), asked.label),
            format!(
                "`leverrier remove` takes it out; `leverrier fit {}` learns it",
                workspace.spec.name()
            ),
        ));
    }
    let model = before(workspace, known, monitor)?;
    let compiled = workspace.spec.compiled();
    let options = Options::default();
    let law = workspace.spec.learned(&model)?;
    let on_training = LawOnData::of(law.clone(), &workspace.split.training, &options);
    let unseen = start_of(&asked.label, compiled, &on_training)?;
    match &unseen {
        Some(start) if asked.open => asked.statement.clone_from(&start.snippet),
        _ => asked.scanned(compiled, on_training)?,
    }
    let text = edit::insert(workspace.spec.text(), &asked.statement);
    let spec = edited(workspace, text)?;
    let system = spec.system();
    // What is known stays known: only the new terms are without numbers.
    let best = asked.values.iter().filter_map(|(name, best)| {
        let id = system.find_parameter(name)?;
        Some((id, system.parameter(id)?.bounds.clamp(*best)))
    });
    let start = match &unseen {
        Some(start) => start.begin(&law, system)?,
        None => law.on(system),
    };
    let mut start = start.with_parameters(best);
    let of_effect = |term: &Term| term.effect.as_deref() == Some(asked.label.as_str());
    for id in system.terms_where(of_effect) {
        if !start.support().contains(&id) {
            start = start.with_term(id, 0.0)?;
        }
    }
    let after = workspace.resume(&start, monitor)?;
    RevisionOutcome::judged(workspace, &model, spec, after, (&asked.label, true), monitor)
}

/// Removes an effect, or a term by its name. `known` as in [`add`].
///
/// # Errors
/// The spec has no such effect or term.
pub(crate) fn remove(
    workspace: &Workspace,
    known: Option<&Model>,
    effect: &str,
    monitor: &dyn Monitor,
) -> Result<RevisionOutcome> {
    let text = workspace.spec.text();
    let (label, shorter) =
        match NamedEffect::new(effect, workspace.spec.text(), workspace.spec.system()) {
            // A term may bear the name of an effect, but an effect is what is meant first.
            Ok(asked) if asked.place(text).is_some() => {
                let place = asked.place(text).map(|statement| statement.site.0).unwrap_or_default();
                (asked.label, edit::remove(text, place))
            }
            asked => match (edit::remove_term(text, effect), asked) {
                (Some(shorter), _) => (effect.to_string(), shorter),
                (None, Err(error)) => return Err(not_there(effect, workspace, error)),
                (None, Ok(asked)) => {
                    return Err(Error::new(
                        ErrorKind::UnknownName,
                        format!("{} does not have `{}`", workspace.spec.name(), asked.label),
                        removable(text),
                    ));
                }
            },
        };
    let spec = edited(workspace, shorter)?;
    let model = before(workspace, known, monitor)?;
    let after = workspace.fit(&spec, monitor)?;
    RevisionOutcome::judged(workspace, &model, spec, after, (&label, false), monitor)
}

fn before(workspace: &Workspace, known: Option<&Model>, monitor: &dyn Monitor) -> Result<Model> {
    match known {
        Some(model) => Ok(model.clone()),
        None => Ok(workspace.model(monitor)?.0),
    }
}

impl RevisionOutcome {
    fn judged(
        workspace: &Workspace,
        before: &Model,
        spec: Spec,
        after: Model,
        (label, adds): (&str, bool),
        monitor: &dyn Monitor,
    ) -> Result<RevisionOutcome> {
        let whole = workspace.widen(&spec, &after, monitor)?;
        let (was, is) = judge(workspace, before, &spec, &after)?;
        let mut effect = Vec::new();
        let (supported, why) = if adds {
            effect = effect_terms(before, &spec, &after, label);
            added(&was, &is, &effect)
        } else {
            removed(&was, &is)
        };
        let verb = if adds { "add" } else { "remove" };
        let (action, moved) = (format!("{verb} {label}"), moved(before, &after));
        let training = after;
        Ok(RevisionOutcome {
            action,
            adds,
            spec,
            training,
            whole,
            was,
            is,
            moved,
            effect,
            supported,
            why,
        })
    }

    /// Writes ledger, spec and model, each of them whole.
    pub(crate) fn keep(&self, workspace: &Workspace) -> Result<()> {
        let old = &workspace.spec;
        let mut ledger = Ledger::open(old.file())?;
        ledger.know(old.text());
        let (was, is) = (Some(self.was.clone()), Some(self.is.clone()));
        ledger.push(self.action.clone(), self.spec.text().to_string(), was, is);
        // The ledger first: whatever happens then, the old text is kept.
        ledger.write(old.file())?;
        write_atomically(old.file(), self.spec.text().as_bytes())?;
        let origin = origin(&self.spec, &workspace.dataset, &workspace.about);
        let file = ModelFile { origin, model: self.whole.clone() };
        write_model(&self.spec.model_path(), &file)
    }
}

/// An unknown name: the spec's own terms may be what was meant.
fn not_there(effect: &str, workspace: &Workspace, error: Error) -> Error {
    let names = edit::term_names(workspace.spec.text());
    match crate::spec::nearest(effect, names.iter().map(String::as_str)) {
        Some(near) => Error::new(
            ErrorKind::UnknownName,
            format!("{} has no term `{}`", workspace.spec.name(), effect),
            format!("did you mean `{near}`?"),
        ),
        None => error,
    }
}

/// What `remove` can take out of a spec, in a sentence.
fn removable(text: &str) -> String {
    let mut names = effects_of(text);
    names.extend(edit::term_names(text));
    if names.is_empty() {
        return "it has no effect and no named term: edit the spec by hand".to_string();
    }
    format!("what can be removed: {}", names.join(", "))
}

/// The spec with another text; what is wrong with that is said of the edit, not of the file.
fn edited(workspace: &Workspace, text: String) -> Result<Spec> {
    let old = &workspace.spec;
    old.edited(text).map_err(|error| match error {
        Error::Spec { diagnostics, .. } => Error::new(
            ErrorKind::NotApplicable,
            format!("{} cannot be without it, or with it: {}", old.name(), first(&diagnostics)),
            "nothing was changed; edit the spec by hand",
        ),
        other => other,
    })
}

fn first(diagnostics: &[Diagnostic]) -> String {
    diagnostics.first().map_or(String::new(), |diagnostic| diagnostic.message.clone())
}

/// Both models on the held-out runs, in the same units: the noise floor of the better of the two.
fn judge(
    workspace: &Workspace,
    before: &Model,
    spec: &Spec,
    after: &Model,
) -> Result<(HeldOutErrors, HeldOutErrors)> {
    let data = workspace.held_out().unwrap_or(&workspace.split.held_out);
    let options = Options::default();
    let rearranged = data.with_observables(spec.system().observables());
    let old = LawOnData::of(workspace.spec.learned(before)?, data, &options);
    let new = LawOnData::of(spec.learned(after)?, &rearranged, &options);
    let (of_old, of_new) = floors_of_both(workspace, &old, &new);
    let samples = old.law.window().max(new.law.window());
    let of = |model: &LawOnData, noise: &[f64]| {
        let names = model.system().observables();
        let noise_of: Vec<(String, f64)> = names.into_iter().zip(noise.iter().copied()).collect();
        if workspace.held_out().is_none() {
            return HeldOutErrors { samples, noise: noise_of.clone(), ..HeldOutErrors::unknown() };
        }
        let error = errors(model, noise, &[samples]);
        HeldOutErrors {
            held_out_error: error.first().map(|e| e.1),
            noise_floor: 1.0,
            samples,
            horizons: errors(model, noise, &windows(data)),
            noise: noise_of,
        }
    };
    Ok((of(&old, &of_old), of(&new, &of_new)))
}

/// The smaller noise floor of two models on the training part, for each observable of either; no
/// less than a column is rough by where one of them has a part that nobody measures: without it
/// the other takes what momenta lack for their noise, and that of coordinates for less than it is.
fn floors_of_both(workspace: &Workspace, old: &LawOnData, new: &LawOnData) -> (Vec<f64>, Vec<f64>) {
    let rows =
        |model: &LawOnData| workspace.split.training.with_observables(model.system().observables());
    let (of_old, of_new) = (rows(old), rows(new));
    let old = old.with_data(&Measurements::of(&of_old, old.options));
    let new = new.with_data(&Measurements::of(&of_new, new.options));
    let floor = |model: &LawOnData| model.law.clone().with_noise(noise_floor(model).sizes);
    let (old_floor, new_floor) = (floor(&old), floor(&new));
    let hidden = [&old, &new].iter().any(|model| !model.system().hidden.is_empty());
    let least = |model: &LawOnData, one: &Law, other: &Law| -> Vec<f64> {
        let others = other.noise_on(one.system(), f64::INFINITY);
        let least: Vec<f64> = one.noise().iter().zip(others).map(|(a, b)| a.min(b)).collect();
        if hidden { no_less_than_rough(&model.with_noise(least)) } else { least }
    };
    (least(&old, &old_floor, &new_floor), least(&new, &new_floor, &old_floor))
}

/// Terms of an effect in a model, then its inner parameters: name, value, standard error.
fn effect_terms(
    before: &Model,
    spec: &Spec,
    model: &Model,
    label: &str,
) -> Vec<(String, f64, f64)> {
    let system = spec.system();
    let Some(law) = model.law(system) else { return Vec::new() };
    let known = |name: &String| before.parameters.iter().any(|old| old.name == *name);
    let inner = model.parameters.iter().filter(|p| !known(&p.name));
    let inner: Vec<(String, f64, f64)> =
        inner.map(|p| (p.name.clone(), p.value, p.standard_error)).collect();
    let terms = law
        .terms()
        .zip(law.standard_errors())
        .filter(|((_, term, _), _)| term.effect.as_deref() == Some(label))
        .map(|((_, term, coefficient), error)| {
            let name = term.name.clone().unwrap_or_else(|| term.label.clone());
            (name, coefficient, error)
        });
    let terms: Vec<(String, f64, f64)> = terms.collect();
    // Without its terms a number inside them means nothing.
    if terms.is_empty() { terms } else { [terms, inner].concat() }
}

const NO_JUDGE: &str = "there are no held-out runs to judge it on";

/// Whether an addition pays; `None` without held-out runs.
fn added(
    was: &HeldOutErrors,
    is: &HeldOutErrors,
    effect: &[(String, f64, f64)],
) -> (Option<bool>, String) {
    if effect.is_empty() {
        return (Some(false), "the fit does not choose it: its coefficient is zero".to_string());
    }
    let Some((was, is)) = was.held_out_error.zip(is.held_out_error) else {
        return (None, NO_JUDGE.to_string());
    };
    let said = (times(was), times(is));
    let clear = effect.iter().map(|(_, x, s)| (x / s).abs()).fold(0.0, f64::max);
    let undetermined = effect.iter().all(|(_, _, error)| !error.is_finite());
    let how = if is < was {
        format!("the held-out error falls from {} to {} times the noise", said.0, said.1)
    } else {
        format!(
            "the held-out error does not fall: {} times the noise before, {} after",
            said.0, said.1
        )
    };
    // What only together with other numbers shows in the data has no standard error of its own.
    if undetermined {
        let why = format!("{how}, but these data do not determine its numbers: others do as well");
        return (Some(2.0 * is < was), why);
    }
    let why = format!("{how}, and its coefficient is {clear:.0} standard errors from zero");
    (Some(is < was && clear > CLEAR), why)
}

/// Whether a removal costs nothing; `None` without held-out runs.
fn removed(was: &HeldOutErrors, is: &HeldOutErrors) -> (Option<bool>, String) {
    let Some((was, is)) = was.held_out_error.zip(is.held_out_error) else {
        return (None, NO_JUDGE.to_string());
    };
    let free = is <= FREE * was;
    let how = if free { "does not rise" } else { "rises" };
    let (was, is) = (times(was), times(is));
    let why = format!("the held-out error {how}: {was} times the noise before, {is} after");
    (Some(free), why)
}

/// How the coefficients and inner parameters of the model before moved.
fn moved(before: &Model, after: &Model) -> Vec<CoefficientChange> {
    let parameters = before.parameters.iter().map(|old| {
        let new = after.parameters.iter().find(|p| p.name == old.name);
        CoefficientChange {
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
            CoefficientChange {
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
