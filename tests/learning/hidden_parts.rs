//! Parts that nobody measures: fitted where the spec has them, and found where it has not.

use leverrier::internals::data::Dataset;
use leverrier::internals::diagnose::diagnosis::Verdict;
use leverrier::internals::diagnose::discover::{Discovery, DiscoveryOptions, discover};
use leverrier::internals::expr::{FunctionSpace, System, build};
use leverrier::internals::fit::{Options, Silent, fit};
use leverrier::internals::simulate::{NoiseLevel, Simulator, add_noise};

use crate::driven::shaken;

/// What is seen of a motion: the columns of a system's observables that have these names.
fn seen(made: &Dataset, system: &System, names: &[&str]) -> Dataset {
    let named = made.with_observables(names.iter().map(ToString::to_string).collect());
    named.with_observables(system.observables()).into_owned()
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

/// What the loop adds to a spec by what is seen of a motion.
fn discovered(text: &str, made: &Dataset, names: &[&str]) -> Discovery {
    let spec = build("test", text).unwrap_or_else(|error| panic!("{error}"));
    let split = seen(made, &spec.system, names).split_held_out(0.25, 0);
    let (training, held_out) = (&split.training, &split.held_out);
    discover("test", text, training, held_out, &DiscoveryOptions::default(), &Silent).unwrap()
}

#[test]
fn a_hysteretic_spring_is_named() {
    let truth = "coordinates x; momenta p; input u { spline }
state w { w' = 1.5*rate(x) - 2*abs(rate(x))*w - 1*rate(x)*abs(w) }
T = p^2/2; V = x^2/2; force x += u - w - 0.1*p";
    let mut made = shaken(truth, 1.0, 6, (500, 0.1));
    let level = vec![NoiseLevel::Absolute(1e-3); made.observables.len()];
    add_noise(&mut made, &level, 3).unwrap();
    let text = "coordinates x; momenta p; input u { spline }
T = p^2/2; V = span{ x^2 }; force x += u + span{ drag: -p }";
    let found = discovered(text, &made, &["x"]);
    assert_eq!(found.verdict, Verdict::NothingMissing, "{}", found.stop);
    let [step] = found.steps.as_slice() else { panic!("{:?}", found.steps) };
    assert_eq!(step.effect, "bouc_wen(x)", "{}", found.stop);
    // Stiffness of the memory, its loss and what differs with direction.
    for (value, expected) in step.coefficient.iter().zip([1.5, 2.0, 0.5]) {
        assert!((value - expected).abs() < 0.1 * expected, "{step:?}");
    }
    // The spec has it, and its model explains runs that it has not seen.
    assert!(found.text.contains("effect bouc_wen(x"), "{}", found.text);
    let (before, after) = found.held_out_error;
    assert!(before > 2.0 && after < 1.1, "{before} {after}");
}

#[test]
#[ignore = "long"]
fn a_mass_on_a_spring_is_named_where_free_motion_leaves_its_numbers_open() {
    let truth = "coordinates x, z; momenta p, p_z
T = p^2/2 + p_z^2/(2*0.4)
V = 0.5*x^2 + 0.3*(z - x)^2";
    for seed in 0..3 {
        let at =
            |run: usize, i: usize| (1.3 + 2.1 * run as f64 + 1.7 * i as f64 + seed as f64).sin();
        let start = |run: usize| (0..4).map(|i| at(run, i)).collect();
        let starts: Vec<Vec<f64>> = (0..8).map(start).collect();
        let mut made = simulated(truth, &starts, &even(300, 0.1));
        let level = vec![NoiseLevel::Relative(0.005); made.observables.len()];
        add_noise(&mut made, &level, seed).unwrap();
        let text = "coordinates x; momenta p\nT = p^2/2\nV = span{ x^2 }";
        let found = discovered(text, &made, &["x", "p"]);
        let [step] = found.steps.as_slice() else { panic!("seed {seed}: {}", found.stop) };
        assert_eq!(step.effect, "hidden_oscillator(x)", "seed {seed}: {}", found.stop);
        let (before, after) = found.held_out_error;
        assert!(before > 50.0 && after < 1.1, "seed {seed}: {before} {after}");
        // Two frequencies are seen; a stiffness, a mass and a frequency make them.
        assert!(step.standard_error.iter().all(|error| error.is_infinite()), "{step:?}");
    }
}
