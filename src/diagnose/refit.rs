//! A candidate refitted with everything that the model has: all unknowns together, from where
//! its score likes it best.

use std::sync::Arc;

use nalgebra::DVector;

use super::candidates::{Candidate, InnerRange, NumberChange, Origin};
use super::clearness::Clearness;
use super::effect::RankedEffect;
use super::law_on_data::LawOnData;
use super::misfit::excess;
use super::scan::Scored;
use super::settling::{Parts, Settled, settle, settle_from};
use super::tuning::Ranking;
use crate::error::Result;
use crate::expr::{System, TermId};
use crate::fit::Law;
use crate::fit::factor::Factor;
use crate::fit::gauss_newton::LeastGain;
use crate::fit::own_values::{covariance_of_shared, is_said};
use crate::fit::pass::Sums;
use crate::fit::refit::{Integrator, Refitted, Refitting, refitted};
use crate::fit::segments::cut;
use crate::fit::states::States;

/// A model with one more effect, fitted.
pub struct Refit {
    /// The effect with its numbers; what it does to errors is not known yet.
    pub effect: RankedEffect,
    /// The model with the effect: a law of the system with the candidate.
    pub law: Law,
    /// Whether the candidate has a name: an effect of the catalogue, or of the spec.
    pub named: bool,
    /// Whether its name says that no coefficient is negative.
    pub positive: bool,
    /// The candidate's terms in it.
    pub terms: Vec<TermId>,
    /// Fall of the weighted squares on the segments that it was fitted to.
    pub fall: f64,
    /// What is left of them for each independent residual.
    pub variance: f64,
    /// What is left of those segments.
    left: Sums,
    /// Samples of such a segment, and how many there were; `None` where they were not weighed by
    /// the noise alone, or where the fit gained nothing.
    segments: Option<(usize, usize)>,
    /// What the choice among the grid's points costs, as in the trainer's criterion.
    pub choice: f64,
    /// What it costs to say which of its kind the candidate is, in nats.
    pub candidate_choice: f64,
    /// Whether it was fitted to all the data.
    pub whole: bool,
    /// Whether a rate, an exponent or the like ran into the end of what is looked through: the
    /// effect then stands in for a simpler one (a decay that takes for ever is a constant).
    pub at_bound: bool,
    /// How far its inner numbers may go.
    pub ranges: Vec<InnerRange>,
}

/// Where a refit starts.
pub struct Start {
    /// The model's terms and the candidate's.
    law: Law,
    /// What its p-value is corrected for.
    tests: f64,
    /// Whether its numbers were fitted, so that it follows the data better than the model does.
    fitted: bool,
}

impl Start {
    /// The model's own values, and a candidate where its score likes it best.
    ///
    /// # Errors
    ///
    /// The candidate's terms are not of its own system.
    pub fn scored(model: &LawOnData, candidate: &Candidate, scored: &Scored) -> Result<Start> {
        let tuning = &model.tuning().ranking;
        let system = Arc::new(bounded(candidate, model.system(), &scored.values, tuning));
        // Parameters of the spec's own candidates stand in the spec before they are used.
        let own = candidate.parameters.iter();
        let own = own.filter_map(|&id| Some((id, system.parameter(id)?.start)));
        let mut law = model.law.on(&system).with_parameters(own);
        let change = scored.score.coefficients.first().copied().unwrap_or(0.0);
        if let Some(value) = candidate.start_of_number(change) {
            law = law.with_parameters(candidate.parameters.iter().map(|&id| (id, value)));
        }
        for (&id, &value) in candidate.terms.iter().zip(&scored.score.coefficients) {
            law = law.with_term(id, value)?;
        }
        Ok(Start { law, tests: scored.tests, fitted: false })
    }

    /// These numbers, where the candidate stands for an effect.
    pub fn at(law: Law, effect: &RankedEffect) -> Start {
        Start { law, tests: effect.tests, fitted: false }
    }

    /// A refit once more, from other numbers where there are some.
    pub fn again(refit: &Refit, law: Option<Law>) -> Start {
        Start::at(law.unwrap_or_else(|| refit.law.clone()), &refit.effect)
    }
}

impl From<Refit> for Start {
    fn from(refit: Refit) -> Start {
        Start { fitted: true, ..Start::at(refit.law, &refit.effect) }
    }
}

/// How far Gauss-Newton goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// Another fit follows.
    Rough,
    /// For the ranking: what is left to gain makes no difference there. What contains a simpler
    /// effect has a number that is worth nothing near it, and would go on along that for long.
    Ranking,
    /// To the end.
    Full,
}

/// The model with a candidate in it, refitted to a part of the data where there are many, else to
/// all of them. `None` where the candidate cannot be fitted.
pub fn refit(data: &Parts, candidate: &Candidate, start: Start) -> Option<Refit> {
    match &data.part {
        Some(part) => with_candidate(part, candidate, start, Precision::Rough),
        None => refit_whole(&data.all, candidate, start, Precision::Full),
    }
}

/// The same, to all of the data.
pub fn refit_whole(
    settled: &Settled,
    candidate: &Candidate,
    start: Start,
    precision: Precision,
) -> Option<Refit> {
    let refit = with_candidate(settled, candidate, start, precision)?;
    Some(Refit { whole: true, ..refit })
}

impl Refit {
    /// The model with the effect on the data of another, as the start of further questions.
    pub fn on<'a>(&self, like: &LawOnData<'a>) -> LawOnData<'a> {
        on(&self.law, like)
    }

    /// Whether a coefficient contradicts the candidate's name: a drag that feeds energy is none.
    pub fn contradicts_name(&self) -> bool {
        self.positive && has_negative(&self.law, &self.terms)
    }

    /// What it leaves of data that it may have been fitted to.
    pub fn left_of(&self, settled: &Settled) -> Sums {
        let count = settled.segments.list.len();
        match self.left_by_fit(settled.model.law.window(), count) {
            Some(sums) => sums.clone(),
            None => self.left_of_other(settled),
        }
    }

    /// What it leaves of all segments of its window; `model` is the model with the effect.
    ///
    /// Where a force jumps, as dry friction and contacts do, states move on slowly, and some end
    /// beside their best place. What they leave would be taken for something that is missing: they
    /// are looked for once more from what was measured.
    pub fn left_of_all(&self, model: &LawOnData) -> Sums {
        let segments = &model.options.fit.segments;
        let count = cut(&model.data.packed, model.law.reach(), segments).list.len();
        let by_fit = self.left_by_fit(model.law.window(), count);
        if let Some(sums) = by_fit.filter(|sums| sums.unsettled == 0) {
            return sums.clone();
        }
        let afresh = settle(model.clone()).sums;
        let lower = |sums: &&Sums| sums.loss <= afresh.loss && sums.diverged <= afresh.diverged;
        by_fit.filter(lower).cloned().unwrap_or(afresh)
    }

    /// What its fit left, if that was a fit to `count` segments of a length.
    fn left_by_fit(&self, window: usize, count: usize) -> Option<&Sums> {
        (self.segments == Some((window, count))).then_some(&self.left)
    }

    /// What it leaves of data that it was not fitted to. The states of the model without it are a
    /// near start; but a model that loses the motion leads some of them astray, and where more than
    /// noise is left from there, they are looked for once more from what was measured.
    pub fn left_of_other(&self, settled: &Settled) -> Sums {
        let model = self.on(&settled.model);
        let mut states = settled.states.clone();
        let near = settle_from(&model, &settled.segments, &mut states);
        if gained(&near, settled) && excess(&near, &model) == 0.0 {
            return near;
        }
        let afresh = settle(model).sums;
        let lower = near.loss < afresh.loss && near.diverged <= afresh.diverged;
        if lower { near } else { afresh }
    }
}

/// Whether a law has a term of these with a negative coefficient.
pub fn has_negative(law: &Law, terms: &[TermId]) -> bool {
    terms.iter().any(|&id| law.coefficient(id).is_some_and(|value| value < 0.0))
}

/// A law on the data of another, weighed and cut as they are there.
fn on<'a>(law: &Law, like: &LawOnData<'a>) -> LawOnData<'a> {
    let (noise, window) = (like.law.noise().to_vec(), like.law.window());
    like.with_law(law.clone().with_noise(noise).with_window(window))
}

/// Whether less is left than the model without the effect leaves, and no more segments are lost.
fn gained(sums: &Sums, settled: &Settled) -> bool {
    sums.loss < settled.sums.loss && sums.diverged <= settled.sums.diverged
}

/// A law whose numbers were fitted together.
pub struct Fitted {
    /// With the covariance of its numbers.
    pub law: Law,
    /// What is left of the segments that it was fitted to.
    pub sums: Sums,
    /// Whether the noise is not below what the integrator resolves.
    pub resolved: bool,
    /// The columns of all numbers in units of the noise, initial states eliminated: those of the
    /// law's coefficients first.
    pub factor: Factor,
}

impl Fitted {
    /// What it costs that groups of terms do more to predictions than all together, as those do
    /// that cancel each other: twice the nats. Before the data an effect is expected to be about as
    /// large as what is missing; one that is `c` times as large takes a range of numbers `c` times
    /// as wide.
    pub fn cancellation(&self, groups: &[Vec<TermId>]) -> f64 {
        let design = self.factor.design();
        let does = |group: &Vec<TermId>| {
            let terms = self.law.terms().enumerate();
            let own = terms.filter(|(_, (id, ..))| group.contains(id));
            own.fold(DVector::zeros(design.nrows()), |sum, (at, (_, _, coefficient))| {
                sum + design.column(at) * coefficient
            })
        };
        let each: Vec<DVector<f64>> = groups.iter().map(does).collect();
        let together: DVector<f64> = each.iter().fold(DVector::zeros(design.nrows()), |a, b| a + b);
        let least = together.norm().max(f64::MIN_POSITIVE);
        each.iter().map(|one| 2.0 * (one.norm() / least).max(1.0).ln()).sum()
    }
}

/// Fits all numbers of a law to the segments of a model, by Gauss-Newton from where they are.
/// `None` where it cannot be fitted.
pub fn fitted(settled: &Settled, law: &Law, precision: Precision) -> Option<Fitted> {
    fitted_until((settled, &settled.states), law, precision, 0.0)
}

/// The same from other states, until a step promises less than these squares, if not before.
fn fitted_until(
    (settled, states): (&Settled, &States),
    law: &Law,
    precision: Precision,
    squares: f64,
) -> Option<Fitted> {
    let Settled { model, segments, sums, .. } = settled;
    let noise = model.law.noise();
    let law = law.clone().with_noise(noise.to_vec()).with_window(model.law.window());
    let tuning = &model.options.fit;
    let part = match precision {
        Precision::Rough => tuning.refit.rough,
        Precision::Ranking => model.tuning().ranking.deviance_left / sums.rows.max(1) as f64,
        Precision::Full => tuning.refit.converged,
    };
    let least = LeastGain { part, squares };
    let left = (sums.loss / sums.rows.max(1) as f64).sqrt();
    let integrator = if model.at_steps { Integrator::Kept } else { Integrator::Chosen(left) };
    let (start, monitor) = (Some((segments, states)), model.monitor);
    let how = Refitting { start, integrator, least, tuning, monitor };
    let Refitted { law, linearised, resolution } = refitted(&law, &model.data.packed, how).ok()?;
    let (factor, sums) = (linearised.merged(), linearised.sums);
    let variance = variance_of(&sums, &model.tuning().ranking);
    let used = law.dynamics().parameters().to_vec();
    let variance = variance.min(1.0) * model.autocorrelation_time;
    let covariance = covariance_of_shared(law.system(), (law.support(), &used), &factor, variance);
    // The noise is that of the model, whatever this fit leaves.
    let law = law.with_noise(noise.to_vec()).with_window(model.law.window());
    let law = law.with_covariance_of(&used, &covariance);
    let mut known = resolution.iter().zip(noise);
    Some(Fitted { law, sums, resolved: known.all(|(least, s)| least <= s), factor })
}

/// The model with its numbers fitted again, over short segments first: numbers that were taken from
/// another model may be far off. `None` where they cannot be fitted.
pub fn fitted_from_afar<'a>(model: &LawOnData<'a>) -> Option<LawOnData<'a>> {
    let tuning = &model.options.fit;
    let (integrator, least) = (Integrator::Kept, tuning.refit.converged.into());
    let (noise, whole) = (model.law.noise(), model.law.window());
    let mut law = model.law.clone();
    for window in [model.tuning().states.first_samples.min(whole), whole] {
        let how = Refitting { start: None, integrator, least, tuning, monitor: model.monitor };
        law = refitted(&law.with_window(window), &model.data.packed, how).ok()?.law;
        // The noise is that of the model, whatever these fits leave.
        law = law.with_noise(noise.to_vec());
    }
    Some(model.with_law(law.with_window(whole)))
}

/// What is left for each independent residual.
fn variance_of(sums: &Sums, tuning: &Ranking) -> f64 {
    (sums.loss / sums.rows.max(1) as f64).max(tuning.least_variance)
}

/// The model with a candidate, fitted.
fn with_candidate(
    settled: &Settled,
    candidate: &Candidate,
    start: Start,
    precision: Precision,
) -> Option<Refit> {
    // What is nothing beside the model's own misfit is not worth a step before one story is told:
    // clean data have many digits.
    let negligible = settled.model.tuning().verdict.negligible * settled.sums.loss;
    // Where the model without the candidate loses the motion, its states lead a fit astray.
    let own = start.fitted.then(|| settle(on(&start.law, &settled.model)));
    let nearer = own.as_ref().filter(|own| own.sums.loss < settled.sums.loss);
    let states = nearer.map_or(&settled.states, |own| &own.states);
    let Fitted { law, sums, resolved, .. } =
        fitted_until((settled, states), &start.law, precision, negligible)?;
    // What a constraint says is no number of the fit.
    let free = candidate.terms.iter().filter(|id| !is_said(law.system(), **id));
    let terms = free.filter_map(|&id| law.coefficient_with_error(id));
    let inner = candidate.parameters.iter().filter_map(|&id| law.parameter_with_error(id));
    let (coefficient, standard_error): (Vec<f64>, Vec<f64>) = terms.chain(inner).unzip();
    let values = candidate.parameters.iter().filter_map(|&id| law.parameter(id));
    let values: Vec<f64> = values.collect();
    let tuning = &settled.model.tuning().ranking;
    let at_bound = is_at_bound(candidate, &values, tuning);
    let segments = (settled.model.law.window(), settled.segments.list.len());
    let effect = RankedEffect {
        effect: candidate.label.clone(),
        on: candidate.on.clone(),
        snippet: candidate.snippet(&values),
        number: candidate.number().map(NumberChange::of),
        left_out: candidate.left_out().cloned(),
        coefficient,
        standard_error,
        p_value: 1.0,
        tests: start.tests,
        deviance: 0.0,
        held_out_error_before: f64::NAN,
        held_out_error_after: f64::NAN,
        indistinguishable: Vec::new(),
    };
    let clearness = Clearness::of(&effect, &candidate.terms, law.system());
    Some(Refit {
        effect: RankedEffect { p_value: clearness.p_value(start.tests), ..effect },
        fall: settled.sums.loss - sums.loss,
        variance: variance_of(&sums, tuning),
        segments: (resolved && gained(&sums, settled)).then_some(segments),
        left: sums,
        law,
        named: !matches!(candidate.origin, Origin::Unnamed { .. }),
        positive: candidate.is_positive(),
        terms: candidate.terms.clone(),
        choice: 2.0 * (candidate.grid.len().max(1) as f64).ln(),
        candidate_choice: candidate.choice,
        whole: false,
        at_bound,
        ranges: candidate.ranges(tuning),
    })
}

/// Whether an inner parameter that gives an effect its shape is at one of its bounds: a contact
/// that all the motion is in touch with is a spring, a wall far away pulls like a weight.
fn is_at_bound(candidate: &Candidate, values: &[f64], tuning: &Ranking) -> bool {
    let ranges = candidate.ranges(tuning);
    ranges.iter().zip(values).any(|(range, &value)| range.is_at_its_end(value, tuning.at_bound))
}

/// The system with a candidate, its inner parameters at a grid point and within their ranges.
fn bounded(candidate: &Candidate, base: &System, values: &[f64], tuning: &Ranking) -> System {
    let mut system = candidate.system(base);
    let ranges = candidate.ranges(tuning);
    for ((id, &value), range) in candidate.parameters.iter().zip(values).zip(ranges) {
        let Some(parameter) = system.parameters.get_mut(id.position()) else { continue };
        parameter.bounds = parameter.bounds.within(range.bounds);
        parameter.start = parameter.bounds.clamp(value);
    }
    system
}
