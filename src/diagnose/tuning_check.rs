//! Which numbers a diagnosis can go by.

use super::options::Options;
use crate::error::Result;
use crate::fit::tuning_check::require;

impl Options {
    /// Refuses numbers that a diagnosis cannot go by.
    ///
    /// # Errors
    ///
    /// A count of something that there must be one of is zero, or a number is not positive and
    /// finite; [`ErrorKind::InvalidArgument`](crate::ErrorKind::InvalidArgument).
    pub(super) fn check(&self) -> Result<()> {
        self.fit.check()?;
        let tuning = &self.tuning;
        let (composed, comparison, design) = (&tuning.composed, &tuning.comparison, &tuning.design);
        let counts = [
            ("states.first_samples", tuning.states.first_samples, 1),
            ("autocorrelation.memory", tuning.autocorrelation.memory, 1),
            ("states.growth", tuning.states.growth, 2),
            ("states.longest", tuning.states.longest, 2),
            ("candidates.points", tuning.candidates.points, 2),
            ("candidates.frequencies", tuning.candidates.frequencies, 2),
            ("composed.shortest", composed.shortest, 2),
            ("composed.panels", composed.panels, 1),
            ("composed.compared_at", composed.compared_at, 1),
            ("scan.samples", tuning.scan.samples, 2),
            ("instrument.shortest", tuning.instrument.shortest, 3),
            ("instrument.longest", tuning.instrument.longest, tuning.instrument.shortest),
            ("comparison.plane_nodes", comparison.plane_nodes, 2),
            ("comparison.portrait_points", comparison.portrait_points, 2),
            ("comparison.energies", comparison.energies, 1),
            ("comparison.lanes", comparison.lanes, 1),
            ("design.shortest", design.shortest, 2),
            ("design.repeats", design.repeats, 1),
            ("design.batch", design.batch, 1),
            ("design.lanes", design.lanes, 1),
        ];
        let sizes = [
            ("noise_floor.lacks_force", tuning.noise_floor.lacks_force),
            ("noise_floor.levels", tuning.noise_floor.levels),
            ("autocorrelation.peak", tuning.autocorrelation.peak),
            ("autocorrelation.largest", tuning.autocorrelation.largest),
            ("states.outlying", tuning.states.outlying),
            ("composed.panel_angle", composed.panel_angle),
            ("composed.first_spacing", composed.first_spacing),
            ("composed.second_spacing", composed.second_spacing),
            ("composed.last_step", composed.last_step),
            ("scan.least_variance", tuning.scan.least_variance),
            ("ranking.same", tuning.ranking.same),
            ("verdict.level", tuning.verdict.level),
            ("ranking.least_variance", tuning.ranking.least_variance),
            ("ranking.deviance_left", tuning.ranking.deviance_left),
            ("design.last_step", design.last_step),
            ("design.finer_steps", design.finer_steps),
        ];
        require("diagnosis.tuning", &counts, &sizes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_no_diagnosis_can_go_by_are_refused_by_name() {
        assert!(Options::default().check().is_ok());
        let mut options = Options::default();
        options.tuning.states.growth = 1;
        let error = options.check().expect_err("it never grows").to_string();
        assert!(error.contains("states.growth"), "{error}");
        let mut options = Options::default();
        options.tuning.composed.panel_angle = 0.0;
        assert!(options.check().is_err());
        let mut options = Options::default();
        options.fit.segments.folds = 0;
        assert!(options.check().is_err());
    }
}
