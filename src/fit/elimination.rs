//! Backward elimination on a triangular factor.

use nalgebra::{DMatrix, DVector};

use super::factor::Factor;
use super::support::Columns;

/// Backward elimination: the inverse triangle is updated with every column that leaves.
pub struct Elimination {
    /// Terms that are left.
    pub support: Vec<usize>,
    /// Factor columns in the order of the triangle.
    columns: Vec<usize>,
    triangle: DMatrix<f64>,
    inverse: DMatrix<f64>,
    target: DVector<f64>,
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
        let triangle = selected.design();
        let size = chosen.len();
        let inverse = triangle
            .solve_upper_triangular(&DMatrix::identity(size, size))
            .unwrap_or_else(|| DMatrix::identity(size, size));
        let support = support.into_iter().filter(|k| chosen.contains(k)).collect();
        let (target, squares) = (selected.target(), selected.least());
        Elimination { support, columns: chosen, triangle, inverse, target, squares }
    }

    /// Removes the term whose loss raises the squares least.
    pub fn remove_weakest(&mut self, columns: &Columns) {
        let solution = &self.inverse * &self.target;
        let weakest = self
            .columns
            .iter()
            .enumerate()
            .filter(|&(_, &c)| c < columns.terms)
            .map(|(i, &c)| {
                let spread = self.inverse.row(i).norm_squared();
                (i, c, solution[i] * solution[i] / spread)
            })
            .min_by(|a, b| a.2.total_cmp(&b.2));
        let Some((at, term, _)) = weakest else {
            self.support.clear();
            return;
        };
        self.remove(at);
        self.support.retain(|&k| k != term);
        let keep = columns.of(&self.support);
        while let Some(at) = self.columns.iter().position(|c| !keep.contains(c)) {
            self.remove(at);
        }
    }

    /// Takes one column out and rotates the triangle back into shape.
    fn remove(&mut self, at: usize) {
        let size = self.columns.len();
        self.columns.remove(at);
        let mut triangle = std::mem::replace(&mut self.triangle, DMatrix::zeros(0, 0));
        triangle = triangle.remove_column(at);
        for k in at..size - 1 {
            let (a, b) = (triangle[(k, k)], triangle[(k + 1, k)]);
            let length = a.hypot(b);
            if length == 0.0 {
                continue;
            }
            let (c, s) = (a / length, b / length);
            for column in k..size - 1 {
                let (x, y) = (triangle[(k, column)], triangle[(k + 1, column)]);
                triangle[(k, column)] = c * x + s * y;
                triangle[(k + 1, column)] = c * y - s * x;
            }
            let (x, y) = (self.target[k], self.target[k + 1]);
            self.target[k] = c * x + s * y;
            self.target[k + 1] = c * y - s * x;
            let (mut left, mut right) = self.inverse.columns_range_pair_mut(k, k + 1);
            for row in 0..size {
                let (x, y) = (left[row], right[row]);
                left[row] = c * x + s * y;
                right[row] = c * y - s * x;
            }
        }
        self.triangle = triangle.remove_row(size - 1);
        let inverse = std::mem::replace(&mut self.inverse, DMatrix::zeros(0, 0));
        self.inverse = inverse.remove_row(at).remove_column(size - 1);
        let target = std::mem::replace(&mut self.target, DVector::zeros(0));
        self.squares += target[size - 1].powi(2);
        self.target = target.remove_row(size - 1);
    }
}
