//! An error in units of the noise, in words.

/// How many times the noise an error is. Of data without noise these are the digits that were
/// written, and how many times those it is says nothing: numbers end at 10,000.
pub fn times(error: f64) -> String {
    match error.abs() {
        size if size.is_nan() => "unknown".to_string(),
        size if size < 0.005 => "less than 0.01".to_string(),
        size if size < 100.0 => format!("{error:.2}"),
        size if size < 10_000.0 => format!("{error:.0}"),
        _ => "over 10,000".to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::times;

    #[test]
    fn errors_are_as_precise_as_is_useful() {
        let of = [1e-7, 0.976, 99.5, 123.4, 9_999.0, 7.4e13, f64::INFINITY, f64::NAN].map(times);
        let words = [
            "less than 0.01",
            "0.98",
            "99.50",
            "123",
            "9999",
            "over 10,000",
            "over 10,000",
            "unknown",
        ];
        assert_eq!(of, words);
    }
}
