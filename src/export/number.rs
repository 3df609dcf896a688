//! Numbers as the exporters write them: LaTeX, comments in code, and nice fractions.

pub use crate::simplify::measured::{Measured, shortest, significant};

impl Measured {
    /// For LaTeX in mathematics mode: `1.5(2) \times 10^{-7}`.
    pub fn tex(&self) -> String {
        let mut out = self.digits.clone();
        if let Some(uncertainty) = &self.uncertainty {
            out += &format!("({uncertainty})");
        }
        if self.exponent != 0 {
            out += &format!(r" \times 10^{{{}}}", self.exponent);
        }
        out
    }
}

/// A value with its standard error as text: [`Measured::new`], then [`Measured::text`].
pub fn with_uncertainty(value: f64, standard_error: f64) -> String {
    Measured::new(value, standard_error).text()
}

/// The fraction with denominator up to `largest` that is exactly this number (to the last bit).
pub fn fraction(value: f64, largest: u32) -> Option<(i64, i64)> {
    if !value.is_finite() || value.abs() > 1e6 {
        return None;
    }
    (1..=largest).find_map(|denominator| {
        let numerator = (value * f64::from(denominator)).round();
        (numerator / f64::from(denominator) == value)
            .then_some((numerator as i64, i64::from(denominator)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_are_exact() {
        assert_eq!(fraction(0.5, 100), Some((1, 2)));
        assert_eq!(fraction(-2.0 / 3.0, 100), Some((-2, 3)));
        assert_eq!(fraction(4.0, 100), Some((4, 1)));
        assert_eq!(fraction(0.501, 100), None);
        assert_eq!(fraction(f64::INFINITY, 100), None);
    }
}
