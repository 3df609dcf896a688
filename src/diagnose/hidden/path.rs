//! The motion of what is known, by the model that stands, with what it leaves of the measurements.

use nalgebra::{DMatrix, DVector};

use super::orbit::Path;
use super::response::{Row, Stretch};
use crate::diagnose::law_on_data::LawOnData;
use crate::diagnose::settling::{Settled, settle};
use crate::diagnose::window::longest;
use crate::dynamics::{Batch, Dynamics, Scratch, advance};
use crate::expr::Observed;
use crate::fit::segments::Segment;

/// Bodies that attract each other as their masses and one over the square of the distance.
pub(super) struct Attracting {
    pub(super) names: Vec<String>,
    /// Places of their coordinates.
    pub(super) coordinates: Vec<Vec<usize>>,
    pub(super) masses: Vec<f64>,
    /// The constant of gravitation.
    pub(super) gravity: f64,
}

/// What a model says of known bodies, one stretch of time after the other.
pub(super) struct Known {
    pub(super) path: Path,
    pub(super) stretches: Vec<Stretch>,
    /// What is left of each stretch, in units of the noise.
    pub(super) residuals: Vec<DVector<f64>>,
    /// The observable of every residual.
    pub(super) observables: Vec<usize>,
}

/// The model with the best states of the longest segments over which it keeps near the
/// measurements: what else pulls is then small.
pub(super) fn near<'a>(model: &LawOnData<'a>) -> Settled<'a> {
    let tuning = &model.tuning().hidden;
    let spreads = model.spreads();
    let mut window = longest(model);
    loop {
        let settled = settle(model.with_window(window));
        let far = |(observable, spread): (usize, &f64)| {
            let sums = &settled.sums;
            let mean = sums.squares[observable] / sums.freedom[observable].max(1.0);
            model.law.noise()[observable] * mean.sqrt() > tuning.largest_error * spread
        };
        let is_far = settled.sums.diverged > 0 || spreads.iter().enumerate().any(far);
        if !is_far || window <= tuning.shortest {
            return settled;
        }
        window = (window / 2).max(tuning.shortest);
    }
}

impl Known {
    /// Along the settled motion of a model; `noise` says how many times its noise each observable
    /// is off by. `None` where its motion is lost or too little was measured.
    pub(super) fn along(settled: &Settled, bodies: &Attracting, noise: &[f64]) -> Option<Known> {
        let model = &settled.model;
        let measured = &model.data.packed;
        let time = |segment: &Segment, sample: usize| {
            measured.clock_of(segment.run).time(measured.times_of(segment.run)[sample])
        };
        let mut order: Vec<usize> = (0..settled.segments.list.len()).collect();
        let list = &settled.segments.list;
        order.sort_by(|&a, &b| {
            time(&list[a], list[a].first).total_cmp(&time(&list[b], list[b].first))
        });
        let samples: usize = list.iter().map(|segment| segment.samples()).sum();
        let stride = samples.div_ceil(model.tuning().hidden.nodes.max(1));
        let dynamics = model.law.dynamics();
        let mut follower = Follower {
            model,
            bodies,
            theta: model.law.theta(&dynamics),
            masses: model.law.masses()?,
            dynamics,
            scratch: Scratch::new(),
            path: Path {
                times: Vec::new(),
                places: Vec::new(),
                velocities: Vec::new(),
                masses: bodies.masses.clone(),
                gravity: bodies.gravity,
                axes: bodies.coordinates.first()?.len(),
            },
        };
        let all = settled.residuals();
        let mut known = (Vec::new(), Vec::new(), Vec::new());
        let mut reached: Option<Batch> = None;
        for at in order {
            let segment = &list[at];
            let start = time(segment, segment.first);
            if let Some(batch) = &mut reached {
                // Runs that begin together are not one after the other.
                if batch.time[0] >= start {
                    continue;
                }
                follower.cross(batch, start)?;
            }
            let mut batch = follower.batch(start, settled.states.of(at));
            let mut nodes: Vec<usize> = (segment.first..segment.last).step_by(stride).collect();
            nodes.push(segment.last);
            let first = follower.path.times.len();
            let mut transitions = Vec::with_capacity(nodes.len());
            follower.take(&batch);
            for pair in nodes.windows(2) {
                transitions.push(follower.go_on(&mut batch, time(segment, pair[1]))?);
                follower.take(&batch);
            }
            let mut rows = Vec::new();
            let mut left = Vec::new();
            for (observable, residuals) in all[at].iter().enumerate() {
                for (node, sample) in nodes.iter().enumerate() {
                    let residual = residuals[sample - segment.first] / noise[observable];
                    if residual.is_finite() {
                        let weight = follower.weight(observable) / noise[observable];
                        rows.push(Row { node, component: observable, weight });
                        left.push(residual);
                        known.2.push(observable);
                    }
                }
            }
            let times = follower.path.times[first..].to_vec();
            let stretch = Stretch::new(first, times, transitions, rows)?;
            known.1.push(stretch.beyond_start(DVector::from_vec(left)));
            known.0.push(stretch);
            reached = Some(batch);
        }
        let (stretches, residuals, observables) = known;
        let path = follower.path;
        (path.times.len() > 2).then_some(Known { path, stretches, residuals, observables })
    }
}

/// A motion that is followed, with where it comes by.
struct Follower<'a> {
    model: &'a LawOnData<'a>,
    bodies: &'a Attracting,
    dynamics: Dynamics,
    theta: Vec<f64>,
    /// Of each coordinate.
    masses: Vec<f64>,
    scratch: Scratch,
    path: Path,
}

impl Follower<'_> {
    fn batch(&self, time: f64, state: &[f64]) -> Batch {
        let (degrees, unknowns) = (self.dynamics.degrees(), self.dynamics.unknowns());
        let mut batch = Batch::with_tangents(degrees, 1, unknowns);
        batch.set(0, time, state);
        batch
    }

    /// One over the noise of an observable, for a component of the state.
    fn weight(&self, observable: usize) -> f64 {
        let weight = 1.0 / self.model.law.noise()[observable];
        let momentum = observable.checked_sub(self.dynamics.degrees());
        match (momentum, self.model.system().observed) {
            (Some(i), Observed::Velocities) => weight / self.masses[i],
            _ => weight,
        }
    }

    /// Goes on to a time; the transition of the state. `None` where the motion is lost.
    fn go_on(&mut self, batch: &mut Batch, time: f64) -> Option<DMatrix<f64>> {
        batch.reset_tangents();
        let span = [time - batch.time[0]];
        let stepping = self.model.law.stepping();
        let steps = stepping.steps(&span);
        let Follower { dynamics, theta, scratch, .. } = self;
        advance(dynamics, stepping.method, batch, &span, steps, theta, scratch);
        let (size, columns) = (2 * dynamics.degrees(), batch.columns());
        let finite = batch.is_finite(0);
        finite.then(|| DMatrix::from_fn(size, size, |r, c| batch.tangent[r * columns + c]))
    }

    /// Goes on to the next stretch, where nothing was measured.
    fn cross(&mut self, batch: &mut Batch, to: f64) -> Option<()> {
        let usual = self.model.data.packed.typical_step().max(f64::MIN_POSITIVE);
        let (from, intervals) = (batch.time[0], ((to - batch.time[0]) / usual).ceil());
        let intervals = intervals.clamp(1.0, MOST_BETWEEN) as usize;
        for k in 1..intervals {
            self.go_on(batch, from + (to - from) * k as f64 / intervals as f64)?;
            self.take(batch);
        }
        Some(())
    }

    /// Takes where all bodies are.
    fn take(&mut self, batch: &Batch) {
        let state = batch.get(0);
        let n = self.dynamics.degrees();
        let all = &self.bodies.coordinates;
        let of = |value: &dyn Fn(usize) -> f64| -> Vec<[f64; 3]> {
            let place = |body: &Vec<usize>| -> [f64; 3] {
                std::array::from_fn(|axis| body.get(axis).map_or(0.0, |&i| value(i)))
            };
            all.iter().map(place).collect()
        };
        self.path.times.push(batch.time[0]);
        self.path.places.push(of(&|i| state[i]));
        self.path.velocities.push(of(&|i| state[n + i] / self.masses[i]));
    }
}

/// Nodes between two stretches, at most.
const MOST_BETWEEN: f64 = 1e4;
