//! Columns that show how fast something moves where no column shows where it is: those of a
//! gyroscope, a speedometer or an accelerometer.

use super::words::{self, Named};
use crate::data::Table;
use crate::expr::Unit;

/// Which derivative of a coordinate by time a column shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Derivative {
    First,
    Second,
}

/// A column that shows a derivative of a coordinate that has no column of its own.
#[derive(Debug, Clone)]
pub(super) struct Rate<'a> {
    pub named: Named<'a>,
    pub derivative: Derivative,
    /// Whether the coordinate is an angle.
    pub turns: bool,
    /// The mean of its readings, in the unit of the column.
    pub mean: f64,
    /// How many other columns are of its kind and vary less.
    pub others: usize,
}

/// Units of derivatives: which they are of, and whether of an angle. A new one is one row here.
const UNITS: &[(&str, Derivative, bool)] = &[
    ("rad/s", Derivative::First, true),
    ("m/s", Derivative::First, false),
    ("px/s", Derivative::First, false),
    ("rad/s^2", Derivative::Second, true),
    ("m/s^2", Derivative::Second, false),
    ("px/s^2", Derivative::Second, false),
];

/// Grams in a column of an acceleration are multiples of the standard acceleration of gravity.
const MULTIPLES: &[(&str, &str)] = &[("g", "g_n"), ("mg", "mg_n")];

/// Words of names that say the same. The axis of an instrument may stand behind them without a
/// blank, as in `accX`.
const WORDS: &[(&str, Derivative, bool)] = &[
    ("omega", Derivative::First, true),
    ("gyroscope", Derivative::First, true),
    ("gyro", Derivative::First, true),
    ("gyr", Derivative::First, true),
    ("gyroskop", Derivative::First, true),
    ("velocity", Derivative::First, false),
    ("vel", Derivative::First, false),
    ("v", Derivative::First, false),
    ("acceleration", Derivative::Second, false),
    ("accelerometer", Derivative::Second, false),
    ("accel", Derivative::Second, false),
    ("acc", Derivative::Second, false),
    ("beschleunigung", Derivative::Second, false),
    ("winkelbeschleunigung", Derivative::Second, true),
    ("accélération", Derivative::Second, false),
    ("aceleración", Derivative::Second, false),
    ("accelerazione", Derivative::Second, false),
];

impl Rate<'_> {
    /// What the coordinate is called in a first spec.
    pub(super) fn coordinate(&self) -> &'static str {
        if self.turns { "theta" } else { "x" }
    }

    /// The unit of the coordinate in the file: that before the slash of `mm/s`, else the plain one
    /// of its kind.
    pub(super) fn unit_of_coordinate(&self) -> Option<String> {
        let unit = self.named.unit.as_deref()?;
        let before = unit.split_once('/').filter(|(_, behind)| matches!(*behind, "s" | "s^2"));
        let plain = if self.turns { "rad" } else { "m" };
        Some(match before {
            Some((length, _)) if !self.turns => length.trim().to_string(),
            _ => plain.to_string(),
        })
    }
}

/// Of the columns that show a derivative the one that varies most: velocities before accelerations,
/// as they need one integration less.
pub(super) fn strongest<'a>(columns: &[&Named<'a>], table: &Table) -> Option<Rate<'a>> {
    let all = columns.iter().filter(|named| words::drives(named).is_none());
    let mut rates: Vec<(f64, Rate)> = all.filter_map(|named| of_column(named, table)).collect();
    let first = |rate: &Rate| rate.derivative == Derivative::First;
    if rates.iter().any(|row| first(&row.1)) {
        rates.retain(|row| first(&row.1));
    }
    let turns = rates.first()?.1.turns;
    rates.retain(|row| row.1.turns == turns);
    let others = rates.len() - 1;
    // Of columns that vary alike the first of the file.
    let (_, rate) =
        rates.into_iter().reduce(|best, next| if next.0 > best.0 { next } else { best })?;
    Some(Rate { others, ..rate })
}

/// What a column shows, by its unit or, without one, by its name; and the variance of its readings
/// in base units.
fn of_column<'a>(named: &Named<'a>, table: &Table) -> Option<(f64, Rate<'a>)> {
    let mut named = named.clone();
    let multiple = MULTIPLES.iter().find(|(grams, _)| named.unit.as_deref() == Some(grams));
    if let (Some((_, unit)), Some((Derivative::Second, false))) = (multiple, by_name(&named)) {
        named.unit = Some((*unit).to_string());
    }
    let (derivative, turns) = match named.unit.as_deref() {
        Some(unit) => by_unit(unit)?,
        None => by_name(&named)?,
    };
    let numbers = table.numbers(named.column).unwrap_or_default();
    let known: Vec<f64> = numbers.into_iter().filter(|x| !x.is_nan()).collect();
    let count = known.len().max(1) as f64;
    let mean = known.iter().sum::<f64>() / count;
    let variance = known.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
    let scale = named.unit.as_deref().and_then(|unit| Unit::parse(unit).ok());
    let scale = scale.map_or(1.0, |unit| unit.scale);
    Some((scale * scale * variance, Rate { named, derivative, turns, mean, others: 0 }))
}

fn by_unit(text: &str) -> Option<(Derivative, bool)> {
    let unit = Unit::parse(text).ok()?;
    // Hertz is no rate of an angle, though its dimensions are the same.
    let says_angle = ["rad", "deg", "rev", "turn", "rpm"].iter().any(|word| text.contains(word));
    let is = |like: &str| Unit::parse(like).is_ok_and(|like| like.same_kind(unit));
    let row = UNITS.iter().find(|(like, _, turns)| *turns == says_angle && is(like))?;
    Some((row.1, row.2))
}

fn by_name(named: &Named) -> Option<(Derivative, bool)> {
    // A capital alone is a voltage.
    if named.name.trim() == "V" {
        return None;
    }
    match named.key.as_str() {
        "wx" | "wy" | "wz" => return Some((Derivative::First, true)),
        "ax" | "ay" | "az" => return Some((Derivative::Second, false)),
        _ => {}
    }
    let words = words::words(&named.key.replace('_', " "));
    let is = |word: &str, name: &str| {
        let stem = word.trim_end_matches(|c: char| c.is_ascii_digit());
        let axis = name.len() > 2
            && stem.strip_prefix(name).is_some_and(|rest| matches!(rest, "x" | "y" | "z"));
        stem == name || axis
    };
    let row = WORDS.iter().find(|(name, ..)| words.iter().any(|word| is(word, name)))?;
    Some((row.1, row.2 || words.iter().any(|word| word.starts_with("angular"))))
}
