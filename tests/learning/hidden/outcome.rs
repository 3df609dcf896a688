//! What became of one hidden effect: whether it was named, and what adding it did.

use leverrier::internals::diagnose::comparison::error;
use leverrier::internals::diagnose::diagnosis::{Diagnosis, RankedEffect, Verdict, diagnose};
use leverrier::internals::diagnose::{self, LawOnData};
use leverrier::internals::expr::build;
use leverrier::internals::fit::{Model, Options, Silent, fit};

use super::Case;

/// How well an effect was named.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Place {
    /// It stands first.
    First,
    /// It is in the group that the data cannot tell apart, of at most three.
    Group,
    /// It is in a larger group.
    Crowd,
    /// It is among the leaders, but said to be worse.
    Behind,
    /// It is not there.
    Absent,
}

impl Place {
    /// First, or in a group of at most three.
    pub(crate) fn is_named(self) -> bool {
        matches!(self, Place::First | Place::Group)
    }
}

/// What became of one hidden effect.
#[derive(Debug, Clone)]
pub(crate) struct Outcome {
    /// The verdict.
    pub verdict: Verdict,
    /// Where the hidden effect stands in the ranking.
    pub place: Place,
    /// The first effect of the ranking.
    pub first: Option<String>,
    /// Those that are said to explain as much as the first.
    pub group: Vec<String>,
    /// Error on held-out runs with the first effect added, in units of the true noise; without
    /// noise in units of what the fit takes for noise.
    pub after: Option<f64>,
    /// Seconds of the diagnosis.
    pub seconds: f64,
    /// The whole diagnosis.
    pub diagnosis: Diagnosis,
    /// The model that was diagnosed.
    pub model: Model,
}

impl Case {
    /// What is missing from a model of the case.
    pub(crate) fn diagnosis(&self, model: &Model) -> Diagnosis {
        let law = model.law(&self.compiled.system).expect("the case's own");
        let options = diagnose::Options::default();
        let (training, held_out) = (&self.training, &self.held_out);
        diagnose(&self.compiled, &law, training, held_out, &options, &Silent)
            .unwrap_or_else(|error| panic!("{error}"))
    }
}

/// Diagnoses a case in which `hidden` (a label such as `viscous_drag(q)`) is missing.
pub(crate) fn outcome(case: &Case, hidden: &str) -> Outcome {
    let model = case.fit();
    let clock = std::time::Instant::now();
    let diagnosis = case.diagnosis(&model);
    let seconds = clock.elapsed().as_secs_f64();
    let names: Vec<&str> = diagnosis.ranking.iter().map(|l| l.effect.as_str()).collect();
    let mut group = diagnosis.indistinguishable.clone();
    if let Some(first) = names.first()
        && !group.iter().any(|name| name == first)
    {
        group.insert(0, first.to_string());
    }
    let place = match names.iter().position(|name| *name == hidden) {
        Some(0) => Place::First,
        Some(_) if group.iter().any(|name| name == hidden) && group.len() <= 3 => Place::Group,
        Some(_) if group.iter().any(|name| name == hidden) => Place::Crowd,
        Some(_) => Place::Behind,
        None => Place::Absent,
    };
    let first = names.first().map(|name| name.to_string());
    let after = diagnosis.ranking.first().map(|leader| added(case, leader));
    Outcome { verdict: diagnosis.verdict, place, first, group, after, seconds, diagnosis, model }
}

/// Error on held-out runs, over segments of the model's own window, once an effect is added and
/// everything is fitted again.
pub(crate) fn added(case: &Case, effect: &RankedEffect) -> f64 {
    let text = effect.written_into(&case.text);
    let compiled = build("learned", &text).unwrap_or_else(|error| panic!("{text}\n{error}"));
    // The case has no columns for a part with states of its own.
    if compiled.system.degrees() > case.compiled.system.degrees() {
        return effect.held_out_error_after;
    }
    let Ok(model) = fit(&compiled.system, &case.training, &Options::default(), &Silent) else {
        return f64::INFINITY;
    };
    let Some(mut law) = model.law(&compiled.system) else { return f64::INFINITY };
    if case.noise.iter().all(|noise| *noise > 0.0) {
        law = law.with_noise(case.noise.clone());
    }
    let window = law.window();
    let options = diagnose::Options::default();
    error(&LawOnData::of(law, &case.held_out, &options), window).0
}
