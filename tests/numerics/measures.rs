//! What columns show: values and derivatives against closed forms and differences.

use leverrier::internals::dynamics::{Batch, Dynamics, Scratch, observe};
use leverrier::internals::eval::{BACKENDS, Backend};
use leverrier::internals::expr::{System, build};

const SPEC: &str = "coordinates x, y; momenta p_x, p_y; param a = 0.7
measure r = sqrt(x^2 + y^2); measure bearing = atan2(y, x)
measure felt = rate(rate(x)) + a*y; measure parting = rate(r)
T = span{ p_x^2, p_y^2 }
V = span{ x^2, x*y^2, cos(y) }
force x += span{ drag: -p_x }";

/// Coefficients of the terms, then the parameter.
const THETA: [f64; 7] = [0.5, 0.6, 0.3, -0.2, 0.9, 0.1, 0.7];
const STATE: [f64; 4] = [-0.8, 0.4, 0.3, -0.5];

fn system(text: &str) -> System {
    let compiled = build("test", text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    System::clone(&compiled.system)
}

/// All observables, and their derivatives `[observable][state, theta]`.
fn shown(
    dynamics: &Dynamics,
    system: &System,
    state: &[f64],
    theta: &[f64],
) -> (Vec<f64>, Vec<f64>) {
    let mut batch = Batch::with_tangents(2, 1, dynamics.unknowns());
    batch.set(0, 0.0, state);
    let rows = dynamics.observables();
    let mut out = vec![f64::NAN; rows];
    let mut tangent = vec![f64::NAN; rows * (4 + dynamics.unknowns())];
    let scratch = &mut Scratch::new();
    observe(dynamics, system.observed, &batch, theta, &mut out, Some(&mut tangent), scratch);
    (out, tangent)
}

#[test]
fn measures_follow_the_motion_and_so_do_their_derivatives() {
    let system = system(SPEC);
    assert_eq!(system.observables()[4..], ["r", "bearing", "felt", "parting"]);
    for &(_, backend) in BACKENDS {
        let dynamics = Dynamics::whole(&system, backend);
        let (out, tangent) = shown(&dynamics, &system, &STATE, &THETA);
        let [x, y, u, v] = STATE;
        let [t_x, t_y, k, mixed, _, drag, a] = THETA;
        let r = x.hypot(y);
        // x' = 2 t_x u and u' = -(2 k x + mixed y^2) - drag u.
        let felt = 2.0 * t_x * (-2.0 * k * x - mixed * y * y - drag * u) + a * y;
        let parting = (x * 2.0 * t_x * u + y * 2.0 * t_y * v) / r;
        for (found, truth) in out[4..].iter().zip([r, y.atan2(x), felt, parting]) {
            assert!((found - truth).abs() < 1e-14, "{backend:?}: {found} {truth}");
        }
        let h = 1e-6;
        for column in 0..4 + THETA.len() {
            let moved = |by: f64| {
                let (mut state, mut theta) = (STATE, THETA);
                match column.checked_sub(4) {
                    None => state[column] += by,
                    Some(k) => theta[k] += by,
                }
                shown(&dynamics, &system, &state, &theta).0
            };
            let (above, below) = (moved(h), moved(-h));
            for row in 0..out.len() {
                let truth = (above[row] - below[row]) / (2.0 * h);
                let found = tangent[row * (4 + THETA.len()) + column];
                assert!((found - truth).abs() < 1e-8, "{row} by {column}: {found} {truth}");
            }
        }
    }
}

#[test]
fn terms_that_are_left_out_or_only_probed_count_as_zero() {
    let system = system(SPEC);
    let ids = system.term_ids();
    let kept: Vec<_> = ids[..4].to_vec();
    let few = Dynamics::new(&system, &kept, Backend::default()).unwrap();
    let probed = Dynamics::with_probes(&system, &kept, &ids[4..], Backend::default()).unwrap();
    let whole = Dynamics::whole(&system, Backend::default());
    let zeros = [0.5, 0.6, 0.3, -0.2, 0.0, 0.0, 0.7];
    let (truth, by) = shown(&whole, &system, &STATE, &zeros);
    let (out, _) = shown(&few, &system, &STATE, &[0.5, 0.6, 0.3, -0.2, 0.7]);
    let (of_probes, by_probes) = shown(&probed, &system, &STATE, &zeros);
    for row in 0..truth.len() {
        assert!((out[row] - truth[row]).abs() < 1e-14, "{row}: {} {}", out[row], truth[row]);
        assert!((of_probes[row] - truth[row]).abs() < 1e-14, "{row}");
    }
    for (at, (a, b)) in by.iter().zip(&by_probes).enumerate() {
        assert!((a - b).abs() < 1e-14, "{at}: {a} {b}");
    }
}

#[test]
fn an_addition_to_the_spec_changes_what_is_felt() {
    let felt = "coordinates x; momenta p; measure felt = rate(rate(x)); T = p^2/2; V = x^2/2\n";
    let compiled = build("test", felt).unwrap();
    let scope = leverrier::internals::expr::Scope::of(&compiled);
    let with = scope.with("effect viscous_drag(x)").unwrap();
    let system = &with.compiled().system;
    let dynamics = Dynamics::whole(system, Backend::default());
    let mut batch = Batch::new(1, 1);
    batch.set(0, 0.0, &[0.3, 0.8]);
    let mut out = vec![0.0; 3];
    observe(&dynamics, system.observed, &batch, &[0.25], &mut out, None, &mut Scratch::new());
    assert!((out[2] - (-0.3 - 0.25 * 0.8)).abs() < 1e-15, "{out:?}");
}
