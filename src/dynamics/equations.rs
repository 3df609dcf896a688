//! The equations of motion of a system, compiled.

use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::batch::{Batch, Scratch};
use super::flow::{Flow, FlowSource};
use super::gradient::Gradient;
use super::instrument::instrument;
use super::methods::Method;
use super::switches::{Between, Motion, Side, Switches, of_time};
use super::{holonomic, internal};
use crate::error::Result;
use crate::eval::{Backend, Evaluator, Inputs, Series, StepSource, Steps, compile, compile_steps};
use crate::expr::{Expr, Graph, Observed, ParameterId, Place, Symbol, System, TermId};

/// Equations of motion of a system with some of its learned terms.
///
/// dq_i/dt = v_i = dH/dp_i and dp_i/dt = -g_i with g_i = dH/dq_i - F_i. The unknowns are
/// theta = coefficients of the active terms, then the inner parameters in use. What a method
/// needs is compiled when it is first used.
pub struct Dynamics {
    motion: Motion,
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
    /// Effects of terms that are only probed: derivatives without values.
    probed_slope: Vec<Vec<(usize, Expr)>>,
    probed_velocity: Vec<Vec<(usize, Expr)>>,
    instrument: Gradient,
    compiled: CompiledParts,
}

/// What was compiled of equations of motion so far.
#[derive(Default)]
struct CompiledParts {
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
    switches: OnceLock<Option<Switches>>,
    /// Which switching surfaces act, by which coefficients are zero.
    acting: Mutex<HashMap<Vec<bool>, Arc<Vec<bool>>>>,
    modes: Mutex<BTreeMap<Vec<Side>, Option<Arc<Mode>>>>,
    surfaces: OnceLock<Flow>,
}

/// Equations of motion between switching surfaces.
pub(super) struct Mode {
    /// Where the state stands to each surface.
    pub(super) sides: Vec<Side>,
    /// The motion there.
    pub(super) dynamics: Dynamics,
    /// The surfaces that end the mode.
    pub(super) watched: Vec<usize>,
    /// For each of them how far its end is, positive inside; then, for each, the derivative of that
    /// by the time alone.
    pub(super) margins: Flow,
}

/// Steps of single trajectories from which on machine code for them pays.
const WORTH_A_LOOP: usize = 400;

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
            motion: Motion { graph, slope, velocity },
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
            probed_slope,
            probed_velocity,
            instrument,
            compiled: CompiledParts::default(),
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
        let evaluator = self.compiled.energy.get_or_init(|| {
            let mut varying = self.state.clone();
            varying.push(Symbol::Time);
            varying.extend(self.driving_energy());
            let inputs = Inputs { varying, uniform: self.unknowns.clone() };
            compile(&self.motion.graph, &inputs, &[self.hamiltonian], self.backend)
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
        let mut symbols = self.motion.graph.symbols(&[self.hamiltonian]);
        symbols.retain(|symbol| symbol.is_driving());
        symbols
    }

    /// Whether an input is named by the equations of motion.
    fn is_driven(&self) -> bool {
        let rows: Vec<Expr> =
            self.motion.slope.rows.iter().chain(&self.motion.velocity.rows).copied().collect();
        self.motion.graph.symbols(&rows).iter().any(|symbol| symbol.is_driving())
    }

    /// Rates of change of a batch of states, `[2n][lanes]`, with inputs at rest where the batch has
    /// no record of them.
    pub fn field_at(&self, batch: &Batch, theta: &[f64], out: &mut [f64], scratch: &mut Scratch) {
        scratch.stand_at(batch);
        self.field().evaluate(&batch.state, batch.lanes, theta, false, scratch);
        let size = 2 * self.degrees * batch.lanes;
        out[..size].copy_from_slice(&scratch.out[..size]);
    }

    /// The switching surfaces that the motion by `theta` has, where it has any.
    pub(super) fn switches(&self, theta: &[f64]) -> Option<(&Switches, Arc<Vec<bool>>)> {
        let coefficients = &self.unknowns[..self.active.len()];
        let of_motion = || Switches::new(&self.motion, &self.state, coefficients);
        let switches = self.compiled.switches.get_or_init(of_motion).as_ref()?;
        let zeros: Vec<bool> = theta.iter().take(self.active.len()).map(|c| *c == 0.0).collect();
        let mut known = self.compiled.acting.lock().unwrap_or_else(PoisonError::into_inner);
        let acting =
            known.entry(zeros).or_insert_with_key(|zeros| Arc::new(switches.acting(zeros)));
        acting.contains(&true).then(|| (switches, acting.clone()))
    }

    /// The motion with the state on some side of each switching surface; `None` where it cannot
    /// slide as asked for.
    pub(super) fn mode(&self, switches: &Switches, sides: &[Side]) -> Option<Arc<Mode>> {
        let mut known = self.compiled.modes.lock().unwrap_or_else(PoisonError::into_inner);
        let compile = || {
            let Between { motion, watched, margins } = switches.between(sides)?;
            let margins = self.margins(motion.graph.clone(), &margins);
            let dynamics = Dynamics {
                motion,
                active: self.active.clone(),
                parameters: self.parameters.clone(),
                unknowns: self.unknowns.clone(),
                state: self.state.clone(),
                periods: self.periods.clone(),
                probed_slope: self.probed_slope.clone(),
                probed_velocity: self.probed_velocity.clone(),
                instrument: self.instrument.clone(),
                compiled: CompiledParts::default(),
                ..*self
            };
            Some(Arc::new(Mode { sides: sides.to_vec(), dynamics, watched, margins }))
        };
        known.entry(sides.to_vec()).or_insert_with(compile).clone()
    }

    /// The arguments that change their signs on switching surfaces, as [`Mode::margins`].
    pub(super) fn surfaces(&self, switches: &Switches) -> &Flow {
        let compile = || self.margins(self.motion.graph.clone(), &switches.arguments);
        self.compiled.surfaces.get_or_init(compile)
    }

    /// Functions of the whole state, then their derivatives by the time alone.
    fn margins(&self, mut graph: Graph, functions: &[Expr]) -> Flow {
        let rates: Vec<Expr> = functions.iter().map(|&f| of_time(&mut graph, f)).collect();
        let rows = [functions, &rates].concat();
        let mut linear = vec![Vec::new(); rows.len()];
        for (&row, linear) in functions.iter().zip(&mut linear) {
            for (unknown, &symbol) in self.unknowns.iter().enumerate().take(self.active.len()) {
                let derivative = graph.derivative(row, symbol);
                if !graph.is_zero(derivative) {
                    linear.push((unknown, derivative));
                }
            }
        }
        self.compile(graph, &rows, &linear, 0..2 * self.degrees)
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
        self.compiled
            .kick
            .get_or_init(|| self.flow(&self.motion.slope.rows, &self.motion.slope.linear, 0..end))
    }

    /// v as a function of p (and of q where it is not separable).
    pub(super) fn drift(&self) -> &Flow {
        let start = if self.separable { self.degrees } else { 0 };
        let inputs = start..2 * self.degrees;
        self.compiled.drift.get_or_init(|| {
            self.flow(&self.motion.velocity.rows, &self.motion.velocity.linear, inputs)
        })
    }

    /// Derivatives of g (or of v) by the probes, as functions of the whole state; none without
    /// probes.
    pub(super) fn probed(&self, drift: bool) -> Option<&Flow> {
        let (cell, linear) = if drift {
            (&self.compiled.probed_drift, &self.probed_velocity)
        } else {
            (&self.compiled.probed_kick, &self.probed_slope)
        };
        let flow = cell.get_or_init(|| {
            if linear.iter().all(Vec::is_empty) {
                return None;
            }
            let mut graph = self.motion.graph.clone();
            let zeros = vec![graph.number(0.0); self.degrees];
            Some(self.compile(graph, &zeros, linear, 0..2 * self.degrees))
        });
        flow.as_ref()
    }

    /// What the instrument adds to each observable, as a function of the whole state; none for
    /// an instrument that adds nothing.
    pub(super) fn instrument(&self) -> Option<&Flow> {
        let flow = self.compiled.instrument_flow.get_or_init(|| {
            let Gradient { rows, linear } = &self.instrument;
            let silent = rows.iter().all(|&row| self.motion.graph.is_zero(row));
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
        let mut known = self.compiled.series.lock().unwrap_or_else(PoisonError::into_inner);
        let compile = || {
            // An input has its own series in every interval.
            if self.is_driven() {
                return None;
            }
            let mut graph = self.motion.graph.clone();
            let rates = self.rates(&mut graph);
            let (state, unknowns) = (&self.state, &self.unknowns);
            Series::new(&mut graph, state, unknowns, &rates, order, self.backend).map(Arc::new)
        };
        known.entry(order).or_insert_with(compile).clone()
    }

    /// Name of a function in the equations of motion that has a kink or a jump: its derivatives
    /// come to nothing but zero.
    pub fn kink(&self) -> Option<&'static str> {
        let mut graph = self.motion.graph.clone();
        let rates = self.rates(&mut graph);
        graph.kink(&rates)
    }

    /// (v, -g).
    fn rates(&self, graph: &mut Graph) -> Vec<Expr> {
        let mut rates = self.motion.velocity.rows.clone();
        rates.extend(self.motion.slope.rows.iter().map(|&g| graph.negate(g)));
        rates
    }

    /// (v, -g) as a function of the whole state.
    pub(super) fn field(&self) -> &Flow {
        self.compiled.field.get_or_init(|| {
            let mut graph = self.motion.graph.clone();
            let rows = self.rates(&mut graph);
            let mut linear = self.motion.velocity.linear.clone();
            linear.extend(self.motion.slope.linear.iter().map(|list| {
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
        if self.compiled.steps_taken.fetch_add(steps, Ordering::Relaxed) + steps < WORTH_A_LOOP {
            return None;
        }
        let mut loops = self.compiled.loops.lock().unwrap_or_else(PoisonError::into_inner);
        let compile = || {
            if self.is_driven() {
                return None;
            }
            let order: Vec<bool> = (0..stages).map(|stage| stage % 2 == 0).collect();
            let source = StepSource {
                graph: &self.motion.graph,
                state: &self.state,
                drift: (
                    &self.motion.velocity.rows,
                    self.drift().sources(&self.state, &self.unknowns),
                ),
                kick: (&self.motion.slope.rows, self.kick().sources(&self.state, &self.unknowns)),
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
        self.compile(self.motion.graph.clone(), rows, linear, inputs)
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
