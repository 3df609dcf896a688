//! A block: segments side by side, with what was measured of them.

use super::driving::OwnInputs;
use super::pass::Problem;
use super::segments::Segment;
use crate::data::Packed;

/// Segments that are worked on side by side. Their measurements are gathered once: a block is
/// integrated again and again until its states are settled.
pub(super) struct Block<'a> {
    /// One segment a lane.
    pub(super) segments: &'a [Segment],
    /// Samples of the longest segment.
    pub(super) samples: usize,
    /// Time of the first sample of each lane.
    pub(super) starts: Vec<f64>,
    /// Time to each sample from the one before, `[sample][lane]`; zero where a segment is over.
    spans: Vec<f64>,
    /// `[sample][observable][lane]`; not a number where nothing was measured.
    measured: Vec<f64>,
    /// One over the standard error of each of these, as part of the middle one; empty where columns
    /// have none.
    precisions: Vec<f64>,
    /// What inputs do from each sample to the next, `[sample][input][power][lane]`.
    driving: Vec<f64>,
    /// Inputs, and coefficients of each.
    driven: (usize, usize),
    /// Measured values of each lane.
    pub(super) counts: Vec<usize>,
    observables: usize,
}

impl<'a> Block<'a> {
    /// Gathers what was measured of some segments of a problem.
    pub(super) fn gather(problem: &Problem, segments: &'a [Segment]) -> Block<'a> {
        let (measured, observables) = (problem.measured, problem.weights.len());
        let lanes = segments.len();
        let samples = segments.iter().map(|s| s.samples()).max().unwrap_or(0);
        let driven = problem.own.beside(measured.driven());
        let mut block = Block {
            segments,
            samples,
            starts: Vec::with_capacity(lanes),
            spans: vec![0.0; samples * lanes],
            measured: vec![f64::NAN; samples * observables * lanes],
            precisions: Vec::new(),
            driving: vec![0.0; samples * driven.0 * driven.1 * lanes],
            driven,
            counts: vec![0; lanes],
            observables,
        };
        block.gather_inputs(measured, problem.own);
        for (lane, segment) in segments.iter().enumerate() {
            let times = &measured.times_of(segment.run)[segment.first..=segment.last];
            block.starts.push(measured.clock_of(segment.run).time(times[0]));
            for (sample, pair) in times.windows(2).enumerate() {
                block.spans[(sample + 1) * lanes + lane] = pair[1] - pair[0];
            }
        }
        for observable in 0..observables {
            for (lane, segment) in segments.iter().enumerate() {
                let values = measured.values_of(observable, segment.run);
                let values = values.get(segment.first..=segment.last).unwrap_or_default();
                for (sample, &x) in values.iter().enumerate().filter(|(_, x)| x.is_finite()) {
                    block.measured[(sample * observables + observable) * lanes + lane] = x;
                    block.counts[lane] += 1;
                }
                let errors = measured.errors_of(observable, segment.run);
                let errors = errors.get(segment.first..=segment.last).unwrap_or_default();
                if !errors.is_empty() && block.precisions.is_empty() {
                    block.precisions = vec![1.0; samples * observables * lanes];
                }
                for (sample, error) in errors.iter().enumerate() {
                    block.precisions[(sample * observables + observable) * lanes + lane] =
                        1.0 / error;
                }
            }
        }
        block
    }

    fn gather_inputs(&mut self, measured: &Packed, own: OwnInputs) {
        let (lanes, (inputs, powers)) = (self.lanes(), self.driven);
        let recorded = inputs - own.count;
        let mut coefficients = vec![0.0; powers];
        for (lane, segment) in self.segments.iter().enumerate() {
            for (sample, at) in (segment.first..=segment.last).enumerate() {
                for (input, value) in (recorded..).zip(own.of(segment.run)) {
                    self.driving[(sample * inputs + input) * powers * lanes + lane] = *value;
                }
                for input in 0..recorded {
                    let ends = at == segment.last;
                    measured.driving(input, segment.run, at, ends, &mut coefficients);
                    let first = (sample * inputs + input) * powers * lanes + lane;
                    let places = self.driving[first..].iter_mut().step_by(lanes);
                    places.zip(&coefficients).for_each(|(place, x)| *place = *x);
                }
            }
        }
    }

    /// Inputs, and coefficients of each.
    pub(super) fn driven(&self) -> (usize, usize) {
        self.driven
    }

    /// What inputs do from a sample to the next, `[input][power][lane]`.
    pub(super) fn driving(&self, sample: usize) -> &[f64] {
        let size = self.driven.0 * self.driven.1 * self.lanes();
        &self.driving[sample * size..][..size]
    }

    /// Number of segments.
    pub(super) fn lanes(&self) -> usize {
        self.segments.len()
    }

    /// Time of each lane to a sample from the one before.
    pub(super) fn span(&self, sample: usize) -> &[f64] {
        &self.spans[sample * self.lanes()..][..self.lanes()]
    }

    /// How much more than a middle one each of these says, as a factor of its residual; `None`
    /// where no column holds standard errors.
    pub(super) fn precisions(&self, sample: usize, observable: usize) -> Option<&[f64]> {
        let row = sample * self.observables + observable;
        self.precisions.get(row * self.lanes()..(row + 1) * self.lanes())
    }

    /// What was measured of an observable at a sample, one number a lane; not a number where
    /// nothing was.
    pub(super) fn measured(&self, sample: usize, observable: usize) -> &[f64] {
        let row = sample * self.observables + observable;
        &self.measured[row * self.lanes()..][..self.lanes()]
    }
}
