//! The noise floor, from predictions so short that a wrong model has no time to go astray.
//!
//! A model that lacks something takes a part of what it misses for noise: the longer its
//! segments, the more. Over one or two samples even a poor model is nearly right, so what is
//! left there is the instrument's.

use super::autocorrelation::{Noise, correlated_noise};
use super::law_on_data::LawOnData;
use super::settling::{Settled, settle, settle_from};
use super::tuning::NoiseFloor;
use crate::data::Dataset;
use crate::fit::scales::{fewest_samples, scales};

/// Noise of every observable over the shortest predictions that the data allow; the model's own
/// estimate where that is not clearly larger, or where there are too few residuals. Where the data
/// are far smoother than these predictions are good, what is not smooth in the data. Never less
/// than what the integrator resolves.
///
/// Where whole runs leave more, but nothing besides noise of a short memory, it is that noise.
pub fn noise_floor(model: &LawOnData) -> Noise {
    let noise = Noise::from(shortest(model));
    correlated_noise(&model.with_noise(noise.clone()), 0).unwrap_or(noise)
}

/// The noise over the shortest predictions, or the model's. What whole runs leave beside it may be
/// a force or noise with a memory: candidates have their say before that is called noise.
pub(super) fn shortest(model: &LawOnData) -> Vec<f64> {
    let tuning = &model.tuning().noise_floor;
    let own = model.law.noise();
    let measured = measured(model);
    let both = own.iter().zip(measured);
    both.map(|(&own, measured)| match measured {
        Some(Measured { noise, error }) if noise < own * (1.0 - tuning.below * error) => noise,
        _ => own,
    })
    .collect()
}

/// Noise of every observable over the shortest predictions of a model that explains the data; as
/// the model has it where there are too few residuals. Never less than what the integrator
/// resolves.
pub(super) fn noise_of(model: &LawOnData) -> Vec<f64> {
    let own = model.law.noise().iter();
    let measured = measured(model).into_iter();
    own.zip(measured).map(|(&own, short)| short.map_or(own, |short| short.noise)).collect()
}

/// Noise of every observable as the model has it, where a column is a little rougher: as rough as
/// that. Where a force is missing, the shortest predictions tell the columns' noises apart badly:
/// what momenta lack by it is taken for their noise, and initial states are then free to follow the
/// noise of the coordinates.
pub(crate) fn no_less_than_rough(model: &LawOnData) -> Vec<f64> {
    let tuning = &model.tuning().noise_floor;
    let rough = |row: usize| roughness(&model.data.dataset, row, tuning);
    let own = model.law.noise().iter().enumerate();
    own.map(|(row, &own)| {
        let rough = rough(row).filter(|rough| *rough < tuning.told_apart * own);
        rough.map_or(own, |rough| rough.max(own))
    })
    .collect()
}

/// An estimate of the noise of an observable.
struct Measured {
    noise: f64,
    /// Relative standard error; zero for what is not smooth in smooth data.
    error: f64,
}

/// Noise of every observable over the shortest predictions that the data allow; what is not smooth
/// in the data where these predictions stray for lack of a force. `None` where there are too few
/// residuals.
fn measured(model: &LawOnData) -> Vec<Option<Measured>> {
    let scales = scales(&model.data.packed, model.system().observed_count());
    let state = 2 * model.system().degrees();
    let window = fewest_samples(&scales, state, model.data.packed.samples());
    let tuning = &model.tuning().noise_floor;
    // Relative standard error of each estimate; none where there is no estimate.
    let mut known = vec![None; model.law.noise().len()];
    let Settled { model: mut judge, segments, mut states, mut sums } =
        settle(model.with_window(window));
    for round in 0..tuning.rounds {
        if round > 0 {
            sums = settle_from(&judge, &segments, &mut states);
        }
        let mut moved: f64 = 0.0;
        let mut next = judge.law.noise().to_vec();
        for (i, noise) in next.iter_mut().enumerate() {
            let enough = sums.freedom[i] > tuning.residuals && sums.squares[i].is_finite();
            known[i] = enough.then(|| (0.5 / sums.freedom[i]).sqrt());
            if enough {
                // Data without noise leave nothing, of which there is no logarithm.
                let factor = (sums.squares[i] / sums.freedom[i]).sqrt().max(1e-9);
                *noise *= factor;
                moved = moved.max(factor.ln().abs());
            }
        }
        judge.law = judge.law.with_noise(next);
        if moved < tuning.steady {
            break;
        }
    }
    let all = judge.law.noise().iter().zip(known).zip(model.law.resolution()).enumerate();
    all.map(|(row, ((&short, error), &resolution))| {
        let error = error?;
        let rough = roughness(&model.data.dataset, row, tuning);
        Some(match rough.filter(|rough| tuning.lacks_force * rough < short) {
            Some(rough) => Measured { noise: rough.max(resolution), error: 0.0 },
            None => Measured { noise: short.max(resolution), error },
        })
    })
    .collect()
}

/// What is not smooth in a column: the median of its differences of some order, of the order where
/// that is smallest, in units of what the order makes of white noise. `None` without stretches
/// that were sampled evenly.
fn roughness(dataset: &Dataset, row: usize, tuning: &NoiseFloor) -> Option<f64> {
    // (order, root of the sum of squares of its binomial coefficients)
    const ORDERS: [(usize, f64); 4] =
        [(4, 8.366_600_265), (6, 30.397_368_307), (8, 113.446_022_4), (10, 429.832_525_5)];
    // Intervals that differ by less than this part are equal: times that were written with seven
    // digits or more.
    const EVEN: f64 = 1e-6;
    // The median of the absolute value of a normal number.
    const MEDIAN: f64 = 0.674_489_75;
    let mut found: [Vec<f64>; ORDERS.len()] = Default::default();
    for run in &dataset.runs {
        let Some(column) = run.values.get(row) else { continue };
        // For each interval, how many up to it are as long as it is.
        let mut alike: Vec<usize> = Vec::with_capacity(run.times.len());
        let mut before = f64::NAN;
        for pair in run.times.windows(2) {
            let step = pair[1] - pair[0];
            let same = (step / before - 1.0).abs() < EVEN;
            alike.push(if same { alike.last().map_or(1, |n| n + 1) } else { 1 });
            before = step;
        }
        let mut differences = column.clone();
        for order in 1..=ORDERS[ORDERS.len() - 1].0 {
            for i in 1..differences.len() {
                differences[i - 1] = differences[i] - differences[i - 1];
            }
            differences.pop();
            let Some(at) = ORDERS.iter().position(|row| row.0 == order) else { continue };
            let even = alike.iter().skip(order - 1).map(|&n| n >= order);
            let sizes = differences.iter().zip(even).filter(|(x, even)| *even && x.is_finite());
            found[at].extend(sizes.map(|(x, _)| x.abs()));
        }
    }
    let of_order = |(sizes, (_, scale)): (&mut Vec<f64>, (usize, f64))| {
        let middle = sizes.len() / 2;
        (sizes.len() as f64 > tuning.residuals)
            .then(|| *sizes.select_nth_unstable_by(middle, f64::total_cmp).1 / (MEDIAN * scale))
    };
    found.iter_mut().zip(ORDERS).filter_map(of_order).reduce(f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Clock, Run};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64;

    /// Ten turns of a sine, sampled at `times`, with white noise.
    fn sine(times: &[f64], sigma: f64) -> Dataset {
        let mut generator = Pcg64::seed_from_u64(3);
        let mut noise = || -> f64 { StandardNormal.sample(&mut generator) };
        let values = vec![times.iter().map(|t| t.sin() + sigma * noise()).collect()];
        let lines = vec![0; times.len()];
        let (name, clock) = (String::new(), Clock::default());
        let run = Run {
            name,
            times: times.to_vec(),
            values,
            lines,
            clock,
            inputs: Vec::new(),
            groups: Vec::new(),
            errors: Vec::new(),
        };
        Dataset { observables: vec!["x".to_string()], runs: vec![run], inputs: Vec::new() }
    }

    fn found(data: &Dataset) -> Option<f64> {
        roughness(data, 0, &NoiseFloor::default())
    }

    #[test]
    fn what_is_rough_is_the_noise_and_not_the_motion() {
        let even: Vec<f64> = (0..1000).map(|i| 0.0628 * i as f64).collect();
        for sigma in [1e-2, 1e-4] {
            let rough = found(&sine(&even, sigma)).expect("an estimate");
            assert!((rough / sigma - 1.0).abs() < 0.2, "{rough} {sigma}");
        }
        assert!(found(&sine(&even, 0.0)).expect("an estimate") < 1e-10);
        let uneven: Vec<f64> = even.iter().map(|t| t + 0.01 * t.cos()).collect();
        assert_eq!(found(&sine(&uneven, 0.0)), None);
    }
}
