//! Models that compete for the same measurements, and what they would predict for a new run.

use std::sync::Arc;

use rayon::prelude::*;

use crate::data::Dataset;
use crate::diagnose::law_on_data::{LawOnData, Measurements};
use crate::diagnose::options::Options;
use crate::diagnose::settling::problem;
use crate::dynamics::{Batch, Dynamics, Method, MethodKind, Scratch, advance, observe};
use crate::error::{Error, ErrorKind, Result};
use crate::expr::{Compiled, Scope};
use crate::fit::factor::Factor;
use crate::fit::gauss_newton::{self, Refit};
use crate::fit::pass::{Linearised, Stepping, Sums, settle_and_linearise};
use crate::fit::refit::{Integrator, Refitting, refitted};
use crate::fit::segments::{Reach, Segments, cut, typical_step};
use crate::fit::states::States;
use crate::fit::{Law, Silent};

/// A fitted model that claims to explain the measurements.
#[derive(Debug, Clone)]
pub struct Rival {
    /// `viscous_drag(theta)`, or what the model is called.
    pub label: String,
    /// The statement that makes the spec its own; empty for the spec as it is.
    pub statement: String,
    /// The model.
    pub law: Law,
}

impl Rival {
    /// A law as it is.
    pub fn as_it_is(law: &Law, label: &str) -> Rival {
        Rival { label: label.to_string(), statement: String::new(), law: law.clone() }
    }

    /// A law on data with an effect in it, fitted to these data.
    ///
    /// `spec` is that of the law's system; `statement` adds the effect `label` to it.
    /// `start` holds first guesses of the coefficients of the effect's terms (zero where short).
    ///
    /// # Errors
    ///
    /// When the statement does not fit the spec, or the model cannot be fitted.
    pub fn with_effect(
        model: &LawOnData,
        spec: &Compiled,
        label: &str,
        statement: &str,
        start: &[f64],
    ) -> Result<Rival> {
        let system = Scope::of(spec).extension(statement)?.onto(model.system());
        let system = Arc::new(system);
        let mut law = model.law.on(&system);
        let new = system.terms_where(|term| term.effect.as_deref() == Some(label));
        let guesses = start.iter().copied().chain(std::iter::repeat(0.0));
        for (id, guess) in new.into_iter().zip(guesses) {
            law = law.with_term(id, guess)?;
        }
        let (tuning, integrator) = (&model.options.fit, Integrator::Chosen(1.0));
        let least = tuning.refit.converged.into();
        let how = Refitting { start: None, integrator, least, tuning, monitor: model.monitor };
        let law = refitted(&law, &model.data.packed, how)?.law;
        let mut stepping = law.stepping();
        let usual = model.law.stepping().longest.min(typical_step(&model.data.dataset));
        stepping.longest = stepping.longest.max(usual / model.tuning().design.finer_steps);
        Ok(Rival {
            label: label.to_string(),
            statement: statement.to_string(),
            law: law.with_stepping(stepping),
        })
    }
}

/// A trajectory at the samples of a run.
pub(super) struct Path {
    /// `[sample][2n]`: coordinates, then momenta.
    pub states: Vec<Vec<f64>>,
    /// `[observable][sample]`.
    pub observed: Vec<Vec<f64>>,
}

/// What a rival knows from the measurements so far.
pub(super) struct Known<'a> {
    pub rival: &'a Rival,
    /// The rival at its best on the measurements so far, in the noise that all are judged by.
    pub model: LawOnData<'a>,
    pub dynamics: Dynamics,
    /// Coefficients, then the inner parameters in use, at their best.
    pub theta: Vec<f64>,
    /// Segments of the measurements so far, and their initial states.
    pub segments: Segments,
    pub states: States,
    /// The problem of the measurements so far, linearised at `theta`; unknowns are increments.
    pub factor: Factor,
    /// What the measurements so far leave unexplained, and from how many of them.
    pub sums: Sums,
}

impl<'a> Known<'a> {
    /// Fits a rival to the measurements so far, in segments of `window` samples, with the noise
    /// that all rivals are judged by.
    pub(super) fn new(
        rival: &'a Rival,
        data: &Measurements<'a>,
        window: usize,
        noise: &[f64],
        options: &'a Options,
    ) -> Result<Self> {
        let stepping = explicit(rival.law.stepping());
        let law = rival.law.clone().with_noise(noise.to_vec()).with_window(window);
        let model = LawOnData::on(law.with_stepping(stepping), data, options);
        let dynamics = model.law.dynamics();
        let segments = cut(&data.packed, Reach::of(window), &options.fit.segments);
        let states = States::measured(&data.packed, &segments.list, dynamics.degrees());
        let theta = model.law.theta(&dynamics);
        let best = fitted(&model, (&dynamics, &theta), &segments, states);
        if !best.sums().loss.is_finite() || best.sums().rows <= best.theta.len() {
            return Err(Error::new(
                ErrorKind::InsufficientData,
                format!("{} cannot be fitted to the measurements so far", rival.label),
                "measure longer runs, or leave it out",
            ));
        }
        let factor = best.linearised.merged();
        let sums = best.sums().clone();
        let (theta, states) = (best.theta, best.states);
        Ok(Known { rival, model, dynamics, theta, segments, states, factor, sums })
    }

    /// Trajectories from (start, times) of each run; where one leaves the finite numbers, so do
    /// its states.
    pub(super) fn predict(&self, runs: &[(&[f64], &[f64])]) -> Vec<Path> {
        runs.par_chunks(self.model.tuning().design.lanes)
            .flat_map_iter(|chunk| self.predict_block(chunk))
            .collect()
    }

    fn predict_block(&self, runs: &[(&[f64], &[f64])]) -> Vec<Path> {
        let lanes = runs.len();
        let rows = self.dynamics.observables();
        let mut batch = Batch::new(self.dynamics.degrees(), lanes);
        for (lane, (start, times)) in runs.iter().enumerate() {
            batch.set(lane, times.first().copied().unwrap_or(0.0), start);
        }
        let mut scratch = Scratch::new();
        let mut seen = vec![0.0; rows * lanes];
        let mut span = vec![0.0; lanes];
        let mut paths: Vec<Path> = (0..lanes)
            .map(|_| Path { states: Vec::new(), observed: vec![Vec::new(); rows] })
            .collect();
        let stepping = self.model.law.stepping();
        let samples = runs.iter().map(|(_, times)| times.len()).max().unwrap_or(0);
        for sample in 0..samples {
            if sample > 0 {
                for (span, (_, times)) in span.iter_mut().zip(runs) {
                    *span = times.get(sample).map_or(0.0, |time| time - times[sample - 1]);
                }
                let steps = stepping.steps(&span);
                let method = stepping.method;
                let dynamics = &self.dynamics;
                advance(dynamics, method, &mut batch, &span, steps, &self.theta, &mut scratch);
            }
            let observed = self.rival.law.system().observed;
            let theta = &self.theta;
            observe(&self.dynamics, observed, &batch, theta, &mut seen, None, &mut scratch);
            for (lane, path) in paths.iter_mut().enumerate() {
                if sample < runs[lane].1.len() {
                    path.states.push(batch.get(lane));
                    for (row, values) in path.observed.iter_mut().enumerate() {
                        values.push(seen[row * lanes + lane]);
                    }
                }
            }
        }
        paths
    }

    /// The rival on other measurements, from guesses of the segments' initial states: one
    /// factor for each fold of the segments.
    pub(super) fn before(
        &self,
        dataset: &Dataset,
        segments: &Segments,
        mut states: States,
    ) -> Linearised {
        let model = self.on(dataset);
        let weights = model.law.weights();
        let law = (&self.dynamics, &self.theta[..]);
        settle_and_linearise(&problem(&model, segments, &weights), law, law, &mut states)
    }

    /// The loss after a full refit to other measurements.
    pub(super) fn refitted(&self, dataset: &Dataset, segments: &Segments, states: States) -> f64 {
        let start = (&self.dynamics, &self.theta[..]);
        fitted(&self.on(dataset), start, segments, states).sums().loss
    }

    fn on<'b>(&'b self, dataset: &'b Dataset) -> LawOnData<'b> {
        LawOnData::of(self.model.law.clone(), dataset, self.model.options)
    }

    /// Deviance so far, with a price of log(residuals) for every unknown.
    pub(super) fn standing(&self) -> f64 {
        self.sums.loss + self.theta.len() as f64 * (self.sums.rows.max(1) as f64).ln()
    }
}

/// The stages of an implicit method are found slowly where a force jumps, as dry friction does
/// where the motion turns, and a search follows thousands of runs. Half the step makes up for
/// the larger error of the explicit method.
fn explicit(stepping: Stepping) -> Stepping {
    match (&stepping.method.row().kind, Method::by_name("rk4")) {
        (MethodKind::Implicit(_), Some(method)) => {
            Stepping { method, longest: 0.5 * stepping.longest }
        }
        _ => stepping,
    }
}

/// Fits all numbers of a law to some segments, its steps and its noise as they are: the noise is
/// that of all rivals, and the steps are those that a search over thousands of runs affords.
fn fitted(
    model: &LawOnData,
    (dynamics, theta): (&Dynamics, &[f64]),
    segments: &Segments,
    states: States,
) -> Refit {
    let weights = model.law.weights();
    let (problem, bounds) = (problem(model, segments, &weights), model.law.bounds(dynamics));
    let least = model.options.fit.refit.converged.into();
    gauss_newton::refit(&problem, dynamics, &bounds, theta, states, least, &Silent)
}
