//! Inner numbers of composed terms, moved to where the score is best.

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
/// that it has, and the fall of the squares there.
pub(super) fn refined(start: &Composed, fall: f64, search: &Search) -> (Composed, f64) {
    let Search { jets, responses, tuning } = search;
    let tuning = &tuning.composed;
    let inner = start.inner();
    let mut best = (start.clone(), fall);
    if inner.is_empty() {
        return best;
    }
    let ranges: Vec<(f64, f64)> =
        inner.iter().map(|&(at, _, kind)| bounds(&start.factors[at], kind, jets)).collect();
    let mut step = tuning.first_step;
    let mut scores = 0;
    while step > tuning.last_step && scores < tuning.scores {
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
