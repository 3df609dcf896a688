//! Holonomic constraints among the equations of motion.

use super::gradient::Gradient;
use crate::expr::{Expr, Graph, Symbol, System};

/// Adds the forces that hold the system's constraints to what moves the momenta; `slope` is -dp/dt.
///
/// The forces are linear in the coefficients of V and of the applied forces: every one is derived
/// by.
pub(super) fn hold(
    graph: &mut Graph,
    system: &System,
    active: &[usize],
    slope: &mut Gradient,
    velocity: &Gradient,
) {
    if system.constraints.is_empty() {
        return;
    }
    let held: Vec<Expr> = system.constraints.iter().map(|constraint| constraint.expr).collect();
    let pushes: Vec<Expr> = slope.rows.iter().map(|&row| graph.negate(row)).collect();
    // What no forces hold was refused where the spec was read.
    let Some(holding) = graph.holding_forces(&held, &velocity.rows, &pushes) else { return };
    for ((row, linear), force) in slope.rows.iter_mut().zip(&mut slope.linear).zip(holding) {
        if graph.is_zero(force) {
            continue;
        }
        *row = graph.subtract(*row, force);
        linear.clear();
        for (unknown, &k) in active.iter().enumerate() {
            let derivative = graph.derivative(*row, Symbol::Coefficient(k));
            if !graph.is_zero(derivative) {
                linear.push((unknown, derivative));
            }
        }
    }
}
