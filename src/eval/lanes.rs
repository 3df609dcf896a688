//! Rows of lanes and one number for each lane.
//!
//! Rows are short: a few registers. So some lanes of all rows come first, then the next: what
//! belongs to a lane stays in its register. The results are the same bits for every number of
//! lanes.

#![allow(unsafe_code, reason = "bounds are checked once, before the loops over rows")]

use super::processor::dispatched;

/// Lanes that fill the widest register.
pub(crate) const REGISTER: usize = 8;
/// Lanes of as many registers as are worked on together.
const WIDE: usize = 4 * REGISTER;

/// Calls `$piece::<N>($arguments, first lane)` for all lanes, many at a time.
macro_rules! in_pieces {
    ($lanes:expr, $piece:ident($($argument:expr),*)) => {
        let lanes = $lanes;
        let mut lane = 0;
        while lane + WIDE <= lanes {
            $piece::<WIDE>($($argument,)* lane);
            lane += WIDE;
        }
        while lane + REGISTER <= lanes {
            $piece::<REGISTER>($($argument,)* lane);
            lane += REGISTER;
        }
        while lane < lanes {
            $piece::<1>($($argument,)* lane);
            lane += 1;
        }
    };
}

dispatched! {
    /// target = a * weight, row after row of lanes.
    pub(crate) fn set_weighted(target: &mut [f64], a: &[f64], weight: &[f64]) = set_weighted_body;
}

#[inline(always)]
fn set_weighted_body(target: &mut [f64], a: &[f64], weight: &[f64]) {
    in_pieces!(weight.len(), set_weighted_piece(target, a, weight));
}

#[inline(always)]
fn set_weighted_piece<const N: usize>(target: &mut [f64], a: &[f64], weight: &[f64], lane: usize) {
    let w = *load::<N>(weight, lane);
    let a = &a[..target.len()];
    let mut at = lane;
    while at + N <= target.len() {
        // SAFETY: the loop goes no further than both are long.
        unsafe { store_unchecked(target, at, &product(load_unchecked(a, at), &w)) };
        at += weight.len();
    }
}

dispatched! {
    /// target += a * weight, row after row of lanes, each number rounded once.
    pub(crate) fn add_weighted(target: &mut [f64], a: &[f64], weight: &[f64]) = add_weighted_body;
}

#[inline(always)]
fn add_weighted_body(target: &mut [f64], a: &[f64], weight: &[f64]) {
    in_pieces!(weight.len(), add_weighted_piece(target, a, weight));
}

#[inline(always)]
fn add_weighted_piece<const N: usize>(target: &mut [f64], a: &[f64], weight: &[f64], lane: usize) {
    let w = *load::<N>(weight, lane);
    let a = &a[..target.len()];
    let mut at = lane;
    while at + N <= target.len() {
        // SAFETY: the loop goes no further than both are long.
        unsafe {
            let sum = fused(load_unchecked(a, at), &w, load_unchecked(target, at));
            store_unchecked(target, at, &sum);
        }
        at += weight.len();
    }
}

dispatched! {
    /// The same for two rows at once, `target += a * weights[0] + b * weights[1]`; the weights
    /// are `[2][lanes]`.
    pub(crate) fn add_weighted_pair(target: &mut [f64], a: &[f64], b: &[f64], weights: &[f64])
        = add_weighted_pair_body;
}

#[inline(always)]
fn add_weighted_pair_body(target: &mut [f64], a: &[f64], b: &[f64], weights: &[f64]) {
    in_pieces!(weights.len() / 2, add_weighted_pair_piece(target, a, b, weights));
}

#[inline(always)]
fn add_weighted_pair_piece<const N: usize>(
    target: &mut [f64],
    a: &[f64],
    b: &[f64],
    weights: &[f64],
    lane: usize,
) {
    let lanes = weights.len() / 2;
    let (v, w) = (*load::<N>(weights, lane), *load::<N>(weights, lanes + lane));
    let (a, b) = (&a[..target.len()], &b[..target.len()]);
    let mut at = lane;
    while at + N <= target.len() {
        // SAFETY: the loop goes no further than all three are long.
        unsafe {
            let sum = fused(load_unchecked(a, at), &v, load_unchecked(target, at));
            let sum = fused(load_unchecked(b, at), &w, &sum);
            store_unchecked(target, at, &sum);
        }
        at += lanes;
    }
}

dispatched! {
    /// target = from * scale, row after row of lanes; zero where the scale is, whatever stands
    /// in `from`.
    pub(crate) fn weigh(target: &mut [f64], from: &[f64], scale: &[f64]) = weigh_body;
}

#[inline(always)]
fn weigh_body(target: &mut [f64], from: &[f64], scale: &[f64]) {
    in_pieces!(scale.len(), weigh_piece(target, from, scale));
}

#[inline(always)]
fn weigh_piece<const N: usize>(target: &mut [f64], from: &[f64], scale: &[f64], lane: usize) {
    let s = *load::<N>(scale, lane);
    if !s.contains(&0.0) {
        // As nearly always: compilers take the choice between two numbers lane by lane.
        return set_weighted_piece::<N>(target, from, scale, lane);
    }
    let from = &from[..target.len()];
    let mut at = lane;
    while at + N <= target.len() {
        store(target, at, &scaled(load(from, at), &s));
        at += scale.len();
    }
}

dispatched! {
    /// rows *= scale, row after row of lanes; zero where the scale is, whatever stands there.
    pub(crate) fn rescale(rows: &mut [f64], scale: &[f64]) = rescale_body;
}

#[inline(always)]
fn rescale_body(rows: &mut [f64], scale: &[f64]) {
    in_pieces!(scale.len(), rescale_piece(rows, scale));
}

#[inline(always)]
fn rescale_piece<const N: usize>(rows: &mut [f64], scale: &[f64], lane: usize) {
    let s = *load::<N>(scale, lane);
    let whole = !s.contains(&0.0);
    let mut at = lane;
    while at + N <= rows.len() {
        // SAFETY: the loop goes no further than the rows.
        let x = unsafe { load_unchecked::<N>(rows, at) };
        let product = if whole { product(x, &s) } else { scaled(x, &s) };
        // SAFETY: as above.
        unsafe { store_unchecked(rows, at, &product) };
        at += scale.len();
    }
}

dispatched! {
    /// sums = the squares of rows of lanes, one upon the other; the rows begin `stride` numbers
    /// apart.
    pub(crate) fn sum_squares(sums: &mut [f64], rows: &[f64], stride: usize) = sum_squares_body;
}

#[inline(always)]
fn sum_squares_body(sums: &mut [f64], rows: &[f64], stride: usize) {
    in_pieces!(sums.len(), sum_squares_piece(sums, rows, stride));
}

#[inline(always)]
fn sum_squares_piece<const N: usize>(sums: &mut [f64], rows: &[f64], stride: usize, lane: usize) {
    let mut sum = [0.0; N];
    let mut at = lane;
    while at + N <= rows.len() {
        // SAFETY: the loop goes no further than the rows.
        let x = unsafe { load_unchecked(rows, at) };
        sum = fused(x, x, &sum);
        at += stride;
    }
    store(sums, lane, &sum);
}

dispatched! {
    /// Adds 0 to the mark of each lane, or what is not a number where any of its rows is not
    /// finite.
    pub(crate) fn mark_broken(marks: &mut [f64], rows: &[f64]) = mark_broken_body;
}

#[inline(always)]
fn mark_broken_body(marks: &mut [f64], rows: &[f64]) {
    in_pieces!(marks.len(), mark_broken_piece(marks, rows));
}

#[inline(always)]
fn mark_broken_piece<const N: usize>(marks: &mut [f64], rows: &[f64], lane: usize) {
    let mut sum = *load::<N>(marks, lane);
    let mut at = lane;
    while at + N <= rows.len() {
        // SAFETY: the loop goes no further than the rows.
        sum = fused(unsafe { load_unchecked(rows, at) }, &[0.0; N], &sum);
        at += marks.len();
    }
    store(marks, lane, &sum);
}

/// a b, number by number.
#[inline(always)]
fn product<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    let mut product = [0.0; N];
    for i in 0..N {
        product[i] = a[i] * b[i];
    }
    product
}

/// The same, but zero where b is, whatever a is.
#[inline(always)]
fn scaled<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    let mut scaled = product(a, b);
    for i in 0..N {
        scaled[i] = if b[i] == 0.0 { 0.0 } else { scaled[i] };
    }
    scaled
}

/// Neighbouring numbers from a place on; zeros where there are not so many.
#[inline(always)]
pub(super) fn load<const LANES: usize>(values: &[f64], at: usize) -> &[f64; LANES] {
    values[at..].first_chunk().unwrap_or(const { &[0.0; LANES] })
}

/// The same without a look at the length, where a loop has looked once for all its turns.
///
/// # Safety
///
/// `at + LANES` is at most the length.
#[inline(always)]
pub(super) unsafe fn load_unchecked<const LANES: usize>(
    values: &[f64],
    at: usize,
) -> &[f64; LANES] {
    debug_assert!(at + LANES <= values.len());
    // SAFETY: the caller promises that so many numbers are there.
    unsafe { &*values.as_ptr().add(at).cast() }
}

/// Neighbouring numbers to a place and after it, without a look at the length.
///
/// # Safety
///
/// `at + N` is at most the length.
#[inline(always)]
pub(super) unsafe fn store_unchecked<const N: usize>(
    values: &mut [f64],
    at: usize,
    numbers: &[f64; N],
) {
    debug_assert!(at + N <= values.len());
    // SAFETY: the caller promises that so many places are there.
    unsafe { *values.as_mut_ptr().add(at).cast() = *numbers };
}

/// a b + c, number by number, each rounded once.
///
/// Closures, and so `array::from_fn`, are compiled for the plain instruction set: without them
/// a body stays in the registers that it is dispatched for.
#[inline(always)]
pub(super) fn fused<const N: usize>(a: &[f64; N], b: &[f64; N], c: &[f64; N]) -> [f64; N] {
    let mut sum = [0.0; N];
    for i in 0..N {
        sum[i] = a[i].mul_add(b[i], c[i]);
    }
    sum
}

/// Neighbouring numbers to a place and after it.
#[inline(always)]
pub(super) fn store<const N: usize>(values: &mut [f64], at: usize, numbers: &[f64; N]) {
    values[at..][..N].copy_from_slice(numbers);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::InstructionSet;

    fn numbers(count: usize, from: f64) -> Vec<f64> {
        (0..count).map(|at| (0.7 * at as f64 + from).sin()).collect()
    }

    #[test]
    fn every_number_of_lanes_is_worked_on_alike() {
        const ROWS: usize = 3;
        for lanes in [1, 7, 8, 13, 32, 45, 64, 77] {
            let (a, b) = (numbers(ROWS * lanes, 0.1), numbers(ROWS * lanes, 0.2));
            let start = numbers(ROWS * lanes, 0.3);
            let mut weights = numbers(2 * lanes, 0.4);
            weights[lanes / 2] = 0.0;
            let (v, w) = weights.split_at(lanes);
            let expected = |f: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
                (0..ROWS * lanes).map(|at| f(at, at % lanes)).collect()
            };
            let mut broken = a.clone();
            broken[lanes + lanes / 3] = f64::INFINITY;
            for set in InstructionSet::available() {
                let mut found = start.clone();
                set_weighted(set, &mut found, &a, v);
                assert_eq!(found, expected(&|at, lane| a[at] * v[lane]));
                let mut found = start.clone();
                add_weighted(set, &mut found, &a, v);
                assert_eq!(found, expected(&|at, lane| a[at].mul_add(v[lane], start[at])));
                let mut found = start.clone();
                add_weighted_pair(set, &mut found, &a, &b, &weights);
                let pair = |at: usize, lane: usize| {
                    b[at].mul_add(w[lane], a[at].mul_add(v[lane], start[at]))
                };
                assert_eq!(found, expected(&pair));
                let zero_or = |x: f64, lane: usize| if v[lane] == 0.0 { 0.0 } else { x * v[lane] };
                let mut found = start.clone();
                weigh(set, &mut found, &broken, v);
                assert_eq!(found, expected(&|at, lane| zero_or(broken[at], lane)));
                let mut found = broken.clone();
                rescale(set, &mut found, v);
                assert_eq!(found, expected(&|at, lane| zero_or(broken[at], lane)));
                // There may be no rows.
                set_weighted(set, &mut [], &[], v);
                add_weighted(set, &mut [], &[], v);
                add_weighted_pair(set, &mut [], &[], &[], &weights);
                weigh(set, &mut [], &[], v);
                rescale(set, &mut [], v);
                let mut marks = vec![0.0; lanes];
                mark_broken(set, &mut marks, &[]);
                assert_eq!(marks, vec![0.0; lanes]);
                let mut sums = vec![7.0; lanes - lanes / 2];
                sum_squares(set, &mut sums, &a[lanes / 2..], lanes);
                let square = |sum: f64, x: f64| x.mul_add(x, sum);
                let of_lane = |lane: usize| a.chunks(lanes).map(move |row| row[lane]);
                let expected: Vec<f64> =
                    (lanes / 2..lanes).map(|lane| of_lane(lane).fold(0.0, square)).collect();
                assert_eq!(sums, expected);
                let mut marks = vec![0.0; lanes];
                mark_broken(set, &mut marks, &broken);
                let is_broken = |(lane, mark): (usize, &f64)| mark.is_nan() == (lane == lanes / 3);
                assert!(marks.iter().enumerate().all(is_broken), "{marks:?}");
            }
        }
    }
}
