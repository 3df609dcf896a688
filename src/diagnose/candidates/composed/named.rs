//! What candidates with a name do along a motion, at every point of their grids, and what the
//! unknowns of the model itself do.

use super::actions::{Action, Channels};
use super::states::{Along, PhasePoints, Points};
use crate::diagnose::candidates::Candidate;
use crate::eval::{Backend, Inputs, compile};
use crate::expr::{Expr, Place, Symbol, System};
use crate::fit::Law;
use crate::fit::column::Column;

/// A candidate at one point of its grid.
pub(super) struct NamedAction {
    /// Its inner parameters there.
    pub(super) values: Vec<f64>,
    /// What each of its columns does.
    pub(super) actions: Vec<Action>,
}

/// A grid of one number with so many points more between any two.
pub(super) fn finer(grid: &[Vec<f64>], between: usize) -> Vec<Vec<f64>> {
    let mut all = grid.to_vec();
    for pair in grid.windows(2) {
        if let [from, to] = pair
            && let ([from], [to]) = (from.as_slice(), to.as_slice())
        {
            let part = |k: usize| k as f64 / (between + 1) as f64;
            all.extend((1..=between).map(|k| vec![from + (to - from) * part(k)]));
        }
    }
    all
}

/// What a candidate does at some points of the motion, at some choices of its inner parameters.
/// Nothing of one that goes by something else than the state, the time and the law's own numbers,
/// and of choices with which it is not finite.
pub(super) fn at_all_points(
    candidate: &Candidate,
    grid: &[Vec<f64>],
    law: &Law,
    points: &Points,
    channels: Channels,
) -> Vec<NamedAction> {
    let mut system = System::clone(law.system());
    let mut outputs: Vec<Expr> = Vec::new();
    let mut plans: Vec<(&Vec<f64>, Vec<Plan>)> = Vec::new();
    for values in grid {
        let terms = candidate.probes(&mut system, law, values);
        let plan = terms.iter().map(|term| {
            let mut plan = Plan::default();
            for (at, expr) in term.parts() {
                plan.add(&mut system, &mut outputs, (at, expr), channels);
            }
            plan
        });
        plans.push((values, plan.collect()));
    }
    let all: Vec<&Plan> = plans.iter().flat_map(|(_, plan)| plan).collect();
    let Some(known) = Evaluated::of(&system, &outputs, law, points, channels, &all) else {
        return Vec::new();
    };
    let action = |plan: &Plan| known.action(plan);
    let named = plans.into_iter().map(|(values, plan)| NamedAction {
        values: values.clone(),
        actions: plan.iter().map(action).collect(),
    });
    let finite = |action: &Action| action.values.iter().all(|x| x.is_finite());
    named.filter(|one| one.actions.iter().all(finite)).collect()
}

/// What some unknowns of a law do at points of its motion; `None` for those that are not finite
/// there, or go by something else than the state and the time.
pub(super) fn of_unknowns(
    law: &Law,
    unknowns: &[Column],
    points: &Points,
    channels: Channels,
) -> Vec<Option<Action>> {
    let mut system = System::clone(law.system());
    let dynamics = law.dynamics();
    let terms = dynamics.active();
    let mut own = |column: &Column| {
        let at = column.position();
        let parts = match terms.get(at) {
            Some(&id) => law.system().term(id)?.parts().collect(),
            None => {
                let id = dynamics.parameters().get(at - terms.len())?;
                derivative(&mut system, Symbol::Parameter(id.position()))
            }
        };
        let (mut plan, mut outputs) = (Plan::default(), Vec::new());
        for (place, expr) in parts {
            if !system.graph.is_zero(expr) {
                plan.add(&mut system, &mut outputs, (place, expr), channels);
            }
        }
        let action =
            Evaluated::of(&system, &outputs, law, points, channels, &[&plan])?.action(&plan);
        action.values.iter().all(|x| x.is_finite()).then_some(action)
    };
    unknowns.iter().map(&mut own).collect()
}

/// The derivative of a system by a symbol, where it acts.
fn derivative(system: &mut System, by: Symbol) -> Vec<(Place, Expr)> {
    let mut whole = system.known_parts();
    let graph = &mut system.graph;
    for (at, term) in system.terms.iter().enumerate() {
        let coefficient = graph.symbol(Symbol::Coefficient(at));
        whole.extend(term.parts().map(|(place, expr)| (place, graph.multiply(coefficient, expr))));
    }
    whole.into_iter().map(|(place, expr)| (place, graph.derivative(expr, by))).collect()
}

/// Values of some expressions at points of the motion of a law, one expression after another.
/// `None` where they go by something else than the state, the time and the law's own numbers.
fn values_at(
    system: &System,
    outputs: &[Expr],
    law: &Law,
    points: &PhasePoints,
) -> Option<Vec<f64>> {
    let state = system.state();
    let known = |symbol: &Symbol| {
        state.contains(symbol)
            || matches!(symbol, Symbol::Time | Symbol::Parameter(_) | Symbol::Coefficient(_))
    };
    if !system.graph.symbols(outputs).iter().all(known) {
        return None;
    }
    let varying = state.into_iter().chain([Symbol::Time]).collect();
    let parameters = (0..system.parameters.len()).map(Symbol::Parameter);
    let coefficients = (0..system.terms.len()).map(Symbol::Coefficient);
    let inputs = Inputs { varying, uniform: parameters.chain(coefficients).collect() };
    let numbers: Vec<f64> =
        law.parameters().iter().copied().chain(law.coefficient_of_each_term()).collect();
    let compiled = compile(&system.graph, &inputs, outputs, Backend::default());
    let mut found = vec![0.0; outputs.len() * points.values()];
    let here = points.with_times();
    compiled.evaluate(&here, &numbers, points.values(), &mut found, &mut Vec::new());
    Some(found)
}

/// Values of some outputs, at the points that suit them.
struct Evaluated {
    /// One output after another.
    values: Vec<f64>,
    /// Of each output.
    count: usize,
    channels: Channels,
    fine: bool,
}

impl Evaluated {
    /// Forces with a kink or a jump are known at the finer points, all else at the nodes.
    fn of(
        system: &System,
        outputs: &[Expr],
        law: &Law,
        points: &Points,
        channels: Channels,
        plans: &[&Plan],
    ) -> Option<Evaluated> {
        let mut acted = plans.iter().flat_map(|plan| &plan.channels);
        let fine = system.graph.kink(outputs).is_some() && acted.all(|&c| c < channels.degrees);
        let points = if fine { &points.fine } else { &points.nodes };
        let along = if fine { Along::Model } else { channels.along };
        let values = values_at(system, outputs, law, points)?;
        Some(Evaluated {
            values,
            count: points.values(),
            channels: Channels { along, ..channels },
            fine,
        })
    }

    fn action(&self, plan: &Plan) -> Action {
        Action { fine: self.fine, ..plan.action(&self.values, self.channels, self.count) }
    }
}

/// Where the outputs of an evaluation act.
#[derive(Default)]
struct Plan {
    channels: Vec<usize>,
    /// Place among the outputs, and a sign.
    outputs: Vec<(usize, f64)>,
}

impl Plan {
    /// With so many values of each output, one output after another.
    fn action(&self, found: &[f64], channels: Channels, values: usize) -> Action {
        let row = |(&channel, &(output, sign)): (&usize, &(usize, f64))| {
            let row = &found[output * values..(output + 1) * values];
            row[channels.values(channel, values)].iter().map(move |x| sign * x)
        };
        Action {
            channels: self.channels.clone(),
            values: self.channels.iter().zip(&self.outputs).flat_map(row).collect(),
            fine: false,
        }
    }

    fn add(
        &mut self,
        system: &mut System,
        outputs: &mut Vec<Expr>,
        (place, expr): (Place, Expr),
        channels: Channels,
    ) {
        let n = channels.degrees;
        let mut act = |channel: usize, expr: Expr, sign: f64| {
            self.channels.push(channel);
            self.outputs.push((outputs.len(), sign));
            outputs.push(expr);
        };
        match place {
            Place::Force(i) => act(channels.kick(i), expr, 1.0),
            Place::Rate(i) => act(channels.drift(i), expr, 1.0),
            Place::Sensor(i) => act(channels.sensor(i), expr, 1.0),
            Place::Kinetic | Place::Potential | Place::Hamiltonian => {
                for i in 0..n {
                    let kick = system.graph.derivative(expr, Symbol::Coordinate(i));
                    if !system.graph.is_zero(kick) {
                        act(channels.kick(i), kick, -1.0);
                    }
                    let drift = system.graph.derivative(expr, Symbol::Momentum(i));
                    if !system.graph.is_zero(drift) {
                        act(channels.drift(i), drift, 1.0);
                    }
                }
            }
        }
    }
}
