//! The loop: diagnose, add what is missing, fit again.

use serde_json::{Value, json};

use super::json::json_text;
use super::{Data, DiscoveryOptions, Effect, Law, Spec, Verdict};
use crate::diagnose::discover::{Discovery as Found, Step, discover};
use crate::diagnose::sufficiency;
use crate::error::{Error, ErrorKind, Result};
use crate::fit::Monitor;

/// What was added to a spec, one effect after the other, until what is left is noise.
///
/// ```
/// use leverrier::{DiscoveryOptions, Silent, Spec};
///
/// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
/// let (training, held_out) = spec.data()?.split(0.25, 0)?;
/// let found = spec.discover(&training, &held_out, &DiscoveryOptions::default(), &Silent)?;
/// assert_eq!(found.steps()[0].effect, "viscous_drag(q)");
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Discovery {
    steps: Vec<Effect>,
    stop: String,
    verdict: Verdict,
    law: Law,
    document: Value,
}

impl Spec {
    /// Fits, asks what is missing, adds it and fits again, until no effect lowers the error on the
    /// held-out measurements. The spec itself stays as it is: the law that comes of it has the
    /// longer text.
    ///
    /// # Errors
    /// The measurements are of another spec ([`ErrorKind::InvalidArgument`]), are too few to judge
    /// an effect by ([`ErrorKind::InsufficientData`]), or cannot be fitted.
    ///
    /// ```
    /// use leverrier::{DiscoveryOptions, Silent, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let options = DiscoveryOptions::default();
    /// let found = spec.discover(&training, &held_out, &options, &Silent)?;
    /// assert!(found.law().spec().text().contains("effect viscous_drag(q)"));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn discover(
        &self,
        training: &Data,
        held_out: &Data,
        options: &DiscoveryOptions,
        monitor: &dyn Monitor,
    ) -> Result<Discovery> {
        training.require(self)?;
        held_out.require(self)?;
        let unseen = (held_out.runs() > 0).then(|| held_out.dataset());
        let mut options = options.tuned();
        let (system, diagnosis) = (self.system(), &options.diagnosis);
        if let Some(reason) = sufficiency::lacking(system, training.dataset(), unseen, diagnosis) {
            let hint = "measure more, or hold out another share of the samples";
            return Err(Error::new(ErrorKind::InsufficientData, reason, hint));
        }
        if options.fit.parameter_starts.is_empty() {
            options.fit.parameter_starts.clone_from(&self.compiled().starts);
        }
        let (seen, unseen) = (training.dataset(), held_out.dataset());
        let found = discover(self.name(), self.text(), seen, unseen, &options, monitor)?;
        let document = json!(found);
        let Found { steps, stop, verdict, text, model, .. } = found;
        Ok(Discovery {
            steps: steps.into_iter().map(effect).collect(),
            stop,
            verdict: Verdict::of(verdict),
            law: Law::learned(&self.edited(text)?, model, training)?,
            document,
        })
    }
}

fn effect(step: Step) -> Effect {
    Effect {
        effect: step.effect,
        statement: step.snippet,
        coefficients: step.coefficient,
        standard_errors: step.standard_error,
        p_value: step.p_value,
        held_out_error_before: step.held_out_error_before,
        held_out_error_after: step.held_out_error_after,
    }
}

impl Discovery {
    /// What was added, in order.
    ///
    /// ```
    /// use leverrier::{DiscoveryOptions, Silent, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let options = DiscoveryOptions::default();
    /// let found = spec.discover(&training, &held_out, &options, &Silent)?;
    /// assert_eq!(found.steps().len(), 1);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn steps(&self) -> &[Effect] {
        &self.steps
    }

    /// Why it ended, in a sentence.
    ///
    /// ```
    /// use leverrier::{DiscoveryOptions, Silent, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let options = DiscoveryOptions::default();
    /// let found = spec.discover(&training, &held_out, &options, &Silent)?;
    /// assert!(!found.stop().is_empty());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn stop(&self) -> &str {
        &self.stop
    }

    /// The answer of the last diagnosis.
    ///
    /// ```
    /// use leverrier::{DiscoveryOptions, Silent, Spec, Verdict};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let options = DiscoveryOptions::default();
    /// let found = spec.discover(&training, &held_out, &options, &Silent)?;
    /// assert_eq!(found.verdict(), Verdict::NothingMissing);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn verdict(&self) -> Verdict {
        self.verdict
    }

    /// The law with all that was added, learned from the training measurements.
    ///
    /// ```
    /// use leverrier::{DiscoveryOptions, Silent, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let options = DiscoveryOptions::default();
    /// let found = spec.discover(&training, &held_out, &options, &Silent)?;
    /// assert_eq!(found.law().terms().len(), 2);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn law(&self) -> &Law {
        &self.law
    }

    /// All of it as JSON, with the fields of `discover` in `docs/formats.md`; those of the split
    /// are not among them.
    ///
    /// ```
    /// use leverrier::{DiscoveryOptions, Silent, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let options = DiscoveryOptions::default();
    /// let found = spec.discover(&training, &held_out, &options, &Silent)?;
    /// assert!(found.to_json().contains("\"held_out_error\""));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn to_json(&self) -> String {
        json_text(&self.document)
    }
}
