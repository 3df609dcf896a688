//! Learning from runs that an input drives.

use std::fs;

use leverrier::internals::data::{Clock, Dataset, Interpolation, Run};
use leverrier::internals::diagnose::diagnosis::Verdict;
use leverrier::internals::diagnose::discover::{DiscoveryOptions, discover};
use leverrier::internals::expr::build;
use leverrier::internals::fit::{Options, Silent, fit};
use leverrier::internals::simulate::{InputRecord, NoiseLevel, Simulator, add_noise};
use leverrier::{Data, ErrorKind, Spec};

use crate::paper::figures::printed;

/// Several tones, as a shaker plays them; run by run at other phases.
fn tones(run: usize, t: f64) -> f64 {
    let tone = |k: usize| {
        let k = k as f64;
        ((0.31 + 0.27 * k) * t + 1.7 * k * (1.0 + run as f64)).sin()
    };
    (0..8).map(tone).sum::<f64>()
}

/// Runs of a law from rest under tones of an amplitude, with the inputs that made them.
pub(crate) fn shaken(
    truth: &str,
    amplitude: f64,
    runs: usize,
    (samples, step): (usize, f64),
) -> Dataset {
    let compiled = build("truth", truth).unwrap_or_else(|error| panic!("{error}"));
    let system = &compiled.system;
    let inputs = system.measured_inputs();
    let times: Vec<f64> = (0..samples).map(|i| step * i as f64).collect();
    let rest = vec![0.0; 2 * system.degrees()];
    let mut all = Dataset { inputs: inputs.clone(), ..Dataset::default() };
    for run in 0..runs {
        let values: Vec<f64> = times.iter().map(|&t| amplitude * tones(run, t)).collect();
        let columns = inputs[0].columns(&times, &values);
        let driving = Run {
            name: (run + 1).to_string(),
            times: times.clone(),
            values: Vec::new(),
            lines: vec![0; samples],
            clock: Clock::default(),
            inputs: columns.clone(),
            groups: Vec::new(),
            errors: Vec::new(),
        };
        let data = Dataset { runs: vec![driving], inputs: inputs.clone(), ..Dataset::default() };
        let record = InputRecord::of_runs(system, &data).unwrap().remove(0);
        let simulator = Simulator::known(system).driven_by(record);
        let made =
            simulator.trajectories(std::slice::from_ref(&rest), &times).unwrap().dataset(system);
        all.observables.clone_from(&made.observables);
        let made = made.runs.into_iter().map(|made| Run {
            name: (run + 1).to_string(),
            inputs: columns.clone(),
            ..made
        });
        all.runs.extend(made);
    }
    all
}

/// The same by a shaker of usual strength.
fn runs(truth: &str, runs: usize, samples: usize, step: f64) -> Dataset {
    shaken(truth, 0.3, runs, (samples, step))
}

const TRUTH: &str = "coordinates x; momenta p; input u { spline }
T = p^2/2\nV = x^2/2 + x^4/4\nforce x += 1.3*u - 0.2*p";
const SPACE: &str = "coordinates x; momenta p; input u { spline }
T = p^2/2\nV = span{ poly(x; 4) }\nforce x += span{ gain: u, drag: -p, mixed: u*x }";

#[test]
fn a_driven_oscillator_is_recovered_at_every_noise() {
    for (noise, tolerance) in [(0.0, 1e-7), (0.01, 0.01), (0.05, 0.04)] {
        let mut data = runs(TRUTH, 4, 300, 0.1);
        let level = NoiseLevel::Relative(noise);
        add_noise(&mut data, &[level, level], 5).unwrap();
        let system = build("space", SPACE).unwrap().system;
        let model = fit(&system, &data, &Options::default(), &Silent).unwrap();
        let found: Vec<&str> = model.terms.iter().map(|term| term.term.as_str()).collect();
        assert_eq!(found, ["x^2", "x^4", "u", "-p"], "{noise}");
        for (term, expected) in model.terms.iter().zip([0.5, 0.25, 1.3, 0.2]) {
            let off = (term.coefficient - expected).abs();
            assert!(off < tolerance, "{} at {noise}: {}", term.term, term.coefficient);
            let allowed = 4.5 * term.standard_error + 1e-7;
            assert!(off < allowed, "{}: {off} of {}", term.term, term.standard_error);
        }
    }
}

#[test]
fn what_an_input_does_between_samples_matters() {
    let held = TRUTH.replace("spline", "hold");
    let data = runs(&held, 3, 300, 0.3);
    let drag = |between: &str| {
        let space = SPACE.replace("spline", between);
        let system = build("space", &space).unwrap().system;
        let mut data = data.clone();
        data.inputs = system.measured_inputs();
        let model = fit(&system, &data, &Options::default(), &Silent).unwrap();
        let drag = model.terms.iter().find(|term| term.term == "-p");
        (drag.map_or(0.0, |term| term.coefficient), model.noise[0].standard_deviation)
    };
    let (right, wrong) = (drag("hold"), drag("linear"));
    assert!((right.0 - 0.2).abs() < 1e-7, "{right:?}");
    assert!(wrong.1 > 1e3 * right.1, "{wrong:?}");
}

#[test]
fn a_mass_far_from_one_is_found_from_positions_alone() {
    let truth = "coordinates x; momenta p; input u { linear }
T = p^2/(2*3e-5)\nV = 3e-5*x^2\nforce x += 3e-5*u - 0.2*p";
    let space = "coordinates x; momenta p; input u { linear }
T = span{ p^2 }\nV = span{ x^2 }\nforce x += 3e-5*u + span{ -p }";
    let mut data = runs(truth, 2, 600, 0.1);
    for run in &mut data.runs {
        run.values[1].fill(f64::NAN);
    }
    let noise = [NoiseLevel::Relative(1e-3), NoiseLevel::Absolute(0.0)];
    add_noise(&mut data, &noise, 3).unwrap();
    let system = build("space", space).unwrap().system;
    let model = fit(&system, &data, &Options::default(), &Silent).unwrap();
    for (term, expected) in model.terms.iter().zip([0.5 / 3e-5, 3e-5, 0.2]) {
        let off = (term.coefficient / expected - 1.0).abs();
        assert!(off < 0.01, "{}: {}", term.term, term.coefficient);
    }
}

fn opened(spec: &str, csv: &str) -> leverrier::Result<Data> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("runs.csv");
    fs::write(&path, csv).expect("written");
    Data::open(path, &Spec::parse(spec)?)
}

#[test]
fn what_is_wrong_with_an_input_is_said_with_its_place() {
    let spec =
        "coordinates x; momenta p; input u { linear }; T = p^2/2; V = span{ x^2 }; force x += u";
    let rows = |rows: &[&str]| format!("t,x,u\n{}\n", rows.join("\n"));
    let good = rows(&["0,1,2", "1,1.5,2.5", "2,1,2"]);
    let data = opened(spec, &good).unwrap();
    assert_eq!((data.samples(), data.warnings().len()), (3, 1), "{:?}", data.warnings());

    let cases = [
        (rows(&["0,1,2", "1,1.5,", "2,1,2"]), 3, "the input `u` has no value here"),
        (rows(&["0,1,2", "1,1.5,2", "2,1,", "3,2,"]), 4, "the input `u` ends at line 3"),
        (rows(&["0,1,2", "1,1.5,two", "2,1,2"]), 3, "two"),
        ("t,x,v\n0,1,2\n1,2,3\n".to_string(), 1, "no column `u`"),
    ];
    for (csv, line, message) in cases {
        let error = opened(spec, &csv).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Data, "{error}");
        let text = error.to_string();
        assert!(text.contains(message), "{text}");
        assert!(text.contains(&format!("line {line}")), "{text}");
    }
    let uneven = spec.replace("linear", "band_limited");
    let error = opened(&uneven, &rows(&["0,1,2", "1,1.5,2", "2.2,1,1", "3,2,3"])).unwrap_err();
    assert!(error.to_string().contains("not evenly spaced"), "{error}");
}

#[test]
fn numbers_in_memory_carry_their_inputs() {
    let spec = Spec::parse(SPACE).unwrap();
    let data = runs(TRUTH, 2, 200, 0.1);
    let run = |at: usize| {
        let run = &data.runs[at];
        (run.times.clone(), [&run.values[..], &run.inputs[..1]].concat())
    };
    let (times, columns) = run(0);
    let slices: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let held = Data::from_slices(&spec, &times, &slices).unwrap();
    let (times, columns) = run(1);
    let slices: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let held = held.with_run(&times, &slices).unwrap();
    let law = spec.fit(&held).unwrap();
    assert!((law.coefficient("gain").unwrap() - 1.3).abs() < 1e-6);
    assert!(Data::from_slices(&spec, &times, &slices[..1]).is_err());
    // And the law follows an input that it never saw.
    let t: Vec<f64> = (0..200).map(|i| 0.1 * f64::from(i)).collect();
    let u: Vec<f64> = t.iter().map(|&t| tones(7, t)).collect();
    let motion = law.predict_driven(&[0.0, 0.0], &[0.0, 7.05], &t, &[&u]).unwrap();
    assert!(motion.column("x").unwrap()[1].is_finite());
    assert!(law.predict(&[0.0, 0.0], &[0.0, 1.0]).is_err());
    assert_eq!(Interpolation::by_keyword("hold"), Some(Interpolation::Hold));
}

/// Positions of a shaken rig, with noise in parts of their spread.
fn seen_rig(force: &str, between: &str, noise: f64) -> Dataset {
    let truth = format!(
        "coordinates x; momenta p; input u {{ {between} }}
T = p^2/2; V = 0.8*x^2; force x += {force} - 0.3*p"
    );
    let mut data = shaken(&truth, 0.6, 4, (400, 0.1));
    add_noise(&mut data, &[NoiseLevel::Relative(noise), NoiseLevel::Absolute(0.0)], 4).unwrap();
    data.runs.iter_mut().for_each(|run| run.values[1].fill(f64::NAN));
    data
}

#[test]
fn a_delay_is_learned() {
    for between in ["linear", "spline", "band_limited"] {
        let data = seen_rig("1.4*delayed(u, 0.23)", between, 0.0);
        let space = format!(
            "coordinates x; momenta p; input u {{ {between} }}; param d = 0.1 in 0..2
T = p^2/2; V = span{{ x^2 }}; force x += span{{ gain: delayed(u, d), drag: -p }}"
        );
        let system = build("space", &space).unwrap().system;
        let model = fit(&system, &data, &Options::default(), &Silent).unwrap();
        let delay = model.parameters[0].value;
        assert!((delay - 0.23).abs() < 1e-5, "{between}: {delay}");
        for (term, expected) in model.terms.iter().zip([0.8, 1.4, 0.3]) {
            assert!((term.coefficient - expected).abs() < 1e-4, "{between}: {term:?}");
        }
    }
}

#[test]
fn what_a_drive_does_to_its_command_is_named() {
    let whole = "V = span{ x^2 }";
    // The force that there is, what is known, what is told of it, and its numbers: of all that goes
    // through a drive, the gain is known.
    let cases: [(&str, &str, &str, f64); 6] = [
        ("delayed(u, 0.27)", whole, "input_delay(x, u)", 0.27),
        ("u + (abs(u - 0.3) - abs(u + 0.3))/2", whole, "input_dead_zone(x, u)", 0.3),
        ("(abs(u + 1) - abs(u - 1))/2", whole, "input_saturation(x, u)", 1.0),
        // Where the stiffness is not known, a mass does as well.
        ("0.8*u", "V = 0.8*x^2", "input_gain(x, u)", -0.2),
        ("u + 0.15*abs(u)", whole, "input_asymmetry(x, u)", 0.15),
        ("u + 0.2", whole, "constant_force(x)", 0.2),
    ];
    for (force, potential, name, number) in cases {
        let text = format!(
            "coordinates x; momenta p; input u {{ spline }}
T = p^2/2; {potential}; force x += u + span{{ drag: -p }}"
        );
        let data = seen_rig(force, "spline", 0.01).split_held_out(0.25, 0);
        let (training, held_out) = (&data.training, &data.held_out);
        let options = DiscoveryOptions::default();
        let found = discover("rig", &text, training, held_out, &options, &Silent).unwrap();
        assert_eq!(found.verdict, Verdict::NothingMissing, "{force}: {}", found.stop);
        let [step] = found.steps.as_slice() else { panic!("{force}: {:?}", found.steps) };
        assert_eq!(step.effect, name, "{force}");
        assert_eq!(step.coefficient.len(), 1, "{force}: {step:?}");
        let off = (step.coefficient[0] - number).abs();
        assert!(off < 0.04 * number.abs(), "{force}: {step:?}");
        assert!(off < 4.5 * step.standard_error[0], "{force}: {step:?}");
        // A fit of what was written has it still, and writes no number that adds up to nothing.
        let again = build("found", &found.text).unwrap_or_else(|error| panic!("{error}"));
        let model = fit(&again.system, training, &Options::default(), &Silent).unwrap();
        let own = name.split('(').next().unwrap_or_default();
        let is_own = |term: &str| term.starts_with(own);
        assert!(model.terms.iter().any(|term| term.name.as_deref().is_some_and(is_own)), "{name}");
        let equations = printed(&again.system, &model, training);
        assert!(!equations.contains(" 0 u"), "{equations}");
    }
}

#[test]
fn nothing_is_told_of_a_drive_that_does_what_it_says() {
    let text = "coordinates x; momenta p; input u { spline }
T = p^2/2; V = span{ x^2 }; force x += u + span{ drag: -p }";
    for (force, expected) in [("u", None), ("u - 0.12*sign(p)", Some("coulomb_friction(x)"))] {
        let data = seen_rig(force, "spline", 0.01).split_held_out(0.25, 0);
        let (training, held_out) = (&data.training, &data.held_out);
        let options = DiscoveryOptions::default();
        let found = discover("rig", text, training, held_out, &options, &Silent).unwrap();
        let told: Vec<&str> = found.steps.iter().map(|step| step.effect.as_str()).collect();
        assert_eq!(told, expected.into_iter().collect::<Vec<_>>(), "{force}: {}", found.stop);
    }
}
