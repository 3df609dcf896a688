//! Internal states of first order among the equations of motion.

use super::gradient::Gradient;
use crate::expr::{Graph, Place, Symbol, System, without_others};

/// Puts the laws of internal states where those of coordinates would stand: dw/dt in the place
/// of dH/dp, and no change of what stands as their momentum.
///
/// A law may hold velocities, and with them the coefficients of H: every one is derived by.
pub(super) fn set_rates(
    graph: &mut Graph,
    system: &System,
    active: &[usize],
    slope: &mut Gradient,
    velocity: &mut Gradient,
) {
    for (place, known) in system.known_rates() {
        let Place::Rate(i) = place else { continue };
        let mut parts = vec![(1.0, known)];
        for &k in active {
            if let Some(expr) = system.terms[k].part(place) {
                let coefficient = graph.symbol(Symbol::Coefficient(k));
                parts.push((1.0, graph.multiply(coefficient, expr)));
            }
        }
        let rate = graph.linear(0.0, &parts);
        let rate = without_others(graph, rate, active);
        let mut linear = Vec::new();
        for (unknown, &k) in active.iter().enumerate() {
            let derivative = graph.derivative(rate, Symbol::Coefficient(k));
            if !graph.is_zero(derivative) {
                linear.push((unknown, derivative));
            }
        }
        velocity.rows[i] = rate;
        velocity.linear[i] = linear;
        slope.rows[i] = graph.number(0.0);
        slope.linear[i].clear();
    }
}
