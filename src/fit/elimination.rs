//! Backward elimination on a triangular factor.

use nalgebra::{DMatrix, DVector};

use super::factor::Factor;
use super::support::Columns;

/// Backward elimination: the inverse of the triangle is all that is kept.
///
/// The unknowns are `W t`, the covariance is `W W'`, for W the inverse of R and t the target. A
/// reflection from the right leaves both as they are; the one that turns a row of W into its
/// last entry alone takes that unknown out with the last column.
pub struct Elimination {
    /// Terms that are left.
    pub support: Vec<usize>,
    /// Factor columns of the rows of W, `None` once they have left.
    columns: Vec<Option<usize>>,
    /// W; columns that have left, the last first, are cut off.
    inverse: DMatrix<f64>,
    target: DVector<f64>,
    /// W t.
    solution: DVector<f64>,
    /// Sum of squares that the columns leave.
    pub squares: f64,
}

impl Elimination {
    /// Starts from all terms of `support`; columns that are zero are left out at once.
    pub fn new(factor: &Factor, columns: &Columns, support: Vec<usize>) -> Self {
        let norms = factor.norms();
        let chosen: Vec<usize> =
            columns.of(&support).into_iter().filter(|&k| norms[k] > 0.0).collect();
        let mut selected = factor.select(&chosen);
        // A trace of ridge keeps dependent columns apart; it is far below what is looked at.
        let norms = selected.norms();
        let mut ridge = DMatrix::zeros(chosen.len(), chosen.len() + 1);
        for (k, norm) in norms.iter().enumerate() {
            ridge[(k, k)] = 1e-13 * norm;
        }
        selected.push(&mut ridge, 0);
        let size = chosen.len();
        let inverse = selected
            .design()
            .solve_upper_triangular(&DMatrix::identity(size, size))
            .unwrap_or_else(|| DMatrix::identity(size, size));
        let support = support.into_iter().filter(|k| chosen.contains(k)).collect();
        let (target, squares) = (selected.target(), selected.least());
        let solution = &inverse * &target;
        let columns = chosen.into_iter().map(Some).collect();
        Elimination { support, columns, inverse, target, solution, squares }
    }

    /// Removes the term whose loss raises the squares least.
    pub fn remove_weakest(&mut self, columns: &Columns) {
        let mut spreads = vec![0.0; self.columns.len()];
        for column in self.inverse.column_iter() {
            for (spread, x) in spreads.iter_mut().zip(column.iter()) {
                *spread += x * x;
            }
        }
        let rows = self.columns.iter().zip(self.solution.iter().zip(&spreads)).enumerate();
        let weakest = rows
            .filter_map(|(at, (column, (x, spread)))| {
                let term = column.filter(|&c| c < columns.terms)?;
                Some((at, term, x * x / spread))
            })
            .min_by(|a, b| a.2.total_cmp(&b.2));
        let Some((at, term, _)) = weakest else {
            self.support.clear();
            return;
        };
        self.remove(at);
        self.support.retain(|&k| k != term);
        if self.columns.iter().flatten().all(|&c| c < columns.terms) {
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
        let Some(last) = self.inverse.ncols().checked_sub(1) else { return };
        // The reflection I - 2 v v' / v'v that turns the row into its last entry.
        let mut v = self.inverse.row(at).transpose();
        v[last] += v.norm().copysign(v[last]);
        let squares = v.norm_squared();
        if squares > 0.0 {
            let factor = -2.0 / squares;
            let along = &self.inverse * &v;
            self.inverse.ger(factor, &along, &v, 1.0);
            let along = self.target.dot(&v);
            self.target.axpy(factor * along, &v, 1.0);
        }
        let lost = self.target[last];
        self.solution.axpy(-lost, &self.inverse.column(last), 1.0);
        self.solution[at] = 0.0;
        self.squares += lost * lost;
        let inverse = std::mem::replace(&mut self.inverse, DMatrix::zeros(0, 0));
        // The last column of a matrix that is stored by columns is cut off in place.
        self.inverse = inverse.resize_horizontally(last, 0.0);
        self.inverse.row_mut(at).fill(0.0);
        let target = std::mem::replace(&mut self.target, DVector::zeros(0));
        self.target = target.resize_vertically(last, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::Bounds;

    #[test]
    fn squares_are_those_of_a_fit_without_what_left() {
        let mut rows = DMatrix::from_fn(40, 7, |i, j| (0.7 * ((i + 1) * (j + 1)) as f64).sin());
        let mut factor = Factor::new(6);
        factor.push(&mut rows, 40);
        let columns = Columns {
            terms: 6,
            companions: vec![Vec::new(); 6],
            forced: Vec::new(),
            bounds: vec![Bounds::FREE; 6],
            complexity: vec![1; 6],
            costs: vec![0.0; 6],
        };
        let mut elimination = Elimination::new(&factor, &columns, (0..6).collect());
        for left in (0..6).rev() {
            let before = elimination.squares;
            let dearer = |k: usize| {
                let rest: Vec<usize> =
                    elimination.support.iter().copied().filter(|&j| j != k).collect();
                factor.select(&rest).least()
            };
            let cheapest =
                elimination.support.iter().map(|&k| dearer(k)).fold(f64::INFINITY, f64::min);
            elimination.remove_weakest(&columns);
            assert_eq!(elimination.support.len(), left);
            assert!(elimination.squares >= before);
            assert!((elimination.squares - cheapest).abs() < 1e-10 * cheapest, "{left} left");
            let exact = factor.select(&elimination.support).least();
            assert!((elimination.squares - exact).abs() < 1e-10 * exact, "{left} left");
        }
    }
}
