//! Models that compete for the same measurements, and what they would predict for a new run.

use std::sync::Arc;

use rayon::prelude::*;

use crate::data::{Dataset, Packed};
use crate::diagnose::context::Context;
use crate::diagnose::tuning::TUNING;
use crate::dynamics::{Batch, Dynamics, Method, MethodKind, Scratch, advance, observe};
use crate::error::{Error, ErrorKind, Result};
use crate::expr::{Bounds, Compiled, Observed, Scope};
use crate::fit::factor::Factor;
use crate::fit::gauss_newton::refit;
use crate::fit::pass::{Linearised, Problem, Stepping, Sums, settle_and_linearise};
use crate::fit::segments::{Segments, cut, packed, typical_step};
use crate::fit::states::States;
use crate::fit::train::Training;
use crate::fit::tuning::TUNING as FIT;
use crate::fit::{Law, Loss, Options, Silent};

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
    /// The model of a context as it is.
    pub fn as_it_is(context: &Context, label: &str) -> Rival {
        Rival { label: label.to_string(), statement: String::new(), law: context.law.clone() }
    }

    /// The model of a context with an effect in it, fitted to the context's measurements.
    ///
    /// `spec` is that of the context's system; `statement` adds the effect `label` to it.
    /// `start` holds first guesses of the coefficients of the effect's terms (zero where short).
    ///
    /// # Errors
    ///
    /// When the statement does not fit the spec, or the model cannot be fitted.
    pub fn with_effect(
        context: &Context,
        spec: &Compiled,
        label: &str,
        statement: &str,
        start: &[f64],
    ) -> Result<Rival> {
        let system = Scope::of(spec).extension(statement)?.onto(context.system());
        let system = Arc::new(system);
        let mut law = context.law.on(&system);
        let new = system.terms_where(|term| term.effect.as_deref() == Some(label));
        let guesses = start.iter().copied().chain(std::iter::repeat(0.0));
        for (id, guess) in new.into_iter().zip(guesses) {
            law = law.with_term(id, guess)?;
        }
        let options = Options { window: Some(context.law.window()), ..Options::default() };
        let mut training = Training::from_law(&law, context.measured.clone(), &options)?;
        training.choose_integrator();
        let mut fitted = training.refit(&Silent);
        training.take(&mut fitted);
        let mut stepping = training.law().stepping();
        let usual = context.law.stepping().longest.min(typical_step(context.dataset));
        stepping.longest = stepping.longest.max(usual / TUNING.design.finer_steps);
        Ok(Rival {
            label: label.to_string(),
            statement: statement.to_string(),
            law: training.law().clone().with_stepping(stepping),
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
    stepping: Stepping,
    pub dynamics: Dynamics,
    /// Coefficients, then the inner parameters in use, at their best.
    pub theta: Vec<f64>,
    bounds: Vec<Bounds>,
    weights: Vec<f64>,
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
    pub fn new(rival: &'a Rival, dataset: &Dataset, window: usize, noise: &[f64]) -> Result<Self> {
        let dynamics = rival.law.dynamics();
        let (theta, bounds) = (rival.law.theta(&dynamics), rival.law.bounds(&dynamics));
        let measured = packed(dataset);
        let segments = cut(&measured, window);
        let states = States::measured(&measured, &segments.list, dynamics.degrees());
        let weights: Vec<f64> = noise.iter().map(|s| 1.0 / s.max(f64::MIN_POSITIVE)).collect();
        let stepping = explicit(rival.law.stepping());
        let problem = problem(rival, stepping, &measured, &segments, &weights);
        let best =
            refit(&problem, &dynamics, &bounds, &theta, states, FIT.refit.converged, &Silent);
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
        Ok(Known {
            rival,
            stepping,
            dynamics,
            theta,
            bounds,
            weights,
            segments,
            states,
            factor,
            sums,
        })
    }

    /// Trajectories from (start, times) of each run; where one leaves the finite numbers, so do
    /// its states.
    pub fn predict(&self, runs: &[(&[f64], &[f64])]) -> Vec<Path> {
        runs.par_chunks(TUNING.design.lanes)
            .flat_map_iter(|chunk| self.predict_block(chunk))
            .collect()
    }

    fn predict_block(&self, runs: &[(&[f64], &[f64])]) -> Vec<Path> {
        let lanes = runs.len();
        let rows = 2 * self.dynamics.degrees();
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
        let Stepping { method, longest } = self.stepping;
        let samples = runs.iter().map(|(_, times)| times.len()).max().unwrap_or(0);
        for sample in 0..samples {
            if sample > 0 {
                for (span, (_, times)) in span.iter_mut().zip(runs) {
                    *span = times.get(sample).map_or(0.0, |time| time - times[sample - 1]);
                }
                let most = span.iter().fold(0.0f64, |most, s| most.max(s.abs()));
                let steps = (most / longest * (1.0 - 1e-9)).ceil().max(1.0) as usize;
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

    /// The rival before other measurements, from guesses of the segments' initial states: one
    /// factor for each fold of the segments.
    pub fn before(&self, dataset: &Dataset, segments: &Segments, mut states: States) -> Linearised {
        let measured = packed(dataset);
        let problem = problem(self.rival, self.stepping, &measured, segments, &self.weights);
        let law = (&self.dynamics, &self.theta[..]);
        settle_and_linearise(&problem, law, law, &mut states)
    }

    /// The loss after a full refit to other measurements.
    pub fn refitted(&self, dataset: &Dataset, segments: &Segments, states: States) -> f64 {
        let measured = packed(dataset);
        let problem = problem(self.rival, self.stepping, &measured, segments, &self.weights);
        let bounds = &self.bounds;
        refit(&problem, &self.dynamics, bounds, &self.theta, states, FIT.refit.converged, &Silent)
            .sums()
            .loss
    }

    /// Deviance so far, with a price of log(residuals) for every unknown.
    pub fn standing(&self) -> f64 {
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

/// Below this residuals are rounding, in units of the noise.
const FLOOR: f64 = 1e-3;

fn problem<'b>(
    rival: &'b Rival,
    stepping: Stepping,
    measured: &'b Packed,
    segments: &'b Segments,
    weights: &'b [f64],
) -> Problem<'b> {
    let observed: Observed = rival.law.system().observed;
    Problem {
        measured,
        segments,
        observed,
        weights,
        loss: Loss::SQUARES,
        stepping,
        floor: FLOOR,
        stream: None,
        window: segments.longest(),
        tuning: &FIT,
    }
}
