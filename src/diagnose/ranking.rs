//! Candidates scored, the significant ones refitted in full, and ranked.

use super::candidates::Candidate;
use super::evidence::Judged;
use super::law_on_data::{LawOnData, Measurements};
use super::misfit::error_of;
use super::refit::{Precision, Refit, Start, fitted_from_afar, refit, refit_whole};
use super::scan::{Scored, significant};
use super::settling::{Parts, Settled, settle, settle_parts};
use super::tuning;
use super::window::followed;
use crate::error::Result;
use crate::fit::Monitor;

/// What asking all candidates found.
pub struct Ranking {
    /// The refitted candidates, the best first.
    pub effects: Vec<Judged>,
    /// How many of them, the first included, explain equally well.
    pub close: usize,
    /// Samples of a segment when they were ranked.
    pub window: usize,
    /// Error of the model before held-out runs, over such segments.
    pub before: f64,
    /// Candidates times grid points.
    pub tests: usize,
}

/// Scores all candidates, refits the significant ones (`most` of them) and ranks them.
///
/// # Errors
///
/// When the data do not suffice to score anything.
pub(super) fn ranking<'a>(
    model: &LawOnData<'a>,
    held_out: &Measurements<'a>,
    candidates: &[Candidate],
    most: usize,
    monitor: &dyn Monitor,
) -> Result<Ranking> {
    let scored = significant(model, candidates, monitor)?;
    let at = &scored.data.all.model;
    let start = |s: &Scored| Ok((s.candidate, Start::scored(at, &candidates[s.candidate], s)?));
    let starts = scored.best.iter().take(most).map(start).collect::<Result<Vec<_>>>()?;
    let held_out = model.with_data(held_out);
    let field = Field { candidates, held_out, variance: scored.variance, monitor };
    let refitted = field.refitted(scored.data, starts);
    Ok(rank(refitted, scored.variance, scored.tests))
}

/// What refits have in common.
struct Field<'a, 'b> {
    candidates: &'b [Candidate],
    /// The model before held-out runs.
    held_out: LawOnData<'a>,
    /// Variance of the weighted residuals as scores tell it.
    variance: f64,
    monitor: &'b dyn Monitor,
}

/// Refits of some candidates, by their places in the list, on segments of one length.
struct Refitted<'a> {
    judged: Vec<(usize, Judged)>,
    data: Parts<'a>,
    held_out: Parts<'a>,
}

impl<'a> Field<'a, '_> {
    /// Refits from some starts. With the best of the candidates in it the model may follow the
    /// measurements for longer: then segments grow, and all are refitted on the longer ones.
    fn refitted(&self, mut data: Parts<'a>, mut starts: Vec<(usize, Start)>) -> Refitted<'a> {
        let mut set_aside = Vec::new();
        loop {
            let window = data.all.model.law.window();
            let mut fitted = self.fitted(&data, starts);
            fitted.append(&mut set_aside);
            if let Some(part) = &data.part {
                // A part of the data tells whether longer segments are followed.
                let deviance = |(_, refit): &(usize, Refit)| refit.fall / refit.variance;
                let best = fitted.iter().max_by(|a, b| deviance(a).total_cmp(&deviance(b)));
                let longer = best.map_or(window, |(_, best)| followed(best, part));
                if longer > window && !self.monitor.stopped() {
                    let part = self.held_out.tuning().ranking.refitted_part;
                    let enough = part * best.map_or(0.0, deviance);
                    let (near, far): (Vec<_>, Vec<_>) =
                        fitted.into_iter().partition(|one| deviance(one) >= enough);
                    set_aside = far;
                    starts = near.into_iter().map(|(c, refit)| (c, refit.into())).collect();
                    data = settle_parts(data.all.model.with_window(longer));
                    continue;
                }
            }
            let held_out = settle_parts(self.held_out.with_window(window));
            let judged = self.judged(fitted, &data, &held_out);
            let best = judged.first();
            let longer = best.map_or(window, |(_, best)| followed(&best.refit, &data.all));
            if longer == window || self.monitor.stopped() {
                let judged = self.simpler_again(judged, &data, &held_out);
                return Refitted { judged, data, held_out };
            }
            starts = judged.into_iter().map(|(c, judged)| (c, judged.refit.into())).collect();
            data = settle_parts(data.all.model.with_window(longer));
        }
    }

    /// Refits from some starts, on segments of one length.
    fn fitted(&self, data: &Parts, starts: Vec<(usize, Start)>) -> Vec<(usize, Refit)> {
        let count = starts.len().max(1) as f64;
        let fitted = starts.into_iter().enumerate().filter_map(|(i, (candidate, start))| {
            if i > 0 && self.monitor.stopped() {
                return None;
            }
            self.monitor.stage("refitting the leaders", 0.3 + 0.5 * i as f64 / count);
            Some((candidate, refit(data, &self.candidates[candidate], start)?))
        });
        fitted.collect()
    }

    /// What they leave of the data, or of a part of them; the best are fitted to all, and judged
    /// by all. Best first.
    fn judged(
        &self,
        fitted: Vec<(usize, Refit)>,
        data: &Parts,
        held_out: &Parts,
    ) -> Vec<(usize, Judged)> {
        let tuning = &data.all.model.tuning().ranking;
        let usable = |judged: &Judged| judged.fall.is_finite() && judged.fall > 0.0;
        let judged = fitted.into_iter().map(|(c, refit)| (c, Judged::of(refit, data, held_out)));
        let mut judged: Vec<_> = judged.filter(|(_, judged)| judged.fall.is_finite()).collect();
        let variance = yardstick(&judged, self.variance);
        judged.sort_by(|(_, a), (_, b)| b.merit(variance).total_cmp(&a.merit(variance)));
        let best = judged.first().map_or(0.0, |(_, judged)| judged.merit(variance));
        // What a part of the data says of a small effect is rough.
        let samples = data.all.model.data.dataset.samples() as f64;
        let rough = (samples / data.all.model.tuning().scan.samples as f64).max(1.0);
        let within = (tuning.finish_within * rough).max(tuning.finish_within_part * best);
        let finished = judged.into_iter().enumerate().filter_map(|(place, (c, judged))| {
            let near = best - judged.merit(variance) < within;
            let left = place > 0 && (place >= tuning.finished || !near);
            if left || judged.refit.whole || place > 0 && self.monitor.stopped() {
                return usable(&judged).then_some((c, judged));
            }
            let precision = if place > 0 { Precision::Ranking } else { Precision::Full };
            let start = judged.refit.into();
            let refit = refit_whole(&data.all, &self.candidates[c], start, precision)?;
            let judged = Judged::by(refit, &data.all, &held_out.all);
            usable(&judged).then_some((c, judged))
        });
        finished.collect()
    }

    /// Simpler candidates on the coordinates of the best one start once more: from numbers that
    /// short segments give, and the states that the best one has found. What is linear over a whole
    /// run without the effect may lie where the simpler one, which has fewer ways to go, does not
    /// find out.
    fn simpler_again(
        &self,
        judged: Vec<(usize, Judged)>,
        data: &Parts<'a>,
        held_out: &Parts,
    ) -> Vec<(usize, Judged)> {
        let variance = yardstick(&judged, self.variance);
        let merit = |one: &Judged| one.merit(variance);
        let unknowns = |one: &Judged| one.refit.effect.coefficient.len();
        let all = judged.iter().map(|(_, one)| one);
        let Some(best) = all.max_by(|a, b| merit(a).total_cmp(&merit(b))) else { return judged };
        let (most, on) = (unknowns(best), best.refit.effect.on.clone());
        let least = merit(best) - data.all.model.tuning().ranking.indistinguishable;
        let behind =
            |one: &Judged| unknowns(one) < most && merit(one) < least && one.refit.effect.on == on;
        if !judged.iter().any(|(_, one)| behind(one)) {
            return judged;
        }
        let Settled { model, segments, sums, .. } = &data.all;
        let states = settle(best.refit.on(model)).states;
        let (model, segments, sums) = (model.clone(), segments.clone(), sums.clone());
        let start = Settled { model, segments, states, sums };
        let again = |candidate: usize, one: &Judged| {
            let near = fitted_from_afar(&one.refit.on(&start.model));
            let from = Start::again(&one.refit, near.map(|model| model.law));
            let candidate = &self.candidates[candidate];
            let refit = refit_whole(&start, candidate, from, Precision::Ranking)?;
            let again = Judged::by(refit, &data.all, &held_out.all);
            (again.fall > one.fall).then_some(again)
        };
        let each = judged.into_iter().map(|(candidate, one)| {
            let tried = behind(&one) && !self.monitor.stopped();
            let better = if tried { again(candidate, &one) } else { None };
            (candidate, better.unwrap_or(one))
        });
        each.collect()
    }
}

/// What is left where the most is explained; `otherwise` where nothing is.
fn yardstick(judged: &[(usize, Judged)], otherwise: f64) -> f64 {
    let least = judged.iter().map(|(_, judged)| judged.variance).fold(f64::INFINITY, f64::min);
    if least.is_finite() { least.max(f64::MIN_POSITIVE) } else { otherwise }
}

/// Those that pay, in the order of their evidence.
fn rank(refitted: Refitted, scored: f64, tests: usize) -> Ranking {
    let Refitted { judged: mut effects, data, held_out } = refitted;
    let variance = yardstick(&effects, scored);
    let tuning: &tuning::Ranking = &data.all.model.tuning().ranking;
    let (before, _) = error_of(&held_out.all.sums);
    // What a full fit does not keep, or held-out runs do not thank for, is not missing.
    let pays = |judged: &Judged| {
        let effect = &judged.refit.effect;
        effect.held_out_error_after < effect.held_out_error_before
    };
    effects.retain(|(_, one)| one.merit(variance) > 0.0 && (pays(one) || before.is_nan()));
    effects.retain(|(_, one)| !one.refit.contradicts_name());
    if effects.iter().any(|(_, one)| !one.refit.at_bound) {
        effects.retain(|(_, one)| !one.refit.at_bound);
    }
    effects.iter_mut().for_each(|(_, one)| one.refit.effect.deviance = one.fall / variance);
    effects.sort_by(|(_, a), (_, b)| b.evidence(variance).total_cmp(&a.evidence(variance)));
    let best = effects.first().map_or(0.0, |(_, one)| one.evidence(variance));
    let behind = |one: &Judged| best - one.evidence(variance);
    // Of those that explain equally well the one with the fewest unknowns comes first, and of
    // two names for the same motion the one that comes first in the catalogue: rounding does
    // not choose.
    // Beside a large misfit, differences far below it are those of integrators and digits.
    let negligible = data.all.model.tuning().verdict.negligible * best;
    let (same, step) = (tuning.indistinguishable.max(negligible), tuning.same.max(negligible));
    let equal = |(_, one): &&(usize, Judged)| behind(one) < same;
    let close = effects.iter().take_while(equal).count();
    effects[..close].sort_by_key(|(candidate, one)| {
        let unknowns = one.refit.effect.coefficient.len();
        (unknowns, (behind(one) / step) as usize, *candidate)
    });
    let effects = effects.into_iter().map(|(_, one)| one).collect();
    let window = data.all.model.law.window();
    Ranking { effects, close, window, before, tests }
}
