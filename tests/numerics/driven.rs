//! Systems that an input drives, against closed forms.

use leverrier::internals::data::{Clock, Dataset, Interpolation, MeasuredInput, Packed, Run};
use leverrier::internals::dynamics::{
    Batch, Drive, Dynamics, Method, Scratch, advance, observe, pull_back,
};
use leverrier::internals::eval::{BACKENDS, Backend};
use leverrier::internals::expr::{Observed, System, build};
use leverrier::internals::simulate::{InputRecord, Simulator};

use crate::support::keeps_its_order;

fn system(text: &str) -> System {
    let compiled = build("test", text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    System::clone(&compiled.system)
}

const OSCILLATOR: &str = "coordinates x; momenta p; input u { spline }
T = p^2/2\nV = (x - u)^2/2\nforce x += 0.1*rate(u)*x - 0.1*rate(u)*x";

/// x'' = -x + u with a cubic u is solved by u - u'' and a free oscillation.
const CUBIC: [f64; 4] = [0.3, -0.4, 0.5, -0.1];

fn polynomial(coefficients: &[f64], t: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * t + c)
}

fn solution(start: [f64; 2], t: f64) -> [f64; 2] {
    let [a, b, c, d] = CUBIC;
    let particular = [a - 2.0 * c, b - 6.0 * d, c, d];
    let slope = [particular[1], 2.0 * c, 3.0 * d];
    let (x, v) = (start[0] - particular[0], start[1] - slope[0]);
    let (sine, cosine) = t.sin_cos();
    [
        polynomial(&particular, t) + x * cosine + v * sine,
        polynomial(&slope, t) - x * sine + v * cosine,
    ]
}

fn driven(dynamics: &Dynamics, method: Method, span: f64, steps: usize) -> Vec<f64> {
    let mut batch = Batch::new(1, 1);
    batch.set(0, 0.0, &[0.7, -0.2]);
    batch.drive = Drive::new(1, 4, 1);
    batch.drive.set(0, 0, &CUBIC);
    advance(dynamics, method, &mut batch, &[span], steps, &[], &mut Scratch::new());
    batch.get(0)
}

#[test]
fn every_method_keeps_its_order_under_a_smooth_input() {
    let system = system(OSCILLATOR);
    for &(_, backend) in BACKENDS {
        let dynamics = Dynamics::known(&system, backend);
        assert!(dynamics.separable() && dynamics.depends_on_time());
        for method in Method::all() {
            let row = method.row();
            let expected = solution([0.7, -0.2], 3.0);
            let error = |steps: usize| {
                let end = driven(&dynamics, method, 3.0, steps);
                (end[0] - expected[0]).hypot(end[1] - expected[1])
            };
            keeps_its_order(method, error);
            assert!(error(256) < 1e-3, "{}: {}", row.name, error(256));
        }
    }
}

#[test]
fn one_advance_goes_on_where_another_ends() {
    let system = system(OSCILLATOR);
    let dynamics = Dynamics::known(&system, Backend::default());
    let method = Method::by_name("suzuki-umeno-8").unwrap();
    let mut batch = Batch::new(1, 2);
    batch.drive = Drive::new(1, 4, 2);
    for lane in 0..2 {
        batch.set(lane, 5.0, &[0.7, -0.2]);
        batch.drive.set(0, lane, &CUBIC);
    }
    // Each lane has its own spans, and together the same.
    for span in [[1.0, 0.5], [0.25, 1.5], [0.75, 0.0]] {
        advance(&dynamics, method, &mut batch, &span, 20, &[], &mut Scratch::new());
    }
    let expected = solution([0.7, -0.2], 2.0);
    for lane in 0..2 {
        let end = batch.get(lane);
        assert!((end[0] - expected[0]).abs() + (end[1] - expected[1]).abs() < 1e-9, "{end:?}");
    }
}

#[test]
fn tangents_and_the_reverse_sweep_know_the_input() {
    let text = "coordinates x; momenta p; input u { spline }\nparam a = 0.4
T = p^2/2\nV = span{ x^4, u*x^2 }\nforce x += sin(a*u) + span{ rate(u)*x, -p*u^2 }
sensor x += span{ u*x }";
    let system = system(text);
    let dynamics = Dynamics::whole(&system, Backend::default());
    let theta = [0.3, 0.2, -0.5, 0.1, 0.05, 0.4];
    assert_eq!(dynamics.unknowns(), theta.len());
    let (columns, h) = (2 + theta.len(), 1e-5);
    for method in Method::all().filter(|method| !method.needs_separable()) {
        let run = |start: &[f64], theta: &[f64], tangents: bool| {
            let mut batch = if tangents { Batch::with_tangents(1, 1, 6) } else { Batch::new(1, 1) };
            batch.set(0, 0.0, start);
            batch.drive = Drive::new(1, 4, 1);
            batch.drive.set(0, 0, &CUBIC);
            let begun = batch.clone();
            let scratch = &mut Scratch::new();
            advance(&dynamics, method, &mut batch, &[0.8], 5, theta, scratch);
            let mut seen = vec![0.0; 2];
            let mut tangent = vec![0.0; batch.tangent.len()];
            let observed = Observed::Momenta;
            let out = tangents.then_some(&mut tangent[..]);
            observe(&dynamics, observed, &batch, theta, &mut seen, out, scratch);
            (begun, batch, seen, tangent)
        };
        let start = [0.7, -0.2];
        let (begun, end, _, tangent) = run(&start, &theta, true);
        for column in 0..columns {
            let moved = |by: f64| {
                let (mut start, mut theta) = (start, theta);
                match column.checked_sub(2) {
                    None => start[column] += by,
                    Some(k) => theta[k] += by,
                }
                run(&start, &theta, false).2
            };
            let (up, down) = (moved(h), moved(-h));
            for row in 0..2 {
                let slope = (up[row] - down[row]) / (2.0 * h);
                let found = tangent[row * columns + column];
                let name = method.row().name;
                assert!((slope - found).abs() < 1e-7, "{name} {row} {column}: {slope} {found}");
            }
        }
        // The transpose of the tangents of the motion alone.
        let cotangent = [0.6, -1.1];
        let scratch = &mut Scratch::new();
        let back = pull_back(&dynamics, method, &begun, &[0.8], 5, &theta, &cotangent, scratch);
        for k in 0..theta.len() {
            let forward: f64 =
                (0..2).map(|row| cotangent[row] * end.tangent[row * columns + 2 + k]).sum();
            assert!((forward - back.gradient[k]).abs() < 1e-12, "{}", method.row().name);
        }
    }
}

fn record(system: &System, between: Interpolation, times: &[f64], values: &[f64]) -> InputRecord {
    let input = MeasuredInput { name: "u".into(), between };
    let run = Run {
        name: "1".into(),
        times: times.to_vec(),
        values: Vec::new(),
        lines: vec![0; times.len()],
        clock: Clock::default(),
        inputs: input.columns(times, values),
        groups: Vec::new(),
        errors: Vec::new(),
    };
    let data = Dataset { observables: Vec::new(), runs: vec![run], inputs: vec![input] };
    InputRecord::of_runs(system, &data).unwrap().remove(0)
}

#[test]
fn steps_end_where_a_held_input_jumps() {
    let text = "coordinates x; momenta p; input u { hold }\nT = p^2/2\nV = x^2/2\nforce x += u";
    let system = system(text);
    let knots: Vec<f64> = (0..12).map(|i| 0.3 * f64::from(i)).collect();
    let values: Vec<f64> = (0..12).map(|i| (f64::from(i) * 2.3).sin()).collect();
    let simulator =
        Simulator::known(&system).driven_by(record(&system, Interpolation::Hold, &knots, &values));
    // Samples of the motion stand where the input has none.
    let times: Vec<f64> = (0..=32).map(|i| 0.1 * f64::from(i) + 0.01).collect();
    let motion = simulator.trajectories(&[vec![0.4, 0.1]], &times).unwrap();
    let (mut state, mut now) = ([0.4, 0.1], times[0]);
    for (sample, &time) in times.iter().enumerate() {
        // The closed form goes from jump to jump: a turn about the held value.
        while now < time {
            let at = knots.partition_point(|knot| *knot <= now + 1e-12) - 1;
            let end = knots.get(at + 1).map_or(time, |knot| knot.min(time));
            let ((sine, cosine), u) = ((end - now).sin_cos(), values[at]);
            let [x, v] = [state[0] - u, state[1]];
            state = [u + x * cosine + v * sine, v * cosine - x * sine];
            now = end;
        }
        let found = &motion.states[0][sample];
        let error = (found[0] - state[0]).abs() + (found[1] - state[1]).abs();
        assert!(error < 1e-12, "at {time}: {error:e}");
    }
    assert!(simulator.trajectories(&[vec![0.4, 0.1]], &[0.0, 9.0]).is_err());
    assert!(Simulator::known(&system).trajectories(&[vec![0.4, 0.1]], &[0.0, 1.0]).is_err());
}

#[test]
fn a_spline_through_a_cubic_is_that_cubic() {
    let system = system(OSCILLATOR);
    let knots: Vec<f64> = (0..20).map(|i| 0.3 * f64::from(i)).collect();
    let values: Vec<f64> = knots.iter().map(|&t| polynomial(&CUBIC, t)).collect();
    let record = record(&system, Interpolation::Spline, &knots, &values);
    let simulator = Simulator::known(&system).driven_by(record);
    let motion = simulator.trajectories(&[vec![0.7, -0.2]], &[0.0, 1.1, 2.0, 4.5]).unwrap();
    for (time, state) in motion.times.iter().zip(&motion.states[0]) {
        let expected = solution([0.7, -0.2], *time);
        assert!((state[0] - expected[0]).abs() + (state[1] - expected[1]).abs() < 1e-11);
    }
}

/// A record of an input that is this cubic in time, from 0 to 6.
fn cubic_record(system: &System) -> InputRecord {
    let times: Vec<f64> = (0..=60).map(|i| 0.1 * f64::from(i)).collect();
    let values: Vec<f64> = times.iter().map(|t| polynomial(&CUBIC, *t)).collect();
    let input = &system.measured_inputs()[0];
    let run = Run {
        name: "1".to_string(),
        lines: vec![0; times.len()],
        values: Vec::new(),
        clock: Clock::default(),
        inputs: input.columns(&times, &values),
        groups: Vec::new(),
        errors: Vec::new(),
        times,
    };
    let data = Dataset { observables: Vec::new(), runs: vec![run], inputs: vec![input.clone()] };
    InputRecord::of_runs(system, &data).unwrap().remove(0)
}

#[test]
fn a_delayed_input_acts_later() {
    let system = system(
        "coordinates x; momenta p; input u { spline }
T = p^2/2\nV = x^2/2\nforce x += delayed(u, 0.37)",
    );
    // The motion is that of an input that is not delayed, by a clock that is late.
    let (from, late) = (1.0, 0.37);
    let begun = solution([0.7, -0.2], from - late);
    let times: Vec<f64> = (0..=40).map(|i| from + 0.1 * f64::from(i)).collect();
    let simulator = Simulator::known(&system).driven_by(cubic_record(&system));
    let made = simulator.trajectories(&[begun.to_vec()], &times).unwrap().dataset(&system);
    for (k, time) in times.iter().enumerate() {
        let expected = solution([0.7, -0.2], time - late);
        for (row, expected) in made.runs[0].values.iter().zip(expected) {
            assert!((row[k] - expected).abs() < 1e-8, "{time}: {} {expected}", row[k]);
        }
    }
}

#[test]
fn tangents_know_how_late_an_input_is() {
    let text = "coordinates x; momenta p; input u { spline }\nparam d = 0.4
T = p^2/2\nV = span{ x^2 }\nforce x += delayed(u, d)^2 + span{ rate(delayed(u, d))*x }
sensor x += span{ delayed(u, d) }";
    let system = system(text);
    let dynamics = Dynamics::whole(&system, Backend::default());
    let theta = [0.3, 0.2, -0.5, 0.41];
    assert_eq!(dynamics.unknowns(), theta.len());
    let times: Vec<f64> = (0..=60).map(|i| 0.1 * f64::from(i)).collect();
    let values: Vec<f64> = times.iter().map(|t| (1.3 * t).sin()).collect();
    let input = &system.measured_inputs()[0];
    let inputs = std::slice::from_ref(input);
    let packed = Packed::run_of(times.clone(), input.columns(&times, &values)).driven_by(0, inputs);
    let (columns, h) = (2 + theta.len(), 1e-5);
    let method = Method::by_name("gauss-legendre-6").unwrap();
    let run = |theta: &[f64], tangents: bool| {
        let mut batch = if tangents { Batch::with_tangents(1, 1, 4) } else { Batch::new(1, 1) };
        batch.set(0, times[20], &[0.7, -0.2]);
        batch.drive = Drive::new(1, 4, 1);
        batch.drive.stand(packed.record(), 0, 0, times[20]);
        let scratch = &mut Scratch::new();
        for _ in 0..3 {
            advance(&dynamics, method, &mut batch, &[0.25], 5, theta, scratch);
        }
        let mut seen = vec![0.0; 2];
        let mut tangent = vec![0.0; batch.tangent.len()];
        let out = tangents.then_some(&mut tangent[..]);
        observe(&dynamics, Observed::Momenta, &batch, theta, &mut seen, out, scratch);
        (seen, tangent)
    };
    let (_, tangent) = run(&theta, true);
    for k in 0..theta.len() {
        let moved = |by: f64| {
            let mut theta = theta;
            theta[k] += by;
            run(&theta, false).0
        };
        let (up, down) = (moved(h), moved(-h));
        for row in 0..2 {
            let (slope, found) =
                ((up[row] - down[row]) / (2.0 * h), tangent[row * columns + 2 + k]);
            assert!((slope - found).abs() < 1e-6, "{row} {k}: {slope} {found}");
            assert!(k < 3 || slope.abs() > 1e-3, "{slope}");
        }
    }
}
