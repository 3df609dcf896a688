//! The next run worth measuring.

use std::ops::RangeInclusive;

use serde_json::{Value, json};

use super::components::{matching, state_names};
use super::effect::NamedEffect;
use super::json::json_text;
use super::{Data, Law, Spec};
use crate::data::Dataset;
use crate::diagnose::design::rival::Rival;
use crate::diagnose::design::{self, Allowed, Goal, Plan};
use crate::diagnose::diagnosis::{self, RankedEffect, Verdict};
use crate::diagnose::{LawOnData, Options};
use crate::error::{Error, ErrorKind, Result};
use crate::fit::{self, Monitor};
use crate::simulate::Interval;

/// What the next run is for, and what it may be. What is left open is as in the measurements so
/// far: where they went, how long their runs last, how often they sample.
///
/// ```
/// use leverrier::DesignOptions;
///
/// // Which of the two is it? Started at rest, and observed for 5 to 20 units of time.
/// let options = DesignOptions {
///     between: vec!["viscous_drag".to_string(), "coulomb_friction".to_string()],
///     start: vec![("p".to_string(), 0.0..=0.0)],
///     duration: Some(5.0..=20.0),
///     ..DesignOptions::default()
/// };
/// assert!(options.coefficient.is_none());
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DesignOptions {
    /// Effects to tell apart, two or more; none: those that a diagnosis cannot decide between.
    pub between: Vec<String>,
    /// The coefficient or inner parameter to measure: its name, or its term.
    pub coefficient: Option<String>,
    /// Where components of the state may start, by name.
    pub start: Vec<(String, RangeInclusive<f64>)>,
    /// What the motion may not leave, by component of the state.
    pub motion: Vec<(String, RangeInclusive<f64>)>,
    /// Time of the first sample; it matters where a force depends on time.
    pub from: Option<f64>,
    /// Time from the first to the last sample.
    pub duration: Option<RangeInclusive<f64>>,
    /// Time between samples.
    pub step: Option<RangeInclusive<f64>>,
}

/// The next run worth measuring, and why.
///
/// ```
/// use leverrier::{DesignOptions, Silent, Spec};
///
/// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
/// let (training, held_out) = spec.data()?.split(0.25, 0)?;
/// let law = spec.fit(&training)?;
/// let design = law.design(&training, &held_out, &DesignOptions::default(), &Silent)?;
/// assert!(design.samples() > 1 && design.start().iter().all(|(_, value)| value.is_finite()));
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    plan: Plan,
    why: String,
    document: Value,
}

impl Law {
    /// The run that best tells apart what a diagnosis cannot decide between, or that best measures
    /// the coefficient that is known worst; or what the options ask for.
    ///
    /// The law is that of the training part; a run is designed beside both parts.
    ///
    /// # Errors
    /// The measurements are of another spec, an effect, a coefficient or a component of the state
    /// does not exist, a range is empty ([`ErrorKind::InvalidArgument`]), or no run can be made
    /// within the bounds.
    ///
    /// ```
    /// use leverrier::{DesignOptions, Silent, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let options = DesignOptions {
    ///     coefficient: Some("cos(q)".to_string()),
    ///     start: vec![("q".to_string(), -1.0..=1.0), ("p".to_string(), 0.0..=0.0)],
    ///     ..DesignOptions::default()
    /// };
    /// let law = spec.fit(&training)?;
    /// let design = law.design(&training, &held_out, &options, &Silent)?;
    /// assert!(design.start()[0].1.abs() <= 1.0 && design.start()[1].1 == 0.0);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn design(
        &self,
        training: &Data,
        held_out: &Data,
        options: &DesignOptions,
        monitor: &dyn Monitor,
    ) -> Result<Design> {
        training.require(self.spec())?;
        held_out.require(self.spec())?;
        self.fitted("design by")?;
        let allowed = options.allowed(self.spec())?;
        let mut dataset = training.dataset().clone();
        dataset.runs.extend(held_out.dataset().runs.iter().cloned());
        let unseen = (held_out.runs() > 0).then(|| held_out.dataset());
        let measured = Measured { all: &dataset, training: training.dataset(), held_out: unseen };
        let asked =
            Asked { between: &options.between, coefficient: options.coefficient.as_deref() };
        let tuned = Options::default();
        let law = self.numbers();
        let purpose = purpose(self.spec(), law, &measured, &asked, &tuned, monitor)?;
        let Purpose { goal, rivals, why } = purpose;
        let plan =
            design::design(&rivals, &goal, &dataset, law.window(), &allowed, &tuned, monitor)?;
        let mut document = json!(plan);
        if let Some(fields) = document.as_object_mut() {
            fields.insert("why".to_string(), json!(why));
        }
        Ok(Design { plan, why, document })
    }
}

impl Design {
    /// Why this run, in a sentence.
    ///
    /// ```
    /// # use leverrier::{DesignOptions, Silent, Spec};
    /// # let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// # let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// # let law = spec.fit(&training)?;
    /// let design = law.design(&training, &held_out, &DesignOptions::default(), &Silent)?;
    /// assert!(design.why().contains("viscous_drag(q)"));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn why(&self) -> &str {
        &self.why
    }

    /// Where the run starts: coordinates, then momenta, each with its name, in the spec's units.
    ///
    /// ```
    /// # use leverrier::{DesignOptions, Silent, Spec};
    /// # let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// # let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// # let law = spec.fit(&training)?;
    /// let design = law.design(&training, &held_out, &DesignOptions::default(), &Silent)?;
    /// assert_eq!(design.start()[0].0, "q");
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn start(&self) -> Vec<(&str, f64)> {
        self.plan.best.start.iter().map(|part| (part.name.as_str(), part.value)).collect()
    }

    /// Times of its samples, in the spec's unit.
    ///
    /// ```
    /// # use leverrier::{DesignOptions, Silent, Spec};
    /// # let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// # let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// # let law = spec.fit(&training)?;
    /// let design = law.design(&training, &held_out, &DesignOptions::default(), &Silent)?;
    /// assert_eq!(design.times().len(), design.samples());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn times(&self) -> Vec<f64> {
        let best = &self.plan.best;
        (0..best.samples).map(|i| best.from + best.step * i as f64).collect()
    }

    /// How many samples it has.
    ///
    /// ```
    /// # use leverrier::{DesignOptions, Silent, Spec};
    /// # let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// # let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// # let law = spec.fit(&training)?;
    /// let design = law.design(&training, &held_out, &DesignOptions::default(), &Silent)?;
    /// assert!(design.samples() > 1);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn samples(&self) -> usize {
        self.plan.best.samples
    }

    /// All of it as JSON, with the fields of `design` in `docs/formats.md`; those of the split are
    /// not among them.
    ///
    /// ```
    /// # use leverrier::{DesignOptions, Silent, Spec};
    /// # let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// # let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// # let law = spec.fit(&training)?;
    /// let design = law.design(&training, &held_out, &DesignOptions::default(), &Silent)?;
    /// assert!(design.to_json().contains("\"alternatives\""));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn to_json(&self) -> String {
        json_text(&self.document)
    }
}

fn invalid(message: impl Into<String>, hint: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidArgument, message, hint)
}

impl DesignOptions {
    fn allowed(&self, spec: &Spec) -> Result<Allowed> {
        let names = state_names(spec.system());
        let bounds = |parts: &[(String, RangeInclusive<f64>)]| -> Result<Vec<Option<Interval>>> {
            let mut out = vec![None; names.len()];
            for (name, range) in parts {
                let interval = interval(range)?;
                for at in matching(&names, name)? {
                    if let Some(bound) = out.get_mut(at) {
                        *bound = Some(interval);
                    }
                }
            }
            Ok(out)
        };
        let times = |range: &Option<RangeInclusive<f64>>, what: &str, count: usize| {
            let Some(range) = range else { return Ok(Vec::new()) };
            values_between(what, &interval(range)?, count)
        };
        if self.from.is_some_and(|from| !from.is_finite()) {
            return Err(invalid("the time of the first sample is not finite", "give a time"));
        }
        Ok(Allowed {
            start: bounds(&self.start)?,
            motion: bounds(&self.motion)?,
            from: self.from,
            durations: times(&self.duration, "the duration", DURATIONS)?,
            steps: times(&self.step, "the time between samples", STEPS)?,
        })
    }
}

fn interval(range: &RangeInclusive<f64>) -> Result<Interval> {
    let (lower, upper) = (*range.start(), *range.end());
    if !(lower.is_finite() && upper.is_finite() && lower <= upper) {
        return Err(invalid(
            format!("the range {lower}..{upper} is empty or not finite"),
            "give the smaller number first",
        ));
    }
    Ok(Interval { lower, upper })
}

/// Values of a range that are tried.
pub(crate) const DURATIONS: usize = 3;
/// The same of the time between samples.
pub(crate) const STEPS: usize = 3;

/// Times from the lower to the upper end in equal ratios.
///
/// # Errors
/// [`ErrorKind::InvalidArgument`] where they are not positive.
pub(crate) fn values_between(what: &str, range: &Interval, count: usize) -> Result<Vec<f64>> {
    if range.lower <= 0.0 {
        return Err(invalid(
            format!("{what} must be positive"),
            "give a time, such as 20, or a range of it, such as 5..20",
        ));
    }
    if range.lower == range.upper {
        return Ok(vec![range.lower]);
    }
    let ratio = range.upper / range.lower;
    let last = count.saturating_sub(1).max(1) as f64;
    Ok((0..count).map(|i| range.lower * ratio.powf(i as f64 / last)).collect())
}

/// What a run is asked for.
pub(crate) struct Asked<'a> {
    /// Effects to tell apart.
    pub between: &'a [String],
    /// What to measure.
    pub coefficient: Option<&'a str>,
}

/// Measurements that a run is designed beside.
pub(crate) struct Measured<'a> {
    pub all: &'a Dataset,
    pub training: &'a Dataset,
    pub held_out: Option<&'a Dataset>,
}

/// What the run is for, the models that it is designed with, and why.
pub(crate) struct Purpose {
    pub goal: Goal,
    pub rivals: Vec<Rival>,
    pub why: String,
}

/// Rivals that are compared, at most.
const RIVALS: usize = 4;

/// What to design for: what was asked for, or else what `diagnose` cannot decide.
///
/// # Errors
/// An effect does not exist, stands in the spec, is named twice, or has nothing to be told from.
pub(crate) fn purpose(
    spec: &Spec,
    law: &fit::Law,
    measured: &Measured,
    asked: &Asked,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Purpose> {
    let model = LawOnData::of(law.clone(), measured.all, options);
    let with = |label: &str, statement: &str, start: &[f64]| {
        Rival::with_effect(&model, spec.compiled(), label, statement, start)
    };
    if asked.between.len() == 1 {
        return Err(invalid(
            "one effect has no alternative to be distinguished from",
            "name two or more to tell apart",
        ));
    }
    if !asked.between.is_empty() {
        let mut rivals: Vec<Rival> = Vec::new();
        for text in asked.between {
            let mut named = NamedEffect::new(text, spec.text(), spec.system())?;
            if named.place(spec.text()).is_some() {
                return Err(invalid(
                    format!("{} has `{}` already", spec.name(), named.label),
                    "take it out first: rivals are judged by adding them",
                ));
            }
            if rivals.iter().any(|rival| rival.label == named.label) {
                return Err(invalid(
                    format!("`{}` is named twice", named.label),
                    "name different effects",
                ));
            }
            named.scanned(spec.compiled(), model.clone())?;
            rivals.push(with(&named.label, &named.statement, &[])?);
        }
        let why = format!("The run that best distinguishes {}, as asked for.", listed(&rivals));
        return Ok(Purpose { goal: Goal::Rivals, rivals, why });
    }
    if let Some(name) = asked.coefficient {
        let rivals = vec![Rival::as_it_is(law, "the model")];
        let why = format!("The run that best measures {name}, as asked for.");
        return Ok(Purpose { goal: Goal::Coefficient(Some(name.to_string())), rivals, why });
    }
    let worst = Goal::Coefficient(None);
    let measures = "so the run is the one that best measures the least known coefficient.";
    let as_it_is = || vec![Rival::as_it_is(law, "the model")];
    let Some(held_out) = measured.held_out else {
        let why = format!("There are too few measurements to say what is missing, {measures}");
        return Ok(Purpose { goal: worst, rivals: as_it_is(), why });
    };
    let training = measured.training;
    let base = spec.compiled();
    let found = diagnosis::diagnose(base, law, training, held_out, options, monitor)?;
    let tied = |leader: &&RankedEffect| found.indistinguishable.contains(&leader.effect);
    let first = found.ranking.first();
    let mut rivals: Vec<Rival> = Vec::new();
    // A number of the spec is no statement that a rival could have.
    let effects = first.into_iter().chain(found.ranking.iter().skip(1).filter(tied));
    for leader in effects.filter(|leader| leader.number.is_none()).take(RIVALS) {
        rivals.push(with(&leader.effect, &leader.snippet, &leader.coefficient)?);
    }
    let close = 1 + found.ranking.iter().skip(1).filter(tied).count();
    let more = close.saturating_sub(rivals.len());
    let alone = rivals.len() == 1;
    let among = listed(&rivals);
    if rivals.len() > 1 {
        // The diagnosis held some runs out; all of them together may have the answer.
        let (data, window) = (measured.all, law.window());
        let standings = design::standings(&rivals, data, window, options)?;
        let close = options.tuning.ranking.indistinguishable;
        let mut excess = standings.iter().map(|standing| standing.excess_deviance);
        rivals.retain(|_| excess.next().is_some_and(|excess| excess <= close));
    }
    Ok(match (rivals.as_slice(), found.verdict) {
        ([_, _, ..], _) => {
            let more = match more {
                0 => String::new(),
                1 => " (one more comes close, and is left out)".to_string(),
                _ => format!(" ({more} more come close, and are left out)"),
            };
            let why = format!("These data cannot distinguish {}{more}.", listed(&rivals));
            Purpose { goal: Goal::Rivals, rivals, why }
        }
        ([Rival { label, .. }], _) => {
            let missing = if alone {
                format!("{label} is missing, and no other effect comes close: add it.")
            } else {
                format!(
                    "The training part alone cannot distinguish {among}, but all measurements together can: {label} is missing: add it."
                )
            };
            let why = format!(
                "{missing} The run is the one that best measures the least known coefficient of the model with it."
            );
            Purpose { goal: worst, rivals, why }
        }
        (_, Verdict::ExplainedInPart) => {
            let why = format!("Only a part of what is missing is explained, {measures}");
            Purpose { goal: worst, rivals: as_it_is(), why }
        }
        (_, Verdict::Unexplained) => {
            let why = format!("What is missing is not in the catalogue, {measures}");
            Purpose { goal: worst, rivals: as_it_is(), why }
        }
        _ => {
            let why = format!("Nothing is missing, {measures}");
            Purpose { goal: worst, rivals: as_it_is(), why }
        }
    })
}

/// `a, b and c`.
fn listed(rivals: &[Rival]) -> String {
    let labels: Vec<&str> = rivals.iter().map(|rival| rival.label.as_str()).collect();
    match labels.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => labels.concat(),
    }
}
