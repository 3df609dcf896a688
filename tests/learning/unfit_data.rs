//! What a fit makes of data and spaces that it cannot do justice to: a model that is finite, or a
//! reason.

use leverrier::internals::data::{Clock, Dataset, Run};
use leverrier::internals::fit::{Options, Silent, fit};

use super::trainer::{
    DUFFING, HENON_HEILES, HENON_HEILES_TRUTH, PENDULUM, PENDULUM_SPACE, assert_sound,
    assert_within, even, learn, measure, noisy, spec, spiral,
};

#[test]
fn models_that_diverge_end_finite_or_with_a_reason() {
    // Data far outside what the model can follow: a cubic force with the wrong sign.
    let data = measure(DUFFING, &spiral(10, 1, 60.0), &even(12, 0.3));
    for space in [
        "coordinates q\nmomenta p\nT = p^2/2\nV = -3*q^4 + span{ q^2 }\n",
        "coordinates q\nmomenta p\nT = p^2/2\nV = span{ exp(q), exp(-q), q^2 }\n",
        "coordinates q\nmomenta p\nT = p^2/2 + exp(p^2)\nV = span{ q^2, q^9 }\n",
        "coordinates q\nmomenta p\nparam a = 3\nT = p^2/2\nV = span{ exp(a*q) }\n",
        "coordinates q\nmomenta p\nH = q^2*p^4 + span{ q^4*p^2, q^2 }\n",
        "coordinates q\nmomenta p\nT = p^2/2\nV = span{ log(q), sqrt(q), 1/q }\n",
    ] {
        match fit(&spec(space).system, &data, &Options::default(), &Silent) {
            Ok(model) => assert_sound(&model),
            Err(error) => assert!(error.to_string().len() > 20, "{error}"),
        }
    }
}

#[test]
fn columns_without_information() {
    let mut data = noisy(measure(HENON_HEILES, &spiral(40, 2, 0.35), &even(12, 0.1)), 1e-3, 2);
    let space = "coordinates q[1..2]\nmomenta p[1..2]\n\
                 T = (p[1]^2 + p[2]^2)/2\nV = span{ poly(q; 3) }\n";
    // A momentum that was never measured.
    data.runs.iter_mut().for_each(|run| run.values[3].fill(f64::NAN));
    let model = learn(space, &data, &Options::default());
    assert_within(&model, &HENON_HEILES_TRUTH[2..], 4.0);
    // A coordinate that never moved: a finite answer.
    data.runs.iter_mut().for_each(|run| run.values[1].fill(0.25));
    match fit(&spec(space).system, &data, &Options::default(), &Silent) {
        Ok(model) => assert_sound(&model),
        Err(error) => assert!(error.to_string().len() > 20, "{error}"),
    }
    // Nothing at all.
    data.runs.iter_mut().for_each(|run| run.values.iter_mut().for_each(|c| c.fill(f64::NAN)));
    let error = fit(&spec(space).system, &data, &Options::default(), &Silent)
        .expect_err("nothing was measured");
    assert!(error.to_string().contains("measured"), "{error}");
}

#[test]
fn next_to_no_data() {
    let pair = measure(PENDULUM, &[vec![1.0, 0.3]], &even(2, 0.1));
    let empty =
        Dataset { observables: pair.observables.clone(), runs: Vec::new(), inputs: Vec::new() };
    let single = Dataset {
        inputs: Vec::new(),
        runs: vec![Run {
            name: "1".into(),
            times: vec![0.0],
            values: vec![vec![1.0]; 2],
            lines: vec![0],
            clock: Clock::default(),
            inputs: Vec::new(),
            groups: Vec::new(),
            errors: Vec::new(),
        }],
        ..empty.clone()
    };
    for data in [&empty, &single] {
        let error = fit(&spec(PENDULUM_SPACE).system, data, &Options::default(), &Silent)
            .expect_err("there is no motion in it");
        assert!(error.to_string().len() > 20, "{error}");
    }
    // Two samples are two residuals: eight terms cannot be told apart.
    for sparse in [true, false] {
        let options = Options { sparse, ..Options::default() };
        match fit(&spec(PENDULUM_SPACE).system, &pair, &options, &Silent) {
            Ok(model) => {
                assert_sound(&model);
                let said = model.unlearnable.iter().any(|s| s.contains("residuals"));
                assert!(said, "{:?}", model.unlearnable);
                assert!(!sparse || model.terms.len() <= 2);
            }
            Err(error) => assert!(error.to_string().len() > 20, "{error}"),
        }
    }
}
