//! Eight trajectories under way, with tangents that reach as far as they act.

use super::super::motion::agree;
use super::super::pass::Problem;
use super::plan::Plan;
use crate::dynamics::{Batch, Dynamics, LANES, Method, MethodKind, Scratch, advance};
use crate::eval::Eight;

/// Eight trajectories under way. Where the method is of high order, tangents go by one of order
/// four for as long as both agree, as in [`motion`](super::super::motion).
pub(super) struct Motion<'a> {
    problem: &'a Problem<'a>,
    law: (&'a Dynamics, &'a [f64]),
    cheaper: Option<(Method, usize)>,
    apart: f64,
}

impl<'a> Motion<'a> {
    pub(super) fn new(
        problem: &'a Problem<'a>,
        law: (&'a Dynamics, &'a [f64]),
        samples: usize,
    ) -> Motion<'a> {
        let (row, tuning) = (problem.stepping.method.row(), &problem.tuning.tangents);
        let high = matches!(row.kind, MethodKind::Splitting(_)) && row.order > tuning.above_order;
        let cheaper = Method::by_name("forest-ruth").filter(|_| high).map(|method| (method, 1));
        let apart = (tuning.deviation / (samples - 1) as f64).max(tuning.least_deviation);
        Motion { problem, law, cheaper, apart }
    }

    pub(super) fn advance(
        &mut self,
        plan: &Plan,
        batch: &mut Batch,
        tangents: &mut [Eight],
        span: &[f64],
        scratch: &mut Scratch,
    ) {
        let (stepping, (dynamics, theta)) = (self.problem.stepping, self.law);
        let steps = stepping.steps(span);
        let moved = |batch: &Batch, method: Method, steps: usize, scratch: &mut Scratch| {
            let mut moved = batch.clone();
            advance(dynamics, method, &mut moved, span, steps, theta, scratch);
            moved
        };
        let exact = self.cheaper.map(|_| moved(batch, stepping.method, steps, scratch));
        while let (Some((method, fewer)), Some(exact)) = (self.cheaper, &exact) {
            let trial = moved(batch, method, fewer, scratch);
            if agree(&batch.state, &exact.state, &trial.state, LANES, self.apart) {
                let both = (&mut *batch, tangents);
                plan.tangents.advance(dynamics, method, both, span, fewer, theta, scratch);
                batch.state.clone_from(&exact.state);
                return;
            }
            let more = fewer + fewer.div_ceil(2);
            self.cheaper =
                (more <= self.problem.tuning.tangents.steps * steps).then_some((method, more));
        }
        plan.tangents.advance(
            dynamics,
            stepping.method,
            (batch, tangents),
            span,
            steps,
            theta,
            scratch,
        );
    }
}
