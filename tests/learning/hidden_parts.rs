//! Parts that nobody measures: fitted where the spec has them, and found where it has not.

use leverrier::internals::data::{Clock, Dataset, Run};
use leverrier::internals::diagnose::diagnosis::{Diagnosis, Verdict, diagnose};
use leverrier::internals::diagnose::{self};
use leverrier::internals::expr::{FunctionSpace, System, build};
use leverrier::internals::fit::{Model, Options, Silent, fit};
use leverrier::internals::simulate::{InputRecord, NoiseLevel, Simulator, add_noise};

/// What is seen of a motion: the columns of a system's observables that have these names.
fn seen(made: &Dataset, system: &System, names: &[&str]) -> Dataset {
    let run = |run: &Run| {
        let column = |name: &String| {
            let place = made.observables.iter().position(|own| own == name);
            match place.filter(|_| names.contains(&name.as_str())) {
                Some(place) => run.values[place].clone(),
                None => vec![f64::NAN; run.times.len()],
            }
        };
        Run { values: system.observables().iter().map(column).collect(), ..run.clone() }
    };
    Dataset {
        observables: system.observables(),
        runs: made.runs.iter().map(run).collect(),
        inputs: made.inputs.clone(),
    }
}

fn simulated(truth: &str, starts: &[Vec<f64>], times: &[f64]) -> Dataset {
    let compiled = build("truth", truth).unwrap_or_else(|error| panic!("{error}"));
    let simulator = Simulator::known(&compiled.system);
    simulator.trajectories(starts, times).unwrap().dataset(&compiled.system)
}

fn even(samples: usize, step: f64) -> Vec<f64> {
    (0..samples).map(|i| step * i as f64).collect()
}

const PAIR: &str = "coordinates x, z; momenta p_x, p_z
T = p_x^2/2 + p_z^2/(2*0.4)
V = 0.5*x^2 + 0.3*(z - x)^2 + 0.05*z^4";

#[test]
fn a_hidden_mass_is_fitted_with_its_motion() {
    let starts = [vec![1.0, -0.3, 0.2, 0.1], vec![-0.4, 0.9, 0.0, -0.2], vec![0.2, 0.1, 0.8, 0.3]];
    let mut made = simulated(PAIR, &starts, &even(300, 0.1));
    let level = vec![NoiseLevel::Absolute(1e-4); made.observables.len()];
    add_noise(&mut made, &level, 7).unwrap();
    let spec = build(
        "pair",
        "coordinates x; momenta p_x; hidden z
param own = 0.47; param between = 0.32; param hard = 0.045
T = p_x^2/2 + p_z^2/(2*0.4)
V = own*x^2 + between*(z - x)^2 + hard*z^4",
    )
    .unwrap();
    let data = seen(&made, &spec.system, &["x"]);
    let options = Options { starts: 0, ..Options::default() };
    let model = fit(&spec.system, &data, &options, &Silent).unwrap();
    let of = |name: &str| {
        let found = model.parameters.iter().find(|parameter| parameter.name == name);
        found.unwrap_or_else(|| panic!("no {name}: {:?}", model.parameters)).value
    };
    for (name, expected) in [("own", 0.5), ("between", 0.3), ("hard", 0.05)] {
        assert!((of(name) / expected - 1.0).abs() < 0.001, "{name}: {}", of(name));
    }
    // Where it was, at the start of every run and at the end.
    for (run, start) in starts.iter().enumerate() {
        let name = (run + 1).to_string();
        let part = model.hidden.iter().find(|part| part.name == "z" && part.run == name).unwrap();
        let end = made.runs[run].values[1].last().unwrap();
        assert!((part.values.0 - start[1]).abs() < 0.01, "{part:?}");
        assert!((part.values.1 - end).abs() < 0.01, "{part:?} {end}");
    }
}

#[test]
fn what_acts_on_nothing_that_is_measured_is_said() {
    let silent = |text: &str| -> Vec<String> {
        let space = FunctionSpace::new(&build("test", text).unwrap());
        space.cannot_be_learned.into_iter().filter(|line| line.contains("hidden")).collect()
    };
    let text = "coordinates x; momenta p; hidden z; state w { w' = rate(x) - w }
T = (p^2 + p_z^2)/2; V = span{ x^2, z^2 }";
    let found = silent(text);
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(found[0].contains("of z") && found[1].contains("of w"), "{found:?}");
    assert!(silent(&format!("{text}; force x += -w; V += x*z")).is_empty());
    assert!(silent(&format!("{text}; sensor x += w + z")).is_empty());
}

/// Several tones, run by run at other phases.
fn tones(run: usize, t: f64) -> f64 {
    (0..8)
        .map(|k| {
            let k = k as f64;
            ((0.31 + 0.27 * k) * t + 1.7 * k * (1.0 + run as f64)).sin()
        })
        .sum::<f64>()
}

/// Runs of a law from rest under tones.
fn driven(truth: &str, state: usize, samples: usize, step: f64) -> Dataset {
    let compiled = build("truth", truth).unwrap_or_else(|error| panic!("{error}"));
    let system = &compiled.system;
    let inputs = system.measured_inputs();
    let times = even(samples, step);
    let mut all = Dataset { inputs: inputs.clone(), ..Dataset::default() };
    for run in 0..6 {
        let values: Vec<f64> = times.iter().map(|&t| tones(run, t)).collect();
        let columns = inputs[0].columns(&times, &values);
        let driving = Run {
            name: (run + 1).to_string(),
            times: times.clone(),
            values: Vec::new(),
            lines: vec![0; samples],
            clock: Clock::default(),
            inputs: columns.clone(),
        };
        let data = Dataset { runs: vec![driving], inputs: inputs.clone(), ..Dataset::default() };
        let record = InputRecord::of_runs(system, &data).unwrap().remove(0);
        let simulator = Simulator::known(system).driven_by(record);
        let made = simulator.trajectories(&[vec![0.0; state]], &times).unwrap().dataset(system);
        all.observables.clone_from(&made.observables);
        all.runs.extend(made.runs.into_iter().map(|made| Run {
            name: (run + 1).to_string(),
            inputs: columns.clone(),
            ..made
        }));
    }
    all
}

fn asked(text: &str, made: &Dataset, names: &[&str]) -> (Model, Diagnosis) {
    let spec = build("test", text).unwrap_or_else(|error| panic!("{error}"));
    let all = seen(made, &spec.system, names);
    let split = all.split_held_out(0.25, 0);
    let model = fit(&spec.system, &split.training, &Options::default(), &Silent).unwrap();
    let law = model.law_of(&spec.system).unwrap();
    let options = diagnose::Options::default();
    let found = diagnose(&spec, &law, &split.training, &split.held_out, &options, &Silent).unwrap();
    (model, found)
}

#[test]
fn a_hysteretic_spring_is_named() {
    let truth = "coordinates x; momenta p; input u { spline }
state w { w' = 1.5*rate(x) - 2*abs(rate(x))*w - 1*rate(x)*abs(w) }
T = p^2/2; V = x^2/2; force x += u - w - 0.1*p";
    let mut made = driven(truth, 4, 500, 0.1);
    let level = vec![NoiseLevel::Absolute(1e-3); made.observables.len()];
    add_noise(&mut made, &level, 3).unwrap();
    let text = "coordinates x; momenta p; input u { spline }
T = p^2/2; V = span{ x^2 }; force x += u + span{ drag: -p }";
    let (_, found) = asked(text, &made, &["x"]);
    assert_eq!(found.verdict, Verdict::Missing, "{}", found.reason);
    assert_eq!(found.story.len(), 1, "{}", found.reason);
    assert_eq!(found.story[0].effect, "bouc_wen(x)", "{}", found.reason);
    // Stiffness of the memory, its loss and what differs with direction.
    for (value, expected) in found.story[0].coefficient.iter().zip([1.5, 2.0, 0.5]) {
        assert!((value - expected).abs() < 0.1 * expected, "{:?}", found.story[0]);
    }
}
