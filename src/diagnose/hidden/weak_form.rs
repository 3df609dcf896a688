//! What is left of the force on a coordinate, in weak form along the measured motion.
//!
//! With p = m q' and p' = K + sum of c_k psi_k a weight w that vanishes at the ends of a window
//! with its derivative gives m int w'' q = int w K + sum of c_k int w psi_k, which is linear in the
//! mass and the coefficients and free of derivatives of what was measured (Messenger and Bortz,
//! J. Comput. Phys. 443, 2021).

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::data::Packed;
use crate::diagnose::law_on_data::LawOnData;
use crate::eval::{Backend, Inputs, compile};
use crate::expr::{Expr, Observed, Place, Symbol, System};
use crate::fit::Law;
use crate::fit::masses::{bump, pushes, velocities, windows};

/// The measured motion of all runs, momenta from velocities where they were not measured.
pub(super) struct MeasuredMotion<'a> {
    pub(super) law: &'a Law,
    pub(super) packed: &'a Packed,
    tuning: &'a crate::fit::tuning::MassTuning,
    masses: Vec<f64>,
    /// `[run][q, then p][sample]`
    states: Vec<Vec<Vec<f64>>>,
}

/// What stands in a column of the weak form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Column {
    /// The mass of the coordinate.
    Mass,
    /// The coefficient of a term of the model, by its position.
    Term(usize),
}

/// The weak form of one coordinate over windows of one length.
pub(super) struct WeakForm {
    /// Run and first sample of every window.
    pub(super) windows: Vec<(usize, usize)>,
    pub(super) length: usize,
    /// Weight of every sample, `[window][sample]`.
    pub(super) weights: Vec<Vec<f64>>,
    pub(super) names: Vec<Column>,
    /// `[column][window]`
    pub(super) columns: Vec<Vec<f64>>,
    pub(super) target: Vec<f64>,
}

impl<'a> MeasuredMotion<'a> {
    /// `None` where a coordinate or the law's masses are not known.
    pub(super) fn of(model: &'a LawOnData) -> Option<MeasuredMotion<'a>> {
        let system = model.system();
        let n = system.degrees();
        let packed = &*model.data.packed;
        let masses = model.law.masses()?;
        let seen = |row: usize| packed.column(row).iter().any(|x| x.is_finite());
        // What measures tell of a coordinate is no column of it.
        let known = |i: usize| seen(i) || system.is_hidden(i);
        if !system.measures.is_empty() && !(0..n).all(known) {
            return None;
        }
        let by_momenta = system.observed == Observed::Momenta;
        let state = |run: usize| -> Vec<Vec<f64>> {
            let times = packed.times_of(run);
            let coordinates = (0..n).map(|i| packed.values_of(i, run).to_vec());
            let momenta = (0..n).map(|i| match seen(n + i) {
                true if by_momenta => packed.values_of(n + i, run).to_vec(),
                true => packed.values_of(n + i, run).iter().map(|v| v * masses[i]).collect(),
                false if times.len() < 2 => vec![f64::NAN; times.len()],
                false => {
                    let values = velocities(times, packed.values_of(i, run));
                    values.into_iter().map(|v| v * masses[i]).collect()
                }
            });
            coordinates.chain(momenta).collect()
        };
        let states = (0..packed.runs()).map(state).collect();
        let tuning = &model.options.fit.masses;
        Some(MeasuredMotion { law: &model.law, packed, tuning, masses, states })
    }

    fn system(&self) -> &System {
        self.law.system()
    }

    /// Lengths of windows, in samples.
    pub(super) fn lengths(&self) -> &[usize] {
        &self.tuning.lengths
    }

    /// A component of the state, an input or the time at samples of a run.
    pub(super) fn values(&self, symbol: Symbol, run: usize, samples: Range<usize>) -> Vec<f64> {
        let n = self.system().degrees();
        let times = self.packed.times_of(run);
        let state = |row: usize| match self.states[run].get(row) {
            Some(values) => values[samples.clone()].to_vec(),
            None => vec![f64::NAN; samples.len()],
        };
        match symbol {
            Symbol::Coordinate(i) => state(i),
            Symbol::Momentum(i) => state(n + i),
            Symbol::Input(input, order) => {
                let mut out = vec![0.0; self.packed.driven().1];
                let factorial: f64 = (1..=order).map(|k| k as f64).product();
                let mut at = |sample: usize| {
                    self.packed.driving(input, run, sample, sample + 1 == times.len(), &mut out);
                    out.get(order).copied().unwrap_or(0.0) * factorial
                };
                samples.map(&mut at).collect()
            }
            Symbol::Delayed(input, order, by) => {
                let by = by.number_or(self.law.parameters());
                let at = |&t: &f64| self.packed.record().input_at(input, order, run, t - by);
                times[samples].iter().map(at).collect()
            }
            _ => times[samples].iter().map(|&t| self.packed.clock_of(run).time(t)).collect(),
        }
    }

    /// The weak form of coordinate i; `None` with too few windows.
    pub(super) fn weak_form(&self, i: usize, length: usize, most: usize) -> Option<WeakForm> {
        let system = self.system();
        let mut graph = system.graph.clone();
        let known = graph.sum(&[system.kinetic, system.potential, system.hamiltonian]);
        let slope = graph.derivative(known, Symbol::Coordinate(i));
        let mut outputs: Vec<Expr> = vec![graph.subtract(system.forces[i], slope)];
        let momentum = graph.symbol(Symbol::Momentum(i));
        let square = graph.power(momentum, 2.0);
        let few = system.terms.len() <= most;
        let mut names = Vec::new();
        let mut mass = None;
        for (k, term) in system.terms.iter().enumerate() {
            if !few && self.law.coefficient(system.term_ids()[k]).is_none() {
                continue;
            }
            if term.place == Place::Kinetic && term.expr == square {
                mass = Some(k);
                continue;
            }
            let push = pushes(&mut graph, term, i);
            if !graph.is_zero(push) {
                outputs.push(push);
                names.push(Column::Term(k));
            }
        }
        // What is known sets the scale of the momenta; without it the mass stays as it is.
        let free = mass.is_some() && !graph.is_zero(outputs[0]);
        let symbols: Vec<Symbol> = (graph.symbols(&outputs).into_iter())
            .filter(|symbol| !matches!(symbol, Symbol::Parameter(_) | Symbol::Coefficient(_)))
            .collect();
        let uniform = (0..system.parameters.len()).map(Symbol::Parameter).collect();
        let inputs = Inputs { varying: symbols.clone(), uniform };
        let evaluator = compile(&graph, &inputs, &outputs, Backend::default());
        let mut form = WeakForm {
            windows: Vec::new(),
            length,
            weights: Vec::new(),
            columns: vec![Vec::new(); names.len()],
            names,
            target: Vec::new(),
        };
        let mut masses = Vec::new();
        for (run, first) in windows(self.packed, length, self.tuning) {
            let samples = first..first + length;
            let values = |symbol: &Symbol| self.values(*symbol, run, samples.clone());
            let points: Vec<f64> = symbols.iter().flat_map(values).collect();
            let mut out = vec![0.0; evaluator.outputs() * length];
            evaluator.evaluate(&points, self.law.parameters(), length, &mut out, &mut Vec::new());
            let (weights, bends) = weights(&self.packed.times_of(run)[samples.clone()]);
            let integral =
                |values: &[f64]| -> f64 { weights.iter().zip(values).map(|(w, x)| w * x).sum() };
            let q = &self.packed.values_of(i, run)[samples];
            let bent: f64 = bends.iter().zip(q).map(|(w, x)| w * x).sum();
            let mut all = out.chunks_exact(length).map(integral);
            let known = all.next().unwrap_or(f64::NAN);
            let columns: Vec<f64> = all.collect();
            if !(bent.is_finite() && known.is_finite() && columns.iter().all(|x| x.is_finite())) {
                continue;
            }
            form.windows.push((run, first));
            form.weights.push(weights);
            form.columns.iter_mut().zip(columns).for_each(|(column, x)| column.push(-x));
            masses.push(bent);
            form.target.push(if free { known } else { known - self.masses[i] * bent });
        }
        if free {
            form.names.push(Column::Mass);
            form.columns.push(masses);
        }
        (form.windows.len() > 2 * form.columns.len() + 4).then_some(form)
    }
}

/// Weights of samples in the integral of w f, and in that of w'' f.
fn weights(times: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let last = times.len() - 1;
    let (start, span) = (times[0], times[last] - times[0]);
    let of = |at: usize| {
        let before = if at > 0 { times[at] - times[at - 1] } else { 0.0 };
        let after = if at < last { times[at + 1] - times[at] } else { 0.0 };
        let (weight, bend) = bump(2.0 * (times[at] - start) / span - 1.0);
        let share = 0.5 * (before + after);
        (share * weight, share * bend * 4.0 / (span * span))
    };
    (0..=last).map(of).unzip()
}

impl WeakForm {
    /// The integral of a function over each window; `of` gives its values over a run.
    pub(super) fn integrals<'v>(&self, of: impl Fn(usize) -> Option<&'v [f64]>) -> Vec<f64> {
        let windows = self.windows.iter().zip(&self.weights);
        let integral = |((run, first), weights): (&(usize, usize), &Vec<f64>)| {
            let Some(values) = of(*run) else { return 0.0 };
            let values = &values[*first..first + self.length];
            weights.iter().zip(values).map(|(w, x)| w * x).sum()
        };
        windows.map(integral).collect()
    }

    /// Least squares with further columns: what is left for each window beyond the unknowns, and
    /// all coefficients. `None` where a column is not finite.
    pub(super) fn solve(&self, more: &[Vec<f64>]) -> Option<(f64, Vec<f64>)> {
        let columns: Vec<&Vec<f64>> = self.columns.iter().chain(more).collect();
        least_squares(&columns, &self.target)
    }
}

/// Mean square of what columns leave of a target, for each row beyond the unknowns, and their
/// coefficients. Columns are brought to one size; directions that are rounding are left out.
pub(super) fn least_squares(columns: &[&Vec<f64>], target: &[f64]) -> Option<(f64, Vec<f64>)> {
    let rows = target.len();
    let free = rows.checked_sub(columns.len()).filter(|free| *free > 0)? as f64;
    let norm = |column: &Vec<f64>| column.iter().map(|x| x * x).sum::<f64>().sqrt();
    let norms: Vec<f64> = columns.iter().map(|column| norm(column)).collect();
    if norms.iter().any(|norm| !norm.is_finite()) {
        return None;
    }
    let known = DVector::from_column_slice(target);
    if columns.is_empty() {
        return Some((known.norm_squared() / free, Vec::new()));
    }
    let scaled = |r: usize, k: usize| if norms[k] > 0.0 { columns[k][r] / norms[k] } else { 0.0 };
    let matrix = DMatrix::from_fn(rows, columns.len(), scaled);
    let solved = matrix.clone().svd(true, true).solve(&known, 1e-10).ok()?;
    let left = (known - matrix * &solved).norm_squared() / free;
    let values = solved.iter().zip(&norms);
    let values = values.map(|(x, norm)| if *norm > 0.0 { x / norm } else { 0.0 });
    Some((left, values.collect()))
}
