//! Every row of METHODS is measured: order, reversibility, energy, tangents.

use crate::support::{learned_system, symplectic_defect};
use leverrier::internals::dynamics::systems::{SYSTEMS, SystemRow, known_system};
use leverrier::internals::dynamics::{
    Batch, Dynamics, METHODS, Method, MethodKind, Scratch, StepControl, Stop, advance,
    choose_steps, finest_method, observe, pull_back, pull_back_observed, simulate,
};
use leverrier::internals::eval::{BACKENDS, Backend};
use leverrier::internals::expr::Observed;

/// The systems that a method applies to.
fn suited(method: Method) -> impl Iterator<Item = &'static SystemRow> {
    SYSTEMS.iter().filter(move |row| row.separable || !method.needs_separable())
}

fn compiled(row: &SystemRow) -> Dynamics {
    Dynamics::known(&(row.build)(), Backend::Batched)
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
            MethodKind::Splitting(gammas) => {
                let sum: f64 = gammas.iter().sum();
                assert!((sum - 1.0).abs() < 1e-14, "{}: {sum}", row.name);
                let backward: Vec<f64> = gammas.iter().rev().copied().collect();
                assert_eq!(gammas.to_vec(), backward, "{}", row.name);
            }
            MethodKind::Implicit(tableau) | MethodKind::Explicit(tableau) => {
                let sum: f64 = tableau.weights.iter().sum();
                assert!((sum - 1.0).abs() < 1e-15, "{}: {sum}", row.name);
                let stages = tableau.weights.len();
                for (line, node) in tableau.matrix.chunks(stages).zip(tableau.nodes) {
                    // Rounding goes with the size of what is added up.
                    let size = line.iter().map(|entry| entry.abs()).sum::<f64>().max(1.0);
                    let off = (line.iter().sum::<f64>() - node).abs();
                    assert!(off < 8.0 * f64::EPSILON * size, "{}: {off:e}", row.name);
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
    let other = if matches!(method.row().kind, MethodKind::Implicit(_)) || !row.separable {
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
    let all = [0.45, 0.2, 0.5, 0.6, 0.35, -0.3, 0.25, -0.15, 0.1];
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
            let mut active = system.term_ids();
            active.reverse();
            active.remove(2);
            let dynamics = Dynamics::new(&system, &active, Backend::Batched).unwrap();
            let inner = &system.parameter_ids()[1..];
            assert_eq!((dynamics.separable(), dynamics.parameters()), (separable, inner));
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
            // With derivatives a tape may share its products differently.
            let plain = go(&starts, &theta, false).state;
            assert!(distance(&batch.state, &plain) < 1e-15, "{}", method.row().name);
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
    let theta = learned_theta(system.terms.len());
    let method = Method::by_name("forest-ruth").unwrap();
    let results: Vec<Batch> = BACKENDS
        .iter()
        .map(|&(_, backend)| {
            let dynamics = Dynamics::whole(&system, backend);
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

#[test]
fn energy_stays_bounded_under_symplectic_methods_and_drifts_under_rk4() {
    let row = SYSTEMS.iter().find(|row| row.name == "pendulum").unwrap();
    let dynamics = compiled(row);
    for method in Method::all() {
        let mut scratch = Scratch::new();
        let mut batch = Batch::new(1, 1);
        batch.set(0, 0.0, row.start);
        let mut energy = [0.0];
        dynamics.energy(&batch, &[], &mut energy, &mut scratch);
        let first = energy[0];
        // The largest error over the first tenth of the time, and over the last.
        let mut worst = [0.0_f64; 10];
        for tenth in &mut worst {
            for _ in 0..200 {
                advance(&dynamics, method, &mut batch, &[1.7], 6, &[], &mut scratch);
                dynamics.energy(&batch, &[], &mut energy, &mut scratch);
                *tenth = tenth.max((energy[0] - first).abs());
                assert!(energy[0].is_finite());
            }
        }
        let growth = worst[9] / worst[0].max(1e-12);
        let name = method.row().name;
        if method.row().symplectic {
            assert!(worst[9] < 0.05 && growth < 1.5, "{name}: {worst:?}");
        } else {
            assert!(growth > 5.0, "{name}: {worst:?}");
        }
    }
}

#[test]
fn every_closed_form_and_invariant_is_met() {
    for row in SYSTEMS {
        let dynamics = compiled(row);
        let method = finest_method(&dynamics);
        let times: Vec<f64> = (0..40).map(|i| 0.13 * row.period * f64::from(i)).collect();
        let runs =
            simulate(&dynamics, method, &[], &[row.start.to_vec()], &times, StepControl::FINEST);
        assert_eq!(runs[0].stop, Stop::Finished, "{}", row.name);
        for (i, (&time, state)) in times.iter().zip(&runs[0].states).enumerate() {
            if let Some(solution) = row.solution {
                let error = distance(state, &solution(time));
                assert!(error < 1e-12, "{} at {time}: {error:e}", row.name);
            }
            for invariant in row.invariants {
                assert!((invariant(state) - invariant(row.start)).abs() < 1e-12, "{}", row.name);
            }
            if row.conservative {
                let drift = (runs[0].energies[i] - runs[0].energies[0]).abs();
                assert!(drift < 1e-12, "{}: {drift:e}", row.name);
            }
        }
    }
}

#[test]
fn every_lane_has_its_own_span_and_divergences_stay_alone() {
    // V = -q^4: escapes to infinity in finite time.
    let system = known_system("escape", 1, |g, q, p, _| {
        let zero = g.number(0.0);
        let (t, v) = (g.power(p[0], 2.0), g.power(q[0], 4.0));
        (g.scale(0.5, t), g.negate(v), zero, vec![])
    });
    let dynamics = Dynamics::known(&system, Backend::Batched);
    let spans = [0.3, 50.0, 0.0, -0.2, 0.3];
    let starts = [[0.5, 0.1], [1.0, 1.0], [1e200, 1e200], [0.5, 0.1], [f64::NAN, 0.0]];
    for method in Method::all() {
        let mut batch = Batch::with_tangents(1, 5, 0);
        for (lane, start) in starts.iter().enumerate() {
            batch.set(lane, 0.0, start);
        }
        let mut scratch = Scratch::new();
        advance(&dynamics, method, &mut batch, &spans, 8, &[], &mut scratch);
        let name = method.row().name;
        for lane in [0, 3] {
            let alone = run(&dynamics, method, &starts[lane], spans[lane], 8);
            assert_eq!(batch.get(lane), alone, "{name}");
        }
        assert_eq!(batch.get(2), starts[2], "{name}: a lane without a span stays");
        // Implicit stage equations may have a far-off root where the motion has diverged.
        let implicit = matches!(method.row().kind, MethodKind::Implicit(_));
        for lane in if implicit { 4..5 } else { 1..2 } {
            assert!(batch.get(lane).iter().all(|x| x.is_nan()), "{name}");
            assert!((0..4).all(|i| batch.tangent[i * 5 + lane].is_nan()), "{name}");
        }
        assert!((0..4).all(|i| batch.tangent[i * 5].is_finite()), "{name}");
    }
    let runs = simulate(
        &dynamics,
        finest_method(&dynamics),
        &[],
        &[vec![1.0, 1.0], vec![0.0, 0.0]],
        &[0.0, 0.2, 5.0, 6.0],
        StepControl::FINEST,
    );
    assert!(!matches!(runs[0].stop, Stop::Finished) && runs[0].times == [0.0, 0.2]);
    assert_eq!((runs[1].stop, runs[1].states.len()), (Stop::Finished, 4));
}

#[test]
fn the_reverse_sweep_is_the_transpose_of_the_tangents() {
    for method in Method::all() {
        let separable = method.needs_separable();
        let system = learned_system(true, separable);
        let dynamics = Dynamics::whole(&system, Backend::Batched);
        let theta = learned_theta(system.terms.len());
        let unknowns = dynamics.unknowns();
        let columns = 4 + unknowns;
        let mut start = Batch::with_tangents(2, 3, unknowns);
        for lane in 0..3 {
            start.set(lane, 0.3, &[0.2 * lane as f64, 0.3, -0.2, 0.4]);
        }
        let spans = [0.5, 0.9, -0.3];
        let mut scratch = Scratch::new();
        let mut end = start.clone();
        advance(&dynamics, method, &mut end, &spans, 4, &theta, &mut scratch);
        let mut seen = vec![0.0; 12];
        let mut tangent = vec![0.0; end.tangent.len()];
        let observed = Observed::Velocities;
        observe(&dynamics, observed, &end, &theta, &mut seen, Some(&mut tangent), &mut scratch);
        let weights: Vec<f64> = (0..12).map(|i| (f64::from(i) * 1.3).sin()).collect();

        let mut cotangent = weights.clone();
        let mut gradient = vec![0.0; unknowns];
        pull_back_observed(
            &dynamics,
            observed,
            &end,
            &theta,
            &mut cotangent,
            &mut gradient,
            &mut scratch,
        );
        let back =
            pull_back(&dynamics, method, &start, &spans, 4, &theta, &cotangent, &mut scratch);
        for column in 0..columns {
            for lane in 0..3 {
                let forward = |lane: usize| -> f64 {
                    (0..4)
                        .map(|row| {
                            weights[row * 3 + lane] * tangent[(row * columns + column) * 3 + lane]
                        })
                        .sum()
                };
                let (expected, found) = match column.checked_sub(4) {
                    None => (forward(lane), back.cotangent[column * 3 + lane]),
                    Some(k) => ((0..3).map(forward).sum(), gradient[k] + back.gradient[k]),
                };
                assert!(
                    (expected - found).abs() < 1e-13,
                    "{} column {column}: {expected} against {found}",
                    method.row().name
                );
            }
        }
    }
}

#[test]
fn observed_velocities_and_their_tangents_are_right() {
    let system = learned_system(false, false);
    let dynamics = Dynamics::whole(&system, Backend::Batched);
    let theta = learned_theta(system.terms.len());
    let columns = 4 + dynamics.unknowns();
    let see = |z: &[f64], theta: &[f64]| {
        let mut batch = Batch::with_tangents(2, 1, dynamics.unknowns());
        batch.set(0, 0.0, z);
        let (mut out, mut tangent) = (vec![0.0; 4], vec![0.0; 4 * columns]);
        let scratch = &mut Scratch::new();
        let observed = Observed::Velocities;
        observe(&dynamics, observed, &batch, theta, &mut out, Some(&mut tangent), scratch);
        (out, tangent)
    };
    let z = [0.3, -0.2, 0.5, 0.4];
    let (out, tangent) = see(&z, &theta);
    // T = p1^2 / 2 + 0.45 p2^2 + 0.2 p1 p2^3, and the last term of H: theta[7] q1 p2^2.
    assert!((out[2] - (0.5 + 0.2 * 0.4_f64.powi(3))).abs() < 1e-15);
    let p2 = 0.9 * 0.4 + 0.2 * 0.5 * 3.0 * 0.16 + theta[7] * 2.0 * 0.3 * 0.4;
    assert!((out[3] - p2).abs() < 1e-15);
    for column in 0..columns {
        let moved = |by: f64| {
            let (mut z, mut theta) = (z, theta.clone());
            match column.checked_sub(4) {
                Some(k) => theta[k] += by,
                None => z[column] += by,
            }
            see(&z, &theta).0
        };
        let (below, above) = (moved(-1e-5), moved(1e-5));
        for row in 0..4 {
            let slope = (above[row] - below[row]) / 2e-5;
            assert!((slope - tangent[row * columns + column]).abs() < 1e-9);
        }
    }
}

#[test]
fn chosen_steps_reach_the_tolerance() {
    for row in SYSTEMS {
        let dynamics = compiled(row);
        let n = dynamics.degrees();
        let mut sample = Batch::new(n, 8);
        for lane in 0..8 {
            let start: Vec<f64> =
                row.start.iter().map(|z| z * (1.0 - 0.05 * lane as f64)).collect();
            sample.set(lane, 0.1 * lane as f64, &start);
        }
        let spans = [0.1; 8];
        let mut scratch = Scratch::new();
        let mut costs = Vec::new();
        for tolerance in [1e-3, 1e-7, 1e-11] {
            let tolerances = vec![tolerance; 2 * n];
            let choice =
                choose_steps(&dynamics, &[], &sample, &spans, &tolerances, true, &mut scratch);
            assert!(choice.reached, "{} {tolerance}: {choice:?}", row.name);
            costs.push(choice.cost);
            // Held against another method than any that could be chosen.
            let (mut batch, mut truth) = (sample.clone(), sample.clone());
            let rk4 = Method::by_name("rk4").unwrap();
            let (method, steps) = (choice.method, choice.steps);
            advance(&dynamics, method, &mut batch, &spans, steps, &[], &mut scratch);
            advance(&dynamics, rk4, &mut truth, &spans, 400, &[], &mut scratch);
            for (a, b) in batch.state.iter().zip(&truth.state) {
                assert!((a - b).abs() < 1.1 * tolerance, "{} {choice:?}", row.name);
            }
        }
        assert!(costs.is_sorted() && costs[0] < costs[2], "{}: {costs:?}", row.name);
        // Beyond rounding: the tolerance is raised to it and reached.
        let choice =
            choose_steps(&dynamics, &[], &sample, &spans, &vec![0.0; 2 * n], true, &mut scratch);
        assert!(choice.error.iter().all(|e| *e < 1e-13), "{} {choice:?}", row.name);
        let symplectic = choice.method.row().symplectic;
        assert!(symplectic || !row.conservative, "{} {choice:?}", row.name);
    }
}

#[test]
fn the_pace_of_a_simulation_is_kept() {
    let row = &SYSTEMS[0];
    let dynamics = compiled(row);
    let method = Method::by_name("leapfrog").unwrap();
    let starts = [row.start.to_vec()];
    let go = |pace| simulate(&dynamics, method, &[], &starts, &[0.0, 1.0, 1.5], pace);
    assert_eq!(
        go(StepControl::PerInterval(4))[0].states[1],
        go(StepControl::Longest(0.25))[0].states[1]
    );
    assert_eq!(go(StepControl::PerInterval(2))[0].states.len(), 3);
    assert!(matches!(go(StepControl::Longest(0.0))[0].stop, Stop::Unresolved { after: 0.0 }));
    assert!(
        simulate(&dynamics, method, &[], &starts, &[], StepControl::FINEST)[0].times.is_empty()
    );
}
