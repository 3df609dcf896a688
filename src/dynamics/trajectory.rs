//! Whole trajectories at given times.

use super::batch::{Batch, Scratch};
use super::equations::Dynamics;
use super::events::advance;
use super::methods::Method;

/// Why a trajectory ends where it does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    /// Every time was reached.
    Finished,
    /// The state left the finite numbers between `after` and the next time asked for.
    Diverged {
        /// The last time that was reached.
        after: f64,
    },
    /// The step control could not reach its tolerance between `after` and the next time asked
    /// for: the motion is near a singularity or too fast.
    Unresolved {
        /// The last time that was reached.
        after: f64,
    },
}

/// One trajectory at the times that were asked for, as far as it could be followed.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// The times reached, the first of them that of the start.
    pub times: Vec<f64>,
    /// `[sample][2n]`: coordinates, then momenta.
    pub states: Vec<Vec<f64>>,
    /// H at each sample.
    pub energies: Vec<f64>,
    /// Why it ends.
    pub stop: Stop,
}

/// How many steps are taken from one time to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StepControl {
    /// The same number in every interval.
    PerInterval(usize),
    /// As few equal steps as keep each step at most this long.
    Longest(f64),
    /// Twice as many again until the estimated error of an interval is below this part of
    /// 1 + |component|, or is rounding.
    Tolerance(f64),
}

impl StepControl {
    /// As near to machine precision as doubles allow.
    pub const FINEST: StepControl = StepControl::Tolerance(f64::EPSILON);
}

/// Most steps in one interval, before an interval counts as unresolved.
const MOST_STEPS: usize = 1 << 20;
/// Most steps in one interval that the error control tries.
const MOST_TRIED: usize = 1 << 13;
/// Change by twice as many steps, as part of 1 + |component|, that may be rounding.
const ROUNDING: f64 = 1e-12;

/// The method that [`simulate`] makes data with: the highest order that applies.
pub fn finest_method(dynamics: &Dynamics) -> Method {
    let suited = Method::all()
        .filter(|method| method.row().symplectic)
        .filter(|method| dynamics.separable() != (method.row().tableau().is_some()));
    suited.max_by_key(|method| method.row().order).unwrap_or_default()
}

/// Follows each of `starts` (2n numbers: coordinates, momenta), at `times[0]`, through all
/// `times`, which may run backward.
///
/// Missing numbers of a start are taken as 0. All starts are followed side by side; one that
/// cannot be followed any further ends there, and its [`Stop`] says why.
pub fn simulate(
    dynamics: &Dynamics,
    method: Method,
    theta: &[f64],
    starts: &[Vec<f64>],
    times: &[f64],
    pace: StepControl,
) -> Vec<Trajectory> {
    let lanes = starts.len();
    let mut batch = Batch::new(dynamics.degrees(), lanes);
    let mut out: Vec<Trajectory> = starts
        .iter()
        .map(|_| Trajectory {
            times: Vec::new(),
            states: Vec::new(),
            energies: Vec::new(),
            stop: Stop::Finished,
        })
        .collect();
    let Some(&first) = times.first() else { return out };
    for (lane, start) in starts.iter().enumerate() {
        batch.set(lane, first, start);
    }
    let mut walk = Walk { dynamics, method, theta, scratch: Scratch::new(), steps: 1 };
    let mut energies = vec![0.0; lanes];
    for (i, &time) in times.iter().enumerate() {
        if i > 0 {
            let after = times[i - 1];
            let resolved = walk.interval(&mut batch, time - after, pace);
            batch.time.fill(time);
            for (lane, trajectory) in out.iter_mut().enumerate() {
                if trajectory.stop != Stop::Finished || (resolved[lane] && batch.is_finite(lane)) {
                    continue;
                }
                trajectory.stop = if batch.is_finite(lane) {
                    Stop::Unresolved { after }
                } else {
                    Stop::Diverged { after }
                };
                batch.set(lane, time, &vec![f64::NAN; 2 * dynamics.degrees()]);
            }
        }
        dynamics.energy(&batch, theta, &mut energies, &mut walk.scratch);
        for (lane, trajectory) in out.iter_mut().enumerate() {
            if trajectory.stop == Stop::Finished {
                trajectory.times.push(time);
                trajectory.states.push(batch.get(lane));
                trajectory.energies.push(energies[lane]);
            }
        }
        if out.iter().all(|trajectory| trajectory.stop != Stop::Finished) {
            break;
        }
    }
    out
}

struct Walk<'a> {
    dynamics: &'a Dynamics,
    method: Method,
    theta: &'a [f64],
    scratch: Scratch,
    /// Steps that the last interval took.
    steps: usize,
}

impl Walk<'_> {
    /// Moves every lane on; says which of them were resolved.
    fn interval(&mut self, batch: &mut Batch, span: f64, pace: StepControl) -> Vec<bool> {
        let steps = match pace {
            StepControl::PerInterval(steps) => steps.max(1),
            StepControl::Longest(longest) => {
                let steps = (span.abs() / longest.abs()).ceil();
                // A step of nothing asks for more steps than there are: not resolved.
                if steps.is_nan() || steps > MOST_STEPS as f64 {
                    return vec![false; batch.lanes];
                }
                (steps as usize).max(1)
            }
            StepControl::Tolerance(tolerance) => return self.controlled(batch, span, tolerance),
        };
        *batch = self.moved(batch, span, steps);
        vec![true; batch.lanes]
    }

    fn moved(&mut self, batch: &Batch, span: f64, steps: usize) -> Batch {
        let mut batch = batch.clone();
        let spans = vec![span; batch.lanes];
        let (dynamics, method, scratch) = (self.dynamics, self.method, &mut self.scratch);
        advance(dynamics, method, &mut batch, &spans, steps, self.theta, scratch);
        batch
    }

    /// Doubles the steps until the error estimate of every lane is small.
    fn controlled(&mut self, batch: &mut Batch, span: f64, tolerance: f64) -> Vec<bool> {
        let lanes = batch.lanes;
        let gain = f64::from(self.method.row().order).exp2() - 1.0;
        let mut steps = (self.steps / 2).max(1);
        let mut coarse = self.moved(batch, span, steps);
        let mut previous = vec![f64::INFINITY; lanes];
        let mut settled = vec![false; lanes];
        let mut result = coarse.clone();
        loop {
            steps *= 2;
            let fine = self.moved(batch, span, steps);
            for lane in 0..lanes {
                if settled[lane] || !batch.is_finite(lane) {
                    continue;
                }
                let (a, b) = (coarse.get(lane), fine.get(lane));
                // A lane with anything infinite has an infinite change and goes on.
                let change = a.iter().zip(&b).fold(0.0, |worst: f64, (a, b)| {
                    let change = (a - b).abs() / (1.0 + b.abs());
                    if change.is_finite() { worst.max(change) } else { f64::INFINITY }
                });
                let rounding = change <= ROUNDING && change >= 0.25 * previous[lane];
                settled[lane] = change <= gain * tolerance || rounding;
                previous[lane] = change;
                // The last trial stands for lanes that never settle.
                result.set(lane, fine.time[lane], &b);
            }
            let waiting = |lane: usize| batch.is_finite(lane) && !settled[lane];
            if !(0..lanes).any(waiting) {
                self.steps = steps;
                break;
            }
            if steps >= MOST_TRIED {
                self.steps = 1;
                break;
            }
            coarse = fine;
        }
        result.time = coarse.time;
        *batch = result;
        settled
    }
}
