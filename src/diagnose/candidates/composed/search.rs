//! Terms scored around one motion of the model: many at once, then the leaders with care.

use rayon::prelude::*;

use super::actions::Action;
use super::enumerate::Found;
use super::expression::{Composed, LeafJets};
use super::leaves::Leaves;
use super::responses::{Responses, TOGETHER};
use super::states::Along;
use crate::diagnose::settling::Settled;
use crate::diagnose::tuning::Tuning;
use crate::fit::column::Column;

/// What scores are made of around one motion.
pub(super) struct Search<'a> {
    pub(super) jets: LeafJets,
    pub(super) responses: Responses,
    pub(super) tuning: &'a Tuning,
}

impl<'a> Search<'a> {
    /// Around the motion of a model; `kept` are the columns of those of its unknowns that stay
    /// free, and nodes are `spacing` radians of the fastest motion apart. What the `restored` terms
    /// do, each times a coefficient, is to be explained besides.
    pub(super) fn of(
        settled: &Settled<'a>,
        leaves: &Leaves,
        kept: &[Column],
        spacing: f64,
        along: Along,
        restored: &[(Composed, f64)],
    ) -> Search<'a> {
        let model = &settled.model;
        let mut responses = Responses::of(settled, kept, spacing, along);
        let compared_at = model.tuning().composed.compared_at;
        let jets =
            LeafJets::of(leaves, model.law.parameters(), &responses.points.nodes, compared_at);
        let actions: Vec<(f64, Action)> = restored
            .iter()
            .map(|(term, c)| (*c, term.action(&jets.nodes, responses.channels)))
            .collect();
        responses.restore(&actions);
        Search { jets, responses, tuning: model.tuning() }
    }

    /// Variance of the weighted residuals when so many squares are left.
    pub(super) fn variance(&self, left: f64) -> f64 {
        (left / self.responses.rows.max(1) as f64).max(self.tuning.scan.least_variance)
    }

    /// The variance when the best of some terms is in the model.
    pub(super) fn best_variance(&self, terms: &[(Composed, f64)]) -> f64 {
        let most = terms.iter().map(|(_, fall)| *fall).fold(0.0, f64::max);
        self.variance(self.responses.squares - most)
    }

    /// Scores of some terms at the numbers that they have; what is not finite here is left out.
    pub(super) fn scored(&self, terms: Vec<Composed>) -> Vec<Found> {
        let mut terms = terms;
        terms.sort_by_key(|term| term.channels(&self.jets.few, self.responses.channels));
        let alike: Vec<&[Composed]> = terms
            .chunk_by(|a, b| {
                let of = |term: &Composed| term.channels(&self.jets.few, self.responses.channels);
                of(a) == of(b)
            })
            .flat_map(|group| group.chunks(TOGETHER))
            .collect();
        let of = |group: &&[Composed]| {
            let action = |term: &Composed| term.action(&self.jets.nodes, self.responses.channels);
            let actions: Vec<Action> = group.iter().map(action).collect();
            let falls: [f64; TOGETHER] = self.responses.falls(&actions);
            let found = group.iter().zip(actions.iter().zip(falls));
            let found =
                found.filter(|(_, (action, _))| action.values.iter().all(|x| x.is_finite()));
            found
                .map(|(term, (_, fall))| Found { fall, composed: term.clone() })
                .collect::<Vec<_>>()
        };
        alike.par_iter().flat_map_iter(of).collect()
    }
}
