//! What all folds leave for theta: a sparse symmetric matrix, its Cholesky factor, and its
//! inverse.
//!
//! The factor is kept in an envelope: of each row all entries from the first that is not zero on.
//! Unknowns are ordered by the place where they act, so that in a chain envelopes are as wide as
//! couplings reach.

use rayon::prelude::*;

use super::pass::Quadratic;
use super::plan::Plan;

/// What least squares of theta are, near to where they were linearised.
#[derive(Clone)]
pub(super) struct Normal {
    /// Of each unknown the entries of its row that are not zero, ascending.
    pub(super) rows: Vec<Vec<(u32, f64)>>,
    pub(super) slopes: Vec<f64>,
    /// Diagonal, zero where the states do all that the unknown does.
    pub(super) diagonal: Vec<f64>,
}

/// A diagonal below this part of what it was before the states were eliminated is the rounding of
/// the difference.
const ABSORBED: f64 = 1e-11;

impl Normal {
    /// Folds together, each taken so many times, and pieces of one unknown added up.
    pub(super) fn of<'a>(
        plan: &Plan,
        unknowns: usize,
        folds: impl Iterator<Item = (&'a Quadratic, f64)> + Clone,
    ) -> Normal {
        let sum = |of: fn(&Quadratic) -> &[f64], size: usize| {
            let mut sum = vec![0.0; size];
            for (fold, times) in folds.clone().filter(|(_, times)| *times > 0.0) {
                sum.iter_mut().zip(of(fold)).for_each(|(sum, x)| *sum += times * x);
            }
            sum
        };
        let pieces = &plan.couplings.pieces;
        let left = sum(|fold| &fold.left, plan.left.entries());
        let of_pieces = sum(|fold| &fold.slopes, pieces.len());
        let touched_pieces = sum(|fold| &fold.touched, pieces.len());
        let (mut slopes, mut touched) = (vec![0.0; unknowns], vec![0.0; unknowns]);
        let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); unknowns];
        for (a, piece) in pieces.iter().enumerate() {
            slopes[piece.unknown] += of_pieces[a];
            touched[piece.unknown] += touched_pieces[a];
            for at in plan.left.row(a) {
                let (b, x) = (plan.left.columns[at] as usize, left[at]);
                let other = pieces[b].unknown;
                rows[piece.unknown].push((other as u32, x));
                if a != b {
                    rows[other].push((piece.unknown as u32, x));
                }
            }
        }
        for row in &mut rows {
            row.sort_by_key(|(column, _)| *column);
            row.dedup_by(|next, kept| {
                let same = next.0 == kept.0;
                kept.1 += if same { next.1 } else { 0.0 };
                same
            });
        }
        let own = |k: usize| {
            let at = rows[k].binary_search_by_key(&(k as u32), |(column, _)| *column);
            let value = at.map_or(0.0, |at| rows[k][at].1);
            if value > ABSORBED * touched[k] { value } else { 0.0 }
        };
        let diagonal: Vec<f64> = (0..unknowns).map(own).collect();
        Normal { rows, slopes, diagonal }
    }

    /// Whether every number is finite.
    pub(super) fn is_finite(&self) -> bool {
        self.rows.iter().flatten().all(|(_, x)| x.is_finite())
            && self.slopes.iter().all(|x| x.is_finite())
    }

    /// The matrix times a vector.
    pub(super) fn times(&self, x: &[f64]) -> Vec<f64> {
        let row = |row: &Vec<(u32, f64)>| row.iter().map(|(k, m)| m * x[*k as usize]).sum();
        self.rows.par_iter().map(row).collect()
    }

    /// Cholesky's factor for some unknowns, in the order given.
    pub(super) fn factor(&self, unknowns: Vec<usize>) -> Envelope {
        let mut place = vec![usize::MAX; self.rows.len()];
        unknowns.iter().enumerate().for_each(|(at, &k)| place[k] = at);
        let mut factor = Envelope {
            first: Vec::with_capacity(unknowns.len()),
            starts: vec![0],
            values: Vec::new(),
            least: 1.0,
            unknowns,
        };
        for (i, &k) in factor.unknowns.iter().enumerate() {
            let entries = || self.rows[k].iter().map(|(l, x)| (place[*l as usize], *x));
            let entries = || entries().filter(|(at, _)| *at <= i);
            let first = entries().map(|(at, _)| at).min().unwrap_or(i);
            let start = factor.values.len();
            factor.values.resize(start + i + 1 - first, 0.0);
            entries().for_each(|(at, x)| factor.values[start + at - first] = x);
            let (before, own) = factor.values.split_at_mut(start);
            for j in first..i {
                let begin = factor.first[j].max(first);
                let other = &before[factor.starts[j] + begin - factor.first[j]..][..j - begin];
                let shadow = dot(&own[begin - first..j - first], other);
                let diagonal = before[factor.starts[j + 1] - 1];
                own[j - first] = (own[j - first] - shadow) / diagonal;
            }
            let squares = dot(&own[..i - first], &own[..i - first]);
            let pivot = self.diagonal[k] - squares;
            factor.least = factor.least.min(pivot / self.diagonal[k]);
            // Whoever asks for the least pivot does not look at what follows from another.
            own[i - first] = pivot.max(f64::MIN_POSITIVE).sqrt();
            factor.first.push(first);
            factor.starts.push(factor.values.len());
        }
        factor
    }
}

/// Columns of an inverse that are solved for together.
const SIDES: usize = 8;

/// The inner product of two rows, in eight sums.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a, b) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    for (a, b) in a.0.iter().zip(b.0) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().sum::<f64>() + a.1.iter().zip(b.1).map(|(a, b)| a * b).sum::<f64>()
}

/// A triangular factor L of L L', row after row from the first entry that is not zero.
pub(super) struct Envelope {
    /// The unknowns of its rows.
    pub(super) unknowns: Vec<usize>,
    /// The smallest pivot, as a part of the diagonal that it comes from; not positive where the
    /// matrix is not positive definite.
    pub(super) least: f64,
    first: Vec<usize>,
    starts: Vec<usize>,
    values: Vec<f64>,
}

impl Envelope {
    fn row(&self, i: usize) -> &[f64] {
        &self.values[self.starts[i]..self.starts[i + 1]]
    }

    /// Solves in place for a right-hand side in the order of the rows, zero before `from`.
    pub(super) fn solve(&self, x: &mut [f64], from: usize) {
        for i in from..x.len() {
            let (row, first) = (self.row(i), self.first[i]);
            let begin = first.max(from).min(i);
            let sum = dot(&row[begin - first..i - first], &x[begin..i]);
            x[i] = (x[i] - sum) / row[i - first];
        }
        for i in (0..x.len()).rev() {
            let (row, first) = (self.row(i), self.first[i]);
            x[i] /= row[i - first];
            let value = x[i];
            x[first..i].iter_mut().zip(row).for_each(|(x, l)| *x -= value * l);
        }
    }

    /// The inverse of the matrix, `[row][row]`: so many columns at a time that a row of the
    /// factor is read once for all of them.
    pub(super) fn inverse(&self) -> Vec<f64> {
        let size = self.unknowns.len();
        let mut inverse = vec![0.0; size * size];
        let groups = inverse.par_chunks_mut((SIDES * size).max(1)).enumerate();
        groups.for_each_init(Vec::new, |sides, (group, columns)| {
            let from = group * SIDES;
            sides.clear();
            sides.resize(size, [0.0; SIDES]);
            (from..size).zip(0..SIDES).for_each(|(k, side)| sides[k][side] = 1.0);
            self.solve_sides(sides, from);
            for (side, column) in columns.chunks_exact_mut(size).enumerate() {
                column.iter_mut().zip(sides.iter()).for_each(|(x, sides)| *x = sides[side]);
            }
        });
        inverse
    }

    /// Solves in place for several right-hand sides, all zero before `from`.
    fn solve_sides(&self, x: &mut [[f64; SIDES]], from: usize) {
        for i in from..x.len() {
            let (row, first) = (self.row(i), self.first[i]);
            let begin = first.max(from).min(i);
            let mut sums = x[i];
            for (l, x) in row[begin - first..i - first].iter().zip(&x[begin..i]) {
                sums.iter_mut().zip(x).for_each(|(sum, x)| *sum -= l * x);
            }
            x[i] = sums.map(|sum| sum / row[i - first]);
        }
        for i in (0..x.len()).rev() {
            let (row, first) = (self.row(i), self.first[i]);
            let values = x[i].map(|x| x / row[i - first]);
            x[i] = values;
            for (x, l) in x[first..i].iter_mut().zip(row) {
                x.iter_mut().zip(&values).for_each(|(x, value)| *x -= l * value);
            }
        }
    }
}
