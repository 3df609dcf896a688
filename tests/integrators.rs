//! Every row of METHODS is measured: order, reversibility, energy, tangents.

mod support;

use leverrier::dynamics::systems::{SYSTEMS, SystemRow};
use leverrier::dynamics::{Batch, Dynamics, Kind, METHODS, Method, Scratch, advance};
use leverrier::eval::{BACKENDS, Backend};
use support::{learned_system, symplectic_defect};

/// The systems that a method applies to.
fn suited(method: Method) -> impl Iterator<Item = &'static SystemRow> {
    SYSTEMS.iter().filter(move |row| row.separable || !method.needs_separable())
}

fn compiled(row: &SystemRow) -> Dynamics {
    Dynamics::new(&(row.build)(), &[], Backend::Batched)
}

/// The state after `span` in `steps` steps from the typical start.
fn run(dynamics: &Dynamics, method: Method, start: &[f64], span: f64, steps: usize) -> Vec<f64> {
    let mut batch = Batch::new(dynamics.degrees(), 1);
    batch.set(0, 0.0, start);
    advance(dynamics, method, &mut batch, &[span], steps, &[], &mut Scratch::new());
    batch.get(0)
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn the_rows_say_which_systems_separate() {
    for row in SYSTEMS {
        assert_eq!(compiled(row).separable(), row.separable, "{}", row.name);
    }
}

#[test]
fn compositions_are_consistent_and_symmetric() {
    for row in METHODS {
        match &row.kind {
            Kind::Splitting(gammas) => {
                let sum: f64 = gammas.iter().sum();
                assert!((sum - 1.0).abs() < 1e-14, "{}: {sum}", row.name);
                let backward: Vec<f64> = gammas.iter().rev().copied().collect();
                assert_eq!(gammas.to_vec(), backward, "{}", row.name);
            }
            Kind::Implicit(tableau) | Kind::Explicit(tableau) => {
                let sum: f64 = tableau.weights.iter().sum();
                assert!((sum - 1.0).abs() < 1e-15, "{}: {sum}", row.name);
                let stages = tableau.weights.len();
                for (line, node) in tableau.matrix.chunks(stages).zip(tableau.nodes) {
                    assert!((line.iter().sum::<f64>() - node).abs() < 1e-15, "{}", row.name);
                }
            }
        }
    }
}

/// Slope of log error against log step, over steps where the error is above rounding.
fn measured_order(method: Method, row: &SystemRow) -> f64 {
    let dynamics = compiled(row);
    let span = 0.7 * row.period;
    // An independent method, fine enough to be near rounding.
    let other = if matches!(method.row().kind, Kind::Implicit(_)) || !row.separable {
        "rk4"
    } else {
        "gauss-legendre-6"
    };
    let truth = match row.solution {
        Some(solution) => solution(span),
        None => {
            let other = Method::by_name(other).unwrap();
            let steps = if other.row().order == 6 { 400 } else { 20_000 };
            run(&dynamics, other, row.start, span, steps)
        }
    };
    let mut points = Vec::new();
    for steps in [4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024] {
        let error = distance(&run(&dynamics, method, row.start, span, steps), &truth);
        if error < 2e-12 {
            break;
        }
        points.push(((steps as f64).ln(), error.ln()));
    }
    let last = &points[points.len().saturating_sub(4)..];
    assert!(last.len() >= 3, "{} on {}: {points:?}", method.row().name, row.name);
    let count = last.len() as f64;
    let (x, y) = last.iter().fold((0.0, 0.0), |(x, y), point| (x + point.0, y + point.1));
    let (x, y) = (x / count, y / count);
    let above: f64 = last.iter().map(|point| (point.0 - x) * (point.1 - y)).sum();
    let below: f64 = last.iter().map(|point| (point.0 - x).powi(2)).sum();
    -above / below
}

#[test]
fn every_method_has_its_order_on_every_system() {
    for method in Method::all() {
        for row in suited(method) {
            let order = measured_order(method, row);
            let expected = f64::from(method.row().order);
            assert!(
                order > expected - 0.5 && order < expected + 1.6,
                "{} on {}: order {order:.2}",
                method.row().name,
                row.name
            );
        }
    }
}

#[test]
fn symmetric_methods_come_back() {
    for method in Method::all().filter(|m| m.row().symmetric) {
        for row in suited(method) {
            let dynamics = compiled(row);
            let mut batch = Batch::with_tangents(dynamics.degrees(), 1, 0);
            batch.set(0, 0.0, row.start);
            let identity = batch.clone();
            let mut scratch = Scratch::new();
            let span = [0.9 * row.period];
            advance(&dynamics, method, &mut batch, &span, 20, &[], &mut scratch);
            assert!(distance(&batch.get(0), row.start) > 1e-2);
            advance(&dynamics, method, &mut batch, &[-span[0]], 20, &[], &mut scratch);
            let name = format!("{} on {}", method.row().name, row.name);
            assert!(distance(&batch.state, &identity.state) < 1e-12, "{name}");
            assert!(distance(&batch.tangent, &identity.tangent) < 1e-10, "{name}");
        }
    }
}

/// Coefficients for [`learned_system`], then its inner parameter.
fn learned_theta(count: usize) -> Vec<f64> {
    let all = [0.45, 0.2, 0.5, 0.6, 0.35, -0.3, 0.25, -0.15];
    let mut theta = all[..count].to_vec();
    theta.push(0.4);
    theta
}

#[test]
fn tangents_are_the_jacobian_of_the_discrete_map() {
    for method in Method::all() {
        for (driven, separable) in [(false, true), (true, true), (true, false)] {
            if method.needs_separable() && !separable {
                continue;
            }
            let system = learned_system(driven, separable);
            // Unsorted and incomplete: unknowns are numbered as `active` says.
            let mut active: Vec<usize> = (0..system.terms.len()).rev().collect();
            active.remove(2);
            let dynamics = Dynamics::new(&system, &active, Backend::Batched);
            assert_eq!((dynamics.separable(), dynamics.parameters()), (separable, &[1][..]));
            let theta = learned_theta(active.len());
            let unknowns = dynamics.unknowns();
            assert_eq!(unknowns, theta.len());
            let starts = [[0.3, -0.2, 0.5, 0.4], [-0.6, 0.4, 0.1, -0.3]];
            let spans = [0.7, -0.4];
            let go = |starts: &[[f64; 4]], theta: &[f64], tangents: bool| {
                let mut batch = Batch::with_tangents(2, 2, unknowns);
                if !tangents {
                    batch = Batch::new(2, 2);
                }
                for (lane, start) in starts.iter().enumerate() {
                    batch.set(lane, 0.2 + lane as f64, start);
                }
                advance(&dynamics, method, &mut batch, &spans, 3, theta, &mut Scratch::new());
                batch
            };
            let batch = go(&starts, &theta, true);
            assert_eq!(batch.state, go(&starts, &theta, false).state, "{}", method.row().name);
            let columns = 4 + unknowns;
            for column in 0..columns {
                let moved = |by: f64| {
                    let (mut starts, mut theta) = (starts, theta.clone());
                    match column.checked_sub(4) {
                        Some(k) => theta[k] += by,
                        None => starts.iter_mut().for_each(|start| start[column] += by),
                    }
                    go(&starts, &theta, false).state
                };
                // Fourth-order differences: the error is far below the tolerance.
                let h = 1e-3;
                let (a, b, c, d) = (moved(-2.0 * h), moved(-h), moved(h), moved(2.0 * h));
                for row in 0..4 {
                    for lane in 0..2 {
                        let at = row * 2 + lane;
                        let slope = (a[at] - 8.0 * b[at] + 8.0 * c[at] - d[at]) / (12.0 * h);
                        let tangent = batch.tangent[(row * columns + column) * 2 + lane];
                        assert!(
                            (slope - tangent).abs() < 1e-9,
                            "{} row {row} column {column}: {slope} against {tangent}",
                            method.row().name
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn tangents_of_symplectic_methods_keep_the_symplectic_form() {
    for method in Method::all().filter(|m| m.row().symplectic) {
        for row in suited(method).filter(|row| row.conservative) {
            let dynamics = compiled(row);
            let n = dynamics.degrees();
            let mut batch = Batch::with_tangents(n, 1, 0);
            batch.set(0, 0.0, row.start);
            let span = [row.period];
            advance(&dynamics, method, &mut batch, &span, 25, &[], &mut Scratch::new());
            let defect = symplectic_defect(&batch.tangent, n, 2 * n, 1, 0);
            assert!(defect < 1e-11, "{} on {}: {defect}", method.row().name, row.name);
        }
    }
}

#[test]
fn backends_agree() {
    let system = learned_system(true, true);
    let active: Vec<usize> = (0..system.terms.len()).collect();
    let theta = learned_theta(active.len());
    let method = Method::by_name("forest-ruth").unwrap();
    let results: Vec<Batch> = BACKENDS
        .iter()
        .map(|&(_, backend)| {
            let dynamics = Dynamics::new(&system, &active, backend);
            let mut batch = Batch::with_tangents(2, 3, dynamics.unknowns());
            for lane in 0..3 {
                batch.set(lane, 0.0, &[0.1 * lane as f64, 0.3, -0.2, 0.4]);
            }
            let span = [0.5, 0.1, -0.3];
            advance(&dynamics, method, &mut batch, &span, 4, &theta, &mut Scratch::new());
            batch
        })
        .collect();
    for other in &results[1..] {
        assert!(distance(&results[0].state, &other.state) < 1e-14);
        assert!(distance(&results[0].tangent, &other.tangent) < 1e-13);
    }
}
