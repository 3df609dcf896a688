//! The cheapest method and number of steps that reach a tolerance.

use super::batch::{Batch, Scratch};
use super::equations::Dynamics;
use super::events::advance;
use super::methods::{Method, MethodKind};

/// What to integrate with, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct StepChoice {
    /// The method.
    pub method: Method,
    /// Steps for each span.
    pub steps: usize,
    /// Largest error of each component of the state over the sample, `[2n]`.
    pub error: Vec<f64>,
    /// Force evaluations for each span.
    pub cost: usize,
    /// Whether the error is below the tolerance.
    pub reached: bool,
    /// One sentence for the user.
    pub reason: String,
}

/// Numbers of steps that are tried, times powers of two.
const LADDER: [usize; 2] = [2, 3];
/// Most force evaluations for one span that are tried.
const MOST_EVALUATIONS: usize = 4_000;
/// The reference may err by this part of the tolerance.
const REFERENCE_SHARE: f64 = 0.05;

/// Picks the cheapest (method, steps) whose largest error over the sample is below
/// `tolerance`, one number a component of the state, `[2n]`.
///
/// `sample` holds starts, `span` the time that each of them goes on for. Splittings are tried
/// when the dynamics separates, Gauss-Legendre and explicit methods otherwise; of these only the
/// former where all motion comes from H and the method is to `keep` its structure. The truth is a
/// solution of the highest order with more and more steps, until it settles; starts where it does
/// not (near a singularity, or diverging) are left out. A tolerance below rounding is raised to it.
pub fn choose_steps(
    dynamics: &Dynamics,
    theta: &[f64],
    sample: &Batch,
    span: &[f64],
    tolerance: &[f64],
    keep: bool,
    scratch: &mut Scratch,
) -> StepChoice {
    let mut methods: Vec<Method> = Method::all()
        .filter(|method| match method.row().kind {
            MethodKind::Splitting(_) => dynamics.separable(),
            MethodKind::Implicit(_) => !dynamics.separable(),
            MethodKind::Explicit(_) => !(dynamics.separable() || keep && dynamics.is_hamiltonian()),
        })
        .collect();
    // The highest order first: it bounds what the others may cost.
    methods.sort_by_key(|method| std::cmp::Reverse(method.row().order));
    let tolerance = raised(tolerance, sample);
    let mut trial =
        TrialSteps { dynamics, theta, sample, span, tolerance, scratch, truth: Vec::new() };
    let settled = trial.find_truth(methods[0]);
    let fallback = StepChoice {
        method: methods[0],
        steps: 1,
        error: vec![f64::INFINITY; 2 * dynamics.degrees()],
        cost: methods[0].cost(),
        reached: false,
        reason: "no trajectory of the sample stays finite, so that nothing can be estimated"
            .to_string(),
    };
    if settled == 0 {
        return fallback;
    }

    let mut best: Option<StepChoice> = None;
    for method in methods {
        for steps in ladder() {
            let cost = method.cost() * steps;
            let limit = match &best {
                Some(best) if best.reached => best.cost,
                _ => MOST_EVALUATIONS,
            };
            if cost >= limit {
                break;
            }
            let error = trial.error(method, steps);
            let reached = error.iter().zip(&trial.tolerance).all(|(e, t)| e <= t);
            let better = match &best {
                None => true,
                Some(best) => {
                    reached || trial.excess(&error) < trial.excess(&best.error) && !best.reached
                }
            };
            if better {
                let reason = reason(method, steps, reached, trial.excess(&error));
                best = Some(StepChoice { method, steps, error, cost, reached, reason });
            }
            if reached {
                break;
            }
        }
    }
    best.unwrap_or(fallback)
}

/// 1, 2, 3, 4, 6, 8, 12, 16, ...
fn ladder() -> impl Iterator<Item = usize> {
    std::iter::once(1)
        .chain((0..20).flat_map(|power| LADDER.into_iter().map(move |first| first << power)))
}

fn reason(method: Method, steps: usize, reached: bool, excess: f64) -> String {
    let plural = if steps == 1 { "step" } else { "steps" };
    let name = method.row().name;
    if reached {
        format!("{name} with {steps} {plural} an interval errs by {excess:.1e} of the tolerance")
    } else {
        format!(
            "no method reaches the tolerance: {name} with {steps} {plural} an interval comes \
             nearest, {excess:.1e} times above it"
        )
    }
}

/// The tolerance, at least a few roundings of the largest value of each component.
fn raised(tolerance: &[f64], sample: &Batch) -> Vec<f64> {
    let rows = sample.state.chunks_exact(sample.lanes.max(1));
    rows.enumerate()
        .map(|(row, values)| {
            let largest =
                values.iter().filter(|v| v.is_finite()).fold(0.0, |a: f64, v| a.max(v.abs()));
            let wanted = tolerance.get(row).copied().unwrap_or(0.0);
            wanted.max(64.0 * f64::EPSILON * largest).max(f64::MIN_POSITIVE)
        })
        .collect()
}

struct TrialSteps<'a> {
    dynamics: &'a Dynamics,
    theta: &'a [f64],
    sample: &'a Batch,
    span: &'a [f64],
    tolerance: Vec<f64>,
    scratch: &'a mut Scratch,
    /// `[2n][lanes]`; NaN where it does not settle.
    truth: Vec<f64>,
}

impl TrialSteps<'_> {
    fn run(&mut self, method: Method, steps: usize) -> Vec<f64> {
        let mut batch = Batch::new(self.dynamics.degrees(), self.sample.lanes);
        batch.state.clone_from(&self.sample.state);
        batch.time.clone_from(&self.sample.time);
        batch.drive.clone_from(&self.sample.drive);
        advance(self.dynamics, method, &mut batch, self.span, steps, self.theta, self.scratch);
        batch.state
    }

    /// Doubles the steps until most lanes settle; returns how many did.
    fn find_truth(&mut self, method: Method) -> usize {
        let lanes = self.sample.lanes;
        let mut steps = 4;
        let mut coarse = self.run(method, steps);
        let mut before = 0;
        loop {
            steps *= 2;
            let mut fine = self.run(method, steps);
            let settled: Vec<bool> = (0..lanes)
                .map(|lane| {
                    self.tolerance.iter().enumerate().all(|(row, tolerance)| {
                        let at = row * lanes + lane;
                        let rounding = 256.0 * f64::EPSILON * fine[at].abs();
                        (fine[at] - coarse[at]).abs() <= rounding.max(REFERENCE_SHARE * tolerance)
                    })
                })
                .collect();
            let finite = (0..lanes).filter(|&lane| fine[lane].is_finite()).count();
            let count = settled.iter().filter(|&&settled| settled).count();
            // A few lanes that never settle must not cost more than all the others.
            let stuck = count == before && 10 * count >= 9 * finite;
            before = count;
            if count == finite || stuck || 2 * steps * method.cost() > MOST_EVALUATIONS {
                for row in fine.chunks_exact_mut(lanes.max(1)) {
                    for (value, settled) in row.iter_mut().zip(&settled) {
                        if !settled {
                            *value = f64::NAN;
                        }
                    }
                }
                self.truth = fine;
                return count;
            }
            coarse = fine;
        }
    }

    /// Largest error of each component over the lanes whose truth is known.
    fn error(&mut self, method: Method, steps: usize) -> Vec<f64> {
        let state = self.run(method, steps);
        let lanes = self.sample.lanes.max(1);
        let rows = state.chunks_exact(lanes).zip(self.truth.chunks_exact(lanes));
        rows.map(|(state, truth)| {
            let known = state.iter().zip(truth).filter(|(_, truth)| truth.is_finite());
            known.fold(0.0, |worst: f64, (state, truth)| {
                let error = (state - truth).abs();
                if error.is_finite() { worst.max(error) } else { f64::INFINITY }
            })
        })
        .collect()
    }

    /// Largest error in units of the tolerance.
    fn excess(&self, error: &[f64]) -> f64 {
        error.iter().zip(&self.tolerance).fold(0.0, |worst, (e, t)| worst.max(e / t))
    }
}
