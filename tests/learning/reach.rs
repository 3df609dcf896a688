//! Numbers of laws that lack something, and what is said of them first.

use leverrier::internals::data::Dataset;
use leverrier::internals::expr::build;
use leverrier::internals::fit::{
    Model, Options, Silent, Warning, fit, fit_as_far_as_it_tells as reached,
};
use leverrier::internals::simulate::{NoiseLevel, Simulator, add_noise};

/// Runs of a law from some states, with noise of a standard deviation on what is observed.
fn runs(truth: &str, starts: &[[f64; 2]], samples: usize, noise: f64) -> Dataset {
    let compiled = build("truth", truth).unwrap_or_else(|error| panic!("{error}"));
    let system = &compiled.system;
    let times: Vec<f64> = (0..samples).map(|i| 0.05 * i as f64).collect();
    let starts: Vec<Vec<f64>> = starts.iter().map(|start| start.to_vec()).collect();
    let made = Simulator::known(system).trajectories(&starts, &times).unwrap();
    let mut data = made.dataset(system);
    let level = NoiseLevel::Absolute(noise);
    add_noise(&mut data, &[level, level], 3).unwrap();
    data
}

/// What `fit` makes of a spec, and what is made of it where its numbers count.
fn both(space: &str, data: &Dataset) -> (Model, Model) {
    let system = build("space", space).unwrap_or_else(|error| panic!("{error}")).system;
    let options = Options::default();
    let plain = fit(&system, data, &options, &Silent).unwrap();
    (plain, reached(&system, data, &options, &Silent).unwrap())
}

/// A coefficient by its term, and its standard error.
fn of(model: &Model, term: &str) -> (f64, f64) {
    let found = model.terms.iter().find(|found| found.term == term);
    let found = found.unwrap_or_else(|| panic!("no {term} in {:?}", model.terms));
    (found.coefficient, found.standard_error)
}

const PENDULUM: &str = "coordinates q; momenta p; time t\nT = p^2/2\n";

#[test]
fn a_law_that_follows_its_data_keeps_its_model() {
    let truth = format!("{PENDULUM}V = -9*cos(q)\nforce q += -0.1*p");
    let space = format!("{PENDULUM}V = span{{ cos(q), q^2 }}\nforce q += span{{ -p, -sign(p) }}");
    let data = runs(&truth, &[[1.0, 0.0], [0.3, 1.0]], 200, 1e-3);
    let (plain, reached) = both(&space, &data);
    assert_eq!(plain, reached);
}

#[test]
fn what_a_law_lacks_does_not_go_into_its_numbers() {
    // A drive that nobody thinks of, some hundred times the noise.
    let truth =
        format!("{PENDULUM}V = -9*cos(q)\nforce q += -0.1*p + 0.2*cos(4.3*t) - 0.1*sign(p)");
    let space = format!("{PENDULUM}V = span{{ cos(q) }}\nforce q += span{{ -p }}");
    let data = runs(&truth, &[[1.2, 0.0], [0.8, 1.0], [1.0, -1.0]], 256, 1e-4);
    let (plain, reached) = both(&space, &data);
    assert!(reached.evidence.window > plain.evidence.window, "{:?}", reached.evidence);
    let (weight, error) = of(&reached, "cos(q)");
    assert!((weight + 9.0).abs() < 3.0 * error, "{weight} +- {error}");
    assert!(error < 0.5, "{error}");
    let brief = |warning: &Warning| matches!(warning, Warning::FollowsBriefly { .. });
    assert!(reached.warnings.iter().any(brief), "{:?}", reached.warnings);
}

#[test]
fn longer_segments_bring_terms_that_shorter_ones_cannot_tell() {
    // Positions alone, of a precise camera that shakes: the law follows four samples within the
    // noise, which tell no drag.
    let truth = format!("{PENDULUM}V = -1.44*cos(q)\nforce q += -0.03*p*abs(p)");
    let space = format!("{PENDULUM}V = span{{ cos(q) }}\nforce q += span{{ -p*abs(p), -p }}");
    let mut data = runs(&truth, &[[1.2, 0.0], [0.8, 0.4]], 800, 3e-4);
    for (run, phase) in data.runs.iter_mut().zip([0.0, 1.0]) {
        for (t, q) in run.times.iter().zip(&mut run.values[0]) {
            *q += 0.01 * (8.0 * t + phase).sin();
        }
        run.values[1].fill(f64::NAN);
    }
    let (plain, reached) = both(&space, &data);
    assert!(plain.terms.iter().all(|found| found.term == "cos(q)"), "{:?}", plain.terms);
    let (drag, error) = of(&reached, "-p*abs(p)");
    assert!((drag - 0.03).abs() < 4.0 * error && error < 3e-3, "{drag} +- {error}");
}

#[test]
fn a_window_that_is_asked_for_is_kept() {
    let truth = format!("{PENDULUM}V = -9*cos(q)\nforce q += -0.1*p + 0.2*cos(4.3*t)");
    let space = format!("{PENDULUM}V = span{{ cos(q) }}\nforce q += span{{ -p }}");
    let data = runs(&truth, &[[1.2, 0.0]], 256, 1e-4);
    let system = build("space", &space).unwrap().system;
    for window in [2, 7, 100, 256, 1000] {
        let options = Options { window: Some(window), ..Options::default() };
        let model = reached(&system, &data, &options, &Silent).unwrap();
        assert_eq!(model.evidence.window, window.min(256));
        if window >= 100 {
            assert!((of(&model, "cos(q)").0 + 9.0).abs() < 1.0, "{window}: {:?}", model.terms);
        }
    }
}

#[test]
fn numbers_without_a_meaning_are_said() {
    let truth = format!("{PENDULUM}V = -9*cos(q)\nforce q += 0.1*p");
    let space = "coordinates q; momenta p; time t\nparam J = 2 in 1.5 .. 4\n\
                 T = p^2/(2*J)\nV = span{ cos(q) }\nforce q += span{ -p }";
    let data = runs(&truth, &[[1.0, 0.0], [0.3, 1.0]], 100, 1e-3);
    let warnings = both(space, &data).1.warnings;
    let at_bound = |w: &Warning| matches!(w, Warning::AtBound { name, .. } if name == "J");
    assert!(warnings.iter().any(at_bound), "{warnings:?}");
    let feeds = |w: &Warning| matches!(w, Warning::FeedsEnergy { term, .. } if term == "-p");
    let space = format!("{PENDULUM}V = span{{ cos(q) }}\nforce q += span{{ -p }}");
    let warnings = both(&space, &data).1.warnings;
    assert!(warnings.iter().any(feeds), "{warnings:?}");
}

#[test]
fn a_motion_that_sustains_itself_is_not_warned_of() {
    let truth = format!("{PENDULUM}V = q^2/2\nforce q += 0.4*p - 0.4*q^2*p");
    let space = format!("{PENDULUM}V = span{{ q^2 }}\nforce q += span{{ p, -q^2*p }}");
    let data = runs(&truth, &[[2.0, 0.0], [0.5, 0.5]], 300, 3e-3);
    let model = both(&space, &data).1;
    assert!(of(&model, "p").0 > 0.3, "{:?}", model.terms);
    let feeds = |w: &Warning| matches!(w, Warning::FeedsEnergy { .. });
    assert!(!model.warnings.iter().any(feeds), "{:?}", model.warnings);
}

#[test]
fn a_negative_mass_is_said() {
    let truth = "coordinates q; momenta p\nT = -p^2/2\nV = 4.5*q^2";
    let space = "coordinates q; momenta p\nT = span{ p^2 }\nV = 4.5*q^2";
    let data = runs(truth, &[[0.1, 0.0], [0.0, 0.1]], 40, 1e-4);
    let warnings = both(space, &data).1.warnings;
    let negative = Warning::NegativeMass { coordinate: "q".to_string() };
    assert!(warnings.contains(&negative), "{warnings:?}");
}

#[test]
fn one_run_that_differs_is_said() {
    let truth = format!("{PENDULUM}V = -9*cos(q)");
    let space = format!("{PENDULUM}V = span{{ cos(q) }}");
    let mut data = runs(&truth, &[[1.0, 0.0], [0.3, 1.0], [0.7, 0.0], [0.1, 2.0]], 100, 1e-3);
    for (at, x) in data.runs[2].values.iter_mut().flatten().enumerate() {
        *x += if at % 2 == 0 { 8e-3 } else { -8e-3 };
    }
    let warnings = both(&space, &data).1.warnings;
    let one = |w: &Warning| matches!(w, Warning::OneRun { run, .. } if *run == data.runs[2].name);
    assert!(warnings.iter().any(one), "{warnings:?}");
}
