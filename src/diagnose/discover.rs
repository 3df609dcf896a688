//! The loop: ask what is missing, add it, fit again, until nothing pays on held-out runs.

use serde::Serialize;

use super::candidates::{LeftOut, NumberChange};
use super::diagnosis::{Diagnosis, RankedEffect, Verdict, diagnose};
use super::effect::written_into;
use super::law_on_data::LawOnData;
use super::misfit::error;
use super::options::Options;
use super::window::longest;
use crate::data::Dataset;
use crate::error::Result;
use crate::expr::{Compiled, build};
use crate::fit::{self, Law, Model, Monitor, resume};

/// What the loop did, and why it ended.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Discovery {
    /// Additions, in order.
    pub steps: Vec<Step>,
    /// What these data cannot tell from several additions together.
    pub instead: Vec<Instead>,
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
    /// Error on held-out runs over their whole length at the start and at the end, in units of the
    /// last noise estimate.
    pub held_out_error: (f64, f64),
}

/// Several additions that were found together, and what explains the data as well in the place of
/// more than one of them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Instead {
    /// Labels of the additions.
    pub of: Vec<String>,
    /// Labels of the others, those of one explanation joined by `and`.
    pub others: Vec<String>,
}

/// One addition.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// `viscous_drag(theta)`.
    pub effect: String,
    /// The statement that was added.
    pub snippet: String,
    /// The number of the spec that was changed, where it is that and no effect: `snippet` is the
    /// statement that it stands in.
    pub number: Option<NumberChange>,
    /// The term of the spec that was learned, where it is one that the fit had left out: `snippet`
    /// is empty.
    pub left_out: Option<LeftOut>,
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
    /// What these data cannot tell from it, all other additions being the same.
    pub indistinguishable: Vec<String>,
}

/// What may be chosen about a discovery. The defaults serve every system.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DiscoveryOptions {
    /// Options of the fits.
    pub fit: fit::Options,
    /// Options of the diagnoses.
    pub diagnosis: Options,
}

/// Adds what a diagnosis finds missing to a spec, all of it or the part that is clear, and asks
/// again until what is left is noise, or nothing is clear of it.
///
/// # Errors
///
/// When the spec has errors, or cannot be fitted.
pub fn discover(
    name: &str,
    text: &str,
    training: &Dataset,
    held_out: &Dataset,
    options: &DiscoveryOptions,
    monitor: &dyn Monitor,
) -> Result<Discovery> {
    let mut text = text.to_string();
    let mut compiled = build(name, &text)?;
    let mut model = fit::fit(&compiled.system, training, &options.fit, monitor)?;
    let mut steps: Vec<Step> = Vec::new();
    let mut instead: Vec<Instead> = Vec::new();
    let start = text.clone();
    let first = (compiled.clone(), model.clone());
    let mut interrupted = false;
    let mut in_part = false;
    let (stop, verdict) = loop {
        let round = steps.len() + 1;
        monitor.stage(&format!("what is missing, round {round}"), 0.1);
        let law = model.law_of(&compiled.system)?;
        // A part that nobody measures has columns in which nothing is.
        let columns = compiled.system.observables();
        let (seen, unseen) =
            (training.with_observables(columns.clone()), held_out.with_observables(columns));
        let diagnosis = diagnose(&compiled, &law, &seen, &unseen, &options.diagnosis, monitor)?;
        // An interrupted diagnosis did not look everywhere: its verdict says nothing.
        if monitor.stopped() {
            interrupted = true;
            break (interruption(&diagnosis, round), Verdict::Interrupted);
        }
        let story = match diagnosis.verdict {
            Verdict::Missing => &diagnosis.story,
            Verdict::ExplainedInPart => &diagnosis.partial,
            _ => &Vec::new(),
        };
        if story.is_empty() {
            let verdict = match diagnosis.verdict {
                Verdict::Unexplained if in_part => Verdict::ExplainedInPart,
                verdict => verdict,
            };
            break (diagnosis.reason, verdict);
        }
        if steps.len() >= options.diagnosis.tuning.discovery.additions {
            let sentence = format!(
                "stopped after {} additions; more would lower the error on held-out runs",
                steps.len()
            );
            break (sentence, Verdict::Missing);
        }
        let mut beside = diagnosis.beside_story.iter();
        let begun = beside.try_fold(law, |law, &(id, value)| law.with_term(id, value))?;
        let with = with_story(name, &text, &begun, story, training, &options.fit, monitor)?;
        if monitor.halted() {
            interrupted = true;
            break (interruption(&diagnosis, round), Verdict::Interrupted);
        }
        let Some((longer, next, fitted)) = with else {
            let names: Vec<&str> = story.iter().map(|member| member.effect.as_str()).collect();
            let sentence =
                format!("{} looked missing, but a full fit does not select it", names.join(", "));
            break (sentence, Verdict::Unexplained);
        };
        for (at, member) in in_writing(story).into_iter().enumerate() {
            let alone = at == 0 && story.len() == 1;
            let others =
                if alone { &diagnosis.indistinguishable } else { &member.indistinguishable };
            steps.push(step(member, others));
        }
        instead.extend(Instead::of(&diagnosis));
        in_part |= diagnosis.verdict == Verdict::ExplainedInPart;
        (text, compiled, model) = (longer, next, fitted);
    };
    let last = model.law_of(&compiled.system)?;
    let held_out_error = |compiled: &Compiled, model: &Model| -> Result<f64> {
        let noise = last.noise_on(&compiled.system, 1.0);
        let law = model.law_of(&compiled.system)?.with_noise(noise);
        let held_out = held_out.with_observables(compiled.system.observables());
        let model = LawOnData::of(law, &held_out, &options.diagnosis).heeding(monitor);
        Ok(error(&model, longest(&model)).0)
    };
    let before = if start == text {
        held_out_error(&compiled, &model)?
    } else {
        held_out_error(&first.0, &first.1)?
    };
    let after = held_out_error(&compiled, &model)?;
    Ok(Discovery {
        steps,
        instead,
        stop,
        interrupted,
        verdict,
        text,
        model,
        held_out_error: (before, after),
    })
}

/// What an interrupted diagnosis had found, and how far it had come.
fn interruption(diagnosis: &Diagnosis, round: usize) -> String {
    match diagnosis.ranking.first() {
        Some(first) => format!(
            "interrupted in round {round}, before anything was added in it; the best candidate so \
             far was {}{}",
            first.effect,
            first.gain()
        ),
        None => format!(
            "interrupted in round {round}, before any candidate was fitted; {} tests had been made",
            diagnosis.tests
        ),
    }
}

/// The members of a story in the order in which they are written: numbers, the last in the text
/// first, so that those before it keep their places; then statements.
fn in_writing(story: &[RankedEffect]) -> Vec<&RankedEffect> {
    let mut members: Vec<&RankedEffect> = story.iter().collect();
    members.sort_by_key(|member| match &member.number {
        Some(change) => (0, std::cmp::Reverse(change.known.span.start)),
        None => (1, std::cmp::Reverse(0)),
    });
    members
}

impl Instead {
    /// What a diagnosis names in the place of all of its story, as far as that is no exchange of
    /// one member alone; `None` where it names nothing.
    fn of(diagnosis: &Diagnosis) -> Option<Instead> {
        let story = &diagnosis.story;
        let of: Vec<String> = story.iter().map(|member| member.effect.clone()).collect();
        let exchanged = |at: usize, other: &String| {
            let mut labels = of.clone();
            labels[at].clone_from(other);
            labels.sort();
            labels.join(" and ")
        };
        let exchanges: Vec<String> = story
            .iter()
            .enumerate()
            .flat_map(|(at, member)| member.indistinguishable.iter().map(move |one| (at, one)))
            .map(|(at, other)| exchanged(at, other))
            .collect();
        let others = diagnosis.indistinguishable.iter();
        let others: Vec<String> = others.filter(|one| !exchanges.contains(one)).cloned().collect();
        (story.len() > 1 && !others.is_empty()).then_some(Instead { of, others })
    }
}

impl Step {
    /// The text of a spec with it; a number must have been found in this text.
    pub fn written_into(&self, text: &str) -> String {
        written_into(text, &self.snippet, self.number.as_ref(), &self.coefficient)
    }
}

/// Spec and model with all members of a story; `None` where a fit does not keep them all.
fn with_story(
    name: &str,
    text: &str,
    law: &Law,
    story: &[RankedEffect],
    training: &Dataset,
    options: &fit::Options,
    monitor: &dyn Monitor,
) -> Result<Option<(String, Compiled, Model)>> {
    let members = in_writing(story);
    let longer =
        members.into_iter().fold(text.to_string(), |text, member| member.written_into(&text));
    let next = build(name, &longer)?;
    let mut start = law.on(&next.system);
    for member in story {
        start = start_with(start, member)?;
    }
    let training = training.with_observables(next.system.observables());
    // Where not even a fit succeeds, nothing is added.
    let Ok(fitted) = resume(&start, &training, options, monitor) else { return Ok(None) };
    let has = |member: &RankedEffect| {
        if let Some(own) = &member.left_out {
            let mut learned = fitted.terms.iter();
            return learned.any(|term| term.term == own.term && term.place == own.place);
        }
        let mut all = next.system.terms.iter();
        let unnamed = !all.any(|term| term.effect.as_deref() == Some(member.effect.as_str()));
        let learned = |term| belongs(&next.system, term, &member.effect);
        unnamed || fitted.terms.iter().any(learned)
    };
    Ok(story.iter().all(has).then_some((longer, next, fitted)))
}

/// A law as the start of a fit of a system with an effect, its coefficients as they were found.
fn start_with(law: Law, member: &RankedEffect) -> Result<Law> {
    let system = law.system().clone();
    let terms = system.terms_where(|term| match &member.left_out {
        Some(own) => own.is(term),
        None => term.effect.as_deref() == Some(member.effect.as_str()),
    });
    let numbers = member.coefficient.iter().copied().chain(std::iter::repeat(0.0));
    terms.into_iter().zip(numbers).try_fold(law, |law, (id, value)| law.with_term(id, value))
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

fn step(member: &RankedEffect, others: &[String]) -> Step {
    Step {
        effect: member.effect.clone(),
        snippet: member.snippet.clone(),
        number: member.number.clone(),
        left_out: member.left_out.clone(),
        coefficient: member.coefficient.clone(),
        standard_error: member.standard_error.clone(),
        p_value: member.p_value,
        held_out_error_before: member.held_out_error_before,
        held_out_error_after: member.held_out_error_after,
        indistinguishable: others.iter().filter(|name| **name != member.effect).cloned().collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn effect(name: &str, instead: &[&str]) -> RankedEffect {
        RankedEffect {
            effect: name.to_string(),
            on: Vec::new(),
            snippet: String::new(),
            number: None,
            left_out: None,
            coefficient: Vec::new(),
            standard_error: Vec::new(),
            p_value: 1.0,
            tests: 1.0,
            deviance: 0.0,
            held_out_error_before: f64::NAN,
            held_out_error_after: f64::NAN,
            indistinguishable: instead.iter().map(|one| one.to_string()).collect(),
        }
    }

    #[test]
    fn only_what_takes_the_place_of_several_members_is_instead_of_a_story() {
        let drag = effect("viscous drag", &[]);
        let bowl = effect("tanh", &["magnet"]);
        let mut diagnosis = Diagnosis::too_little(String::new());
        diagnosis.story = vec![drag.clone(), bowl];
        diagnosis.indistinguishable = vec!["magnet and viscous drag".to_string()];
        // The magnet is named beside the member that it stands in for.
        assert!(Instead::of(&diagnosis).is_none());
        diagnosis.indistinguishable.push("memory".to_string());
        let instead = Instead::of(&diagnosis).unwrap();
        assert_eq!(instead.of, ["viscous drag", "tanh"]);
        assert_eq!(instead.others, ["memory"]);
        // What stands in for one change alone is said beside that.
        diagnosis.story = vec![drag];
        assert!(Instead::of(&diagnosis).is_none());
    }
}
