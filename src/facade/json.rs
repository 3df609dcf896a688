//! Results as JSON, with the fields that `docs/formats.md` lists.

use std::path::Path;

use serde::Serialize;

use super::{Law, Spec, model_file};
use crate::error::Result;

/// The text of what has no keys but text and no numbers but finite ones or null.
pub(super) fn json_text(of: &impl Serialize) -> String {
    serde_json::to_string(of).unwrap_or_else(|_| "null".to_string())
}

impl Law {
    /// The model file's text: all that a fit has found, to be kept or sent.
    ///
    /// # Errors
    /// The law was not fitted ([`ErrorKind::NothingToDo`](crate::ErrorKind::NothingToDo)).
    ///
    /// ```
    /// use leverrier::{Law, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let law = spec.fit(&spec.data()?)?;
    /// let again = Law::from_model_json(&law.model_json()?, &spec)?;
    /// assert_eq!(again.terms(), law.terms());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn model_json(&self) -> Result<String> {
        Ok(json_text(self.fitted("save")?))
    }

    /// The law of a model file's text, which must have been fitted to this spec.
    ///
    /// # Errors
    /// The text is damaged or of another spec ([`ErrorKind::Model`](crate::ErrorKind::Model)).
    ///
    /// ```
    /// use leverrier::{ErrorKind, Law, Spec};
    ///
    /// let spec = Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2 }")?;
    /// let error = Law::from_model_json("{}", &spec).unwrap_err();
    /// assert_eq!(error.kind(), ErrorKind::Model);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn from_model_json(text: &str, spec: &Spec) -> Result<Law> {
        let path = Path::new("the model");
        let (numbers, file) =
            model_file::parse(path, text.as_bytes(), spec.name(), spec.system(), FIT_AGAIN)?;
        Ok(Law::of(spec, numbers, Some(file)))
    }

    /// The printed form of the law as JSON, with the fields of `hamiltonian` in
    /// `docs/formats.md`.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let law = spec.fit(&spec.data()?)?;
    /// assert!(law.hamiltonian_json().contains("\"snapped\""));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    #[cfg(feature = "export")]
    pub fn hamiltonian_json(&self) -> String {
        let simplified = crate::export::simplified(self.numbers(), self.ranges());
        let style = crate::simplify::Style::default();
        json_text(&crate::export::equations_json(&simplified, style))
    }
}

/// What to do about a model that cannot be read.
const FIT_AGAIN: &str = "fit the spec again";
