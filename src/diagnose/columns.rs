//! What terms that are not in a model would do to its predictions: a column for each, beside those
//! of the model's own unknowns.

use super::score_test::Scores;
use super::settling::{Settled, problem};
use crate::dynamics::Dynamics;
use crate::error::{Error, ErrorKind, Result};
use crate::eval::Backend;
use crate::expr::{System, Term};
use crate::fit::column::Column;
use crate::fit::factor::Factor;
use crate::fit::pass::{Sums, linearise};

/// Scores of probes, and what they cost.
pub struct Probed {
    /// One column for each probe.
    pub scores: Scores,
    /// Segments that were lost: predictions, or effects of a probe, that are not finite.
    pub diverged: usize,
}

impl Settled<'_> {
    /// Scores of terms that are not in the model, one column each, orthogonal to the model's
    /// own unknowns and to all initial states.
    ///
    /// `extended` is the system with whatever its graph must hold for the expressions of
    /// `probes`; its own terms are those of the system, or begin with them.
    pub fn probe(&self, extended: System, probes: &[Term]) -> Result<Probed> {
        let Settled { model, segments, states, .. } = self;
        let mut system = extended;
        let first = system.terms.len();
        system.terms.extend_from_slice(probes);
        let extra = system.term_ids().split_off(first);
        let law = &model.law;
        let (active, added) = (system.positions(law.support())?, system.positions(&extra)?);
        let dynamics = Dynamics::of_runs(&system, active, added, Backend::default());
        let count = law.support().len();
        let theta = law.theta(&dynamics);
        let weights = model.law.weights();
        let problem = problem(model, segments, &weights);
        let linearised = linearise(&problem, &dynamics, &theta, states);
        if linearised.sums.rows <= count + dynamics.parameters().len() {
            let Sums { rows, diverged, .. } = linearised.sums;
            return Err(Error::new(
                ErrorKind::InsufficientData,
                format!(
                    "{rows} independent residuals do not suffice to ask what is missing \
                     ({diverged} of {} predictions diverged)",
                    segments.list.len()
                ),
                "measure longer runs, or more of them",
            ));
        }
        // The model's unknowns first: coefficients, inner parameters, then the probes. What runs
        // have for themselves is eliminated.
        let terms = dynamics.active().len();
        let shared = dynamics.parameters().iter().enumerate().filter(|(_, id)| {
            system.parameters.get(id.position()).is_some_and(|parameter| parameter.per.is_none())
        });
        let shared: Vec<usize> = shared.map(|(place, _)| terms + place).collect();
        let base = count + shared.len();
        let order: Vec<Column> =
            (0..count).chain(shared).chain(count..terms).map(Column::new).collect();
        let factor = linearised.merged().select(&order);
        let tuning = model.tuning();
        let variance = noise_variance(&factor, base).max(tuning.ranking.least_variance);
        let diverged = linearised.sums.diverged;
        Ok(Probed { scores: Scores::new(&factor, base, variance, tuning.scan.spanned), diverged })
    }
}

/// Variance of the weighted residuals with everything that was probed taken out, or of the
/// model's own where there are too many probes for that.
fn noise_variance(factor: &Factor, base: usize) -> f64 {
    let (rows, columns) = (factor.rows(), factor.columns());
    if rows > 3 * columns {
        factor.least() / (rows - columns) as f64
    } else {
        let size = columns - base;
        let left = factor.target().rows(base, size).norm_squared() + factor.least();
        left / rows.saturating_sub(base).max(1) as f64
    }
}
