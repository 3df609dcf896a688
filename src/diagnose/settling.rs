//! The best initial state of every segment: what a law leaves of its data where the state at the
//! start of each segment is free.

use super::law_on_data::LawOnData;
use super::rest::moving;
use super::restarting::restarted;
use crate::dynamics::Dynamics;
use crate::fit::Loss;
use crate::fit::driving::OwnInputs;
use crate::fit::factor::Factor;
use crate::fit::pass::{self, Problem, Sums};
use crate::fit::scales::{fewest_samples, scales};
use crate::fit::scores::Scores;
use crate::fit::segments::{Reach, Segments, cut};
use crate::fit::states::States;
use crate::fit::windowed::Residuals;

/// A law on data, with the best state of every segment of the law's window.
#[derive(Clone)]
pub struct Settled<'a> {
    /// The law and the data.
    pub model: LawOnData<'a>,
    /// Segments of the law's window.
    pub segments: Segments,
    /// Their best states.
    pub states: States,
    /// What is left then.
    pub sums: Sums,
}

/// A law on all of some data, and on a part of them where there are many.
pub struct Parts<'a> {
    /// All of them.
    pub all: Settled<'a>,
    /// A part, spread over all segments.
    pub part: Option<Settled<'a>>,
}

/// Below this part of the noise residuals are rounding, or the integrator's: it adds a part 1e-6
/// to the variance.
const FLOOR: f64 = 1e-3;

/// What a pass over some segments works on: residuals are weighed by the law's noise, of which
/// `weights` are the inverse, and integrated by its steps.
pub(super) fn problem<'b>(
    model: &'b LawOnData,
    segments: &'b Segments,
    weights: &'b [f64],
) -> Problem<'b> {
    Problem {
        measured: &model.data.packed,
        segments,
        observed: model.system().observed,
        weights,
        loss: Loss::SQUARES,
        stepping: model.law.stepping(),
        floor: FLOOR,
        stream: None,
        window: model.law.window(),
        parameters: &model.system().parameters,
        own: OwnInputs::default(),
        tuning: &model.options.fit,
        halt: model.monitor,
    }
}

/// The best states of all segments.
///
/// Parts that nobody measures have no state that a few samples tell: segments are then no shorter
/// than those that a fit begins with.
pub fn settle(model: LawOnData) -> Settled {
    settle_of(model, |_, segments| segments)
}

/// The best states of the segments in which something moves.
pub fn settle_moving(model: LawOnData) -> Settled {
    settle_of(model, moving)
}

fn settle_of<'a>(
    model: LawOnData<'a>,
    some: impl Fn(&LawOnData<'a>, Segments) -> Segments,
) -> Settled<'a> {
    let least = shortest(&model);
    let window = model.law.window().max(least);
    let model = if least > 0 { model.with_window(window) } else { model };
    let tuning = &model.tuning().states;
    let reach = Reach { window, ..model.law.reach() };
    let whole = cut(&model.data.packed, reach, &model.options.fit.segments);
    let segments = some(&model, whole).spread(model.data.most);
    let mut states = States::measured_by(&model.law, &model.data.packed, &segments.list);
    // Over many periods the misfit has many minima, and what was measured first need not
    // lie near the lowest: the first samples of each segment bring its state there.
    let dynamics = model.law.dynamics_of_runs();
    let theta = model.law.theta(&dynamics);
    let weights = model.law.weights();
    let mut look = tuning.first_samples.max(least);
    while look < window {
        let short = segments.shortened(look);
        pass::settle(&problem(&model, &short, &weights), &dynamics, &theta, &mut states);
        look *= tuning.growth;
    }
    let law = (&dynamics, theta.as_slice());
    let mut sums = patiently(&model, &segments, law, &mut states);
    if !dynamics.has_own_inputs() && restarted(&model, &segments, law, &mut states) {
        sums = patiently(&model, &segments, law, &mut states);
    }
    Settled { model, segments, states, sums }
}

/// Samples that a segment has at least, where something moves unseen; else 0.
pub(super) fn shortest(model: &LawOnData) -> usize {
    let (system, packed) = (model.system(), &model.data.packed);
    if !system.measures.is_empty() {
        // A state takes as many values up as it has components.
        let scales = scales(packed, system.observed_count());
        return fewest_samples(&scales, 2 * system.degrees(), packed.samples());
    }
    if system.hidden.is_empty() {
        return 0;
    }
    model.options.fit.segments.hidden.min(model.data.packed.longest_run())
}

/// The best states of all segments of all the data, and of a part of them where there are many.
pub fn settle_parts(model: LawOnData) -> Parts {
    let most = model.tuning().scan.samples;
    let many = model.data.dataset.samples().min(model.data.most) > most;
    let part = many.then(|| settle(model.thinned(most)));
    Parts { all: settle(model), part }
}

/// Improves the states of some segments until they are settled, and sums up what is left.
pub(super) fn settle_from(model: &LawOnData, segments: &Segments, states: &mut States) -> Sums {
    let dynamics = model.law.dynamics_of_runs();
    let theta = model.law.theta(&dynamics);
    patiently(model, segments, (&dynamics, &theta), states)
}

/// Long segments of a rough model take their time: what has not settled would look like something
/// missing.
fn patiently(
    model: &LawOnData,
    segments: &Segments,
    (dynamics, theta): (&Dynamics, &[f64]),
    states: &mut States,
) -> Sums {
    let tuning = &model.tuning().states;
    let weights = model.law.weights();
    let problem = problem(model, segments, &weights);
    let mut sums = pass::settle(&problem, dynamics, theta, states);
    for _ in 0..tuning.retries {
        if sums.unsettled == 0 {
            break;
        }
        let further = pass::settle(&problem, dynamics, theta, states);
        let settled = further.loss >= sums.loss * (1.0 - tuning.settled);
        sums = further;
        if settled {
            break;
        }
    }
    sums
}

impl Settled<'_> {
    /// The residuals linearised by all numbers of the law, states eliminated.
    pub(super) fn linearised(&self) -> Factor {
        let Settled { model, segments, states, .. } = self;
        let dynamics = model.law.dynamics_of_runs();
        let theta = model.law.theta(&dynamics);
        let weights = model.law.weights();
        pass::linearise(&problem(model, segments, &weights), &dynamics, &theta, states).merged()
    }

    /// How alike the residuals of neighbouring samples are, and how large those of each run.
    pub(super) fn what_is_left(&self) -> Residuals {
        let Settled { model, segments, states, .. } = self;
        let dynamics = model.law.dynamics_of_runs();
        let theta = model.law.theta(&dynamics);
        let weights = model.law.weights();
        let problem = problem(model, segments, &weights);
        Residuals::of(&problem, (&dynamics, &theta), states, model.system())
    }

    /// What each sample says of all numbers of the law, states eliminated.
    pub(super) fn scores(&self) -> Scores {
        let Settled { model, segments, states, .. } = self;
        let dynamics = model.law.dynamics_of_runs();
        let theta = model.law.theta(&dynamics);
        let weights = model.law.weights();
        Scores::of(&problem(model, segments, &weights), (&dynamics, &theta), states)
    }

    /// Residuals in units of the noise: `[segment][observable][sample]`, not a number where there
    /// is none.
    pub fn residuals(&self) -> Vec<Vec<Vec<f64>>> {
        let Settled { model, segments, states, .. } = self;
        let dynamics = model.law.dynamics_of_runs();
        let theta = model.law.theta(&dynamics);
        let weights = model.law.weights();
        pass::residuals(&problem(model, segments, &weights), &dynamics, &theta, states)
    }
}
