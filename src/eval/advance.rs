//! A step along a Taylor series.

use super::processor::dispatched;

dispatched! {
    /// state += c_1 step + c_2 step^2 + ..., with c `[order][component]`; `carry` is what
    /// rounding took before, and then what it takes now.
    pub(crate) fn add_series(
        state: &mut [f64],
        carry: &mut [f64],
        coefficients: &[f64],
        step: f64,
    ) = add_series_body;
}

/// Components whose series are summed side by side, and sums that a series is cut into.
const TOGETHER: usize = 4;

#[inline(always)]
fn add_series_body(state: &mut [f64], carry: &mut [f64], coefficients: &[f64], step: f64) {
    let size = state.len();
    for first in (0..size).step_by(TOGETHER) {
        match size - first {
            1 => add_some::<1>(state, carry, coefficients, first, step),
            2 => add_some::<2>(state, carry, coefficients, first, step),
            3 => add_some::<3>(state, carry, coefficients, first, step),
            _ => add_some::<TOGETHER>(state, carry, coefficients, first, step),
        }
    }
}

/// The same for N components from `first` on. Every `TOGETHER`-th coefficient is summed by
/// itself, so that no sum has to wait for all of the others.
#[inline(always)]
fn add_some<const N: usize>(
    state: &mut [f64],
    carry: &mut [f64],
    coefficients: &[f64],
    first: usize,
    step: f64,
) {
    let size = state.len();
    let square = step * step;
    let fourth = square * square;
    let mut sums = [[0.0_f64; N]; TOGETHER];
    for rows in coefficients.chunks(TOGETHER * size).rev() {
        for (sum, row) in sums.iter_mut().zip(rows.chunks_exact(size)) {
            let row = &row[first..first + N];
            for i in 0..N {
                sum[i] = sum[i].mul_add(fourth, row[i]);
            }
        }
    }
    let [a, b, c, d] = sums;
    for i in 0..N {
        let change = d[i].mul_add(step, c[i]).mul_add(square, b[i].mul_add(step, a[i]));
        let moved = change.mul_add(step, carry[first + i]);
        let sum = state[first + i] + moved;
        carry[first + i] = moved - (sum - state[first + i]);
        state[first + i] = sum;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::InstructionSet;

    #[test]
    fn exponentials_are_the_sums_of_their_series() {
        for size in 1..10 {
            let rate = |i: usize| 0.3 - 0.1 * i as f64;
            let mut row = vec![1.0; size];
            let mut coefficients = Vec::new();
            for k in 1..=22 {
                row.iter_mut().enumerate().for_each(|(i, c)| *c *= rate(i) / f64::from(k));
                coefficients.extend_from_slice(&row);
            }
            let mut found = Vec::new();
            for set in InstructionSet::available() {
                let (mut state, mut carry) = (vec![1.0; size], vec![1e-17; size]);
                add_series(set, &mut state, &mut carry, &coefficients, 0.8);
                for (i, x) in state.iter().enumerate() {
                    assert!((x - (0.8 * rate(i)).exp()).abs() < 4e-16, "{set:?}, component {i}");
                }
                found.push((state, carry));
            }
            assert!(found.iter().all(|of_set| *of_set == found[0]), "{size} components");
        }
    }
}
