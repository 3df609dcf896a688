//! The equations of motion of a system, compiled.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::batch::{Batch, Scratch};
use super::flow::{Flow, FlowSource};
use super::instrument::instrument;
use super::methods::Method;
use super::{holonomic, internal};
use crate::error::Result;
use crate::eval::{Backend, Evaluator, Inputs, Series, StepSource, Steps, compile, compile_steps};
use crate::expr::{Expr, Graph, Node, Observed, ParameterId, Place, Symbol, System, TermId};

/// Equations of motion of a system with some of its learned terms.
///
/// dq_i/dt = v_i = dH/dp_i and dp_i/dt = -g_i with g_i = dH/dq_i - F_i. The unknowns are
/// theta = coefficients of the active terms, then the inner parameters in use. What a method
/// needs is compiled when it is first used.
pub struct Dynamics {
    graph: Graph,
    backend: Backend,
    degrees: usize,
    active: Vec<TermId>,
    parameters: Vec<ParameterId>,
    unknowns: Vec<Symbol>,
    state: Vec<Symbol>,
    separable: bool,
    forced: bool,
    timed: bool,
    own_inputs: bool,
    /// The period of each observable, where whole periods of it are lost.
    periods: Vec<Option<f64>>,
    hamiltonian: Expr,
    slope: Gradient,
    velocity: Gradient,
    /// Effects of terms that are only probed: derivatives without values.
    probed_slope: Vec<Vec<(usize, Expr)>>,
    probed_velocity: Vec<Vec<(usize, Expr)>>,
    instrument: Gradient,
    kick: OnceLock<Flow>,
    drift: OnceLock<Flow>,
    instrument_flow: OnceLock<Option<Flow>>,
    probed_kick: OnceLock<Option<Flow>>,
    probed_drift: OnceLock<Option<Flow>>,
    field: OnceLock<Flow>,
    energy: OnceLock<Box<dyn Evaluator>>,
    /// Steps of single trajectories so far: many of them are worth machine code.
    steps_taken: AtomicUsize,
    /// For each splitting that such steps were taken with, by the number of its stages.
    loops: Mutex<BTreeMap<usize, Option<Arc<dyn Steps>>>>,
    /// Taylor series by their order.
    series: Mutex<BTreeMap<usize, Option<Arc<Series>>>>,
}

/// Steps of single trajectories from which on machine code for them pays.
const WORTH_A_LOOP: usize = 400;

/// g or v: n expressions, and for each the derivatives by the active coefficients.
pub(super) struct Gradient {
    pub(super) rows: Vec<Expr>,
    pub(super) linear: Vec<Vec<(usize, Expr)>>,
}

impl fmt::Debug for Dynamics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Dynamics")
            .field("degrees", &self.degrees)
            .field("active", &self.active)
            .field("parameters", &self.parameters)
            .field("separable", &self.separable)
            .finish_non_exhaustive()
    }
}

impl Dynamics {
    /// Equations of motion with the terms `active`; others are left out.
    ///
    /// # Errors
    ///
    /// A term belongs to another system.
    pub fn new(system: &System, active: &[TermId], backend: Backend) -> Result<Dynamics> {
        Dynamics::with_probes(system, active, &[], backend)
    }

    /// Equations of motion with every term of the function space.
    pub fn whole(system: &System, backend: Backend) -> Dynamics {
        Dynamics::of_positions(system, (0..system.terms.len()).collect(), Vec::new(), backend)
    }

    /// Equations of motion by what is known alone.
    pub fn known(system: &System, backend: Backend) -> Dynamics {
        Dynamics::of_positions(system, Vec::new(), Vec::new(), backend)
    }

    /// Equations of motion with the terms `active`, and tangents for the terms `probes` besides.
    ///
    /// The coefficients of probes are taken as zero, whatever theta says: only what they would
    /// do to first order is computed. So a separable system stays separable under probes that
    /// are not; its splitting evaluates them in the middle of every kick and drift. Probes are
    /// unknowns after the active terms and before the parameters.
    ///
    /// # Errors
    ///
    /// A term or a probe belongs to another system.
    pub fn with_probes(
        system: &System,
        active: &[TermId],
        probes: &[TermId],
        backend: Backend,
    ) -> Result<Dynamics> {
        let (active, probes) = (system.positions(active)?, system.positions(probes)?);
        Ok(Dynamics::of_positions(system, active, probes, backend))
    }

    /// The same for runs that have some inner parameters for themselves: what a run's number
    /// differs by from theta's is an input, behind the measured ones, for each of these parameters
    /// in turn.
    pub(crate) fn of_runs(
        system: &System,
        active: Vec<usize>,
        probes: Vec<usize>,
        backend: Backend,
    ) -> Dynamics {
        let Some(of_runs) = system.with_own_inputs() else {
            return Dynamics::of_positions(system, active, probes, backend);
        };
        let dynamics = Dynamics::of_positions(&of_runs, active, probes, backend);
        Dynamics { own_inputs: true, ..dynamics }
    }

    /// Whether runs have numbers for themselves in these equations, as inputs.
    pub(crate) fn has_own_inputs(&self) -> bool {
        self.own_inputs
    }

    /// The same by the positions of terms in a system that they are known to belong to.
    pub(crate) fn of_positions(
        system: &System,
        mut active: Vec<usize>,
        mut probes: Vec<usize>,
        backend: Backend,
    ) -> Dynamics {
        let mut graph = system.graph.clone();
        let degrees = system.degrees();
        let state = system.state();

        let known = graph.sum(&[system.kinetic, system.potential, system.hamiltonian]);
        let rates = |graph: &mut Graph, active: &[usize]| {
            let mut slope = Gradient::conservative(graph, system, active, known, &state[..degrees]);
            slope.subtract_forces(graph, system, active);
            let mut velocity =
                Gradient::conservative(graph, system, active, known, &state[degrees..]);
            internal::set_rates(graph, system, active, &mut slope, &mut velocity);
            holonomic::hold(graph, system, active, &mut slope, &velocity);
            (slope, velocity)
        };
        let (mut slope, mut velocity) = rates(&mut graph, &active);
        let mut separable = are_separable(&graph, &slope, &velocity);
        let internal = !system.known_rates().is_empty();
        let held = !system.constraints.is_empty();
        if !probes.is_empty() && (internal || held || !separable) {
            // Methods for such systems take every term in their stride.
            active.append(&mut probes);
            (slope, velocity) = rates(&mut graph, &active);
            separable = are_separable(&graph, &slope, &velocity);
        }
        let hamiltonian = energy(&mut graph, system, &active, known);
        let instrument = instrument(&mut graph, system, &active, &probes);
        let zero = graph.number(0.0);
        let mut probed =
            Gradient::conservative(&mut graph, system, &probes, zero, &state[..degrees]);
        probed.subtract_forces(&mut graph, system, &probes);
        let probed_velocity =
            Gradient::conservative(&mut graph, system, &probes, zero, &state[degrees..]);
        let after_active = |rows: Vec<Vec<(usize, Expr)>>| -> Vec<Vec<(usize, Expr)>> {
            let shift = |list: Vec<(usize, Expr)>| {
                list.into_iter().map(|(unknown, expr)| (unknown + active.len(), expr)).collect()
            };
            rows.into_iter().map(shift).collect()
        };
        let probed_slope = after_active(probed.linear);
        let probed_velocity = after_active(probed_velocity.linear);

        let mut all = slope.rows.clone();
        all.extend_from_slice(&velocity.rows);
        all.extend_from_slice(&instrument.rows);
        let timed = graph.symbols(&all).into_iter().any(Symbol::is_of_time);
        let parameters: Vec<usize> = graph
            .symbols(&all)
            .into_iter()
            .filter_map(|symbol| match symbol {
                Symbol::Parameter(j) => Some(j),
                _ => None,
            })
            .collect();
        let pushes =
            |&k: &usize| system.terms[k].parts().any(|(place, _)| matches!(place, Place::Force(_)));
        let forced = internal
            || held
            || !system.forces.iter().all(|&f| graph.is_zero(f))
            || active.iter().any(pushes);
        active.append(&mut probes);
        let unknowns = active
            .iter()
            .map(|&k| Symbol::Coefficient(k))
            .chain(parameters.iter().map(|&j| Symbol::Parameter(j)))
            .collect();
        let (terms, all_parameters) = (system.term_ids(), system.parameter_ids());
        Dynamics {
            graph,
            backend,
            degrees,
            active: active.into_iter().map(|k| terms[k]).collect(),
            parameters: parameters.into_iter().map(|j| all_parameters[j]).collect(),
            unknowns,
            state,
            separable,
            forced,
            timed,
            own_inputs: false,
            periods: system.periods(),
            hamiltonian,
            slope,
            velocity,
            probed_slope,
            probed_velocity,
            instrument,
            instrument_flow: OnceLock::new(),
            kick: OnceLock::new(),
            drift: OnceLock::new(),
            probed_kick: OnceLock::new(),
            probed_drift: OnceLock::new(),
            field: OnceLock::new(),
            energy: OnceLock::new(),
            steps_taken: AtomicUsize::new(0),
            loops: Mutex::default(),
            series: Mutex::default(),
        }
    }

    /// Number of degrees of freedom n.
    pub fn degrees(&self) -> usize {
        self.degrees
    }

    /// Number of observables: 2n, then what columns show beside the state.
    pub fn observables(&self) -> usize {
        self.periods.len()
    }

    /// The period of an observable, where whole periods of it are lost.
    pub fn period(&self, observable: usize) -> Option<f64> {
        self.periods.get(observable).copied().flatten()
    }

    /// Number of unknowns P, the length of theta.
    pub fn unknowns(&self) -> usize {
        self.unknowns.len()
    }

    /// `active()[k]` is the term whose coefficient is `theta[k]`.
    pub fn active(&self) -> &[TermId] {
        &self.active
    }

    /// `parameters()[j]` is the inner parameter that `theta[active().len() + j]` is: those that
    /// occur in the equations of motion, in the order of the system.
    pub fn parameters(&self) -> &[ParameterId] {
        &self.parameters
    }

    /// Whether v depends on p and t only and g on q and t only, as a splitting needs.
    pub fn separable(&self) -> bool {
        self.separable
    }

    /// Whether all motion comes from H, without forces beside it: a symplectic method then keeps
    /// the structure of the flow.
    pub fn is_hamiltonian(&self) -> bool {
        !self.forced
    }

    /// Whether the equations of motion name the time or an input.
    pub fn depends_on_time(&self) -> bool {
        self.timed
    }

    /// H of every lane into `out`, `[lanes]`; `theta` has [`Dynamics::unknowns`] numbers.
    pub fn energy(&self, batch: &Batch, theta: &[f64], out: &mut [f64], scratch: &mut Scratch) {
        let evaluator = self.energy.get_or_init(|| {
            let mut varying = self.state.clone();
            varying.push(Symbol::Time);
            varying.extend(self.driving_energy());
            let inputs = Inputs { varying, uniform: self.unknowns.clone() };
            compile(&self.graph, &inputs, &[self.hamiltonian], self.backend)
        });
        scratch.stand_at(batch);
        let Scratch { points, workspace, drive, since, .. } = scratch;
        points.clear();
        points.extend_from_slice(&batch.state);
        points.extend_from_slice(&batch.time);
        for symbol in self.driving_energy() {
            match symbol {
                Symbol::Input(input, order) => drive.append(input, order, since, points),
                Symbol::Delayed(input, order, by) => {
                    let by = by.among(&self.unknowns, theta);
                    drive.append_delayed((input, order, by), since, points);
                }
                _ => {}
            }
        }
        evaluator.evaluate(points, theta, batch.lanes, &mut out[..batch.lanes], workspace);
    }

    /// The inputs that H names.
    fn driving_energy(&self) -> Vec<Symbol> {
        let mut symbols = self.graph.symbols(&[self.hamiltonian]);
        symbols.retain(|symbol| symbol.is_driving());
        symbols
    }

    /// Whether an input is named by the equations of motion.
    fn is_driven(&self) -> bool {
        let rows: Vec<Expr> = self.slope.rows.iter().chain(&self.velocity.rows).copied().collect();
        self.graph.symbols(&rows).iter().any(|symbol| symbol.is_driving())
    }

    /// Rates of change of a batch of states, `[2n][lanes]`, with inputs at rest where the batch has
    /// no record of them.
    pub fn field_at(&self, batch: &Batch, theta: &[f64], out: &mut [f64], scratch: &mut Scratch) {
        scratch.stand_at(batch);
        self.field().evaluate(&batch.state, batch.lanes, theta, false, scratch);
        let size = 2 * self.degrees * batch.lanes;
        out[..size].copy_from_slice(&scratch.out[..size]);
    }

    /// Compiles what steps of a method need, side by side, before many threads ask for it at once
    /// and wait for one of them.
    pub fn prepare(&self, method: Method) {
        if method.needs_separable() {
            rayon::join(|| self.kick(), || self.drift());
        } else {
            self.field();
        }
    }

    /// g as a function of q (and of p where it is not separable).
    pub(super) fn kick(&self) -> &Flow {
        let end = if self.separable { self.degrees } else { 2 * self.degrees };
        self.kick.get_or_init(|| self.flow(&self.slope.rows, &self.slope.linear, 0..end))
    }

    /// v as a function of p (and of q where it is not separable).
    pub(super) fn drift(&self) -> &Flow {
        let start = if self.separable { self.degrees } else { 0 };
        let inputs = start..2 * self.degrees;
        self.drift.get_or_init(|| self.flow(&self.velocity.rows, &self.velocity.linear, inputs))
    }

    /// Derivatives of g (or of v) by the probes, as functions of the whole state; none without
    /// probes.
    pub(super) fn probed(&self, drift: bool) -> Option<&Flow> {
        let (cell, linear) = if drift {
            (&self.probed_drift, &self.probed_velocity)
        } else {
            (&self.probed_kick, &self.probed_slope)
        };
        let flow = cell.get_or_init(|| {
            if linear.iter().all(Vec::is_empty) {
                return None;
            }
            let mut graph = self.graph.clone();
            let zeros = vec![graph.number(0.0); self.degrees];
            Some(self.compile(graph, &zeros, linear, 0..2 * self.degrees))
        });
        flow.as_ref()
    }

    /// What the instrument adds to each observable, as a function of the whole state; none for
    /// an instrument that adds nothing.
    pub(super) fn instrument(&self) -> Option<&Flow> {
        let flow = self.instrument_flow.get_or_init(|| {
            let Gradient { rows, linear } = &self.instrument;
            let silent = rows.iter().all(|&row| self.graph.is_zero(row));
            if silent && linear.iter().all(Vec::is_empty) {
                return None;
            }
            Some(self.flow(rows, linear, 0..2 * self.degrees))
        });
        flow.as_ref()
    }

    /// Whether the state itself is what an instrument shows.
    pub(crate) fn shows_state(&self, observed: Observed) -> bool {
        let all = self.observables() == 2 * self.degrees;
        all && observed == Observed::Momenta && self.instrument().is_none()
    }

    /// Taylor series of the motion; `None` for what has kinks or jumps.
    pub(super) fn series(&self, order: usize) -> Option<Arc<Series>> {
        let mut known = self.series.lock().unwrap_or_else(PoisonError::into_inner);
        let compile = || {
            // An input has its own series in every interval.
            if self.is_driven() {
                return None;
            }
            let mut graph = self.graph.clone();
            let rates = self.rates(&mut graph);
            let (state, unknowns) = (&self.state, &self.unknowns);
            Series::new(&mut graph, state, unknowns, &rates, order, self.backend).map(Arc::new)
        };
        known.entry(order).or_insert_with(compile).clone()
    }

    /// Name of a function in the equations of motion that has a kink or a jump: its derivatives
    /// come to nothing but zero.
    pub fn kink(&self) -> Option<&'static str> {
        let mut graph = self.graph.clone();
        let rates = self.rates(&mut graph);
        let inside = graph.topological(&rates);
        inside.into_iter().find_map(|expr| match graph.node(expr) {
            Node::Apply(function, _) if !function.row().smooth => Some(function.row().name),
            _ => None,
        })
    }

    /// (v, -g).
    fn rates(&self, graph: &mut Graph) -> Vec<Expr> {
        let mut rates = self.velocity.rows.clone();
        rates.extend(self.slope.rows.iter().map(|&g| graph.negate(g)));
        rates
    }

    /// (v, -g) as a function of the whole state.
    pub(super) fn field(&self) -> &Flow {
        self.field.get_or_init(|| {
            let mut graph = self.graph.clone();
            let rows = self.rates(&mut graph);
            let mut linear = self.velocity.linear.clone();
            linear.extend(self.slope.linear.iter().map(|list| {
                list.iter().map(|&(unknown, expr)| (unknown, graph.negate(expr))).collect()
            }));
            self.compile(graph, &rows, &linear, 0..2 * self.degrees)
        })
    }

    /// Machine code for steps of a splitting of `stages` stages, one drift and one kick after
    /// the other; `None` as long as it does not pay, and where there is none.
    pub(super) fn step_loop(&self, stages: usize, steps: usize) -> Option<Arc<dyn Steps>> {
        if self.backend != Backend::Machine {
            return None;
        }
        if self.steps_taken.fetch_add(steps, Ordering::Relaxed) + steps < WORTH_A_LOOP {
            return None;
        }
        let mut loops = self.loops.lock().unwrap_or_else(PoisonError::into_inner);
        let compile = || {
            if self.is_driven() {
                return None;
            }
            let order: Vec<bool> = (0..stages).map(|stage| stage % 2 == 0).collect();
            let source = StepSource {
                graph: &self.graph,
                state: &self.state,
                drift: (&self.velocity.rows, self.drift().sources(&self.state, &self.unknowns)),
                kick: (&self.slope.rows, self.kick().sources(&self.state, &self.unknowns)),
                stages: &order,
            };
            compile_steps(&source).map(Arc::from)
        };
        loops.entry(stages).or_insert_with(compile).clone()
    }

    fn flow(
        &self,
        rows: &[Expr],
        linear: &[Vec<(usize, Expr)>],
        inputs: std::ops::Range<usize>,
    ) -> Flow {
        self.compile(self.graph.clone(), rows, linear, inputs)
    }

    fn compile(
        &self,
        graph: Graph,
        functions: &[Expr],
        linear: &[Vec<(usize, Expr)>],
        inputs: std::ops::Range<usize>,
    ) -> Flow {
        let source =
            FlowSource { functions, linear, state: &self.state, inputs, unknowns: &self.unknowns };
        Flow::new(graph, &source, self.backend)
    }
}

impl Gradient {
    /// Derivatives of H by `symbols`. Terms are linear in their coefficients, so that every
    /// mixed derivative is the derivative of a term.
    fn conservative(
        graph: &mut Graph,
        system: &System,
        active: &[usize],
        known: Expr,
        symbols: &[Symbol],
    ) -> Gradient {
        let mut conservative: Vec<usize> = Vec::new();
        let mut exprs = vec![known];
        for (unknown, &k) in active.iter().enumerate() {
            let parts: Vec<Expr> = system.terms[k]
                .parts()
                .filter(|(place, _)| place.is_energy())
                .map(|(_, expr)| expr)
                .collect();
            if !parts.is_empty() {
                conservative.push(unknown);
                exprs.push(graph.sum(&parts));
            }
        }
        let mut gradient = Gradient { rows: Vec::new(), linear: Vec::new() };
        for &symbol in symbols {
            let derivatives = graph.derivatives(&exprs, symbol);
            let mut parts = vec![(1.0, derivatives[0])];
            let mut linear = Vec::new();
            for (&unknown, &derivative) in conservative.iter().zip(&derivatives[1..]) {
                if graph.is_zero(derivative) {
                    continue;
                }
                let coefficient = graph.symbol(Symbol::Coefficient(active[unknown]));
                parts.push((1.0, graph.multiply(coefficient, derivative)));
                linear.push((unknown, derivative));
            }
            gradient.rows.push(graph.linear(0.0, &parts));
            gradient.linear.push(linear);
        }
        gradient
    }

    fn subtract_forces(&mut self, graph: &mut Graph, system: &System, active: &[usize]) {
        for (i, (row, linear)) in self.rows.iter_mut().zip(&mut self.linear).enumerate() {
            let mut parts = vec![(1.0, *row)];
            parts.extend(system.forces.get(i).map(|&force| (-1.0, force)));
            for (unknown, &k) in active.iter().enumerate() {
                if let Some(expr) = system.terms[k].part(Place::Force(i)) {
                    let coefficient = graph.symbol(Symbol::Coefficient(k));
                    parts.push((-1.0, graph.multiply(coefficient, expr)));
                    linear.push((unknown, graph.negate(expr)));
                }
            }
            *row = graph.linear(0.0, &parts);
        }
    }
}

/// Whether g depends on q and t only and v on p and t only.
fn are_separable(graph: &Graph, slope: &Gradient, velocity: &Gradient) -> bool {
    let depends =
        |on: fn(&Symbol) -> bool, gradient: &Gradient| graph.symbols(&gradient.rows).iter().any(on);
    !depends(|s| matches!(s, Symbol::Momentum(_)), slope)
        && !depends(|s| matches!(s, Symbol::Coordinate(_)), velocity)
}

/// H with the active terms.
fn energy(graph: &mut Graph, system: &System, active: &[usize], known: Expr) -> Expr {
    let mut parts = vec![(1.0, known)];
    for &k in active {
        let coefficient = graph.symbol(Symbol::Coefficient(k));
        for (_, expr) in system.terms[k].parts().filter(|(place, _)| place.is_energy()) {
            parts.push((1.0, graph.multiply(coefficient, expr)));
        }
    }
    graph.linear(0.0, &parts)
}
