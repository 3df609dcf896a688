//! Explanations that leave something: of which effects a physicist would believe all the same.
//!
//! The law of a real rig lacks more than can be named. What does not reach the noise may still be
//! most of what is missing, or may be whatever bends to it. So sets of named effects are chosen
//! with as few independent residuals as those of the best resemble each other, and fitted; where
//! none is believed, one effect after another is. An effect is believed where its numbers are
//! clear by errors that count what is left ([`scores`](crate::fit::scores)), where parts of the
//! data, each by itself, give it the same numbers, small motions and large ones, too, and where it
//! takes a good part of what is left of held-out runs: what bends to a larger thing has the name
//! of another. What does as well in its place is said, and how large and how correlated that is
//! which is left.

use nalgebra::DMatrix;

use super::candidates::candidates;
use super::candidates::composed::proposed::ProposedSet;
use super::candidates::composed::sets::SetSearch;
use super::comparison::{ResidualMap, strongest_map};
use super::effect::RankedEffect;
use super::misfit::error_of;
use super::refit::{Precision, fitted};
use super::search::extended;
use super::settling::{Settled, settle};
use super::story::{Member, Question, Story};
use super::times::times;
use super::together::around_motion_of;
use super::tuning::Tuning;
use super::window::longest;
use crate::error::Result;
use crate::fit::column::Column;
use crate::fit::scores::{Fold, Scores};
use crate::fit::windowed::is_significant;

/// What is clear of what is missing, and what is not.
pub(super) struct InPart {
    /// Named effects that would be believed, fitted together; what does as well in the place of
    /// each is among its rivals.
    pub(super) members: Vec<RankedEffect>,
    /// What they explain and what they leave, in a sentence.
    pub(super) reason: String,
    /// The force that is left, where it shows most.
    pub(super) shape: Option<ResidualMap>,
}

/// The named effects all of which would be believed; `None` where not one is. `baseline` is the
/// story without a change. They are looked for on a part of the data; `all` asks the same of all.
///
/// # Errors
///
/// When a change does not fit the spec.
pub(super) fn in_part<'a>(
    question: &Question<'a, '_>,
    all: &Question<'a, '_>,
    baseline: &Story<'a>,
) -> Result<Option<InPart>> {
    let found = match of_sets(question, baseline)? {
        Some(found) => Some(found),
        None => one_after_another(question, baseline),
    };
    let Some((held, rivals)) = found else { return Ok(None) };
    let Some(held) = believed_by(all, held) else { return Ok(None) };
    Ok(Some(told(all, baseline, &held, rivals)))
}

/// A story with the numbers and errors that all data give it, where they determine any; `None`
/// where a member is doubtful then.
fn believed_by<'a>(all: &Question<'a, '_>, held: Story<'a>) -> Option<Story<'a>> {
    let settled = settle(held.model.thinned(all.model.data.most));
    let found = fitted(&settled, &settled.model.law, Precision::Ranking);
    let whole = found.and_then(|found| Held::at(settle(settled.model.with_law(found.law))));
    let Some(whole) = whole else { return Some(held) };
    let story = whole.story(&held);
    (!whole.is_doubtful(&story, all.model.tuning())).then_some(story)
}

/// A story all of whose members would be believed, and what does as well in the place of each.
type Believed<'a> = (Story<'a>, Vec<Vec<String>>);

/// One named effect after another.
fn one_after_another<'a>(
    question: &Question<'a, '_>,
    baseline: &Story<'a>,
) -> Option<Believed<'a>> {
    let tuning = question.model.tuning();
    let mut story = baseline.clone();
    let mut held = None;
    let mut rivals: Vec<Vec<String>> = Vec::new();
    while story.members.len() < tuning.verdict.effects && !question.monitor.stopped() {
        let all = tuning.ranking.first_refits;
        let longer = extended(question, &story, (all, all));
        let tried = longer.into_iter().filter_map(|longer| Tried::of(question, &story, longer));
        let Some((best, others)) = clearest(tried.collect(), tuning) else { break };
        (story, held) = (best.plain, Some(best.held));
        rivals.push(others);
    }
    held.map(|held| (held, rivals))
}

/// Sets of named effects, chosen by what counts what they leave; found anew around the motion of
/// the best as long as that makes another the best.
fn of_sets<'a>(question: &Question<'a, '_>, baseline: &Story<'a>) -> Result<Option<Believed<'a>>> {
    let tuning = question.model.tuning();
    let mut scope = question.scope.clone();
    let all = candidates(&mut scope, &question.model.data.dataset, &tuning.candidates);
    let Some(mut search) = SetSearch::in_part(&baseline.model, &all) else { return Ok(None) };
    let mut window = search.window();
    let mut proposed = search.look(None, question.monitor).proposed(question.scope)?;
    let mut asked: Vec<Vec<String>> = Vec::new();
    let mut found: Vec<(ProposedSet, Tried)> = Vec::new();
    for _ in 0..tuning.sets.looks {
        let before = asked.len();
        let mut least = f64::INFINITY;
        let (without, _) = baseline.squares(window, &baseline.model.noise());
        for set in proposed {
            // What costs more than one that is believed is its rival at most.
            if set.cost > least + tuning.ranking.indistinguishable {
                break;
            }
            let Some(story) = Story::of_set(baseline, &set, (window, without))? else { continue };
            if asked.contains(&story.labels()) || question.monitor.stopped() {
                continue;
            }
            asked.push(story.labels());
            if let Some(tried) = Tried::of(question, baseline, story) {
                if tried.is_believed {
                    least = least.min(set.cost);
                }
                found.push((set, tried));
            }
        }
        let prices = prices(question, found.iter().map(|(_, tried)| tried));
        let mut priced: Vec<_> = prices.into_iter().zip(std::mem::take(&mut found)).collect();
        // Of two that are one law the first of the catalogue is told.
        let price = |price: f64| (price.ln() / SAME).round();
        priced.sort_by(|(a, (one, _)), (b, (other, _))| {
            price(*a).total_cmp(&price(*b)).then(one.places().cmp(&other.places()))
        });
        found = priced.into_iter().map(|(_, one)| one).collect();
        let Some((set, best)) = found.iter().find(|(_, one)| one.is_believed) else { break };
        if asked.len() == before || question.monitor.stopped() {
            break;
        }
        window = best.held.model.law.window().min(tuning.in_part.window).max(search.window());
        let around = around_motion_of(set, &best.held, window);
        proposed = search.look(Some(&around), question.monitor).proposed(question.scope)?;
    }
    let mut found: Vec<Tried> = found.into_iter().map(|(_, tried)| tried).collect();
    let Some(place) = found.iter().position(|one| one.is_believed) else { return Ok(None) };
    if found[..place].iter().any(|better| better.unknowns() <= found[place].unknowns()) {
        return Ok(None);
    }
    let best = found.remove(place);
    found.retain(|one| one.is_believed);
    let others = found;
    let rivals = best.held.members.iter().map(|member| best.instead_of(member, &others, tuning));
    let rivals = rivals.collect();
    Ok(Some((best.held, rivals)))
}

/// What is told of a story that is believed.
fn told<'a>(
    question: &Question<'a, '_>,
    baseline: &Story<'a>,
    held: &Story<'a>,
    rivals: Vec<Vec<String>>,
) -> InPart {
    let window = held.model.law.window();
    let baseline = baseline.with_noise(held.model.noise()).over(window);
    let (before, after) = (held_out_error(question, &baseline), held_out_error(question, held));
    let members = held.members.iter().zip(rivals).map(|(member, rivals)| RankedEffect {
        held_out_error_before: before,
        held_out_error_after: after,
        indistinguishable: rivals,
        ..member.effect.clone()
    });
    let members: Vec<RankedEffect> = members.collect();
    let names: Vec<&str> = members.iter().map(|member| member.effect.as_str()).collect();
    let (take, is) = if names.len() == 1 { ("takes", "is") } else { ("take", "are") };
    let mut reason = format!(
        "{} {take} the error on held-out runs from {} to {} times the noise, and {is} clear by \
         standard errors that count what is left",
        names.join(" and "),
        times(before),
        times(after)
    );
    if let Some((observable, correlation)) = most_alike(held) {
        reason += &format!(
            "; that is no noise: what is left of {observable} is from one sample to the next the \
             same to {correlation:.2} (correlation)"
        );
    }
    InPart { members, reason, shape: strongest_map(&held.model).ok().flatten() }
}

/// The observable whose residuals are most like those of the next sample, and their correlation;
/// `None` where none are, by more than chance.
fn most_alike(story: &Story) -> Option<(String, f64)> {
    let neighbours = settle(story.model.clone()).what_is_left().neighbours;
    let alike = neighbours
        .into_iter()
        .filter(|(_, correlation, pairs)| is_significant(*correlation, *pairs));
    let most = alike.max_by(|a, b| a.1.total_cmp(&b.1));
    most.map(|(observable, correlation, _)| (observable, correlation.min(1.0)))
}

/// A story with more effects than one before, and what it leaves.
struct Tried<'a> {
    /// As it was found.
    plain: Story<'a>,
    /// With the numbers that determine it best, and errors that count what is left.
    held: Story<'a>,
    /// How many times the variances of its numbers are those of independent residuals of the size
    /// of the noise.
    inflation: f64,
    /// Squares beyond the noise that it leaves of held-out runs, in those that the story before
    /// leaves.
    left: f64,
    /// Whether all of its members are clear, and leave little enough of held-out runs beside a
    /// story without them.
    is_believed: bool,
}

impl<'a> Tried<'a> {
    /// `None` where its numbers are not determined, or the motion is lost.
    fn of(question: &Question<'a, '_>, before: &Story<'a>, plain: Story<'a>) -> Option<Tried<'a>> {
        let tuning = question.model.tuning();
        let best = Held::of(&plain, tuning)?;
        let held = best.story(&plain);
        let is_doubtful = held.bends_a_curve_twice() || best.is_doubtful(&held, tuning);
        let members = before.members.len();
        let shorter = before.with_noise(held.model.noise()).over(held.model.law.window());
        let (before, after) = (held_out_error(question, &shorter), held_out_error(question, &held));
        let excess = |error: f64| (error.powi(2) - 1.0).max(0.0);
        // Where the model before loses the motion, its error is no number.
        let left = if before.is_nan() { 0.0 } else { excess(after) / excess(before) };
        let added = plain.members.iter().skip(members);
        let added: usize = added.map(|member| member.effect.coefficient.len()).sum();
        let is_believed = !is_doubtful && left < tuning.in_part.left.powi(added as i32);
        let tried = Tried { plain, held, inflation: best.inflation, left, is_believed };
        after.is_finite().then_some(tried)
    }

    fn unknowns(&self) -> usize {
        self.plain.members.iter().map(|member| member.effect.coefficient.len()).sum()
    }

    /// What does as well in the place of a member: what another story has there.
    fn instead_of(&self, member: &Member, others: &[Tried<'a>], tuning: &Tuning) -> Vec<String> {
        let (own, place) = (self.held.labels(), &member.effect.effect);
        let one = |other: &Tried| {
            let theirs = other.held.labels();
            let kept = own.iter().filter(|label| theirs.contains(label)).count();
            let mut new = theirs.into_iter().filter(|label| !own.contains(label));
            let exchanged = kept + 1 == own.len() && !other.held.labels().contains(place);
            new.next().filter(|_| exchanged && new.next().is_none())
        };
        let alike = others.iter().filter(|other| other.unknowns() == self.unknowns());
        let named = alike.filter_map(|other| Some((one(other)?, other)));
        let close = |other: &Tried<'a>| self.behind(other) < tuning.ranking.indistinguishable;
        named.filter(|(_, other)| close(other)).map(|(label, _)| label).collect()
    }

    /// By how many squares another story leaves more over the segments of this one, in units of
    /// what one of them says.
    fn behind(&self, other: &Tried<'a>) -> f64 {
        let (noise, window) = (self.held.model.noise(), self.held.model.law.window());
        let (own, _) = self.held.squares(window, &noise);
        let (theirs, _) = other.held.with_noise(noise.clone()).over(window).squares(window, &noise);
        (theirs - own) / self.inflation
    }
}

/// What each of some stories leaves of held-out runs over the longest segments that determine the
/// numbers of one of them, where each of its numbers has to take a part of that.
fn prices<'a: 't, 't>(
    question: &Question<'a, '_>,
    all: impl Iterator<Item = &'t Tried<'a>> + Clone,
) -> Vec<f64> {
    let left = question.model.tuning().in_part.left;
    let believed = all.clone().filter(|one| one.is_believed);
    let longest = believed.max_by_key(|one| one.held.model.law.window());
    let Some(longest) = longest.map(|one| &one.held.model) else {
        return vec![f64::INFINITY; all.count()];
    };
    let price = |one: &Tried<'a>| {
        let story = one.held.with_noise(longest.noise()).over(longest.law.window());
        let error = held_out_error(question, &story);
        let price = (error.powi(2) - 1.0).max(f64::MIN_POSITIVE) / left.powi(one.unknowns() as i32);
        if price.is_nan() { f64::INFINITY } else { price }
    };
    all.map(price).collect()
}

/// The story that is told of some: of those with the fewest numbers that which leaves least of
/// held-out runs; and what does as well in the place of its last effect. What has more numbers
/// bends to what nothing explains.
fn clearest<'a>(tried: Vec<Tried<'a>>, tuning: &Tuning) -> Option<(Tried<'a>, Vec<String>)> {
    let (mut tried, doubtful): (Vec<Tried>, Vec<Tried>) =
        tried.into_iter().partition(|one| one.is_believed);
    let fewest = tried.iter().map(Tried::unknowns).min()?;
    tried.retain(|one| one.unknowns() == fewest);
    let least = tried.iter().enumerate().min_by(|(_, a), (_, b)| a.left.total_cmp(&b.left));
    let best = tried.remove(least.map_or(0, |(place, _)| place));
    let is_better = |one: &Tried| one.unknowns() <= fewest && one.left < best.left;
    if doubtful.iter().any(is_better) {
        return None;
    }
    let rivals = tried.iter().filter(|one| best.behind(one) < tuning.ranking.indistinguishable);
    let last = |one: &Tried| one.plain.members.last().map(|last| last.effect.effect.clone());
    let rivals = rivals.filter_map(last).collect();
    Some((best, rivals))
}

/// A story's numbers from the segments that determine them best.
struct Held<'a> {
    settled: Settled<'a>,
    scores: Scores,
    /// Covariance of all numbers, which counts what is left.
    covariance: DMatrix<f64>,
    /// How many times those are the variances of independent residuals of the size of the noise.
    inflation: f64,
}

impl<'a> Held<'a> {
    /// Over segments from the story's own to such that each part of the data has a few; `None`
    /// where none of them determine its numbers.
    fn of(story: &Story<'a>, tuning: &Tuning) -> Option<Held<'a>> {
        let most = story.model.data.packed.samples() / tuning.in_part.segments;
        let most = most.min(longest(&story.model)).max(2);
        let mut window = story.model.law.window().min(most);
        let mut best: Option<Held> = None;
        let mut law = story.model.law.clone();
        loop {
            let settled = settle(story.model.with_law(law.with_window(window)));
            let found = fitted(&settled, &settled.model.law, Precision::Ranking);
            let Some(found) = found.filter(|_| settled.sums.diverged == 0) else { break };
            law = found.law;
            let held = Held::at(settle(settled.model.with_law(law.clone())));
            let better = |held: &Held| best.as_ref().is_none_or(|best| held.tells_more(best));
            if let Some(held) = held.filter(better) {
                best = Some(held);
            }
            if window >= most {
                break;
            }
            window = (2 * window).min(most);
        }
        best
    }

    fn at(settled: Settled<'a>) -> Option<Held<'a>> {
        let scores = settled.scores();
        let (covariance, plain) = (scores.covariance()?, scores.inverse()?);
        let ratios = (0..covariance.nrows()).map(|i| (covariance[(i, i)] / plain[(i, i)]).ln());
        let inflation = (ratios.sum::<f64>() / covariance.nrows().max(1) as f64).exp();
        Some(Held { settled, scores, covariance, inflation })
    }

    /// Whether numbers are better known here, by the mean of the logarithms of their variances.
    fn tells_more(&self, other: &Held) -> bool {
        let (own, others) = (self.covariance.diagonal(), other.covariance.diagonal());
        let ratios = own.iter().zip(&others).map(|(a, b)| (a / b).ln());
        ratios.filter(|ratio| ratio.is_finite()).sum::<f64>() < 0.0
    }

    /// A story with the numbers, segments and errors of these.
    fn story(&self, story: &Story<'a>) -> Story<'a> {
        let variances = self.covariance.diagonal();
        let error = |at: Column| variances.get(at.position()).map_or(f64::NAN, |v| v.sqrt());
        story.held_by(&self.settled, error)
    }

    /// Whether a number of a member is not clear, not the same in all parts of the data, or of the
    /// wrong sign; or whether a member has no name.
    fn is_doubtful(&self, story: &Story, tuning: &Tuning) -> bool {
        let folds: Vec<Fold> = self.scores.folds().into_iter().flatten().collect();
        let clear = tuning.in_part.standard_errors;
        folds.len() < 2
            || story.beliefs().iter().any(|member| {
                let agree = |one: &(f64, Column)| folds.iter().all(|fold| self.agrees(fold, *one));
                member.clearness < clear
                    || !member.coefficients.iter().all(agree)
                    || member.is_simpler_where_equal && self.apart(&member.coefficients) < clear
            })
    }

    /// Standard errors by which two coefficients differ.
    fn apart(&self, coefficients: &[(f64, Column)]) -> f64 {
        let &[(one, first), (other, second)] = coefficients else { return f64::INFINITY };
        let (first, second) = (first.position(), second.position());
        let variance = |row, column| self.covariance[(row, column)];
        let squared =
            variance(first, first) + variance(second, second) - 2.0 * variance(first, second);
        (one - other).abs() / squared.max(0.0).sqrt()
    }

    /// Whether a part of the data gives a coefficient about the value that all data give it, as far
    /// as it tells: no more than a half off, which keeps its sign.
    fn agrees(&self, fold: &Fold, (value, column): (f64, Column)) -> bool {
        let column = column.position();
        let error = (self.inflation * fold.inverse[(column, column)]).sqrt();
        let off = fold.step[column].abs();
        off < OFF * value.abs() || off < ERRORS * error
    }
}

/// Prices of two sets that are one law differ by this part, at most.
const SAME: f64 = 1e-3;

/// Part of its size that a coefficient may be off in a part of the data.
const OFF: f64 = 0.5;

/// Standard errors within which a part of the data tells no other value.
const ERRORS: f64 = 3.0;

/// Error on held-out runs over segments of a story's window.
fn held_out_error<'a>(question: &Question<'a, '_>, story: &Story<'a>) -> f64 {
    error_of(&settle(story.model.with_data(question.held_out)).sums).0
}
