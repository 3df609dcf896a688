//! The search over stories: sets of changes that are found together, or a beam of sets that are
//! extended, exchanged and shortened.

use super::candidates::composed::composed;
use super::candidates::{Candidate, candidates, left_out, unnamed};
use super::description::{agree_on_noise, description_lengths, sort_by_description_length};
use super::doubts::holds;
use super::evidence::Judged;
use super::naming::with_name;
use super::ranking::{Ranking, ranking};
use super::settling::settle;
use super::story::{Question, Story};
use super::together::together;
use super::tuning::Tuning;
use crate::error::Result;

/// Stories, the best first: at least that without a change.
///
/// `baseline` is the story without a change, `beam` are those of one change. Where none of these
/// holds by one number, or another describes the data clearly better than that, or one holds beside
/// a model that is at the noise already, sets of changes are found together, if the model can be
/// asked for them, and where nothing holds then, single terms without a name. A model that cannot
/// be asked for sets is searched as long as the best story does not explain the data over whole
/// runs: each of the leading stories is extended by the changes that pay most beside it. When that
/// has ended, each member of the best is taken out and looked for again among all candidates: while
/// others were missing, a more flexible change may have stood in for them.
///
/// # Errors
///
/// When a change does not fit the spec.
pub(super) fn stories<'a>(
    question: &Question<'a, '_>,
    baseline: &Story<'a>,
    mut beam: Vec<Story<'a>>,
) -> Result<Vec<Story<'a>>> {
    let all = question.model.tuning();
    let tuning = &all.verdict;
    let monitor = question.monitor;
    let mut ended: Vec<Story> = Vec::new();
    let mut grown = baseline.clone();
    grown.grow(question);
    let mut sets_asked = false;
    agree_on_noise(&mut beam);
    // Where the model explains the data as it is, and no change explains them better, there is
    // nothing to compose. Where one does, it may stand in for several: a steady motion hides the
    // drag and the drive that make it from each other; unless all that is left is what the steps of
    // the integrator leave. Beside a model that does not, one number that explains everything is no
    // accident; several in one change bend to what they are not.
    let asked = match grown.explains {
        true => !grown.model.at_steps && beam.iter().any(holds),
        false => !is_by_one_number(&beam, all),
    };
    if asked && !monitor.stopped() {
        if let Some(sets) = together(question, baseline)? {
            sets_asked = true;
            beam.extend(sets);
        }
        // Where no set holds, one term may still, once its numbers are fitted with more care.
        if !beam.iter().any(holds) && !monitor.stopped() {
            monitor.stage("terms without a name", 0.7);
            beam.extend(with_unnamed(question, baseline)?);
        }
    }
    agree_on_noise(&mut beam);
    sort_by_description_length(&mut beam, all);
    // Sets were held against their neighbours when they were chosen.
    if sets_asked {
        ended.append(&mut beam);
    }
    // What one more change costs, at least.
    let cheapest = beam.iter().map(Story::price).fold(f64::INFINITY, f64::min);
    for depth in 1..tuning.effects {
        let told = ended.iter().chain(&beam).filter(|story| holds(story));
        let least = told.map(Story::price).fold(f64::INFINITY, f64::min);
        let (open, done): (Vec<Story>, Vec<Story>) = std::mem::take(&mut beam)
            .into_iter()
            .partition(|story| !story.explains && story.price() + cheapest < least);
        ended.extend(done);
        if open.is_empty() || monitor.stopped() {
            ended.extend(open);
            break;
        }
        monitor.stage("what else is missing", 0.75 + 0.05 * depth as f64);
        let mut next: Vec<Story> = Vec::new();
        // Terms without a name can be bent to anything: they do not crowd out what has one.
        let (mut named, mut unnamed) = (0, 0);
        for story in open {
            let is_named = story.members.iter().all(|member| member.named);
            let (taken, most) = match is_named {
                true => (&mut named, tuning.beam),
                false => (&mut unnamed, tuning.unnamed_beam),
            };
            *taken += 1;
            if *taken > most || monitor.stopped() {
                ended.push(story);
                continue;
            }
            let longer = extended(question, &story, (all.ranking.later_refits, tuning.branches));
            if longer.is_empty() {
                ended.push(story);
            }
            for one in longer {
                if one.is_patchwork() {
                    // It grows no better by one more piece.
                    ended.push(one);
                } else if !next.iter().any(|other| other.labels() == one.labels()) {
                    next.push(one);
                }
            }
        }
        agree_on_noise(&mut next);
        sort_by_description_length(&mut next, all);
        beam = next;
    }
    ended.append(&mut beam);
    agree_on_noise(&mut ended);
    sort_by_description_length(&mut ended, all);
    // A story that holds is told before one that is shorter and explains less.
    ended.sort_by_key(|story| !holds(story));
    let alone = !sets_asked;
    if let Some(best) = ended.first().filter(|best| alone && holds(best) && best.members.len() > 1)
    {
        let best = exchanged(question, best.clone())?;
        ended.retain(|story| story.labels() != best.labels());
        ended.insert(0, best);
    }
    if let Some(best) = ended.first().filter(|best| holds(best))
        && let Some(named) = with_name(question, baseline, best)?
    {
        ended.insert(0, named);
    }
    ended.push(grown);
    Ok(ended)
}

/// Whether a story of one number holds, and none of more describes the data clearly better.
fn is_by_one_number(stories: &[Story], tuning: &Tuning) -> bool {
    let holding: Vec<&Story> = stories.iter().filter(|story| holds(story)).collect();
    let lengths = description_lengths(&holding, tuning);
    let least = lengths.iter().copied().fold(f64::INFINITY, f64::min);
    let mut both = holding.iter().zip(lengths);
    both.any(|(story, length)| {
        story.unknowns() == 1 && length - least < tuning.ranking.indistinguishable
    })
}

/// Stories that were found on a part of the data, held against all of them; those first that
/// hold then.
pub(super) fn held_against_all<'a>(
    mut stories: Vec<Story<'a>>,
    question: &Question<'a, '_>,
) -> Vec<Story<'a>> {
    let (data, few) = (&question.model.data, question.model.tuning().states.searched);
    if data.packed.samples().min(data.most) <= few {
        return stories;
    }
    for story in &mut stories {
        story.model = story.model.thinned(data.most);
        story.sums = settle(story.model.clone()).sums;
        if story.explains {
            story.grow(question);
        }
    }
    stories.sort_by_key(|story| !holds(story));
    stories
}

/// Stories of one change beside `baseline`, which has none: the best of those that asking all named
/// candidates of the model found.
pub(super) fn beginnings<'a>(
    question: &Question<'a, '_>,
    baseline: &Story<'a>,
    first: &Ranking,
) -> Vec<Story<'a>> {
    let all = question.model.tuning();
    let tuning = &all.verdict;
    let monitor = question.monitor;
    let mut beam: Vec<Story> = Vec::new();
    for (place, judged) in first.effects.iter().enumerate() {
        let told = beam.iter().filter(|story| holds(story));
        let least = told.map(Story::price).fold(f64::INFINITY, f64::min);
        // Where one holds, only one that does nearly as well and costs no more can take its place.
        let best = first.effects.first().map_or(0.0, |best| best.refit.effect.deviance);
        let within = all.ranking.finish_within.max(tuning.negligible * best);
        let near = best - judged.refit.effect.deviance <= within;
        let rivals = least.is_finite() && judged.price <= least && near;
        if monitor.stopped() || !(rivals || place < tuning.beginnings && least.is_infinite()) {
            continue;
        }
        beam.extend(baseline.with(judged, first.window, question));
    }
    beam
}

/// The story with each of the changes that pay most beside it: so many of those refitted.
pub(super) fn extended<'a>(
    question: &Question<'a, '_>,
    story: &Story<'a>,
    (refits, branches): (usize, usize),
) -> Vec<Story<'a>> {
    let mut scope = story.scope.clone();
    let tuning = story.model.tuning();
    let mut all = candidates(&mut scope, &story.model.data.dataset, &tuning.candidates);
    all.extend(left_out(&scope, &story.model.law, tuning.candidates.left_out));
    added(question, story, &all, refits, branches)
}

/// The same with terms that have no name. Those that were composed crowd out the others, which
/// are few: each kind is refitted for itself.
fn with_unnamed<'a>(question: &Question<'a, '_>, story: &Story<'a>) -> Result<Vec<Story<'a>>> {
    let mut scope = story.scope.clone();
    let tuning = story.model.tuning();
    let terms = composed(&mut scope, &story.model, question.monitor)?;
    let shapes = unnamed(&mut scope, &story.model.data.dataset, &tuning.candidates);
    let (refits, branches) = (tuning.ranking.first_refits, tuning.verdict.unnamed_branches);
    let mut all = added(question, story, &terms, refits, branches);
    // Shapes without a form say less than a term that explains all.
    if !all.iter().any(holds) {
        all.extend(added(question, story, &shapes, refits, branches));
    }
    Ok(all)
}

fn added<'a>(
    question: &Question<'a, '_>,
    story: &Story<'a>,
    all: &[Candidate],
    refits: usize,
    branches: usize,
) -> Vec<Story<'a>> {
    let (held_out, monitor) = (question.held_out, question.monitor);
    // A model that loses the motion answers no further question.
    let Ok(ranking) = ranking(&story.model, held_out, all, refits, monitor) else {
        return Vec::new();
    };
    // A flexible change may be ahead as long as others are missing: the best of the simplest ones
    // is always tried.
    let unknowns = |judged: &Judged| judged.refit.effect.coefficient.len();
    let simplest = ranking.effects.iter().enumerate().min_by_key(|(_, judged)| unknowns(judged));
    let simplest = simplest.map_or(0, |(place, _)| place);
    let taken = ranking.effects.iter().enumerate();
    let taken = taken.filter(|(place, _)| *place < branches || *place == simplest);
    // What a fit took to numbers that the language does not is no story: a step of no duration.
    let stories = taken.filter_map(|(_, judged)| story.with(judged, ranking.window, question).ok());
    stories.collect()
}

/// The story with members taken out that do not pay, and exchanged for what explains more, or as
/// much with less. What explains as much in the place of a member is noted beside it.
fn exchanged<'a>(question: &Question<'a, '_>, story: Story<'a>) -> Result<Story<'a>> {
    let mut best = story;
    let tuning = question.model.tuning();
    for _ in 0..tuning.verdict.effects {
        let mut better = None;
        for place in 0..best.members.len() {
            if question.monitor.stopped() {
                return Ok(best);
            }
            let Some(without) = best.without(question, place)? else { continue };
            let few = (tuning.ranking.later_refits, tuning.verdict.branches);
            let mut rivals = extended(question, &without, few);
            rivals.retain(|rival| holds(rival) && rival.labels() != best.labels());
            if holds(&without) {
                rivals.push(without);
            }
            rivals.push(best.clone());
            agree_on_noise(&mut rivals);
            let lengths = description_lengths(&rivals.iter().collect::<Vec<_>>(), tuning);
            let own = lengths.last().copied().unwrap_or(f64::INFINITY);
            let first = lengths.iter().copied().fold(f64::INFINITY, f64::min);
            let close = rivals.iter().zip(&lengths).filter(|(rival, length)| {
                rival.members.len() == best.members.len()
                    && rival.labels() != best.labels()
                    && **length - own < tuning.ranking.indistinguishable
            });
            let names = close.filter_map(|(rival, _)| rival.members.last());
            best.members[place].effect.indistinguishable =
                names.map(|member| member.effect.effect.clone()).collect();
            if own - first > tuning.ranking.same {
                let at = lengths.iter().position(|length| *length == first);
                better = at.map(|at| rivals.swap_remove(at));
                break;
            }
        }
        match better {
            Some(story) => best = story,
            None => break,
        }
    }
    Ok(best)
}
