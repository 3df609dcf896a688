//! Taylor series of the motion, against closed forms, invariants and other integrators.

use leverrier::internals::dynamics::systems::{SYSTEMS, known_system};
use leverrier::internals::dynamics::{
    Dynamics, StepControl, Stop, finest_method, simulate, taylor,
};
use leverrier::internals::eval::Backend;
use leverrier::internals::expr::Function;

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |worst, (a, b)| worst.max((a - b).abs()))
}

#[test]
fn every_closed_form_and_invariant_is_met() {
    for row in SYSTEMS {
        for backend in [Backend::Batched, Backend::Machine] {
            let dynamics = Dynamics::known(&(row.build)(), backend);
            let times: Vec<f64> = (0..40).map(|i| 0.13 * row.period * f64::from(i)).collect();
            let run = taylor(&dynamics, &[], row.start, &times, 0.0).unwrap();
            let trajectory = &run.trajectory;
            assert_eq!(trajectory.stop, Stop::Finished, "{}", row.name);
            assert_eq!(trajectory.times, times);
            for (i, (&time, state)) in times.iter().zip(&trajectory.states).enumerate() {
                if let Some(solution) = row.solution {
                    let error = distance(state, &solution(time));
                    assert!(error < 1e-12, "{} at {time}: {error:e}", row.name);
                }
                for invariant in row.invariants {
                    assert!(
                        (invariant(state) - invariant(row.start)).abs() < 1e-13,
                        "{}",
                        row.name
                    );
                }
                if row.conservative {
                    let drift = (trajectory.energies[i] - trajectory.energies[0]).abs();
                    assert!(drift < 1e-14, "{}: {drift:e}", row.name);
                }
            }
        }
    }
}

#[test]
fn long_runs_keep_the_energy_to_rounding() {
    let row = SYSTEMS.iter().find(|row| row.name == "Henon-Heiles").unwrap();
    let dynamics = Dynamics::known(&(row.build)(), Backend::default());
    let run = taylor(&dynamics, &[], row.start, &[0.0, 1e4], 0.0).unwrap();
    let energies = &run.trajectory.energies;
    assert!((energies[1] - energies[0]).abs() < 2e-15 && run.steps < 30_000, "{run:?}");
    // Back again: the motion is regular enough for that.
    let back = taylor(&dynamics, &[], &run.trajectory.states[1], &[1e4, 0.0], 0.0).unwrap();
    assert!(distance(&back.trajectory.states[1], row.start) < 1e-8);
}

#[test]
fn the_tolerance_is_met_and_sets_the_order() {
    let row = SYSTEMS.iter().find(|row| row.name == "pendulum").unwrap();
    let dynamics = Dynamics::known(&(row.build)(), Backend::default());
    let times = [0.0, row.period];
    let best = taylor(&dynamics, &[], row.start, &times, 0.0).unwrap();
    let mut before = usize::MAX;
    for tolerance in [1e-12, 1e-8, 1e-4] {
        let run = taylor(&dynamics, &[], row.start, &times, tolerance).unwrap();
        let error = distance(&run.trajectory.states[1], &best.trajectory.states[1]);
        assert!(error < 100.0 * tolerance && error > 1e-6 * tolerance, "{tolerance}: {error:e}");
        assert!(run.order < before);
        before = run.order;
    }
}

/// Every smooth function and power, time, learned terms: against the finest other integrator.
#[test]
fn every_function_has_its_series() {
    for function in Function::all() {
        let name = function.row().name;
        let system = known_system(name, 1, |g, q, p, t| {
            let kinetic = g.power(p[0], 2.0);
            let zero = g.number(0.0);
            let inside = g.linear(0.4, &[(0.3, q[0]), (0.02, t)]);
            let value = g.apply(function, inside);
            let shifted = g.linear(3.0, &[(1.0, q[0])]);
            let root = g.power(shifted, -1.5);
            let odd = g.power(shifted, 0.3);
            let general = g.power_of(shifted, inside);
            let product = g.product(0.1, &[(value, 2.0), (q[0], 3.0)]);
            let parts = [
                (-1.0, q[0]),
                (-0.1, value),
                (0.1, root),
                (0.1, odd),
                (-0.01, general),
                (0.1, product),
            ];
            let force = g.linear(0.0, &parts);
            (kinetic, zero, zero, vec![force])
        });
        let dynamics = Dynamics::known(&system, Backend::default());
        let times = [0.0, 0.5, 2.0];
        let start = vec![0.3, 0.2];
        let run = taylor(&dynamics, &[], &start, &times, 0.0);
        if !function.row().is_smooth() {
            assert!(run.is_none(), "{name}");
            continue;
        }
        let run = run.unwrap();
        let method = finest_method(&dynamics);
        let other = simulate(&dynamics, method, &[], &[start], &times, StepControl::FINEST);
        for (a, b) in run.trajectory.states.iter().zip(&other[0].states) {
            assert!(distance(a, b) < 1e-13, "{name}: {a:?} {b:?}");
        }
    }
}

#[test]
fn learned_terms_and_inner_parameters_take_part() {
    for (driven, separable) in [(false, true), (true, true), (true, false)] {
        let system = crate::support::learned_system(driven, separable);
        let dynamics = Dynamics::whole(&system, Backend::default());
        let theta: Vec<f64> = (0..dynamics.unknowns()).map(|k| 0.1 + 0.05 * k as f64).collect();
        let (start, times) = (vec![0.1, 0.2, 0.05, -0.1], [1.0, 0.5, 2.0]);
        let run = taylor(&dynamics, &theta, &start, &times, 0.0).unwrap();
        let method = finest_method(&dynamics);
        let other = simulate(&dynamics, method, &theta, &[start], &times, StepControl::FINEST);
        for (a, b) in run.trajectory.states.iter().zip(&other[0].states) {
            assert!(distance(a, b) < 1e-12, "{a:?} {b:?}");
        }
    }
}

#[test]
fn what_cannot_be_followed_says_why() {
    let system = known_system("runaway", 1, |g, q, p, _| {
        let zero = g.number(0.0);
        let kinetic = g.power(p[0], 2.0);
        let potential = g.product(-1.0, &[(q[0], 4.0)]);
        (kinetic, potential, zero, vec![])
    });
    let dynamics = Dynamics::known(&system, Backend::default());
    let run = taylor(&dynamics, &[], &[1.0, 1.0], &[0.0, 0.1, 100.0], 0.0).unwrap();
    assert_eq!(run.trajectory.times, [0.0, 0.1]);
    assert_ne!(run.trajectory.stop, Stop::Finished);
    // Nothing asked, nothing said.
    let run = taylor(&dynamics, &[], &[1.0, 1.0], &[], 0.0).unwrap();
    assert!(run.trajectory.states.is_empty());
    let run = taylor(&dynamics, &[], &[f64::NAN], &[0.0, 1.0], 0.0).unwrap();
    assert_ne!(run.trajectory.stop, Stop::Finished);
}
