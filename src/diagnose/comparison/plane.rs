//! Residual force over a plane of the phase space.

use serde::Serialize;

use super::hats::{centres, force_terms, hats};
use crate::diagnose::law_on_data::LawOnData;
use crate::diagnose::settling::settle;
use crate::error::Result;
use crate::expr::{Expr, System};
use crate::fit::column::Column;

/// The force that is missing over (q, p) of one coordinate, bilinear between nodes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ForcePlane {
    /// Index of the coordinate that the force acts on, and whose plane it is.
    pub coordinate: usize,
    /// Values of the coordinate at the nodes, ascending, evenly spaced.
    pub across: Vec<f64>,
    /// Values of the momentum at the nodes, ascending, evenly spaced.
    pub up: Vec<f64>,
    /// What is known at the nodes near which there are data.
    pub nodes: Vec<ForceNode>,
    /// Fall of the deviance that the whole map would bring.
    pub deviance: f64,
    /// Degrees of freedom of the map.
    pub degrees: usize,
    /// p-value: the probability that noise does as well.
    pub p_value: f64,
}

/// The missing force at one node of a plane.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ForceNode {
    /// Index into `across`.
    pub column: usize,
    /// Index into `up`.
    pub row: usize,
    /// The force.
    pub force: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Samples nearer to this node than to any other.
    pub samples: usize,
}

/// The missing force on each coordinate over its own plane; planes without a spread of data
/// are left out.
///
/// `motion` gives a component of the state (q, then p) at all samples.
pub fn force_planes(
    model: &LawOnData,
    motion: &dyn Fn(usize) -> Vec<f64>,
) -> Result<Vec<ForcePlane>> {
    let n = model.system().degrees();
    let tuning = &model.tuning().comparison;
    let count = tuning.plane_nodes;
    let nodes = |values: &[f64]| centres(&mut values.to_vec(), count, tuning.outermost);
    let mut planes = Vec::new();
    for coordinate in 0..n.min(tuning.planes) {
        let (q, p) = (motion(coordinate), motion(n + coordinate));
        let (across, up) = (nodes(&q), nodes(&p));
        if across.is_empty() || up.is_empty() {
            continue;
        }
        let counts = counts(&across, &up, q.iter().zip(&p));
        let mut system = System::clone(model.system());
        let symbols = system.state();
        let mut along = |row: usize, centres: &[f64]| {
            let variable = system.graph.symbol(symbols[row]);
            hats(&mut system.graph, variable, centres)
        };
        let (over_q, over_p) = (along(coordinate, &across), along(n + coordinate, &up));
        let held: Vec<(usize, usize)> = (0..count * count)
            .map(|at| (at % count, at / count))
            .filter(|&(column, row)| counts[row * count + column] >= tuning.node_samples)
            .collect();
        let functions: Vec<Expr> = held
            .iter()
            .map(|&(column, row)| system.graph.multiply(over_q[column], over_p[row]))
            .collect();
        if functions.is_empty() {
            continue;
        }
        let terms = force_terms(coordinate, &functions, &system);
        let scores = settle(model.clone()).probe(system, &terms)?.scores;
        let score = scores.group(&Column::all(terms.len()).collect::<Vec<_>>());
        let known = score.coefficients.iter().zip(&score.standard_errors);
        let nodes = held
            .into_iter()
            .zip(known)
            .filter(|(_, (force, error))| force.is_finite() && error.is_finite())
            .map(|((column, row), (&force, &standard_error))| {
                let samples = counts[row * count + column];
                ForceNode { column, row, force, standard_error, samples }
            })
            .collect();
        let (deviance, degrees, p_value) = (score.deviance, score.degrees, score.p_value);
        planes.push(ForcePlane { coordinate, across, up, nodes, deviance, degrees, p_value });
    }
    Ok(planes)
}

/// Samples nearest to each node, `[row][column]`.
fn counts<'a>(
    across: &[f64],
    up: &[f64],
    samples: impl Iterator<Item = (&'a f64, &'a f64)>,
) -> Vec<usize> {
    let mut counts = vec![0; across.len() * up.len()];
    let nearest = |value: f64, nodes: &[f64]| {
        let step = nodes[1] - nodes[0];
        let at = ((value - nodes[0]) / step).round();
        (at >= 0.0 && at < nodes.len() as f64).then_some(at as usize)
    };
    for (&q, &p) in samples {
        if let (Some(column), Some(row)) = (nearest(q, across), nearest(p, up)) {
            counts[row * across.len() + column] += 1;
        }
    }
    counts
}
