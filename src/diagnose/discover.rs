//! The loop: ask what is missing, add it, fit again, until nothing pays on unseen runs.

use serde::Serialize;

use super::context::Context;
use super::missing::{Diagnosis, Leader, Verdict, diagnose};
use super::round::CLOSE;
use crate::data::Dataset;
use crate::error::Result;
use crate::expr::{Compiled, Term, build};
use crate::fit::resume::{Start, resume};
use crate::fit::{Model, Monitor, Options, fit};
use crate::spec::edit::insert;

/// What the loop did, and why it ended.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Discovery {
    /// Additions, in order.
    pub steps: Vec<Step>,
    /// Why it ended, in a sentence.
    pub stop: String,
    /// Verdict of the last diagnosis.
    pub verdict: Verdict,
    /// The spec with every addition.
    pub text: String,
    /// The model of that spec, fitted to the training runs.
    pub model: Model,
    /// Error on unseen runs at the start and at the end, in units of the last noise estimate.
    pub unseen_error: (f64, f64),
}

/// One addition.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// `viscous_drag(theta)`.
    pub effect: String,
    /// The statement that was added.
    pub snippet: String,
    /// Coefficients of its terms, then its inner parameters.
    pub coefficient: Vec<f64>,
    /// Standard errors, in the same order.
    pub standard_error: Vec<f64>,
    /// Chance that noise does as well, all tries paid for.
    pub p_value: f64,
    /// Error on unseen runs over a segment without it, in units of the noise.
    pub unseen_error_before: f64,
    /// The same with it.
    pub unseen_error_after: f64,
    /// Leaders that these data could not tell from it.
    pub indistinguishable: Vec<String>,
}

/// Additions, at most.
const MOST: usize = 8;
/// An addition pays when the unseen deviance falls by more than this (odds of 1,000 to 1).
const PAYS: f64 = 14.0;

/// Adds named effects to a spec until what is left is noise, or nothing of the catalogue helps.
///
/// # Errors
///
/// When the spec has errors, or cannot be fitted.
pub fn discover(
    name: &str,
    text: &str,
    training: &Dataset,
    unseen: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Discovery> {
    let mut text = text.to_string();
    let mut compiled = build(name, &text)?;
    let mut model = fit(&compiled.system, training, options, monitor)?;
    let mut steps: Vec<Step> = Vec::new();
    // What else each step might have been.
    let mut rivals: Vec<Vec<Leader>> = Vec::new();
    let start = text.clone();
    let first = (compiled.clone(), model.clone());
    let (stop, verdict) = loop {
        monitor.stage(&format!("what is missing, round {}", steps.len() + 1), 0.1);
        let diagnosis = diagnose(name, &text, &compiled, &model, training, unseen, monitor)?;
        if !goes_on(&diagnosis) {
            break (diagnosis.reason, diagnosis.verdict);
        }
        if steps.len() == MOST {
            let sentence = format!("stopped after {MOST} additions; more would pay");
            break (sentence, Verdict::Missing);
        }
        if monitor.stopped() {
            break ("interrupted: what was found so far was kept".to_string(), Verdict::Missing);
        }
        let context = Context::new(&compiled.system, &model, unseen)?;
        let (_, _, sums) = context.settle(context.window);
        let pays = |leader: &&Leader| {
            let fall = leader.unseen_error_before.powi(2) - leader.unseen_error_after.powi(2);
            fall * sums.rows as f64 > PAYS * leader.unseen_error_after.powi(2)
        };
        let mut kept = None;
        let mut lost = None;
        for leader in diagnosis.ranking.iter().filter(pays) {
            let longer = insert(&text, &leader.snippet);
            let next = build(name, &longer)?;
            let of = |term: &Term| term.effect.as_deref() == Some(leader.effect.as_str());
            let terms = (0..next.system.terms.len()).filter(|&k| of(&next.system.terms[k]));
            let start = Start::of(&model, &next.system).with(terms);
            // Where not even a fit succeeds, the next leader may.
            let fitted = resume(&next.system, training, options, &start, monitor).ok();
            let has = |model: &Model| {
                model.terms.iter().any(|term| belongs(&next.system, term, &leader.effect))
            };
            if let Some(fitted) = fitted.filter(has) {
                kept = Some((step(&diagnosis, leader), longer, next, fitted));
                break;
            }
            lost.get_or_insert(&leader.effect);
        }
        let Some((step, longer, next, fitted)) = kept else {
            let sentence = match lost {
                Some(effect) => format!("{effect} looked missing, but a full fit does not keep it"),
                None => "what looks missing does not lower the error on unseen runs".to_string(),
            };
            let verdict = match diagnosis.verdict {
                Verdict::Unexplained => Verdict::Unexplained,
                _ => Verdict::NothingMissing,
            };
            break (sentence, verdict);
        };
        steps.push(step);
        rivals.push(diagnosis.ranking);
        (text, compiled, model) = (longer, next, fitted);
    };
    if steps.len() > 1 {
        for (step, rivals) in steps.iter_mut().zip(&rivals) {
            let found = Found { name, text: &text, compiled: &compiled, model: &model };
            let simpler = found.simpler(step, rivals, training, options, monitor)?;
            if let Some((rival, revised, next, fitted)) = simpler {
                step.replace(rival);
                (text, compiled, model) = (revised, next, fitted);
            }
            let found = Found { name, text: &text, compiled: &compiled, model: &model };
            step.indistinguishable = found.alike(step, rivals, training, options, monitor)?;
        }
    }
    let noise: Vec<f64> = model.noise.iter().map(|n| n.standard_deviation).collect();
    let unseen_error = |compiled: &crate::expr::Compiled, of: &Model| -> Result<f64> {
        let mut context = Context::new(&compiled.system, of, unseen)?;
        context.noise.clone_from(&noise);
        Ok(super::compare::error(&context, model.evidence.window).0)
    };
    let before = if start == text {
        unseen_error(&compiled, &model)?
    } else {
        unseen_error(&first.0, &first.1)?
    };
    let after = unseen_error(&compiled, &model)?;
    Ok(Discovery { steps, stop, verdict, text, model, unseen_error: (before, after) })
}

/// Whether the best named effect may be added: always when it explains the misfit; as a part of
/// a larger whole only when no term without a name does better on unseen runs.
fn goes_on(diagnosis: &Diagnosis) -> bool {
    let named = diagnosis.ranking.first().map(|leader| leader.unseen_error_after);
    let unnamed = diagnosis.unnamed.as_ref().map(|leader| leader.unseen_error_after);
    match diagnosis.verdict {
        Verdict::Missing => true,
        Verdict::Unexplained => {
            named.is_some_and(|named| unnamed.is_none_or(|unnamed| named <= unnamed))
        }
        Verdict::NothingMissing | Verdict::TooLittleData => false,
    }
}

/// A spec with everything that was found, and its model.
struct Found<'a> {
    name: &'a str,
    text: &'a str,
    compiled: &'a Compiled,
    model: &'a Model,
}

/// What a model leaves of the measurements, in units of its own noise.
struct Left {
    /// Weighted squares, and the residuals that they are the sum of.
    loss: f64,
    rows: usize,
    /// Segments that are not followed at all.
    exploded: usize,
    noise: Vec<f64>,
    window: usize,
}

impl Left {
    /// What an unknown has to save.
    fn price(&self) -> f64 {
        (self.rows.max(1) as f64).ln()
    }
}

impl Found<'_> {
    /// A rival of a step with fewer unknowns that explains as much now that the other effects are
    /// there: while they were missing, a more flexible effect may have stood in for them too.
    fn simpler<'l>(
        &self,
        step: &Step,
        rivals: &'l [Leader],
        training: &Dataset,
        options: &Options,
        monitor: &dyn Monitor,
    ) -> Result<Option<(&'l Leader, String, Compiled, Model)>> {
        let unknowns = step.coefficient.len();
        let without = self.left(training)?;
        let mut rivals: Vec<&Leader> =
            rivals.iter().filter(|rival| rival.coefficient.len() < unknowns).collect();
        rivals.sort_by_key(|rival| rival.coefficient.len());
        for rival in rivals {
            let swapped = self.with_instead(step, rival, &without, training, options, monitor)?;
            let Some((more, text, next, fitted)) = swapped else { continue };
            let saved = (unknowns - rival.coefficient.len()) as f64 * without.price();
            if more < saved + CLOSE {
                return Ok(Some((rival, text, next, fitted)));
            }
        }
        Ok(None)
    }

    /// Labels of the rivals that explain as much in the place of a step, now that the other
    /// effects are there.
    fn alike(
        &self,
        step: &Step,
        rivals: &[Leader],
        training: &Dataset,
        options: &Options,
        monitor: &dyn Monitor,
    ) -> Result<Vec<String>> {
        let mut out = Vec::new();
        let without = self.left(training)?;
        for rival in rivals.iter().filter(|rival| rival.effect != step.effect) {
            let swapped = self.with_instead(step, rival, &without, training, options, monitor)?;
            let unknowns = rival.coefficient.len() as f64 - step.coefficient.len() as f64;
            if swapped.is_some_and(|(more, ..)| more + unknowns * without.price() < CLOSE) {
                out.push(rival.effect.clone());
            }
        }
        Ok(out)
    }

    /// What the model leaves.
    fn left(&self, training: &Dataset) -> Result<Left> {
        let context = Context::new(&self.compiled.system, self.model, training)?;
        let (_, _, sums) = context.settle(context.window);
        let (noise, window) = (context.noise, context.window);
        Ok(Left { loss: sums.loss, rows: sums.rows, exploded: sums.exploded, noise, window })
    }

    /// The spec and the model with a rival in the place of a step, and by how much the weighted
    /// squares grow; `None` where it cannot be there, or does not follow the measurements.
    fn with_instead(
        &self,
        step: &Step,
        rival: &Leader,
        without: &Left,
        training: &Dataset,
        options: &Options,
        monitor: &dyn Monitor,
    ) -> Result<Option<(f64, String, Compiled, Model)>> {
        let text = self.text.replacen(&step.snippet, &rival.snippet, 1);
        // The effect may have been added by another step.
        let Ok(next) = build(self.name, &text) else { return Ok(None) };
        let of = |term: &Term| term.effect.as_deref() == Some(rival.effect.as_str());
        let terms = (0..next.system.terms.len()).filter(|&k| of(&next.system.terms[k]));
        let start = Start::of(self.model, &next.system).with(terms);
        let Ok(fitted) = resume(&next.system, training, options, &start, monitor) else {
            return Ok(None);
        };
        let mut other = Context::new(&next.system, &fitted, training)?;
        other.noise.clone_from(&without.noise);
        let (_, _, sums) = other.settle(without.window);
        let follows = sums.exploded <= without.exploded;
        Ok(follows.then(|| (sums.loss - without.loss, text, next, fitted)))
    }
}

impl Step {
    fn replace(&mut self, rival: &Leader) {
        self.effect.clone_from(&rival.effect);
        self.snippet.clone_from(&rival.snippet);
        self.coefficient.clone_from(&rival.coefficient);
        self.standard_error.clone_from(&rival.standard_error);
        self.p_value = rival.p_value;
        self.unseen_error_after = rival.unseen_error_after;
    }
}

/// Whether a learned term came with an effect.
fn belongs(
    system: &crate::expr::System,
    learned: &crate::fit::model::LearnedTerm,
    effect: &str,
) -> bool {
    system.terms.iter().any(|term| {
        term.effect.as_deref() == Some(effect)
            && term.label == learned.term
            && system.place_name(term.place) == learned.place
    })
}

fn step(diagnosis: &Diagnosis, leader: &Leader) -> Step {
    let mut others: Vec<String> = diagnosis.indistinguishable.clone();
    others.retain(|name| *name != leader.effect);
    Step {
        effect: leader.effect.clone(),
        snippet: leader.snippet.clone(),
        coefficient: leader.coefficient.clone(),
        standard_error: leader.standard_error.clone(),
        p_value: leader.p_value,
        unseen_error_before: leader.unseen_error_before,
        unseen_error_after: leader.unseen_error_after,
        indistinguishable: others,
    }
}
