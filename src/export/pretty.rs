//! A model as people read it: expressions whose numbers carry their uncertainty.

use std::collections::HashMap;

use crate::expr::{Expr, Graph, Place, Symbol};
use crate::fit::Law;

/// Expressions in which `Symbol::Coefficient(j)` stands for `numbers[j]`.
#[derive(Debug, Clone, Default)]
pub struct Pretty {
    /// The graph that `parts` belong to.
    pub graph: Graph,
    /// At most one expression for each place; a place that is zero is left out.
    pub parts: Vec<(Place, Expr)>,
    /// The numbers that the expressions hold, in the order of their symbols.
    pub numbers: Vec<PrettyNumber>,
    /// What was done to the expressions that a reader should know.
    pub notes: Vec<String>,
}

/// A number of a [`Pretty`] expression.
#[derive(Debug, Clone, PartialEq)]
pub struct PrettyNumber {
    /// The learned value; the exact number itself where `snapped` is given.
    pub value: f64,
    /// Zero for an exact number, infinite or NaN when unknown.
    pub standard_error: f64,
    /// The exact number that was put in place of the learned one, in the mini-language: `1/2`.
    pub snapped: Option<String>,
}

impl Pretty {
    /// The model term by term, as it was learned: nothing is simplified.
    pub fn plain(law: &Law) -> Pretty {
        let system = law.system();
        let mut graph = system.graph.clone();
        // A rate in a sensor holds coefficients of the model by their terms.
        let zero = graph.number(0.0);
        let mut by_number: HashMap<Symbol, Expr> =
            (0..system.terms.len()).map(|k| (Symbol::Coefficient(k), zero)).collect();
        for (j, k) in law.positions().into_iter().enumerate() {
            by_number.insert(Symbol::Coefficient(k), graph.symbol(Symbol::Coefficient(j)));
        }
        let mut known = vec![
            (Place::Kinetic, system.kinetic),
            (Place::Potential, system.potential),
            (Place::Hamiltonian, system.hamiltonian),
        ];
        known.extend(system.forces.iter().enumerate().map(|(i, &f)| (Place::Force(i), f)));
        known.extend(system.known_rates());
        // What measures show is written as it was said, on any curve.
        let sensors = system.sensors.iter().enumerate().take(2 * system.degrees());
        known.extend(sensors.map(|(i, &s)| (Place::Sensor(i), s)));
        let zero = graph.number(0.0);
        let of_measures = 2 * system.degrees()..system.observed_count();
        known.extend(of_measures.map(|i| (Place::Sensor(i), zero)));
        let mut parts = Vec::new();
        for (place, known) in known {
            let own = |graph: &mut Graph, expr| match place {
                Place::Sensor(_) | Place::Rate(_) => graph.substitute(expr, &by_number),
                _ => expr,
            };
            let mut sum = vec![(1.0, own(&mut graph, known))];
            for (j, (_, term, _)) in law.terms().enumerate() {
                let Some(term) = term.part(place) else { continue };
                let number = graph.symbol(Symbol::Coefficient(j));
                let term = own(&mut graph, term);
                sum.push((1.0, graph.multiply(number, term)));
            }
            let whole = graph.linear(0.0, &sum);
            if !graph.is_zero(whole) {
                parts.push((place, whole));
            }
        }
        let numbers = law
            .coefficients()
            .iter()
            .zip(law.standard_errors())
            .map(|(&value, standard_error)| PrettyNumber { value, standard_error, snapped: None })
            .collect();
        Pretty { graph, parts, numbers, notes: Vec::new() }
    }

    /// The expression of a place, if it has one.
    pub fn part(&self, place: Place) -> Option<Expr> {
        self.parts.iter().find(|part| part.0 == place).map(|part| part.1)
    }
}
