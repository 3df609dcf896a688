//! Measurements: from NumPy's memory into the library's.

use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::Arc;

use leverrier::Values;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::{PyIndexError, PyKeyError};
use pyo3::prelude::*;

use super::errors::OrRaise;
use super::spec::Spec;

/// Measurements of a spec's observables.
#[pyclass(frozen, module = "leverrier._native")]
pub struct Data(pub Arc<leverrier::Data>);

/// A column as Python hands it over: numbers, text, or so many cells of a kind that is not read.
#[derive(FromPyObject)]
pub enum Cells<'py> {
    Numbers(PyReadonlyArray1<'py, f64>),
    Text(Vec<String>),
    Unreadable(String, usize),
}

/// A column that can be borrowed from: NumPy's own memory where it is contiguous.
enum Borrowed<'a> {
    Numbers(Cow<'a, [f64]>),
    Text(&'a [String]),
    Unreadable(&'static str, usize),
}

impl Cells<'_> {
    fn borrowed(&self) -> Borrowed<'_> {
        match self {
            Cells::Numbers(array) => Borrowed::Numbers(numbers(array)),
            Cells::Text(text) => Borrowed::Text(text),
            Cells::Unreadable(what, count) => Borrowed::Unreadable(kind(what), *count),
        }
    }
}

/// What a column holds that is neither numbers nor text.
fn kind(what: &str) -> &'static str {
    match what {
        "dates" => "dates",
        "durations" => "durations of time",
        "complex" => "complex numbers",
        "lists" => "lists",
        _ => "objects of Python",
    }
}

impl Borrowed<'_> {
    fn values(&self) -> Values<'_> {
        match self {
            Borrowed::Numbers(numbers) => Values::Numbers(numbers),
            Borrowed::Text(text) => Values::Text(text),
            Borrowed::Unreadable(what, count) => Values::Unreadable(what, *count),
        }
    }
}

fn numbers<'a>(array: &'a PyReadonlyArray1<'_, f64>) -> Cow<'a, [f64]> {
    match array.as_slice() {
        Ok(slice) => Cow::Borrowed(slice),
        Err(_) => Cow::Owned(array.as_array().iter().copied().collect()),
    }
}

#[pymethods]
impl Data {
    /// A file; where none is named, the one that the spec names.
    #[staticmethod]
    #[pyo3(signature = (spec, path=None))]
    fn open(py: Python<'_>, spec: &Spec, path: Option<PathBuf>) -> PyResult<Data> {
        let spec = spec.0.clone();
        let read = py.detach(move || match path {
            Some(path) => leverrier::Data::open(path, &spec),
            None => spec.data(),
        });
        Ok(Data(Arc::new(read.or_raise(py)?)))
    }

    /// No measurements at all: a part of the data without rows.
    #[staticmethod]
    fn empty(spec: &Spec) -> Data {
        Data(Arc::new(leverrier::Data::empty(&spec.0)))
    }

    /// Columns that have names.
    #[staticmethod]
    #[pyo3(signature = (spec, columns, time=None, run=None))]
    fn from_columns(
        py: Python<'_>,
        spec: &Spec,
        columns: Vec<(String, Cells<'_>)>,
        time: Option<&str>,
        run: Option<&str>,
    ) -> PyResult<Data> {
        let held: Vec<(&str, Borrowed)> =
            columns.iter().map(|(name, cells)| (name.as_str(), cells.borrowed())).collect();
        let values: Vec<(&str, Values)> =
            held.iter().map(|(name, cells)| (*name, cells.values())).collect();
        let data = leverrier::Data::from_columns(&spec.0, &values, time, run);
        Ok(Data(Arc::new(data.or_raise(py)?)))
    }

    /// Columns in the order of the spec's observables.
    #[staticmethod]
    fn from_samples(
        py: Python<'_>,
        spec: &Spec,
        times: PyReadonlyArray1<'_, f64>,
        runs: Option<Cells<'_>>,
        columns: Vec<PyReadonlyArray1<'_, f64>>,
    ) -> PyResult<Data> {
        let held: Vec<Cow<[f64]>> = columns.iter().map(numbers).collect();
        let values: Vec<&[f64]> = held.iter().map(AsRef::as_ref).collect();
        let (times, runs) = (numbers(&times), runs.as_ref().map(Cells::borrowed));
        let runs = runs.as_ref().map(Borrowed::values);
        let data = leverrier::Data::from_samples(&spec.0, &times, runs, &values);
        Ok(Data(Arc::new(data.or_raise(py)?)))
    }

    /// Training and held-out measurements.
    fn split(&self, py: Python<'_>, held_out: f64, seed: u64) -> PyResult<(Data, Data)> {
        let (training, unseen) = self.0.split(held_out, seed).or_raise(py)?;
        Ok((Data(Arc::new(training)), Data(Arc::new(unseen))))
    }

    fn report_json(&self) -> String {
        self.0.report_json()
    }

    #[getter]
    fn samples(&self) -> usize {
        self.0.samples()
    }

    #[getter]
    fn observables(&self) -> Vec<String> {
        self.0.observables().to_vec()
    }

    #[getter]
    fn runs(&self) -> Vec<String> {
        let names = (0..self.0.runs()).filter_map(|run| self.0.run_name(run));
        names.map(str::to_string).collect()
    }

    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.0.warnings().to_vec()
    }

    fn times<'py>(&self, py: Python<'py>, run: usize) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let times = self.0.times(run).ok_or_else(|| PyIndexError::new_err("there is no such run"));
        Ok(PyArray1::from_vec(py, times?))
    }

    fn values<'py>(
        &self,
        py: Python<'py>,
        run: usize,
        observable: &str,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let values = self.0.values(run, observable);
        let values = values.ok_or_else(|| PyKeyError::new_err(observable.to_string()))?;
        Ok(PyArray1::from_slice(py, values))
    }
}
