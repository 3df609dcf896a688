//! A model before its data: what every question about the misfit starts from.

use std::sync::Arc;

use super::tuning::TUNING;
use crate::data::{Dataset, Packed};
use crate::dynamics::Dynamics;
use crate::error::{Error, ErrorKind, Result};
use crate::expr::System;
use crate::fit::pass::{Problem, Sums, residuals, settle};
use crate::fit::segments::{Segments, cut, packed};
use crate::fit::states::States;
use crate::fit::train::Training;
use crate::fit::tuning::TUNING as FIT;
use crate::fit::{Law, Loss, Model, Options, Silent};

/// The model belongs to another spec than it was brought with.
pub fn foreign() -> Error {
    Error::new(
        ErrorKind::Model,
        "the model belongs to another spec",
        "fit the spec again, then ask what is missing",
    )
}

/// A learned model and measurements that it is held against.
#[derive(Clone)]
pub struct Context<'a> {
    /// The model: its noise is what residuals are weighed by, its steps integrate predictions, and
    /// its window is the length of a segment.
    pub law: Law,
    /// The measurements.
    pub dataset: &'a Dataset,
    /// The same, run after run.
    pub measured: Arc<Packed>,
    /// Samples that questions are asked of, at most; they are spread over all segments.
    pub most: usize,
}

impl<'a> Context<'a> {
    /// # Errors
    ///
    /// When the model belongs to another spec.
    pub fn new(system: &Arc<System>, model: &Model, dataset: &'a Dataset) -> Result<Self> {
        Ok(Context::of(model.law(system).ok_or_else(foreign)?, dataset))
    }

    /// A law before measurements.
    pub fn of(law: Law, dataset: &'a Dataset) -> Self {
        Context { law, dataset, measured: Arc::new(packed(dataset)), most: usize::MAX }
    }

    /// What the model is of.
    pub fn system(&self) -> &Arc<System> {
        self.law.system()
    }

    /// Another law before the same measurements.
    pub fn with_law(&self, law: Law) -> Context<'a> {
        Context { law, ..self.clone() }
    }

    /// The same over segments of another length, in samples.
    pub fn with_window(&self, window: usize) -> Context<'a> {
        self.with_law(self.law.clone().with_window(window))
    }

    /// The same with residuals weighed by another noise of each observable.
    pub fn with_noise(&self, noise: Vec<f64>) -> Context<'a> {
        self.with_law(self.law.clone().with_noise(noise))
    }

    /// The same model before other measurements.
    pub fn with_data(&self, dataset: &'a Dataset) -> Context<'a> {
        Context { dataset, measured: Arc::new(packed(dataset)), ..self.clone() }
    }

    /// The same model before a part of its measurements.
    pub fn thinned(&self, most: usize) -> Context<'a> {
        Context { most, ..self.clone() }
    }

    pub(super) fn weights(&self) -> Vec<f64> {
        self.law.noise().iter().map(|s| 1.0 / s.max(f64::MIN_POSITIVE)).collect()
    }

    pub(super) fn problem<'b>(&'b self, segments: &'b Segments, weights: &'b [f64]) -> Problem<'b> {
        Problem {
            measured: &self.measured,
            segments,
            observed: self.system().observed,
            weights,
            loss: Loss::SQUARES,
            stepping: self.law.stepping(),
            floor: 1e-3,
            stream: None,
            window: self.law.window(),
            tuning: &FIT,
        }
    }

    /// Best states of all segments of at most `window` samples, and what is left then.
    pub fn settle(&self, window: usize) -> (Segments, States, Sums) {
        let segments = cut(&self.measured, window).spread(self.most);
        let mut states = States::measured_by(&self.law, &self.measured, &segments.list);
        // Over many periods the misfit has many minima, and what was measured first need not
        // lie near the lowest: the first samples of each segment bring its state there.
        let dynamics = self.law.dynamics();
        let theta = self.law.theta(&dynamics);
        let weights = self.weights();
        let mut look = TUNING.states.first_samples;
        while look < window {
            let short = segments.shortened(look);
            settle(&self.problem(&short, &weights), &dynamics, &theta, &mut states);
            look *= TUNING.states.growth;
        }
        let problem = self.problem(&segments, &weights);
        let sums = patiently(&problem, &dynamics, &theta, &mut states);
        (segments, states, sums)
    }

    /// Improves the states of some segments until they are settled, and sums up what is left.
    pub(super) fn settle_from(&self, segments: &Segments, states: &mut States) -> Sums {
        let dynamics = self.law.dynamics();
        let theta = self.law.theta(&dynamics);
        let weights = self.weights();
        patiently(&self.problem(segments, &weights), &dynamics, &theta, states)
    }

    /// Residuals in units of the noise over segments of at most `window` samples, each from its
    /// best state: `[segment][observable][sample]`, not a number where there is none.
    pub fn residuals(&self, window: usize) -> Vec<Vec<Vec<f64>>> {
        let (segments, states, _) = self.settle(window);
        let dynamics = self.law.dynamics();
        let theta = self.law.theta(&dynamics);
        let weights = self.weights();
        residuals(&self.problem(&segments, &weights), &dynamics, &theta, &states)
    }

    /// The same terms with their numbers fitted again, over short segments first: numbers that
    /// were taken from another model may be far off. `None` where they cannot be fitted.
    pub fn refitted(&self) -> Option<Context<'a>> {
        let mut law = self.law.clone();
        for window in [TUNING.states.first_samples.min(law.window()), law.window()] {
            let options = Options { window: Some(window), ..Options::default() };
            let mut training = Training::from_law(&law, self.measured.clone(), &options).ok()?;
            let mut refit = training.refit(&Silent);
            training.take(&mut refit);
            // The noise is that of the model, whatever these fits leave.
            law = training.law().clone().with_noise(self.law.noise().to_vec());
        }
        Some(self.with_law(law.with_window(self.law.window())))
    }

    /// The model before all of its measurements, and before a part of them where there are many.
    pub fn parts(&self) -> Parts<'a> {
        let most = TUNING.scan.samples;
        let many = self.dataset.samples().min(self.most) > most;
        Parts { all: self.settled(), part: many.then(|| self.thinned(most).settled()) }
    }

    /// The model with the best states of all its segments.
    pub fn settled(&self) -> Settled<'a> {
        let (segments, states, sums) = self.settle(self.law.window());
        Settled { context: self.clone(), segments, states, sums }
    }
}

/// A model before all of some data, and before a part of them where there are many.
pub struct Parts<'a> {
    /// All of them.
    pub all: Settled<'a>,
    /// A part, spread over all segments.
    pub part: Option<Settled<'a>>,
}

/// A model before its data, with the best state of every segment.
pub struct Settled<'a> {
    /// The model and the data.
    pub context: Context<'a>,
    /// Segments of the context's window.
    pub segments: Segments,
    /// Their best states.
    pub states: States,
    /// What is left then.
    pub sums: Sums,
}

/// Long segments of a rough model take their time: what has not settled would look like something
/// missing.
fn patiently(problem: &Problem, dynamics: &Dynamics, theta: &[f64], states: &mut States) -> Sums {
    let mut sums = settle(problem, dynamics, theta, states);
    for _ in 0..TUNING.states.retries {
        if sums.unsettled == 0 {
            break;
        }
        let further = settle(problem, dynamics, theta, states);
        let settled = further.loss >= sums.loss * (1.0 - TUNING.states.settled);
        sums = further;
        if settled {
            break;
        }
    }
    sums
}
