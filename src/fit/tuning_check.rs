//! Which numbers a fit can go by.

use super::tuning::{RefitTuning, Tuning};
use crate::error::{Error, ErrorKind, Result};

impl Tuning {
    /// Refuses numbers that a fit cannot go by.
    ///
    /// # Errors
    ///
    /// A count of something that there must be one of is zero, or a number is not positive and
    /// finite; [`ErrorKind::InvalidArgument`].
    pub(crate) fn check(&self) -> Result<()> {
        let Tuning { segments, stepping, rounds, course, support, first_order, .. } = self;
        let counts = [
            ("segments.folds", segments.folds, 1),
            ("stepping.transitions", stepping.transitions, 1),
            ("rounds.noise_segments", rounds.noise_segments, 1),
            ("course.longest", course.longest, 2),
            ("course.sampled", course.sampled, 2),
            ("course.combinations", course.combinations, 1),
            ("support.nested", support.nested, 2),
            ("support.polished", support.polished, 1),
            ("first_order.batch", first_order.batch, 1),
            ("first_order.epochs", first_order.epochs, 1),
            ("first_order.held_back", first_order.held_back, 2),
            ("first_order.norm_segments", first_order.norm_segments, 1),
            ("settling.expected_part", self.settling.expected_part, 1),
            ("segments.stretch", usize::try_from(segments.stretch).unwrap_or(usize::MAX), 1),
            ("conclusion.draws", self.conclusion.draws, 1),
            ("local.reach", self.local.reach, 1),
        ];
        let RefitTuning { converged, rough, first_damping, more_damping, .. } = self.refit;
        let sizes = [
            ("segments.hole", segments.hole),
            ("segments.slack", segments.slack),
            ("stepping.part_of_noise", stepping.part_of_noise),
            ("stepping.part_of_mean", stepping.part_of_mean),
            ("stepping.part_of_error", stepping.part_of_error),
            ("conclusion.clean", self.conclusion.clean),
            ("refit.converged", converged),
            ("refit.rough", rough),
            ("refit.first_damping", first_damping),
            ("refit.more_damping", more_damping),
            ("rounds.noise_steady", rounds.noise_steady),
            ("course.follows", course.follows),
            ("course.reach", course.reach),
            ("support.path_ratio", support.path_ratio),
            ("first_order.rate", first_order.rate),
            ("first_order.last_rate", first_order.last_rate),
            ("local.negligible", self.local.negligible),
            ("local.response", self.local.response),
            ("local.finer", self.local.finer),
            ("local.apart", self.local.apart),
            ("local.margin", self.local.margin),
        ];
        require("tuning", &counts, &sizes)
    }
}

/// Refuses counts (a name, the value, the least) that are too small, and sizes that are not
/// positive and finite; `of` is what holds them.
///
/// # Errors
///
/// The first of them; [`ErrorKind::InvalidArgument`].
pub(crate) fn require(
    of: &str,
    counts: &[(&str, usize, usize)],
    sizes: &[(&str, f64)],
) -> Result<()> {
    let wrong = |name: &str, value: String, wanted: String| {
        let message = format!("`{of}.{name}` is {value}");
        Err(Error::new(ErrorKind::InvalidArgument, message, format!("it must be {wanted}")))
    };
    if let Some((name, value, least)) = counts.iter().find(|(_, value, least)| value < least) {
        return wrong(name, value.to_string(), format!("at least {least}"));
    }
    match sizes.iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
        Some((name, value)) => wrong(name, value.to_string(), "positive and finite".to_string()),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_no_fit_can_go_by_are_refused_by_name() {
        assert!(Tuning::default().check().is_ok());
        let mut tuning = Tuning::default();
        tuning.segments.folds = 0;
        let error = tuning.check().expect_err("no folds").to_string();
        assert!(error.contains("segments.folds"), "{error}");
        let mut tuning = Tuning::default();
        tuning.refit.converged = f64::NAN;
        assert!(tuning.check().is_err());
    }
}
