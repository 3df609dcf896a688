//! What a model predicts, beside what was measured.

use serde::Serialize;

use crate::diagnose::law_on_data::LawOnData;
use crate::diagnose::settling::{Settled, settle};
use crate::dynamics::{Batch, Drive, Dynamics, Scratch, advance, observe};
use crate::expr::Observed;
use crate::fit::driving;
use crate::fit::segments::{Segment, longest_run};

/// One run: its measurements, and the motion that the model predicts from the best start.
///
/// A hole in the measurements ends a prediction, and another one starts behind it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Prediction {
    /// Name of the run.
    pub run: String,
    /// Whether the model was not trained on it.
    pub held_out: bool,
    /// Times of the samples, in the spec's unit.
    pub times: Vec<f64>,
    /// `[observable][sample]`; NaN (null in JSON) where nothing was measured.
    pub measured: Vec<Vec<f64>>,
    /// `[observable][sample]`; NaN where nothing could be predicted.
    pub predicted: Vec<Vec<f64>>,
    /// The motion, `[q, then p][sample]`: as measured where momenta are, else the states that
    /// fit the measurements best, stretch by stretch of the length of training.
    pub states: Vec<Vec<f64>>,
    /// Energy of the model along the prediction, at each sample.
    pub energy: Vec<f64>,
    /// Samples at which a prediction starts.
    pub starts: Vec<usize>,
    /// Root mean square of measured minus predicted, in units of the noise.
    pub error: f64,
}

/// Predictions of every run, in the order of the data, each over as long as its data have no
/// hole.
pub fn predictions(model: &LawOnData, held_out: bool) -> Vec<Prediction> {
    let rows = 2 * model.system().degrees();
    let observables = model.system().observed_count();
    let mut out: Vec<Prediction> = model
        .data
        .dataset
        .runs
        .iter()
        .map(|run| {
            let missing = |rows: usize| vec![vec![f64::NAN; run.times.len()]; rows];
            Prediction {
                run: run.name.clone(),
                held_out,
                times: run.clock_times(),
                measured: run.values.clone(),
                predicted: missing(observables),
                states: missing(rows),
                energy: vec![f64::NAN; run.times.len()],
                starts: Vec::new(),
                error: f64::NAN,
            }
        })
        .collect();
    let law = CompiledLaw::new(model);
    let mut scratch = Scratch::new();
    let mut follow = |window: usize, out: &mut [Prediction]| {
        let Settled { segments, states, .. } = settle(model.with_window(window));
        let all: Vec<(Segment, &[f64])> =
            segments.list.iter().copied().zip(states.iter()).collect();
        for block in all.chunks(model.tuning().comparison.lanes) {
            law.follow(block, out, &mut scratch);
        }
    };
    let measured = |row: usize| {
        let mut all =
            model.data.dataset.runs.iter().filter_map(|run| run.values.get(row)).flatten();
        all.any(|x| x.is_finite())
    };
    let near = if model.system().observed == Observed::Momenta && (0..rows).all(measured) {
        None
    } else {
        let mut near = out.clone();
        follow(model.law.window(), &mut near);
        Some(near)
    };
    follow(longest_run(&model.data.dataset), &mut out);
    for (at, prediction) in out.iter_mut().enumerate() {
        prediction.states = match near.as_ref().and_then(|near| near.get(at)) {
            Some(near) => near.states.clone(),
            None => prediction.measured.iter().take(rows).cloned().collect(),
        };
        prediction.starts.sort_unstable();
        prediction.error = error(prediction, model.law.noise());
    }
    out
}

/// A law on data, its equations compiled.
pub(super) struct CompiledLaw<'a> {
    model: &'a LawOnData<'a>,
    dynamics: Dynamics,
    theta: Vec<f64>,
}

impl<'a> CompiledLaw<'a> {
    pub(super) fn new(model: &'a LawOnData) -> Self {
        let dynamics = model.law.dynamics();
        let theta = model.law.theta(&dynamics);
        CompiledLaw { model, dynamics, theta }
    }

    /// H at states of 2n numbers, at one time; inputs are at rest.
    pub(super) fn energies(&self, states: &[Vec<f64>], time: f64) -> Vec<f64> {
        let mut batch = Batch::new(self.model.system().degrees(), states.len());
        for (lane, state) in states.iter().enumerate() {
            batch.set(lane, time, state);
        }
        batch.drive = Drive::new(self.model.system().inputs.len(), 1, states.len());
        let mut out = vec![f64::NAN; states.len()];
        self.dynamics.energy(&batch, &self.theta, &mut out, &mut Scratch::new());
        out
    }

    fn follow(&self, block: &[(Segment, &[f64])], out: &mut [Prediction], scratch: &mut Scratch) {
        let model = self.model;
        let (degrees, lanes) = (model.system().degrees(), block.len());
        let (rows, observables) = (2 * degrees, self.dynamics.observables());
        let mut batch = Batch::new(degrees, lanes);
        for (lane, (segment, state)) in block.iter().enumerate() {
            batch.set(lane, out[segment.run].times[segment.first], state);
            out[segment.run].starts.push(segment.first);
        }
        let samples = block.iter().map(|(segment, _)| segment.samples()).max().unwrap_or(0);
        let mut span = vec![0.0; lanes];
        let mut seen = vec![0.0; observables * lanes];
        let mut energy = vec![0.0; lanes];
        for sample in 0..samples {
            if sample > 0 {
                for (lane, (segment, _)) in block.iter().enumerate() {
                    let times = &model.data.dataset.runs[segment.run].times;
                    let at = segment.first + sample;
                    span[lane] = if at <= segment.last { times[at] - times[at - 1] } else { 0.0 };
                }
                let (steps, method) =
                    (model.law.stepping().steps(&span), model.law.stepping().method);
                advance(&self.dynamics, method, &mut batch, &span, steps, &self.theta, scratch);
            }
            let places = block.iter().map(|(segment, _)| driving::at(*segment, sample));
            driving::drive(&mut batch, &model.data.packed, places);
            let observed = model.system().observed;
            observe(&self.dynamics, observed, &batch, &self.theta, &mut seen, None, scratch);
            self.dynamics.energy(&batch, &self.theta, &mut energy, scratch);
            for (lane, (segment, _)) in block.iter().enumerate() {
                let at = segment.first + sample;
                if at > segment.last {
                    continue;
                }
                let prediction = &mut out[segment.run];
                for row in 0..observables {
                    let mut value = seen[row * lanes + lane];
                    if let Some(period) = self.dynamics.period(row) {
                        // In the turn that was read, so that both can be drawn.
                        let apart = (value - prediction.measured[row][at]) / period;
                        value -= if apart.is_finite() { period * apart.round() } else { 0.0 };
                    }
                    prediction.predicted[row][at] = value;
                }
                for row in 0..rows {
                    prediction.states[row][at] = batch.state[row * lanes + lane];
                }
                prediction.energy[at] = energy[lane];
            }
        }
    }
}

fn error(prediction: &Prediction, noise: &[f64]) -> f64 {
    let (mut squares, mut count) = (0.0, 0);
    let rows = prediction.measured.iter().zip(&prediction.predicted).zip(noise);
    for ((measured, predicted), noise) in rows {
        for (a, b) in measured.iter().zip(predicted) {
            if a.is_finite() && b.is_finite() {
                squares += ((a - b) / noise.max(f64::MIN_POSITIVE)).powi(2);
                count += 1;
            }
        }
    }
    (squares / f64::from(count.max(1))).sqrt()
}
