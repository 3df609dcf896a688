//! Parts of the data, which many processes share: three pure functions, and the fit that calls
//! them through an engine of Python's.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};
use std::thread;

use leverrier::{Engine, Error, ErrorKind, PartPlace, PartSampling, PartSurvey, PassFactor};
use leverrier::{PassRequest, Result};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::data::Data;
use super::errors::OrRaise;
use super::law::Law;
use super::spec::{FitOptions, Spec};
use super::work::{INTERVAL, work};

/// A part of the data as Python hands it over.
#[derive(FromPyObject)]
pub enum Part<'py> {
    Data(PyRef<'py, Data>),
    File(PathBuf),
}

impl Part<'_> {
    fn part(&self) -> leverrier::Part {
        match self {
            Part::Data(data) => leverrier::Part::Data(data.0.as_ref().clone()),
            Part::File(path) => leverrier::Part::File(path.clone()),
        }
    }
}

/// The survey of a part, as bytes; `sampling` is the samples that are kept and a seed.
#[pyfunction]
pub fn survey_part<'py>(
    py: Python<'py>,
    spec: &Spec,
    part: Part<'_>,
    number: u32,
    sampling: (u64, u64),
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyBytes>> {
    let (spec, part) = (spec.0.clone(), part.part());
    let sampling = PartSampling { most: sampling.0, seed: sampling.1 };
    let survey =
        move |_: &dyn leverrier::Monitor| spec.survey_part(&part, number, sampling)?.to_bytes();
    let bytes = work(py, threads, None, survey)?.finish(py, |_, bytes| Ok(bytes))?;
    Ok(PyBytes::new(py, &bytes))
}

/// The pass of a part, as bytes; `place` is its number, runs and samples before it, and how
/// many of these are of the run that goes on in it.
#[pyfunction]
pub fn pass_part<'py>(
    py: Python<'py>,
    spec: &Spec,
    part: Part<'_>,
    request: &[u8],
    place: (u32, u64, u64, u64),
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyBytes>> {
    let (spec, part) = (spec.0.clone(), part.part());
    let request = PassRequest::from_bytes(request).or_raise(py)?;
    let (number, runs_before, samples_before, carried) = place;
    let place = PartPlace { number, runs_before, samples_before, carried };
    let pass = move |_: &dyn leverrier::Monitor| spec.pass_part(&part, &request, place)?.to_bytes();
    let bytes = work(py, threads, None, pass)?.finish(py, |_, bytes| Ok(bytes))?;
    Ok(PyBytes::new(py, &bytes))
}

/// What two surveys, or two factors, merge to.
#[pyfunction]
pub fn merge_parts<'py>(
    py: Python<'py>,
    first: &[u8],
    second: &[u8],
) -> PyResult<Bound<'py, PyBytes>> {
    let (first, second) = (first.to_vec(), second.to_vec());
    let merged = py.detach(move || leverrier::Part::merge_bytes(&first, &second)).or_raise(py)?;
    Ok(PyBytes::new(py, &merged))
}

/// The law that an engine's parts give, and the sample of their data. The engine has the methods
/// `survey(most, seed, watch)` and `pass_(request, places, watch)`, which give bytes.
#[pyfunction]
pub fn fit_parts(
    py: Python<'_>,
    spec: &Spec,
    engine: Py<PyAny>,
    options: FitOptions,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Law, Data)> {
    let spec = spec.0.clone();
    let options = options.options().or_raise(py)?;
    let called = Arc::new(Called { engine, failure: Mutex::new(None) });
    let engine = called.clone();
    let fit = move |monitor: &dyn leverrier::Monitor| spec.fit_parts(&*engine, &options, monitor);
    let done = work(py, threads, progress, fit);
    let interrupted =
        matches!(&done, Err(error) if error.is_instance_of::<PyKeyboardInterrupt>(py));
    if let Ok(mut failure) = called.failure.lock()
        && let Some(failure) = failure.take()
        && !interrupted
    {
        return Err(failure);
    }
    done?.finish(py, |_, (law, data)| Ok((Law(Arc::new(law)), Data(Arc::new(data)))))
}

/// An engine of Python's, called from the threads that fit.
struct Called {
    engine: Py<PyAny>,
    /// What it raised.
    failure: Mutex<Option<PyErr>>,
}

/// What a call of the engine and the fit tell each other.
#[derive(Default)]
struct Told {
    fraction: Mutex<f64>,
    stopped: AtomicBool,
}

/// For the engine: takes how far it has come, gives whether to go on.
#[pyclass(frozen)]
struct Watch(Arc<Told>);

#[pymethods]
impl Watch {
    fn __call__(&self, fraction: f64) -> bool {
        if let Ok(mut told) = self.0.fraction.lock() {
            *told = fraction;
        }
        !self.0.stopped.load(Ordering::Relaxed)
    }
}

impl Called {
    /// Calls a method of the engine, which gives bytes, or None where it was told to stop.
    fn call<A>(&self, watch: &dyn Fn(f64) -> bool, method: &str, arguments: A) -> Result<Vec<u8>>
    where
        A: FnOnce(Watch) -> Arguments + Send,
    {
        let told = Arc::new(Told::default());
        let shown = Watch(told.clone());
        let (sender, receiver) = channel();
        let called = thread::scope(|scope| {
            scope.spawn(move || {
                let called = Python::attach(|py| -> PyResult<Option<Vec<u8>>> {
                    let engine = self.engine.bind(py);
                    let given = match arguments(shown) {
                        Arguments::Survey(most, seed, watch) => {
                            engine.call_method1(method, (most, seed, watch))
                        }
                        Arguments::Pass(request, places, watch) => {
                            let request = PyBytes::new(py, &request);
                            engine.call_method1(method, (request, places, watch))
                        }
                    };
                    given?.extract::<Option<Vec<u8>>>()
                });
                // The fit waits for it.
                let _ = sender.send(called);
            });
            loop {
                match receiver.recv_timeout(INTERVAL) {
                    Ok(called) => break Some(called),
                    Err(RecvTimeoutError::Disconnected) => break None,
                    Err(RecvTimeoutError::Timeout) => {}
                }
                let fraction = told.fraction.lock().map_or(0.0, |fraction| *fraction);
                if !watch(fraction) {
                    told.stopped.store(true, Ordering::Relaxed);
                }
            }
        });
        match called {
            Some(Ok(Some(bytes))) => Ok(bytes),
            Some(Ok(None)) => Err(Error::Interrupted),
            Some(Err(raised)) => {
                if let Ok(mut failure) = self.failure.lock() {
                    failure.get_or_insert(raised);
                }
                Err(Error::new(ErrorKind::Internal, "the engine raised an exception", "see it"))
            }
            None => Err(Error::new(ErrorKind::Internal, "the engine panicked", "report this")),
        }
    }
}

/// What the methods of an engine take.
enum Arguments {
    Survey(u64, u64, Watch),
    Pass(Vec<u8>, Vec<(u32, u64, u64, u64)>, Watch),
}

impl Engine for Called {
    fn survey(&self, of: PartSampling, watch: &dyn Fn(f64) -> bool) -> Result<PartSurvey> {
        let arguments = move |watch| Arguments::Survey(of.most, of.seed, watch);
        PartSurvey::from_bytes(&self.call(watch, "survey", arguments)?)
    }

    fn pass(
        &self,
        request: &PassRequest,
        places: &[PartPlace],
        watch: &dyn Fn(f64) -> bool,
    ) -> Result<PassFactor> {
        let request = request.to_bytes()?;
        let place = |at: &PartPlace| (at.number, at.runs_before, at.samples_before, at.carried);
        let places = places.iter().map(place).collect();
        let arguments = move |watch| Arguments::Pass(request, places, watch);
        PassFactor::from_bytes(&self.call(watch, "pass_", arguments)?)
    }
}
