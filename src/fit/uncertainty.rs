//! What the data leave open: standard errors, how often a term is chosen, which terms cannot
//! be told apart, and which cannot be learned at all.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::column::Column;
use super::factor::Factor;
use super::rounding::UNDETERMINED;
use super::support::{SearchProblem, SupportFit, quick_search};
use super::tuning::ConclusionTuning;

/// Unknowns that the data do not determine beside those before them.
pub fn undetermined(factor: &Factor) -> Vec<Column> {
    let (triangle, norms) = (factor.design(), factor.norms());
    let pivot = |k: Column| triangle[(k.position(), k.position())].abs();
    let open = |&k: &Column| pivot(k) <= UNDETERMINED * norms[k] || norms[k] == 0.0;
    Column::all(factor.columns()).filter(open).collect()
}

/// Covariance of the unknowns of a factor for residuals of the given variance.
///
/// (R' R)^-1 through the inverse of R. An unknown that the data do not determine, and those
/// that it drags along, have infinite variance.
pub fn covariance(factor: &Factor, variance: f64) -> DMatrix<f64> {
    let size = factor.columns();
    let triangle = factor.design();
    let open = undetermined(factor);
    if !open.is_empty() {
        let mut covariance = DMatrix::zeros(size, size);
        for k in 0..size {
            let drags =
                open.iter().map(|o| o.position()).any(|o| o == k || triangle[(k.min(o), o)] != 0.0);
            covariance[(k, k)] = if drags { f64::INFINITY } else { 0.0 };
        }
        return covariance;
    }
    let inverse = triangle
        .solve_upper_triangular(&DMatrix::identity(size, size))
        .unwrap_or_else(|| DMatrix::from_diagonal_element(size, size, f64::INFINITY));
    &inverse * inverse.transpose() * variance
}

/// How often each column is chosen when the data are resampled, 0 to 1.
///
/// The folds are drawn with replacement (Efron, Ann. Stat. 7, 1979) and the support is searched
/// anew among the terms of the leading candidates. `None` where there is one fold: no draw of it is
/// another sample.
pub fn inclusion(
    folds: &[Factor],
    search: SearchProblem,
    candidates: &[SupportFit],
    (tuning, seed): (&ConclusionTuning, u64),
) -> Option<Vec<f64>> {
    if folds.len() < 2 {
        return None;
    }
    let columns = search.columns;
    let mut frequency = vec![0.0; columns.terms];
    let mut pool: Vec<Column> = Vec::new();
    let best = candidates.first().map_or(f64::NAN, |c| c.criterion);
    let leading = candidates.iter().take_while(|c| c.criterion - best < tuning.leading);
    for &term in leading.flat_map(|c| &c.support) {
        if pool.len() < tuning.pool && !pool.contains(&term) {
            pool.push(term);
        }
    }
    pool.sort_unstable();
    if pool.is_empty() {
        return Some(frequency);
    }
    let chosen = columns.of(&pool);
    let narrowed = columns.narrow(&pool, &chosen);
    let folds: Vec<Factor> = folds.iter().map(|fold| fold.select(&chosen)).collect();
    let mut generator = Pcg64::seed_from_u64(seed);
    let mut draw = || {
        let mut times = vec![0u32; folds.len()];
        for _ in 0..folds.len() {
            times[generator.random_range(0..folds.len())] += 1;
        }
        times
    };
    let draws: Vec<Vec<u32>> = (0..tuning.draws).map(|_| draw()).collect();
    let whitened = Whitened::new(&folds, tuning.apart);
    let searched = |times: &Vec<u32>| {
        let drawn = whitened.as_ref().and_then(|folds| folds.drawn(times)).unwrap_or_else(|| {
            Factor::together(chosen.len(), folds.iter().zip(times.iter().copied()))
        });
        quick_search(SearchProblem { factor: &drawn, columns: &narrowed, ..search })
    };
    let supports: Vec<Vec<Column>> = draws.par_iter().map(searched).collect();
    for k in supports.into_iter().flatten() {
        frequency[pool[k]] += 1.0;
    }
    frequency.iter_mut().for_each(|count| *count /= tuning.draws as f64);
    Some(frequency)
}

/// Folds as Gram matrices, in coordinates in which all of them together are the identity. There
/// any drawn sum is well conditioned, so that products of matrices do as well as reflections.
struct Whitened {
    /// What the folds leave at their common solution.
    whole: DMatrix<f64>,
    grams: Vec<DMatrix<f64>>,
    rows: Vec<usize>,
    /// The common solution.
    solution: DVector<f64>,
}

impl Whitened {
    /// `None` where a column keeps no more than a part `apart` of itself beside the others.
    fn new(folds: &[Factor], apart: f64) -> Option<Whitened> {
        let unknowns = folds.first()?.columns();
        let mut whole = Factor::together(unknowns, folds.iter().map(|fold| (fold, 1)));
        let norms = whole.norms();
        let stands_apart = |k: usize| whole.triangle()[(k, k)].abs() > apart * norms[k];
        if !(0..unknowns).all(stands_apart) || whole.least() == 0.0 {
            return None;
        }
        let solution = super::bounded::solve_triangle(&whole);
        whole.shift(&solution);
        let whole = whole.triangle().clone();
        let gram = |fold: &Factor| {
            let mut fold = fold.clone();
            fold.shift(&solution);
            let rows = whole.tr_solve_upper_triangular(&fold.triangle().transpose())?;
            Some(&rows * rows.transpose())
        };
        let grams = folds.iter().map(gram).collect::<Option<Vec<_>>>()?;
        let rows = folds.iter().map(Factor::rows).collect();
        Some(Whitened { whole, grams, rows, solution })
    }

    /// The folds together, each taken so many times; `None` where they do not determine all.
    fn drawn(&self, times: &[u32]) -> Option<Factor> {
        let mut gram = DMatrix::zeros(self.whole.nrows(), self.whole.ncols());
        let mut count = 0;
        for ((of_fold, rows), &times) in self.grams.iter().zip(&self.rows).zip(times) {
            gram.zip_apply(of_fold, |sum, x| *sum += f64::from(times) * x);
            count += rows * times as usize;
        }
        let triangle = gram.cholesky()?.l().transpose() * &self.whole;
        let mut drawn = Factor::of_triangle(triangle, count);
        drawn.shift(&-&self.solution);
        Some(drawn)
    }
}

/// A column that the data cannot learn by itself.
#[derive(Debug, Clone, PartialEq)]
pub enum Unlearnable {
    /// It does not change any measured value.
    Untouched {
        /// Which.
        column: Column,
    },
    /// It does the same as a combination of others (empty: which one was not looked for).
    Dependent {
        /// Which.
        column: Column,
        /// The other columns and their factors.
        on: Vec<(Column, f64)>,
    },
}

/// Columns that are zero, or a combination of the others to rounding.
pub fn unlearnable(factor: &Factor, tuning: &ConclusionTuning) -> Vec<Unlearnable> {
    let mut made_of = 0;
    let norms = factor.norms();
    let mut found: Vec<Unlearnable> = Column::all(norms.len())
        .filter(|&k| norms[k] == 0.0)
        .map(|column| Unlearnable::Untouched { column })
        .collect();
    let touched: Vec<Column> = Column::all(norms.len()).filter(|&k| norms[k] > 0.0).collect();
    if touched.is_empty() {
        return found;
    }
    // Orthogonalise column by column, twice for rounding; what a dependent column is made of
    // is solved for among the independent ones.
    let design = factor.design();
    let mut basis: Vec<DVector<f64>> = Vec::new();
    let mut independent: Vec<Column> = Vec::new();
    for &k in &touched {
        let mut rest: DVector<f64> = design.column(k.position()) / norms[k];
        for _ in 0..2 {
            for q in &basis {
                let shadow = q.dot(&rest);
                rest.axpy(-shadow, q, 1.0);
            }
        }
        let left = rest.norm();
        if left > tuning.dependent {
            basis.push(rest / left);
            independent.push(k);
            continue;
        }
        if made_of == tuning.made_of {
            found.push(Unlearnable::Dependent { column: k, on: Vec::new() });
            continue;
        }
        made_of += 1;
        let mut target = factor.select(&independent);
        let with = factor.select(&[independent.clone(), vec![k]].concat());
        let size = independent.len();
        target = replace_target(&target, &with.design().column(size).rows(0, size).clone_owned());
        let mix = super::bounded::solve_triangle(&target);
        let on = independent
            .iter()
            .zip(mix.iter())
            .filter(|(j, x)| (*x * norms[**j]).abs() > tuning.no_part * norms[k])
            .map(|(&j, &x)| (j, x))
            .collect();
        found.push(Unlearnable::Dependent { column: k, on });
    }
    found
}

/// The same design with another right-hand side.
fn replace_target(factor: &Factor, target: &DVector<f64>) -> Factor {
    let size = factor.columns();
    let mut rows = DMatrix::zeros(size, size + 1);
    rows.view_mut((0, 0), (size, size)).copy_from(&factor.design());
    rows.view_mut((0, size), (size, 1)).copy_from(target);
    let mut fresh = Factor::new(size);
    fresh.push(&rows, size);
    fresh
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factor(rows: usize, columns: usize, f: impl Fn(usize, usize) -> f64) -> Factor {
        let all = DMatrix::from_fn(rows, columns + 1, f);
        let mut factor = Factor::new(columns);
        factor.push(&all, rows);
        factor
    }

    #[test]
    fn the_covariance_of_a_mean_is_the_variance_over_the_count() {
        let of = factor(25, 1, |_, _| 1.0);
        assert!((covariance(&of, 4.0)[(0, 0)] - 4.0 / 25.0).abs() < 1e-14);
    }

    #[test]
    fn drawn_folds_are_what_they_are_together() {
        // Clean data: what is left is far below the columns.
        let value = |i: usize, j: usize| ((3 * i + 7 * j) as f64).sin() + j as f64;
        let of_fold = |fold: usize| {
            factor(20, 3, |i, j| match j {
                3 => {
                    2.0 * value(20 * fold + i, 0) - value(20 * fold + i, 2)
                        + 1e-9 * (i as f64).cos()
                }
                _ => value(20 * fold + i, j),
            })
        };
        let folds: Vec<Factor> = (0..4).map(of_fold).collect();
        let times = [2, 0, 1, 1];
        let drawn = Whitened::new(&folds, 1e-6).and_then(|folds| folds.drawn(&times)).unwrap();
        let together = Factor::together(3, folds.iter().zip(times));
        assert_eq!(drawn.rows(), together.rows());
        assert!((drawn.least() / together.least() - 1.0).abs() < 1e-5);
        let gram = |factor: &Factor| factor.triangle().transpose() * factor.triangle();
        assert!((gram(&drawn) - gram(&together)).amax() < 1e-12 * gram(&together).amax());
    }

    #[test]
    fn a_zero_column_and_a_sum_of_columns_are_named() {
        let base = |i: usize, j: usize| ((3 * i + 7 * j) as f64).sin();
        let of = factor(12, 4, |i, j| match j {
            2 => 0.0,
            3 => 2.0 * base(i, 0) - base(i, 1),
            _ => base(i, j),
        });
        let found = unlearnable(&of, &ConclusionTuning::default());
        assert_eq!(found[0], Unlearnable::Untouched { column: Column::new(2) });
        let Unlearnable::Dependent { column, on } = &found[1] else { panic!("{found:?}") };
        assert_eq!(*column, Column::new(3));
        assert!((on[0].1 - 2.0).abs() < 1e-9 && (on[1].1 + 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_variance_of_an_open_unknown_is_infinite() {
        let of = factor(10, 2, |i, j| if j == 1 { 0.0 } else { i as f64 });
        let covariance = covariance(&of, 1.0);
        assert!(covariance[(0, 0)].is_finite());
        assert_eq!(covariance[(1, 1)], f64::INFINITY);
    }
}
