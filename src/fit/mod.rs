//! Training: from measurements and a function space to a sparse model.
//!
//! [`fit`] is the whole of it. The parts, in the order in which data pass through them:
//! segments are cut ([`segments`]), integrated and freed of their unknown initial states
//! ([`pass`]), gathered in a triangular factor ([`factor`]) on which the support is searched
//! ([`path`], [`support`]) and refitted ([`gauss_newton`]); rounds of this are [`train`].

pub mod bounded;
mod conclude;
pub mod criterion;
pub mod elimination;
pub mod factor;
pub mod first_order;
mod gauge;
pub mod gauss_newton;
pub mod loss;
pub mod model;
pub mod monitor;
pub mod options;
pub mod pass;
pub mod path;
mod prune;
pub mod segments;
pub mod starts;
pub mod stepping;
pub mod support;
pub mod train;
pub mod uncertainty;
pub mod unseen;

pub use gauss_newton::StopReason;
pub use loss::{LOSSES, Loss};
pub use model::Model;
pub use monitor::{Flag, Monitor, Silent};
pub use options::{Options, Selection, Trainer};

use crate::data::Dataset;
use crate::error::{Error, Result};
use crate::expr::System;

/// Learns the coefficients and inner parameters of `system` from `dataset`.
///
/// The observables of the data are those of [`System::observables`], in that order and in
/// the spec's units. The result does not depend on the number of threads.
///
/// # Errors
///
/// [`Error::Fit`](crate::error::Error::Fit) when the data do not suffice, with what to do.
pub fn fit(
    system: &System,
    dataset: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Model> {
    if system.terms.is_empty() && system.parameters.is_empty() {
        return Err(Error::fit(
            "the spec has nothing to learn",
            "put the unknown part into `span{ ... }`, or simulate the spec as it is",
        ));
    }
    if let Some(settled) = gauge::settle_scale(system, dataset) {
        if settled.system.terms.is_empty() && settled.system.parameters.is_empty() {
            return Err(Error::fit(
                "without momenta and known parts the only term sets the scale of H",
                "put more terms into `span{ ... }`, or measure momenta",
            ));
        }
        let mut model = learn(&settled.system, dataset, options, monitor)?;
        settled.restore(system, &mut model);
        return Ok(model);
    }
    learn(system, dataset, options, monitor)
}

fn learn(
    system: &System,
    dataset: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Model> {
    let large = system.terms.len() > LARGEST_FACTOR;
    if options.trainer == Trainer::FirstOrder || large {
        return screened(system, dataset, options, monitor);
    }
    let (training, round) = train::train(system, dataset, options, monitor)?;
    Ok(conclude::conclude(&training, &round))
}

/// Function spaces larger than this are screened by the first-order trainer.
const LARGEST_FACTOR: usize = 3000;
/// Survivors of the screening that Gauss-Newton takes on.
const SURVIVORS: usize = 600;
/// Terms of the least complexity that are kept whatever the screening says.
const SIMPLEST: usize = 150;

/// First-order screening of the function space, then Gauss-Newton on what survives.
fn screened(
    system: &System,
    dataset: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Model> {
    let screening = first_order::screen(system, dataset, options, monitor)?;
    let mut survivors = screening.survivors.clone();
    if survivors.len() > SURVIVORS {
        let size = |k: &usize| screening.coefficients[*k].abs();
        survivors.sort_by(|a, b| size(b).total_cmp(&size(a)));
        survivors.truncate(SURVIVORS);
        survivors.sort_unstable();
    }
    // Mini-batches hardly tell thousands of like columns apart: the simplest terms, cheap to the
    // criterion anyway, are always looked at.
    let complexity: Vec<u32> =
        system.terms.iter().map(|t| criterion::complexity(&system.graph, t.expr)).collect();
    let mut simplest: Vec<usize> = (0..system.terms.len()).collect();
    simplest.sort_by_key(|&k| complexity[k]);
    survivors.extend(simplest.into_iter().take(SIMPLEST));
    survivors.sort_unstable();
    survivors.dedup();
    let mut narrowed = system.clone();
    narrowed.terms = survivors.iter().map(|&k| system.terms[k].clone()).collect();
    for (parameter, &value) in narrowed.parameters.iter_mut().zip(&screening.parameters) {
        parameter.start = value;
    }
    let (training, round) = train::train(&narrowed, dataset, options, monitor)?;
    let mut model = conclude::conclude(&training, &round);
    model.fingerprint = model::fingerprint(system);
    model.evidence.function_space = system.terms.len();
    model.evidence.selection = format!(
        "{} among the {} of {} terms that first-order screening and simplicity left",
        model.evidence.selection,
        survivors.len(),
        system.terms.len()
    );
    Ok(model)
}
