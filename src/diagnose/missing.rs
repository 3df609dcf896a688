//! What is missing: every candidate's score, the leaders refitted in full, a verdict.

use serde::Serialize;

use super::candidates::{Candidate, candidates};
use super::compare::{error, residual_maps};
use super::context::Context;
use super::score::{Score, Scores};
use crate::data::Dataset;
use crate::error::Result;
use crate::expr::{Compiled, System, Term};
use crate::fit::train::Training;
use crate::fit::{Model, Monitor, Options};

/// What is missing from a model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// The answer in a word.
    pub verdict: Verdict,
    /// Why, in a sentence.
    pub reason: String,
    /// Leaders, the best first.
    pub ranking: Vec<Leader>,
    /// Labels of leaders that these data cannot tell from the first; empty when it stands alone.
    pub indistinguishable: Vec<String>,
    /// Candidates that were tried, and grid points of their inner parameters.
    pub candidates: usize,
    /// Candidates times the grid points of their inner parameters.
    pub tried: usize,
    /// Error on unseen runs over a segment, in units of the noise, before anything is added.
    pub unseen_error: f64,
}

/// The answer in a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// A named effect explains what the model misses.
    Missing,
    /// What is left is noise.
    NothingMissing,
    /// Something is missing that the catalogue does not have.
    Unexplained,
    /// The data do not suffice to say.
    TooLittleData,
}

/// A candidate that was refitted in full.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Leader {
    /// `viscous_drag(theta)`.
    pub effect: String,
    /// Coordinates or observables that it is on.
    pub on: Vec<String>,
    /// The statement that adds it to the spec.
    pub snippet: String,
    /// Coefficient of each of its terms, then its inner parameters.
    pub coefficient: Vec<f64>,
    /// Standard errors, in the order of `coefficient`.
    pub standard_error: Vec<f64>,
    /// Chance that noise does as well, all candidates and grid points paid for.
    pub p_value: f64,
    /// Fall of the training deviance in the full refit.
    pub deviance: f64,
    /// In units of the noise.
    pub unseen_error_before: f64,
    /// The same with the effect in the model.
    pub unseen_error_after: f64,
}

/// Columns that one linearisation carries, at most.
const COLUMNS: usize = 240;
/// Candidates that are refitted.
const LEADERS: usize = 8;
/// Chance below which an effect is there, all tries paid for.
const SIGNIFICANT: f64 = 1e-3;
/// Deviances closer than this cannot be told apart (odds of 20 to 1).
const CLOSE: f64 = 6.0;

struct Scored {
    candidate: usize,
    values: Vec<f64>,
    score: Score,
    /// p-value with everything that was tried paid for.
    p_value: f64,
    /// Deviance less the price of its unknowns.
    merit: f64,
}

/// Asks what a model misses.
///
/// `text` is the spec that the model was fitted from; `training` the runs that it was fitted to,
/// `unseen` others.
pub fn diagnose(
    name: &str,
    text: &str,
    base: &Compiled,
    model: &Model,
    training: &Dataset,
    unseen: &Dataset,
    monitor: &dyn Monitor,
) -> Result<Diagnosis> {
    let context = Context::new(&base.system, model, training)?;
    let far = context.with_data(unseen);
    let (before, _) = error(&far, context.window);
    let all = candidates(name, text, base, training);
    monitor.stage("scoring candidates", 0.1);
    let (scored, tried) = score_all(&context, &all)?;
    let found: Vec<&Scored> = scored.iter().filter(|s| s.p_value < SIGNIFICANT).collect();
    let maps = residual_maps(&context)?;
    let unnamed = maps
        .iter()
        .map(|map| (map.p_value * maps.len() as f64, map))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let diagnosis = |verdict, reason: String, ranking, indistinguishable| Diagnosis {
        verdict,
        reason,
        ranking,
        indistinguishable,
        candidates: all.len(),
        tried,
        unseen_error: before,
    };
    if found.is_empty() {
        return Ok(match unnamed {
            Some((p, map)) if p < SIGNIFICANT => diagnosis(
                Verdict::Unexplained,
                format!(
                    "the force on {} depends on {} in a way that no effect of the catalogue has",
                    map.on, map.against
                ),
                Vec::new(),
                Vec::new(),
            ),
            _ => diagnosis(
                Verdict::NothingMissing,
                format!("none of {tried} tries explains more than noise would"),
                Vec::new(),
                Vec::new(),
            ),
        });
    }
    let mut leaders: Vec<(Leader, f64)> = Vec::new();
    for (i, scored) in found.iter().take(LEADERS).enumerate() {
        monitor.stage("refitting the leaders", 0.3 + 0.6 * i as f64 / LEADERS as f64);
        if let Some(leader) = refit(&context, &all[scored.candidate], scored, &far, before) {
            leaders.push(leader);
        }
    }
    leaders.sort_by(|a, b| b.1.total_cmp(&a.1));
    let best = leaders.first().map_or(0.0, |l| l.1);
    // Of those that explain equally well the one with the fewest unknowns comes first.
    let close = leaders.iter().take_while(|l| best - l.1 < CLOSE).count();
    leaders[..close].sort_by_key(|(leader, _)| leader.coefficient.len());
    let indistinguishable: Vec<String> = leaders
        .iter()
        .skip(1)
        .filter(|(_, merit)| best - merit < CLOSE)
        .map(|(leader, _)| leader.effect.clone())
        .collect();
    let ranking: Vec<Leader> = leaders.into_iter().map(|(leader, _)| leader).collect();
    let Some(first) = ranking.first() else {
        return Ok(diagnosis(
            Verdict::Unexplained,
            "effects look likely, but none of them could be fitted".to_string(),
            ranking,
            indistinguishable,
        ));
    };
    let reason = format!(
        "{} takes the error on unseen runs from {:.2} to {:.2} times the noise",
        first.effect, first.unseen_error_before, first.unseen_error_after
    );
    Ok(diagnosis(Verdict::Missing, reason, ranking, indistinguishable))
}

/// Scores every candidate at every grid point; the best grid point of each, best candidate first.
fn score_all(context: &Context, all: &[Candidate]) -> Result<(Vec<Scored>, usize)> {
    let mut system = context.system.clone();
    let (_, _, sums) = context.settle(context.window);
    let lost = sums.exploded;
    let mut queue: Vec<Try> = Vec::new();
    for (c, candidate) in all.iter().enumerate() {
        for values in &candidate.grid {
            let terms = candidate.probes(&mut system, values);
            queue.push((c, values.clone(), terms));
        }
    }
    let tried = queue.len();
    let mut best: Vec<Option<Scored>> = (0..all.len()).map(|_| None).collect();
    let mut start = 0;
    while start < queue.len() {
        let mut end = start;
        let mut width = 0;
        while end < queue.len() && (end == start || width + queue[end].2.len() <= COLUMNS) {
            width += queue[end].2.len();
            end += 1;
        }
        score_range(context, &system, &queue[start..end], tried, lost, &mut best)?;
        start = end;
    }
    let mut scored: Vec<Scored> = best.into_iter().flatten().collect();
    scored.sort_by(|a, b| b.merit.total_cmp(&a.merit).then(a.candidate.cmp(&b.candidate)));
    Ok((scored, tried))
}

/// A candidate, values of its inner parameters, and its terms at them.
type Try = (usize, Vec<f64>, Vec<Term>);

/// Scores some tries together. Where one of them loses segments that the model itself does not
/// (it divides by zero, say), the tries are taken apart, and that one is left out.
fn score_range(
    context: &Context,
    system: &System,
    tries: &[Try],
    tried: usize,
    lost: usize,
    best: &mut [Option<Scored>],
) -> Result<()> {
    let terms: Vec<Term> = tries.iter().flat_map(|(_, _, terms)| terms.clone()).collect();
    let probed = match context.probe(system, &terms) {
        Ok(probed) if probed.exploded <= lost => probed,
        Err(error) if tries.len() == 1 && lost > 0 => return Err(error),
        _ if tries.len() == 1 => return Ok(()),
        _ => {
            let (first, second) = tries.split_at(tries.len() / 2);
            score_range(context, system, first, tried, lost, best)?;
            return score_range(context, system, second, tried, lost, best);
        }
    };
    let scores: Scores = probed.scores;
    let mut column = 0;
    for (c, values, terms) in tries {
        let columns: Vec<usize> = (column..column + terms.len()).collect();
        column += terms.len();
        let score = scores.group(&columns);
        let unknowns = score.degrees + values.len();
        let merit = score.deviance - unknowns as f64 * (scores.rows as f64).ln();
        if score.degrees > 0 && best[*c].as_ref().is_none_or(|b| merit > b.merit) {
            let p_value = (score.p_value * tried as f64).min(1.0);
            let values = values.clone();
            best[*c] = Some(Scored { candidate: *c, values, score, p_value, merit });
        }
    }
    Ok(())
}

/// The model with a candidate in it, refitted from the model's own values; with its merit.
fn refit(
    context: &Context,
    candidate: &Candidate,
    scored: &Scored,
    unseen: &Context,
    before: f64,
) -> Option<(Leader, f64)> {
    let mut system = candidate.system.clone();
    for (place, (&j, &value)) in candidate.parameters.iter().zip(&scored.values).enumerate() {
        let parameter = &mut system.parameters[j];
        // Outside the grid the data say nothing about the parameter: it may leave it by half.
        let axis = candidate.grid.iter().map(|values| values[place]);
        let (lower, upper) =
            axis.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        let margin = 0.5 * (upper - lower);
        let smallest = if lower > 0.0 { 0.5 * lower } else { lower - margin };
        parameter.bounds.lower = parameter.bounds.lower.max(smallest);
        parameter.bounds.upper = parameter.bounds.upper.min(upper + margin);
        parameter.start = parameter.bounds.clamp(value);
    }
    let support: Vec<usize> =
        support_in(context, &system).chain(candidate.terms.iter().copied()).collect();
    let options = Options { window: Some(context.window), ..Options::default() };
    let silent = crate::fit::Silent;
    let mut training = Training::new(&system, context.dataset, &options).ok()?;
    training.noise.clone_from(&context.noise);
    training.integrator.stepping = context.stepping;
    training.support = support;
    training.coefficients.fill(0.0);
    for (&k, &value) in training.support.iter().zip(&context.coefficients) {
        training.coefficients[k] = value;
    }
    for (&k, &value) in candidate.terms.iter().zip(&scored.score.coefficients) {
        training.coefficients[k] = value;
    }
    for (value, &known) in training.parameters.iter_mut().zip(&context.parameters) {
        *value = known;
    }
    training.choose_integrator();
    let refit = training.refit(&silent);
    let (_, _, sums) = context.settle(context.window);
    let deviance = sums.loss - refit.sums.loss;
    let count = training.support.len();
    let variance = 1.0f64.min(refit.sums.loss / refit.sums.rows.max(1) as f64).max(1e-9);
    let covariance = crate::fit::uncertainty::covariance(&refit.linearised.merged(), variance);
    let new_terms = count - candidate.terms.len()..count;
    let of = |i: usize| (refit.theta[i], covariance[(i, i)].sqrt());
    let (mut coefficient, mut standard_error): (Vec<f64>, Vec<f64>) = new_terms.map(of).unzip();
    let inner = refit.theta.len() - candidate.parameters.len().min(refit.theta.len() - count);
    for i in inner..refit.theta.len() {
        coefficient.push(refit.theta[i]);
        standard_error.push(covariance[(i, i)].sqrt());
    }
    training.take(&refit);
    let mut after = unseen.with_data(unseen.dataset);
    after.system = training.system;
    after.support.clone_from(&training.support);
    after.coefficients = training.support.iter().map(|&k| training.coefficients[k]).collect();
    after.parameters.clone_from(&training.parameters);
    after.stepping = training.integrator.stepping;
    let (unseen_error_after, _) = error(&after, context.window);
    let values: Vec<f64> = candidate.parameters.iter().map(|&j| training.parameters[j]).collect();
    let unknowns = (candidate.terms.len() + candidate.parameters.len()) as f64;
    // Every unknown is paid for, and the choice among the grid's points (as in the trainer's
    // criterion).
    let price = unknowns * (refit.sums.rows.max(1) as f64).ln()
        + 2.0 * (candidate.grid.len().max(1) as f64).ln();
    let merit = deviance / variance - price;
    Some((
        Leader {
            effect: candidate.label.clone(),
            on: candidate.on.clone(),
            snippet: candidate.effect.statement(&candidate.on, &values),
            coefficient,
            standard_error,
            p_value: scored.p_value,
            deviance: deviance / variance,
            unseen_error_before: before,
            unseen_error_after,
        },
        merit,
    ))
}

/// The model's terms in a system that holds more.
fn support_in<'a>(context: &'a Context, system: &'a System) -> impl Iterator<Item = usize> + 'a {
    context.support.iter().filter_map(|&k| {
        let term = &context.system.terms[k];
        system.terms.iter().position(|t| t.place == term.place && t.label == term.label)
    })
}
