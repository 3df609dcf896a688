//! Models to export, and a plain integrator that generated code is held against.

use std::sync::Arc;

use leverrier::internals::dynamics::Method;
use leverrier::internals::dynamics::Tableau;
use leverrier::internals::export::{
    Export, ExportedIntegrator, IntegratorKind, Pretty, PrettyNumber, Provenance,
};
use leverrier::internals::expr::{
    Bounds, Expr, FUNCTIONS, Function, Graph, Names, Observed, Parameter, Place, Symbol, System,
    Term, TermId, Variable, build,
};
use leverrier::internals::fit::{Law, Stepping};
use nalgebra::DMatrix;

/// A model with everything that an export needs.
pub(crate) struct Case {
    pub law: Law,
    pub pretty: Pretty,
    pub kind: IntegratorKind,
    pub order: u32,
    pub start: (f64, Vec<f64>),
}

impl Case {
    pub(crate) fn export(&self) -> Export<'_> {
        Export {
            law: &self.law,
            pretty: &self.pretty,
            integrator: ExportedIntegrator {
                name: "test method".to_string(),
                order: self.order,
                kind: self.kind.clone(),
            },
            provenance: Provenance {
                version: "0.1.0".to_string(),
                spec: ("a_b%c.ham".to_string(), "5e".repeat(32)),
                data: Some(("data\\*/\"\"\"{.csv\n#".to_string(), "0a".repeat(32))),
                seed: 7,
            },
            start: Some(self.start.clone()),
        }
    }
}

pub(crate) fn leapfrog() -> IntegratorKind {
    IntegratorKind::Splitting { weights: vec![1.0] }
}

fn forest_ruth() -> IntegratorKind {
    let outer = 1.0 / (2.0 - 2f64.cbrt());
    IntegratorKind::Splitting { weights: vec![outer, 1.0 - 2.0 * outer, outer] }
}

/// Numbers of the test's own, kept to its end as those of the table of methods are.
fn tableau(matrix: Vec<f64>, weights: Vec<f64>, nodes: Vec<f64>) -> &'static Tableau {
    let (matrix, weights, nodes) = (matrix.leak(), weights.leak(), nodes.leak());
    Box::leak(Box::new(Tableau { matrix, weights, nodes }))
}

fn gauss_legendre_4() -> IntegratorKind {
    let s = 3f64.sqrt() / 6.0;
    IntegratorKind::Implicit(tableau(
        vec![0.25, 0.25 - s, 0.25 + s, 0.25],
        vec![0.5, 0.5],
        vec![0.5 - s, 0.5 + s],
    ))
}

fn rk4() -> IntegratorKind {
    let mut matrix = vec![0.0; 16];
    (matrix[4], matrix[9], matrix[14]) = (0.5, 0.5, 1.0);
    IntegratorKind::Explicit(tableau(
        matrix,
        vec![1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
        vec![0.0, 0.5, 0.5, 1.0],
    ))
}

fn variable(name: &str, unit: Option<&str>) -> Variable {
    Variable { name: name.to_string(), unit: None, unit_text: unit.map(str::to_string) }
}

/// Builds a system term by term.
struct Builder {
    system: System,
    coefficients: Vec<f64>,
}

impl Builder {
    fn new(name: &str, coordinates: &[&str], momenta: &[&str]) -> Builder {
        let mut graph = Graph::new();
        let zero = graph.number(0.0);
        let system = System {
            name: name.to_string(),
            graph,
            coordinates: coordinates.iter().map(|name| variable(name, Some("rad"))).collect(),
            momenta: momenta.iter().map(|name| variable(name, None)).collect(),
            declared_bodies: Vec::new(),
            observed: Observed::Momenta,
            velocities: Vec::new(),
            time: variable("t", Some("s")),
            inputs: Vec::new(),
            hidden: Vec::new(),
            parameters: Vec::new(),
            kinetic: zero,
            potential: zero,
            hamiltonian: zero,
            forces: vec![zero; coordinates.len()],
            sensors: vec![zero; 2 * coordinates.len()],
            constraints: Vec::new(),
            measures: Vec::new(),
            terms: Vec::new(),
        };
        Builder { system, coefficients: Vec::new() }
    }

    fn q(&mut self, i: usize) -> Expr {
        self.system.graph.symbol(Symbol::Coordinate(i))
    }

    fn p(&mut self, i: usize) -> Expr {
        self.system.graph.symbol(Symbol::Momentum(i))
    }

    fn monomial(&mut self, parts: &[(Expr, f64)]) -> Expr {
        self.system.graph.product(1.0, parts)
    }

    fn apply(&mut self, name: &str, argument: Expr) -> Expr {
        self.system.graph.apply(Function::by_name(name).unwrap(), argument)
    }

    /// A learned term; zero is a term that was not chosen.
    fn term(&mut self, place: Place, name: Option<&str>, expr: Expr, coefficient: f64) {
        let names = Names { coefficients: Vec::new(), ..self.system.names() };
        let label = self.system.graph.text(expr, &names);
        self.system.terms.push(Term {
            place,
            expr,
            also: Vec::new(),
            effect: None,
            label,
            name: name.map(str::to_string),
            bounds: Bounds::FREE,
            unit: None,
            unit_text: Some("kg m^2/s^2".to_string()),
        });
        self.coefficients.push(coefficient);
    }

    fn parameter(&mut self, name: &str, start: f64) -> Expr {
        let i = self.system.parameters.len();
        self.system.parameters.push(Parameter {
            name: name.to_string(),
            start,
            bounds: Bounds::FREE,
            per: None,
            unit: None,
            unit_text: None,
        });
        self.system.graph.symbol(Symbol::Parameter(i))
    }

    fn finish(self, kind: IntegratorKind, order: u32, step: f64, start: (f64, Vec<f64>)) -> Case {
        let terms = self.system.term_ids().into_iter().zip(self.coefficients);
        let terms: Vec<(TermId, f64)> = terms.filter(|(_, value)| *value != 0.0).collect();
        // Errors of every kind: usual, unknown, exact.
        let mut variances: Vec<f64> = (0..terms.len())
            .map(|i| [1.3e-3, f64::NAN, 0.0, f64::INFINITY, 2e-9][i % 5].powi(2))
            .collect();
        let parameters: Vec<f64> = self.system.parameters.iter().map(|p| p.start).collect();
        variances.extend(parameters.iter().map(|_| 0.01f64.powi(2)));
        let noise = [0.005, 1.25e-7].into_iter().cycle().take(2 * self.system.degrees()).collect();
        let stepping = Stepping { method: Method::by_name("leapfrog").unwrap(), longest: step };
        let law = Law::new(Arc::new(self.system), terms, parameters, noise, (stepping, 2)).unwrap();
        let law = law.with_covariance(DMatrix::from_diagonal(&variances.into())).unwrap();
        let mut pretty = Pretty::plain(&law);
        if let Some(number) = pretty.numbers.first_mut() {
            let snapped = Some(number.value.to_string());
            *number = PrettyNumber { snapped, standard_error: 0.0, ..*number };
        }
        pretty
            .notes
            .push("c1 = 1/2 is 0.3 standard errors from what was learned: 50% & more".into());
        Case { law, pretty, kind, order, start }
    }
}

/// Known kinetic energy, cosine, a driven term with a time in it.
fn pendulum() -> Case {
    let mut b = Builder::new("pendulum", &["theta"], &["p_theta"]);
    let (q, p) = (b.q(0), b.p(0));
    let square = b.monomial(&[(p, 2.0)]);
    b.system.kinetic = b.system.graph.scale(0.5, square);
    let cos = b.apply("cos", q);
    b.term(Place::Potential, Some("k"), cos, -1.3125);
    b.term(Place::Potential, None, q, 0.0);
    let fourth = b.monomial(&[(q, 4.0)]);
    b.term(Place::Potential, Some("K"), fourth, 0.0123);
    let (a, shift) = (b.parameter("a", 0.25), b.parameter("b", 0.5));
    let one_plus = b.system.graph.linear(1.0, &[(1.0, a)]);
    let product = b.system.graph.multiply(one_plus, q);
    let argument = b.system.graph.add(product, shift);
    let sin = b.apply("sin", argument);
    b.term(Place::Potential, None, sin, 0.031);
    b.finish(leapfrog(), 2, 0.05, (0.0, vec![0.9, 0.1]))
}

/// Two degrees of freedom, indexed names, fourth order; a regular orbit.
fn henon_heiles() -> Case {
    let mut b = Builder::new("Hénon-Heiles", &["q[1]", "q[2]"], &["p[1]", "p[2]"]);
    let (x, y, u, v) = (b.q(0), b.q(1), b.p(0), b.p(1));
    for (place, parts, c) in [
        (Place::Kinetic, vec![(u, 2.0)], 0.5),
        (Place::Kinetic, vec![(v, 2.0)], 0.500_000_000_1),
        (Place::Kinetic, vec![(u, 3.0)], 0.0),
        (Place::Potential, vec![(x, 2.0)], 0.5),
        (Place::Potential, vec![(y, 2.0)], 0.4999),
        (Place::Potential, vec![(x, 2.0), (y, 1.0)], 1.0),
        (Place::Potential, vec![(y, 3.0)], -1.0 / 3.0),
        (Place::Potential, vec![(x, 7.0), (y, 5.0)], 1.5e-9),
    ] {
        let expr = b.monomial(&parts);
        b.term(place, None, expr, c);
    }
    b.finish(forest_ruth(), 4, 0.1, (-1.5, vec![0.1, 0.02, 0.05, 0.12]))
}

/// A general H, friction, and names that are words of Rust, C or Python.
fn damped_rotor() -> Case {
    let mut b = Builder::new("damped rotor", &["in"], &["lambda"]);
    let (q, p) = (b.q(0), b.p(0));
    let cos = b.apply("cos", q);
    let inertia = b.system.graph.linear(2.0, &[(1.0, cos)]);
    b.system.hamiltonian = b.system.graph.product(0.5, &[(p, 2.0), (inertia, -1.0)]);
    b.term(Place::Hamiltonian, Some("double"), cos, -0.7);
    let size = b.apply("abs", p);
    let drag = b.system.graph.multiply(p, size);
    b.term(Place::Force(0), Some("x1"), drag, -0.02);
    let t = b.system.graph.symbol(Symbol::Time);
    let double = b.system.graph.scale(1.7, t);
    let drive = b.apply("sin", double);
    b.term(Place::Force(0), None, drive, 0.1);
    let sign = b.apply("sign", p);
    b.term(Place::Force(0), None, sign, 0.0);
    b.finish(gauss_legendre_4(), 4, 0.05, (0.0, vec![0.4, 0.3]))
}

/// A magnetic H and a potential of many functions, by an explicit method.
fn magnetic() -> Case {
    let mut b = Builder::new("magnetic \"trap\" */ \\", &["x", "X"], &["p_x", "p_X"]);
    let (x, y, u, v) = (b.q(0), b.q(1), b.p(0), b.p(1));
    let g = &mut b.system.graph;
    let a = g.linear(0.0, &[(1.0, u), (0.4, y)]);
    let c = g.linear(0.0, &[(1.0, v), (-0.4, x)]);
    let (a2, c2) = (g.power(a, 2.0), g.power(c, 2.0));
    b.system.hamiltonian = g.linear(0.0, &[(0.5, a2), (0.5, c2)]);
    let r2 = {
        let (x2, y2) = (g.power(x, 2.0), g.power(y, 2.0));
        g.linear(1.0, &[(1.0, x2), (1.0, y2)])
    };
    let inverse = g.power(r2, -1.5);
    b.term(Place::Hamiltonian, None, inverse, -0.3);
    for (name, c) in [("sqrt", 0.9), ("log", 0.2), ("exp", 0.01), ("tanh", 0.1), ("atan", 0.1)] {
        let expr = b.apply(name, r2);
        b.term(Place::Hamiltonian, None, expr, c);
    }
    let power = b.system.graph.power_of(r2, x);
    b.term(Place::Hamiltonian, None, power, 0.02);
    b.finish(rk4(), 4, 0.02, (0.0, vec![0.3, -0.2, 0.1, 0.25]))
}

/// An energy of velocities: masses couple, and forces go by velocities.
fn double_pendulum() -> Case {
    let text = "system \"double pendulum\"
coordinates a, b
param m = 0.7
param l = 0.8
T = rate(a)^2/2 + m*(rate(sin(a) + l*sin(b))^2 + rate(cos(a) + l*cos(b))^2)/2
V = span{ cos(a), cos(b) }
force a += span{ -rate(a), rate(b) - rate(a) }
force b += -0.02*(rate(b) - rate(a))";
    let compiled = build("case", text).unwrap_or_else(|error| panic!("{error}"));
    let system = System::clone(&compiled.system);
    let builder = Builder { system, coefficients: vec![-16.7, -5.5, 0.05, 0.0] };
    builder.finish(gauss_legendre_4(), 4, 0.02, (0.0, vec![1.3, -0.4, 0.2, 0.1]))
}

/// What moves and is not measured: a second mass, and a memory that the motion drives.
fn hysteretic_pair() -> Case {
    let text = "system \"hysteretic pair\"
coordinates x; momenta p
hidden z = 0.1 with p_z
param b = 0.7
state w = 0.2 { w' = rate(x) - b*w*p^2 }
T = p^2/2 + p_z^2/2
V = span{ x^2, (z - x)^2 }
force x += span{ -w, -p }";
    let compiled = build("case", text).unwrap_or_else(|error| panic!("{error}"));
    let system = System::clone(&compiled.system);
    let builder = Builder { system, coefficients: vec![0.5, 0.3, 0.4, 0.02] };
    builder.finish(rk4(), 4, 0.02, (0.0, vec![0.9, 0.1, 0.2, 0.0, 0.1, 0.0]))
}

/// A weight on a rod by its place: what holds it there is in the equations.
fn weight_on_a_rod() -> Case {
    let text = "system \"weight on a rod\"
coordinates x, y; momenta p, r
T = p^2/2 + r^2/2
V = span{ y, x^2 }
force x += span{ -p }
constrain x^2 + y^2 == 1";
    let compiled = build("case", text).unwrap_or_else(|error| panic!("{error}"));
    let system = System::clone(&compiled.system);
    let builder = Builder { system, coefficients: vec![0.98, -0.1, 0.03] };
    builder.finish(gauss_legendre_4(), 4, 0.05, (0.0, vec![0.6, -0.8, 0.4, 0.3]))
}

/// Nothing learned, no potential.
fn free_particle() -> Case {
    let mut b = Builder::new("", &["q"], &["p"]);
    let p = b.p(0);
    b.system.kinetic = b.system.graph.power(p, 2.0);
    b.finish(leapfrog(), 2, 1e-6, (0.0, vec![0.0, 1.0]))
}

/// Every row of the table of functions, in an oscillator of its own. Variables have the names
/// that functions have in C and SymPy: the generated code must not confuse them.
fn every_function() -> Case {
    let coordinates: Vec<&str> = FUNCTIONS.iter().map(|row| row.c.name).collect();
    let momenta: Vec<String> = FUNCTIONS
        .iter()
        .map(|row| match row.sympy {
            name if coordinates.contains(&name) => format!("p_{name}"),
            name => name.to_string(),
        })
        .collect();
    let momenta: Vec<&str> = momenta.iter().map(String::as_str).collect();
    let mut b = Builder::new("every function", &coordinates, &momenta);
    let (mut kinetic, mut potential) = (Vec::new(), Vec::new());
    for (i, (function, row)) in Function::all().zip(FUNCTIONS).enumerate() {
        let (q, p) = (b.q(i), b.p(i));
        kinetic.push((0.5, b.monomial(&[(p, 2.0)])));
        potential.push((0.5, b.monomial(&[(q, 2.0)])));
        let (low, high) = row.domain.sample_interval();
        let sine = b.apply("sin", q);
        let g = &mut b.system.graph;
        let argument = g.linear(0.3 * low + 0.7 * high, &[(0.2 * (high - low), sine)]);
        let value = g.apply(function, argument);
        b.term(Place::Potential, None, value, 0.1);
    }
    b.system.kinetic = b.system.graph.linear(0.0, &kinetic);
    b.system.potential = b.system.graph.linear(0.0, &potential);
    let start = (0..2 * coordinates.len()).map(|i| 0.2 - 0.01 * i as f64).collect();
    b.finish(leapfrog(), 2, 0.05, (0.0, start))
}

pub(crate) fn cases() -> Vec<Case> {
    vec![
        pendulum(),
        henon_heiles(),
        damped_rotor(),
        magnetic(),
        double_pendulum(),
        hysteretic_pair(),
        weight_on_a_rod(),
        free_particle(),
        every_function(),
    ]
}

pub(crate) fn case(name: &str) -> Case {
    cases().into_iter().find(|case| case.law.system().name == name).unwrap()
}

/// Equations of motion by the slow evaluator.
pub(crate) struct Equations<'a> {
    case: &'a Case,
    graph: Graph,
    energy: Expr,
    field: Vec<Expr>,
}

impl<'a> Equations<'a> {
    pub(crate) fn new(case: &'a Case) -> Equations<'a> {
        let mut system = System::clone(case.law.system());
        let n = system.degrees();
        let energy = system.energy(case.law.support()).unwrap();
        let forces = system.force(case.law.support()).unwrap();
        let rates = system.rates(case.law.support()).unwrap();
        let gradient = system.graph.gradient(energy, &case.law.system().state());
        let mut field = gradient[n..].to_vec();
        field.extend((0..n).map(|i| system.graph.subtract(forces[i], gradient[i])));
        for (i, rate) in rates {
            (field[i], field[n + i]) = (rate, system.graph.number(0.0));
        }
        Equations { case, graph: system.graph, energy, field }
    }

    fn value(&self, expr: Expr, state: &[f64], t: f64) -> f64 {
        let n = state.len() / 2;
        self.graph.value(expr, &|symbol| match symbol {
            Symbol::Coordinate(i) => state[i],
            Symbol::Momentum(i) => state[n + i],
            Symbol::Velocity(_) => f64::NAN,
            Symbol::Time => t,
            Symbol::Input(..) | Symbol::Delayed(..) => f64::NAN,
            Symbol::Parameter(i) => self.case.law.parameters()[i],
            Symbol::Coefficient(k) => {
                self.case.law.coefficient(self.case.law.system().term_ids()[k]).unwrap()
            }
        })
    }

    pub(crate) fn energy(&self, state: &[f64], t: f64) -> f64 {
        self.value(self.energy, state, t)
    }

    /// dq/dt, then dp/dt.
    pub(crate) fn field(&self, state: &[f64], t: f64) -> Vec<f64> {
        self.field.iter().map(|&expr| self.value(expr, state, t)).collect()
    }
}

/// The start and the states after each step.
pub(crate) fn reference(case: &Case, steps: usize) -> Vec<Vec<f64>> {
    let equations = Equations::new(case);
    let mut states = vec![case.start.1.clone()];
    for i in 0..steps {
        let t = case.start.0 + i as f64 * case.law.stepping().longest;
        let next = step(&equations, &states[i], t, case.law.stepping().longest, &case.kind);
        states.push(next);
    }
    states
}

fn step(equations: &Equations, state: &[f64], t: f64, h: f64, kind: &IntegratorKind) -> Vec<f64> {
    let n = state.len() / 2;
    match kind {
        IntegratorKind::Splitting { weights } => {
            let mut z = state.to_vec();
            let drift = |z: &mut Vec<f64>, time: f64, length: f64, half: usize| {
                let field = equations.field(z, time);
                for i in half * n..(half + 1) * n {
                    z[i] += length * field[i];
                }
            };
            let mut time = t;
            for weight in weights {
                let w = weight * h;
                drift(&mut z, time, 0.5 * w, 0);
                drift(&mut z, time + 0.5 * w, w, 1);
                time += w;
                drift(&mut z, time, 0.5 * w, 0);
            }
            z
        }
        IntegratorKind::Implicit(tableau) => {
            // Fixed-point iteration: another way to the same solution.
            let stages = tableau.weights.len();
            let mut slopes = vec![equations.field(state, t); stages];
            for _ in 0..60 {
                slopes = runge_kutta_slopes(equations, state, t, h, tableau, &slopes);
            }
            finish(state, h, tableau, &slopes)
        }
        IntegratorKind::Explicit(tableau) => {
            let stages = tableau.weights.len();
            let mut slopes = vec![vec![0.0; 2 * n]; stages];
            for _ in 0..stages {
                slopes = runge_kutta_slopes(equations, state, t, h, tableau, &slopes);
            }
            finish(state, h, tableau, &slopes)
        }
    }
}

fn runge_kutta_slopes(
    equations: &Equations,
    state: &[f64],
    t: f64,
    h: f64,
    tableau: &Tableau,
    slopes: &[Vec<f64>],
) -> Vec<Vec<f64>> {
    let stages = slopes.len();
    (0..stages)
        .map(|i| {
            let mut at = state.to_vec();
            for (j, slope) in slopes.iter().enumerate() {
                for (x, slope) in at.iter_mut().zip(slope) {
                    *x += h * tableau.matrix[i * stages + j] * slope;
                }
            }
            equations.field(&at, t + tableau.nodes[i] * h)
        })
        .collect()
}

fn finish(state: &[f64], h: f64, tableau: &Tableau, slopes: &[Vec<f64>]) -> Vec<f64> {
    let mut out = state.to_vec();
    for (weight, slope) in tableau.weights.iter().zip(slopes) {
        for (x, slope) in out.iter_mut().zip(slope) {
            *x += h * weight * slope;
        }
    }
    out
}
