//! Energies of velocities, against what the Lagrangian itself says by finite differences.

use leverrier::internals::expr::{Expr, Symbol, System, build};

/// A Lagrangian as a function of coordinates, velocities and time, written by hand.
type ByHand = fn(&[f64], &[f64], f64) -> f64;

const DOUBLE_PENDULUM: &str = "coordinates a, b; velocities u, v
param m = 0.7
param l = 1.3
L = u^2/2 + m*(u^2 + l^2*v^2)/2 + m*l*u*v*cos(a - b) + (1 + m)*9.81*cos(a) + m*l*9.81*cos(b)";

fn double_pendulum(q: &[f64], v: &[f64], _: f64) -> f64 {
    let (m, l, g) = (0.7, 1.3, 9.81);
    // The places of both weights, by the chain rule.
    let first = [q[0].cos() * v[0], q[0].sin() * v[0]];
    let second = [first[0] + l * q[1].cos() * v[1], first[1] + l * q[1].sin() * v[1]];
    let square = |x: [f64; 2]| x[0] * x[0] + x[1] * x[1];
    let fall = g * q[0].cos() + m * g * (q[0].cos() + l * q[1].cos());
    square(first) / 2.0 + m * square(second) / 2.0 + fall
}

/// The same by places, which is what a constraint by coordinates is; angles of the second rod are
/// measured from the first.
const RELATIVE: &str = "coordinates a, c; momenta p, r
param m = 0.7
T = (rate(sin(a))^2 + rate(cos(a))^2)/2
T += m*(rate(sin(a) + 1.3*sin(a + c))^2 + rate(cos(a) + 1.3*cos(a + c))^2)/2
V = -9.81*cos(a) - m*9.81*(cos(a) + 1.3*cos(a + c))";

fn relative(q: &[f64], v: &[f64], t: f64) -> f64 {
    double_pendulum(&[q[0], q[0] + q[1]], &[v[0], v[0] + v[1]], t)
}

/// A charge in a field across the plane that turns, with a time-dependent mass: L has parts that
/// are linear in the velocities and parts that depend on time.
const CHARGE: &str = "coordinates x, y
L = (1 + 0.3*sin(t))*(rate(x)^2 + 2*rate(y)^2)/2 + 0.2*x*rate(x)*rate(y) +
    0.8*(x*rate(y) - y*rate(x)) + rate(x*cos(t)) - x^2*y^2/2";

fn charge(q: &[f64], v: &[f64], t: f64) -> f64 {
    let (x, y) = (q[0], q[1]);
    (1.0 + 0.3 * t.sin()) * (v[0] * v[0] + 2.0 * v[1] * v[1]) / 2.0
        + 0.2 * x * v[0] * v[1]
        + 0.8 * (x * v[1] - y * v[0])
        + (v[0] * t.cos() - x * t.sin())
        - x * x * y * y / 2.0
}

/// A chain of four: more than two coordinates are solved by elimination.
const CHAIN: &str = "coordinates q[1..4]
L = sum((rate(sum(sin(q[j]) for j in 1..i))^2 + rate(sum(cos(q[j]) for j in 1..i))^2)/2 for i in 1..4) +
    sum((5 - i)*9.81*cos(q[i]) for i in 1..4)";

fn chain(q: &[f64], v: &[f64], _: f64) -> f64 {
    let (mut x, mut y, mut sum) = (0.0, 0.0, 0.0);
    for (i, (q, v)) in q.iter().zip(v).enumerate() {
        x += q.cos() * v;
        y += q.sin() * v;
        sum += (x * x + y * y) / 2.0 + (4 - i) as f64 * 9.81 * q.cos();
    }
    sum
}

/// A mass matrix without a diagonal, and a coordinate of which only T of its momentum is known.
const CROSSED: &str = "coordinates x, y, z; momenta p, r, s
L = (2 + x^2)*rate(x)*rate(y) - x*y - z^2*x
T = s^2/3";

fn crossed(q: &[f64], v: &[f64], _: f64) -> f64 {
    (2.0 + q[0] * q[0]) * v[0] * v[1] - q[0] * q[1] - q[2] * q[2] * q[0] + 0.75 * v[2] * v[2]
}

const CASES: [(&str, ByHand); 5] = [
    (DOUBLE_PENDULUM, double_pendulum),
    (RELATIVE, relative),
    (CHARGE, charge),
    (CHAIN, chain),
    (CROSSED, crossed),
];

/// Equations of motion of a spec without learned terms.
struct Motion {
    system: System,
    rates: Vec<Expr>,
}

impl Motion {
    fn of(text: &str) -> Motion {
        let compiled = build("test", text).unwrap_or_else(|error| panic!("{error}\n{text}"));
        let mut system = System::clone(&compiled.system);
        let energy = system.energy(&[]).unwrap();
        let forces = system.force(&[]).unwrap();
        let n = system.degrees();
        let mut rates = Vec::new();
        for i in 0..n {
            rates.push(system.graph.derivative(energy, Symbol::Momentum(i)));
        }
        for (i, force) in forces.into_iter().enumerate() {
            let slope = system.graph.derivative(energy, Symbol::Coordinate(i));
            rates.push(system.graph.subtract(force, slope));
        }
        Motion { system, rates }
    }

    /// dq/dt, then dp/dt.
    fn field(&self, state: &[f64], t: f64) -> Vec<f64> {
        let n = self.system.degrees();
        let of = |symbol: Symbol| match symbol {
            Symbol::Coordinate(i) => state[i],
            Symbol::Momentum(i) => state[n + i],
            Symbol::Time => t,
            Symbol::Parameter(j) => self.system.parameters[j].start,
            _ => f64::NAN,
        };
        self.rates.iter().map(|&rate| self.system.graph.value(rate, &of)).collect()
    }

    /// One step of the classical method of Runge and Kutta.
    fn step(&self, z: &[f64], t: f64, h: f64) -> Vec<f64> {
        let at = |k: &[f64], part: f64| -> Vec<f64> {
            z.iter().zip(k).map(|(z, k)| z + part * h * k).collect()
        };
        let k1 = self.field(z, t);
        let k2 = self.field(&at(&k1, 0.5), t + h / 2.0);
        let k3 = self.field(&at(&k2, 0.5), t + h / 2.0);
        let k4 = self.field(&at(&k3, 1.0), t + h);
        let rate = |i: usize| (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) / 6.0;
        (0..z.len()).map(|i| z[i] + h * rate(i)).collect()
    }
}

/// A slope by central differences of the fourth order.
fn slope(f: impl Fn(f64) -> f64, h: f64) -> f64 {
    (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)
}

fn moved(x: &[f64], i: usize, by: f64) -> Vec<f64> {
    let mut out = x.to_vec();
    out[i] += by;
    out
}

#[test]
fn momenta_velocities_and_forces_are_those_of_the_lagrangian() {
    for (text, lagrangian) in CASES {
        let motion = Motion::of(text);
        let n = motion.system.degrees();
        for place in 0..5 {
            let at = |k: usize| (0.9 + 2.3 * k as f64 + 1.1 * place as f64).sin();
            let q: Vec<f64> = (0..n).map(at).collect();
            let v: Vec<f64> = (n..2 * n).map(|k| 2.0 * at(k)).collect();
            let t = 0.4 * f64::from(place);
            let momentum = |i: usize| slope(|h| lagrangian(&q, &moved(&v, i, h), t), 1e-2);
            let state: Vec<f64> = q.iter().copied().chain((0..n).map(momentum)).collect();
            let field = motion.field(&state, t);
            for i in 0..n {
                assert!((field[i] - v[i]).abs() < 1e-9, "{text}\n{} {}", field[i], v[i]);
                let push = slope(|h| lagrangian(&moved(&q, i, h), &v, t), 1e-3);
                let (found, size) = (field[n + i], push.abs().max(1.0));
                assert!((found - push).abs() < 1e-8 * size, "{text}\n{found} {push}");
            }
        }
    }
}

#[test]
fn trajectories_satisfy_the_equations_of_euler_and_lagrange() {
    for (text, lagrangian) in CASES {
        let motion = Motion::of(text);
        let n = motion.system.degrees();
        let (h, steps) = (1e-3, 600);
        let mut path = vec![(0..2 * n).map(|k| (1.0 + 1.9 * k as f64).cos()).collect::<Vec<f64>>()];
        for i in 0..steps {
            path.push(motion.step(&path[i], h * i as f64, h));
        }
        // From here on only the coordinates are looked at.
        let q = |i: usize| &path[i][..n];
        let velocity = |i: usize| -> Vec<f64> {
            let of = |k: usize| {
                (8.0 * (q(i + 1)[k] - q(i - 1)[k]) - (q(i + 2)[k] - q(i - 2)[k])) / (12.0 * h)
            };
            (0..n).map(of).collect()
        };
        for i in (10..steps - 10).step_by(97) {
            for k in 0..n {
                let momentum = |i: usize| {
                    let (v, t) = (velocity(i), h * i as f64);
                    slope(|d| lagrangian(q(i), &moved(&v, k, d), t), 1e-2)
                };
                let rate = (8.0 * (momentum(i + 1) - momentum(i - 1))
                    - (momentum(i + 2) - momentum(i - 2)))
                    / (12.0 * h);
                let v = velocity(i);
                let push = slope(|d| lagrangian(&moved(q(i), k, d), &v, h * i as f64), 1e-3);
                assert!((rate - push).abs() < 1e-5 * push.abs().max(1.0), "{text}\n{rate} {push}");
            }
        }
    }
}

#[test]
fn velocities_in_forces_are_those_of_the_motion() {
    let text = "coordinates a, b; velocities u, v
T = u^2 + v^2/2 + u*v*cos(a - b)
V = -2*cos(a) - cos(b)
force a += -0.3*u - 0.1*(u - v)
force b += -0.1*(v - rate(a)) - 0.2*rate(sin(b))";
    let (motion, free) = (Motion::of(text), Motion::of(text.split("force").next().unwrap()));
    let state = [0.4, -1.1, 0.8, 0.3];
    let (with, without) = (motion.field(&state, 0.0), free.field(&state, 0.0));
    let (u, v) = (with[0], with[1]);
    assert_eq!([u, v], [without[0], without[1]]);
    let forces = [-0.3 * u - 0.1 * (u - v), -0.1 * (v - u) - 0.2 * state[1].cos() * v];
    for i in 0..2 {
        let found = with[2 + i] - without[2 + i];
        assert!((found - forces[i]).abs() < 1e-12, "{found} {}", forces[i]);
    }
}

#[test]
fn a_constant_mass_matrix_keeps_the_energy_separable() {
    let text = "coordinates x, y; T = rate(x)^2 + rate(x)*rate(y) + rate(y)^2; V = x^2*y";
    let system = Motion::of(text).system;
    let text = system.graph.text(system.kinetic, &system.names());
    assert_eq!(text, "p_x^2/3 - p_x*p_y/3 + p_y^2/3");
    assert!(system.graph.is_zero(system.hamiltonian));
}

#[test]
fn relative_angles_leave_no_sum_of_squared_sines() {
    let system = Motion::of(RELATIVE).system;
    let text = system.graph.text(system.hamiltonian, &system.names());
    assert!(!text.contains("sin"), "{text}");
    assert!(!text.contains('a'), "{text}");
}
