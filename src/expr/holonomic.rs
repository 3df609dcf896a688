//! Forces that hold a motion to holonomic constraints g(q) = 0.
//!
//! The multipliers follow from the second time derivative of the constraints (Goldstein, Classical
//! Mechanics, section 2.4; index reduction as in Hairer and Wanner, Solving Ordinary Differential
//! Equations II, section VII.1): with G = dg/dq and dq/dt = v(q, p), G v stays zero along
//!
//! dp/dt = f + G^T lambda,    (G dv/dp G^T) lambda = -(d(G v)/dq v + G dv/dp f).
//!
//! What g and its rate are at the start of a motion they stay: a start that is off by a little
//! moves on the neighbouring surface.

use std::collections::HashMap;

use super::graph::{Expr, Graph, Symbol};

impl Graph {
    /// G^T lambda for every momentum: what holds `constraints`, which are functions of coordinates,
    /// where without it dq/dt would be `velocities` and dp/dt `forces`. `None` where the
    /// constraints contradict or repeat one another whatever the state is.
    pub(crate) fn holding_forces(
        &mut self,
        constraints: &[Expr],
        velocities: &[Expr],
        forces: &[Expr],
    ) -> Option<Vec<Expr>> {
        let n = velocities.len();
        let slopes: Vec<Vec<Expr>> = constraints
            .iter()
            .map(|&g| (0..n).map(|i| self.derivative(g, Symbol::Coordinate(i))).collect())
            .collect();
        let rates: Vec<Expr> = slopes.iter().map(|slope| self.dot(slope, velocities)).collect();
        let by_momenta: Vec<Vec<Expr>> = rates
            .iter()
            .map(|&rate| (0..n).map(|k| self.derivative(rate, Symbol::Momentum(k))).collect())
            .collect();
        let mut matrix = Vec::with_capacity(rates.len());
        let mut wanted = Vec::with_capacity(rates.len());
        for (rate, row) in rates.iter().zip(&by_momenta) {
            matrix.push(slopes.iter().map(|slope| self.dot(row, slope)).collect::<Vec<_>>());
            let by_coordinates: Vec<Expr> =
                (0..n).map(|k| self.derivative(*rate, Symbol::Coordinate(k))).collect();
            let free = self.dot(&by_coordinates, velocities);
            let pushed = self.dot(row, forces);
            let by_time = self.derivative(*rate, Symbol::Time);
            wanted.push(self.linear(0.0, &[(-1.0, free), (-1.0, pushed), (-1.0, by_time)]));
        }
        let multipliers = self.solve_symmetric(&matrix, &wanted)?;
        let force = |i: usize, graph: &mut Graph| {
            let column: Vec<Expr> = slopes.iter().map(|slope| slope[i]).collect();
            graph.dot(&column, &multipliers)
        };
        Some((0..n).map(|i| force(i, self)).collect())
    }

    fn dot(&mut self, a: &[Expr], b: &[Expr]) -> Expr {
        let parts: Vec<(f64, Expr)> =
            a.iter().zip(b).map(|(&a, &b)| (1.0, self.multiply(a, b))).collect();
        self.linear(0.0, &parts)
    }

    /// A^-1 x for a symmetric matrix: half the gradient of x^T A^-1 x by x.
    fn solve_symmetric(&mut self, matrix: &[Vec<Expr>], vector: &[Expr]) -> Option<Vec<Expr>> {
        // Symbols that no expression holds stand for x while the form is derived.
        let stand_ins: Vec<Symbol> =
            (0..vector.len()).map(|j| Symbol::Coefficient(usize::MAX - j)).collect();
        let unknown: Vec<Expr> = stand_ins.iter().map(|&symbol| self.symbol(symbol)).collect();
        let form = self.inverse_form(matrix, &unknown)?;
        let values: HashMap<Symbol, Expr> =
            stand_ins.iter().copied().zip(vector.iter().copied()).collect();
        let solved = |graph: &mut Graph, &symbol: &Symbol| {
            let slope = graph.derivative(form, symbol);
            let slope = graph.substitute(slope, &values);
            graph.linear(0.0, &[(0.5, slope)])
        };
        Some(stand_ins.iter().map(|symbol| solved(self, symbol)).collect())
    }
}
