//! A law held against measurements.

use serde_json::{Value, json};

use super::json::json_text;
use crate::diagnose::comparison;
use crate::diagnose::instrument::Detection;

/// How well a law predicts measurements, and where it fails.
///
/// ```
/// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
/// let (training, held_out) = spec.data()?.split(0.25, 0)?;
/// let law = spec.fit(&training)?;
/// let comparison = law.compare(&held_out)?;
/// // Over long predictions the drag shows that this law does not know of.
/// let longest = comparison.horizons().last().unwrap();
/// assert!(longest.error > 3.0);
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    horizons: Vec<Horizon>,
    findings: Vec<String>,
    document: Value,
}

/// Error of predictions of one length, each from its best initial state.
///
/// ```
/// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
/// let data = spec.data()?;
/// let comparison = spec.fit(&data)?.compare(&data)?;
/// for horizon in comparison.horizons() {
///     println!("over {} the error is {} times the noise", horizon.duration, horizon.error);
/// }
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Horizon {
    /// Samples of a prediction, the first included.
    pub samples: usize,
    /// In the spec's unit of time.
    pub duration: f64,
    /// Root mean square over all observables in units of the noise: 1 is the noise floor. The
    /// freedom that the initial state takes up is corrected for.
    pub error: f64,
    /// The same on held-out measurements; `None` where only one kind was compared.
    pub held_out: Option<f64>,
    /// The same for persistence: the state stays as it is.
    pub baseline: f64,
    /// Predictions that left the finite numbers.
    pub diverged: usize,
}

impl Comparison {
    /// A comparison, with the faults of the instrument that were found beside it.
    pub(super) fn of(found: comparison::Comparison, detections: &[Detection]) -> Comparison {
        let mut document = json!(found);
        if let Some(fields) = document.as_object_mut() {
            fields.insert("detections".to_string(), json!(detections));
        }
        let horizon = |horizon: &comparison::Horizon| Horizon {
            samples: horizon.samples,
            duration: horizon.duration,
            error: horizon.training,
            held_out: horizon.held_out,
            baseline: horizon.baseline,
            diverged: horizon.diverged,
        };
        Comparison {
            horizons: found.horizons.iter().map(horizon).collect(),
            findings: found.findings,
            document,
        }
    }

    /// All of it as JSON, with the fields of `compare` in `docs/formats.md`; those of the split
    /// are not among them.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let json = spec.fit(&training)?.compare(&held_out)?.to_json();
    /// assert!(json.contains("\"noise_floor\""));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn to_json(&self) -> String {
        json_text(&self.document)
    }

    /// Error against length of prediction, shortest first: 2, 4, 8, ... samples, and the longest
    /// run.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let data = spec.data()?;
    /// let comparison = spec.fit(&data)?.compare(&data)?;
    /// assert_eq!(comparison.horizons()[0].samples, 2);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn horizons(&self) -> &[Horizon] {
        &self.horizons
    }

    /// The worst, in plain sentences.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let data = spec.data()?;
    /// let comparison = spec.fit(&data)?.compare(&data)?;
    /// assert!(!comparison.findings().is_empty());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn findings(&self) -> &[String] {
        &self.findings
    }
}
