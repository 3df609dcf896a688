//! Start values of the inner parameters.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::options::Options;
use crate::expr::System;

/// How far starts reach from the spec's own, where there are no bounds.
const REACH: f64 = 2.0;

/// The spec's own start, then others spread over the bounds (or around the start): one random
/// point in each stratum of each parameter, strata shuffled against each other (Latin hypercube:
/// McKay, Beckman and Conover, Technometrics 21, 1979). One start when there is no parameter.
pub fn starts(system: &System, options: &Options) -> Vec<Vec<f64>> {
    let own: Vec<f64> = system.parameters.iter().map(|p| p.bounds.clamp(p.start)).collect();
    if own.is_empty() || options.starts == 0 {
        return vec![own];
    }
    let mut generator = Pcg64::seed_from_u64(options.seed);
    let count = options.starts;
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for parameter in &system.parameters {
        let reach = REACH * parameter.start.abs().max(1.0);
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
    let others = (0..count).map(|i| columns.iter().map(|column| column[i]).collect());
    std::iter::once(own).chain(others).collect()
}
