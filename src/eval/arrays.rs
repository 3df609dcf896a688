//! Arithmetic over rows of numbers, in the widest registers and fused as in the evaluators.

use super::lanes::load;
use super::processor::dispatched;

dispatched! {
    /// target += a * b, number by number, each rounded once.
    pub(crate) fn add_products(target: &mut [f64], a: &[f64], b: &[f64]) = add_products_body;
}

#[inline(always)]
fn add_products_body(target: &mut [f64], a: &[f64], b: &[f64]) {
    for ((t, a), b) in target.iter_mut().zip(a).zip(b) {
        *t = a.mul_add(*b, *t);
    }
}

dispatched! {
    /// target += a, number by number.
    pub(crate) fn add(target: &mut [f64], a: &[f64]) = add_body;
}

#[inline(always)]
fn add_body(target: &mut [f64], a: &[f64]) {
    for (t, a) in target.iter_mut().zip(a) {
        *t += a;
    }
}

dispatched! {
    /// target *= factor, number by number.
    pub(crate) fn multiply(target: &mut [f64], factor: f64) = multiply_body;
}

#[inline(always)]
fn multiply_body(target: &mut [f64], factor: f64) {
    for t in target {
        *t *= factor;
    }
}

dispatched! {
    /// target += factor * a, number by number, both operations rounded.
    pub(crate) fn add_multiple(target: &mut [f64], a: &[f64], factor: f64) = add_multiple_body;
}

#[inline(always)]
fn add_multiple_body(target: &mut [f64], a: &[f64], factor: f64) {
    for (t, a) in target.iter_mut().zip(a) {
        *t += factor * a;
    }
}

dispatched! {
    /// target = base + factor * a, number by number, both operations rounded.
    pub(crate) fn sum_with_multiple(target: &mut [f64], base: &[f64], a: &[f64], factor: f64)
        = sum_with_multiple_body;
}

#[inline(always)]
fn sum_with_multiple_body(target: &mut [f64], base: &[f64], a: &[f64], factor: f64) {
    for ((t, b), a) in target.iter_mut().zip(base).zip(a) {
        *t = b + factor * a;
    }
}

dispatched! {
    /// sums += the rows `[row][lane]`, each times its weight.
    pub(crate) fn add_weighted_rows(sums: &mut [f64], weights: &[f64], rows: &[f64])
        = add_weighted_rows_body;
}

#[inline(always)]
fn add_weighted_rows_body(sums: &mut [f64], weights: &[f64], rows: &[f64]) {
    let lanes = sums.len().max(1);
    let mut first = 0;
    while first + ROW <= lanes {
        let mut own = [0.0; ROW];
        for (weight, row) in weights.iter().zip(rows.chunks_exact(lanes)) {
            let row: &[f64; ROW] = load(row, first);
            for i in 0..ROW {
                own[i] = weight.mul_add(row[i], own[i]);
            }
        }
        for (sum, own) in sums[first..].iter_mut().zip(own) {
            *sum += own;
        }
        first += ROW;
    }
    for (lane, sum) in sums.iter_mut().enumerate().skip(first) {
        let column = rows.iter().skip(lane).step_by(lanes);
        *sum += weights.iter().zip(column).fold(0.0, |own, (w, x)| w.mul_add(*x, own));
    }
}

dispatched! {
    /// Adds the sum of the squares of each row of `lanes` numbers to its place in `sums`.
    pub(crate) fn add_squares(sums: &mut [f64], rows: &[f64], lanes: usize) = add_squares_body;
}

#[inline(always)]
fn add_squares_body(sums: &mut [f64], rows: &[f64], lanes: usize) {
    for (sum, row) in sums.iter_mut().zip(rows.chunks_exact(lanes.max(1))) {
        let mut parts = [0.0; PARTS];
        let mut chunks = row.chunks_exact(PARTS);
        for chunk in &mut chunks {
            add_parts(&mut parts, chunk, chunk);
        }
        *sum += parts.iter().sum::<f64>();
        *sum += chunks.remainder().iter().map(|x| x * x).sum::<f64>();
    }
}

dispatched! {
    /// state += change * scale, with what rounding loses carried on to the next change: a sum
    /// of any number of changes is then rounded about once (Kahan, Comm. ACM 8, 1965). All
    /// slices are `[rows][lanes]` but `scale`, `[lanes]`. A lane with scale 0 does not move,
    /// whatever its change is.
    pub(crate) fn add_carrying(state: &mut [f64], carry: &mut [f64], change: &[f64], scale: &[f64])
        = add_carrying_body;
}

#[inline(always)]
fn add_carrying_body(state: &mut [f64], carry: &mut [f64], change: &[f64], scale: &[f64]) {
    if scale.is_empty() {
        return;
    }
    let lanes = scale.len();
    let rows = state.chunks_exact_mut(lanes).zip(carry.chunks_exact_mut(lanes));
    for ((state, carry), change) in rows.zip(change.chunks_exact(lanes)) {
        for lane in 0..lanes {
            let moved = change[lane].mul_add(scale[lane], carry[lane]);
            let moved = if scale[lane] == 0.0 { 0.0 } else { moved };
            let sum = state[lane] + moved;
            carry[lane] = moved - (sum - state[lane]);
            state[lane] = sum;
        }
    }
}

/// Numbers that are summed side by side.
const PARTS: usize = 8;

/// Lanes that are summed side by side: four registers of the widest processor, as a sum waits four
/// steps for the one before.
const ROW: usize = 32;

#[inline(always)]
fn add_parts(sums: &mut [f64; PARTS], a: &[f64], b: &[f64]) {
    for i in 0..PARTS {
        sums[i] = a[i].mul_add(b[i], sums[i]);
    }
}

dispatched! {
    /// The squared length of row R^-1 of every lane. `row` is `[column][lane]`, R stands in
    /// `triangle` as `[row][columns][lane]`, one over its diagonal in `inverse`, `[column][lane]`;
    /// `solved` is scratch memory of the size of `row`.
    pub(crate) fn leverages(
        leverage: &mut [f64],
        solved: &mut [f64],
        row: &[f64],
        triangle: &[f64],
        inverse: &[f64],
        columns: usize,
    ) = leverages_body;
}

#[inline(always)]
fn leverages_body(
    leverage: &mut [f64],
    solved: &mut [f64],
    row: &[f64],
    triangle: &[f64],
    inverse: &[f64],
    columns: usize,
) {
    let lanes = leverage.len();
    leverage.fill(0.0);
    for (c, (entries, inverse)) in
        row.chunks_exact(lanes).zip(inverse.chunks_exact(lanes)).enumerate()
    {
        let (done, rest) = solved.split_at_mut(c * lanes);
        let own = &mut rest[..lanes];
        own.copy_from_slice(entries);
        for (r, known) in done.chunks_exact(lanes).enumerate() {
            let factor = &triangle[(r * columns + c) * lanes..][..lanes];
            for ((x, f), k) in own.iter_mut().zip(factor).zip(known) {
                *x = f.mul_add(-k, *x);
            }
        }
        for ((x, inverse), leverage) in own.iter_mut().zip(inverse).zip(&mut *leverage) {
            *x *= inverse;
            *leverage = x.mul_add(*x, *leverage);
        }
    }
}

/// What a comparison of one row of lanes fills, one number for each.
pub(crate) struct Compared<'a> {
    /// `weight (measured - predicted)`.
    pub residuals: &'a mut [f64],
    /// What each residual was multiplied by.
    pub weights: &'a mut [f64],
    /// The squares of the residuals.
    pub squares: &'a mut [f64],
    /// The same added to what stands here.
    pub losses: &'a mut [f64],
}

impl Compared<'_> {
    /// The same places, lent on.
    pub(crate) fn again(&mut self) -> Compared<'_> {
        let Compared { residuals, weights, squares, losses } = self;
        Compared { residuals, weights, squares, losses }
    }
}

dispatched! {
    /// Weighted residuals of one row of lanes. Where nothing was measured (not a number) all is
    /// zero; where the prediction is not finite so it is, and the loss is infinite.
    pub(crate) fn compare(out: Compared, measured: &[f64], predicted: &[f64], weight: f64) = compare_body;
}

#[inline(always)]
fn compare_body(out: Compared, measured: &[f64], predicted: &[f64], weight: f64) {
    let lanes = measured.len();
    let predicted = &predicted[..lanes];
    let (residuals, weights) = (&mut out.residuals[..lanes], &mut out.weights[..lanes]);
    let (squares, losses) = (&mut out.squares[..lanes], &mut out.losses[..lanes]);
    for lane in 0..lanes {
        let residual = weight * (measured[lane] - predicted[lane]);
        let seen = !measured[lane].is_nan();
        let kept = seen && residual.abs() < f64::INFINITY;
        let square = residual * residual;
        residuals[lane] = if kept { residual } else { 0.0 };
        weights[lane] = if kept { weight } else { 0.0 };
        squares[lane] = if kept { square } else { 0.0 };
        let lost = if seen { f64::INFINITY } else { 0.0 };
        losses[lane] += if kept { square } else { lost };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::InstructionSet;

    #[test]
    fn weighted_rows_are_summed_alike_for_every_number_of_lanes() {
        let weights: Vec<f64> = (0..7).map(|k| 0.3 + f64::from(k)).collect();
        for set in InstructionSet::available() {
            for lanes in [1, 8, ROW - 1, ROW, 2 * ROW + 3] {
                let rows: Vec<f64> = (0..7 * lanes).map(|i| (i as f64).sin()).collect();
                let mut sums = vec![0.5; lanes];
                add_weighted_rows(set, &mut sums, &weights, &rows);
                for (lane, sum) in sums.iter().enumerate() {
                    let own = rows.iter().skip(lane).step_by(lanes);
                    let expected: f64 = own.zip(&weights).map(|(x, weight)| x * weight).sum();
                    assert!((sum - 0.5 - expected).abs() < 1e-12, "{set:?} {lanes} {lane}");
                }
            }
        }
    }
}
