//! Inner numbers of composed terms, moved to where the score is best.

use rayon::prelude::*;

use super::enumerate::Found;
use super::expression::Composed;
use super::library::bounds;
use super::search::Search;
use super::shapes::Inner;

/// A coordinate of the search: a logarithm where the number is a length or a rate.
fn moved(inner: Inner, number: f64, step: f64, (lower, upper): (f64, f64)) -> f64 {
    let number = match inner {
        Inner::Length | Inner::Scale | Inner::WaveNumber => number * step.exp(),
        Inner::Centre => number + step * (upper - lower),
        // The first step is half of an exponent.
        Inner::Exponent => number + 4.0 * step,
    };
    number.clamp(lower, upper)
}

/// The term with the inner numbers that the score likes best, by a compass search from those
/// that it has, and the fall of the squares there, in about so many scores.
fn refined(start: &Composed, fall: f64, search: &Search, most: usize) -> (Composed, f64) {
    let Search { jets, responses, tuning } = search;
    let tuning = &tuning.composed;
    let inner = start.inner();
    let mut best = (start.clone(), fall);
    if inner.is_empty() {
        return best;
    }
    let ranges: Vec<(f64, f64)> =
        inner.iter().map(|&(at, _, kind)| bounds(&start.factors[at], kind, jets)).collect();
    // A leaf that is no number along this motion has no range.
    if !ranges.iter().all(|(lower, upper)| lower <= upper) {
        return best;
    }
    let mut step = tuning.first_step;
    let mut scores = 0;
    while step > tuning.last_step && scores < most {
        let mut better = false;
        for (place, &(_, _, kind)) in inner.iter().enumerate() {
            for sign in [1.0, -1.0] {
                let mut numbers = best.0.numbers();
                numbers[place] = moved(kind, numbers[place], sign * step, ranges[place]);
                let other = best.0.with_numbers(&numbers);
                let action = other.action(&jets.nodes, responses.channels);
                scores += 1;
                if action.values.iter().any(|x| !x.is_finite()) {
                    continue;
                }
                let fall = responses.fall(&action);
                if fall > best.1 {
                    best = (other, fall);
                    better = true;
                    break;
                }
            }
        }
        if !better {
            step *= 0.5;
        }
    }
    best
}

/// The best of each form, the inner numbers of the leaders refined; best first.
///
/// At the points of its grid a form may leave far more than between them: so all are moved a little
/// before the leaders are chosen.
pub(super) fn refined_leaders(search: &Search, found: Vec<Found>) -> Vec<(Composed, f64)> {
    let most = found.iter().map(|one| one.fall).fold(0.0, f64::max);
    let variance = search.variance(search.responses.squares - most);
    let merit = |composed: &Composed, fall: f64| {
        let numbers = 0.5 * (search.responses.rows.max(2) as f64).ln();
        0.5 * fall / variance - composed.price - numbers * composed.inner().len() as f64
    };
    let mut found = found;
    found.sort_by(|a, b| merit(&b.composed, b.fall).total_cmp(&merit(&a.composed, a.fall)));
    let mut forms: Vec<Found> = Vec::new();
    for one in found {
        if !forms.iter().any(|form| form.composed.has_form_of(&one.composed)) {
            forms.push(one);
        }
    }
    let tuning = &search.tuning.composed;
    let refined_in = |(term, fall): &(Composed, f64), most| refined(term, *fall, search, most);
    let sketched = |one: &(Composed, f64)| refined_in(one, tuning.sketched * one.0.inner().len());
    let by_merit = |terms: &mut Vec<(Composed, f64)>| {
        terms.sort_by(|a, b| merit(&b.0, b.1).total_cmp(&merit(&a.0, a.1)));
    };
    let forms: Vec<(Composed, f64)> =
        forms.into_iter().map(|one| (one.composed, one.fall)).collect();
    let mut terms: Vec<(Composed, f64)> = forms.par_iter().map(sketched).collect();
    by_merit(&mut terms);
    let leaders = terms.len().min(tuning.refined);
    let refined_terms: Vec<(Composed, f64)> =
        terms[..leaders].par_iter().map(|one| refined_in(one, tuning.scores)).collect();
    terms.splice(..leaders, refined_terms);
    by_merit(&mut terms);
    terms
}
