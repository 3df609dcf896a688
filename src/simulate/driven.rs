//! Trajectories of a law that measured inputs drive.

use super::inputs::InputRecord;
use super::trajectory::{IntegrationRecord, Simulator, States, diverged};
use crate::dynamics::{Batch, Drive, Scratch, advance, choose_steps};
use crate::error::Result;

/// States on which the length of a step is chosen.
const PILOT_STATES: usize = 64;
/// Pieces of the inputs that the pilot goes through.
const PILOT_PIECES: usize = 2000;

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
        let (inputs, powers) = record.size();
        sample.drive = Drive::new(inputs, powers, met.len());
        let mut coefficients = vec![0.0; powers];
        for (lane, (time, state, _)) in met.iter().enumerate() {
            sample.set(lane, *time, state);
            let (at, _) = record.place(*time);
            record.stand_lane(&mut sample.drive, lane, at);
            for input in 0..inputs {
                record.powers_at(input, at, false, &mut coefficients);
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
