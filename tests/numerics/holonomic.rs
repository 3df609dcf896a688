//! Motions held to equations between coordinates, against coordinates that need none.

use leverrier::internals::expr::build;
use leverrier::internals::simulate::Simulator;

const ROD: &str = "coordinates x, y; momenta p, r
T = (p^2 + r^2)/(2*1.3)
V = 1.3*9.81*y
constrain x^2 + y^2 == 0.7^2";

const ANGLE: &str = "coordinates a; momenta p
T = p^2/(2*1.3*0.49)
V = -1.3*9.81*0.7*cos(a)";

const TWO_RODS: &str = "coordinates x, y, u, v; momenta px, py, pu, pv
let second = (u - x)^2 + (v - y)^2
T = (px^2 + py^2)/2 + (pu^2 + pv^2)/(2*0.6)
V = 9.81*y + 0.6*9.81*v
force x += -0.1*px
force y += -0.1*py
constrain x^2 + y^2 == 1
constrain second == 0.64";

const TWO_ANGLES: &str = "coordinates a, b
T = (rate(sin(a))^2 + rate(cos(a))^2)/2
T += 0.6*(rate(sin(a) + 0.8*sin(b))^2 + rate(cos(a) + 0.8*cos(b))^2)/2
V = -1.6*9.81*cos(a) - 0.6*0.8*9.81*cos(b)
force a += -0.1*rate(a)";

/// States of a known spec at some times.
fn motion(text: &str, start: &[f64], times: &[f64]) -> Vec<Vec<f64>> {
    let compiled = build("test", text).unwrap_or_else(|error| panic!("{error}"));
    let simulator = Simulator::known(&compiled.system);
    let data = simulator.trajectories(&[start.to_vec()], times).unwrap().dataset(&compiled.system);
    let run = &data.runs[0];
    (0..times.len()).map(|at| run.values.iter().map(|column| column[at]).collect()).collect()
}

fn times(end: f64) -> Vec<f64> {
    (0..=50).map(|i| end * f64::from(i) / 50.0).collect()
}

fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() < tolerance, "{found}, not {expected}");
}

#[test]
fn a_weight_on_a_rod_swings_as_its_angle_does() {
    let (l, m, a, rate) = (0.7, 1.3, 2.1f64, 0.5);
    let times = times(6.0);
    let start = [l * a.sin(), -l * a.cos(), m * l * a.cos() * rate, m * l * a.sin() * rate];
    let places = motion(ROD, &start, &times);
    let angles = motion(ANGLE, &[a, m * l * l * rate], &times);
    for (place, angle) in places.iter().zip(&angles) {
        near(place[0], l * angle[0].sin(), 1e-8);
        near(place[1], -l * angle[0].cos(), 1e-8);
        near(place[0].hypot(place[1]), l, 1e-9);
    }
}

#[test]
fn two_rods_with_friction_move_as_their_angles_do() {
    let (a, b) = (1.2f64, -0.4f64);
    let times = times(3.0);
    let start = [a.sin(), -a.cos(), a.sin() + 0.8 * b.sin(), -a.cos() - 0.8 * b.cos()];
    let start: Vec<f64> = start.into_iter().chain([0.0; 4]).collect();
    let places = motion(TWO_RODS, &start, &times);
    let angles = motion(TWO_ANGLES, &[a, b, 0.0, 0.0], &times);
    for (place, angle) in places.iter().zip(&angles) {
        near(place[0], angle[0].sin(), 1e-7);
        near(place[3], -angle[0].cos() - 0.8 * angle[1].cos(), 1e-7);
    }
}

#[test]
fn a_start_off_the_constraint_is_refused() {
    let system = build("test", ROD).unwrap().system;
    let off = Simulator::known(&system).trajectories(&[vec![0.5, -0.2, 0.0, 0.0]], &[0.0, 1.0]);
    let sentence = off.err().unwrap().to_string();
    assert!(sentence.contains("`x^2 + y^2 == 0.7^2` does not hold"), "{sentence}");
}

#[test]
fn what_is_tied_together_moves_as_one() {
    let tied = "coordinates x, y; momenta p, r
T = p^2/2 + r^2/6
V = 2*x^2
constrain x - y == 0.5";
    let one = "coordinates x; momenta p\nT = p^2/8\nV = 2*x^2";
    let times = times(10.0);
    let both = motion(tied, &[0.8, 0.3, 0.1, 0.3], &times);
    let alone = motion(one, &[0.8, 0.4], &times);
    for (both, alone) in both.iter().zip(&alone) {
        near(both[0], alone[0], 1e-9);
        near(both[0] - both[1], 0.5, 1e-9);
    }
}
