//! The Cramér-Rao bound, computed from scratch: information matrix of the true law with known
//! noise and unknown initial states, from finite differences of a hand-written integrator.
//! Nothing here uses the library.

use nalgebra::{DMatrix, DVector};

/// A law as plain functions: dH/dq and dH/dp at a state, with coefficients theta.
pub(crate) struct PlainLaw {
    pub theta: Vec<f64>,
    /// The time derivative of the state (q1, q2, p1, p2).
    pub flow: fn(&[f64], &[f64]) -> [f64; 4],
}

/// Hénon-Heiles with its six coefficients, in the order of `henon_heiles().terms`.
pub(crate) fn henon_heiles() -> PlainLaw {
    PlainLaw {
        theta: vec![0.5, 0.5, 0.5, 0.5, 1.0, -1.0 / 3.0],
        flow: |x, c| {
            [
                2.0 * c[0] * x[2],
                2.0 * c[1] * x[3],
                -2.0 * c[2] * x[0] - 2.0 * c[4] * x[0] * x[1],
                -2.0 * c[3] * x[1] - c[4] * x[0] * x[0] - 3.0 * c[5] * x[1] * x[1],
            ]
        },
    }
}

/// The coupled oscillators with their five coefficients, in the order of `coupled().terms`.
pub(crate) fn coupled() -> PlainLaw {
    PlainLaw {
        theta: vec![0.5; 5],
        flow: |x, c| {
            [
                2.0 * c[0] * x[2],
                2.0 * c[1] * x[3],
                -2.0 * c[2] * x[0] - 2.0 * c[4] * x[0] * x[1] * x[1],
                -2.0 * c[3] * x[1] - 2.0 * c[4] * x[0] * x[0] * x[1],
            ]
        },
    }
}

impl PlainLaw {
    /// The state after `time`, by the classical Runge-Kutta method in twenty steps a tenth.
    pub(crate) fn follow(&self, start: &[f64], theta: &[f64], time: f64) -> [f64; 4] {
        let steps = ((time / 0.005).round() as usize).max(1);
        let h = time / steps as f64;
        let mut x = [start[0], start[1], start[2], start[3]];
        for _ in 0..steps {
            let moved = |slope: &[f64; 4], by: f64| {
                let mut y = x;
                y.iter_mut().zip(slope).for_each(|(y, s)| *y += by * s);
                y
            };
            let a = (self.flow)(&x, theta);
            let b = (self.flow)(&moved(&a, h / 2.0), theta);
            let c = (self.flow)(&moved(&b, h / 2.0), theta);
            let d = (self.flow)(&moved(&c, h), theta);
            for i in 0..4 {
                x[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
            }
        }
        x
    }

    /// Derivatives of the state after `time` by the start (4 x 4) and by theta (4 x K).
    fn jacobians(&self, start: &[f64], time: f64) -> (DMatrix<f64>, DMatrix<f64>) {
        let width = 1e-4;
        let column = |vary: &dyn Fn(f64) -> [f64; 4]| {
            let (up, down) = (vary(width), vary(-width));
            DVector::from_fn(4, |i, _| (up[i] - down[i]) / (2.0 * width))
        };
        let by_start: Vec<DVector<f64>> = (0..4)
            .map(|k| {
                column(&|by| {
                    let mut start = start.to_vec();
                    start[k] += by;
                    self.follow(&start, &self.theta, time)
                })
            })
            .collect();
        let by_theta: Vec<DVector<f64>> = (0..self.theta.len())
            .map(|k| {
                column(&|by| {
                    let mut theta = self.theta.clone();
                    theta[k] += by;
                    self.follow(start, &theta, time)
                })
            })
            .collect();
        (DMatrix::from_columns(&by_start), DMatrix::from_columns(&by_theta))
    }

    /// The smallest covariance that an unbiased estimate of theta can have, from runs of
    /// `samples` samples, 0.1 apart, of all four components with noise `sigma`.
    pub(crate) fn covariance(
        &self,
        starts: &[Vec<f64>],
        samples: usize,
        sigma: f64,
    ) -> DMatrix<f64> {
        let size = self.theta.len();
        let mut information = DMatrix::zeros(size, size);
        for start in starts {
            // The first sample is the initial state itself.
            let mut ss = DMatrix::identity(4, 4);
            let mut st = DMatrix::zeros(4, size);
            let mut tt = DMatrix::zeros(size, size);
            for sample in 1..samples {
                let (by_start, by_theta) = self.jacobians(start, 0.1 * sample as f64);
                ss += by_start.transpose() * &by_start;
                st += by_start.transpose() * &by_theta;
                tt += by_theta.transpose() * &by_theta;
            }
            let inverse = ss.try_inverse().expect("the first sample alone fixes the state");
            information += tt - st.transpose() * inverse * st;
        }
        information.try_inverse().expect("every coefficient can be learned") * (sigma * sigma)
    }

    /// Expected mean absolute error of a prediction one step ahead, of each component, for
    /// Gaussian estimates with this covariance.
    pub(crate) fn one_step(&self, starts: &[Vec<f64>], covariance: &DMatrix<f64>) -> Vec<f64> {
        let mut mean = vec![0.0; 4];
        for start in starts {
            let (_, by_theta) = self.jacobians(start, 0.1);
            let spread = &by_theta * covariance * by_theta.transpose();
            for (i, sum) in mean.iter_mut().enumerate() {
                // E|x| = sqrt(2/pi) sigma.
                let expected = (2.0 / std::f64::consts::PI * spread[(i, i)]).sqrt();
                *sum += expected / starts.len() as f64;
            }
        }
        mean
    }
}
