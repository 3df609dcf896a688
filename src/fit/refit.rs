//! The numbers of a law fitted again, its terms as they are: nothing is searched.

use std::sync::Arc;

use super::gauss_newton::LeastGain;
use super::law::Law;
use super::monitor::Monitor;
use super::options::Options;
use super::pass::Linearised;
use super::segments::Segments;
use super::states::States;
use super::train::Training;
use super::tuning::Tuning;
use crate::data::Packed;
use crate::error::{Error, Result};

/// How the numbers of a law are fitted again.
#[derive(Clone, Copy)]
pub struct Refitting<'a> {
    /// Segments, with states that they start from; `None` for those of the law's window, as they
    /// were measured.
    pub start: Option<(&'a Segments, &'a States)>,
    /// By what trajectories are integrated.
    pub integrator: Integrator,
    /// The fit ends when a step promises less.
    pub least: LeastGain,
    /// The numbers that it goes by.
    pub tuning: &'a Tuning,
    /// Asked whether to stop with the best so far.
    pub monitor: &'a dyn Monitor,
}

/// By what trajectories are integrated in a refit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Integrator {
    /// By that of the law.
    Kept,
    /// By one that is accurate enough for the law's noise.
    Chosen,
}

/// A law whose numbers were fitted together.
pub struct Refitted {
    /// Its noise is what this fit leaves; its covariance is not known.
    pub law: Law,
    /// The problem linearised at its numbers: the columns of its coefficients, then those of the
    /// inner parameters in use.
    pub linearised: Linearised,
    /// What the integrator and the digits of the data resolve of each observable.
    pub resolution: Vec<f64>,
}

/// Fits all numbers of a law to measurements, by Gauss-Newton from where they are.
///
/// # Errors
///
/// When no coordinate is measured, or no two samples are near enough in time; when it is to stop at
/// once.
pub fn refitted(law: &Law, measured: &Arc<Packed>, how: Refitting) -> Result<Refitted> {
    if how.monitor.halted() {
        return Err(Error::Interrupted);
    }
    let tuning = how.tuning.clone();
    let options = Options { window: Some(law.window()), tuning, ..Options::default() };
    let mut training = Training::from_law(law, measured.clone(), &options)?;
    if let Some((segments, states)) = how.start {
        training.segments.clone_from(segments);
        training.states.clone_from(states);
    }
    if how.integrator == Integrator::Chosen {
        training.choose_integrator();
    }
    let mut refit = training.refit_until(how.least, how.monitor);
    training.take(&mut refit);
    let (law, resolution) = (training.law().clone(), training.accuracy.resolution.clone());
    Ok(Refitted { law, linearised: refit.linearised, resolution })
}
