//! What is missing: every candidate's score, the leaders refitted in full, a verdict.

use serde::Serialize;

use super::candidates::{Candidate, candidates};
use super::compare::{ResidualMap, error, residual_maps};
use super::context::Context;
use super::floor::noise_floor;
use super::generic::generic;
pub use super::leader::Leader;
use super::leader::{Refitted, refit};
use super::scan::{Scan, scan};
use crate::data::Dataset;
use crate::error::Result;
use crate::expr::{Compiled, build};
use crate::fit::{Model, Monitor};

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
    /// What would have to be added after the first, by its own merits, to explain the rest.
    pub then: Vec<Leader>,
    /// The best term without a name, where the verdict is that something unnamed is missing.
    pub unnamed: Option<Leader>,
    /// The force that is left when all that has a name is in the model, where it shows most.
    pub shape: Option<ResidualMap>,
    /// Candidates that were tried.
    pub candidates: usize,
    /// Candidates times the grid points of their inner parameters.
    pub tried: usize,
    /// Error on unseen runs over a segment, in units of the noise, before anything is added.
    pub unseen_error: f64,
    /// Noise of each observable, as predictions over few samples show it.
    pub noise_floor: Vec<f64>,
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

impl Diagnosis {
    /// Nothing can be said, for this reason.
    pub fn too_little(reason: String) -> Diagnosis {
        Diagnosis {
            verdict: Verdict::TooLittleData,
            reason,
            ranking: Vec::new(),
            indistinguishable: Vec::new(),
            then: Vec::new(),
            unnamed: None,
            shape: None,
            candidates: 0,
            tried: 0,
            unseen_error: f64::NAN,
            noise_floor: Vec::new(),
        }
    }
}

/// Candidates that are refitted in the first round, and in later ones.
const LEADERS: usize = 8;
const LATER: usize = 3;
/// Leaders within this part of the best merit, or that much of it, are fitted to all the data,
/// so many at most.
const NEAR: f64 = 0.01;
const MARGIN: f64 = 50.0;
const FINISHED: usize = 4;
/// Effects together that may explain a misfit.
const TOGETHER: usize = 3;
/// Chance below which an effect is there, all tries paid for.
const SIGNIFICANT: f64 = 1e-3;
/// Deviances closer than this cannot be told apart (odds of 20 to 1).
pub(super) const CLOSE: f64 = 6.0;
/// Named effects explain a misfit when they leave less than this part of it.
const LEAVES: f64 = 0.1;
/// Standard errors of the noise's variance that a model at the noise may be above it.
const AT_NOISE: f64 = 4.0;

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
    let mut context = Context::new(&base.system, model, training)?;
    context.noise = noise_floor(&context, model);
    let far = context.with_data(unseen);
    if let Some(reason) = super::suffices::lacking_beside(&context, &far) {
        return Ok(Diagnosis::too_little(reason));
    }
    let (before, _) = error(&far, context.window);
    let all = candidates(name, text, base, training);
    monitor.stage("scoring candidates", 0.1);
    let scores = scan(&context, &all)?;
    let mut diagnosis = Diagnosis {
        verdict: Verdict::NothingMissing,
        candidates: all.len(),
        tried: scores.tried,
        unseen_error: before,
        noise_floor: context.noise.clone(),
        ..Diagnosis::too_little(format!(
            "none of {} tries explains more than noise would",
            scores.tried
        ))
    };
    let (_, _, sums) = context.settle(context.window);
    let mut leaders = leaders(&context, &all, &scores, sums.loss, LEADERS, (&far, before), monitor);
    // The yardstick of all merits: what is left where the most is explained.
    let variance =
        leaders.iter().map(|l| l.variance).fold(scores.variance, f64::min).max(f64::MIN_POSITIVE);
    leaders.iter_mut().for_each(|l| l.leader.deviance = l.fall / variance);
    leaders.sort_by(|a, b| b.merit(variance).total_cmp(&a.merit(variance)));
    let best = leaders.first().map_or(0.0, |l| l.merit(variance));
    // Of those that explain equally well the one with the fewest unknowns comes first.
    let close = leaders.iter().take_while(|l| best - l.merit(variance) < CLOSE).count();
    leaders[..close].sort_by_key(|l| l.leader.coefficient.len());
    if close > 1 {
        let others = leaders[1..close].iter().map(|l| l.leader.effect.clone());
        diagnosis.indistinguishable = others.collect();
    }
    diagnosis.ranking = leaders.iter().map(|l| l.leader.clone()).collect();
    monitor.stage("what is left", 0.8);
    let chain = chain(name, text, &context, leaders, training, (&far, before), monitor)?;
    judge(&mut diagnosis, name, text, base, &context, chain, variance, monitor)?;
    Ok(diagnosis)
}

/// Refits the significant candidates; the best of them on all the data.
fn leaders(
    context: &Context,
    all: &[Candidate],
    scores: &Scan,
    loss: f64,
    most: usize,
    unseen: (&Context, f64),
    monitor: &dyn Monitor,
) -> Vec<Refitted> {
    let found = scores.scored.iter().filter(|s| s.p_value < SIGNIFICANT).take(most);
    let usable = |l: &Refitted| l.fall.is_finite() && l.fall > 0.0;
    let mut leaders: Vec<(usize, Refitted)> = found
        .enumerate()
        .filter_map(|(i, scored)| {
            monitor.stage("refitting the leaders", 0.3 + 0.5 * i as f64 / most as f64);
            let refitted = refit(context, &all[scored.candidate], scored, loss, unseen)?;
            usable(&refitted).then_some((scored.candidate, refitted))
        })
        .collect();
    let variance = leaders.iter().map(|(_, l)| l.variance).fold(scores.variance, f64::min);
    leaders.sort_by(|(_, a), (_, b)| b.merit(variance).total_cmp(&a.merit(variance)));
    let best = leaders.first().map_or(0.0, |(_, l)| l.merit(variance));
    leaders
        .into_iter()
        .enumerate()
        .filter_map(|(place, (candidate, l))| {
            let near = best - l.merit(variance) < MARGIN.max(NEAR * best);
            if place > 0 && (place >= FINISHED || !near) {
                return Some(l);
            }
            l.finish(context, &all[candidate], loss, unseen.0).filter(usable)
        })
        .collect()
}

/// Effects that together explain what the model misses, each the best after those before it.
struct Chain {
    links: Vec<Refitted>,
    /// Squares that are left in excess of the noise, in parts of those at the start.
    left: f64,
    /// Whether candidates still explain more than noise would.
    open: bool,
    /// The force that is left, where it shows most.
    shape: Option<ResidualMap>,
}

/// Goes on with the best leader until nothing significant is left.
fn chain(
    name: &str,
    text: &str,
    context: &Context,
    leaders: Vec<Refitted>,
    training: &Dataset,
    unseen: (&Context, f64),
    monitor: &dyn Monitor,
) -> Result<Chain> {
    let (_, _, sums) = context.settle(context.window);
    let rows = sums.rows.max(1) as f64;
    // A model at the noise leaves one square for each independent residual.
    let excess = |loss: f64| (loss / rows - 1.0).max(0.0);
    let at_noise = |loss: f64| excess(loss) < AT_NOISE * (2.0 / rows).sqrt();
    let mut text = text.to_string();
    let mut links: Vec<Refitted> = leaders.into_iter().take(1).collect();
    let mut open = false;
    let mut loss = sums.loss;
    while let Some(last) = links.last() {
        loss -= last.fall;
        open = false;
        if at_noise(loss) {
            break;
        }
        text = super::candidates::extended(&text, &last.leader.snippet);
        let compiled = build(name, &text)?;
        let present = last.context(context);
        let present = Context { system: &compiled.system, ..present };
        let far = present.with_data(unseen.0.dataset);
        let more = candidates(name, &text, &compiled, training);
        let scores = scan(&present, &more)?;
        open = scores.scored.iter().any(|s| s.p_value < SIGNIFICANT);
        if !open || links.len() == TOGETHER || monitor.stopped() {
            break;
        }
        let (before, _) = error(&far, present.window);
        let next = leaders_of(&present, &more, &scores, loss, (&far, before), monitor);
        match next {
            Some(next) => links.push(next),
            None => break,
        }
    }
    let last = links.last().map(|last| last.context(context));
    let present = last.as_ref().unwrap_or(context);
    let shape = if at_noise(loss) && !links.is_empty() { None } else { shape(present)? };
    let left = excess(loss) / excess(sums.loss).max(f64::MIN_POSITIVE);
    let left = if at_noise(loss) { 0.0 } else { left };
    Ok(Chain { links, left, open, shape })
}

/// The best of the next round.
fn leaders_of(
    context: &Context,
    all: &[Candidate],
    scores: &Scan,
    loss: f64,
    unseen: (&Context, f64),
    monitor: &dyn Monitor,
) -> Option<Refitted> {
    let mut next = leaders(context, all, scores, loss, LATER, unseen, monitor);
    let variance = next.iter().map(|l| l.variance).fold(scores.variance, f64::min);
    next.sort_by(|a, b| b.merit(variance).total_cmp(&a.merit(variance)));
    next.into_iter().next().filter(|l| l.merit(variance) > 0.0)
}

/// The residual force where it shows most, if it is more than noise.
fn shape(context: &Context) -> Result<Option<ResidualMap>> {
    let maps = residual_maps(context)?;
    let count = maps.len() as f64;
    let most = maps.into_iter().min_by(|a, b| a.p_value.total_cmp(&b.p_value));
    Ok(most.filter(|map| map.p_value * count < SIGNIFICANT))
}

/// The verdict.
#[allow(clippy::too_many_arguments)]
fn judge(
    diagnosis: &mut Diagnosis,
    name: &str,
    text: &str,
    base: &Compiled,
    context: &Context,
    chain: Chain,
    variance: f64,
    monitor: &dyn Monitor,
) -> Result<()> {
    let Some(first) = chain.links.first() else {
        if let Some(shape) = chain.shape {
            diagnosis.verdict = Verdict::Unexplained;
            diagnosis.reason = format!(
                "the force on {} depends on {} in a way that no effect of the catalogue has",
                shape.on, shape.against
            );
            diagnosis.shape = Some(shape);
        }
        return Ok(());
    };
    diagnosis.verdict = Verdict::Missing;
    diagnosis.reason = format!(
        "{} takes the error on unseen runs from {:.2} to {:.2} times the noise",
        first.leader.effect, first.leader.unseen_error_before, first.leader.unseen_error_after
    );
    diagnosis.then = chain.links[1..].iter().map(|l| l.leader.clone()).collect();
    diagnosis.shape = chain.shape;
    if chain.left == 0.0 && chain.links.len() == 1 {
        return Ok(());
    }
    monitor.stage("terms without a name", 0.9);
    let (fall, price) = chain.links.iter().fold((0.0, 0.0), |(f, p), l| (f + l.fall, p + l.price));
    let unnamed = {
        let all = generic(name, text, base, context.dataset);
        let scores = scan(context, &all)?;
        let far = (context, f64::NAN);
        let (_, _, sums) = context.settle(context.window);
        leaders_of(context, &all, &scores, sums.loss, far, monitor)
    };
    let yardstick = unnamed.as_ref().map_or(variance, |u| u.variance.min(variance));
    if std::env::var("LEVERRIER_DEBUG").is_ok() {
        for link in &chain.links {
            eprintln!(
                "   link {} fall {:.1} variance {:.3} after {:.3}",
                link.leader.snippet, link.fall, link.variance, link.leader.unseen_error_after
            );
        }
        eprintln!("   left {} open {}", chain.left, chain.open);
        if let Some(u) = &unnamed {
            eprintln!(
                "   unnamed {} fall {:.1} variance {:.3} merit {:.1} against {:.1}",
                u.leader.snippet,
                u.fall,
                u.variance,
                u.merit(yardstick),
                fall / yardstick - price
            );
        }
    }
    let better = unnamed
        .as_ref()
        .is_some_and(|u| u.merit(yardstick) > fall / yardstick - price + CLOSE);
    if better || (chain.open && chain.left > LEAVES) {
        diagnosis.verdict = Verdict::Unexplained;
        diagnosis.reason = match (&unnamed, better) {
            (Some(u), true) => format!(
                "`{}` explains it better than any effect of the catalogue",
                u.leader.snippet
            ),
            _ => format!(
                "the best effects of the catalogue leave {:.0} % of the misfit",
                100.0 * chain.left
            ),
        };
        diagnosis.unnamed = unnamed.map(|u| u.leader);
    }
    Ok(())
}
