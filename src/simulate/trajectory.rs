//! Trajectories of a law, integrated as accurately as double precision allows.

use super::inputs::{InputRecord, missing};
use crate::data::{Clock, Dataset, Run};
use crate::dynamics::{
    Batch, Dynamics, Scratch, StepChoice, Stop, advance, choose_steps, observe, taylor,
};
use crate::error::{Error, ErrorKind, Result};
use crate::eval::Backend;
use crate::expr::{ParameterId, System, TermId};

/// States along the way on which the number of steps is chosen.
const PILOT_STATES: usize = 64;
/// Trajectories that the pilot follows.
const PILOT_RUNS: usize = 16;

/// A law that can be moved forward in time.
pub struct Simulator<'a> {
    pub(super) system: &'a System,
    pub(super) dynamics: Dynamics,
    pub(super) theta: Vec<f64>,
    /// What drives the motion.
    pub(super) driver: Option<InputRecord>,
}

/// What trajectories are integrated with.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum IntegratorChoice {
    /// As many equal steps of the cheapest method of the table as reach the limit of double
    /// precision.
    #[default]
    Chosen,
    /// Taylor series of the solution, in steps as long as they allow.
    Taylor {
        /// The error of one step, as a part of the largest component of the state; below
        /// rounding it is rounding.
        tolerance: f64,
    },
}

/// With what trajectories were integrated.
#[derive(Debug, Clone, PartialEq)]
pub struct IntegrationRecord {
    /// Name of a row of the methods, or `taylor`.
    pub method: &'static str,
    /// Order of the method or of the series.
    pub order: usize,
    /// Steps of all trajectories together.
    pub steps: usize,
    /// Steps from one sample to the next, where that is the same everywhere.
    pub per_sample: Option<usize>,
    /// One sentence for the user.
    pub reason: String,
}

/// How well simulated trajectories keep their energy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyConservation {
    /// Largest |H(t) - H(0)| over all runs, in the unit of energy.
    pub largest: f64,
    /// The same in units of the largest |H(0)|; `None` where that is zero.
    pub relative: Option<f64>,
}

/// `[run][sample][2n]`: q, then p.
pub(super) type States = Vec<Vec<Vec<f64>>>;

/// Simulated trajectories: `states[run][sample]` holds q, then p.
pub struct Trajectories {
    /// Times of the samples, the same for all runs.
    pub times: Vec<f64>,
    /// q, then p.
    pub states: Vec<Vec<Vec<f64>>>,
    /// What was measured of each state: q, then p or the velocities.
    pub observed: Vec<Vec<Vec<f64>>>,
    /// By how much the energy was off.
    pub drift: EnergyConservation,
    /// With what they were integrated, and how well.
    pub integration: IntegrationRecord,
}

impl<'a> Simulator<'a> {
    /// The law of `system` with the terms `active`, a coefficient for each, and a value for
    /// each of the system's parameters.
    ///
    /// # Errors
    /// A term belongs to another system.
    pub fn new(
        system: &'a System,
        active: &[TermId],
        coefficients: &[f64],
        parameters: &[f64],
    ) -> Result<Self> {
        let dynamics = Dynamics::new(system, active, Backend::default())?;
        let mut theta = coefficients.to_vec();
        let value = |id: &ParameterId| parameters.get(id.position()).copied().unwrap_or(0.0);
        theta.extend(dynamics.parameters().iter().map(value));
        Ok(Simulator::with(system, dynamics, theta))
    }

    /// The motion of a system in which no term is unknown, its parameters zero.
    pub fn known(system: &'a System) -> Self {
        let dynamics = Dynamics::known(system, Backend::default());
        let theta = vec![0.0; dynamics.unknowns()];
        Simulator::with(system, dynamics, theta)
    }

    /// The motion of `system` by some of its terms, with their coefficients and then the inner
    /// parameters in use.
    pub(crate) fn with(system: &'a System, dynamics: Dynamics, theta: Vec<f64>) -> Self {
        Simulator { system, dynamics, theta, driver: None }
    }

    /// The same law under measured inputs.
    pub fn driven_by(self, record: InputRecord) -> Self {
        Simulator { driver: Some(record), ..self }
    }

    /// H at states (q, then p), at time `time`; without a record inputs are at rest.
    pub fn energies(&self, states: &[Vec<f64>], time: f64) -> Vec<f64> {
        let mut batch = self.batch(states, time);
        self.drive_at(&mut batch, time);
        let mut out = vec![0.0; states.len()];
        self.dynamics.energy(&batch, &self.theta, &mut out, &mut Scratch::new());
        out
    }

    pub(super) fn batch(&self, states: &[Vec<f64>], time: f64) -> Batch {
        let mut batch = Batch::new(self.dynamics.degrees(), states.len());
        for (lane, state) in states.iter().enumerate() {
            batch.set(lane, time, state);
        }
        batch
    }

    /// The trajectory from every start, sampled at `times` (ascending; the first is the start's).
    ///
    /// # Errors
    /// A trajectory leaves the finite numbers; the message says which and when.
    pub fn trajectories(&self, starts: &[Vec<f64>], times: &[f64]) -> Result<Trajectories> {
        self.trajectories_by(IntegratorChoice::Chosen, starts, times)
    }

    /// The same by an integrator of one's choice.
    ///
    /// # Errors
    /// As above; and the law has no Taylor series, or the series cannot be followed through a
    /// place where its steps become nothing.
    pub fn trajectories_by(
        &self,
        integrator: IntegratorChoice,
        starts: &[Vec<f64>],
        times: &[f64],
    ) -> Result<Trajectories> {
        self.require_held(starts)?;
        let (states, integration) = match integrator {
            _ if !self.system.inputs.is_empty() => {
                let record = self.driver.as_ref().ok_or_else(|| missing(self.system))?;
                self.by_pieces(record, starts, times)?
            }
            IntegratorChoice::Chosen => self.by_steps(starts, times)?,
            IntegratorChoice::Taylor { tolerance } => self.by_series(starts, times, tolerance)?,
        };
        let mut scratch = Scratch::new();
        let before = self.energies(starts, times.first().copied().unwrap_or(0.0));
        let mut largest: f64 = 0.0;
        let mut observed: Vec<Vec<Vec<f64>>> = vec![Vec::with_capacity(times.len()); starts.len()];
        let rows = self.dynamics.observables();
        let mut seen = vec![0.0; rows * starts.len()];
        let mut energy = vec![0.0; starts.len()];
        let mut batch = Batch::new(self.dynamics.degrees(), starts.len());
        for (sample, &time) in times.iter().enumerate() {
            for (lane, states) in states.iter().enumerate() {
                batch.set(lane, time, &states[sample]);
            }
            self.drive_at(&mut batch, time);
            observe(
                &self.dynamics,
                self.system.observed,
                &batch,
                &self.theta,
                &mut seen,
                None,
                &mut scratch,
            );
            self.dynamics.energy(&batch, &self.theta, &mut energy, &mut scratch);
            // An angle is read as its instrument gives it: whole turns are lost.
            for row in 0..rows {
                let Some(period) = self.dynamics.period(row) else { continue };
                for x in &mut seen[row * starts.len()..(row + 1) * starts.len()] {
                    *x -= period * (*x / period).round();
                }
            }
            for lane in 0..starts.len() {
                observed[lane].push((0..rows).map(|row| seen[row * starts.len() + lane]).collect());
                largest = largest.max((energy[lane] - before[lane]).abs());
            }
        }
        let scale = before.iter().fold(0.0f64, |most, e| most.max(e.abs()));
        let relative = (scale > 0.0).then_some(largest / scale);
        let drift = EnergyConservation { largest, relative };
        Ok(Trajectories { times: times.to_vec(), states, observed, drift, integration })
    }

    /// `[run][sample]` by equal steps.
    fn by_steps(&self, starts: &[Vec<f64>], times: &[f64]) -> Result<(States, IntegrationRecord)> {
        let first = times.first().copied().unwrap_or(0.0);
        let interval = times.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
        let intervals = times.len().saturating_sub(1);
        let choice = self.choose(starts, first, interval, intervals);
        let (method, steps) = (choice.method, choice.steps);
        let mut scratch = Scratch::new();
        let mut batch = self.batch(starts, first);
        let mut states: States = vec![Vec::with_capacity(times.len()); starts.len()];
        for (sample, &time) in times.iter().enumerate() {
            if let Some(from) = sample.checked_sub(1).and_then(|at| times.get(at)) {
                let span = vec![time - from; starts.len()];
                let theta = &self.theta;
                advance(&self.dynamics, method, &mut batch, &span, steps, theta, &mut scratch);
                batch.time.fill(time);
            }
            for (lane, states) in states.iter_mut().enumerate() {
                if !batch.is_finite(lane) {
                    return Err(diverged(lane, &format!("before t = {time}")));
                }
                states.push(batch.get(lane));
            }
        }
        let integration = IntegrationRecord {
            method: method.row().name,
            order: method.row().order as usize,
            steps: steps * intervals * starts.len(),
            per_sample: Some(steps),
            reason: choice.reason,
        };
        Ok((states, integration))
    }

    /// `[run][sample]` by Taylor series.
    fn by_series(
        &self,
        starts: &[Vec<f64>],
        times: &[f64],
        tolerance: f64,
    ) -> Result<(States, IntegrationRecord)> {
        let (mut states, mut steps, mut order) = (States::new(), 0, 0);
        for (run, start) in starts.iter().enumerate() {
            let found = taylor(&self.dynamics, &self.theta, start, times, tolerance);
            let found = found.ok_or_else(|| self.no_series())?;
            match found.trajectory.stop {
                Stop::Finished => states.push(found.trajectory.states),
                Stop::Diverged { after } => {
                    return Err(diverged(run, &format!("after t = {after}")));
                }
                Stop::Unresolved { after } => {
                    return Err(Error::new(
                        ErrorKind::TaylorSeries,
                        format!(
                            "the Taylor series of run {} cannot be followed after t = {after}: \
                             its steps become too short, or its terms are not numbers",
                            run + 1
                        ),
                        "start away from singularities and the ends of roots and logarithms, \
                         shorten the duration, or take equal steps",
                    ));
                }
            }
            (steps, order) = (steps + found.steps, found.order);
        }
        let reason = format!(
            "Taylor series of order {order} take steps with an error of {:.1e} of the state",
            tolerance.max(f64::EPSILON)
        );
        Ok((states, IntegrationRecord { method: "taylor", order, steps, per_sample: None, reason }))
    }

    fn no_series(&self) -> Error {
        let hint = "equal steps can do it";
        match self.dynamics.kink() {
            Some(function) => Error::new(
                ErrorKind::TaylorSeries,
                format!("there is no Taylor series of `{function}`, which has a kink or a jump"),
                hint,
            ),
            None => Error::new(
                ErrorKind::TaylorSeries,
                "the Taylor series of this law has too many terms",
                hint,
            ),
        }
    }

    /// The number of steps that an interval needs, judged on states all along the way: a
    /// motion may start slowly and pass something sharp later.
    fn choose(
        &self,
        starts: &[Vec<f64>],
        time: f64,
        interval: f64,
        intervals: usize,
    ) -> StepChoice {
        let mut scratch = Scratch::new();
        let tolerance = vec![0.0; 2 * self.dynamics.degrees()];
        let few: Vec<Vec<f64>> = starts.iter().take(PILOT_STATES).cloned().collect();
        let sample = self.batch(&few, time);
        let span = vec![interval; few.len()];
        let chosen = |sample: &Batch, span: &[f64], scratch: &mut Scratch| {
            choose_steps(&self.dynamics, &self.theta, sample, span, &tolerance, true, scratch)
        };
        let rough = chosen(&sample, &span, &mut scratch);
        if intervals < 2 {
            return rough;
        }
        let runs: Vec<Vec<f64>> = starts.iter().take(PILOT_RUNS).cloned().collect();
        let mut batch = self.batch(&runs, time);
        let span = vec![interval; runs.len()];
        let keep = (intervals * runs.len()).div_ceil(PILOT_STATES).max(1);
        let (mut met, mut count) = (Vec::new(), 0usize);
        for _ in 0..intervals {
            advance(
                &self.dynamics,
                rough.method,
                &mut batch,
                &span,
                rough.steps,
                &self.theta,
                &mut scratch,
            );
            for lane in 0..runs.len() {
                if count.is_multiple_of(keep) && batch.is_finite(lane) {
                    met.push((batch.time[lane], batch.get(lane)));
                }
                count += 1;
            }
        }
        let mut sample = Batch::new(self.dynamics.degrees(), met.len());
        for (lane, (time, state)) in met.iter().enumerate() {
            sample.set(lane, *time, state);
        }
        let span = vec![interval; met.len()];
        let fine = chosen(&sample, &span, &mut scratch);
        if fine.cost >= rough.cost { fine } else { rough }
    }
}

pub(super) fn diverged(run: usize, when: &str) -> Error {
    Error::new(
        ErrorKind::NotFinite,
        format!("the trajectory of run {} diverges {when}", run + 1),
        "shorten the duration, or start where the motion stays bounded",
    )
}

impl Trajectories {
    /// What was measured, as a data set with runs named 1, 2, ...
    pub fn dataset(&self, system: &System) -> Dataset {
        let observables = system.observables();
        let runs = self.observed.iter().enumerate().map(|(run, samples)| Run {
            name: (run + 1).to_string(),
            times: self.times.clone(),
            values: (0..observables.len())
                .map(|row| samples.iter().map(|sample| sample[row]).collect())
                .collect(),
            lines: vec![0; self.times.len()],
            clock: Clock::default(),
            inputs: Vec::new(),
            groups: Vec::new(),
            errors: Vec::new(),
        });
        let runs = runs.collect();
        Dataset { observables, runs, inputs: Vec::new() }
    }
}
