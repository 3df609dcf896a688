//! Putting samples aside, so that a fit can be judged on what it has not seen; and putting
//! data sets together.

use std::cmp::Ordering;
use std::collections::HashSet;

use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::header::counted;
use super::{Dataset, Run};
use crate::error::{Error, ErrorKind, Result};

/// A data set in two parts.
#[derive(Debug, Clone, PartialEq)]
pub struct Split {
    /// What the fit sees.
    pub training: Dataset,
    /// What it does not see; without runs when there are too few samples to put any aside.
    pub held_out: Dataset,
    /// How the split was made, as a sentence.
    pub how: String,
}

/// Turns of the slowest motion that a block holds, at least, where so much is put aside: small
/// effects take time to show, and a prediction ends with the block it begins in.
const TURNS: f64 = 1.5;
/// Blocks that are put aside out of a run, at most: each sees another part of the motion.
const BLOCKS: usize = 3;
/// The least samples that show motion.
const LEAST: usize = 2;

impl Dataset {
    /// How many samples there are in all runs.
    pub fn samples(&self) -> usize {
        self.runs.iter().map(|run| run.times.len()).sum()
    }

    /// For each observable, how many samples have a value.
    pub fn measured(&self) -> Vec<usize> {
        (0..self.observables.len())
            .map(|at| {
                self.runs
                    .iter()
                    .filter_map(|run| run.values.get(at))
                    .flatten()
                    .filter(|value| !value.is_nan())
                    .count()
            })
            .collect()
    }

    /// Puts about a `fraction` of the samples aside: whole runs where there are enough of them, and
    /// first those that hold none of the largest and smallest values, so that a prediction is asked
    /// for where the fit has seen the motion; otherwise blocks of consecutive samples of every run,
    /// at times that the seed decides: three, or fewer where each would see less than a turn and a
    /// half of the slowest motion. The stretches that a run is cut into become runs of their own
    /// (`1, part 2`), so that nothing integrates across what is held out. The same seed gives the
    /// same split, in whichever order the runs stand, and in whichever units.
    ///
    /// A fraction outside 0 to 0.9 is brought into it.
    pub fn split_held_out(&self, fraction: f64, seed: u64) -> Split {
        let fraction = if fraction.is_nan() { 0.0 } else { fraction.clamp(0.0, 0.9) };
        let mut generator = Pcg64::seed_from_u64(seed);
        let wanted = (fraction * self.runs.len() as f64).round() as usize;
        if fraction > 0.0 && wanted >= 1 && wanted < self.runs.len() {
            self.split_by_runs(fraction, seed, &mut generator)
        } else {
            self.split_by_blocks(fraction, seed, &mut generator)
        }
    }

    fn split_by_runs(&self, fraction: f64, seed: u64, generator: &mut Pcg64) -> Split {
        let mut order = self.by_content();
        order.shuffle(generator);
        let extremes = self.extremes();
        order.sort_by_key(|at| extremes.get(*at).copied());
        let wanted = fraction * self.samples() as f64;
        let mut aside = HashSet::new();
        let mut samples = 0;
        for at in order {
            let more = self.runs.get(at).map_or(0, |run| run.times.len());
            // Never the last run, and no run that brings the share further from the fraction that
            // was asked for.
            let closer = samples as f64 + 0.5 * more as f64 <= wanted;
            if aside.len() + 1 < self.runs.len() && (aside.is_empty() || closer) {
                aside.insert(at);
                samples += more;
            }
        }
        let part = |held_out: bool| {
            let runs = self.runs.iter().enumerate();
            let runs = runs.filter(|(at, _)| aside.contains(at) == held_out);
            self.with(runs.map(|(_, run)| run.clone()).collect())
        };
        let (training, held_out) = (part(false), part(true));
        let how = format!(
            "{} of {} ({}) held out: what the runs hold and the seed {seed} decide which.",
            held_out.runs.len(),
            counted(self.runs.len(), "run"),
            counted(held_out.samples(), "sample"),
        );
        Split { training, held_out, how }
    }

    fn split_by_blocks(&self, fraction: f64, seed: u64, generator: &mut Pcg64) -> Split {
        let mut parts_of: Vec<(Vec<Run>, Vec<Run>)> = vec![Default::default(); self.runs.len()];
        let mut blocks_aside = 0;
        for at in self.by_content() {
            let of = self.runs.get(at).zip(parts_of.get_mut(at));
            let Some((run, (training, held_out))) = of else { continue };
            let samples = run.times.len();
            if fraction <= 0.0 || samples < 2 * LEAST {
                training.push(run.clone());
                continue;
            }
            let wanted = (fraction * samples as f64).round() as usize;
            let aside = wanted.clamp(LEAST, samples - LEAST);
            let turns = run.turns() * aside as f64 / samples as f64;
            // Neither a block nor what is beside it in its stretch may be too short.
            let room = (aside / LEAST).min((samples - aside) / (LEAST + 1)).max(1);
            let blocks = ((turns / TURNS).round() as usize).clamp(1, BLOCKS).min(room);
            blocks_aside += blocks;
            let mut seen = 0;
            let mut parts = 0;
            let mut part = |from: usize, to: usize| {
                parts += 1;
                run.part(format!("{}, part {parts}", run.name), from, to)
            };
            for block in 0..blocks {
                // One block in each of as many equal stretches of the run.
                let (from, to) = (block * samples / blocks, (block + 1) * samples / blocks);
                let length = (block + 1) * aside / blocks - block * aside / blocks;
                let start = from + place(to - from - length, generator);
                if start > seen {
                    training.push(part(seen, start));
                }
                held_out.push(part(start, start + length));
                seen = start + length;
            }
            if seen < samples {
                training.push(part(seen, samples));
            }
        }
        let (training, held_out): (Vec<Vec<Run>>, Vec<Vec<Run>>) = parts_of.into_iter().unzip();
        let (training, held_out) = (self.with(training.concat()), self.with(held_out.concat()));
        let how = if held_out.runs.is_empty() {
            "Nothing is held out: there are too few samples to put any aside, or none was asked \
             for."
                .to_string()
        } else {
            format!(
                "{} of consecutive samples ({} of {}) held out, out of {}: what these hold and the \
                 seed {seed} decide where.",
                counted(blocks_aside, "block"),
                held_out.samples(),
                counted(self.samples(), "sample"),
                counted(self.runs.len(), "run"),
            )
        };
        Split { training, held_out, how }
    }

    /// Numbers of the runs in an order that is made by what they hold, whatever their order in the
    /// file: the same runs are held out of the same measurements.
    fn by_content(&self) -> Vec<usize> {
        let keyed = self.runs.iter().enumerate().map(|(at, run)| (run.key(), at, run));
        let mut order: Vec<(Key, usize, &Run)> = keyed.collect();
        order.sort_by(|a, b| a.0.cmp(&b.0).then_with(|| by_content(a.2, b.2)));
        order.into_iter().map(|(_, at, _)| at).collect()
    }

    /// For each run, of how many observables it holds the largest or the smallest value.
    fn extremes(&self) -> Vec<usize> {
        let mut held = vec![0; self.runs.len()];
        for observable in 0..self.observables.len() {
            for sign in [1.0, -1.0] {
                let furthest = |run: &Run| {
                    let values = run.values.get(observable).into_iter().flatten();
                    values.map(|x| sign * x).fold(f64::NEG_INFINITY, f64::max)
                };
                let reached: Vec<f64> = self.runs.iter().map(furthest).collect();
                let most = reached.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                for (count, reached) in held.iter_mut().zip(reached) {
                    *count += usize::from(reached == most);
                }
            }
        }
        held
    }

    fn with(&self, runs: Vec<Run>) -> Dataset {
        Dataset { observables: self.observables.clone(), runs, inputs: self.inputs.clone() }
    }
}

/// Number of samples of a run, then how far each observable goes in the first step: what tells
/// nearly all runs from one another. Distances are not below zero, and their bits are in order.
type Key = (usize, Vec<u64>);

/// How far an observable is from where it begins: in the same order in other units, from another
/// origin and with another sign.
fn way(values: &[f64]) -> Vec<f64> {
    let first = values.iter().copied().find(|x| x.is_finite()).unwrap_or(0.0);
    values.iter().map(|x| (x - first).abs()).collect()
}

/// Orders runs of the same key by all that they hold.
fn by_content(a: &Run, b: &Run) -> Ordering {
    let raw = |values: &[f64]| values.to_vec();
    let compare = |of: &dyn Fn(&[f64]) -> Vec<f64>| {
        let pairs = a.values.iter().zip(&b.values);
        pairs.map(|(a, b)| lexicographic(&of(a), &of(b))).find(|order| order.is_ne())
    };
    compare(&way)
        .unwrap_or(Ordering::Equal)
        .then_with(|| compare(&raw).unwrap_or(Ordering::Equal))
        .then_with(|| lexicographic(&a.times, &b.times))
        .then_with(|| a.name.cmp(&b.name))
}

fn lexicographic(a: &[f64], b: &[f64]) -> Ordering {
    let differ = a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne());
    differ.unwrap_or_else(|| a.len().cmp(&b.len()))
}

/// How many of the `free` samples beside a block come before it: any number, so that on neither
/// side too few are left to show motion.
fn place(free: usize, generator: &mut Pcg64) -> usize {
    let before = generator.random_range(0..=free);
    match (before, free - before) {
        (1..LEAST, _) => 0,
        (_, 1..LEAST) => free,
        _ => before,
    }
}

impl Run {
    fn key(&self) -> Key {
        let step = |values: &Vec<f64>| way(values.get(..2).unwrap_or(values)).get(1).copied();
        let steps = self.values.iter().map(|values| step(values).unwrap_or(f64::NAN).to_bits());
        (self.times.len(), steps.collect())
    }

    /// How often the slowest observable goes to and fro around its mean. Changes of less than
    /// its standard deviation are not counted: noise makes them too.
    fn turns(&self) -> f64 {
        let swings = |column: &Vec<f64>| {
            let known = || column.iter().filter(|x| x.is_finite());
            let count = known().count().max(1) as f64;
            let mean = known().sum::<f64>() / count;
            let half = 0.5 * (known().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt();
            let mut sides: Vec<bool> =
                known().filter(|x| (*x - mean).abs() > half).map(|x| *x > mean).collect();
            sides.dedup();
            (half > 0.0).then(|| 0.5 * sides.len().saturating_sub(1) as f64)
        };
        self.values.iter().filter_map(swings).reduce(f64::min).unwrap_or(0.0)
    }

    /// The samples from number `start` up to, but not including, number `end`.
    fn part(&self, name: String, start: usize, end: usize) -> Run {
        fn cut<T: Copy>(all: &[T], start: usize, end: usize) -> Vec<T> {
            all.iter().take(end).skip(start).copied().collect()
        }
        Run {
            name,
            times: cut(&self.times, start, end),
            values: self.values.iter().map(|v| cut(v, start, end)).collect(),
            errors: self.errors.iter().map(|v| cut(v, start, end)).collect(),
            lines: cut(&self.lines, start, end),
            clock: self.clock,
            inputs: self.inputs.iter().map(|v| cut(v, start, end)).collect(),
            // Parts of a run share its number.
            groups: (0..self.groups.len()).map(|by| self.group(by).to_string()).collect(),
        }
    }
}

/// Puts data sets of the same observables together, in whichever order each has them. A run
/// whose name is already taken gets a number: `1 (2)`.
///
/// # Errors
/// Two data sets have different observables.
pub fn concatenate(sets: &[Dataset]) -> Result<Dataset> {
    let Some(first) = sets.first() else {
        return Ok(Dataset::default());
    };
    let mut all = first.with(Vec::new());
    let mut names = HashSet::new();
    for set in sets {
        let places: Option<Vec<usize>> = first
            .observables
            .iter()
            .map(|name| set.observables.iter().position(|other| other == name))
            .collect();
        let places =
            places.filter(|places| places.len() == set.observables.len()).ok_or_else(|| {
                Error::new(
                    ErrorKind::InvalidArgument,
                    format!(
                        "data sets of {} and of {} cannot be put together",
                        first.observables.join(", "),
                        set.observables.join(", ")
                    ),
                    "give data sets of the same observables",
                )
            })?;
        for run in &set.runs {
            let mut run = run.clone();
            run.values =
                places.iter().map(|at| run.values.get(*at).cloned().unwrap_or_default()).collect();
            if !run.errors.is_empty() {
                let own = |at: &usize| run.errors.get(*at).cloned().unwrap_or_default();
                run.errors = places.iter().map(own).collect();
            }
            let plain = run.name.clone();
            let mut number = 1;
            while !names.insert(run.name.clone()) {
                number += 1;
                run.name = format!("{plain} ({number})");
            }
            all.runs.push(run);
        }
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Clock;

    fn data(lengths: &[usize]) -> Dataset {
        let run = |(at, length): (usize, &usize)| Run {
            name: at.to_string(),
            times: (0..*length).map(|i| i as f64).collect(),
            values: vec![(0..*length).map(|i| (1000 * at + i) as f64).collect()],
            lines: (2..).take(*length).collect(),
            clock: Clock::default(),
            inputs: Vec::new(),
            groups: Vec::new(),
            errors: Vec::new(),
        };
        Dataset {
            inputs: Vec::new(),
            observables: vec!["x".to_string()],
            runs: lengths.iter().enumerate().map(run).collect(),
        }
    }

    fn values(data: &Dataset) -> Vec<f64> {
        let mut all: Vec<f64> = data.runs.iter().flat_map(|r| r.values[0].clone()).collect();
        all.sort_by(f64::total_cmp);
        all
    }

    #[test]
    fn every_sample_is_on_exactly_one_side() {
        for lengths in [vec![2; 50], vec![100], vec![7, 400], vec![4], vec![10, 200, 3, 3, 3]] {
            let all = data(&lengths);
            for seed in 0..20 {
                let split = all.split_held_out(0.2, seed);
                let mut together = values(&split.training);
                together.extend(values(&split.held_out));
                together.sort_by(f64::total_cmp);
                assert_eq!(together, values(&all), "{lengths:?}: {}", split.how);
                assert!(!split.training.runs.is_empty() && !split.held_out.runs.is_empty());
                for run in split.training.runs.iter().chain(&split.held_out.runs) {
                    assert!(run.times.len() >= 2, "{lengths:?}: {}", split.how);
                    assert_eq!(run.lines.len(), run.times.len());
                }
                assert_eq!(split, all.split_held_out(0.2, seed));
            }
        }
    }

    /// Runs that differ from one another in more than where they begin.
    fn motions(lengths: &[usize]) -> Dataset {
        let mut all = data(lengths);
        for (at, run) in all.runs.iter_mut().enumerate() {
            let rate = 0.1 + 0.37 * ((7 * at + 3) % 11) as f64;
            run.values[0] = run.times.iter().map(|t| (rate * t).sin() + 0.01 * t).collect();
        }
        all
    }

    #[test]
    fn the_order_of_runs_their_units_and_signs_do_not_matter() {
        for (lengths, fraction) in [(vec![30; 9], 0.25), (vec![50, 60, 50], 0.1)] {
            let all = motions(&lengths);
            for seed in 0..10 {
                let names = |data: &Dataset| {
                    let of = |run: &Run| (run.name.clone(), run.times.clone());
                    let mut names: Vec<_> = data.runs.iter().map(of).collect();
                    names.sort_by(|a, b| a.0.cmp(&b.0));
                    names
                };
                let split = all.split_held_out(fraction, seed);
                let mut turned = all.clone();
                turned.runs.reverse();
                let mut scaled = all.clone();
                for x in scaled.runs.iter_mut().flat_map(|run| &mut run.values[0]) {
                    *x = -1000.0 * *x + 5.0;
                }
                for other in [turned, scaled] {
                    let other = other.split_held_out(fraction, seed);
                    assert_eq!(names(&other.held_out), names(&split.held_out));
                    assert_eq!(names(&other.training), names(&split.training));
                }
            }
        }
    }

    #[test]
    fn about_the_fraction_is_put_aside_and_the_seed_decides_what() {
        let all = data(&[2; 500]);
        let split = all.split_held_out(0.2, 1);
        assert_eq!(split.held_out.samples(), 200);
        assert_eq!(
            split.how,
            "100 of 500 runs (200 samples) held out: what the runs hold and the seed 1 decide which."
        );
        assert_ne!(split.held_out, all.split_held_out(0.2, 2).held_out);
        let single = data(&[1000]).split_held_out(0.3, 1);
        assert_eq!(single.held_out.samples(), 300);
    }

    #[test]
    fn runs_that_reach_furthest_are_held_out_last() {
        let mut all = motions(&[40; 10]);
        let reach = [1.0, 1.4, 0.3, 2.0, 0.9, 1.1, 0.7, 1.8, 1.6, 0.5];
        for (run, reach) in all.runs.iter_mut().zip(reach) {
            run.values[0].iter_mut().for_each(|x| *x *= reach);
        }
        for seed in 0..20 {
            let split = all.split_held_out(0.25, seed);
            let furthest = |data: &Dataset| {
                values(data)
                    .into_iter()
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
            };
            let (seen, unseen) = (furthest(&split.training), furthest(&split.held_out));
            assert!(seen.0 < unseen.0 && unseen.1 < seen.1, "{seen:?} {unseen:?}");
        }
        // Where nearly all is held out, they are, too.
        assert_eq!(all.split_held_out(0.9, 1).held_out.runs.len(), 9);
    }

    #[test]
    fn a_block_sees_a_turn_and_a_half_at_least() {
        // (turns of the slow column in the whole run, blocks that are put aside)
        for (turns, blocks) in [(1.0, 1), (6.0, 1), (12.0, 2), (18.0, 3), (80.0, 3)] {
            let mut all = data(&[1000]);
            let wave = |turns: f64| -> Vec<f64> {
                let angle = |i: usize| std::f64::consts::TAU * turns * i as f64 / 1000.0;
                (0..1000).map(|i| angle(i).sin()).collect()
            };
            all.observables.push("fast".to_string());
            all.runs[0].values = vec![wave(turns), wave(100.0)];
            let split = all.split_held_out(0.25, 3);
            assert_eq!(split.held_out.runs.len(), blocks, "{turns}: {}", split.how);
            assert_eq!(split.held_out.samples(), 250);
        }
    }

    #[test]
    fn no_part_of_a_fast_motion_is_too_short_to_show_it() {
        for samples in 4..60 {
            let mut all = data(&[samples]);
            all.runs[0].values[0] = (0..samples).map(|i| (i % 2) as f64).collect();
            for seed in 0..20 {
                for fraction in [0.1, 0.25, 0.5, 0.9] {
                    let split = all.split_held_out(fraction, seed);
                    for run in split.training.runs.iter().chain(&split.held_out.runs) {
                        assert!(run.times.len() >= 2, "{samples} {fraction}: {}", split.how);
                    }
                }
            }
        }
    }

    #[test]
    fn too_few_samples_stay_together() {
        for (lengths, fraction) in [(vec![3], 0.2), (vec![100], 0.0), (vec![100], f64::NAN)] {
            let split = data(&lengths).split_held_out(fraction, 1);
            assert_eq!(split.held_out.runs, []);
            assert!(split.how.starts_with("Nothing is held out"));
        }
    }

    #[test]
    fn data_sets_are_put_together_by_the_names_of_observables() {
        let mut one = data(&[2]);
        one.observables = vec!["x".into(), "y".into()];
        one.runs[0].values = vec![vec![1.0, 2.0], vec![3.0, f64::NAN]];
        assert_eq!(one.measured(), [2, 1]);
        let mut other = one.clone();
        other.observables.reverse();
        let all = concatenate(&[one.clone(), other]).expect("the same observables");
        assert_eq!(all.runs[1].name, "0 (2)");
        assert_eq!(all.runs[1].values[1], [1.0, 2.0]);
        assert!(concatenate(&[one, data(&[2])]).is_err());
    }
}
