//! What is missing: every candidate's score, the leaders refitted in full, a verdict.

use std::fmt::Write as _;

use serde::Serialize;

use super::candidates::candidates;
use super::compare::{ResidualMap, residual_maps};
use super::context::Context;
use super::detectors::RESOLVED;
use super::floor::noise_floor;
use super::generic::generic;
pub use super::leader::Leader;
use super::leader::Refitted;
use super::round::{CLOSE, Round, SAME, beyond, round};
use crate::data::Dataset;
use crate::error::Result;
use crate::expr::{Compiled, Scope};
use crate::fit::pass::Sums;
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
    /// Whether that term alone explains more than the named effects together.
    pub unnamed_explains_more: bool,
    /// The force that is left when all that has a name is in the model, where it shows most.
    pub shape: Option<ResidualMap>,
    /// Candidates that were tried.
    pub candidates: usize,
    /// Candidates times the grid points of their inner parameters.
    pub tried: usize,
    /// Error on held-out runs over a segment, in units of the noise, before anything is added.
    pub held_out_error: f64,
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
    /// Puts the leader first that a chain begins with.
    fn begin_with(&mut self, link: Option<&Refitted>) {
        let Some(effect) = link.map(|link| link.leader.effect.as_str()) else { return };
        let Some(place) = self.ranking.iter().position(|leader| leader.effect == effect) else {
            return;
        };
        if place > self.indistinguishable.len() {
            self.indistinguishable.clear();
        } else if place > 0 {
            self.indistinguishable[place - 1] = self.ranking[0].effect.clone();
        }
        self.ranking[..=place].rotate_right(1);
    }

    /// Nothing can be said, for this reason.
    pub fn too_little(reason: String) -> Diagnosis {
        Diagnosis {
            verdict: Verdict::TooLittleData,
            reason,
            ranking: Vec::new(),
            indistinguishable: Vec::new(),
            then: Vec::new(),
            unnamed: None,
            unnamed_explains_more: false,
            shape: None,
            candidates: 0,
            tried: 0,
            held_out_error: f64::NAN,
            noise_floor: Vec::new(),
        }
    }
}

/// Candidates that are refitted in the first round, and in later ones.
const LEADERS: usize = 8;
const LATER: usize = 3;
/// Effects together that may explain a misfit.
const TOGETHER: usize = 3;
/// Leaders that such a chain may begin with.
const BEGINNINGS: usize = 3;
/// Named effects explain a misfit when they leave less than this part of it,
const LEAVES: f64 = 0.1;
/// and bring the error to less than this times the noise.
const REACHES: f64 = 1.1;
/// What is less than this part of the misfit is left to a next question: a single effect that
/// explains clean data down to their last digits is not unexplained for the last of them.
const NEGLIGIBLE: f64 = 1e-6;
/// Chance below which a residual force without a name is there.
const UNMISTAKABLE: f64 = 1e-6;
/// Standard errors of the noise's variance that a model at the noise may be above it.
const AT_NOISE: f64 = 4.0;

/// Asks what a model misses.
///
/// `base` is the spec that the model was fitted from; `training` the runs that it was fitted to,
/// `held_out` others.
pub fn diagnose(
    base: &Compiled,
    model: &Model,
    training: &Dataset,
    held_out: &Dataset,
    monitor: &dyn Monitor,
) -> Result<Diagnosis> {
    let mut context = Context::new(&base.system, model, training)?;
    context = context.with_noise(noise_floor(&context, model));
    if let Some(reason) = super::suffices::lacking_beside(&context, &context.with_data(held_out)) {
        return Ok(Diagnosis::too_little(reason));
    }
    monitor.stage("scoring candidates", 0.1);
    let mut scope = Scope::of(base);
    let all = candidates(&mut scope, training);
    let asked = Asked { scope, held_out, context: &context, monitor };
    let first = round(&context, held_out, &all, LEADERS, monitor)?;
    let close = first.leaders.iter().take(first.close).skip(1);
    let mut diagnosis = Diagnosis {
        verdict: Verdict::NothingMissing,
        candidates: all.len(),
        tried: first.tried,
        held_out_error: first.before,
        noise_floor: context.law.noise().to_vec(),
        ranking: first.leaders.iter().map(|l| l.leader.clone()).collect(),
        indistinguishable: close.map(|l| l.leader.effect.clone()).collect(),
        ..Diagnosis::too_little(format!(
            "none of {} tests finds more than noise explains",
            first.tried
        ))
    };
    monitor.stage("what is left", 0.8);
    let window = first.window;
    match asked.best_chain(first)? {
        Some(chain) => {
            diagnosis.begin_with(chain.links.first());
            asked.judge(&mut diagnosis, chain)?;
        }
        None => {
            let longest = context.with_window(window);
            if !resolved(&context, model) {
                diagnosis.reason = "what is left is at the limit of what the integrator and the \
                                    digits of the data resolve"
                    .to_string();
            } else if let Some(shape) = shape(&longest)? {
                diagnosis.verdict = Verdict::Unexplained;
                diagnosis.reason = format!(
                    "the force on {} depends on {} in a way that no effect of the catalogue has",
                    shape.on, shape.against
                );
                diagnosis.shape = Some(shape);
            }
        }
    }
    Ok(diagnosis)
}

/// Whether the noise of some observable is above what the integrator and rounding leave.
fn resolved(context: &Context, model: &Model) -> bool {
    let known = context.law.noise().iter().zip(&model.noise);
    known.into_iter().any(|(noise, of)| *noise > RESOLVED * of.resolution)
}

/// What was asked.
struct Asked<'a, 'b> {
    scope: Scope,
    held_out: &'a Dataset,
    context: &'b Context<'a>,
    monitor: &'b dyn Monitor,
}

/// Effects that together explain what the model misses, each the best after those before it.
struct Chain {
    links: Vec<Refitted>,
    /// Samples of a segment at the end.
    window: usize,
    /// Squares that are left in excess of the noise, in parts of those at the start.
    left: f64,
    /// Error that is left, in units of the noise.
    error: f64,
    /// Whether candidates still explain more than noise would.
    open: bool,
    /// The force that is left, where it shows most.
    shape: Option<ResidualMap>,
}

/// Squares a residual in excess of the noise; zero for a model at the noise, which leaves one
/// square for each independent residual. What cannot be predicted is not explained.
fn excess(sums: &Sums) -> f64 {
    if sums.rows == 0 {
        return f64::INFINITY;
    }
    let rows = sums.rows.max(1) as f64;
    let excess = sums.loss / rows - 1.0;
    if excess < AT_NOISE * (2.0 / rows).sqrt() { 0.0 } else { excess }
}

/// Weighted squares over segments of a length, and their mean.
fn squares(context: &Context, window: usize) -> (f64, f64) {
    let (_, _, sums) = context.settle(window);
    (sums.loss, (sums.loss / sums.rows.max(1) as f64).max(f64::MIN_POSITIVE))
}

impl Chain {
    /// What all its unknowns cost.
    fn price(&self) -> f64 {
        self.links.iter().map(|link| link.price).sum()
    }
}

impl Asked<'_, '_> {
    /// The chain that explains the most; `None` without a leader.
    ///
    /// With two effects missing, a flexible third may stand in for a part of each and lead alone:
    /// unless the first leader leaves nothing, the next ones may begin a chain too.
    fn best_chain(&self, first: Round) -> Result<Option<Chain>> {
        let mut best: Option<Chain> = None;
        for leader in first.leaders.into_iter().take(BEGINNINGS) {
            let chain = self.chain(leader, first.window)?;
            let more = match &best {
                Some(best) => self.explains_more(&chain, best),
                None => true,
            };
            if more {
                best = Some(chain);
            }
            let alone = |chain: &Chain| chain.left == 0.0 && chain.links.len() == 1;
            if best.as_ref().is_some_and(alone) || self.monitor.stopped() {
                break;
            }
        }
        Ok(best)
    }

    /// Whether a chain explains more than another on segments of one length, prices paid; two that
    /// explain the same are left in their order.
    fn explains_more(&self, chain: &Chain, than: &Chain) -> bool {
        let window = chain.window.min(than.window);
        let (Some(ours), Some(theirs)) = (chain.links.last(), than.links.last()) else {
            return than.links.is_empty();
        };
        let (ours, theirs) = (ours.context(self.context), theirs.context(self.context));
        let ((ours, one), (theirs, other)) = (squares(&ours, window), squares(&theirs, window));
        (theirs - ours) / one.min(other) > chain.price() - than.price() + SAME
    }

    /// Goes on from a leader with the best next one until nothing significant is left.
    fn chain(&self, leader: Refitted, window: usize) -> Result<Chain> {
        let mut scope = self.scope.clone();
        let mut window = window;
        let mut links = Vec::new();
        let mut last = leader;
        let (open, explained) = loop {
            let mut present = last.context(self.context).with_window(window);
            // What explains everything goes on to explain it over longer segments.
            let enough = loop {
                if excess(&last.left_of_all(&present)) > 0.0 {
                    break false;
                }
                match beyond(&present) {
                    Some(longer) => present = present.with_window(longer),
                    None => break true,
                }
            };
            window = present.law.window();
            if enough {
                links.push(last);
                break (false, true);
            }
            scope = scope.with(&last.leader.snippet)?;
            let more = candidates(&mut scope, self.context.dataset);
            let present = present.with_law(present.law.on(&scope.compiled().system));
            let next = round(&present, self.held_out, &more, LATER, self.monitor);
            links.push(last);
            // A model that loses the motion answers no further question.
            let Ok(next) = next else { break (true, false) };
            let open = !next.leaders.is_empty();
            let best = next.leaders.into_iter().next();
            match best.filter(|l| l.merit(next.variance) > 0.0) {
                Some(best) if links.len() < TOGETHER && !self.monitor.stopped() => {
                    window = next.window;
                    last = best;
                }
                _ => break (open, false),
            }
        };
        let end =
            links.last().map_or_else(|| self.context.clone(), |last| last.context(self.context));
        let end = end.with_window(window);
        let at_end = match links.last() {
            _ if explained => 0.0,
            Some(last) => excess(&last.left_of_all(&end)),
            None => excess(&end.settle(window).2),
        };
        let (shape, left) = if at_end > 0.0 {
            let at_start = excess(&self.context.settle(window).2).max(f64::MIN_POSITIVE);
            (shape(&end)?, at_end / at_start)
        } else {
            (None, 0.0)
        };
        let error = (1.0 + at_end).sqrt();
        Ok(Chain { links, window, left, error, open, shape })
    }

    /// The best term without a name, and by how much it explains more than a chain, prices paid.
    fn unnamed(&self, chain: &Chain) -> Result<Option<(Refitted, f64)>> {
        let all = generic(&mut self.scope.clone(), self.context.dataset);
        let Ok(found) = round(self.context, self.held_out, &all, LATER, self.monitor) else {
            return Ok(None);
        };
        let Some(best) = found.leaders.into_iter().next() else { return Ok(None) };
        let window = found.window.min(chain.window);
        let (of_best, least) = squares(&best.context(self.context), window);
        let last = chain.links.last().map(|last| last.context(self.context));
        let (of_chain, other) =
            last.as_ref().map_or((f64::INFINITY, least), |last| squares(last, window));
        let more = (of_chain - of_best) / least.min(other) + chain.price() - best.price;
        Ok(Some((best, more)))
    }

    /// The verdict when named effects explain something.
    fn judge(&self, diagnosis: &mut Diagnosis, chain: Chain) -> Result<()> {
        let Some(first) = chain.links.first() else { return Ok(()) };
        diagnosis.verdict = Verdict::Missing;
        diagnosis.reason = format!(
            "{} takes the error on held-out runs from {:.2} to {:.2} times the noise",
            first.leader.effect,
            first.leader.held_out_error_before,
            first.leader.held_out_error_after
        );
        for link in &chain.links[1..] {
            let _ = write!(
                diagnosis.reason,
                ", {} after it to {:.2}",
                link.leader.effect, link.leader.held_out_error_after
            );
        }
        diagnosis.then = chain.links[1..].iter().map(|l| l.leader.clone()).collect();
        if chain.left == 0.0 && chain.links.len() == 1 {
            return Ok(());
        }
        self.monitor.stage("terms without a name", 0.9);
        let unnamed = self.unnamed(&chain)?;
        let better = unnamed.as_ref().is_some_and(|(_, more)| *more > CLOSE);
        let short = chain.error > REACHES && chain.left > NEGLIGIBLE;
        let endless = chain.open && chain.links.len() == TOGETHER;
        if better || endless || chain.left > LEAVES || short {
            diagnosis.verdict = Verdict::Unexplained;
            diagnosis.reason = match &unnamed {
                Some((best, _)) if better => format!(
                    "`{}` explains it better than any effect of the catalogue",
                    best.leader.snippet
                ),
                _ => format!(
                    "the best effects of the catalogue ({}) leave {:.0} % of the misfit, {:.2} times \
                     the noise",
                    chain
                        .links
                        .iter()
                        .map(|l| l.leader.effect.as_str())
                        .collect::<Vec<_>>()
                        .join(", "),
                    100.0 * chain.left,
                    chain.error
                ),
            };
            diagnosis.unnamed_explains_more = better;
            diagnosis.unnamed = unnamed.map(|(best, _)| best.leader);
        }
        diagnosis.shape = chain.shape;
        Ok(())
    }
}

/// The residual force where it shows most, if it is more than noise.
fn shape(context: &Context) -> Result<Option<ResidualMap>> {
    let maps = residual_maps(context)?;
    let count = maps.len() as f64;
    let most = maps.into_iter().min_by(|a, b| a.p_value.total_cmp(&b.p_value));
    Ok(most.filter(|map| map.p_value * count < UNMISTAKABLE))
}
