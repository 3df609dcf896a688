//! Points along trajectories, where candidates are evaluated.
//!
//! Where forces are asked to act along the measured motion, each is there twice: what changes
//! velocities or readings themselves says by that where the motion was, and acts along the model's.

/// The motion along which forces act.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Along {
    /// The model's: it has no noise, and is not where the motion was.
    Model,
    /// The measured one, as far as the model is off by more than noise.
    Measured,
}

/// The points of all segments.
pub(super) struct Points {
    /// Nodes, through which smooth functions are interpolated.
    pub(super) nodes: PhasePoints,
    /// Finer ones where forces act.
    pub(super) fine: PhasePoints,
}

/// Points in phase space, side by side.
#[derive(Debug, Clone, Default)]
pub(super) struct PhasePoints {
    /// `[component][point]`, coordinates before momenta; in each row first all points where the
    /// model has them, then all where forces act, if they are others.
    pub(super) states: Vec<f64>,
    /// Time at each of these.
    pub(super) times: Vec<f64>,
    /// Number of points, each counted once.
    pub(super) count: usize,
}

impl PhasePoints {
    /// From the states of all points where the model has them, those where forces act, none if they
    /// are the same, and their times.
    pub(super) fn of(modelled: &[Vec<f64>], forced: &[Vec<f64>], times: Vec<f64>) -> PhasePoints {
        let size = modelled.first().map_or(0, Vec::len);
        let row =
            |component: usize| modelled.iter().chain(forced).map(move |point| point[component]);
        let states = (0..size).flat_map(row).collect();
        let times = if forced.is_empty() { times } else { times.repeat(2) };
        PhasePoints { states, times, count: modelled.len() }
    }

    /// Values in each row: one for each point, or two.
    pub(super) fn values(&self) -> usize {
        self.times.len()
    }

    /// Some of the points, spread evenly over all of them.
    pub(super) fn sample(&self, most: usize) -> PhasePoints {
        let count = self.count.min(most);
        // An odd fraction of the length, so that the places do not fall into step with segments.
        let place = |i: usize| (2 * i + 1) * self.count / (2 * count.max(1));
        let chosen = |values: &[f64]| -> Vec<f64> {
            let all = values.chunks_exact(self.count.max(1));
            all.flat_map(|each| (0..count).map(|i| each[place(i)])).collect()
        };
        PhasePoints { states: chosen(&self.states), times: chosen(&self.times), count }
    }

    /// States, and the times after them: `[component, time][point]`.
    pub(super) fn with_times(&self) -> Vec<f64> {
        self.states.iter().chain(&self.times).copied().collect()
    }
}
