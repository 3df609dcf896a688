//! A candidate refitted in full, with everything that the model has.

use std::sync::Arc;

use serde::Serialize;

use super::candidates::{Candidate, Origin};
use super::compare::error_of;
use super::context::{Context, Settled};
use super::scan::Scored;
use crate::error::Result;
use crate::expr::{Bounds, System};
use crate::fit::pass::Sums;
use crate::fit::segments::cut;
use crate::fit::train::{Extent, Training};
use crate::fit::{Law, Options, Silent};
use crate::spec::effects::ScanBy;

/// A candidate that was refitted in full.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Leader {
    /// `viscous_drag(theta)`.
    pub effect: String,
    /// Coordinates or observables that it is on.
    pub on: Vec<String>,
    /// The statement that adds it to the spec.
    pub snippet: String,
    /// Coefficient of each of its terms, then its inner parameters.
    pub coefficient: Vec<f64>,
    /// Standard errors, in the order of `coefficient`.
    pub standard_error: Vec<f64>,
    /// Chance that noise does as well, all candidates and grid points paid for.
    pub p_value: f64,
    /// Fall of the training deviance in the full refit.
    pub deviance: f64,
    /// In units of the noise.
    pub held_out_error_before: f64,
    /// The same with the effect in the model.
    pub held_out_error_after: f64,
}

/// A model with one more effect, as far as the diagnosis needs it.
pub struct Refitted {
    /// For the ranking.
    pub leader: Leader,
    /// The model with the effect: a law of the candidate's system.
    pub law: Law,
    /// Fall of the weighted squares.
    pub fall: f64,
    /// What is left of them for each independent residual.
    pub variance: f64,
    /// What it left of the segments that it was fitted to.
    left: Sums,
    /// Samples of such a segment, and how many there were; `None` where they were not weighed by
    /// the noise alone, or where the fit gained nothing.
    fitted: Option<(usize, usize)>,
    /// Fall of the weighted squares of held-out runs.
    held_out_fall: f64,
    /// What the unknowns cost, and the choice among the grid's points (as in the trainer's
    /// criterion).
    pub price: f64,
    /// The part of `price` that the choice costs.
    choice: f64,
    /// Whether it was fitted to all the data.
    finished: bool,
    /// Whether a rate, an exponent or the like ran into the end of what is looked through: the
    /// effect then stands in for a simpler one (a decay that takes for ever is a constant).
    pub pinned: bool,
}

impl Refitted {
    /// Deviance less price, when the weighted residuals have this variance.
    pub fn merit(&self, variance: f64) -> f64 {
        self.fall / variance - self.price
    }

    /// The same with what held-out runs say. They cost nothing: no number was fitted to them.
    pub fn evidence(&self, variance: f64) -> f64 {
        self.merit(variance) + self.held_out_fall / variance
    }

    /// The model with the effect, as the start of further questions.
    pub fn context<'a>(&self, like: &Context<'a>) -> Context<'a> {
        let (noise, window) = (like.law.noise().to_vec(), like.law.window());
        like.with_law(self.law.clone().with_noise(noise).with_window(window))
    }
}

/// Where a refit starts.
pub struct Start {
    /// The model's terms and the candidate's.
    law: Law,
    p_value: f64,
}

impl Start {
    /// The model's own values, and a candidate where its score likes it best.
    ///
    /// # Errors
    ///
    /// The candidate's terms are not of its own system.
    pub fn scored(context: &Context, candidate: &Candidate, scored: &Scored) -> Result<Start> {
        let system = Arc::new(bounded(candidate, context.system(), &scored.values));
        // Parameters of the spec's own candidates stand in the spec before they are used.
        let own = candidate.parameters.iter();
        let own = own.filter_map(|&id| Some((id, system.parameter(id)?.start)));
        let mut law = context.law.on(&system).with_parameters(own);
        for (&id, &value) in candidate.terms.iter().zip(&scored.score.coefficients) {
            law = law.with_term(id, value)?;
        }
        Ok(Start { law, p_value: scored.p_value })
    }
}

impl From<Refitted> for Start {
    fn from(refitted: Refitted) -> Start {
        Start { law: refitted.law, p_value: refitted.leader.p_value }
    }
}

/// The model with a candidate in it, refitted: on a part of the data where there are many;
/// [`Refitted::finish`] then takes them all. Its fall is that on what it was fitted to, until
/// [`Refitted::judge`] looks at everything.
///
/// `few` is the model before that part, where there is one. `None` where the candidate cannot be
/// fitted.
pub fn refit(
    settled: &Settled,
    few: Option<&Settled>,
    candidate: &Candidate,
    start: Start,
) -> Option<Refitted> {
    let care = if few.is_some() { Care::Rough } else { Care::Full };
    let refitted = fit(few.unwrap_or(settled), candidate, start, care)?;
    Some(Refitted { finished: few.is_none(), ..refitted })
}

impl Refitted {
    /// Fits it to all the data, from where it stands.
    pub fn finish(
        self,
        settled: &Settled,
        candidate: &Candidate,
        held_out: &Settled,
        care: Care,
    ) -> Option<Refitted> {
        if self.finished {
            return Some(self);
        }
        let mut refitted = fit(settled, candidate, self.into(), care)?;
        refitted.finished = true;
        refitted.judge(settled, held_out);
        Some(refitted)
    }

    /// What it leaves of the misfit, and of the error on held-out runs.
    pub fn judge(&mut self, settled: &Settled, held_out: &Settled) {
        let sums = self.left(settled);
        self.fall = settled.sums.loss - sums.loss;
        self.variance = (sums.loss / sums.rows.max(1) as f64).max(1e-12);
        self.price = self.price_beside(sums.rows);
        let far = self.before(held_out);
        let ((before, lost), (after, more)) = (error_of(&held_out.sums), error_of(&far));
        self.leader.held_out_error_before = before;
        let fall = (before.powi(2) - after.powi(2)) * far.freedom.iter().sum::<f64>();
        self.held_out_fall = if fall.is_finite() && more <= lost { fall } else { 0.0 };
        // Runs that it does not follow any more are no gain.
        self.leader.held_out_error_after = if more > lost { f64::INFINITY } else { after };
    }

    /// Whether it was fitted to all the data.
    pub fn is_finished(&self) -> bool {
        self.finished
    }

    /// The same, from a part of both.
    pub fn judge_by(
        &mut self,
        few: &Settled,
        few_held_out: &Settled,
        settled: &Settled,
        held_out: &Settled,
    ) {
        self.judge(few, few_held_out);
        let times =
            |all: &Settled, part: &Settled| all.sums.rows as f64 / part.sums.rows.max(1) as f64;
        self.fall *= times(settled, few);
        self.held_out_fall *= times(held_out, few_held_out);
        self.price = self.price_beside(settled.sums.rows);
        // The part has an error of its own; what the effect does to it is what counts.
        let (before, _) = error_of(&held_out.sums);
        self.leader.held_out_error_after *= before / self.leader.held_out_error_before;
        self.leader.held_out_error_before = before;
    }

    /// What its unknowns cost beside so many residuals.
    fn price_beside(&self, rows: usize) -> f64 {
        self.leader.coefficient.len() as f64 * (rows.max(1) as f64).ln() + self.choice
    }

    /// What it leaves of data that it may have been fitted to.
    pub(super) fn left(&self, settled: &Settled) -> Sums {
        let count = settled.segments.list.len();
        match self.left_by_fit(settled.context.law.window(), count) {
            Some(sums) => sums.clone(),
            None => self.before(settled),
        }
    }

    /// What it leaves of all segments of a context's window; `context` is that of the model with
    /// the effect.
    ///
    /// Where a force jumps, as dry friction and contacts do, states move on slowly, and some end
    /// beside their best place. What they leave would be taken for something that is missing: they
    /// are looked for once more from what was measured.
    pub fn left_of_all(&self, context: &Context) -> Sums {
        let count = cut(&context.measured, context.law.window()).list.len();
        let by_fit = self.left_by_fit(context.law.window(), count);
        if let Some(sums) = by_fit.filter(|sums| sums.unsettled == 0) {
            return sums.clone();
        }
        let afresh = context.settle(context.law.window()).2;
        let lower = |sums: &&Sums| sums.loss <= afresh.loss && sums.exploded <= afresh.exploded;
        by_fit.filter(lower).cloned().unwrap_or(afresh)
    }

    /// What its fit left, if that was a fit to `count` segments of a length.
    fn left_by_fit(&self, window: usize, count: usize) -> Option<&Sums> {
        (self.fitted == Some((window, count))).then_some(&self.left)
    }

    /// What it leaves before some data. The states of the model without it are a near start;
    /// where nothing is gained from there, it starts from what was measured.
    fn before(&self, settled: &Settled) -> Sums {
        let context = self.context(&settled.context);
        let mut states = settled.states.clone();
        let sums = context.settle_from(&settled.segments, &mut states);
        if gained(&sums, settled) { sums } else { context.settle(settled.context.law.window()).2 }
    }
}

/// Whether less is left than the model without the effect leaves, and no more segments are lost.
fn gained(sums: &Sums, settled: &Settled) -> bool {
    sums.loss < settled.sums.loss && sums.exploded <= settled.sums.exploded
}

/// How far Gauss-Newton goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Care {
    /// Another fit follows.
    Rough,
    /// For the ranking: what is left to gain makes no difference there. What contains a simpler
    /// effect has a number that is worth nothing near it, and would go on along that for long.
    Ranking,
    /// To the end.
    Full,
}

/// Deviance that a fit for the ranking may leave: a third of a standard error, at most.
const LEFT: f64 = 0.1;

/// Gauss-Newton on the segments of a context.
fn fit(settled: &Settled, candidate: &Candidate, start: Start, care: Care) -> Option<Refitted> {
    let context = &settled.context;
    let options = Options { window: Some(context.law.window()), ..Options::default() };
    let law = start.law.with_noise(context.law.noise().to_vec());
    let mut training = Training::from_law(&law, context.measured.clone(), &options).ok()?;
    training.segments.clone_from(&settled.segments);
    training.states.clone_from(&settled.states);
    training.choose_integrator();
    if care == Care::Rough {
        training.extent = Extent::Rough;
    }
    let mut refit = match care {
        Care::Ranking => training.refit_until(LEFT / settled.sums.rows.max(1) as f64, &Silent),
        Care::Rough | Care::Full => training.refit(&Silent),
    };
    let count = law.support().len();
    let rows = refit.sums().rows.max(1) as f64;
    let fall = settled.sums.loss - refit.sums().loss;
    let variance = (refit.sums().loss / rows).max(1e-12);
    let covariance =
        crate::fit::uncertainty::covariance(&refit.linearised.merged(), variance.min(1.0));
    let inner = refit.theta.len() - candidate.parameters.len().min(refit.theta.len() - count);
    let terms = candidate.terms.iter().filter_map(|id| law.support().binary_search(id).ok());
    let own = terms.chain(inner..refit.theta.len());
    let (coefficient, standard_error): (Vec<f64>, Vec<f64>) =
        own.map(|i| (refit.theta[i], covariance[(i, i)].sqrt())).unzip();
    training.take(&mut refit);
    let law = training.law().clone();
    let values = candidate.parameters.iter().filter_map(|&id| law.parameter(id));
    let values: Vec<f64> = values.collect();
    let noise = training.accuracy.resolution.iter().zip(context.law.noise());
    let resolved = noise.into_iter().all(|(least, s)| least <= s);
    let pinned = is_pinned(candidate, law.system(), &values);
    Some(Refitted {
        leader: Leader {
            effect: candidate.label.clone(),
            on: candidate.on.clone(),
            snippet: candidate.snippet(&values),
            coefficient,
            standard_error,
            p_value: start.p_value,
            deviance: 0.0,
            held_out_error_before: f64::NAN,
            held_out_error_after: f64::NAN,
        },
        law,
        fall,
        variance,
        left: refit.sums().clone(),
        fitted: (resolved && gained(refit.sums(), settled))
            .then_some((context.law.window(), settled.segments.list.len())),
        held_out_fall: 0.0,
        price: 0.0,
        choice: 2.0 * (candidate.grid.len().max(1) as f64).ln(),
        finished: false,
        pinned,
    })
}

/// Whether an inner parameter that gives an effect its shape is at one of its bounds: a contact
/// that all the motion is in touch with is a spring.
fn is_pinned(candidate: &Candidate, system: &System, values: &[f64]) -> bool {
    let Origin::Catalogue(row) = &candidate.origin else { return false };
    let shapes = [
        ScanBy::Rate,
        ScanBy::Exponent,
        ScanBy::Momentum,
        ScanBy::Frequency,
        ScanBy::WaveNumber,
        ScanBy::Position,
    ];
    row.parameters.iter().zip(&candidate.parameters).zip(values).any(|((scan, &id), &value)| {
        let bounds = system.parameter(id).map_or(Bounds::FREE, |parameter| parameter.bounds);
        let Bounds { lower, upper } = bounds;
        let close = 1e-6 * (upper - lower);
        shapes.contains(&scan.by) && (value - lower <= close || upper - value <= close)
    })
}

/// The system with a candidate, its inner parameters at a grid point. Outside the grid the data
/// say nothing about a parameter: it may leave the grid by half of its length, but for places
/// and instants, which are looked for where there are data, and for waves, of which the data
/// show half a length or more.
fn bounded(candidate: &Candidate, base: &System, values: &[f64]) -> System {
    let mut system = candidate.system(base);
    for (place, (id, &value)) in candidate.parameters.iter().zip(values).enumerate() {
        let Some(parameter) = system.parameters.get_mut(id.position()) else { continue };
        let axis = candidate.grid.iter().map(|values| values[place]);
        let (lower, upper) =
            axis.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        let by = match &candidate.origin {
            Origin::Catalogue(row) => row.parameters.get(place).map(|scan| scan.by),
            _ => None,
        };
        let inside = matches!(by, Some(ScanBy::Position | ScanBy::Instant | ScanBy::WaveNumber));
        let margin = if inside { 0.0 } else { 0.5 * (upper - lower) };
        let smallest = if lower > 0.0 && !inside { 0.5 * lower } else { lower - margin };
        // One start of the user's is no grid.
        if lower < upper {
            parameter.bounds.lower = parameter.bounds.lower.max(smallest);
            parameter.bounds.upper = parameter.bounds.upper.min(upper + margin);
        }
        parameter.start = parameter.bounds.clamp(value);
    }
    system
}
