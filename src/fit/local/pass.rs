//! A pass over the data by sparse algebra: eight segments at a time are integrated with tangents
//! that reach as far as they act, and their initial states eliminated domain by domain.
//!
//! With J_s and J the derivatives of the residuals r by the states and by theta, and
//! N = J_s' J_s, what elimination leaves is J' J - J' J_s N^-1 J_s' J with the slopes
//! J' r - J' J_s N^-1 J_s' r. N^-1 falls off from site to site, and so N x = b for what acts in a
//! domain is solved on the domain and its halo.

use rayon::prelude::*;

use super::super::block::Block;
use super::super::pass::{Problem, Sums};
use super::super::segments::Segment;
use super::super::states::States;
use super::motion::Motion;
use super::plan::{Domain, Plan, Rows};
use crate::dynamics::{Batch, Drive, Dynamics, KeptScratch, LANES, Scratch};
use crate::eval::{
    Compared, Eight, InstructionSet, Lower, NOWHERE, add_entry_squares, add_gathered, add_lower,
    add_outer, add_scattered, compare, conjugate_gradients, factorise, solve_lower, solve_upper,
    squares, weigh_entries,
};

/// A pivot of J_s' J_s below this part of its diagonal is rounding: nothing determines the state.
const OPEN: f64 = 1e-13;
/// A step of the states is found to this part of itself by conjugate gradients: it settles them,
/// and what they settle at does not follow from it.
const STEP: f64 = 1e-7;
/// Their steps, at most. Where more are needed, which is seldom, domains are factorised.
const STEPS: usize = 40;
/// Right-hand sides that are solved for together.
const SIDES: usize = 4;

/// What a pass leaves of some segments, by pieces of theta.
#[derive(Clone)]
pub(super) struct Quadratic {
    /// The matrix, in the pattern of [`Plan::left`].
    pub(super) left: Vec<f64>,
    /// The slopes: what the gradient is, over -2.
    pub(super) slopes: Vec<f64>,
    /// Squared norm of each column before the states were eliminated.
    pub(super) touched: Vec<f64>,
    pub(super) sums: Sums,
    pub(super) tails: Tails,
}

/// How much is left out beyond the ends of what is kept, as parts of the largest. What is there
/// falls off with the distance ever faster, or as fast: it is no more than the last that is kept,
/// times what that is of the last but one.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Tails {
    /// Of tangents.
    pub(super) reach: f64,
    /// Of what states respond with.
    pub(super) halo: f64,
}

impl Tails {
    pub(super) fn with(self, other: Tails) -> Tails {
        Tails { reach: self.reach.max(other.reach), halo: self.halo.max(other.halo) }
    }
}

/// Settles the states at a theta and linearises by it: what each fold leaves; `None` where it was
/// stopped on the way, with some of the states settled.
pub(super) fn pass(
    problem: &Problem,
    plan: &Plan,
    law: (&Dynamics, &[f64]),
    states: &mut States,
    stopped: &(dyn Fn() -> bool + Sync),
) -> Option<Vec<Quadratic>> {
    let size = 2 * law.0.degrees();
    let mut rest = states.all_mut();
    let mut starts = Vec::new();
    for fold in &problem.segments.folds {
        starts.extend(rest.split_off_mut(..fold.len() * size));
    }
    let folds = problem.segments.folds.par_iter().zip(starts).with_max_len(1);
    folds
        .map_init(KeptScratch::new, |scratch, (fold, states)| {
            let segments = &problem.segments.list[fold.clone()];
            let mut work = Work::new(problem, plan, law);
            let parts = segments.chunks(LANES).zip(states.chunks_mut(LANES * size));
            for (segments, states) in parts {
                if stopped() {
                    return None;
                }
                work.take(segments, states, scratch);
            }
            Some(work.finish())
        })
        .collect()
}

/// The tails of a few segments from all over the data.
pub(super) fn tails(
    problem: &Problem,
    plan: &Plan,
    law: (&Dynamics, &[f64]),
    states: &States,
) -> Tails {
    let all = &problem.segments.list;
    let stride = all.len().div_ceil(LANES).max(1);
    let some: Vec<usize> = (0..all.len()).step_by(stride).collect();
    let segments: Vec<Segment> = some.iter().map(|&at| all[at]).collect();
    let mut own: Vec<f64> = some.iter().flat_map(|&at| states.of(at)).copied().collect();
    let mut work = Work::new(problem, plan, law);
    work.take(&segments, &mut own, &mut KeptScratch::new());
    work.tails
}

/// One fold while its segments go by, and the memory for eight of them.
struct Work<'a> {
    problem: &'a Problem<'a>,
    plan: &'a Plan,
    law: (&'a Dynamics, &'a [f64]),
    set: InstructionSet,
    sums: Sums,
    tails: Tails,
    left: Vec<Eight>,
    slopes: Vec<Eight>,
    touched: Vec<Eight>,
    tangents: Vec<Eight>,
    /// Weighted rows of the samples after the first, `[sample][row][entry]`.
    rows: Vec<Eight>,
    /// Weighted residuals, `[sample][observable]`, and what belongs to them.
    residuals: Vec<Eight>,
    weights: Vec<Eight>,
    scales: Vec<Eight>,
    losses: Eight,
    normal: Vec<Eight>,
    mixed: Vec<Eight>,
    /// J_s' r and the step of the states.
    gradient: Vec<Eight>,
    step: Vec<Eight>,
    promised: Eight,
    matrix: Vec<Eight>,
    inverse: Vec<Eight>,
    sides: Vec<Eight>,
    /// Whether conjugate gradients have found every step so far.
    iterates: bool,
    memory: Vec<Eight>,
}

impl<'a> Work<'a> {
    fn new(problem: &'a Problem<'a>, plan: &'a Plan, law: (&'a Dynamics, &'a [f64])) -> Work<'a> {
        let (size, pieces) = (2 * law.0.degrees(), plan.couplings.pieces.len());
        let zeros = |count: usize| vec![Eight::ZERO; count];
        Work {
            problem,
            plan,
            law,
            set: InstructionSet::widest(),
            sums: Sums::new(size),
            tails: Tails::default(),
            left: zeros(plan.left.entries()),
            slopes: zeros(pieces),
            touched: zeros(pieces),
            tangents: Vec::new(),
            rows: Vec::new(),
            residuals: Vec::new(),
            weights: Vec::new(),
            scales: Vec::new(),
            losses: Eight::ZERO,
            normal: zeros(plan.normal.entries()),
            mixed: zeros(plan.mixed.entries()),
            gradient: zeros(size),
            step: zeros(size),
            promised: Eight::ZERO,
            matrix: Vec::new(),
            inverse: Vec::new(),
            sides: Vec::new(),
            iterates: true,
            memory: Vec::new(),
        }
    }

    fn finish(self) -> Quadratic {
        let numbers = |list: &[Eight]| list.iter().map(Eight::sum).collect();
        Quadratic {
            left: numbers(&self.left),
            slopes: numbers(&self.slopes),
            touched: numbers(&self.touched),
            sums: self.sums,
            tails: self.tails,
        }
    }

    /// Settles up to eight segments from `states`, `[segment][state]`, and takes them in.
    fn take(&mut self, segments: &[Segment], states: &mut [f64], scratch: &mut Scratch) {
        let count = segments.len();
        let mut padded = segments.to_vec();
        padded.resize(LANES, segments[count - 1]);
        let block = Block::gather(self.problem, &padded);
        let settled = self.settle(&block, count, states, scratch);
        self.sums.unsettled += settled[..count].iter().filter(|settled| !**settled).count();
        for lane in 0..count {
            if self.losses.0[lane].is_finite() {
                self.sums.loss += self.losses.0[lane];
                self.sums.rows += block.counts[lane].saturating_sub(self.gradient.len());
            } else {
                self.sums.diverged += 1;
            }
        }
        self.add_pieces(block.samples);
        let plan = self.plan;
        for domain in &plan.domains {
            self.eliminate(domain, block.samples);
        }
        self.tails.reach = self.tails.reach.max(self.tail_of_tangents(block.samples));
    }

    /// Gauss-Newton for the states at a theta that is held, each segment by itself, as
    /// [`settled`](super::super::settling::settled) has it; leaves the rows at the settled states.
    fn settle(
        &mut self,
        block: &Block,
        count: usize,
        states: &mut [f64],
        scratch: &mut Scratch,
    ) -> [bool; LANES] {
        let tuning = &self.problem.tuning.settling;
        let size = self.gradient.len();
        let mut trial = states.to_vec();
        let mut step = vec![Eight::ZERO; size];
        let (mut best, mut length) = ([f64::INFINITY; LANES], [1.0; LANES]);
        let (mut settled, mut lower) = ([false; LANES], [false; LANES]);
        for _ in 0..tuning.steps {
            self.linearise(block, count, &trial, scratch);
            self.find_step(block.samples);
            for lane in 0..count {
                let (loss, promised) = (self.losses.0[lane], self.promised.0[lane]);
                let rounding = self.problem.floor.powi(2) * block.counts[lane] as f64;
                let still = promised <= tuning.settled * loss + tuning.rounding * rounding;
                let equal = still && loss <= best[lane] * (1.0 + tuning.equal_loss);
                lower[lane] = loss < best[lane] || equal || settled[lane];
                if lower[lane] {
                    best[lane] = loss;
                    length[lane] = 1.0;
                    settled[lane] = still;
                    step.iter_mut().zip(&self.step).for_each(|(to, x)| to.0[lane] = x.0[lane]);
                } else {
                    // The last step overshot: a part of it.
                    length[lane] *= tuning.shorter;
                    settled[lane] = !best[lane].is_finite() || length[lane] < tuning.shortest;
                }
            }
            let lanes = states.chunks_exact_mut(size).zip(trial.chunks_exact_mut(size));
            for (lane, (state, trial)) in lanes.enumerate() {
                if lower[lane] {
                    state.copy_from_slice(trial);
                }
                let part = if settled[lane] { 0.0 } else { length[lane] };
                for ((trial, state), step) in trial.iter_mut().zip(state).zip(&step) {
                    *trial = *state + part * step.0[lane];
                }
            }
            if (0..count).all(|lane| settled[lane] && lower[lane]) {
                return settled;
            }
        }
        self.linearise(block, count, states, scratch);
        self.find_step(block.samples);
        settled
    }

    /// Weighted residuals and rows at some states.
    fn linearise(&mut self, block: &Block, count: usize, states: &[f64], scratch: &mut Scratch) {
        let (size, samples) = (self.gradient.len(), block.samples);
        let half = 2 * self.plan.tangents.half();
        self.rows.resize((samples - 1) * half, Eight::ZERO);
        for list in [&mut self.residuals, &mut self.weights, &mut self.scales] {
            list.resize(samples * size, Eight::ZERO);
        }
        self.losses = Eight::ZERO;
        self.plan.tangents.identity(&mut self.tangents);
        let mut batch = Batch::new(size / 2, LANES);
        batch.drive = Drive::new(0, 0, LANES);
        for lane in 0..LANES {
            let from = lane.min(count - 1) * size;
            batch.set(lane, block.starts[lane], &states[from..from + size]);
        }
        let mut motion = Motion::new(self.problem, self.law, samples);
        for sample in 0..samples {
            if sample > 0 {
                let tangents = &mut self.tangents;
                motion.advance(self.plan, &mut batch, tangents, block.span(sample), scratch);
            }
            for row in 0..size {
                let at = sample * size + row;
                let out = Compared {
                    residuals: &mut self.residuals[at].0,
                    weights: &mut self.weights[at].0,
                    squares: &mut self.scales[at].0,
                    losses: &mut self.losses.0,
                };
                let predicted = &batch.state[row * LANES..][..LANES];
                let weight = self.problem.weights[row];
                compare(self.set, out, block.measured(sample, row), predicted, weight);
                if sample > 0 {
                    let range = self.plan.tangents.row(row);
                    let into = &mut self.rows[(sample - 1) * half..][range.clone()];
                    weigh_entries(self.set, into, &self.tangents[range], &self.weights[at]);
                }
            }
        }
        self.take_out_lanes(count);
    }

    /// Zeroes what belongs to no segment, or to one that left the finite numbers.
    fn take_out_lanes(&mut self, count: usize) {
        let out = |lane: &usize| *lane >= count || !self.losses.0[*lane].is_finite();
        let out: Vec<usize> = (0..LANES).filter(out).collect();
        if out.is_empty() {
            return;
        }
        for list in [&mut self.residuals, &mut self.weights, &mut self.scales, &mut self.rows] {
            list.iter_mut().for_each(|x| out.iter().for_each(|&lane| x.0[lane] = 0.0));
        }
    }

    /// Calls `take` with every site after the first sample: the entries of its two rows, and their
    /// residuals.
    fn each_site(&self, samples: usize, mut take: impl FnMut(usize, [&[Eight]; 2], [&Eight; 2])) {
        let (size, half) = (self.gradient.len(), 2 * self.plan.tangents.half());
        for sample in 1..samples {
            let entries = &self.rows[(sample - 1) * half..];
            for site in 0..size / 2 {
                let rows = [site, site + size / 2];
                take(
                    site,
                    rows.map(|row| &entries[self.plan.tangents.row(row)]),
                    rows.map(|row| &self.residuals[sample * size + row]),
                );
            }
        }
    }

    /// N and J_s' r of the rows at hand, and the step that the states take.
    fn find_step(&mut self, samples: usize) {
        let (plan, set, size) = (self.plan, self.set, self.gradient.len());
        let mut normal = std::mem::take(&mut self.normal);
        let mut gradient = std::mem::take(&mut self.gradient);
        normal.fill(Eight::ZERO);
        for state in 0..size {
            // At the first sample the state itself is what is measured.
            let (weight, residual) = (self.weights[state], self.residuals[state]);
            normal[plan.normal.row(state).end - 1].add_product(&weight, &weight);
            gradient[state] = Eight::ZERO;
            gradient[state].add_product(&weight, &residual);
        }
        self.gradient = gradient;
        let mut gradient = self.gradient.clone();
        self.each_site(samples, |site, rows, residuals| {
            let maps = &plan.sites[site];
            let [a, b] = rows.map(|entries| &entries[..maps.states.len()]);
            add_lower(set, &mut normal, a, b, &maps.normal);
            add_scattered(set, &mut gradient, a, residuals[0], &maps.states);
            add_scattered(set, &mut gradient, b, residuals[1], &maps.states);
        });
        (self.normal, self.gradient) = (normal, gradient);
        if self.iterates {
            let Rows { starts, columns, .. } = &plan.normal;
            let matrix = Lower { starts, columns, values: &self.normal };
            let (into, memory) = (&mut self.step, &mut self.memory);
            let found = &mut self.iterates;
            conjugate_gradients(set, matrix, &self.gradient, into, memory, (STEP, STEPS), found);
        }
        if !self.iterates {
            self.step_by_domains();
        }
        self.promised = Eight::ZERO;
        for (step, slope) in self.step.iter().zip(&self.gradient) {
            self.promised.add_product(step, slope);
        }
    }

    /// The step of the states, each domain's own from the domain and its halo.
    fn step_by_domains(&mut self) {
        let (plan, set) = (self.plan, self.set);
        for domain in &plan.domains {
            self.factorise(domain);
            self.sides.clear();
            self.sides.extend(domain.states.iter().map(|&state| self.gradient[state as usize]));
            solve_lower(set, &self.matrix, &self.inverse, &mut self.sides, 0);
            solve_upper(set, &self.matrix, &self.inverse, &mut self.sides);
            for own in &domain.own {
                self.step[own.state] = self.sides[own.place];
            }
        }
    }

    /// The factor of a domain's part of N.
    fn factorise(&mut self, domain: &Domain) {
        self.matrix.clear();
        let entry = |&place: &u32| match place {
            NOWHERE => Eight::ZERO,
            place => self.normal[place as usize],
        };
        self.matrix.extend(domain.normal.iter().map(entry));
        self.inverse.clear();
        self.inverse.resize(domain.states.len(), Eight::ZERO);
        factorise(self.set, &mut self.matrix, &mut self.inverse, OPEN);
    }

    /// J' J, J_s' J and J' r of the rows at hand.
    fn add_pieces(&mut self, samples: usize) {
        let (plan, set) = (self.plan, self.set);
        let mut mixed = std::mem::take(&mut self.mixed);
        let mut left = std::mem::take(&mut self.left);
        let mut slopes = std::mem::take(&mut self.slopes);
        let mut touched = std::mem::take(&mut self.touched);
        mixed.fill(Eight::ZERO);
        self.each_site(samples, |site, rows, residuals| {
            let maps = &plan.sites[site];
            let [(a, b), (c, d)] = rows.map(|entries| entries.split_at(maps.states.len()));
            add_outer(set, &mut mixed, a, b, c, d, &maps.mixed);
            add_lower(set, &mut left, b, d, &maps.left);
            for (pieces, residual) in [b, d].into_iter().zip(residuals) {
                add_scattered(set, &mut slopes, pieces, residual, &maps.pieces);
                add_entry_squares(set, &mut touched, pieces, &maps.pieces);
            }
        });
        (self.mixed, self.left, self.slopes, self.touched) = (mixed, left, slopes, touched);
    }

    /// Takes what the states of a domain do out of its pieces, and adds the degrees of freedom
    /// of its rows.
    fn eliminate(&mut self, domain: &Domain, samples: usize) {
        let (plan, set, size) = (self.plan, self.set, domain.states.len());
        self.factorise(domain);
        self.add_freedom(domain, samples);
        self.sides.clear();
        self.sides.resize(domain.pieces.len() * size, Eight::ZERO);
        let near = |piece: &u32| domain.near.binary_search(piece).ok();
        for (piece, side) in domain.pieces.iter().zip(self.sides.chunks_exact_mut(size)) {
            let Some(at) = near(piece) else { continue };
            let places = &domain.places.columns[domain.places.row(at)];
            let values = &self.mixed[plan.mixed.row(*piece as usize)];
            for (&place, value) in places.iter().zip(values) {
                if place != NOWHERE {
                    side[place as usize] = *value;
                }
            }
        }
        solve_lower(set, &self.matrix, &self.inverse, &mut self.sides, domain.from);
        solve_upper(set, &self.matrix, &self.inverse, &mut self.sides);
        for (&piece, side) in domain.pieces.iter().zip(self.sides.chunks_exact(size)) {
            let piece = piece as usize;
            let slope = &mut self.slopes[piece];
            add_gathered(set, slope, side, &self.gradient, &domain.states, true);
            for entry in plan.left.row(piece) {
                let other = plan.left.columns[entry];
                let Some(at) = near(&other) else { continue };
                let values = &self.mixed[plan.mixed.row(other as usize)];
                let places = &domain.places.columns[domain.places.row(at)];
                add_gathered(set, &mut self.left[entry], values, side, places, true);
            }
            let scaled = |place: usize| {
                side[place].largest() * self.problem.weights[domain.states[place] as usize]
            };
            let largest = (0..size).map(scaled).fold(0.0, f64::max);
            let ends = domain
                .outermost
                .each_ref()
                .map(|ring| ring.iter().map(|&place| scaled(place as usize)).fold(0.0, f64::max));
            if largest > 0.0 {
                self.tails.halo = self.tails.halo.max(beyond(ends) / largest);
            }
        }
    }

    /// Squares and degrees of freedom of a domain's own observables. The leverage of a measured
    /// value on the states is its row times N^-1 times its row.
    fn add_freedom(&mut self, domain: &Domain, samples: usize) {
        let (plan, set, size) = (self.plan, self.set, domain.states.len());
        let (all, half) = (self.gradient.len(), 2 * plan.tangents.half());
        let own = domain.own.iter();
        let wanted: Vec<_> =
            own.flat_map(|own| (0..samples).map(move |sample| (sample, own))).collect();
        let mut leverage = Eight::ZERO;
        for some in wanted.chunks(SIDES) {
            self.sides.clear();
            self.sides.resize(some.len() * size, Eight::ZERO);
            let mut from = size;
            for (&(sample, own), side) in some.iter().zip(self.sides.chunks_exact_mut(size)) {
                if sample == 0 {
                    side[own.place] = self.weights[own.state];
                    from = from.min(own.place);
                    continue;
                }
                let entries = &self.rows[(sample - 1) * half..][plan.tangents.row(own.state)];
                for (entry, &place) in entries.iter().zip(&own.row) {
                    if place != NOWHERE {
                        side[place as usize] = *entry;
                        from = from.min(place as usize);
                    }
                }
            }
            solve_lower(set, &self.matrix, &self.inverse, &mut self.sides, from);
            for (&(sample, own), side) in some.iter().zip(self.sides.chunks_exact(size)) {
                let row = own.state;
                squares(set, &side[from..], &mut leverage);
                let at = sample * all + row;
                for lane in 0..LANES {
                    if self.weights[at].0[lane] != 0.0 {
                        self.sums.squares[row] += self.scales[at].0[lane];
                        self.sums.freedom[row] += 1.0 - leverage.0[lane];
                    }
                }
            }
        }
    }

    /// What is left out of tangents at the last sample, as a part of the largest of its column:
    /// of themselves, and of the products of two.
    fn tail_of_tangents(&self, samples: usize) -> f64 {
        let (plan, all) = (self.plan, self.gradient.len());
        let columns = all + plan.couplings.pieces.len();
        let mut largest = vec![0.0f64; columns];
        // The largest at the end, one site before it, and at the second site.
        let mut rings = vec![[0.0f64; 3]; columns];
        let half = 2 * plan.tangents.half();
        let distances = [plan.reach, plan.reach.saturating_sub(1), plan.reach.min(2)];
        for row in 0..all {
            let columns = &plan.tangents.columns[row % (all / 2)];
            let entries = &self.rows[(samples - 2) * half..][plan.tangents.row(row)];
            for (entry, &(column, distance)) in entries.iter().zip(columns) {
                let size = entry.largest();
                largest[column] = largest[column].max(size);
                for (ring, of) in rings[column].iter_mut().zip(distances) {
                    if distance == of {
                        *ring = ring.max(size);
                    }
                }
            }
        }
        let left_out = |(&[end, before, second], &largest): (&[f64; 3], &f64)| {
            (beyond([end, before]) / largest).max(end / largest * (second / largest))
        };
        let known = rings.iter().zip(&largest).filter(|(_, largest)| **largest > 0.0);
        known.map(left_out).fold(0.0, f64::max)
    }
}

/// What may stand beyond the last ring, of the largest there and one site before.
fn beyond([end, before]: [f64; 2]) -> f64 {
    if before > end { end * (end / before) } else { end }
}
