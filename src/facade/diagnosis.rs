//! What a law misses.

use serde_json::{Value, json};

use super::json::json_text;
use crate::diagnose::diagnosis;
use crate::diagnose::instrument::Detection;

/// What a law misses: a verdict, and the effects of the catalogue that were fitted with it, the
/// best first.
///
/// ```
/// use leverrier::{Spec, Verdict};
///
/// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
/// let (training, held_out) = spec.data()?.split(0.25, 0)?;
/// let law = spec.fit(&training)?;
/// let diagnosis = law.diagnose(&training, &held_out)?;
/// assert_eq!(diagnosis.verdict(), Verdict::Missing);
/// assert_eq!(diagnosis.missing(), Some("viscous_drag(q)"));
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnosis {
    verdict: Verdict,
    reason: String,
    effects: Vec<Effect>,
    story: Vec<Effect>,
    partial: Vec<Effect>,
    indistinguishable: Vec<String>,
    document: Value,
    /// All of it, for figures.
    found: diagnosis::Diagnosis,
}

/// The answer in a word.
///
/// ```
/// use leverrier::Verdict;
///
/// fn act_on(verdict: Verdict) -> &'static str {
///     match verdict {
///         Verdict::Missing => "add the effect and fit again",
///         Verdict::ExplainedInPart => "add what is clear, and look at what is left",
///         Verdict::NothingMissing => "done",
///         Verdict::Unexplained => "look at the residual force",
///         _ => "measure more",
///     }
/// }
/// assert_eq!(act_on(Verdict::NothingMissing), "done");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Verdict {
    /// A named effect explains what the law misses.
    Missing,
    /// Named effects explain a part of what the law misses, and are clear beside what is left.
    ExplainedInPart,
    /// What is left is noise.
    NothingMissing,
    /// Something is missing that the catalogue does not have.
    Unexplained,
    /// The data do not suffice to say.
    InsufficientData,
    /// The monitor stopped it before everything was looked at.
    Interrupted,
}

/// An effect that was fitted together with the law.
///
/// ```
/// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
/// let (training, held_out) = spec.data()?.split(0.25, 0)?;
/// let diagnosis = spec.fit(&training)?.diagnose(&training, &held_out)?;
/// let drag = &diagnosis.effects()[0];
/// assert_eq!(drag.effect, "viscous_drag(q)");
/// assert!(drag.p_value < 1e-6 && drag.held_out_error_after < drag.held_out_error_before);
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Effect {
    /// Its name and what it acts on, as [`Law::with`](crate::Law::with) takes them.
    pub effect: String,
    /// The statement that adds it to a spec.
    pub statement: String,
    /// Coefficient of each of its terms, then its inner parameters.
    pub coefficients: Vec<f64>,
    /// Standard errors, in the order of `coefficients`.
    pub standard_errors: Vec<f64>,
    /// Probability that noise makes the least clear coefficient as clear (Wald's test), corrected
    /// for all candidates that were tested (look-elsewhere correction).
    pub p_value: f64,
    /// Error on the held-out runs without it, in units of the noise.
    pub held_out_error_before: f64,
    /// The same with it.
    pub held_out_error_after: f64,
}

impl Verdict {
    pub(super) fn of(verdict: diagnosis::Verdict) -> Verdict {
        match verdict {
            diagnosis::Verdict::Missing => Verdict::Missing,
            diagnosis::Verdict::ExplainedInPart => Verdict::ExplainedInPart,
            diagnosis::Verdict::NothingMissing => Verdict::NothingMissing,
            diagnosis::Verdict::Unexplained => Verdict::Unexplained,
            diagnosis::Verdict::TooLittleData => Verdict::InsufficientData,
            diagnosis::Verdict::Interrupted => Verdict::Interrupted,
        }
    }
}

impl Diagnosis {
    /// All of it as JSON, with the fields of `diagnose` in `docs/formats.md`; those of the split
    /// are not among them.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let diagnosis = spec.fit(&training)?.diagnose(&training, &held_out)?;
    /// assert!(diagnosis.to_json().contains("\"ranking\""));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn to_json(&self) -> String {
        json_text(&self.document)
    }

    /// A diagnosis, with the faults of the instrument that were found beside it.
    pub(super) fn of(found: diagnosis::Diagnosis, detections: &[Detection]) -> Diagnosis {
        let mut document = json!(found);
        if let Some(fields) = document.as_object_mut() {
            fields.insert("detections".to_string(), json!(detections));
        }
        let effect = |leader: diagnosis::RankedEffect| Effect {
            effect: leader.effect,
            statement: leader.snippet,
            coefficients: leader.coefficient,
            standard_errors: leader.standard_error,
            p_value: leader.p_value,
            held_out_error_before: leader.held_out_error_before,
            held_out_error_after: leader.held_out_error_after,
        };
        Diagnosis {
            document,
            found: found.clone(),
            verdict: Verdict::of(found.verdict),
            reason: found.reason,
            story: found.story.into_iter().map(effect).collect(),
            partial: found.partial.into_iter().map(effect).collect(),
            effects: found.ranking.into_iter().map(effect).collect(),
            indistinguishable: found.indistinguishable,
        }
    }

    /// All of it, as it was found.
    #[cfg(feature = "figures")]
    pub(crate) fn found(&self) -> &diagnosis::Diagnosis {
        &self.found
    }

    /// The changes that together explain the measurements over whole runs, seen and held out, their
    /// numbers fitted together; none unless something is missing and was found. One without a name
    /// is a formula.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let diagnosis = spec.fit(&training)?.diagnose(&training, &held_out)?;
    /// assert_eq!(diagnosis.story().len(), 1);
    /// assert_eq!(diagnosis.story()[0].effect, "viscous_drag(q)");
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn story(&self) -> &[Effect] {
        &self.story
    }

    /// Where no explanation reaches the noise: the changes that are clear all the same, their
    /// numbers fitted together, with errors that count what they leave. None unless the verdict is
    /// [`Verdict::ExplainedInPart`].
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let diagnosis = spec.fit(&training)?.diagnose(&training, &held_out)?;
    /// assert!(diagnosis.partial().is_empty());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn partial(&self) -> &[Effect] {
        &self.partial
    }

    /// The answer in a word.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let diagnosis = spec.fit(&training)?.diagnose(&training, &held_out)?;
    /// assert_eq!(diagnosis.verdict(), leverrier::Verdict::Missing);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn verdict(&self) -> Verdict {
        self.verdict
    }

    /// Why, in a sentence.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let diagnosis = spec.fit(&training)?.diagnose(&training, &held_out)?;
    /// assert!(diagnosis.reason().contains("viscous_drag(q)"));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn reason(&self) -> &str {
        &self.reason
    }

    /// The effect that is missing, as [`Law::with`](crate::Law::with) takes it; `None` unless the
    /// verdict is [`Verdict::Missing`].
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let law = spec.fit(&training)?;
    /// if let Some(effect) = law.diagnose(&training, &held_out)?.missing() {
    ///     let damped = law.with(effect)?.fit(&training)?;
    ///     assert_eq!(damped.terms().len(), 2);
    /// }
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn missing(&self) -> Option<&str> {
        let first = self.effects.first().filter(|_| self.verdict == Verdict::Missing)?;
        Some(&first.effect)
    }

    /// Effects that were fitted together with the law, the best first.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let diagnosis = spec.fit(&training)?.diagnose(&training, &held_out)?;
    /// assert!(diagnosis.effects().len() > 1);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn effects(&self) -> &[Effect] {
        &self.effects
    }

    /// What these data cannot distinguish from the first effect, or from an explanation of
    /// several, the members of each joined by `and`; empty when it stands alone.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let diagnosis = spec.fit(&training)?.diagnose(&training, &held_out)?;
    /// assert!(diagnosis.indistinguishable().is_empty());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn indistinguishable(&self) -> &[String] {
        &self.indistinguishable
    }
}
