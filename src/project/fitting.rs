//! Learning from a folder's files, and the model file that comes of it.

use std::sync::Arc;

use crate::data::{DataReport, Dataset};
use crate::error::{Error, ErrorKind, Result};
use crate::expr::System;
use crate::facade::Spec;
pub(crate) use crate::facade::model_file::write as write_model;
use crate::facade::origin::{self, Origin};
use crate::fit::{self, Model, Monitor, Options};

/// Fits on the given number of threads.
pub(crate) fn learn(
    system: &Arc<System>,
    dataset: &Dataset,
    options: &Options,
    threads: Option<usize>,
    monitor: &dyn Monitor,
) -> Result<Model> {
    on_threads(threads, || fit::fit(system, dataset, options, monitor))
}

/// Does the work on the given number of threads; on all cores by default.
pub(crate) fn on_threads<T: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<T> + Send,
) -> Result<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build().map_err(
        |error| {
            Error::new(
                ErrorKind::Threads,
                format!("cannot start the threads: {error}"),
                "ask for fewer",
            )
        },
    )?;
    pool.install(work)
}

/// Where a model comes from.
pub(crate) fn origin(spec: &Spec, dataset: &Dataset, about: &DataReport) -> Origin {
    origin::origin(spec.system(), (spec.file(), spec.text()), dataset, about)
}
