//! Training: from measurements and a function space to a sparse model.
//!
//! [`fit`] is the whole of it. The parts, in the order in which data pass through them:
//! segments are cut ([`segments`]), integrated and freed of their unknown initial states
//! ([`pass`]), gathered in a triangular factor ([`factor`]) on which the support is searched
//! ([`path`], [`support`]) and refitted ([`gauss_newton`]); rounds of this are [`train`].

mod conclude;
pub mod factor;
pub mod gauss_newton;
pub mod loss;
pub mod model;
pub mod monitor;
pub mod options;
pub mod pass;
pub mod path;
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
use crate::error::Result;
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
    let (training, round) = train::train(system, dataset, options, monitor)?;
    Ok(conclude::conclude(&training, &round))
}
