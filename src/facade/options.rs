//! What may be chosen about a diagnosis and the loop around it. The defaults serve every system.

use crate::diagnose;
use crate::diagnose::discover::{self, Accepts};
use crate::fit;

/// Options of a diagnosis.
///
/// ```
/// use leverrier::DiagnosisOptions;
///
/// // An angle from an encoder and its filtered differences: noise with a memory.
/// let options = DiagnosisOptions { correlated_noise: true, ..DiagnosisOptions::default() };
/// assert_eq!(options.orbits, 0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DiagnosisOptions {
    /// Whether what whole runs leave may be noise whose samples are not independent: then it is
    /// asked whether it looks like that of a filter, and the independent samples are counted. Off
    /// by default: of short records of real rigs it can make friction noise.
    pub correlated_noise: bool,
    /// Orbits of a body that nobody measures that are fitted, at most. None by default: each takes
    /// minutes on a record of decades.
    pub orbits: usize,
}

impl DiagnosisOptions {
    /// Errors that may be noise with a memory, at most, in units of the noise of neighbouring
    /// samples: over two samples that of a process with the memory of some ten looks four times
    /// smaller than it is.
    const CORRELATED: f64 = 4.0;

    /// The numbers that a diagnosis goes by.
    pub(crate) fn tuned(self) -> diagnose::Options {
        let mut options = diagnose::Options::default();
        if self.correlated_noise {
            options.tuning.autocorrelation.largest = Self::CORRELATED;
        }
        options.tuning.hidden.orbits = self.orbits;
        options
    }
}

/// Options of a discovery: of the fits, of the diagnoses, and of what is added.
///
/// ```
/// use leverrier::{DiscoveryOptions, Silent, Spec};
///
/// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
/// let (training, held_out) = spec.data()?.split(0.25, 0)?;
/// let options = DiscoveryOptions { partial: true, ..DiscoveryOptions::default() };
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
    /// Where no story explains the data over whole runs: whether the best that explains a part is
    /// added. By default nothing is.
    pub partial: bool,
}

impl DiscoveryOptions {
    /// The same for the layer that discovers.
    pub(crate) fn tuned(&self) -> discover::DiscoveryOptions {
        discover::DiscoveryOptions {
            fit: self.fit.clone(),
            diagnosis: self.diagnosis.tuned(),
            accepts: if self.partial { Accepts::Partial } else { Accepts::Whole },
        }
    }
}
