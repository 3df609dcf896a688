//! What columns show that is no coordinate: laws are found from it, angles on the circle.

use leverrier::internals::data::Dataset;
use leverrier::internals::diagnose::Options as DiagnosisOptions;
use leverrier::internals::diagnose::diagnosis::{Verdict, diagnose};
use leverrier::internals::expr::{FunctionSpace, System, build};
use leverrier::internals::fit::{Model, Options, Silent, fit};
use leverrier::internals::simulate::{NoiseLevel, Simulator, add_noise};

/// Runs of a truth, of which only its measures are kept, with noise in parts of their spread.
fn measured(
    truth: &str,
    starts: &[Vec<f64>],
    (samples, step): (usize, f64),
    noise: f64,
) -> Dataset {
    let system = build("truth", truth).unwrap_or_else(|error| panic!("{error}")).system;
    let times: Vec<f64> = (0..samples).map(|i| step * i as f64).collect();
    let made = Simulator::known(&system).trajectories(starts, &times).unwrap();
    let mut data = made.dataset(&system);
    let mut levels = vec![NoiseLevel::Absolute(0.0); 2 * system.degrees()];
    levels.resize(data.observables.len(), NoiseLevel::Relative(noise));
    add_noise(&mut data, &levels, 11).unwrap();
    for run in &mut data.runs {
        run.values[..2 * system.degrees()].iter_mut().for_each(|column| column.fill(f64::NAN));
    }
    data
}

fn learned(space: &str, data: &Dataset) -> Model {
    let system = build("space", space).unwrap_or_else(|error| panic!("{error}")).system;
    fit(&system, data, &Options::default(), &Silent).unwrap_or_else(|error| panic!("{error}"))
}

/// That a model has these terms, with these coefficients, and no other to speak of: what the
/// truth's own integration errs by may be told by a term, too.
fn is(model: &Model, expected: &[(&str, f64)], tolerance: f64, case: &str) {
    let told = model.terms.iter().filter(|term| term.coefficient.abs() > 1e-9);
    let found: Vec<(&str, f64)> = told.map(|term| (term.term.as_str(), term.coefficient)).collect();
    assert_eq!(found.len(), expected.len(), "{case}: {found:?}");
    for ((term, value), (name, truth)) in found.iter().zip(expected) {
        assert_eq!(term, name, "{case}: {found:?}");
        assert!((value - truth).abs() < tolerance * truth.abs(), "{case}: {found:?}");
    }
}

const ORBIT: &str = "coordinates x, y; momenta p_x, p_y
measure r = sqrt(x^2 + y^2); measure bearing = atan2(y, x)
T = (p_x^2 + p_y^2)/2\n";

#[test]
fn an_orbit_is_found_from_distance_and_bearing() {
    let truth = format!("{ORBIT}V = -1/sqrt(x^2 + y^2)");
    let space = format!("{ORBIT}V = span{{ 1/sqrt(x^2 + y^2), x, y, x^2 + y^2 }}");
    // Several turns, one orbit run through backwards.
    let starts = [vec![1.0, 0.0, 0.0, 0.9], vec![-0.7, 0.5, 0.6, 0.8], vec![0.0, -1.2, 0.9, 0.1]];
    for (noise, tolerance) in [(0.0, 1e-6), (0.01, 0.01)] {
        let mut data = measured(&truth, &starts, (250, 0.08), noise);
        if noise > 0.0 {
            // Columns of different rates, and what was lost.
            for run in &mut data.runs {
                run.values[4].iter_mut().skip(1).step_by(2).for_each(|x| *x = f64::NAN);
                run.values[5][40..46].fill(f64::NAN);
            }
        }
        let model = learned(&space, &data);
        is(&model, &[("1/sqrt(x^2 + y^2)", -1.0)], tolerance, &format!("noise {noise}"));
    }
}

const ROD: &str = "coordinates theta; momenta p
measure across = sin(theta); measure up = -cos(theta)
T = p^2/2\n";

#[test]
fn a_pendulum_is_found_from_the_place_of_its_bob() {
    let truth = format!("{ROD}V = -cos(theta)");
    let space = format!("{ROD}V = span{{ trig(theta; 2) }}\nforce theta += span{{ drag: -p }}");
    // Two that swing and one that goes round.
    let starts = [vec![1.4, 0.0], vec![-0.5, 0.8], vec![0.3, 2.6]];
    for (noise, tolerance) in [(0.0, 1e-6), (0.01, 0.01), (0.05, 0.05)] {
        let model = learned(&space, &measured(&truth, &starts, (200, 0.1), noise));
        is(&model, &[("cos(theta)", -1.0)], tolerance, &format!("noise {noise}"));
    }
}

#[test]
fn an_angle_without_its_turns_is_compared_on_the_circle() {
    let wrapped = "coordinates theta; momenta p; measure angle = theta { wrapped }
T = p^2/2\n";
    let truth = format!("{wrapped}V = -cos(theta)");
    let space = format!("{wrapped}V = span{{ trig(theta; 2) }}");
    let starts = [vec![0.3, 2.6], vec![-3.0, -2.2], vec![1.2, 0.1]];
    let data = measured(&truth, &starts, (200, 0.1), 0.003);
    let pi = std::f64::consts::PI;
    let read = data.runs.iter().flat_map(|run| &run.values[2]);
    assert!(read.clone().all(|x| x.abs() < pi + 0.1) && read.clone().any(|x| x.abs() > 3.0));
    let model = learned(&space, &data);
    is(&model, &[("cos(theta)", -1.0)], 0.01, "wrapped");
    assert!(model.noise[2].standard_deviation < 0.02, "{:?}", model.noise);
}

#[test]
fn an_oscillator_is_found_from_an_accelerometer_alone() {
    let felt = "coordinates x; momenta p; measure felt = rate(rate(x))\nT = p^2/2\n";
    let truth = format!("{felt}V = 2*x^2\nforce x += -0.1*p");
    let space = format!("{felt}V = span{{ x^2, x^4 }}\nforce x += span{{ drag: -p }}");
    let starts = [vec![1.0, 0.0], vec![-0.4, 1.1]];
    for (noise, tolerance) in [(0.0, 1e-5), (0.01, 0.03), (0.05, 0.1)] {
        let model = learned(&space, &measured(&truth, &starts, (300, 0.05), noise));
        is(&model, &[("x^2", 2.0), ("-p", 0.1)], tolerance, &format!("noise {noise}"));
    }
}

#[test]
fn what_no_column_depends_on_is_an_error() {
    let text = "coordinates x, y; momenta p_x, p_y; measure far = 2*x
T = (p_x^2 + p_y^2)/2; V = span{ x^2, y^2 }";
    let data =
        measured(&text.replace("span{ x^2, y^2 }", "x^2 + y^2"), &[vec![1.0; 4]], (50, 0.1), 0.0);
    let system: &System = &build("space", text).unwrap().system;
    let error = fit(&system.clone().into(), &data, &Options::default(), &Silent).unwrap_err();
    assert!(error.to_string().contains("nothing that is measured depends on `y`"), "{error}");
    // `check` says it where the spec does.
    let said = format!(
        "{text}\ndata \"none.csv\" {{ x not measured, y not measured, p_x not measured, p_y not measured }}"
    );
    let space = FunctionSpace::new(&build("test", &said).unwrap());
    let lines: Vec<&String> =
        space.cannot_be_learned.iter().filter(|line| line.contains("no column")).collect();
    assert!(lines.len() == 1 && lines[0].contains("of y"), "{lines:?}");
}

#[test]
fn an_orbit_is_found_from_its_rates_without_any_direction() {
    let rates = "coordinates x, y; momenta p_x, p_y
measure r = sqrt(x^2 + y^2); measure parting = rate(sqrt(x^2 + y^2))
measure turning = (x*rate(y) - y*rate(x))/(x^2 + y^2)
T = (p_x^2 + p_y^2)/2\n";
    let truth = format!("{rates}V = -1/sqrt(x^2 + y^2)");
    let space = format!("{rates}V = span{{ 1/sqrt(x^2 + y^2), x^2 + y^2 }}");
    let starts = [vec![1.0, 0.0, 0.0, 0.9], vec![-0.7, 0.5, 0.6, 0.8]];
    let model = learned(&space, &measured(&truth, &starts, (250, 0.08), 0.01));
    is(&model, &[("1/sqrt(x^2 + y^2)", -1.0)], 0.01, "rates");
}

#[test]
fn a_swinging_instrument_tells_its_law() {
    // What a telephone on a rod feels: along the rod, across it, and how fast it turns.
    let felt = "coordinates theta; momenta p; let g = 9.81; let l = 0.7
measure along = l*rate(theta)^2 + g*cos(theta)
measure across = l*rate(rate(theta)) + g*sin(theta)
measure turning = rate(theta)
T = p^2/(2*l^2)\n";
    let truth = format!("{felt}V = -g*l*cos(theta)\nforce theta += -0.08*p");
    let space =
        format!("{felt}V = span{{ cos(theta), theta^2 }}\nforce theta += span{{ drag: -p }}");
    let starts = [vec![1.2, 0.0], vec![-0.4, 1.1]];
    let model = learned(&space, &measured(&truth, &starts, (300, 0.03), 0.02));
    is(&model, &[("cos(theta)", -6.867), ("-p", 0.08)], 0.01, "telephone");
}

#[test]
fn a_fault_of_the_instrument_is_named_on_a_measure() {
    let truth = format!("{ROD}V = -cos(theta)\nsensor across += 0.05");
    let starts = [vec![1.4, 0.0], vec![-0.5, 0.8], vec![0.3, 2.6], vec![1.0, 0.5]];
    let data = measured(&truth, &starts, (150, 0.1), 0.01);
    let compiled = build("model", &format!("{ROD}V = span{{ cos(theta) }}")).unwrap();
    let training = Dataset { runs: data.runs[..3].to_vec(), ..data.clone() };
    let held_out = Dataset { runs: data.runs[3..].to_vec(), ..data };
    let model = fit(&compiled.system, &training, &Options::default(), &Silent).unwrap();
    let law = model.law(&compiled.system).unwrap();
    let options = DiagnosisOptions::default();
    let found = diagnose(&compiled, &law, &training, &held_out, &options, &Silent).unwrap();
    assert_eq!(found.verdict, Verdict::Missing, "{found:?}");
    assert_eq!(found.ranking[0].effect, "sensor_offset(across)");
}
