//! The options that say what a diagnosis looks for beside the usual.

use clap::{ArgAction, Args};

use crate::facade::DiagnosisOptions;

/// What a diagnosis looks for beside the usual.
#[derive(Args, Debug, Clone, Copy)]
pub(super) struct DiagnosisArguments {
    /// Whether what is left may be noise with a memory, such as that of a filter; `=false` where
    /// no reading knows of the one before it.
    #[arg(
        long,
        value_name = "BOOL",
        action = ArgAction::Set,
        default_value_t = true,
        default_missing_value = "true",
        num_args = 0..=1,
        require_equals = true
    )]
    pub correlated_noise: bool,
    /// Orbits of a body that nobody measures to fit, at most, where bodies of known masses attract
    /// each other; 0: none is looked for.
    #[arg(long, value_name = "N", default_value_t = DiagnosisOptions::default().orbits)]
    pub orbits: usize,
    /// Ask for effects on any two of many coordinates, also where nothing in the spec couples them;
    /// the number of pairs grows with the square of the coordinates.
    #[arg(long)]
    pub all_pairs: bool,
}

impl Default for DiagnosisArguments {
    fn default() -> Self {
        let DiagnosisOptions { correlated_noise, orbits, all_pairs } = DiagnosisOptions::default();
        DiagnosisArguments { correlated_noise, orbits, all_pairs }
    }
}

impl DiagnosisArguments {
    /// The same as options.
    pub(super) fn options(self) -> DiagnosisOptions {
        let DiagnosisArguments { correlated_noise, orbits, all_pairs } = self;
        DiagnosisOptions { correlated_noise, orbits, all_pairs }
    }
}
