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
mod gathered;
mod gauge;
pub mod gauss_newton;
pub mod loss;
pub mod model;
pub mod monitor;
pub mod options;
pub mod pass;
pub mod path;
mod prune;
pub mod resume;
mod rows;
pub mod screening;
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
pub use resume::{Start, resume};

use crate::data::Dataset;
use crate::error::{Error, Result};
use crate::expr::System;

/// Learns the coefficients and inner parameters of `system` from `dataset`.
///
/// Of a system in which everything is known there is still the noise to learn, and how long
/// the law follows the measurements.
///
/// The observables of the data are those of [`System::observables`], in that order and in
/// the spec's units. The result does not depend on the number of threads.
///
/// # Errors
///
/// [`Error::Fit`] when the data do not suffice, with what to do.
pub fn fit(
    system: &System,
    dataset: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Model> {
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
    if options.trainer == Trainer::FirstOrder {
        return screening::first_order(system, dataset, options, monitor);
    }
    if system.terms.len() > LARGEST_FACTOR {
        return screening::working_set(system, dataset, options, monitor);
    }
    let (training, round) = train::train(system, dataset, options, monitor)?;
    Ok(conclude::conclude(&training, &round))
}

/// Function spaces larger than this are worked on a part at a time.
const LARGEST_FACTOR: usize = 3000;
