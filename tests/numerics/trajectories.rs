//! Single trajectories in machine code are those of the batched evaluator, to the last bit.

use leverrier::internals::dynamics::systems::{SYSTEMS, known_system};
use leverrier::internals::dynamics::{Batch, Dynamics, Method, Scratch, advance};
use leverrier::internals::eval::Backend;
use leverrier::internals::expr::{Function, System};

/// Follows `lanes` trajectories near a start for four spans of `steps` steps.
fn follow(
    system: &System,
    start: &[f64],
    method: Method,
    backend: Backend,
    lanes: usize,
    steps: usize,
) -> Batch {
    let dynamics = Dynamics::whole(system, backend);
    let theta: Vec<f64> = (0..dynamics.unknowns()).map(|k| 0.1 + 0.05 * k as f64).collect();
    let mut batch = Batch::new(dynamics.degrees(), lanes);
    for lane in 0..lanes {
        let state: Vec<f64> = start.iter().map(|x| x * (1.0 - 0.01 * lane as f64)).collect();
        batch.set(lane, 0.25, &state);
    }
    let mut scratch = Scratch::new();
    let spans: Vec<f64> = (0..lanes).map(|lane| 7.0 * (1.0 + 0.1 * lane as f64)).collect();
    for _ in 0..4 {
        advance(&dynamics, method, &mut batch, &spans, steps, &theta, &mut scratch);
    }
    batch
}

fn same(system: &System, start: &[f64]) {
    for method in Method::all().filter(|method| method.needs_separable()) {
        for lanes in [1, 3] {
            let run = |backend| follow(system, start, method, backend, lanes, 150);
            let (batched, machine) = (run(Backend::Batched), run(Backend::Machine));
            for (a, b) in batched.state.iter().zip(&machine.state) {
                let same = a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
                assert!(same, "{} by {}: {a:e} {b:e}", system.name, method.row().name);
            }
            assert_eq!(batched.time, machine.time);
        }
    }
}

#[test]
fn known_systems_are_followed_bit_by_bit() {
    for row in SYSTEMS.iter().filter(|row| row.separable) {
        same(&(row.build)(), row.start);
    }
}

#[test]
fn learned_terms_inner_parameters_and_time_are_followed_bit_by_bit() {
    for driven in [false, true] {
        same(&crate::support::learned_system(driven, true), &[0.1, 0.2, 0.05, -0.1]);
    }
}

/// Every elementary function, powers of all kinds, and more state than registers.
#[test]
fn long_forces_are_followed_bit_by_bit() {
    let functions: Vec<Function> = Function::all().collect();
    for n in [1, 3, 7] {
        let system = known_system("many", n, |g, q, p, t| {
            let kinetic: Vec<_> = p.iter().map(|&p| g.power(p, 2.0)).collect();
            let kinetic = g.sum(&kinetic);
            let zero = g.number(0.0);
            let mut forces = Vec::new();
            for i in 0..n {
                let neighbour = q[(i + 1) % n];
                let mut parts = vec![(-1.0, q[i]), (0.1, g.power_of(q[i], neighbour))];
                for (k, &function) in functions.iter().enumerate() {
                    let scaled = g.linear(0.3, &[(0.2 + 0.01 * k as f64, q[i]), (0.1, t)]);
                    let value = g.apply(function, scaled);
                    let factor = g.product(0.02, &[(neighbour, 2.0), (value, 1.0)]);
                    parts.push((1.0, factor));
                }
                let shifted = g.linear(4.0, &[(1.0, q[i])]);
                parts.push((0.1, g.power(shifted, -1.5)));
                parts.push((0.1, g.power(shifted, 0.3)));
                forces.push(g.linear(0.0, &parts));
            }
            (kinetic, zero, zero, forces)
        });
        let start: Vec<f64> = (0..2 * n).map(|i| 0.2 + 0.03 * i as f64).collect();
        same(&system, &start);
    }
}

#[test]
fn what_does_not_move_stays_and_what_diverges_is_lost() {
    let system = known_system("runaway", 1, |g, q, p, _| {
        let zero = g.number(0.0);
        let kinetic = g.power(p[0], 2.0);
        let potential = g.product(-1.0, &[(q[0], 4.0)]);
        (kinetic, potential, zero, vec![])
    });
    let dynamics = Dynamics::known(&system, Backend::Machine);
    let method = Method::by_name("forest-ruth").unwrap();
    let mut batch = Batch::new(1, 2);
    batch.set(0, 0.0, &[1.0, 1.0]);
    batch.set(1, 0.0, &[1.0, 1.0]);
    advance(&dynamics, method, &mut batch, &[100.0, 1e-3], 1000, &[], &mut Scratch::new());
    assert!(batch.get(0).iter().all(|x| x.is_nan()));
    assert!(batch.is_finite(1));
    let before = batch.get(1);
    advance(&dynamics, method, &mut batch, &[0.0, 0.0], 1000, &[], &mut Scratch::new());
    assert_eq!(batch.get(1), before);
}
