//! Grids of inner parameters: what is looked through is what the data reach.

use std::collections::HashMap;

use crate::data::{Dataset, MeasuredInput, Run};
use crate::diagnose::tuning::{Axis, Candidates};
use crate::expr::System;
use crate::fit::segments::{longest_run, typical_step};
use crate::spec::effects::ScanBy;

/// How far measurements reach, in space and time.
pub struct Reach<'a> {
    system: &'a System,
    dataset: &'a Dataset,
    tuning: &'a Candidates,
    /// Smallest and largest value of each coordinate, and the largest size of its momentum, by the
    /// coordinate's name; of inputs too, with their largest size.
    ranges: HashMap<String, (f64, f64, f64)>,
    /// Usual time between samples.
    step: f64,
    /// First and last time of any run.
    times: (f64, f64),
    /// Of the longest run.
    duration: f64,
}

impl<'a> Reach<'a> {
    /// How far the measurements of a system reach.
    pub fn of(system: &'a System, dataset: &'a Dataset, tuning: &'a Candidates) -> Reach<'a> {
        let step = typical_step(dataset).max(f64::MIN_POSITIVE);
        let times = dataset.runs.iter().filter_map(Run::ends);
        let none = (f64::INFINITY, f64::NEG_INFINITY);
        Reach {
            system,
            dataset,
            tuning,
            ranges: ranges(system, dataset),
            step,
            times: times.fold(none, |(a, b), (start, end)| (a.min(start), b.max(end))),
            duration: (longest_run(dataset).saturating_sub(1).max(1)) as f64 * step,
        }
    }

    /// Values of some inner parameters of an effect `on` a coordinate or observable, every choice
    /// of all of them together; one empty choice without any.
    pub fn grid(&self, scans: &[ScanBy], on: &str) -> Vec<Vec<f64>> {
        let range = self.ranges.get(on).copied().unwrap_or((-1.0, 1.0, 1.0));
        self.grid_over(scans, range)
    }

    /// The same of an effect on bodies, each a list of coordinates: lengths are those of the
    /// distance from the origin, or of two bodies.
    pub(super) fn grid_of_bodies(&self, scans: &[ScanBy], bodies: &[Vec<String>]) -> Vec<Vec<f64>> {
        let place = |name: &String| {
            self.system.coordinates.iter().position(|variable| variable.name == *name)
        };
        let rows = |body: &Vec<String>| -> Vec<usize> { body.iter().filter_map(place).collect() };
        let first = bodies.first().map(rows).unwrap_or_default();
        let second = bodies.get(1).map(rows);
        let mut range = (f64::INFINITY, 0.0_f64);
        for run in &self.dataset.runs {
            let at = |row: usize, k: usize| {
                run.values.get(row).and_then(|cells| cells.get(k)).copied().unwrap_or(f64::NAN)
            };
            let count = run.values.first().map_or(0, Vec::len);
            for k in 0..count {
                let square = |(i, &row): (usize, &usize)| {
                    let other = second.as_ref().and_then(|rows| rows.get(i));
                    (at(row, k) - other.map_or(0.0, |&other| at(other, k))).powi(2)
                };
                let distance = first.iter().enumerate().map(square).sum::<f64>().sqrt();
                if distance.is_finite() {
                    range = (range.0.min(distance), range.1.max(distance));
                }
            }
        }
        if range.0 > range.1 {
            range = (0.0, 1.0);
        }
        // A length is compared with the distance itself, not with how much that changes.
        self.grid_over(scans, (0.0, range.1, range.1))
    }

    fn grid_over(&self, scans: &[ScanBy], range: (f64, f64, f64)) -> Vec<Vec<f64>> {
        let Reach { step, times: (start, end), duration, tuning, .. } = *self;
        let (lower, upper, momentum) = range;
        let spread = upper - lower;
        let turn = std::f64::consts::TAU;
        let most = if scans.len() > 1 {
            (tuning.points_together as f64).powf(1.0 / scans.len() as f64) as usize
        } else {
            tuning.points
        };
        let even = |a: f64, b: f64, count: usize| evenly(a, b, count.min(most).max(2));
        // Each axis between its ends times what its numbers are parts of.
        let ratio = |axis: Axis, (first, last): (f64, f64)| -> Vec<f64> {
            let (a, b) = (axis.from * first, axis.to * last);
            let count = axis.points.min(most).max(2);
            (0..count).map(|i| a * (b / a).powf(i as f64 / (count - 1) as f64)).collect()
        };
        let grids = &tuning.grids;
        let axes: Vec<Vec<f64>> = scans
            .iter()
            .map(|scan| match scan {
                ScanBy::Frequency => {
                    // Half a turn more over a run is a new frequency.
                    let finest = std::f64::consts::PI / duration;
                    let highest = grids.highest_frequency * turn / step;
                    let count = (highest / finest) as usize;
                    let most = if scans.len() > 1 { most } else { tuning.frequencies };
                    evenly(2.0 * finest, highest.max(3.0 * finest), count.clamp(2, most))
                }
                ScanBy::Position => {
                    let margin = grids.place_margin * spread;
                    even(lower + margin, upper - margin, grids.places)
                }
                ScanBy::Beyond => {
                    let away = ratio(grids.beyond, (spread, spread));
                    let below = away.iter().rev().map(|away| lower - away);
                    below.chain(away.iter().map(|away| upper + away)).collect()
                }
                ScanBy::Length => ratio(grids.lengths, (spread, spread)),
                ScanBy::Range => ratio(grids.ranges, (spread, spread)),
                ScanBy::WaveNumber => ratio(grids.wave_numbers, (turn / spread, turn / spread)),
                ScanBy::Instant => {
                    let margin = grids.instant_margin * duration;
                    even(start + margin, end - margin, grids.instants)
                }
                ScanBy::Duration => ratio(grids.durations, (step, duration)),
                ScanBy::Exponent => grids.exponents.to_vec(),
                ScanBy::Power => grids.powers.to_vec(),
                ScanBy::Ratio => grids.ratios.to_vec(),
                ScanBy::Momentum => ratio(grids.momenta, (momentum, momentum)),
                ScanBy::Level => ratio(grids.levels, (momentum, momentum)),
                ScanBy::Delay => ratio(grids.delays, (step, step.min(duration))),
                ScanBy::Rate => ratio(grids.rates, (1.0 / duration, 1.0 / step)),
            })
            .collect();
        every_choice(&axes)
    }
}

/// So many values from one to another, two at least.
fn evenly(a: f64, b: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| a + (b - a) * i as f64 / (count - 1) as f64).collect()
}

/// All combinations of one value from each axis.
pub(super) fn every_choice(axes: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut grid: Vec<Vec<f64>> = vec![Vec::new()];
    for axis in axes {
        grid = grid
            .iter()
            .flat_map(|head| axis.iter().map(|&x| [head.clone(), vec![x]].concat()))
            .collect();
    }
    grid
}

/// Smallest and largest measured value of every coordinate and momentum, by name.
fn ranges(system: &System, dataset: &Dataset) -> HashMap<String, (f64, f64, f64)> {
    let n = system.degrees();
    let names = system.coordinates.iter().chain(&system.momenta);
    let mut out = HashMap::new();
    for (place, input) in MeasuredInput::places(&dataset.inputs).0.into_iter().zip(&dataset.inputs)
    {
        let cells = dataset.runs.iter().filter_map(|run| run.inputs.get(place)).flatten();
        let largest = cells.fold(0.0_f64, |most, x| most.max(x.abs()));
        if largest > 0.0 && largest.is_finite() {
            out.insert(input.name.clone(), (-largest, largest, largest));
        }
    }
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
