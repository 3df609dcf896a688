//! Sets of changes that are proposed to be fitted, and the motions that they are proposed around.

use super::entries::Change;
use crate::diagnose::candidates::InnerRange;
use crate::diagnose::effect::RankedEffect;
use crate::diagnose::law_on_data::LawOnData;
use crate::fit::Law;
use crate::fit::column::Column;

/// One member of a proposed set.
#[derive(Clone)]
pub struct Proposed {
    /// What it is, with first values of its numbers.
    pub effect: RankedEffect,
    /// Inner numbers among its coefficients: the last so many.
    pub inner: usize,
    /// How far these may go.
    pub ranges: Vec<InnerRange>,
    /// What its numbers and the choice among all members cost, in nats.
    pub price: f64,
    /// Whether it has a name.
    pub named: bool,
    /// Whether that name says that no coefficient is negative.
    pub positive: bool,
    pub(super) change: Change,
    /// Its place in the list of candidates, composed terms behind them.
    pub(super) kind: usize,
}

/// A set that is to be fitted in full.
#[derive(Clone)]
pub struct ProposedSet {
    /// Its members.
    pub members: Vec<Proposed>,
    /// The model as it is, with the numbers that it has beside them to first order.
    pub law: Law,
    /// Twice the nats of its description, to first order.
    pub cost: f64,
    /// What of that is saved by terms of the model that idle beside it.
    pub saved: f64,
    /// Whether it is there for what it leaves, however long its description is: what the data do
    /// not tell from the best is to be named beside it.
    pub rival: bool,
}

impl ProposedSet {
    /// The set without one of its members.
    pub fn without(mut self, place: usize) -> ProposedSet {
        self.members.remove(place);
        self
    }

    /// Places of its members in the list of candidates, composed terms behind them, in order.
    pub fn places(&self) -> Vec<usize> {
        let mut places: Vec<usize> = self.members.iter().map(|one| one.kind).collect();
        places.sort_unstable();
        places
    }
}

/// A motion that candidates are judged around.
pub struct Around<'a> {
    /// A model with some changes, over segments that it follows.
    pub model: LawOnData<'a>,
    /// The changes.
    pub changes: Vec<Placed>,
    /// Whether it leaves noise.
    pub explains: bool,
}

/// A change of a model.
pub struct Placed {
    /// What it was proposed as.
    pub proposed: Proposed,
    /// All of its numbers: coefficients, then inner ones.
    pub numbers: Vec<f64>,
    /// Their columns among those of the model.
    pub columns: Vec<Column>,
}
