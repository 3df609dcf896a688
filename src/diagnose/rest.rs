//! Stretches of measurement in which nothing moves.
//!
//! A mass at rest says little of the forces on it: dry friction may balance any of them. And what
//! acts there by the direction of the motion follows the noise of a velocity that is none.

use super::law_on_data::LawOnData;
use crate::fit::segments::Segments;

/// Samples of the shortest stretch that is taken for one at rest.
const SHORTEST: usize = 8;
/// Standard errors that a sample at rest is off by, at most.
const FAR: f64 = 3.5;
/// Standard errors that the sum of squares over a stretch is more than noise, at most: a motion
/// that turns passes through its slow part faster.
const MORE_THAN_NOISE: f64 = 4.0;

/// A stretch that is no noise is looked at again without one of so many parts.
const PARTS: usize = 16;

/// The stretches of some segments in which something moves; the segments as they are where nothing
/// does. To first order a force acts along the model's motion, which goes on where a mass that
/// friction holds stands: no sample at rest may be among them.
pub(super) fn moving(model: &LawOnData, segments: Segments) -> Segments {
    let packed = &model.data.packed;
    let degrees = model.system().degrees();
    let noise = model.law.noise();
    let at_rest: Vec<Vec<bool>> = (0..packed.runs())
        .map(|run| {
            let columns: Vec<Column> = (0..noise.len().min(2 * degrees))
                .map(|observable| Column {
                    values: packed.values_of(observable, run),
                    noise: noise[observable],
                    // A velocity at rest is zero, a coordinate whatever it is.
                    about_zero: observable >= degrees,
                })
                .filter(|column| column.noise > 0.0 && column.values.iter().any(|v| !v.is_nan()))
                .collect();
            rests(&columns, packed.times_of(run).len())
        })
        .collect();
    let moves = |run: usize, sample: usize| {
        !at_rest.get(run).and_then(|run| run.get(sample)).copied().unwrap_or(false)
    };
    let moving = segments.stretches_where(moves);
    if moving.list.is_empty() { segments } else { moving }
}

/// What one observable shows in one run.
struct Column<'a> {
    values: &'a [f64],
    noise: f64,
    about_zero: bool,
}

/// Which of so many samples lie in a stretch at rest.
fn rests(columns: &[Column], samples: usize) -> Vec<bool> {
    let mut rests = vec![false; samples];
    let mut first = 0;
    while first < samples && !columns.is_empty() {
        let mut end = first;
        let mut ranges = vec![(f64::INFINITY, f64::NEG_INFINITY); columns.len()];
        while end < samples && columns.iter().zip(&mut ranges).all(|(c, range)| c.stays(end, range))
        {
            end += 1;
        }
        let long = end - first >= SHORTEST;
        if long && columns.iter().all(|column| column.is_noise(first, end)) {
            rests[first..end].fill(true);
            first = end;
        } else {
            // What comes to rest moves in the first part of such a stretch.
            first += if long { (end - first).div_ceil(PARTS) } else { 1 };
        }
    }
    rests
}

impl Column<'_> {
    /// Whether a sample is not far from those of a range, which it widens.
    fn stays(&self, sample: usize, range: &mut (f64, f64)) -> bool {
        let value = self.values[sample];
        if value.is_nan() {
            return true;
        }
        *range = (range.0.min(value), range.1.max(value));
        let far = FAR * self.noise;
        if self.about_zero { value.abs() <= far } else { range.1 - range.0 <= 2.0 * far }
    }

    /// Whether nothing but noise is left about the mean, or about zero.
    fn is_noise(&self, first: usize, end: usize) -> bool {
        let values = || self.values[first..end].iter().copied().filter(|value| !value.is_nan());
        let count = values().count() as f64;
        if count < 2.0 {
            return count == 0.0;
        }
        let mean = if self.about_zero { 0.0 } else { values().sum::<f64>() / count };
        let freedom = if self.about_zero { count } else { count - 1.0 };
        let squares = values().map(|value| ((value - mean) / self.noise).powi(2)).sum::<f64>();
        squares <= freedom + MORE_THAN_NOISE * (2.0 * freedom).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    /// A coordinate and its velocity: a motion that dies out at `stop`, or never does.
    fn run(seed: u64, period: f64, stop: usize) -> [Vec<f64>; 2] {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut noise = || 0.01 * (0..12).map(|_| random.random::<f64>() - 0.5).sum::<f64>();
        let rate = std::f64::consts::TAU / period;
        let at = |k: usize| {
            let left = if k < stop { 1.0 - k as f64 / stop as f64 } else { 0.0 };
            let phase = rate * k as f64;
            (left * phase.cos(), -left * phase.sin())
        };
        let both: Vec<(f64, f64)> =
            (0..300).map(|k| (0.3 + at(k).0 + noise(), at(k).1 + noise())).collect();
        [both.iter().map(|b| b.0).collect(), both.iter().map(|b| b.1).collect()]
    }

    fn found(columns: &[Vec<f64>; 2]) -> Vec<bool> {
        let column = |values, about_zero| Column { values, noise: 0.01, about_zero };
        rests(&[column(&columns[0], false), column(&columns[1], true)], columns[0].len())
    }

    #[test]
    fn what_has_stopped_rests_and_what_turns_does_not() {
        for seed in 0..20 {
            for period in [12.0, 40.0, 150.0, 600.0] {
                let never = found(&run(seed, period, usize::MAX));
                let share = never.iter().filter(|&&rest| rest).count();
                assert!(share < 30, "period {period}: {share} of 300 samples rest");
            }
            let stopped = found(&run(seed, 40.0, 150));
            let still = stopped[150..].iter().filter(|&&rest| rest).count();
            assert!(still > 130, "{still} of 150 samples rest");
            assert!(stopped[..120].iter().all(|&rest| !rest));
        }
    }
}
