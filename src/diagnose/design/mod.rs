//! The next run worth measuring: the one that best distinguishes rival models, or that measures
//! the coefficient that is known worst.

mod criterion;
mod plan;
pub mod rival;
mod search;

use statrs::distribution::{ContinuousCDF, Normal};

use criterion::{Criterion, PlannedRun, Question, Sampling};
pub use plan::{Allowed, Bound, Expected, Gain, Goal, Named, Plan, Proposal, Sought, Standing};
use rival::{Known, Rival};
use search::{EvaluatedRun, about_as_good, at_rest, round_to, score, search};

use crate::data::{Dataset, Run};
use crate::diagnose::law_on_data::Measurements;
use crate::diagnose::options::Options;
use crate::diagnose::tuning::Design;
use crate::error::{Error, ErrorKind, Result};
use crate::fit::Monitor;
use crate::fit::segments::typical_step;
use crate::fit::uncertainty::covariance;
use crate::simulate::Interval;

/// Looks for the run that brings most.
///
/// `rivals` are models of `dataset`, the measurements so far; `window` is the number of samples
/// of a segment that shares an initial state, as in the fits. Expectations are taken at the
/// rivals' best values: where these are known badly, the run will bring more or less than is
/// said. What is expected of a single coefficient is linearised; evidence between rivals is
/// linearised in the search, and computed from full refits for the results.
///
/// # Errors
///
/// When no run within the bounds is possible, a coefficient's name is unknown, or there are too
/// few rivals or unknowns.
pub fn design(
    rivals: &[Rival],
    goal: &Goal,
    dataset: &Dataset,
    window: usize,
    allowed: &Allowed,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Plan> {
    options.check()?;
    let wanted = if *goal == Goal::Rivals { 2 } else { 1 };
    let Some(first) = rivals.first().filter(|_| rivals.len() >= wanted) else {
        return Err(Error::new(
            ErrorKind::InvalidArgument,
            format!("a run is designed between {wanted} models or more, not {}", rivals.len()),
            "name at least two effects",
        ));
    };
    let parameters = &first.law.system().parameters;
    if let Some(own) = parameters.iter().find(|parameter| parameter.per.is_some()) {
        return Err(Error::new(
            ErrorKind::NotApplicable,
            format!(
                "a run is designed for one system, but every run (or group of runs) has a `{}` of \
                 its own",
                own.name
            ),
            "take `per` from the `param` to design a run for what is shared",
        ));
    }
    if let Some(input) = first.law.system().inputs.first() {
        return Err(Error::new(
            ErrorKind::NotApplicable,
            format!(
                "a run is designed by its start and its sampling, but `{}` drives this system",
                input.variable.name
            ),
            "choose what the input does by hand; `simulate --inputs` shows what would follow",
        ));
    }
    let judged = if *goal == Goal::Rivals { rivals } else { std::slice::from_ref(first) };
    monitor.stage("fitting the rivals", 0.4);
    let tuning = &options.tuning;
    let known = informed(judged, dataset, window, options)?;
    let (question, coefficient) = match goal {
        Goal::Rivals => (Question::Rivals, None),
        Goal::Coefficient(name) => {
            let (at, sought) = sought(&known[0], name.as_deref())?;
            (Question::Unknown(at), Some(sought))
        }
    };
    let everywhere = Interval { lower: f64::NEG_INFINITY, upper: f64::INFINITY };
    let dimensions = 2 * first.law.system().degrees();
    let reach = reach(&known[0], dataset);
    let start = bounds(&allowed.start, &reach, 0.0);
    let wide: Vec<Interval> = start.iter().zip(&reach).map(|(a, b)| around(a, b)).collect();
    let motion = bounds(&allowed.motion, &wide, 1.0);
    let samplings = samplings(dataset, allowed, &tuning.design)?;
    let mut criterion = Criterion {
        known,
        dataset,
        window,
        options,
        motion: vec![everywhere; dimensions],
        question,
    };
    let standings: Vec<f64> = criterion.known.iter().map(Known::standing).collect();
    let rivals = match question {
        Question::Rivals => ahead(judged, &standings),
        Question::Unknown(_) => Vec::new(),
    };
    let repeat = repeated(&criterion);
    criterion.motion.clone_from(&motion);
    let search = search(&criterion, &samplings, &start, monitor);
    monitor.stage("refitting", 0.9);
    let mut found: Vec<EvaluatedRun> = Vec::new();
    for mut one in search.found {
        if question == Question::Rivals {
            let sampling = &samplings[one.sampling];
            let planned_run = PlannedRun { start: one.start.clone(), sampling };
            let Some(values) = criterion.evaluate_in_full(&planned_run) else { continue };
            one.score = score(&criterion, &search.live, &values);
            one.values = values;
        }
        found.push(one);
    }
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    let Some(best) = found.first().map(|found| found.score) else {
        return Err(Error::new(
            ErrorKind::NothingFound,
            format!(
                "none of the {} runs that were tried stays within its bounds and finite",
                search.evaluated
            ),
            "start from smaller bounds, shorten the run, or widen the bounds of the motion",
        ));
    };
    // Of those that are about as good, the shortest.
    let cheap = found
        .iter()
        .enumerate()
        .filter(|(_, one)| about_as_good(one.score, best, tuning.design.enough))
        .min_by_key(|(at, one)| (samplings[one.sampling].times.len(), *at))
        .map_or(0, |(at, _)| at);
    let chosen = found.remove(cheap);
    found.insert(0, chosen);
    let mut proposals: Vec<Proposal> =
        found.iter().map(|one| proposal(&criterion, one, &samplings, &standings)).collect();
    let best = proposals.remove(0);
    let labels = |(a, b): (usize, usize)| (judged[a].label.clone(), judged[b].label.clone());
    let indistinguishable = if question == Question::Rivals {
        let pairs = criterion.pairs().into_iter().zip(&search.live);
        pairs.filter(|(_, live)| !**live).map(|(pair, _)| labels(pair)).collect()
    } else {
        Vec::new()
    };
    Ok(Plan {
        rivals,
        coefficient,
        best,
        alternatives: proposals,
        repeat: repeat.map(|values| expected(&criterion, &values, &standings)),
        indistinguishable,
        start_bounds: named_bounds(first, &start),
        motion_bounds: named_bounds(first, &motion),
        evaluated: search.evaluated,
        stop: search.stop,
    })
}

/// What measurements say about rivals, in their order.
///
/// # Errors
///
/// When a rival cannot be fitted to the measurements.
pub fn standings(
    rivals: &[Rival],
    dataset: &Dataset,
    window: usize,
    options: &Options,
) -> Result<Vec<Standing>> {
    let known = informed(rivals, dataset, window, options)?;
    Ok(ahead(rivals, &known.iter().map(Known::standing).collect::<Vec<_>>()))
}

/// Rivals fitted to the same measurements, with the noise of the one that leaves least.
fn informed<'a>(
    rivals: &'a [Rival],
    dataset: &'a Dataset,
    window: usize,
    options: &'a Options,
) -> Result<Vec<Known<'a>>> {
    let rows = rivals.first().map_or(0, |rival| rival.law.noise().len());
    let noise: Vec<f64> = (0..rows)
        .map(|row| rivals.iter().map(|r| r.law.noise()[row]).fold(f64::INFINITY, f64::min))
        .collect();
    let data = Measurements::of(dataset, options);
    rivals.iter().map(|rival| Known::new(rival, &data, window, &noise, options)).collect()
}

fn ahead(rivals: &[Rival], standings: &[f64]) -> Vec<Standing> {
    let least = standings.iter().copied().fold(f64::INFINITY, f64::min);
    let standing = |(rival, standing): (&Rival, &f64)| Standing {
        effect: rival.label.clone(),
        snippet: rival.statement.clone(),
        excess_deviance: standing - least,
    };
    rivals.iter().zip(standings).map(standing).collect()
}

/// The unknown that is named, or the one with the largest relative standard error.
fn sought(known: &Known, name: Option<&str>) -> Result<(usize, Sought)> {
    let law = &known.rival.law;
    let terms = law.terms().map(|(_, term, _)| {
        (term.name.clone().unwrap_or_else(|| term.label.clone()), term.label.clone())
    });
    let parameters = known.dynamics.parameters().iter().filter_map(|&id| {
        let name = law.system().parameter(id)?.name.clone();
        Some((name.clone(), name))
    });
    let unknowns: Vec<(String, String)> = terms.chain(parameters).collect();
    let covariance = covariance(&known.factor, 1.0);
    let error = |at: usize| covariance[(at, at)].sqrt();
    let relative = |at: usize| error(at) / known.theta[at].abs().max(f64::MIN_POSITIVE);
    let names = || unknowns.iter().map(|(name, _)| name.as_str());
    let at = match name {
        None => (0..unknowns.len()).max_by(|&a, &b| relative(a).total_cmp(&relative(b))),
        Some(name) => {
            let wanted = name.replace(' ', "");
            let is = |text: &String| text.replace(' ', "") == wanted;
            let at = unknowns.iter().position(|(name, label)| is(name) || is(label));
            if at.is_none() {
                let hint = match crate::spec::nearest(name, names()) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("it has {}", names().collect::<Vec<_>>().join(", ")),
                };
                return Err(Error::new(
                    ErrorKind::UnknownName,
                    format!("the model has no coefficient `{name}`"),
                    hint,
                ));
            }
            at
        }
    };
    let Some(at) = at else {
        return Err(Error::new(
            ErrorKind::NothingFound,
            "nothing is missing and nothing is learned: there is nothing to design a run for",
            "put the unknown part into `span{ ... }`, or name two effects to distinguish",
        ));
    };
    let what = unknowns[at].0.clone();
    Ok((at, Sought { what, value: known.theta[at], standard_error: error(at) }))
}

/// The box of all states that the measurements so far went through.
fn reach(known: &Known, dataset: &Dataset) -> Vec<Interval> {
    let times: Vec<Vec<f64>> = dataset.runs.iter().map(Run::clock_times).collect();
    let runs: Vec<(&[f64], &[f64])> = known
        .segments
        .list
        .iter()
        .zip(&known.states)
        .map(|(s, state)| (state, &times[s.run][s.first..=s.last]))
        .collect();
    let none = Interval { lower: f64::INFINITY, upper: f64::NEG_INFINITY };
    let mut reach = vec![none; 2 * known.dynamics.degrees()];
    let paths = known.predict(&runs);
    let states = paths.iter().flat_map(|path| &path.states);
    for state in states.filter(|state| state.iter().all(|x| x.is_finite())) {
        for (side, &x) in reach.iter_mut().zip(state) {
            *side = Interval { lower: side.lower.min(x), upper: side.upper.max(x) };
        }
    }
    for side in &mut reach {
        if side.lower > side.upper {
            // Nothing is known: units are chosen so that numbers are about one.
            *side = Interval { lower: -1.0, upper: 1.0 };
        }
        // Numbers that people would say.
        let inner = *side;
        side.lower = round_to(inner.lower, &inner);
        side.upper = round_to(inner.upper, &inner);
    }
    reach
}

/// What was asked for, or else the usual, made wider on both sides by a part of its width.
fn bounds(asked: &[Option<Interval>], usual: &[Interval], wider: f64) -> Vec<Interval> {
    let of = |(i, usual): (usize, &Interval)| {
        let more = wider * (usual.upper - usual.lower);
        let usual = Interval { lower: usual.lower - more, upper: usual.upper + more };
        asked.get(i).copied().flatten().unwrap_or(usual)
    };
    usual.iter().enumerate().map(of).collect()
}

fn around(a: &Interval, b: &Interval) -> Interval {
    Interval { lower: a.lower.min(b.lower), upper: a.upper.max(b.upper) }
}

/// Every duration with every step.
fn samplings(dataset: &Dataset, allowed: &Allowed, tuning: &Design) -> Result<Vec<Sampling>> {
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    let ends = || dataset.runs.iter().filter_map(Run::ends);
    let typical = typical_step(dataset);
    let from = allowed.from.or_else(|| median(ends().map(|(a, _)| a).collect())).unwrap_or(0.0);
    let steps = if allowed.steps.is_empty() { vec![typical] } else { allowed.steps.clone() };
    let usual = median(ends().map(|(a, b)| b - a).collect()).unwrap_or(0.0);
    let least = steps.iter().copied().fold(0.0, f64::max) * (tuning.shortest - 1) as f64;
    let durations = if allowed.durations.is_empty() {
        vec![usual.max(least)]
    } else {
        allowed.durations.clone()
    };
    let mut out = Vec::new();
    for &duration in &durations {
        for &step in &steps {
            // A whole number of steps may be less by rounding.
            let intervals = (duration / step * (1.0 + 1e-9)).floor();
            if !(intervals >= 1.0 && intervals < tuning.longest as f64) {
                return Err(Error::new(
                    ErrorKind::InvalidArgument,
                    format!("a run of {duration} with a sample every {step} is not possible"),
                    format!("a run has from 2 to {} samples", tuning.longest),
                ));
            }
            let times = (0..=intervals as usize).map(|i| from + i as f64 * step).collect();
            out.push(Sampling::beside(dataset, times));
        }
    }
    Ok(out)
}

/// What a repeat of an earlier run would bring, on average.
fn repeated(criterion: &Criterion) -> Option<Vec<f64>> {
    let known = &criterion.known[0];
    let runs = criterion.dataset.runs.len();
    let mut firsts: Vec<Option<(usize, &[f64])>> = vec![None; runs];
    for (segment, state) in known.segments.list.iter().zip(&known.states) {
        let first = &mut firsts[segment.run];
        if first.is_none_or(|(sample, _)| segment.first < sample) {
            *first = Some((segment.first, state));
        }
    }
    let stride = runs.div_ceil(criterion.options.tuning.design.repeats).max(1);
    let chosen: Vec<(Vec<f64>, Sampling)> = firsts
        .into_iter()
        .enumerate()
        .step_by(stride)
        .filter_map(|(run, first)| {
            let (sample, state) = first?;
            let times = criterion.dataset.runs[run].clock_times().split_off(sample);
            Some((state.to_vec(), Sampling::beside(criterion.dataset, times)))
        })
        .collect();
    let planned: Vec<PlannedRun> = chosen
        .iter()
        .map(|(start, sampling)| PlannedRun { start: start.clone(), sampling })
        .collect();
    let judged: Vec<Vec<f64>> = criterion.evaluate(&planned).into_iter().flatten().collect();
    let mean = |k: usize| judged.iter().map(|v| v[k]).sum::<f64>() / judged.len() as f64;
    judged.first().map(|first| (0..first.len()).map(mean).collect())
}

/// Values of a criterion as they are reported.
fn expected(criterion: &Criterion, values: &[f64], standings: &[f64]) -> Expected {
    if let Question::Unknown(_) = criterion.question {
        return Expected { gains: Vec::new(), standard_error: values.first().copied() };
    }
    let distinguishable = criterion.options.tuning.ranking.indistinguishable;
    let gain = |((a, b), &deviance): ((usize, usize), &f64)| Gain {
        truth: criterion.known[a].rival.label.clone(),
        against: criterion.known[b].rival.label.clone(),
        deviance,
        power: power(standings[b] - standings[a], deviance, distinguishable),
    };
    let gains = criterion.pairs().into_iter().zip(values).map(gain).collect();
    Expected { gains, standard_error: None }
}

/// Probability that a difference of deviances distinguishes two models after it grew. Growth that
/// is expected to be g is Gaussian of variance 4 g: twice the difference times the noise.
fn power(now: f64, growth: f64, distinguishable: f64) -> f64 {
    // Where nothing grows nothing spreads, and the sign of what is known decides.
    let spread = 2.0 * growth.max(1e-9).sqrt();
    Normal::standard().cdf((now + growth - distinguishable) / spread)
}

fn proposal(
    criterion: &Criterion,
    found: &EvaluatedRun,
    samplings: &[Sampling],
    standings: &[f64],
) -> Proposal {
    let known = &criterion.known[0];
    let system = known.rival.law.system();
    let times = &samplings[found.sampling].times;
    let shown = known.predict(&[(found.start.as_slice(), &times[..1])]);
    let observed = shown.iter().flat_map(|path| &path.observed).flatten();
    let named = |(name, &value): (String, &f64)| Named { name, value };
    let from = times[0];
    let step = shorter(times[1] - from);
    Proposal {
        start: state_names(known.rival).into_iter().zip(&found.start).map(named).collect(),
        observed: system.observables().into_iter().zip(observed).map(named).collect(),
        at_rest: at_rest(&found.start),
        from,
        duration: shorter(step * (times.len() - 1) as f64),
        step,
        samples: times.len(),
        expected: expected(criterion, &found.values, standings),
    }
}

/// A number without what rounding did to its last digits.
fn shorter(x: f64) -> f64 {
    format!("{x:.11e}").parse().unwrap_or(x)
}

fn named_bounds(rival: &Rival, bounds: &[Interval]) -> Vec<Bound> {
    let names = state_names(rival).into_iter().zip(bounds);
    names.map(|(name, b)| Bound { name, lower: b.lower, upper: b.upper }).collect()
}

fn state_names(rival: &Rival) -> Vec<String> {
    let system = rival.law.system();
    system.coordinates.iter().chain(&system.momenta).map(|v| v.name.clone()).collect()
}
