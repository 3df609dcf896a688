//! What drives a simulated motion: one run of measured inputs.

use std::sync::Arc;

use crate::data::{Dataset, MeasuredInput, Packed};
use crate::dynamics::{Batch, Drive};
use crate::error::{Error, ErrorKind, Result};
use crate::expr::System;

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
                self.powers_at(input, sample, ends, &mut out);
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
    pub(super) fn place(&self, time: f64) -> (usize, f64) {
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
    pub(super) fn drive(&self, batch: &mut Batch, time: f64) -> f64 {
        let (sample, since) = self.place(time);
        let (inputs, powers) = self.measured.driven();
        let after = self.after(sample);
        let mut coefficients = vec![0.0; powers];
        batch.drive = Drive::new(inputs, powers, batch.lanes);
        for input in 0..inputs {
            self.powers_at(input, sample, after.is_none(), &mut coefficients);
            for lane in 0..batch.lanes {
                batch.drive.set(input, lane, &coefficients);
            }
        }
        self.stand(&mut batch.drive, batch.lanes, sample);
        batch.drive.go_on(&vec![since; batch.lanes]);
        after.unwrap_or(f64::INFINITY)
    }

    /// Says that all lanes stand at a sample.
    fn stand(&self, drive: &mut Drive, lanes: usize, sample: usize) {
        (0..lanes).for_each(|lane| self.stand_lane(drive, lane, sample));
    }

    /// Says that a lane stands at a sample.
    pub(super) fn stand_lane(&self, drive: &mut Drive, lane: usize, sample: usize) {
        let time = self.measured.times_of(self.run).get(sample).copied().unwrap_or(f64::NAN);
        drive.stand(self.measured.record(), lane, self.run, time);
    }

    /// Inputs, and powers of time that each has in a piece.
    pub(super) fn size(&self) -> (usize, usize) {
        self.measured.driven()
    }

    /// Coefficients of an input from a sample on, by powers of the time since; beyond the last
    /// sample it stays as it `ends`.
    pub(super) fn powers_at(&self, input: usize, sample: usize, ends: bool, out: &mut [f64]) {
        self.measured.driving(input, self.run, sample, ends, out);
    }

    /// That the inputs are known at all times.
    pub(super) fn cover(&self, times: &[f64]) -> Result<()> {
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
