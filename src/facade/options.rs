//! What may be chosen about a diagnosis and the loop around it. The defaults serve every system.

use crate::diagnose;
use crate::diagnose::discover;
use crate::fit;

/// Options of a diagnosis.
///
/// ```
/// use leverrier::DiagnosisOptions;
///
/// // Readings that no filter has touched: what whole runs leave is a force.
/// let options = DiagnosisOptions { correlated_noise: false, ..DiagnosisOptions::default() };
/// assert_eq!(options.orbits, 0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DiagnosisOptions {
    /// Whether what whole runs leave may be noise whose samples are not independent: then it is
    /// asked whether it looks like that of a filter, and the independent samples are counted. On by
    /// default; short records, and readings in coarse steps, cannot tell it from something missing.
    pub correlated_noise: bool,
    /// Orbits of a body that nobody measures that are fitted, at most: 0, none is looked for. It is
    /// looked for among bodies of known masses that attract each other, and nowhere else.
    pub orbits: usize,
    /// Whether effects on two of many coordinates (twelve or more) are asked for on any two. By
    /// default only on those that a summand of the spec couples: the number of pairs grows with
    /// the square.
    pub all_pairs: bool,
}

impl Default for DiagnosisOptions {
    fn default() -> Self {
        let orbits = diagnose::Options::default().tuning.hidden.orbits;
        DiagnosisOptions { correlated_noise: true, orbits, all_pairs: false }
    }
}

impl DiagnosisOptions {
    /// The numbers that a diagnosis goes by.
    pub(crate) fn tuned(self) -> diagnose::Options {
        let mut options = diagnose::Options::default();
        if !self.correlated_noise {
            options.tuning.autocorrelation.largest = 1.0;
        }
        if self.all_pairs {
            options.tuning.candidates.pair_coordinates = usize::MAX;
        }
        options.tuning.hidden.orbits = self.orbits;
        options
    }
}

/// Options of a discovery: of the fits and of the diagnoses.
///
/// ```
/// use leverrier::{DiscoveryOptions, Silent, Spec};
///
/// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
/// let (training, held_out) = spec.data()?.split(0.25, 0)?;
/// let options = DiscoveryOptions::default();
/// let found = spec.discover(&training, &held_out, &options, &Silent)?;
/// assert_eq!(found.steps()[0].effect, "viscous_drag(q)");
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DiscoveryOptions {
    /// Of every fit.
    pub fit: fit::Options,
    /// Of every diagnosis.
    pub diagnosis: DiagnosisOptions,
}

impl DiscoveryOptions {
    /// The same for the layer that discovers.
    pub(crate) fn tuned(&self) -> discover::DiscoveryOptions {
        discover::DiscoveryOptions { fit: self.fit.clone(), diagnosis: self.diagnosis.tuned() }
    }
}
