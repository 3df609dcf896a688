//! The noise of the observables as a model under training leaves it.

use super::pass::{Problem, Sums, settle};
use super::rounding::NO_FREEDOM;
use super::states::States;
use super::train::Training;
use crate::dynamics::Dynamics;

impl Training<'_> {
    /// The noise at the present model as many segments from all over the data show it.
    pub(super) fn noise_of_a_part(&self, dynamics: &Dynamics, theta: &[f64]) -> Vec<f64> {
        let mean = self.samples() / self.segments.list.len().max(1);
        let segments = self.segments.spread(self.options.tuning.rounds.noise_segments * mean);
        let mut states = States::measured_by(&self.law, &self.measured, &segments.list);
        let weights = self.weights();
        let problem = Problem { segments: &segments, ..self.problem(&weights) };
        let sums = settle(&problem, dynamics, theta, &mut states);
        self.noise_estimate(&sums, theta.len())
    }

    /// Residual spread of each observable, degrees of freedom of states and theta paid for
    /// (the fixed point is MINQUE, Rao, J. Multivar. Anal. 1, 1971).
    pub(super) fn noise_estimate(&self, sums: &Sums, unknowns: usize) -> Vec<f64> {
        let rows = sums.rows as f64;
        let share = ((rows - unknowns as f64) / rows).max(1.0 / rows.max(1.0));
        let noise = self.law.noise().iter();
        noise
            .zip(&self.accuracy.resolution)
            .zip(sums.squares.iter().zip(&sums.freedom))
            .map(|((&old, &floor), (&squares, &freedom))| {
                if freedom <= NO_FREEDOM || !squares.is_finite() {
                    return old;
                }
                (old.max(floor) * (squares / (freedom * share)).sqrt()).max(floor)
            })
            .collect()
    }
}
