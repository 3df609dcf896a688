//! Backward elimination on a triangular factor.

use nalgebra::{DMatrix, DVector};

use super::column::Column;
use super::support::{Columns, SearchProblem};

/// Backward elimination: the inverse of the triangle is all that is kept.
///
/// The unknowns are `W t`, the covariance is `W W'`, for W the inverse of R and t the target. A
/// reflection from the right leaves both as they are; the one that turns a row of W into its
/// last entry alone takes that unknown out with the last column.
pub struct Elimination {
    /// The columns of the terms that are left.
    pub support: Vec<Column>,
    /// Factor columns of the rows of W, `None` once they have left.
    columns: Vec<Option<Column>>,
    /// W by columns; those that have left, the last first, are cut off.
    inverse: Vec<f64>,
    /// The squared length of each row of W.
    spreads: Vec<f64>,
    target: Vec<f64>,
    /// W t.
    solution: Vec<f64>,
    /// Sum of squares that the columns leave.
    pub squares: f64,
}

impl Elimination {
    /// Starts from all terms of `support`; columns that are zero are left out at once.
    pub fn new(problem: SearchProblem, support: Vec<Column>) -> Self {
        let SearchProblem { factor, columns, tuning, .. } = problem;
        let norms = factor.norms();
        let chosen: Vec<Column> =
            columns.of(&support).into_iter().filter(|&k| norms[k] > 0.0).collect();
        let mut selected = factor.select(&chosen);
        // A trace of ridge keeps dependent columns apart; it is far below what is looked at.
        let norms = selected.norms();
        let alone =
            |(k, norm): (usize, &f64)| selected.triangle()[(k, k)].abs() > tuning.alone * norm;
        if !norms.iter().enumerate().all(alone) {
            let mut ridge = DMatrix::zeros(chosen.len(), chosen.len() + 1);
            for (k, norm) in norms.iter().enumerate() {
                ridge[(k, k)] = tuning.ridge * norm;
            }
            selected.push(&ridge, 0);
        }
        let size = chosen.len();
        let inverse = selected
            .design()
            .solve_upper_triangular(&DMatrix::identity(size, size))
            .unwrap_or_else(|| DMatrix::identity(size, size));
        let support = support.into_iter().filter(|k| chosen.contains(k)).collect();
        let (target, squares) = (selected.target(), selected.least());
        let list = |values: DVector<f64>| values.as_slice().to_vec();
        Elimination {
            support,
            columns: chosen.into_iter().map(Some).collect(),
            spreads: inverse.row_iter().map(|row| row.norm_squared()).collect(),
            solution: list(&inverse * &target),
            inverse: inverse.as_slice().to_vec(),
            target: list(target),
            squares,
        }
    }

    /// Removes the term whose loss raises the squares least, of those that may leave.
    pub fn remove_weakest(&mut self, columns: &Columns) {
        let rows = self.columns.iter().zip(self.solution.iter().zip(&self.spreads)).enumerate();
        let weakest = rows
            .filter_map(|(at, (column, (x, spread)))| {
                let term = column.filter(|&c| columns.may_leave(c))?;
                Some((at, term, x * x / spread))
            })
            .min_by(|a, b| a.2.total_cmp(&b.2));
        let Some((at, term, _)) = weakest else {
            self.support.clear();
            return;
        };
        self.remove(at);
        self.support.retain(|&k| k != term);
        if self.columns.iter().flatten().all(|&c| columns.is_term(c)) {
            return;
        }
        let keep = columns.of(&self.support);
        for at in 0..self.columns.len() {
            if self.columns[at].is_some_and(|column| !keep.contains(&column)) {
                self.remove(at);
            }
        }
    }

    /// Takes one unknown out.
    fn remove(&mut self, at: usize) {
        self.columns[at] = None;
        let Some(last) = self.target.len().checked_sub(1) else { return };
        let size = self.columns.len();
        // The reflection I - 2 v v' / v'v that turns the row into its last entry.
        let mut v: Vec<f64> = self.inverse.iter().skip(at).step_by(size).copied().collect();
        v[last] += v.iter().map(|x| x * x).sum::<f64>().sqrt().copysign(v[last]);
        let squares: f64 = v.iter().map(|x| x * x).sum();
        let factor = if squares > 0.0 { -2.0 / squares } else { 0.0 };
        let mut along = vec![0.0; size];
        for (column, v) in self.inverse.chunks_exact(size).zip(&v) {
            along.iter_mut().zip(column).for_each(|(sum, x)| *sum += v * x);
        }
        let onto: f64 = factor * self.target.iter().zip(&v).map(|(t, v)| t * v).sum::<f64>();
        self.target.iter_mut().zip(&v).for_each(|(t, v)| *t += onto * v);
        self.spreads.fill(0.0);
        for (at_column, (column, v)) in self.inverse.chunks_exact_mut(size).zip(&v).enumerate() {
            column.iter_mut().zip(&along).for_each(|(x, along)| *x += factor * v * along);
            column[at] = 0.0;
            if at_column < last {
                self.spreads.iter_mut().zip(&*column).for_each(|(sum, x)| *sum += x * x);
            }
        }
        let lost = self.target.pop().unwrap_or(0.0);
        let column = &self.inverse[last * size..];
        self.solution.iter_mut().zip(column).for_each(|(x, w)| *x -= lost * w);
        self.solution[at] = 0.0;
        self.squares += lost * lost;
        self.inverse.truncate(last * size);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::criterion::Criterion;
    use crate::fit::factor::Factor;
    use crate::fit::tuning::SupportTuning;

    #[test]
    fn squares_are_those_of_a_fit_without_what_left() {
        let rows = DMatrix::from_fn(40, 7, |i, j| (0.7 * ((i + 1) * (j + 1)) as f64).sin());
        let mut factor = Factor::new(6);
        factor.push(&rows, 40);
        let columns = Columns::plain(6);
        let (criterion, tuning) = (Criterion { floor: 0.0 }, &SupportTuning::default());
        let problem = SearchProblem { factor: &factor, columns: &columns, criterion, tuning };
        let mut elimination = Elimination::new(problem, columns.of_terms().collect());
        for left in (0..6).rev() {
            let before = elimination.squares;
            let loss_without = |k: Column| {
                let rest: Vec<Column> =
                    elimination.support.iter().copied().filter(|&j| j != k).collect();
                factor.select(&rest).least()
            };
            let cheapest =
                elimination.support.iter().map(|&k| loss_without(k)).fold(f64::INFINITY, f64::min);
            elimination.remove_weakest(&columns);
            assert_eq!(elimination.support.len(), left);
            assert!(elimination.squares >= before);
            assert!((elimination.squares - cheapest).abs() < 1e-10 * cheapest, "{left} left");
            let exact = factor.select(&elimination.support).least();
            assert!((elimination.squares - exact).abs() < 1e-10 * exact, "{left} left");
        }
    }
}
