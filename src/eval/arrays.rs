//! Arithmetic over rows of numbers, in the widest registers and fused as in the evaluators.

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
