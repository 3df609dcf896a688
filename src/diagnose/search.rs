//! The search over stories: a beam of sets of changes, extended, exchanged and shortened.

use super::candidates::composed::{Budget, composed};
use super::candidates::{Candidate, candidates, unnamed};
use super::ranking::{Ranking, ranking};
use super::story::{
    Question, Story, agree_on_noise, description_lengths, sort_by_description_length,
};
use super::tuning::TUNING;
use crate::error::Result;

/// Stories, the best first: at least that without a change.
///
/// `first` is what asking all named candidates of the bare model found. The search goes on as long
/// as the best story does not explain the data over whole runs: each of the leading stories is
/// extended by the changes that pay most beside it. When it has ended, each member of the best is
/// taken out and looked for again among all candidates: while others were missing, a more
/// flexible change may have stood in for them.
///
/// # Errors
///
/// When a change does not fit the spec.
pub fn stories<'a>(question: &Question<'a, '_>, first: &Ranking) -> Result<Vec<Story<'a>>> {
    let tuning = &TUNING.verdict;
    let monitor = question.monitor;
    let bare = Story::bare(question);
    let mut ended: Vec<Story> = Vec::new();
    let mut beam: Vec<Story> = Vec::new();
    for judged in first.effects.iter().take(tuning.beginnings) {
        let story = bare.with(judged, first.window, question)?;
        let enough = holds(&story);
        beam.push(story);
        if enough || monitor.stopped() {
            break;
        }
    }
    let mut grown = bare.clone();
    grown.grow(monitor);
    // Where the model explains the data as it is, there is nothing to compose.
    if !grown.explains && !beam.iter().any(holds) && !monitor.stopped() {
        monitor.stage("terms without a name", 0.7);
        beam.extend(with_unnamed(question, &bare)?);
    }
    agree_on_noise(&mut beam);
    sort_by_description_length(&mut beam);
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
        for (place, story) in open.into_iter().enumerate() {
            if place >= tuning.beam || monitor.stopped() {
                ended.push(story);
                continue;
            }
            let longer = extended(question, &story)?;
            if longer.is_empty() {
                ended.push(story);
            }
            for one in longer {
                if !next.iter().any(|other| other.labels() == one.labels()) {
                    next.push(one);
                }
            }
        }
        agree_on_noise(&mut next);
        sort_by_description_length(&mut next);
        beam = next;
    }
    ended.append(&mut beam);
    agree_on_noise(&mut ended);
    sort_by_description_length(&mut ended);
    // A story that holds is told before one that is shorter and explains less.
    ended.sort_by_key(|story| !holds(story));
    if let Some(best) = ended.first().filter(|best| holds(best) && best.members.len() > 1) {
        let best = exchanged(question, best.clone())?;
        ended.retain(|story| story.labels() != best.labels());
        ended.insert(0, best);
    }
    ended.push(grown);
    Ok(ended)
}

/// Whether a story may be told: it explains the data over whole runs, with nothing to spare.
fn holds(story: &Story) -> bool {
    story.explains && story.stands()
}

/// The story with each of the changes that pay most beside it.
fn extended<'a>(question: &Question<'a, '_>, story: &Story<'a>) -> Result<Vec<Story<'a>>> {
    let mut scope = story.scope.clone();
    let all = candidates(&mut scope, story.context.dataset);
    added(question, story, &all, TUNING.ranking.later_refits)
}

/// The same with terms that have no name.
fn with_unnamed<'a>(question: &Question<'a, '_>, story: &Story<'a>) -> Result<Vec<Story<'a>>> {
    let mut scope = story.scope.clone();
    let budget = Budget::default();
    let mut all = composed(&mut scope, &story.context, budget, question.monitor)?;
    all.extend(unnamed(&mut scope, story.context.dataset));
    added(question, story, &all, TUNING.ranking.first_refits)
}

fn added<'a>(
    question: &Question<'a, '_>,
    story: &Story<'a>,
    all: &[Candidate],
    most: usize,
) -> Result<Vec<Story<'a>>> {
    let (held_out, monitor) = (question.held_out, question.monitor);
    // A model that loses the motion answers no further question.
    let Ok(ranking) = ranking(&story.context, held_out, all, most, monitor) else {
        return Ok(Vec::new());
    };
    let best = ranking.effects.iter().take(TUNING.verdict.branches);
    best.map(|judged| story.with(judged, ranking.window, question)).collect()
}

/// The story with members taken out that do not pay, and exchanged for what explains more, or as
/// much with less. What explains as much in the place of a member is noted beside it.
fn exchanged<'a>(question: &Question<'a, '_>, story: Story<'a>) -> Result<Story<'a>> {
    let mut best = story;
    for _ in 0..TUNING.verdict.effects {
        let mut better = None;
        for place in 0..best.members.len() {
            if question.monitor.stopped() {
                return Ok(best);
            }
            let Some(without) = best.without(question, place)? else { continue };
            let mut rivals = extended(question, &without)?;
            rivals.retain(|rival| holds(rival) && rival.labels() != best.labels());
            if holds(&without) {
                rivals.push(without);
            }
            rivals.push(best.clone());
            agree_on_noise(&mut rivals);
            let lengths = description_lengths(&rivals.iter().collect::<Vec<_>>());
            let own = lengths.last().copied().unwrap_or(f64::INFINITY);
            let first = lengths.iter().copied().fold(f64::INFINITY, f64::min);
            let close = rivals.iter().zip(&lengths).filter(|(rival, length)| {
                rival.members.len() == best.members.len()
                    && rival.labels() != best.labels()
                    && **length - own < TUNING.ranking.indistinguishable
            });
            let names = close.filter_map(|(rival, _)| rival.members.last());
            best.members[place].effect.indistinguishable =
                names.map(|member| member.effect.effect.clone()).collect();
            if own - first > TUNING.ranking.same {
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
