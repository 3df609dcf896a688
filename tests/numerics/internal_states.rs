//! Internal states of first order, against an independent integration of their laws.

use leverrier::internals::dynamics::{Batch, Dynamics, Method, Scratch, advance};
use leverrier::internals::eval::{BACKENDS, Backend};
use leverrier::internals::expr::{System, build};

use crate::support::keeps_its_order;

/// Two internal states, of which one drives the other; they act on the motion and it on them.
const COUPLED: &str = "coordinates x; momenta p; param b = 0.7
state w = 0.2 { w' = rate(x) - b*w*p^2 }
state v { v' = w - 0.5*v + 0.1*x*v }
T = p^2/3; V = x^2/2 + x^4/10
force x += -0.8*w + 0.3*v";

/// dz/dt of the same, written by hand.
fn field([x, p, w, v]: [f64; 4], b: f64) -> [f64; 4] {
    let velocity = 2.0 * p / 3.0;
    [
        velocity,
        -x - 0.4 * x.powi(3) - 0.8 * w + 0.3 * v,
        velocity - b * w * p * p,
        w - 0.5 * v + 0.1 * x * v,
    ]
}

/// The classical method of Runge and Kutta, in steps so fine that only rounding is left.
fn fine(start: [f64; 4], b: f64, span: f64) -> [f64; 4] {
    let steps = 20_000;
    let h = span / f64::from(steps);
    let mut z = start;
    for _ in 0..steps {
        let at = |k: [f64; 4], part: f64| -> [f64; 4] {
            std::array::from_fn(|i| z[i] + part * h * k[i])
        };
        let k1 = field(z, b);
        let k2 = field(at(k1, 0.5), b);
        let k3 = field(at(k2, 0.5), b);
        let k4 = field(at(k3, 1.0), b);
        z = std::array::from_fn(|i| z[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
    }
    z
}

fn system(text: &str) -> System {
    let compiled = build("test", text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    System::clone(&compiled.system)
}

const START: [f64; 4] = [0.9, -0.4, 0.2, -0.3];

/// Coordinates, internal states in their places, momenta; what stands as theirs is zero.
fn layout([x, p, w, v]: [f64; 4]) -> [f64; 6] {
    [x, w, v, p, 0.0, 0.0]
}

fn run(dynamics: &Dynamics, method: Method, steps: usize) -> Vec<f64> {
    let mut batch = Batch::new(3, 1);
    batch.set(0, 0.0, &layout(START));
    advance(dynamics, method, &mut batch, &[2.0], steps, &[0.7], &mut Scratch::new());
    batch.get(0)
}

#[test]
fn every_method_keeps_its_order_with_internal_states() {
    let system = system(COUPLED);
    let expected = layout(fine(START, 0.7, 2.0));
    for &(_, backend) in BACKENDS {
        let dynamics = Dynamics::known(&system, backend);
        assert!(!dynamics.separable() && !dynamics.is_hamiltonian());
        for method in Method::all().filter(|method| !method.needs_separable()) {
            let row = method.row();
            let error = |steps: usize| {
                let end = run(&dynamics, method, steps);
                assert_eq!(end[4..], [0.0, 0.0], "what has no momentum gets none");
                end.iter().zip(expected).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
            };
            keeps_its_order(method, error);
            assert!(error(256) < 1e-5, "{}: {}", row.name, error(256));
        }
    }
}

#[test]
fn tangents_of_internal_states_are_the_jacobian_of_the_discrete_map() {
    let system = system(COUPLED);
    let dynamics = Dynamics::known(&system, Backend::default());
    for name in ["rk4", "gauss-legendre-4", "cooper-verner-8"] {
        let method = Method::by_name(name).unwrap();
        let end = |start: [f64; 6], b: f64| -> Vec<f64> {
            let mut batch = Batch::new(3, 1);
            batch.set(0, 0.0, &start);
            advance(&dynamics, method, &mut batch, &[0.6], 3, &[b], &mut Scratch::new());
            batch.get(0)
        };
        let mut batch = Batch::with_tangents(3, 1, 1);
        batch.set(0, 0.0, &layout(START));
        advance(&dynamics, method, &mut batch, &[0.6], 3, &[0.7], &mut Scratch::new());
        for column in 0..7 {
            let step = 1e-6;
            let moved = |by: f64| {
                let mut start = layout(START);
                if let Some(x) = start.get_mut(column) {
                    *x += by;
                }
                end(start, if column == 6 { 0.7 + by } else { 0.7 })
            };
            let (up, down) = (moved(step), moved(-step));
            for row in 0..6 {
                let difference = (up[row] - down[row]) / (2.0 * step);
                let tangent = batch.tangent[row * 7 + column];
                assert!(
                    (difference - tangent).abs() < 1e-8,
                    "{name}, d{row}/d{column}: {tangent} and {difference}"
                );
            }
        }
    }
}

#[test]
fn a_law_of_the_momenta_alone_leaves_the_motion_separable() {
    let text = "coordinates q; momenta p; state s { s' = rate(q) }; T = p^2/2; V = q^2/2";
    let dynamics = Dynamics::known(&system(text), Backend::default());
    assert!(dynamics.separable());
    let method = Method::by_name("suzuki-umeno-8").unwrap();
    let mut batch = Batch::new(2, 1);
    batch.set(0, 0.0, &[0.4, 1.0, -0.7, 0.0]);
    advance(&dynamics, method, &mut batch, &[3.0], 60, &[], &mut Scratch::new());
    let end = batch.get(0);
    // The integral of the velocity is the way.
    assert!((end[1] - 1.0 - (end[0] - 0.4)).abs() < 1e-14, "{end:?}");
}

#[test]
fn learned_terms_stand_in_the_law_of_a_state() {
    let text = "coordinates q; momenta p; T = span{ p^2 }; V = q^2/2
state s { s' = span{ a: rate(q), b: -s } }; force q += -s";
    let system = system(text);
    let terms = system.term_ids();
    let dynamics = Dynamics::new(&system, &terms, Backend::default()).unwrap();
    let theta = [0.5, 2.0, 0.3];
    let mut batch = Batch::new(2, 1);
    batch.set(0, 0.0, &[0.4, 0.1, -0.7, 0.0]);
    let mut out = vec![0.0; 4];
    dynamics.field_at(&batch, &theta, &mut out, &mut Scratch::new());
    let expected = [-0.7, 2.0 * -0.7 - 0.3 * 0.1, -0.4 - 0.1, 0.0];
    for (a, b) in out.iter().zip(expected) {
        assert!((a - b).abs() < 1e-15, "{out:?}");
    }
    // Without the term of T nothing moves, and the rate is zero.
    let some = Dynamics::new(&system, &terms[1..], Backend::default()).unwrap();
    some.field_at(&batch, &theta[1..], &mut out, &mut Scratch::new());
    assert_eq!(out[..2], [0.0, -0.3 * 0.1]);
}
