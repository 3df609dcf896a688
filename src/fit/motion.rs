//! Trajectories of a block of segments with their derivatives.
//!
//! Residuals are as accurate as the measurements ask for. Their derivatives need not be: an
//! error of theirs only slows Gauss-Newton's convergence. So a method of high order moves the
//! states alone, and one of order four the states and their many tangents, for as long as both
//! agree.

use super::block::Block;
use super::pass::Problem;
use crate::dynamics::{Batch, Drive, Dynamics, Method, MethodKind, Scratch, advance};

/// Equations of motion with the theta that they move by.
pub(super) type Equations<'a> = (&'a Dynamics, &'a [f64]);

/// What a block moves by, and what its motion is derived by.
#[derive(Clone, Copy)]
pub(super) struct Propagation<'a> {
    /// The present model.
    pub(super) present: Equations<'a>,
    /// The same motion as one of many, by whose theta there are to be derivatives.
    pub(super) by: Option<Equations<'a>>,
}

/// A block of trajectories under way.
pub(super) struct Motion<'a> {
    /// States and tangents now.
    pub(super) batch: Batch,
    problem: &'a Problem<'a>,
    propagation: Propagation<'a>,
    /// For the tangents, where it is not the method of the states.
    cheaper: Option<Cheaper>,
    /// It may differ by this part of the motion from sample to sample.
    apart: f64,
}

/// A method for tangents, with so many steps from sample to sample.
#[derive(Clone, Copy)]
struct Cheaper {
    method: Method,
    steps: usize,
}

impl<'a> Motion<'a> {
    /// Trajectories with tangents by their initial states and by `unknowns` numbers.
    pub(super) fn new(
        problem: &'a Problem,
        propagation: Propagation<'a>,
        unknowns: usize,
        block: &Block,
        scratch: &mut Scratch,
    ) -> Motion<'a> {
        let (lanes, intervals) = (block.lanes(), block.samples.max(2) - 1);
        let (row, tuning) = (problem.stepping.method.row(), &problem.tuning.tangents);
        let high_order =
            matches!(row.kind, MethodKind::Splitting(_)) && row.order > tuning.above_order;
        let degrees = propagation.present.0.degrees();
        let mut batch = Batch::with_tangents_in(scratch, degrees, lanes, unknowns);
        let (inputs, powers) = block.driven();
        batch.drive = Drive::new(inputs, powers, lanes);
        Motion {
            batch,
            problem,
            propagation,
            cheaper: Method::by_name("forest-ruth")
                .filter(|_| high_order)
                .map(|method| Cheaper { method, steps: 1 }),
            apart: (tuning.deviation / intervals as f64).max(tuning.least_deviation),
        }
    }

    /// Gives the memory back, for other trajectories.
    pub(super) fn recycle(self, scratch: &mut Scratch) {
        scratch.take_back(self.batch.tangent);
    }

    /// Sets the time and the initial state of one trajectory.
    pub(super) fn set(&mut self, lane: usize, time: f64, state: &[f64]) {
        self.batch.set(lane, time, state);
    }

    /// Says what inputs do from here to the next sample, `[input][power][lane]`.
    pub(super) fn drive(&mut self, by: &[f64]) {
        self.batch.drive.coefficients_mut().copy_from_slice(by);
    }

    /// Says where every trajectory stands in the record, for inputs that are delayed.
    pub(super) fn stand(&mut self, block: &Block, sample: usize) {
        let measured = self.problem.measured;
        if measured.driven().0 == 0 {
            return;
        }
        for (lane, segment) in block.segments.iter().enumerate() {
            let at = (segment.first + sample).min(segment.last);
            let time = measured.times_of(segment.run).get(at).copied().unwrap_or(f64::NAN);
            self.batch.drive.stand(measured.record(), lane, segment.run, time);
        }
    }

    /// Goes on by `span[lane]`.
    pub(super) fn advance(&mut self, span: &[f64], scratch: &mut Scratch) {
        let stepping = self.problem.stepping;
        let steps = stepping.steps(span);
        // The states go by the present model alone, which has fewer terms.
        let (present, held) = self.propagation.present;
        let (dynamics, theta) = self.propagation.by.unwrap_or(self.propagation.present);
        if self.cheaper.is_none() {
            advance(dynamics, stepping.method, &mut self.batch, span, steps, theta, scratch);
            return;
        }
        let mut exact = Batch::new(dynamics.degrees(), self.batch.lanes);
        exact.state.clone_from(&self.batch.state);
        exact.time.clone_from(&self.batch.time);
        exact.drive.clone_from(&self.batch.drive);
        advance(present, stepping.method, &mut exact, span, steps, held, scratch);
        while let Some(Cheaper { method, steps: fewer }) = self.cheaper {
            let mut trial = Batch::new(dynamics.degrees(), self.batch.lanes);
            trial.state.clone_from(&self.batch.state);
            trial.time.clone_from(&self.batch.time);
            trial.drive.clone_from(&self.batch.drive);
            advance(present, method, &mut trial, span, fewer, held, scratch);
            if agree(&self.batch.state, &exact.state, &trial.state, self.batch.lanes, self.apart) {
                advance(dynamics, method, &mut self.batch, span, fewer, theta, scratch);
                self.batch.state = exact.state;
                return;
            }
            let next = Cheaper { method, steps: fewer + fewer.div_ceil(2) };
            self.cheaper =
                Some(next).filter(|next| next.steps <= self.problem.tuning.tangents.steps * steps);
        }
        advance(dynamics, stepping.method, &mut self.batch, span, steps, theta, scratch);
    }
}

/// Whether in every row of the state the largest difference of two trajectories is a small part
/// of the largest change. Lanes that left the finite numbers do not count.
pub(super) fn agree(
    before: &[f64],
    exact: &[f64],
    cheaper: &[f64],
    lanes: usize,
    part: f64,
) -> bool {
    let rows = before.chunks_exact(lanes).zip(exact.chunks_exact(lanes));
    rows.zip(cheaper.chunks_exact(lanes)).all(|((before, exact), cheaper)| {
        let (mut change, mut apart) = (0.0f64, 0.0f64);
        for ((b, e), c) in before.iter().zip(exact).zip(cheaper) {
            if e.is_finite() {
                change = change.max((e - b).abs());
                apart = apart.max(if c.is_finite() { (c - e).abs() } else { f64::INFINITY });
            }
        }
        apart <= part * change
    })
}
