//! What is read of a state beside itself: what instruments add, and what measures show.

use super::gradient::Gradient;
use crate::expr::{Expr, Graph, Place, Symbol, System, without_others};

/// What the instrument adds to each observable, and its derivatives by the unknowns.
pub(super) fn instrument(
    graph: &mut Graph,
    system: &System,
    active: &[usize],
    probes: &[usize],
) -> Gradient {
    let mut gradient = Gradient { rows: Vec::new(), linear: Vec::new() };
    for observable in 0..system.observed_count() {
        let place = Place::Sensor(observable);
        let mut parts: Vec<(f64, Expr)> =
            system.sensors.get(observable).map(|&known| (1.0, known)).into_iter().collect();
        for &k in active {
            if let Some(expr) = system.terms[k].part(place) {
                let coefficient = graph.symbol(Symbol::Coefficient(k));
                parts.push((1.0, graph.multiply(coefficient, expr)));
            }
        }
        let whole = graph.linear(0.0, &parts);
        // Terms that are left out have no coefficient.
        let row = without_others(graph, whole, active);
        // The rate of an observable holds the coefficients of H: every one is derived by.
        let mut linear: Vec<(usize, Expr)> = Vec::new();
        if !graph.is_zero(row) {
            for (unknown, &k) in active.iter().enumerate() {
                let derivative = graph.derivative(row, Symbol::Coefficient(k));
                if !graph.is_zero(derivative) {
                    linear.push((unknown, derivative));
                }
            }
        }
        for (probe, &k) in probes.iter().enumerate() {
            let of_motion = graph.derivative(whole, Symbol::Coefficient(k));
            let of_motion = without_others(graph, of_motion, active);
            let own = system.terms[k].part(place);
            let parts: Vec<Expr> = own.into_iter().chain([of_motion]).collect();
            let derivative = graph.sum(&parts);
            if !graph.is_zero(derivative) {
                linear.push((active.len() + probe, derivative));
            }
        }
        gradient.rows.push(row);
        gradient.linear.push(linear);
    }
    gradient
}
