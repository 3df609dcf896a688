//! Where a model fails: error by horizon, drift of the energy, residual force.

mod compared;
mod energy;
mod hats;
mod maps;
pub mod plane;
pub mod predictions;
pub mod view;

use serde::Serialize;

pub use compared::Compared;
use energy::energy_drift;
pub use energy::{EnergyDrift, energies};
pub(super) use maps::strongest_map;
pub use maps::{ResidualMap, residual_maps};

use super::law_on_data::LawOnData;
pub use super::misfit::error;
use super::settling::shortest;
use super::times::times;
use crate::data::Dataset;
use crate::error::Result;
use crate::fit::segments::{Reach, cut, longest_run, typical_step};

/// A model held against measurements.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Error against length of prediction, shortest first.
    pub horizons: Vec<Horizon>,
    /// Noise of each observable, in its unit; `None` where it was not measured.
    pub noise_floor: Vec<(String, Option<f64>)>,
    /// Residual force on each coordinate against each variable.
    pub maps: Vec<ResidualMap>,
    /// How the energy changes along every run.
    pub energy: Vec<EnergyDrift>,
    /// The worst, in plain sentences.
    pub findings: Vec<String>,
}

/// Error of predictions of one length, each from its best initial state.
///
/// Root mean square over all observables in units of the noise: 1 is the noise floor. The
/// freedom that the initial state takes up is corrected for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Horizon {
    /// Samples of a prediction, the first included.
    pub samples: usize,
    /// In the spec's unit of time.
    pub duration: f64,
    /// Error on the runs that the model was trained on.
    pub training: f64,
    /// `None` without held-out runs.
    pub held_out: Option<f64>,
    /// The same for persistence: the state stays as it is.
    pub baseline: f64,
    /// Predictions that left the finite numbers.
    pub diverged: usize,
}

/// Compares a model with the runs that it was trained on, and with held-out ones.
pub fn compare(training: &LawOnData, held_out: Option<&LawOnData>) -> Result<Comparison> {
    training.options.check()?;
    let horizons = horizons(training, held_out);
    let maps = residual_maps(training)?;
    let energy = energy_drift(training);
    let names = training.system().observables();
    let noise = training.law.noise().iter().zip(training.data.dataset.measured());
    let noise = noise.map(|(noise, measured)| (measured > 0).then_some(*noise));
    let noise_floor = names.into_iter().zip(noise).collect();
    let findings = findings(training, &horizons, &maps, &energy);
    Ok(Comparison { horizons, noise_floor, maps, energy, findings })
}

/// Lengths of prediction in samples: 2, 4, 8, ... and the longest run.
pub fn windows(dataset: &Dataset) -> Vec<usize> {
    let longest = longest_run(dataset);
    let mut windows: Vec<usize> =
        std::iter::successors(Some(2), |w| Some(2 * w)).take_while(|&w| w < longest).collect();
    windows.push(longest);
    windows
}

fn horizons(training: &LawOnData, held_out: Option<&LawOnData>) -> Vec<Horizon> {
    let step = typical_step(&training.data.dataset);
    let least = shortest(training);
    windows(&training.data.dataset)
        .into_iter()
        .filter(|&samples| samples >= least)
        .map(|samples| {
            let (seen, diverged) = error(training, samples);
            Horizon {
                samples,
                duration: step * (samples - 1) as f64,
                training: seen,
                held_out: held_out.map(|model| error(model, samples).0),
                baseline: baseline(training, samples),
                diverged,
            }
        })
        .collect()
}

/// The guess that nothing moves: each segment's mean, in units of the noise.
fn baseline(model: &LawOnData, window: usize) -> f64 {
    let (mut squares, mut freedom) = (0.0, 0.0);
    let reach = Reach { window, ..model.law.reach() };
    for segment in cut(&model.data.packed, reach, &model.options.fit.segments).list {
        let run = &model.data.dataset.runs[segment.run];
        for (values, noise) in run.values.iter().zip(model.law.noise()) {
            let seen: Vec<f64> = values[segment.first..=segment.last]
                .iter()
                .copied()
                .filter(|x| x.is_finite())
                .collect();
            if seen.len() < 2 {
                continue;
            }
            let mean = seen.iter().sum::<f64>() / seen.len() as f64;
            squares += seen.iter().map(|x| ((x - mean) / noise).powi(2)).sum::<f64>();
            freedom += (seen.len() - 1) as f64;
        }
    }
    (squares / f64::max(freedom, 1.0)).sqrt()
}

/// Three decimals, or as many digits of what is smaller or larger.
fn short(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || (0.01..1e4).contains(&size) {
        format!("{value:.3}")
    } else {
        format!("{value:.2e}")
    }
}

fn findings(
    model: &LawOnData,
    horizons: &[Horizon],
    maps: &[ResidualMap],
    energy: &[EnergyDrift],
) -> Vec<String> {
    let tuning = &model.tuning().comparison;
    let mut out = Vec::new();
    if model.autocorrelation_time > 1.0 {
        out.push(format!(
            "the noise is correlated: {:.1} samples in a row say as much as one of white noise",
            model.autocorrelation_time
        ));
    }
    // Where momenta are not measured, states take up all that two samples say.
    let said = || horizons.iter().filter(|horizon| horizon.training.is_finite());
    if let (Some(first), Some(last)) = (said().next(), said().next_back()) {
        // Data without noise leave nothing over short predictions.
        let growth = last.training / first.training.max(1e-9);
        out.push(if first.samples == last.samples {
            format!(
                "the error over {} samples is {} times the noise",
                last.samples,
                times(last.training)
            )
        } else if growth < tuning.grows {
            format!(
                "the error stays at {} times the noise from {} samples to {}",
                times(last.training),
                first.samples,
                last.samples
            )
        } else {
            format!(
                "the error grows from {} times the noise over {} samples to {} over {}",
                times(first.training),
                first.samples,
                times(last.training),
                last.samples
            )
        });
    }
    let mut worst: Vec<&ResidualMap> =
        maps.iter().filter(|map| map.p_value * (maps.len() as f64) < tuning.significant).collect();
    worst.sort_by(|a, b| {
        (b.deviance / b.degrees as f64).total_cmp(&(a.deviance / a.degrees as f64))
    });
    for map in worst.iter().take(tuning.maps) {
        let peak = map
            .points
            .iter()
            .filter(|p| p.2.is_finite())
            .max_by(|a, b| (a.1 / a.2).abs().total_cmp(&(b.1 / b.2).abs()));
        if let Some(&(at, force, error)) = peak {
            out.push(format!(
                "the force on {} is off by {} ({:.0} standard errors) where {} is near {}",
                map.on,
                short(force),
                (force / error).abs(),
                map.against,
                short(at)
            ));
        }
    }
    let drifting: Vec<&EnergyDrift> = energy
        .iter()
        .filter(|e| e.rate.abs() > tuning.drifts * e.rate_error && e.rate_error > 0.0)
        .collect();
    if let Some(most) = drifting.iter().max_by(|a, b| a.rate.abs().total_cmp(&b.rate.abs())) {
        let how = if most.rate < 0.0 { "loses" } else { "gains" };
        out.push(format!(
            "run {} {how} energy: from {:.4} to {:.4}, in {} of {} runs the energy drifts",
            most.run,
            most.first,
            most.last,
            drifting.len(),
            model.data.dataset.runs.len()
        ));
    }
    out
}
