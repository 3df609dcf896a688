//! How accurately to integrate: as the noise asks for, and no more.

use super::driving;
use super::law::Law;
use super::options::Options;
use super::pass::Stepping;
use super::rounding::WHOLE_STEPS;
use super::segments::Segment;
use super::states::States;
use super::train::Training;
use crate::dynamics::{Batch, Dynamics, Method, Scratch, choose_steps, observe};
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

/// A law by a method that its equations allow: no splitting takes forces with momenta.
pub(crate) fn by_method_for_its_forces(law: Law) -> Law {
    let stepping = law.stepping();
    if !stepping.method.needs_separable() || law.dynamics().separable() {
        return law;
    }
    law.with_stepping(Stepping { method: usual(false), ..stepping })
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

/// What a model is integrated for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Aim {
    /// A model on the way.
    Round,
    /// A model that leaves so many times the noise: errors of steps are small beside a hundredth of
    /// that.
    Misfit(f64),
    /// The model that a training ends with: others will simulate it, so it keeps the structure of
    /// its flow; and its integrator errs by little beside the standard errors.
    Result,
}

/// Part of what a model leaves beside which the errors of its steps are small.
pub(super) const PART_OF_MISFIT: f64 = 0.01;

/// The cheapest integrator that is accurate enough for the present noise.
pub fn choose(training: &Training, dynamics: &Dynamics, theta: &[f64], aim: Aim) -> Choice {
    // Rounding accumulates along a segment.
    let (noise, window) = (training.law().noise(), training.law().window());
    let times = match aim {
        Aim::Misfit(times) if times.is_finite() => (PART_OF_MISFIT * times).max(1.0),
        _ => 1.0,
    };
    let along = (window.max(2) - 1) as f64;
    let mut rounding = training.rounding.clone();
    rounding.iter_mut().for_each(|r| *r *= along);
    let (batch, span) = sample(training);
    let slopes = slopes_of_measures(training, dynamics, theta, &batch);
    let of_state = |errors: &[f64]| errors_of_measures(&slopes, errors);
    let longest_span = span.iter().fold(0.0f64, |m, s| m.max(s.abs()));
    let options = training.options;
    let tuning = &options.tuning.stepping;
    let present: Vec<f64> =
        [training.accuracy.error.clone(), of_state(&training.accuracy.error)].concat();
    let is_limited =
        noise.iter().zip(&training.spread).zip(&present).any(|((s, spread), error)| {
            error.is_finite() && *s < tuning.suspect * error || *s < tuning.finest * spread
        });
    // What a model leaves is not what its steps do, where it is far more than that.
    let limited = is_limited && times == 1.0;
    // Errors of consecutive intervals add up along a segment.
    let intervals = window.saturating_sub(1).max(1) as f64;
    let residuals = (training.samples() * noise.len() / 2).max(1) as f64;
    let (keep, part_of_mean) = match aim {
        Aim::Round | Aim::Misfit(_) => (false, tuning.part_of_mean),
        Aim::Result => (true, tuning.part_of_error),
    };
    let most = tuning.part_of_noise.min(part_of_mean / residuals.sqrt());
    let share = if limited { 0.0 } else { most / intervals };
    let tolerance =
        tolerances(&noise.iter().map(|s| share * times * s).collect::<Vec<_>>(), &slopes);
    let mut scratch = Scratch::new();
    let mut choice = choose_steps(dynamics, theta, &batch, &span, &tolerance, keep, &mut scratch);
    if share > 0.0 && (!choice.reached || choice.cost > tuning.evaluations) {
        // Across a jump every method is of the first order: hundreds of steps an interval would
        // go to errors that the noise hides.
        let hidden: Vec<f64> = noise.iter().map(|s| tuning.hidden * times * s).collect();
        let tolerance = tolerances(&hidden, &slopes);
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
    let of_measures = of_state(&error);
    let resolution = rounding
        .iter()
        .zip(error.iter().chain(&of_measures))
        .map(|(r, e)| if e.is_finite() { r.max(tuning.margin * intervals * e) } else { *r })
        .collect();
    Choice { stepping, accuracy: Accuracy { error, resolution, reason } }
}

impl Training<'_> {
    /// Takes the integrator of a result; whether it is another than that of the rounds.
    pub(super) fn integrate_for_result(&mut self) -> bool {
        let (dynamics, theta) = self.compile();
        let choice = choose(self, &dynamics, &theta, Aim::Result);
        let another = choice.stepping != self.law.stepping();
        if another {
            self.integrate_by(choice);
        }
        another
    }

    /// Makes the integrator as accurate as the present model and noise ask for.
    pub fn choose_integrator(&mut self, aim: Aim) {
        let (dynamics, theta) = self.compile();
        self.integrate_by(choose(self, &dynamics, &theta, aim));
    }

    fn integrate_by(&mut self, choice: Choice) {
        self.law.set_stepping(choice.stepping);
        self.accuracy = choice.accuracy;
    }

    /// Makes the integrator as accurate as the present noise asks for.
    pub(super) fn sharpen(&mut self) {
        let (mut dynamics, mut theta) = self.compile();
        if dynamics.separable() && !self.separable {
            // The next round integrates the whole space, which no splitting can.
            (dynamics, theta) = self.compile_whole();
        }
        self.integrate_by(choose(self, &dynamics, &theta, Aim::Round));
        let noise = self.law.noise().iter().zip(&self.accuracy.resolution);
        let noise = noise.map(|(noise, floor)| noise.max(*floor)).collect();
        self.law.set_noise(noise);
    }
}

/// How measures follow the state at a sample of states, root mean squares: `[measure][component]`.
fn slopes_of_measures(
    training: &Training,
    dynamics: &Dynamics,
    theta: &[f64],
    sample: &Batch,
) -> Vec<Vec<f64>> {
    let system = training.system();
    let (state, lanes) = (2 * system.degrees(), sample.lanes);
    if system.measures.is_empty() || lanes == 0 {
        return Vec::new();
    }
    let mut scratch = Scratch::new();
    let mut batch = Batch::with_tangents(system.degrees(), lanes, dynamics.unknowns());
    for lane in 0..lanes {
        batch.set(lane, sample.time[lane], &sample.get(lane));
    }
    batch.drive.clone_from(&sample.drive);
    let rows = dynamics.observables();
    let columns = state + dynamics.unknowns();
    let mut out = vec![0.0; rows * lanes];
    let mut tangent = vec![0.0; rows * columns * lanes];
    let observed = system.observed;
    observe(dynamics, observed, &batch, theta, &mut out, Some(&mut tangent), &mut scratch);
    let of = |row: usize, component: usize| {
        let slopes = &tangent[(row * columns + component) * lanes..][..lanes];
        let finite = slopes.iter().filter(|x| x.is_finite());
        let (count, squares) = finite.fold((0.0, 0.0), |(n, sum), x| (n + 1.0, sum + x * x));
        if count > 0.0 { f64::sqrt(squares / count) } else { 0.0 }
    };
    (state..rows).map(|row| (0..state).map(|component| of(row, component)).collect()).collect()
}

/// Errors of measures that follow from those of the components of the state.
fn errors_of_measures(slopes: &[Vec<f64>], errors: &[f64]) -> Vec<f64> {
    let error = |of: &Vec<f64>| {
        let parts = of.iter().zip(errors).filter(|(slope, _)| **slope > 0.0);
        parts.map(|(slope, error)| slope * error).sum()
    };
    slopes.iter().map(error).collect()
}

/// What each component of the state may err by, where each observable may err by some numbers.
fn tolerances(of_observables: &[f64], slopes: &[Vec<f64>]) -> Vec<f64> {
    let state = of_observables.len() - slopes.len();
    let (own, of_measures) = of_observables.split_at(state);
    let mut tolerance = own.to_vec();
    for (of, most) in slopes.iter().zip(of_measures) {
        for (tolerance, slope) in tolerance.iter_mut().zip(of).filter(|(_, slope)| **slope > 0.0) {
            *tolerance = tolerance.min(most / slope);
        }
    }
    tolerance
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::build;

    #[test]
    fn a_force_with_momenta_takes_a_method_that_needs_no_splitting() {
        let law = |force: &str| {
            let text = format!("coordinates q\nmomenta p\nT = p^2/2\nV = q^2\n{force}");
            let law = Law::known(build("law", &text).expect("a spec").system).expect("a law");
            let stepping = Stepping { method: usual(true), ..law.stepping() };
            by_method_for_its_forces(law.with_stepping(stepping)).stepping()
        };
        assert_eq!(law("").method, usual(true));
        assert_eq!(law("force q += -q^3\n").method, usual(true));
        assert_eq!(law("force q += -0.1*p\n").method, usual(false));
    }
}
