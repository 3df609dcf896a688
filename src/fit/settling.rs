//! The initial states of a block's segments, improved until they are settled.

use super::block::Block;
use super::blocking::BLOCKING;
use super::motion::{Equations, Propagation};
use super::pass::Problem;
use super::rows::DesignRows;
use super::segments::Segment;
use super::states::States;
use crate::dynamics::{Dynamics, KeptScratch, Scratch};

/// After so many steps the lanes that are still moving go on alone, where they are at most one in
/// [`FEW`]; it changes cost alone.
const TOGETHER: usize = 3;
const FEW: usize = 4;

/// What it took to settle the states of a block.
pub(super) struct Settlement {
    pub(super) steps: usize,
    /// Lanes that were still moving at the end.
    pub(super) unsettled: usize,
    /// By how much the loss falls with their next step, where that is all that is missing.
    pub(super) promised: f64,
}

/// What rows by theta are wanted of a block.
#[derive(Clone, Copy)]
pub(super) struct TangentRequest<'a> {
    /// The model whose theta it is.
    pub(super) law: Equations<'a>,
    /// Steps after which the states are expected to be settled.
    pub(super) expected: Option<usize>,
    /// Where the states are expected to be settled at once, `[lane][state]`.
    pub(super) extrapolated: Option<&'a [f64]>,
    /// Whether it is asked how the states respond to theta.
    pub(super) responses: bool,
    /// Whether nearly settled states will do: a step of theta and the states together needs no
    /// more, for what is eliminated is the step of the states.
    pub(super) nearly: bool,
}

/// Rows of a block at settled states, with these eliminated: without columns for theta, or with
/// those of `by`.
///
/// Rows by theta are costly. They are computed where `by` expects the states to be settled; if that
/// was too soon, once more at the end.
pub(super) fn settled(
    problem: &Problem,
    present: Equations,
    by: Option<TangentRequest>,
    block: &Block,
    states: &mut [f64],
    scratch: &mut Scratch,
) -> (DesignRows, Settlement) {
    let tuning = &problem.tuning.settling;
    let lanes = block.lanes();
    if let Some(by) = by
        && let Some(extrapolated) = by.extrapolated
        && let Some(rows) = at_once(problem, present, by, extrapolated, block, scratch)
    {
        states.copy_from_slice(extrapolated);
        return rows;
    }
    let mut search = Search::from(states, lanes);
    let mut taken = 0;
    while taken < tuning.steps {
        let here = by.filter(|by| by.expected == Some(taken));
        let propagation = Propagation { present, by: here.map(|by| by.law) };
        let mut rows = DesignRows::integrate(problem, propagation, block, &search.trial, scratch);
        rows.eliminate_states(here.is_some_and(|by| by.responses));
        let promised = rows.promised();
        let improved = search.step(problem, &rows, &promised, states);
        if search.open().next().is_none() && improved {
            // The rows at hand are those of the settled states.
            if by.is_none() || here.is_some() {
                return (rows, Settlement { steps: taken, unsettled: 0, promised: 0.0 });
            }
            rows.recycle(scratch);
            break;
        }
        let enough =
            |lane: usize| search.settled[lane] || is_nearly_still(problem, &rows, &promised, lane);
        if here.is_some_and(|by| by.nearly) && improved && (0..lanes).all(enough) {
            let taken = left_to_take(&promised, taken, |lane| search.settled[lane]);
            return (rows, taken);
        }
        rows.recycle(scratch);
        taken += 1;
        let open: Vec<usize> = search.open().collect();
        if taken >= TOGETHER && !open.is_empty() && open.len() * FEW <= lanes {
            taken = search.finish(problem, present, (block, &open), (states, taken), scratch);
            break;
        }
    }
    let propagation = Propagation { present, by: by.map(|by| by.law) };
    let mut rows = DesignRows::integrate(problem, propagation, block, states, scratch);
    rows.eliminate_states(by.is_some_and(|by| by.responses));
    let unsettled = search.open().count();
    (rows, Settlement { steps: taken, unsettled, promised: 0.0 })
}

/// The search of each lane for its best state.
struct Search {
    /// Where to look next, `[lane][state]`.
    trial: Vec<f64>,
    /// The least that was left.
    best: Vec<f64>,
    /// From the best state, `[state][lane]`.
    step: Vec<f64>,
    /// The part of it that is tried.
    length: Vec<f64>,
    settled: Vec<bool>,
}

impl Search {
    fn from(states: &[f64], lanes: usize) -> Search {
        Search {
            trial: states.to_vec(),
            best: vec![f64::INFINITY; lanes],
            step: vec![0.0; states.len()],
            length: vec![1.0; lanes],
            settled: vec![false; lanes],
        }
    }

    /// Lanes that are still moving.
    fn open(&self) -> impl Iterator<Item = usize> {
        self.settled.iter().enumerate().filter(|(_, settled)| !**settled).map(|(lane, _)| lane)
    }

    /// Takes in what the trial leaves, keeps in `states` what is better, and says whether no lane
    /// is worse off.
    fn step(
        &mut self,
        problem: &Problem,
        rows: &DesignRows,
        promised: &[f64],
        states: &mut [f64],
    ) -> bool {
        let tuning = &problem.tuning.settling;
        let lanes = self.settled.len();
        let size = states.len() / lanes.max(1);
        let steps = rows.state_steps();
        let mut improved = true;
        for lane in 0..lanes {
            let loss = rows.losses[lane];
            let still = is_still(problem, rows, promised, lane);
            let equal = still && loss <= self.best[lane] * (1.0 + tuning.equal_loss);
            let lower = loss < self.best[lane] || equal || self.settled[lane];
            let own = lane * size..(lane + 1) * size;
            if lower {
                self.best[lane] = loss;
                self.length[lane] = 1.0;
                self.settled[lane] = still;
                states[own.clone()].copy_from_slice(&self.trial[own.clone()]);
            } else {
                // The last step overshot: a quarter of it.
                self.length[lane] *= tuning.shorter;
                self.settled[lane] =
                    !self.best[lane].is_finite() || self.length[lane] < tuning.shortest;
                improved = false;
            }
            let part = if self.settled[lane] { 0.0 } else { self.length[lane] };
            for (place, at) in own.enumerate() {
                let step = &mut self.step[place * lanes + lane];
                if lower {
                    *step = steps[place * lanes + lane];
                }
                self.trial[at] = states[at] + part * *step;
            }
        }
        improved
    }

    /// The search of some lanes alone.
    fn of(&self, lanes: &[usize]) -> Search {
        let all = self.settled.len();
        let size = self.trial.len() / all.max(1);
        let own = |lane: &usize| self.trial[lane * size..(lane + 1) * size].iter().copied();
        let step = |place| lanes.iter().map(move |lane| self.step[place * all + lane]);
        Search {
            trial: lanes.iter().flat_map(own).collect(),
            best: lanes.iter().map(|&lane| self.best[lane]).collect(),
            step: (0..size).flat_map(step).collect(),
            length: lanes.iter().map(|&lane| self.length[lane]).collect(),
            settled: vec![false; lanes.len()],
        }
    }

    /// Goes on with the few lanes of a block that are still moving: the others would be integrated
    /// beside them for nothing. Gives the steps that were taken in all.
    fn finish(
        &mut self,
        problem: &Problem,
        present: Equations,
        (block, open): (&Block, &[usize]),
        (states, mut taken): (&mut [f64], usize),
        scratch: &mut Scratch,
    ) -> usize {
        let segments: Vec<Segment> = open.iter().map(|&lane| block.segments[lane]).collect();
        let few = Block::gather(problem, &segments);
        let size = states.len() / block.lanes().max(1);
        let own = |lane: usize| lane * size..(lane + 1) * size;
        let mut search = self.of(open);
        let mut moved: Vec<f64> =
            open.iter().flat_map(|&lane| states[own(lane)].to_vec()).collect();
        let propagation = Propagation { present, by: None };
        while taken < problem.tuning.settling.steps && search.open().next().is_some() {
            let mut rows =
                DesignRows::integrate(problem, propagation, &few, &search.trial, scratch);
            rows.eliminate_states(false);
            let promised = rows.promised();
            search.step(problem, &rows, &promised, &mut moved);
            rows.recycle(scratch);
            taken += 1;
        }
        for (place, &lane) in open.iter().enumerate() {
            states[own(lane)].copy_from_slice(&moved[own(place)]);
            self.settled[lane] = search.settled[place];
        }
        taken
    }
}

/// Whether the state of a lane is settled.
fn is_still(problem: &Problem, rows: &DesignRows, promised: &[f64], lane: usize) -> bool {
    let tuning = &problem.tuning.settling;
    let rounding = problem.floor.powi(2) * rows.measured[lane] as f64;
    promised[lane] <= tuning.settled * rows.losses[lane] + tuning.rounding * rounding
}

fn is_nearly_still(problem: &Problem, rows: &DesignRows, promised: &[f64], lane: usize) -> bool {
    promised[lane] <= problem.tuning.settling.nearly_settled * rows.losses[lane]
}

/// What is taken where all that is left is a last step of the lanes that are not settled.
fn left_to_take(promised: &[f64], steps: usize, settled: impl Fn(usize) -> bool) -> Settlement {
    let moving = || (0..promised.len()).filter(|&lane| !settled(lane));
    let promised = moving().map(|lane| promised[lane]).sum();
    Settlement { steps, unsettled: moving().count(), promised }
}

/// Rows where the states were extrapolated, if they are settled there, or nearly where that will
/// do.
///
/// Otherwise they were extrapolated too far for what is linear. Over many periods the misfit has
/// many minima, and from there a state may find another one than it had.
fn at_once(
    problem: &Problem,
    present: Equations,
    by: TangentRequest,
    extrapolated: &[f64],
    block: &Block,
    scratch: &mut Scratch,
) -> Option<(DesignRows, Settlement)> {
    let mut rows = DesignRows::integrate(
        problem,
        Propagation { present, by: Some(by.law) },
        block,
        extrapolated,
        scratch,
    );
    rows.eliminate_states(by.responses);
    let promised = rows.promised();
    let finite = |lane: usize| rows.losses[lane].is_finite();
    let still = |lane: usize| finite(lane) && is_still(problem, &rows, &promised, lane);
    let near =
        |lane: usize| by.nearly && finite(lane) && is_nearly_still(problem, &rows, &promised, lane);
    if (0..rows.lanes).all(|lane| still(lane) || near(lane)) {
        let taken = left_to_take(&promised, 0, still);
        return Some((rows, taken));
    }
    rows.recycle(scratch);
    None
}

/// Of few columns a needless try costs less than to look how many steps the states take.
pub(super) fn steps_of_few(by: &Dynamics) -> Option<usize> {
    (by.unknowns() <= 4 * by.degrees()).then_some(1)
}

/// Steps that the states of a few segments take, for each block to know when rows `by` theta are
/// worth while; of so few that they cost little beside all.
pub(super) fn expected_steps(
    problem: &Problem,
    present: Equations,
    by: &Dynamics,
    states: &States,
) -> Option<usize> {
    let tuning = &problem.tuning.settling;
    let known = steps_of_few(by);
    let few = (states.len() / tuning.expected_part).min(tuning.expected_from);
    if known.is_some() || few == 0 {
        return known;
    }
    let segments = &problem.segments.list[..few];
    let block = Block::gather(problem, segments);
    let mut tried = states.part(0..few).to_vec();
    let (_, taken) = settled(problem, present, None, &block, &mut tried, &mut KeptScratch::new());
    Some(taken.steps)
}

/// How the best states follow theta, to first order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Responses {
    size: usize,
    unknowns: usize,
    /// R_s^-1 times the columns of theta, then times the residuals, `[segment][column][state]`.
    values: Vec<f64>,
}

impl Responses {
    /// Those of no segments yet, of `segments` in the end; `None` where these would take too much
    /// memory.
    pub(super) fn of(segments: usize, size: usize, unknowns: usize) -> Option<Responses> {
        let numbers = segments.saturating_mul(size * (unknowns + 1));
        let values = Vec::new();
        (numbers <= BLOCKING.response_bytes / size_of::<f64>()).then_some(Responses {
            size,
            unknowns,
            values,
        })
    }

    /// Takes a block in, after elimination with responses.
    pub(super) fn take(&mut self, rows: &DesignRows) {
        let (lanes, columns) = (rows.lanes, self.unknowns + 1);
        let start = self.values.len();
        let each = columns * self.size;
        self.values.resize(start + lanes * each, 0.0);
        let mut solved = vec![0.0; self.size * lanes];
        for column in 0..columns {
            rows.solve(rows.state + column, &mut solved);
            for (i, solved) in solved.chunks_exact(lanes).enumerate() {
                let places = self.values[start + column * self.size + i..].iter_mut().step_by(each);
                places.zip(solved).for_each(|(place, x)| *place = *x);
            }
        }
    }

    /// Those of further segments.
    pub(super) fn append(&mut self, more: &Responses) {
        self.values.extend_from_slice(&more.values);
    }

    /// Moves the states to where they are expected to be best after theta's `change`.
    pub fn follow(&self, states: &mut States, change: &[f64]) {
        let each = (self.size * (self.unknowns + 1)).max(1);
        let states = states.all_mut().chunks_exact_mut(self.size.max(1));
        for (state, columns) in states.zip(self.values.chunks_exact(each)) {
            let (by_theta, step) = columns.split_at(self.size * self.unknowns);
            state.iter_mut().zip(step).for_each(|(x, step)| *x += step);
            for (column, by) in by_theta.chunks_exact(self.size).zip(change) {
                state.iter_mut().zip(column).for_each(|(x, column)| *x -= column * by);
            }
        }
    }
}
