//! Sparse algebra of eight problems of the same pattern side by side.
//!
//! An entry of a matrix is eight numbers, one for each problem, which fill a register: where its
//! neighbours stand is looked up once for all of them.

use super::lanes::REGISTER;
use super::processor::dispatched;

/// One number of each of eight problems.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C, align(64))]
pub(crate) struct Eight(pub(crate) [f64; REGISTER]);

/// No place: what would go there is dropped.
pub(crate) const NOWHERE: u32 = u32::MAX;

impl Eight {
    /// Zero in every problem.
    pub(crate) const ZERO: Eight = Eight([0.0; REGISTER]);

    /// The same number in every problem.
    pub(crate) const fn all(number: f64) -> Eight {
        Eight([number; REGISTER])
    }

    /// The sum over the problems, by halves.
    pub(crate) fn sum(&self) -> f64 {
        let [a, b, c, d, e, f, g, h] = self.0;
        ((a + e) + (c + g)) + ((b + f) + (d + h))
    }

    /// The largest size among the problems.
    pub(crate) fn largest(&self) -> f64 {
        self.0.iter().fold(0.0f64, |most, x| most.max(x.abs()))
    }

    /// self += a b, each problem rounded once.
    #[inline(always)]
    pub(crate) fn add_product(&mut self, a: &Eight, b: &Eight) {
        for lane in 0..REGISTER {
            self.0[lane] = a.0[lane].mul_add(b.0[lane], self.0[lane]);
        }
    }

    /// self -= a b, each problem rounded once.
    #[inline(always)]
    pub(super) fn subtract_product(&mut self, a: &Eight, b: &Eight) {
        for lane in 0..REGISTER {
            self.0[lane] = (-a.0[lane]).mul_add(b.0[lane], self.0[lane]);
        }
    }

    #[inline(always)]
    pub(super) fn times(&self, b: &Eight) -> Eight {
        let mut product = *self;
        for lane in 0..REGISTER {
            product.0[lane] *= b.0[lane];
        }
        product
    }
}

dispatched! {
    /// target[t] += weight source[s] for every pair (t, s).
    pub(crate) fn add_multiples(
        target: &mut [Eight],
        source: &[Eight],
        pairs: &[(u32, u32)],
        weight: &Eight,
    ) = add_multiples_body;
}

#[inline(always)]
fn add_multiples_body(
    target: &mut [Eight],
    source: &[Eight],
    pairs: &[(u32, u32)],
    weight: &Eight,
) {
    for &(t, s) in pairs {
        target[t as usize].add_product(&source[s as usize], weight);
    }
}

dispatched! {
    /// target = from weight, entry by entry; zero where the weight is, whatever stands in `from`.
    pub(crate) fn weigh_entries(target: &mut [Eight], from: &[Eight], weight: &Eight)
        = weigh_entries_body;
}

#[inline(always)]
fn weigh_entries_body(target: &mut [Eight], from: &[Eight], weight: &Eight) {
    for (target, from) in target.iter_mut().zip(from) {
        for lane in 0..REGISTER {
            let (x, w) = (from.0[lane], weight.0[lane]);
            target.0[lane] = if w == 0.0 { 0.0 } else { x * w };
        }
    }
}

dispatched! {
    /// out[places[i, j]] += a[i] b[j] + c[i] d[j] wherever there is a place, row after row of
    /// `places`: two rows of a matrix at once, so that what is added to moves half as often.
    pub(crate) fn add_outer(
        out: &mut [Eight],
        a: &[Eight],
        b: &[Eight],
        c: &[Eight],
        d: &[Eight],
        places: &[u32],
    ) = add_outer_body;
}

#[inline(always)]
fn add_outer_body(
    out: &mut [Eight],
    a: &[Eight],
    b: &[Eight],
    c: &[Eight],
    d: &[Eight],
    places: &[u32],
) {
    for ((a, c), places) in a.iter().zip(c).zip(places.chunks_exact(b.len().max(1))) {
        for ((b, d), &place) in b.iter().zip(d).zip(places) {
            if place != NOWHERE {
                let into = &mut out[place as usize];
                into.add_product(a, b);
                into.add_product(c, d);
            }
        }
    }
}

dispatched! {
    /// out[places[i, j]] += a[i] a[j] + b[i] b[j] for j <= i wherever there is a place; `places` is
    /// the lower triangle, row after row.
    pub(crate) fn add_lower(out: &mut [Eight], a: &[Eight], b: &[Eight], places: &[u32])
        = add_lower_body;
}

#[inline(always)]
fn add_lower_body(out: &mut [Eight], a: &[Eight], b: &[Eight], places: &[u32]) {
    let mut rest = places;
    for i in 0..a.len().min(b.len()) {
        let (row, after) = rest.split_at(i + 1);
        for (j, &place) in row.iter().enumerate() {
            if place != NOWHERE {
                let into = &mut out[place as usize];
                into.add_product(&a[i], &a[j]);
                into.add_product(&b[i], &b[j]);
            }
        }
        rest = after;
    }
}

dispatched! {
    /// out[places[i]] += a[i] weight.
    pub(crate) fn add_scattered(out: &mut [Eight], a: &[Eight], weight: &Eight, places: &[u32])
        = add_scattered_body;
}

#[inline(always)]
fn add_scattered_body(out: &mut [Eight], a: &[Eight], weight: &Eight, places: &[u32]) {
    for (a, &place) in a.iter().zip(places) {
        out[place as usize].add_product(a, weight);
    }
}

dispatched! {
    /// out[places[i]] += a[i]^2.
    pub(crate) fn add_entry_squares(out: &mut [Eight], a: &[Eight], places: &[u32])
        = add_entry_squares_body;
}

#[inline(always)]
fn add_entry_squares_body(out: &mut [Eight], a: &[Eight], places: &[u32]) {
    for (a, &place) in a.iter().zip(places) {
        out[place as usize].add_product(a, a);
    }
}

dispatched! {
    /// out += a[i] b[places[i]] over all i that have a place, or -= for `minus`.
    pub(crate) fn add_gathered(
        out: &mut Eight,
        a: &[Eight],
        b: &[Eight],
        places: &[u32],
        minus: bool,
    ) = add_gathered_body;
}

#[inline(always)]
fn add_gathered_body(out: &mut Eight, a: &[Eight], b: &[Eight], places: &[u32], minus: bool) {
    let mut sum = Eight::ZERO;
    for (a, &place) in a.iter().zip(places) {
        if place != NOWHERE {
            sum.add_product(a, &b[place as usize]);
        }
    }
    let sign = if minus { -1.0 } else { 1.0 };
    for lane in 0..REGISTER {
        out.0[lane] += sign * sum.0[lane];
    }
}

/// Rows of a factor, or right-hand sides, that are worked on together: no sum waits for itself.
const TOGETHER: usize = 4;

dispatched! {
    /// The Cholesky factor L of a symmetric matrix of so many rows, in its place: lower triangle,
    /// row after row. `inverse` gets one over the diagonal of L; zero where a pivot is no more
    /// than the part `least` of the diagonal it comes from: that unknown is left at zero.
    pub(crate) fn factorise(matrix: &mut [Eight], inverse: &mut [Eight], least: f64)
        = factorise_body;
}

#[inline(always)]
fn factorise_body(matrix: &mut [Eight], inverse: &mut [Eight], least: f64) {
    let size = inverse.len();
    for i in 0..size {
        let (above, own) = matrix.split_at_mut(i * (i + 1) / 2);
        let own = &mut own[..i + 1];
        let mut j = 0;
        while j < i {
            let count = TOGETHER.min(i - j);
            let mut sums = [Eight::ZERO; TOGETHER];
            if count == TOGETHER {
                let row = |m: usize| &above[(j + m) * (j + m + 1) / 2..][..j];
                let rows = [row(0), row(1), row(2), row(3)];
                for (k, x) in own[..j].iter().enumerate() {
                    for m in 0..TOGETHER {
                        sums[m].add_product(x, &rows[m][k]);
                    }
                }
            } else {
                for m in 0..count {
                    let row = &above[(j + m) * (j + m + 1) / 2..][..j];
                    for (x, y) in own[..j].iter().zip(row) {
                        sums[m].add_product(x, y);
                    }
                }
            }
            for (m, sum) in sums.iter().enumerate().take(count) {
                let at = j + m;
                let row = &above[at * (at + 1) / 2..][..at];
                let mut left = own[at];
                for lane in 0..REGISTER {
                    left.0[lane] -= sum.0[lane];
                }
                for k in j..at {
                    left.subtract_product(&own[k], &row[k]);
                }
                own[at] = left.times(&inverse[at]);
            }
            j += count;
        }
        let mut left = own[i];
        for x in &own[..i] {
            left.subtract_product(x, x);
        }
        for lane in 0..REGISTER {
            let (before, pivot) = (own[i].0[lane], left.0[lane]);
            let sound = pivot > least * before && pivot > 0.0;
            own[i].0[lane] = if sound { pivot.sqrt() } else { 0.0 };
            inverse[i].0[lane] = if sound { 1.0 / pivot.sqrt() } else { 0.0 };
        }
    }
}

dispatched! {
    /// L^-1 times right-hand sides, `[side][row]`, which are zero before row `from`.
    pub(crate) fn solve_lower(factor: &[Eight], inverse: &[Eight], sides: &mut [Eight], from: usize)
        = solve_lower_body;
}

#[inline(always)]
fn solve_lower_body(factor: &[Eight], inverse: &[Eight], sides: &mut [Eight], from: usize) {
    let size = inverse.len();
    let mut groups = sides.chunks_exact_mut((TOGETHER * size).max(1));
    for group in &mut groups {
        let (a, rest) = group.split_at_mut(size);
        let (b, rest) = rest.split_at_mut(size);
        let (c, d) = rest.split_at_mut(size);
        for i in from..size {
            let row = &factor[i * (i + 1) / 2..][from..i];
            let mut sums = [a[i], b[i], c[i], d[i]];
            for (k, l) in row.iter().enumerate() {
                sums[0].subtract_product(l, &a[from + k]);
                sums[1].subtract_product(l, &b[from + k]);
                sums[2].subtract_product(l, &c[from + k]);
                sums[3].subtract_product(l, &d[from + k]);
            }
            a[i] = sums[0].times(&inverse[i]);
            b[i] = sums[1].times(&inverse[i]);
            c[i] = sums[2].times(&inverse[i]);
            d[i] = sums[3].times(&inverse[i]);
        }
    }
    for side in groups.into_remainder().chunks_exact_mut(size.max(1)) {
        for i in from..size {
            let row = &factor[i * (i + 1) / 2..][from..i];
            let mut sum = side[i];
            for (l, x) in row.iter().zip(&side[from..]) {
                sum.subtract_product(l, x);
            }
            side[i] = sum.times(&inverse[i]);
        }
    }
}

dispatched! {
    /// L'^-1 times right-hand sides, `[side][row]`.
    pub(crate) fn solve_upper(factor: &[Eight], inverse: &[Eight], sides: &mut [Eight])
        = solve_upper_body;
}

#[inline(always)]
fn solve_upper_body(factor: &[Eight], inverse: &[Eight], sides: &mut [Eight]) {
    let size = inverse.len();
    let mut groups = sides.chunks_exact_mut((TOGETHER * size).max(1));
    for group in &mut groups {
        let (a, rest) = group.split_at_mut(size);
        let (b, rest) = rest.split_at_mut(size);
        let (c, d) = rest.split_at_mut(size);
        for i in (0..size).rev() {
            let row = &factor[i * (i + 1) / 2..][..i];
            let own = &inverse[i];
            let x = [a[i].times(own), b[i].times(own), c[i].times(own), d[i].times(own)];
            (a[i], b[i], c[i], d[i]) = (x[0], x[1], x[2], x[3]);
            let (a, b, c, d) = (&mut a[..i], &mut b[..i], &mut c[..i], &mut d[..i]);
            for (k, l) in row.iter().enumerate() {
                a[k].subtract_product(l, &x[0]);
                b[k].subtract_product(l, &x[1]);
                c[k].subtract_product(l, &x[2]);
                d[k].subtract_product(l, &x[3]);
            }
        }
    }
    for side in groups.into_remainder().chunks_exact_mut(size.max(1)) {
        for i in (0..size).rev() {
            let x = side[i].times(&inverse[i]);
            side[i] = x;
            for (left, l) in side[..i].iter_mut().zip(&factor[i * (i + 1) / 2..][..i]) {
                left.subtract_product(l, &x);
            }
        }
    }
}

dispatched! {
    /// The sum of squares of some entries, problem by problem.
    pub(crate) fn squares(entries: &[Eight], sum: &mut Eight) = squares_body;
}

#[inline(always)]
fn squares_body(entries: &[Eight], sum: &mut Eight) {
    *sum = Eight::ZERO;
    for x in entries {
        sum.add_product(x, x);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::InstructionSet;

    fn number(seed: usize) -> Eight {
        Eight(std::array::from_fn(|lane| (0.7 * (seed * 9 + lane) as f64 + 0.3).sin()))
    }

    #[test]
    fn a_factor_solves_and_leaves_open_what_is_not_determined() {
        for size in [1, 2, 5, 11] {
            // A = B B' + 1, lower triangle by rows; its last unknown is nothing in problem 3.
            let b: Vec<Eight> = (0..size * size).map(number).collect();
            let mut matrix = Vec::new();
            for i in 0..size {
                for j in 0..=i {
                    let mut sum = Eight::all(if i == j { 1.0 } else { 0.0 });
                    (0..size).for_each(|k| sum.add_product(&b[i * size + k], &b[j * size + k]));
                    if i + 1 == size {
                        sum.0[3] = 0.0;
                    }
                    matrix.push(sum);
                }
            }
            let x: Vec<Eight> = (0..5 * size).map(|at| number(at + 77)).collect();
            let entry = |i: usize, j: usize| matrix[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)];
            let mut sides = vec![Eight::ZERO; 5 * size];
            for side in 0..5 {
                for i in 0..size {
                    for j in 0..size {
                        sides[side * size + i].add_product(&entry(i, j), &x[side * size + j]);
                    }
                }
            }
            for set in InstructionSet::available() {
                let (mut factor, mut found) = (matrix.clone(), sides.clone());
                let mut inverse = vec![Eight::ZERO; size];
                factorise(set, &mut factor, &mut inverse, 1e-12);
                solve_lower(set, &factor, &inverse, &mut found, 0);
                solve_upper(set, &factor, &inverse, &mut found);
                for (at, (found, x)) in found.iter().zip(&x).enumerate() {
                    for lane in 0..REGISTER {
                        let open = lane == 3 && at % size + 1 == size;
                        let expected = if open { 0.0 } else { x.0[lane] };
                        if lane != 3 || open {
                            assert!((found.0[lane] - expected).abs() < 1e-9, "{set:?} {size}");
                        }
                    }
                }
            }
        }
    }
}
