//! Laws, and what they say.

use std::path::PathBuf;
use std::sync::Arc;

use leverrier::Error;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use super::data::Data;
use super::errors::OrRaise;
use super::spec::{DiagnosisOptions, Spec};
use super::work::work;

/// A spec with a number for everything in it.
#[pyclass(frozen, module = "leverrier._native")]
pub struct Law(pub Arc<leverrier::Law>);

/// What a law lacks.
#[pyclass(frozen, module = "leverrier._native")]
pub struct Diagnosis(Arc<leverrier::Diagnosis>);

#[pymethods]
impl Diagnosis {
    fn json(&self) -> String {
        self.0.to_json()
    }
}

/// The equations of motion, compiled.
#[pyclass(frozen, module = "leverrier._native")]
pub struct VectorField(Arc<leverrier::VectorField>);

/// Times, states one after the other, the integrator's name, and how far the energy strayed.
type Motion<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, &'static str, f64);

#[pymethods]
impl Law {
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf, spec: &Spec) -> PyResult<Law> {
        Ok(Law(Arc::new(leverrier::Law::open(path, &spec.0).or_raise(py)?)))
    }

    #[staticmethod]
    fn from_model_json(py: Python<'_>, text: &str, spec: &Spec) -> PyResult<Law> {
        Ok(Law(Arc::new(leverrier::Law::from_model_json(text, &spec.0).or_raise(py)?)))
    }

    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        self.0.save(path).or_raise(py)
    }

    fn model_json(&self, py: Python<'_>) -> PyResult<String> {
        self.0.model_json().or_raise(py)
    }

    fn hamiltonian_json(&self) -> String {
        self.0.hamiltonian_json()
    }

    fn equations(&self) -> String {
        self.0.equations()
    }

    /// A format that is one text.
    fn exported(&self, py: Python<'_>, format: &str) -> PyResult<String> {
        let law = &self.0;
        let text = match format {
            "latex" => law.to_latex(),
            "latex-document" => law.to_latex_document(),
            "mathml" => law.to_mathml(),
            "python" => law.to_python(),
            "json" => law.to_json(),
            other => Err(Error::new(
                leverrier::ErrorKind::UnknownName,
                format!("there is no format `{other}`"),
                "it is latex, latex-document, mathml, python or json",
            )),
        };
        text.or_raise(py)
    }

    fn to_rust(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        self.0.to_rust(folder).or_raise(py)
    }

    fn to_c(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        self.0.to_c(folder).or_raise(py)
    }

    fn vector_field(&self) -> VectorField {
        VectorField(Arc::new(self.0.vector_field()))
    }

    fn predict<'py>(
        &self,
        py: Python<'py>,
        start: Vec<f64>,
        times: Vec<f64>,
        inputs: Option<(Vec<f64>, Vec<Vec<f64>>)>,
    ) -> PyResult<Motion<'py>> {
        let law = self.0.clone();
        let motion = work(py, Some(1), None, move |_| match inputs {
            None => law.predict(&start, &times),
            Some((at, inputs)) => {
                let inputs: Vec<&[f64]> = inputs.iter().map(AsRef::as_ref).collect();
                law.predict_driven(&start, &times, &at, &inputs)
            }
        })?;
        motion.finish(py, |_, motion| Ok(Predicted(motion)))?.arrays(py)
    }

    fn refit(
        &self,
        py: Python<'_>,
        data: &Data,
        threads: Option<usize>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Law> {
        let (law, data) = (self.0.clone(), data.0.clone());
        let refitted = work(py, threads, progress, move |monitor| law.refit(&data, monitor))?;
        refitted.finish(py, |_, law| Ok(Law(Arc::new(law))))
    }

    fn compare(
        &self,
        py: Python<'_>,
        training: &Data,
        held_out: &Data,
        noise: Option<Vec<f64>>,
        threads: Option<usize>,
    ) -> PyResult<String> {
        let (law, training, held_out) = (self.0.clone(), training.0.clone(), held_out.0.clone());
        let compared = work(py, threads, None, move |_| {
            law.compare_held_out(&training, &held_out, noise.as_deref())
        })?;
        compared.finish(py, |_, comparison| Ok(comparison.to_json()))
    }

    fn diagnose(
        &self,
        py: Python<'_>,
        training: &Data,
        held_out: &Data,
        options: DiagnosisOptions,
        threads: Option<usize>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Diagnosis> {
        let (law, training, held_out) = (self.0.clone(), training.0.clone(), held_out.0.clone());
        let options = options.options();
        let diagnosed = work(py, threads, progress, move |monitor| {
            law.diagnose_monitored(&training, &held_out, &options, monitor)
        })?;
        diagnosed.finish(py, |_, diagnosis| Ok(Diagnosis(Arc::new(diagnosis))))
    }

    /// Kind, title, caption and SVG of each figure of the report.
    fn figures(
        &self,
        py: Python<'_>,
        training: &Data,
        held_out: &Data,
        diagnosis: Option<&Diagnosis>,
    ) -> PyResult<Vec<(&'static str, String, String, String)>> {
        let (law, training, held_out) = (self.0.clone(), training.0.clone(), held_out.0.clone());
        let diagnosis = diagnosis.map(|diagnosis| diagnosis.0.clone());
        let drawn =
            work(py, None, None, move |_| law.figures(&training, &held_out, diagnosis.as_deref()))?;
        let of = |one: leverrier::Drawing| (one.plot, one.title, one.caption, one.svg);
        drawn.finish(py, |_, figures| Ok(figures.into_iter().map(of).collect::<Vec<_>>()))
    }

    fn design(
        &self,
        py: Python<'_>,
        training: &Data,
        held_out: &Data,
        options: DesignOptions,
        threads: Option<usize>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<String> {
        let (law, training, held_out) = (self.0.clone(), training.0.clone(), held_out.0.clone());
        let options = options.options();
        let designed = work(py, threads, progress, move |monitor| {
            law.design(&training, &held_out, &options, monitor)
        })?;
        designed.finish(py, |_, design| Ok(design.to_json()))
    }
}

/// What the next run is for, and what it may be.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct DesignOptions {
    between: Vec<String>,
    coefficient: Option<String>,
    start: Vec<(String, (f64, f64))>,
    motion: Vec<(String, (f64, f64))>,
    #[pyo3(item("from"))]
    from: Option<f64>,
    duration: Option<(f64, f64)>,
    step: Option<(f64, f64)>,
}

impl DesignOptions {
    fn options(self) -> leverrier::DesignOptions {
        let range = |(lower, upper): (f64, f64)| lower..=upper;
        let ranges = |parts: Vec<(String, (f64, f64))>| {
            parts.into_iter().map(|(name, ends)| (name, range(ends))).collect()
        };
        leverrier::DesignOptions {
            between: self.between,
            coefficient: self.coefficient,
            start: ranges(self.start),
            motion: ranges(self.motion),
            from: self.from,
            duration: self.duration.map(range),
            step: self.step.map(range),
        }
    }
}

/// A motion on its way to NumPy.
#[pyclass(frozen)]
struct Predicted(leverrier::Trajectory);

impl Predicted {
    fn arrays<'py>(&self, py: Python<'py>) -> PyResult<Motion<'py>> {
        let motion = &self.0;
        let times = PyArray1::from_slice(py, motion.times());
        let states = PyArray1::from_vec(py, motion.states().concat());
        Ok((times, states, motion.method(), motion.energy_drift()))
    }
}

#[pymethods]
impl VectorField {
    fn rates<'py>(
        &self,
        py: Python<'py>,
        time: f64,
        states: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let rates = match states.as_slice() {
            Ok(states) => self.0.rates(time, states),
            Err(_) => self.0.rates(time, &states.as_array().to_vec()),
        };
        Ok(PyArray1::from_vec(py, rates.or_raise(py)?))
    }

    fn energies<'py>(
        &self,
        py: Python<'py>,
        time: f64,
        states: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let states = states.as_array().to_vec();
        Ok(PyArray1::from_vec(py, self.0.energies(time, &states).or_raise(py)?))
    }
}
