//! What is measured of a state.

use super::batch::{Batch, Scratch};
use super::equations::Dynamics;
use crate::expr::Observed;

/// h(z): coordinates, then momenta or velocities dH/dp, into `out`, `[2n][lanes]`.
///
/// `out_tangent`, `[2n][2n + P][lanes]`, gets the derivative by (initial state, theta) if the
/// batch has tangents, and is left alone otherwise.
pub fn observe(
    dynamics: &Dynamics,
    observed: Observed,
    batch: &Batch,
    theta: &[f64],
    out: &mut [f64],
    out_tangent: Option<&mut [f64]>,
    scratch: &mut Scratch,
) {
    let (lanes, degrees, columns) = (batch.lanes, batch.degrees(), batch.columns());
    let out_tangent = out_tangent.filter(|_| batch.has_tangents());
    out[..batch.state.len()].copy_from_slice(&batch.state);
    if observed == Observed::Momenta {
        if let Some(out_tangent) = out_tangent {
            out_tangent[..batch.tangent.len()].copy_from_slice(&batch.tangent);
        }
        return;
    }
    let flow = dynamics.drift();
    scratch.time.clear();
    scratch.time.extend_from_slice(&batch.time);
    flow.evaluate(&batch.state, lanes, theta, out_tangent.is_some(), scratch);
    let (momenta, entries) = scratch.out.split_at(flow.rows * lanes);
    out[degrees * lanes..2 * degrees * lanes].copy_from_slice(momenta);
    if let Some(out_tangent) = out_tangent {
        let half = degrees * columns * lanes;
        let (above, below) = out_tangent[..2 * half].split_at_mut(half);
        above.copy_from_slice(&batch.tangent[..half]);
        below.fill(0.0);
        let source = &batch.tangent[flow.inputs.start * columns * lanes..];
        flow.push(below, source, entries, 2 * degrees, columns, lanes);
    }
}
