//! Derivatives of the energy, and the forces beside them.

use crate::expr::{Expr, Graph, Place, Symbol, System};

/// g or v: n expressions, and for each the derivatives by the active coefficients.
#[derive(Clone)]
pub(super) struct Gradient {
    pub(super) rows: Vec<Expr>,
    pub(super) linear: Vec<Vec<(usize, Expr)>>,
}

impl Gradient {
    /// Derivatives of H by `symbols`. Terms are linear in their coefficients, so that every
    /// mixed derivative is the derivative of a term.
    pub(super) fn conservative(
        graph: &mut Graph,
        system: &System,
        active: &[usize],
        known: Expr,
        symbols: &[Symbol],
    ) -> Gradient {
        let mut conservative: Vec<usize> = Vec::new();
        let mut exprs = vec![known];
        for (unknown, &k) in active.iter().enumerate() {
            let parts: Vec<Expr> = system.terms[k]
                .parts()
                .filter(|(place, _)| place.is_energy())
                .map(|(_, expr)| expr)
                .collect();
            if !parts.is_empty() {
                conservative.push(unknown);
                exprs.push(graph.sum(&parts));
            }
        }
        let mut gradient = Gradient { rows: Vec::new(), linear: Vec::new() };
        for &symbol in symbols {
            let derivatives = graph.derivatives(&exprs, symbol);
            let mut parts = vec![(1.0, derivatives[0])];
            let mut linear = Vec::new();
            for (&unknown, &derivative) in conservative.iter().zip(&derivatives[1..]) {
                if graph.is_zero(derivative) {
                    continue;
                }
                let coefficient = graph.symbol(Symbol::Coefficient(active[unknown]));
                parts.push((1.0, graph.multiply(coefficient, derivative)));
                linear.push((unknown, derivative));
            }
            gradient.rows.push(graph.linear(0.0, &parts));
            gradient.linear.push(linear);
        }
        gradient
    }

    /// Takes the forces off, those of the terms with their coefficients.
    pub(super) fn subtract_forces(&mut self, graph: &mut Graph, system: &System, active: &[usize]) {
        for (i, (row, linear)) in self.rows.iter_mut().zip(&mut self.linear).enumerate() {
            let mut parts = vec![(1.0, *row)];
            parts.extend(system.forces.get(i).map(|&force| (-1.0, force)));
            for (unknown, &k) in active.iter().enumerate() {
                if let Some(expr) = system.terms[k].part(Place::Force(i)) {
                    let coefficient = graph.symbol(Symbol::Coefficient(k));
                    parts.push((-1.0, graph.multiply(coefficient, expr)));
                    linear.push((unknown, graph.negate(expr)));
                }
            }
            *row = graph.linear(0.0, &parts);
        }
    }

    /// Takes the derivatives by coefficients from the rows, which need not be linear in them.
    pub(super) fn linear_by_all(&mut self, graph: &mut Graph, coefficients: &[Symbol]) {
        self.linear = vec![Vec::new(); self.rows.len()];
        for (unknown, &symbol) in coefficients.iter().enumerate() {
            let derivatives = graph.derivatives(&self.rows, symbol);
            for (list, derivative) in self.linear.iter_mut().zip(derivatives) {
                if !graph.is_zero(derivative) {
                    list.push((unknown, derivative));
                }
            }
        }
    }
}
