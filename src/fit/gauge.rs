//! The scale of the momenta, which no measurement of motion alone can tell.
//!
//! Where momenta are never measured and nothing of H and of the forces is known, H and all
//! momenta may be multiplied by one number and every coordinate and velocity stays as it is.
//! The fit then needs a unit of mass: the first pure square p_i^2 of T gets the coefficient 1/2.

use std::collections::HashMap;
use std::sync::Arc;

use super::model::{LearnedTerm, Model, place_name};
use crate::data::{Dataset, Packed};
use crate::expr::{Measure, Observed, Place, Symbol, System, TermId};

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
    // A measure that names a momentum shows it.
    let names_momentum = |measure: &Measure| {
        let on_curve = measure.on_curve.map(|expr| system.graph.symbols(&[expr]));
        on_curve.is_some_and(|symbols| symbols.iter().any(|s| matches!(s, Symbol::Momentum(_))))
    };
    let momenta = system.observed == Observed::Momenta && (degrees..2 * degrees).any(seen)
        || system.measures.iter().any(names_momentum);
    if momenta { None } else { settle(system) }
}

/// The system that is left where the scale is open and momenta are not measured.
pub(super) fn unit_mass(system: &System) -> Option<System> {
    settle(system).map(|settled| System::clone(&settled.system))
}

/// Settles the scale, whatever is measured.
fn settle(system: &System) -> Option<SettledScale> {
    let known = [system.kinetic, system.potential, system.hamiltonian];
    let nothing = |expr| system.graph.symbols(&[expr]).is_empty();
    let open = known.into_iter().all(nothing)
        && system.forces.iter().all(|&force| system.graph.is_zero(force));
    if !open {
        return None;
    }
    let term = square(system)?;
    let mut settled = system.clone();
    let removed = settled.terms.remove(term.position());
    let coefficient = removed.bounds.clamp(UNIT_MASS);
    settle_in_sensors(&mut settled, term.position(), coefficient);
    settled.kinetic = settled.graph.scale(coefficient, removed.expr);
    Some(SettledScale { system: Arc::new(settled), term, coefficient })
}

/// Rates that sensors name hold coefficients, by the places of their terms.
fn settle_in_sensors(system: &mut System, removed: usize, coefficient: f64) {
    let System { graph, sensors, terms, .. } = system;
    let mut moved = HashMap::new();
    moved.insert(Symbol::Coefficient(removed), graph.number(coefficient));
    for k in removed..terms.len() {
        moved.insert(Symbol::Coefficient(k + 1), graph.symbol(Symbol::Coefficient(k)));
    }
    for sensor in sensors {
        *sensor = graph.substitute(*sensor, &moved);
    }
}

/// The first term of T that is the square of a momentum.
fn square(system: &System) -> Option<TermId> {
    squares(system, |_| true).first().copied()
}

/// Velocities alone leave the scale of the momenta open, and so do coordinates alone; unit masses
/// settle it, as a first guess.
pub(super) fn unit_masses(system: &System, measured: &Packed) -> Vec<(TermId, f64)> {
    let ids = match system.observed {
        Observed::Velocities => squares(system, |_| true),
        _ => unseen_squares(system, measured),
    };
    let unit = |id| Some((id, system.term(id)?.bounds.clamp(UNIT_MASS)));
    ids.into_iter().filter_map(unit).collect()
}

/// The squares of momenta that nobody measures, where nothing else is known to move the
/// coordinate: without its own, what pulls at it would have no effect at all.
pub(super) fn unseen_squares(system: &System, measured: &Packed) -> Vec<TermId> {
    let degrees = system.degrees();
    if system.observed == Observed::Velocities {
        return Vec::new();
    }
    let known = [system.kinetic, system.hamiltonian];
    let known = system.graph.symbols(&known);
    let seen = |row: usize| measured.column(row).iter().any(|x| x.is_finite());
    squares(system, |i| seen(i) && !seen(degrees + i) && !known.contains(&Symbol::Momentum(i)))
}

/// Terms of T that are the squares of some momenta.
fn squares(system: &System, of: impl Fn(usize) -> bool) -> Vec<TermId> {
    let mut graph = system.graph.clone();
    let momenta = (0..system.degrees()).filter(|&i| of(i)).map(Symbol::Momentum);
    let squares: Vec<_> = momenta
        .map(|momentum| {
            let p = graph.symbol(momentum);
            graph.power(p, 2.0)
        })
        .collect();
    system.terms_where(|term| term.place == Place::Kinetic && squares.contains(&term.expr))
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
                inclusion: Some(1.0),
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
