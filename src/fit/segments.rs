//! Segments: the stretches of measurement whose initial state is one unknown.

use super::blocking::BLOCKING;
use super::tuning::SegmentTuning;
use std::iter::StepBy;
use std::ops::Range;

use rayon::prelude::*;

use crate::data::{Dataset, Packed};

/// Samples `first ..= last` of one run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segment {
    /// Index of the run in the data set.
    pub run: usize,
    /// Index of the first sample.
    pub first: usize,
    /// Index of the last sample, which belongs to the segment.
    pub last: usize,
}

impl Segment {
    /// Number of samples, the first and the last included.
    pub fn samples(self) -> usize {
        self.last - self.first + 1
    }
}

/// All segments of a data set, fold after fold.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Segments {
    /// The segments, those of one fold next to each other.
    pub list: Vec<Segment>,
    /// Ranges of `list`, in each of which short segments come first. A fold holds whole runs
    /// where there are enough of them, else whole stretches of time, so that leaving one out is
    /// leaving out something held out.
    pub folds: Vec<Range<usize>>,
}

impl Segments {
    /// The segments of each fold in the order of runs and times; short ones come first here.
    pub(super) fn of(mut folds: Vec<Vec<Segment>>) -> Segments {
        folds.par_iter_mut().for_each(|fold| fold.sort_by_key(|segment| segment.samples()));
        let ends = folds.iter().scan(0, |end, fold| {
            *end += fold.len();
            Some(*end - fold.len()..*end)
        });
        Segments { folds: ends.collect(), list: folds.concat() }
    }

    /// Samples of the longest segment, which may be one more than the window it was cut with.
    pub fn longest(&self) -> usize {
        // The longest of a fold is its last.
        let last = |fold: &Range<usize>| self.list[fold.clone()].last().map(|s| s.samples());
        self.folds.iter().filter_map(last).max().unwrap_or(1)
    }

    /// How long the one lasts that lasts longest.
    pub(super) fn longest_time(&self, measured: &Packed) -> f64 {
        let time = |segment: &Segment| {
            let times = measured.times_of(segment.run);
            times[segment.last] - times[segment.first]
        };
        self.list.iter().map(time).fold(0.0, f64::max)
    }

    /// Only the first segments of each fold, at most `most` in all. Where these are few,
    /// neighbouring folds become one: narrow blocks are slow.
    pub fn thinned(&self, most: usize) -> Segments {
        let each = (most / self.folds.len().max(1)).max(1);
        let mut thin = Segments::default();
        for fold in &self.folds {
            let start = thin.list.len();
            let end = fold.end.min(fold.start + each);
            thin.list.extend_from_slice(&self.list[fold.start..end]);
            thin.folds.push(start..thin.list.len());
        }
        thin.joined(BLOCKING.lanes)
    }

    /// The same segments, neighbouring folds put together until each has about `least` of them.
    fn joined(mut self, least: usize) -> Segments {
        let each = (self.list.len() / self.folds.len().max(1)).max(1);
        let chunks = self.folds.chunks(least.div_ceil(each));
        let ends = |fold: &[Range<usize>]| Some(fold.first()?.start..fold.last()?.end);
        let folds: Vec<Range<usize>> = chunks.filter_map(ends).collect();
        for fold in &folds {
            self.list[fold.clone()].sort_by_key(|segment| segment.samples());
        }
        Segments { folds, ..self }
    }

    /// The same segments, none of which has more than its first `samples` samples.
    pub fn shortened(&self, samples: usize) -> Segments {
        let mut short = self.clone();
        for segment in &mut short.list {
            segment.last = segment.last.min(segment.first + samples.max(SHORTEST) - 1);
        }
        short
    }

    /// The stretches of each segment whose samples all meet a condition on run and sample; a single
    /// sample is none.
    pub fn stretches_where(&self, condition: impl Fn(usize, usize) -> bool) -> Segments {
        let stretches = |segment: &Segment| -> Vec<Segment> {
            let Segment { run, first, last } = *segment;
            let samples: Vec<usize> = (first..=last).collect();
            let alike = samples.chunk_by(|&a, &b| condition(run, a) == condition(run, b));
            let ends = alike.filter(|stretch| stretch.len() >= SHORTEST);
            let ends = ends.filter_map(|stretch| Some((*stretch.first()?, *stretch.last()?)));
            ends.filter(|&(first, _)| condition(run, first))
                .map(|(first, last)| Segment { run, first, last })
                .collect()
        };
        let of = |fold: &Range<usize>| self.list[fold.clone()].iter().flat_map(stretches).collect();
        Segments::of(self.folds.iter().map(of).collect())
    }

    /// Segments of at most about `samples` samples in all, taken evenly from every fold; all
    /// of them where there are no more. Folds with few segments are put together.
    pub fn spread(&self, samples: usize) -> Segments {
        let all: usize = self.list.par_iter().map(|segment| segment.samples()).sum();
        let stride = all.div_ceil(samples.max(1)).max(1);
        let mut spread = Segments::default();
        for fold in &self.folds {
            let start = spread.list.len();
            spread.list.extend(self.list[fold.clone()].iter().step_by(stride));
            spread.folds.push(start..spread.list.len());
        }
        spread.joined(BLOCKING.lanes / 2)
    }
}

/// Samples of the shortest segment: one transition.
pub const SHORTEST: usize = 2;

/// No two samples are bridged that are further apart than so many typical intervals: integrating
/// takes time in proportion, and damaged times may be anything.
const FAR: f64 = 1000.0;

/// A data set as it is worked on: runs of one fold lie next to each other.
pub fn packed(dataset: &Dataset, tuning: &SegmentTuning) -> Packed {
    Packed::of(dataset, tuning.folds)
}

/// Cuts every run into segments of so many samples at most that share no sample.
///
/// A hole that is not bridged ends a segment, and so does twice the usual duration of a window.
/// What is left over at the end of a run joins the segment before it if it is a single sample.
/// Within a fold segments are sorted by length, so that blocks of them are nearly rectangular.
pub fn cut(measured: &Packed, reach: Reach, tuning: &SegmentTuning) -> Segments {
    let runs = measured.runs();
    let rule = (reach, measured.typical_step(), tuning);
    let of = |runs: StepBy<Range<usize>>| {
        let mut segments = Vec::with_capacity(runs.len());
        for run in runs {
            let times = measured.times_of(run);
            cut_run(times, rule, times.len() == 2, true, |first, last| {
                segments.push(Segment { run, first, last });
            });
        }
        segments
    };
    let folds = if runs >= tuning.folds {
        (0..tuning.folds)
            .into_par_iter()
            .map(|fold| of((fold..runs).step_by(tuning.folds)))
            .collect()
    } else {
        let all = of((0..runs).step_by(1));
        let count = tuning.folds.min(all.len());
        let start = |fold: usize| (fold * all.len()).div_ceil(count);
        (0..count).map(|fold| all[start(fold)..start(fold + 1)].to_vec()).collect()
    };
    let mut segments = Segments::of(folds);
    segments.folds.retain(|fold| !fold.is_empty());
    segments
}

/// How far segments reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// Samples, at most.
    pub window: usize,
    /// The longest hole that is bridged, in the unit of time; 0 where none is.
    pub bridged: f64,
}

impl Reach {
    /// No hole is bridged.
    pub fn of(window: usize) -> Reach {
        Reach { window, bridged: 0.0 }
    }
}

/// Cuts one run: `take(first, last)` for each segment. Gives the sample that the next segment
/// starts from, which is the end unless more samples of the run may come (`complete` is false).
/// A `pair` is not cut for a hole, unless its samples are [`FAR`] apart.
pub(super) fn cut_run(
    times: &[f64],
    (reach, typical, tuning): (Reach, f64, &SegmentTuning),
    pair: bool,
    complete: bool,
    mut take: impl FnMut(usize, usize),
) -> usize {
    let window = reach.window.max(SHORTEST);
    let longest = tuning.slack * typical * (window - 1) as f64;
    let widest = reach.bridged.max(tuning.hole * typical);
    let mut first = 0;
    // What comes may still join a segment that reaches the last two samples.
    while first + 1 < times.len() && (complete || first + window + 2 <= times.len()) {
        let mut last = first;
        while last + 1 < times.len() && last + 1 - first < window {
            let hole = times[last + 1] - times[last] > widest;
            let long = last > first && times[last + 1] - times[first] > longest;
            let far = times[last + 1] - times[last] > FAR * typical;
            if (hole || long) && !pair || far {
                break;
            }
            last += 1;
        }
        let alone = last + 2 == times.len();
        if alone && complete && times[last + 1] - times[last] <= 2.0 * typical && last > first {
            last += 1;
        }
        if last > first {
            take(first, last);
        }
        first = last + 1;
    }
    if complete { times.len() } else { first }
}

/// First and last samples of the segments of one run, in a data set whose usual interval
/// between samples is `typical`.
pub fn stretches(
    times: &[f64],
    reach: Reach,
    typical: f64,
    tuning: &SegmentTuning,
) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let pair = times.len() == 2;
    let add = |first, last| found.push((first, last));
    cut_run(times, (reach, typical, tuning), pair, true, add);
    found
}

/// The median interval between consecutive samples; 0 when there is none.
pub fn typical_step(dataset: &Dataset) -> f64 {
    crate::data::typical_step(dataset.runs.iter().map(|run| run.times.as_slice()))
}

/// The number of samples of the longest run.
pub fn longest_run(dataset: &Dataset) -> usize {
    dataset.runs.iter().map(|run| run.times.len()).max().unwrap_or(0)
}

/// Blocks of consecutive segments that are worked on side by side. The partition depends on
/// the segments and the width alone, never on the number of threads.
pub fn blocks(segments: Range<usize>, width: usize) -> Vec<Range<usize>> {
    let width = width.max(1);
    let end = segments.end;
    segments.step_by(width).map(|start| start..(start + width).min(end)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Clock, Run};

    fn run(times: &[f64]) -> Run {
        Run {
            name: "1".into(),
            times: times.to_vec(),
            values: vec![times.to_vec(), vec![1.0; times.len()]],
            lines: vec![0; times.len()],
            clock: Clock::default(),
            inputs: Vec::new(),
            groups: Vec::new(),
            errors: Vec::new(),
        }
    }

    fn dataset(runs: Vec<Run>) -> Dataset {
        Dataset { observables: vec!["q".into(), "p".into()], runs, inputs: Vec::new() }
    }

    #[test]
    fn pairs_stay_pairs() {
        let data = dataset(vec![run(&[0.0, 0.1]), run(&[0.0, 7.0])]);
        let tuning = SegmentTuning::default();
        let all = cut(&packed(&data, &tuning), Reach::of(16), &tuning).list;
        assert_eq!(all.len(), 2);
        assert!(all.iter().all(|s| s.samples() == 2));
    }

    #[test]
    fn no_pair_bridges_what_no_integrator_would_come_across() {
        let data = dataset(vec![run(&[0.0, 0.1]), run(&[0.0, 0.2]), run(&[0.0, 1e204])]);
        let tuning = SegmentTuning::default();
        let all = cut(&packed(&data, &tuning), Reach::of(16), &tuning).list;
        assert_eq!(all.len(), 2);
        assert!(all.iter().all(|segment| segment.run < 2));
    }

    #[test]
    fn a_hole_is_bridged_where_that_is_asked_for() {
        let seasons = (0..6).flat_map(|year| (0..8).map(move |night| 20 * year + night));
        let times: Vec<f64> = seasons.map(f64::from).collect();
        let data = dataset(vec![run(&times)]);
        let tuning = SegmentTuning::default();
        let longest = |(window, bridged)| {
            cut(&packed(&data, &tuning), Reach { window, bridged }, &tuning).longest()
        };
        // A hole is 13 intervals; 16 samples last up to 30 of them, and 48 up to 94.
        assert_eq!([(48, 0.0), (48, 12.9)].map(longest), [8, 8]);
        assert_eq!([(8, 13.0), (16, 13.0), (48, 13.0)].map(longest), [8, 16, 40]);
    }

    #[test]
    fn no_segment_bridges_a_hole_and_no_sample_is_used_twice() {
        let mut times: Vec<f64> = (0..23).map(|i| i as f64 * 0.1).collect();
        times.extend((0..9).map(|i| 50.0 + i as f64 * 0.1));
        let data = dataset(vec![run(&times)]);
        for window in [2, 3, 5, 8, 64] {
            let mut used = vec![0; times.len()];
            let tuning = SegmentTuning::default();
            let segments = cut(&packed(&data, &tuning), Reach::of(window), &tuning);
            let longest = segments.list.iter().map(|segment| segment.samples()).max();
            assert_eq!(Some(segments.longest()), longest);
            for segment in segments.list {
                assert!(segment.samples() >= 2 && segment.samples() <= window + 1);
                assert!(times[segment.last] - times[segment.first] < 40.0);
                (segment.first..=segment.last).for_each(|j| used[j] += 1);
            }
            assert!(used.iter().all(|&count| count <= 1), "window {window}");
            assert!(used.iter().sum::<i32>() >= 30, "window {window}");
        }
    }
}
