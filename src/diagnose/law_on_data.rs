//! A law on data: what every question about the misfit is asked of.

use std::borrow::Cow;
use std::sync::Arc;

use super::autocorrelation::Noise;
use super::options::Options;
use super::tuning::Tuning;
use crate::data::{Dataset, Packed};
use crate::expr::System;
use crate::fit::own_values::as_inputs;
use crate::fit::segments::packed;
use crate::fit::{Law, Monitor, Silent};

/// Measurements that a law is held against.
#[derive(Clone)]
pub struct Measurements<'a> {
    /// As they were read.
    pub dataset: Cow<'a, Dataset>,
    /// The same, run after run.
    pub packed: Arc<Packed>,
    /// Samples that questions are asked of, at most; they are spread over all segments.
    pub most: usize,
}

impl<'a> Measurements<'a> {
    /// All samples of a data set.
    pub fn of(dataset: &'a Dataset, options: &Options) -> Measurements<'a> {
        let packed = Arc::new(packed(dataset, &options.fit.segments));
        Measurements { dataset: Cow::Borrowed(dataset), packed, most: usize::MAX }
    }

    /// The same with another data set.
    fn with(&self, dataset: Dataset, options: &Options) -> Measurements<'a> {
        let packed = Arc::new(packed(&dataset, &options.fit.segments));
        Measurements { dataset: Cow::Owned(dataset), packed, most: self.most }
    }
}

/// A law, the measurements that it is held against, and the numbers that this goes by.
///
/// The law's noise is what residuals are weighed by, its steps integrate predictions, and its
/// window is the length of a segment.
#[derive(Clone)]
pub struct LawOnData<'a> {
    /// The law.
    pub law: Law,
    /// The measurements.
    pub data: Measurements<'a>,
    /// What was chosen about the diagnosis.
    pub options: &'a Options,
    /// Samples for each independent one, at least 1: the integrated autocorrelation time of the
    /// noise.
    pub autocorrelation_time: f64,
    /// Whether the noise is what the steps leave: these are kept then, for noise that grew by them
    /// would ask for larger ones.
    pub at_steps: bool,
    /// Asked whether to stop.
    pub monitor: &'a dyn Monitor,
    /// The law whose runs have numbers for themselves, where they have: here these are inputs.
    before: Option<Arc<Law>>,
}

impl<'a> LawOnData<'a> {
    /// A law on all samples of a data set.
    pub fn of(law: Law, dataset: &'a Dataset, options: &'a Options) -> LawOnData<'a> {
        LawOnData::on(law, &Measurements::of(dataset, options), options)
    }

    /// A law on measurements that are packed already.
    pub fn on(law: Law, data: &Measurements<'a>, options: &'a Options) -> LawOnData<'a> {
        // What runs have for themselves are inputs already where another law made them so.
        let plain = law.system().inputs.iter().all(|input| !input.own);
        let of_runs = plain.then(|| as_inputs(&law, &data.dataset)).flatten();
        let (law, data, before) = match of_runs {
            Some((of_runs, dataset)) => (of_runs, data.with(dataset, options), Some(Arc::new(law))),
            None => (law, data.clone(), None),
        };
        let law = resolving(law, &data.packed, options.tuning.noise_floor.levels);
        LawOnData {
            law,
            data,
            options,
            autocorrelation_time: 1.0,
            at_steps: false,
            monitor: &Silent,
            before,
        }
    }

    /// The same, whose fits end early when a monitor says so.
    pub fn heeding(self, monitor: &'a dyn Monitor) -> LawOnData<'a> {
        LawOnData { monitor, ..self }
    }

    /// What the law is of.
    pub fn system(&self) -> &Arc<System> {
        self.law.system()
    }

    fn inputs(&self) -> usize {
        self.system().inputs.len()
    }

    /// The numbers that the diagnosis goes by.
    pub fn tuning(&self) -> &'a Tuning {
        &self.options.tuning
    }

    /// Another law on the same measurements.
    pub fn with_law(&self, law: Law) -> LawOnData<'a> {
        LawOnData { law, ..self.clone() }
    }

    /// The same over segments of another length, in samples.
    pub fn with_window(&self, window: usize) -> LawOnData<'a> {
        self.with_law(self.law.clone().with_window(window))
    }

    /// Standard deviation of what was measured of each observable.
    pub fn spreads(&self) -> Vec<f64> {
        let of = |observable: usize| {
            let all = self.data.packed.column(observable).iter().filter(|x| x.is_finite());
            let count = all.clone().count().max(1) as f64;
            let mean = all.clone().sum::<f64>() / count;
            (all.map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt()
        };
        (0..self.law.noise().len()).map(of).collect()
    }

    /// Whether what is left below the noise is no white noise that anything could be told by, but
    /// what steps and digits leave: of data that are finer than those of instruments.
    pub fn is_computed(&self) -> bool {
        let finest = self.options.fit.conclusion.clean;
        let mut both = self.law.noise().iter().zip(self.spreads());
        self.at_steps || both.all(|(noise, spread)| *noise < finest * spread)
    }

    /// What residuals are weighed by.
    pub fn noise(&self) -> Noise {
        let autocorrelation_time = self.autocorrelation_time;
        Noise { sizes: self.law.noise().to_vec(), autocorrelation_time }
    }

    /// The same with residuals weighed by another noise.
    pub fn with_noise(&self, noise: impl Into<Noise>) -> LawOnData<'a> {
        let Noise { sizes, autocorrelation_time } = noise.into();
        let law = self.law.clone().with_noise(sizes);
        LawOnData { autocorrelation_time, ..self.with_law(law) }
    }

    /// The same law on other measurements.
    pub fn with_data(&self, data: &Measurements<'a>) -> LawOnData<'a> {
        let own = self.before.as_ref().filter(|_| data.dataset.inputs.len() < self.inputs());
        let data = match own.and_then(|before| as_inputs(before, &data.dataset)) {
            Some((_, dataset)) => data.with(dataset, self.options),
            None => data.clone(),
        };
        LawOnData { data, ..self.clone() }
    }

    /// The same law on a part of its measurements.
    pub fn thinned(&self, most: usize) -> LawOnData<'a> {
        let data = Measurements { most, ..self.data.clone() };
        LawOnData { data, ..self.clone() }
    }
}

/// A law whose residuals mean nothing below a step between so many levels of each column's range.
fn resolving(law: Law, measured: &Packed, levels: f64) -> Law {
    let step = |column: &[f64]| {
        let values = || column.iter().copied().filter(|x| x.is_finite());
        let range =
            values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min);
        range.max(0.0) / levels
    };
    let known = law.resolution().iter().enumerate();
    let resolution: Vec<f64> =
        known.map(|(row, known)| known.max(step(measured.column(row)))).collect();
    let noise = law.noise().iter().zip(&resolution).map(|(noise, least)| noise.max(*least));
    let noise = noise.collect();
    law.with_resolution(resolution).with_noise(noise)
}
