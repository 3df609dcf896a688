//! Initial states that are settled, and led to where the next theta wants them.

use leverrier::internals::data::{Clock, Dataset, Run};
use leverrier::internals::dynamics::Dynamics;
use leverrier::internals::eval::Backend;
use leverrier::internals::expr::{Compiled, build};
use leverrier::internals::fit::pass::{Linearised, Problem, settle, settle_linearise_and_respond};
use leverrier::internals::fit::states::States;
use leverrier::internals::fit::train::Training;
use leverrier::internals::fit::{Options, Silent};

const SPACE: &str = "coordinates q\nmomenta p\nT = p^2/2\nV = span{ q^2, cos(q) }\n\
                     force q += span{ -p }\n";
const VELOCITIES: &str = "coordinates q\nvelocities v\nT = p_q^2/2\nV = span{ q^2, cos(q) }\n";

/// Swings with a bias in every third sample, so that no model fits.
fn swings(runs: usize, samples: usize, second: &str) -> Dataset {
    let run = |k: usize| {
        let phase = 0.9 * k as f64;
        let times: Vec<f64> = (0..samples).map(|i| 0.1 * i as f64).collect();
        let odd = |i: usize| if i.is_multiple_of(3) { 0.01 } else { -0.005 };
        let swing = |f: fn(f64) -> f64, size: f64| -> Vec<f64> {
            (times.iter().enumerate()).map(|(i, t)| size * f(t + phase) + odd(i)).collect()
        };
        let values = vec![swing(f64::sin, 0.7), swing(f64::cos, 0.7)];
        let lines = vec![0; samples];
        Run {
            name: k.to_string(),
            times,
            values,
            lines,
            clock: Clock::default(),
            inputs: Vec::new(),
            groups: Vec::new(),
            errors: Vec::new(),
        }
    };
    Dataset {
        inputs: Vec::new(),
        observables: vec!["q".to_string(), second.to_string()],
        runs: (0..runs).map(run).collect(),
    }
}

/// Does something with the problem of a space before some data, at a theta.
fn before<T>(
    space: &Compiled,
    data: &Dataset,
    then: impl FnOnce(&Problem, &Dynamics, &States) -> T,
) -> T {
    let options = Options { window: Some(40), ..Options::default() };
    let training = Training::new(&space.system, data, &options).expect("enough data");
    let dynamics = Dynamics::whole(&space.system, Backend::Batched);
    let weights = vec![100.0; 2];
    then(&training.problem(&weights), &dynamics, &training.states)
}

fn at(
    problem: &Problem,
    dynamics: &Dynamics,
    theta: &[f64],
    states: &mut States,
    nearly: bool,
) -> Linearised {
    settle_linearise_and_respond(problem, (dynamics, theta), states, None, nearly)
}

/// The largest difference of any two numbers.
fn apart(one: &States, other: &States) -> f64 {
    one.iter()
        .flatten()
        .zip(other.iter().flatten())
        .fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs()))
}

#[test]
fn states_are_led_to_where_the_next_theta_wants_them() {
    for (text, second, theta) in
        [(SPACE, "p", vec![0.5, 0.0, 0.0]), (VELOCITIES, "v", vec![0.5, 0.0])]
    {
        let space = build("swing", text).unwrap_or_else(|error| panic!("{error}"));
        let data = swings(9, 80, second);
        before(&space, &data, |problem, dynamics, starts| {
            let mut here = starts.clone();
            let linearised = at(problem, dynamics, &theta, &mut here, false);
            let responses = linearised.responses.expect("segments are long");
            // How far off the states are that are led by one and by half of a change of theta.
            let [whole, half] = [0.02, 0.01].map(|size| {
                let change: Vec<f64> =
                    (0..theta.len()).map(|k| size * (1.0 - 0.6 * k as f64)).collect();
                let next: Vec<f64> = theta.iter().zip(&change).map(|(x, d)| x + d).collect();
                let mut led = here.clone();
                responses.follow(&mut led, &change);
                let mut settled = here.clone();
                at(problem, dynamics, &next, &mut settled, false);
                assert!(apart(&settled, &here) > 10.0 * apart(&settled, &led), "{text}");
                apart(&settled, &led)
            });
            assert!(half < 0.3 * whole, "not of second order: {whole} and {half}");
        });
    }
}

#[test]
fn a_state_that_takes_its_time_ends_where_the_others_do() {
    let space = build("swing", SPACE).unwrap_or_else(|error| panic!("{error}"));
    let data = swings(9, 80, "p");
    before(&space, &data, |problem, dynamics, starts| {
        let theta = [0.4, -0.15, 0.05];
        let mut expected = starts.clone();
        let least = settle(problem, dynamics, &theta, &mut expected);
        assert_eq!(least.unsettled, 0);
        // From so far off a state overshoots, and is not there when all others are.
        for late in [0, 7, expected.len() - 1] {
            let mut states = expected.clone();
            states.of_mut(late).iter_mut().for_each(|x| *x += 2.5);
            let sums = settle(problem, dynamics, &theta, &mut states);
            assert_eq!(sums.unsettled, 0);
            assert!((sums.loss / least.loss - 1.0).abs() < 1e-6, "{} {}", sums.loss, least.loss);
            assert!(apart(&states, &expected) < 1e-5, "{late}");
        }
    });
}

#[test]
fn nearly_settled_states_leave_the_same_problem() {
    let space = build("swing", SPACE).unwrap_or_else(|error| panic!("{error}"));
    let data = swings(9, 80, "p");
    before(&space, &data, |problem, dynamics, starts| {
        let theta = [0.4, -0.15, 0.05];
        let mut exact_states = starts.clone();
        let exact = at(problem, dynamics, &theta, &mut exact_states, false);
        assert_eq!(exact.sums.promised, 0.0);
        // A little off: nearly settled, but not settled.
        let mut near = exact_states.clone();
        for (k, x) in near.all_mut().iter_mut().enumerate() {
            *x += if k % 2 == 0 { 2e-4 } else { -3e-4 };
        }
        let led = near.clone();
        let law = (dynamics, &theta[..]);
        let nearly = settle_linearise_and_respond(problem, law, &mut near, Some(&led), true);
        assert!(nearly.sums.promised > 0.0, "the states were settled: nothing is tested");
        assert!((nearly.sums.loss / exact.sums.loss - 1.0).abs() < 1e-6);
        let (one, other) = (exact.merged(), nearly.merged());
        let solved = |factor: &leverrier::internals::fit::factor::Factor| {
            factor.design().solve_upper_triangular(&factor.target()).expect("independent columns")
        };
        let (one, other) = (solved(&one), solved(&other));
        assert!((&one - &other).amax() < 1e-3 * one.amax(), "{one} {other}");
        // Their last step is known.
        nearly.responses.expect("segments are long").follow(&mut near, &[]);
        assert!(apart(&near, &exact_states) < 1e-6);
    });
}

#[test]
fn a_refit_ends_with_settled_states() {
    let space = build("swing", SPACE).unwrap_or_else(|error| panic!("{error}"));
    let data = swings(9, 80, "p");
    let options = Options { window: Some(40), ..Options::default() };
    let mut training = Training::new(&space.system, &data, &options).expect("enough data");
    let mut law = training.law().clone();
    for (id, value) in space.system.term_ids().into_iter().zip([0.3, -0.1, 0.0]) {
        law = law.with_term(id, value).expect("its own term");
    }
    training.start_from(&law);
    for promise in [1e-2, 1e-9] {
        let refit = training.refit_until(promise.into(), &Silent);
        assert_eq!(refit.sums().promised, 0.0);
        assert_eq!(refit.sums().unsettled, 0);
    }
}
