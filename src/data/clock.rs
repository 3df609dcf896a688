//! Times far from zero: counted from the start of their run, in the digits of the file.
//!
//! A double holds sixteen digits. Of a clock that shows seconds since 1970, nine of them are the
//! same in all samples, and the time between two samples has only seven left. So the times of such
//! a run are counted from near its first, by decimal arithmetic on the text of the file, where
//! there is a text; a column of doubles has lost those digits already, and its rounding is noise.

use super::cell::Cell;
use super::table::{Column, Table};

/// What the times of a run are counted from.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Clock {
    /// The time at which `times` are zero, in the spec's unit of time.
    pub origin: f64,
    /// Standard deviation of what rounding did to each time, in the spec's unit of time; 0 where
    /// it did nothing that matters.
    pub rounding: f64,
}

impl Clock {
    /// The time of a sample on the clock of the file.
    pub fn time(&self, since: f64) -> f64 {
        // Adding zero would turn -0 into 0.
        if self.origin == 0.0 { since } else { self.origin + since }
    }
}

/// A run that starts this many of its first steps from zero is counted from there: the rounding of
/// a nearer one is less than 1e-13 of a step.
const FAR: f64 = 1000.0;

/// Whether times of which these are the first two are counted from near the first.
pub(super) fn is_far(first: f64, second: f64) -> bool {
    (first.abs() > FAR * (second - first).abs()) && second != first
}

/// Times of a run, counted from the whole number before its first one: a number that is exact, so
/// that times on the clock of the file come back as they stand there.
pub(super) struct Since {
    scale: f64,
    whole: Decimal,
    origin: f64,
    /// The first time of the run, counted so.
    pub first: f64,
}

impl Since {
    /// `row` is the first of the run, `time` its converted time; `scale` converts cells.
    pub(super) fn new(table: &Table, column: &Column, row: usize, time: f64, scale: f64) -> Since {
        let (whole, origin) = match table.cell(column, row) {
            Cell::Number(cell) => {
                let whole = Decimal::parse(&cell.trunc().to_string(), false);
                (whole.unwrap_or(Decimal::Unknown), cell.trunc() * scale)
            }
            _ => (Decimal::Unknown, time),
        };
        let mut since = Since { scale, whole, origin, first: 0.0 };
        since.first = since.of(table, column, row, time);
        since
    }

    /// The clock of the run, whose cells are like those of `column`.
    pub(super) fn clock(&self, column: &Column) -> Clock {
        // Uniform in half a unit of the last place to either side.
        let of_double = 0.5 * (self.origin.abs().next_up() - self.origin.abs()) / 3f64.sqrt();
        let rounding = if column.cells.as_numbers().is_some() { of_double } else { 0.0 };
        Clock { origin: self.origin, rounding }
    }

    /// The time of a row since the origin, in the spec's unit; `time` is its converted time.
    pub(super) fn of(&self, table: &Table, column: &Column, row: usize, time: f64) -> f64 {
        match Decimal::of(table, column, row).minus(&self.whole) {
            Some(since) => since * self.scale,
            None => time - self.origin,
        }
    }
}

/// A decimal number as it stands in a text: `digits` times ten to the power of `exponent`.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Decimal {
    Exact {
        digits: i128,
        exponent: i32,
    },
    /// Not a text, or one with more digits than are counted.
    Unknown,
}

impl Decimal {
    fn of(table: &Table, column: &Column, row: usize) -> Decimal {
        if column.cells.as_numbers().is_some() {
            return Decimal::Unknown;
        }
        let cell = column.cells.get(row);
        Decimal::parse(&cell, table.reading.decimal_comma()).unwrap_or(Decimal::Unknown)
    }

    fn parse(cell: &str, decimal_comma: bool) -> Option<Decimal> {
        let text = cell.trim().replace('−', "-").replace(['d', 'D', 'E'], "e");
        let text = if decimal_comma { text.replace(',', ".") } else { text };
        let (number, power) = text.split_once('e').unwrap_or((&text, "0"));
        let (whole, part) = number.split_once('.').unwrap_or((number, ""));
        let digits = format!("{whole}{part}").parse().ok()?;
        let exponent = power.parse::<i32>().ok()?.checked_sub(i32::try_from(part.len()).ok()?)?;
        Some(Decimal::Exact { digits, exponent })
    }

    /// The difference, rounded once; none where it is not known.
    fn minus(&self, other: &Decimal) -> Option<f64> {
        let (Decimal::Exact { digits: a, exponent: m }, Decimal::Exact { digits: b, exponent: n }) =
            (*self, *other)
        else {
            return None;
        };
        let least = m.min(n);
        let shifted = |digits: i128, exponent: i32| {
            let places = u32::try_from(exponent.checked_sub(least)?).ok()?;
            digits.checked_mul(10i128.checked_pow(places)?)
        };
        let difference = shifted(a, m)?.checked_sub(shifted(b, n)?)?;
        format!("{difference}e{least}").parse().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_those_of_the_digits() {
        let minus = |a: &str, b: &str| {
            let read = |text: &str| Decimal::parse(text, false).unwrap_or(Decimal::Unknown);
            read(a).minus(&read(b))
        };
        for (a, b, difference) in [
            ("1700000000.1", "1700000000", Some(0.1)),
            ("1700000000.30", "1.7e9", Some(0.3)),
            ("1000000.123456789012", "1000000.0", Some(0.123456789012)),
            ("-1.7D+09", "-1700000000.1", Some(0.1)),
            ("+5", "2", Some(3.0)),
            ("1e300", "1", None),
            ("1234567890123456789012345678901234567890", "1", None),
            ("12 s", "1", None),
        ] {
            assert_eq!(minus(a, b), difference, "{a} - {b}");
        }
        let comma = |text: &str| Decimal::parse(text, true).unwrap_or(Decimal::Unknown);
        assert_eq!(comma("1700000000,1").minus(&comma("1700000000")), Some(0.1));
    }

    #[test]
    fn only_far_clocks_are_counted_anew() {
        assert!(!is_far(0.0, 0.1) && !is_far(50.0, 50.1) && is_far(1.7e9, 1.7e9 + 0.1));
        assert!(is_far(-1e6, -1e6 + 1.0) && !is_far(5.0, 5.0));
    }
}
