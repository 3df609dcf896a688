//! Initial states of segments.

use std::ops::Range;
use std::slice::ChunksExact;

use rayon::prelude::*;

use super::blocking::BLOCKING;
use super::curve;
use super::hidden;
use super::law::Law;
use super::momenta::Momenta;
use super::segments::Segment;
use crate::data::Packed;
use crate::expr::Observed;

/// The initial state of every segment, in the order of the segments: 2n numbers each, side by
/// side in memory.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct States {
    size: usize,
    values: Vec<f64>,
    /// Numbers that every run has for itself, `[run][number]`; empty where they are not known.
    pub(super) numbers: Vec<f64>,
}

impl States {
    /// The start of every segment as it was measured: a first guess.
    ///
    /// A missing coordinate is taken from the nearest sample that has it. A missing momentum, and
    /// every momentum when velocities are observed, starts as the velocity: measured, or else the
    /// slope to the next sample. The trainer improves on all of it.
    pub fn measured(measured: &Packed, segments: &[Segment], degrees: usize) -> States {
        let size = 2 * degrees;
        let mut values = vec![0.0; size * segments.len()];
        let chunks = values.par_chunks_mut((size * BLOCKING.states_together).max(1));
        chunks.zip(segments.par_chunks(BLOCKING.states_together)).for_each(|(values, segments)| {
            for (state, &segment) in values.chunks_exact_mut(size).zip(segments) {
                first_state(measured, segment, state);
            }
        });
        States { size, values, numbers: Vec::new() }
    }

    /// The same with momenta that are nowhere measured as the law's masses times velocities.
    pub fn measured_by(law: &Law, measured: &Packed, segments: &[Segment]) -> States {
        curve::guess(law, measured);
        let mut states = States::measured(measured, segments, law.system().degrees());
        states.weigh(measured, law);
        states.set_hidden(law, measured, segments);
        states
    }

    /// Starts what nobody measures from where the spec says, or from where the law saw it last on
    /// the same clock.
    pub(super) fn set_hidden(&mut self, law: &Law, measured: &Packed, segments: &[Segment]) {
        let system = law.system();
        let degrees = system.degrees();
        for (state, segment) in self.values.chunks_exact_mut(self.size.max(1)).zip(segments) {
            let time = hidden::start_of(measured, segment);
            for part in &system.hidden {
                let known = hidden::known_near(law, part, time);
                let (value, momentum) =
                    known.map_or((part.start, part.momentum), |known| known.values);
                state[part.coordinate] = value;
                state[degrees + part.coordinate] = momentum;
            }
        }
        hidden::carry(law, measured, segments, self);
    }

    /// Makes momenta that are nowhere measured, and stand as velocities, those of a law.
    pub(super) fn weigh(&mut self, measured: &Packed, law: &Law) {
        let degrees = law.system().degrees();
        let seen = |i: usize| measured.column(degrees + i).iter().any(|x| x.is_finite());
        let seen: Vec<bool> = (0..degrees).map(seen).collect();
        let velocities = law.system().observed == Observed::Velocities;
        if (velocities || !seen.contains(&true))
            && let Some(momenta) = Momenta::of(law)
        {
            self.values.chunks_exact_mut(self.size.max(1)).for_each(|state| momenta.put(state));
            return;
        }
        if seen.iter().all(|&seen| seen) {
            return;
        }
        let Some(mut masses) = law.masses() else { return };
        masses.iter_mut().zip(seen).filter(|(_, seen)| *seen).for_each(|(mass, _)| *mass = 1.0);
        for state in self.values.chunks_exact_mut(self.size.max(1)) {
            let momenta = state[degrees..].iter_mut();
            momenta.zip(&masses).for_each(|(p, mass)| *p *= mass);
        }
    }

    /// Standard deviation of one component over all segments; none where it never changes.
    pub fn spread(&self, component: usize) -> Option<f64> {
        let count = self.len() as f64;
        let of = || self.iter().filter_map(|state| state.get(component).copied());
        let mean = of().sum::<f64>() / count;
        let variance = of().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
        (variance > 0.0 && variance.is_finite()).then(|| variance.sqrt())
    }

    /// Number of segments.
    pub fn len(&self) -> usize {
        self.values.len().checked_div(self.size).unwrap_or(0)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The state of one segment.
    pub fn of(&self, segment: usize) -> &[f64] {
        &self.values[segment * self.size..][..self.size]
    }

    /// Those of consecutive segments, `[segment][2n]`.
    pub fn part(&self, segments: Range<usize>) -> &[f64] {
        &self.values[segments.start * self.size..segments.end * self.size]
    }

    /// The state of one segment, to be changed.
    pub fn of_mut(&mut self, segment: usize) -> &mut [f64] {
        &mut self.values[segment * self.size..][..self.size]
    }

    /// All of them, `[segment][2n]`, to be changed.
    pub fn all_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// One after the other, as in the list of segments.
    pub fn iter(&self) -> ChunksExact<'_, f64> {
        self.values.chunks_exact(self.size.max(1))
    }
}

impl<S: AsRef<[f64]>> FromIterator<S> for States {
    fn from_iter<I: IntoIterator<Item = S>>(states: I) -> States {
        let mut all = States::default();
        for state in states {
            all.size = state.as_ref().len();
            all.values.extend_from_slice(state.as_ref());
        }
        all
    }
}

impl<'a> IntoIterator for &'a States {
    type Item = &'a [f64];
    type IntoIter = ChunksExact<'a, f64>;

    fn into_iter(self) -> ChunksExact<'a, f64> {
        self.iter()
    }
}

/// A first guess of a segment's initial state from its own measurements.
fn first_state(measured: &Packed, segment: Segment, state: &mut [f64]) {
    let degrees = state.len() / 2;
    let times = measured.times_of(segment.run);
    let values = |row: usize| measured.values_of(row, segment.run);
    let near = |row: usize| -> Option<f64> {
        let own = values(row).get(segment.first..=segment.last).unwrap_or_default();
        let guessed = || measured.guessed_of(row, segment.run).get(segment.first).copied();
        own.iter().copied().find(|x| x.is_finite()).or_else(guessed).filter(|x| x.is_finite())
    };
    let slope = |row: usize| -> f64 {
        let guessed = measured.guessed_of(row, segment.run);
        let values = if guessed.is_empty() { values(row) } else { guessed };
        let is_seen = |j: &usize| values.get(*j).is_some_and(|x| x.is_finite());
        let mut seen = (segment.first..=segment.last).filter(is_seen);
        match (seen.next(), seen.next()) {
            (Some(a), Some(b)) => (values[b] - values[a]) / (times[b] - times[a]),
            _ => 0.0,
        }
    };
    let (coordinates, momenta) = state.split_at_mut(degrees);
    for (i, (coordinate, momentum)) in coordinates.iter_mut().zip(momenta).enumerate() {
        *coordinate = near(i).unwrap_or(0.0);
        *momentum = near(degrees + i).unwrap_or_else(|| slope(i));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Clock, Dataset, Run};
    use crate::fit::segments::packed;
    use crate::fit::tuning::SegmentTuning;

    #[test]
    fn a_missing_momentum_starts_as_the_slope() {
        let run = Run {
            name: "1".into(),
            times: vec![0.0, 0.5, 1.0],
            values: vec![vec![0.0, 0.5, 1.0], vec![f64::NAN; 3]],
            lines: vec![0; 3],
            clock: Clock::default(),
            inputs: Vec::new(),
            groups: Vec::new(),
            errors: Vec::new(),
        };
        let data = Dataset {
            observables: vec!["q".into(), "p".into()],
            runs: vec![run],
            inputs: Vec::new(),
        };
        let segment = Segment { run: 0, first: 0, last: 2 };
        let packed = packed(&data, &SegmentTuning::default());
        assert_eq!(States::measured(&packed, &[segment; 2], 1).of(1), [0.0, 1.0]);
    }
}
