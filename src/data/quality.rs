//! Columns that look as if they were not what the spec takes them for.

use serde::Serialize;

use super::Dataset;
use super::cell::short;

/// What is odd about a column.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum SuspicionKind {
    /// No cell was measured.
    Empty,
    /// All cells are the same.
    Constant {
        /// The value of every cell, in the spec's unit.
        value: f64,
    },
    /// The same numbers as another column.
    Duplicate {
        /// Name of the other observable.
        of: String,
    },
    /// Few distinct values, all whole multiples of one step apart.
    Coarse {
        /// The step, in the spec's unit.
        resolution: f64,
        /// How many steps lie between the smallest and the largest value.
        levels: f64,
    },
    /// Rises in proportion to time: a clock or a counter rather than a measurement.
    LooksLikeTime,
}

/// A column that deserves a look.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Suspicion {
    /// Name of the observable.
    pub observable: String,
    /// What is odd about it.
    #[serde(flatten)]
    pub kind: SuspicionKind,
}

impl Suspicion {
    /// A sentence for people.
    pub fn sentence(&self) -> String {
        let name = &self.observable;
        match &self.kind {
            SuspicionKind::Empty => format!("{name} was never measured."),
            SuspicionKind::Constant { value } => {
                format!("{name} is always {}: nothing can be learned from it.", short(*value))
            }
            SuspicionKind::Duplicate { of } => {
                format!("{name} holds the same numbers as {of}.")
            }
            SuspicionKind::Coarse { resolution, levels } => format!(
                "{name} comes in steps of {} (about {levels:.0} over its range): rounding may be \
                 its largest error.",
                short(*resolution)
            ),
            SuspicionKind::LooksLikeTime => {
                format!("{name} rises in proportion to time: it looks like a clock or a counter.")
            }
        }
    }
}

/// Fewer distinct steps than this over the range of a column are coarse.
const COARSE_LEVELS: f64 = 1000.0;
/// Fewer samples than this tell nothing about steps or a likeness to time.
const ENOUGH: usize = 20;

/// All suspicious columns, in the order of the observables.
pub(super) fn suspicions(data: &Dataset) -> Vec<Suspicion> {
    let mut found = Vec::new();
    for (at, name) in data.observables.iter().enumerate() {
        let mut add = |kind| {
            found.push(Suspicion { observable: name.clone(), kind });
        };
        let measured = measured(data, at);
        let (Some(first), Some(last)) = (measured.first(), measured.last()) else {
            add(SuspicionKind::Empty);
            continue;
        };
        if first == last {
            if measured.len() > 1 {
                add(SuspicionKind::Constant { value: *first });
            }
            continue;
        }
        if let Some(of) = (0..at).find(|other| same(data, at, *other)) {
            let of = data.observables.get(of).cloned().unwrap_or_default();
            add(SuspicionKind::Duplicate { of });
        }
        if proportional_to_time(data, at) {
            add(SuspicionKind::LooksLikeTime);
        } else if let Some((resolution, levels)) = steps(&measured) {
            add(SuspicionKind::Coarse { resolution, levels });
        }
    }
    found
}

/// Every measured value of an observable, sorted.
fn measured(data: &Dataset, observable: usize) -> Vec<f64> {
    let mut values: Vec<f64> = data
        .runs
        .iter()
        .filter_map(|run| run.values.get(observable))
        .flatten()
        .copied()
        .filter(|value| !value.is_nan())
        .collect();
    values.sort_by(f64::total_cmp);
    values
}

fn same(data: &Dataset, one: usize, other: usize) -> bool {
    data.runs.iter().all(|run| match (run.values.get(one), run.values.get(other)) {
        (Some(a), Some(b)) => a.iter().zip(b).all(|(x, y)| x == y || (x.is_nan() && y.is_nan())),
        _ => false,
    })
}

/// The step that all differences are whole multiples of, and how many fit into the range.
fn steps(sorted: &[f64]) -> Option<(f64, f64)> {
    if sorted.len() < ENOUGH {
        return None;
    }
    let span = sorted.last()? - sorted.first()?;
    // Values that differ by rounding in a unit conversion only are the same value.
    let all = || sorted.array_windows().map(|[below, above]| above - below);
    let gaps = || all().filter(|gap| *gap > 1e-9 * span);
    let step = gaps().fold(f64::INFINITY, f64::min);
    let levels = span / step;
    let whole = gaps().all(|gap| {
        let multiple = gap / step;
        (multiple - multiple.round()).abs() < 1e-3
    });
    (whole && levels < COARSE_LEVELS).then_some((step, levels))
}

/// Whether some run is long enough to tell, and every such run is a straight line in time
/// with the same slope to one part in a million.
fn proportional_to_time(data: &Dataset, observable: usize) -> bool {
    let mut slopes: Vec<f64> = Vec::new();
    for run in &data.runs {
        let Some(values) = run.values.get(observable) else {
            continue;
        };
        let points: Vec<(f64, f64)> = run
            .times
            .iter()
            .copied()
            .zip(values.iter().copied())
            .filter(|(_, value)| !value.is_nan())
            .collect();
        let (Some(first), Some(last)) = (points.first(), points.last()) else {
            continue;
        };
        if points.len() < ENOUGH {
            continue;
        }
        let rise = last.1 - first.1;
        let slope = rise / (last.0 - first.0);
        let straight = points.iter().all(|(time, value)| {
            (value - first.1 - slope * (time - first.0)).abs() <= 1e-6 * rise.abs()
        });
        if rise <= 0.0 || !straight {
            return false;
        }
        slopes.push(slope);
    }
    match slopes.split_first() {
        Some((first, rest)) => rest.iter().all(|slope| (slope - first).abs() <= 1e-6 * first),
        None => false,
    }
}

/// The noise of an observable, very roughly: the median deviation of a sample from the
/// straight line between its two neighbours, as the standard deviation that normal noise
/// would need for it. The curvature of the motion is in it too, so that it is an upper
/// bound when samples are far apart. `None` with fewer than 20 such triples.
pub(super) fn rough_noise(data: &Dataset, observable: usize) -> Option<f64> {
    let mut deviations = Vec::new();
    for run in &data.runs {
        let Some(values) = run.values.get(observable) else {
            continue;
        };
        for (t, y) in run.times.windows(3).zip(values.windows(3)) {
            let (&[t0, t1, t2], &[y0, y1, y2]) = (t, y) else {
                continue;
            };
            let (before, after) = ((t2 - t1) / (t2 - t0), (t1 - t0) / (t2 - t0));
            let deviation = y1 - before * y0 - after * y2;
            // The variance of this combination of three independent errors.
            let scale = (1.0 + before * before + after * after).sqrt();
            if deviation.is_finite() {
                deviations.push(deviation.abs() / scale);
            }
        }
    }
    if deviations.len() < ENOUGH {
        return None;
    }
    let middle = deviations.len() / 2;
    let (_, median, _) = deviations.select_nth_unstable_by(middle, f64::total_cmp);
    // The median of |x| for a standard normal x.
    Some(*median / 0.674_489_750_196_081_7)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Clock, Run};
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    fn data(columns: &[fn(f64) -> f64]) -> Dataset {
        let times: Vec<f64> = (0..60).map(|i| 0.1 * f64::from(i)).collect();
        Dataset {
            inputs: Vec::new(),
            observables: (0..columns.len()).map(|i| format!("x{i}")).collect(),
            runs: vec![Run {
                name: "1".to_string(),
                values: columns.iter().map(|f| times.iter().map(|t| f(*t)).collect()).collect(),
                lines: vec![0; times.len()],
                times,
                clock: Clock::default(),
                inputs: Vec::new(),
                groups: Vec::new(),
                errors: Vec::new(),
            }],
        }
    }

    #[test]
    fn odd_columns_are_named_and_good_ones_are_not() {
        let found = suspicions(&data(&[
            |t| t.sin(),
            |_| 2.5,
            |t| t.sin(),
            |t| 3.0 * t + 1.0,
            |t| (20.0 * t.cos()).round() * 0.1,
            |_| f64::NAN,
            |t| (-t).exp(),
        ]));
        let names: Vec<&str> = found.iter().map(|s| s.observable.as_str()).collect();
        assert_eq!(names, ["x1", "x2", "x3", "x4", "x5"]);
        assert_eq!(found[0].kind, SuspicionKind::Constant { value: 2.5 });
        assert_eq!(found[1].kind, SuspicionKind::Duplicate { of: "x0".to_string() });
        assert_eq!(found[2].kind, SuspicionKind::LooksLikeTime);
        match found[3].kind {
            SuspicionKind::Coarse { resolution, levels } => {
                assert!((resolution - 0.1).abs() < 1e-9 && (levels - 40.0).abs() < 1e-6);
            }
            ref other => panic!("{other:?}"),
        }
        assert_eq!(found[4].kind, SuspicionKind::Empty);
    }

    #[test]
    fn the_rough_noise_is_roughly_the_noise() {
        let mut generator = rand_pcg::Pcg64::seed_from_u64(3);
        let noise = Normal::new(0.0, 0.02).expect("a positive width");
        let mut time = 0.0;
        let times: Vec<f64> = (0..4000)
            .map(|i| {
                // Unequal steps, so that the weights matter.
                time += if i % 3 == 0 { 0.002 } else { 0.005 };
                time
            })
            .collect();
        let values = times.iter().map(|t| t.sin() + noise.sample(&mut generator)).collect();
        let data = Dataset {
            inputs: Vec::new(),
            observables: vec!["x".to_string()],
            runs: vec![Run {
                name: "1".to_string(),
                lines: vec![0; times.len()],
                times,
                values: vec![values],
                clock: Clock::default(),
                inputs: Vec::new(),
                groups: Vec::new(),
                errors: Vec::new(),
            }],
        };
        let rough = rough_noise(&data, 0).expect("enough samples");
        assert!((rough / 0.02 - 1.0).abs() < 0.1, "{rough}");
    }
}
