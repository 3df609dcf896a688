//! The energy of a model along what was measured.

use serde::Serialize;

use crate::diagnose::law_on_data::LawOnData;
use crate::diagnose::settling::{Settled, settle};
use crate::dynamics::{Batch, Scratch, advance};
use crate::fit::driving;

/// How the model's energy changes along the measurements of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EnergyDrift {
    /// Name of the run.
    pub run: String,
    /// Energy at the first point.
    pub first: f64,
    /// Energy at the last point.
    pub last: f64,
    /// Slope over time and its standard error.
    pub rate: f64,
    /// Standard error of `rate`.
    pub rate_error: f64,
}

/// Energy of the model at the measured states of every run: (time, energy) of each segment's
/// middle, sorted by time; one list a run.
pub fn energies(model: &LawOnData) -> Vec<Vec<(f64, f64)>> {
    let dynamics = model.law.dynamics();
    let theta = model.law.theta(&dynamics);
    let Settled { segments, states, .. } = settle(model.clone());
    let mut scratch = Scratch::new();
    let mut points: Vec<Vec<(f64, f64)>> = vec![Vec::new(); model.data.dataset.runs.len()];
    for (segment, state) in segments.list.iter().zip(&states) {
        let run = &model.data.dataset.runs[segment.run];
        let times = &run.times;
        let mut batch = Batch::new(model.system().degrees(), 1);
        batch.set(0, run.time(segment.first), state);
        // The middle of a segment is where its state is known best.
        let middle = 0.5 * (times[segment.last] - times[segment.first]);
        let stepping = model.law.stepping();
        let mut go_on = |batch: &mut Batch, span: f64| {
            let steps = (span / stepping.longest).ceil().max(1.0) as usize;
            advance(&dynamics, stepping.method, batch, &[span], steps, &theta, &mut scratch);
        };
        if run.inputs.is_empty() {
            go_on(&mut batch, middle);
        } else {
            // An input is another polynomial after every sample.
            for at in segment.first..segment.last {
                let left = middle - (times[at] - times[segment.first]);
                let place = driving::at(*segment, at - segment.first);
                driving::drive(&mut batch, &model.data.packed, std::iter::once(place));
                if left > 0.0 {
                    go_on(&mut batch, left.min(times[at + 1] - times[at]));
                }
            }
        }
        let mut energy = [f64::NAN];
        dynamics.energy(&batch, &theta, &mut energy, &mut scratch);
        if energy[0].is_finite() {
            points[segment.run].push((run.time(segment.first) + middle, energy[0]));
        }
    }
    for points in &mut points {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    points
}

/// Energy along every run, as a straight line over time.
pub(super) fn energy_drift(model: &LawOnData) -> Vec<EnergyDrift> {
    let runs = model.data.dataset.runs.iter();
    runs.zip(energies(model))
        .filter(|(_, points)| points.len() >= 3)
        .map(|(run, points)| {
            let (rate, rate_error) = slope(&points);
            EnergyDrift {
                run: run.name.clone(),
                first: points[0].1,
                last: points[points.len() - 1].1,
                rate,
                rate_error,
            }
        })
        .collect()
}

/// Slope of a straight line through points, and its standard error.
fn slope(points: &[(f64, f64)]) -> (f64, f64) {
    let n = points.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / n;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    let xx: f64 = points.iter().map(|p| (p.0 - x).powi(2)).sum();
    let xy: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    let slope = xy / xx.max(f64::MIN_POSITIVE);
    let left: f64 = points.iter().map(|p| (p.1 - y - slope * (p.0 - x)).powi(2)).sum();
    (slope, (left / (n - 2.0).max(1.0) / xx.max(f64::MIN_POSITIVE)).sqrt())
}
