//! From a trained state to the model that is printed and kept.

use std::collections::HashMap;

use super::column::Column;
use super::distribution::Distribution;
use super::factor::Factor;
use super::law::Law;
use super::model::{
    Evidence, Exchange, FORMAT, FrontPoint, Model, Noise, PathEntry, RunnerUp, Stop, fingerprint,
    place_name,
};
use super::options::Selection;
use super::own_values::{Shared, shared};
use super::support::{Alternative, SupportFit, alternatives, front};
use super::train::{Round, Training};
use super::tuning::ConclusionTuning;
use super::uncertainty::{Unlearnable, inclusion, unlearnable};
use crate::expr::{Symbol, System, Term};

/// What is said of a training beside its numbers.
pub(super) struct Findings {
    /// The law, with its covariance.
    pub law: Law,
    /// How often each term of the function space is chosen, where that is known.
    pub frequency: Option<Vec<f64>>,
    /// Terms that could stand in each other's place.
    pub alternatives: Vec<Alternative>,
    /// What cannot be learned, in sentences.
    pub unlearnable: Vec<String>,
    /// What runs have for themselves.
    pub distributions: Vec<Distribution>,
}

/// Variance of the weighted residuals that a round ended with: the weights are those of the round
/// before, what is left of them is the last correction.
pub(super) fn variance(round: &Round) -> f64 {
    let refit = &round.refit;
    let freedom = refit.sums().rows.saturating_sub(refit.theta.len()).max(1);
    refit.sums().loss / freedom as f64
}

/// Sums a finished training up.
pub(super) fn conclude(training: &Training, round: &Round) -> Model {
    let (system, law) = (training.system(), training.law());
    let tuning = &training.options.tuning.conclusion;
    let refit = &round.refit;
    let final_factor = refit.linearised.merged();
    let variance = variance(round);
    let used = law.dynamics().parameters().to_vec();
    let Shared { covariance, distributions, means } =
        shared(training, refit, (&used, &final_factor, variance));
    let law = law.clone().with_parameters(means).with_covariance_of(&used, &covariance);
    let candidates = &round.search.candidates;
    let Round { folds, merged, .. } = round;
    let search = round.search_problem(training.options);
    let (frequency, (alternatives, mut unlearnable)) = rayon::join(
        || inclusion(folds, search, candidates, (tuning, training.options.seed)),
        || {
            let near = alternatives(search, &law.columns(), tuning.close);
            (near, open_questions(system, merged, tuning))
        },
    );
    unlearnable.extend(distributions.iter().filter_map(undetermined));
    unlearnable.extend(left_out(training));
    let found = Findings { law, frequency, alternatives, unlearnable, distributions };
    record(training, round, found)
}

/// The model of a finished training, with what was found beside it.
pub(super) fn record(training: &Training, round: &Round, found: Findings) -> Model {
    let Findings { law, frequency, alternatives, unlearnable, distributions } = found;
    let (system, refit) = (training.system(), &round.refit);
    let learned = refit.theta.len();
    let residuals = refit.sums().rows;
    let used = law.dynamics().parameters().to_vec();
    let candidates = &round.search.candidates;
    let (runs, samples, segments) = match training.stream {
        Some(stream) => stream.counts(),
        None => {
            let measured = &training.measured;
            (measured.runs(), measured.samples(), training.segments.list.len())
        }
    };
    let chosen = candidates.first().map(|c| c.criterion).unwrap_or(f64::NAN);
    let labels = labels(system);
    Model {
        format: FORMAT.to_string(),
        version: env!("CARGO_PKG_VERSION").to_string(),
        system: system.name.clone(),
        fingerprint: fingerprint(system),
        terms: law.recorded_terms(frequency.as_deref()),
        parameters: law.recorded_parameters(&used),
        covariance: law.recorded_covariance(&used),
        noise: noise(training),
        hidden: super::hidden::motions(training),
        integrator: law.recorded_integrator(&training.accuracy.reason),
        evidence: Evidence {
            runs,
            samples,
            segments,
            searched_first: training.stream.map(|_| training.measured.samples()),
            window: law.window(),
            bridged: law.reach().bridged,
            residuals,
            diverged: refit.sums().diverged,
            error: variance(round).sqrt(),
            function_space: system.terms.len(),
            learned,
            criterion: chosen,
            selection: match training.options.selection {
                Selection::Information => {
                    "Bayesian information criterion and description length".to_string()
                }
                Selection::HeldOut => "error on held-out folds".to_string(),
            },
            loss: training.options.loss.row().name.to_string(),
            supports_tried: round.search.supports_tried,
            seed: training.options.seed,
        },
        front: front_points(&labels, candidates, residuals, &law.columns()),
        runners_up: runners_up(training, round, chosen, &labels),
        alternatives: alternatives
            .into_iter()
            .map(|a| Exchange {
                term: label(system, a.term),
                instead: label(system, a.instead),
                difference: a.difference,
            })
            .collect(),
        unlearnable,
        warnings: Vec::new(),
        path: path_entries(training, round),
        stop: Stop {
            reason: refit.stop,
            sentence: refit.stop.sentence().to_string(),
            rounds: training.rounds,
            iterations: refit.iterations,
        },
        distributions,
    }
}

/// The term of a column of the whole function space's factor; its place stands before it where
/// two places could hold it.
fn label(system: &System, column: Column) -> String {
    let term = &system.terms[column];
    let alone = system.terms.iter().filter(|t| t.label == term.label).count() == 1;
    labelled(system, term, alone)
}

/// The labels of all columns.
fn labels(system: &System) -> Vec<String> {
    let mut count: HashMap<&str, usize> = HashMap::new();
    system.terms.iter().for_each(|term| *count.entry(&term.label).or_default() += 1);
    let alone = |term: &Term| count.get(term.label.as_str()) == Some(&1);
    system.terms.iter().map(|term| labelled(system, term, alone(term))).collect()
}

fn labelled(system: &System, term: &Term, alone: bool) -> String {
    if alone {
        term.label.clone()
    } else {
        format!("{}: {}", place_name(system, term.place), term.label)
    }
}

fn noise(training: &Training) -> Vec<Noise> {
    (training.system().observables().into_iter())
        .zip(training.law().noise())
        .zip(&training.accuracy.resolution)
        .map(|((observable, &standard_deviation), &resolution)| Noise {
            observable,
            standard_deviation,
            resolution,
        })
        .collect()
}

fn front_points(
    labels: &[String],
    candidates: &[SupportFit],
    residuals: usize,
    support: &[Column],
) -> Vec<FrontPoint> {
    front(candidates)
        .into_iter()
        .filter(|c| c.support.len() <= 2 * support.len() + 10)
        .map(|c| FrontPoint {
            error: (c.squares / residuals.saturating_sub(c.values.len()).max(1) as f64).sqrt(),
            criterion: c.criterion,
            chosen: c.support == support,
            terms: c.support.iter().map(|&k| labels[k].clone()).collect(),
        })
        .collect()
}

fn runners_up(training: &Training, round: &Round, chosen: f64, labels: &[String]) -> Vec<RunnerUp> {
    let support = training.law().columns();
    (round.search.candidates.iter())
        .filter(|c| c.support != support)
        .take(training.options.tuning.conclusion.runners_up)
        .map(|c| RunnerUp {
            terms: c
                .values
                .iter()
                .filter(|(column, _)| round.columns.is_term(*column))
                .map(|&(k, value)| (labels[k].clone(), value))
                .collect(),
            difference: c.criterion - chosen,
        })
        .collect()
}

fn path_entries(training: &Training, round: &Round) -> Vec<PathEntry> {
    let system = training.system();
    round
        .search
        .path
        .iter()
        .map(|point| PathEntry {
            lambda: point.lambda,
            coefficients: point
                .coefficients
                .iter()
                .filter(|(column, _)| round.columns.is_term(*column))
                .map(|&(k, value)| (label(system, k), value))
                .collect(),
        })
        .collect()
}

/// What these data cannot tell, in sentences.
fn open_questions(system: &System, factor: &Factor, tuning: &ConclusionTuning) -> Vec<String> {
    let (unknowns, residuals) = (factor.columns(), factor.rows());
    let mut sentences = Vec::new();
    if unknowns > residuals {
        sentences.push(format!(
            "{residuals} independent residuals cannot settle the {unknowns} unknowns of the \
             function space: measure more, or write a smaller space"
        ));
    } else if unknowns <= tuning.dependence {
        let found = unlearnable(factor, tuning);
        sentences.extend(found.iter().filter_map(|u| sentence(system, u, tuning.spelled_out)));
    }
    sentences
}

/// The first names of a list, and how many more there are.
fn first_of(names: impl ExactSizeIterator<Item = String>) -> String {
    /// Names that are spelled out.
    const NAMED: usize = 5;
    let more = names.len().saturating_sub(NAMED);
    let mut first: Vec<String> = names.take(NAMED).collect();
    first.extend((more > 0).then(|| format!("{more} more")));
    first.join(", ")
}

/// What was left out though it lowers the error.
fn left_out(training: &Training) -> Option<String> {
    let terms = training.below_precision.iter();
    let labels = terms.map(|id| format!("`{}`", training.system().terms[id.position()].label));
    (labels.len() > 0).then(|| {
        format!(
            "what {} would add is below the precision of these data, which are finer than \
             instruments are: their digits, or the errors of an integrator, look like that",
            first_of(labels)
        )
    })
}

/// Which groups do not determine a number that they have for themselves.
fn undetermined(distribution: &Distribution) -> Option<String> {
    let Distribution { name, per, .. } = distribution;
    let open = distribution.undetermined();
    (!open.is_empty()).then(|| {
        format!(
            "`{name}` of {per} {} is not determined by its measurements: nothing that was \
             measured there changes with it",
            first_of(open.iter().map(|one| one.group.clone()))
        )
    })
}

pub(super) fn sentence(system: &System, found: &Unlearnable, spelled_out: usize) -> Option<String> {
    let name =
        |column: Column| (column.position() < system.terms.len()).then(|| label(system, column));
    match found {
        Unlearnable::Untouched { column } => {
            let term = name(*column)?;
            let symbols = system.graph.symbols(&[system.terms[column.position()].expr]);
            let own = system.parameters.iter().enumerate().find(|(j, parameter)| {
                parameter.per.is_some() && symbols.contains(&Symbol::Parameter(*j))
            });
            if let Some((_, own)) = own {
                return Some(format!(
                    "the coefficient of `{term}` does nothing that the values of `{}` do not do: \
                     write a number for it, or take `per` from the `param`",
                    own.name
                ));
            }
            Some(format!("`{term}` has no effect on what was measured: it cannot be learned"))
        }
        Unlearnable::Dependent { column, on } => {
            let term = name(*column)?;
            let parts: Vec<String> =
                on.iter().filter_map(|&(c, x)| Some(format!("{x:.4} * {}", name(c)?))).collect();
            Some(match parts.len() {
                count if count == 0 || count >= spelled_out => format!(
                    "on these data `{term}` is a linear combination of other terms, to rounding: its coefficient is not identifiable"
                ),
                _ => format!(
                    "on these data `{term}` has exactly the effect of {}: their coefficients are not identifiable separately",
                    parts.join(" + ")
                ),
            })
        }
    }
}
