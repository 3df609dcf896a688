//! Accurate single trajectories by Taylor series of the solution.
//!
//! Order and steps follow from the tolerance (Jorba and Zou, Experimental Mathematics 14, 2005,
//! sections 3.1 and 3.2). Between steps the series itself gives the state at any time.

use std::f64::consts::LOG2_E;

use super::batch::{Batch, Scratch};
use super::equations::Dynamics;
use super::trajectory::{Stop, Trajectory};
use crate::eval::{InstructionSet, add_series};

/// Most steps from one time to the next.
const MOST_STEPS: usize = 10_000_000;
/// A step shorter than this part of the time does not move it on.
const SHORTEST: f64 = 4.0 * f64::EPSILON;

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
    let part = (tolerance.log2() - 0.7 * LOG2_E) / (order - 1) as f64;
    let (size, set) = (2 * dynamics.degrees(), InstructionSet::widest());
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
                add_series(set, &mut there, &mut carry.clone(), coefficients, ahead);
                break Some(there);
            }
            if step < SHORTEST * time.abs() || steps - first_step >= MOST_STEPS {
                break None;
            }
            let step = step.copysign(ahead);
            add_series(set, &mut state, &mut carry, coefficients, step);
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
            let diverged = !state.iter().all(|x| x.is_finite());
            trajectory.stop =
                if diverged { Stop::Diverged { after } } else { Stop::Unresolved { after } };
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
/// binary logarithm of its share of the radius of convergence.
fn longest(coefficients: &[f64], state: &[f64], order: usize, part: f64) -> f64 {
    let size = state.len();
    let largest = |row: &[f64]| {
        // NaN must not be lost on the way.
        row.iter().fold(0.0, |most: f64, x| if x.abs() <= most { most } else { x.abs() })
    };
    let whole = binary_logarithm(largest(state).max(f64::MIN_POSITIVE));
    // The binary logarithm of the radius of convergence, from one coefficient.
    let radius = |k: usize| {
        let last = largest(&coefficients[(k - 1) * size..k * size]);
        (whole - binary_logarithm(last)) * (1.0 / k as f64)
    };
    let (a, b) = (radius(order - 1), radius(order));
    if a.is_nan() || b.is_nan() {
        return f64::NAN;
    }
    power_of_two(a.min(b) + part)
}

/// Bits of a number behind its exponent, and the exponent of one.
const DIGITS: u32 = f64::MANTISSA_DIGITS - 1;
const BIAS: u64 = f64::MAX_EXP as u64 - 1;

/// The binary logarithm to 1e-3, far more than the length of a step needs: the next step waits
/// for it. Interpolated between Chebyshev's points on [1, 2).
fn binary_logarithm(x: f64) -> f64 {
    if !x.is_normal() || x < 0.0 {
        return x.log2();
    }
    let exponent = (x.to_bits() >> DIGITS) as i32 - BIAS as i32;
    let digits = x.to_bits() & ((1 << DIGITS) - 1);
    let t = f64::from_bits(BIAS << DIGITS | digits) - 1.5;
    f64::from(exponent) + (0.585576 + 0.960963 * t) + (0.155446 * t - 0.339752) * (t * t)
}

/// Two to a power, to 1e-4 of itself. Interpolated like the logarithm.
fn power_of_two(x: f64) -> f64 {
    // Numbers near this one are whole, and end in the bits of what was added to it.
    const WHOLE: f64 = 1.5 / f64::EPSILON;
    if x.is_nan() || x.abs() >= f64::from(f64::MAX_EXP - 2) {
        return x.exp2();
    }
    let shifted = x + WHOLE;
    let t = x - (shifted - WHOLE);
    let power = f64::from_bits(shifted.to_bits().wrapping_add(BIAS) << DIGITS);
    power * ((0.999924 + 0.693121 * t) + (0.242640 + 0.055922 * t) * (t * t))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rough_logarithms_and_powers_are_near() {
        for k in -3000..3000 {
            let x = (0.23 * f64::from(k)).exp();
            if x.is_normal() {
                assert!((binary_logarithm(x) - x.log2()).abs() < 1e-3, "{x}");
            }
            let y = 0.34 * f64::from(k) + 0.01;
            assert!((power_of_two(y) - y.exp2()).abs() <= 2e-4 * y.exp2(), "{y}");
        }
        assert_eq!(binary_logarithm(0.0), f64::NEG_INFINITY);
        assert_eq!(binary_logarithm(f64::INFINITY), f64::INFINITY);
        assert!(binary_logarithm(f64::NAN).is_nan());
        assert_eq!(power_of_two(f64::INFINITY), f64::INFINITY);
        assert_eq!(power_of_two(f64::NEG_INFINITY), 0.0);
        assert!(power_of_two(f64::NAN).is_nan());
    }
}
