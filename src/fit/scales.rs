//! The size of what was measured: spread, rounding, how much there is.

use rayon::prelude::*;

use crate::data::Packed;

/// One observable over all runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Standard deviation; of a column that never changes its size, at least 1. `None` where
    /// nothing was measured.
    pub spread: Option<f64>,
    /// What rounding does to it: a few units in the last place of its largest value.
    pub rounding: f64,
    /// Values that were measured.
    pub measured: usize,
}

/// The scale of each of the first `observables` observables.
pub fn scales(measured: &Packed, observables: usize) -> Vec<Scale> {
    (0..observables).into_par_iter().map(|row| scale(measured.column(row))).collect()
}

/// Samples of a segment that hold twice as many measured values as a state has components, where
/// there are so many in all.
pub fn fewest_samples(scales: &[Scale], samples: usize) -> usize {
    let measured: usize = scales.iter().map(|scale| scale.measured).sum();
    let share = measured.max(1) as f64 / (samples * scales.len()).max(1) as f64;
    (2.0 / share - 0.5).ceil() as usize
}

fn scale(cells: &[f64]) -> Scale {
    let values: Vec<f64> = cells.iter().copied().filter(|x| x.is_finite()).collect();
    let largest = values.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
    let spread = if variance > 0.0 { variance.sqrt() } else { mean.abs().max(1.0) };
    Scale {
        spread: (!values.is_empty()).then_some(spread),
        rounding: (8.0 * f64::EPSILON * largest).max(1e-300),
        measured: values.len(),
    }
}
