//! The answer: whether a story holds over whole runs, training and held out, and what is said where
//! none does.

use std::fmt::Write as _;

use rayon::prelude::*;

use super::comparison::strongest_map;
use super::description::{description_lengths, is_computed};
use super::diagnosis::{Diagnosis, Verdict};
use super::doubts::holds;
use super::effect::RankedEffect;
use super::misfit::{error_of, excess, is_noise_of, is_resolved};
use super::rounding::is_of_rounding;
use super::settling::settle;
use super::steps::noise_of_steps;
use super::story::{Member, Question, SAME_SQUARES, Story};
use super::times::times;
use super::tuning::Tuning;
use super::window::longest;
use crate::fit::pass::Sums;

/// What held-out runs say of a model, over their whole length.
struct OnHeldOut {
    /// In units of the noise.
    error: f64,
    /// Whether that is the noise, to a tenth of its size or as well as so many residuals can tell,
    /// or what the errors of the numbers add to it.
    at_noise: bool,
    /// Whether it is that by what these errors add alone.
    by_errors: bool,
    /// Squares that are left.
    left: f64,
    /// Those that are left where the numbers move within their errors, and what that costs: twice
    /// the nats by which it widens predictions; where it is known.
    within_errors: Option<(f64, f64)>,
    /// Independent residuals.
    rows: f64,
}

/// Judges stories, the best first, the model as it is among them, and writes the answer. Where none
/// holds and something is missing, they are returned.
pub(super) fn judge<'a>(
    question: &Question<'a, '_>,
    diagnosis: &mut Diagnosis,
    mut stories: Vec<Story<'a>>,
) -> Vec<Story<'a>> {
    let Some(place) = stories.iter().position(|story| story.members.is_empty()) else {
        return Vec::new();
    };
    let tuning = question.model.tuning();
    let mut baseline = stories.remove(place);
    if let Some(best) = stories.first() {
        baseline.hold_against(best.model.noise());
    }
    let before = on_held_out(question, &baseline);
    let enough = baseline.explains && before.at_noise;
    let mut fault = None;
    let asked = |story: &mut Story<'a>| {
        story.conclude();
        let after = on_held_out(question, story);
        let found = fault_of(story, (&before, &after), enough.then_some(&baseline), tuning)
            .or_else(|| enough.then(|| of_rounding(story, &baseline))?);
        (found, after)
    };
    let mut accepted: Vec<(Story, OnHeldOut)> = Vec::new();
    let mut others: Vec<Story> = Vec::new();
    // Those that hold come first.
    let holding = stories.iter().take_while(|story| holds(story)).count();
    let rest = stories.split_off(holding).into_iter().map(|story| (story, None));
    let of_holding = |mut story: Story<'a>| {
        let answer = asked(&mut story);
        (story, Some(answer))
    };
    let answered: Vec<_> = stories.into_par_iter().map(of_holding).collect();
    for (mut story, answer) in answered.into_iter().chain(rest) {
        if !accepted.is_empty() && answer.is_none() && !holds(&story) {
            break;
        }
        // What leaves more than noise is not accepted; of the best of these it is said how much.
        if fault.is_some() && !story.explains {
            others.push(story);
            continue;
        }
        let (found, after) = answer.unwrap_or_else(|| asked(&mut story));
        match found {
            None => accepted.push((story, after)),
            Some(found) => {
                fault.get_or_insert((found, after));
                others.push(story);
            }
        }
    }
    if accepted.iter().any(|(story, _)| !story.stands_in_for_a_simpler_one()) {
        accepted.retain(|(story, _)| !story.stands_in_for_a_simpler_one());
    }
    if !accepted.is_empty() {
        choose(diagnosis, accepted, &before, tuning);
        return Vec::new();
    }
    let stories = others;
    diagnosis.held_out_error = before.error;
    if enough {
        diagnosis.verdict = Verdict::NothingMissing;
        if let Some((best, (fault, _))) = stories.first().zip(fault) {
            diagnosis.reason = format!(
                "the model is at the noise over whole runs; the best explanation beside it is none \
                 ({}): {fault}",
                best.labels().join(", ")
            );
        }
        return Vec::new();
    }
    unexplained(question, diagnosis, (&baseline, &before), &stories, fault);
    stories
}

/// The members of a story, the errors before and after all of it with the first and the last, and
/// what does as well in the place of each.
fn members(
    story: &Story,
    (before, after): (&OnHeldOut, &OnHeldOut),
    exchanges: &[(String, String)],
) -> Vec<RankedEffect> {
    let mut members: Vec<RankedEffect> =
        story.members.iter().map(|member| member.effect.clone()).collect();
    if let Some(first) = members.first_mut() {
        first.held_out_error_before = before.error;
    }
    if let Some(last) = members.last_mut() {
        last.held_out_error_after = after.error;
    }
    // Of those that were found together none came before another.
    for member in &mut members {
        if member.held_out_error_before.is_nan() {
            member.held_out_error_before = before.error;
        }
        if member.held_out_error_after.is_nan() {
            member.held_out_error_after = after.error;
        }
        let instead = exchanges.iter().filter(|(own, _)| *own == member.effect);
        for (_, other) in instead {
            if !member.indistinguishable.contains(other) {
                member.indistinguishable.push(other.clone());
            }
        }
    }
    members
}

/// Why a story is not accepted; `None` where it holds. `enough` is the model as it is, where that
/// explains the data already.
fn fault_of(
    story: &Story,
    (before, after): (&OnHeldOut, &OnHeldOut),
    enough: Option<&Story>,
    tuning: &Tuning,
) -> Option<&'static str> {
    if !story.explains {
        Some("it leaves more than noise on the runs that it was fitted to")
    } else if !after.at_noise && after.error > tuning.verdict.negligible.sqrt() * before.error {
        Some("it leaves more than noise on held-out runs")
    } else if !(after.error < before.error || before.error.is_nan()) {
        Some("held-out runs are explained as well without it")
    } else if !story.stands() {
        Some("not all of its coefficients are clearly different from zero")
    } else if story.is_patchwork() {
        Some("its members are pieces of one curve, which fit any")
    } else if story.contradicts_a_name() {
        Some("one of its coefficients has the sign of the opposite effect")
    } else if story.is_infinite_on_its_way() {
        Some("one of its members is infinite where the motion passes")
    } else if enough.is_some_and(|baseline| !pays(story, baseline, tuning)) {
        Some("the model explains the data as well without it")
    } else {
        None
    }
}

/// Why a story is not accepted beside a model that is at the noise of rounded readings.
fn of_rounding(story: &Story, baseline: &Story) -> Option<&'static str> {
    let noise = story.model.noise();
    is_of_rounding(&baseline.model.with_noise(noise), &story.model)
        .then_some("rounding of the readings explains as much")
}

/// Whether a story has a shorter description than another over segments that both follow.
fn pays(story: &Story, than: &Story, tuning: &Tuning) -> bool {
    let both = description_lengths(&[story, than], tuning);
    both.first() < both.last()
}

/// The error of a story on held-out runs, over all of their length.
fn on_held_out<'a>(question: &Question<'a, '_>, story: &Story<'a>) -> OnHeldOut {
    let model = story.model.with_data(question.held_out);
    let mut model = model.with_window(longest(&model));
    // Other runs meet kinks in their own way.
    let than = question.model.with_data(question.held_out);
    if model.at_steps
        && let Some(noise) = noise_of_steps(&model, &than)
    {
        model = model.with_noise(noise);
    }
    let settled = settle(model.clone());
    let error = error_of(&settled.sums).0;
    let tuning = model.tuning();
    let same = |sums: &Sums| story.explains && is_noise_of(&story.sums, sums, &story.model);
    let near = |sums: &Sums| story.excess_of(sums) == 0.0 || same(sums);
    let close = story.explains && error < tuning.ranking.largest_error;
    let within_errors = if close { story.left_within_errors(&settled) } else { None };
    let noise = error <= tuning.verdict.reaches || near(&settled.sums);
    let by_errors = !noise && within_errors.as_ref().is_some_and(|(sums, _)| near(sums));
    OnHeldOut {
        error,
        at_noise: settled.sums.diverged == 0 && (noise || by_errors),
        by_errors,
        left: settled.sums.loss,
        within_errors: within_errors.map(|(sums, widened)| (sums.loss, widened)),
        rows: settled.sums.rows as f64,
    }
}

/// Writes one of some stories that hold: the shortest with the fewest changes and numbers among
/// those whose description of all runs is about as short as any. Runs that nothing was fitted to
/// are among these: a series may be as near as its function where both were fitted. The others are
/// named as far as these data do not tell them from it: with odds of a twentieth or more, in as few
/// changes or in fewer numbers. What has numbers to spare may hold the story in it: it is a rival
/// where they pay for themselves.
fn choose(
    diagnosis: &mut Diagnosis,
    accepted: Vec<(Story, OnHeldOut)>,
    before: &OnHeldOut,
    tuning: &Tuning,
) {
    let stories: Vec<&Story> = accepted.iter().map(|(story, _)| story).collect();
    // Where one of them leaves white noise, what another leaves has no memory by the instrument.
    let times = stories.iter().map(|story| story.model.autocorrelation_time);
    let time = times.fold(f64::INFINITY, f64::min).max(1.0);
    let computed = is_computed(&stories);
    let unsaid = |after: &OnHeldOut| if computed { after.rows } else { 0.0 };
    // Like is compared with like: where a force has a kink, what errors add may not be known.
    let known = accepted.iter().all(|(_, after)| after.within_errors.is_some());
    let left_of = |after: &OnHeldOut| {
        let (left, widened) = after.within_errors.filter(|_| known).unwrap_or((after.left, 0.0));
        left.max(unsaid(after)) / time + widened
    };
    let lengths: Vec<f64> = description_lengths(&stories, tuning)
        .iter()
        .zip(&accepted)
        .map(|(length, (_, after))| length + left_of(after))
        .collect();
    let least = lengths.iter().copied().fold(f64::INFINITY, f64::min);
    let near = |length: &f64| length - least < tuning.ranking.indistinguishable;
    let ranked: Vec<_> = lengths.iter().zip(&accepted).filter(|(length, _)| near(length)).collect();
    let size = |story: &Story| (story.members.len(), story.unknowns());
    let fewest = ranked.iter().map(|(_, (story, _))| size(story)).min();
    let simplest = ranked.iter().filter(|(_, (story, _))| Some(size(story)) == fewest);
    let shortest = simplest.clone().map(|(length, _)| **length).fold(f64::INFINITY, f64::min);
    // Of those that are level the first: they come in the order of their descriptions of the runs
    // that they were fitted to, and where these are level, too, of their ranking.
    let first = simplest.clone().find(|(length, _)| **length - shortest < tuning.verdict.level);
    // Lengths that are no numbers leave the first.
    let Some((length, (story, after))) = first.copied().or(lengths.iter().zip(&accepted).next())
    else {
        return;
    };
    // What a name saves says which is accepted, and not what the data tell apart; but one law in
    // two ways of writing is no other, and a number more has to pay for itself.
    let data_alone = |length: &f64, story: &Story| length - story.price();
    let own = data_alone(length, story);
    let number = (story.sums.rows.max(2) as f64).ln();
    let to_spare = |other: &Story| other.unknowns().saturating_sub(story.unknowns());
    let is_as_good = |length: &f64, (other, its): &(Story, OnHeldOut)| {
        let is_same_law = (its.left - after.left).abs() <= SAME_SQUARES * after.left;
        let behind = data_alone(length, other) - own;
        match to_spare(other) {
            0 => near(length) || !is_same_law && behind < tuning.ranking.indistinguishable,
            more => behind + more as f64 * number < 0.0,
        }
    };
    let labels = story.labels();
    let mut others: Vec<(&f64, &(Story, OnHeldOut))> = lengths.iter().zip(&accepted).collect();
    others.sort_by(|(a, (one, _)), (b, (other, _))| {
        data_alone(a, one).total_cmp(&data_alone(b, other))
    });
    let rivals: Vec<(Vec<String>, bool)> = others
        .into_iter()
        .filter(|(_, (other, _))| {
            let (own, its) = (size(story), size(other));
            let is_simple = its.0 <= own.0 || its.1 < own.1;
            its.0 > 0 && is_simple && other.labels() != labels
        })
        .map(|(length, one)| (one, is_as_good(length, one)))
        .filter(|((other, _), is_as_good)| *is_as_good || to_spare(other) == 0)
        .map(|((other, _), is_as_good)| (other.labels(), is_as_good))
        .collect();
    accept(diagnosis, story, (before, after), &exchanges(&labels, &rivals));
    // What stands beside one effect alone is none of several.
    if labels.len() > 1 {
        diagnosis.indistinguishable.clear();
    }
    for (other, is_as_good) in rivals {
        let name = other.join(" and ");
        diagnosis.indistinguishable.retain(|known| *known != name);
        if is_as_good {
            diagnosis.indistinguishable.push(name);
        }
    }
}

/// What does as well in the place of one member of a story of several, all others being the same:
/// pairs of the member and the other, by their labels.
fn exchanges(own: &[String], rivals: &[(Vec<String>, bool)]) -> Vec<(String, String)> {
    let exchange = |other: &[String]| {
        let mut only = own.iter().filter(|label| !other.contains(label));
        let mut instead = other.iter().filter(|label| !own.contains(label));
        let one = only.next().zip(instead.next());
        one.filter(|_| own.len() > 1 && only.next().is_none() && instead.next().is_none())
            .map(|(member, other)| (member.clone(), other.clone()))
    };
    let as_good = rivals.iter().filter(|(_, is_as_good)| *is_as_good);
    as_good.filter_map(|(other, _)| exchange(other)).collect()
}

/// Writes a story that holds.
fn accept(
    diagnosis: &mut Diagnosis,
    story: &Story,
    (before, after): (&OnHeldOut, &OnHeldOut),
    exchanges: &[(String, String)],
) {
    let members = members(story, (before, after), exchanges);
    let Some((first, then)) = members.split_first() else { return };
    diagnosis.verdict = Verdict::Missing;
    diagnosis.held_out_error = before.error;
    let found_together = |member: &Member| member.effect.held_out_error_after.is_nan();
    diagnosis.reason = if then.is_empty() || !story.members.iter().any(found_together) {
        one_after_another(first, then)
    } else {
        let names: Vec<&str> = members.iter().map(|member| member.effect.as_str()).collect();
        format!(
            "together {} take the error on held-out runs from {} to {} times the noise",
            names.join(", "),
            times(before.error),
            times(after.error)
        )
    };
    if after.by_errors {
        diagnosis.reason += ", as far as the errors of their numbers let them";
    }
    diagnosis.begin_with(first);
    diagnosis.further = then.to_vec();
    diagnosis.story = members;
}

/// What each member of a story does to the error, those before it being in the model.
fn one_after_another(first: &RankedEffect, then: &[RankedEffect]) -> String {
    let mut reason = format!(
        "{} takes the error on held-out runs from {} to {} times the noise",
        first.effect,
        times(first.held_out_error_before),
        times(first.held_out_error_after)
    );
    for next in then {
        let _ =
            write!(reason, ", {} after it to {}", next.effect, times(next.held_out_error_after));
    }
    reason
}

/// Nothing that holds: what can be said all the same.
fn unexplained(
    question: &Question,
    diagnosis: &mut Diagnosis,
    (baseline, before): (&Story, &OnHeldOut),
    stories: &[Story],
    fault: Option<(&str, OnHeldOut)>,
) {
    if stories.is_empty() && !is_resolved(question.model) {
        diagnosis.verdict = Verdict::NothingMissing;
        diagnosis.reason = "what is left is at the limit of what the integrator and the digits of \
                            the data resolve"
            .to_string();
        return;
    }
    diagnosis.verdict = Verdict::Unexplained;
    let last = stories.first().unwrap_or(baseline);
    let more_than_noise = excess(&last.sums, &last.model) > 0.0;
    // One that loses the motion leaves no force that could be drawn.
    diagnosis.shape = more_than_noise.then(|| strongest_map(&last.model).ok().flatten()).flatten();
    let unnamed = |story: &Story| story.members.iter().find(|one| !one.named).cloned();
    let lead = stories.iter().find_map(unnamed);
    diagnosis.unnamed = lead.map(|member| member.effect);
    diagnosis.unnamed_explains_more = stories.first().and_then(unnamed).is_some();
    diagnosis.reason = match (stories.first(), fault, &diagnosis.shape) {
        (Some(best), Some((fault, after)), _) => format!(
            "the best explanation that was found is none ({}, which takes the error of held-out \
             runs over their whole length from {} to {} times the noise): {fault}",
            best.labels().join(", "),
            times(before.error),
            times(after.error)
        ),
        (_, _, Some(shape)) => format!(
            "the force on {} depends on {} in a way that no effect of the catalogue has",
            shape.on, shape.against
        ),
        _ => format!(
            "over whole runs the error is {} times the noise, and nothing that was tried takes it \
             away",
            times(before.error)
        ),
    };
}

#[cfg(test)]
mod tests {
    use super::exchanges;

    #[test]
    fn an_exchange_leaves_all_other_members() {
        let all = |labels: &[&str]| labels.iter().map(|one| one.to_string()).collect::<Vec<_>>();
        let rivals = [
            (all(&["drag", "tanh"]), true),
            (all(&["drag", "sine"]), false),
            (all(&["cubic", "tanh"]), true),
            (all(&["magnet"]), true),
        ];
        let found = exchanges(&all(&["drag", "magnet"]), &rivals);
        assert_eq!(found, [("magnet".to_string(), "tanh".to_string())]);
        // Of one alone the whole story is exchanged.
        assert!(exchanges(&all(&["drag"]), &[(all(&["tanh"]), true)]).is_empty());
    }
}
