//! The options that say what a diagnosis looks for beside the usual.

use clap::Args;

use crate::facade::DiagnosisOptions;

/// What a diagnosis looks for beside the usual.
#[derive(Args, Debug, Clone, Copy, Default)]
pub(super) struct DiagnosisArguments {
    /// Ask whether what is left is noise with a memory, such as that of a filter. Of short records
    /// of real rigs this can make friction noise.
    #[arg(long)]
    pub correlated_noise: bool,
    /// Orbits of a body that nobody measures to fit, at most; each takes minutes on a record of
    /// decades.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub orbits: usize,
}

impl DiagnosisArguments {
    /// The same as options.
    pub(super) fn options(self) -> DiagnosisOptions {
        let DiagnosisArguments { correlated_noise, orbits } = self;
        DiagnosisOptions { correlated_noise, orbits }
    }
}
