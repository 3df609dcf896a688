//! Trajectories of a law, integrated as accurately as double precision allows.

use crate::data::{Dataset, Run};
use crate::dynamics::{
    Batch, Dynamics, Method, Scratch, StepChoice, advance, choose_steps, observe,
};
use crate::error::{Error, Result};
use crate::eval::Backend;
use crate::expr::System;

/// States along the way on which the number of steps is chosen.
const PILOT_STATES: usize = 64;
/// Trajectories that the pilot follows.
const PILOT_RUNS: usize = 16;

/// A law that can be moved forward in time.
pub struct Simulator<'a> {
    system: &'a System,
    dynamics: Dynamics,
    theta: Vec<f64>,
}

/// How far the energy of simulated trajectories strayed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyDrift {
    /// Largest |H(t) - H(0)| over all runs, in the unit of energy.
    pub largest: f64,
    /// The same in units of the largest |H(0)|; `None` where that is zero.
    pub relative: Option<f64>,
}

/// Simulated trajectories: `states[run][sample]` holds q, then p.
pub struct Trajectories {
    /// Times of the samples, the same for all runs.
    pub times: Vec<f64>,
    /// q, then p.
    pub states: Vec<Vec<Vec<f64>>>,
    /// What was measured of each state: q, then p or the velocities.
    pub observed: Vec<Vec<Vec<f64>>>,
    /// How far the energy strayed.
    pub drift: EnergyDrift,
    /// With what they were integrated, and how well.
    pub integration: StepChoice,
}

impl<'a> Simulator<'a> {
    /// The law of `system` with the terms `active`, a coefficient for each, and a value for
    /// each of the system's parameters.
    pub fn new(
        system: &'a System,
        active: &[usize],
        coefficients: &[f64],
        parameters: &[f64],
    ) -> Self {
        let dynamics = Dynamics::new(system, active, Backend::default());
        let mut theta = coefficients.to_vec();
        theta.extend(
            dynamics.parameters().iter().map(|&j| parameters.get(j).copied().unwrap_or(0.0)),
        );
        Simulator { system, dynamics, theta }
    }

    /// H at states (q, then p), at time `time`.
    pub fn energies(&self, states: &[Vec<f64>], time: f64) -> Vec<f64> {
        let batch = self.batch(states, time);
        let mut out = vec![0.0; states.len()];
        self.dynamics.energy(&batch, &self.theta, &mut out, &mut Scratch::new());
        out
    }

    fn batch(&self, states: &[Vec<f64>], time: f64) -> Batch {
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
        let first = times.first().copied().unwrap_or(0.0);
        let interval = times.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
        let integration = self.choose(starts, first, interval, times.len().saturating_sub(1));
        let mut scratch = Scratch::new();
        let mut batch = self.batch(starts, first);
        let before = self.energies(starts, first);
        let mut strayed: f64 = 0.0;
        let mut states = vec![Vec::with_capacity(times.len()); starts.len()];
        let mut observed = states.clone();
        let rows = 2 * self.dynamics.degrees();
        let mut seen = vec![0.0; rows * starts.len()];
        let mut energy = vec![0.0; starts.len()];
        for (sample, &time) in times.iter().enumerate() {
            if let Some(from) = sample.checked_sub(1).and_then(|at| times.get(at)) {
                let span = vec![time - from; starts.len()];
                let (method, steps) = (integration.method, integration.steps);
                advance(
                    &self.dynamics,
                    method,
                    &mut batch,
                    &span,
                    steps,
                    &self.theta,
                    &mut scratch,
                );
                batch.time.fill(time);
            }
            if let Some(run) = (0..starts.len()).find(|&lane| !batch.is_finite(lane)) {
                return Err(Error::fit(
                    format!(
                        "the trajectory of run {} leaves the finite numbers before t = {time}",
                        run + 1
                    ),
                    "shorten the duration, or start where the motion stays bounded",
                ));
            }
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
            for lane in 0..starts.len() {
                states[lane].push(batch.get(lane));
                observed[lane].push((0..rows).map(|row| seen[row * starts.len() + lane]).collect());
                strayed = strayed.max((energy[lane] - before[lane]).abs());
            }
        }
        let scale = before.iter().fold(0.0f64, |most, e| most.max(e.abs()));
        let relative = (scale > 0.0).then_some(strayed / scale);
        let drift = EnergyDrift { largest: strayed, relative };
        Ok(Trajectories { times: times.to_vec(), states, observed, drift, integration })
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
        let rough =
            choose_steps(&self.dynamics, &self.theta, &sample, &span, &tolerance, &mut scratch);
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
        let fine =
            choose_steps(&self.dynamics, &self.theta, &sample, &span, &tolerance, &mut scratch);
        if fine.cost >= rough.cost { fine } else { rough }
    }
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
        });
        let runs = runs.collect();
        Dataset { observables, runs }
    }

    /// The integrator's name.
    pub fn method(&self) -> Method {
        self.integration.method
    }
}
