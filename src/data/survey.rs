//! A first pass over a source: what it holds, and a fair sample of it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::report::{ColumnReport, DataReport, Streamed};
use super::source::{Chunk, Piece, Source};
use super::stream::FileSource;
use super::{Dataset, Run};
use crate::error::{Error, Result};

/// Longer runs are sampled in stretches of so many samples.
const STRETCH: usize = 512;

/// What a source holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Survey {
    /// Runs with at least two samples.
    pub runs: u64,
    /// Samples of all runs.
    pub samples: u64,
    /// Samples of the longest run.
    pub longest: u64,
    /// Whole runs (stretches of long ones), drawn at random so that each is as likely as any
    /// other, in the order of the source.
    pub sample: Dataset,
    /// The data report: counts and ranges of everything, the rest from the sample.
    pub report: DataReport,
}

/// Goes through a source once and keeps a sample of about `most` samples.
///
/// `watch` is told how far the pass has come, and says whether to go on. The same seed keeps
/// the same sample.
///
/// # Errors
/// Whatever is wrong with the measurements; [`Error::Interrupted`] when `watch` says no.
pub fn survey(
    source: &dyn Source,
    most: usize,
    seed: u64,
    watch: &dyn Fn(f64) -> bool,
) -> Result<Survey> {
    let observables = source.observables().to_vec();
    let mut counting = Counting::new(observables.len());
    let mut kept = Reservoir::new(most, seed);
    let mut pass = source.pass()?;
    while let Some(chunk) = pass.next()? {
        counting.take(&chunk);
        for piece in &chunk.pieces {
            kept.take(&chunk, piece);
        }
        if !watch(pass.fraction()) {
            return Err(Error::Interrupted);
        }
    }
    let runs = kept.runs(observables.len());
    let sample = Dataset { observables, runs, inputs: source.inputs().to_vec() };
    let mut report = DataReport::of(&sample);
    report.samples = usize::try_from(counting.samples).unwrap_or(usize::MAX);
    for (column, counted) in report.columns.iter_mut().zip(&counting.columns) {
        counted.put_into(column, counting.samples);
    }
    report.streamed = Some(Streamed {
        runs: counting.runs,
        sampled_runs: sample.runs.len(),
        sampled_samples: sample.samples(),
    });
    Ok(Survey {
        runs: counting.runs,
        samples: counting.samples,
        longest: counting.longest,
        sample,
        report,
    })
}

/// The survey of a file.
///
/// # Errors
/// As [`survey`], and no run with two samples.
pub fn survey_file(
    source: &FileSource,
    most: usize,
    seed: u64,
    watch: &dyn Fn(f64) -> bool,
) -> Result<Survey> {
    let mut found = survey(source, most, seed, watch)?;
    if found.sample.runs.is_empty() {
        return Err(super::table::wrong(
            source.path(),
            None,
            None,
            "no two samples of a run stand next to each other; motion takes two",
            "look at the run column; keep the rows of a run together in the file",
        ));
    }
    for (column, header) in found.report.columns.iter_mut().zip(source.headers()) {
        column.header.clone_from(header);
    }
    found.report.warnings.extend(source.notes().iter().cloned());
    found.report.source = source.report(found.report.samples)?;
    Ok(found)
}

/// Sums over all samples.
#[derive(Default)]
pub(super) struct Counting {
    pub(super) runs: u64,
    pub(super) samples: u64,
    pub(super) longest: u64,
    /// Samples so far of the run that the last chunk left open.
    open: u64,
    pub(super) columns: Vec<Counted>,
}

impl Counting {
    pub(super) fn new(columns: usize) -> Counting {
        Counting { columns: vec![Counted::default(); columns], ..Counting::default() }
    }

    pub(super) fn take(&mut self, chunk: &Chunk) {
        self.samples += chunk.times.len() as u64;
        for piece in &chunk.pieces {
            let before = if piece.begins { 0 } else { self.open };
            let length = before + piece.samples.len() as u64;
            self.longest = self.longest.max(length);
            self.open = length;
            if piece.ends && length > 1 {
                self.runs += 1;
            }
        }
        for (column, values) in self.columns.iter_mut().zip(&chunk.values) {
            column.take(values);
        }
    }
}

/// Moments of a column, merged chunk by chunk (Chan, Golub and LeVeque, Am. Stat. 37, 1983).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Counted {
    measured: u64,
    minimum: f64,
    maximum: f64,
    mean: f64,
    squares: f64,
}

impl Counted {
    fn take(&mut self, values: &[f64]) {
        let measured = || values.iter().copied().filter(|x| !x.is_nan());
        let count = measured().count();
        if count == 0 {
            return;
        }
        let mean = measured().map(|x| x / count as f64).sum::<f64>();
        let squares = measured().map(|x| (x - mean).powi(2)).sum::<f64>();
        let (least, most) =
            measured().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        self.merge(&Counted {
            measured: count as u64,
            minimum: least,
            maximum: most,
            mean,
            squares,
        });
    }

    /// The moments of both together.
    pub(super) fn merge(&mut self, other: &Counted) {
        if other.measured == 0 {
            return;
        }
        if self.measured == 0 {
            (self.minimum, self.maximum) = (other.minimum, other.maximum);
        }
        self.minimum = self.minimum.min(other.minimum);
        self.maximum = self.maximum.max(other.maximum);
        let all = (self.measured + other.measured) as f64;
        let apart = other.mean - self.mean;
        self.squares +=
            other.squares + apart * apart * self.measured as f64 * other.measured as f64 / all;
        self.mean += apart * other.measured as f64 / all;
        self.measured += other.measured;
    }

    /// How many values there were.
    pub(super) fn measured(&self) -> u64 {
        self.measured
    }

    pub(super) fn put_into(&self, column: &mut ColumnReport, samples: u64) {
        let whole = |count: u64| usize::try_from(count).unwrap_or(usize::MAX);
        let some = |number: f64| (self.measured > 0).then_some(number);
        column.measured = whole(self.measured);
        column.missing = whole(samples - self.measured);
        column.minimum = some(self.minimum);
        column.maximum = some(self.maximum);
        column.mean = some(self.mean);
        column.spread = some((self.squares / self.measured.max(1) as f64).sqrt());
    }
}

/// The stretches with the smallest of random priorities: a sample without replacement, which
/// depends on the seed and the source alone (Efraimidis and Spirakis, Inf. Process. Lett. 97,
/// 2006, with equal weights).
#[derive(Default)]
pub(super) struct Reservoir {
    most: usize,
    seed: u64,
    samples: usize,
    /// By priority, then by run and stretch.
    pub(super) kept: BTreeMap<(u64, u64, u64), Run>,
    /// The number of the first run.
    pub(super) first: u64,
    /// Stretches that the open run has given.
    stretches: u64,
}

impl Reservoir {
    pub(super) fn new(most: usize, seed: u64) -> Reservoir {
        Reservoir { most: most.max(4), seed, ..Reservoir::default() }
    }

    pub(super) fn take(&mut self, chunk: &Chunk, piece: &Piece) {
        if piece.begins {
            self.stretches = 0;
        }
        let mut start = piece.samples.start;
        while start < piece.samples.end {
            // What is left over joins the last stretch, so that no sample stands alone.
            let left = piece.samples.end - start;
            let length = if left < 2 * STRETCH { left } else { STRETCH };
            self.offer(chunk, piece, start, start + length);
            self.stretches += 1;
            start += length;
        }
    }

    fn offer(&mut self, chunk: &Chunk, piece: &Piece, start: usize, end: usize) {
        if end - start < 2 {
            return;
        }
        let number = self.first + piece.run;
        let priority = scramble(self.seed ^ scramble(scramble(number) ^ self.stretches));
        let key = (priority, number, self.stretches);
        let full = self.samples >= self.most;
        if full && self.kept.last_key_value().is_some_and(|(last, _)| key > *last) {
            return;
        }
        let whole = piece.begins && piece.ends && end - start == piece.samples.len();
        let name = piece.name.to_string();
        let part = |column: &[f64]| column.get(start..end).unwrap_or_default().to_vec();
        let run = Run {
            name: if whole { name } else { format!("{name}, part {}", self.stretches + 1) },
            times: part(&chunk.times),
            values: chunk.values.iter().map(|column| part(column)).collect(),
            lines: vec![piece.line; end - start],
            clock: piece.clock,
            inputs: Vec::new(),
            groups: Vec::new(),
            errors: Vec::new(),
        };
        self.keep(key, run);
    }

    /// Keeps a run of so high a priority, and gives up those that are then too many.
    pub(super) fn keep(&mut self, key: (u64, u64, u64), run: Run) {
        self.samples += run.times.len();
        self.kept.insert(key, run);
        while let Some(last) = self.kept.last_entry() {
            let without = self.samples - last.get().times.len();
            if without < self.most {
                break;
            }
            self.samples = without;
            last.remove();
        }
    }

    /// In the order of the source; behind so many observables stand inputs.
    pub(super) fn runs(self, observables: usize) -> Vec<Run> {
        let mut runs: Vec<((u64, u64), Run)> =
            self.kept.into_iter().map(|((_, run, part), kept)| ((run, part), kept)).collect();
        runs.sort_by_key(|(place, _)| *place);
        let mut runs: Vec<Run> = runs.into_iter().map(|(_, run)| run).collect();
        for run in runs.iter_mut().filter(|run| run.values.len() > observables) {
            run.inputs = run.values.split_off(observables);
        }
        runs
    }
}

/// The output function of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
fn scramble(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}
