//! Points of the model's own trajectories, where candidates are evaluated.

/// Points in phase space, side by side.
#[derive(Debug, Clone, Default)]
pub(super) struct PhasePoints {
    /// `[component][point]`, coordinates before momenta.
    pub(super) states: Vec<f64>,
    /// Time at each point.
    pub(super) times: Vec<f64>,
    /// Number of points.
    pub(super) count: usize,
}

impl PhasePoints {
    /// From the states of all points, one after the other, and their times.
    pub(super) fn of(points: &[Vec<f64>], times: Vec<f64>) -> PhasePoints {
        let size = points.first().map_or(0, Vec::len);
        let row = |component: usize| points.iter().map(move |point| point[component]);
        PhasePoints { states: (0..size).flat_map(row).collect(), times, count: points.len() }
    }

    /// Some of the points, spread evenly over all of them.
    pub(super) fn sample(&self, most: usize) -> PhasePoints {
        let count = self.count.min(most);
        let rows = self.states.chunks_exact(self.count.max(1));
        // An odd fraction of the length, so that the places do not fall into step with segments.
        let place = |i: usize| (2 * i + 1) * self.count / (2 * count.max(1));
        let states = rows.flat_map(|row| (0..count).map(move |i| row[place(i)])).collect();
        let times = (0..count).map(|i| self.times[place(i)]).collect();
        PhasePoints { states, times, count }
    }

    /// States, and the times after them: `[component, time][point]`.
    pub(super) fn with_times(&self) -> Vec<f64> {
        self.states.iter().chain(&self.times).copied().collect()
    }
}
