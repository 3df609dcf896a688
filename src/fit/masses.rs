//! First guesses of masses where momenta are not measured and a known force sets their scale.
//!
//! Of p' = K - sum of c_k psi_k with p = m q' the weak form over a window, with a weight w that
//! vanishes at its ends with its derivative, is m int w'' q = int w K - sum of c_k int w psi_k:
//! linear in the mass and the coefficients, and free of derivatives of what was measured (Messenger
//! and Bortz, J. Comput. Phys. 443, 2021). It is a start for the fit and no more.

use nalgebra::{DMatrix, DVector};

use super::tuning::MassTuning;
use crate::data::Packed;
use crate::eval::{Backend, Inputs, compile};
use crate::expr::{Expr, Graph, Observed, Place, Symbol, System, Term, TermId};

/// Coefficients 1/(2 m) of the squares p_i^2 that are learned, where something known tells them.
pub(super) fn first_masses(
    system: &System,
    measured: &Packed,
    tuning: &MassTuning,
) -> Vec<(TermId, f64)> {
    let n = system.degrees();
    let seen = |row: usize| measured.column(row).iter().any(|x| x.is_finite());
    if system.observed == Observed::Velocities {
        return Vec::new();
    }
    if (n..2 * n).any(seen) || !(0..n).all(seen) {
        return Vec::new();
    }
    (0..n).filter_map(|i| first_mass(system, measured, i, tuning)).collect()
}

/// The same of one coordinate.
fn first_mass(
    system: &System,
    measured: &Packed,
    i: usize,
    tuning: &MassTuning,
) -> Option<(TermId, f64)> {
    let mut graph = system.graph.clone();
    let momentum = Symbol::Momentum(i);
    let square = {
        let p = graph.symbol(momentum);
        graph.power(p, 2.0)
    };
    let is_square = |term: &Term| term.place == Place::Kinetic && term.expr == square;
    let (id, term) = system.terms_with_ids().find(|(_, term)| is_square(term))?;
    let energy = graph.sum(&[system.kinetic, system.potential, system.hamiltonian]);
    if graph.depends_on(energy, momentum) || system.terms.len() > tuning.terms {
        return None;
    }
    // K, then the columns of the terms.
    let slope = graph.derivative(energy, Symbol::Coordinate(i));
    let mut outputs = vec![graph.subtract(system.forces[i], slope)];
    for term in &system.terms {
        let push = pushes(&mut graph, term, i);
        if !graph.is_zero(push) {
            outputs.push(push);
        }
    }
    if graph.is_zero(outputs[0]) {
        return None;
    }
    let forces = Forces::new(system, &graph, &outputs);
    let of_length = |&length: &usize| {
        let mut rows = Vec::new();
        for (run, first) in windows(measured, length, tuning) {
            rows.push(forces.weak_row(measured, run, first, length, i)?);
        }
        explained(&rows)
    };
    let found = tuning.lengths.iter().filter_map(of_length).max_by(|a, b| a.0.total_cmp(&b.0));
    let (part, mass) = found?;
    let sound = part > tuning.explained && mass.is_finite() && mass > 0.0;
    sound.then(|| (id, term.bounds.clamp(0.5 / mass)))
}

/// What a unit coefficient of a term does to dp_i/dt.
pub(crate) fn pushes(graph: &mut Graph, term: &Term, i: usize) -> Expr {
    let mut parts = Vec::new();
    for (place, expr) in term.parts() {
        match place {
            Place::Force(j) if j == i => parts.push((1.0, expr)),
            place if place.is_energy() => {
                parts.push((-1.0, graph.derivative(expr, Symbol::Coordinate(i))));
            }
            _ => {}
        }
    }
    graph.linear(0.0, &parts)
}

/// Mass and coefficients by least squares: the part of the known force that they explain, and the
/// mass.
fn explained(rows: &[Vec<f64>]) -> Option<(f64, f64)> {
    let columns = rows.first()?.len() - 1;
    if rows.len() < 2 * columns + 2 {
        return None;
    }
    // Columns are brought to one size: coordinates in nanometres are none.
    let norm = |k: usize| rows.iter().map(|row| row[k] * row[k]).sum::<f64>().sqrt();
    let norms: Vec<f64> = (0..=columns).map(norm).collect();
    let (of_mass, of_known) = (norms[0], norms[columns]);
    if of_mass.is_nan() || of_mass <= 0.0 || of_known.is_nan() || of_known <= 0.0 {
        return None;
    }
    let scaled = |r: usize, k: usize| if norms[k] > 0.0 { rows[r][k] / norms[k] } else { 0.0 };
    let matrix = DMatrix::from_fn(rows.len(), columns, scaled);
    let known = DVector::from_fn(rows.len(), |r, _| rows[r][columns] / of_known);
    // Directions that are rounding of columns of norm one are left out.
    let solved = matrix.clone().svd(true, true).solve(&known, 1e-9).ok()?;
    let left = (known - matrix * &solved).norm_squared();
    let part = 1.0 - left * rows.len() as f64 / (rows.len() - columns) as f64;
    Some((part, solved[0] * of_known / of_mass))
}

/// First samples of windows of a length, without a hole, spread over all runs.
pub(crate) fn windows(
    measured: &Packed,
    length: usize,
    tuning: &MassTuning,
) -> Vec<(usize, usize)> {
    let typical = measured.typical_step();
    let whole = |run: usize, first: usize| {
        let times = &measured.times_of(run)[first..first + length];
        times.windows(2).all(|pair| pair[1] - pair[0] <= tuning.hole * typical)
    };
    let all: usize = (0..measured.runs())
        .map(|run| (measured.times_of(run).len() + 1).saturating_sub(length))
        .sum();
    let stride = (all / tuning.windows.max(1)).max(length / 3).max(1);
    let mut found = Vec::new();
    for run in 0..measured.runs() {
        let last = (measured.times_of(run).len() + 1).saturating_sub(length);
        found.extend((0..last).step_by(stride).filter(|&at| whole(run, at)).map(|at| (run, at)));
    }
    found.truncate(4 * tuning.windows);
    found
}

/// The known force and what the terms push with, along what was measured.
struct Forces {
    evaluator: Box<dyn crate::eval::Evaluator>,
    symbols: Vec<Symbol>,
    parameters: Vec<f64>,
    degrees: usize,
}

impl Forces {
    fn new(system: &System, graph: &Graph, outputs: &[Expr]) -> Forces {
        let symbols: Vec<Symbol> = (graph.symbols(outputs).into_iter())
            .filter(|symbol| !matches!(symbol, Symbol::Parameter(_) | Symbol::Coefficient(_)))
            .collect();
        let uniform = (0..system.parameters.len()).map(Symbol::Parameter).collect();
        let inputs = Inputs { varying: symbols.clone(), uniform };
        Forces {
            evaluator: compile(graph, &inputs, outputs, Backend::default()),
            symbols,
            parameters: system.parameters.iter().map(|p| p.bounds.clamp(p.start)).collect(),
            degrees: system.degrees(),
        }
    }

    /// int w'' q, -int w psi_k and int w K over one window; momenta are velocities here.
    fn weak_row(
        &self,
        measured: &Packed,
        run: usize,
        first: usize,
        length: usize,
        i: usize,
    ) -> Option<Vec<f64>> {
        let times = &measured.times_of(run)[first..first + length];
        let of = |row: usize| &measured.values_of(row, run)[first..first + length];
        let mut points = Vec::with_capacity(self.symbols.len() * length);
        for &symbol in &self.symbols {
            match symbol {
                Symbol::Coordinate(j) => points.extend_from_slice(of(j)),
                Symbol::Momentum(j) => points.extend(velocities(times, of(j))),
                Symbol::Input(input, order) => {
                    let mut out = vec![0.0; measured.driven().1];
                    for at in first..first + length {
                        measured.driving(input, run, at, at + 1 == first + length, &mut out);
                        let factorial: f64 = (1..=order).map(|k| k as f64).product();
                        points.push(out.get(order).copied().unwrap_or(0.0) * factorial);
                    }
                }
                Symbol::Delayed(input, order, by) => {
                    // A delay that is looked for is left out of a first guess.
                    let by = by.number().unwrap_or(0.0);
                    let at = |&t: &f64| measured.record().input_at(input, order, run, t - by);
                    points.extend(times.iter().map(at));
                }
                _ => points.extend(times.iter().map(|&t| measured.clock_of(run).time(t))),
            }
        }
        let mut out = vec![0.0; self.evaluator.outputs() * length];
        self.evaluator.evaluate(&points, &self.parameters, length, &mut out, &mut Vec::new());
        let mut row = vec![0.0; self.evaluator.outputs() + 1];
        let (start, span) = (times[0], times[length - 1] - times[0]);
        let known = row.len() - 1;
        debug_assert!(i < self.degrees);
        for (at, q) in of(i).iter().enumerate().filter(|(_, q)| q.is_finite()) {
            let before = if at > 0 { times[at] - times[at - 1] } else { 0.0 };
            let after = if at + 1 < length { times[at + 1] - times[at] } else { 0.0 };
            let (weight, bend) = bump(2.0 * (times[at] - start) / span - 1.0);
            let share = 0.5 * (before + after);
            row[0] += share * bend * 4.0 / (span * span) * q;
            for (k, value) in out.chunks_exact(length).enumerate() {
                let into = if k == 0 { known } else { k };
                let sign = if k == 0 { 1.0 } else { -1.0 };
                row[into] += sign * share * weight * value[at];
            }
        }
        row.iter().all(|x| x.is_finite()).then_some(row)
    }
}

/// (1 - s^2)^4 and its second derivative.
pub(crate) fn bump(s: f64) -> (f64, f64) {
    let inside = 1.0 - s * s;
    (inside.powi(4), 48.0 * s * s * inside.powi(2) - 8.0 * inside.powi(3))
}

/// Velocities by differences over both neighbours.
pub(crate) fn velocities(times: &[f64], values: &[f64]) -> Vec<f64> {
    let last = times.len() - 1;
    let of = |at: usize| {
        let (a, b) = (at.saturating_sub(1), (at + 1).min(last));
        (values[b] - values[a]) / (times[b] - times[a])
    };
    (0..=last).map(of).collect()
}
