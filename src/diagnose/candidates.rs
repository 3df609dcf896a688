//! Effects that may be missing, ready to be tried: each built into the spec once, its inner
//! parameters on a grid.

use std::collections::HashMap;

use crate::data::Dataset;
use crate::expr::{Compiled, Symbol, System, Term, build};
use crate::fit::segments::{longest_run, typical_step};
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

/// Grid points of one inner parameter, at most; of several together.
const POINTS: usize = 48;
const TOGETHER: usize = 60;

/// Everything of the catalogue that the system allows, and the spec's own candidates, except
/// what the spec holds already.
pub fn candidates(name: &str, text: &str, base: &Compiled, dataset: &Dataset) -> Vec<Candidate> {
    let system = &base.system;
    let held: Vec<&str> = system.terms.iter().filter_map(|t| t.effect.as_deref()).collect();
    let ranges = ranges(system, dataset);
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
            let grid = grid(&scans, first, &ranges, dataset);
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

/// Smallest and largest measured value of every coordinate and momentum, by name.
pub(super) fn ranges(system: &System, dataset: &Dataset) -> HashMap<String, (f64, f64, f64)> {
    let n = system.degrees();
    let names = system.coordinates.iter().chain(&system.momenta);
    let mut out = HashMap::new();
    for (row, variable) in names.enumerate() {
        let cells = dataset.runs.iter().filter_map(|run| run.values.get(row)).flatten();
        let (mut lower, mut upper) = (f64::INFINITY, f64::NEG_INFINITY);
        for &x in cells.filter(|x| x.is_finite()) {
            lower = lower.min(x);
            upper = upper.max(x);
        }
        if lower < upper {
            // A momentum goes by the name of its coordinate too: effects are on coordinates.
            let momentum = lower.abs().max(upper.abs());
            if row < n {
                out.insert(variable.name.clone(), (lower, upper, upper - lower));
            } else if let Some(of) = out.get_mut(&system.coordinates[row - n].name) {
                of.2 = momentum;
            }
        }
    }
    out
}

pub(super) fn grid(
    scans: &[ScanBy],
    on: &str,
    ranges: &HashMap<String, (f64, f64, f64)>,
    dataset: &Dataset,
) -> Vec<Vec<f64>> {
    let (lower, upper, momentum) = ranges.get(on).copied().unwrap_or((-1.0, 1.0, 1.0));
    let spread = upper - lower;
    let step = typical_step(dataset).max(f64::MIN_POSITIVE);
    let times = dataset.runs.iter().flat_map(|run| run.times.first().zip(run.times.last()));
    let (start, end) =
        times.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (&s, &e)| (a.min(s), b.max(e)));
    let duration = (longest_run(dataset).saturating_sub(1).max(1)) as f64 * step;
    let turn = std::f64::consts::TAU;
    let most = if scans.len() > 1 {
        (TOGETHER as f64).powf(1.0 / scans.len() as f64) as usize
    } else {
        POINTS
    };
    let even = |a: f64, b: f64, count: usize| -> Vec<f64> {
        let count = count.min(most).max(2);
        (0..count).map(|i| a + (b - a) * i as f64 / (count - 1) as f64).collect()
    };
    let ratio = |a: f64, b: f64, count: usize| -> Vec<f64> {
        let count = count.min(most).max(2);
        (0..count).map(|i| a * (b / a).powf(i as f64 / (count - 1) as f64)).collect()
    };
    let axes: Vec<Vec<f64>> = scans
        .iter()
        .map(|scan| match scan {
            ScanBy::Frequency => {
                // Half a turn more over a run is a new frequency; above the fastest that
                // mechanical data show, a quarter of the sampling rate, nothing is looked for.
                let finest = std::f64::consts::PI / duration;
                let highest = 0.25 * turn / step;
                even(2.0 * finest, highest.max(3.0 * finest), (highest / finest) as usize)
            }
            ScanBy::Position => even(lower + 0.1 * spread, upper - 0.1 * spread, 9),
            ScanBy::Length => ratio(0.1 * spread, spread, 4),
            ScanBy::WaveNumber => ratio(0.5 * turn / spread, 8.0 * turn / spread, 24),
            ScanBy::Instant => even(start + 0.05 * duration, end - 0.05 * duration, 16),
            ScanBy::Duration => ratio(2.0 * step, duration, 6),
            ScanBy::Exponent => vec![0.5, 1.5, 2.5],
            ScanBy::Momentum => ratio(0.1 * momentum, momentum, 4),
            ScanBy::Rate => ratio(0.5 / duration, 0.5 / step, 6),
        })
        .collect();
    super::own::every_choice(&axes)
}
