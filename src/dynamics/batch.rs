//! Trajectories side by side, and the memory that moving them takes.

use std::cell::RefCell;
use std::ops::{Deref, DerefMut};

use super::drive::Drive;
use super::lanes::{gathered, scatter};
use crate::eval::{Aligned, InstructionSet, mark_broken};

/// Structure of arrays over `lanes` trajectories.
#[derive(Debug, Clone, PartialEq)]
pub struct Batch {
    /// Number of trajectories.
    pub lanes: usize,
    /// `[2n][lanes]`: coordinates, then momenta.
    pub state: Vec<f64>,
    /// `[lanes]`.
    pub time: Vec<f64>,
    /// d state / d (initial state, theta), `[2n][2n + P][lanes]`; empty when not wanted.
    pub tangent: Aligned,
    /// What inputs do from the times of the lanes on, until the next advance.
    pub drive: Drive,
    degrees: usize,
    unknowns: usize,
}

impl Batch {
    /// Trajectories of `degrees` degrees of freedom without tangents; all states and times zero.
    pub fn new(degrees: usize, lanes: usize) -> Batch {
        Batch {
            lanes,
            state: vec![0.0; 2 * degrees * lanes],
            time: vec![0.0; lanes],
            tangent: Aligned::default(),
            drive: Drive::default(),
            degrees,
            unknowns: 0,
        }
    }

    /// The same with tangents by the initial state (the identity) and `unknowns` numbers (zero).
    pub fn with_tangents(degrees: usize, lanes: usize, unknowns: usize) -> Batch {
        Batch::with_tangents_in(&mut Scratch::new(), degrees, lanes, unknowns)
    }

    /// The same in memory that `scratch` lends.
    pub(crate) fn with_tangents_in(
        scratch: &mut Scratch,
        degrees: usize,
        lanes: usize,
        unknowns: usize,
    ) -> Batch {
        let mut batch = Batch::new(degrees, lanes);
        batch.unknowns = unknowns;
        batch.tangent = scratch.lend(2 * degrees * batch.columns() * lanes);
        batch.reset_tangents();
        batch
    }

    /// Number of degrees of freedom n.
    pub fn degrees(&self) -> usize {
        self.degrees
    }

    /// Number of tangent columns, 2n + P.
    pub fn columns(&self) -> usize {
        2 * self.degrees + self.unknowns
    }

    /// Whether the batch carries tangents.
    pub fn has_tangents(&self) -> bool {
        !self.tangent.is_empty()
    }

    /// The present states become the initial ones: tangents back to identity and zero.
    pub fn reset_tangents(&mut self) {
        if self.tangent.is_empty() {
            return;
        }
        let (lanes, columns) = (self.lanes, self.columns());
        self.tangent.fill(0.0);
        for row in 0..2 * self.degrees {
            let start = (row * columns + row) * lanes;
            self.tangent[start..start + lanes].fill(1.0);
        }
    }

    /// Sets the time and state (2n numbers) of one trajectory.
    pub fn set(&mut self, lane: usize, time: f64, state: &[f64]) {
        self.time[lane] = time;
        for (row, &value) in state.iter().enumerate().take(2 * self.degrees) {
            self.state[row * self.lanes + lane] = value;
        }
    }

    /// The state of one trajectory, 2n numbers.
    pub fn get(&self, lane: usize) -> Vec<f64> {
        (0..2 * self.degrees).map(|row| self.state[row * self.lanes + lane]).collect()
    }

    /// The states of some trajectories.
    pub(super) fn without_tangents(&self, lanes: &[usize]) -> Batch {
        let mut some = Batch::new(self.degrees, lanes.len());
        some.time = lanes.iter().map(|&lane| self.time[lane]).collect();
        some.state = gathered(&self.state, self.lanes, lanes);
        some.drive = self.drive.of(lanes);
        some
    }

    /// Some trajectories with the tangents that they have.
    pub(super) fn with_tangents_of(&self, lanes: &[usize]) -> Batch {
        let mut some = self.without_tangents(lanes);
        some.unknowns = self.unknowns;
        some.tangent.reshape(self.tangent.len() / self.lanes.max(1) * lanes.len());
        some.tangent.copy_from_slice(&gathered(&self.tangent, self.lanes, lanes));
        some
    }

    /// Takes some trajectories back.
    pub(super) fn put_back(&mut self, lanes: &[usize], some: &Batch) {
        scatter(&mut self.time, self.lanes, lanes, &some.time);
        scatter(&mut self.state, self.lanes, lanes, &some.state);
        scatter(&mut self.tangent, self.lanes, lanes, &some.tangent);
        self.drive.take_back(lanes, &some.drive);
    }

    /// Whether every component of a trajectory's state is finite.
    pub fn is_finite(&self, lane: usize) -> bool {
        (0..2 * self.degrees).all(|row| self.state[row * self.lanes + lane].is_finite())
    }

    /// Turns lanes with any number that is not finite into NaN altogether.
    pub(super) fn condemn(&mut self, broken: &mut Vec<f64>) {
        let lanes = self.lanes;
        if lanes == 0 {
            return;
        }
        // x * 0 is NaN exactly where x is not finite, so a sum of zeros finds the broken lanes.
        broken.clear();
        broken.resize(lanes, 0.0);
        let set = InstructionSet::widest();
        mark_broken(set, broken, &self.state);
        mark_broken(set, broken, &self.tangent);
        if broken.iter().all(|mark| *mark == 0.0) {
            return;
        }
        for row in self.state.chunks_exact_mut(lanes).chain(self.tangent.chunks_exact_mut(lanes)) {
            for (mark, value) in broken.iter().zip(row) {
                *value += mark;
            }
        }
    }
}

/// Scratch memory of the integrators; one a thread. It grows to what is needed and stays.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Outputs of the last evaluation.
    pub(super) out: Aligned,
    /// Inputs that had to be copied together.
    pub(super) points: Vec<f64>,
    /// Times of the present stage, `[lanes]`.
    pub(super) time: Vec<f64>,
    /// Time of the present stage since the beginning of the advance, `[lanes]`.
    pub(super) since: Vec<f64>,
    /// What inputs do in the present advance.
    pub(super) drive: Drive,
    /// Step of each lane, `[lanes]`.
    pub(super) step: Vec<f64>,
    /// Step times stage coefficient, `[lanes]`.
    pub(super) scale: Vec<f64>,
    /// What rounding took from the states of the present advance, `[2n][lanes]`.
    pub(super) carry: Vec<f64>,
    /// Whatever an evaluator or a method wants.
    pub(super) workspace: Vec<f64>,
    /// The same for the kicks and the drifts of one advance, which begins with both empty.
    pub(super) again: [Vec<f64>; 2],
    /// Memory that nobody uses at present.
    spare: Vec<Aligned>,
}

impl Scratch {
    /// Empty scratch memory.
    pub fn new() -> Scratch {
        Scratch::default()
    }

    /// Memory for so many numbers, whatever they are.
    pub(crate) fn lend(&mut self, size: usize) -> Aligned {
        let mut memory = self.spare.pop().unwrap_or_default();
        memory.reshape(size);
        memory
    }

    /// Makes ready for evaluations at the present times of a batch.
    pub(super) fn stand_at(&mut self, batch: &Batch) {
        self.time.clone_from(&batch.time);
        self.drive.clone_from(&batch.drive);
        self.since.clear();
        self.since.resize(batch.lanes, 0.0);
    }

    /// Takes memory back that was lent, the last first.
    pub(crate) fn take_back(&mut self, memory: Aligned) {
        self.spare.push(memory);
    }
}

/// Scratch memory that its thread keeps from one use to the next: fresh memory has to be found,
/// and filled with zeros.
pub(crate) struct KeptScratch(Scratch);

/// Numbers that a thread keeps, at most.
const MOST_KEPT: usize = 4 << 20;

thread_local! {
    static KEPT: RefCell<Scratch> = RefCell::default();
}

impl KeptScratch {
    /// What the thread has kept, unless something else is using it.
    pub(crate) fn new() -> KeptScratch {
        KeptScratch(KEPT.try_with(RefCell::take).unwrap_or_default())
    }
}

impl Drop for KeptScratch {
    fn drop(&mut self) {
        let scratch = std::mem::take(&mut self.0);
        let held: usize = scratch.spare.iter().map(Aligned::capacity).sum();
        if held <= MOST_KEPT {
            // A thread that is coming to its end keeps nothing.
            let _ = KEPT.try_with(|kept| kept.replace(scratch));
        }
    }
}

impl Deref for KeptScratch {
    type Target = Scratch;

    fn deref(&self) -> &Scratch {
        &self.0
    }
}

impl DerefMut for KeptScratch {
    fn deref_mut(&mut self) -> &mut Scratch {
        &mut self.0
    }
}
