//! What the fields of a model file may hold, and of others of the kind: they are files like others,
//! and may come from anybody.
//!
//! Whatever is read is written on by exporters, reports and terminals. These escape text for where
//! it stands; here is said what was never written by a fit.

use super::origin::{FileDigest, Origin, is_visible};
use crate::fit::Model;

/// Longest name, in bytes: what file systems take.
const LONGEST_NAME: usize = 255;
/// Longest sentence or term, in bytes.
const LONGEST_LINE: usize = 100_000;

/// What is wrong with a model file, in words that go on from "the file is damaged"; none where
/// every field is what its name says.
pub(crate) fn wrong_in_model(model: &Model, origin: &Origin) -> Option<String> {
    let mut problems = Problems::default();
    problems.origin("origin.spec", &origin.spec, false);
    problems.origin("origin.data", &origin.data, true);
    problems.hash("fingerprint", &model.fingerprint, false);
    problems.version(&model.version);
    problems.texts(model);
    problems.numbers(model, origin);
    problems.first
}

/// The first thing that is wrong.
#[derive(Default)]
pub(crate) struct Problems {
    pub first: Option<String>,
}

impl Problems {
    pub(crate) fn require(&mut self, holds: bool, problem: impl FnOnce() -> String) {
        if !holds && self.first.is_none() {
            self.first = Some(problem());
        }
    }

    /// One line that can be seen as it is.
    pub(crate) fn line(&mut self, field: &str, text: &str) {
        let sound = text.len() <= LONGEST_LINE && text.chars().all(is_visible);
        self.require(sound, || format!("`{field}` is not one line of text"));
    }

    /// SHA-256 in hexadecimal digits.
    fn hash(&mut self, field: &str, text: &str, may_be_empty: bool) {
        let digits = text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
        let sound = digits || (may_be_empty && text.is_empty());
        self.require(sound, || format!("`{field}` is not a SHA-256 in hexadecimal digits"));
    }

    fn origin(&mut self, field: &str, of: &FileDigest, may_be_empty: bool) {
        self.line(&format!("{field}.name"), &of.name);
        let sound = of.name.len() <= 3 * LONGEST_NAME && !of.name.contains('/');
        self.require(sound, || format!("`{field}.name` is not the name of a file"));
        self.hash(&format!("{field}.sha256"), &of.sha256, may_be_empty);
    }

    /// As in 0.1.0 or 1.0.0-rc.1.
    fn version(&mut self, text: &str) {
        let letter = |c: char| c.is_ascii_alphanumeric() || ".-+".contains(c);
        let sound = !text.is_empty() && text.len() <= LONGEST_NAME && text.chars().all(letter);
        self.require(sound, || "`version` is not a version".to_string());
    }

    fn texts(&mut self, model: &Model) {
        self.line("system", &model.system);
        for term in &model.terms {
            self.line("place", &term.place);
            self.line("term", &term.term);
            self.line("name", term.name.as_deref().unwrap_or_default());
            self.line("unit", term.unit.as_deref().unwrap_or_default());
        }
        for parameter in &model.parameters {
            self.line("name", &parameter.name);
            self.line("unit", parameter.unit.as_deref().unwrap_or_default());
        }
        for found in &model.distributions {
            self.line("name", &found.name);
            self.line("per", &found.per);
            self.line("unit", found.unit.as_deref().unwrap_or_default());
            found.values.iter().for_each(|value| self.line("group", &value.group));
        }
        for noise in &model.noise {
            self.line("observable", &noise.observable);
        }
        self.line("integrator.method", &model.integrator.method);
        self.line("integrator.reason", &model.integrator.reason);
        self.line("evidence.selection", &model.evidence.selection);
        self.line("evidence.loss", &model.evidence.loss);
        self.line("stop.sentence", &model.stop.sentence);
        for term in model.front.iter().flat_map(|point| &point.terms) {
            self.line("front.terms", term);
        }
        let runners_up = model.runners_up.iter().flat_map(|runner| &runner.terms);
        let path = model.path.iter().flat_map(|entry| &entry.coefficients);
        for (term, _) in runners_up.chain(path) {
            self.line("terms", term);
        }
        for exchange in &model.alternatives {
            self.line("alternatives.term", &exchange.term);
            self.line("alternatives.instead", &exchange.instead);
        }
        for sentence in &model.unlearnable {
            self.line("unlearnable", sentence);
        }
    }

    fn numbers(&mut self, model: &Model, origin: &Origin) {
        let coefficients = model.terms.iter().map(|term| term.coefficient);
        let parameters = model.parameters.iter().map(|parameter| parameter.value);
        let finite = coefficients.chain(parameters).all(f64::is_finite);
        self.require(finite, || "it has a number that is not finite".to_string());
        let errors = model.terms.iter().map(|term| term.standard_error);
        let errors = errors.chain(model.parameters.iter().map(|p| p.standard_error));
        let values = || model.distributions.iter().flat_map(|found| &found.values);
        let finite = values().all(|value| value.value.is_finite());
        self.require(finite, || "a value of `distributions` is not finite".to_string());
        let errors = errors.chain(values().map(|value| value.standard_error));
        let errors = errors.chain(model.noise.iter().map(|noise| noise.standard_deviation));
        self.require({ errors }.all(|x| x >= 0.0), || {
            "a standard error or a noise is below zero".to_string()
        });
        let mut shares = model.terms.iter().filter_map(|term| term.inclusion);
        let shares = shares.all(|share| (0.0..=1.0).contains(&share));
        self.require(shares, || "an `inclusion` is not between 0 and 1".to_string());
        let step = model.integrator.longest_step;
        self.require(step.is_finite() && step > 0.0, || {
            "`integrator.longest_step` is not above zero".to_string()
        });
        let size = model.terms.len() + model.parameters.len();
        let square =
            model.covariance.len() == size && model.covariance.iter().all(|row| row.len() == size);
        self.require(square, || format!("`covariance` has not {size} rows of {size} numbers"));
        let ranges = origin.ranges.iter().all(|range| *range >= 0.0);
        self.require(ranges, || "a number of `origin.ranges` is below zero".to_string());
        let start = origin.start.iter().flat_map(|(time, state)| state.iter().chain([time]));
        self.require({ start }.all(|x| x.is_finite()), || {
            "`origin.start` has a number that is not finite".to_string()
        });
    }
}
