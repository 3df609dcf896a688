//! Learning masses and lengths from an energy of velocities.

use leverrier::internals::data::Dataset;
use leverrier::internals::expr::build;
use leverrier::internals::fit::{Model, Options, Silent, fit};
use leverrier::internals::simulate::{NoiseLevel, Simulator, add_noise};

/// A weight of 1 on a rod of 1, and one of 0.6 on a rod of 0.8 below it; joints with friction.
const TRUTH: &str = "coordinates a, b; velocities u, v
T = u^2/2 + 0.6*(u^2 + 2*0.8*u*v*cos(a - b) + 0.8^2*v^2)/2
V = -1.6*9.81*cos(a) - 0.6*0.8*9.81*cos(b)
force a += -0.05*u - 0.02*(u - v)
force b += 0.02*(u - v)";

/// Its mass and its rod are unknown, and so are gravity and the friction.
const SPACE: &str = "coordinates a, b; velocities u, v
param m = 1 in 0.05..20
param l = 0.5 in 0.05..20
L = u^2/2 + m*(u^2 + 2*l*u*v*cos(a - b) + l^2*v^2)/2 - span{ cos(a), cos(b), a^2, b^2 }
force a += span{ upper: -u, lower: v - u }
force b += span{ lower: u - v }";

fn runs(noise: f64) -> Dataset {
    let compiled = build("truth", TRUTH).unwrap_or_else(|error| panic!("{error}"));
    let times: Vec<f64> = (0..300).map(|i| 0.02 * f64::from(i)).collect();
    let starts = [[1.2, -0.4, 0.0, 0.0], [-0.5, 1.5, 0.3, 0.2], [0.3, 0.9, 1.0, -0.4]];
    let starts: Vec<Vec<f64>> = starts.iter().map(|start| start.to_vec()).collect();
    let simulator = Simulator::known(&compiled.system);
    let mut data = simulator.trajectories(&starts, &times).unwrap().dataset(&compiled.system);
    add_noise(&mut data, &[NoiseLevel::Relative(noise); 4], 11).unwrap();
    data
}

fn learned(data: &Dataset) -> Model {
    let system = build("space", SPACE).unwrap_or_else(|error| panic!("{error}")).system;
    fit(&system, data, &Options::default(), &Silent).unwrap()
}

fn agrees(model: &Model, tolerance: f64) {
    let found: Vec<&str> = model.terms.iter().map(|term| term.term.as_str()).collect();
    assert_eq!(found, ["cos(a)", "cos(b)", "-u", "v - u"]);
    let coefficients = model.terms.iter().map(|term| (term.coefficient, term.standard_error));
    let parameters = model.parameters.iter().map(|one| (one.value, one.standard_error));
    let expected = [-1.6 * 9.81, -0.6 * 0.8 * 9.81, 0.05, 0.02, 0.6, 0.8];
    for ((found, error), expected) in coefficients.chain(parameters).zip(expected) {
        let off = (found - expected).abs();
        assert!(off < tolerance * expected.abs(), "{found} {expected}");
        assert!(off < 4.5 * error + 1e-7 * expected.abs(), "{found} +- {error}, not {expected}");
    }
}

#[test]
fn mass_and_length_of_a_double_pendulum_are_found() {
    agrees(&learned(&runs(0.0)), 1e-6);
    agrees(&learned(&runs(0.01)), 0.05);
}

#[test]
fn angles_alone_tell_as_much() {
    let mut data = runs(0.003);
    for run in &mut data.runs {
        run.values[2].fill(f64::NAN);
        run.values[3].fill(f64::NAN);
    }
    agrees(&learned(&data), 0.05);
}
