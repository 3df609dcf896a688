//! Which learned numbers may be printed as nice ones.
//!
//! A number is taken for a nice one only if it lies within its uncertainty of it, and if
//! the uncertainty is so small that a number drawn at random would rarely lie that near
//! to any number that is as nice. The fitted model is never changed, only its print.

use std::fmt;

use super::lang::Rational;

/// A rational number, or a rational multiple of pi.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NiceNumber {
    /// Carries the sign.
    pub numerator: i64,
    /// Positive, without a common factor with the numerator.
    pub denominator: i64,
    /// Whether the rational is multiplied by pi.
    pub pi: bool,
}

impl NiceNumber {
    /// As a floating-point number.
    pub fn value(self) -> f64 {
        let ratio = self.numerator as f64 / self.denominator as f64;
        if self.pi { ratio * std::f64::consts::PI } else { ratio }
    }

    /// The rational factor, without pi.
    pub(super) fn rational(self) -> Rational {
        Rational::new(self.numerator.into(), self.denominator.into()).unwrap_or(Rational::ONE)
    }

    pub(super) fn of(rational: Rational, pi: bool) -> Self {
        NiceNumber { numerator: *rational.0.numer(), denominator: *rational.0.denom(), pi }
    }
}

/// `1/2`, `-3`, `pi/2`, `3*pi/4`: the mini-language's syntax.
impl fmt::Display for NiceNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.pi && self.numerator != 0, self.numerator) {
            (false, n) => write!(f, "{n}")?,
            (true, 1) => write!(f, "pi")?,
            (true, -1) => write!(f, "-pi")?,
            (true, n) => write!(f, "{n}*pi")?,
        }
        if self.denominator != 1 { write!(f, "/{}", self.denominator) } else { Ok(()) }
    }
}

/// What a number may be taken for: a row of denominators to try, simplest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Niceness {
    /// A factor: p/q with q <= 12, never 0.
    Factor,
    /// A phase: p pi/q with q one of 1, 2, 3, 4, 6, or 0.
    Phase,
    /// An offset: p/q with q <= 4, or 0.
    Offset,
}

impl Niceness {
    fn denominators(self) -> &'static [i64] {
        match self {
            Niceness::Factor => &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12],
            Niceness::Phase => &[1, 2, 3, 4, 6],
            Niceness::Offset => &[1, 2, 3, 4],
        }
    }
}

/// How far a number may be moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// Standard errors.
    pub sigmas: f64,
    /// Fraction of the number (of 1, for numbers near zero) that integration and rounding
    /// leave uncertain however small the standard error is.
    pub relative: f64,
    /// Largest probability that a random number lies as near to a number as nice.
    pub probability: f64,
}

impl Default for Tolerance {
    fn default() -> Self {
        Tolerance { sigmas: 2.0, relative: 1e-7, probability: 0.05 }
    }
}

/// Largest numerator of a fraction; whole numbers may be larger.
const LARGEST_NUMERATOR: f64 = 144.0;
const LARGEST_WHOLE: f64 = 1e5;

/// The nice number that `value` may be printed as.
pub fn nice(
    value: f64,
    standard_error: f64,
    niceness: Niceness,
    tolerance: Tolerance,
) -> Option<NiceNumber> {
    if !value.is_finite() || !standard_error.is_finite() {
        return None;
    }
    let pi = niceness == Niceness::Phase;
    let unit = if pi { std::f64::consts::PI } else { 1.0 };
    let value = value / unit;
    let scale = if niceness == Niceness::Factor { value.abs() } else { value.abs().max(1.0) };
    let window = (tolerance.sigmas * standard_error / unit).max(tolerance.relative * scale);
    let mut density = 0.0;
    for &denominator in niceness.denominators() {
        density += totient(denominator);
        if 2.0 * window * density > tolerance.probability {
            // More complicated numbers lie still denser.
            return None;
        }
        let numerator = (value * denominator as f64).round();
        let near = (value - numerator / denominator as f64).abs() <= window;
        let limit = if denominator == 1 { LARGEST_WHOLE } else { LARGEST_NUMERATOR };
        let allowed = numerator != 0.0 || niceness != Niceness::Factor;
        if near && allowed && numerator.abs() <= limit {
            let rational = Rational::new(numerator as i128, denominator.into())?;
            return Some(NiceNumber::of(rational, pi && numerator != 0.0));
        }
    }
    None
}

/// How many fractions of that denominator, in lowest terms, a unit interval holds.
fn totient(n: i64) -> f64 {
    (1..=n).filter(|&k| gcd(k, n) == 1).count() as f64
}

fn gcd(a: i64, b: i64) -> i64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(value: f64, error: f64, niceness: Niceness) -> Option<String> {
        nice(value, error, niceness, Tolerance::default()).map(|nice| nice.to_string())
    }

    #[test]
    fn numbers_snap_within_their_uncertainty_only() {
        let factor = |v, e| text(v, e, Niceness::Factor);
        assert_eq!(factor(0.5001, 0.001), Some("1/2".into()));
        assert_eq!(factor(-1.0 / 3.0 + 1e-4, 1e-3), Some("-1/3".into()));
        assert_eq!(factor(1.999_999_9, 0.0), Some("2".into()));
        assert_eq!(factor(0.4997, 0.2), None, "far too uncertain to be called a half");
        assert_eq!(factor(0.51, 0.001), None, "ten standard errors away");
        assert_eq!(factor(0.0, 1e-3), None, "a factor is never dropped");
        assert_eq!(factor(7.0 / 12.0, 1e-4), Some("7/12".into()));
        assert_eq!(factor(7.0 / 12.0 + 1e-3, 1e-3), None, "one of too many twelfths");
        assert_eq!(factor(f64::NAN, 1e-3), None);
        assert_eq!(factor(1.0, f64::INFINITY), None);
    }

    #[test]
    fn phases_snap_to_multiples_of_pi_and_to_zero() {
        let phase = |v, e| text(v, e, Niceness::Phase);
        assert_eq!(phase(std::f64::consts::FRAC_PI_2 + 1e-4, 1e-3), Some("pi/2".into()));
        assert_eq!(phase(-0.75 * std::f64::consts::PI, 0.0), Some("-3*pi/4".into()));
        assert_eq!(phase(1e-5, 1e-4), Some("0".into()));
        assert_eq!(phase(1.2, 1e-4), None);
    }

    #[test]
    fn random_numbers_seldom_snap() {
        // The promise of `probability`, measured on numbers that are not nice.
        for error in [1e-6, 1e-4, 1e-3, 1e-2, 0.1] {
            let snapped = (1..=2000)
                .filter(|&k| {
                    let value = 0.3 + 2.5 * (f64::from(k) * 0.618_033_988_749).fract();
                    text(value, error, Niceness::Factor).is_some()
                })
                .count();
            assert!(snapped <= 110, "{snapped} of 2000 snapped at standard error {error}");
        }
    }
}
