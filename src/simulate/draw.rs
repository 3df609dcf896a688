//! Initial states drawn at random: from intervals, within a range of energies.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::trajectory::Simulator;
use crate::error::{Error, ErrorKind, Result};

/// Candidates that are judged at a time.
const BATCH: usize = 1024;
/// Candidates for each start before the search is given up.
const PATIENCE: usize = 10_000;

/// Where one component of the state may lie; the same numbers for a fixed one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// The smallest value.
    pub lower: f64,
    /// The largest value.
    pub upper: f64,
}

/// What starts are drawn from.
#[derive(Debug, Clone, PartialEq)]
pub struct InitialDistribution {
    /// One for each component of the state: q, then p.
    pub intervals: Vec<Interval>,
    /// Starts outside this range of energies are drawn again.
    pub energy: Option<Interval>,
}

/// `count` states, uniform over the intervals, and over what the energies leave of them.
///
/// # Errors
/// Hardly any state of the intervals has an energy in the range.
pub fn draw(
    simulator: &Simulator,
    sampling: &InitialDistribution,
    count: usize,
    time: f64,
    seed: u64,
) -> Result<Vec<Vec<f64>>> {
    let mut generator = Pcg64::seed_from_u64(seed);
    let mut found: Vec<Vec<f64>> = Vec::with_capacity(count);
    let mut tried = 0usize;
    while found.len() < count {
        if tried > PATIENCE.saturating_mul(count) {
            return Err(Error::new(
                ErrorKind::EnergyRange,
                format!(
                    "of {tried} states in the given ranges only {} have an energy in its range",
                    found.len()
                ),
                "widen the range of energies, or draw from ranges of the state nearer to it",
            ));
        }
        let many = if sampling.energy.is_some() { BATCH } else { count - found.len() };
        let candidates: Vec<Vec<f64>> = (0..many)
            .map(|_| {
                let one = |side: &Interval| {
                    let part: f64 = generator.random_range(0.0..1.0);
                    side.lower + (side.upper - side.lower) * part
                };
                sampling.intervals.iter().map(one).collect()
            })
            .collect();
        tried = tried.saturating_add(many);
        match sampling.energy {
            None => found.extend(candidates),
            Some(range) => {
                let energies = simulator.energies(&candidates, time);
                let inside = |energy: f64| energy >= range.lower && energy <= range.upper;
                let good = candidates.into_iter().zip(energies).filter(|(_, e)| inside(*e));
                found.extend(good.map(|(state, _)| state));
            }
        }
    }
    found.truncate(count);
    Ok(found)
}
