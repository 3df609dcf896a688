//! What an integrator leaves of a law where it has no order: across a kink of a force.
//!
//! Data that were computed are finer than that, and what such a law then leaves is not missing. It
//! is seen where the same trajectories are integrated in finer steps.

use super::law_on_data::LawOnData;
use super::misfit::error_of;
use super::settling::{Settled, problem, settle};
use crate::fit::Stepping;
use crate::fit::pass::{Problem, residuals};

/// How many times as fine the finer steps are.
const FINER: f64 = 4.0;
/// Noise is this many times the root mean square of what finer steps change: they err, too, and
/// the few kinks of other runs may be met worse.
const MARGIN: f64 = 2.0;
/// Noise that is off by less is not changed: it would be, a little, again and again.
const CLEARLY: f64 = 1.1;
/// What is missing from a law is at least so many times as large over the same segments: errors of
/// steps hide no more than a hundredth of it. Nothing is known to be missing where they are as fine
/// as no instrument.
const SMALL: f64 = 100.0;

/// Noise of every observable that is no less than what the steps of a law's integrator leave of
/// segments of its window. `None` where they leave less than the noise, where the noise is that of
/// an instrument, and where it would be and is not small beside what another law leaves, `than`.
pub(super) fn noise_of_steps(model: &LawOnData, than: &LawOnData) -> Option<Vec<f64>> {
    let finest = model.options.fit.conclusion.clean;
    let spreads = model.spreads();
    let is_fine = |(noise, spread): (&f64, &f64)| *noise < finest * spread;
    if !model.law.noise().iter().zip(&spreads).any(is_fine) {
        return None;
    }
    let Settled { model, segments, states, .. } = settle(model.clone());
    let dynamics = model.law.dynamics_of_runs();
    let theta = model.law.theta(&dynamics);
    let weights = model.law.weights();
    let usual = problem(&model, &segments, &weights);
    let stepping = Stepping { longest: usual.stepping.longest / FINER, ..usual.stepping };
    let finer = Problem { stepping, ..problem(&model, &segments, &weights) };
    let of = |problem: &Problem| residuals(problem, &dynamics, &theta, &states);
    let (usual, finer) = (of(&usual), of(&finer));
    let changed = |row: usize| {
        let series = |all: &[Vec<Vec<f64>>]| -> Vec<f64> {
            all.iter().filter_map(|segment| segment.get(row)).flatten().copied().collect()
        };
        let (usual, finer) = (series(&usual), series(&finer));
        let squares = usual.iter().zip(&finer).map(|(a, b)| (a - b).powi(2));
        let known = squares.filter(|square| square.is_finite());
        let (count, sum) =
            known.fold((0.0, 0.0), |(count, sum), square| (count + 1.0, sum + square));
        MARGIN * f64::sqrt(sum / f64::max(count, 1.0))
    };
    let times: Vec<f64> = (0..model.law.noise().len()).map(changed).collect();
    if times.iter().all(|times| *times <= CLEARLY) {
        return None;
    }
    let both = model.law.noise().iter().zip(&times);
    let noise: Vec<f64> = both.map(|(noise, times)| noise * times.max(1.0)).collect();
    let other = than.with_noise(noise.clone()).with_window(model.law.window());
    let fine = noise.iter().zip(&spreads).all(is_fine);
    (fine || error_of(&settle(other).sums).0 > SMALL).then_some(noise)
}
