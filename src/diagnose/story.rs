//! A story: changes to a model that are judged as one.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::autocorrelation::Noise;
use super::candidates::InnerRange;
use super::candidates::composed::proposed::{Proposed, ProposedSet};
use super::clearness::Clearness;
use super::effect::RankedEffect;
use super::evidence::Judged;
use super::law_on_data::{LawOnData, Measurements};
use super::misfit::excess;
use super::refit::{Precision, fitted, fitted_from_afar};
use super::settling::{Settled, settle};
use crate::error::Result;
use crate::expr::{Bounds, KnownNumber, ParameterId, Place, Scope, Term, TermId};
use crate::fit::column::Column;
use crate::fit::factor::Factor;
use crate::fit::own_values::is_said;
use crate::fit::pass::Sums;
use crate::fit::stepping::by_method_for_its_forces;
use crate::fit::{Law, Monitor};
use crate::spec::effects::label_of_second;

/// What is asked: which changes explain what a model leaves of its data.
pub struct Question<'a, 'b> {
    /// The spec of the model.
    pub scope: &'b Scope,
    /// The model on the runs that it was fitted to, residuals weighed by the noise floor.
    pub model: &'b LawOnData<'a>,
    /// Other runs.
    pub held_out: &'b Measurements<'a>,
    /// Told how far it is.
    pub monitor: &'b dyn Monitor,
}

/// One change of a story.
#[derive(Clone)]
pub(super) struct Member {
    /// What it is, with its numbers when it was found; its errors are those of the story up to it.
    pub effect: RankedEffect,
    /// Its terms in the story's system.
    pub terms: Vec<TermId>,
    /// Its inner parameters there.
    pub parameters: Vec<ParameterId>,
    /// How far these may go.
    pub ranges: Vec<InnerRange>,
    /// What its unknowns cost, and what it takes to say which candidate it is: twice the nats.
    pub price: f64,
    /// Whether it has a name: an effect of the catalogue, or of the spec.
    pub named: bool,
    /// Whether that name says that no coefficient is negative.
    pub positive: bool,
}

/// Two sums of the same squares differ by this part of them, at most.
pub(super) const SAME_SQUARES: f64 = 1e-6;

/// Terms of a member, and its inner parameters.
type Own = (Vec<TermId>, Vec<ParameterId>);

/// A scope with some effects, their inner numbers within their ranges, and what each of them has
/// there.
fn placed<'e>(
    effects: impl Iterator<Item = (&'e RankedEffect, &'e [InnerRange])>,
    scope: &Scope,
) -> Result<(Scope, Vec<Own>)> {
    let mut scope = scope.clone();
    let mut names = Vec::new();
    let mut all_ranges = Vec::new();
    for (effect, ranges) in effects {
        all_ranges.push(ranges);
        let standing = scope.compiled().system.clone();
        scope = effect.added_to(&scope)?;
        let system = &scope.compiled().system;
        // A term that the fit left out stands in the spec.
        let is_own = |(at, term): &(usize, &Term)| match &effect.left_out {
            Some(own) => own.is(term),
            None => *at >= standing.terms.len(),
        };
        let terms = system.terms.iter().enumerate().filter(is_own);
        let terms: Vec<(Place, String)> =
            terms.map(|(_, term)| (term.place, term.label.clone())).collect();
        let parameters = system.parameters.iter().skip(standing.parameters.len());
        let parameters: Vec<String> = parameters.map(|one| one.name.clone()).collect();
        names.push((terms, parameters));
    }
    // Where they stand in the end: a later effect may be lowered before an earlier one.
    let system = &scope.compiled().system;
    let own = |(terms, parameters): (Vec<(Place, String)>, Vec<String>)| {
        let is_own = |term: &Term| {
            terms.iter().any(|(place, label)| *place == term.place && *label == term.label)
        };
        let ids = system.terms_with_ids().filter(|(_, term)| is_own(term));
        let inner = system.parameter_ids().into_iter().filter(|&id| {
            system.parameter(id).is_some_and(|parameter| parameters.contains(&parameter.name))
        });
        (ids.map(|(id, _)| id).collect(), inner.collect())
    };
    let all: Vec<Own> = names.into_iter().map(own).collect();
    let bounds = all.iter().zip(all_ranges).flat_map(|((_, ids), ranges)| bounds_of(ids, ranges));
    let scope = scope.bounded(bounds);
    Ok((scope, all))
}

fn bounds_of(
    parameters: &[ParameterId],
    ranges: &[InnerRange],
) -> impl Iterator<Item = (ParameterId, Bounds)> {
    parameters.iter().copied().zip(ranges.iter().map(|range| range.bounds))
}

/// A model with changes to it, the changes and what they cost.
#[derive(Clone)]
pub(super) struct Story<'a> {
    /// The changes, in the order in which they were found.
    pub members: Vec<Member>,
    /// The spec with all of them.
    pub scope: Scope,
    /// The model with all of them before the training runs. Its window is the longest that it was
    /// held against.
    pub model: LawOnData<'a>,
    /// What it leaves of segments of that length.
    pub sums: Sums,
    /// Whether that is noise, over whole runs.
    pub explains: bool,
    /// What it costs that members do more to predictions than all of them together: twice the
    /// nats; known when the story is concluded.
    cancellation: f64,
    /// Squares for each residual that are nothing beside what the model without a change leaves.
    pub negligible: f64,
    /// How well the runs that it was fitted to determine its numbers; known when the story is
    /// concluded.
    determined: Option<Factor>,
}

impl<'a> Story<'a> {
    /// The story without a change: the model as it is.
    pub(super) fn baseline(question: &Question<'a, '_>) -> Story<'a> {
        let model = question.model.clone();
        let sums = settle(model.clone()).sums;
        let scope = question.scope.clone();
        let negligible = model.tuning().verdict.negligible * sums.loss / sums.rows.max(1) as f64;
        Story {
            members: Vec::new(),
            scope,
            model,
            sums,
            explains: false,
            cancellation: 0.0,
            negligible,
            determined: None,
        }
    }

    /// The story with one more change, held against longer and longer segments as long as it
    /// leaves noise. It was fitted over segments of `window` samples.
    ///
    /// # Errors
    ///
    /// When the change does not fit the spec.
    pub(super) fn with(
        &self,
        judged: &Judged,
        window: usize,
        question: &Question<'a, '_>,
    ) -> Result<Story<'a>> {
        let scope = judged.refit.effect.added_to(&self.scope)?;
        let system = scope.compiled().system.clone();
        let standing = self.scope.compiled().system.parameters.len();
        let parameters = system.parameter_ids().into_iter();
        let parameters: Vec<ParameterId> =
            parameters.filter(|id| id.position() >= standing).collect();
        let ranges = judged.refit.ranges.clone();
        let scope = scope.bounded(bounds_of(&parameters, &ranges));
        let system = &scope.compiled().system;
        let member = Member {
            effect: judged.refit.effect.clone(),
            terms: judged.refit.terms.clone(),
            parameters,
            ranges,
            price: judged.price + 2.0 * judged.refit.candidate_choice,
            named: judged.refit.named,
            positive: judged.refit.positive,
        };
        let model = judged.refit.on(&self.model).with_window(window);
        let sums = judged.refit.left_of_all(&model);
        let model = model.with_law(model.law.on(system));
        let members = self.members.iter().cloned().chain([member]).collect();
        let mut story = Story { members, scope, model, sums, explains: false, ..self.clone() };
        story.measure_noise(question);
        story.grow(question);
        Ok(story)
    }

    /// The story of several changes to `baseline` at once, fitted over segments of `window`
    /// samples, over which they were chosen; `None` where their numbers cannot be fitted, or first
    /// order leads away from the data: to more squares than `without` any change.
    ///
    /// # Errors
    ///
    /// When a change does not fit the spec.
    pub(super) fn of_set(
        baseline: &Story<'a>,
        set: &ProposedSet,
        (window, without): (usize, f64),
    ) -> Result<Option<Story<'a>>> {
        let (scope, own) = placed(
            set.members.iter().map(|one| (&one.effect, one.ranges.as_slice())),
            &baseline.scope,
        )?;
        let noise = baseline.model.law.noise().to_vec();
        let mut law = set.law.on(&scope.compiled().system).with_noise(noise);
        let mut members = Vec::new();
        for (one, (terms, parameters)) in set.members.iter().zip(own) {
            let numbers = &one.effect.coefficient;
            let (coefficients, inner) = numbers.split_at(numbers.len().saturating_sub(one.inner));
            for (&id, &value) in terms.iter().zip(coefficients) {
                law = law.with_term(id, value)?;
            }
            law = law.with_parameters(parameters.iter().copied().zip(inner.iter().copied()));
            let (effect, price) = (one.effect.clone(), 2.0 * one.price);
            let Proposed { named, positive, .. } = *one;
            let ranges = one.ranges.clone();
            members.push(Member { effect, terms, parameters, ranges, price, named, positive });
        }
        let law = by_method_for_its_forces(law.with_window(window));
        let settled = settle(baseline.model.with_law(law));
        let leads = settled.sums.loss < without;
        if !leads {
            return Ok(None);
        }
        let Some(found) = fitted(&settled, &settled.model.law, Precision::Ranking) else {
            return Ok(None);
        };
        let (law, sums) = (found.law, found.sums);
        let model = settled.model.with_law(law.clone());
        let mut story = Story { members, scope, model, sums, explains: false, ..baseline.clone() };
        story.take_numbers(&law);
        Ok(Some(story))
    }

    /// The story with the numbers of another law.
    pub(super) fn with_law(&self, law: Law) -> Story<'a> {
        Story { model: self.model.with_law(law), ..self.clone() }
    }

    /// Squares that count as one: those that are left for each residual.
    pub(super) fn variance_of(&self, sums: &Sums) -> f64 {
        let mean = sums.loss / sums.rows.max(1) as f64;
        let all = if self.model.is_computed() { 1.0 } else { 0.0 };
        let least = self.negligible.max(self.model.tuning().scan.least_variance).max(all);
        mean.max(least) * self.model.autocorrelation_time
    }

    /// The numbers of each member in the story's law: coefficients, then inner ones.
    pub(super) fn numbers(&self) -> Vec<Vec<f64>> {
        let law = &self.model.law;
        let of = |member: &Member| {
            let terms = member.terms.iter().filter_map(|&id| law.coefficient(id));
            terms.chain(member.parameters.iter().filter_map(|&id| law.parameter(id))).collect()
        };
        self.members.iter().map(of).collect()
    }

    /// Their columns among those of the law, where they are unknowns.
    pub(super) fn columns(&self) -> Vec<Vec<Column>> {
        let dynamics = self.model.law.dynamics();
        let (active, inner) = (dynamics.active(), dynamics.parameters());
        let of = |member: &Member| {
            let terms = active.iter().enumerate().filter(|(_, id)| member.terms.contains(id));
            let own = inner.iter().enumerate().filter(|(_, id)| member.parameters.contains(id));
            let own = own.map(|(at, _)| active.len() + at);
            terms.map(|(at, _)| at).chain(own).map(Column::new).collect()
        };
        self.members.iter().map(of).collect()
    }

    /// Squares a residual in excess of the noise, of what it leaves of segments; zero for what is
    /// negligible.
    pub(super) fn excess_of(&self, sums: &Sums) -> f64 {
        let mean = sums.loss / sums.rows.max(1) as f64;
        if sums.rows > 0 && mean < self.negligible {
            return 0.0;
        }
        excess(sums, &self.model)
    }

    /// Judges what it leaves by another noise of each observable; returns its best states then.
    pub(super) fn hold_against(&mut self, noise: Noise) -> Settled<'a> {
        let smaller = self.model.noise().log_size() - noise.log_size();
        self.negligible *= (2.0 * smaller / noise.sizes.len().max(1) as f64).exp();
        self.model = self.model.with_noise(noise);
        let settled = settle(self.model.clone());
        self.sums = settled.sums.clone();
        self.explains &= self.excess_of(&self.sums) == 0.0;
        settled
    }

    /// The story without one of its members, its numbers fitted again; `None` where they cannot be,
    /// or where a second one of it stays.
    ///
    /// # Errors
    ///
    /// When the other members do not fit the spec.
    pub(super) fn without(
        &self,
        question: &Question<'a, '_>,
        place: usize,
    ) -> Result<Option<Story<'a>>> {
        let mut members = self.members.clone();
        let second = label_of_second(&members.remove(place).effect.effect);
        if second.is_some_and(|second| members.iter().any(|one| one.effect.effect == second)) {
            return Ok(None);
        }
        let (scope, own) =
            placed(members.iter().map(|one| (&one.effect, one.ranges.as_slice())), question.scope)?;
        for (member, own) in members.iter_mut().zip(own) {
            (member.terms, member.parameters) = own;
        }
        let law = self.model.law.on(&scope.compiled().system);
        // What the member stood for, the others take over as well as they can.
        let Some(model) = fitted_from_afar(&self.model.with_law(law)) else { return Ok(None) };
        let sums = settle(model.clone()).sums;
        let mut story = Story { members, scope, model, sums, explains: false, ..self.clone() };
        story.grow_together(question);
        Ok(Some(story))
    }

    /// The story with residuals weighed by another noise.
    pub(super) fn with_noise(&self, noise: Noise) -> Story<'a> {
        Story { model: self.model.with_noise(noise), ..self.clone() }
    }

    /// The story with the numbers and over the segments of its own law there, each number with the
    /// error that its column has.
    pub(super) fn held_by(
        &self,
        settled: &Settled<'a>,
        error: impl Fn(Column) -> f64,
    ) -> Story<'a> {
        let mut story = self.clone();
        (story.model, story.sums) = (settled.model.clone(), settled.sums.clone());
        let law = story.model.law.clone();
        story.take_numbers(&law);
        let columns = story.columns();
        for (member, columns) in story.members.iter_mut().zip(columns) {
            let errors = columns.into_iter().map(&error);
            for (slot, error) in member.effect.standard_error.iter_mut().zip(errors) {
                *slot = error;
            }
        }
        story.take_p_values();
        story
    }

    /// Fits all numbers to the longest segments that the story follows, and gives each member its
    /// own.
    pub(super) fn conclude(&mut self) {
        let settled = settle(self.model.clone());
        let Some(found) = fitted(&settled, &self.model.law, Precision::Full) else { return };
        if found.sums.diverged > self.sums.diverged || !found.sums.loss.is_finite() {
            return;
        }
        // The terms of an effect belong together; those without a name were put together.
        let apart = |one: &Member| match one.named {
            true => vec![one.terms.clone()],
            false => one.terms.iter().map(|&id| vec![id]).collect(),
        };
        let groups: Vec<Vec<TermId>> = self.members.iter().flat_map(apart).collect();
        self.cancellation = found.cancellation(&groups);
        self.take_numbers(&found.law);
        self.determined = Some(found.factor);
        if found.sums.loss <= self.sums.loss {
            self.sums = found.sums;
        }
        self.model = self.model.with_law(found.law);
    }

    /// What the story leaves of other runs where its numbers move as far as those that it was
    /// fitted to let them, beside what that costs there: numbers that are known to some digits
    /// predict a long motion to fewer. Beside it, twice the nats by which that widens predictions:
    /// what may be many things foretells none of them. `None` where it is not known how well the
    /// numbers are determined.
    pub(super) fn left_within_errors(&self, of: &Settled) -> Option<(Sums, f64)> {
        let determined = self.determined.as_ref()?;
        let other = of.linearised();
        // What the derivatives lose of the motion, though the motion itself goes on, says nothing.
        let lost = (other.select(&[]).least() - of.sums.loss).abs() > SAME_SQUARES * of.sums.loss;
        if lost || other.columns() != determined.columns() {
            return None;
        }
        let mut both = determined.clone();
        both.merge(&other);
        let (before, after) = (determined.design(), both.design());
        let ratios = (0..determined.columns()).map(|i| (after[(i, i)] / before[(i, i)]).abs());
        let widened = 2.0 * ratios.filter(|ratio| ratio.is_finite()).map(f64::ln).sum::<f64>();
        let loss = both.least() - determined.least();
        Some((Sums { loss, ..of.sums.clone() }, widened))
    }

    /// Gives each member its numbers in a law, with their errors.
    pub(super) fn take_numbers(&mut self, law: &Law) {
        for member in &mut self.members {
            let free = member.terms.iter().filter(|id| !is_said(law.system(), **id));
            let terms = free.filter_map(|&id| law.coefficient_with_error(id));
            let inner = member.parameters.iter().filter_map(|&id| law.parameter_with_error(id));
            let numbers: Vec<(f64, f64)> = terms.chain(inner).collect();
            // What a term without a name was placed by is written into it.
            for (at, (value, error)) in numbers.into_iter().enumerate() {
                if let Some(slot) = member.effect.coefficient.get_mut(at) {
                    *slot = value;
                }
                if let Some(slot) = member.effect.standard_error.get_mut(at) {
                    *slot = error;
                }
            }
        }
        self.take_p_values();
        self.write_numbers();
    }

    /// Gives each member the p-value of its numbers beside their errors.
    fn take_p_values(&mut self) {
        let system = &self.scope.compiled().system;
        for member in &mut self.members {
            let clearness = Clearness::of(&member.effect, &member.terms, system);
            member.effect.p_value = clearness.p_value(member.effect.tests);
        }
    }

    /// Writes the statements of known numbers that are members with the values of all of them.
    fn write_numbers(&mut self) {
        let changes = self.members.iter().filter_map(|member| {
            let change = member.effect.number.as_ref()?;
            let value = member.effect.coefficient.last().copied().unwrap_or(change.was);
            Some((change.known.clone(), value))
        });
        let changes: Vec<(KnownNumber, f64)> = changes.collect();
        let values: Vec<(&KnownNumber, f64)> = changes.iter().map(|(k, x)| (k, *x)).collect();
        let changed = self.members.iter_mut().filter(|member| member.effect.number.is_some());
        for (member, (known, value)) in changed.zip(&changes) {
            member.effect.snippet = known.rewritten(*value, &values);
        }
    }

    /// What all its unknowns and choices cost: twice the nats.
    pub(super) fn price(&self) -> f64 {
        self.members.iter().map(|member| member.price).sum::<f64>() + self.cancellation
    }

    /// Coefficients of the model beside those of its members.
    pub(super) fn standing(&self) -> Vec<TermId> {
        let own = |id: &TermId| self.members.iter().any(|member| member.terms.contains(id));
        self.model.law.dynamics().active().iter().copied().filter(|id| !own(id)).collect()
    }

    /// Squares that are left over segments of `window` samples before such a noise, and independent
    /// residuals.
    pub(super) fn squares(&self, window: usize, noise: &Noise) -> (f64, f64) {
        let same = noise.sizes == self.model.law.noise();
        if same && window == self.model.law.window() {
            return (self.sums.loss, self.sums.rows.max(1) as f64);
        }
        let sums = settle(self.model.with_noise(noise.clone()).with_window(window)).sums;
        (sums.loss, sums.rows.max(1) as f64)
    }

    /// Names of its changes, in alphabetical order.
    pub(super) fn labels(&self) -> Vec<String> {
        let mut labels: Vec<String> =
            self.members.iter().map(|member| member.effect.effect.clone()).collect();
        labels.sort();
        labels
    }
}

/// The probability that noise takes so many squares off by one number.
pub(super) fn p_value(squares: f64) -> f64 {
    ChiSquared::new(1.0).map_or(1.0, |chi| if squares.is_nan() { 1.0 } else { chi.sf(squares) })
}
