//! Measurements: what was read from a file, as runs of samples with true times.
//!
//! From a file to a data set in two steps: [`read`] makes a [`Table`] of cells as they
//! stand in the file, and [`dataset`] picks the columns that a spec asks for, converts
//! them, and groups and orders the rows into runs. Nothing is resampled or filled in.
//!
//! What is larger than memory goes another way: a [`Source`] is read anew in every pass, chunk
//! by chunk; [`survey`] counts what it holds and draws a sample that is a data set.

use std::borrow::Cow;

mod beside;
mod blocks;
mod cell;
mod cells;
mod clock;
mod counted;
mod delimiter;
mod driving;
mod errors;
mod files;
mod folder;
mod format;
mod grouping;
#[cfg(any(feature = "arrow", feature = "files", feature = "parquet"))]
mod guard;
mod gzip;
mod header;
mod input;
mod layout;
mod lines;
mod mapping;
mod moment;
mod named;
mod order;
mod packed;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(not(feature = "parquet"))]
#[path = "without_parquet.rs"]
mod parquet;
mod parts;
mod quality;
mod read;
mod record;
mod report;
mod sealed;
mod select;
mod several;
mod source;
mod split;
mod stream;
mod survey;
mod table;
mod text;
mod told_rate;
mod unit_words;
mod write;

pub(crate) use beside::{can_remove, is_at};
pub use cell::{Cell, format_number, parse_cell, short};
pub use cells::Cells;
pub use clock::Clock;
pub use counted::count_times;
pub use delimiter::Delimiter;
pub(crate) use errors::as_parts_of_the_middle;
pub use files::Kind;
pub use folder::write_folder;
pub use format::{Format, file_of, read, read_bytes, to_bytes};
pub use input::Interpolation;
pub use mapping::{ColumnMap, InputMap, Mapping, ObservableMap, TIME_NAMES, listed};
pub use named::{NamedFile, files_of, name_apart, stem};
pub use packed::{Packed, typical_step};
#[cfg(feature = "parquet")]
pub use parquet::{ParquetWriter, to_parquet};
pub use parts::{PartPlace, PartSampling, PartSurvey};
pub use quality::{Suspicion, SuspicionKind};
pub use record::Record;
pub use report::{ColumnReport, DataReport, FileReport, Gap, RunReport, Sampling, Streamed};
pub use sealed::{MOST, Sealed, sum};
pub use select::dataset;
pub use several::{TakenColumns, together};
pub use source::{Chunk, InMemory, Pass, Piece, RunName, Source};
pub use split::{Split, concatenate};
pub use stream::{FilePart, FileSource, head, memory_needed};
pub use survey::{Survey, survey, survey_file};
pub use table::{
    Column, CountedRows, ParquetReading, Reading, StoredReading, Table, TextReading, column_of,
};
pub use text::{Encoding, is_invisible, visible};
pub use unit_words::{is_time_unit, known_unit};
pub use write::{Layout, to_csv, write_atomically, write_csv};

/// One uninterrupted recording. Missing cells are NaN; times strictly increase.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// The cell of the run column, or "1" when there is none.
    pub name: String,
    /// Sample times since `clock.origin` in the spec's time unit, strictly increasing.
    pub times: Vec<f64>,
    /// `values[observable][sample]`, in the spec's units; NaN where nothing was measured.
    pub values: Vec<Vec<f64>>,
    /// `errors[observable][sample]`: standard errors that a column holds beside the values, as
    /// parts of the middle one of all; empty for observables that have none, and altogether where
    /// none has.
    pub errors: Vec<Vec<f64>>,
    /// Line of the file that each sample came from, counted from 1; 0 when not from a file.
    pub lines: Vec<u64>,
    /// What `times` are counted from: zero, unless a file has times far from it.
    pub clock: Clock,
    /// `inputs[column][sample]` of what drives the motion, in the spec's units: for each of
    /// [`Dataset::inputs`] its values and then the derivatives that its interpolation goes by.
    pub inputs: Vec<Vec<f64>>,
    /// Which group it belongs to, for each of [`Mapping::groups`]; without a text it is one of its
    /// own. Empty where nobody asked.
    pub groups: Vec<String>,
}

/// A measured input of the motion.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredInput {
    /// Name of the input in the spec.
    pub name: String,
    /// What it does between its samples.
    pub between: Interpolation,
}

impl MeasuredInput {
    /// The columns of a run at `times` from the values of the input, none of them missing.
    pub fn columns(&self, times: &[f64], values: &[f64]) -> Vec<Vec<f64>> {
        self.between.derivatives(times, values, driving::gap([times]))
    }

    /// First column of each of some inputs among the columns of a run, and their number.
    pub fn places(inputs: &[MeasuredInput]) -> (Vec<usize>, usize) {
        let mut end = 0;
        let place = |input: &MeasuredInput| {
            end += input.between.columns();
            end - input.between.columns()
        };
        let places = inputs.iter().map(place).collect();
        (places, end)
    }
}

impl Run {
    /// Which group it belongs to by one of [`Mapping::groups`]; where nobody asked, it is one of
    /// its own.
    pub fn group(&self, by: usize) -> &str {
        self.groups.get(by).filter(|group| !group.is_empty()).unwrap_or(&self.name)
    }

    /// The time of a sample on the clock of the file; not a number beyond the last.
    pub fn time(&self, sample: usize) -> f64 {
        self.times.get(sample).map_or(f64::NAN, |since| self.clock.time(*since))
    }

    /// Times of all samples on the clock of the file.
    pub fn clock_times(&self) -> Vec<f64> {
        self.times.iter().map(|since| self.clock.time(*since)).collect()
    }

    /// First and last time on the clock of the file.
    pub fn ends(&self) -> Option<(f64, f64)> {
        Some((self.time(0), self.time(self.times.len().checked_sub(1)?)))
    }
}

/// All runs of one data set.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Dataset {
    /// Names of the observables: coordinates first, then momenta or velocities.
    pub observables: Vec<String>,
    /// The recordings, in the order of their first appearance.
    pub runs: Vec<Run>,
    /// What drives the motion, in the order of the spec.
    pub inputs: Vec<MeasuredInput>,
}

impl Dataset {
    /// The same measurements with these observables in this order: not a number throughout where
    /// nothing here has the name.
    pub fn with_observables(&self, names: Vec<String>) -> Cow<'_, Dataset> {
        if names == self.observables {
            return Cow::Borrowed(self);
        }
        let place = |name: &String| self.observables.iter().position(|own| own == name);
        let places: Vec<Option<usize>> = names.iter().map(place).collect();
        let run = |run: &Run| {
            let measured = |place: &Option<usize>| place.and_then(|at| run.values.get(at).cloned());
            let nothing = || vec![f64::NAN; run.times.len()];
            let column = |place: &Option<usize>| measured(place).unwrap_or_else(nothing);
            let errors = |place: &Option<usize>| {
                place.and_then(|at| run.errors.get(at).cloned()).unwrap_or_default()
            };
            let errors = if run.errors.is_empty() {
                Vec::new()
            } else {
                places.iter().map(errors).collect()
            };
            Run { values: places.iter().map(column).collect(), errors, ..run.clone() }
        };
        Cow::Owned(Dataset {
            runs: self.runs.iter().map(run).collect(),
            observables: names,
            inputs: self.inputs.clone(),
        })
    }
}
