//! Measurements of a spec's observables.

use std::path::Path;

use super::Spec;
use super::json::json_text;
use super::measured::{self, Named, Values};
use crate::data::{Clock, DataReport, Dataset, MeasuredInput, Run};
use crate::error::{Error, ErrorKind, Result};
use crate::simulate::InputRecord;

/// Measurements: runs of samples with their times, in the units of the spec that they were read
/// for. Nothing is resampled or filled in; what was not measured is NaN.
///
/// ```
/// use leverrier::{Data, Spec};
///
/// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
/// let data = Data::open("examples/damped-pendulum/swings.csv", &spec)?;
/// assert_eq!(data.runs(), 8);
/// assert_eq!(data.observables(), ["q", "p"]);
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Data {
    dataset: Dataset,
    report: DataReport,
}

impl Data {
    /// Reads a file of measurements, CSV and its like or Parquet, whole into memory. Its columns
    /// are found as the spec's `data` block says, or else by the names of the variables. Every
    /// coordinate needs one. Momenta (or velocities) may all go without; where the file has a
    /// column for one of them, or the spec names one, each of the others needs one too, unless the
    /// `data` block says `p not measured`.
    ///
    /// A file larger than memory is not read part by part here, as the program's `fit` does.
    ///
    /// # Errors
    /// The file cannot be read ([`ErrorKind::File`]), or is damaged or lacks a column
    /// ([`ErrorKind::Data`]), with the place.
    ///
    /// ```
    /// use leverrier::{Data, ErrorKind, Spec};
    ///
    /// let spec = Spec::parse("coordinates theta; momenta L\nT = L^2/2\nV = span{ cos(theta) }")?;
    /// let error = Data::open("examples/damped-pendulum/swings.csv", &spec).unwrap_err();
    /// assert_eq!(error.kind(), ErrorKind::Data); // its columns are called q and p
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn open(path: impl AsRef<Path>, spec: &Spec) -> Result<Data> {
        Data::of_names(spec, &spec.named(Some(path.as_ref()))?)
    }

    pub(super) fn of_names(spec: &Spec, names: &[Named]) -> Result<Data> {
        let (dataset, report) = measured::read(spec.compiled(), names)?;
        Ok(Data { dataset, report })
    }

    /// One run from numbers in memory: `times` ascending, in the spec's unit of time, and for each
    /// coordinate, then for each momentum (or velocity, where the spec says so) a slice of as many
    /// values. Coordinates alone will do. NaN is a missing value. Behind them stands a slice for
    /// each input of the spec, in its order, without missing values.
    ///
    /// # Errors
    /// The slices do not fit the spec or each other ([`ErrorKind::InvalidArgument`]).
    ///
    /// ```
    /// use leverrier::{Data, Spec};
    ///
    /// let spec = Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ poly(q; 4) }")?;
    /// let times: Vec<f64> = (0..60).map(|i| 0.1 * i as f64).collect();
    /// let q: Vec<f64> = times.iter().map(|t| t.cos()).collect();
    /// let p: Vec<f64> = times.iter().map(|t| -t.sin()).collect();
    /// let law = spec.fit(&Data::from_slices(&spec, &times, &[&q, &p])?)?;
    /// assert!((law.coefficient("q^2").unwrap() - 0.5).abs() < 1e-9);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn from_slices(spec: &Spec, times: &[f64], values: &[&[f64]]) -> Result<Data> {
        let (observables, inputs) = (spec.system().observables(), spec.system().measured_inputs());
        let shape = (observables.len(), spec.system().measures.len());
        let run = run("1", times, values, shape, &inputs)?;
        Ok(Data::of(Dataset { observables, runs: vec![run], inputs }))
    }

    /// No measurements: a part of larger data that has no rows.
    ///
    /// ```
    /// use leverrier::{Data, Spec};
    ///
    /// let spec = Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2 }")?;
    /// assert_eq!(Data::empty(&spec).samples(), 0);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn empty(spec: &Spec) -> Data {
        let (observables, inputs) = (spec.system().observables(), spec.system().measured_inputs());
        Data::of(Dataset { observables, runs: Vec::new(), inputs })
    }

    /// A table in memory: its columns are found as those of a file are ([`Data::open`]), with the
    /// units that the spec's `data` block names; its `data` block may name a run column, or say
    /// `pairs`. `time` and `run` name columns to take in place of the spec's. Rows of a run may
    /// stand in any order of time.
    ///
    /// # Errors
    /// A column is missing or cannot be used, with the place ([`ErrorKind::Data`]); columns are not
    /// of the same length ([`ErrorKind::InvalidArgument`]).
    ///
    /// ```
    /// use leverrier::{Data, Spec, Values};
    ///
    /// let spec = Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2 }")?;
    /// let columns = [("time", Values::Numbers(&[0.0, 0.1])), ("q", Values::Numbers(&[1.0, 0.9]))];
    /// assert_eq!(Data::from_columns(&spec, &columns, None, None)?.samples(), 2);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn from_columns(
        spec: &Spec,
        columns: &[(&str, Values)],
        time: Option<&str>,
        run: Option<&str>,
    ) -> Result<Data> {
        let (dataset, report) = measured::of_columns(spec.compiled(), columns, time, run)?;
        Ok(Data { dataset, report })
    }

    /// Samples of many runs: times in the spec's unit, the run of each sample where there are
    /// several, and a slice of values for each coordinate, then for each momentum (or velocity),
    /// then for each input, in the spec's units. Momenta may all be left out. NaN is a missing
    /// value.
    ///
    /// # Errors
    /// There are too many or too few slices, or they differ in length
    /// ([`ErrorKind::InvalidArgument`]); a sample cannot be used ([`ErrorKind::Data`]).
    ///
    /// ```
    /// use leverrier::{Data, Spec, Values};
    ///
    /// let spec = Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2 }")?;
    /// let (times, runs) = ([0.0, 0.1, 0.0, 0.1], Values::Numbers(&[1.0, 1.0, 2.0, 2.0]));
    /// let (q, p) = ([1.0, 0.9, 0.5, 0.4], [0.0, -0.1, 0.0, -0.05]);
    /// let data = Data::from_samples(&spec, &times, Some(runs), &[&q, &p])?;
    /// assert_eq!((data.runs(), data.samples()), (2, 4));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn from_samples(
        spec: &Spec,
        times: &[f64],
        runs: Option<Values>,
        values: &[&[f64]],
    ) -> Result<Data> {
        let (dataset, report) = measured::of_samples(spec.compiled(), times, runs, values)?;
        Ok(Data { dataset, report })
    }

    /// The same data with one more run, given as in [`Data::from_slices`].
    ///
    /// # Errors
    /// As [`Data::from_slices`].
    ///
    /// ```
    /// use leverrier::{Data, Spec};
    ///
    /// let spec = Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2 }")?;
    /// let data = Data::from_slices(&spec, &[0.0, 0.1], &[&[1.0, 0.9]])?;
    /// let data = data.with_run(&[0.0, 0.1, 0.2], &[&[0.5, 0.4, 0.2]])?;
    /// assert_eq!((data.runs(), data.samples()), (2, 5));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn with_run(self, times: &[f64], values: &[&[f64]]) -> Result<Data> {
        let mut dataset = self.dataset;
        let name = (dataset.runs.len() + 1).to_string();
        // Where the runs before show measures alone, so may this one.
        let all = dataset.observables.len();
        let shows = |row: &usize| {
            let mut values = dataset.runs.iter().filter_map(|run| run.values.get(*row)).flatten();
            values.any(|x| x.is_finite())
        };
        let first = (0..all).find(shows).unwrap_or(0);
        let shape = (all, if first > 0 { all - first } else { 0 });
        dataset.runs.push(run(&name, times, values, shape, &dataset.inputs)?);
        Ok(Data::of(dataset))
    }

    /// Two parts: what a law is learned from, and what is held out to judge it, about the
    /// `held_out` share of the samples (0 to 0.9). Whole runs are held out where there are several,
    /// else stretches of one; the same seed makes the same choice.
    ///
    /// # Errors
    /// The share is outside its range ([`ErrorKind::InvalidArgument`]).
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let data = spec.data()?;
    /// let (training, held_out) = data.split(0.25, 0)?;
    /// assert_eq!(training.runs() + held_out.runs(), data.runs());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn split(&self, held_out: f64, seed: u64) -> Result<(Data, Data)> {
        if !(0.0..=0.9).contains(&held_out) {
            return Err(Error::new(
                ErrorKind::InvalidArgument,
                "the share of held-out samples must be between 0 and 0.9",
                "give the share of the samples to put aside, such as 0.25",
            ));
        }
        let split = self.dataset.split_held_out(held_out, seed);
        Ok((Data::of(split.training), Data::of(split.held_out)))
    }

    /// How many runs there are.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// assert_eq!(spec.data()?.runs(), 8);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn runs(&self) -> usize {
        self.dataset.runs.len()
    }

    /// How many samples there are in all runs.
    ///
    /// ```
    /// # use leverrier::{Data, Spec};
    /// let spec = Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2 }")?;
    /// assert_eq!(Data::from_slices(&spec, &[0.0, 0.1], &[&[1.0, 0.9]])?.samples(), 2);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn samples(&self) -> usize {
        self.dataset.samples()
    }

    /// Names of the observables: coordinates first, then momenta or velocities.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// assert_eq!(spec.data()?.observables(), ["q", "p"]);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn observables(&self) -> &[String] {
        &self.dataset.observables
    }

    /// Times of a run (counted from 0) in the spec's unit, ascending; `None` where there is no
    /// such run.
    ///
    /// ```
    /// # use leverrier::{Data, Spec};
    /// let spec = Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2 }")?;
    /// let data = Data::from_slices(&spec, &[0.0, 0.1], &[&[1.0, 0.9]])?;
    /// assert_eq!(data.times(0), Some(vec![0.0, 0.1]));
    /// assert_eq!(data.times(1), None);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn times(&self, run: usize) -> Option<Vec<f64>> {
        self.dataset.runs.get(run).map(Run::clock_times)
    }

    /// Values of an observable in a run (counted from 0), one for each of its times, in the spec's
    /// unit; NaN where nothing was measured, `None` where there is no such run or observable.
    ///
    /// ```
    /// # use leverrier::{Data, Spec};
    /// let spec = Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2 }")?;
    /// let data = Data::from_slices(&spec, &[0.0, 0.1], &[&[1.0, 0.9]])?;
    /// assert_eq!(data.values(0, "q"), Some([1.0, 0.9].as_slice()));
    /// assert!(data.values(0, "p").unwrap()[0].is_nan());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn values(&self, run: usize, observable: &str) -> Option<&[f64]> {
        let at = self.dataset.observables.iter().position(|name| name == observable)?;
        Some(self.dataset.runs.get(run)?.values.get(at)?)
    }

    /// What was put right on reading and what deserves a look, as sentences.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// assert!(spec.data()?.warnings().is_empty());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn warnings(&self) -> &[String] {
        &self.report.warnings
    }

    /// The name of a run, as its file or table has it.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// assert_eq!(spec.data()?.run_name(0), Some("1"));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn run_name(&self, run: usize) -> Option<&str> {
        Some(&self.dataset.runs.get(run)?.name)
    }

    /// The data report as JSON, with the fields of `docs/formats.md`.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// assert!(spec.data()?.report_json().contains("\"sampling\""));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn report_json(&self) -> String {
        json_text(&self.report)
    }

    pub(super) fn of(dataset: Dataset) -> Data {
        let report = DataReport::of(&dataset);
        Data { dataset, report }
    }

    /// A sample of larger data, with the report on all of them.
    pub(super) fn sample(dataset: Dataset, report: DataReport) -> Data {
        Data { dataset, report }
    }

    pub(crate) fn dataset(&self) -> &Dataset {
        &self.dataset
    }

    pub(crate) fn report(&self) -> &DataReport {
        &self.report
    }

    /// That it has the observables of a spec.
    pub(crate) fn require(&self, spec: &Spec) -> Result<()> {
        let wanted = spec.system().observables();
        if self.dataset.observables == wanted {
            return Ok(());
        }
        Err(Error::new(
            ErrorKind::InvalidArgument,
            format!(
                "the data hold {}, but {} is about {}",
                self.dataset.observables.join(", "),
                spec.name(),
                wanted.join(", ")
            ),
            "open the data with the spec that they are for",
        ))
    }
}

/// The inputs of a spec from numbers in memory.
///
/// # Errors
/// The slices do not fit the spec or each other.
pub(super) fn inputs_of(spec: &Spec, times: &[f64], values: &[&[f64]]) -> Result<InputRecord> {
    let inputs = spec.system().measured_inputs();
    let run = run("1", times, values, (0, 0), &inputs)?;
    let data = Dataset { observables: Vec::new(), runs: vec![run], inputs };
    InputRecord::of_runs(spec.system(), &data)?.pop().ok_or_else(|| {
        Error::new(ErrorKind::InvalidArgument, "no input is given", "give its times and values")
    })
}

fn run(
    name: &str,
    times: &[f64],
    values: &[&[f64]],
    (observables, measures): (usize, usize),
    inputs: &[MeasuredInput],
) -> Result<Run> {
    let wrong = |message: String, hint: &str| {
        Err(Error::new(ErrorKind::InvalidArgument, format!("run {name}: {message}"), hint))
    };
    let given = values.len().checked_sub(inputs.len());
    // What measures show may be all that there is.
    let part = if measures > 0 { measures } else { observables / 2 };
    let Some(measured) = given.filter(|given| [part, observables].contains(given)) else {
        let and = match inputs.len() {
            0 => String::new(),
            1 => " and an input".to_string(),
            more => format!(" and {more} inputs"),
        };
        return wrong(
            format!("{} slices of values for {observables} observables{and}", values.len()),
            match inputs.len() {
                0 if measures > 0 => "give one for each measure, or for each observable",
                0 => "give one for each coordinate, or for each observable",
                _ => {
                    "give one for each coordinate, or for each observable, then one for each input"
                }
            },
        );
    };
    if let Some(other) = values.iter().find(|slice| slice.len() != times.len()) {
        return wrong(
            format!("{} values at {} times", other.len(), times.len()),
            "give one value for each time, NaN where nothing was measured",
        );
    }
    let ascending = times.is_sorted_by(|before, after| before < after);
    if !ascending || times.iter().any(|time| !time.is_finite()) {
        return wrong("the times do not ascend".to_string(), "sort the samples by time");
    }
    if values.iter().any(|slice| slice.iter().any(|value| value.is_infinite())) {
        return wrong("a value is infinite".to_string(), "give NaN where nothing was measured");
    }
    let mut columns: Vec<Vec<f64>> = values.iter().map(|slice| slice.to_vec()).collect();
    let driving = columns.split_off(measured);
    if let Some(input) = (inputs.iter().zip(&driving))
        .find_map(|(input, values)| values.iter().any(|x| x.is_nan()).then_some(input))
    {
        return wrong(
            format!("the input `{}` has a missing value", input.name),
            "the motion cannot be followed without its input: leave these samples out",
        );
    }
    let missing = vec![f64::NAN; times.len()];
    if measures > 0 && measured < observables {
        columns.splice(0..0, std::iter::repeat_n(missing.clone(), observables - measured));
    }
    columns.resize(observables, missing);
    let derived = inputs.iter().zip(&driving);
    let inputs = derived.flat_map(|(input, values)| input.columns(times, values)).collect();
    Ok(Run {
        name: name.to_string(),
        times: times.to_vec(),
        values: columns,
        lines: vec![0; times.len()],
        clock: Clock::default(),
        inputs,
        groups: Vec::new(),
        errors: Vec::new(),
    })
}
