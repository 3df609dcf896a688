//! Terms of the function space that the fit left out: where something else was missing, or over
//! short segments, they did not pay.

use serde::Serialize;

use super::numbers::acts_on;
use super::{Candidate, Origin, one_of};
use crate::expr::{Extension, Place, Scope, Term};
use crate::fit::Law;
use crate::fit::own_values::is_said;

/// A term of a spec that its law does not have.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// Where it stands: T, V, H, a force.
    pub place: String,
    /// As the spec writes it.
    pub term: String,
    #[serde(skip)]
    at: Place,
}

impl LeftOut {
    /// Whether it is this term.
    pub(in crate::diagnose) fn is(&self, term: &Term) -> bool {
        term.place == self.at && term.label == self.term
    }
}

/// The terms of a spec that a law does not have; none where there are more of them than `most`.
pub fn left_out(scope: &Scope, law: &Law, most: usize) -> Vec<Candidate> {
    let system = &scope.compiled().system;
    let learned = |term: &Term| {
        law.terms().any(|(_, own, _)| own.label == term.label && own.place == term.place)
    };
    let terms = system.terms_with_ids();
    let terms = terms.filter(|(id, term)| !learned(term) && !is_said(system, *id));
    let mut all: Vec<Candidate> = terms
        .map(|(id, term)| {
            let place = system.place_name(term.place);
            let own = LeftOut { place, term: term.label.clone(), at: term.place };
            Candidate {
                label: format!("{} {}", own.place, own.term),
                on: acts_on(system, &system.graph, term),
                arguments: Vec::new(),
                extension: Extension::of_nothing(system),
                terms: vec![id],
                parameters: Vec::new(),
                grid: vec![Vec::new()],
                choice: 0.0,
                second: None,
                origin: Origin::LeftOut(own),
            }
        })
        .collect();
    if all.len() > most {
        all.clear();
    }
    one_of(&mut all);
    all
}
