//! Learning and diagnosing motions that are held to an equation between coordinates.

use leverrier::internals::expr::build;
use leverrier::internals::simulate::{NoiseLevel, Simulator, add_noise};
use leverrier::{Data, Spec};

/// A weight on a rod of 0.7 in a field that is not quite upright, in the drag of the air.
const TRUTH: &str = "coordinates x, y; momenta p, r
T = (p^2 + r^2)/2
V = 9.81*y + 1.5*x
force x += -0.15*p
force y += -0.15*r
constrain x^2 + y^2 == 0.49";

/// The data that a spec of these coordinates reads: swings of the weight.
fn swings(spec: &Spec, noise: f64) -> Data {
    let compiled = build("truth", TRUTH).unwrap_or_else(|error| panic!("{error}"));
    let times: Vec<f64> = (0..150).map(|i| 0.04 * f64::from(i)).collect();
    let starts: Vec<Vec<f64>> = [0.8f64, -1.4, 2.0, -0.5, 1.1, 1.7]
        .iter()
        .map(|angle| vec![0.7 * angle.sin(), -0.7 * angle.cos(), 0.0, 0.0])
        .collect();
    let simulator = Simulator::known(&compiled.system);
    let mut data = simulator.trajectories(&starts, &times).unwrap().dataset(&compiled.system);
    add_noise(&mut data, &[NoiseLevel::Relative(noise); 4], 5).unwrap();
    let mut runs = data.runs.iter();
    let first: Vec<&[f64]> = runs.next().unwrap().values.iter().map(Vec::as_slice).collect();
    let whole = Data::from_slices(spec, &times, &first).unwrap();
    runs.fold(whole, |whole, run| {
        let columns: Vec<&[f64]> = run.values.iter().map(Vec::as_slice).collect();
        whole.with_run(&times, &columns).unwrap()
    })
}

const LEARNED: &str = "coordinates x, y; momenta p, r
T = (p^2 + r^2)/2
V = span{ x, y, x*y, x^2 - y^2 }
constrain x^2 + y^2 == 0.49";

#[test]
fn a_field_is_learned_beside_the_force_of_the_rod() {
    let text = format!("{LEARNED}\neffect viscous_drag(x, y)");
    let spec = Spec::parse(&text).unwrap();
    for (noise, tolerance) in [(0.0, 1e-6), (0.01, 0.03)] {
        let law = spec.fit(&swings(&spec, noise)).unwrap();
        let found: Vec<&str> = law.terms().iter().map(|term| term.term.as_str()).collect();
        assert_eq!(found.len(), 3, "{found:?} at a noise of {noise}");
        for (term, expected) in [("x", 1.5), ("y", 9.81)] {
            let c = law.coefficient(term).unwrap();
            assert!((c - expected).abs() < tolerance * expected, "{term}: {c}");
        }
    }
}

#[test]
fn the_drag_beside_a_rod_is_named() {
    let spec = Spec::parse(LEARNED).unwrap();
    let data = swings(&spec, 0.01);
    let (training, held_out) = data.split(0.34, 0).unwrap();
    let diagnosis = spec.fit(&training).unwrap().diagnose(&training, &held_out).unwrap();
    assert_eq!(diagnosis.missing(), Some("viscous_drag(x, y)"), "{}", diagnosis.reason());
}
