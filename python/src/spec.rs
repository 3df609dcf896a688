//! Specs, and what is learned of them.

use std::path::PathBuf;
use std::sync::Arc;

use leverrier::{Error, ErrorKind, Loss, Method, Options, Selection, Severity, Trainer};
use pyo3::prelude::*;

use super::data::Data;
use super::errors::OrRaise;
use super::law::Law;
use super::work::work;

/// What is known of a system, and what is to be learned.
#[pyclass(frozen, module = "leverrier._native")]
pub struct Spec(pub leverrier::Spec);

/// How to fit; names as the program's options have them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct FitOptions {
    select: String,
    loss: String,
    method: Option<String>,
    step: Option<f64>,
    window: Option<usize>,
    starts: usize,
    seed: u64,
    sparse: bool,
    trainer: String,
    memory: Option<u64>,
}

/// What a diagnosis looks for beside the usual.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct DiagnosisOptions {
    correlated_noise: bool,
    orbits: usize,
    all_pairs: bool,
}

impl DiagnosisOptions {
    pub fn options(self) -> leverrier::DiagnosisOptions {
        let DiagnosisOptions { correlated_noise, orbits, all_pairs } = self;
        leverrier::DiagnosisOptions { correlated_noise, orbits, all_pairs }
    }
}

fn invalid(message: String, hint: &str) -> Error {
    Error::new(ErrorKind::InvalidArgument, message, hint)
}

impl FitOptions {
    pub fn options(self) -> leverrier::Result<Options> {
        let unknown = |what: &str, name: &str, hint: &str| {
            Err(invalid(format!("there is no {what} `{name}`"), hint))
        };
        if self.step.is_some_and(|step| !(step.is_finite() && step > 0.0)) {
            return Err(invalid("the step must be positive".to_string(), "give a time, as 0.01"));
        }
        if self.window.is_some_and(|window| window < 2) {
            let hint = "motion takes two samples; leave it out to let the fit choose";
            return Err(invalid("the window must be at least 2".to_string(), hint));
        }
        Ok(Options {
            selection: match self.select.as_str() {
                "information" => Selection::Information,
                "held-out" => Selection::HeldOut,
                other => return unknown("selection", other, "it is `information` or `held-out`"),
            },
            trainer: match self.trainer.as_str() {
                "gauss-newton" => Trainer::GaussNewton,
                "first-order" => Trainer::FirstOrder,
                other => return unknown("trainer", other, "`gauss-newton` or `first-order`"),
            },
            loss: match Loss::by_name(&self.loss) {
                Some(loss) => loss,
                None => return unknown("loss", &self.loss, "`squares` and `huber` are among them"),
            },
            method: match &self.method {
                None => None,
                Some(name) => match Method::by_name(name) {
                    Some(method) => Some(method),
                    None => return unknown("integrator", name, "leave it out to have one chosen"),
                },
            },
            longest_step: self.step,
            window: self.window,
            starts: self.starts,
            seed: self.seed,
            sparse: self.sparse,
            memory: self.memory,
            ..Options::default()
        })
    }
}

#[pymethods]
impl Spec {
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<Spec> {
        Ok(Spec(leverrier::Spec::open(path).or_raise(py)?))
    }

    #[staticmethod]
    fn parse(py: Python<'_>, text: &str) -> PyResult<Spec> {
        Ok(Spec(leverrier::Spec::parse(text).or_raise(py)?))
    }

    #[getter]
    fn text(&self) -> &str {
        self.0.text()
    }

    #[getter]
    fn system(&self) -> &str {
        self.0.system_name()
    }

    #[getter]
    fn coordinates(&self) -> Vec<String> {
        self.0.coordinates().into_iter().map(str::to_string).collect()
    }

    #[getter]
    fn momenta(&self) -> Vec<String> {
        self.0.momenta().into_iter().map(str::to_string).collect()
    }

    #[getter]
    fn inputs(&self) -> Vec<String> {
        self.0.inputs()
    }

    #[getter]
    fn observables(&self) -> Vec<String> {
        self.0.observables()
    }

    #[getter]
    fn terms(&self) -> Vec<String> {
        self.0.terms().into_iter().map(str::to_string).collect()
    }

    /// Warnings and notes about the text, as sentences with their line.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        let told = self.0.warnings().iter().filter(|one| one.severity >= Severity::Warning);
        told.map(|one| format!("line {}: {one}", one.place(self.0.text()).0)).collect()
    }

    fn with_effect(&self, py: Python<'_>, effect: &str) -> PyResult<Spec> {
        Ok(Spec(self.0.with(effect).or_raise(py)?))
    }

    fn without(&self, py: Python<'_>, effect: &str) -> PyResult<Spec> {
        Ok(Spec(self.0.without(effect).or_raise(py)?))
    }

    fn known_law(&self, py: Python<'_>) -> PyResult<Law> {
        Ok(Law(Arc::new(self.0.known_law().or_raise(py)?)))
    }

    fn fit(
        &self,
        py: Python<'_>,
        data: &Data,
        options: FitOptions,
        threads: Option<usize>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Law> {
        let (spec, data) = (self.0.clone(), data.0.clone());
        let options = options.options().or_raise(py)?;
        let fit =
            move |monitor: &dyn leverrier::Monitor| spec.fit_monitored(&data, &options, monitor);
        work(py, threads, progress, fit)?.finish(py, |_, law| Ok(Law(Arc::new(law))))
    }

    /// JSON, and the law that came of it.
    fn discover(
        &self,
        py: Python<'_>,
        training: &Data,
        held_out: &Data,
        options: (FitOptions, DiagnosisOptions),
        threads: Option<usize>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(String, Law, Spec)> {
        let (spec, training, held_out) = (self.0.clone(), training.0.clone(), held_out.0.clone());
        let (fit, diagnosis) = options;
        let fit = fit.options().or_raise(py)?;
        let options = leverrier::DiscoveryOptions { fit, diagnosis: diagnosis.options() };
        let search = move |monitor: &dyn leverrier::Monitor| {
            spec.discover(&training, &held_out, &options, monitor)
        };
        work(py, threads, progress, search)?.finish(py, |_, found| {
            let law = found.law().clone();
            let longer = Spec(law.spec().clone());
            Ok((found.to_json(), Law(Arc::new(law)), longer))
        })
    }
}
