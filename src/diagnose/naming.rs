//! The name of a composed term, where the catalogue has one for it.
//!
//! Beside a strong effect a model loses the motion at once, and no named effect is found from
//! there; the search for composed terms follows the measured motion and finds its form. Where an
//! effect of the catalogue has nearly that force along the motion, it is fitted in its place.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::candidates::{Candidate, Origin, candidates};
use super::comparison::predictions::predictions;
use super::description::description_lengths;
use super::doubts::holds;
use super::evidence::Judged;
use super::law_on_data::LawOnData;
use super::refit::{Precision, Start, refit_whole};
use super::settling::{Settled, settle};
use super::story::{Question, Story};
use crate::dynamics::{Batch, Drive, Scratch};
use crate::error::Result;
use crate::expr::System;
use crate::fit::Law;

/// A candidate whose force is nearly that of a composed term.
struct Alike {
    candidate: usize,
    law: Law,
    /// Part of the term's force along the motion that it does not have.
    apart: f64,
}

/// The story with a named effect in place of its only change, where that has no name and a named
/// one explains as much; `None` where none does. `baseline` is the story without a change.
///
/// # Errors
///
/// When a named effect does not fit the spec.
pub(super) fn with_name<'a>(
    question: &Question<'a, '_>,
    baseline: &Story<'a>,
    story: &Story<'a>,
) -> Result<Option<Story<'a>>> {
    let tuning = question.model.tuning();
    let [member] = story.members.as_slice() else { return Ok(None) };
    if member.named {
        return Ok(None);
    }
    let mut scope = question.scope.clone();
    let all = candidates(&mut scope, &question.model.data.dataset, &tuning.candidates);
    let alike = alike(&story.model, question.model.system(), &all)?;
    let window = story.model.law.window();
    let like = question.model.with_noise(story.model.noise()).with_window(window);
    let held_out = settle(like.with_data(question.held_out));
    let data = settle(like);
    let states = settle(story.model.clone()).states;
    let start = Settled { states, ..data.clone() };
    for one in alike {
        if question.monitor.stopped() {
            break;
        }
        let from = Start::at(one.law, &member.effect);
        let candidate = &all[one.candidate];
        let Some(refit) = refit_whole(&start, candidate, from, Precision::Full) else { continue };
        let named = baseline.with(&Judged::by(refit, &data, &held_out), window, question)?;
        let lengths = description_lengths(&[story, &named], tuning);
        let shorter = lengths.last() <= lengths.first();
        if holds(&named) && shorter {
            return Ok(Some(named));
        }
    }
    Ok(None)
}

/// The candidates of the catalogue whose forces are nearest to that of what a law has beside those
/// of `base`, the nearest first.
fn alike(with: &LawOnData, base: &Arc<System>, all: &[Candidate]) -> Result<Vec<Alike>> {
    let tuning = &with.tuning().naming;
    let motion = Motion::of(with, tuning.states);
    let without = with.law.on(base);
    let rest = motion.field(&without);
    let target = motion.field(&with.law) - &rest;
    let mut found: Vec<Alike> = Vec::new();
    for (place, candidate) in all.iter().enumerate() {
        if !matches!(candidate.origin, Origin::Catalogue(_)) {
            continue;
        }
        let mut best: Option<Alike> = None;
        for values in &candidate.grid {
            let system = Arc::new(candidate.system(base));
            let parameters = candidate.parameters.iter().copied().zip(values.iter().copied());
            let law = without.on(&system).with_parameters(parameters);
            let columns = candidate.terms.iter().map(|&id| {
                let one = law.clone().with_term(id, 1.0)?;
                Ok(motion.field(&one) - &rest)
            });
            let columns = columns.collect::<Result<Vec<DVector<f64>>>>()?;
            let Some((coefficients, apart)) = nearest(&columns, &target) else { continue };
            if apart < tuning.apart && best.as_ref().is_none_or(|best| apart < best.apart) {
                let mut law = law;
                for (&id, &value) in candidate.terms.iter().zip(coefficients.iter()) {
                    law = law.with_term(id, value)?;
                }
                best = Some(Alike { candidate: place, law, apart });
            }
        }
        found.extend(best);
    }
    found.sort_by(|a, b| a.apart.total_cmp(&b.apart));
    found.truncate(tuning.tried);
    Ok(found)
}

/// The combination of columns nearest to a target, and the part of the target that it does not
/// have; `None` where they are no columns.
fn nearest(columns: &[DVector<f64>], target: &DVector<f64>) -> Option<(DVector<f64>, f64)> {
    let design = DMatrix::from_columns(columns);
    if columns.is_empty() || !design.iter().chain(target.iter()).all(|x| x.is_finite()) {
        return None;
    }
    let coefficients = design.clone().svd(true, true).solve(target, f64::EPSILON).ok()?;
    let left = (target - design * &coefficients).norm();
    let apart = left / target.norm();
    apart.is_finite().then_some((coefficients, apart))
}

/// States along the motion of a law, all at once.
struct Motion {
    batch: Batch,
}

impl Motion {
    /// So many of them, spread over all runs.
    fn of(model: &LawOnData, most: usize) -> Motion {
        let mut states: Vec<(f64, Vec<f64>)> = Vec::new();
        for run in predictions(model, false) {
            for (sample, &time) in run.times.iter().enumerate() {
                let state: Vec<f64> = run.states.iter().map(|row| row[sample]).collect();
                if state.iter().all(|x| x.is_finite()) {
                    states.push((time, state));
                }
            }
        }
        let stride = states.len().div_ceil(most.max(1)).max(1);
        let taken: Vec<&(f64, Vec<f64>)> = states.iter().step_by(stride).collect();
        let mut batch = Batch::new(model.system().degrees(), taken.len());
        for (lane, (time, state)) in taken.iter().enumerate() {
            batch.set(lane, *time, state);
        }
        batch.drive = Drive::new(model.system().inputs.len(), 1, taken.len());
        Motion { batch }
    }

    /// Rates of change by a law, `[2n][lanes]`.
    fn field(&self, law: &Law) -> DVector<f64> {
        let dynamics = law.dynamics();
        let mut out = vec![f64::NAN; 2 * dynamics.degrees() * self.batch.lanes];
        dynamics.field_at(&self.batch, &law.theta(&dynamics), &mut out, &mut Scratch::new());
        DVector::from_vec(out)
    }
}
