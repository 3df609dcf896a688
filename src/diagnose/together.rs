//! Stories of several changes that were found together.
//!
//! Sets are proposed around a motion that the data follow, fitted over longer and longer segments
//! as every story is, and proposed anew around the motion of the best of them: over longer
//! segments smaller changes show, and what stood in for them is given back.

use rayon::prelude::*;

use super::candidates::candidates;
use super::candidates::composed::proposed::{Around, Placed, Proposed, ProposedSet};
use super::candidates::composed::sets::SetSearch;
use super::description::{agree_on_noise, description_lengths};
use super::doubts::holds;
use super::function_space::FunctionSpace;
use super::misfit::is_noise_of;
use super::settling::settle;
use super::story::{Question, Story};
use super::tuning::Tuning;
use crate::error::Result;
use crate::fit::pass::Sums;

/// Stories of sets of changes beside `baseline`, which has none; each ends where it no longer
/// follows the data. `None` where the model is not one that can be asked for sets.
///
/// Sets stand beside the whole function space first. Where none of them holds, they stand beside
/// the terms that the fit found: a whole space bends to a function that a few of its terms are
/// nearly like.
///
/// # Errors
///
/// When a change does not fit the spec.
pub(super) fn together<'a>(
    question: &Question<'a, '_>,
    baseline: &Story<'a>,
) -> Result<Option<Vec<Story<'a>>>> {
    let space = FunctionSpace::of(question);
    let Some(found) = beside(question, &space.all_free(baseline)?)? else { return Ok(None) };
    // Where one explains the data, what the others have to spare need not be known.
    let explained = found.iter().any(|story| story.explains);
    let open = found.into_par_iter().filter(|story| story.explains || !explained);
    let mut stories: Vec<Story> = open.map(|story| space.pruned(story, question)).collect();
    let more = !space.is_whole() && !question.monitor.stopped();
    if more && !stories.iter().any(holds) {
        stories.extend(beside(question, baseline)?.into_iter().flatten());
    }
    Ok(Some(stories))
}

/// A set that was proposed, fitted in full.
type Fitted<'a> = (ProposedSet, Story<'a>);

/// Stories of sets beside `baseline`. Where none of those explains the data that are chosen along
/// the model's own motion, forces are asked for along the measured one, too: a model that lacks
/// much is far from it.
fn beside<'a>(question: &Question<'a, '_>, baseline: &Story<'a>) -> Result<Option<Vec<Story<'a>>>> {
    let tuning = question.model.tuning();
    let mut scope = question.scope.clone();
    let all = candidates(&mut scope, &question.model.data.dataset, &tuning.candidates);
    let Some(search) = SetSearch::of(&baseline.model, &all, question.monitor) else {
        return Ok(None);
    };
    let mut stories = looked_for(question, baseline, search)?;
    if !stories.iter().any(|story| story.explains)
        && !question.monitor.stopped()
        && let Some(search) = SetSearch::of_measured(&baseline.model, &all, question.monitor)
    {
        stories.extend(looked_for(question, baseline, search)?);
    }
    Ok(Some(stories))
}

/// Stories of the sets that a search proposes, and proposes anew around the best of them.
fn looked_for<'a>(
    question: &Question<'a, '_>,
    baseline: &Story<'a>,
    mut search: SetSearch<'a, '_>,
) -> Result<Vec<Story<'a>>> {
    let tuning = question.model.tuning();
    let mut found: Vec<Fitted> = Vec::new();
    let mut window = search.window();
    let mut before: Option<Story> = None;
    let mut around: Option<Around> = None;
    for look in 0..tuning.sets.looks {
        question.monitor.stage("sets of changes", 0.7);
        let proposed = search.look(around.as_ref(), question.monitor).proposed(question.scope)?;
        try_sets(question, baseline, proposed, window, &mut found)?;
        shorten(question, &mut found)?;
        let Some((set, best)) = leader(&found, question) else { break };
        let same = before.as_ref().is_some_and(|before| !is_nearer(best, before, tuning));
        if same || question.monitor.stopped() || look + 1 == tuning.sets.looks {
            break;
        }
        before = Some(best.clone());
        window = best.model.law.window().min(tuning.sets.window).max(search.window());
        around = Some(around_motion_of(set, best, window));
    }
    Ok(found.into_iter().map(|(_, story)| story).collect())
}

/// Fits the sets that are not known yet over segments of `window` samples, and holds the best of
/// them against longer ones. Computed data have so many digits that a set which explains them
/// leaves nothing to a larger one: they are asked for the small ones first.
fn try_sets<'a>(
    question: &Question<'a, '_>,
    baseline: &Story<'a>,
    proposed: Vec<ProposedSet>,
    window: usize,
    found: &mut Vec<Fitted<'a>>,
) -> Result<()> {
    let known = |set: &ProposedSet| found.iter().any(|(other, _)| labels(other) == labels(set));
    let mut new: Vec<ProposedSet> = proposed.into_iter().filter(|set| !known(set)).collect();
    if !baseline.model.is_computed() {
        return try_together(question, baseline, new, window, found);
    }
    new.sort_by_key(|set| set.members.len());
    while let Some(size) = new.first().map(|set| set.members.len()) {
        let larger = new.split_off(new.partition_point(|set| set.members.len() == size));
        try_together(question, baseline, new, window, found)?;
        let explains = |(set, story): &Fitted| story.explains && set.members.len() <= size;
        if found.iter().any(explains) {
            break;
        }
        new = larger;
    }
    Ok(())
}

/// The same for sets that are asked for at once.
fn try_together<'a>(
    question: &Question<'a, '_>,
    baseline: &Story<'a>,
    sets: Vec<ProposedSet>,
    window: usize,
    found: &mut Vec<Fitted<'a>>,
) -> Result<()> {
    let (without, _) = baseline.squares(window, &baseline.model.noise());
    let fitted = |set: ProposedSet| -> Result<Option<Fitted>> {
        if question.monitor.stopped() {
            return Ok(None);
        }
        Ok(Story::of_set(baseline, &set, (window, without))?.map(|story| (set, story)))
    };
    let sets = sets.into_par_iter().map(fitted).collect::<Result<Vec<Option<Fitted>>>>()?;
    let sets = sets.into_iter().flatten().collect();
    let mut explained: Option<(Sums, f64)> = None;
    let most = question.model.tuning().sets.grown;
    let mut leading = 0;
    for (set, mut story) in best_first(sets, question) {
        if question.monitor.stopped() {
            break;
        }
        leading += usize::from(!set.rival);
        if leading > most && !set.rival {
            continue;
        }
        // What leaves more of these segments than one that explains whole runs says no more; but of
        // computed data what steps leave is not known yet, and a longer form may bend to that.
        let (seen, price) = (story.sums.clone(), story.price());
        let says_no_more = |(least, paid): &(Sums, f64)| {
            let is_simpler = story.model.is_computed() && price < *paid;
            !is_simpler && !is_noise_of(least, &seen, &story.model)
        };
        if explained.as_ref().is_some_and(says_no_more) {
            continue;
        }
        story.hold_together(question);
        if story.explains {
            let loss = seen.loss.max(seen.rows as f64);
            explained.get_or_insert((Sums { loss, ..seen }, price));
        }
        found.push((set, story));
    }
    Ok(())
}

/// The motion of a set's story over segments of `window` samples.
pub(super) fn around_motion_of<'a>(
    set: &ProposedSet,
    story: &Story<'a>,
    window: usize,
) -> Around<'a> {
    let places = story.numbers().into_iter().zip(story.columns());
    let placed = |(proposed, (numbers, columns)): (&Proposed, _)| Placed {
        proposed: proposed.clone(),
        numbers,
        columns,
    };
    Around {
        model: story.model.with_window(window),
        changes: set.members.iter().zip(places).map(placed).collect(),
        explains: story.explains,
    }
}

/// Whether a story is another than the best of the look before, and explains the data, follows
/// longer segments or leaves clearly less: what a rig leaves bends a little to any further change.
fn is_nearer(best: &Story, before: &Story, tuning: &Tuning) -> bool {
    let longer = best.model.law.window() > before.model.law.window();
    let before_now = before.with_noise(best.model.noise());
    let most = tuning.sets.nearer * before_now.excess_of(&settle(before_now.model.clone()).sums);
    best.labels() != before.labels()
        && (best.explains || longer || best.excess_of(&best.sums) < most)
}

/// Adds to sets that explain the data, and may be the best when shortened, what is left of them
/// then: what stood in for another form has nothing left to do once that is in its place, but first
/// order around the motion of a story that needed it does not say so. A set may be the best as long
/// as none holds, or where without all members that are not clearly there its description would be
/// shorter than that of the best which holds.
fn shorten<'a>(question: &Question<'a, '_>, found: &mut Vec<Fitted<'a>>) -> Result<()> {
    let shorter = |of: &ProposedSet| {
        let (all, count) = (labels(of), of.members.len());
        let is_part = |set: &ProposedSet| {
            set.members.len() < count && labels(set).iter().all(|label| all.contains(label))
        };
        found.iter().any(|(set, story)| story.explains && is_part(set))
    };
    let is_open = |(set, story): &&Fitted| story.explains && !story.stands() && !shorter(set);
    let open: Vec<&Fitted> = found.iter().filter(is_open).collect();
    if open.is_empty() {
        return Ok(());
    }
    let holding = found.iter().filter(|(_, story)| holds(story));
    let compared = holding.chain(open.iter().copied()).map(|(set, story)| (set, story));
    let (sets, stories): (Vec<&ProposedSet>, Vec<&Story>) = compared.unzip();
    let lengths = lengths_of(sets.into_iter(), &stories, question);
    let (holding, own) = lengths.split_at(lengths.len().saturating_sub(open.len()));
    let shortest = holding.iter().copied().fold(f64::INFINITY, f64::min);
    let clear = question.model.tuning().verdict.standard_errors;
    let spare = |story: &Story| -> f64 {
        let idle = story.members.iter().filter(|member| story.clearness(member) < clear);
        idle.map(|member| member.price).sum()
    };
    let may_be_best: Vec<&Fitted> = open
        .into_iter()
        .zip(own)
        .filter_map(|(one, length)| (length - spare(&one.1) < shortest).then_some(one))
        .collect();
    let shortened = |one: &Fitted<'a>| shortened(question, one.clone());
    let new = may_be_best.into_par_iter().map(shortened).collect::<Result<Vec<Fitted>>>()?;
    for one in new {
        if !found.iter().any(|(set, _)| labels(set) == labels(&one.0)) {
            found.push(one);
        }
    }
    Ok(())
}

/// A set that explains the data, without the members that are not clearly there as long as it
/// explains them all the same.
fn shortened<'a>(
    question: &Question<'a, '_>,
    (mut set, mut story): Fitted<'a>,
) -> Result<Fitted<'a>> {
    while story.explains && !story.stands() && story.members.len() > 1 {
        if question.monitor.stopped() {
            break;
        }
        let clearness = story.members.iter().map(|member| story.clearness(member)).enumerate();
        let Some((least, _)) = clearness.min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        match story.without(question, least)? {
            Some(shorter) if shorter.explains => {
                (set, story) = (set.without(least), shorter);
            }
            _ => break,
        }
    }
    Ok((set, story))
}

fn labels(set: &ProposedSet) -> Vec<&str> {
    let mut labels: Vec<&str> = set.members.iter().map(|one| one.effect.effect.as_str()).collect();
    labels.sort_unstable();
    labels
}

/// Sets with their stories, that of the shortest description first.
fn best_first<'a>(fitted: Vec<Fitted<'a>>, question: &Question<'a, '_>) -> Vec<Fitted<'a>> {
    let stories: Vec<&Story> = fitted.iter().map(|(_, story)| story).collect();
    let lengths = lengths_of(fitted.iter().map(|(set, _)| set), &stories, question);
    let mut both: Vec<_> = lengths.into_iter().zip(fitted).collect();
    both.sort_by(|a, b| a.0.total_cmp(&b.0));
    both.into_iter().map(|(_, one)| one).collect()
}

/// The story of the shortest description, with its set, among those that explain whole runs if any
/// does: only over these is all that the data say of them compared.
fn leader<'f, 'a>(found: &'f [Fitted<'a>], question: &Question<'a, '_>) -> Option<&'f Fitted<'a>> {
    let explained = found.iter().any(|(_, story)| story.explains);
    let standing: Vec<&Fitted> =
        found.iter().filter(|(_, story)| story.explains || !explained).collect();
    let mut stories: Vec<Story> = standing.iter().map(|(_, story)| story.clone()).collect();
    agree_on_noise(&mut stories);
    let sets = standing.iter().map(|(set, _)| set);
    let lengths = lengths_of(sets, &stories.iter().collect::<Vec<_>>(), question);
    let best = lengths.iter().zip(standing).min_by(|a, b| a.0.total_cmp(b.0));
    best.map(|(_, one)| one)
}

/// Description lengths of sets with their stories, without the terms of the model that idle beside
/// them.
fn lengths_of<'s>(
    sets: impl Iterator<Item = &'s ProposedSet>,
    stories: &[&Story],
    question: &Question,
) -> Vec<f64> {
    let lengths = description_lengths(stories, question.model.tuning()).into_iter();
    lengths.zip(sets).map(|(length, set)| length - set.saved).collect()
}
