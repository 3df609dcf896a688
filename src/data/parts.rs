//! Surveys of parts of the data, made by many processes and merged.

use serde::{Deserialize, Serialize};

use super::report::{DataReport, Streamed};
use super::sealed::{MOST, Sealed};
use super::source::{Chunk, Piece, RunName, Source};
use super::stream::FileSource;
use super::survey::{Counted, Counting, Reservoir, Survey};
use super::{Clock, Dataset, MeasuredInput, Run};
use crate::error::{Error, ErrorKind, Result};

/// A part's runs are numbered from its own number times this, where samples are drawn.
const RUNS_OF_A_PART: u64 = 1 << 40;
/// Parts of the data, at most.
const PARTS: u64 = 1 << 22;
/// Runs that go on across a border, or seem to, which are named in a note.
const NAMED: usize = 5;

/// How a survey draws its sample.
///
/// ```
/// let sampling = leverrier::PartSampling { most: 10_000, seed: 0 };
/// assert_eq!(sampling, leverrier::PartSampling { ..sampling });
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartSampling {
    /// Samples that are kept, about.
    pub most: u64,
    /// The same seed keeps the same sample.
    pub seed: u64,
}

/// Where a part of the data stands among all: what a pass has to know of the others.
///
/// ```
/// let first = leverrier::PartPlace::default();
/// assert_eq!((first.number, first.runs_before, first.samples_before), (0, 0, 0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct PartPlace {
    /// Its number, counted from 0.
    pub number: u32,
    /// Runs that begin in parts before it.
    pub runs_before: u64,
    /// Samples in parts before it.
    pub samples_before: u64,
    /// How many of them are of the run that goes on in it.
    pub carried: u64,
}

/// What one part of the data holds, or several that follow each other: counts, moments, the ends of
/// their runs, and a fair sample.
///
/// Surveys of neighbours merge; in which order does not matter to the sample and the counts.
///
/// ```
/// use leverrier::{Part, PartSampling, PartSurvey, Spec};
///
/// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
/// let part = Part::File("examples/damped-pendulum/swings.csv".into());
/// let sampling = PartSampling { most: 500, seed: 0 };
/// let survey = spec.survey_part(&part, 0, sampling)?;
/// assert_eq!(survey.samples(), 968);
/// // It travels as bytes.
/// let again = PartSurvey::from_bytes(&survey.to_bytes()?)?;
/// assert_eq!(again, survey);
/// let both = survey.merge(spec.survey_part(&part, 1, sampling)?)?;
/// assert_eq!(both.samples(), 2 * 968);
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartSurvey {
    observables: Vec<String>,
    /// Names of what drives the motion.
    inputs: Vec<String>,
    /// Headers of the columns of the first part, where it has some.
    headers: Vec<Option<String>>,
    sampling: PartSampling,
    /// In the order of their numbers, without a gap.
    parts: Vec<Surveyed>,
    columns: Vec<Counted>,
    kept: Vec<Kept>,
}

/// What is known of one part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Surveyed {
    number: u32,
    /// What errors and notes call it.
    name: String,
    samples: u64,
    /// Runs of which it has samples, and those of at least two.
    begun: u64,
    runs: u64,
    longest: u64,
    /// The first and the last of them; the same one where there is one.
    ends: Option<(RunEnd, RunEnd)>,
    notes: Vec<String>,
}

/// The first or the last run of a part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct RunEnd {
    name: String,
    /// Runs of two rows each go on nowhere.
    pair: bool,
    samples: u64,
    /// Times on the clock of the data.
    from: f64,
    to: f64,
}

/// A run, or a stretch of one, that was drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Kept {
    key: (u64, u64, u64),
    name: String,
    line: u64,
    times: Vec<f64>,
    values: Vec<Vec<f64>>,
    origin: f64,
    rounding: f64,
}

/// The first and the last run, while a source goes by.
#[derive(Default)]
struct Ends {
    begun: u64,
    first: Option<RunEnd>,
    last: Option<RunEnd>,
}

impl Ends {
    fn take(&mut self, chunk: &Chunk, piece: &Piece) {
        let times = chunk.times.get(piece.samples.clone()).unwrap_or_default();
        let (Some(&from), Some(&to)) = (times.first(), times.last()) else { return };
        if piece.begins {
            self.begun += 1;
            if self.begun == 2 {
                self.first = self.last.take();
            }
            self.last = Some(RunEnd {
                name: piece.name.to_string(),
                pair: matches!(piece.name, RunName::Pair(_)),
                samples: 0,
                from: piece.clock.time(from),
                to: f64::NAN,
            });
        }
        if let Some(last) = &mut self.last {
            last.samples += times.len() as u64;
            last.to = piece.clock.time(to);
        }
    }

    fn both(self) -> Option<(RunEnd, RunEnd)> {
        let last = self.last?;
        Some((self.first.unwrap_or_else(|| last.clone()), last))
    }
}

impl PartSurvey {
    /// Goes through a part once. `watch` is told how far it has come, and says whether to go on.
    ///
    /// # Errors
    /// Whatever is wrong with the measurements; [`Error::Interrupted`] when `watch` says no.
    pub(crate) fn of(
        source: &dyn Source,
        (number, name): (u32, &str),
        sampling: PartSampling,
        watch: &dyn Fn(f64) -> bool,
    ) -> Result<PartSurvey> {
        let observables = source.observables().to_vec();
        let mut counting = Counting::new(observables.len());
        let most = usize::try_from(sampling.most).unwrap_or(usize::MAX);
        let mut reservoir = Reservoir::new(most, sampling.seed);
        reservoir.first = u64::from(number) * RUNS_OF_A_PART;
        let mut ends = Ends::default();
        let mut pass = source.pass()?;
        while let Some(chunk) = pass.next()? {
            counting.take(&chunk);
            for piece in &chunk.pieces {
                ends.take(&chunk, piece);
                reservoir.take(&chunk, piece);
            }
            if !watch(pass.fraction()) {
                return Err(Error::Interrupted);
            }
        }
        let Counting { runs, samples, longest, columns, .. } = counting;
        let surveyed = Surveyed {
            number,
            name: name.to_string(),
            samples,
            begun: ends.begun,
            runs,
            longest,
            ends: ends.both(),
            notes: Vec::new(),
        };
        Ok(PartSurvey {
            headers: vec![None; observables.len()],
            observables,
            inputs: source.inputs().iter().map(|input| input.name.clone()).collect(),
            sampling,
            parts: vec![surveyed],
            columns,
            kept: reservoir.kept.into_iter().map(|(key, run)| Kept::of(key, run)).collect(),
        })
    }

    /// The same with what the file itself tells.
    pub(crate) fn of_file(mut self, source: &FileSource) -> PartSurvey {
        self.headers = source.headers().to_vec();
        if let Some(part) = self.parts.first_mut() {
            part.notes.extend_from_slice(source.notes());
        }
        self
    }

    /// Samples of all its parts.
    ///
    /// ```
    /// use leverrier::{Part, PartSampling, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let part = Part::File("examples/damped-pendulum/swings.csv".into());
    /// let survey = spec.survey_part(&part, 0, PartSampling { most: 500, seed: 0 })?;
    /// assert_eq!(survey.samples(), 968);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn samples(&self) -> u64 {
        self.parts.iter().map(|part| part.samples).sum()
    }

    /// How many parts it is of.
    ///
    /// ```
    /// use leverrier::{Part, PartSampling, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let part = Part::File("examples/damped-pendulum/swings.csv".into());
    /// let survey = spec.survey_part(&part, 0, PartSampling { most: 500, seed: 0 })?;
    /// assert_eq!(survey.parts(), 1);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn parts(&self) -> usize {
        self.parts.len()
    }

    /// The survey of both, of which `next` is of the parts that follow.
    ///
    /// # Errors
    /// They are not neighbours, or not of the same observables and sampling
    /// ([`ErrorKind::InvalidArgument`]).
    ///
    /// ```
    /// use leverrier::{Part, PartSampling, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let part = Part::File("examples/damped-pendulum/swings.csv".into());
    /// let survey = spec.survey_part(&part, 0, PartSampling { most: 500, seed: 0 })?;
    /// // No part follows itself.
    /// assert!(survey.clone().merge(survey).is_err());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn merge(mut self, next: PartSurvey) -> Result<PartSurvey> {
        let alike = self.observables == next.observables
            && self.inputs == next.inputs
            && self.sampling == next.sampling;
        if !alike {
            return Err(unlike("are of different specs or samplings"));
        }
        let here = self.parts.last().map(|part| part.number);
        let there = next.parts.first().map(|part| part.number);
        if here.map(|number| number + 1) != there {
            return Err(unlike("are of parts that do not follow each other"));
        }
        let most = usize::try_from(self.sampling.most).unwrap_or(usize::MAX);
        let mut reservoir = Reservoir::new(most, self.sampling.seed);
        for kept in self.kept.into_iter().chain(next.kept) {
            reservoir.keep(kept.key, kept.run());
        }
        self.kept = reservoir.kept.into_iter().map(|(key, run)| Kept::of(key, run)).collect();
        self.parts.extend(next.parts);
        self.columns.iter_mut().zip(&next.columns).for_each(|(all, more)| all.merge(more));
        Ok(self)
    }

    /// The bytes that [`PartSurvey::from_bytes`] reads: `docs/formats.md`.
    ///
    /// # Errors
    /// None that is known.
    ///
    /// ```
    /// use leverrier::{Part, PartSampling, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let part = Part::File("examples/damped-pendulum/swings.csv".into());
    /// let survey = spec.survey_part(&part, 0, PartSampling { most: 500, seed: 0 })?;
    /// assert!(survey.to_bytes()?.starts_with(b"LVps"));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        self.sealed()
    }

    /// What [`PartSurvey::to_bytes`] wrote.
    ///
    /// # Errors
    /// The bytes are of another kind or version, or damaged ([`ErrorKind::Model`]).
    ///
    /// ```
    /// use leverrier::{Part, PartSampling, PartSurvey, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let part = Part::File("examples/damped-pendulum/swings.csv".into());
    /// let survey = spec.survey_part(&part, 0, PartSampling { most: 500, seed: 0 })?;
    /// assert_eq!(PartSurvey::from_bytes(&survey.to_bytes()?)?, survey);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn from_bytes(bytes: &[u8]) -> Result<PartSurvey> {
        PartSurvey::unsealed(bytes)
    }

    /// The survey of all data, and where each part stands among them. `inputs` are those of the
    /// system.
    ///
    /// A run whose name and times go on in the next part is one run, whose segment there is cut in
    /// two.
    ///
    /// # Errors
    /// The first part is missing; no two samples of a run stand next to each other; a run goes on
    /// in another part and is driven by an input that takes whole runs.
    pub(crate) fn concluded(self, inputs: Vec<MeasuredInput>) -> Result<(Vec<PartPlace>, Survey)> {
        if self.parts.first().is_none_or(|part| part.number != 0) {
            return Err(unlike("do not begin with part 0"));
        }
        let columns = self.observables.len() + MeasuredInput::places(&inputs).1;
        let driven = self.inputs.iter().eq(inputs.iter().map(|input| &input.name));
        if !driven || self.kept.iter().any(|kept| kept.values.len() != columns) {
            return Err(unlike("are of another spec"));
        }
        let joined = Joined::of(&self.parts);
        if joined.crossing > 0
            && let Some(whole) = inputs.iter().find(|input| input.between.columns() > 1)
        {
            return Err(Error::new(
                ErrorKind::InvalidArgument,
                format!(
                    "{}, and the input `{}` is `{}` between its samples, which takes whole runs",
                    joined.sentence(),
                    whole.name,
                    whole.between
                ),
                "say `linear` or `hold` in the spec, or keep every run in one part",
            ));
        }
        let samples = self.samples();
        let observables = self.observables.len();
        let most = usize::try_from(self.sampling.most).unwrap_or(usize::MAX);
        let mut reservoir = Reservoir::new(most, self.sampling.seed);
        for kept in self.kept {
            reservoir.keep(kept.key, kept.run());
        }
        let runs = reservoir.runs(observables);
        if runs.is_empty() {
            return Err(Error::new(
                ErrorKind::InsufficientData,
                "no two samples of a run stand next to each other; motion takes two",
                "look at the run column; keep the rows of a run together",
            ));
        }
        let sample = Dataset { observables: self.observables, runs, inputs };
        let mut report = DataReport::of(&sample);
        report.samples = usize::try_from(samples).unwrap_or(usize::MAX);
        for (column, counted) in report.columns.iter_mut().zip(&self.columns) {
            counted.put_into(column, samples);
        }
        for (column, header) in report.columns.iter_mut().zip(&self.headers) {
            column.header.clone_from(header);
        }
        report.streamed = Some(Streamed {
            runs: joined.runs,
            sampled_runs: sample.runs.len(),
            sampled_samples: sample.samples(),
        });
        if joined.crossing > 0 {
            report.warnings.push(format!(
                "{}: each is one run, its segment there cut in two",
                joined.sentence()
            ));
        }
        report.warnings.extend(joined.scattered());
        let mut notes: Vec<String> = self.parts.into_iter().flat_map(|part| part.notes).collect();
        notes.dedup();
        report.warnings.extend(notes);
        let Joined { runs, longest, places, .. } = joined;
        Ok((places, Survey { runs, samples, longest, sample, report }))
    }
}

fn unlike(what: &str) -> Error {
    Error::new(
        ErrorKind::InvalidArgument,
        format!("these surveys {what}"),
        "survey every part once, numbered from 0, with the same spec and sampling",
    )
}

/// Runs of all parts, those that cross borders put together.
#[derive(Default)]
struct Joined {
    runs: u64,
    longest: u64,
    places: Vec<PartPlace>,
    /// Borders that a run crosses, and the first of these runs.
    crossing: u64,
    crossed: Vec<String>,
    /// Runs with the same name at the ends of parts that are not neighbours, or whose time goes
    /// back.
    apart: Vec<String>,
}

impl Joined {
    fn of(parts: &[Surveyed]) -> Joined {
        let mut all = Joined::default();
        // The run that the part before left open, and its samples so far.
        let mut open: Option<(&RunEnd, u64)> = None;
        let mut seen = std::collections::BTreeSet::new();
        let (mut runs_before, mut samples_before) = (0, 0);
        for part in parts {
            let Some((first, last)) = &part.ends else {
                let number = part.number;
                all.places.push(PartPlace { number, runs_before, samples_before, carried: 0 });
                continue;
            };
            let goes_on = open.filter(|(before, _)| before.goes_on_in(first));
            if let Some((before, _)) = goes_on {
                all.crossing += 1;
                if all.crossed.len() < NAMED && !all.crossed.contains(&before.name) {
                    all.crossed.push(before.name.clone());
                }
            } else if seen.contains(&first.name) && !first.pair {
                all.apart.push(first.name.clone());
            }
            let carried = goes_on.map_or(0, |(_, samples)| samples);
            let joined = u64::from(goes_on.is_some());
            // The number of its first run is that of the run that goes on in it.
            let runs_of_part = runs_before - joined;
            let number = part.number;
            let place = PartPlace { number, runs_before: runs_of_part, samples_before, carried };
            all.places.push(place);
            runs_before = runs_of_part + part.begun;
            samples_before += part.samples;
            // Runs of at least two samples, the first as long as it is with what came before.
            let counted = |samples: u64| u64::from(samples > 1);
            all.runs += part.runs - counted(first.samples);
            all.runs += counted(first.samples + carried) - counted(carried);
            all.longest = all.longest.max(part.longest).max(first.samples + carried);
            let alone = part.begun == 1;
            open = Some((last, if alone { first.samples + carried } else { last.samples }));
            seen.insert(&last.name);
        }
        if seen.len() < 2 {
            // Parts without names of runs, each from a time of its own.
            all.apart.clear();
        }
        all
    }

    fn sentence(&self) -> String {
        let named = self.crossed.join("`, `");
        let more = if self.crossing > self.crossed.len() as u64 { " among others" } else { "" };
        match self.crossing {
            1 => format!("the run `{named}` goes on from one part of the data to the next"),
            many => format!(
                "runs go on from one part of the data to the next at {many} borders (`{named}`{more})"
            ),
        }
    }

    /// A note on runs of the same name that do not follow each other.
    fn scattered(&self) -> Option<String> {
        let mut named = self.apart.clone();
        named.dedup();
        let count = named.len();
        named.truncate(NAMED);
        (count > 0).then(|| {
            format!(
                "runs of the same name stand in parts of the data that do not follow each other \
                 (`{}`): each of them is taken as several runs; give the parts in the order of \
                 time, or sort the data by run",
                named.join("`, `")
            )
        })
    }
}

impl RunEnd {
    fn goes_on_in(&self, first: &RunEnd) -> bool {
        !self.pair && !first.pair && self.name == first.name && first.from > self.to
    }
}

impl Kept {
    fn of(key: (u64, u64, u64), run: Run) -> Kept {
        let Clock { origin, rounding } = run.clock;
        let line = run.lines.first().copied().unwrap_or(0);
        Kept { key, name: run.name, line, times: run.times, values: run.values, origin, rounding }
    }

    fn run(self) -> Run {
        Run {
            lines: vec![self.line; self.times.len()],
            name: self.name,
            times: self.times,
            values: self.values,
            clock: Clock { origin: self.origin, rounding: self.rounding },
            inputs: Vec::new(),
            groups: Vec::new(),
            errors: Vec::new(),
        }
    }
}

impl Sealed for PartSurvey {
    const MARK: &'static [u8; 4] = b"LVps";
    const WHAT: &'static str = "survey of a part of the data";

    fn checked(&self) -> std::result::Result<(), &'static str> {
        let observables = self.observables.len();
        if self.headers.len() != observables || self.columns.len() != observables {
            return Err("their columns are not as many as the observables");
        }
        if self.parts.is_empty() || self.parts.len() as u64 > PARTS {
            return Err("they are of no part, or of too many");
        }
        let numbered = (self.parts.iter().zip(self.parts.iter().skip(1)))
            .all(|(before, next)| before.number.checked_add(1) == Some(next.number));
        let small = self.parts.iter().all(|part| u64::from(part.number) < PARTS);
        if !numbered || !small {
            return Err("their parts are not numbered");
        }
        let mut samples = 0u64;
        for part in &self.parts {
            samples = samples.saturating_add(part.samples);
            let Surveyed { begun, runs, longest, .. } = *part;
            let sane = part.samples <= MOST
                && begun <= part.samples
                && runs <= begun
                && longest <= part.samples
                && part.ends.is_some() == (begun > 0);
            let end = |end: &RunEnd| end.samples <= part.samples && end.samples > 0;
            let ends = part.ends.as_ref().is_none_or(|(first, last)| {
                let two = u64::from(first.samples > 1);
                end(first) && end(last) && two <= runs
            });
            if !sane || !ends {
                return Err("their counts contradict each other");
            }
        }
        if samples > MOST || self.columns.iter().any(|column| column.measured() > samples) {
            return Err("their counts contradict each other");
        }
        let columns = self.kept.first().map_or(observables, |kept| kept.values.len());
        for kept in &self.kept {
            let length = kept.times.len();
            let ascending = kept.times.iter().zip(kept.times.iter().skip(1)).all(|(a, b)| a < b);
            let finite = kept.times.iter().chain([&kept.origin, &kept.rounding]);
            let whole = kept.values.len() == columns
                && columns >= observables
                && kept.values.iter().all(|values| values.len() == length);
            if length < 2 || !ascending || !finite.into_iter().all(|x| x.is_finite()) || !whole {
                return Err("their sample is no run of samples");
            }
        }
        Ok(())
    }
}
