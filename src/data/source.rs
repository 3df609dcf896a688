//! Measurements that do not have to fit in memory: read anew in every pass, part by part.

use std::fmt;
use std::ops::Range;

use super::{Clock, Dataset, MeasuredInput};
use crate::error::Result;

/// Measurements that can be gone through from the first to the last, as often as need be.
pub trait Source: Sync {
    /// Names of the observables, in the order of a chunk's values.
    fn observables(&self) -> &[String];

    /// What drives the motion; their columns stand in a chunk's values behind the observables.
    fn inputs(&self) -> &[MeasuredInput];

    /// Begins a pass. Every pass gives the same samples, cut into the same chunks.
    ///
    /// # Errors
    /// The measurements cannot be reached any more.
    fn pass(&self) -> Result<Box<dyn Pass + '_>>;
}

/// One way through a [`Source`].
pub trait Pass: Send {
    /// The next samples; none after the last.
    ///
    /// # Errors
    /// Whatever is wrong with the measurements there.
    fn next(&mut self) -> Result<Option<Chunk>>;

    /// How much of the measurements was read, 0 to 1.
    fn fraction(&self) -> f64;
}

/// Consecutive samples of one or many runs.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Chunk {
    /// Times of all samples, run after run, since the clock's origin of their piece; strictly
    /// increasing within a run.
    pub times: Vec<f64>,
    /// `values[observable][sample]`, in the spec's units; NaN where nothing was measured. Behind
    /// them the columns of the inputs, as in [`Run::inputs`](super::Run::inputs).
    pub values: Vec<Vec<f64>>,
    /// The runs; they cover all samples, one after the other.
    pub pieces: Vec<Piece>,
}

/// The part of a run that stands in a chunk.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// Number of the run, counted from 0.
    pub run: u64,
    /// Its name.
    pub name: RunName,
    /// Its samples in the chunk.
    pub samples: Range<usize>,
    /// Line (row) of the file of its first sample; 0 when not from a file.
    pub line: u64,
    /// Whether the run's first sample is here.
    pub begins: bool,
    /// Whether the run's last sample is here.
    pub ends: bool,
    /// What the times of its samples are counted from.
    pub clock: Clock,
}

/// What a run is called, without a text for each of a hundred million of them.
#[derive(Debug, Clone, PartialEq)]
pub enum RunName {
    /// By a number.
    Number(f64),
    /// By a text.
    Text(String),
    /// By the place of the pair in the file, counted from 1.
    Pair(u64),
}

impl fmt::Display for RunName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RunName::Number(number) => f.write_str(&super::format_number(*number)),
            RunName::Text(text) => f.write_str(text),
            RunName::Pair(number) => write!(f, "{number}"),
        }
    }
}

/// A data set in memory is a source too: of one chunk for every so many samples.
pub struct InMemory<'a> {
    data: &'a Dataset,
    samples: usize,
}

impl<'a> InMemory<'a> {
    /// Chunks of whole runs, with `samples` samples or a little more.
    pub fn new(data: &'a Dataset, samples: usize) -> Self {
        InMemory { data, samples }
    }
}

impl Source for InMemory<'_> {
    fn observables(&self) -> &[String] {
        &self.data.observables
    }

    fn inputs(&self) -> &[MeasuredInput] {
        &self.data.inputs
    }

    fn pass(&self) -> Result<Box<dyn Pass + '_>> {
        Ok(Box::new(InMemoryPass { held: self, next: 0 }))
    }
}

struct InMemoryPass<'a> {
    held: &'a InMemory<'a>,
    next: usize,
}

impl Pass for InMemoryPass<'_> {
    fn next(&mut self) -> Result<Option<Chunk>> {
        let runs = &self.held.data.runs;
        if self.next >= runs.len() {
            return Ok(None);
        }
        let observables = self.held.data.observables.len();
        let columns = observables + MeasuredInput::places(&self.held.data.inputs).1;
        let mut chunk = Chunk { values: vec![Vec::new(); columns], ..Chunk::default() };
        while let Some(run) = runs.get(self.next) {
            let start = chunk.times.len();
            if start >= self.held.samples {
                break;
            }
            chunk.times.extend(&run.times);
            let (measured, driving) = chunk.values.split_at_mut(observables);
            for (all, values) in measured.iter_mut().zip(&run.values) {
                all.extend(values);
            }
            for (all, values) in driving.iter_mut().zip(&run.inputs) {
                all.extend(values);
            }
            chunk.pieces.push(Piece {
                run: self.next as u64,
                name: RunName::Text(run.name.clone()),
                samples: start..chunk.times.len(),
                line: run.lines.first().copied().unwrap_or(0),
                begins: true,
                ends: true,
                clock: run.clock,
            });
            self.next += 1;
        }
        Ok(Some(chunk))
    }

    fn fraction(&self) -> f64 {
        self.next as f64 / self.held.data.runs.len().max(1) as f64
    }
}
