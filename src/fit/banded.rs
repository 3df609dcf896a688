//! Symmetric banded matrices: normal equations of what only neighbours have a part in.

/// A symmetric matrix whose entries more than a band from the diagonal are zero.
pub(super) struct Banded {
    size: usize,
    /// Entries of a row: the diagonal and those before it.
    width: usize,
    /// `[row][distance from the diagonal]`.
    lower: Vec<f64>,
}

impl Banded {
    /// A matrix of zeros, in which unknowns nearer than `width` may meet.
    pub(super) fn new(size: usize, width: usize) -> Banded {
        Banded { size, width, lower: vec![0.0; size * width] }
    }

    /// Adds x x^T, x standing from an unknown on; it is not longer than the width.
    pub(super) fn add_square(&mut self, first: usize, x: &[f64]) {
        for (i, a) in x.iter().enumerate().filter(|(_, a)| **a != 0.0) {
            for (j, b) in x.iter().enumerate().take(i + 1) {
                self.lower[(first + i) * self.width + i - j] += a * b;
            }
        }
    }

    /// Solves with the diagonal grown by a part of itself (Cholesky); `None` where the matrix is
    /// not positive.
    pub(super) fn solve_damped(mut self, damping: f64, right: &[f64]) -> Option<Vec<f64>> {
        let width = self.width;
        for row in 0..self.size {
            self.lower[row * width] *= 1.0 + damping;
            let least = row.saturating_sub(width - 1);
            for column in least..=row {
                let from = least.max(column.saturating_sub(width - 1));
                let mut sum = self.lower[row * width + row - column];
                for k in from..column {
                    sum -=
                        self.lower[row * width + row - k] * self.lower[column * width + column - k];
                }
                self.lower[row * width + row - column] = if column < row {
                    sum / self.lower[column * width]
                } else if sum > 0.0 {
                    sum.sqrt()
                } else {
                    return None;
                };
            }
        }
        let mut x = right.to_vec();
        for row in 0..self.size {
            for k in row.saturating_sub(width - 1)..row {
                x[row] -= self.lower[row * width + row - k] * x[k];
            }
            x[row] /= self.lower[row * width];
        }
        for row in (0..self.size).rev() {
            for k in row + 1..(row + width).min(self.size) {
                x[row] -= self.lower[k * width + k - row] * x[k];
            }
            x[row] /= self.lower[row * width];
        }
        x.iter().all(|x| x.is_finite()).then_some(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn a_banded_system_is_solved_as_a_full_one() {
        let (size, width) = (11, 4);
        let mut banded = Banded::new(size, width);
        let mut full = DMatrix::<f64>::zeros(size, size);
        for first in 0..=size - width {
            let x: Vec<f64> =
                (0..width).map(|i| (0.5 + 3.1 * (first * width + i) as f64).sin()).collect();
            banded.add_square(first, &x);
            for i in 0..width {
                for j in 0..width {
                    full[(first + i, first + j)] += x[i] * x[j];
                }
            }
        }
        let right: Vec<f64> = (0..size).map(|i| (i as f64).cos()).collect();
        for i in 0..size {
            full[(i, i)] *= 1.01;
        }
        let truth = full.lu().solve(&DVector::from_vec(right.clone()));
        let found = banded.solve_damped(0.01, &right);
        let (Some(truth), Some(found)) = (truth, found) else { panic!("not solved") };
        for (a, b) in truth.iter().zip(&found) {
            assert!((a - b).abs() < 1e-9 * (1.0 + a.abs()), "{a} {b}");
        }
        assert!(Banded::new(3, 2).solve_damped(0.0, &[1.0; 3]).is_none());
    }
}
