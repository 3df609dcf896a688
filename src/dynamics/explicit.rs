//! Explicit Runge-Kutta steps and their exact tangents.

use std::ops::Deref;

use super::batch::{Batch, Scratch};
use super::equations::Dynamics;
use super::methods::Tableau;
use super::splitting::rescale;
use crate::eval::{Aligned, InstructionSet, add_multiple, sum_with_multiple};

/// Advances a batch; `scratch.step` holds the step of each lane. `record` sees the
/// state before every step.
///
/// The tangent of a stage is the variational equation at the same stage, so that the result is
/// the Jacobian of the discrete map.
pub(super) fn advance(
    dynamics: &Dynamics,
    tableau: &Tableau,
    batch: &mut Batch,
    steps: usize,
    theta: &[f64],
    scratch: &mut Scratch,
    record: &mut dyn FnMut(&[f64]),
) {
    let field = dynamics.field();
    let (lanes, columns, tangents) = (batch.lanes, batch.columns(), batch.has_tangents());
    let stages = tableau.weights.len();
    let sizes = [batch.state.len(), batch.tangent.len()];
    // Step times slope at each stage, and its tangent.
    let [mut slopes, mut variations] =
        sizes.map(|size| -> Vec<Aligned> { (0..stages).map(|_| scratch.lend(size)).collect() });
    let [mut state_place, mut tangent_place] = sizes.map(|size| scratch.lend(size));
    let start = batch.time.clone();
    scratch.workspace.clear();
    for step in 0..steps {
        record(&batch.state);
        for stage in 0..stages {
            let row = &tableau.matrix[stage * stages..(stage + 1) * stages];
            let (known, rest) = slopes.split_at_mut(stage);
            let state = combined(&mut state_place, &batch.state, row, known);
            set_stage(scratch, &start, step as f64 + tableau.nodes[stage]);
            field.evaluate_again(state, lanes, theta, tangents, scratch);
            let size = if tangents { field.outputs() } else { field.rows } * lanes;
            rescale(&mut scratch.out[..size], &scratch.scale);
            let (values, entries) = scratch.out[..size].split_at(field.rows * lanes);
            rest[0].copy_from_slice(values);
            if tangents {
                let (known, rest) = variations.split_at_mut(stage);
                let tangent = combined(&mut tangent_place, &batch.tangent, row, known);
                let first = 2 * batch.degrees();
                field.map(&mut rest[0], tangent, entries, first, columns, lanes);
            }
        }
        add_parts(&mut batch.state, tableau.weights, &slopes);
        add_parts(&mut batch.tangent, tableau.weights, &variations);
    }
    let lent = slopes.into_iter().chain(variations).chain([state_place, tangent_place]);
    lent.rev().for_each(|memory| scratch.take_back(memory));
}

/// Times of a stage `at` steps from the start; the factor of what is evaluated is the step.
pub(super) fn set_stage(scratch: &mut Scratch, start: &[f64], at: f64) {
    let Scratch { time, since, scale, step, .. } = scratch;
    since.clear();
    since.extend(step.iter().map(|h| at * h));
    time.clear();
    time.extend(start.iter().zip(&*step).map(|(t, h)| t + at * h));
    scale.clear();
    scale.extend_from_slice(step);
}

/// base + sum of factor * part, at `place` unless it is the base itself.
pub(super) fn combined<'a, P: Deref<Target = [f64]>>(
    place: &'a mut [f64],
    base: &'a [f64],
    factors: &[f64],
    parts: &[P],
) -> &'a [f64] {
    let mut wanted = factors.iter().zip(parts).filter(|(factor, _)| **factor != 0.0);
    let Some((&factor, part)) = wanted.next() else { return base };
    let set = InstructionSet::widest();
    sum_with_multiple(set, place, base, part, factor);
    wanted.for_each(|(&factor, part)| add_multiple(set, place, part, factor));
    place
}

/// out += sum of factor * part.
pub(super) fn add_parts<P: Deref<Target = [f64]>>(out: &mut [f64], factors: &[f64], parts: &[P]) {
    let set = InstructionSet::widest();
    for (&factor, part) in factors.iter().zip(parts) {
        if factor != 0.0 {
            add_multiple(set, out, part, factor);
        }
    }
}
