//! How accurately to integrate: as the noise asks for, and no more.

use super::driving;
use super::options::Options;
use super::pass::Stepping;
use super::rounding::WHOLE_STEPS;
use super::segments::Segment;
use super::states::States;
use super::train::Training;
use crate::dynamics::{Batch, Dynamics, Method, Scratch, choose_steps};
use crate::error::{Error, ErrorKind, Result};
use crate::expr::System;

/// An integrator with what it can resolve.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// Method and longest step.
    pub stepping: Stepping,
    /// What it can resolve.
    pub accuracy: Accuracy,
}

/// What an integrator can resolve.
#[derive(Debug, Clone, PartialEq)]
pub struct Accuracy {
    /// Largest error of each component of the state between two samples; infinite when unknown.
    pub error: Vec<f64>,
    /// For each observable, the error below which residuals mean nothing.
    pub resolution: Vec<f64>,
    /// Why this integrator, in a sentence.
    pub reason: String,
}

/// The method of a first round.
#[expect(clippy::expect_used, reason = "both names are literals of the table")]
pub(super) fn usual(separable: bool) -> Method {
    let name = if separable { "forest-ruth" } else { "gauss-legendre-4" };
    Method::by_name(name).expect("a row of METHODS")
}

/// For the first round, whose model is rough anyway.
///
/// # Errors
///
/// When a method for separable systems was asked for and the system is not separable.
pub fn coarse(
    system: &System,
    options: &Options,
    separable: bool,
    typical: f64,
    rounding: &[f64],
) -> Result<Choice> {
    let method = options.method.unwrap_or_else(|| usual(separable));
    if method.needs_separable() && !separable {
        return Err(Error::new(
            ErrorKind::NotApplicable,
            format!(
                "`{}` needs H = T(p) + V(q) and forces without momenta, which this system is not",
                method.row().name
            ),
            "leave the method open, or take gauss-legendre-4, gauss-legendre-6 or rk4",
        ));
    }
    Ok(Choice {
        stepping: Stepping { method, longest: options.longest_step.unwrap_or(typical) },
        accuracy: Accuracy {
            error: vec![f64::INFINITY; 2 * system.degrees()],
            resolution: rounding.to_vec(),
            reason: "the first guess".to_string(),
        },
    })
}

/// The cheapest integrator that is accurate enough for the present noise. A model that others
/// will simulate is to `keep` the structure of its flow; one on the way need not.
pub fn choose(training: &Training, dynamics: &Dynamics, theta: &[f64], keep: bool) -> Choice {
    // Rounding accumulates along a segment.
    let (noise, window) = (training.law().noise(), training.law().window());
    let along = (window.max(2) - 1) as f64;
    let mut rounding = training.rounding.clone();
    rounding.iter_mut().for_each(|r| *r *= along);
    let (batch, span) = sample(training);
    let longest_span = span.iter().fold(0.0f64, |m, s| m.max(s.abs()));
    let options = training.options;
    let tuning = &options.tuning.stepping;
    let limited = noise.iter().zip(&training.spread).zip(&training.accuracy.error).any(
        |((s, spread), error)| {
            error.is_finite() && *s < tuning.suspect * error || *s < tuning.finest * spread
        },
    );
    // Errors of consecutive intervals add up along a segment.
    let intervals = window.saturating_sub(1).max(1) as f64;
    let residuals = (training.samples() * noise.len() / 2).max(1) as f64;
    let most = tuning.part_of_noise.min(tuning.part_of_mean / residuals.sqrt());
    let share = if limited { 0.0 } else { most / intervals };
    let tolerance: Vec<f64> = noise.iter().map(|s| share * s).collect();
    let mut scratch = Scratch::new();
    let mut choice = choose_steps(dynamics, theta, &batch, &span, &tolerance, keep, &mut scratch);
    if share > 0.0 && (!choice.reached || choice.cost > tuning.evaluations) {
        // Across a jump every method is of the first order: hundreds of steps an interval would
        // go to errors that the noise hides.
        let tolerance: Vec<f64> = noise.iter().map(|s| tuning.hidden * s).collect();
        let rough = choose_steps(dynamics, theta, &batch, &span, &tolerance, keep, &mut scratch);
        if rough.reached && rough.cost < choice.cost {
            choice = rough;
        }
    }
    let mut stepping = Stepping {
        method: choice.method,
        longest: longest_span / choice.steps as f64 * (1.0 + WHOLE_STEPS),
    };
    let mut reason = choice.reason;
    let mut error = choice.error;
    if options.method.is_some() || options.longest_step.is_some() {
        stepping = Stepping {
            method: options.method.unwrap_or(stepping.method),
            longest: options.longest_step.unwrap_or(match options.method {
                Some(_) => training.law().stepping().longest,
                None => stepping.longest,
            }),
        };
        reason = "as asked for".to_string();
        // What was asked for is taken at its word: its error is not mistaken for noise.
        error = vec![0.0; error.len()];
    }
    let resolution = rounding
        .iter()
        .zip(&error)
        .map(|(r, e)| if e.is_finite() { r.max(tuning.margin * intervals * e) } else { *r })
        .collect();
    Choice { stepping, accuracy: Accuracy { error, resolution, reason } }
}

/// States spread over all segments, and the times to their next samples.
///
/// Starts alone would not do: an orbit that is released far from the centre is nearest to it, and
/// hardest to follow, in the middle of its segment.
fn sample(training: &Training) -> (Batch, Vec<f64>) {
    let segments = &training.segments.list;
    let intervals: usize = segments.iter().map(|segment| segment.samples() - 1).sum();
    let stride = intervals.div_ceil(training.options.tuning.stepping.transitions).max(1);
    let mut picked: Vec<(usize, usize)> = Vec::new();
    let mut before = 0usize;
    for (i, segment) in segments.iter().enumerate() {
        let count = segment.samples() - 1;
        let next = before.div_ceil(stride) * stride;
        let within = (next..before + count).step_by(stride);
        picked.extend(within.map(|place| (i, segment.first + place - before)));
        before += count;
    }
    let degrees = training.system().degrees();
    let from = |&(i, at): &(usize, usize)| Segment { first: at, ..segments[i] };
    let rests: Vec<Segment> = picked.iter().map(from).collect();
    let measured = States::measured_by(training.law(), &training.measured, &rests);
    let mut batch = Batch::new(degrees, picked.len());
    let mut span = Vec::with_capacity(picked.len());
    for (lane, &(i, at)) in picked.iter().enumerate() {
        let segment = segments[i];
        let times = training.measured.times_of(segment.run);
        let settled = at == segment.first;
        let start = if settled { training.states.of(i) } else { measured.of(lane) };
        let clock = training.measured.clock_of(segment.run);
        batch.set(lane, clock.time(times[at]), start);
        span.push(times[at + 1] - times[at]);
    }
    let place = |&(i, at): &(usize, usize)| driving::at(segments[i], at - segments[i].first);
    let own = training.own_inputs();
    let own = driving::OwnInputs { count: own.0, values: &own.1 };
    driving::drive_each(&mut batch, (&training.measured, own), picked.iter().map(place));
    (batch, span)
}
