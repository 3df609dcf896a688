//! Passes over the data in which runs have numbers of their own.
//!
//! All segments move side by side, each by the numbers of its run: they are inputs to it. What the
//! elimination of its initial state leaves goes into the factor of the runs that it shares numbers
//! with, from which these numbers are eliminated in their turn.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::block::Block;
use super::bounded::solve_bounded;
use super::column::Column;
use super::driving::OwnInputs;
use super::factor::Factor;
use super::motion::{Equations, Propagation};
use super::pass::{Linearised, Problem, Sums, block_width};
use super::per_run::{Eliminated, OwnNumber, deviations, eliminate, groupings_of_own, own, places};
use super::rounding::ABSORBED;
use super::rows::DesignRows;
use super::segments::{Segment, blocks};
use super::settling::{TangentRequest, expected_steps, settled};
use super::states::States;
use crate::dynamics::KeptScratch;
use crate::expr::Bounds;

/// Settles states and numbers for the present model, and linearises by another model of the same
/// motion. If `nearly`, a last step of the numbers may be left that promises next to nothing.
pub(super) fn settle_and_linearise(
    problem: &Problem,
    present: Equations,
    whole: Equations,
    states: &mut States,
    nearly: bool,
) -> Linearised {
    let clusters = Clusters::of(problem, present, states);
    let done = clusters.settled(problem, present, states, nearly);
    if std::ptr::eq(present.0, whole.0) {
        return clusters.eliminated(problem, whole, done);
    }
    let how = How::Settle { present, by: whole };
    let done = clusters.pass(problem, how, &clusters.everywhere(), states);
    clusters.eliminated(problem, whole, done)
}

/// Linearises at states and numbers that are settled.
pub(super) fn linearise(problem: &Problem, law: Equations, states: &States) -> Linearised {
    let mut states = states.clone();
    let clusters = Clusters::of(problem, law, &mut states);
    let done = clusters.pass(problem, How::Hold(law), &clusters.everywhere(), &mut states);
    clusters.eliminated(problem, law, done)
}

/// Weighted residuals of some segments at settled states and numbers, as those of
/// [`residuals`](super::pass::residuals), with what runs have for themselves.
pub(super) fn with_numbers<T>(
    problem: &Problem,
    law: Equations,
    states: &States,
    work: impl FnOnce(&Problem) -> T,
) -> T {
    let mut states = states.clone();
    let clusters = Clusters::of(problem, law, &mut states);
    let values = clusters.inputs(problem, law, &states);
    work(&inner(problem, &values))
}

/// The problem in which what runs have for themselves are inputs.
fn inner<'a>(problem: &Problem<'a>, values: &'a [f64]) -> Problem<'a> {
    let own = OwnInputs { count: own(problem.parameters).len(), values };
    Problem { parameters: &[], own, ..*problem }
}

/// What a pass does with the states.
#[derive(Clone, Copy)]
enum How<'a> {
    /// They are settled for the present model, and rows are by another of the same motion.
    Settle { present: Equations<'a>, by: Equations<'a> },
    /// They are settled.
    Hold(Equations<'a>),
}

impl<'a> How<'a> {
    fn by(self) -> Equations<'a> {
        match self {
            How::Settle { by, .. } => by,
            How::Hold(law) => law,
        }
    }
}

/// Runs that share numbers with each other and with no other run.
struct Cluster {
    numbers: Vec<OwnNumber>,
    /// Positions of their segments in the list of all.
    segments: Vec<usize>,
}

/// All runs.
struct Clusters {
    list: Vec<Cluster>,
    /// Of each run, which number of its cluster each parameter has there.
    places: Vec<Vec<usize>>,
}

/// A cluster, linearised.
struct Passed {
    /// By its numbers, then by theta.
    factor: Factor,
    sums: Sums,
}

/// What is left of a segment.
struct Left {
    state: Vec<f64>,
    rows: DMatrix<f64>,
    /// Squared norms of the columns of theta before the state was eliminated.
    touched: Vec<f64>,
    sums: Sums,
}

impl Clusters {
    /// The runs by what they share; where no numbers are known yet, those of theta are the first.
    fn of(problem: &Problem, law: Equations, states: &mut States) -> Clusters {
        let Problem { parameters, measured, segments, .. } = *problem;
        let by = groupings_of_own(parameters);
        if states.numbers.len() != by.len() * measured.runs() {
            let own = own(parameters);
            let mut first: Vec<f64> = own.iter().map(|j| parameters[*j].start).collect();
            for (place, of) in places(problem, law.0) {
                first[of] = law.1[place];
            }
            states.numbers = first.repeat(measured.runs());
        }
        let number = |run: usize| {
            let of = |(of, &by): (usize, &usize)| OwnNumber { run: measured.group_of(by, run), of };
            by.iter().enumerate().map(of).collect::<Vec<OwnNumber>>()
        };
        let numbers: Vec<Vec<OwnNumber>> = (0..measured.runs()).map(number).collect();
        // Runs that meet in a number become one cluster, which is named by its first run.
        let mut first: Vec<usize> = (0..measured.runs()).collect();
        let root = |first: &[usize], mut run: usize| {
            while first[run] != run {
                run = first[run];
            }
            run
        };
        for (run, numbers) in numbers.iter().enumerate() {
            for number in numbers {
                let (a, b) = (root(&first, run), root(&first, number.run));
                first[a.max(b)] = a.min(b);
            }
        }
        let mut clusters: BTreeMap<usize, Cluster> = BTreeMap::new();
        for (at, segment) in segments.list.iter().enumerate() {
            let cluster = clusters
                .entry(root(&first, segment.run))
                .or_insert_with(|| Cluster { numbers: Vec::new(), segments: Vec::new() });
            cluster.segments.push(at);
            cluster.numbers.extend(&numbers[segment.run]);
        }
        let mut places = vec![Vec::new(); measured.runs()];
        for cluster in clusters.values_mut() {
            cluster.numbers.sort();
            cluster.numbers.dedup();
            for &at in &cluster.segments {
                let run = segments.list[at].run;
                let place = |number| cluster.numbers.binary_search(number).ok();
                places[run] = numbers[run].iter().filter_map(place).collect();
            }
        }
        Clusters { list: clusters.into_values().collect(), places }
    }

    /// All clusters by their positions.
    fn everywhere(&self) -> Vec<usize> {
        (0..self.list.len()).collect()
    }

    /// What every run's numbers differ by from those of theta.
    fn inputs(&self, problem: &Problem, (dynamics, theta): Equations, states: &States) -> Vec<f64> {
        let mut of_law = vec![0.0; own(problem.parameters).len()];
        for (place, of) in places(problem, dynamics) {
            of_law[of] = theta[place];
        }
        deviations(problem.parameters, problem.measured, states, &of_law)
    }

    /// One pass over the segments of some clusters, whose states go with it.
    fn pass(
        &self,
        problem: &Problem,
        how: How,
        some: &[usize],
        states: &mut States,
    ) -> Vec<Passed> {
        let values = self.inputs(problem, how.by(), states);
        let inner = inner(problem, &values);
        let mut at: Vec<usize> =
            some.iter().flat_map(|&c| self.list[c].segments.iter().copied()).collect();
        // Blocks of segments of one length.
        at.sort_by_key(|&at| (problem.segments.list[at].samples(), at));
        let list: Vec<Segment> = at.iter().map(|&at| problem.segments.list[at]).collect();
        let starts: Vec<&[f64]> = at.iter().map(|&at| states.of(at)).collect();
        let (size, unknowns) = (2 * how.by().0.degrees(), how.by().0.unknowns());
        let longest = list.last().map_or(1, |segment| segment.samples());
        let width = block_width(problem, longest, size + unknowns + 1);
        let expected = match how {
            How::Settle { present, by } => expected_steps(&inner, present, by.0, states),
            How::Hold(_) => None,
        };
        let passed: Vec<Left> = blocks(0..list.len(), width)
            .into_par_iter()
            .map_init(KeptScratch::new, |scratch, range| {
                let block = Block::gather(&inner, &list[range.clone()]);
                let mut states = starts[range].concat();
                let (rows, unsettled) = match how {
                    How::Hold(law) => {
                        let by = Propagation { present: law, by: Some(law) };
                        let mut rows = DesignRows::integrate(&inner, by, &block, &states, scratch);
                        rows.eliminate_states(true);
                        (rows, 0)
                    }
                    How::Settle { present, by } => {
                        let request = TangentRequest {
                            law: by,
                            expected,
                            extrapolated: None,
                            responses: true,
                            nearly: false,
                        };
                        let (rows, taken) =
                            settled(&inner, present, Some(request), &block, &mut states, scratch);
                        (rows, taken.unsettled)
                    }
                };
                let mut left = left_of(&rows, &states, problem.weights.len());
                if let Some(first) = left.first_mut() {
                    first.sums.unsettled = unsettled;
                }
                rows.recycle(scratch);
                left
            })
            .flatten_iter()
            .collect();
        let mut of_segment: Vec<Option<Left>> = Vec::new();
        of_segment.resize_with(problem.segments.list.len(), || None);
        for (left, at) in passed.into_iter().zip(at) {
            states.of_mut(at).copy_from_slice(&left.state);
            of_segment[at] = Some(left);
        }
        let places = places(problem, how.by().0);
        let together = |&c: &usize| {
            let segments = &self.list[c].segments;
            let left = segments
                .iter()
                .filter_map(|&at| Some((problem.segments.list[at].run, of_segment[at].as_ref()?)));
            self.together(&self.list[c], left, &places, (unknowns, problem.weights.len()))
        };
        some.par_iter().map(together).collect()
    }

    /// What is left of the segments of a cluster, each with its run.
    fn together<'b>(
        &self,
        cluster: &Cluster,
        segments: impl Iterator<Item = (usize, &'b Left)>,
        places: &[(usize, usize)],
        (unknowns, observables): (usize, usize),
    ) -> Passed {
        let count = cluster.numbers.len();
        let mut factor = Factor::new(count + unknowns);
        let mut sums = Sums::new(observables);
        let mut touched = vec![0.0; count + unknowns];
        for (run, left) in segments {
            // The column of a number that runs have for themselves stands with the numbers.
            let column = |k: usize| {
                let own = places.iter().find(|(place, _)| *place == k);
                own.map_or(count + k, |(_, of)| self.places[run][*of])
            };
            let mut rows = DMatrix::zeros(left.rows.nrows(), count + unknowns + 1);
            for (k, from) in left.rows.column_iter().enumerate() {
                rows.set_column(column(k), &from);
            }
            factor.push(&rows, left.sums.rows);
            sums.add(&left.sums);
            for (k, squares) in left.touched.iter().enumerate() {
                touched[column(k)] += squares;
            }
        }
        factor.zero_columns(|k, norm| norm <= ABSORBED * touched[k.position()].sqrt());
        Passed { factor, sums }
    }

    /// Gauss-Newton for the numbers of all clusters while theta is held, the states settled at
    /// every step.
    fn settled(
        &self,
        problem: &Problem,
        law: Equations,
        states: &mut States,
        nearly: bool,
    ) -> Vec<Passed> {
        let tuning = &problem.tuning.settling;
        let how = How::Settle { present: law, by: law };
        let mut best = self.pass(problem, how, &self.everywhere(), states);
        let mut length = vec![1.0; self.list.len()];
        let mut moving = self.everywhere();
        for _ in 0..tuning.steps {
            let step = |&c: &usize| {
                let Step { change, promise } = self.step(problem, c, &best[c].factor, states);
                let sums = &best[c].sums;
                let part = if nearly { tuning.nearly_settled } else { tuning.settled };
                let least =
                    part * sums.loss + tuning.rounding * problem.floor.powi(2) * sums.rows as f64;
                let goes_on = promise > least && length[c] >= tuning.shortest;
                // What is left will be taken with the next step of theta.
                let left = if nearly && promise > 0.0 && promise <= least { promise } else { 0.0 };
                (c, goes_on.then_some(change), left)
            };
            let steps: Vec<(usize, Option<Vec<f64>>, f64)> = moving.par_iter().map(step).collect();
            let mut trial = states.clone();
            moving.clear();
            for (c, change, left) in steps {
                best[c].sums.loss -= left;
                best[c].sums.promised += left;
                let Some(change) = change else { continue };
                moving.push(c);
                for (place, change) in self.numbers_of(problem, c).zip(change) {
                    trial.numbers[place] += length[c] * change;
                }
            }
            if moving.is_empty() {
                break;
            }
            let next = self.pass(problem, how, &moving, &mut trial);
            for (&c, next) in moving.iter().zip(next) {
                let (old, new) = (&best[c].sums, &next.sums);
                let sane = new.loss.is_finite() && new.diverged <= old.diverged;
                if !(sane && (new.loss < old.loss || new.diverged < old.diverged)) {
                    length[c] *= tuning.shorter;
                    continue;
                }
                length[c] = 1.0;
                best[c] = next;
                for place in self.numbers_of(problem, c) {
                    states.numbers[place] = trial.numbers[place];
                }
                for &at in &self.list[c].segments {
                    states.of_mut(at).copy_from_slice(trial.of(at));
                }
            }
        }
        best
    }

    /// Where the numbers of a cluster stand among those of all runs.
    fn numbers_of<'b>(&'b self, problem: &Problem, c: usize) -> impl Iterator<Item = usize> + 'b {
        let count = own(problem.parameters).len();
        self.list[c].numbers.iter().map(move |number| number.run * count + number.of)
    }

    /// The step of the numbers of a cluster, theta held.
    fn step(&self, problem: &Problem, c: usize, factor: &Factor, states: &States) -> Step {
        let own = own(problem.parameters);
        let numbers = &self.list[c].numbers;
        let columns: Vec<Column> = Column::all(numbers.len()).collect();
        let factor = factor.select(&columns);
        let bounds = |column: Column| {
            let number = numbers[column.position()];
            let parameter = &problem.parameters[own[number.of]];
            let present = states.numbers[number.run * own.len() + number.of];
            // Far from where it is the linearised problem says nothing.
            let reach = present.abs().max(parameter.start.abs());
            let Bounds { lower, upper } = parameter.bounds.near(present, reach);
            Bounds { lower: lower - present, upper: upper - present }
        };
        let change = solve_bounded(&factor, bounds).values;
        let promise = factor.squares(&(&change * 0.0)) - factor.squares(&change);
        Step { change: change.as_slice().to_vec(), promise }
    }

    /// Eliminates the numbers of every cluster: their columns of theta are zero.
    fn eliminated(&self, problem: &Problem, whole: Equations, passed: Vec<Passed>) -> Linearised {
        let unknowns = whole.0.unknowns();
        let of = |(cluster, passed): (&Cluster, Passed)| {
            let (factor, eliminated) = eliminate(&cluster.numbers, &passed.factor);
            let mut sums = passed.sums;
            let taken = eliminated.determined.iter().filter(|determined| **determined).count();
            let left = sums.rows.saturating_sub(taken);
            let share = left as f64 / sums.rows.max(1) as f64;
            sums.freedom.iter_mut().for_each(|freedom| *freedom *= share);
            sums.rows = left;
            (factor, eliminated, sums)
        };
        let reduced: Vec<(Factor, Eliminated, Sums)> =
            self.list.par_iter().zip(passed).map(of).collect();
        let folds = problem.segments.folds.len().clamp(1, reduced.len().max(1));
        let mut out = Linearised::nothing(unknowns, problem.weights.len());
        out.sums.loss = 0.0;
        let of_fold = |fold: usize| {
            let parts = reduced.iter().skip(fold).step_by(folds).map(|(factor, ..)| (factor, 1));
            Factor::together(unknowns, parts)
        };
        out.folds = (0..folds).into_par_iter().map(of_fold).collect();
        for (_, eliminated, sums) in reduced {
            out.sums.add(&sums);
            out.eliminated.push(eliminated);
        }
        out
    }
}

/// A step of the numbers of a cluster.
struct Step {
    change: Vec<f64>,
    /// How much the linearised loss falls.
    promise: f64,
}

/// What is left of each segment of a block.
fn left_of(rows: &DesignRows, states: &[f64], observables: usize) -> Vec<Left> {
    let mut sums = vec![Sums::new(observables); rows.lanes];
    rows.sum_up_each(&mut sums, |lane| lane);
    let of = |(lane, (state, sums)): (usize, (&[f64], Sums))| {
        let (rows, touched) = rows.left_of(lane);
        Left { state: state.to_vec(), rows, touched, sums }
    };
    states.chunks_exact(rows.state.max(1)).zip(sums).enumerate().map(of).collect()
}
