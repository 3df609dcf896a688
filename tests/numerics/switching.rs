//! Motion across kinks and jumps, and along surfaces that hold it.

use leverrier::internals::dynamics::{Batch, Dynamics, Method, Scratch, advance};
use leverrier::internals::eval::Backend;
use leverrier::internals::expr::{System, build};

fn system(text: &str) -> System {
    let compiled = build("test", text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    System::clone(&compiled.system)
}

fn method(name: &str) -> Method {
    Method::by_name(name).unwrap()
}

/// A mass on a spring with dry friction.
const DRY: &str = "coordinates x; momenta p; T = p^2/2; V = x^2/2
force x += span{ f: -sign(p) }";

/// Its state at time t from rest at `x`: half circles about the ends of the band in which friction
/// holds it, until it stops within.
fn half_circles(mut x: f64, friction: f64, mut t: f64) -> [f64; 2] {
    let half = std::f64::consts::PI;
    while x.abs() > friction {
        let centre = friction.copysign(x);
        let (sin, cos) = t.sin_cos();
        if t <= half {
            return [centre + (x - centre) * cos, -(x - centre) * sin];
        }
        (x, t) = (2.0 * centre - x, t - half);
    }
    [x, 0.0]
}

#[test]
fn dry_friction_stops_a_mass_where_it_should() {
    let dynamics = Dynamics::whole(&system(DRY), Backend::default());
    let starts = [2.1, -1.3, 0.8, 0.2, -0.25];
    for name in ["rk4", "gauss-legendre-6"] {
        let mut batch = Batch::new(1, starts.len());
        for (lane, &x) in starts.iter().enumerate() {
            batch.set(lane, 0.0, &[x, 0.0]);
        }
        let mut scratch = Scratch::new();
        for sample in 1..80 {
            let spans = vec![0.23; starts.len()];
            advance(&dynamics, method(name), &mut batch, &spans, 8, &[0.25], &mut scratch);
            for (lane, &x) in starts.iter().enumerate() {
                let truth = half_circles(x, 0.25, 0.23 * f64::from(sample));
                for (a, b) in batch.get(lane).iter().zip(truth) {
                    assert!((a - b).abs() < 3e-7, "{name} from {x}, {sample}: {a} for {b}");
                }
            }
        }
    }
}

/// A text, theta, and starts.
type Case = (&'static str, &'static [f64], &'static [&'static [f64]]);

/// Systems with jumps, and starts that come to them within the span.
const SYSTEMS: &[Case] = &[
    (DRY, &[0.25], &[&[1.1, -0.2], &[0.1, 0.15], &[-0.9, 0.3], &[0.05, 0.02]]),
    // Both are separable: a kink in the energy, once at a number of its own.
    (
        "coordinates x; momenta p; T = p^2/2; V = span{ a: abs(x), b: x^2 }",
        &[0.7, 0.2],
        &[&[0.3, -0.8], &[-0.1, 0.9]],
    ),
    (
        "coordinates x; momenta p; param s = 0.4; T = p^2/2; V = x^2/2
V += span{ k: (abs(x - s) + x - s)/2 }",
        &[0.6, 0.4],
        &[&[0.2, 0.9], &[0.6, -1.1]],
    ),
    // Two masses that rub against each other.
    (
        "coordinates x, y; momenta p, r; T = p^2/2 + r^2/3; V = x^2/2 + (x - y)^2
force x += -span{ f: sign(p - 2*r/3) }; force y += span{ f: sign(p - 2*r/3) }",
        &[0.3],
        &[&[0.5, 0.2, 0.3, -0.2], &[0.1, 0.05, 0.2, 0.35]],
    ),
    // A belt that runs unevenly, and another force that switches beside it.
    (
        "coordinates x; momenta p; T = p^2/2; V = x^2/2
force x += span{ f: -sign(p - cos(t)/2), g: -sign(x) }",
        &[0.5, 0.1],
        &[&[0.1, 0.3], &[-0.3, 0.6], &[0.2, 0.48]],
    ),
];

/// The end of a motion, and its tangents, `[2n][2n + P]`.
fn end(
    dynamics: &Dynamics,
    name: &str,
    start: &[f64],
    theta: &[f64],
    steps: usize,
) -> (Vec<f64>, Vec<f64>) {
    let mut batch = Batch::with_tangents(dynamics.degrees(), 1, dynamics.unknowns());
    batch.set(0, 0.3, start);
    advance(dynamics, method(name), &mut batch, &[1.1], steps, theta, &mut Scratch::new());
    (batch.get(0), batch.tangent.to_vec())
}

fn names(dynamics: &Dynamics) -> &'static [&'static str] {
    if dynamics.separable() { &["forest-ruth", "rk4"] } else { &["rk4", "gauss-legendre-4"] }
}

/// Motion of a system by a method from a start.
struct Moved<'a> {
    text: &'a str,
    dynamics: &'a Dynamics,
    name: &'a str,
    start: &'a [f64],
    theta: &'a [f64],
}

/// Every start of every system by every method that suits it.
fn for_every_start(check: impl Fn(&Moved)) {
    for (text, theta, starts) in SYSTEMS {
        let dynamics = &Dynamics::whole(&system(text), Backend::default());
        for start in *starts {
            for name in names(dynamics) {
                check(&Moved { text, dynamics, name, start, theta });
            }
        }
    }
}

#[test]
fn tangents_take_the_jump_of_every_event() {
    for_every_start(|&Moved { text, dynamics, name, start, theta }| {
        let columns = start.len() + theta.len();
        let (_, tangent) = end(dynamics, name, start, theta, 40);
        for column in 0..columns {
            let moved = |by: f64| {
                let (mut start, mut theta) = (start.to_vec(), theta.to_vec());
                match column.checked_sub(start.len()) {
                    Some(unknown) => theta[unknown] += by,
                    None => start[column] += by,
                }
                end(dynamics, name, &start, &theta, 40).0
            };
            let (before, after) = (moved(-1e-5), moved(1e-5));
            for row in 0..start.len() {
                let numeric = (after[row] - before[row]) / 2e-5;
                let exact = tangent[row * columns + column];
                assert!(
                    (numeric - exact).abs() < 2e-5 * (1.0 + exact.abs()),
                    "{text}\n{name} from {start:?}, d{row}/d{column}: {exact} for {numeric}"
                );
            }
        }
    });
}

#[test]
fn every_method_keeps_its_order_across_events() {
    for_every_start(|&Moved { text, dynamics, name, start, theta }| {
        let truth = end(dynamics, name, start, theta, 640).0;
        let error = |steps: usize| -> f64 {
            let state = end(dynamics, name, start, theta, steps).0;
            let differences = state.iter().zip(&truth).map(|(a, b)| (a - b).abs());
            differences.fold(0.0, f64::max)
        };
        let (coarse, fine) = (error(10), error(40));
        assert!(
            fine < coarse / 100.0 || fine < 1e-9,
            "{text}\n{name} from {start:?}: {coarse:e}, {fine:e}"
        );
    });
}

#[test]
fn trajectories_do_not_depend_on_those_beside_them() {
    for (text, theta, starts) in SYSTEMS {
        let dynamics = Dynamics::whole(&system(text), Backend::default());
        let (degrees, unknowns) = (dynamics.degrees(), dynamics.unknowns());
        let name = names(&dynamics)[0];
        let mut together = Batch::with_tangents(degrees, starts.len(), unknowns);
        let mut spans = Vec::new();
        for (lane, start) in starts.iter().enumerate() {
            together.set(lane, 0.3, start);
            spans.push(1.1);
        }
        let mut scratch = Scratch::new();
        advance(&dynamics, method(name), &mut together, &spans, 12, theta, &mut scratch);
        for (lane, start) in starts.iter().enumerate() {
            assert_eq!(together.get(lane), end(&dynamics, name, start, theta, 12).0, "{text}");
        }
    }
}
