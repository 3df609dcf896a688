//! What a run that nobody has made yet would bring: the criterion that runs are compared by.
//!
//! If rival A is true, the run would show what A predicts. Rival B is then held against that
//! prediction together with all measurements so far, and may bend its own unknowns and the
//! run's initial state as it likes: what is still left of the difference is what the deviance
//! between the two grows by, in expectation. That is the criterion of Atkinson and Fedorov,
//! Biometrika 62, 57 (1975), with B's freedom limited by what is known of it. For a single
//! model the criterion is the variance of one coefficient (c-optimality: Elfving, Ann. Math.
//! Stat. 23, 255 (1952)).

use super::rival::{Known, Path};
use crate::data::{Clock, Dataset, Run};
use crate::diagnose::options::Options;
use crate::fit::segments::{Reach, Segment, Segments, stretches, typical_step};
use crate::fit::states::States;
use crate::fit::uncertainty::covariance;
use crate::simulate::Interval;

/// When a run is sampled.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sampling {
    /// Times of the samples, ascending.
    pub times: Vec<f64>,
    /// Usual time between samples of all measurements, this run among them.
    pub typical: f64,
}

impl Sampling {
    /// The sampling of a run at `times`, made beside the measurements so far.
    pub(super) fn beside(dataset: &Dataset, times: Vec<f64>) -> Sampling {
        let mut all = dataset.clone();
        let values = vec![vec![0.0; times.len()]; all.observables.len()];
        let lines = vec![0; times.len()];
        let (name, clock) = (String::new(), Clock::default());
        let inputs = Vec::new();
        all.runs.push(Run {
            name,
            times: times.clone(),
            values,
            lines,
            clock,
            inputs,
            groups: Vec::new(),
            errors: Vec::new(),
        });
        Sampling { times, typical: typical_step(&all) }
    }
}

/// A run that could be made.
#[derive(Debug, Clone)]
pub(super) struct PlannedRun<'a> {
    /// q, then p.
    pub start: Vec<f64>,
    pub sampling: &'a Sampling,
}

/// What is asked of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Question {
    /// Distinguish the rivals.
    Rivals,
    /// Measure this unknown of the only model: an index into its theta.
    Unknown(usize),
}

/// All that know the measurements so far, and the rules for new ones.
pub(super) struct Criterion<'a> {
    pub known: Vec<Known<'a>>,
    pub dataset: &'a Dataset,
    /// Samples of a segment.
    pub window: usize,
    /// What was chosen about the diagnosis.
    pub options: &'a Options,
    /// The motion may not leave this.
    pub motion: Vec<Interval>,
    pub question: Question,
}

impl Criterion<'_> {
    /// Pairs of (true rival, rival against it), in the order of [`Criterion::evaluate`].
    pub(super) fn pairs(&self) -> Vec<(usize, usize)> {
        let count = self.known.len();
        (0..count)
            .flat_map(|a| (0..count).filter_map(move |b| (a != b).then_some((a, b))))
            .collect()
    }

    /// What each planned_run would bring: the growth of the deviance for each of the pairs, or the
    /// standard error of the unknown. `None` where the motion is not allowed, or cannot be
    /// followed.
    pub(super) fn evaluate(&self, planned: &[PlannedRun]) -> Vec<Option<Vec<f64>>> {
        let runs: Vec<(&[f64], &[f64])> =
            planned.iter().map(|t| (t.start.as_slice(), t.sampling.times.as_slice())).collect();
        let paths: Vec<Vec<Path>> = self.known.iter().map(|known| known.predict(&runs)).collect();
        let fit: Vec<usize> =
            (0..planned.len()).filter(|&i| paths.iter().all(|of| self.allows(&of[i]))).collect();
        let (segments, of_run) = self.segments(planned, &fit);
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); fit.len()];
        let mut lost = vec![false; fit.len()];
        for (a, paths) in paths.iter().enumerate() {
            let shown = self.shown(planned, &fit, paths);
            let states = starts(&segments, &fit, paths);
            for (b, known) in self.known.iter().enumerate() {
                if a == b && self.question == Question::Rivals {
                    continue;
                }
                let rows = known.before(&shown, &segments, states.clone());
                for (i, new) in rows.folds.iter().enumerate() {
                    let mut all = known.factor.clone();
                    all.merge(new);
                    values[i].push(match self.question {
                        Question::Rivals => all.least() - known.factor.least(),
                        Question::Unknown(at) => covariance(&all, 1.0)[(at, at)].sqrt(),
                    });
                    lost[i] |= new.rows() < of_run[i];
                }
            }
        }
        let mut out: Vec<Option<Vec<f64>>> = vec![None; planned.len()];
        for ((i, values), lost) in fit.into_iter().zip(values).zip(lost) {
            if !lost && values.iter().all(|value| !value.is_nan()) {
                out[i] = Some(values);
            }
        }
        out
    }

    /// The growth of the deviance for each of the pairs, every rival refitted in full to the
    /// measurements so far and what the true one predicts. `None` as in [`Criterion::evaluate`].
    pub(super) fn evaluate_in_full(&self, planned_run: &PlannedRun) -> Option<Vec<f64>> {
        let runs = [(planned_run.start.as_slice(), planned_run.sampling.times.as_slice())];
        let planned = std::slice::from_ref(planned_run);
        let paths: Vec<Vec<Path>> = self.known.iter().map(|known| known.predict(&runs)).collect();
        if !paths.iter().all(|of| self.allows(&of[0])) {
            return None;
        }
        let (added, _) = self.segments(planned, &[0]);
        let run = self.dataset.runs.len();
        let mut values = Vec::new();
        for (a, b) in self.pairs() {
            let known = &self.known[b];
            let mut all = self.dataset.clone();
            all.runs.extend(self.shown(planned, &[0], &paths[a]).runs);
            let mut segments = known.segments.clone();
            let before = segments.list.len();
            segments.list.extend(added.list.iter().map(|s| Segment { run, ..*s }));
            segments.folds.push(before..segments.list.len());
            let new = starts(&added, &[0], &paths[a]);
            let states: States = known.states.iter().chain(&new).collect();
            values.push(known.refitted(&all, &segments, states) - known.sums.loss);
        }
        values.iter().all(|value| value.is_finite()).then_some(values)
    }

    fn allows(&self, path: &Path) -> bool {
        path.states.iter().all(|state| {
            let inside = |(x, side): (&f64, &Interval)| *x >= side.lower && *x <= side.upper;
            state.iter().zip(&self.motion).all(inside)
        })
    }

    /// Segments of the chosen planned, one fold each, and how many residuals each must bring.
    fn segments(&self, planned: &[PlannedRun], chosen: &[usize]) -> (Segments, Vec<usize>) {
        let measured = self.dataset.measured().into_iter().filter(|&count| count > 0).count();
        let state = self.known.first().map_or(0, |known| 2 * known.dynamics.degrees());
        let mut segments = Segments::default();
        let mut residuals = Vec::with_capacity(chosen.len());
        for (run, &i) in chosen.iter().enumerate() {
            let Sampling { times, typical } = planned[i].sampling;
            let from = segments.list.len();
            let reach = Reach::of(self.window);
            let mut parts = stretches(times, reach, *typical, &self.options.fit.segments);
            // Side by side, segments of one length waste no samples.
            parts.sort_by_key(|(first, last)| (last - first, *first));
            let of = |(first, last)| Segment { run, first, last };
            segments.list.extend(parts.into_iter().map(of));
            let new = &segments.list[from..];
            residuals
                .push(new.iter().map(|s| (s.samples() * measured).saturating_sub(state)).sum());
            segments.folds.push(from..segments.list.len());
        }
        (segments, residuals)
    }

    /// What the chosen planned would show if the paths were true, without noise.
    fn shown(&self, planned: &[PlannedRun], chosen: &[usize], paths: &[Path]) -> Dataset {
        let measured = self.dataset.measured();
        let runs = chosen.iter().map(|&i| {
            let times = planned[i].sampling.times.clone();
            let values = paths[i].observed.iter().zip(&measured).map(|(values, &count)| {
                if count > 0 { values.clone() } else { vec![f64::NAN; values.len()] }
            });
            Run {
                name: String::new(),
                values: values.collect(),
                lines: vec![0; times.len()],
                times,
                clock: Clock::default(),
                inputs: Vec::new(),
                groups: Vec::new(),
                errors: Vec::new(),
            }
        });
        let observables = self.dataset.observables.clone();
        Dataset { observables, runs: runs.collect(), inputs: Vec::new() }
    }
}

/// Initial states of segments on the chosen paths.
fn starts(segments: &Segments, chosen: &[usize], paths: &[Path]) -> States {
    let state = |s: &Segment| &paths[chosen[s.run]].states[s.first];
    segments.list.iter().map(state).collect()
}
