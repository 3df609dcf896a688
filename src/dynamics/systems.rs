//! Canonical mechanical systems, fully known, for tests, examples and benchmarks.

use crate::expr::{Expr, Function, Graph, Observed, Symbol, System, Variable};

/// One canonical system.
pub struct SystemRow {
    /// Its name.
    pub name: &'static str,
    /// Builds it.
    pub build: fn() -> System,
    /// A typical start: coordinates, then momenta, at time 0.
    pub start: &'static [f64],
    /// A typical time scale: about a period, or the shortest of several.
    pub period: f64,
    /// Whether the energy is conserved.
    pub conservative: bool,
    /// H = T(p, t) + V(q, t) and no force depends on the momenta.
    pub separable: bool,
    /// The state at a time from [`SystemRow::start`], where a closed form exists.
    pub solution: Option<fn(f64) -> Vec<f64>>,
    /// Functions of the state that stay constant, apart from the energy.
    pub invariants: &'static [fn(&[f64]) -> f64],
}

/// A system without unknown parts, from its energy and forces; coordinates q1, q2, ... and
/// momenta p1, p2, ... `parts` returns T, V, the rest of H, and one force a coordinate
/// (an empty list for none).
pub fn known_system(
    name: &str,
    degrees: usize,
    parts: impl FnOnce(&mut Graph, &[Expr], &[Expr], Expr) -> (Expr, Expr, Expr, Vec<Expr>),
) -> System {
    let mut graph = Graph::new();
    let q: Vec<Expr> = (0..degrees).map(|i| graph.symbol(Symbol::Coordinate(i))).collect();
    let p: Vec<Expr> = (0..degrees).map(|i| graph.symbol(Symbol::Momentum(i))).collect();
    let t = graph.symbol(Symbol::Time);
    let (kinetic, potential, hamiltonian, mut forces) = parts(&mut graph, &q, &p, t);
    let zero = graph.number(0.0);
    forces.resize(degrees, zero);
    let variable = |name: String| Variable { name, unit: None, unit_text: None };
    System {
        name: name.to_string(),
        graph,
        coordinates: (1..=degrees).map(|i| variable(format!("q{i}"))).collect(),
        momenta: (1..=degrees).map(|i| variable(format!("p{i}"))).collect(),
        declared_bodies: Vec::new(),
        observed: Observed::Momenta,
        velocities: Vec::new(),
        time: variable("t".to_string()),
        inputs: Vec::new(),
        hidden: Vec::new(),
        parameters: Vec::new(),
        kinetic,
        potential,
        hamiltonian,
        forces,
        sensors: vec![zero; 2 * degrees],
        constraints: Vec::new(),
        measures: Vec::new(),
        terms: Vec::new(),
    }
}

/// Sum of squares / 2.
fn half_squares(graph: &mut Graph, of: &[Expr]) -> Expr {
    let squares: Vec<(f64, Expr)> = of.iter().map(|&x| (0.5, graph.power(x, 2.0))).collect();
    graph.linear(0.0, &squares)
}

/// Every canonical system. A new one is one row here.
pub static SYSTEMS: &[SystemRow] = &[
    SystemRow {
        name: "harmonic oscillator",
        build: || {
            known_system("harmonic oscillator", 1, |g, q, p, _| {
                let zero = g.number(0.0);
                (half_squares(g, p), half_squares(g, q), zero, vec![])
            })
        },
        start: &[0.8, 0.3],
        period: std::f64::consts::TAU,
        conservative: true,
        separable: true,
        solution: Some(|t| {
            let (sin, cos) = t.sin_cos();
            vec![0.8 * cos + 0.3 * sin, 0.3 * cos - 0.8 * sin]
        }),
        invariants: &[],
    },
    SystemRow {
        name: "pendulum",
        build: || {
            known_system("pendulum", 1, |g, q, p, _| {
                let zero = g.number(0.0);
                let cos = g.apply(Function::COS, q[0]);
                (half_squares(g, p), g.negate(cos), zero, vec![])
            })
        },
        start: &[1.4, 0.0],
        period: 7.1,
        conservative: true,
        separable: true,
        solution: None,
        invariants: &[],
    },
    SystemRow {
        name: "Henon-Heiles",
        build: || {
            known_system("Henon-Heiles", 2, |g, q, p, _| {
                let zero = g.number(0.0);
                let squares = half_squares(g, q);
                let first = g.product(1.0, &[(q[0], 2.0), (q[1], 1.0)]);
                let second = g.power(q[1], 3.0);
                let potential =
                    g.linear(0.0, &[(1.0, squares), (1.0, first), (-1.0 / 3.0, second)]);
                (half_squares(g, p), potential, zero, vec![])
            })
        },
        start: &[0.1, 0.2, 0.35, 0.1],
        period: std::f64::consts::TAU,
        conservative: true,
        separable: true,
        solution: None,
        invariants: &[],
    },
    SystemRow {
        name: "Kepler",
        build: || {
            known_system("Kepler", 2, |g, q, p, _| {
                let zero = g.number(0.0);
                let squares = half_squares(g, q);
                let squares = g.scale(2.0, squares);
                let inverse = g.power(squares, -0.5);
                (half_squares(g, p), g.negate(inverse), zero, vec![])
            })
        },
        // Perihelion of an ellipse with eccentricity 0.3 and semi-major axis 1.
        start: &[0.7, 0.0, 0.0, 1.362_770_287_738_494_4],
        period: std::f64::consts::TAU,
        conservative: true,
        separable: true,
        solution: Some(kepler),
        invariants: &[|z| z[0] * z[3] - z[1] * z[2]],
    },
    SystemRow {
        name: "coupled quartic oscillators",
        build: || {
            known_system("coupled quartic oscillators", 2, |g, q, p, _| {
                let zero = g.number(0.0);
                let squares = half_squares(g, q);
                let product = g.product(1.0, &[(q[0], 2.0), (q[1], 2.0)]);
                let potential = g.linear(0.0, &[(1.0, squares), (0.5, product)]);
                (half_squares(g, p), potential, zero, vec![])
            })
        },
        start: &[0.9, -0.4, 0.1, 0.6],
        period: 5.5,
        conservative: true,
        separable: true,
        solution: None,
        invariants: &[],
    },
    SystemRow {
        name: "non-separable oscillator",
        build: || {
            known_system("non-separable oscillator", 1, |g, q, p, _| {
                let zero = g.number(0.0);
                let one = g.number(1.0);
                let q2 = g.power(q[0], 2.0);
                let p2 = g.power(p[0], 2.0);
                let (a, b) = (g.add(q2, one), g.add(p2, one));
                (zero, zero, g.product(0.5, &[(a, 1.0), (b, 1.0)]), vec![])
            })
        },
        start: &[0.5, 0.7],
        period: 4.5,
        conservative: true,
        separable: false,
        solution: None,
        invariants: &[],
    },
    SystemRow {
        name: "damped oscillator",
        build: || {
            known_system("damped oscillator", 1, |g, q, p, _| {
                let zero = g.number(0.0);
                (half_squares(g, p), half_squares(g, q), zero, vec![g.scale(-0.4, p[0])])
            })
        },
        start: &[1.0, 0.0],
        period: std::f64::consts::TAU,
        conservative: false,
        separable: false,
        solution: Some(|t| damped(1.0, 0.0, t)),
        invariants: &[],
    },
    SystemRow {
        name: "driven oscillator",
        build: || {
            known_system("driven oscillator", 1, |g, q, p, t| {
                let zero = g.number(0.0);
                let drive = drive(g, t);
                (half_squares(g, p), half_squares(g, q), zero, vec![drive])
            })
        },
        // The steady state: q = a cos(1.7 t), a = 0.5 / (1 - 1.7^2), and a free vibration.
        start: &[0.6, -0.2],
        period: 3.7,
        conservative: false,
        separable: true,
        solution: Some(|t| {
            let (w, a) = (1.7_f64, 0.5 / (1.0 - 1.7 * 1.7));
            let (sin, cos) = t.sin_cos();
            let (c, s) = (0.6 - a, -0.2);
            vec![a * (w * t).cos() + c * cos + s * sin, -a * w * (w * t).sin() - c * sin + s * cos]
        }),
        invariants: &[],
    },
    SystemRow {
        name: "driven damped oscillator",
        build: || {
            known_system("driven damped oscillator", 1, |g, q, p, t| {
                let zero = g.number(0.0);
                let drive = drive(g, t);
                let force = g.linear(0.0, &[(1.0, drive), (-0.4, p[0])]);
                (half_squares(g, p), half_squares(g, q), zero, vec![force])
            })
        },
        start: &[0.6, -0.2],
        period: 3.7,
        conservative: false,
        separable: false,
        solution: Some(|t| {
            // x = a cos wt + b sin wt solves x'' + 0.4 x' + x = 0.5 cos wt.
            let w = 1.7_f64;
            let (stiff, loss) = (1.0 - w * w, 0.4 * w);
            let scale = 0.5 / (stiff * stiff + loss * loss);
            let (a, b) = (scale * stiff, scale * loss);
            let free = damped(0.6 - a, -0.2 - b * w, t);
            let (sin, cos) = (w * t).sin_cos();
            vec![a * cos + b * sin + free[0], w * (b * cos - a * sin) + free[1]]
        }),
        invariants: &[],
    },
];

/// cos(1.7 t) / 2.
fn drive(graph: &mut Graph, t: Expr) -> Expr {
    let phase = graph.scale(1.7, t);
    let cos = graph.apply(Function::COS, phase);
    graph.scale(0.5, cos)
}

/// x'' + 0.4 x' + x = 0 from x, v.
fn damped(x: f64, v: f64, t: f64) -> Vec<f64> {
    let rate = 0.2;
    let w = (1.0_f64 - rate * rate).sqrt();
    let (sin, cos) = (w * t).sin_cos();
    let s = (v + rate * x) / w;
    let decay = (-rate * t).exp();
    let position = decay * (x * cos + s * sin);
    vec![position, decay * w * (s * cos - x * sin) - rate * position]
}

/// The ellipse with eccentricity 0.3 and semi-major axis 1, from perihelion at time 0.
fn kepler(t: f64) -> Vec<f64> {
    let e = 0.3_f64;
    let mut anomaly = t;
    for _ in 0..50 {
        anomaly -= (anomaly - e * anomaly.sin() - t) / (1.0 - e * anomaly.cos());
    }
    let (sin, cos) = anomaly.sin_cos();
    let minor = (1.0 - e * e).sqrt();
    let rate = 1.0 / (1.0 - e * cos);
    vec![cos - e, minor * sin, -sin * rate, minor * cos * rate]
}
