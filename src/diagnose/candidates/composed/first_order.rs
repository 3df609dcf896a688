//! The numbers that a model takes to first order beside a set of changes.

use super::entries::Entry;
use super::found_set::FoundSet;
use super::gram::Pool;
use super::responses::Responses;
use crate::error::Result;
use crate::expr::{ParameterId, TermId};
use crate::fit::Law;
use crate::fit::column::Column;

/// One of the unknowns of a law.
#[derive(Clone, Copy)]
pub(super) enum Unknown {
    Coefficient(TermId),
    Inner(ParameterId),
}

/// The unknowns of a law at some columns.
pub(super) fn unknowns(law: &Law, columns: &[Column]) -> Vec<Unknown> {
    let dynamics = law.dynamics();
    let terms = dynamics.active().iter().map(|&id| Unknown::Coefficient(id));
    let inner = dynamics.parameters().iter().map(|&id| Unknown::Inner(id));
    let all: Vec<Unknown> = terms.chain(inner).collect();
    columns.iter().filter_map(|column| all.get(column.position()).copied()).collect()
}

/// A law with the numbers that its `unknowns` have to first order beside a set.
///
/// # Errors
///
/// When an unknown is not one of the law.
pub(super) fn first_order(
    responses: &Responses,
    pool: &Pool,
    entries: &[Entry],
    set: &FoundSet,
    law: &Law,
    unknowns: &[Unknown],
) -> Result<Law> {
    let coefficients = pool.coefficients(&set.members).unwrap_or_default();
    let mut added = responses.no_heights();
    for (&at, own) in set.members.iter().zip(coefficients) {
        for (coefficient, response) in own.iter().zip(&entries[at].responses) {
            added.axpy(*coefficient, &response.heights, 1.0);
        }
    }
    let mut moved = law.clone();
    for (place, change) in responses.unknowns_beside(&added) {
        match unknowns.get(place) {
            Some(&Unknown::Coefficient(id)) => {
                let value = law.coefficient(id).unwrap_or(0.0);
                moved = moved.with_term(id, value + change)?;
            }
            Some(&Unknown::Inner(id)) => {
                let bounds = law.system().parameter(id).map(|parameter| parameter.bounds);
                let value = law.parameter(id).zip(bounds);
                let value = value.map(|(value, bounds)| (id, bounds.clamp(value + change)));
                moved = moved.with_parameters(value);
            }
            None => {}
        }
    }
    Ok(moved)
}
