//! Noise whose samples are not independent: what an instrument filters, or what drifts for a
//! moment, is alike in neighbouring readings.
//!
//! Over the shortest predictions such noise looks smaller than it is, since the states follow it;
//! over whole runs it looks like something missing. It is told from that by its memory, which is
//! short and the same everywhere, while what a model misses goes on as long as the motion does: an
//! autoregressive model of low order (Yule and Walker, 1927 and 1931) leaves of the one
//! nothing but white noise (`whiteness`), and of the other the motion.

use std::f64::consts::PI;

use super::instrument::coarse_steps;
use super::law_on_data::LawOnData;
use super::misfit::error_of;
use super::settling::settle;
use super::tuning::Autocorrelation;
use super::whiteness::{White, autocovariance, p_value};
use super::window::longest;

/// The noise of an instrument.
#[derive(Debug, Clone, PartialEq)]
pub struct Noise {
    /// Standard deviation of each observable, in its unit.
    pub sizes: Vec<f64>,
    /// Samples for each independent one, at least 1: the integrated autocorrelation time of the
    /// observable that has most of it.
    pub autocorrelation_time: f64,
}

impl From<Vec<f64>> for Noise {
    /// White noise of these standard deviations.
    fn from(sizes: Vec<f64>) -> Noise {
        Noise { sizes, autocorrelation_time: 1.0 }
    }
}

impl Noise {
    /// Sum of the logarithms of all standard deviations.
    pub fn log_size(&self) -> f64 {
        self.sizes.iter().map(|size| size.ln()).sum()
    }
}

/// The noise that a model leaves over whole runs, where that is larger than the model's noise, but
/// noise nevertheless: with a short memory, and nothing beside it. `None` where the model's noise
/// explains whole runs, and where something else is left of them.
///
/// `changes` is how many changes of a model were found in the same readings: each of them takes up
/// what it can of a record, and with enough of them the rest of any short one looks like noise.
/// Readings in coarse steps have no such noise: what rounding makes of them goes with the motion.
pub fn correlated_noise(model: &LawOnData, changes: usize) -> Option<Noise> {
    let tuning = &model.tuning().autocorrelation;
    let reaches = model.tuning().verdict.reaches;
    if tuning.largest <= reaches {
        return None;
    }
    if coarse_steps(model).iter().any(Option::is_some) {
        return None;
    }
    let settled = settle(model.with_window(longest(model)));
    let (error, lost) = error_of(&settled.sums);
    if lost > 0 || !(error > reaches && error < tuning.largest) {
        return None;
    }
    let residuals = settled.residuals();
    let mut noise = model.noise();
    let spreads = model.spreads();
    let mut rests = Vec::new();
    let mut samples = 0;
    for (row, size) in noise.sizes.iter_mut().enumerate() {
        let series: Vec<&[f64]> =
            residuals.iter().filter_map(|segment| Some(segment.get(row)?.as_slice())).collect();
        if series.iter().all(|values| values.iter().all(|x| !x.is_finite())) {
            continue;
        }
        let found = Process::of(&series, changes, tuning)?;
        // The states take a part of the variance with them.
        let freedom = settled.sums.freedom[row].max(1.0);
        *size *= (settled.sums.squares[row] / freedom).sqrt();
        // What a model that has lost the motion leaves is the motion.
        if *size > tuning.part * spreads[row] {
            return None;
        }
        noise.autocorrelation_time = noise.autocorrelation_time.max(found.time);
        samples = series.iter().map(|values| values.len()).max().unwrap_or(0).max(samples);
        rests.push(found.rest);
    }
    let white = p_value(&rests, lags(samples, tuning))? >= tuning.significant;
    white.then_some(noise)
}

/// An autoregressive process of low order.
struct Process {
    /// Samples for each independent one: the spectral density at frequency zero over that of white
    /// noise of the same variance, at least 1.
    time: f64,
    /// What it leaves of the residuals that it describes.
    rest: White,
}

impl Process {
    /// The process that residuals may be, `[segment][sample]`, not a number where there is none;
    /// `None` where none of a short memory describes them.
    fn of(series: &[&[f64]], changes: usize, tuning: &Autocorrelation) -> Option<Process> {
        let longest = series.iter().map(|values| values.len()).max()?;
        let lags = lags(longest, tuning);
        let covariance = autocovariance(series, lags)?;
        let count =
            series.iter().flat_map(|values| values.iter()).filter(|x| x.is_finite()).count();
        if lags <= 2 * tuning.order {
            return None;
        }
        let (factors, innovation) = chosen(&covariance, count as f64, tuning.order);
        if !short(&factors, longest / tuning.memory, longest) || peaks(&factors, tuning.peak) {
            return None;
        }
        let density = innovation / (1.0 - factors.iter().sum::<f64>()).powi(2);
        let time = (density / covariance[0]).max(1.0);
        // Of a short record with a long memory much can be said, and little of it is certain.
        let enough = tuning.samples * time * changes.max(1) as f64;
        let certain = time <= tuning.longest && count as f64 >= enough;
        let white = series.iter().map(|values| whitened(values, &factors)).collect();
        let rest = White { series: white, fitted: factors.len() };
        certain.then_some(Process { time, rest })
    }
}

/// Lags whose autocorrelations are looked at.
fn lags(longest: usize, tuning: &Autocorrelation) -> usize {
    (longest / 4).min(tuning.lags)
}

/// Factors and variance of the innovation of the autoregressive process of the order that
/// describes so many samples in the fewest nats, by Levinson's recursion.
fn chosen(covariance: &[f64], count: f64, most: usize) -> (Vec<f64>, f64) {
    let mut factors: Vec<f64> = Vec::new();
    let mut innovation = covariance[0];
    let length =
        |innovation: f64, order: usize| count * innovation.ln() + order as f64 * count.ln();
    let mut best = (factors.clone(), innovation);
    for order in 1..=most {
        let predicted: f64 =
            factors.iter().zip(covariance[1..order].iter().rev()).map(|(a, c)| a * c).sum();
        let reflection = (covariance[order] - predicted) / innovation;
        let turned: Vec<f64> = factors.iter().rev().map(|a| reflection * a).collect();
        factors.iter_mut().zip(turned).for_each(|(a, b)| *a -= b);
        factors.push(reflection);
        innovation *= 1.0 - reflection * reflection;
        if innovation <= 0.0 {
            break;
        }
        if length(innovation, order) < length(best.1, best.0.len()) {
            best = (factors.clone(), innovation);
        }
    }
    best
}

/// Whether the response of a process to one innovation is over after so many samples: within a
/// twentieth of it up to `longest`.
fn short(factors: &[f64], memory: usize, longest: usize) -> bool {
    let mut response = vec![1.0];
    for at in 1..longest {
        let next = factors
            .iter()
            .enumerate()
            .filter_map(|(back, a)| Some(a * response.get(at.checked_sub(back + 1)?)?));
        response.push(next.sum());
    }
    response.iter().skip(memory).all(|x: &f64| x.abs() < 0.05)
}

/// Whether the spectral density of a process has a peak: it is larger somewhere by some factor than
/// at frequency zero and at half the sampling rate. What a model misses swings with the motion;
/// what an instrument filters or differentiates does not.
fn peaks(factors: &[f64], factor: f64) -> bool {
    const FREQUENCIES: usize = 64;
    let density = |at: usize| {
        let angle = PI * at as f64 / FREQUENCIES as f64;
        let (mut real, mut imaginary) = (1.0, 0.0);
        for (back, a) in factors.iter().enumerate() {
            let turned = angle * (back + 1) as f64;
            real -= a * turned.cos();
            imaginary += a * turned.sin();
        }
        1.0 / f64::max(real * real + imaginary * imaginary, f64::MIN_POSITIVE)
    };
    let ends = density(0).max(density(FREQUENCIES));
    (1..FREQUENCIES).any(|at| density(at) > factor * ends)
}

/// What is left of values when what those before them say is taken off; not a number where one of
/// these is none.
fn whitened(values: &[f64], factors: &[f64]) -> Vec<f64> {
    let at = |i: usize| {
        let said = factors.iter().enumerate().map(|(back, a)| a * values[i - back - 1]);
        values[i] - said.sum::<f64>()
    };
    (factors.len()..values.len()).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64;

    /// Runs of noise of variance 1, each sample `memory` times the one before it, and a wave.
    fn noise(memory: f64, wave: f64, seed: u64) -> Vec<Vec<f64>> {
        let mut generator = Pcg64::seed_from_u64(seed);
        let fresh = (1.0 - memory * memory).sqrt();
        let mut run = || {
            let mut last: f64 = StandardNormal.sample(&mut generator);
            let mut next = |at: usize| {
                let draw: f64 = StandardNormal.sample(&mut generator);
                last = memory * last + fresh * draw;
                last + wave * (0.4 * at as f64).sin()
            };
            (0..200).map(&mut next).collect()
        };
        (0..6).map(|_| run()).collect()
    }

    fn found(memory: f64, wave: f64, seed: u64) -> Option<f64> {
        let runs = noise(memory, wave, seed);
        let series: Vec<&[f64]> = runs.iter().map(Vec::as_slice).collect();
        let tuning = Autocorrelation::default();
        let process = Process::of(&series, 1, &tuning)?;
        let white = p_value(&[process.rest], lags(200, &tuning))? >= tuning.significant;
        white.then_some(process.time)
    }

    #[test]
    fn a_longer_story_takes_more_readings() {
        let runs = noise(0.7, 0.0, 3);
        let series: Vec<&[f64]> = runs.iter().map(Vec::as_slice).collect();
        let process = |changes| Process::of(&series, changes, &Autocorrelation::default());
        // 1,200 readings, of which some 210 are independent.
        assert!(process(1).is_some() && process(2).is_some());
        assert!(process(4).is_none());
    }

    #[test]
    fn the_memory_of_noise_is_found_and_a_motion_is_none() {
        for (memory, time) in [(0.0, 1.0), (0.5, 3.0), (0.7, 17.0 / 3.0)] {
            let seeds = 0..20;
            let times: Vec<f64> = seeds.filter_map(|seed| found(memory, 0.0, seed)).collect();
            assert!(times.len() >= 19, "{memory}: {} of 20", times.len());
            let mean = times.iter().sum::<f64>() / times.len() as f64;
            assert!((mean / time - 1.0).abs() < 0.2, "{memory}: {mean} {time}");
        }
        for memory in [0.0, 0.7] {
            assert!((0..20).all(|seed| found(memory, 0.7, seed).is_none()), "{memory}");
        }
        // What goes on for a whole run is not noise of short memory.
        assert!((0..20).all(|seed| found(0.98, 0.0, seed).is_none()));
    }
}
