//! A dynamical system with unknown parts: what a spec means, as expressions.

use std::collections::HashMap;

use super::graph::{Expr, Graph, Symbol};
use super::identity::TermId;
use super::print::Names;
use super::unit::Unit;
use crate::data::{Interpolation, MeasuredInput};
use crate::error::Result;
use crate::spec::effects::Body;

/// A coordinate or a momentum.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// As written in the spec: `theta`, `q[3]`.
    pub name: String,
    /// `None`: no unit was given, nothing about it is checked.
    pub unit: Option<Unit>,
    /// The unit as the user wrote it, for print.
    pub unit_text: Option<String>,
}

/// What is measured and drives the motion.
#[derive(Debug, Clone, PartialEq)]
pub struct InputVariable {
    /// Its name and unit.
    pub variable: Variable,
    /// What it does between its samples.
    pub between: Interpolation,
    /// Whether it is what runs have for themselves of an inner parameter: nobody recorded it, and
    /// no effect acts on it.
    pub own: bool,
}

/// What moves and is not measured: a coordinate with its momentum, or an internal state of first
/// order (a memory, a temperature, the lag of a sensor).
///
/// An internal state w stands in the list of coordinates and is read like one, but dw/dt is an
/// expression of its own. What stands as its momentum is always zero and moves nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hidden {
    /// Its place among the coordinates.
    pub coordinate: usize,
    /// Where its value at the start of a run is looked for from.
    pub start: f64,
    /// The same of its momentum; 0 for an internal state.
    pub momentum: f64,
    /// dw/dt of an internal state; `None` for a coordinate, which moves by H and its force.
    pub rate: Option<Expr>,
}

/// What a column shows that is no part of the state: a function of it, of its rates, of the time
/// and of inputs. By the model it is the known part of a sensor whose ideal reading is 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Measure {
    /// Its name and unit.
    pub variable: Variable,
    /// As it was written.
    pub text: String,
    /// What it is lost a multiple of, in its unit: a whole turn of an angle.
    pub period: Option<f64>,
    /// The same on any curve q(t), for first guesses: `Velocity(i)` is dq_i/dt, `Velocity(n + i)`
    /// its rate, `Momentum(n + i)` the rate of a momentum. `None` where it has higher rates.
    pub on_curve: Option<Expr>,
    /// The arguments of atan2, on any curve, where it is nothing but that: for print.
    pub direction: Option<[Expr; 2]>,
}

/// What the second half of the observables is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Observed {
    /// The momenta themselves.
    Momenta,
    /// The velocities dH/dp.
    Velocities,
}

/// Where a part of the equations of motion stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Place {
    /// T(p).
    Kinetic,
    /// V(q).
    Potential,
    /// A part of H(q, p) that is neither T nor V.
    Hamiltonian,
    /// The generalised force on coordinate i, outside H.
    Force(usize),
    /// The rate of change of the internal state that stands in the place of coordinate i.
    Rate(usize),
    /// What the instrument adds to observable i, in the order of [`System::observables`].
    Sensor(usize),
}

impl Place {
    /// Whether it is a part of H.
    pub fn is_energy(self) -> bool {
        matches!(self, Place::Kinetic | Place::Potential | Place::Hamiltonian)
    }

    /// Whether it may name rates of the state, which follow from what moves it.
    pub fn follows_motion(self) -> bool {
        matches!(self, Place::Sensor(_) | Place::Rate(_))
    }

    /// Whether it is a part of the instrument, and moves nothing.
    pub fn is_sensor(self) -> bool {
        matches!(self, Place::Sensor(_))
    }
}

/// Allowed values of a coefficient or parameter; infinite where there is no bound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Smallest allowed value, or minus infinity.
    pub lower: f64,
    /// Largest allowed value, or infinity.
    pub upper: f64,
}

impl Bounds {
    /// No bound on either side.
    pub const FREE: Bounds = Bounds { lower: f64::NEG_INFINITY, upper: f64::INFINITY };

    /// Whether there is no bound on either side.
    pub fn is_free(self) -> bool {
        self == Bounds::FREE
    }

    /// The allowed value nearest to `value`.
    pub fn clamp(self, value: f64) -> f64 {
        value.max(self.lower).min(self.upper)
    }

    /// What these bounds and others allow both.
    pub fn within(self, other: Bounds) -> Bounds {
        Bounds { lower: self.lower.max(other.lower), upper: self.upper.min(other.upper) }
    }

    /// What of these bounds lies within `reach` of a value; all of it for a reach of 0.
    pub fn near(self, value: f64, reach: f64) -> Bounds {
        if reach == 0.0 {
            return self;
        }
        Bounds { lower: self.lower.max(value - reach), upper: self.upper.min(value + reach) }
    }
}

/// A member of the function space: its coefficient is learned and penalised.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// The part of the equations of motion that it is a term of.
    pub place: Place,
    /// The term without its coefficient.
    pub expr: Expr,
    /// Further places where the same coefficient stands, with what it multiplies there.
    pub also: Vec<(Place, Expr)>,
    /// The catalogue effect or candidate that the term came with: `viscous_drag(theta)`.
    pub effect: Option<String>,
    /// The term in the syntax of the mini-language, without its coefficient.
    pub label: String,
    /// The name that the user gave to the coefficient, if any.
    pub name: Option<String>,
    /// Allowed values of the coefficient.
    pub bounds: Bounds,
    /// Unit of the coefficient, where units were given.
    pub unit: Option<Unit>,
    /// The coefficient's unit as text, for print.
    pub unit_text: Option<String>,
}

impl Term {
    /// Every place of the term with what its coefficient multiplies there.
    pub fn parts(&self) -> impl Iterator<Item = (Place, Expr)> + '_ {
        std::iter::once((self.place, self.expr)).chain(self.also.iter().copied())
    }

    /// What the coefficient multiplies at one place, where it stands there.
    pub fn part(&self, place: Place) -> Option<Expr> {
        self.parts().find(|part| part.0 == place).map(|part| part.1)
    }
}

/// A holonomic constraint: an equation between coordinates that every motion satisfies.
#[derive(Debug, Clone, PartialEq)]
pub struct Constraint {
    /// Left side minus right side: a function of coordinates and inner parameters.
    pub expr: Expr,
    /// As it stands in the spec: `x^2 + y^2 == l^2`.
    pub label: String,
}

/// What has a value of its own of an inner parameter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Per {
    /// Every run.
    Run,
    /// Every group of runs, told apart by a column of the data.
    Group(String),
}

impl Per {
    /// What the word behind `per` means: `run`, or the name of a column.
    pub fn of(word: &str) -> Per {
        if word == "run" { Per::Run } else { Per::Group(word.to_string()) }
    }

    /// The column that tells groups of runs apart; `None` for every run.
    pub fn column(&self) -> Option<&str> {
        match self {
            Per::Run => None,
            Per::Group(column) => Some(column),
        }
    }

    /// As it stands behind `per`.
    pub fn word(&self) -> &str {
        self.column().unwrap_or("run")
    }
}

/// An inner parameter: a number inside terms that is learned and not penalised.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// As written in the spec.
    pub name: String,
    /// Value that training starts from.
    pub start: f64,
    /// Allowed values.
    pub bounds: Bounds,
    /// What has a value of its own; `None`: all runs share it.
    pub per: Option<Per>,
    /// `None`: no unit was given, nothing about it is checked.
    pub unit: Option<Unit>,
    /// The unit as the user wrote it, for print.
    pub unit_text: Option<String>,
}

/// dq/dt = dH/dp, dp/dt = -dH/dq + F with
/// H = known + sum of c_k phi_k over the terms of T, V and H, and
/// F_i = known_i + sum of c_k psi_k over the terms of the force on coordinate i.
/// What is measured is the observable of the state, plus the sensor's known part, plus the
/// sum of c_k chi_k over the terms of that sensor.
///
/// Every known part is an expression in [`Symbol`]s; zero where nothing is known.
#[derive(Debug, Clone)]
pub struct System {
    /// Name of the system, usually the spec's file name without its ending.
    pub name: String,
    /// The graph that every expression below belongs to.
    pub graph: Graph,
    /// Generalised coordinates q_1 .. q_n.
    pub coordinates: Vec<Variable>,
    /// Bodies that the spec declares, by the names of their coordinates.
    pub declared_bodies: Vec<Body>,
    /// Conjugate momenta, one for each coordinate.
    pub momenta: Vec<Variable>,
    /// What the second half of the observables is.
    pub observed: Observed,
    /// Names of the measured velocities; empty when momenta are observed.
    pub velocities: Vec<Variable>,
    /// The time, with its unit.
    pub time: Variable,
    /// Measured inputs; `inputs[i]` is `Symbol::Input(i, 0)`.
    pub inputs: Vec<InputVariable>,
    /// What moves and is not measured, in the order of the coordinates.
    pub hidden: Vec<Hidden>,
    /// Inner parameters; `parameters[j]` is `Symbol::Parameter(j)`.
    pub parameters: Vec<Parameter>,
    /// The known part of T(p).
    pub kinetic: Expr,
    /// The known part of V(q).
    pub potential: Expr,
    /// The known part of H(q, p) that is neither T nor V.
    pub hamiltonian: Expr,
    /// One for each coordinate.
    pub forces: Vec<Expr>,
    /// What the instrument adds to each observable, in the order of [`System::observables`];
    /// zero where it adds nothing.
    pub sensors: Vec<Expr>,
    /// Equations between coordinates that every motion satisfies; the forces that hold them are not
    /// among `forces`.
    pub constraints: Vec<Constraint>,
    /// What columns show that is no part of the state; the observables behind those of the state.
    pub measures: Vec<Measure>,
    /// The function space. The coefficient of `terms[k]` is `Symbol::Coefficient(k)`.
    pub terms: Vec<Term>,
}

impl System {
    /// Number of degrees of freedom n; the state has 2n components.
    pub fn degrees(&self) -> usize {
        self.coordinates.len()
    }

    /// The same with an input beside every inner parameter that runs have for themselves, behind
    /// the others and in the order of the parameters, to which it is added. `None` where there is
    /// none.
    pub(crate) fn with_own_inputs(&self) -> Option<System> {
        let mut system = self.clone();
        let mut sums = HashMap::new();
        for (j, parameter) in system.parameters.iter_mut().enumerate() {
            if parameter.per.is_none() {
                continue;
            }
            let own = Symbol::Input(system.inputs.len(), 0);
            let parts =
                [Symbol::Parameter(j), own].map(|symbol| (1.0, system.graph.symbol(symbol)));
            sums.insert(Symbol::Parameter(j), system.graph.linear(0.0, &parts));
            let Parameter { name, unit, unit_text, .. } = parameter.clone();
            let variable = Variable { name: format!("{name} of the run"), unit, unit_text };
            let between = Interpolation::Hold;
            system.inputs.push(InputVariable { variable, between, own: true });
        }
        if sums.is_empty() {
            return None;
        }
        let System {
            graph,
            kinetic,
            potential,
            hamiltonian,
            forces,
            sensors,
            hidden,
            constraints,
            measures,
            terms,
            ..
        } = &mut system;
        let energies = [kinetic, potential, hamiltonian].into_iter();
        let rates = hidden.iter_mut().filter_map(|part| part.rate.as_mut());
        let held = constraints.iter_mut().map(|constraint| &mut constraint.expr);
        let others = terms.iter_mut().flat_map(|term| {
            std::iter::once(&mut term.expr).chain(term.also.iter_mut().map(|(_, expr)| expr))
        });
        let on_curves = measures.iter_mut().filter_map(|measure| measure.on_curve.as_mut());
        let others = others.chain(on_curves).chain(held);
        for expr in energies.chain(forces).chain(sensors).chain(rates).chain(others) {
            *expr = graph.substitute(*expr, &sums);
        }
        Some(system)
    }

    /// The internal state of first order that stands in the place of a coordinate; `None` where a
    /// coordinate stands there.
    pub fn internal(&self, coordinate: usize) -> Option<&Hidden> {
        self.hidden.iter().find(|part| part.coordinate == coordinate && part.rate.is_some())
    }

    /// The known part of the rate of every internal state, with its place.
    pub fn known_rates(&self) -> Vec<(Place, Expr)> {
        let rate = |part: &Hidden| Some((Place::Rate(part.coordinate), part.rate?));
        self.hidden.iter().filter_map(rate).collect()
    }

    /// Every known part with its place.
    pub fn known_parts(&self) -> Vec<(Place, Expr)> {
        let energies = [
            (Place::Kinetic, self.kinetic),
            (Place::Potential, self.potential),
            (Place::Hamiltonian, self.hamiltonian),
        ];
        let forces = self.forces.iter().enumerate().map(|(i, &expr)| (Place::Force(i), expr));
        let sensors = self.sensors.iter().enumerate().map(|(i, &expr)| (Place::Sensor(i), expr));
        energies.into_iter().chain(forces).chain(self.known_rates()).chain(sensors).collect()
    }

    /// The rates of all internal states by their places among the coordinates, learned terms
    /// included; coefficients of terms that are not `active` are zero in them.
    ///
    /// # Errors
    ///
    /// A term belongs to another system.
    pub fn rates(&mut self, active: &[TermId]) -> Result<Vec<(usize, Expr)>> {
        let active = self.positions(active)?;
        let states = self.known_rates();
        let mut rates = Vec::with_capacity(states.len());
        for (place, known) in states {
            let Place::Rate(i) = place else { continue };
            let total = self.total(known, place, &active);
            rates.push((i, without_others(&mut self.graph, total, &active)));
        }
        Ok(rates)
    }

    /// Whether no column ever holds an observable, in the order of [`System::observables`].
    pub fn is_hidden(&self, observable: usize) -> bool {
        let n = self.degrees();
        self.hidden.iter().any(|part| [part.coordinate, n + part.coordinate].contains(&observable))
    }

    /// Degrees of freedom that have a coordinate and a momentum: internal states are none.
    pub fn mechanical(&self) -> Vec<usize> {
        (0..self.degrees()).filter(|&i| self.internal(i).is_none()).collect()
    }

    /// q_1 .. q_n, p_1 .. p_n.
    pub fn state(&self) -> Vec<Symbol> {
        let n = self.degrees();
        (0..n).map(Symbol::Coordinate).chain((0..n).map(Symbol::Momentum)).collect()
    }

    /// Names for print; coefficients without a name are called c1, c2, ...
    pub fn names(&self) -> Names {
        Names {
            coordinates: self.coordinates.iter().map(|v| v.name.clone()).collect(),
            momenta: self.momenta.iter().map(|v| v.name.clone()).collect(),
            inputs: self.inputs.iter().map(|input| input.variable.name.clone()).collect(),
            parameters: self.parameters.iter().map(|p| p.name.clone()).collect(),
            coefficients: self
                .terms
                .iter()
                .enumerate()
                .map(|(k, term)| term.name.clone().unwrap_or_else(|| format!("c{}", k + 1)))
                .collect(),
        }
    }

    /// Names of the observables in data: coordinates, then momenta or velocities, then measures.
    pub fn observables(&self) -> Vec<String> {
        self.observed_variables().map(|variable| variable.name.clone()).collect()
    }

    /// The observables, in their order.
    pub fn observed_variables(&self) -> impl Iterator<Item = &Variable> {
        let second = match self.observed {
            Observed::Momenta => &self.momenta,
            Observed::Velocities => &self.velocities,
        };
        let measures = self.measures.iter().map(|measure| &measure.variable);
        self.coordinates.iter().chain(second).chain(measures)
    }

    /// Number of observables: 2n, and one for each measure.
    pub fn observed_count(&self) -> usize {
        2 * self.degrees() + self.measures.len()
    }

    /// The period of each observable, where it is lost a multiple of one.
    pub fn periods(&self) -> Vec<Option<f64>> {
        let mut periods = vec![None; 2 * self.degrees()];
        periods.extend(self.measures.iter().map(|measure| measure.period));
        periods
    }

    /// The inputs, as a data set names them.
    pub fn measured_inputs(&self) -> Vec<MeasuredInput> {
        let measured = |input: &InputVariable| MeasuredInput {
            name: input.variable.name.clone(),
            between: input.between,
        };
        self.inputs.iter().map(measured).collect()
    }

    /// H as one expression, the learned terms `active` with their coefficients as symbols.
    ///
    /// # Errors
    ///
    /// A term belongs to another system.
    pub fn energy(&mut self, active: &[TermId]) -> Result<Expr> {
        let active = self.positions(active)?;
        let mut parts = vec![(1.0, self.kinetic), (1.0, self.potential), (1.0, self.hamiltonian)];
        for k in active {
            for (_, term) in self.terms[k].parts().filter(|(place, _)| place.is_energy()) {
                let coefficient = self.graph.symbol(Symbol::Coefficient(k));
                parts.push((1.0, self.graph.multiply(coefficient, term)));
            }
        }
        Ok(self.graph.linear(0.0, &parts))
    }

    /// The force on each coordinate outside H, learned terms and what holds constraints included.
    ///
    /// # Errors
    ///
    /// A term belongs to another system.
    pub fn force(&mut self, active: &[TermId]) -> Result<Vec<Expr>> {
        let positions = self.positions(active)?;
        let degrees = self.degrees();
        let mut of = |i| self.total(self.forces[i], Place::Force(i), &positions);
        let mut forces: Vec<Expr> = (0..degrees).map(&mut of).collect();
        if self.constraints.is_empty() {
            return Ok(forces);
        }
        let energy = self.energy(active)?;
        let gradient = self.graph.gradient(energy, &self.state());
        let (slopes, velocities) = gradient.split_at(degrees);
        let pushes = forces.iter().zip(slopes);
        let pushes: Vec<Expr> =
            pushes.map(|(&force, &slope)| self.graph.subtract(force, slope)).collect();
        let held: Vec<Expr> = self.constraints.iter().map(|one| one.expr).collect();
        if let Some(holding) = self.graph.holding_forces(&held, velocities, &pushes) {
            for (force, holding) in forces.iter_mut().zip(holding) {
                *force = self.graph.sum(&[*force, holding]);
            }
        }
        Ok(forces)
    }

    /// A known part and the learned terms of one place, given by their positions, coefficients as
    /// symbols.
    fn total(&mut self, known: Expr, place: Place, active: &[usize]) -> Expr {
        let mut parts = vec![(1.0, known)];
        for &k in active {
            if let Some(term) = self.terms[k].part(place) {
                let coefficient = self.graph.symbol(Symbol::Coefficient(k));
                parts.push((1.0, self.graph.multiply(coefficient, term)));
            }
        }
        self.graph.linear(0.0, &parts)
    }
}

/// An expression with zero for the coefficients of all terms but some.
pub(crate) fn without_others(graph: &mut Graph, expr: Expr, active: &[usize]) -> Expr {
    let zero = graph.number(0.0);
    let others = graph.symbols(&[expr]).into_iter().filter(|symbol| match symbol {
        Symbol::Coefficient(k) => !active.contains(k),
        _ => false,
    });
    let zeros: HashMap<Symbol, Expr> = others.map(|symbol| (symbol, zero)).collect();
    if zeros.is_empty() { expr } else { graph.substitute(expr, &zeros) }
}
