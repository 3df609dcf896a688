//! Accurate single trajectories by Taylor series of the solution.
//!
//! Order and steps follow from the tolerance (Jorba and Zou, Experimental Mathematics 14, 2005,
//! sections 3.1 and 3.2). Between steps the series itself gives the state at any time.

use super::batch::{Batch, Scratch};
use super::equations::Dynamics;
use super::trajectory::{Stop, Trajectory};

/// Most steps from one time to the next.
const MOST_STEPS: usize = 10_000_000;
/// A step shorter than this part of the time does not move it on.
const SHORTEST: f64 = 4.0 * f64::EPSILON;

/// Components whose series are summed side by side, and sums that a series is cut into.
const TOGETHER: usize = 4;

/// How far a series was followed, and in how many steps.
#[derive(Debug, Clone, PartialEq)]
pub struct TaylorRun {
    /// States and energies at the times asked for.
    pub trajectory: Trajectory,
    /// Number of steps.
    pub steps: usize,
    /// Order of the series.
    pub order: usize,
}

/// Follows one trajectory through all `times`, of which the first is that of the start; they
/// may run backward.
///
/// `start` has 2n numbers, coordinates before momenta. `tolerance` is the error of one step as
/// a part of the largest component; the best there is, about 1e-16, costs little more than
/// 1e-10. Errors of rounding are carried along. Any dynamics will do, separable or not, with
/// forces or without; `None` if it has a kink or a jump (`abs`, `sign`), where there is no
/// series, or if the series is too long to be worth it.
pub fn taylor(
    dynamics: &Dynamics,
    theta: &[f64],
    start: &[f64],
    times: &[f64],
    tolerance: f64,
) -> Option<TaylorRun> {
    let tolerance = tolerance.clamp(f64::EPSILON, 1e-2);
    // The order that costs least; a step is then e^-2 of the radius of convergence, or a little
    // more where the order was rounded up.
    let order = (-0.5 * tolerance.ln() + 1.0).ceil().max(2.0) as usize;
    let part = tolerance.ln() / (order - 1) as f64;
    let size = 2 * dynamics.degrees();
    let series = dynamics.series(order)?;
    let mut series = series.at(theta);
    let mut state = start.to_vec();
    state.resize(size, 0.0);
    let mut point = vec![0.0; size + 1];
    let mut carry = vec![0.0; size];
    let mut time = *times.first().unwrap_or(&0.0);
    // What rounding took from the time.
    let mut rest = 0.0;
    let mut trajectory = Trajectory {
        times: Vec::new(),
        states: Vec::new(),
        energies: Vec::new(),
        stop: Stop::Finished,
    };
    let mut scratch = Scratch::new();
    let mut batch = Batch::new(dynamics.degrees(), 1);
    let mut energy = [0.0];
    let mut steps = 0;
    // Coefficients at the present state and time, if they are known, and how far they reach.
    let mut reach: Option<f64> = None;
    for (at, &wanted) in times.iter().enumerate() {
        let first_step = steps;
        let sampled = loop {
            let ahead = (wanted - time) - rest;
            if ahead == 0.0 {
                break Some(state.clone());
            }
            let step = match reach {
                Some(step) => step,
                None => {
                    point[..size].copy_from_slice(&state);
                    point[size] = time;
                    let step = longest(series.evaluate(&point), &state, order, part);
                    reach = Some(step);
                    step
                }
            };
            if step.is_nan() {
                break None;
            }
            let coefficients = series.coefficients();
            if ahead.abs() <= step {
                let mut there = state.clone();
                move_on(&mut there, &mut carry.clone(), coefficients, ahead);
                break Some(there);
            }
            if step < SHORTEST * time.abs() || steps - first_step >= MOST_STEPS {
                break None;
            }
            let step = step.copysign(ahead);
            move_on(&mut state, &mut carry, coefficients, step);
            // Time is a sum of many steps too.
            let moved = step + rest;
            let now = time + moved;
            (time, rest) = (now, moved - (now - time));
            reach = None;
            steps += 1;
        };
        let finite = sampled.filter(|state| state.iter().all(|x| x.is_finite()));
        let Some(sample) = finite else {
            let after = times[at.saturating_sub(1)];
            let exploded = !state.iter().all(|x| x.is_finite());
            trajectory.stop =
                if exploded { Stop::Exploded { after } } else { Stop::Unresolved { after } };
            break;
        };
        batch.set(0, wanted, &sample);
        dynamics.energy(&batch, theta, &mut energy, &mut scratch);
        trajectory.times.push(wanted);
        trajectory.states.push(sample);
        trajectory.energies.push(energy[0]);
    }
    Some(TaylorRun { trajectory, steps, order })
}

/// The longest step that keeps the tolerance, from the last two coefficients; `part` is the
/// logarithm of its share of the radius of convergence.
fn longest(coefficients: &[f64], state: &[f64], order: usize, part: f64) -> f64 {
    let size = state.len();
    let largest = |row: &[f64]| {
        // NaN must not be lost on the way.
        row.iter().fold(0.0, |most: f64, x| if x.abs() <= most { most } else { x.abs() })
    };
    let whole = largest(state).max(f64::MIN_POSITIVE);
    // The logarithm of the radius of convergence, from one coefficient.
    let radius = |k: usize| {
        let last = largest(&coefficients[(k - 1) * size..k * size]);
        (whole / last).ln() / k as f64
    };
    let (a, b) = (radius(order - 1), radius(order));
    if a.is_nan() || b.is_nan() {
        return f64::NAN;
    }
    (a.min(b) + part - 0.7 / (order - 1) as f64).exp()
}

/// Adds the series at `step` to the state, and carries what rounding takes.
fn move_on(state: &mut [f64], carry: &mut [f64], coefficients: &[f64], step: f64) {
    let size = state.len();
    for first in (0..size).step_by(TOGETHER) {
        match size - first {
            1 => add_series::<1>(state, carry, coefficients, first, step),
            2 => add_series::<2>(state, carry, coefficients, first, step),
            3 => add_series::<3>(state, carry, coefficients, first, step),
            _ => add_series::<TOGETHER>(state, carry, coefficients, first, step),
        }
    }
}

/// The same for N components from `first` on. Every `TOGETHER`-th coefficient is summed by
/// itself, so that no sum has to wait for all of the others.
fn add_series<const N: usize>(
    state: &mut [f64],
    carry: &mut [f64],
    coefficients: &[f64],
    first: usize,
    step: f64,
) {
    let size = state.len();
    let square = step * step;
    let fourth = square * square;
    let mut sums = [[0.0; N]; TOGETHER];
    for rows in coefficients.chunks(TOGETHER * size).rev() {
        for (sum, row) in sums.iter_mut().zip(rows.chunks_exact(size)) {
            for (sum, c) in sum.iter_mut().zip(&row[first..first + N]) {
                *sum = *sum * fourth + c;
            }
        }
    }
    let [a, b, c, d] = sums;
    for i in 0..N {
        let change = (a[i] + b[i] * step) + (c[i] + d[i] * step) * square;
        add_carried(&mut state[first + i], &mut carry[first + i], change * step);
    }
}

fn add_carried(state: &mut f64, carry: &mut f64, change: f64) {
    let moved = change + *carry;
    let sum = *state + moved;
    *carry = moved - (sum - *state);
    *state = sum;
}
