//! Whether numbers are independent of one another: what is left of noise with a memory, once that
//! is taken off.
//!
//! What a model misses is told from noise by what the motion makes of it. It swings with the
//! motion, which a spectrum shows as a line (Fisher, Proc. R. Soc. A 125, 1929, for several runs
//! together); it moves a coordinate and its momentum, and others, together, where two sensors know
//! nothing of one another (Haugh, J. Am. Stat. Assoc. 71, 1976); and it is large where the motion
//! is, and small where that has died away (McLeod and Li, J. Time Ser. Anal. 4, 1983). Each says
//! nothing of what looks like noise to the others: what is asked for is the least of their
//! p-values, times their number.

use std::f64::consts::PI;

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Lags of squares, and of two series, that are looked at, to either side: what a model misses
/// there shows in the first of them.
const NEAR: usize = 10;
/// Frequencies of a spectrum, at most: two for each that a run of 4,096 samples can tell apart.
const FREQUENCIES: usize = 4_096;

/// What should be white: the numbers of one observable.
pub(super) struct White {
    /// Run by run; not a number where there is none.
    pub series: Vec<Vec<f64>>,
    /// Numbers that were fitted to make it so.
    pub fitted: usize,
}

/// The probability that independent numbers look so little like independent ones, in any of the
/// ways that are looked at and of any observable; `None` where there are too few to say.
pub(super) fn p_value(all: &[White], lags: usize) -> Option<f64> {
    let mut found = Vec::new();
    for white in all {
        found.push(portmanteau(&white.series, lags, white.fitted)?);
        found.push(of_squares(white)?);
        found.push(of_lines(&white.series)?);
    }
    for (i, first) in all.iter().enumerate() {
        for second in &all[i + 1..] {
            found.push(together(first, second)?);
        }
    }
    let least = found.iter().copied().fold(1.0, f64::min);
    Some((least * found.len() as f64).min(1.0))
}

/// Mean products of values so many samples apart, for lags from 0 on; `None` where some lag has no
/// pair.
pub(super) fn autocovariance(series: &[impl AsRef<[f64]>], lags: usize) -> Option<Vec<f64>> {
    let all = (0..=lags).map(|lag| {
        let (sum, count) = products(series, series, lag);
        (count > 0.0).then(|| sum / count)
    });
    let all: Option<Vec<f64>> = all.collect();
    all.filter(|all| all[0] > 0.0)
}

/// Sum and number of the products of values of one with values of another so many samples later.
fn products(first: &[impl AsRef<[f64]>], later: &[impl AsRef<[f64]>], lag: usize) -> (f64, f64) {
    let (mut sum, mut count) = (0.0, 0.0);
    for (a, b) in first.iter().zip(later) {
        for (a, b) in a.as_ref().iter().zip(b.as_ref().iter().skip(lag)) {
            let product = a * b;
            if product.is_finite() {
                sum += product;
                count += 1.0;
            }
        }
    }
    (sum, count)
}

fn tail(degrees: f64, statistic: f64) -> Option<f64> {
    Some(ChiSquared::new(degrees).ok()?.sf(statistic))
}

/// p-value of all autocorrelations up to a lag together, where so many numbers were fitted (Ljung
/// and Box, Biometrika 65, 1978).
fn portmanteau(series: &[Vec<f64>], lags: usize, fitted: usize) -> Option<f64> {
    let (squares, count) = products(series, series, 0);
    let variance = squares / count;
    let mut statistic = 0.0;
    for lag in 1..=lags {
        let (sum, pairs) = products(series, series, lag);
        if pairs < 1.0 {
            return None;
        }
        statistic += (sum / variance).powi(2) / pairs;
    }
    tail(lags.saturating_sub(fitted).max(1) as f64, statistic)
}

/// p-value of the autocorrelations of squares.
fn of_squares(white: &White) -> Option<f64> {
    let squares = white.series.iter().map(|run| run.iter().map(|x| x * x).collect());
    let mut squares: Vec<Vec<f64>> = squares.collect();
    let all = || white.series.iter().flatten().filter(|x| x.is_finite());
    let mean = all().map(|x| x * x).sum::<f64>() / all().count().max(1) as f64;
    squares.iter_mut().flatten().for_each(|x| *x -= mean);
    portmanteau(&squares, NEAR, 0)
}

/// p-value of the correlations of two series at all small lags, to either side.
fn together(first: &White, second: &White) -> Option<f64> {
    let variance = |white: &White| {
        let (squares, count) = products(&white.series, &white.series, 0);
        squares / count
    };
    let scale = variance(first) * variance(second);
    let mut statistic = 0.0;
    let mut degrees = 0.0;
    for (one, other, from) in [(first, second, 0), (second, first, 1)] {
        for lag in from..=NEAR {
            let (sum, pairs) = products(&one.series, &other.series, lag);
            if pairs > 0.0 {
                statistic += sum * sum / (pairs * scale);
                degrees += 1.0;
            }
        }
    }
    // Two columns that were never measured together.
    if degrees < 1.0 { Some(1.0) } else { tail(degrees, statistic) }
}

/// p-value of the highest line of a spectrum, all frequencies counted: squares of the amplitudes of
/// all runs, in units of the variance.
fn of_lines(series: &[Vec<f64>]) -> Option<f64> {
    let (squares, count) = products(series, series, 0);
    let variance = squares / count;
    let measured = |run: &&Vec<f64>| run.iter().filter(|x| x.is_finite()).count() > NEAR;
    let runs: Vec<&Vec<f64>> = series.iter().filter(measured).collect();
    let longest = runs.iter().map(|run| run.len()).max()?;
    let frequencies = longest.min(FREQUENCIES);
    let mut least: f64 = 1.0;
    for at in 0..frequencies {
        let angle = PI * at as f64 / frequencies as f64;
        let (mut statistic, mut degrees) = (0.0, 0.0);
        for run in &runs {
            // Amplitudes of cosine and sine are independent of one another where many turns are
            // seen; where few are, what both take off is asked for together.
            let (mut cc, mut cs, mut ss, mut xc, mut xs) = (0.0, 0.0, 0.0, 0.0, 0.0);
            let (turn_sin, turn_cos) = angle.sin_cos();
            let (mut cos, mut sin) = (1.0, 0.0);
            for x in run.iter() {
                if x.is_finite() {
                    cc += cos * cos;
                    cs += cos * sin;
                    ss += sin * sin;
                    xc += x * cos;
                    xs += x * sin;
                }
                (cos, sin) = (cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin);
            }
            let determinant = cc * ss - cs * cs;
            if determinant > 1e-3 * cc * cc.max(ss) {
                statistic += (ss * xc * xc - 2.0 * cs * xc * xs + cc * xs * xs) / determinant;
                degrees += 2.0;
            } else {
                statistic += xc * xc / cc;
                degrees += 1.0;
            }
        }
        least = least.min(tail(degrees, statistic / variance)?);
    }
    Some((least * frequencies as f64).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64;

    fn noise(runs: usize, samples: usize, seed: u64) -> Vec<Vec<f64>> {
        let mut generator = Pcg64::seed_from_u64(seed);
        let mut draw = || -> f64 { StandardNormal.sample(&mut generator) };
        (0..runs).map(|_| (0..samples).map(|_| draw()).collect()).collect()
    }

    fn of(series: Vec<Vec<f64>>) -> White {
        White { series, fitted: 0 }
    }

    /// How many of 100 seeds are called dependent at one per cent.
    fn dependent(make: impl Fn(u64) -> Vec<White>) -> usize {
        (0..100).filter(|&seed| p_value(&make(seed), 40).expect("enough") < 0.01).count()
    }

    #[test]
    fn independent_numbers_are_rarely_called_dependent() {
        for (runs, samples) in [(6, 160), (1, 900)] {
            let pair = |seed| [seed, seed + 1_000].map(|s| of(noise(runs, samples, s))).into();
            let found = dependent(pair);
            assert!(found <= 5, "{runs} runs: {found} of 100");
        }
    }

    #[test]
    fn a_wave_a_waxing_and_a_common_cause_are_seen() {
        let wave = |seed: u64| {
            let mut one = noise(4, 200, seed);
            one.iter_mut().for_each(|run| {
                run.iter_mut().enumerate().for_each(|(i, x)| *x += 0.4 * (0.3 * i as f64).sin());
            });
            vec![of(one)]
        };
        let waxing = |seed: u64| {
            let mut one = noise(4, 200, seed);
            one.iter_mut().for_each(|run| {
                run.iter_mut().enumerate().for_each(|(i, x)| *x *= (-0.01 * i as f64).exp());
            });
            vec![of(one)]
        };
        let common = |seed: u64| {
            let (first, mut second) = (noise(4, 200, seed), noise(4, 200, seed + 1_000));
            for (a, b) in first.iter().zip(&mut second) {
                a.iter().zip(b.iter_mut().skip(1)).for_each(|(a, b)| *b += 0.3 * a);
            }
            vec![of(first), of(second)]
        };
        for found in [dependent(wave), dependent(waxing), dependent(common)] {
            assert!(found >= 97, "{found} of 100");
        }
    }
}
