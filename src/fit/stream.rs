//! Passes over data that are larger than memory.
//!
//! A pass reads a source from the first chunk to the last. Of every chunk only the triangular
//! factors stay, one for each fold: initial states are settled anew from the measurements in
//! every pass, for keeping them would take as much memory as the data. While one chunk is worked
//! on the next one is read and cut, by the same threads.
//!
//! Who makes the passes is behind [`Passes`]: this process ([`Whole`]), or many that have a part of
//! the data each ([`parts`](super::parts)).

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use rayon::prelude::*;

use super::monitor::Monitor;
use super::pass::{FoldPass, FoldResult, Linearised, Problem, block_width, shares};
use super::segments::{Reach, Segment, Segments, blocks, cut_run};
use super::states::States;
use super::tuning::SegmentTuning;
use crate::data::{Chunk, Clock, MeasuredInput, Packed, PartPlace, Source, Survey};
use crate::dynamics::{Dynamics, KeptScratch, Scratch};
use crate::error::{Error, Result};
use crate::expr::System;

/// What a pass over all data is asked for.
#[derive(Clone, Copy)]
pub struct Asked<'a> {
    /// What is learned; both dynamics are of it.
    pub(super) system: &'a System,
    pub(super) problem: &'a Problem<'a>,
    /// The dynamics that states are settled by.
    pub(super) present: (&'a Dynamics, &'a [f64]),
    /// The one of the same law that residuals are linearised by.
    pub(super) by: (&'a Dynamics, &'a [f64]),
    /// The typical step of the data, as the sample shows it.
    pub(super) typical: f64,
    /// Whether whole runs go into one fold, or stretches of time.
    pub(super) by_runs: bool,
}

/// What a pass leaves.
pub struct Passed {
    /// One for each fold.
    pub(super) folds: Vec<FoldResult>,
    pub(super) segments: u64,
    pub(super) transitions: u64,
}

/// Is told transitions that were passed over, as far as they are known, and how far the pass has
/// come (0 to 1); says whether to go on.
pub type Watch<'a> = &'a dyn Fn(Option<u64>, f64) -> bool;

/// Whoever can pass over all data.
pub trait Passes: Sync {
    /// One pass; none where it was stopped.
    ///
    /// # Errors
    /// Whatever is wrong with the data, or with those who pass over them.
    fn pass(&self, asked: &Asked, watch: Watch) -> Result<Option<Passed>>;
}

/// A source that this process reads from its beginning to its end.
pub struct Whole<'a>(pub &'a dyn Source);

impl Passes for Whole<'_> {
    fn pass(&self, asked: &Asked, watch: Watch) -> Result<Option<Passed>> {
        pass_over(self.0, asked, PartPlace::default(), watch)
    }
}

/// Data that are read anew in every pass.
pub struct Stream<'a> {
    passes: &'a dyn Passes,
    system: &'a System,
    monitor: &'a dyn Monitor,
    /// Runs and samples in all.
    runs: u64,
    samples: u64,
    /// The typical step of the data, as the sample shows it.
    typical: f64,
    kept: Mutex<Kept>,
}

#[derive(Default)]
struct Kept {
    failure: Option<Error>,
    passes: usize,
    segments: usize,
}

impl<'a> Stream<'a> {
    /// Passes over the data of a system, which `survey` is of.
    pub fn new(
        passes: &'a dyn Passes,
        system: &'a System,
        survey: &Survey,
        typical: f64,
        monitor: &'a dyn Monitor,
    ) -> Self {
        Stream {
            passes,
            system,
            monitor,
            runs: survey.runs,
            samples: survey.samples,
            typical,
            kept: Mutex::new(Kept::default()),
        }
    }

    /// Runs and samples in all, and segments that the last whole pass cut them into.
    pub fn counts(&self) -> (usize, usize, usize) {
        let whole = |count: u64| usize::try_from(count).unwrap_or(usize::MAX);
        (whole(self.runs), whole(self.samples), self.kept().segments)
    }

    /// What went wrong with the source, if anything did. Passes that failed leave no numbers.
    pub fn failure(&self) -> Option<Error> {
        self.kept().failure.take()
    }

    /// Whether something went wrong with the source.
    pub fn failed(&self) -> bool {
        self.kept().failure.is_some()
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// One pass: states settled by one dynamics, residuals linearised by another of the same law.
    ///
    /// Stopped or failed, it gives no rows and an infinite loss.
    pub(super) fn pass(
        &self,
        problem: &Problem,
        present: (&Dynamics, &[f64]),
        by: (&Dynamics, &[f64]),
    ) -> Linearised {
        let clock = Instant::now();
        match self.through(problem, present, by) {
            Ok(Some((linearised, transitions))) => {
                self.monitor.passed(transitions, clock.elapsed().as_secs_f64());
                linearised
            }
            Ok(None) => Linearised::nothing(by.0.unknowns(), problem.weights.len()),
            Err(error) => {
                self.kept().failure.get_or_insert(error);
                Linearised::nothing(by.0.unknowns(), problem.weights.len())
            }
        }
    }

    fn through(
        &self,
        problem: &Problem,
        present: (&Dynamics, &[f64]),
        by: (&Dynamics, &[f64]),
    ) -> Result<Option<(Linearised, u64)>> {
        let clock = Instant::now();
        let number = {
            let mut kept = self.kept();
            kept.passes += 1;
            kept.passes
        };
        self.monitor.stage(&format!("pass {number} over all data"), 0.0);
        let watch = |transitions: Option<u64>, fraction: f64| {
            let rate =
                transitions.map(|t| t as f64 / clock.elapsed().as_secs_f64().max(1e-9) / 1e6);
            let rate = rate
                .map_or(String::new(), |rate| format!(", {rate:.2} million transitions a second"));
            self.monitor.stage(&format!("pass {number} over all data{rate}"), fraction);
            !(self.monitor.stopped() || self.failed())
        };
        let asked = Asked {
            system: self.system,
            problem,
            present,
            by,
            typical: self.typical,
            by_runs: self.runs >= problem.tuning.segments.folds as u64,
        };
        let Some(Passed { folds, segments, transitions }) = self.passes.pass(&asked, &watch)?
        else {
            return Ok(None);
        };
        self.kept().segments = usize::try_from(segments).unwrap_or(usize::MAX);
        Ok(Some((Linearised::of(folds, problem.weights.len()), transitions)))
    }
}

/// One pass over a source, which stands there among all data.
pub(super) fn pass_over(
    source: &dyn Source,
    asked: &Asked,
    place: PartPlace,
    watch: Watch,
) -> Result<Option<Passed>> {
    let Asked { problem, present, by, .. } = *asked;
    // What is left over at the end of a run may make a segment one longer.
    let window = problem.window + 1;
    let folds = problem.tuning.segments.folds;
    let mut cutter = Cutter {
        window: problem.window,
        typical: asked.typical,
        by_runs: asked.by_runs,
        tuning: &problem.tuning.segments,
        inputs: source.inputs(),
        observables: problem.weights.len(),
        tail: Chunk::default(),
        runs_before: place.runs_before,
        carried: place.carried,
        before: place.samples_before,
    };
    let (unknowns, observables) = (by.0.unknowns(), problem.weights.len());
    let shares = shares(unknowns);
    let mut parts = vec![FoldPass::new(unknowns, observables); folds * shares];
    let (mut segments, mut transitions) = (0, 0);
    let mut pass = source.pass()?;
    let mut next = pass.next()?.map(|chunk| cutter.cut(chunk));
    while let Some((measured, cut)) = next.take() {
        if !watch(Some(transitions), pass.fraction()) {
            return Ok(None);
        }
        segments += cut.list.len() as u64;
        transitions += cut.list.iter().map(|s| s.samples() as u64 - 1).sum::<u64>();
        let here = Problem { measured: &measured, segments: &cut, stream: None, ..*problem };
        let (read, ()) = rayon::join(
            || pass.next().map(|chunk| chunk.map(|chunk| cutter.cut(chunk))),
            || {
                let of_thread = KeptScratch::new;
                parts.par_iter_mut().enumerate().with_max_len(1).for_each_init(
                    of_thread,
                    |scratch, part| {
                        let (at, part) = part;
                        let range = share(&cut.folds[at / shares], at % shares, shares);
                        work(&here, window, present, by, range, part, scratch);
                    },
                );
            },
        );
        next = read?;
    }
    watch(Some(transitions), 1.0);
    let mut left = parts.into_iter().map(FoldPass::finish);
    let folds = (0..folds)
        .filter_map(|_| FoldResult::together(left.by_ref().take(shares).collect()))
        .collect();
    Ok(Some(Passed { folds, segments, transitions }))
}

/// One of so many shares of a range.
fn share(range: &Range<usize>, at: usize, shares: usize) -> Range<usize> {
    let end = |at: usize| range.start + range.len() * at / shares;
    end(at)..end(at + 1)
}

/// Takes some segments of one fold of a chunk in.
fn work(
    problem: &Problem,
    window: usize,
    present: (&Dynamics, &[f64]),
    by: (&Dynamics, &[f64]),
    range: Range<usize>,
    fold: &mut FoldPass,
    scratch: &mut Scratch,
) {
    let degrees = present.0.degrees();
    let width = block_width(problem, window, 2 * degrees + by.0.unknowns() + 1);
    for part in blocks(range, width) {
        let segments = &problem.segments.list[part];
        let mut states = States::measured(problem.measured, segments, degrees);
        fold.settle_and_take(problem, (present, by), segments, states.all_mut(), None, scratch);
    }
    fold.flush();
}

/// Cuts chunk after chunk into the segments that the whole data would be cut into.
struct Cutter<'a> {
    tuning: &'a SegmentTuning,
    /// What drives the motion; its columns stand behind those of the observables.
    inputs: &'a [MeasuredInput],
    observables: usize,
    window: usize,
    typical: f64,
    /// Whether whole runs go into one fold, or stretches of time.
    by_runs: bool,
    /// The end of the last chunk, from which the next segment starts.
    tail: Chunk,
    /// Runs before the source's first.
    runs_before: u64,
    /// Samples that sources before have of the next run, before the first chunk.
    carried: u64,
    /// Samples before the next chunk.
    before: u64,
}

impl Cutter<'_> {
    fn cut(&mut self, mut chunk: Chunk) -> (Packed, Segments) {
        let carried = self.tail.times.len();
        if carried > 0 {
            let tail = std::mem::take(&mut self.tail);
            chunk.times.splice(0..0, tail.times);
            for (values, carried) in chunk.values.iter_mut().zip(tail.values) {
                values.splice(0..0, carried);
            }
            for (at, piece) in chunk.pieces.iter_mut().enumerate() {
                piece.samples.start += if at == 0 { 0 } else { carried };
                piece.samples.end += carried;
            }
        }
        let each = chunk.times.len() / 2 / self.tuning.folds;
        let mut folds: Vec<Vec<Segment>> =
            (0..self.tuning.folds).map(|_| Vec::with_capacity(each)).collect();
        let mut left = chunk.times.len();
        let far = chunk.pieces.iter().any(|piece| piece.clock != Clock::default());
        for (at, piece) in chunk.pieces.iter().enumerate() {
            let times = &chunk.times[piece.samples.clone()];
            let pair = piece.begins && piece.ends && times.len() == 2;
            // What is left of a segment that another source began comes first, by itself.
            let begun = (std::mem::take(&mut self.carried) % self.window as u64) as usize;
            let rest = if begun > 0 { (self.window - begun).min(times.len()) } else { 0 };
            let rule = (Reach::of(self.window), self.typical, self.tuning);
            let mut push = |first: usize, last: usize| {
                let start = piece.samples.start;
                let place = self.before + (start + first).saturating_sub(carried) as u64;
                let run = self.runs_before + piece.run;
                let fold = if self.by_runs { run } else { place / self.tuning.stretch };
                let segment = Segment {
                    run: if far { at } else { 0 },
                    first: start + first,
                    last: start + last,
                };
                folds[(fold % self.tuning.folds as u64) as usize].push(segment);
            };
            cut_run(&times[..rest], rule, false, true, &mut push);
            let next = rest
                + cut_run(&times[rest..], rule, pair, piece.ends, |first, last| {
                    push(rest + first, rest + last);
                });
            if !piece.ends {
                left = piece.samples.start + next;
            }
        }
        self.before += (chunk.times.len() - carried) as u64;
        self.tail = Chunk {
            times: chunk.times[left..].to_vec(),
            values: chunk.values.iter().map(|values| values[left..].to_vec()).collect(),
            pieces: Vec::new(),
        };
        let (measured, segments) = side_by_side(&chunk, far, Segments::of(folds));
        (measured.driven_by(self.observables, self.inputs), segments)
    }
}

/// What was measured of some segments of a chunk, one after the other as they are passed over: in
/// the chunk those of a fold lie far apart. With `far`, each segment's run is its piece.
fn side_by_side(chunk: &Chunk, far: bool, mut segments: Segments) -> (Packed, Segments) {
    let list = &segments.list;
    let samples = list.iter().map(|segment| segment.samples()).sum();
    let of = |column: &Vec<f64>| {
        let mut own = Vec::with_capacity(samples);
        list.iter().for_each(|segment| own.extend(&column[segment.first..=segment.last]));
        own
    };
    let (times, values) =
        rayon::join(|| of(&chunk.times), || chunk.values.par_iter().map(of).collect());
    let mut end = 0;
    for segment in &mut segments.list {
        let first = end;
        end += segment.samples();
        *segment = Segment { first, last: end - 1, ..*segment };
    }
    let clocks = || chunk.pieces.iter().map(|piece| piece.clock).collect();
    let measured = match far {
        true => Packed::runs_of(times, values, clocks()),
        false => Packed::run_of(times, values),
    };
    (measured, segments)
}
