//! Long work: on threads of its own, without Python's lock, with progress and Ctrl-C.

use std::mem::take;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use leverrier::{Error, ErrorKind, Monitor};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use super::errors::exception;

/// How often Python is asked for signals, and told how far the work has come.
pub const INTERVAL: Duration = Duration::from_millis(50);

/// What the working threads and the waiting one tell each other.
#[derive(Default)]
struct Course {
    stop: AtomicBool,
    /// The stages since Python was asked last, each with its last fraction.
    stages: Mutex<Vec<(String, f64)>>,
}

impl Monitor for Course {
    fn stage(&self, what: &str, fraction: f64) {
        if let Ok(mut stages) = self.stages.lock() {
            match stages.last_mut() {
                Some(last) if last.0 == what => last.1 = fraction,
                _ => stages.push((what.to_string(), fraction)),
            }
        }
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// What came of the work, and the KeyboardInterrupt that cut it short.
pub struct Outcome<T> {
    pub result: T,
    pub interrupt: Option<PyErr>,
}

impl<T> Outcome<T> {
    /// The result; where the work was interrupted, the interrupt with the best so far as its
    /// attribute `best`.
    pub fn finish<P>(
        self,
        py: Python<'_>,
        wrap: impl FnOnce(Python<'_>, T) -> PyResult<P>,
    ) -> PyResult<P>
    where
        P: for<'py> IntoPyObject<'py>,
    {
        let wrapped = wrap(py, self.result)?;
        match self.interrupt {
            None => Ok(wrapped),
            Some(interrupt) => {
                interrupt.value(py).setattr("best", wrapped)?;
                Err(interrupt)
            }
        }
    }
}

/// Does the work on so many threads (all cores where none is said), a pool of its own: one that
/// all calls share would not survive a fork of the process.
pub fn work<T: Send + 'static>(
    py: Python<'_>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
    job: impl FnOnce(&dyn Monitor) -> leverrier::Result<T> + Send + 'static,
) -> PyResult<Outcome<T>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    let pool = pool.map_err(|error| {
        let message = format!("cannot start the threads: {error}");
        exception(py, &Error::new(ErrorKind::Threads, message, "ask for fewer"))
    })?;
    let course = Arc::new(Course::default());
    let (sender, mut receiver) = channel();
    let told = course.clone();
    pool.spawn(move || {
        let done = catch_unwind(AssertUnwindSafe(|| job(&*told)));
        // Nobody listens any more after a second Ctrl-C.
        let _ = sender.send(done);
    });
    let mut interrupt: Option<PyErr> = None;
    let done = loop {
        let (back, received) = py.detach(move || {
            let received = receiver.recv_timeout(INTERVAL);
            (receiver, received)
        });
        receiver = back;
        match received {
            Ok(done) => break Some(done),
            Err(RecvTimeoutError::Disconnected) => break None,
            Err(RecvTimeoutError::Timeout) => {}
        }
        if let Err(signal) = py.check_signals() {
            if interrupt.is_some() {
                return Err(signal);
            }
            course.stop.store(true, Ordering::Relaxed);
            interrupt = Some(signal);
        }
        let stages = course.stages.lock().map(|mut stages| take(&mut *stages));
        for stage in stages.unwrap_or_default() {
            if let (Some(progress), None) = (progress, &interrupt)
                && let Err(failed) = progress.call1(stage)
            {
                course.stop.store(true, Ordering::Relaxed);
                // Ctrl-C may come while Python is in there.
                if !failed.is_instance_of::<PyKeyboardInterrupt>(py) {
                    return Err(failed);
                }
                interrupt = Some(failed);
            }
        }
    };
    match (done, interrupt) {
        (Some(Ok(Ok(result))), interrupt) => Ok(Outcome { result, interrupt }),
        (Some(Ok(Err(error))), Some(interrupt)) if error.kind() == ErrorKind::Interrupted => {
            Err(interrupt)
        }
        (Some(Ok(Err(error))), _) => Err(exception(py, &error)),
        (_, Some(interrupt)) if interrupt.is_instance_of::<PyKeyboardInterrupt>(py) => {
            Err(interrupt)
        }
        _ => {
            let error = Error::new(ErrorKind::Internal, "the computation panicked", "report this");
            Err(exception(py, &error))
        }
    }
}
