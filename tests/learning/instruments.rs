//! Noise as instruments make it: correlated from sample to sample, and rounded.

use leverrier::internals::diagnose::diagnosis::Verdict;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use crate::diagnosis::{Case, PENDULUM, TRAP, read_by};

/// Noise of 1 % of the spread, each deviation `memory` times the one before it.
fn correlated(memory: f64) -> impl Fn(&mut [f64], f64, &mut Pcg64) {
    move |run, spread, generator| {
        let fresh = (1.0 - memory * memory).sqrt();
        let mut last: f64 = StandardNormal.sample(generator);
        for x in run {
            *x += 0.01 * spread * last;
            let draw: f64 = StandardNormal.sample(generator);
            last = memory * last + fresh * draw;
        }
    }
}

/// Readings in steps of a part of the spread.
fn rounded(part: f64) -> impl Fn(&mut [f64], f64, &mut Pcg64) {
    move |run, spread, _| {
        let step = part * spread;
        run.iter_mut().for_each(|x| *x = (*x / step).round() * step);
    }
}

fn names(case: &Case) -> (Verdict, Vec<String>, String) {
    let found = case.diagnosis();
    (found.verdict, found.story.into_iter().map(|one| one.effect).collect(), found.reason)
}

#[test]
fn correlated_noise_is_nothing_missing_and_hides_no_effect() {
    let drag = "force q += -0.05*p";
    let mut within = 0;
    for seed in 0..4 {
        for memory in [0.5, 0.8] {
            let case = read_by(&PENDULUM, "", seed, correlated(memory));
            let found = case.diagnosis();
            let (verdict, reason) = (found.verdict, found.reason);
            assert_eq!(verdict, Verdict::NothingMissing, "{seed} {memory} {reason}");
            let case = read_by(&PENDULUM, drag, seed, correlated(memory));
            let found = case.diagnosis();
            let story: Vec<&str> = found.story.iter().map(|one| one.effect.as_str()).collect();
            assert_eq!(story, ["viscous_drag(q)"], "{seed} {memory} {}", found.reason);
            let (value, error) = (found.story[0].coefficient[0], found.story[0].standard_error[0]);
            assert!((value - 0.05).abs() < 4.5 * error, "{seed} {memory}: {value} {error}");
            within += usize::from((value - 0.05).abs() < 2.0 * error);
        }
    }
    // Errors of correlated noise that took each sample for a fact of its own were 1.7 and 3 times
    // too small: of eight values one or two would be within two of them.
    assert!(within >= 6, "{within} of 8 within two standard errors");
}

#[test]
fn what_rounding_alone_explains_is_not_named_and_what_is_there_is() {
    for part in [0.1, 0.3] {
        for base in [&PENDULUM, &TRAP] {
            let (verdict, story, reason) = names(&read_by(base, "", 0, rounded(part)));
            assert_eq!(verdict, Verdict::NothingMissing, "{part} {story:?} {reason}");
        }
        let case = read_by(&PENDULUM, "force q += -0.05*p", 0, rounded(part));
        assert_eq!(names(&case).1, ["viscous_drag(q)"], "{part}");
    }
}
