//! A parameter that groups of runs have for themselves: the values, and how they are distributed.

use serde::{Deserialize, Serialize};

use super::model::finite_or_null_one;

/// An inner parameter of which every run, or every group of runs, has a value of its own.
///
/// The values are taken as drawn from one distribution, each read with an error of its own
/// (random effects: Paule and Mandel, J. Res. Natl. Bur. Stand. 87, 1982). In a law's
/// `parameters` it stands with the mean, which is what holds of a run not yet seen.
///
/// ```
/// use leverrier::{Data, Spec};
///
/// let spec = Spec::parse("coordinates q; momenta p; data \"swings.csv\" { run run }
/// param g per run = 1 in 0..
/// T = p^2/2; V = -g*cos(q)
/// force q += span{ -p }")?;
/// let law = spec.fit(&Data::open("examples/damped-pendulum/swings.csv", &spec)?)?;
/// let found = &law.distributions()[0];
/// // One pendulum, let go eight times.
/// assert_eq!((found.per.as_str(), found.values.len()), ("run", 8));
/// assert!((found.mean - 1.0).abs() < 5.0 * found.mean_error);
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Distribution {
    /// Name of the parameter in the spec.
    pub name: String,
    /// What has a value of its own: `run`, or the column that tells groups of runs apart.
    pub per: String,
    /// Its unit, as the spec writes it.
    pub unit: Option<String>,
    /// Mean of the distribution, in that unit.
    pub mean: f64,
    /// Standard error of the mean.
    #[serde(with = "finite_or_null_one")]
    pub mean_error: f64,
    /// Standard deviation of the distribution: what the values differ by beyond their errors, 0
    /// where the errors explain it all.
    pub spread: f64,
    /// The group that stands out most, where there are five that are determined.
    pub most_unusual: Option<Unusual>,
    /// The value of each group, in the order of the data.
    pub values: Vec<OwnValue>,
}

/// The value of one group of runs.
///
/// ```
/// use leverrier::{Data, Spec};
///
/// let spec = Spec::parse("coordinates q; momenta p; data \"swings.csv\" { run run }
/// param g per run = 1 in 0..
/// T = p^2/2; V = -g*cos(q)
/// force q += span{ -p }")?;
/// let law = spec.fit(&Data::open("examples/damped-pendulum/swings.csv", &spec)?)?;
/// for value in &law.distributions()[0].values {
///     println!("run {}: {} +- {}", value.group, value.value, value.standard_error);
///     assert!(value.is_determined());
/// }
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OwnValue {
    /// The cell that names the group; the run's name where every run is one.
    pub group: String,
    /// Runs that belong to it.
    pub runs: usize,
    /// Its value.
    pub value: f64,
    /// Standard error; `null` in the file where the runs do not determine the value.
    #[serde(with = "finite_or_null_one")]
    pub standard_error: f64,
}

/// The group whose value stands out most.
///
/// ```
/// use leverrier::{Data, Spec};
///
/// let spec = Spec::parse("coordinates q; momenta p; data \"swings.csv\" { run run }
/// param g per run = 1 in 0..
/// T = p^2/2; V = -g*cos(q)
/// force q += span{ -p }")?;
/// let law = spec.fit(&Data::open("examples/damped-pendulum/swings.csv", &spec)?)?;
/// if let Some(one) = &law.distributions()[0].most_unusual {
///     println!("run {} is {} standard deviations off", one.group, one.deviations);
/// }
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unusual {
    /// Its name.
    pub group: String,
    /// How far its value lies from the mean of the others, in standard deviations of such a
    /// difference: their spread and its own error together.
    pub deviations: f64,
}

/// Halvings of an interval that lead to the spread: as many as a double has digits.
const BISECTIONS: usize = 60;
/// Fewest values of which one can stand out: the spread of three others is hardly known.
const FEWEST: usize = 5;

impl Distribution {
    /// The values with their mean and spread.
    pub(crate) fn of(
        name: &str,
        per: &str,
        unit: Option<String>,
        values: Vec<OwnValue>,
    ) -> Distribution {
        let known: Vec<(f64, f64)> =
            values.iter().filter(|v| v.is_determined()).map(|v| (v.value, v.variance())).collect();
        let Moments { mean, error, spread } = Moments::of(&known);
        Distribution {
            name: name.to_string(),
            per: per.to_string(),
            unit,
            mean,
            mean_error: error,
            spread,
            most_unusual: most_unusual(&values),
            values,
        }
    }

    /// Groups whose runs do not determine their value.
    pub(crate) fn undetermined(&self) -> Vec<&OwnValue> {
        self.values.iter().filter(|value| !value.is_determined()).collect()
    }
}

impl OwnValue {
    /// Whether its runs determine the value.
    ///
    /// ```
    /// use leverrier::{Data, Spec};
    ///
    /// let spec = Spec::parse("coordinates q; momenta p; data \"swings.csv\" { run run }
    /// param g per run = 1 in 0..
    /// T = p^2/2; V = -g*cos(q)
    /// force q += span{ -p }")?;
    /// let law = spec.fit(&Data::open("examples/damped-pendulum/swings.csv", &spec)?)?;
    /// assert!(law.distributions()[0].values.iter().all(|value| value.is_determined()));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn is_determined(&self) -> bool {
        self.standard_error.is_finite()
    }

    /// The variance of its error; one of rounding at least, so that it can be divided by.
    fn variance(&self) -> f64 {
        let rounding = 1e-15 * self.value.abs();
        (self.standard_error.powi(2) + rounding.powi(2)).max(f64::MIN_POSITIVE)
    }
}

/// The value that lies furthest from the others.
fn most_unusual(values: &[OwnValue]) -> Option<Unusual> {
    let known: Vec<&OwnValue> = values.iter().filter(|value| value.is_determined()).collect();
    if known.len() < FEWEST {
        return None;
    }
    // Which one it is shows beside all of them; how far it lies, beside the others alone.
    let pairs = |without: Option<usize>| -> Vec<(f64, f64)> {
        let others = known.iter().enumerate().filter(|(at, _)| Some(*at) != without);
        others.map(|(_, value)| (value.value, value.variance())).collect()
    };
    let far = |all: &Moments, value: &OwnValue| {
        (value.value - all.mean) / (value.variance() + all.spread.powi(2)).sqrt()
    };
    let all = Moments::of(&pairs(None));
    let (at, value) = known
        .iter()
        .enumerate()
        .max_by(|a, b| far(&all, a.1).abs().total_cmp(&far(&all, b.1).abs()))?;
    let others = Moments::of(&pairs(Some(at)));
    let variance = value.variance() + others.spread.powi(2) + others.error.powi(2);
    let deviations = (value.value - others.mean) / variance.sqrt();
    Some(Unusual { group: value.group.clone(), deviations })
}

/// Moments of the distribution that values with errors are drawn from.
struct Moments {
    mean: f64,
    error: f64,
    spread: f64,
}

impl Moments {
    /// Of values with the variances of their errors.
    fn of(values: &[(f64, f64)]) -> Moments {
        if values.is_empty() {
            return Moments { mean: f64::NAN, error: f64::INFINITY, spread: 0.0 };
        }
        let mean = |extra: f64| {
            let weight = |variance: &f64| 1.0 / (variance + extra);
            let total: f64 = values.iter().map(|(_, variance)| weight(variance)).sum();
            let sum: f64 = values.iter().map(|(x, variance)| x * (weight(variance) / total)).sum();
            (sum, total)
        };
        // The variance beyond the errors with which the squares are as many as they should be.
        let excess = |extra: f64| {
            let center = mean(extra).0;
            let squares: f64 = values.iter().map(|(x, v)| (x - center).powi(2) / (v + extra)).sum();
            squares - (values.len() - 1) as f64
        };
        let (least, most) = values
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v.0), b.max(v.0)));
        let (mut low, mut high) = (0.0, (most - least).powi(2));
        for _ in 0..if excess(0.0) > 0.0 { BISECTIONS } else { 0 } {
            let middle = 0.5 * (low + high);
            *(if excess(middle) > 0.0 { &mut low } else { &mut high }) = middle;
        }
        let extra = low;
        let (mean, total) = mean(extra);
        Moments { mean, error: (1.0 / total).sqrt(), spread: extra.sqrt() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(of: &[(f64, f64)]) -> Distribution {
        let value = |(at, &(value, standard_error)): (usize, &(f64, f64))| OwnValue {
            group: (at + 1).to_string(),
            runs: 1,
            value,
            standard_error,
        };
        Distribution::of("k", "run", None, of.iter().enumerate().map(value).collect())
    }

    #[test]
    fn equal_errors_leave_the_plain_mean_and_what_they_do_not_explain() {
        let found = values(&[(1.0, 0.1), (2.0, 0.1), (3.0, 0.1), (6.0, 0.1)]);
        assert!((found.mean - 3.0).abs() < 1e-12);
        // The variance of the values is 14/3, of which the errors explain 0.01.
        assert!((found.spread.powi(2) - (14.0 / 3.0 - 0.01)).abs() < 1e-12);
        assert!((found.mean_error.powi(2) - 14.0 / 12.0).abs() < 1e-12);
        assert_eq!(found.most_unusual, None);
        let found = values(&[(1.0, 0.1), (2.0, 0.1), (3.0, 0.1), (2.5, 0.1), (9.0, 0.1)]);
        assert_eq!(found.most_unusual.map(|one| one.group).as_deref(), Some("5"));
    }

    #[test]
    fn what_errors_explain_is_no_spread_and_a_poor_value_hardly_counts() {
        let found = values(&[
            (1.0, 0.1),
            (1.05, 0.1),
            (0.95, 0.1),
            (0.9, 0.1),
            (5e3, 1e4),
            (9.0, f64::INFINITY),
        ]);
        assert_eq!(found.spread, 0.0);
        assert!((found.mean - 0.975).abs() < 1e-3);
        assert_eq!(found.undetermined().len(), 1);
        assert!(found.most_unusual.is_some_and(|one| one.deviations.abs() < 1.0));
    }
}
