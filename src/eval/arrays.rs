//! Arithmetic over rows of numbers, in the widest registers and fused as in the evaluators.

use std::ops::Range;

use super::processor::dispatched;

dispatched! {
    /// target += a * b, number by number, each rounded once.
    pub fn add_products(target: &mut [f64], a: &[f64], b: &[f64]) = add_products_body;
}

#[inline(always)]
fn add_products_body(target: &mut [f64], a: &[f64], b: &[f64]) {
    for ((t, a), b) in target.iter_mut().zip(a).zip(b) {
        *t = a.mul_add(*b, *t);
    }
}

dispatched! {
    /// target += a, number by number.
    pub fn add(target: &mut [f64], a: &[f64]) = add_body;
}

#[inline(always)]
fn add_body(target: &mut [f64], a: &[f64]) {
    for (t, a) in target.iter_mut().zip(a) {
        *t += a;
    }
}

dispatched! {
    /// target += factor * a, number by number, both operations rounded.
    pub fn add_multiple(target: &mut [f64], a: &[f64], factor: f64) = add_multiple_body;
}

#[inline(always)]
fn add_multiple_body(target: &mut [f64], a: &[f64], factor: f64) {
    for (t, a) in target.iter_mut().zip(a) {
        *t += factor * a;
    }
}

dispatched! {
    /// target = base + factor * a, number by number, both operations rounded.
    pub fn sum_with_multiple(target: &mut [f64], base: &[f64], a: &[f64], factor: f64)
        = sum_with_multiple_body;
}

#[inline(always)]
fn sum_with_multiple_body(target: &mut [f64], base: &[f64], a: &[f64], factor: f64) {
    for ((t, b), a) in target.iter_mut().zip(base).zip(a) {
        *t = b + factor * a;
    }
}

dispatched! {
    /// target = a * weight, row after row of lanes.
    pub fn set_weighted(target: &mut [f64], a: &[f64], weight: &[f64]) = set_weighted_body;
}

#[inline(always)]
fn set_weighted_body(target: &mut [f64], a: &[f64], weight: &[f64]) {
    if weight.is_empty() {
        return;
    }
    let lanes = weight.len();
    for (target, a) in target.chunks_exact_mut(lanes).zip(a.chunks_exact(lanes)) {
        for ((t, a), w) in target.iter_mut().zip(a).zip(weight) {
            *t = a * w;
        }
    }
}

dispatched! {
    /// target += a * weight, row after row of lanes, each number rounded once.
    pub fn add_weighted(target: &mut [f64], a: &[f64], weight: &[f64]) = add_weighted_body;
}

#[inline(always)]
fn add_weighted_body(target: &mut [f64], a: &[f64], weight: &[f64]) {
    if weight.is_empty() {
        return;
    }
    let lanes = weight.len();
    for (target, a) in target.chunks_exact_mut(lanes).zip(a.chunks_exact(lanes)) {
        add_products_body(target, a, weight);
    }
}

dispatched! {
    /// The same for two rows at once, `target += a * weights[0] + b * weights[1]`; the weights
    /// are `[2][lanes]`.
    pub fn add_weighted_pair(target: &mut [f64], a: &[f64], b: &[f64], weights: &[f64])
        = add_weighted_pair_body;
}

#[inline(always)]
fn add_weighted_pair_body(target: &mut [f64], a: &[f64], b: &[f64], weights: &[f64]) {
    if weights.is_empty() {
        return;
    }
    let (first, second) = weights.split_at(weights.len() / 2);
    let lanes = first.len();
    let sources = a.chunks_exact(lanes).zip(b.chunks_exact(lanes));
    for (target, (a, b)) in target.chunks_exact_mut(lanes).zip(sources) {
        for ((t, (a, b)), (v, w)) in
            target.iter_mut().zip(a.iter().zip(b)).zip(first.iter().zip(second))
        {
            *t = b.mul_add(*w, a.mul_add(*v, *t));
        }
    }
}

dispatched! {
    /// rows *= scale, row after row of lanes; zero where the scale is, whatever stands there.
    pub fn rescale(rows: &mut [f64], scale: &[f64]) = rescale_body;
}

#[inline(always)]
fn rescale_body(rows: &mut [f64], scale: &[f64]) {
    if scale.is_empty() {
        return;
    }
    for row in rows.chunks_exact_mut(scale.len()) {
        for (value, &factor) in row.iter_mut().zip(scale) {
            let product = *value * factor;
            *value = if factor == 0.0 { 0.0 } else { product };
        }
    }
}

dispatched! {
    /// Adds 0 to the mark of each lane, or what is not a number where any of its rows is not
    /// finite.
    pub fn mark_broken(marks: &mut [f64], rows: &[f64]) = mark_broken_body;
}

#[inline(always)]
fn mark_broken_body(marks: &mut [f64], rows: &[f64]) {
    if marks.is_empty() {
        return;
    }
    for row in rows.chunks_exact(marks.len()) {
        for (mark, x) in marks.iter_mut().zip(row) {
            *mark = x.mul_add(0.0, *mark);
        }
    }
}

dispatched! {
    /// Adds the sum of the squares of each row of `lanes` numbers to its place in `sums`.
    pub fn add_squares(sums: &mut [f64], rows: &[f64], lanes: usize) = add_squares_body;
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
    pub fn add_carrying(state: &mut [f64], carry: &mut [f64], change: &[f64], scale: &[f64])
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

#[inline(always)]
fn add_parts(sums: &mut [f64; PARTS], a: &[f64], b: &[f64]) {
    for i in 0..PARTS {
        sums[i] = a[i].mul_add(b[i], sums[i]);
    }
}

/// a b + c, number by number, each rounded once.
///
/// Closures, and so `array::from_fn`, are compiled for the plain instruction set: without them
/// a body stays in the registers that it is dispatched for.
#[inline(always)]
fn fused<const N: usize>(a: &[f64; N], b: &[f64; N], c: &[f64; N]) -> [f64; N] {
    let mut sum = [0.0; N];
    for i in 0..N {
        sum[i] = a[i].mul_add(b[i], c[i]);
    }
    sum
}

/// Householder reflections of rows of lanes, each lane with its own.
#[derive(Clone, Copy)]
pub struct LaneReflections<'a> {
    /// `[reflection][lane]`: x becomes x + factor (v x) v.
    pub factors: &'a [f64],
    /// Number of lanes.
    pub lanes: usize,
    /// Columns of every row; the vector of the k-th reflection is column k, from row k on.
    pub columns: usize,
    /// Rows before this one that are not k are zero in the k-th vector.
    pub dense: usize,
    /// Whether row k of the columns takes part; where it is zero and nobody looks at what it
    /// becomes, it need not.
    pub heads: bool,
}

dispatched! {
    /// Takes reflections to the columns `targets` of `values`, `[row][columns][lane]`, one
    /// reflection after the other while a column is in the nearest cache.
    pub fn reflect_lanes(values: &mut [f64], by: LaneReflections, targets: Range<usize>)
        = reflect_lanes_body;
}

/// Lanes that fill the widest register.
const REGISTER: usize = 8;
/// Registers that are summed side by side: a sum need not wait for the one before.
const PIECES: usize = 8;
const WIDE: usize = PIECES * REGISTER;

#[inline(always)]
fn reflect_lanes_body(values: &mut [f64], by: LaneReflections, targets: Range<usize>) {
    let lanes = by.lanes;
    let (wide, whole) = (lanes / WIDE * WIDE, lanes / REGISTER * REGISTER);
    let rows = values.len() / (by.columns * lanes).max(1);
    if !by.heads && by.dense >= by.factors.len() / lanes {
        // What all vectors have is few rows: a column is read and written once.
        match rows - by.dense.min(rows) {
            2 => return reflect_held_columns::<2>(values, by, targets),
            4 => return reflect_held_columns::<4>(values, by, targets),
            6 => return reflect_held_columns::<6>(values, by, targets),
            8 => return reflect_held_columns::<8>(values, by, targets),
            _ => {}
        }
    }
    for column in targets {
        for lane in (0..wide).step_by(WIDE) {
            reflect_some::<REGISTER, PIECES>(values, by, lane, column);
        }
        for lane in (wide..whole).step_by(REGISTER) {
            reflect_some::<REGISTER, 1>(values, by, lane, column);
        }
        for lane in whole..lanes {
            reflect_some::<1, 1>(values, by, lane, column);
        }
    }
}

#[inline(always)]
fn reflect_held_columns<const ROWS: usize>(
    values: &mut [f64],
    by: LaneReflections,
    targets: Range<usize>,
) {
    let lanes = by.lanes;
    let whole = lanes / REGISTER * REGISTER;
    for column in targets {
        for lane in (0..whole).step_by(REGISTER) {
            reflect_held::<REGISTER, ROWS>(values, by, lane, column);
        }
        for lane in whole..lanes {
            reflect_held::<1, ROWS>(values, by, lane, column);
        }
    }
}

/// All reflections of one column in neighbouring lanes: its last rows alone, held in registers.
#[inline(always)]
fn reflect_held<const LANES: usize, const ROWS: usize>(
    values: &mut [f64],
    by: LaneReflections,
    lane: usize,
    column: usize,
) {
    let LaneReflections { factors, lanes, columns, dense, .. } = by;
    let stride = columns * lanes;
    let mut held = [[0.0; LANES]; ROWS];
    for (row, held) in held.iter_mut().enumerate() {
        *held = *load(values, (dense + row) * stride + column * lanes + lane);
    }
    for k in 0..factors.len() / lanes {
        let mut sum = [0.0; LANES];
        for (row, held) in held.iter().enumerate() {
            sum = fused(load(values, (dense + row) * stride + k * lanes + lane), held, &sum);
        }
        let factor = load::<LANES>(factors, k * lanes + lane);
        for i in 0..LANES {
            sum[i] *= factor[i];
        }
        for (row, held) in held.iter_mut().enumerate() {
            *held = fused(load(values, (dense + row) * stride + k * lanes + lane), &sum, held);
        }
    }
    for (row, held) in held.iter().enumerate() {
        let at = (dense + row) * stride + column * lanes + lane;
        values[at..][..LANES].copy_from_slice(held);
    }
}

/// All reflections of one column in `COUNT` times `LANES` neighbouring lanes.
#[inline(always)]
fn reflect_some<const LANES: usize, const COUNT: usize>(
    values: &mut [f64],
    by: LaneReflections,
    lane: usize,
    column: usize,
) {
    let LaneReflections { factors, lanes, columns, dense, heads } = by;
    let (stride, end) = (columns * lanes, values.len());
    for k in 0..factors.len() / lanes {
        let (v, x) = (k * lanes + lane, column * lanes + lane);
        let below = dense.max(k + 1) * stride;
        let mut sums = [[0.0; LANES]; COUNT];
        if heads {
            add_row(&mut sums, values, k * stride + v, k * stride + x);
        }
        for row in (below..end).step_by(stride) {
            add_row(&mut sums, values, row + v, row + x);
        }
        for (piece, sum) in sums.iter_mut().enumerate() {
            let factor = load::<LANES>(factors, k * lanes + lane + piece * LANES);
            for i in 0..LANES {
                sum[i] *= factor[i];
            }
        }
        if heads {
            move_row(&sums, values, k * stride + v, k * stride + x);
        }
        for row in (below..end).step_by(stride) {
            move_row(&sums, values, row + v, row + x);
        }
    }
}

/// sums += v x, for the lanes from the places `v` and `x` on.
#[inline(always)]
fn add_row<const LANES: usize, const COUNT: usize>(
    sums: &mut [[f64; LANES]; COUNT],
    values: &[f64],
    v: usize,
    x: usize,
) {
    for (piece, sum) in sums.iter_mut().enumerate() {
        let v = load::<LANES>(values, v + piece * LANES);
        *sum = fused(v, load(values, x + piece * LANES), sum);
    }
}

/// x += v sums, for the lanes from the places `v` and `x` on.
#[inline(always)]
fn move_row<const LANES: usize, const COUNT: usize>(
    sums: &[[f64; LANES]; COUNT],
    values: &mut [f64],
    v: usize,
    x: usize,
) {
    for (piece, sum) in sums.iter().enumerate() {
        let at = x + piece * LANES;
        let moved = fused(load(values, v + piece * LANES), sum, load(values, at));
        values[at..][..LANES].copy_from_slice(&moved);
    }
}

/// Neighbouring numbers from a place on; zeros where there are not so many.
#[inline(always)]
fn load<const LANES: usize>(values: &[f64], at: usize) -> &[f64; LANES] {
    values[at..].first_chunk().unwrap_or(const { &[0.0; LANES] })
}

dispatched! {
    /// The squared length of row R^-1 of every lane. `row` is `[column][lane]`, R stands in
    /// `triangle` as `[row][columns][lane]`, one over its diagonal in `inverse`, `[column][lane]`;
    /// `solved` is scratch memory of the size of `row`.
    pub fn leverages(
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
pub struct Compared<'a> {
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
    pub fn again(&mut self) -> Compared<'_> {
        let Compared { residuals, weights, squares, losses } = self;
        Compared { residuals, weights, squares, losses }
    }
}

dispatched! {
    /// Weighted residuals of one row of lanes. Where nothing was measured (not a number) all is
    /// zero; where the prediction is not finite so it is, and the loss is infinite.
    pub fn compare(out: Compared, measured: &[f64], predicted: &[f64], weight: f64) = compare_body;
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

dispatched! {
    /// target = from * scale, row after row of lanes; zero where the scale is, whatever stands
    /// in `from`.
    pub fn weigh(target: &mut [f64], from: &[f64], scale: &[f64]) = weigh_body;
}

#[inline(always)]
fn weigh_body(target: &mut [f64], from: &[f64], scale: &[f64]) {
    if scale.is_empty() {
        return;
    }
    let lanes = scale.len();
    for (target, from) in target.chunks_exact_mut(lanes).zip(from.chunks_exact(lanes)) {
        for ((t, x), s) in target.iter_mut().zip(from).zip(scale) {
            *t = if *s == 0.0 { 0.0 } else { x * s };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::InstructionSet;

    /// Rows of `[column][lane]`: vectors in the first columns, what they reflect in the last.
    fn numbers(count: usize) -> Vec<f64> {
        (0..count).map(|at| (0.7 * at as f64 + 0.3).sin()).collect()
    }

    #[test]
    fn reflections_are_the_same_however_many_rows_and_lanes_there_are() {
        let (vectors, columns) = (3, 5);
        for lanes in [1, 8, 13, 64, 70] {
            for below in 1..=9 {
                let rows = vectors + below;
                let stride = columns * lanes;
                let mut start = numbers(rows * stride);
                // Rows above those that all vectors have: nothing but zeros.
                start[..vectors * stride].fill(0.0);
                let factors: Vec<f64> = numbers(vectors * lanes).iter().map(|x| 0.2 * x).collect();
                let mut expected = start.clone();
                let place =
                    |row: usize, column: usize, lane: usize| row * stride + column * lanes + lane;
                for (column, lane) in
                    (vectors..columns).flat_map(|c| (0..lanes).map(move |l| (c, l)))
                {
                    for k in 0..vectors {
                        let mut sum = 0.0;
                        for row in vectors..rows {
                            let v = expected[place(row, k, lane)];
                            sum = v.mul_add(expected[place(row, column, lane)], sum);
                        }
                        sum *= factors[k * lanes + lane];
                        for row in vectors..rows {
                            let v = expected[place(row, k, lane)];
                            let x = &mut expected[place(row, column, lane)];
                            *x = v.mul_add(sum, *x);
                        }
                    }
                }
                for set in InstructionSet::available() {
                    for heads in [false, true] {
                        let by = LaneReflections {
                            factors: &factors,
                            lanes,
                            columns,
                            dense: vectors,
                            heads,
                        };
                        let mut found = start.clone();
                        reflect_lanes(set, &mut found, by, vectors..columns);
                        assert_eq!(found, expected, "{set:?}, {lanes} lanes, {below} rows");
                    }
                }
            }
        }
    }
}
