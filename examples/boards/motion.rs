//! Motions of a law that is written down: fourth-order Runge-Kutta, with steps that are halved
//! until halving changes nothing, and what halving changed taken on to the fifth order. It is not
//! the library's own.

use leverrier::Law;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use super::expression::Expression;

/// Beyond it a motion has left every bound.
const BOUND: f64 = 1e3;

/// Steps between samples to begin with.
const STEPS: usize = 16;

/// A step is short enough where two halves of it give the same to this. Data without noise are
/// held against a law to the last digits: an integrator's own error would be found in them.
const EXACT: f64 = 1e-13;

/// Halvings of a step: what a force that jumps asks for.
const HALVINGS: usize = 16;

/// Steps between samples in which a learned law is followed.
const FOLLOWING: usize = 40;

/// States (x, v) at the times of the samples.
pub(crate) type Motion = Vec<[f64; 2]>;

/// Times from 0 to the end, both included.
pub(crate) fn times(end: f64, samples: usize) -> Vec<f64> {
    let last = samples.saturating_sub(1).max(1) as f64;
    (0..samples).map(|i| end * i as f64 / last).collect()
}

/// What a step adds to a state.
fn step(law: &Expression, time: f64, state: [f64; 2], h: f64) -> [f64; 2] {
    let rate = |t: f64, s: [f64; 2]| [s[1], law.value(&[s[0], s[1], t])];
    let along = |k: [f64; 2], h: f64| [state[0] + h * k[0], state[1] + h * k[1]];
    let first = rate(time, state);
    let second = rate(time + 0.5 * h, along(first, 0.5 * h));
    let third = rate(time + 0.5 * h, along(second, 0.5 * h));
    let fourth = rate(time + h, along(third, h));
    let sum = |i: usize| first[i] + 2.0 * (second[i] + third[i]) + fourth[i];
    [h * sum(0) / 6.0, h * sum(1) / 6.0]
}

fn plus(first: [f64; 2], second: [f64; 2]) -> [f64; 2] {
    [first[0] + second[0], first[1] + second[1]]
}

/// What a step adds, in as many as it takes.
fn advance(law: &Expression, time: f64, state: [f64; 2], h: f64, left: usize) -> [f64; 2] {
    let half = 0.5 * h;
    let whole = step(law, time, state, h);
    let first = step(law, time, state, half);
    let twice = plus(first, step(law, time + half, plus(state, first), half));
    let end = plus(state, twice);
    let off = (0..2).map(|i| (whole[i] - twice[i]).abs() / (1.0 + end[i].abs()));
    let off = off.fold(0.0, f64::max);
    if left == 0 || off < EXACT || !is_bounded(&end) {
        // Of the fourth order: the error of two halves is a fifteenth of the difference.
        return [0, 1].map(|i| twice[i] + (twice[i] - whole[i]) / 15.0);
    }
    let first = advance(law, time, state, half, left - 1);
    plus(first, advance(law, time + half, plus(state, first), half, left - 1))
}

fn is_bounded(state: &[f64; 2]) -> bool {
    state.iter().all(|x| x.abs() < BOUND)
}

/// The motion of a law from a start; none where it leaves every bound.
pub(crate) fn motion(law: &Expression, start: [f64; 2], times: &[f64]) -> Option<Motion> {
    let (mut state, mut carried) = (start, [0.0; 2]);
    let mut out = vec![start];
    for pair in times.windows(2) {
        let h = (pair[1] - pair[0]) / STEPS as f64;
        for i in 0..STEPS {
            let added = advance(law, pair[0] + h * i as f64, state, h, HALVINGS);
            for (k, added) in added.into_iter().enumerate() {
                // Kahan's sum: what rounding takes from a state is carried on.
                let added = added + carried[k];
                let sum = state[k] + added;
                carried[k] = added - (sum - state[k]);
                state[k] = sum;
            }
            if !is_bounded(&state) {
                return None;
            }
        }
        out.push(state);
    }
    Some(out)
}

/// Where starts are drawn: from a square around rest, or outside of it in a larger one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Square {
    pub inner: f64,
    pub outer: f64,
}

/// Motions from starts of a square; one whose motion leaves every bound is drawn anew up to ten
/// times. None where one was drawn in vain.
pub(crate) fn drawn(
    law: &Expression,
    square: Square,
    count: usize,
    times: &[f64],
    seed: u64,
) -> Option<Vec<Motion>> {
    let mut generator = Pcg64::seed_from_u64(seed);
    let mut side = || generator.random_range(-square.outer..square.outer);
    let mut start = || {
        let mut drawn = [side(), side()];
        while drawn.iter().all(|x| x.abs() < square.inner) {
            drawn = [side(), side()];
        }
        drawn
    };
    // Once, and ten times anew.
    let mut one = || (0..=10).find_map(|_| motion(law, start(), times));
    (0..count).map(|_| one()).collect()
}

/// Mean and standard deviation of a column of all motions.
fn spread(motions: &[Motion], column: usize) -> (f64, f64) {
    let all = || motions.iter().flatten().map(|state| state[column]);
    let count = all().count().max(1) as f64;
    let mean = all().sum::<f64>() / count;
    (mean, (all().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt())
}

/// The motions with noise of a part of each column's spread.
pub(crate) fn noisy(motions: &[Motion], part: f64, seed: u64) -> Vec<Motion> {
    let mut generator = Pcg64::seed_from_u64(seed);
    let sizes = [spread(motions, 0).1, spread(motions, 1).1];
    let mut read = |state: &[f64; 2]| {
        let mut out = *state;
        for (value, size) in out.iter_mut().zip(sizes) {
            let noise: f64 = StandardNormal.sample(&mut generator);
            *value += part * size * noise;
        }
        out
    };
    motions.iter().map(|motion| motion.iter().map(&mut read).collect()).collect()
}

/// Mean squared error of a learned law on motions from their starts, in parts of the variance; of
/// the two columns the worse. Infinite where the law's motion leaves every bound; none where it
/// has more than x and v.
pub(crate) fn error(law: &Law, motions: &[Motion], times: &[f64]) -> Option<f64> {
    let field = law.vector_field();
    let mut states: Vec<f64> = motions.iter().flat_map(|m| m.first()).flatten().copied().collect();
    let mut squares = [0.0; 2];
    let samples = motions.len() * times.len();
    for (i, pair) in times.windows(2).enumerate() {
        let h = (pair[1] - pair[0]) / FOLLOWING as f64;
        for j in 0..FOLLOWING {
            let time = pair[0] + h * j as f64;
            let along = |rates: &[f64], h: f64| -> Vec<f64> {
                states.iter().zip(rates).map(|(state, rate)| state + h * rate).collect()
            };
            let first = field.rates(time, &states).ok()?;
            let second = field.rates(time + 0.5 * h, &along(&first, 0.5 * h)).ok()?;
            let third = field.rates(time + 0.5 * h, &along(&second, 0.5 * h)).ok()?;
            let fourth = field.rates(time + h, &along(&third, h)).ok()?;
            for (k, state) in states.iter_mut().enumerate() {
                *state += h * (first[k] + 2.0 * (second[k] + third[k]) + fourth[k]) / 6.0;
            }
        }
        if !states.iter().all(|x| x.abs() < BOUND) {
            return Some(f64::INFINITY);
        }
        for (motion, state) in motions.iter().zip(states.chunks_exact(2)) {
            for (column, square) in squares.iter_mut().enumerate() {
                *square += (motion.get(i + 1)?[column] - state[column]).powi(2);
            }
        }
    }
    let part = |column: usize| {
        let variance = spread(motions, column).1.powi(2).max(f64::MIN_POSITIVE);
        squares[column] / samples as f64 / variance
    };
    Some(part(0).max(part(1)))
}

/// A number from a text, the same on every machine (Fowler, Noll and Vo's hash).
pub(crate) fn seed(text: &str) -> u64 {
    let hash = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    text.bytes().fold(0xcbf2_9ce4_8422_2325, hash)
}
