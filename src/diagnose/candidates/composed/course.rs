//! The model's own trajectory over a segment, with what a small push anywhere along it does to
//! every later prediction.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::diagnose::law_on_data::LawOnData;
use crate::diagnose::settling::Settled;
use crate::dynamics::{Batch, Dynamics, KeptScratch, advance, observe};
use crate::fit::driving;
use crate::fit::segments::Segment;
use crate::fit::states::States;

/// Trajectories that are followed side by side; it changes cost alone.
const LANES: usize = 32;

/// The trajectory of one segment.
pub(super) struct Course {
    /// Time of the first point.
    pub(super) start: f64,
    /// Times of the points, from the first one on; a sample stands at every `points_between`.
    pub(super) times: Vec<f64>,
    /// States at the points.
    pub(super) states: Vec<Vec<f64>>,
    /// Inverse of the derivative of each of these states by the first.
    pub(super) inverses: Vec<DMatrix<f64>>,
    /// Derivatives of what is predicted at each sample by the first state and by the model's
    /// unknowns, `[sample][observable][2n + unknowns]`, in units of the noise; zero where nothing
    /// was measured.
    pub(super) tangents: Vec<DMatrix<f64>>,
    /// Measured less predicted in units of the noise, `[sample][observable]`.
    pub(super) residuals: Vec<Vec<f64>>,
    /// One over the noise of what was measured, zero where nothing was, `[sample][observable]`.
    pub(super) weights: Vec<Vec<f64>>,
}

/// The trajectories of some segments from their states, with `between` points from sample to
/// sample. Segments that leave the finite numbers are left out.
pub(super) fn courses(settled: &Settled, between: usize) -> Vec<Course> {
    let Settled { model, segments, states, .. } = settled;
    let dynamics = model.law.dynamics();
    let theta = model.law.theta(&dynamics);
    let all: Vec<(usize, Segment)> = segments.list.iter().copied().enumerate().collect();
    all.par_chunks(LANES)
        .map_init(KeptScratch::new, |scratch, chunk| {
            let together = Together { model, dynamics: &dynamics, theta: &theta, between };
            together.follow(chunk, states, scratch)
        })
        .flatten_iter()
        .collect()
}

/// What the trajectories of a chunk have in common.
struct Together<'a> {
    model: &'a LawOnData<'a>,
    dynamics: &'a Dynamics,
    theta: &'a [f64],
    between: usize,
}

impl Together<'_> {
    fn follow(
        &self,
        chunk: &[(usize, Segment)],
        states: &States,
        scratch: &mut KeptScratch,
    ) -> Vec<Course> {
        let &Together { model, dynamics, theta, between } = self;
        let (lanes, size) = (chunk.len(), 2 * dynamics.degrees());
        let mut batch = Batch::with_tangents(dynamics.degrees(), lanes, dynamics.unknowns());
        let columns = batch.columns();
        let measured = &model.data.packed;
        let mut courses = Vec::with_capacity(lanes);
        for (lane, (index, segment)) in chunk.iter().enumerate() {
            let times = measured.times_of(segment.run);
            let start = measured.clock_of(segment.run).time(times[segment.first]);
            batch.set(lane, start, states.of(*index));
            courses.push(Course {
                start,
                times: Vec::new(),
                states: Vec::new(),
                inverses: Vec::new(),
                tangents: Vec::new(),
                residuals: Vec::new(),
                weights: Vec::new(),
            });
        }
        let weights = model.law.weights();
        let longest = chunk.iter().map(|(_, segment)| segment.samples()).max().unwrap_or(0);
        let mut out = vec![0.0; size * lanes];
        let mut tangent = vec![0.0; size * columns * lanes];
        let mut lost = vec![false; lanes];
        for sample in 0..longest {
            if sample > 0 {
                let spans: Vec<f64> = chunk.iter().map(|(_, s)| self.span(*s, sample)).collect();
                for point in 1..=between {
                    self.move_on(&mut batch, &spans, scratch);
                    for (lane, course) in courses.iter_mut().enumerate() {
                        if sample < chunk[lane].1.samples() && !lost[lane] {
                            lost[lane] = !course.take_point(&batch, lane, spans[lane]);
                        }
                    }
                    debug_assert!(point <= between);
                }
            } else {
                for (lane, course) in courses.iter_mut().enumerate() {
                    lost[lane] = !course.take_point(&batch, lane, 0.0);
                }
            }
            let places = chunk.iter().map(|(_, segment)| driving::at(*segment, sample));
            driving::drive(&mut batch, measured, places);
            let observed = model.system().observed;
            observe(dynamics, observed, &batch, theta, &mut out, Some(&mut tangent), scratch);
            for (lane, (_, segment)) in chunk.iter().enumerate() {
                if sample >= segment.samples() || lost[lane] {
                    continue;
                }
                let at = segment.first + sample;
                let mut row_weights = Vec::with_capacity(weights.len());
                let mut residuals = Vec::with_capacity(weights.len());
                for (observable, weight) in weights.iter().enumerate() {
                    let values = measured.values_of(observable, segment.run);
                    let value = values.get(at).copied().unwrap_or(f64::NAN);
                    let known = value.is_finite();
                    row_weights.push(if known { *weight } else { 0.0 });
                    let residual = (value - out[observable * lanes + lane]) * weight;
                    residuals.push(if known { residual } else { 0.0 });
                }
                let derivative = DMatrix::from_fn(weights.len(), columns, |observable, column| {
                    tangent[(observable * columns + column) * lanes + lane]
                        * row_weights[observable]
                });
                lost[lane] = residuals.iter().chain(&derivative).any(|x| !x.is_finite());
                let course = &mut courses[lane];
                course.residuals.push(residuals);
                course.tangents.push(derivative);
                course.weights.push(row_weights);
            }
        }
        let kept = courses.into_iter().zip(lost).filter(|(_, lost)| !lost);
        kept.map(|(course, _)| course).collect()
    }

    /// Time from point to point before a sample; zero where a segment is over.
    fn span(&self, segment: Segment, sample: usize) -> f64 {
        if sample >= segment.samples() {
            return 0.0;
        }
        let times = self.model.data.packed.times_of(segment.run);
        let at = segment.first + sample;
        (times[at] - times[at - 1]) / self.between as f64
    }

    fn move_on(&self, batch: &mut Batch, spans: &[f64], scratch: &mut KeptScratch) {
        let stepping = self.model.law.stepping();
        let steps = stepping.steps(spans);
        advance(self.dynamics, stepping.method, batch, spans, steps, self.theta, scratch);
    }
}

impl Course {
    /// By how much the states at the samples, which stand at every `between`th point, were measured
    /// to be off, as far as residuals are no noise by `trust`. Where coordinates alone are measured
    /// nothing is known of momenta.
    pub(super) fn off(&self, between: usize, trust: &[f64]) -> Vec<DVector<f64>> {
        let size = self.states.first().map_or(0, Vec::len);
        let of = |(sample, tangent): (usize, &DMatrix<f64>)| {
            let (residuals, weights) = (&self.residuals[sample], &self.weights[sample]);
            let off: Vec<f64> = residuals.iter().zip(trust).map(|(r, trust)| r * trust).collect();
            if weights.len() == size && weights.iter().all(|weight| *weight > 0.0) {
                let by_state = tangent.columns(0, size) * &self.inverses[sample * between];
                let off = DVector::from_vec(off);
                return by_state.lu().solve(&off).unwrap_or_else(|| DVector::zeros(size));
            }
            let coordinate = |i: usize| match weights.get(i) {
                Some(&weight) if i < size / 2 && weight > 0.0 => off[i] / weight,
                _ => 0.0,
            };
            DVector::from_fn(size, |i, _| coordinate(i))
        };
        self.tangents.iter().enumerate().map(of).collect()
    }

    /// Takes one point of a lane in; false where it is lost.
    fn take_point(&mut self, batch: &Batch, lane: usize, span: f64) -> bool {
        let size = 2 * batch.degrees();
        let (lanes, columns) = (batch.lanes, batch.columns());
        let derivative = DMatrix::from_fn(size, size, |row, column| {
            batch.tangent[(row * columns + column) * lanes + lane]
        });
        let state = batch.get(lane);
        if !state.iter().chain(&derivative).all(|x| x.is_finite()) {
            return false;
        }
        let Some(inverse) = derivative.try_inverse() else { return false };
        let before = self.times.last().copied().unwrap_or(0.0);
        self.times.push(before + span);
        self.states.push(state);
        self.inverses.push(inverse);
        true
    }
}

/// Weights of up to four neighbouring nodes in the cubic through them.
pub(super) fn interpolation(nodes: &[f64], time: f64) -> Vec<(usize, f64)> {
    let after = nodes.partition_point(|&node| node < time);
    let width = nodes.len().min(4);
    let first = after.saturating_sub(2).min(nodes.len() - width);
    let among = first..first + width;
    let weight = |k: usize| {
        let others = among.clone().filter(|&other| other != k);
        others.map(|o| (time - nodes[o]) / (nodes[k] - nodes[o])).product::<f64>()
    };
    among.clone().map(|k| (k, weight(k))).collect()
}

/// Of each observable, the part of its residuals that is no noise.
pub(super) fn trust(courses: &[Course]) -> Vec<f64> {
    let observables = courses.iter().find_map(|course| course.weights.first()).map_or(0, Vec::len);
    let of = |observable: usize| {
        let all = courses.iter().flat_map(|course| course.residuals.iter().zip(&course.weights));
        let known = all.filter(|(_, weights)| weights[observable] > 0.0);
        let squares = known.map(|(residuals, _)| residuals[observable].powi(2));
        let (sum, count) = squares.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
        if sum > count { 1.0 - count / sum } else { 0.0 }
    };
    (0..observables).map(of).collect()
}

/// Highest angular frequency of the motion, in the sense that a harmonic motion has its own: the
/// largest ratio of a component's rate of change to its spread.
pub(super) fn frequency(courses: &[Course]) -> f64 {
    let size = courses.first().and_then(|course| course.states.first()).map_or(0, Vec::len);
    let of_component = |component: usize| {
        let values = || courses.iter().flat_map(|c| c.states.iter().map(|s| s[component]));
        let count = values().count().max(1) as f64;
        let mean = values().sum::<f64>() / count;
        let spread = values().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
        let (mut change, mut steps) = (0.0, 0.0f64);
        for course in courses {
            let states = course.states.windows(2);
            for (pair, times) in states.zip(course.times.windows(2)) {
                let span = times[1] - times[0];
                if span > 0.0 {
                    change += ((pair[1][component] - pair[0][component]) / span).powi(2);
                    steps += 1.0;
                }
            }
        }
        if spread > 0.0 { (change / steps.max(1.0) / spread).sqrt() } else { 0.0 }
    };
    (0..size).map(of_component).fold(0.0, f64::max)
}
