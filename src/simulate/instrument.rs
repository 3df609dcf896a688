//! What an instrument does to a trajectory: noise, lost samples, pairs.

use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;

use crate::data::{Dataset, Run};
use crate::error::{Error, ErrorKind, Result};

/// Standard deviation of the noise of one observable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoiseLevel {
    /// In the observable's unit.
    Absolute(f64),
    /// In units of the standard deviation of all its values.
    Relative(f64),
}

/// Streams of random numbers that must not depend on each other.
const NOISE: u64 = 0x6e6f_6973;
const LOSS: u64 = 0x6c6f_7373;

/// Adds independent Gaussian noise to every value; one [`NoiseLevel`] for each observable.
/// Returns the standard deviations.
///
/// # Errors
/// A standard deviation is negative or not finite.
pub fn add_noise(data: &mut Dataset, noise: &[NoiseLevel], seed: u64) -> Result<Vec<f64>> {
    let mut generator = Pcg64::seed_from_u64(seed ^ NOISE);
    let mut sigmas = Vec::with_capacity(noise.len());
    for (row, noise) in noise.iter().enumerate() {
        sigmas.push(match *noise {
            NoiseLevel::Absolute(sigma) => sigma,
            NoiseLevel::Relative(part) => part * spread(data, row),
        });
    }
    let distributions: Vec<Normal<f64>> = sigmas
        .iter()
        .map(|&sigma| {
            let sound = sigma.is_finite() && sigma >= 0.0;
            sound.then(|| Normal::new(0.0, sigma).ok()).flatten().ok_or_else(|| {
                Error::new(
                    ErrorKind::InvalidArgument,
                    "noise must be zero or more",
                    "give a standard deviation, such as 0.01",
                )
            })
        })
        .collect::<Result<_>>()?;
    for run in &mut data.runs {
        for at in 0..run.times.len() {
            for (column, noise) in run.values.iter_mut().zip(&distributions) {
                if let Some(value) = column.get_mut(at) {
                    *value += noise.sample(&mut generator);
                }
            }
        }
    }
    Ok(sigmas)
}

fn spread(data: &Dataset, row: usize) -> f64 {
    let values = || data.runs.iter().filter_map(move |run| run.values.get(row)).flatten();
    let count = values().count().max(1) as f64;
    let mean = values().sum::<f64>() / count;
    (values().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt()
}

/// Every two neighbours of a run become a run of their own, as the paper makes its pairs:
/// inner samples stand in two runs, and get independent noise in each.
pub fn consecutive_pairs(data: &Dataset) -> Dataset {
    let mut runs = Vec::new();
    for run in &data.runs {
        for at in 1..run.times.len() {
            runs.push(Run {
                name: (runs.len() + 1).to_string(),
                times: run.times[at - 1..=at].to_vec(),
                values: run.values.iter().map(|column| column[at - 1..=at].to_vec()).collect(),
                lines: vec![0; 2],
                clock: run.clock,
                inputs: run.inputs.iter().map(|column| column[at - 1..=at].to_vec()).collect(),
                groups: run.groups.clone(),
                errors: run
                    .errors
                    .iter()
                    .map(|one| one.get(at - 1..=at).unwrap_or_default().to_vec())
                    .collect(),
            });
        }
    }
    Dataset { observables: data.observables.clone(), runs, inputs: data.inputs.clone() }
}

/// Loses a fraction of the samples of each run, at random; two always stay.
pub fn drop_samples(data: &mut Dataset, fraction: f64, seed: u64) {
    let mut generator = Pcg64::seed_from_u64(seed ^ LOSS);
    for run in &mut data.runs {
        let count = run.times.len();
        let mut order: Vec<usize> = (0..count).collect();
        order.shuffle(&mut generator);
        // The expected number, rounded up or down by chance.
        let exact = fraction.clamp(0.0, 1.0) * count as f64;
        let probability: f64 = generator.random_range(0.0..1.0);
        let lost = (exact.floor() as usize + usize::from(probability < exact.fract()))
            .min(count.saturating_sub(2));
        let mut kept = order.split_off(lost);
        kept.sort_unstable();
        let pick = |column: &[f64]| kept.iter().map(|&at| column[at]).collect::<Vec<f64>>();
        run.times = pick(&run.times);
        for column in run.values.iter_mut().chain(&mut run.inputs) {
            *column = pick(column);
        }
        run.lines = vec![0; kept.len()];
    }
}
