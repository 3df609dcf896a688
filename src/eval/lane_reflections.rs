//! Householder reflections of rows of lanes: the arithmetic that frees rows of their states.
//!
//! Every lane has reflections of its own, so that lanes fill registers and nothing is summed
//! across them. Whatever the number of lanes, the results are the same bits.

#![allow(unsafe_code, reason = "bounds are checked once, before the loops over rows")]

use std::ops::Range;

use super::lanes::{REGISTER, fused, load, load_unchecked, store_unchecked};
use super::processor::dispatched;

/// Householder reflections of rows of lanes, each lane with its own.
#[derive(Clone, Copy)]
pub(crate) struct LaneReflections<'a> {
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
    /// reflection after the other while a column is in the nearest cache; only those `among` the
    /// lanes.
    pub(crate) fn reflect_lanes(
        values: &mut [f64],
        by: LaneReflections,
        targets: Range<usize>,
        among: Range<usize>,
    ) = reflect_lanes_body;
}

/// Columns that are reflected together: what they are reflected by is read once for all, and no
/// sum need wait for the one before.
const COLUMNS: usize = 4;

#[inline(always)]
fn reflect_lanes_body(
    values: &mut [f64],
    by: LaneReflections,
    targets: Range<usize>,
    among: Range<usize>,
) {
    let rows = values.len() / (by.columns * by.lanes).max(1);
    if !by.heads && by.dense >= by.factors.len() / by.lanes {
        // What all vectors have is few rows: a column is read and written once.
        match rows - by.dense.min(rows) {
            2 => return reflect_held_columns::<2>(values, by, targets, among),
            4 => return reflect_held_columns::<4>(values, by, targets, among),
            6 => return reflect_held_columns::<6>(values, by, targets, among),
            8 => return reflect_held_columns::<8>(values, by, targets, among),
            _ => {}
        }
    }
    let mut column = targets.start;
    while column + COLUMNS <= targets.end {
        reflect_columns::<COLUMNS>(values, by, column, &among);
        column += COLUMNS;
    }
    while column < targets.end {
        reflect_columns::<1>(values, by, column, &among);
        column += 1;
    }
}

/// Neighbouring columns in some lanes, as many registers side by side as there are lanes for.
#[inline(always)]
fn reflect_columns<const COLUMNS: usize>(
    values: &mut [f64],
    by: LaneReflections,
    column: usize,
    among: &Range<usize>,
) {
    let (mut lane, end) = (among.start, among.end);
    if COLUMNS == 1 {
        lane = reflect_lanes_from::<REGISTER, 8, COLUMNS>(values, by, lane..end, column);
        lane = reflect_lanes_from::<REGISTER, 4, COLUMNS>(values, by, lane..end, column);
    }
    lane = reflect_lanes_from::<REGISTER, 2, COLUMNS>(values, by, lane..end, column);
    lane = reflect_lanes_from::<REGISTER, 1, COLUMNS>(values, by, lane..end, column);
    reflect_lanes_from::<1, 1, COLUMNS>(values, by, lane..end, column);
}

/// `COUNT` times `LANES` of the lanes at a time; the first that is left over.
#[inline(always)]
fn reflect_lanes_from<const LANES: usize, const COUNT: usize, const COLUMNS: usize>(
    values: &mut [f64],
    by: LaneReflections,
    among: Range<usize>,
    column: usize,
) -> usize {
    let mut lane = among.start;
    while lane + COUNT * LANES <= among.end {
        reflect_some::<LANES, COUNT, COLUMNS>(values, by, lane, column);
        lane += COUNT * LANES;
    }
    lane
}

#[inline(always)]
fn reflect_held_columns<const ROWS: usize>(
    values: &mut [f64],
    by: LaneReflections,
    targets: Range<usize>,
    among: Range<usize>,
) {
    let whole = among.end - among.len() % REGISTER;
    for column in targets {
        for lane in (among.start..whole).step_by(REGISTER) {
            reflect_held::<REGISTER, ROWS>(values, by, lane, column);
        }
        for lane in whole..among.end {
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
    let count = factors.len() / lanes;
    assert!(count <= columns && column < columns && lane + LANES <= lanes);
    assert!((dense + ROWS) * stride <= values.len());
    // Where the numbers of a row and column are: all of them are places of `values`.
    let at = |row: usize, column: usize| (dense + row) * stride + column * lanes + lane;
    let mut held = [[0.0; LANES]; ROWS];
    for (row, held) in held.iter_mut().enumerate() {
        // SAFETY: the row, the column and the lanes are there.
        *held = unsafe { *load_unchecked(values, at(row, column)) };
    }
    for k in 0..count {
        let mut sum = [0.0; LANES];
        for (row, held) in held.iter().enumerate() {
            // SAFETY: the row, the vector and the lanes are there.
            sum = fused(unsafe { load_unchecked(values, at(row, k)) }, held, &sum);
        }
        // SAFETY: so many factors there are for each reflection, one a lane.
        let factor: &[f64; LANES] = unsafe { load_unchecked(factors, k * lanes + lane) };
        for i in 0..LANES {
            sum[i] *= factor[i];
        }
        for (row, held) in held.iter_mut().enumerate() {
            // SAFETY: the row, the vector and the lanes are there.
            *held = fused(unsafe { load_unchecked(values, at(row, k)) }, &sum, held);
        }
    }
    for (row, held) in held.iter().enumerate() {
        // SAFETY: the row, the column and the lanes are there.
        unsafe { store_unchecked(values, at(row, column), held) };
    }
}

/// All reflections of some columns in `COUNT` times `LANES` neighbouring lanes.
#[inline(always)]
fn reflect_some<const LANES: usize, const COUNT: usize, const COLUMNS: usize>(
    values: &mut [f64],
    by: LaneReflections,
    lane: usize,
    column: usize,
) {
    let LaneReflections { factors, lanes, columns, dense, heads } = by;
    let (stride, end) = (columns * lanes, values.len());
    let count = factors.len() / lanes;
    if count == 0 {
        return;
    }
    // Vectors stand before the columns, and the last row is as long as the columns need.
    let last = end.saturating_sub(1) / stride * stride;
    assert!(count <= column && lane + COUNT * LANES <= lanes);
    assert!(
        last + (column + COLUMNS) * lanes <= end && (!heads || count * stride <= last + stride)
    );
    for k in 0..count {
        let (v, x) = (k * lanes + lane, column * lanes + lane);
        let below = dense.max(k + 1) * stride;
        let mut sums = [[[0.0; LANES]; COUNT]; COLUMNS];
        if heads {
            // SAFETY: row k is one of the whole rows, and its vector and columns are within it.
            unsafe { add_row(&mut sums, values, k * stride + v, k * stride + x, lanes) };
        }
        for row in (below..end).step_by(stride) {
            // SAFETY: the row is whole, and its vector and columns are within it.
            unsafe { add_row(&mut sums, values, row + v, row + x, lanes) };
        }
        for (piece, at) in (k * lanes + lane..).step_by(LANES).take(COUNT).enumerate() {
            let factor = load::<LANES>(factors, at);
            for sums in &mut sums {
                for i in 0..LANES {
                    sums[piece][i] *= factor[i];
                }
            }
        }
        if heads {
            // SAFETY: as above.
            unsafe { move_row(&sums, values, k * stride + v, k * stride + x, lanes) };
        }
        for row in (below..end).step_by(stride) {
            // SAFETY: as above.
            unsafe { move_row(&sums, values, row + v, row + x, lanes) };
        }
    }
}

/// sums += v x, for the lanes from the places `v` and `x` on.
///
/// # Safety
///
/// All of them are places of `values`.
#[inline(always)]
unsafe fn add_row<const LANES: usize, const COUNT: usize, const COLUMNS: usize>(
    sums: &mut [[[f64; LANES]; COUNT]; COLUMNS],
    values: &[f64],
    v: usize,
    x: usize,
    lanes: usize,
) {
    for piece in 0..COUNT {
        // SAFETY: as the caller promises.
        let v = unsafe { load_unchecked::<LANES>(values, v + piece * LANES) };
        for (column, sums) in sums.iter_mut().enumerate() {
            // SAFETY: as the caller promises.
            let x = unsafe { load_unchecked(values, x + column * lanes + piece * LANES) };
            sums[piece] = fused(v, x, &sums[piece]);
        }
    }
}

/// x += v sums, for the lanes from the places `v` and `x` on.
///
/// # Safety
///
/// All of them are places of `values`.
#[inline(always)]
unsafe fn move_row<const LANES: usize, const COUNT: usize, const COLUMNS: usize>(
    sums: &[[[f64; LANES]; COUNT]; COLUMNS],
    values: &mut [f64],
    v: usize,
    x: usize,
    lanes: usize,
) {
    for piece in 0..COUNT {
        // SAFETY: as the caller promises.
        let v = unsafe { *load_unchecked::<LANES>(values, v + piece * LANES) };
        for (column, sums) in sums.iter().enumerate() {
            let at = x + column * lanes + piece * LANES;
            // SAFETY: as the caller promises.
            unsafe {
                let moved = fused(&v, &sums[piece], load_unchecked(values, at));
                store_unchecked(values, at, &moved);
            }
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
    fn without_reflections_or_rows_nothing_happens() {
        let mut values = numbers(0);
        let by = LaneReflections { factors: &[], lanes: 16, columns: 5, dense: 0, heads: true };
        for set in InstructionSet::available() {
            reflect_lanes(set, &mut values, by, 0..5, 0..16);
            assert!(values.is_empty());
        }
    }

    #[test]
    fn reflections_are_the_same_however_many_rows_and_lanes_there_are() {
        let (vectors, columns) = (3, 8);
        for lanes in [1, 8, 13, 28, 70] {
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
                        let middle = lanes / 16 * 8;
                        for among in [middle..lanes, 0..middle] {
                            reflect_lanes(set, &mut found, by, vectors..columns, among);
                        }
                        assert_eq!(found, expected, "{set:?}, {lanes} lanes, {below} rows");
                    }
                }
            }
        }
    }
}
