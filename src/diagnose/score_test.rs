//! Score tests on a triangular factor: what would each candidate take off the misfit, orthogonal
//! to everything that is fitted already.
//!
//! The factor's first columns are the model's unknowns (states are eliminated before), the rest
//! probes. What is left of the triangle below the model's columns is the problem in which the
//! model is free: a candidate's share of the misfit there is its score statistic
//! (Rao, Proc. Camb. Phil. Soc. 44, 1948), a chi-square of as many degrees as it has columns.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::fit::column::Column;
use crate::fit::factor::Factor;

/// The evidence for a group of columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// Fall of the deviance (squares over noise variance).
    pub deviance: f64,
    /// Independent columns of the group.
    pub degrees: usize,
    /// Coefficient of each column, in the order of the group.
    pub coefficients: Vec<f64>,
    /// Standard errors, in the same order.
    pub standard_errors: Vec<f64>,
    /// p-value of this one candidate: the probability that noise does as well.
    pub p_value: f64,
}

/// The problem in which the model is free.
#[derive(Debug, Clone)]
pub struct Scores {
    design: DMatrix<f64>,
    target: DVector<f64>,
    norms: Vec<f64>,
    /// A column that keeps less than this part of itself is spanned by others.
    spanned: f64,
    /// Variance of the weighted residuals.
    pub variance: f64,
    /// Independent residuals that are left.
    pub rows: usize,
}

impl Scores {
    /// From a factor whose first `base` columns are the model's unknowns.
    ///
    /// `variance` is that of the weighted residuals when nothing is missing; a column that keeps
    /// less than the part `spanned` of itself is spanned by others.
    pub fn new(factor: &Factor, base: usize, variance: f64, spanned: f64) -> Scores {
        let size = factor.columns();
        let whole = factor.norms();
        let design = factor.design().view((base, base), (size - base, size - base)).clone_owned();
        let target = factor.target().rows(base, size - base).clone_owned();
        let norms = whole[base..].to_vec();
        let rows = factor.rows().saturating_sub(base);
        Scores { design, target, norms, spanned, variance, rows }
    }

    /// Whether all of it is numbers: one column that is none makes all scores none.
    pub fn is_finite(&self) -> bool {
        self.target.iter().chain(self.design.iter()).all(|x| x.is_finite())
    }

    /// Number of probes.
    pub fn columns(&self) -> usize {
        self.norms.len()
    }

    /// The score of a group of probes together; the first probe is column 0.
    pub fn group(&self, columns: &[Column]) -> Score {
        let (basis, kept) = self.basis(columns);
        let heights = basis.tr_mul(&self.target);
        let deviance = heights.norm_squared() / self.variance;
        let degrees = kept.len();
        let (coefficients, standard_errors) = self.solve(columns, &kept);
        let p_value = match ChiSquared::new(degrees.max(1) as f64) {
            Ok(chi) if degrees > 0 && deviance.is_finite() => chi.sf(deviance),
            _ => 1.0,
        };
        Score { deviance, degrees, coefficients, standard_errors, p_value }
    }

    /// The problem with some probes taken into the model.
    pub fn given(&self, columns: &[Column]) -> Scores {
        let (basis, kept) = self.basis(columns);
        let mut next = self.clone();
        next.design = &self.design - &basis * basis.tr_mul(&self.design);
        next.target = &self.target - &basis * basis.tr_mul(&self.target);
        next.rows = self.rows.saturating_sub(kept.len());
        next
    }

    /// Squares that the probes together could still take off, over the noise variance.
    pub fn left(&self) -> f64 {
        self.target.norm_squared() / self.variance
    }

    /// How much of one group's effect another group can imitate, 0 to 1: the squared cosine of
    /// the smallest angle between what they do.
    pub fn overlap(&self, first: &[Column], second: &[Column]) -> f64 {
        let (a, _) = self.basis(first);
        let (b, _) = self.basis(second);
        if a.ncols() == 0 || b.ncols() == 0 {
            return 0.0;
        }
        let cosines = a.tr_mul(&b).singular_values();
        cosines.max().powi(2).min(1.0)
    }

    /// An orthonormal basis of the columns' span, and the places in the list of those that are
    /// kept: columns that add nothing are left out.
    fn basis(&self, columns: &[Column]) -> (DMatrix<f64>, Vec<usize>) {
        let rows = self.design.nrows();
        let mut basis: Vec<DVector<f64>> = Vec::new();
        let mut kept = Vec::new();
        for (place, &column) in columns.iter().enumerate() {
            let mut rest = self.design.column(column.position()).clone_owned();
            for _ in 0..2 {
                for q in &basis {
                    let shadow = q.dot(&rest);
                    rest.axpy(-shadow, q, 1.0);
                }
            }
            let left = rest.norm();
            if left > self.spanned * self.norms[column] && left > 0.0 {
                basis.push(rest / left);
                kept.push(place);
            }
        }
        (DMatrix::from_fn(rows, basis.len(), |r, c| basis[c][r]), kept)
    }

    fn solve(&self, columns: &[Column], kept: &[usize]) -> (Vec<f64>, Vec<f64>) {
        let mut coefficients = vec![0.0; columns.len()];
        let mut errors = vec![f64::INFINITY; columns.len()];
        let chosen: Vec<usize> = kept.iter().map(|&place| columns[place].position()).collect();
        if chosen.is_empty() {
            return (coefficients, errors);
        }
        let decomposition = self.design.select_columns(&chosen).qr();
        let heights = decomposition.q().tr_mul(&self.target);
        let r = decomposition.r();
        let size = chosen.len();
        let solved = r.solve_upper_triangular(&heights);
        let inverse = r.solve_upper_triangular(&DMatrix::identity(size, size));
        if let (Some(solved), Some(inverse)) = (solved, inverse) {
            for (i, &place) in kept.iter().enumerate() {
                coefficients[place] = solved[i];
                errors[place] = (inverse.row(i).norm_squared() * self.variance).sqrt();
            }
        }
        (coefficients, errors)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64;

    const PROBE: [Column; 1] = [Column::new(0)];
    const OTHER: [Column; 1] = [Column::new(1)];
    const COPY: [Column; 1] = [Column::new(2)];

    /// Rows y = 2 x0 + c x1 + noise, with probes x1, x2 and a copy of x1.
    fn scores(c: f64, seed: u64) -> Scores {
        let mut generator = Pcg64::seed_from_u64(seed);
        let mut draw = || -> f64 { StandardNormal.sample(&mut generator) };
        let rows: Vec<[f64; 5]> = (0..400)
            .map(|_| {
                let x: [f64; 3] = [draw(), draw(), draw()];
                [x[0], x[1], x[2], 3.0 * x[1], 2.0 * x[0] + c * x[1] + 0.1 * draw()]
            })
            .collect();
        let matrix = DMatrix::from_fn(400, 5, |r, k| rows[r][k]);
        let mut factor = Factor::new(4);
        factor.push(&matrix, 400);
        Scores::new(&factor, 1, 0.01, 1e-5)
    }

    #[test]
    fn what_is_there_is_found_with_its_size() {
        let scores = scores(0.05, 1);
        let score = scores.group(&PROBE);
        assert!((score.coefficients[0] - 0.05).abs() < 4.0 * score.standard_errors[0]);
        assert!((score.standard_errors[0] - 0.1 / 20.0).abs() < 5e-4);
        assert!(score.p_value < 1e-12);
        assert!(scores.group(&OTHER).p_value > 1e-3);
        assert!(scores.given(&PROBE).group(&OTHER).p_value > 1e-3);
    }

    #[test]
    fn a_copy_cannot_be_told_apart_and_adds_nothing() {
        let scores = scores(0.05, 2);
        assert!(scores.overlap(&PROBE, &COPY) > 0.999_999);
        assert!(scores.overlap(&PROBE, &OTHER) < 0.1);
        assert_eq!(scores.group(&[PROBE[0], COPY[0]]).degrees, 1);
        assert_eq!(scores.given(&PROBE).group(&COPY).degrees, 0);
    }

    #[test]
    fn without_an_effect_the_p_values_are_uniform() {
        let small = (0..400).filter(|&seed| scores(0.0, seed).group(&PROBE).p_value < 0.1).count();
        assert!((20..=62).contains(&small), "{small} of 400 below 0.1");
    }
}
