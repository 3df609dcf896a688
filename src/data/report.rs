//! The data report: what a data set holds, and what deserves a look before it is fitted.

use std::path::PathBuf;

use serde::Serialize;

use super::quality::{Suspicion, rough_noise, suspicions};
use super::table::{Reading, Table};
use super::{Dataset, MeasuredInput, Run};

/// What a data set holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DataReport {
    /// The file that it came from, if any.
    pub source: Option<FileReport>,
    /// How many samples there are in all runs.
    pub samples: usize,
    /// Set when the data are read part by part: then runs, sampling, gaps, rough noise and
    /// suspicions are those of a sample.
    pub streamed: Option<Streamed>,
    /// The runs, in the order of the data set.
    pub runs: Vec<RunReport>,
    /// Time between samples of one run.
    pub sampling: Sampling,
    /// Where samples are missing.
    pub gaps: Vec<Gap>,
    /// The observables, in the order of the data set, then the inputs.
    pub columns: Vec<ColumnReport>,
    /// Columns that deserve a look.
    pub suspicious: Vec<Suspicion>,
    /// What was put right and what deserves a look, as sentences.
    pub warnings: Vec<String>,
}

/// A file, and how it was understood.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FileReport {
    /// Its path.
    pub file: PathBuf,
    /// SHA-256 of its bytes, in hexadecimal digits.
    pub sha256: String,
    /// How many rows it has below the header.
    pub rows: usize,
    /// How many files it stands for, where a name means several.
    pub files: usize,
    /// How it was understood; of several files the first.
    #[serde(flatten)]
    pub reading: Reading,
}

/// Data that are read part by part, and the sample of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Streamed {
    /// Runs in all.
    pub runs: u64,
    /// Runs of the sample; stretches of long runs count as runs.
    pub sampled_runs: usize,
    /// Samples of the sample.
    pub sampled_samples: usize,
}

/// One run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunReport {
    /// Its name.
    pub name: String,
    /// How many samples it has.
    pub samples: usize,
    /// Time of the first sample, in the spec's time unit.
    pub start: f64,
    /// Time of the last sample, in the spec's time unit.
    pub end: f64,
    /// Lowest and highest line of the file that a sample came from; 0 without a file.
    pub lines: (u64, u64),
}

/// Time between samples, over all runs, in the spec's time unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Sampling {
    /// Half of the steps are shorter.
    pub median: f64,
    /// The shortest step.
    pub minimum: f64,
    /// The longest step.
    pub maximum: f64,
    /// Whether all steps are within 5 % of the median.
    pub is_regular: bool,
}

/// A step of more than one and a half median steps.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Gap {
    /// Name of the run.
    pub run: String,
    /// Line of the last sample before it; 0 without a file.
    pub after_line: u64,
    /// Time of the last sample before it.
    pub start: f64,
    /// Time of the first sample after it.
    pub end: f64,
    /// Its length in median steps of its run.
    pub steps: f64,
}

/// One observable, in the spec's unit. The numbers are `None` when nothing was measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ColumnReport {
    /// Name of the observable.
    pub name: String,
    /// Header of the column that it was read from.
    pub header: Option<String>,
    /// How many samples have a value.
    pub measured: usize,
    /// How many samples have none.
    pub missing: usize,
    /// Smallest value.
    pub minimum: Option<f64>,
    /// Largest value.
    pub maximum: Option<f64>,
    /// Arithmetic mean.
    pub mean: Option<f64>,
    /// Standard deviation about the mean.
    pub spread: Option<f64>,
    /// A rough upper bound of the noise from second differences; the curvature of the
    /// motion is in it too. The fit measures the noise properly.
    pub rough_noise: Option<f64>,
}

impl DataReport {
    /// The report on a data set that did not come from a file.
    pub fn of(data: &Dataset) -> Self {
        let steps: Vec<f64> = data.runs.iter().flat_map(steps).collect();
        let sampling = sampling(steps);
        let suspicious = suspicions(data);
        let observed = (0..data.observables.len()).map(|at| column_report(data, at));
        let columns = observed.chain(driving(data));
        DataReport {
            source: None,
            samples: data.samples(),
            streamed: None,
            runs: data.runs.iter().map(run_report).collect(),
            sampling,
            gaps: data.runs.iter().flat_map(|run| gaps(run, sampling.median)).collect(),
            columns: columns.collect(),
            warnings: suspicious.iter().map(Suspicion::sentence).collect(),
            suspicious,
        }
    }

    /// The report on a data set from a file: the headers that the observables were read
    /// from, and what was put right on the way.
    pub(super) fn of_file(
        data: &Dataset,
        table: &Table,
        headers: Vec<Option<String>>,
        notes: Vec<String>,
    ) -> Self {
        let mut report = DataReport::of(data);
        for (column, header) in report.columns.iter_mut().zip(headers) {
            column.header = header;
        }
        report.warnings.splice(0..0, notes);
        report.source = (table.reading != Reading::Memory).then(|| FileReport {
            file: table.path.clone(),
            sha256: table.sha256.clone(),
            rows: table.rows(),
            files: 1,
            reading: table.reading.clone(),
        });
        report
    }
}

fn run_report(run: &Run) -> RunReport {
    RunReport {
        name: run.name.clone(),
        samples: run.times.len(),
        start: run.ends().map_or(0.0, |ends| ends.0),
        end: run.ends().map_or(0.0, |ends| ends.1),
        lines: (
            run.lines.iter().copied().min().unwrap_or(0),
            run.lines.iter().copied().max().unwrap_or(0),
        ),
    }
}

fn steps(run: &Run) -> Vec<f64> {
    run.times.array_windows().map(|[before, after]| after - before).collect()
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len().checked_sub(1)? / 2;
    let (_, median, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    Some(*median)
}

fn sampling(steps: Vec<f64>) -> Sampling {
    let minimum = steps.iter().copied().reduce(f64::min).unwrap_or(0.0);
    let maximum = steps.iter().copied().reduce(f64::max).unwrap_or(0.0);
    let median = median(steps).unwrap_or(0.0);
    Sampling {
        median,
        minimum,
        maximum,
        is_regular: minimum >= 0.95 * median && maximum <= 1.05 * median,
    }
}

fn gaps(run: &Run, median_of_all: f64) -> Vec<Gap> {
    let steps = steps(run);
    // A run of its own rhythm is judged by that; a short one has none.
    let usual = if steps.len() >= 5 {
        median(steps.clone()).unwrap_or(median_of_all)
    } else {
        median_of_all
    };
    steps
        .iter()
        .zip(run.times.array_windows())
        .enumerate()
        .filter(|(_, (step, _))| **step > 1.5 * usual)
        .map(|(at, (step, [start, end]))| Gap {
            run: run.name.clone(),
            after_line: run.lines.get(at).copied().unwrap_or(0),
            start: run.clock.time(*start),
            end: run.clock.time(*end),
            steps: step / usual,
        })
        .collect()
}

fn column_report(data: &Dataset, at: usize) -> ColumnReport {
    let name = data.observables.get(at).cloned().unwrap_or_default();
    let columns = data.runs.iter().filter_map(|run| run.values.get(at));
    ColumnReport { rough_noise: rough_noise(data, at), ..report_on(name, data, columns.collect()) }
}

/// Reports on the inputs. Nothing is said of their noise: they are taken as they are.
fn driving(data: &Dataset) -> impl Iterator<Item = ColumnReport> {
    let places = MeasuredInput::places(&data.inputs).0;
    places.into_iter().zip(&data.inputs).map(|(place, input)| {
        let columns = data.runs.iter().filter_map(|run| run.inputs.get(place));
        report_on(input.name.clone(), data, columns.collect())
    })
}

/// What a column of each run holds.
fn report_on(name: String, data: &Dataset, columns: Vec<&Vec<f64>>) -> ColumnReport {
    let values =
        || columns.iter().flat_map(|values| values.iter()).copied().filter(|x| !x.is_nan());
    let measured = values().count();
    let count = measured as f64;
    let some = |number: f64| (measured > 0).then_some(number);
    // Dividing before adding keeps sums of huge values finite.
    let mean = values().map(|value| value / count).sum::<f64>();
    let variance = values().map(|value| (value - mean).powi(2) / count).sum::<f64>();
    ColumnReport {
        name,
        header: None,
        measured,
        missing: data.samples() - measured,
        minimum: values().reduce(f64::min),
        maximum: values().reduce(f64::max),
        mean: some(mean),
        spread: some(variance.sqrt()),
        rough_noise: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Clock;

    fn run(times: &[f64]) -> Run {
        Run {
            name: "a".to_string(),
            times: times.to_vec(),
            values: vec![times.to_vec()],
            lines: (2..).take(times.len()).collect(),
            clock: Clock::default(),
            inputs: Vec::new(),
            groups: Vec::new(),
            errors: Vec::new(),
        }
    }

    #[test]
    fn a_gap_is_found_where_it_is() {
        let data = Dataset {
            inputs: Vec::new(),
            observables: vec!["x".to_string()],
            runs: vec![run(&[0.0, 1.0, 2.0, 4.0, 5.0, 6.0])],
        };
        let report = DataReport::of(&data);
        assert_eq!(
            report.gaps,
            [Gap { run: "a".to_string(), after_line: 4, start: 2.0, end: 4.0, steps: 2.0 }]
        );
        assert!(!report.sampling.is_regular);
        assert_eq!(report.sampling.median, 1.0);
        let column = &report.columns[0];
        assert_eq!((column.mean, column.missing), (Some(3.0), 0));
        // The mean of (9 + 4 + 1 + 1 + 4 + 9).
        let spread = column.spread.expect("measured");
        assert!((spread - (28.0_f64 / 6.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_fast_run_beside_a_slow_one_has_no_gaps() {
        let fast: Vec<f64> = (0..50).map(|i| 0.1 * f64::from(i)).collect();
        let slow: Vec<f64> = (0..10).map(f64::from).collect();
        let data = Dataset {
            observables: vec!["x".to_string()],
            runs: vec![run(&fast), run(&slow)],
            inputs: Vec::new(),
        };
        assert_eq!(DataReport::of(&data).gaps, []);
    }
}
