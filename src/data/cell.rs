//! One cell of a file, as a number or as the lack of one.

/// What a cell says when a number is asked of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cell {
    /// A finite number.
    Number(f64),
    /// Nothing was measured: empty, or one of the usual words for that.
    Missing,
    /// An infinity, by name or as the result of a spreadsheet's division by zero.
    Infinite,
    /// A number beyond the range of double precision.
    TooLarge,
    /// Anything else.
    Text,
}

/// How people write that nothing was measured (in lower case).
const MISSING: &[&str] = &[
    "",
    "na",
    "n/a",
    "n.a.",
    "#n/a",
    "#nv",
    "nan",
    "-nan",
    "nan(ind)",
    "-nan(ind)",
    "1.#qnan",
    "-1.#ind",
    "null",
    "none",
    "nil",
    "?",
    // Beyond the range of the instrument.
    "overload",
    "overrange",
    "overflow",
    "ovld",
    "ovf",
    "out of range",
    "invalid",
    "undefined",
    "#value!",
    "#wert!",
    "#ref!",
    "#num!",
];

/// How people and programs write infinity, without its sign (in lower case).
const INFINITE: &[&str] = &["inf", "infinity", "1.#inf", "∞", "#div/0!"];

/// Reads one cell. With `decimal_comma`, the only comma of a number is its decimal sign.
///
/// Understood beside ordinary literals: a leading plus, the typographic minus sign and
/// Fortran's `1.5D-03`.
pub fn parse_cell(cell: &str, decimal_comma: bool) -> Cell {
    let cell = cell.trim();
    // The ordinary number first: it is nearly every cell of a file.
    if cell.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '-' | '+' | '.' | ',' | '−'))
        && let Some(number) = number(cell, decimal_comma)
    {
        return if number.is_finite() { Cell::Number(number) } else { Cell::TooLarge };
    }
    // `--`, `--.---` and the like, as displays show what they do not have.
    if !cell.is_empty() && cell.chars().all(|c| matches!(c, '-' | '.' | '_' | '*' | '–' | '—'))
    {
        return Cell::Missing;
    }
    let lower = cell.to_lowercase();
    if MISSING.contains(&lower.as_str()) {
        return Cell::Missing;
    }
    let unsigned = lower.strip_prefix(['-', '+', '−']).unwrap_or(&lower);
    if INFINITE.contains(&unsigned) {
        return Cell::Infinite;
    }
    Cell::Text
}

fn number(cell: &str, decimal_comma: bool) -> Option<f64> {
    // `f64::from_str` also takes "inf" and "nan", which are none of ours.
    let plain = |text: &str| {
        text.bytes().all(|b| b.is_ascii_digit() || matches!(b, b'+' | b'-' | b'.' | b'e' | b'E'))
    };
    if plain(cell) {
        return cell.parse().ok();
    }
    let mut text = cell.replace('−', "-");
    if decimal_comma {
        if text.contains('.') || text.matches(',').count() > 1 {
            return None;
        }
        text = text.replace(',', ".");
    }
    let text = text.replace(['d', 'D'], "e");
    if plain(&text) { text.parse().ok() } else { None }
}

/// The shortest decimal that reads back as exactly `number`; nothing for NaN.
pub fn format_number(number: f64) -> String {
    if number.is_nan() {
        return String::new();
    }
    let text = format!("{number:?}");
    match text.strip_suffix(".0") {
        Some(whole) => whole.to_string(),
        None => text,
    }
}

/// A number to four significant digits.
pub fn short(number: f64) -> String {
    match format!("{number:.3e}").parse::<f64>() {
        Ok(rounded) => format_number(rounded),
        Err(_) => format_number(number),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_mean_what_people_mean() {
        let rows = [
            ("1.5", false, Cell::Number(1.5)),
            (" +2 ", false, Cell::Number(2.0)),
            ("-.5e-3", false, Cell::Number(-0.5e-3)),
            ("−3", false, Cell::Number(-3.0)),
            ("1.5D-03", false, Cell::Number(1.5e-3)),
            ("1,5", true, Cell::Number(1.5)),
            ("1.5", true, Cell::Number(1.5)),
            ("1,5", false, Cell::Text),
            ("1.234,5", true, Cell::Text),
            ("1,234,567", true, Cell::Text),
            ("", false, Cell::Missing),
            ("NaN", false, Cell::Missing),
            ("N/A", false, Cell::Missing),
            ("-", false, Cell::Missing),
            ("?", false, Cell::Missing),
            ("--.---", false, Cell::Missing),
            ("OVERLOAD", false, Cell::Missing),
            ("error", false, Cell::Text),
            ("-Inf", false, Cell::Infinite),
            ("Infinity", false, Cell::Infinite),
            ("#DIV/0!", false, Cell::Infinite),
            ("1e999", false, Cell::TooLarge),
            ("12 V", false, Cell::Text),
            ("0x10", false, Cell::Text),
            ("1_000", false, Cell::Text),
        ];
        for (text, comma, expected) in rows {
            assert_eq!(parse_cell(text, comma), expected, "{text:?}");
        }
    }

    #[test]
    fn printed_numbers_read_back_as_the_same_bits() {
        for number in [0.1, -0.0, 1e300, 5e-324, 1.0 / 3.0, f64::MAX, 200.0] {
            let text = format_number(number);
            match parse_cell(&text, false) {
                Cell::Number(back) => assert_eq!(back.to_bits(), number.to_bits(), "{text}"),
                other => panic!("{text} became {other:?}"),
            }
        }
        assert_eq!(format_number(200.0), "200");
        assert_eq!(format_number(f64::NAN), "");
    }

    #[test]
    fn numbers_are_shortened_for_people() {
        assert_eq!(short(0.123_456), "0.1235");
        assert_eq!(short(200.0), "200");
        assert_eq!(short(-1.0e-12), "-1e-12");
    }
}
