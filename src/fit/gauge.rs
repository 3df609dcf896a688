//! The scale of the momenta, which no measurement of motion alone can tell.
//!
//! Where momenta are never measured and nothing of H and of the forces is known, H and all
//! momenta may be multiplied by one number and every coordinate and velocity stays as it is.
//! The fit then needs a unit of mass: the first pure square p_i^2 of T gets the coefficient 1/2.

use std::sync::Arc;

use super::model::{LearnedTerm, Model, place_name};
use crate::data::Dataset;
use crate::expr::{Observed, Place, Symbol, System, Term, TermId};

/// Coefficient of the square that sets the scale: a unit mass.
const UNIT_MASS: f64 = 0.5;

/// A system whose open scale was settled.
pub(super) struct SettledScale {
    /// The system with the term moved to the known part.
    pub system: Arc<System>,
    /// The term of the original function space.
    term: TermId,
    /// Its coefficient.
    coefficient: f64,
}

/// Settles the scale of the momenta, if it is open and T has a pure square.
pub(super) fn settle_scale(system: &System, dataset: &Dataset) -> Option<SettledScale> {
    let degrees = system.degrees();
    let seen = |row: usize| {
        let cells = dataset.runs.iter().filter_map(|run| run.values.get(row)).flatten();
        cells.into_iter().any(|x| x.is_finite())
    };
    let momenta = system.observed == Observed::Momenta && (degrees..2 * degrees).any(seen);
    let known = [system.kinetic, system.potential, system.hamiltonian];
    let nothing = |expr| system.graph.symbols(&[expr]).is_empty();
    let open = known.into_iter().all(nothing)
        && system.forces.iter().all(|&force| system.graph.is_zero(force));
    if momenta || !open {
        return None;
    }
    let term = square(system)?;
    let mut settled = system.clone();
    let removed = settled.terms.remove(term.position());
    let coefficient = removed.bounds.clamp(UNIT_MASS);
    settled.kinetic = settled.graph.scale(coefficient, removed.expr);
    Some(SettledScale { system: Arc::new(settled), term, coefficient })
}

/// The first term of T that is the square of a momentum.
fn square(system: &System) -> Option<TermId> {
    let mut graph = system.graph.clone();
    let squares: Vec<_> = (0..system.degrees())
        .map(|i| {
            let p = graph.symbol(Symbol::Momentum(i));
            graph.power(p, 2.0)
        })
        .collect();
    let square = |term: &Term| term.place == Place::Kinetic && squares.contains(&term.expr);
    system.terms_where(square).first().copied()
}

/// Velocities alone leave the scale of the momenta open; unit masses settle it, as a first guess.
pub(super) fn unit_masses(system: &System) -> Vec<(TermId, f64)> {
    if system.observed != Observed::Velocities {
        return Vec::new();
    }
    let graph = &mut system.graph.clone();
    let mut squares = Vec::new();
    for i in 0..system.degrees() {
        let p = graph.symbol(Symbol::Momentum(i));
        squares.push(graph.power(p, 2.0));
    }
    let square = |term: &Term| term.place == Place::Kinetic && squares.contains(&term.expr);
    let terms = system.terms_with_ids().filter(|(_, term)| square(term));
    terms.map(|(id, term)| (id, term.bounds.clamp(UNIT_MASS))).collect()
}

impl SettledScale {
    /// Puts the term back into a model of the settled system, so that it is one of `original`.
    pub(super) fn restore(&self, original: &System, model: &mut Model) {
        let Some(term) = original.term(self.term) else { return };
        model.terms.insert(
            0,
            LearnedTerm {
                place: place_name(original, term.place),
                term: term.label.clone(),
                name: term.name.clone(),
                coefficient: self.coefficient,
                standard_error: 0.0,
                inclusion: 1.0,
                unit: term.unit_text.clone(),
            },
        );
        for row in &mut model.covariance {
            row.insert(0, 0.0);
        }
        model.covariance.insert(0, vec![0.0; model.covariance.len() + 1]);
        model.evidence.function_space += 1;
        model.fingerprint = super::model::fingerprint(original);
        model.unlearnable.insert(
            0,
            format!(
                "the overall scale of H: momenta are not measured and no part of H is known, so \
                 the coefficient of `{}` was set to {} as a unit of mass; make it known to fix \
                 the scale",
                term.label, self.coefficient
            ),
        );
    }
}
