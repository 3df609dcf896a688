//! Fits to data that many processes hold a part of each.
//!
//! Three pure functions do all work on the data: the survey of a part, the pass of a part at given
//! numbers, which leaves triangular factors, and the merge of what two neighbours left. Whoever can
//! call them on other machines is an [`Engine`]; the fit itself ([`fit_parts`]) is that of
//! [`fit_stream`](super::fit_stream), whose passes go through it.

mod factor;
mod request;

pub use factor::PassFactor;
pub use request::PassRequest;

use std::sync::Arc;

use super::model::{Model, fingerprint};
use super::monitor::Monitor;
use super::options::Options;
use super::stream::{Asked, Passed, Passes, Watch, pass_over};
use super::{memory, settled, streamed, whole_runs};
use crate::data::{PartPlace, PartSampling, PartSurvey, Sealed, Source, Survey};
use crate::error::{Error, ErrorKind, Result};
use crate::expr::System;

/// Whoever has the parts of the data and can call functions where they are.
///
/// Every part is asked once. What the parts give is merged in the tree of
/// that the result has the same bits for any number of workers and any order in which they end. The
/// functions are pure: a part whose worker died is asked again elsewhere.
///
/// ```
/// use leverrier::{Engine, Monitor, Options, Part, PartPlace, PartSampling, PartSurvey};
/// use leverrier::{PassFactor, PassRequest, Result, Silent, Spec};
///
/// /// Two files, one after the other in this process.
/// struct Here(Spec, Vec<Part>);
///
/// impl Engine for Here {
///     fn survey(&self, sampling: PartSampling, _: &dyn Fn(f64) -> bool) -> Result<PartSurvey> {
///         let one = |(at, part)| self.0.survey_part(part, at as u32, sampling);
///         let surveys: Result<Vec<PartSurvey>> = self.1.iter().enumerate().map(one).collect();
///         Part::merge_in_order(surveys?, PartSurvey::merge)
///     }
///
///     fn pass(
///         &self,
///         request: &PassRequest,
///         places: &[PartPlace],
///         _: &dyn Fn(f64) -> bool,
///     ) -> Result<PassFactor> {
///         let one = |(part, place)| self.0.pass_part(part, request, place);
///         let factors = self.1.iter().zip(places.iter().copied()).map(one);
///         Part::merge_in_order(factors.collect::<Result<Vec<_>>>()?, PassFactor::merge)
///     }
/// }
///
/// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
/// let file = || Part::File("examples/damped-pendulum/swings.csv".into());
/// let engine = Here(spec.clone(), vec![file(), file()]);
/// let (law, sample) = spec.fit_parts(&engine, &Options::default(), &Silent)?;
/// assert!((law.coefficient("cos(q)").unwrap() + 1.0).abs() < 0.01);
/// assert_eq!(sample.runs(), 16);
/// # Ok::<(), leverrier::Error>(())
/// ```
pub trait Engine: Sync {
    /// The survey of all parts: of each part its survey, merged in order. `watch` is told how far
    /// it has come (0 to 1), and says whether to go on.
    ///
    /// # Errors
    /// The first that a part gives, in their order; [`Error::Interrupted`] where `watch` says no.
    fn survey(&self, sampling: PartSampling, watch: &dyn Fn(f64) -> bool) -> Result<PartSurvey>;

    /// A pass over all parts at the same numbers, each at its place: what each leaves, merged in
    /// order.
    ///
    /// # Errors
    /// As [`Engine::survey`].
    fn pass(
        &self,
        request: &PassRequest,
        places: &[PartPlace],
        watch: &dyn Fn(f64) -> bool,
    ) -> Result<PassFactor>;
}

/// [`Part::merge_in_order`](crate::Part::merge_in_order).
pub fn merge_in_order<T>(leaves: Vec<T>, merge: impl Fn(T, T) -> Result<T>) -> Result<T> {
    let mut level = leaves;
    while level.len() > 1 {
        let mut above = Vec::with_capacity(level.len().div_ceil(2));
        let mut left = level.into_iter();
        while let Some(first) = left.next() {
            above.push(match left.next() {
                Some(second) => merge(first, second)?,
                None => first,
            });
        }
        level = above;
    }
    level.pop().ok_or_else(|| {
        let hint = "name at least one file or table";
        Error::new(ErrorKind::InvalidArgument, "the data have no parts", hint)
    })
}

/// Learns a sparse Hamiltonian from the parts of an engine; the survey has the sample on which the
/// support was looked for first.
///
/// # Errors
///
/// As [`fit_stream`](super::fit_stream), and whatever the engine says.
pub fn fit_parts(
    system: &Arc<System>,
    engine: &dyn Engine,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<(Model, Survey)> {
    options.tuning.check()?;
    whole_runs(system)?;
    let sampling = PartSampling { most: options.tuning.course.sampled as u64, seed: options.seed };
    let watch = |fraction: f64| {
        monitor.stage("surveying the data", 0.1 * fraction);
        !monitor.stopped()
    };
    let (places, survey) = engine.survey(sampling, &watch)?.concluded(system.measured_inputs())?;
    if survey.sample.observables != system.observables() {
        return Err(Error::new(
            ErrorKind::InvalidArgument,
            "the survey is of other observables than those of the spec",
            "survey the parts with the spec that is fitted",
        ));
    }
    let model = settled(system, &survey.sample, |present| {
        memory::check(present, options)?;
        let passes = PartPasses {
            engine,
            places: &places,
            original: system,
            fingerprint: fingerprint(system),
            unit_mass: !Arc::ptr_eq(present, system),
        };
        streamed::learn(present, &passes, &survey, options, monitor)
    })?;
    Ok((model, survey))
}

/// Passes that an engine makes.
struct PartPasses<'a> {
    engine: &'a dyn Engine,
    places: &'a [PartPlace],
    original: &'a System,
    fingerprint: String,
    /// Whether the scale of the momenta was settled by a unit of mass.
    unit_mass: bool,
}

impl Passes for PartPasses<'_> {
    fn pass(&self, asked: &Asked, watch: Watch) -> Result<Option<Passed>> {
        let request = PassRequest::of(asked, self.original, (&self.fingerprint, self.unit_mass))?;
        let told = |fraction: f64| watch(None, fraction);
        match self.engine.pass(&request, self.places, &told) {
            Ok(factor) => factor.passed(asked, &request, self.places.len()).map(Some),
            Err(Error::Interrupted) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

/// The pass of a part of a system's data, which stands there among all.
///
/// # Errors
///
/// The request is of another system ([`ErrorKind::InvalidArgument`]), or something is wrong with
/// the data.
pub(crate) fn pass_part(
    system: &System,
    source: &dyn Source,
    request: &PassRequest,
    place: PartPlace,
) -> Result<PassFactor> {
    request.work(system, |asked| {
        let passed = pass_over(source, asked, place, &|_, _| true)?.ok_or(Error::Interrupted)?;
        Ok(PassFactor::of(passed, request.mark()?, place.number))
    })
}

/// [`Part::merge_bytes`](crate::Part::merge_bytes).
pub fn merge_bytes(first: &[u8], second: &[u8]) -> Result<Vec<u8>> {
    if first.starts_with(PartSurvey::MARK) {
        PartSurvey::from_bytes(first)?.merge(PartSurvey::from_bytes(second)?)?.to_bytes()
    } else {
        PassFactor::from_bytes(first)?.merge(PassFactor::from_bytes(second)?)?.to_bytes()
    }
}
