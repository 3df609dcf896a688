//! Terms of a model that idle beside a set of changes.
//!
//! A set is chosen beside all terms of the model, whatever it leaves to them. One that takes over
//! what some of them stood for says more in fewer numbers: what these cost is saved.

use nalgebra::{DMatrix, DVector};

use super::entries::Entry;
use super::first_order::Unknown;
use super::found_set::FoundSet;
use super::gram::Pool;
use super::responses::Responses;
use crate::fit::Law;
use crate::fit::own_values::may_be_left_out;

/// Some sets without the terms of a law that idle beside them, the best first.
pub(super) fn without_idle_terms(
    found: Vec<FoundSet>,
    (responses, pool, entries): (&Responses, &Pool, &[Entry]),
    law: &Law,
    unknowns: &[Unknown],
) -> Vec<FoundSet> {
    let open: Vec<Option<f64>> = unknowns
        .iter()
        .map(|unknown| match *unknown {
            Unknown::Coefficient(id) if may_be_left_out(law.system(), id) => law.coefficient(id),
            _ => None,
        })
        .collect();
    let shortened = |one: FoundSet| match beside(&one, (responses, pool, entries), &open) {
        Some(terms) => shortest(one, terms, pool),
        None => one,
    };
    let mut all: Vec<FoundSet> = found.into_iter().map(shortened).collect();
    all.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.members.cmp(&b.members)));
    all
}

/// Coefficients of a model's terms beside a set, to first order.
struct Terms {
    values: DVector<f64>,
    /// Their covariances beside noise of variance 1.
    covariances: DMatrix<f64>,
    /// Those that may be left out.
    open: Vec<usize>,
}

/// The unknowns of a model beside a set; of those that may be left out the values are given.
fn beside(
    set: &FoundSet,
    (responses, pool, entries): (&Responses, &Pool, &[Entry]),
    open: &[Option<f64>],
) -> Option<Terms> {
    let coefficients = pool.coefficients(&set.members)?;
    let mut added = responses.no_heights();
    let mut columns: Vec<DVector<f64>> = Vec::new();
    for (&at, own) in set.members.iter().zip(coefficients) {
        for (coefficient, response) in own.iter().zip(&entries[at].responses) {
            added.axpy(*coefficient, &response.heights, 1.0);
            columns.push(response.heights.clone());
        }
    }
    let changes = responses.unknowns_beside(&added);
    let size = changes.len();
    let mut spread = DMatrix::identity(size, size);
    if !columns.is_empty() {
        let shadows = pool.orthonormal(&set.members, &DMatrix::from_columns(&columns))?;
        spread = spread.resize_horizontally(size + shadows.ncols(), 0.0);
        spread.columns_mut(size, shadows.ncols()).copy_from(&shadows);
    }
    let spread = responses.by_basis().solve_upper_triangular(&spread)?;
    let value = |&(place, change): &(usize, f64)| Some(open.get(place).copied()?? + change);
    let values: Vec<Option<f64>> = changes.iter().map(value).collect();
    Some(Terms {
        values: DVector::from_iterator(size, values.iter().map(|value| value.unwrap_or(0.0))),
        covariances: &spread * spread.transpose(),
        open: (0..size).filter(|&at| values[at].is_some()).collect(),
    })
}

/// A set without the terms that cost more than they take off the squares, the least first.
fn shortest(mut set: FoundSet, mut terms: Terms, pool: &Pool) -> FoundSet {
    let (mut more, mut dropped) = (0.0, 0);
    loop {
        let gain = |&at: &usize| terms.values[at].powi(2) / terms.covariances[(at, at)];
        let least = terms.open.iter().copied().min_by(|a, b| gain(a).total_cmp(&gain(b)));
        let Some(at) = least else { return set };
        more += gain(&at);
        dropped += 1;
        let Some(cost) = pool.cost_without(&set.members, more, dropped) else { return set };
        if cost >= set.cost {
            return set;
        }
        set.saved += set.cost - cost;
        set.cost = cost;
        // The others as they are where this one is nothing.
        let column = terms.covariances.column(at) / terms.covariances[(at, at)];
        let row = terms.covariances.row(at).clone_owned();
        terms.values.axpy(-terms.values[at], &column, 1.0);
        terms.covariances -= &column * row;
        terms.open.retain(|&one| one != at);
    }
}
