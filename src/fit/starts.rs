//! Start values of the inner parameters.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::options::Options;
use crate::expr::System;

/// Starts to try: every combination of those that the spec lists, the first of each first; then
/// `options.starts` others spread over the bounds (or around the start), one random point in
/// each stratum of each parameter, strata shuffled against each other (Latin hypercube: McKay,
/// Beckman and Conover, Technometrics 21, 1979). One start, empty, when there is no parameter.
pub fn starts(system: &System, options: &Options) -> Vec<Vec<f64>> {
    let mut all = own(system, options);
    if system.parameters.is_empty() || options.starts == 0 {
        return all;
    }
    let mut generator = Pcg64::seed_from_u64(options.seed);
    let count = options.starts;
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for parameter in &system.parameters {
        let reach = options.tuning.course.reach * parameter.start.abs().max(1.0);
        let lower = parameter.bounds.lower.max(parameter.start - reach);
        let upper = parameter.bounds.upper.min(parameter.start + reach);
        let mut strata: Vec<usize> = (0..count).collect();
        for i in (1..count).rev() {
            strata.swap(i, generator.random_range(0..=i));
        }
        let column = strata
            .into_iter()
            .map(|s| {
                let u: f64 = generator.random_range(0.0..1.0);
                lower + (upper - lower) * (s as f64 + u) / count as f64
            })
            .collect();
        columns.push(column);
    }
    all.extend((0..count).map(|i| columns.iter().map(|column| column[i]).collect()));
    all
}

/// Combinations of the starts that the spec lists; the first parameter changes slowest.
fn own(system: &System, options: &Options) -> Vec<Vec<f64>> {
    let mut all: Vec<Vec<f64>> = vec![Vec::new()];
    for (j, parameter) in system.parameters.iter().enumerate() {
        let listed = options.parameter_starts.get(j).filter(|list| !list.is_empty());
        let listed = listed.map_or(std::slice::from_ref(&parameter.start), Vec::as_slice);
        let extended = all.iter().flat_map(|start| {
            listed.iter().map(|&value| {
                let mut longer = start.clone();
                longer.push(parameter.bounds.clamp(value));
                longer
            })
        });
        all = extended.take(options.tuning.course.combinations).collect();
    }
    all
}
