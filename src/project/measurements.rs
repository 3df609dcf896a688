//! The measurements of a spec: in memory, or read part by part where they are too large.

use std::path::Path;
use std::sync::Arc;

use super::fitting::on_threads;
use super::memory;
use crate::data::{self, DataReport, Dataset, FileSource, Survey};
use crate::error::Result;
use crate::expr::System;
use crate::facade::Spec;
use crate::fit::memory::size;
use crate::fit::{Model, Monitor, Options, fit_as_far_as_it_tells, fit_stream};

/// Samples that other commands look at, when the data are too large for them.
const LOOKED_AT: usize = 1 << 19;
/// Files smaller than this fit in any memory.
const SMALL: u64 = 1 << 20;

/// Measurements to learn from.
pub(crate) enum Measurements {
    /// All of them.
    InMemory(Box<(Dataset, DataReport)>),
    /// A file that is read in every pass, and what the first pass found.
    Streamed(Box<FileSource>, Box<Survey>),
}

impl Measurements {
    /// Reads them, or looks through them if they take more memory than `allowed`. Says so.
    ///
    /// # Errors
    /// As [`Spec::data`]; [`Error::Interrupted`](crate::error::Error::Interrupted).
    pub(crate) fn read(
        spec: &Spec,
        asked: Option<&Path>,
        allowed: u64,
        options: &Options,
        monitor: &dyn Monitor,
        say: impl Fn(&str),
    ) -> Result<Measurements> {
        let Some(needed) = too_large(spec, asked, allowed)? else {
            return Ok(Measurements::InMemory(Box::new(spec.read(asked)?)));
        };
        say(&format!(
            "The data would take about {} of memory, and {} are allowed: they are read part by \
             part, once in every pass.",
            size(needed),
            size(allowed)
        ));
        let source = spec.source(asked)?;
        let survey =
            data::survey_file(&source, options.tuning.course.sampled, options.seed, &|fraction| {
                monitor.stage("surveying the data", 0.1 * fraction);
                !monitor.stopped()
            })?;
        Ok(Measurements::Streamed(Box::new(source), Box::new(survey)))
    }

    /// Fits a system to all of them, on the given number of threads.
    pub(crate) fn learn(
        &self,
        system: &Arc<System>,
        options: &Options,
        threads: Option<usize>,
        monitor: &dyn Monitor,
    ) -> Result<Model> {
        match self {
            Measurements::InMemory(held) => {
                on_threads(threads, || fit_as_far_as_it_tells(system, &held.0, options, monitor))
            }
            Measurements::Streamed(source, survey) => on_threads(threads, || {
                fit_stream(system, source.as_ref(), survey, options, monitor)
            }),
        }
    }

    /// All measurements, or a sample of them.
    pub(crate) fn dataset(&self) -> &Dataset {
        match self {
            Measurements::InMemory(held) => &held.0,
            Measurements::Streamed(_, survey) => &survey.sample,
        }
    }

    /// What they hold.
    pub(crate) fn report(&self) -> &DataReport {
        match self {
            Measurements::InMemory(held) => &held.1,
            Measurements::Streamed(_, survey) => &survey.report,
        }
    }
}

/// What the data would take in memory, if that is more than allowed.
fn too_large(spec: &Spec, asked: Option<&Path>, allowed: u64) -> Result<Option<u64>> {
    let mut sizes = Vec::new();
    for path in spec.data_files(asked)? {
        match std::fs::metadata(data::file_of(&path)) {
            Ok(about) if about.is_file() => sizes.push((path, about.len())),
            // What is no file can be read only once.
            _ => return Ok(None),
        }
    }
    if sizes.iter().map(|(_, size)| size).sum::<u64>() <= SMALL {
        return Ok(None);
    }
    // The largest tells for all: they are of one kind.
    let Some((largest, size)) = sizes.iter().max_by_key(|(_, size)| size) else { return Ok(None) };
    let needed = data::memory_needed(largest)? as f64;
    let all = sizes.iter().map(|(_, size)| *size as f64).sum::<f64>();
    let needed = (needed * all / (*size).max(1) as f64) as u64;
    Ok((needed > allowed).then_some(needed))
}

/// For commands that look at data without passes of their own: all of them, or a sample.
///
/// # Errors
/// As [`Spec::data`].
pub(crate) fn whole_or_sample(spec: &Spec, asked: Option<&Path>) -> Result<(Dataset, DataReport)> {
    let allowed = memory::usual();
    let Some(needed) = too_large(spec, asked, allowed)? else { return spec.read(asked) };
    let survey = data::survey_file(&spec.source(asked)?, LOOKED_AT, 0, &|_| true)?;
    let mut report = survey.report;
    report.warnings.insert(
        0,
        format!(
            "The data would take about {} of memory: {} of {} samples are looked at, drawn at \
             random.",
            size(needed),
            survey.sample.samples(),
            survey.samples
        ),
    );
    Ok((survey.sample, report))
}
