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
pub fn advance(
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
    // Step times slope at each stage, and its tangent.
    let mut slopes = vec![vec![0.0; batch.state.len()]; stages];
    let mut variations: Vec<Aligned> =
        (0..stages).map(|_| scratch.lend(batch.tangent.len())).collect();
    let mut state = Vec::with_capacity(batch.state.len());
    let mut tangent = Vec::with_capacity(batch.tangent.len());
    let start = batch.time.clone();
    scratch.workspace.clear();
    for step in 0..steps {
        record(&batch.state);
        for stage in 0..stages {
            let row = &tableau.matrix[stage * stages..(stage + 1) * stages];
            combine(&mut state, &batch.state, row, &slopes[..stage]);
            set_stage(scratch, &start, step as f64 + tableau.nodes[stage]);
            field.evaluate_again(&state, lanes, theta, tangents, scratch);
            let size = if tangents { field.outputs() } else { field.rows } * lanes;
            rescale(&mut scratch.out[..size], &scratch.scale);
            let (values, entries) = scratch.out[..size].split_at(field.rows * lanes);
            slopes[stage].copy_from_slice(values);
            if tangents {
                combine(&mut tangent, &batch.tangent, row, &variations[..stage]);
                let first = 2 * batch.degrees();
                field.map(&mut variations[stage], &tangent, entries, first, columns, lanes);
            }
        }
        add_parts(&mut batch.state, tableau.weights, &slopes);
        add_parts(&mut batch.tangent, tableau.weights, &variations);
    }
    variations.into_iter().rev().for_each(|memory| scratch.take_back(memory));
}

/// Times of a stage `at` steps from the start; the factor of what is evaluated is the step.
pub fn set_stage(scratch: &mut Scratch, start: &[f64], at: f64) {
    let Scratch { time, scale, step, .. } = scratch;
    time.clear();
    time.extend(start.iter().zip(&*step).map(|(t, h)| t + at * h));
    scale.clear();
    scale.extend_from_slice(step);
}

/// out = base + sum of factor * part.
pub fn combine<P: Deref<Target = [f64]>>(
    out: &mut Vec<f64>,
    base: &[f64],
    factors: &[f64],
    parts: &[P],
) {
    let mut wanted = factors.iter().zip(parts).filter(|(factor, _)| **factor != 0.0);
    let Some((&factor, part)) = wanted.next() else {
        out.clear();
        out.extend_from_slice(base);
        return;
    };
    let set = InstructionSet::widest();
    out.resize(base.len(), 0.0);
    sum_with_multiple(set, out, base, part, factor);
    wanted.for_each(|(&factor, part)| add_multiple(set, out, part, factor));
}

/// out += sum of factor * part.
fn add_parts<P: Deref<Target = [f64]>>(out: &mut [f64], factors: &[f64], parts: &[P]) {
    let set = InstructionSet::widest();
    for (&factor, part) in factors.iter().zip(parts) {
        if factor != 0.0 {
            add_multiple(set, out, part, factor);
        }
    }
}
