//! A model before its data: what every question about the misfit starts from.

use std::sync::Arc;

use super::score::Scores;
use crate::data::{Dataset, Packed};
use crate::dynamics::Dynamics;
use crate::error::{Error, ErrorKind, Result};
use crate::eval::Backend;
use crate::expr::{System, Term};
use crate::fit::factor::Factor;
use crate::fit::pass::{Problem, Sums, linearise, residuals, settle};
use crate::fit::segments::{Segments, cut, packed};
use crate::fit::states::States;
use crate::fit::train::Training;
use crate::fit::{Law, Loss, Model, Options, Silent};

/// Scores of probes, and what they cost.
pub struct Probed {
    /// One column for each probe.
    pub scores: Scores,
    /// Segments that were lost: predictions, or effects of a probe, that are not finite.
    pub exploded: usize,
}

/// Times that the search for the best states is taken up again.
const PATIENCE: usize = 6;
/// Samples that a state is settled on first, and by how much more it then sees at a time.
const FIRST_LOOK: usize = 8;
const FURTHER: usize = 4;
/// States are settled when the loss falls by less than this part.
const SETTLED: f64 = 1e-4;

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

    fn weights(&self) -> Vec<f64> {
        self.law.noise().iter().map(|s| 1.0 / s.max(f64::MIN_POSITIVE)).collect()
    }

    fn problem<'b>(&'b self, segments: &'b Segments, weights: &'b [f64]) -> Problem<'b> {
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
        }
    }

    /// Best states of all segments of at most `window` samples, and what is left then.
    pub fn settle(&self, window: usize) -> (Segments, States, Sums) {
        let segments = cut(&self.measured, window).spread(self.most);
        let degrees = self.system().degrees();
        let mut states = States::measured(&self.measured, &segments.list, degrees);
        // Over many periods the misfit has many minima, and what was measured first need not
        // lie near the lowest: the first samples of each segment bring its state there.
        let dynamics = self.law.dynamics();
        let theta = self.law.theta(&dynamics);
        let weights = self.weights();
        let mut look = FIRST_LOOK;
        while look < window {
            let short = segments.shortened(look);
            settle(&self.problem(&short, &weights), &dynamics, &theta, &mut states);
            look *= FURTHER;
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
        for window in [FIRST_LOOK.min(law.window()), law.window()] {
            let options = Options { window: Some(window), ..Options::default() };
            let mut training = Training::from_law(&law, self.measured.clone(), &options).ok()?;
            let mut refit = training.refit(&Silent);
            training.take(&mut refit);
            // The noise is that of the model, whatever these fits leave.
            law = training.law().clone().with_noise(self.law.noise().to_vec());
        }
        Some(self.with_law(law.with_window(self.law.window())))
    }

    /// The model with the best states of all its segments.
    pub fn settled(&self) -> Settled<'a> {
        let (segments, states, sums) = self.settle(self.law.window());
        Settled { context: self.clone(), segments, states, sums }
    }
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

impl Settled<'_> {
    /// Scores of terms that are not in the model, one column each, orthogonal to the model's
    /// own unknowns and to all initial states.
    ///
    /// `extended` is the system with whatever its graph must hold for the expressions of
    /// `probes`; its own terms are those of the system, or begin with them.
    pub fn probe(&self, extended: System, probes: &[Term]) -> Result<Probed> {
        let Settled { context, segments, states, .. } = self;
        let mut system = extended;
        let first = system.terms.len();
        system.terms.extend_from_slice(probes);
        let extra = system.term_ids().split_off(first);
        let (law, backend) = (&context.law, Backend::default());
        let dynamics = Dynamics::with_probes(&system, law.support(), &extra, backend)?;
        let count = law.support().len();
        let theta = law.theta(&dynamics);
        let weights = context.weights();
        let problem = context.problem(segments, &weights);
        let linearised = linearise(&problem, &dynamics, &theta, states);
        if linearised.sums.rows <= count + dynamics.parameters().len() {
            let Sums { rows, exploded, .. } = linearised.sums;
            return Err(Error::new(
                ErrorKind::InsufficientData,
                format!(
                    "{rows} independent residuals do not suffice to ask what is missing \
                     ({exploded} of {} predictions diverged)",
                    segments.list.len()
                ),
                "measure longer runs, or more of them",
            ));
        }
        // The model's unknowns first: coefficients, inner parameters, then the probes.
        let terms = dynamics.active().len();
        let order: Vec<usize> = (0..count)
            .chain(terms..terms + dynamics.parameters().len())
            .chain(count..terms)
            .collect();
        let base = count + dynamics.parameters().len();
        let factor = linearised.merged().select(&order);
        let variance = noise_variance(&factor, base);
        let exploded = linearised.sums.exploded;
        Ok(Probed { scores: Scores::new(&factor, base, variance), exploded })
    }
}

/// Long segments of a rough model take their time: what has not settled would look like something
/// missing.
fn patiently(problem: &Problem, dynamics: &Dynamics, theta: &[f64], states: &mut States) -> Sums {
    let mut sums = settle(problem, dynamics, theta, states);
    for _ in 0..PATIENCE {
        if sums.unsettled == 0 {
            break;
        }
        let further = settle(problem, dynamics, theta, states);
        let settled = further.loss >= sums.loss * (1.0 - SETTLED);
        sums = further;
        if settled {
            break;
        }
    }
    sums
}

/// Variance of the weighted residuals with everything that was probed taken out, or of the
/// model's own where there are too many probes for that.
fn noise_variance(factor: &Factor, base: usize) -> f64 {
    let (rows, columns) = (factor.rows(), factor.columns());
    let variance = if rows > 3 * columns {
        factor.least() / (rows - columns) as f64
    } else {
        let size = columns - base;
        let left = factor.target().rows(base, size).norm_squared() + factor.least();
        left / rows.saturating_sub(base).max(1) as f64
    };
    variance.max(1e-12)
}
