//! What is measured of a state.

use super::batch::{Batch, Scratch};
use super::equations::Dynamics;
use crate::expr::Observed;

/// h(z): coordinates, then momenta or velocities dH/dp, with what the instrument adds to each, then
/// the measures, into `out`, `[2n + m][lanes]`.
///
/// `out_tangent`, `[2n + m][2n + P][lanes]`, gets the derivative by (initial state, theta) if the
/// batch has tangents, and is left alone otherwise.
pub fn observe(
    dynamics: &Dynamics,
    observed: Observed,
    batch: &Batch,
    theta: &[f64],
    out: &mut [f64],
    mut out_tangent: Option<&mut [f64]>,
    scratch: &mut Scratch,
) {
    out_tangent = out_tangent.filter(|_| batch.has_tangents());
    ideal(dynamics, observed, batch, theta, out, out_tangent.as_deref_mut(), scratch);
    let Some(instrument) = dynamics.instrument() else { return };
    let (lanes, columns) = (batch.lanes, batch.columns());
    scratch.stand_at(batch);
    instrument.evaluate(&batch.state, lanes, theta, out_tangent.is_some(), scratch);
    let (added, entries) = scratch.out.split_at(instrument.rows * lanes);
    for (value, added) in out.iter_mut().zip(added) {
        *value += added;
    }
    if let Some(out_tangent) = out_tangent {
        let first = 2 * batch.degrees();
        instrument.push(out_tangent, &batch.tangent, entries, first, columns, lanes);
    }
}

/// What an ideal instrument shows.
fn ideal(
    dynamics: &Dynamics,
    observed: Observed,
    batch: &Batch,
    theta: &[f64],
    out: &mut [f64],
    out_tangent: Option<&mut [f64]>,
    scratch: &mut Scratch,
) {
    let (lanes, degrees, columns) = (batch.lanes, batch.degrees(), batch.columns());
    out[..batch.state.len()].copy_from_slice(&batch.state);
    out[batch.state.len()..].fill(0.0);
    if observed == Observed::Momenta {
        if let Some(out_tangent) = out_tangent {
            out_tangent[..batch.tangent.len()].copy_from_slice(&batch.tangent);
            out_tangent[batch.tangent.len()..].fill(0.0);
        }
        return;
    }
    let flow = dynamics.drift();
    scratch.stand_at(batch);
    flow.evaluate(&batch.state, lanes, theta, out_tangent.is_some(), scratch);
    let (momenta, entries) = scratch.out.split_at(flow.rows * lanes);
    out[degrees * lanes..2 * degrees * lanes].copy_from_slice(momenta);
    if let Some(out_tangent) = out_tangent {
        let half = degrees * columns * lanes;
        out_tangent[2 * half..].fill(0.0);
        let (above, below) = out_tangent[..2 * half].split_at_mut(half);
        above.copy_from_slice(&batch.tangent[..half]);
        below.fill(0.0);
        let source = &batch.tangent[flow.inputs.start * columns * lanes..];
        flow.push(below, source, entries, 2 * degrees, columns, lanes);
    }
}
