//! Fits to data in parts, on this machine or on many.

use std::path::PathBuf;

use super::measured;
use super::{Data, Law, Spec};
use crate::data::{FileSource, InMemory, PartPlace, PartSampling, PartSurvey, Source};
use crate::error::{Error, Result};
use crate::fit::parts::{self, Engine, PassFactor, PassRequest, merge_bytes, merge_in_order};
use crate::fit::{Monitor, Options};

/// Samples of a chunk of measurements in memory.
const CHUNK: usize = 1 << 17;

/// A part of the data: a file, or measurements in memory. All parts have the same columns.
///
/// ```
/// use leverrier::{Part, PartSampling, Spec};
///
/// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
/// let sampling = PartSampling { most: 500, seed: 0 };
/// let file = Part::File("examples/damped-pendulum/swings.csv".into());
/// let table = Part::Data(spec.data()?);
/// let samples = |part| Ok::<_, leverrier::Error>(spec.survey_part(part, 0, sampling)?.samples());
/// assert_eq!(samples(&file)?, samples(&table)?);
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[expect(clippy::large_enum_variant, reason = "there are few, and each is handed on once")]
pub enum Part {
    /// A file, which is read anew in every pass, part by part: the rows of a run stand together, in
    /// the order of time.
    File(PathBuf),
    /// Measurements in memory.
    Data(Data),
}

/// The same, opened.
enum Opened<'a> {
    File(Box<FileSource>),
    Data(InMemory<'a>),
}

impl Part {
    /// Merges neighbours, then neighbours of what that gives, until one is left; an odd last one
    /// goes up as it is. The tree depends on the number of leaves alone.
    ///
    /// # Errors
    /// There are no leaves ([`ErrorKind::InvalidArgument`](crate::ErrorKind::InvalidArgument)), or
    /// two of them do not merge.
    ///
    /// ```
    /// let names = ["a", "b", "c"].map(String::from).to_vec();
    /// let tree = leverrier::Part::merge_in_order(names, |a, b| Ok(format!("({a}{b})")))?;
    /// assert_eq!(tree, "((ab)c)");
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn merge_in_order<T>(leaves: Vec<T>, merge: impl Fn(T, T) -> Result<T>) -> Result<T> {
        merge_in_order(leaves, merge)
    }

    /// What the bytes of two surveys, or of two factors, merge to, the second of the parts that
    /// follow.
    ///
    /// # Errors
    /// They are of different kinds or damaged ([`ErrorKind::Model`](crate::ErrorKind::Model)), or
    /// do not follow each other
    /// ([`ErrorKind::InvalidArgument`](crate::ErrorKind::InvalidArgument)).
    ///
    /// ```
    /// use leverrier::{Part, PartSampling, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let part = Part::File("examples/damped-pendulum/swings.csv".into());
    /// let sampling = PartSampling { most: 500, seed: 0 };
    /// let [first, second] = [0, 1].map(|at| spec.survey_part(&part, at, sampling));
    /// let both = Part::merge_bytes(&first?.to_bytes()?, &second?.to_bytes()?)?;
    /// assert!(Part::merge_bytes(&both, b"something else").is_err());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn merge_bytes(first: &[u8], second: &[u8]) -> Result<Vec<u8>> {
        merge_bytes(first, second)
    }

    fn opened(&self, spec: &Spec) -> Result<Opened<'_>> {
        Ok(match self {
            Part::File(path) => {
                Opened::File(Box::new(measured::source(spec.compiled(), &spec.named(Some(path))?)?))
            }
            Part::Data(data) => {
                data.require(spec)?;
                Opened::Data(InMemory::new(data.dataset(), CHUNK))
            }
        })
    }

    /// What notes call it.
    fn name(&self, number: u32) -> String {
        match self {
            Part::File(path) => path.display().to_string(),
            Part::Data(_) => format!("part {number}"),
        }
    }
}

impl Opened<'_> {
    fn source(&self) -> &dyn Source {
        match self {
            Opened::File(file) => file.as_ref(),
            Opened::Data(data) => data,
        }
    }
}

/// Says which part of the data in memory something is wrong with; errors of files name them.
fn placed(error: Error, part: &Part, number: u32) -> Error {
    match (error, part) {
        (Error::Data(mut wrong), Part::Data(_)) => {
            wrong.message = format!("in part {number} of the data: {}", wrong.message);
            Error::Data(wrong)
        }
        (error, _) => error,
    }
}

impl Spec {
    /// The survey of a part: what it holds, and a fair sample of it. Parts are numbered from 0; one
    /// whose name and times go on in the next has a run in common with it.
    ///
    /// # Errors
    /// The part cannot be read, or does not hold the columns that the spec asks for.
    ///
    /// ```
    /// use leverrier::{Part, PartSampling, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let part = Part::File("examples/damped-pendulum/swings.csv".into());
    /// let survey = spec.survey_part(&part, 0, PartSampling { most: 500, seed: 0 })?;
    /// assert_eq!((survey.parts(), survey.samples()), (1, 968));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn survey_part(
        &self,
        part: &Part,
        number: u32,
        sampling: PartSampling,
    ) -> Result<PartSurvey> {
        let opened = part.opened(self).map_err(|error| placed(error, part, number))?;
        let name = part.name(number);
        let survey = PartSurvey::of(opened.source(), (number, &name), sampling, &|_| true)
            .map_err(|error| placed(error, part, number))?;
        Ok(match &opened {
            Opened::File(source) => survey.of_file(source),
            Opened::Data(_) => survey,
        })
    }

    /// The pass of a part at the numbers of a request: triangular factors, which merge. Works on
    /// the threads of the rayon pool that it is called from; the result does not depend on their
    /// number.
    ///
    /// # Errors
    /// As [`Spec::survey_part`]; the request is of another spec
    /// ([`ErrorKind::InvalidArgument`](crate::ErrorKind::InvalidArgument)).
    ///
    /// The example of [`Engine`] calls it; with bytes that are no request there is nothing to pass:
    ///
    /// ```
    /// assert!(leverrier::PassRequest::from_bytes(&[]).is_err());
    /// ```
    pub fn pass_part(
        &self,
        part: &Part,
        request: &PassRequest,
        place: PartPlace,
    ) -> Result<PassFactor> {
        let pass =
            |opened: Opened| parts::pass_part(self.system(), opened.source(), request, place);
        part.opened(self).and_then(pass).map_err(|error| placed(error, part, place.number))
    }

    /// Learns from the parts of an engine which terms the law has, and their coefficients. Beside
    /// the law comes the sample of the data on which the terms were looked for first, with the
    /// report on all of them: comparisons and diagnoses work on it.
    ///
    /// The surveys and every pass go through the engine: those that linearise by the whole function
    /// space, and those of the refits. The search on the factors, and the first look at the sample,
    /// are made here.
    ///
    /// # Errors
    /// As [`Spec::fit_monitored`], and whatever the engine says.
    ///
    /// ```
    /// use leverrier::{LocalParts, Options, Part, Silent, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let file = Part::File("examples/damped-pendulum/swings.csv".into());
    /// let engine = LocalParts::new(&spec, vec![file.clone(), file]);
    /// let (law, _) = spec.fit_parts(&engine, &Options::default(), &Silent)?;
    /// assert_eq!(law.terms().len(), 1);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn fit_parts(
        &self,
        engine: &dyn Engine,
        options: &Options,
        monitor: &dyn Monitor,
    ) -> Result<(Law, Data)> {
        let options = self.with_starts(options);
        let (model, survey) = parts::fit_parts(self.system(), engine, &options, monitor)?;
        let data = Data::sample(survey.sample, survey.report);
        Ok((Law::learned(self, model, &data)?, data))
    }
}

/// The parts of data that this process reads, one after the other.
///
/// ```
/// use leverrier::{LocalParts, Options, Part, Silent, Spec};
///
/// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
/// let (training, held_out) = spec.data()?.split(0.25, 0)?;
/// let engine = LocalParts::new(&spec, vec![Part::Data(training), Part::Data(held_out)]);
/// let (law, data) = spec.fit_parts(&engine, &Options::default(), &Silent)?;
/// assert!(law.compare(&data).is_ok());
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct LocalParts {
    spec: Spec,
    parts: Vec<Part>,
}

impl LocalParts {
    /// Some parts of the data of a spec, in their order.
    ///
    /// ```
    /// use leverrier::{LocalParts, Part, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let engine = LocalParts::new(&spec, vec![Part::Data(spec.data()?)]);
    /// assert!(format!("{engine:?}").contains("LocalParts"));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn new(spec: &Spec, parts: Vec<Part>) -> LocalParts {
        LocalParts { spec: spec.clone(), parts }
    }

    fn each<T>(
        &self,
        watch: &dyn Fn(f64) -> bool,
        one: impl Fn(&Part, usize) -> Result<T>,
        merge: impl Fn(T, T) -> Result<T>,
    ) -> Result<T> {
        let mut leaves = Vec::with_capacity(self.parts.len());
        for (at, part) in self.parts.iter().enumerate() {
            if !watch(at as f64 / self.parts.len() as f64) {
                return Err(Error::Interrupted);
            }
            leaves.push(one(part, at)?);
        }
        merge_in_order(leaves, merge)
    }
}

impl Engine for LocalParts {
    fn survey(&self, sampling: PartSampling, watch: &dyn Fn(f64) -> bool) -> Result<PartSurvey> {
        let one = |part: &Part, at: usize| self.spec.survey_part(part, at as u32, sampling);
        self.each(watch, one, PartSurvey::merge)
    }

    fn pass(
        &self,
        request: &PassRequest,
        places: &[PartPlace],
        watch: &dyn Fn(f64) -> bool,
    ) -> Result<PassFactor> {
        let one = |part: &Part, at: usize| {
            let place = places.get(at).copied().unwrap_or_default();
            self.spec.pass_part(part, request, place)
        };
        self.each(watch, one, PassFactor::merge)
    }
}
