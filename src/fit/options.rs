//! What may be chosen about a fit. The defaults serve every system.

use super::loss::Loss;
use super::tuning::Tuning;
use crate::dynamics::Method;

/// How the support is chosen.
///
/// ```
/// use leverrier::{Options, Selection};
///
/// let options = Options { selection: Selection::HeldOut, ..Options::default() };
/// assert_ne!(options.selection, Options::default().selection);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Selection {
    /// The extended Bayesian information criterion.
    Information,
    /// The error on folds of the data that a candidate was not fitted to: the smallest
    /// support within one standard error of the best.
    HeldOut,
}

/// Which trainer.
///
/// ```
/// use leverrier::{Options, Trainer};
///
/// // For a function space of thousands of terms.
/// let options = Options { trainer: Trainer::FirstOrder, ..Options::default() };
/// assert_eq!(options.seed, 0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trainer {
    /// Second order, exact supports.
    GaussNewton,
    /// Mini-batches and a proximal step, for function spaces too large for a factor.
    FirstOrder,
}

/// Options of a fit.
///
/// ```
/// use leverrier::{Loss, Method, Options};
///
/// let options = Options {
///     loss: Loss::by_name("huber").unwrap_or(Loss::SQUARES), // for outliers
///     method: Method::by_name("leapfrog"),
///     seed: 7,
///     ..Options::default()
/// };
/// assert!(options.sparse);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Which trainer; large function spaces are screened by the first-order one in any case.
    pub trainer: Trainer,
    /// How the support is chosen.
    pub selection: Selection,
    /// How much a residual counts.
    pub loss: Loss,
    /// `None`: the cheapest that is accurate enough.
    pub method: Option<Method>,
    /// Longest step of the integrator, in the spec's unit of time; `None`: from an error estimate.
    pub longest_step: Option<f64>,
    /// Samples of a segment, at most; `None`: as long as the model can follow.
    pub window: Option<usize>,
    /// Start values that the spec lists for each inner parameter (in the order of
    /// [`System::parameters`](crate::expr::System)); where there are none, its single start.
    pub parameter_starts: Vec<Vec<f64>>,
    /// Starts of the inner parameters that are tried beside the spec's own.
    pub starts: usize,
    /// Whether to search a support; without it every term stays.
    pub sparse: bool,
    /// Seed of whatever is random: the same seed gives the same model.
    pub seed: u64,
    /// Bytes that the factors of the function space may take; `None`: as many as there are.
    pub memory: Option<u64>,
    /// The numbers that a fit goes by.
    pub tuning: Tuning,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            trainer: Trainer::GaussNewton,
            selection: Selection::Information,
            loss: Loss::SQUARES,
            method: None,
            longest_step: None,
            window: None,
            parameter_starts: Vec::new(),
            starts: 8,
            sparse: true,
            seed: 0,
            memory: None,
            tuning: Tuning::default(),
        }
    }
}
