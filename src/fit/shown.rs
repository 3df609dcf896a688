//! What columns show of a curve q(t), as functions of its places, velocities and accelerations.

use std::collections::HashMap;

use crate::data::Packed;
use crate::eval::{Backend, Evaluator, Inputs, compile};
use crate::expr::{Expr, Graph, Observed, Symbol, System};

/// A row of what is measured.
pub(super) struct Row {
    pub(super) observable: usize,
    pub(super) period: Option<f64>,
    /// One over the spread of the column.
    pub(super) weight: f64,
    /// Whether it shows rates.
    pub(super) of_rates: bool,
}

/// Everything measured as functions of a curve: its places, velocities and accelerations.
pub(super) struct Shown {
    /// Of every row its value, then its derivatives by the 3n components of the curve.
    pub(super) evaluator: Box<dyn Evaluator>,
    pub(super) rows: Vec<Row>,
    /// What drives beside the curve: the time, inputs and their rates.
    pub(super) driven: Vec<Symbol>,
    pub(super) parameters: Vec<f64>,
    pub(super) degrees: usize,
    /// Sizes from which searches start: 1, and what was measured.
    pub(super) sizes: Vec<f64>,
}

impl Shown {
    /// What the columns show of a system; `None` where nothing tells of a curve.
    pub(super) fn of(system: &System, parameters: &[f64], packed: &Packed) -> Option<Shown> {
        let n = system.degrees();
        let mut graph = system.graph.clone();
        let momenta = momenta(system, &mut graph, parameters);
        let mut rows = Vec::new();
        let mut values = Vec::new();
        let mut sizes = vec![1.0];
        for (observable, period) in system.periods().into_iter().enumerate() {
            let column = packed.column(observable);
            if system.is_hidden(observable) || !column.iter().any(|x| x.is_finite()) {
                continue;
            }
            let expr = match observable.checked_sub(2 * n) {
                Some(at) => system.measures.get(at).and_then(|measure| measure.on_curve),
                None if observable < n => Some(graph.symbol(Symbol::Coordinate(observable))),
                None => Some(match system.observed {
                    Observed::Velocities => graph.symbol(Symbol::Velocity(observable - n)),
                    Observed::Momenta => graph.symbol(Symbol::Momentum(observable - n)),
                }),
            };
            let Some(expr) = expr.map(|expr| graph.substitute(expr, &momenta)) else { continue };
            let symbols = graph.symbols(&[expr]);
            let unknown = |s: &Symbol| match s {
                Symbol::Coefficient(_) | Symbol::Momentum(_) => true,
                Symbol::Velocity(i) => *i >= 2 * n,
                _ => false,
            };
            if symbols.iter().any(unknown) {
                continue;
            }
            let of_rates = symbols.iter().any(|s| matches!(s, Symbol::Velocity(_)));
            let (spread, size) = spread(column);
            sizes.push(size);
            rows.push(Row { observable, period, weight: 1.0 / spread, of_rates });
            values.push(expr);
        }
        if rows.is_empty() {
            return None;
        }
        let curve: Vec<Symbol> =
            (0..n).map(Symbol::Coordinate).chain((0..2 * n).map(Symbol::Velocity)).collect();
        let mut outputs = values.clone();
        for &value in &values {
            outputs.extend(graph.gradient(value, &curve));
        }
        let mut driven = graph.symbols(&outputs);
        driven.retain(|symbol| symbol.is_of_time());
        let varying = curve.into_iter().chain(driven.iter().copied()).collect();
        let uniform = (0..parameters.len()).map(Symbol::Parameter).collect();
        let inputs = Inputs { varying, uniform };
        let evaluator = compile(&graph, &inputs, &outputs, Backend::default());
        let parameters = parameters.to_vec();
        Some(Shown { evaluator, rows, driven, parameters, degrees: n, sizes })
    }

    /// Number of coordinates.
    pub(super) fn degrees(&self) -> usize {
        self.degrees
    }
}

/// Momenta and their rates as velocities times masses at rest: a first guess needs no more.
fn momenta(system: &System, graph: &mut Graph, parameters: &[f64]) -> HashMap<Symbol, Expr> {
    let n = system.degrees();
    let energy = graph.sum(&[system.kinetic, system.hamiltonian]);
    let mut out = HashMap::new();
    for i in 0..n {
        let p = Symbol::Momentum(i);
        let slope = graph.derivative(energy, p);
        let inverse = graph.derivative(slope, p);
        let of = |symbol: Symbol| match symbol {
            Symbol::Parameter(j) => parameters.get(j).copied().unwrap_or(1.0),
            _ => 0.0,
        };
        let mass = 1.0 / graph.value(inverse, &of);
        let mass = if mass.is_finite() && mass != 0.0 { mass } else { 1.0 };
        for (momentum, velocity) in [(i, i), (n + i, n + i)] {
            let velocity = graph.symbol(Symbol::Velocity(velocity));
            out.insert(Symbol::Momentum(momentum), graph.scale(mass, velocity));
        }
    }
    out
}

/// Standard deviation and root mean square of a column.
fn spread(column: &[f64]) -> (f64, f64) {
    let all = || column.iter().copied().filter(|x| x.is_finite());
    let count = all().count().max(1) as f64;
    let mean = all().sum::<f64>() / count;
    let square = all().map(|x| x * x).sum::<f64>() / count;
    let spread = (square - mean * mean).max(0.0).sqrt();
    let size = square.sqrt();
    (if spread > 1e-9 * size { spread } else { size.max(f64::MIN_POSITIVE) }, size)
}
