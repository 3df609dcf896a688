//! The force that a model leaves, piecewise linear in one variable.

use serde::Serialize;

use super::hats::{centres, force_terms, hats};
use crate::diagnose::law_on_data::LawOnData;
use crate::diagnose::settling::{Settled, settle};
use crate::error::Result;
use crate::expr::{Expr, Symbol, System, Term};
use crate::fit::column::Column;
use crate::fit::segments::longest_run;

/// The force that is missing (or too much), piecewise linear in one variable.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResidualMap {
    /// Coordinate that the force acts on.
    pub on: String,
    /// Variable that the force is shown against.
    pub against: String,
    /// (value of the variable, force, standard error).
    pub points: Vec<(f64, f64, f64)>,
    /// Fall of the deviance that the whole map would bring, and its degrees of freedom.
    pub deviance: f64,
    /// Degrees of freedom of the map.
    pub degrees: usize,
    /// p-value: the probability that noise does as well.
    pub p_value: f64,
}

/// Residual force on every coordinate against every coordinate, momentum, the energy and time.
pub fn residual_maps(model: &LawOnData) -> Result<Vec<ResidualMap>> {
    let mut system = System::clone(model.system());
    let variables = variables(model, &mut system);
    let mut terms: Vec<Term> = Vec::new();
    let mut layout = Vec::new();
    for on in 0..system.degrees() {
        for (name, expr, centres) in &variables {
            let functions = hats(&mut system.graph, *expr, centres);
            let start = terms.len();
            terms.extend(force_terms(on, &functions, &system));
            layout.push((on, name.clone(), centres.clone(), start..terms.len()));
        }
    }
    if terms.is_empty() {
        return Ok(Vec::new());
    }
    let scores = settle(model.clone()).probe(system, &terms)?.scores;
    Ok(layout
        .into_iter()
        .map(|(on, against, centres, columns)| {
            let score = scores.group(&columns.map(Column::new).collect::<Vec<_>>());
            ResidualMap {
                on: model.system().coordinates[on].name.clone(),
                against,
                points: centres
                    .iter()
                    .zip(score.coefficients.iter().zip(&score.standard_errors))
                    .map(|(&x, (&force, &error))| (x, force, error))
                    .collect(),
                deviance: score.deviance,
                degrees: score.degrees,
                p_value: score.p_value,
            }
        })
        .collect())
}

/// The residual force where it shows most, if it is more than noise.
///
/// # Errors
///
/// When the data do not suffice to ask for it.
pub(crate) fn strongest_map(model: &LawOnData) -> Result<Option<ResidualMap>> {
    let maps = residual_maps(model)?;
    let count = maps.len() as f64;
    let most = maps.into_iter().min_by(|a, b| a.p_value.total_cmp(&b.p_value));
    Ok(most.filter(|map| map.p_value * count < model.tuning().verdict.unmistakable))
}

/// Variables that the force may depend on: name, expression, centres of hats over the data.
fn variables(model: &LawOnData, system: &mut System) -> Vec<(String, Expr, Vec<f64>)> {
    let Settled { segments, states, .. } = settle(model.clone());
    let tuning = &model.tuning().comparison;
    let centres = |values: &mut Vec<f64>| centres(values, tuning.hats, tuning.outermost);
    let n = system.degrees();
    let mut variables = Vec::new();
    for (row, symbol) in system.state().into_iter().enumerate() {
        let mut values: Vec<f64> = states.iter().map(|state| state[row]).collect();
        let measured = model.data.dataset.runs.iter().flat_map(|run| run.values[row].iter());
        if row < n {
            values.extend(measured);
        }
        let name = if row < n { &system.coordinates[row] } else { &system.momenta[row - n] };
        let centres = centres(&mut values);
        if !centres.is_empty() {
            let name = name.name.clone();
            variables.push((name, system.graph.symbol(symbol), centres));
        }
    }
    let mut times: Vec<f64> = segments
        .list
        .iter()
        .flat_map(|s| {
            let run = &model.data.dataset.runs[s.run];
            (s.first..=s.last).map(|at| run.time(at))
        })
        .collect();
    let pairs = longest_run(&model.data.dataset) <= 2;
    let times = if pairs { Vec::new() } else { centres(&mut times) };
    if !times.is_empty() {
        variables.push((system.time.name.clone(), system.graph.symbol(Symbol::Time), times));
    }
    variables
}
