//! What a model leaves of its data, in units of the noise.

use super::law_on_data::LawOnData;
use super::settling::settle;
use crate::fit::pass::Sums;

/// Error in units of the noise over segments of `window` samples, and segments that diverged;
/// NaN where too few are left to say.
pub fn error(model: &LawOnData, window: usize) -> (f64, usize) {
    error_of(&settle(model.with_window(window)).sums)
}

/// The same of sums that are at hand.
pub(super) fn error_of(sums: &Sums) -> (f64, usize) {
    let freedom: f64 = sums.freedom.iter().sum();
    let squares: f64 = sums.squares.iter().sum();
    let error = if freedom < 1.0 { f64::NAN } else { (squares / freedom).sqrt() };
    (error, sums.diverged)
}

/// Squares a residual in excess of the noise; zero for a model at the noise, which leaves one
/// square for each independent residual. What cannot be predicted is not explained.
pub(super) fn excess(sums: &Sums, model: &LawOnData) -> f64 {
    if sums.rows == 0 {
        return f64::INFINITY;
    }
    let rows = sums.rows.max(1) as f64;
    let excess = sums.loss / rows - 1.0;
    let independent = rows / model.autocorrelation_time;
    let at_noise = model.tuning().verdict.at_noise * (2.0 / independent).sqrt();
    if excess < at_noise { 0.0 } else { excess }
}

/// Whether what a model leaves of other runs is the noise that it leaves of those it was fitted
/// to, as well as the residuals of both tell its size.
pub(super) fn is_noise_of(seen: &Sums, unseen: &Sums, model: &LawOnData) -> bool {
    if seen.rows == 0 || unseen.rows == 0 {
        return false;
    }
    let (own, other) = (seen.rows as f64, unseen.rows as f64);
    let ratio = (unseen.loss / other) / (seen.loss / own);
    let spread = (2.0 * model.autocorrelation_time * (1.0 / own + 1.0 / other)).sqrt();
    ratio - 1.0 <= model.tuning().verdict.at_noise * spread
}

/// Whether the noise of some observable is above what the integrator and rounding leave.
pub(super) fn is_resolved(model: &LawOnData) -> bool {
    let LawOnData { law, .. } = model;
    let tuning = &model.tuning().verdict;
    let mut known = law.noise().iter().zip(law.resolution());
    known.any(|(noise, resolution)| *noise > tuning.resolved * resolution)
}
