//! A few random inputs of every target: none ends in a panic, and all end in time.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use crate::mutated::input;
use crate::targets::TARGETS;

/// Nothing takes as long on any machine, however busy: 10 s are promised on a quiet one.
const HANGS: Duration = Duration::from_secs(120);

/// Tries the inputs of such numbers.
fn tried(name: &str, numbers: std::ops::Range<u64>) {
    let target = TARGETS.iter().find(|target| target.name == name).expect("a target");
    let seeds = (target.seeds)();
    assert!(!seeds.is_empty(), "{name} has no inputs to begin with");
    let mut wrong = Vec::new();
    let mut once = |what: String, bytes: &[u8]| {
        let begun = Instant::now();
        let panicked = catch_unwind(AssertUnwindSafe(|| (target.run)(bytes))).is_err();
        if panicked || begun.elapsed() > HANGS {
            wrong.push(format!("{what} in {:?}", begun.elapsed()));
        }
    };
    for (number, seed) in seeds.iter().enumerate() {
        once(format!("{name}, seed {number}"), seed);
    }
    for number in numbers {
        once(format!("{name}, input {number}"), &input(target, &seeds, number));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// As many as the environment asks for.
fn cases(usual: u64) -> u64 {
    let asked = std::env::var("LEVERRIER_CASES").ok();
    asked.and_then(|count| count.parse().ok()).unwrap_or(usual)
}

#[test]
fn specs() {
    tried("spec", 0..600);
}

/// Many more by `LEVERRIER_CASES=100000 cargo test --test reliability fuzz::grammar`.
#[test]
fn grammar() {
    tried("grammar", 0..cases(600));
}

#[test]
fn tables() {
    tried("text", 0..5000);
    tried("parquet", 0..3000);
    tried("files", 0..1000);
}

/// Many more as for specs.
#[test]
fn damaged_files_are_fitted_in_time() {
    tried("damaged", 0..cases(150));
}

#[test]
fn models_and_ledgers() {
    tried("model", 0..2000);
    tried("ledger", 0..300);
}

#[test]
fn requests_to_the_studio() {
    tried("request", 0..100);
}

#[test]
fn whole_runs() {
    tried("run", 8..30);
}

/// What was found once is not found again: inputs by the name of their target.
#[test]
fn finds_stay_mended() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/finds");
    // There is no such folder before the first of them.
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let target = TARGETS.iter().find(|target| name.starts_with(target.name));
        let target = target.unwrap_or_else(|| panic!("{name} begins with the name of a target"));
        let begun = Instant::now();
        (target.run)(&std::fs::read(entry.path()).expect("an input"));
        assert!(begun.elapsed() < HANGS, "{name}");
    }
}

/// Found by whole runs: where nothing is held out, comparing with that panicked.
#[test]
fn a_comparison_with_no_run_is_refused() {
    use leverrier::{Data, ErrorKind, Spec};
    let spec = Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2 }").expect("a spec");
    let times: Vec<f64> = (0..40).map(|at| 0.1 * f64::from(at)).collect();
    let (q, p): (Vec<f64>, Vec<f64>) = times.iter().map(|t| (t.cos(), -t.sin())).unzip();
    let data = Data::from_slices(&spec, &times, &[&q, &p]).expect("measurements");
    let (training, held_out) = data.split(0.0, 0).expect("a split");
    let law = spec.fit(&training).expect("a law");
    assert_eq!(held_out.runs(), 0);
    let error = law.compare(&held_out).expect_err("nothing to compare with");
    assert_eq!(error.kind(), ErrorKind::InsufficientData);
    assert!(law.compare(&training).is_ok());
}

/// Found by random specs: a velocity too many, with its unit, panicked where it has no coordinate.
#[test]
fn a_velocity_too_many_is_an_error_of_the_spec() {
    let text = "coordinates q [m]\nvelocities a [m/s], b [m/s]\ntime t [s]\n\
                T = p_q^2/2\nV = span{ q^2 }\n";
    let error = leverrier::Spec::parse(text).expect_err("one velocity too many");
    assert_eq!(error.kind(), leverrier::ErrorKind::Spec);
}
