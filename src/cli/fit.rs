//! `leverrier fit`: learns a model and writes it beside its spec.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use serde_json::json;

use super::console::{Console, set, usage};
use super::measurements::Measurements;
use super::memory;
use super::progress::Progress;
use super::project::fitting::{origin, write_model};
use super::project::lock::Lock;
use super::project::{ModelFile, Spec};
use crate::dynamics::{METHODS, Method};
use crate::error::{Error, Result};
use crate::fit::{LOSSES, Loss, Options, Selection, Silent, StopReason, Trainer};
use crate::report::{self, FitReport, present};

/// Learn the unknown part of a spec's energy and forces from its data.
///
/// Prints the Hamiltonian, the table of its coefficients with uncertainties, and how sure all
/// of it is; writes the model file beside the spec (pendulum.ham -> pendulum.model.json).
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier fit pendulum.ham\n  \
    leverrier fit pendulum.ham --data tuesday.csv -o tuesday.model.json\n  \
    leverrier fit pendulum.ham --loss huber            outliers in the data\n  \
    leverrier fit pendulum.ham --select held-out       choose terms by error on held-out data\n  \
    leverrier fit stars.ham --memory 1GiB              larger data are read part by part\n  \
    leverrier fit pendulum.ham --format json > fit.json\n\n\
    Ctrl-C keeps the best model so far; a second Ctrl-C ends at once.")]
pub(super) struct Arguments {
    /// The spec.
    pub spec: PathBuf,
    /// Measurements to learn from, instead of those that the spec names.
    #[arg(long, value_name = "FILE")]
    pub data: Option<PathBuf>,
    /// How the terms are chosen.
    #[arg(long, value_enum, default_value_t = Select::Information)]
    pub select: Select,
    /// How much a residual counts.
    #[arg(long, value_name = "LOSS", default_value = "squares",
          value_parser = LOSSES.iter().map(|row| row.name).collect::<Vec<_>>())]
    pub loss: String,
    /// Integrator; by default the cheapest that is accurate enough.
    #[arg(long, value_name = "NAME",
          value_parser = METHODS.iter().map(|row| row.name).collect::<Vec<_>>())]
    pub method: Option<String>,
    /// Longest step of the integrator, in the spec's unit of time.
    #[arg(long, value_name = "TIME")]
    pub step: Option<f64>,
    /// Samples of a segment, at most; by default as many as the model can follow.
    #[arg(long, value_name = "SAMPLES")]
    pub window: Option<usize>,
    /// Further starts of the inner parameters.
    #[arg(long, value_name = "N", default_value_t = 8)]
    pub starts: usize,
    /// Seed of whatever is random: the same seed gives the same result.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Threads to use; by default all cores. The result does not depend on it.
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// Memory that the fit may take, such as 2GiB; data that take more are read part by part.
    /// By default half of what is free.
    #[arg(long, value_name = "SIZE", value_parser = memory::parse)]
    pub memory: Option<u64>,
    /// Keep every term: no search for a sparse model.
    #[arg(long)]
    pub dense: bool,
    /// How to train; first-order is for function spaces too large for the other.
    #[arg(long, value_enum, default_value_t = Train::GaussNewton)]
    pub trainer: Train,
    /// Where to write the model.
    #[arg(short, long, value_name = "MODEL")]
    pub output: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum Select {
    /// By the extended Bayesian information criterion.
    Information,
    /// By the error on held-out data, to which a candidate was not fitted.
    #[value(alias = "unseen")]
    HeldOut,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum Train {
    GaussNewton,
    FirstOrder,
}

impl Arguments {
    fn options(&self) -> Result<Options> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        if self.step.is_some_and(|step| !positive(step)) {
            return Err(usage("--step must be positive", "give a time, such as 0.01"));
        }
        if self.window.is_some_and(|window| window < 2) {
            return Err(usage(
                "--window must be at least 2",
                "motion takes two samples; leave it out to let the fit choose",
            ));
        }
        Ok(Options {
            trainer: match self.trainer {
                Train::GaussNewton => Trainer::GaussNewton,
                Train::FirstOrder => Trainer::FirstOrder,
            },
            selection: match self.select {
                Select::Information => Selection::Information,
                Select::HeldOut => Selection::HeldOut,
            },
            loss: Loss::by_name(&self.loss).unwrap_or(Loss::SQUARES),
            method: self.method.as_deref().and_then(Method::by_name),
            longest_step: self.step,
            window: self.window,
            starts: self.starts,
            sparse: !self.dense,
            seed: self.seed,
            memory: Some(memory::allowed(self.memory)?),
            ..Options::default()
        })
    }
}

/// Runs the command.
pub(super) fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let mut options = arguments.options()?;
    // A model that goes elsewhere is nobody else's.
    let lock = (arguments.output.is_none())
        .then(|| Lock::take(&arguments.spec, &Silent, |what| console.message(what)));
    let _lock = lock.transpose()?;
    let spec = Spec::open(&arguments.spec)?;
    options.parameter_starts.clone_from(&spec.compiled().starts);
    console.diagnostics(spec.name(), spec.text(), spec.warnings());
    let path = arguments.output.clone().unwrap_or_else(|| spec.model_path());
    require_writable(&path)?;
    let clock = Instant::now();
    let progress = Progress::new();
    let measurements = Measurements::read(
        &spec,
        arguments.data.as_deref(),
        options.memory.unwrap_or(u64::MAX),
        &options,
        &progress,
        |what| console.message(what),
    )?;
    let (dataset, about) = (measurements.dataset(), measurements.report());
    for warning in &about.warnings {
        console.warning(warning);
    }
    let learned = measurements.learn(spec.system(), &options, arguments.threads, &progress);
    drop(progress);
    let model = learned?;
    let elapsed = clock.elapsed().as_secs_f64();

    let file = ModelFile { model, origin: origin(&spec, dataset, about) };
    // A result that cannot be kept is still printed: it may have taken hours.
    let written = write_model(&path, &file);
    let simplified = present::simplified(&spec.learned(&file.model)?, &file.origin.ranges);
    let measured = about.columns.iter().map(|column| column.measured > 0).collect();
    let report =
        FitReport { system: spec.system(), model: &file.model, simplified, measured, elapsed };
    let mut object = report.to_json();
    let path_text = written.is_ok().then(|| path.display().to_string());
    set(&mut object, "model_file", json!(path_text));
    set(&mut object, "data", json!(about));
    let text = report::fit_text(&report, console.width());
    console.result(&text, &object)?;
    written?;
    if file.model.stop.reason == StopReason::Interrupted {
        console.warning("Interrupted: this is the best model up to then.");
    }
    console.message(&format!("Model written to {}.", path.display()));
    Ok(())
}

/// Whether a file can be made there: to be known before the work, not after it.
fn require_writable(path: &Path) -> Result<()> {
    let failed = |error| Error::file("write", path, error);
    if path.is_dir() {
        return Err(failed(std::io::Error::other("it is a folder; name a file with -o")));
    }
    if path.exists() {
        return Ok(());
    }
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let advice = "name a file in a folder that can be written with -o";
    match tempfile::tempfile_in(folder) {
        Ok(_) => Ok(()),
        Err(error) => {
            let what = match error.kind() {
                std::io::ErrorKind::NotFound => "there is no such folder".to_string(),
                std::io::ErrorKind::PermissionDenied => "the folder is read-only".to_string(),
                kind => kind.to_string(),
            };
            Err(failed(std::io::Error::new(error.kind(), format!("{what}; {advice}"))))
        }
    }
}
