//! What no catalogue has: a bump, a delay, a body that nobody measures.

use leverrier::internals::data::{Clock, Dataset, Run};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::bases::{Base, base};
use super::{Case, case_reaching, difference, measured, space, starts, times};

/// Something that acts and that no effect describes.
pub(crate) struct Stranger {
    /// What it is.
    pub name: &'static str,
    /// Name of its base.
    pub base: &'static str,
    /// How it is hidden.
    pub how: How,
}

/// How a stranger is hidden.
pub(crate) enum How {
    /// A statement of the language, one coefficient for its terms.
    Statement(&'static str),
    /// A force on the first coordinate that goes with what the last one was a while ago. In a
    /// linear system it would be what a spring and a damper do, so it acts in nonlinear ones.
    Delay(f64),
    /// A body on a circle of this radius and turning rate, which pulls by the square of distance.
    Body { radius: f64, rate: f64 },
}

/// How far a stranger moves the samples, in parts of their spread. Farther than what has a name:
/// a delay or a distant body that acts weakly is, up to the noise, what damping or a spring does.
const REACH: f64 = 0.5;

/// All strangers of the benchmark.
pub(crate) static STRANGERS: &[Stranger] = &[
    Stranger {
        name: "bump",
        base: "pendulum",
        how: How::Statement("V += span{ bump: exp(-((q - 0.5)/0.2)^2) }"),
    },
    Stranger {
        name: "bump",
        base: "Duffing",
        how: How::Statement("V += span{ bump: exp(-((q + 0.3)/0.15)^2) }"),
    },
    Stranger {
        name: "bump",
        base: "trap",
        how: How::Statement("V += span{ bump: exp(-((x - 0.3)^2 + (y + 0.2)^2)/0.1) }"),
    },
    Stranger { name: "delay", base: "pendulum", how: How::Delay(8.0) },
    Stranger { name: "delay", base: "Duffing", how: How::Delay(8.0) },
    Stranger { name: "hidden body", base: "Kepler", how: How::Body { radius: 1.9, rate: 0.38 } },
    Stranger { name: "hidden body", base: "trap", how: How::Body { radius: 2.0, rate: 0.9 } },
];

impl Stranger {
    /// Whether a term of the language says it.
    pub(crate) fn is_statement(&self) -> bool {
        matches!(self.how, How::Statement(_))
    }

    /// Clean measurements of runs from `starts` at evenly spaced `times`, for each strength.
    pub(crate) fn motion<'a>(
        &self,
        base: &'a Base,
        starts: &'a [Vec<f64>],
        times: &'a [f64],
        seed: u64,
    ) -> impl Fn(f64) -> Dataset + 'a {
        let (delay, body) = match self.how {
            How::Statement(_) => (0.0, None),
            How::Delay(delay) => (delay, None),
            How::Body { radius, rate } => (0.0, Some((radius, rate))),
        };
        move |strength| Force { strength, delay, body }.runs_from(base, starts, times, seed)
    }

    /// Measurements with the stranger in them.
    pub(crate) fn case(&self, noise: f64, seed: u64) -> Case {
        let base = base(self.base);
        match self.how {
            How::Statement(statement) => case_reaching(REACH, base, statement, noise, seed),
            How::Delay(delay) => hidden(base, noise, seed, |strength| {
                let force = Force { strength, delay, body: None };
                force.dataset(base, seed)
            }),
            How::Body { radius, rate } => hidden(base, noise, seed, |strength| {
                let force = Force { strength, delay: 0.0, body: Some((radius, rate)) };
                force.dataset(base, seed)
            }),
        }
    }
}

/// Finds the strength that moves the samples by [`REACH`].
fn hidden(base: &Base, noise: f64, seed: u64, data: impl Fn(f64) -> Dataset) -> Case {
    let plain = data(0.0);
    let (mut low, mut high) = (1e-4f64, 10.0f64);
    for _ in 0..14 {
        let middle = (low * high).sqrt();
        let moved = difference(&plain, &data(middle));
        if moved <= REACH { low = middle } else { high = middle }
    }
    measured(base, data(low), noise, seed)
}

struct Force {
    strength: f64,
    delay: f64,
    body: Option<(f64, f64)>,
}

/// Steps of the integrator between samples.
const STEPS: usize = 20;

impl Force {
    /// All runs; classical Runge-Kutta with the past kept for the delay (method of steps).
    fn dataset(&self, base: &Base, seed: u64) -> Dataset {
        self.runs_from(base, &starts(base, seed), &times(base), seed)
    }

    /// The same from `starts` at evenly spaced `times`.
    fn runs_from(&self, base: &Base, starts: &[Vec<f64>], times: &[f64], seed: u64) -> Dataset {
        let mut generator = Pcg64::seed_from_u64(seed ^ 0x5bd1);
        let observables = space(base).system.observables();
        let runs = starts.iter().enumerate().map(|(number, start)| {
            let phase = generator.random_range(0.0..std::f64::consts::TAU);
            let states = self.run(base, start, times, phase);
            Run {
                name: (number + 1).to_string(),
                times: times.to_vec(),
                values: (0..start.len())
                    .map(|row| states.iter().map(|z| z[row]).collect())
                    .collect(),
                lines: (0..times.len() as u64).map(|i| i + 2).collect(),
                clock: Clock::default(),
                inputs: Vec::new(),
                groups: Vec::new(),
                errors: Vec::new(),
            }
        });
        Dataset { observables, runs: runs.collect(), inputs: Vec::new() }
    }

    fn run(&self, base: &Base, start: &[f64], times: &[f64], phase: f64) -> Vec<Vec<f64>> {
        let step = (times[1] - times[0]) / STEPS as f64;
        let lag = (self.delay / step).round() as usize;
        let mut z = start.to_vec();
        let mut past = vec![start[start.len() / 2 - 1]];
        let mut out = vec![z.clone()];
        // It moves for as long as the delay before the first sample, so that there is a past.
        let total = (times.len() - 1) * STEPS + lag;
        for i in 0..total {
            if i == lag {
                out = vec![z.clone()];
            }
            let t = step * (i as f64 - lag as f64);
            // The past between two steps is a straight line.
            let was = |shift: f64| {
                let at = i as f64 + shift - lag as f64;
                let low = (at.floor().max(0.0) as usize).min(past.len() - 1);
                let next = past[(low + 1).min(past.len() - 1)];
                past[low] + (next - past[low]) * (at - low as f64).clamp(0.0, 1.0)
            };
            let rate =
                |z: &[f64], shift: f64| self.rate(base, z, t + shift * step, was(shift), phase);
            let along = |z: &[f64], k: &[f64], h: f64| -> Vec<f64> {
                z.iter().zip(k).map(|(z, k)| z + h * k).collect()
            };
            let k1 = rate(&z, 0.0);
            let k2 = rate(&along(&z, &k1, 0.5 * step), 0.5);
            let k3 = rate(&along(&z, &k2, 0.5 * step), 0.5);
            let k4 = rate(&along(&z, &k3, step), 1.0);
            for (j, z) in z.iter_mut().enumerate() {
                *z += step / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]);
            }
            past.push(z[z.len() / 2 - 1]);
            if i >= lag && (i + 1 - lag).is_multiple_of(STEPS) {
                out.push(z.clone());
            }
        }
        out
    }

    /// dq/dt and dp/dt; the bases' own laws written out by hand.
    fn rate(&self, base: &Base, z: &[f64], t: f64, was: f64, phase: f64) -> Vec<f64> {
        let n = z.len() / 2;
        let (q, p) = z.split_at(n);
        let mut force: Vec<f64> = match base.name {
            "pendulum" => vec![-q[0].sin()],
            "Duffing" => vec![-q[0] - q[0].powi(3)],
            "trap" => vec![-q[0], -1.4 * q[1]],
            "Kepler" => {
                let cube = q[0].hypot(q[1]).powi(3);
                vec![-q[0] / cube, -q[1] / cube]
            }
            other => panic!("{other} has no law here"),
        };
        match self.body {
            None => force[0] -= self.strength * was,
            Some((radius, rate)) => {
                let angle = rate * t + phase;
                let away = [radius * angle.cos() - q[0], radius * angle.sin() - q[1]];
                let cube = (away[0].powi(2) + away[1].powi(2) + 0.01).powf(1.5);
                for (force, away) in force.iter_mut().zip(away) {
                    *force += self.strength * away / cube;
                }
            }
        }
        p.iter().copied().chain(force).collect()
    }
}
