//! The first-order trainer: mini-batches, adjoint gradients and a proximal step.
//!
//! Objective: mean loss of the predictions from measured starts plus lambda |theta|_1, as in the
//! paper (DiPietro, Xiong and Zhu, 2020, eq. 6). Its work a step does not grow with the square
//! of the function space, so it screens spaces that no triangular factor fits. What survives is
//! handed to Gauss-Newton, which knows about noise in the starts and gives standard errors.
//!
//! Adam: Kingma and Ba, ICLR 2015, algorithm 1. Proximal step: Parikh and Boyd, Proximal
//! Algorithms, 2014, section 4.2.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::driving;
use super::law::Law;
use super::monitor::Monitor;
use super::options::Options;
use super::pass::Stepping;
use super::path::soft_threshold;
use super::rounding::{NOT_ZERO, WHOLE_STEPS};
use super::scales::scales;
use super::segments::{Reach, Segment, cut, packed};
use super::states::States;
use super::stepping;
use crate::data::{Dataset, Packed};
use crate::dynamics::{
    Batch, Dynamics, Method, Recording, Scratch, advance, observe, pull_back_observed,
};
use crate::error::{Error, ErrorKind, Result};
use crate::eval::Backend;
use crate::expr::System;

/// What screening found.
#[derive(Debug, Clone)]
pub struct Screening {
    /// What it came to: the support are the terms whose coefficient is not zero, of which there
    /// are too many still. It is known from single steps, and its noise is not.
    pub law: Law,
    /// For each penalty: lambda, mean loss on held-back segments, number of survivors.
    pub history: Vec<(f64, f64, usize)>,
    /// Gradient steps that were taken.
    pub steps: usize,
    /// Whether it was stopped before the last penalty.
    pub interrupted: bool,
}

/// Trains over the whole function space, with penalties from strong to weak; the held-back
/// segments choose the penalty.
///
/// # Errors
///
/// When no transition can be predicted from a measured start.
pub fn screen(
    system: &Arc<System>,
    dataset: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Screening> {
    let tuning = &options.tuning.first_order;
    let mut trainer = ProximalDescent::new(system, dataset, options)?;
    let everything = trainer.dynamics.active().len();
    let mut theta = trainer.start(system);
    trainer.measure_columns(&theta);
    let largest = trainer.largest_penalty(&theta);
    let mut best: Option<(f64, Vec<f64>)> = None;
    let mut history = Vec::new();
    let mut interrupted = false;
    for (i, share) in tuning.penalties.into_iter().enumerate() {
        monitor.stage("first-order screening", i as f64 / tuning.penalties.len() as f64);
        let lambda = share * largest;
        interrupted = trainer.descend(&mut theta, lambda, monitor);
        let held_back = trainer.loss_on(&trainer.held_back.clone(), &theta);
        let survivors = theta[..everything].iter().filter(|x| **x != 0.0).count();
        history.push((lambda, held_back, survivors));
        let worse = best.as_ref().is_some_and(|(least, _)| held_back > tuning.worse * least);
        if best.as_ref().is_none_or(|(least, _)| held_back < tuning.better * least) {
            best = Some((held_back, theta.clone()));
        }
        if worse || interrupted {
            break;
        }
    }
    let theta = best.map(|(_, theta)| theta).unwrap_or(theta);
    let mut parameters: Vec<f64> =
        system.parameters.iter().map(|p| p.bounds.clamp(p.start)).collect();
    for (id, &value) in trainer.dynamics.parameters().iter().zip(&theta[everything..]) {
        parameters[id.position()] = value;
    }
    let terms = trainer.dynamics.active().iter().copied().zip(theta[..everything].iter().copied());
    let survivors = terms.filter(|(_, value)| *value != 0.0).collect();
    let stepping = Stepping { method: trainer.method, longest: trainer.longest };
    let known = (stepping, options.window.unwrap_or(tuning.window));
    Ok(Screening {
        law: Law::new(system.clone(), survivors, parameters, Vec::new(), known)?,
        history,
        steps: trainer.steps,
        interrupted,
    })
}

/// How much each term, for its size, would change the loss of a law (of one without terms, where
/// there is none yet), in the order of the system's terms: the gradient over the norm of the term's
/// column. One number a term; work does not grow with their square.
///
/// # Errors
///
/// As [`screen`].
pub fn correlations(
    system: &System,
    law: Option<&Law>,
    dataset: &Dataset,
    options: &Options,
) -> Result<Vec<f64>> {
    let mut trainer = ProximalDescent::new(system, dataset, options)?;
    let terms = trainer.dynamics.active().len();
    let theta = match law {
        Some(law) => law.theta(&trainer.dynamics),
        None => trainer.empty(),
    };
    trainer.measure_columns(&theta);
    let all = trainer.training.clone();
    let gradient = trainer.full_gradient(&all, &theta);
    let slopes = gradient.iter().zip(&trainer.norms).map(|(g, norm)| (g / norm).abs());
    Ok(slopes.take(terms).map(|x| if x.is_finite() { x } else { 0.0 }).collect())
}

struct ProximalDescent<'a> {
    system: &'a System,
    measured: Packed,
    options: &'a Options,
    dynamics: Dynamics,
    method: Method,
    longest: f64,
    training: Vec<Segment>,
    held_back: Vec<Segment>,
    /// One over the typical change of each observable.
    weights: Vec<f64>,
    /// Norm of each column; theta times norm is what the steps are taken in.
    norms: Vec<f64>,
    /// First and second moments of Adam.
    moments: (Vec<f64>, Vec<f64>),
    steps: usize,
    generator: Pcg64,
    scratch: Scratch,
}

impl<'a> ProximalDescent<'a> {
    fn new(system: &'a System, dataset: &Dataset, options: &'a Options) -> Result<Self> {
        let tuning = &options.tuning.first_order;
        let dynamics = Dynamics::whole(system, Backend::default());
        let measured = packed(dataset, &options.tuning.segments);
        let typical = measured.typical_step();
        let scales = scales(&measured, 2 * system.degrees());
        let rounding: Vec<f64> = scales.iter().map(|scale| scale.rounding).collect();
        let separable = dynamics.separable();
        let integrator = stepping::coarse(system, options, separable, typical, &rounding)?;
        let reach = Reach::of(options.window.unwrap_or(tuning.window));
        let segments = cut(&measured, reach, &options.tuning.segments).list;
        let (held_back, training): (Vec<_>, Vec<_>) = segments
            .into_iter()
            .enumerate()
            .partition(|(i, _)| i % tuning.held_back == tuning.held_back - 1);
        let strip = |list: Vec<(usize, Segment)>| list.into_iter().map(|(_, s)| s).collect();
        let (training, held_back): (Vec<Segment>, Vec<Segment>) =
            (strip(training), strip(held_back));
        if training.is_empty() {
            return Err(Error::new(
                ErrorKind::InsufficientData,
                "there are no transitions to learn from",
                "measure runs of at least two samples",
            ));
        }
        let unknowns = dynamics.unknowns();
        let weights = change_weights(&measured, &training, 2 * system.degrees());
        Ok(ProximalDescent {
            system,
            measured,
            options,
            dynamics,
            method: integrator.stepping.method,
            longest: integrator.stepping.longest,
            training,
            held_back,
            weights,
            norms: vec![1.0; unknowns],
            moments: (vec![0.0; unknowns], vec![0.0; unknowns]),
            steps: 0,
            generator: Pcg64::seed_from_u64(options.seed),
            scratch: Scratch::new(),
        })
    }

    fn start(&self, system: &System) -> Vec<f64> {
        let terms = system.terms.iter().map(|t| t.bounds.clamp(0.0));
        terms.chain(self.first_parameters()).collect()
    }

    /// No term, every parameter at its start.
    fn empty(&self) -> Vec<f64> {
        let terms = self.dynamics.active().iter().map(|_| 0.0);
        terms.chain(self.first_parameters()).collect()
    }

    fn first_parameters(&self) -> impl Iterator<Item = f64> {
        self.dynamics.parameters().iter().map(|id| {
            let p = &self.system.parameters[id.position()];
            p.bounds.clamp(p.start)
        })
    }

    /// Loads segments into a batch at their measured starts.
    fn load(&self, segments: &[Segment], unknowns: Option<usize>) -> Batch {
        let degrees = self.system.degrees();
        let mut batch = match unknowns {
            Some(count) => Batch::with_tangents(degrees, segments.len(), count),
            None => Batch::new(degrees, segments.len()),
        };
        let states = States::measured(&self.measured, segments, degrees);
        for (lane, (segment, state)) in segments.iter().zip(&states).enumerate() {
            let since = self.measured.times_of(segment.run)[segment.first];
            let clock = self.measured.clock_of(segment.run);
            batch.set(lane, clock.time(since), state);
        }
        self.drive(&mut batch, segments, 0);
        batch
    }

    /// What inputs do from a sample on.
    fn drive(&self, batch: &mut Batch, segments: &[Segment], sample: usize) {
        let places = segments.iter().map(|&segment| driving::at(segment, sample));
        driving::drive(batch, &self.measured, places);
    }

    fn spans(&self, segments: &[Segment], sample: usize) -> (Vec<f64>, usize) {
        let span: Vec<f64> = segments
            .iter()
            .map(|s| {
                let times = self.measured.times_of(s.run);
                let at = s.first + sample;
                if at <= s.last { times[at] - times[at - 1] } else { 0.0 }
            })
            .collect();
        let widest = span.iter().fold(0.0f64, |m, s| m.max(s.abs()));
        (span, (widest / self.longest * (1.0 - WHOLE_STEPS)).ceil().max(1.0) as usize)
    }

    /// Weighted residuals of one sample, and the cotangents of their loss.
    fn residuals(
        &self,
        segments: &[Segment],
        sample: usize,
        out: &[f64],
        cotangent: &mut [f64],
    ) -> (f64, usize) {
        let lanes = segments.len();
        let row = self.options.loss.row();
        let (mut loss, mut count) = (0.0, 0);
        cotangent.fill(0.0);
        for (observable, weight) in self.weights.iter().enumerate() {
            for (lane, segment) in segments.iter().enumerate() {
                let at = segment.first + sample;
                if at > segment.last {
                    continue;
                }
                let measured = self.measured.values_of(observable, segment.run)[at];
                let residual = weight * (measured - out[observable * lanes + lane]);
                if residual.is_finite() {
                    loss += (row.value)(residual);
                    count += 1;
                    cotangent[observable * lanes + lane] =
                        -2.0 * weight * (row.weight)(residual) * residual;
                }
            }
        }
        (loss, count)
    }

    /// Mean loss over segments and its gradient by theta, by a reverse sweep.
    fn gradient(&mut self, segments: &[Segment], theta: &[f64]) -> (f64, Vec<f64>) {
        let lanes = segments.len();
        let mut batch = self.load(segments, None);
        let samples = segments.iter().map(|s| s.samples()).max().unwrap_or(1);
        let mut recordings = Vec::new();
        let mut states = Vec::new();
        let size = batch.state.len();
        let (mut loss, mut count) = (0.0, 0);
        let mut out = vec![0.0; size];
        let mut cotangents: Vec<Vec<f64>> = Vec::new();
        for sample in 1..samples {
            let (span, steps) = self.spans(segments, sample);
            recordings.push(Recording::advance(
                &self.dynamics,
                self.method,
                &mut batch,
                &span,
                steps,
                theta,
                &mut self.scratch,
            ));
            self.drive(&mut batch, segments, sample);
            let observed = self.system.observed;
            observe(&self.dynamics, observed, &batch, theta, &mut out, None, &mut self.scratch);
            let mut cotangent = vec![0.0; size];
            let (l, c) = self.residuals(segments, sample, &out, &mut cotangent);
            loss += l;
            count += c;
            cotangents.push(cotangent);
            states.push(batch.clone());
        }
        let mut gradient = vec![0.0; theta.len()];
        let mut carried = vec![0.0; size];
        for ((recording, mut cotangent), state) in
            recordings.into_iter().zip(cotangents).zip(&states).rev()
        {
            pull_back_observed(
                &self.dynamics,
                self.system.observed,
                state,
                theta,
                &mut cotangent,
                &mut gradient,
                &mut self.scratch,
            );
            for (c, new) in carried.iter_mut().zip(&cotangent) {
                *c += new;
            }
            recording.pull_back(
                &self.dynamics,
                theta,
                &mut carried,
                &mut gradient,
                &mut self.scratch,
            );
        }
        let scale = 1.0 / count.max(1) as f64;
        gradient.iter_mut().for_each(|g| *g *= scale);
        debug_assert_eq!(carried.len(), 2 * self.system.degrees() * lanes);
        (loss * scale, gradient)
    }

    /// Root mean square effect of each unknown on the weighted predictions, on a few segments.
    fn measure_columns(&mut self, theta: &[f64]) {
        let stride =
            self.training.len().div_ceil(self.options.tuning.first_order.norm_segments).max(1);
        let few: Vec<Segment> = self.training.iter().copied().step_by(stride).collect();
        let unknowns = self.dynamics.unknowns();
        let mut batch = self.load(&few, Some(unknowns));
        let (span, steps) = self.spans(&few, 1);
        let method = self.method;
        advance(&self.dynamics, method, &mut batch, &span, steps, theta, &mut self.scratch);
        let (state, columns, lanes) = (2 * self.system.degrees(), batch.columns(), few.len());
        for k in 0..unknowns {
            let squares: f64 = (0..state)
                .flat_map(|row| {
                    let start = (row * columns + state + k) * lanes;
                    let weight = self.weights[row];
                    batch.tangent[start..start + lanes].iter().map(move |x| (weight * x).powi(2))
                })
                .filter(|x| x.is_finite())
                .sum();
            let norm = (squares / (state * lanes) as f64).sqrt();
            self.norms[k] = if norm > 0.0 { norm } else { 1.0 };
        }
    }

    /// The penalty above which the empty model stays empty.
    fn largest_penalty(&mut self, theta: &[f64]) -> f64 {
        let all = self.training.clone();
        let gradient = self.full_gradient(&all, theta);
        let terms = self.dynamics.active().len();
        (0..terms).map(|k| (gradient[k] / self.norms[k]).abs()).fold(0.0, f64::max)
    }

    fn full_gradient(&mut self, segments: &[Segment], theta: &[f64]) -> Vec<f64> {
        let mut total = vec![0.0; theta.len()];
        let chunks = segments.chunks(self.options.tuning.first_order.batch);
        let count = chunks.len().max(1) as f64;
        for chunk in chunks {
            for (t, g) in total.iter_mut().zip(self.gradient(chunk, theta).1) {
                *t += g / count;
            }
        }
        total
    }

    fn loss_on(&mut self, segments: &[Segment], theta: &[f64]) -> f64 {
        let chunks = segments.chunks(self.options.tuning.first_order.batch);
        let count = chunks.len().max(1) as f64;
        chunks.map(|chunk| self.gradient(chunk, theta).0 / count).sum()
    }

    /// Epochs of proximal Adam at one penalty; whether it was interrupted.
    fn descend(&mut self, theta: &mut [f64], lambda: f64, monitor: &dyn Monitor) -> bool {
        const FIRST: f64 = 0.9;
        const SECOND: f64 = 0.999;
        let terms = self.dynamics.active().len();
        let bounds: Vec<_> = (self.system.terms.iter().map(|t| t.bounds))
            .chain(
                self.dynamics
                    .parameters()
                    .iter()
                    .map(|id| self.system.parameters[id.position()].bounds),
            )
            .collect();
        self.moments.0.fill(0.0);
        self.moments.1.fill(0.0);
        let tuning = &self.options.tuning.first_order;
        let batches = self.training.len().div_ceil(tuning.batch);
        let total = tuning.epochs * batches;
        for step in 0..total {
            if step % batches == 0 {
                for i in (1..self.training.len()).rev() {
                    self.training.swap(i, self.generator.random_range(0..=i));
                }
            }
            let start = step % batches * tuning.batch;
            let end = (start + tuning.batch).min(self.training.len());
            let chunk = self.training[start..end].to_vec();
            let (_, gradient) = self.gradient(&chunk, theta);
            let rate = tuning.rate * tuning.last_rate.powf(step as f64 / total as f64);
            let correction =
                (1.0 - FIRST.powi(step as i32 + 1), 1.0 - SECOND.powi(step as i32 + 1));
            for k in 0..theta.len() {
                let slope = gradient[k] / self.norms[k];
                if !slope.is_finite() {
                    continue;
                }
                let (first, second) = (&mut self.moments.0[k], &mut self.moments.1[k]);
                *first = FIRST * *first + (1.0 - FIRST) * slope;
                *second = SECOND * *second + (1.0 - SECOND) * slope * slope;
                // The proximal step has to be as long as the gradient's, or it would not pull
                // towards the same optimum.
                let length = rate
                    / ((*second / correction.1).sqrt() + tuning.least_moment * lambda + NOT_ZERO);
                let moved = theta[k] * self.norms[k] - length * *first / correction.0;
                let shrunk = if k < terms { soft_threshold(moved, length * lambda) } else { moved };
                theta[k] = bounds[k].clamp(shrunk / self.norms[k]);
            }
            self.steps += 1;
            if monitor.stopped() {
                return true;
            }
        }
        false
    }
}

/// One over the root mean square change of each observable along its segments.
fn change_weights(measured: &Packed, segments: &[Segment], observables: usize) -> Vec<f64> {
    (0..observables)
        .map(|row| {
            let changes: Vec<f64> = segments
                .iter()
                .map(|s| {
                    let values = measured.values_of(row, s.run);
                    (values[s.last] - values[s.first]).powi(2)
                })
                .filter(|x| x.is_finite())
                .collect();
            let mean = changes.iter().sum::<f64>() / changes.len().max(1) as f64;
            if mean > 0.0 { 1.0 / mean.sqrt() } else { 1.0 }
        })
        .collect()
}
