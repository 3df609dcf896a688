//! Choosing the support by the error on data that a candidate was not fitted to.

use super::bounded::solve_bounded;
use super::factor::Factor;
use super::support::{Columns, SupportFit};
use super::tuning::SupportTuning;

/// Puts the candidate first that predicts held-out folds best: the smallest support whose error
/// is within one standard error of the least (Breiman, Friedman, Olshen and Stone,
/// Classification and Regression Trees, 1984, section 3.4.3).
///
/// `folds` are factors of disjoint parts of the data, unknowns absolute. With a single fold
/// the order is left alone.
pub fn prefer_held_out(
    candidates: &mut [SupportFit],
    folds: &[Factor],
    columns: &Columns,
    tuning: &SupportTuning,
) {
    if folds.len() < 2 {
        return;
    }
    let compared = candidates.len().min(tuning.compared_held_out);
    let errors: Vec<(f64, f64)> =
        candidates[..compared].iter().map(|c| held_out_error(c, folds, columns)).collect();
    let Some(&(least, spread)) = errors.iter().min_by(|a, b| a.0.total_cmp(&b.0)) else { return };
    let chosen = (0..compared)
        .filter(|&i| errors[i].0 <= least + spread)
        .min_by_key(|&i| candidates[i].support.len());
    if let Some(chosen) = chosen {
        candidates[..=chosen].rotate_right(1);
    }
}

/// Mean squared error a row over the left-out folds, and its standard error.
fn held_out_error(candidate: &SupportFit, folds: &[Factor], columns: &Columns) -> (f64, f64) {
    let chosen = columns.of(&candidate.support);
    let selected: Vec<Factor> = folds.iter().map(|fold| fold.select(&chosen)).collect();
    let mut errors = Vec::with_capacity(folds.len());
    for (out, left) in selected.iter().enumerate() {
        let mut seen = Factor::new(chosen.len());
        for (i, fold) in selected.iter().enumerate() {
            if i != out {
                seen.merge(fold);
            }
        }
        let values = solve_bounded(&seen, |i| columns.bounds[chosen[i]]).values;
        errors.push(left.squares(&values) / left.rows().max(1) as f64);
    }
    let count = errors.len() as f64;
    let mean = errors.iter().sum::<f64>() / count;
    let variance = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    (mean, (variance / count).sqrt())
}
