//! The size of what was measured: spread, rounding, how much there is.

use super::blocking::BLOCKING;
use rayon::prelude::*;

use super::states::States;
use crate::data::Packed;
use crate::error::{Error, ErrorKind, Result};

/// One observable over all runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObservableScale {
    /// Standard deviation; of a column that never changes its size, at least 1. `None` where
    /// nothing was measured.
    pub spread: Option<f64>,
    /// What rounding does to it: a few units in the last place of its largest value, or what it
    /// moves by while a rounded clock is off.
    pub rounding: f64,
    /// Values that were measured.
    pub measured: usize,
}

/// The scale of each of the first `observables` observables.
pub fn scales(measured: &Packed, observables: usize) -> Vec<ObservableScale> {
    let of = |row: usize| {
        let mut scale = scale(measured.column(row));
        scale.rounding = scale.rounding.max(rounding_of_time(measured, row));
        scale
    };
    (0..observables).into_par_iter().map(of).collect()
}

/// What rounding of the time column does to an observable: it moves on while the clock is off.
fn rounding_of_time(measured: &Packed, row: usize) -> f64 {
    let mut most: f64 = 0.0;
    for run in 0..measured.runs() {
        let rounding = measured.clock_of(run).rounding;
        if rounding == 0.0 {
            continue;
        }
        let (times, values) = (measured.times_of(run), measured.values_of(row, run));
        let pairs = times.windows(2).zip(values.windows(2));
        let rates = pairs.map(|(t, x)| (x[1] - x[0]) / (t[1] - t[0])).filter(|x| x.is_finite());
        let (count, squares) = rates.fold((0.0, 0.0), |(n, sum), x| (n + 1.0, sum + x * x));
        if count > 0.0 {
            // Two roundings, each by the square root of three standard deviations at most.
            most = most.max(2.0 * 3f64.sqrt() * rounding * f64::sqrt(squares / count));
        }
    }
    most
}

/// Numbers beyond this, and below its inverse, have squares and products that are no numbers.
const LARGEST: f64 = 1e100;

/// Says what cannot be computed with: values that are too large, or times that are too close or too
/// far apart. Nobody measures that, but damaged files hold it, and files read as another type.
///
/// # Errors
///
/// Where a column reaches beyond 1e100, or the typical interval does.
pub fn measurable(measured: &Packed, names: &[String], typical: f64) -> Result<()> {
    let hint = "look whether the file is damaged, or was written with another type of number; if \
                not, give the column a larger or a smaller unit";
    let refused = |message| Err(Error::new(ErrorKind::Data, message, hint));
    for (row, name) in names.iter().enumerate() {
        let largest = over(measured.column(row), f64::abs, f64::max);
        if largest > LARGEST {
            return refused(format!("`{name}` reaches {largest:.2e}: its squares are no numbers"));
        }
    }
    let sizes = LARGEST.recip()..LARGEST;
    if typical > 0.0 && !sizes.contains(&typical) {
        return refused(format!("one sample follows {typical:.2e} after another"));
    }
    Ok(())
}

/// Why nothing is left to learn from, of a pass that lost so many segments.
pub fn nothing_left(diverged: usize) -> Error {
    let (message, hint) = match diverged {
        0 => (
            "the measurements do not outnumber the unknown initial states",
            "measure momenta or velocities too, or longer runs",
        ),
        _ => (
            "every predicted motion leaves the finite numbers before the next samples",
            "look at what is known of T, V and forces, at units, and at the starts of parameters; \
             `leverrier check` shows them beside the size of the data",
        ),
    };
    Error::new(ErrorKind::InsufficientData, message, hint)
}

/// The spread of each observable. What was not measured is as large as its guess at the start of
/// the segments: a number without a unit, such as 1, would make the result depend on the units of
/// what was measured.
pub fn spreads(scales: &[ObservableScale], states: &States) -> Vec<f64> {
    let guessed = |row: usize| states.spread(row).unwrap_or(1.0);
    scales.iter().enumerate().map(|(row, s)| s.spread.unwrap_or_else(|| guessed(row))).collect()
}

/// Samples of a segment that hold twice as many measured values as a state of so many components
/// has, where there are so many in all.
pub fn fewest_samples(scales: &[ObservableScale], state: usize, samples: usize) -> usize {
    let measured: usize = scales.iter().map(|scale| scale.measured).sum();
    let share = measured.max(1) as f64 / (samples * state).max(1) as f64;
    (2.0 / share - 0.5).ceil() as usize
}

fn scale(cells: &[f64]) -> ObservableScale {
    let add = |a: f64, b: f64| a + b;
    let count = over(cells, |_| 1.0, add);
    let largest = over(cells, f64::abs, f64::max);
    let mean = over(cells, |x| x, add) / count;
    let variance = over(cells, |x| (x - mean).powi(2), add) / count;
    let spread = if variance > 0.0 { variance.sqrt() } else { mean.abs().max(1.0) };
    ObservableScale {
        spread: (count > 0.0).then_some(spread),
        // Sums of a few terms, each rounded; of a column of zeros it must not vanish.
        rounding: (8.0 * f64::EPSILON * largest).max(1e-300),
        measured: count as usize,
    }
}

/// `of` of all that was measured put together by `with`, which leaves a number as it is if the
/// other is zero: eight numbers at a time, for one alone would wait for the one before.
fn over(
    cells: &[f64],
    of: impl Fn(f64) -> f64 + Sync,
    with: impl Fn(f64, f64) -> f64 + Sync,
) -> f64 {
    let of_part = |part: &[f64]| {
        let mut eight = [0.0; 8];
        for cells in part.chunks(8) {
            for (all, &x) in eight.iter_mut().zip(cells) {
                *all = with(*all, if x.is_finite() { of(x) } else { 0.0 });
            }
        }
        eight.into_iter().fold(0.0, &with)
    };
    let parts: Vec<f64> = cells.par_chunks(BLOCKING.samples_together).map(of_part).collect();
    parts.into_iter().fold(0.0, &with)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Packed;

    #[test]
    fn what_has_no_square_is_refused() {
        let names = ["q".to_string(), "p".to_string()];
        let of = |value: f64, step: f64| {
            let times = (0..3).map(|at| step * f64::from(at)).collect();
            let columns = vec![vec![0.0, f64::NAN, 1.0], vec![1.0, value, 0.0]];
            measurable(&Packed::run_of(times, columns), &names, step)
        };
        for (value, step) in [(1e53, 0.1), (-1e-300, 1e-12), (f64::NAN, 3e7)] {
            assert!(of(value, step).is_ok(), "{value} {step}");
        }
        for (value, step) in [(6.2e276, 0.1), (-1e150, 0.1), (1.0, 2.7e-290), (1.0, 1e204)] {
            let error = of(value, step).expect_err("no square").to_string();
            assert!(error.contains("damaged"), "{error}");
        }
    }

    #[test]
    fn gaps_do_not_count() {
        let times: Vec<f64> = (0..40_003).map(f64::from).collect();
        let mut column: Vec<f64> = times.iter().map(|t| 3.0 + (-1f64).powf(*t) * 0.5).collect();
        column[7] = f64::NAN;
        column[30_000] = f64::NAN;
        let nothing = vec![f64::NAN; times.len()];
        let still = vec![-4.0; times.len()];
        let all = scales(&Packed::run_of(times, vec![column, nothing, still]), 3);
        assert_eq!(all[0].measured, 40_001);
        assert!((all[0].spread.unwrap_or(0.0) - 0.5).abs() < 1e-8, "{:?}", all[0]);
        assert_eq!(all[0].rounding, 8.0 * f64::EPSILON * 3.5);
        assert_eq!((all[1].measured, all[1].spread), (0, None));
        assert_eq!(all[2].spread, Some(4.0));
    }
}
