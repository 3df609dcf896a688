//! A measured number in print: 0.5012(13), the one notation of uncertainty everywhere.

/// A rounded value, its uncertainty in units of the last digit, and a power of ten.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// The value's decimal digits, with sign and point: `-0.5012`.
    pub digits: String,
    /// Uncertainty of the last digits, with a point where it reaches past that of the value
    /// (`12.3(1.2)`); `?` when unknown; `None` for an exact value.
    pub uncertainty: Option<String>,
    /// The whole is multiplied by 10 to this power.
    pub exponent: i32,
}

/// Digits of a value whose uncertainty is not known.
const UNKNOWN_DIGITS: usize = 6;

impl Measured {
    /// Two digits of the standard error, the value to the same place.
    ///
    /// A zero error means an exact value; an infinite, negative or NaN one an unknown error.
    pub fn new(value: f64, standard_error: f64) -> Measured {
        if !value.is_finite() {
            return Measured { digits: "?".to_string(), uncertainty: None, exponent: 0 };
        }
        if standard_error == 0.0 {
            let (digits, exponent) = shortest(value);
            return Measured { digits, uncertainty: None, exponent };
        }
        if !standard_error.is_finite() || standard_error < 0.0 {
            let (digits, exponent) = significant(value, UNKNOWN_DIGITS);
            return Measured { digits, uncertainty: Some("?".to_string()), exponent };
        }
        let (shown, last) = scientific(standard_error, 1);
        // The power of ten of the second digit, where value and error both end.
        let last = last - 1;
        // Exponent of the leading digit that is shown.
        let leading = decade(value, last).max(last + 1);
        let plain = last <= 0 && (-5..6).contains(&leading);
        let exponent = if plain { 0 } else { leading };
        let decimals = (exponent - last).max(0) as usize;
        let digits = scaled_decimal(value, exponent, decimals);
        let shown = match shown.split_at_checked(1) {
            Some((whole, tenths)) if decimals == 1 => format!("{whole}.{tenths}"),
            _ => shown,
        };
        Measured { digits, uncertainty: Some(shown), exponent }
    }

    /// As plain text: `0.5012(13)`, `1.5(2)e-7`.
    pub fn text(&self) -> String {
        let mut out = self.digits.clone();
        if let Some(uncertainty) = &self.uncertainty {
            out += &format!("({uncertainty})");
        }
        if self.exponent != 0 {
            out += &format!("e{}", self.exponent);
        }
        out
    }
}

/// Decimal digits without point and the power of ten of the first, rounded to `decimals` after it.
fn scientific(value: f64, decimals: usize) -> (String, i32) {
    let text = format!("{:.*e}", decimals, value.abs());
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    (mantissa.replace('.', ""), exponent.parse().unwrap_or(0))
}

/// Power of ten of the first digit after rounding to the place `last`.
fn decade(value: f64, last: i32) -> i32 {
    if value == 0.0 {
        return last;
    }
    let (_, first) = scientific(value, 0);
    let below = scientific(value, 17).1;
    let places = (below - last).clamp(0, 17) as usize;
    if below < last { first.min(last) } else { scientific(value, places).1 }
}

/// value / 10^exponent with a fixed number of decimals, rounded once.
fn scaled_decimal(value: f64, exponent: i32, decimals: usize) -> String {
    let text = if exponent == 0 {
        format!("{value:.decimals$}")
    } else if value != 0.0 && scientific(value, decimals).1 == exponent {
        let text = format!("{value:.decimals$e}");
        text.split_once('e').map_or(text.clone(), |(mantissa, _)| mantissa.to_string())
    } else {
        // Below the error's own decade only a few digits are left: a division is exact enough.
        format!("{:.decimals$}", value / 10f64.powi(exponent))
    };
    let zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    if zero { text.trim_start_matches('-').to_string() } else { text }
}

/// The shortest decimal that reads back as the same number, with a power of ten when that is
/// shorter.
pub fn shortest(value: f64) -> (String, i32) {
    if value == 0.0 || (1e-4..1e7).contains(&value.abs()) {
        return (format!("{}", value + 0.0), 0);
    }
    let text = format!("{value:e}");
    match text.split_once('e') {
        Some((mantissa, exponent)) => (mantissa.to_string(), exponent.parse().unwrap_or(0)),
        None => (text, 0),
    }
}

/// A value with so many digits at most; trailing zeros are cut.
pub fn significant(value: f64, digits: usize) -> (String, i32) {
    let rounded: f64 = format!("{:.*e}", digits.saturating_sub(1), value).parse().unwrap_or(value);
    shortest(rounded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_digits_of_the_error_are_shown() {
        for (value, error, expected) in [
            (0.501_234, 0.001_3, "0.5012(13)"),
            (0.827, 0.119, "0.83(12)"),
            (0.827, 0.367, "0.83(37)"),
            (14.674, 0.964, "14.67(96)"),
            (-9.81, 0.0355, "-9.810(35)"),
            (1.0, 0.0354, "1.000(35)"),
            (0.3, 1.2, "0.3(1.2)"),
            (0.0, 0.01, "0.000(10)"),
            (-0.0001, 0.02, "0.000(20)"),
            (1.5e-7, 2e-8, "1.50(20)e-7"),
            (123_456.0, 2300.0, "1.235(23)e5"),
            (12.0, 2300.0, "0.0(2.3)e3"),
            (0.99999, 0.001_2, "1.0000(12)"),
            (999_999.6, 4.0, "999999.6(4.0)"),
            (6.022_140_76e23, 0.000_000_12e23, "6.02214076(12)e23"),
            (3e-320, 1e-320, "3.0(1.0)e-320"),
        ] {
            assert_eq!(Measured::new(value, error).text(), expected, "{value} +- {error}");
        }
    }

    #[test]
    fn errors_that_say_nothing_are_shown_as_such() {
        assert_eq!(Measured::new(0.5, 0.0).text(), "0.5");
        assert_eq!(Measured::new(0.1, f64::NAN).text(), "0.1(?)");
        assert_eq!(Measured::new(1.0 / 3.0, f64::INFINITY).text(), "0.333333(?)");
        assert_eq!(Measured::new(1.0, -1.0).text(), "1(?)");
        assert_eq!(Measured::new(f64::NAN, 0.1).text(), "?");
        assert_eq!(Measured::new(-0.0, 0.0).text(), "0");
        assert_eq!(Measured::new(2.5e-9, 0.0).text(), "2.5e-9");
    }

    #[test]
    fn the_text_reads_back_within_the_uncertainty() {
        let mut x = 0.37_f64;
        for i in 0..2000 {
            x = (x * 3.97 * (1.0 - x)).clamp(1e-9, 1.0);
            let value = (x - 0.5) * 10f64.powi(i % 23 - 11);
            let error = x * 10f64.powi(i % 23 - 11 + i % 17 - 12);
            let measured = Measured::new(value, error);
            let scale = 10f64.powi(measured.exponent);
            let read: f64 = measured.digits.parse().unwrap();
            let decimals = measured.digits.split_once('.').map_or(0, |(_, d)| d.len());
            let last = scale * 10f64.powi(-(decimals as i32));
            assert!(
                (read * scale - value).abs() <= 0.51 * last + 1e-15 * value.abs(),
                "{value} {error} {measured:?}"
            );
            let shown = measured.uncertainty.clone().unwrap();
            let last = if shown.contains('.') { scale } else { last };
            let shown: f64 = shown.parse().unwrap();
            assert!((shown * last - error).abs() <= 0.051 * error, "{value} {error} {measured:?}");
        }
    }
}
