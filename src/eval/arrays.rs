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

dispatched! {
    /// The Householder reflection I - v v' / (v_0 |v_0 - beta|) of one column, taken to others:
    /// `columns` holds `[column][height]` with `stride` between them, `heads` the entry of each
    /// above its rows. For every column x: w = tau (head + v x), head -= w, x -= w v.
    pub fn reflect(v: &[f64], tau: f64, heads: &mut [f64], columns: &mut [f64], stride: usize)
        = reflect_body;
}

/// Numbers that are summed side by side.
const PARTS: usize = 8;

#[inline(always)]
fn reflect_body(v: &[f64], tau: f64, heads: &mut [f64], columns: &mut [f64], stride: usize) {
    let height = v.len();
    let whole = height / PARTS * PARTS;
    for (head, column) in heads.iter_mut().zip(columns.chunks_mut(stride)) {
        let column = &mut column[..height];
        let mut sums = [[0.0; PARTS]; 2];
        let mut parts = v[..whole].chunks_exact(PARTS).zip(column.chunks_exact(PARTS));
        while let Some((a, b)) = parts.next() {
            add_parts(&mut sums[0], a, b);
            let Some((a, b)) = parts.next() else { break };
            add_parts(&mut sums[1], a, b);
        }
        let mut sum = *head;
        let [even, odd] = sums;
        sum += even.iter().zip(odd).map(|(a, b)| a + b).sum::<f64>();
        for i in whole..height {
            sum += v[i] * column[i];
        }
        let w = tau * sum;
        *head -= w;
        for (x, v) in column.iter_mut().zip(v) {
            *x = v.mul_add(-w, *x);
        }
    }
}

#[inline(always)]
fn add_parts(sums: &mut [f64; PARTS], a: &[f64], b: &[f64]) {
    for i in 0..PARTS {
        sums[i] = a[i].mul_add(b[i], sums[i]);
    }
}

dispatched! {
    /// Householder reflections, each lane with its own. `values` is `[row][columns][lane]` with
    /// the vector v of the k-th reflection in its column k, from row k on; `factors` is
    /// `[reflection][lane]`. x -= factor (v x) v for the columns `targets`, one reflection after
    /// the other while a column is in the nearest cache.
    pub fn reflect_lanes(
        values: &mut [f64],
        factors: &[f64],
        lanes: usize,
        columns: usize,
        targets: Range<usize>,
    ) = reflect_lanes_body;
}

/// Lanes whose sums stay in the nearest cache.
const SIDE_BY_SIDE: usize = 64;

#[inline(always)]
fn reflect_lanes_body(
    values: &mut [f64],
    factors: &[f64],
    lanes: usize,
    columns: usize,
    targets: Range<usize>,
) {
    let mut sums = [0.0; SIDE_BY_SIDE];
    for start in (0..lanes).step_by(SIDE_BY_SIDE) {
        let width = SIDE_BY_SIDE.min(lanes - start);
        let sums = &mut sums[..width];
        for column in targets.clone() {
            for (k, factor) in factors.chunks_exact(lanes).enumerate() {
                let (v, x) = (k * lanes + start, column * lanes + start);
                sums.fill(0.0);
                for row in values.chunks(columns * lanes).skip(k) {
                    add_products_body(sums, &row[v..][..width], &row[x..][..width]);
                }
                for (sum, factor) in sums.iter_mut().zip(&factor[start..]) {
                    *sum *= -factor;
                }
                for row in values.chunks_mut(columns * lanes).skip(k) {
                    let (left, right) = row.split_at_mut(x);
                    add_products_body(&mut right[..width], &left[v..][..width], sums);
                }
            }
        }
    }
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
