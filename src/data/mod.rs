//! Measurements: what was read from a file, as runs of samples with true times.

/// One uninterrupted recording. Missing cells are NaN; times strictly increase.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// The cell of the run column, or "1" when there is none.
    pub name: String,
    /// Sample times in the spec's time unit, strictly increasing.
    pub times: Vec<f64>,
    /// `values[observable][sample]`, in the spec's units; NaN where nothing was measured.
    pub values: Vec<Vec<f64>>,
    /// Line of the file that each sample came from, counted from 1; 0 when not from a file.
    pub lines: Vec<u64>,
}

/// All runs of one data set.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Dataset {
    /// Names of the observables: coordinates first, then momenta or velocities.
    pub observables: Vec<String>,
    pub runs: Vec<Run>,
}
