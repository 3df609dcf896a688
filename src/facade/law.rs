//! A law: a spec with a number for everything in it.

use std::fmt;
use std::path::Path;

use super::data::inputs_of;
use super::model_file::{self, ModelFile};
use super::origin;
use super::{Data, Spec, Trajectory};
use crate::error::{Error, ErrorKind, Result};
use crate::fit::distribution::Distribution;
use crate::fit::hidden::HiddenMotion;
use crate::fit::model::{LearnedParameter, LearnedTerm, Noise};
use crate::fit::{self, Model};
use crate::simulate::IntegratorChoice;

/// A law of motion: a spec with a number for everything in it, learned or known.
///
/// ```
/// use leverrier::{Data, Spec};
///
/// let spec = Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ poly(q; 4), cos(q) }")?;
/// let times: Vec<f64> = (0..60).map(|i| 0.1 * i as f64).collect();
/// let q: Vec<f64> = times.iter().map(|t| t.cos()).collect();
/// let p: Vec<f64> = times.iter().map(|t| -t.sin()).collect();
/// let law = spec.fit(&Data::from_slices(&spec, &times, &[&q, &p])?)?;
///
/// assert_eq!(law.terms().len(), 1);
/// let later = law.predict(&[1.0, 0.0], &[0.0, 20.0])?;
/// assert!((later.states()[1][0] - 20.0_f64.cos()).abs() < 1e-6);
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Law {
    spec: Spec,
    numbers: fit::Law,
    /// `None` for a law that stands in its spec.
    file: Option<ModelFile>,
}

/// Steps of the fit that equal steps of a prediction may be looked for in, at a time: over longer
/// spans the error of a step cannot be estimated.
const STEPS_TOGETHER: f64 = 10.0;
/// Parts that an interval is divided into, at most.
const PARTS: f64 = 1e5;

/// Times between `times` such that none are further apart than `longest`, and where `times` are
/// among them.
fn subdivided(times: &[f64], longest: f64) -> (Vec<f64>, Vec<usize>) {
    let mut fine: Vec<f64> = times.first().copied().into_iter().collect();
    let mut wanted = vec![0];
    for (from, to) in times.iter().zip(times.iter().skip(1)) {
        let parts = ((to - from) / longest).ceil().clamp(1.0, PARTS) as usize;
        let inner = (1..parts).map(|part| from + (to - from) * part as f64 / parts as f64);
        fine.extend(inner);
        fine.push(*to);
        wanted.push(fine.len() - 1);
    }
    (fine, wanted)
}

impl Law {
    pub(super) fn learned(spec: &Spec, model: Model, data: &Data) -> Result<Law> {
        let numbers = model.law(spec.system()).ok_or_else(|| {
            Error::new(ErrorKind::Internal, "the model does not fit its own spec", "report this")
        })?;
        let spec_file = (spec.file(), spec.text());
        let origin = origin::origin(spec.system(), spec_file, data.dataset(), data.report());
        Ok(Law { spec: spec.clone(), numbers, file: Some(ModelFile { model, origin }) })
    }

    /// A law of a spec's system, with the model file that it comes from, if there is one.
    pub(crate) fn of(spec: &Spec, numbers: fit::Law, file: Option<ModelFile>) -> Law {
        Law { spec: spec.clone(), numbers, file }
    }

    pub(super) fn known(spec: &Spec) -> Result<Law> {
        if !spec.system().terms.is_empty() {
            return Err(Error::new(
                ErrorKind::NotApplicable,
                format!("{} has terms that are to be learned", spec.name()),
                "fit it to measurements, or write a number before each term",
            ));
        }
        let numbers = fit::Law::known(spec.system().clone())?;
        Ok(Law { spec: spec.clone(), numbers, file: None })
    }

    /// Reads a model file, as [`Law::save`] and the program `leverrier` write it, that was fitted
    /// to this spec.
    ///
    /// # Errors
    /// The file cannot be read ([`ErrorKind::File`]), or is damaged or of another spec
    /// ([`ErrorKind::Model`]).
    ///
    /// ```
    /// use leverrier::{Law, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let name = format!("leverrier-law-open-{}.model.json", std::process::id());
    /// let path = std::env::temp_dir().join(name);
    /// let law = spec.fit(&spec.data()?)?;
    /// law.save(&path)?;
    /// assert_eq!(Law::open(&path, &spec)?.terms(), law.terms());
    /// # std::fs::remove_file(&path).unwrap();
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn open(path: impl AsRef<Path>, spec: &Spec) -> Result<Law> {
        let again = "fit the spec again";
        let (numbers, file) = model_file::read(path.as_ref(), spec.name(), spec.system(), again)?;
        Ok(Law { spec: spec.clone(), numbers, file: Some(file) })
    }

    /// Writes the model file, whole or not at all; a file that is there is replaced.
    ///
    /// # Errors
    /// The file cannot be written ([`ErrorKind::File`]), or the law was not fitted and stands in
    /// its spec ([`ErrorKind::NothingToDo`]).
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let name = format!("leverrier-law-save-{}.model.json", std::process::id());
    /// let path = std::env::temp_dir().join(name);
    /// spec.fit(&spec.data()?)?.save(&path)?;
    /// assert!(std::fs::read_to_string(&path).unwrap().contains("leverrier.model/2"));
    /// # std::fs::remove_file(&path).unwrap();
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        model_file::write(path.as_ref(), self.fitted("save")?)
    }

    /// The spec that it is of.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = q^2/2")?;
    /// assert_eq!(spec.known_law()?.spec().text(), spec.text());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn spec(&self) -> &Spec {
        &self.spec
    }

    /// The terms that were found, each with its coefficient and standard error; none for a law
    /// that stands in its spec.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let law = spec.fit(&spec.data()?)?;
    /// let term = &law.terms()[0];
    /// assert_eq!((term.place.as_str(), term.term.as_str()), ("V", "cos(q)"));
    /// assert!((term.coefficient + 1.0).abs() < 5.0 * term.standard_error.max(0.002));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn terms(&self) -> &[LearnedTerm] {
        self.file.as_ref().map_or(&[], |file| &file.model.terms)
    }

    /// The coefficient of a term of the function space, written as [`Spec::terms`] gives it (or by
    /// its own name): zero where it was not chosen, `None` where there is no such term.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let law = spec.fit(&spec.data()?)?;
    /// assert!(law.coefficient("cos(q)").unwrap() < 0.0);
    /// assert_eq!(law.coefficient("sin(q)"), None);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn coefficient(&self, term: &str) -> Option<f64> {
        let named =
            |learned: &&LearnedTerm| learned.term == term || learned.name.as_deref() == Some(term);
        if let Some(learned) = self.terms().iter().find(named) {
            return Some(learned.coefficient);
        }
        self.spec.terms().contains(&term).then_some(0.0)
    }

    /// The inner parameters that occur in the law, with their standard errors.
    ///
    /// ```
    /// use leverrier::{Data, Spec};
    ///
    /// let spec = Spec::parse("coordinates q; momenta p\nparam k = 1.5\nT = p^2/2\nV = span{ cos(k*q) }")?;
    /// let truth = Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = -cos(2*q)/4")?;
    /// let times: Vec<f64> = (0..200).map(|i| 0.05 * i as f64).collect();
    /// let motion = truth.known_law()?.predict(&[1.2, 0.0], &times)?;
    /// let (q, p) = (motion.column("q").unwrap(), motion.column("p").unwrap());
    /// let law = spec.fit(&Data::from_slices(&spec, &times, &[&q, &p])?)?;
    /// assert!((law.parameters()[0].value.abs() - 2.0).abs() < 1e-6);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn parameters(&self) -> &[LearnedParameter] {
        self.file.as_ref().map_or(&[], |file| &file.model.parameters)
    }

    /// Inner parameters of which every run, or every group of runs, has a value of its own: mean,
    /// spread, and the value of each; none where the spec says `per` of no parameter.
    ///
    /// ```
    /// use leverrier::{Spec, Data, Values};
    ///
    /// let spec = Spec::parse("coordinates q; momenta p; param k per run = 1; T = p^2/2; V = k*q^2/2")?;
    /// let (mut t, mut q, mut p, mut runs) = (vec![], vec![], vec![], vec![]);
    /// for (run, k) in [("stiff", 4.0_f64), ("soft", 2.25)] {
    ///     for time in (0..60).map(|i| 0.1 * i as f64) {
    ///         t.push(time);
    ///         q.push((k.sqrt() * time).cos());
    ///         p.push(-k.sqrt() * (k.sqrt() * time).sin());
    ///         runs.push(run.to_string());
    ///     }
    /// }
    /// let columns = [
    ///     ("t", Values::Numbers(&t)), ("q", Values::Numbers(&q)), ("p", Values::Numbers(&p)),
    ///     ("run", Values::Text(&runs)),
    /// ];
    /// let law = spec.fit(&Data::from_columns(&spec, &columns, None, Some("run"))?)?;
    /// let of_runs = &law.distributions()[0].values;
    /// assert_eq!(of_runs[1].group, "soft");
    /// assert!((of_runs[1].value - 2.25).abs() < 1e-6);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn distributions(&self) -> &[Distribution] {
        self.file.as_ref().map_or(&[], |file| &file.model.distributions)
    }

    /// What the fit found of everything that nobody measures, run by run; none for a law that
    /// stands in its spec.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let law = spec.fit(&spec.data()?)?;
    /// assert!(law.hidden().is_empty()); // every coordinate of this spec is measured
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn hidden(&self) -> &[HiddenMotion] {
        self.file.as_ref().map_or(&[], |file| &file.model.hidden)
    }

    /// Noise of each observable, as the fit found it; none for a law that stands in its spec.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let law = spec.fit(&spec.data()?)?;
    /// assert_eq!(law.noise()[0].observable, "q");
    /// assert!(law.noise()[0].standard_deviation > 0.0);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn noise(&self) -> &[Noise] {
        self.file.as_ref().map_or(&[], |file| &file.model.noise)
    }

    /// The motion from a start (coordinates, then momenta, in the spec's units) at `times`, which
    /// ascend; the first is the time of the start. Integrated to the limit of double precision, by
    /// Taylor series where the law has them, else by equal steps.
    ///
    /// # Errors
    /// The start has not one number for each coordinate and momentum, or the times do not ascend
    /// ([`ErrorKind::InvalidArgument`]); the motion leaves the finite numbers
    /// ([`ErrorKind::NotFinite`]).
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = -cos(q)")?;
    /// let motion = spec.known_law()?.predict(&[0.1, 0.0], &[0.0, 0.5, 1.0])?;
    /// assert_eq!(motion.states().len(), 3);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn predict(&self, start: &[f64], times: &[f64]) -> Result<Trajectory> {
        let names = self.require_start(start, times)?;
        let simulator = self.numbers.simulator();
        let starts = [start.to_vec()];
        let series = IntegratorChoice::Taylor { tolerance: 0.0 };
        match simulator.trajectories_by(series, &starts, times) {
            Err(error) if error.kind() == ErrorKind::TaylorSeries => {
                let longest = STEPS_TOGETHER * self.numbers.stepping().longest;
                let (fine, wanted) = subdivided(times, longest);
                let motion = simulator.trajectories(&starts, &fine)?;
                Ok(Trajectory::first(names, motion).at(&wanted))
            }
            motion => Ok(Trajectory::first(names, motion?)),
        }
    }

    /// That a start and times are those of a prediction; the names of the state's components.
    fn require_start(&self, start: &[f64], times: &[f64]) -> Result<Vec<String>> {
        let system = self.spec.system();
        let names: Vec<String> =
            system.coordinates.iter().chain(&system.momenta).map(|v| v.name.clone()).collect();
        if start.len() != names.len() || start.iter().any(|x| !x.is_finite()) {
            return Err(Error::new(
                ErrorKind::InvalidArgument,
                format!("a start of {} numbers is no state of this system", start.len()),
                format!("give one finite number for each of {}", names.join(", ")),
            ));
        }
        let ascending = times.is_sorted_by(|before, after| before < after);
        if !ascending || times.is_empty() || times.iter().any(|time| !time.is_finite()) {
            return Err(Error::new(
                ErrorKind::InvalidArgument,
                "the times of a prediction must ascend and be finite",
                "begin with the time of the start",
            ));
        }
        Ok(names)
    }

    /// The motion from a state (coordinates, then momenta) at the first of `times` on, under
    /// measured inputs: `inputs` has their values at `input_times`, a slice for each input of the
    /// spec in its order, and the spec says what they do in between.
    ///
    /// # Errors
    /// As [`Law::predict`]; and the inputs do not fit the spec or do not reach over the times
    /// ([`ErrorKind::InvalidArgument`]).
    ///
    /// ```
    /// let text = "coordinates x; momenta p; input u { linear }\nT = p^2/2\nV = x^2/2\nforce x += u";
    /// let law = leverrier::Spec::parse(text)?.known_law()?;
    /// // A ramp: x = t - sin(t).
    /// let motion = law.predict_driven(&[0.0, 0.0], &[0.0, 3.0], &[0.0, 5.0], &[&[0.0, 5.0]])?;
    /// assert!((motion.column("x").unwrap()[1] - (3.0 - 3f64.sin())).abs() < 1e-9);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn predict_driven(
        &self,
        start: &[f64],
        times: &[f64],
        input_times: &[f64],
        inputs: &[&[f64]],
    ) -> Result<Trajectory> {
        let names = self.require_start(start, times)?;
        let record = inputs_of(&self.spec, input_times, inputs)?;
        let simulator = self.numbers.simulator().driven_by(record);
        Ok(Trajectory::first(names, simulator.trajectories(&[start.to_vec()], times)?))
    }

    /// The law's spec with an effect in it, to be fitted again: [`Spec::with`].
    ///
    /// # Errors
    /// As [`Spec::with`].
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let law = spec.fit(&training)?;
    /// let damped = law.with("viscous_drag(q)")?.fit(&training)?;
    /// let error = |law: &leverrier::Law| {
    ///     Ok::<f64, leverrier::Error>(law.compare(&held_out)?.horizons().last().unwrap().error)
    /// };
    /// assert!(error(&law)? > 3.0 && error(&damped)? < 1.5);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn with(&self, effect: &str) -> Result<Spec> {
        self.spec.with(effect)
    }

    /// The law's spec without an effect or a named term: [`Spec::without`].
    ///
    /// # Errors
    /// As [`Spec::without`].
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = q^2/2")?;
    /// let damped = spec.with("viscous_drag(q)")?;
    /// assert!(damped.without("viscous_drag(q)")?.known_law().is_ok());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn without(&self, effect: &str) -> Result<Spec> {
        self.spec.without(effect)
    }

    pub(crate) fn numbers(&self) -> &fit::Law {
        &self.numbers
    }

    pub(crate) fn file(&self) -> Option<&ModelFile> {
        self.file.as_ref()
    }

    /// Largest |value| of each state component in the data that it was learned from; empty where
    /// there are none.
    pub(crate) fn ranges(&self) -> &[f64] {
        self.file.as_ref().map_or(&[], |file| &file.origin.ranges)
    }

    /// The record of the fit, for what needs one.
    pub(crate) fn fitted(&self, what: &str) -> Result<&ModelFile> {
        let kind = if what == "save" { ErrorKind::NothingToDo } else { ErrorKind::NotApplicable };
        self.file.as_ref().ok_or_else(|| {
            Error::new(
                kind,
                format!("there is nothing to {what}: the law stands in its spec"),
                "fit the spec to measurements first",
            )
        })
    }
}

impl fmt::Display for Law {
    /// One line for each term: its place, its coefficient with its standard error, and the term.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, learned) in self.terms().iter().enumerate() {
            let LearnedTerm { place, term, coefficient, standard_error, .. } = learned;
            let line = if at == 0 { "" } else { "\n" };
            write!(f, "{line}{place}: ({coefficient:.6} ± {standard_error:.1e}) {term}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_interval_is_predicted_as_well_as_short_ones() {
        // A force with a kink has no Taylor series.
        let text = "coordinates q; momenta p\nT = p^2/2\nV = q^2/2\nforce q += -0.01*abs(p)*p";
        let law = Spec::parse(text).and_then(|spec| spec.known_law()).expect("a law");
        let short: Vec<f64> = (0..=2000).map(|i| 0.01 * f64::from(i)).collect();
        let short = law.predict(&[1.0, 0.0], &short).expect("a motion");
        let long = law.predict(&[1.0, 0.0], &[0.0, 20.0]).expect("a motion");
        assert_eq!((long.times(), long.states().len()), ([0.0, 20.0].as_slice(), 2));
        for (a, b) in long.states()[1].iter().zip(&short.states()[2000]) {
            assert!((a - b).abs() < 1e-6, "{a} and {b}");
        }
    }
}
