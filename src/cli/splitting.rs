//! The options that say how measurements are split.

use std::path::PathBuf;

use clap::Args;

use super::console::usage;
use crate::error::Result;
use crate::project::workspace::{self, HELD_OUT};

/// How the measurements are split.
#[derive(Args, Debug, Clone)]
pub(super) struct SplitArguments {
    /// Measurements, instead of those that the spec names.
    #[arg(long, value_name = "FILE")]
    pub data: Option<PathBuf>,
    /// Share of the samples that are held out: no model is fitted to them before it is judged on
    /// them.
    #[arg(long, alias = "unseen", value_name = "FRACTION", default_value_t = HELD_OUT)]
    pub held_out: f64,
    /// Seed of the choice of held-out runs: the same seed makes the same choice.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Threads to use; by default all cores. The result does not depend on it.
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
}

impl SplitArguments {
    /// What was asked for, where it is possible.
    pub(super) fn asked(&self) -> Result<workspace::SplitOptions> {
        let SplitArguments { data, held_out, seed, threads } = self.clone();
        if !workspace::SHARES.contains(&held_out) {
            return Err(usage(
                "--held-out must be between 0 and 0.9",
                "give the share of the samples to put aside, such as 0.25",
            ));
        }
        Ok(workspace::SplitOptions { data, held_out, seed, threads })
    }
}
