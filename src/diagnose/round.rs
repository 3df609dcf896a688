//! One round of asking: every candidate is scored, the best are refitted in full and ranked.

use super::candidates::Candidate;
use super::compare::{error, error_of};
use super::context::{Context, Settled};
use super::leader::{Care, Refitted, Start, refit};
use super::scan::{FEW, Scored, scan};
use crate::data::Dataset;
use crate::error::Result;
use crate::fit::Monitor;
use crate::fit::course::{FOLLOWS, LONGEST};
use crate::fit::segments::longest_run;

/// Chance below which an effect is there, all tries paid for.
pub(super) const SIGNIFICANT: f64 = 1e-3;
/// Deviances closer than this cannot be told apart (odds of 20 to 1).
pub(super) const CLOSE: f64 = 6.0;
/// Deviances closer than this are the same: fits for the ranking leave about as much.
pub(super) const SAME: f64 = 0.25;
/// Leaders within this part of the best merit, or that much of it, are fitted to all the data,
/// so many at most.
const NEAR: f64 = 0.01;
const MARGIN: f64 = 50.0;
const FINISHED: usize = 4;
/// Leaders that explain this part of what the best does are refitted when the segments grow; what
/// the others are worth is clear.
const FOLLOWED: f64 = 0.75;
/// Errors in units of the noise at which a model is no first approximation any more.
const STRAYS: f64 = 10.0;

/// What one round found.
pub struct Round {
    /// The refitted candidates, the best first.
    pub leaders: Vec<Refitted>,
    /// How many of them, the first included, explain equally well.
    pub close: usize,
    /// Variance of the weighted residuals where the most is explained: the yardstick of merits.
    pub variance: f64,
    /// Samples of a segment when they were ranked.
    pub window: usize,
    /// Error of the model before held-out runs, over such segments.
    pub before: f64,
    /// Candidates times grid points.
    pub tried: usize,
}

/// Candidates being refitted on segments of one length.
struct Field<'a, 'b> {
    settled: &'b Settled<'a>,
    few: Option<&'b Settled<'a>>,
    variance: f64,
    all: &'b [Candidate],
}

/// Scores all candidates, refits the significant ones (`most` of them) and ranks them.
///
/// A small effect needs time to show. Where nothing is significant, the segments grow beyond
/// those that the model was trained on, until something is. With the best of the candidates in
/// it the model may follow the measurements for longer: then the segments grow as well, and all
/// are refitted on the longer ones.
pub fn round(
    context: &Context,
    held_out: &Dataset,
    all: &[Candidate],
    most: usize,
    monitor: &dyn Monitor,
) -> Result<Round> {
    let mut context = context.clone();
    let held_out = context.with_data(held_out);
    let (mut settled, mut few) = on_part_and_all(&context);
    let mut scores = scan(&settled, few.as_ref(), all)?;
    let mut tried = scores.tried;
    while !scores.scored.iter().any(|s| s.p_value < SIGNIFICANT) && !monitor.stopped() {
        let Some(window) = beyond(&context) else { break };
        context = context.with_window(window);
        (settled, few) = on_part_and_all(&context);
        scores = scan(&settled, few.as_ref(), all)?;
        tried += scores.tried;
    }
    // Every length that was tried is paid for.
    let lengths = tried as f64 / scores.tried.max(1) as f64;
    let found = scores.scored.iter().filter(|s| lengths * s.p_value < SIGNIFICANT).take(most);
    let start = |s: &Scored| Ok((s.candidate, Start::scored(&context, &all[s.candidate], s)?));
    let mut starts = found.map(start).collect::<Result<Vec<(usize, Start)>>>()?;
    let mut behind = Vec::new();
    loop {
        if settled.context.law.window() != context.law.window() {
            (settled, few) = on_part_and_all(&context);
        }
        let field = Field { settled: &settled, few: few.as_ref(), variance: scores.variance, all };
        let mut fitted = field.fitted(starts, monitor);
        fitted.append(&mut behind);
        if let Some(few) = field.few {
            // A part of the data tells whether longer segments are followed.
            let merit = |l: &Refitted| l.merit(l.variance);
            let best = fitted.iter().max_by(|(_, a), (_, b)| merit(a).total_cmp(&merit(b)));
            let window = best.map_or(context.law.window(), |(_, best)| grown(best, few));
            if window > context.law.window() && !monitor.stopped() {
                let enough = FOLLOWED * best.map_or(0.0, |(_, best)| merit(best));
                let (near, far): (Vec<_>, Vec<_>) =
                    fitted.into_iter().partition(|(_, l)| merit(l) >= enough);
                behind = far;
                starts = near.into_iter().map(|(c, l)| (c, Start::from(l))).collect();
                context = context.with_window(window);
                continue;
            }
        }
        let held_out = held_out.with_window(context.law.window());
        let (held_out, few_held_out) = on_part_and_all(&held_out);
        let leaders = field.judged(fitted, &held_out, few_held_out.as_ref());
        let window =
            leaders.first().map_or(context.law.window(), |(_, best)| grown(best, &settled));
        if window == context.law.window() || monitor.stopped() {
            return Ok(field.rank(leaders, &held_out, tried));
        }
        starts = leaders.into_iter().map(|(c, leader)| (c, Start::from(leader))).collect();
        context = context.with_window(window);
    }
}

/// The model before all of some data, and before a part of them where there are many.
fn on_part_and_all<'a>(context: &Context<'a>) -> (Settled<'a>, Option<Settled<'a>>) {
    let many = context.dataset.samples().min(context.most) > FEW;
    (context.settled(), many.then(|| context.thinned(FEW).settled()))
}

impl Field<'_, '_> {
    /// Refits from some starts.
    fn fitted(&self, starts: Vec<(usize, Start)>, monitor: &dyn Monitor) -> Vec<(usize, Refitted)> {
        let count = starts.len().max(1) as f64;
        let fitted = starts.into_iter().enumerate().filter_map(|(i, (candidate, start))| {
            monitor.stage("refitting the leaders", 0.3 + 0.5 * i as f64 / count);
            let refitted = refit(self.settled, self.few, &self.all[candidate], start)?;
            Some((candidate, refitted))
        });
        fitted.collect()
    }

    /// What they leave of the data, or of a part of them; the best are fitted to all, and judged
    /// by all. Best first.
    fn judged(
        &self,
        mut leaders: Vec<(usize, Refitted)>,
        held_out: &Settled,
        few_held_out: Option<&Settled>,
    ) -> Vec<(usize, Refitted)> {
        let usable = |l: &Refitted| l.fall.is_finite() && l.fall > 0.0;
        for (_, leader) in &mut leaders {
            match self.few {
                Some(few) if !leader.is_finished() => {
                    leader.judge_by(few, few_held_out.unwrap_or(held_out), self.settled, held_out);
                }
                _ => leader.judge(self.settled, held_out),
            }
        }
        leaders.retain(|(_, leader)| leader.fall.is_finite());
        let variance = self.yardstick(leaders.iter().map(|(_, l)| l));
        leaders.sort_by(|(_, a), (_, b)| b.merit(variance).total_cmp(&a.merit(variance)));
        let best = leaders.first().map_or(0.0, |(_, l)| l.merit(variance));
        // What a part of the data says of a small effect is rough.
        let rough = (self.settled.context.dataset.samples() as f64 / FEW as f64).max(1.0);
        leaders
            .into_iter()
            .enumerate()
            .filter_map(|(place, (candidate, l))| {
                let near = best - l.merit(variance) < (MARGIN * rough).max(NEAR * best);
                if place > 0 && (place >= FINISHED || !near) {
                    return usable(&l).then_some((candidate, l));
                }
                let care = if place > 0 { Care::Ranking } else { Care::Full };
                let l = l.finish(self.settled, &self.all[candidate], held_out, care)?;
                usable(&l).then_some((candidate, l))
            })
            .collect()
    }

    /// What is left where the most is explained.
    fn yardstick<'l>(&self, leaders: impl Iterator<Item = &'l Refitted>) -> f64 {
        let least = leaders.map(|l| l.variance).fold(f64::INFINITY, f64::min);
        if least.is_finite() { least.max(f64::MIN_POSITIVE) } else { self.variance }
    }

    fn rank(&self, mut leaders: Vec<(usize, Refitted)>, held_out: &Settled, tried: usize) -> Round {
        let variance = self.yardstick(leaders.iter().map(|(_, l)| l));
        let (before, _) = error_of(&held_out.sums);
        // What a full fit does not keep, or held-out runs do not thank for, is not missing.
        let pays = |l: &Refitted| l.leader.held_out_error_after < l.leader.held_out_error_before;
        leaders.retain(|(_, l)| l.merit(variance) > 0.0 && (pays(l) || before.is_nan()));
        if leaders.iter().any(|(_, l)| !l.pinned) {
            leaders.retain(|(_, l)| !l.pinned);
        }
        leaders.iter_mut().for_each(|(_, l)| l.leader.deviance = l.fall / variance);
        leaders.sort_by(|(_, a), (_, b)| b.evidence(variance).total_cmp(&a.evidence(variance)));
        let best = leaders.first().map_or(0.0, |(_, l)| l.evidence(variance));
        let behind = |l: &Refitted| best - l.evidence(variance);
        // Of those that explain equally well the one with the fewest unknowns comes first, and of
        // two names for the same motion the one that comes first in the catalogue: rounding does
        // not choose.
        let close = leaders.iter().take_while(|(_, l)| behind(l) < CLOSE).count();
        leaders[..close].sort_by_key(|(candidate, l)| {
            (l.leader.coefficient.len(), (behind(l) / SAME) as usize, *candidate)
        });
        let leaders = leaders.into_iter().map(|(_, leader)| leader).collect();
        let window = self.settled.context.law.window();
        Round { leaders, close, variance, window, before, tried }
    }
}

/// Twice as long segments, if the model keeps to all of them; `None` where it does not, or where
/// there are none.
pub(super) fn beyond(context: &Context) -> Option<usize> {
    let window = (2 * context.law.window()).min(longest_run(context.dataset).min(LONGEST));
    if window <= context.law.window() {
        return None;
    }
    let (_, lost) = error(context, context.law.window());
    let (far, more) = error(context, window);
    (more <= lost && far < STRAYS).then_some(window)
}

/// The longest segments, in samples, that the model with a leader follows as well as those half as
/// long.
fn grown(leader: &Refitted, settled: &Settled) -> usize {
    let context = leader.context(&settled.context);
    let longest = longest_run(context.dataset).min(LONGEST);
    let mut window = context.law.window();
    if window >= longest {
        return window;
    }
    let (mut present, mut lost) = error_of(&leader.left(settled));
    while window < longest {
        let next = (2 * window).min(longest);
        let (longer, more) = error(&context, next);
        if more > lost || longer.is_nan() || longer > FOLLOWS * present.max(1.0) {
            break;
        }
        (window, present, lost) = (next, longer, more);
    }
    window
}
