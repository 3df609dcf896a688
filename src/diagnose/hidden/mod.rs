//! Parts that nobody measures: memories of first order, a second mass, a body on an orbit.
//!
//! What such a part does to the predictions is not linear in anything that a model has, and the
//! motion of the part itself is unknown. So its laws are first followed along the *measured*
//! motion, for every point of a grid, and the force that is left is asked for it in weak form
//! (`weak_form`); the best points are starts of full fits, which are judged by whole runs. A body
//! on an orbit is looked for by what its pull does to whole runs (`response`): over shorter
//! stretches it is lost in the noise.

mod body;
mod internal;
mod orbit;
mod path;
mod response;
mod weak_form;

use std::sync::Arc;

use rayon::prelude::*;

use super::diagnosis::{Diagnosis, Verdict};
use super::effect::RankedEffect;
use super::law_on_data::LawOnData;
use super::misfit::{error, error_of};
use super::noise_floor::no_less_than_rough;
use super::ranking::Ranking;
use super::settling::settle;
use super::story::{Question, Story};
use super::times::times;
use super::window::longest;
use crate::error::Result;
use crate::expr::{Compiled, System, TermId, build};
use crate::fit::{self, Law, resume};
use crate::spec::edit;

/// A part that may move unseen, with where its fit starts.
#[derive(Debug)]
pub struct Start {
    /// `bouc_wen(x)`.
    pub label: String,
    /// Coordinates that it acts on.
    on: Vec<String>,
    /// The statements that add it.
    pub snippet: String,
    /// First guesses of coefficients of the spec with it: names of terms of the part, and places
    /// of terms that stand.
    coefficients: Vec<(TermName, f64)>,
    /// By what factor the weak form of the force that is left is smaller with it.
    gain: f64,
    /// Whether all of its numbers are near already, by the model over whole runs.
    near: bool,
    /// How many starts of the same part are better.
    rank: usize,
    /// How many were looked at for each that is tried.
    tests: usize,
}

/// A term in the spec with the part.
#[derive(Debug)]
enum TermName {
    /// One of its own, by its label.
    Own(String),
    /// One of the model that stands, by its position.
    Standing(usize),
}

/// A part with its numbers fitted.
struct Found {
    effect: RankedEffect,
    /// Coefficients of the model's own terms beside it.
    standing: Vec<(TermId, f64)>,
    /// Error on held-out runs over their whole length, in units of the noise with the part.
    after: f64,
}

impl Start {
    /// A law of the system without the part as that of the system with it, with what is known of
    /// the coefficients.
    ///
    /// # Errors
    ///
    /// When a coefficient is not a finite number.
    pub fn begin(&self, law: &Law, system: &Arc<System>) -> Result<Law> {
        let ids = system.term_ids();
        let mut law = law.on(system);
        for (name, value) in &self.coefficients {
            let id = match name {
                TermName::Standing(position) => ids.get(*position).copied(),
                TermName::Own(label) => system
                    .terms_with_ids()
                    .find(|(_, term)| term.effect.is_some() && term.label == *label)
                    .map(|(id, _)| id),
            };
            if let Some(id) = id {
                law = law.with_term(id, *value)?;
            }
        }
        Ok(law)
    }
}

/// Where the fit of an effect with internal states starts, by the measured motion; `None` where it
/// has none, or too little is measured to say.
///
/// # Errors
///
/// When the motion of the model cannot be computed.
pub fn start_of(label: &str, spec: &Compiled, model: &LawOnData) -> Result<Option<Start>> {
    Ok(internal::starts(spec, model)?.into_iter().find(|start| start.label == label))
}

/// A body that nobody measures, looked for among bodies that attract each other.
pub struct Unseen {
    starts: Vec<Start>,
    /// Whether it explains so much, and a wrong mass so little, that nothing else need be asked.
    obvious: bool,
}

impl Unseen {
    /// Where it may be, by what the model leaves of whole runs.
    pub fn of(model: &LawOnData) -> Unseen {
        body::unseen(model).unwrap_or(Unseen { starts: Vec::new(), obvious: false })
    }

    /// The diagnosis where it is obvious, and its fit explains the data.
    ///
    /// # Errors
    ///
    /// When the spec cannot be read with it.
    pub fn obvious(&self, question: &Question) -> Result<Option<Diagnosis>> {
        let mut diagnosis = Diagnosis {
            candidates: 1,
            tests: self.starts.first().map_or(0, |start| start.tests),
            noise_floor: question.model.law.noise().to_vec(),
            ..Diagnosis::too_little(String::new())
        };
        if self.obvious
            && let Some(found) = best_of(question, &self.starts)?
            && question.pays(&found)
        {
            tell(&mut diagnosis, found);
            return Ok(Some(diagnosis));
        }
        Ok(None)
    }

    /// Looks for it where it is not obvious, and no change to one thing explains the data: its pull
    /// is a small part of every force, which a search among all other effects takes long to imitate
    /// and never does. Whether it was found, and told.
    ///
    /// # Errors
    ///
    /// When the spec cannot be read with it.
    pub fn look(
        &self,
        question: &Question,
        first: &Ranking,
        diagnosis: &mut Diagnosis,
    ) -> Result<bool> {
        // What no candidate improves on lacks nothing that shows; what is obvious was tried.
        if first.effects.is_empty() || self.obvious {
            return Ok(false);
        }
        let part = |one: &RankedEffect| one.held_out_error_after / one.held_out_error_before;
        let others = first.effects.iter().map(|judged| part(&judged.refit.effect));
        let least = others.fold(f64::INFINITY, f64::min);
        if let Some(found) = best_of(question, &self.starts)?
            && part(&found.effect) < least
            && question.pays(&found)
        {
            tell(diagnosis, found);
            return Ok(true);
        }
        Ok(false)
    }
}

/// Looks for internal states of effects, where no story of what is seen explains the data, and
/// tells the best if it explains them. Not before: states that begin anew in every run can imitate
/// effects of what is seen. Nor where the `best` story leaves clearly less of the force along the
/// measured motion than such a part does.
///
/// # Errors
///
/// When the spec cannot be read with such a part in it.
pub(super) fn look_for_states(
    question: &Question,
    best: Option<&Story>,
    diagnosis: &mut Diagnosis,
) -> Result<()> {
    let tuning = &question.model.tuning().hidden;
    let rival = best.map_or(0.0, |best| internal::gain(question.model, &best.model));
    // Beside a story that leaves noise, a part that leaves far less cancels the motion itself.
    let honest = match best {
        Some(best) if best.explains => rival / tuning.nearly,
        _ => f64::INFINITY,
    };
    let mut starts = internal::starts(question.scope.compiled(), question.model)?;
    let least = tuning.gain.max(tuning.nearly * rival);
    starts.retain(|start| start.gain > least && start.gain <= honest);
    if let Some(found) = best_of(question, &starts)?
        && question.pays(&found)
    {
        tell(diagnosis, found);
    }
    Ok(())
}

impl Question<'_, '_> {
    /// Whether a part explains the data, which the model without it does not.
    fn pays(&self, found: &Found) -> bool {
        let tuning = self.model.tuning();
        let before = found.effect.held_out_error_before;
        let significant = found.effect.p_value < tuning.scan.significant;
        let reaches = tuning.verdict.reaches;
        significant && before > reaches && found.after <= reaches
    }
}

/// The best of some parts, fitted from where the weak form likes them best; where one of them
/// nearly explains the data, from where it likes them next.
fn best_of(question: &Question, starts: &[Start]) -> Result<Option<Found>> {
    let tuning = &question.model.tuning().hidden;
    question.monitor.stage("what may move unseen", 0.95);
    let mut starts: Vec<&Start> = starts.iter().collect();
    starts.sort_by(|a, b| a.rank.cmp(&b.rank).then(b.gain.total_cmp(&a.gain)));
    let mut best: Option<Found> = None;
    for rank in 0..tuning.points.max(1) {
        let asked: Vec<&Start> = starts.iter().copied().filter(|one| one.rank == rank).collect();
        let asked = asked.into_par_iter().take(tuning.fits);
        let fitted = |start: &Start| match question.monitor.stopped() {
            true => Ok(None),
            false => fitted(question, question.scope.compiled(), start),
        };
        for found in asked.map(fitted).collect::<Result<Vec<Option<Found>>>>()? {
            if let Some(found) = found
                && best.as_ref().is_none_or(|best| found.after < best.after)
            {
                best = Some(found);
            }
        }
        if question.monitor.stopped() {
            break;
        }
        // What is far from the noise from its best start is another part's doing.
        let nearly = |best: &Found| best.after < tuning.again * best.effect.held_out_error_before;
        match &best {
            Some(best) if nearly(best) && !question.pays(best) => {}
            _ => break,
        }
    }
    Ok(best)
}

/// Writes a part into the answer.
fn tell(diagnosis: &mut Diagnosis, found: Found) {
    let before = found.effect.held_out_error_before;
    diagnosis.verdict = Verdict::Missing;
    diagnosis.held_out_error = before;
    // In free motion only the frequencies of a mass on a spring are seen, of which there are two.
    let free = found.effect.standard_error.iter().any(|error| !error.is_finite());
    diagnosis.reason = format!(
        "{}, a part that nobody measures, takes the error on held-out runs from {} to {} \
         times the noise{}",
        found.effect.effect,
        times(before),
        times(found.after),
        if free {
            "; its own numbers are not determined by these data: others explain as much"
        } else {
            ""
        }
    );
    diagnosis.beside_story = found.standing;
    diagnosis.begin_with(&found.effect);
    diagnosis.further.clear();
    diagnosis.partial.clear();
    diagnosis.unnamed = None;
    diagnosis.unnamed_explains_more = false;
    diagnosis.story = vec![found.effect];
}

/// The spec with a part, fitted from a start; `None` where that fails.
fn fitted(question: &Question, spec: &Compiled, start: &Start) -> Result<Option<Found>> {
    let model = question.model;
    if model.system().inputs.iter().any(|input| input.own) {
        // Its spec, read anew, would not know that what runs have for themselves is known here.
        return Ok(None);
    }
    let text = edit::insert(&spec.text, &start.snippet);
    let Ok(with) = build(&spec.system.name, &text) else { return Ok(None) };
    let system = &with.system;
    let training = model.data.dataset.with_observables(system.observables());
    let held_out = question.held_out.dataset.with_observables(system.observables());
    let mut law = start.begin(&model.law, system)?;
    // The fit begins with a misfit that is large beside the noise: by that it chooses its steps.
    let whole = error(model, longest(model)).0;
    if whole.is_finite() && whole > 1.0 {
        let noise = law.noise().iter().map(|noise| noise * whole).collect();
        law = law.with_noise(noise);
    }
    let window = model.options.fit.segments.hidden;
    let tuning = model.options.fit.clone();
    let options = fit::Options { tuning, starts: 0, ..fit::Options::default() };
    let law = law.with_window(window);
    let fitted = match start.near {
        true => fit::fit(system, &training, &options, question.monitor),
        false => resume(&law, &training, &options, question.monitor),
    };
    let Ok(fitted) = fitted else { return Ok(None) };
    let law = fitted.law_of(system)?;
    // What the part leaves is held against the noise without it: a part that explains little would
    // take the rest for noise.
    let most = model.law.clone().with_noise(no_less_than_rough(model));
    let most = most.noise_on(system, f64::INFINITY);
    let noise = law.noise().iter().zip(most).map(|(with, most)| with.min(most)).collect();
    let law = law.with_noise(noise);
    let on_training = LawOnData::of(law.clone(), &training, model.options);
    let on_held_out = LawOnData::of(law.clone(), &held_out, model.options);
    let after = error(&on_held_out, longest(&on_held_out));
    // The model without the part, before the noise that it leaves with it.
    let baseline = model.with_noise(law.noise_on(&spec.system, 1.0));
    let unseen = baseline.with_data(question.held_out);
    let before = error(&unseen, longest(&unseen));
    if after.1 > before.1 || !after.0.is_finite() {
        return Ok(None);
    }
    let (coefficient, standard_error) = numbers(&law, spec.system.parameters.len(), start);
    let (mut deviance, mut p_value) = (0.0, 1.0);
    // What leaves more than noise on held-out runs is not told, whatever it does to the others.
    if after.0 <= model.tuning().verdict.reaches {
        let whole = |model: &LawOnData| settle(model.with_window(longest(model))).sums;
        let (left, were) = (whole(&on_training), whole(&baseline));
        if error_of(&left).1 > error_of(&were).1 {
            return Ok(None);
        }
        deviance = were.loss - left.loss;
        // Its numbers, and where it starts in every run, are unknowns that the model does not have.
        let new = system.hidden.iter().filter(|part| part.coordinate >= spec.system.degrees());
        let parts = new.map(|part| if part.rate.is_none() { 2 } else { 1 });
        let unknowns = coefficient.len() + parts.sum::<usize>() * training.runs.len();
        let price = unknowns as f64 * (left.rows.max(1) as f64).ln();
        p_value = (start.tests as f64 * (-0.5 * (deviance - price)).exp()).min(1.0);
    }
    let effect = RankedEffect {
        effect: start.label.clone(),
        on: start.on.clone(),
        snippet: with_starts(&with_values(&start.snippet, &law, system), &law),
        coefficient,
        standard_error,
        p_value,
        tests: start.tests as f64,
        deviance,
        number: None,
        left_out: None,
        held_out_error_before: before.0,
        held_out_error_after: after.0,
        indistinguishable: Vec::new(),
    };
    let own = law.on(model.system());
    let standing = model.law.support().iter();
    let standing = standing.map(|&id| (id, own.coefficient(id).unwrap_or(0.0))).collect();
    Ok(Some(Found { effect, standing, after: after.0 }))
}

/// Coefficients of the part's own terms, then its inner parameters, with standard errors.
fn numbers(law: &Law, standing: usize, start: &Start) -> (Vec<f64>, Vec<f64>) {
    let system = law.system();
    let own = system.terms_where(|term| term.effect.as_deref() == Some(start.label.as_str()));
    let terms = own.into_iter().filter_map(|id| law.coefficient_with_error(id));
    let parameters = system.parameter_ids().into_iter().skip(standing);
    let parameters = parameters.filter_map(|id| law.parameter_with_error(id));
    terms.chain(parameters).unzip()
}

/// The statements with inner parameters as they were fitted: those of an effect in its settings.
fn with_values(snippet: &str, law: &Law, system: &System) -> String {
    let mut out = snippet.to_string();
    for (parameter, value) in system.parameters.iter().zip(law.parameters()) {
        // `frequency_harmonic_drive_x` of the effect's setting `frequency = ...`.
        let settings = ["; ", ", ", "param "];
        for before in settings {
            for (at, _) in out.clone().match_indices(before) {
                let rest = &out[at + before.len()..];
                let Some((name, tail)) = rest.split_once(" = ") else { continue };
                let is = parameter.name == name
                    || before != "param " && parameter.name.starts_with(&format!("{name}_"));
                if !is || name.contains([' ', ',', ';', '(']) {
                    continue;
                }
                let end = tail.find([',', ')', ' ', '\n']).unwrap_or(tail.len());
                let start = at + before.len() + name.len() + 3;
                out.replace_range(start..start + end, &short(*value));
                break;
            }
        }
    }
    out
}

/// The statements with hidden coordinates where the law has them at the first of all times, if it
/// has one motion of them.
fn with_starts(snippet: &str, law: &Law) -> String {
    let system = law.system();
    let first = |name: &str| {
        let motions = law.hidden().iter().filter(|motion| motion.name == name);
        motions.min_by(|a, b| a.times.0.total_cmp(&b.times.0)).map(|motion| motion.values.0)
    };
    let line = |line: &str| -> String {
        let of = system.hidden.iter().filter(|part| part.rate.is_none()).find_map(|part| {
            let name = &system.coordinates[part.coordinate].name;
            let momentum = &system.momenta[part.coordinate].name;
            let begins = line.starts_with(&format!("hidden {name} = "));
            let (q, p) = begins.then(|| first(name).zip(first(momentum))).flatten()?;
            Some(format!("hidden {name} = {} with {momentum} = {}", digits(q), digits(p)))
        });
        of.unwrap_or_else(|| line.to_string())
    };
    snippet.lines().map(line).collect::<Vec<_>>().join("\n")
}

/// A number to ten digits: small changes of an orbit grow.
fn digits(value: f64) -> String {
    format!("{:e}", format!("{value:.9e}").parse().unwrap_or(value))
}

/// A number to six digits, which a fit starts from.
fn short(value: f64) -> String {
    let rounded = format!("{value:.5e}").parse().unwrap_or(value);
    format!("{rounded}")
}
