//! Trajectories of a law that measured inputs drive.

use std::sync::Arc;

use super::trajectory::{IntegrationRecord, Simulator, States, diverged};
use crate::data::{Dataset, MeasuredInput, Packed};
use crate::dynamics::{Batch, Drive, Scratch, advance, choose_steps};
use crate::error::{Error, ErrorKind, Result};
use crate::expr::System;

/// States on which the length of a step is chosen.
const PILOT_STATES: usize = 64;
/// Pieces of the inputs that the pilot goes through.
const PILOT_PIECES: usize = 2000;
/// A time may lie beyond the last sample of an input by this part of the record: by rounding.
const BEYOND: f64 = 1e-12;

/// What drives simulated trajectories: one run of the inputs of a system.
#[derive(Debug, Clone)]
pub struct InputRecord {
    measured: Arc<Packed>,
    run: usize,
    inputs: Vec<MeasuredInput>,
}

impl InputRecord {
    /// The inputs of every run of a data set.
    ///
    /// # Errors
    /// The data set does not hold the inputs of the system.
    pub fn of_runs(system: &System, data: &Dataset) -> Result<Vec<InputRecord>> {
        if data.inputs != system.measured_inputs() {
            return Err(missing(system));
        }
        let measured = Arc::new(Packed::of(data, 1));
        let of = |run| InputRecord { measured: measured.clone(), run, inputs: data.inputs.clone() };
        Ok((0..data.runs.len()).map(of).collect())
    }

    /// Times of its samples, on the clock of the file.
    pub fn times(&self) -> Vec<f64> {
        let clock = self.measured.clock_of(self.run);
        self.measured.times_of(self.run).iter().map(|&since| clock.time(since)).collect()
    }

    /// Values of every input at some times, `[input][time]`.
    pub fn values(&self, times: &[f64]) -> Vec<Vec<f64>> {
        let of = |input: usize| {
            let value = |&time: &f64| {
                let (sample, since) = self.place(time);
                let mut out = vec![0.0; self.measured.driven().1];
                let ends = sample + 1 == self.measured.times_of(self.run).len();
                self.measured.driving(input, self.run, sample, ends, &mut out);
                out.iter().rev().fold(0.0, |sum, c| sum * since + c)
            };
            times.iter().map(value).collect()
        };
        (0..self.inputs.len()).map(of).collect()
    }

    /// Names of the inputs.
    pub fn names(&self) -> Vec<String> {
        self.inputs.iter().map(|input| input.name.clone()).collect()
    }

    /// The last sample that is not after a time, and the time since.
    fn place(&self, time: f64) -> (usize, f64) {
        let (times, origin) =
            (self.measured.times_of(self.run), self.measured.clock_of(self.run).origin);
        let since = time - origin;
        // A time that rounding puts just before a sample is that of the sample.
        let near = BEYOND * (1.0 + since.abs());
        let sample = times.partition_point(|t| *t <= since + near).max(1) - 1;
        (sample, (since - times.get(sample).copied().unwrap_or(0.0)).max(0.0))
    }

    /// Time of the sample after one.
    fn after(&self, sample: usize) -> Option<f64> {
        let next = self.measured.times_of(self.run).get(sample + 1)?;
        Some(self.measured.clock_of(self.run).time(*next))
    }

    /// Sets the inputs of all lanes from a time on; gives the time until which they hold.
    fn drive(&self, batch: &mut Batch, time: f64) -> f64 {
        let (sample, since) = self.place(time);
        let (inputs, powers) = self.measured.driven();
        let after = self.after(sample);
        let mut coefficients = vec![0.0; powers];
        batch.drive = Drive::new(inputs, powers, batch.lanes);
        for input in 0..inputs {
            self.measured.driving(input, self.run, sample, after.is_none(), &mut coefficients);
            for lane in 0..batch.lanes {
                batch.drive.set(input, lane, &coefficients);
            }
        }
        batch.drive.go_on(&vec![since; batch.lanes]);
        after.unwrap_or(f64::INFINITY)
    }

    /// That the inputs are known at all times.
    fn cover(&self, times: &[f64]) -> Result<()> {
        let own = self.times();
        let (Some(first), Some(last)) = (own.first(), own.last()) else { return Ok(()) };
        let slack = BEYOND * (last - first) + BEYOND * last.abs();
        let outside = times.iter().find(|&&t| t < first - slack || t > last + slack);
        let Some(outside) = outside else { return Ok(()) };
        Err(Error::new(
            ErrorKind::InvalidArgument,
            format!(
                "the input `{}` is known from {first} to {last}, but the motion is asked for at \
                 {outside}",
                self.names().join("`, `")
            ),
            "ask for times within the record, or give a longer one",
        ))
    }
}

/// A law with inputs, and nothing said of them.
pub(super) fn missing(system: &System) -> Error {
    let names: Vec<&str> = system.inputs.iter().map(|one| one.variable.name.as_str()).collect();
    Error::new(
        ErrorKind::InvalidArgument,
        format!("what drives the motion is not given: {}", names.join(", ")),
        "give a record of the inputs: --inputs FILE, or the data in which they were measured",
    )
}

impl Simulator<'_> {
    /// States at `times` and what inputs do there, `[run][sample]`: steps end at every sample of
    /// the inputs, beyond which these are other polynomials.
    pub(super) fn by_pieces(
        &self,
        record: &InputRecord,
        starts: &[Vec<f64>],
        times: &[f64],
    ) -> Result<(States, IntegrationRecord)> {
        record.cover(times)?;
        let first = times.first().copied().unwrap_or(0.0);
        let (choice, longest) = self.longest_step(record, starts, times);
        let mut scratch = Scratch::new();
        let mut batch = self.batch(starts, first);
        let mut states: States = vec![Vec::with_capacity(times.len()); starts.len()];
        let mut taken = 0;
        for (sample, &time) in times.iter().enumerate() {
            if let Some(from) = sample.checked_sub(1).and_then(|at| times.get(at)) {
                let mut now = *from;
                while now < time {
                    let end = record.drive(&mut batch, now).min(time);
                    let span = vec![end - now; starts.len()];
                    let steps = ((end - now) / longest * (1.0 - 1e-9)).ceil().max(1.0) as usize;
                    let theta = &self.theta;
                    let (dynamics, method) = (&self.dynamics, choice.method);
                    advance(dynamics, method, &mut batch, &span, steps, theta, &mut scratch);
                    batch.time.fill(end);
                    taken += steps * starts.len();
                    now = end;
                }
            }
            for (lane, states) in states.iter_mut().enumerate() {
                if !batch.is_finite(lane) {
                    return Err(diverged(lane, &format!("before t = {time}")));
                }
                states.push(batch.get(lane));
            }
        }
        let integration = IntegrationRecord {
            method: choice.method.row().name,
            order: choice.method.row().order as usize,
            steps: taken,
            per_sample: None,
            reason: choice.reason,
        };
        Ok((states, integration))
    }

    /// What a piece of the inputs is integrated with, and the longest step of it, judged on states
    /// along the way.
    fn longest_step(
        &self,
        record: &InputRecord,
        starts: &[Vec<f64>],
        times: &[f64],
    ) -> (crate::dynamics::StepChoice, f64) {
        let mut scratch = Scratch::new();
        let tolerance = vec![0.0; 2 * self.dynamics.degrees()];
        let (first, last) =
            (times.first().copied().unwrap_or(0.0), times.last().copied().unwrap_or(0.0));
        let one: Vec<Vec<f64>> = starts.iter().take(1).cloned().collect();
        let mut batch = self.batch(&one, first);
        let chosen = |sample: &Batch, span: &[f64], scratch: &mut Scratch| {
            let widest = span.iter().fold(0.0f64, |most, span| most.max(*span));
            let choice =
                choose_steps(&self.dynamics, &self.theta, sample, span, &tolerance, true, scratch);
            let longest = widest / choice.steps as f64 * (1.0 + 1e-9);
            (choice, longest)
        };
        let end = record.drive(&mut batch, first).min(last);
        let rough = chosen(&batch, &[end - first], &mut scratch);
        let mut met: Vec<(f64, Vec<f64>, f64)> = Vec::new();
        let mut now = first;
        while now < last && met.len() < PILOT_PIECES && batch.is_finite(0) {
            let end = record.drive(&mut batch, now).min(last);
            met.push((now, batch.get(0), end - now));
            let steps = ((end - now) / rough.1).ceil().max(1.0) as usize;
            let (dynamics, theta) = (&self.dynamics, &self.theta);
            let span = [end - now];
            advance(dynamics, rough.0.method, &mut batch, &span, steps, theta, &mut scratch);
            batch.time.fill(end);
            now = end;
        }
        let stride = met.len().div_ceil(PILOT_STATES).max(1);
        let met: Vec<_> = met.into_iter().step_by(stride).collect();
        let mut sample = Batch::new(self.dynamics.degrees(), met.len());
        let (inputs, powers) = record.measured.driven();
        sample.drive = Drive::new(inputs, powers, met.len());
        let mut coefficients = vec![0.0; powers];
        for (lane, (time, state, _)) in met.iter().enumerate() {
            sample.set(lane, *time, state);
            let (at, _) = record.place(*time);
            for input in 0..inputs {
                record.measured.driving(input, record.run, at, false, &mut coefficients);
                sample.drive.set(input, lane, &coefficients);
            }
        }
        let since: Vec<f64> = met.iter().map(|(time, ..)| record.place(*time).1).collect();
        sample.drive.go_on(&since);
        let span: Vec<f64> = met.iter().map(|(.., span)| *span).collect();
        let fine = chosen(&sample, &span, &mut scratch);
        if fine.1 <= rough.1 { fine } else { rough }
    }

    /// Sets what inputs do at a time, for what is seen there.
    pub(super) fn drive_at(&self, batch: &mut Batch, time: f64) {
        match &self.driver {
            Some(record) => {
                record.drive(batch, time);
            }
            None => batch.drive = Drive::new(self.system.inputs.len(), 1, batch.lanes),
        }
    }
}
