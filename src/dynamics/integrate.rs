//! Moving a batch of trajectories.

use super::batch::{Batch, Scratch};
use super::equations::Dynamics;
use super::methods::{Method, MethodKind};
use super::splitting::Recorder;
use super::{explicit, implicit, splitting};

/// Advances every lane by its own `span[lane]` in `steps` equal steps, without a look at switching
/// surfaces: see [`advance`](super::advance).
pub(super) fn advance_plainly(
    dynamics: &Dynamics,
    method: Method,
    batch: &mut Batch,
    span: &[f64],
    steps: usize,
    theta: &[f64],
    scratch: &mut Scratch,
) {
    advance_recording(dynamics, method, batch, span, steps, theta, scratch, None);
}

/// The same; `record` sees the state before every stage of a splitting, or else every step.
#[allow(clippy::too_many_arguments)]
pub(super) fn advance_recording(
    dynamics: &Dynamics,
    method: Method,
    batch: &mut Batch,
    span: &[f64],
    steps: usize,
    theta: &[f64],
    scratch: &mut Scratch,
    record: Option<Recorder>,
) {
    if steps == 0 || batch.lanes == 0 {
        return;
    }
    scratch.drive.clone_from(&batch.drive);
    scratch.step.clear();
    scratch.step.extend(span.iter().map(|span| span / steps as f64));
    let mut ignore = |_: &[f64]| {};
    match &method.row().kind {
        MethodKind::Splitting(_) if !dynamics.separable() => batch.state.fill(f64::NAN),
        MethodKind::Splitting(gammas) => {
            splitting::advance(dynamics, gammas, batch, steps, theta, scratch, record);
        }
        MethodKind::Implicit(tableau) => {
            let record = record.unwrap_or(&mut ignore);
            implicit::advance(dynamics, tableau, batch, steps, theta, scratch, record);
        }
        MethodKind::Explicit(tableau) => {
            let record = record.unwrap_or(&mut ignore);
            explicit::advance(dynamics, tableau, batch, steps, theta, scratch, record);
        }
    }
    for (time, span) in batch.time.iter_mut().zip(span) {
        *time += span;
    }
    batch.drive.go_on(span);
    batch.condemn(&mut scratch.scale);
}
