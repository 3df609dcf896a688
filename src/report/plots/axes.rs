//! Scales, and the numbers that stand at them.

use serde::Serialize;

use super::label::power_of_ten;

/// How values lie along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// Evenly.
    Linear,
    /// By their logarithm; all values are positive.
    Logarithmic,
}

/// A number at an axis, or a name where the axis has rows.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tick {
    /// Where.
    pub value: f64,
    /// What is written there; a mark without a number where it is empty.
    pub text: String,
}

/// One axis of a panel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Axis {
    /// Name of a variable, which is set in italics, or words.
    pub name: String,
    /// Whether `name` is that of a variable of the mini-language.
    pub variable: bool,
    /// Unit in print; empty where there is none.
    pub unit: String,
    /// The value at the left or lower end.
    pub low: f64,
    /// The value at the right or upper end; greater than `low`.
    pub high: f64,
    /// How values lie in between.
    pub scale: Scale,
    /// Ascending.
    pub ticks: Vec<Tick>,
    /// Whether numbers and name are written.
    pub shown: bool,
}

/// Part of the range that is left free beyond the data.
const MARGIN: f64 = 0.05;

impl Axis {
    /// A linear axis over the finite ones of `values`, with a margin.
    pub fn linear(values: impl Iterator<Item = f64>, ticks: usize) -> Axis {
        let (low, high) = extent(values).unwrap_or((0.0, 1.0));
        let margin = MARGIN * (high - low);
        Axis::between(low - margin, high + margin, ticks)
    }

    /// A linear axis from `low` to `high` as they are; widened where there is nothing between.
    pub fn between(low: f64, high: f64, ticks: usize) -> Axis {
        let (low, high) = apart(low, high);
        let ticks = nice_ticks(low, high, ticks);
        Axis { ticks, ..Axis::bare(low, high, Scale::Linear) }
    }

    /// A logarithmic axis over the positive ones of `values`.
    pub fn logarithmic(values: impl Iterator<Item = f64>) -> Axis {
        let positive = values.filter(|x| x.is_finite() && *x >= f64::MIN_POSITIVE);
        let (low, high) = extent(positive).unwrap_or((0.1, 10.0));
        // Less than this says nothing about a power of ten.
        let wide = (high / low).ln().max(0.5);
        let (low, high) = (low * (-0.08 * wide).exp(), high * (0.08 * wide).exp());
        let (low, high) = (low.max(f64::MIN_POSITIVE), high.min(f64::MAX));
        Axis { ticks: decade_ticks(low, high), ..Axis::bare(low, high, Scale::Logarithmic) }
    }

    /// Rows or columns with names: the i-th stands at i.
    pub fn rows(names: impl Iterator<Item = String>) -> Axis {
        let ticks: Vec<Tick> =
            names.enumerate().map(|(i, text)| Tick { value: i as f64, text }).collect();
        let last = ticks.len().max(1) as f64 - 0.5;
        Axis { ticks, ..Axis::bare(-0.5, last, Scale::Linear) }
    }

    fn bare(low: f64, high: f64, scale: Scale) -> Axis {
        let (name, unit) = (String::new(), String::new());
        Axis { name, variable: false, unit, low, high, scale, ticks: Vec::new(), shown: true }
    }

    /// Named by words.
    pub fn words(mut self, name: &str) -> Axis {
        self.name = name.to_string();
        self
    }

    /// Named by a variable with its unit.
    pub fn variable(mut self, name: &str, unit: Option<&str>) -> Axis {
        self.name = name.to_string();
        self.variable = true;
        self.unit = super::label::unit(unit);
        self
    }

    /// With a unit.
    pub fn unit(mut self, unit: &str) -> Axis {
        self.unit = unit.to_string();
        self
    }

    /// Without numbers and name.
    pub fn hidden(mut self) -> Axis {
        self.shown = false;
        self
    }

    /// From 0 at `low` to 1 at `high`; NaN where the scale has no such value.
    pub fn place(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => {
                // Halves, so that the width of the widest range is finite.
                (0.5 * value - 0.5 * self.low) / (0.5 * self.high - 0.5 * self.low)
            }
            Scale::Logarithmic if value > 0.0 => {
                (value.ln() - self.low.ln()) / (self.high.ln() - self.low.ln())
            }
            Scale::Logarithmic => f64::NAN,
        }
    }
}

/// Smallest and largest finite value.
pub(super) fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.filter(|x| x.is_finite()).fold(None, |found, x| match found {
        None => Some((x, x)),
        Some((low, high)) => Some((f64::min(low, x), f64::max(high, x))),
    })
}

/// Two values with a range between them.
fn apart(low: f64, high: f64) -> (f64, f64) {
    let (low, high) = (low.max(f64::MIN / 4.0), high.min(f64::MAX / 4.0));
    let size = low.abs().max(high.abs());
    if high - low > 1e-9 * size && high > low {
        return (low, high);
    }
    let room = if size > 0.0 { 0.1 * size } else { 1.0 };
    (low - room, high + room)
}

/// Ticks at multiples of 1, 2 or 5 times a power of ten, about `count` of them, inside.
pub(super) fn nice_ticks(low: f64, high: f64, count: usize) -> Vec<Tick> {
    let rough = (high / 2.0 - low / 2.0) / count.max(1) as f64 * 2.0;
    if !(rough.is_finite() && rough > 0.0) {
        return Vec::new();
    }
    let power = rough.log10().floor();
    let unit = 10f64.powf(power);
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|m| m * unit)
        .min_by(|a, b| (a / rough).ln().abs().total_cmp(&(b / rough).ln().abs()))
        .unwrap_or(unit);
    let (first, last) = ((low / step).ceil(), (high / step).floor());
    if step <= 0.0 || last - first > 1000.0 || first.abs().max(last.abs()) > 1e15 {
        return Vec::new();
    }
    let steps = (0..=(last - first).max(-1.0) as i64).map(|i| first + i as f64);
    let values: Vec<f64> = steps.take_while(|i| *i <= last).map(|i| i * step).collect();
    let decimals = (-step.log10()).ceil().max(0.0) as usize;
    let largest = values.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    let plain = decimals <= 5 && largest < 1e6;
    values
        .into_iter()
        .map(|value| {
            let text = if plain {
                format!("{value:.decimals$}").replace('-', "−")
            } else {
                let digits = (largest.max(step).log10().floor() - power).clamp(0.0, 12.0) as usize;
                super::label::number(value, digits + 1)
            };
            // A minus sign before nothing.
            let zero = value == 0.0 || text.chars().all(|c| matches!(c, '−' | '0' | '.'));
            Tick { value, text: if zero { "0".to_string() } else { text } }
        })
        .collect()
}

/// Ticks at powers of ten; at 2 and 5 times them too where there are few powers.
fn decade_ticks(low: f64, high: f64) -> Vec<Tick> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let decades = last - first;
    let stride = (decades / 6).max(1);
    let factors: &[f64] = if high / low < 40.0 {
        &[1.0, 2.0, 5.0]
    } else if high / low < 400.0 {
        &[1.0, 3.0]
    } else {
        &[1.0]
    };
    let powers = (first..=last).filter(|power| power.rem_euclid(stride) == 0);
    let ticks: Vec<Tick> = powers
        .flat_map(|power| factors.iter().map(move |factor| (power, *factor)))
        .map(|(power, factor)| {
            let value = format!("{factor}e{power}").parse().unwrap_or(f64::NAN);
            let text = match power {
                -3..=3 => format!("{value}"),
                _ if factor == 1.0 => power_of_ten(power),
                _ => format!("{factor}·{}", power_of_ten(power)),
            };
            Tick { value, text }
        })
        .filter(|tick| tick.value >= low && tick.value <= high)
        .collect();
    if ticks.len() >= 2 { ticks } else { nice_ticks(low, high, 4) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn texts(ticks: &[Tick]) -> Vec<&str> {
        ticks.iter().map(|tick| tick.text.as_str()).collect()
    }

    #[test]
    fn ticks_are_those_that_a_hand_would_draw() {
        assert_eq!(texts(&nice_ticks(-1.05, 1.05, 5)), ["−1.0", "−0.5", "0", "0.5", "1.0"]);
        assert_eq!(texts(&nice_ticks(0.0, 20.0, 5)), ["0", "5", "10", "15", "20"]);
        assert_eq!(texts(&nice_ticks(2.0e-9, 7.0e-9, 3)), ["2·10⁻⁹", "4·10⁻⁹", "6·10⁻⁹"]);
        let axis = Axis::logarithmic([0.9, 120.0].into_iter());
        assert_eq!(texts(&axis.ticks), ["1", "3", "10", "30", "100"]);
        let axis = Axis::logarithmic([1e-9, 1e9].into_iter());
        assert_eq!(axis.ticks.first().map(|t| t.text.as_str()), Some("10⁻⁹"));
        assert!(axis.ticks.len() < 9);
    }

    #[test]
    fn an_axis_without_values_or_spread_is_still_an_axis() {
        for values in [vec![], vec![f64::NAN], vec![0.0, 0.0], vec![3.0], vec![f64::INFINITY]] {
            for axis in
                [Axis::linear(values.iter().copied(), 5), Axis::logarithmic(values.iter().copied())]
            {
                assert!(axis.high > axis.low, "{values:?}: {axis:?}");
                assert!(axis.ticks.len() >= 2, "{values:?}: {axis:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn ticks_lie_inside_ascend_and_differ(a in -1e300..1e300f64, width in -300.0..300.0f64, count in 2usize..9) {
            let axis = Axis::between(a, a + 10f64.powf(width), count);
            prop_assert!(axis.low < axis.high);
            prop_assert!(axis.ticks.len() <= 3 * count + 2, "{:?}", axis.ticks);
            for pair in axis.ticks.windows(2) {
                prop_assert!(pair[0].value < pair[1].value);
            }
            for tick in &axis.ticks {
                let place = axis.place(tick.value);
                prop_assert!((-1e-9..=1.0 + 1e-9).contains(&place), "{:?}", axis);
            }
        }

        #[test]
        fn numbers_at_ticks_differ(a in -1e4..1e4f64, width in -2.0..5.0f64) {
            let axis = Axis::between(a, a + 10f64.powf(width), 5);
            let mut all = texts(&axis.ticks);
            prop_assert!(all.len() >= 2, "{:?}", axis);
            all.dedup();
            prop_assert_eq!(all.len(), axis.ticks.len());
        }

        #[test]
        fn logarithmic_ticks_lie_inside(low in -300.0..300.0f64, decades in 0.0..300.0f64) {
            let low = 10f64.powf(low);
            let high = (low * 10f64.powf(decades)).min(1e305);
            let axis = Axis::logarithmic([low, high].into_iter());
            for tick in &axis.ticks {
                let place = axis.place(tick.value);
                prop_assert!((-1e-9..=1.0 + 1e-9).contains(&place), "{:?}", axis);
            }
        }
    }
}
