//! A spec with its measurements in two parts: what a model learns from and what judges it.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::fitting::{learn, on_threads};
use super::{Listener, Spec};
use crate::data::{DataReport, Dataset, Split};
use crate::diagnose::LawOnData;
use crate::diagnose::comparison;
use crate::error::{Error, ErrorKind, Result};
use crate::facade::held_out;
use crate::fit::{Law, Model, Monitor, Options, resume};

/// Share of the samples that is put aside where nothing is said.
pub(crate) const HELD_OUT: f64 = 0.25;
/// Shares that leave something to learn from.
pub(crate) const SHARES: RangeInclusive<f64> = 0.0..=0.9;

/// How the measurements are split.
#[derive(Debug, Clone)]
pub(crate) struct SplitOptions {
    /// Measurements, instead of those that the spec names.
    pub data: Option<PathBuf>,
    /// Share of the samples that are held out: no model is fitted to them before it is judged on
    /// them.
    pub held_out: f64,
    /// Seed of the choice of held-out runs: the same seed makes the same choice.
    pub seed: u64,
    /// Threads to use; by default all cores. The result does not depend on it.
    pub threads: Option<usize>,
}

impl Default for SplitOptions {
    /// What is meant where nothing is said.
    fn default() -> Self {
        SplitOptions { data: None, held_out: HELD_OUT, seed: 0, threads: None }
    }
}

/// A spec with its measurements split.
pub(crate) struct Workspace {
    pub spec: Spec,
    pub dataset: Dataset,
    pub about: DataReport,
    pub split: Split,
    pub splitting: SplitOptions,
}

impl Workspace {
    /// Reads a spec and its data, and splits these.
    pub(crate) fn open(
        spec: &Path,
        splitting: &SplitOptions,
        listener: &dyn Listener,
    ) -> Result<Self> {
        if !SHARES.contains(&splitting.held_out) {
            return Err(Error::new(
                ErrorKind::InvalidArgument,
                "the share of held-out samples must be between 0 and 0.9",
                "give the share of the samples to put aside, such as 0.25",
            ));
        }
        let spec = Spec::open(spec)?;
        listener.diagnostics(spec.name(), spec.text(), spec.warnings());
        let (dataset, about) = spec.measurements(splitting.data.as_deref())?;
        for warning in &about.warnings {
            listener.warning(warning);
        }
        let split = dataset.split_held_out(splitting.held_out, splitting.seed);
        Ok(Workspace { spec, dataset, about, split, splitting: splitting.clone() })
    }

    /// Held-out runs, if there are any.
    pub(crate) fn held_out(&self) -> Option<&Dataset> {
        (!self.split.held_out.runs.is_empty()).then_some(&self.split.held_out)
    }

    /// The split, for programs.
    pub(crate) fn split_json(&self) -> Value {
        let names = |data: &Dataset| -> Vec<String> {
            data.runs.iter().map(|run| run.name.clone()).collect()
        };
        json!({
            "how": self.split.how,
            "fraction": self.splitting.held_out,
            "seed": self.splitting.seed,
            "training": names(&self.split.training),
            "held_out": names(&self.split.held_out),
        })
    }

    /// A model that has seen the training part alone, and where its terms come from.
    ///
    /// The terms are those of the model file where it belongs to the spec: their numbers are
    /// learned anew, for the file's own may come from all measurements.
    pub(crate) fn model(&self, monitor: &dyn Monitor) -> Result<(Model, &'static str)> {
        if !self.spec.system().terms.is_empty()
            && let Ok(law) = self.spec.law(None)
            && let Some(file) = law.file()
        {
            let model = self.refit(&self.spec, &file.model, &self.split.training, monitor)?;
            return Ok((
                model,
                "the terms of the model file, their numbers from the training part",
            ));
        }
        let model = self.fit(&self.spec, monitor)?;
        let system = self.spec.system();
        if system.terms.is_empty() && system.parameters.is_empty() {
            return Ok((model, "all of it known, its noise from the training part"));
        }
        Ok((model, "terms and numbers from the training part"))
    }

    /// Searches terms and numbers of a spec (this one, or an edited one) on the training part.
    pub(crate) fn fit(&self, spec: &Spec, monitor: &dyn Monitor) -> Result<Model> {
        let parameter_starts = spec.compiled().starts.clone();
        let options = Options { parameter_starts, ..Options::default() };
        let (system, threads) = (spec.system(), self.splitting.threads);
        let training = self.split.training.with_observables(system.observables());
        learn(system, &training, &options, threads, monitor)
    }

    /// Learns an edited spec on the training part, beginning at what is known already.
    pub(crate) fn resume(&self, start: &Law, monitor: &dyn Monitor) -> Result<Model> {
        let options = Options::default();
        let training = self.split.training.with_observables(start.system().observables());
        on_threads(self.splitting.threads, || resume(start, &training, &options, monitor))
    }

    /// The terms of a model with their numbers learned anew.
    pub(crate) fn refit(
        &self,
        spec: &Spec,
        model: &Model,
        data: &Dataset,
        monitor: &dyn Monitor,
    ) -> Result<Model> {
        self.again(spec, model, data, false, monitor)
    }

    /// The terms of a model of the training part with numbers from all measurements, beginning
    /// at the model's own, which are nearly right.
    pub(crate) fn widen(&self, spec: &Spec, model: &Model, monitor: &dyn Monitor) -> Result<Model> {
        self.again(spec, model, &self.dataset, true, monitor)
    }

    fn again(
        &self,
        spec: &Spec,
        model: &Model,
        data: &Dataset,
        warm: bool,
        monitor: &dyn Monitor,
    ) -> Result<Model> {
        let data = data.with_observables(spec.system().observables());
        on_threads(self.splitting.threads, || held_out::refit(spec, model, &data, warm, monitor))
    }
}

/// Error over each length of prediction (in samples), in units of `noise`.
pub(crate) fn errors(model: &LawOnData, noise: &[f64], windows: &[usize]) -> Vec<(usize, f64)> {
    let judge = model.with_noise(noise.to_vec());
    windows.iter().map(|&window| (window, comparison::error(&judge, window).0)).collect()
}
