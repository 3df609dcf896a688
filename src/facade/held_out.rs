//! A law before measurements: learned anew, compared, diagnosed.

use std::sync::Arc;

use super::{Comparison, Data, Diagnosis, DiagnosisOptions, Law, Spec};
use crate::data::Dataset;
use crate::diagnose::comparison::{Compared, compare};
use crate::diagnose::diagnosis::{self, diagnose};
use crate::diagnose::instrument::detect;
use crate::diagnose::{self, LawOnData, sufficiency};
use crate::error::{Error, ErrorKind, Result};
use crate::expr::System;
use crate::fit::model::fingerprint;
use crate::fit::{self, Loss, Model, Monitor, Options, Silent, resume};

/// The terms of a model with their numbers learned anew; `warm` begins at the model's own, which
/// are then nearly right.
pub(crate) fn refit(
    spec: &Spec,
    model: &Model,
    data: &Dataset,
    warm: bool,
    monitor: &dyn Monitor,
) -> Result<Model> {
    let system = spec.system();
    let search = || {
        let parameter_starts = spec.compiled().starts.clone();
        fit::fit(system, data, &Options { parameter_starts, ..Options::default() }, monitor)
    };
    let Some(law) = model.law(system) else { return search() };
    let mut narrowed = System::clone(system);
    narrowed.terms = law.terms().map(|(_, term, _)| term.clone()).collect();
    for (parameter, &value) in narrowed.parameters.iter_mut().zip(law.parameters()) {
        parameter.start = value;
    }
    let narrowed = Arc::new(narrowed);
    if narrowed.terms.is_empty() && narrowed.parameters.is_empty() {
        return search();
    }
    // Whoever fitted with a robust loss meant it.
    let loss = Loss::by_name(&model.evidence.loss).unwrap_or(Loss::SQUARES);
    let options = Options { sparse: false, starts: 0, loss, ..Options::default() };
    let mut again = match warm {
        true => resume(&law.on(&narrowed), data, &options, monitor)?,
        false => fit::fit(&narrowed, data, &options, monitor)?,
    };
    again.fingerprint = fingerprint(system);
    again.evidence.function_space = system.terms.len();
    Ok(again)
}

impl Law {
    /// The same terms with their numbers learned anew from other measurements: what a law is
    /// judged by that has seen all of them.
    ///
    /// # Errors
    /// As [`Spec::fit_monitored`]; the law was not fitted
    /// ([`ErrorKind::NotApplicable`](crate::ErrorKind::NotApplicable)).
    ///
    /// ```
    /// use leverrier::{Silent, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let data = spec.data()?;
    /// let law = spec.fit(&data)?;
    /// let (training, _) = data.split(0.25, 0)?;
    /// assert_eq!(law.refit(&training, &Silent)?.terms().len(), law.terms().len());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn refit(&self, data: &Data, monitor: &dyn Monitor) -> Result<Law> {
        data.require(self.spec())?;
        let model = &self.fitted("refit")?.model;
        let model = refit(self.spec(), model, data.dataset(), false, monitor)?;
        Law::learned(self.spec(), model, data)
    }

    /// Holds the law against measurements, best such that it was not learned from.
    ///
    /// # Errors
    /// The measurements are of another spec
    /// ([`ErrorKind::InvalidArgument`](crate::ErrorKind::InvalidArgument)), or the law knows no
    /// noise to judge by, for it was not fitted
    /// ([`ErrorKind::NotApplicable`](crate::ErrorKind::NotApplicable)).
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let comparison = spec.fit(&training)?.compare(&held_out)?;
    /// for finding in comparison.findings() {
    ///     println!("{finding}");
    /// }
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn compare(&self, data: &Data) -> Result<Comparison> {
        data.require(self.spec())?;
        self.fitted("compare")?;
        some_runs(data)?;
        let options = diagnose::Options::default();
        let model = LawOnData::of(self.numbers().clone(), data.dataset(), &options);
        Ok(Comparison::of(compare(&model, None)?, &[]))
    }

    /// The same on the measurements that the law was learned from and on held-out ones beside
    /// each other: what the program's `compare` shows. The errors are in units of the noise floor,
    /// or of `noise`, one number for each observable, where two laws are to be held beside each
    /// other.
    ///
    /// # Errors
    /// As [`Law::compare`].
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let comparison = spec.fit(&training)?.compare_held_out(&training, &held_out, None)?;
    /// assert!(comparison.horizons()[0].held_out.is_some());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn compare_held_out(
        &self,
        training: &Data,
        held_out: &Data,
        noise: Option<&[f64]>,
    ) -> Result<Comparison> {
        training.require(self.spec())?;
        held_out.require(self.spec())?;
        self.fitted("compare")?;
        some_runs(training)?;
        let options = diagnose::Options::default();
        let unseen = (held_out.runs() > 0).then(|| held_out.dataset());
        let law = self.numbers().clone();
        let compared = Compared::new(law, training.dataset(), unseen, &options, noise)?;
        Ok(Comparison::of(compared.comparison, &compared.detections))
    }

    /// Asks what the law misses: every effect of the catalogue is tested on the measurements that
    /// it was learned from, and the best are judged on held-out ones.
    ///
    /// # Errors
    /// The measurements are of another spec
    /// ([`ErrorKind::InvalidArgument`](crate::ErrorKind::InvalidArgument)), or the law was not
    /// fitted ([`ErrorKind::NotApplicable`](crate::ErrorKind::NotApplicable)).
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let diagnosis = spec.fit(&training)?.diagnose(&training, &held_out)?;
    /// println!("{:?}: {}", diagnosis.verdict(), diagnosis.reason());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn diagnose(&self, training: &Data, held_out: &Data) -> Result<Diagnosis> {
        self.diagnose_with(training, held_out, &DiagnosisOptions::default())
    }

    /// The same with options.
    ///
    /// # Errors
    /// As [`Law::diagnose`].
    ///
    /// ```
    /// use leverrier::{DiagnosisOptions, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let options = DiagnosisOptions { correlated_noise: false, ..DiagnosisOptions::default() };
    /// let diagnosis = spec.fit(&training)?.diagnose_with(&training, &held_out, &options)?;
    /// assert_eq!(diagnosis.missing(), Some("viscous_drag(q)"));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn diagnose_with(
        &self,
        training: &Data,
        held_out: &Data,
        options: &DiagnosisOptions,
    ) -> Result<Diagnosis> {
        self.diagnose_monitored(training, held_out, options, &Silent)
    }

    /// The same, telling a monitor how far it has come, and asking it whether to stop: the
    /// diagnosis is then of what was tested so far.
    ///
    /// # Errors
    /// As [`Law::diagnose`].
    ///
    /// ```
    /// use leverrier::{DiagnosisOptions, Silent, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let (law, options) = (spec.fit(&training)?, DiagnosisOptions::default());
    /// let diagnosis = law.diagnose_monitored(&training, &held_out, &options, &Silent)?;
    /// assert_eq!(diagnosis.missing(), Some("viscous_drag(q)"));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn diagnose_monitored(
        &self,
        training: &Data,
        held_out: &Data,
        options: &DiagnosisOptions,
        monitor: &dyn Monitor,
    ) -> Result<Diagnosis> {
        training.require(self.spec())?;
        held_out.require(self.spec())?;
        self.fitted("diagnose")?;
        let (compiled, law) = (self.spec().compiled(), self.numbers());
        let options = options.tuned();
        let unseen = (held_out.runs() > 0).then(|| held_out.dataset());
        let (training, held_out) = (training.dataset(), held_out.dataset());
        if let Some(reason) = sufficiency::lacking(&compiled.system, training, unseen, &options) {
            return Ok(Diagnosis::of(diagnosis::Diagnosis::too_little(reason), &[]));
        }
        let found = diagnose(compiled, law, training, held_out, &options, monitor)?;
        let detections = detect(&LawOnData::of(law.clone(), training, &options));
        Ok(Diagnosis::of(found, &detections))
    }
}

/// A comparison needs something to compare with.
fn some_runs(data: &Data) -> Result<()> {
    if data.runs() > 0 {
        return Ok(());
    }
    Err(Error::new(
        ErrorKind::InsufficientData,
        "there is no run to compare the law with",
        "measure more runs: of one alone nothing can be held out; or compare with those it is of",
    ))
}
