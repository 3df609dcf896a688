//! The noise floor, from predictions so short that a wrong model has no time to go astray.
//!
//! A model that lacks something takes a part of what it misses for noise: the longer its
//! segments, the more. Over one or two samples even a poor model is nearly right, so what is
//! left there is the instrument's.

use super::context::Context;
use crate::fit::Model;

/// Rounds of weights and variances; each brings them nearer to their fixed point
/// (MINQUE, Rao, J. Multivar. Anal. 1, 1971).
const ROUNDS: usize = 6;
/// Independent residuals below which a column's estimate is worth nothing.
const FEW: f64 = 20.0;

/// Standard errors that the short estimate is below the model's before it is believed: the
/// smaller of two estimates of the same noise would be too small.
const BELOW: f64 = 3.0;

/// Noise of every observable over the shortest predictions that the data allow; the model's own
/// estimate where that is not clearly larger, or where there are too few residuals. Never less
/// than what the integrator resolves.
pub fn noise_floor(context: &Context, model: &Model) -> Vec<f64> {
    let window = shortest(context);
    let mut judge = context.with_data(context.dataset);
    // Relative standard error of each estimate; none where there is no estimate.
    let mut known = vec![None; judge.noise.len()];
    for _ in 0..ROUNDS {
        let (_, _, sums) = judge.settle(window);
        let mut moved: f64 = 0.0;
        for (i, noise) in judge.noise.iter_mut().enumerate() {
            let enough = sums.freedom[i] > FEW && sums.squares[i].is_finite();
            known[i] = enough.then(|| (0.5 / sums.freedom[i]).sqrt());
            if enough {
                let factor = (sums.squares[i] / sums.freedom[i]).sqrt().max(1e-9);
                *noise *= factor;
                moved = moved.max(factor.ln().abs());
            }
        }
        if moved < 0.01 {
            break;
        }
    }
    let resolutions = model.noise.iter().map(|noise| noise.resolution);
    let of_model = judge.noise.iter().zip(&context.noise).zip(known).zip(resolutions);
    of_model
        .map(|(((&short, &own), error), resolution)| match error {
            Some(error) if short < own * (1.0 - BELOW * error) => short.max(resolution),
            _ => own,
        })
        .collect()
}

/// Samples that hold twice as many measured values as a state has components.
fn shortest(context: &Context) -> usize {
    let columns = context.dataset.runs.iter().flat_map(|run| &run.values);
    let (mut cells, mut measured) = (0usize, 0usize);
    for column in columns {
        cells += column.len();
        measured += column.iter().filter(|x| x.is_finite()).count();
    }
    let share = measured.max(1) as f64 / cells.max(1) as f64;
    (2.0 / share - 0.5).ceil() as usize
}
