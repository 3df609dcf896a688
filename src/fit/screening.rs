//! Function spaces that are too large for one triangular factor.
//!
//! First-order work a term, second-order work on few terms: the gradient says which terms are
//! worth looking at, Gauss-Newton decides among them.

use std::sync::Arc;

use super::conclude::conclude;
use super::course::train;
use super::criterion::complexity;
use super::first_order::{self, screen};
use super::law::Law;
use super::model::{Model, fingerprint};
use super::monitor::Monitor;
use super::options::{Options, Trainer};
use crate::data::Dataset;
use crate::error::Result;
use crate::expr::{System, TermId};

/// Proximal first-order training of the whole space, then Gauss-Newton on what survives.
///
/// # Errors
///
/// As [`fit`](super::fit).
pub fn first_order(
    system: &Arc<System>,
    dataset: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Model> {
    let tuning = &options.tuning.screening;
    let screening = screen(system, dataset, options, monitor)?;
    let mut survivors: Vec<(TermId, f64)> =
        screening.law.terms().map(|(id, _, value)| (id, value.abs())).collect();
    survivors.sort_by(|a, b| b.1.total_cmp(&a.1));
    survivors.truncate(tuning.together);
    let survivors: Vec<TermId> = survivors.into_iter().map(|(id, _)| id).collect();
    let mut started = System::clone(system);
    for (parameter, &value) in started.parameters.iter_mut().zip(screening.law.parameters()) {
        parameter.start = value;
    }
    let how = format!("the {} that first-order training left", survivors.len());
    train_on(&started, survivors, &how, dataset, options, monitor)
}

/// Gauss-Newton on a working set that the gradient fills: terms whose effect correlates most
/// with what the model misses enter, until none that enters is chosen
/// (iterated sure independence screening: Fan and Lv, J. R. Stat. Soc. B 70, 2008, section 4.1).
///
/// # Errors
///
/// As [`fit`](super::fit).
pub fn working_set(
    system: &Arc<System>,
    dataset: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Model> {
    let tuning = &options.tuning.screening;
    let all = system.terms.len();
    let ids = system.term_ids();
    let mut working = ids.clone();
    let level: Vec<u32> = system.terms.iter().map(|t| complexity(&system.graph, t.expr)).collect();
    working.sort_by_key(|id| level[id.position()]);
    working.truncate(tuning.simplest);
    let mut law: Option<Law> = None;
    let mut best: Option<Model> = None;
    for round in 0..tuning.rounds {
        monitor.stage("screening the function space", round as f64 / tuning.rounds as f64);
        let correlation = first_order::correlations(system, law.as_ref(), dataset, options)?;
        let stands_out = |id: &TermId| correlation[id.position()];
        let mut outside: Vec<TermId> =
            ids.iter().copied().filter(|id| !working.contains(id)).collect();
        outside.sort_by(|a, b| stands_out(b).total_cmp(&stands_out(a)).then(a.cmp(b)));
        working.extend(outside.into_iter().take(if round == 0 {
            tuning.first
        } else {
            tuning.each
        }));
        let how = format!("the {} whose gradients stand out", working.len());
        let model = train_on(system, working.clone(), &how, dataset, options, monitor)?;
        let Some(next) = model.law(system) else { return Ok(model) };
        let settled = law.is_some_and(|before| before.support() == next.support());
        best = Some(model);
        let support = next.support().to_vec();
        law = Some(next);
        if settled || monitor.stopped() || working.len() == all {
            break;
        }
        // What was not chosen makes room, once the set is full.
        if working.len() + tuning.each > tuning.together {
            working.retain(|id| support.contains(id));
        }
    }
    match best {
        Some(model) => Ok(model),
        None => train_on(system, working, "the simplest", dataset, options, monitor),
    }
}

/// Screens on a sample; `learn` then has all data for the terms that the sample's model and its
/// rivals are made of.
///
/// # Errors
///
/// As [`fit`](super::fit).
pub(super) fn among_survivors(
    system: &Arc<System>,
    sample: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
    learn: impl Fn(&Arc<System>) -> Result<Model>,
) -> Result<Model> {
    let first = match options.trainer {
        Trainer::FirstOrder => first_order(system, sample, options, monitor)?,
        Trainer::GaussNewton => working_set(system, sample, options, monitor)?,
    };
    let rivals = first.runners_up.iter().flat_map(|rival| &rival.terms).map(|(term, _)| term);
    let instead = first.alternatives.iter().map(|exchange| &exchange.instead);
    let named: Vec<&String> =
        first.terms.iter().map(|t| &t.term).chain(rivals).chain(instead).collect();
    let mut narrowed = System::clone(system);
    narrowed.terms.retain(|term| named.contains(&&term.label));
    for parameter in &mut narrowed.parameters {
        if let Some(learned) = first.parameters.iter().find(|p| p.name == parameter.name) {
            parameter.start = learned.value;
        }
    }
    let how = format!(
        "{} terms that a screening of the sample left of {}",
        narrowed.terms.len(),
        system.terms.len()
    );
    let mut model = learn(&Arc::new(narrowed))?;
    model.fingerprint = fingerprint(system);
    model.evidence.function_space = system.terms.len();
    model.evidence.selection = format!("{} among {how}", model.evidence.selection);
    Ok(model)
}

/// Trains on some of the terms, and makes the result a model of the whole space.
fn train_on(
    system: &System,
    mut terms: Vec<TermId>,
    how: &str,
    dataset: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Model> {
    terms.sort_unstable();
    let mut narrowed = system.clone();
    narrowed.terms = terms.iter().filter_map(|&id| system.term(id).cloned()).collect();
    let (training, round) = train(&Arc::new(narrowed), dataset, options, monitor)?;
    let mut model = conclude(&training, &round);
    model.fingerprint = fingerprint(system);
    model.evidence.function_space = system.terms.len();
    model.evidence.selection =
        format!("{} among {how} of {} terms", model.evidence.selection, system.terms.len());
    Ok(model)
}
