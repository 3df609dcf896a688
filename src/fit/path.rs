//! The path of L1-penalised solutions on a triangular factor: coordinate descent with
//! soft thresholding, from the penalty that empties the model down to almost none.
//!
//! Friedman, Hastie and Tibshirani, "Regularization paths for generalized linear models
//! via coordinate descent", J. Stat. Softw. 33 (2010), with the factor in place of the data.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::column::Column;
use super::factor::Factor;
use super::tuning::SupportTuning;
use crate::expr::Bounds;

/// The solution at one penalty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PathPoint {
    /// Penalty on a coefficient times the norm of its column.
    pub lambda: f64,
    /// Unknowns that are not zero, with their values.
    pub coefficients: Vec<(Column, f64)>,
}

impl PathPoint {
    /// The unknowns that are not zero.
    pub fn support(&self) -> Vec<Column> {
        self.coefficients.iter().map(|&(k, _)| k).collect()
    }
}

/// The proximal map of `threshold * |x|`.
pub fn soft_threshold(x: f64, threshold: f64) -> f64 {
    (x.abs() - threshold).max(0.0).copysign(x)
}

/// Solutions of `min 1/2 |A x - b|^2 + lambda * sum_k norm_k |x_k|` over decreasing lambda.
///
/// `tuning` says how the path is walked. `penalised[k]` is false for unknowns that are free of the
/// penalty. Each solution starts from the one before. Columns are brought to unit norm, so that
/// units do not matter.
pub fn path(
    factor: &Factor,
    penalised: &[bool],
    bounds: &[Bounds],
    tuning: &SupportTuning,
) -> Vec<PathPoint> {
    let mut descent = Descent::new(factor, penalised, bounds);
    // Unpenalised unknowns are settled before the first penalty is set.
    descent.solve(f64::INFINITY, tuning);
    let largest = descent.largest_correlation();
    if largest <= 0.0 || !largest.is_finite() || tuning.path_points == 0 {
        return Vec::new();
    }
    let step = tuning.path_ratio.powf(1.0 / (tuning.path_points.max(2) - 1) as f64);
    let freedom = factor.rows().saturating_sub(factor.columns()).max(1) as f64;
    let least = tuning.path_noise * (factor.least() / freedom).sqrt();
    let mut points = Vec::new();
    let mut lambda = largest;
    for _ in 0..tuning.path_points {
        if lambda < least && !points.is_empty() {
            break;
        }
        descent.solve(lambda, tuning);
        let point = PathPoint { lambda, coefficients: descent.coefficients() };
        let full = point.coefficients.len() > tuning.largest;
        points.push(point);
        if full {
            break;
        }
        lambda *= step;
    }
    points
}

/// Coordinate descent on the correlations of the columns with the residual, which every change
/// of an unknown moves by its column's products with all others.
struct Descent<'a> {
    /// Columns of unit norm.
    design: DMatrix<f64>,
    norms: Vec<f64>,
    target: DVector<f64>,
    /// Of each column with what the solution leaves of the target.
    correlations: DVector<f64>,
    /// Products of a column with all columns, once it has moved.
    products: Vec<Option<DVector<f64>>>,
    /// In units of the normalised columns.
    solution: Vec<f64>,
    penalised: &'a [bool],
    bounds: &'a [Bounds],
}

impl<'a> Descent<'a> {
    fn new(factor: &Factor, penalised: &'a [bool], bounds: &'a [Bounds]) -> Self {
        let norms = factor.norms();
        let mut design = factor.design();
        for (k, &norm) in norms.iter().enumerate() {
            if norm > 0.0 {
                design.column_mut(k).scale_mut(1.0 / norm);
            }
        }
        let target = factor.target();
        let size = norms.len();
        let mut descent = Descent {
            design,
            norms,
            correlations: target.clone(),
            target,
            products: vec![None; size],
            solution: vec![0.0; size],
            penalised,
            bounds,
        };
        descent.correlate();
        descent
    }

    /// Finds the correlations anew: rounding does not gather from penalty to penalty.
    fn correlate(&mut self) {
        let mut residual = self.target.clone();
        for (k, &x) in self.solution.iter().enumerate().filter(|(_, x)| **x != 0.0) {
            let column = self.design.view((0, k), (k + 1, 1));
            residual.rows_mut(0, k + 1).axpy(-x, &column.column(0), 1.0);
        }
        self.correlations = project(&self.design, &residual);
    }

    fn largest_correlation(&self) -> f64 {
        Column::all(self.norms.len())
            .filter(|&k| self.penalised[k])
            .map(|k| self.correlations[k].abs())
            .fold(0.0, f64::max)
    }

    /// Descends to convergence, or until the sweeps are used up.
    fn solve(&mut self, lambda: f64, tuning: &SupportTuning) {
        self.correlate();
        let all: Vec<Column> =
            Column::all(self.norms.len()).filter(|&k| self.norms[k] > 0.0).collect();
        let still = tuning.path_still;
        let mut left = tuning.path_sweeps;
        while left > 0 {
            let moved = self.sweep(&all, lambda, still);
            left -= 1;
            if !moved {
                return;
            }
            let active: Vec<Column> =
                all.iter().copied().filter(|&k| self.solution[k] != 0.0).collect();
            while left > 0 && self.sweep(&active, lambda, still) {
                left -= 1;
            }
        }
    }

    /// One pass over the unknowns; whether any of them moved by more than a part `still` of the
    /// largest.
    fn sweep(&mut self, unknowns: &[Column], lambda: f64, still: f64) -> bool {
        let size = self.solution.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let mut largest = 0.0f64;
        for &k in unknowns {
            let free = self.correlations[k] + self.solution[k];
            let threshold = if self.penalised[k] { lambda } else { 0.0 };
            let shrunk = soft_threshold(free, threshold);
            let new = self.bounds[k].clamp(shrunk / self.norms[k]) * self.norms[k];
            let change = new - self.solution[k];
            if change != 0.0 && change.is_finite() {
                self.solution[k] = new;
                let design = &self.design;
                let products = self.products[k].get_or_insert_with(|| {
                    project(design, &design.column(k.position()).clone_owned())
                });
                self.correlations.axpy(-change, products, 1.0);
                largest = largest.max(change.abs());
            }
        }
        largest > still * size
    }

    fn coefficients(&self) -> Vec<(Column, f64)> {
        Column::all(self.solution.len())
            .filter(|&k| self.solution[k] != 0.0)
            .map(|k| (k, self.solution[k] / self.norms[k]))
            .collect()
    }
}

/// Inner products of every column of a triangle with a vector.
fn project(triangle: &DMatrix<f64>, vector: &DVector<f64>) -> DVector<f64> {
    DVector::from_fn(vector.len(), |k, _| {
        triangle.view((0, k), (k + 1, 1)).column(0).dot(&vector.rows(0, k + 1))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orthogonal_columns_are_thresholded_one_by_one() {
        // For an orthonormal design the solution is the soft-thresholded target.
        let rows = DMatrix::from_row_slice(
            3,
            4,
            &[1.0, 0.0, 0.0, 3.0, 0.0, 1.0, 0.0, -0.5, 0.0, 0.0, 1.0, 1.5],
        );
        let mut factor = Factor::new(3);
        factor.push(&rows, 3);
        let tuning =
            SupportTuning { path_points: 2, path_ratio: 1.0 / 3.0, ..SupportTuning::default() };
        let points = path(&factor, &[true; 3], &[Bounds::FREE; 3], &tuning);
        assert!(points[0].coefficients.iter().all(|(_, x)| x.abs() < 1e-12));
        let last = &points[1];
        assert_eq!(last.support(), [0, 2].map(Column::new));
        assert!((last.coefficients[0].1 - 2.0).abs() < 1e-12);
        assert!((last.coefficients[1].1 - 0.5).abs() < 1e-12);
    }

    #[test]
    fn the_optimum_fulfils_its_conditions() {
        // Subgradient conditions: |a_k' r| <= lambda, with equality and the sign of x_k on the
        // support.
        let rows = DMatrix::from_fn(30, 6, |i, j| ((i * 7 + j * 13) as f64 * 0.37).sin());
        let mut factor = Factor::new(5);
        factor.push(&rows, 30);
        let tuning = SupportTuning { path_sweeps: 5000, ..SupportTuning::default() };
        let norms = factor.norms();
        for point in path(&factor, &[true; 5], &[Bounds::FREE; 5], &tuning) {
            let mut x = DVector::zeros(5);
            for &(k, value) in &point.coefficients {
                x[k] = value;
            }
            let residual = factor.target() - factor.design() * &x;
            for k in 0..5 {
                let slope = factor.design().column(k).dot(&residual) / norms[k];
                let slack = 1e-6 * point.lambda + 1e-9;
                assert!(slope.abs() <= point.lambda + slack);
                if x[k] != 0.0 {
                    assert!((slope - point.lambda * x[k].signum()).abs() < slack);
                }
            }
        }
    }
}
