//! Effects that may be missing, ready to be tried: each built into the spec once, its inner
//! parameters on a grid.

use std::collections::HashMap;

use super::reach::Reach;
use crate::data::Dataset;
use crate::expr::{Compiled, Symbol, System, Term, build};
use crate::spec::effects::{EffectRow, ScanBy, instances};

/// Something that may be missing, ready to be tried.
pub struct Candidate {
    /// Where it comes from.
    pub origin: Origin,
    /// `viscous_drag(theta)`.
    pub label: String,
    /// Names of the coordinates or observables that it is on.
    pub on: Vec<String>,
    /// The spec with it, inner parameters as parameters.
    pub system: System,
    /// Its terms in `system`.
    pub terms: Vec<usize>,
    /// Its inner parameters in `system`.
    pub parameters: Vec<usize>,
    /// Values of the inner parameters that are tried; one empty choice without any.
    pub grid: Vec<Vec<f64>>,
}

/// Where a candidate comes from.
#[derive(Debug, Clone)]
pub enum Origin {
    /// A row of the catalogue.
    Catalogue(&'static EffectRow),
    /// The `candidates` of the spec.
    Spec,
    /// A term without a name of its own: a statement, its inner parameters between braces.
    Unnamed {
        /// The statement.
        statement: String,
        /// Names of the inner parameters, in their order.
        parameters: Vec<String>,
    },
}

/// Everything of the catalogue that the system allows, and the spec's own candidates, except
/// what the spec holds already.
pub fn candidates(name: &str, text: &str, base: &Compiled, dataset: &Dataset) -> Vec<Candidate> {
    let system = &base.system;
    let held: Vec<&str> = system.terms.iter().filter_map(|t| t.effect.as_deref()).collect();
    let reach = Reach::of(system, dataset);
    let named = instances(&system.scene()).into_iter().map(|instance| {
        let label = instance.label();
        (instance.effect, instance.statement, label, instance.arguments)
    });
    let named = named.filter(|(_, _, label, _)| !held.contains(&label.as_str())).filter_map(
        |(row, statement, label, on)| {
            let built = build(name, &extended(text, &statement)).ok()?.system;
            let terms: Vec<usize> = (0..built.terms.len())
                .filter(|&k| built.terms[k].effect.as_deref() == Some(label.as_str()))
                .collect();
            let parameters: Vec<usize> =
                (system.parameters.len()..built.parameters.len()).collect();
            let first = on.first().map_or("", String::as_str);
            let scans: Vec<ScanBy> = row.parameters.iter().map(|scan| scan.by).collect();
            let grid = reach.grid(&scans, first);
            let found = !terms.is_empty();
            let origin = Origin::Catalogue(row);
            found.then_some(Candidate { origin, label, on, system: built, terms, parameters, grid })
        },
    );
    super::own::candidates(name, text, base).into_iter().chain(named).collect()
}

/// A spec with one more statement at its end.
pub fn extended(text: &str, statement: &str) -> String {
    format!("{}\n{statement}\n", text.trim_end())
}

impl Candidate {
    /// The statement that adds it, its inner parameters at some values.
    pub fn snippet(&self, values: &[f64]) -> String {
        match &self.origin {
            Origin::Catalogue(row) => row.statement(&self.on, values),
            Origin::Spec => format!("effect {}", self.label),
            Origin::Unnamed { statement, parameters } => {
                let fill = |text: String, (name, value): (&String, &f64)| {
                    text.replace(&format!("{{{name}}}"), &format!("{value:.6}"))
                };
                parameters.iter().zip(values).fold(statement.clone(), fill)
            }
        }
    }

    /// The effect's terms at one choice of its inner parameters, in the graph of `into`.
    pub fn probes(&self, into: &mut System, values: &[f64]) -> Vec<Term> {
        let numbers: HashMap<Symbol, f64> = self
            .parameters
            .iter()
            .zip(values)
            .map(|(&j, &value)| (Symbol::Parameter(j), value))
            .collect();
        self.terms
            .iter()
            .map(|&k| {
                let term = &self.system.terms[k];
                let mut import = |expr| into.graph.import(&self.system.graph, expr, &numbers);
                let expr = import(term.expr);
                let also = term.also.iter().map(|&(place, expr)| (place, import(expr))).collect();
                Term { expr, also, ..term.clone() }
            })
            .collect()
    }
}
