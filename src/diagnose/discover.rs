//! The loop: ask what is missing, add it, fit again, until nothing pays on held-out runs.

use std::sync::Arc;

use serde::Serialize;

use super::candidates::candidates;
use super::context::Context;
use super::diagnosis::{Diagnosis, RankedEffect, Verdict, diagnose};
use super::ranking::ranking;
use super::tuning::TUNING;
use crate::data::Dataset;
use crate::error::Result;
use crate::expr::{Compiled, Scope, System, build};
use crate::fit::{Law, Model, Monitor, Options, fit, resume};
use crate::spec::edit;

/// What the loop did, and why it ended.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Discovery {
    /// Additions, in order.
    pub steps: Vec<Step>,
    /// Why it ended, in a sentence.
    pub stop: String,
    /// Whether it was interrupted before it came to its end.
    pub interrupted: bool,
    /// Verdict of the last diagnosis.
    pub verdict: Verdict,
    /// The spec with every addition.
    pub text: String,
    /// The model of that spec, fitted to the training runs.
    pub model: Model,
    /// Error on held-out runs at the start and at the end, in units of the last noise estimate.
    pub held_out_error: (f64, f64),
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
    /// p-value after the look-elsewhere correction for all candidates and grid points.
    pub p_value: f64,
    /// Error on held-out runs over a segment without it, in units of the noise.
    pub held_out_error_before: f64,
    /// The same with it.
    pub held_out_error_after: f64,
    /// RankedEffects that these data could not tell from it.
    pub indistinguishable: Vec<String>,
}

/// Adds named effects to a spec until what is left is noise, or nothing of the catalogue helps.
///
/// # Errors
///
/// When the spec has errors, or cannot be fitted.
pub fn discover(
    name: &str,
    text: &str,
    training: &Dataset,
    held_out: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Discovery> {
    let mut text = text.to_string();
    let mut compiled = build(name, &text)?;
    let mut model = fit(&compiled.system, training, options, monitor)?;
    let mut steps: Vec<Step> = Vec::new();
    // What else each step might have been.
    let mut rivals: Vec<Vec<RankedEffect>> = Vec::new();
    let start = text.clone();
    let first = (compiled.clone(), model.clone());
    let mut interrupted = false;
    let (stop, verdict) = loop {
        monitor.stage(&format!("what is missing, round {}", steps.len() + 1), 0.1);
        let diagnosis = diagnose(&compiled, &model, training, held_out, monitor)?;
        // An interrupted diagnosis did not look everywhere: its verdict says nothing.
        if monitor.stopped() {
            interrupted = true;
            break interruption(&diagnosis, steps.len() + 1);
        }
        if !goes_on(&diagnosis) {
            break (diagnosis.reason, diagnosis.verdict);
        }
        if steps.len() == TUNING.discovery.additions {
            let sentence = format!(
                "stopped after {} additions; more would lower the error on held-out runs",
                TUNING.discovery.additions
            );
            break (sentence, Verdict::Missing);
        }
        let context = Context::new(&compiled.system, &model, held_out)?;
        let (_, _, sums) = context.settle(context.law.window());
        let partial = diagnosis.verdict == Verdict::Unexplained;
        let pays = |leader: &&RankedEffect| {
            let before = leader.held_out_error_before.powi(2);
            let after = leader.held_out_error_after.powi(2);
            (before - after) * sums.rows as f64 > TUNING.discovery.deviance * after
                && (!partial || before - after > TUNING.discovery.part * (before - 1.0))
        };
        let mut kept = None;
        let mut lost = None;
        for leader in diagnosis.ranking.iter().filter(pays) {
            let longer = edit::insert(&text, &leader.snippet);
            let next = build(name, &longer)?;
            let start = start_with(&context.law, &next.system, &leader.effect)?;
            // Where not even a fit succeeds, the next leader may.
            let fitted = resume(&start, training, options, monitor).ok();
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
                Some(effect) => {
                    format!("{effect} looked missing, but a full fit does not select it")
                }
                None if partial => {
                    "what is left is no effect of the catalogue, and none takes away \
                                    a quarter of it on held-out runs"
                        .to_string()
                }
                None => "what looks missing does not lower the error on held-out runs".to_string(),
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
            let found = Discovered { name, text: &text, compiled: &compiled, model: &model };
            let mut alike = found.alike(step, rivals, training, held_out, monitor)?;
            // One that now explains more takes the step's place, and so does a simpler one.
            let beaten = !alike.iter().any(|leader| leader.effect == step.effect);
            let simpler = |rival: &&RankedEffect| rival.coefficient.len() < step.coefficient.len();
            if let Some(rival) = alike.first().filter(|rival| beaten || simpler(rival)).cloned()
                && let Some(swapped) = found.swapped(step, &rival, training, options, monitor)
            {
                step.replace(&rival);
                (text, compiled, model) = swapped;
            }
            alike.retain(|leader| leader.effect != step.effect);
            step.indistinguishable = alike.into_iter().map(|leader| leader.effect).collect();
        }
    }
    let noise: Vec<f64> = model.noise.iter().map(|n| n.standard_deviation).collect();
    let held_out_error = |compiled: &crate::expr::Compiled, of: &Model| -> Result<f64> {
        let context = Context::new(&compiled.system, of, held_out)?.with_noise(noise.clone());
        Ok(super::misfit::error(&context, model.evidence.window).0)
    };
    let before = if start == text {
        held_out_error(&compiled, &model)?
    } else {
        held_out_error(&first.0, &first.1)?
    };
    let after = held_out_error(&compiled, &model)?;
    Ok(Discovery {
        steps,
        stop,
        interrupted,
        verdict,
        text,
        model,
        held_out_error: (before, after),
    })
}

/// What an interrupted diagnosis had found, and how far it had come.
fn interruption(diagnosis: &Diagnosis, round: usize) -> (String, Verdict) {
    match diagnosis.ranking.first() {
        Some(first) => (
            format!(
                "interrupted in round {round}, before anything was added in it; the best candidate \
                 so far was {}, which takes the error on held-out runs from {:.2} to {:.2} times \
                 the noise",
                first.effect, first.held_out_error_before, first.held_out_error_after
            ),
            Verdict::Missing,
        ),
        None => (
            format!(
                "interrupted in round {round}, while its candidates were scored; none of the {} \
                 scored so far was significant",
                diagnosis.tests
            ),
            Verdict::TooLittleData,
        ),
    }
}

/// Whether the best named effect may be added: always when it explains the misfit; as a part of
/// a larger whole only when no single term without a name explains more.
fn goes_on(diagnosis: &Diagnosis) -> bool {
    match diagnosis.verdict {
        Verdict::Missing => true,
        Verdict::Unexplained => !diagnosis.ranking.is_empty() && !diagnosis.unnamed_explains_more,
        Verdict::NothingMissing | Verdict::TooLittleData => false,
    }
}

/// A law as the start of a fit of a system with an effect, whose coefficients are to be found.
fn start_with(law: &Law, system: &Arc<System>, effect: &str) -> Result<Law> {
    let mut start = law.on(system);
    for id in system.terms_where(|term| term.effect.as_deref() == Some(effect)) {
        if !start.support().contains(&id) {
            start = start.with_term(id, 0.0)?;
        }
    }
    Ok(start)
}

/// A spec with everything that was found, and its model.
struct Discovered<'a> {
    name: &'a str,
    text: &'a str,
    compiled: &'a Compiled,
    model: &'a Model,
}

impl Discovered<'_> {
    /// The step's own effect and those of its rivals that explain as much now that the other
    /// effects are there, the one with the fewest unknowns first: while the others were missing,
    /// a more flexible effect may have stood in for them too.
    fn alike(
        &self,
        step: &Step,
        rivals: &[RankedEffect],
        training: &Dataset,
        held_out: &Dataset,
        monitor: &dyn Monitor,
    ) -> Result<Vec<RankedEffect>> {
        let Some(place) = edit::place_of(self.text, &step.snippet) else { return Ok(Vec::new()) };
        let base = build(self.name, &edit::remove(self.text, place))?;
        let own = Context::new(&self.compiled.system, self.model, training)?;
        let context = own.with_law(own.law.on(&base.system));
        // What the effect stood for, the other terms take over as well as they can.
        let Some(context) = context.refitted() else { return Ok(Vec::new()) };
        let asked =
            |label: &str| label == step.effect || rivals.iter().any(|rival| rival.effect == label);
        let mut all = candidates(&mut Scope::of(&base), training);
        all.retain(|candidate| asked(&candidate.label));
        let found = ranking(&context, held_out, &all, all.len(), monitor)?;
        Ok(found.effects.into_iter().take(found.close).map(|one| one.refit.effect).collect())
    }

    /// Spec and model with a rival in the place of a step; `None` where a fit does not keep it.
    fn swapped(
        &self,
        step: &Step,
        rival: &RankedEffect,
        training: &Dataset,
        options: &Options,
        monitor: &dyn Monitor,
    ) -> Option<(String, Compiled, Model)> {
        let place = edit::place_of(self.text, &step.snippet)?;
        let text = edit::replace(self.text, place, &rival.snippet);
        // The effect may have been added by another step.
        let next = build(self.name, &text).ok()?;
        let known = self.model.law(&self.compiled.system)?;
        let start = start_with(&known, &next.system, &rival.effect).ok()?;
        let fitted = resume(&start, training, options, monitor).ok()?;
        let kept = fitted.terms.iter().any(|term| belongs(&next.system, term, &rival.effect));
        kept.then_some((text, next, fitted))
    }
}

impl Step {
    fn replace(&mut self, rival: &RankedEffect) {
        self.effect.clone_from(&rival.effect);
        self.snippet.clone_from(&rival.snippet);
        self.coefficient.clone_from(&rival.coefficient);
        self.standard_error.clone_from(&rival.standard_error);
        self.p_value = rival.p_value;
        self.held_out_error_after = rival.held_out_error_after;
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

fn step(diagnosis: &Diagnosis, leader: &RankedEffect) -> Step {
    let mut others: Vec<String> = diagnosis.indistinguishable.clone();
    others.retain(|name| *name != leader.effect);
    Step {
        effect: leader.effect.clone(),
        snippet: leader.snippet.clone(),
        coefficient: leader.coefficient.clone(),
        standard_error: leader.standard_error.clone(),
        p_value: leader.p_value,
        held_out_error_before: leader.held_out_error_before,
        held_out_error_after: leader.held_out_error_after,
        indistinguishable: others,
    }
}
