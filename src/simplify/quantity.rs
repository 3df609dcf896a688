//! A number that was computed from fitted ones: its value, and how it depends on them.

use nalgebra::DMatrix;

/// A number with its first derivatives by the fitted numbers (the delta method).
///
/// A number without derivatives is known exactly.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Quantity {
    pub value: f64,
    /// (index of the fitted number, derivative), sorted by index, no zeros.
    pub slopes: Vec<(usize, f64)>,
}

impl Quantity {
    /// A number that was not learned.
    pub(super) fn known(value: f64) -> Self {
        Quantity { value, slopes: Vec::new() }
    }

    /// The fitted number of that index in the covariance.
    pub(super) fn fitted(index: usize, value: f64) -> Self {
        Quantity { value, slopes: vec![(index, 1.0)] }
    }

    pub(super) fn is_known(&self) -> bool {
        self.slopes.is_empty()
    }

    /// f(a, b) with value `value` and partial derivatives `by_a`, `by_b`.
    pub(super) fn combine(value: f64, a: &Quantity, by_a: f64, b: &Quantity, by_b: f64) -> Self {
        let mut slopes = Vec::with_capacity(a.slopes.len() + b.slopes.len());
        let (mut left, mut right) = (a.slopes.iter().peekable(), b.slopes.iter().peekable());
        loop {
            let next = match (left.peek(), right.peek()) {
                (None, None) => break,
                (Some(&&(i, s)), Some(&&(j, t))) if i == j => {
                    left.next();
                    right.next();
                    (i, by_a * s + by_b * t)
                }
                (Some(&&(i, s)), other) if other.is_none_or(|&&(j, _)| i < j) => {
                    left.next();
                    (i, by_a * s)
                }
                (_, Some(&&(j, t))) => {
                    right.next();
                    (j, by_b * t)
                }
                (Some(_), None) => break,
            };
            if next.1 != 0.0 {
                slopes.push(next);
            }
        }
        Quantity { value, slopes }
    }

    pub(super) fn plus(&self, other: &Quantity) -> Self {
        Quantity::combine(self.value + other.value, self, 1.0, other, 1.0)
    }

    pub(super) fn minus(&self, other: &Quantity) -> Self {
        Quantity::combine(self.value - other.value, self, 1.0, other, -1.0)
    }

    pub(super) fn times(&self, other: &Quantity) -> Self {
        Quantity::combine(self.value * other.value, self, other.value, other, self.value)
    }

    /// self / other; infinite where `other` is zero.
    pub(super) fn over(&self, other: &Quantity) -> Self {
        let ratio = self.value / other.value;
        Quantity::combine(ratio, self, 1.0 / other.value, other, -ratio / other.value)
    }

    pub(super) fn scaled(&self, factor: f64) -> Self {
        self.mapped(self.value * factor, factor)
    }

    pub(super) fn shifted(&self, by: f64) -> Self {
        Quantity { value: self.value + by, slopes: self.slopes.clone() }
    }

    /// f(self) with value `value` and derivative `slope`.
    pub(super) fn mapped(&self, value: f64, slope: f64) -> Self {
        let slopes = self.slopes.iter().map(|&(i, s)| (i, s * slope)).collect();
        Quantity { value, slopes }
    }

    /// self ^ exponent.
    pub(super) fn raised(&self, exponent: f64) -> Self {
        let value = crate::expr::raise(self.value, exponent);
        self.mapped(value, exponent * crate::expr::raise(self.value, exponent - 1.0))
    }

    /// Square root of the variance; zero for what is known exactly.
    pub(super) fn standard_error(&self, covariance: &DMatrix<f64>) -> f64 {
        let entry = |i: usize, j: usize| covariance.get((i, j)).copied().unwrap_or(0.0);
        let mut variance = 0.0;
        for &(i, s) in &self.slopes {
            for &(j, t) in &self.slopes {
                variance += s * t * entry(i, j);
            }
        }
        if variance > 0.0 { variance.sqrt() } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_follow_the_delta_method() {
        let covariance = DMatrix::from_row_slice(2, 2, &[0.04, 0.01, 0.01, 0.09]);
        let (a, b) = (Quantity::fitted(0, 2.0), Quantity::fitted(1, 5.0));
        let sum = a.plus(&b).standard_error(&covariance);
        assert!((sum - 0.15f64.sqrt()).abs() < 1e-15);
        let difference = b.minus(&a).standard_error(&covariance);
        assert!((difference - 0.11f64.sqrt()).abs() < 1e-15);
        // Finite differences of a / b^2 times the covariance.
        let f = |a: f64, b: f64| a / (b * b);
        let h = 1e-5;
        let by_a = (f(2.0 + h, 5.0) - f(2.0 - h, 5.0)) / (2.0 * h);
        let by_b = (f(2.0, 5.0 + h) - f(2.0, 5.0 - h)) / (2.0 * h);
        let truth = (by_a * by_a * 0.04 + 2.0 * by_a * by_b * 0.01 + by_b * by_b * 0.09).sqrt();
        let ours = a.over(&b.raised(2.0)).standard_error(&covariance);
        assert!((ours - truth).abs() < 1e-9 * truth.max(1.0));
        assert_eq!(a.minus(&a).slopes, vec![]);
        assert_eq!(Quantity::known(3.0).standard_error(&covariance), 0.0);
    }
}
