//! What the fit must recover: the four systems of the paper, with the defaults everywhere.

use crate::paper::bound::{self, PlainLaw};
use crate::paper::figures::{
    best_quintic, bytes, deviations, energy_stray, first_samples, fresh_starts, halves,
    largest_error, largest_in_standard_errors, one_step, pendulum_error, predict, printed,
    simplified, support,
};
use crate::paper::{
    PendulumSpace, SIGMA, STEP, coupled, coupled_clean, coupled_noisy, henon_heiles,
    henon_heiles_pairs, learn, learn_with, mass_spring, mass_spring_pairs, pairs, pendulum,
    pendulum_pairs, pendulum_space, tensor,
};
use std::sync::Arc;

use leverrier::internals::dynamics::Method;
use leverrier::internals::expr::System;
use leverrier::internals::fit::Options;

fn short(numbers: &[f64]) -> String {
    numbers.iter().map(|x| format!("{x:.1e}")).collect::<Vec<_>>().join(" ")
}

#[test]
fn henon_heiles_clean() {
    let data = henon_heiles_pairs(5_000, 0.0, 1);
    for degree in [3, 6, 10] {
        let model = learn(&tensor(degree), &data);
        let error = largest_error(&henon_heiles(), &model);
        println!("degree {degree}: largest error {error:.1e}");
        assert!(error < 1e-8, "degree {degree}: {error}");
    }
}

#[test]
fn henon_heiles_noisy_has_the_exact_support_at_every_degree() {
    for degree in [3, 6, 10] {
        let data = henon_heiles_pairs(5_000, SIGMA, 40 + u64::from(degree));
        let model = learn(&tensor(degree), &data);
        let (error, sigmas) = (
            largest_error(&henon_heiles(), &model),
            largest_in_standard_errors(&henon_heiles(), &model),
        );
        println!("degree {degree}: {error:.1e}, {sigmas:.2} standard errors");
        assert!(sigmas < 3.0, "degree {degree}: {sigmas} standard errors");
        for noise in &model.noise {
            let ratio = noise.standard_deviation / SIGMA;
            assert!((ratio - 1.0).abs() < 0.05, "noise of {}: {ratio}", noise.observable);
        }
    }
}

#[test]
fn henon_heiles_noisy_reaches_the_cramer_rao_bound() {
    let space = tensor(3);
    let law = henon_heiles();
    let plain = bound::henon_heiles();
    let (mut squares, mut covered, mut count) = (0.0, 0, 0);
    for seed in 0..50 {
        let clean = first_samples(&henon_heiles_pairs(5_000, 0.0, seed));
        let covariance = plain.covariance(&clean, 2, SIGMA);
        let model = learn(&space, &henon_heiles_pairs(5_000, SIGMA, seed));
        let found =
            deviations(&law, &model).unwrap_or_else(|| panic!("seed {seed}: {}", support(&model)));
        for (k, (error, width)) in found.into_iter().enumerate() {
            squares += error * error / covariance[(k, k)];
            covered += usize::from(error.abs() < 1.959964 * width);
            count += 1;
        }
    }
    let ratio = squares / f64::from(count);
    let coverage = covered as f64 / f64::from(count);
    println!("mean squared error {ratio:.3} of the bound, {:.1} % covered", 100.0 * coverage);
    assert!(ratio < 1.2, "{ratio} times the bound");
    assert!((0.90..=0.99).contains(&coverage), "95 % intervals cover {coverage}");
}

#[test]
fn coupled_clean_predicts_to_rounding() {
    let (space, law, data) = (tensor(3), coupled(), coupled_clean(1));
    let model = learn(&space, &data);
    let error = largest_error(&law, &model);
    let ahead = one_step(&law, &space, &model, &fresh_starts(&law, 200, 77));
    println!("largest error {error:.1e}, one step {}", short(&ahead));
    assert!(error < 1e-8, "{error}");
    assert!(ahead.iter().all(|e| *e < 1e-10), "{ahead:?}");
}

/// Errors one step ahead after training on noisy runs, and what the bound allows.
fn coupled_errors(degree: u32, seeds: std::ops::Range<u64>) -> ((f64, f64), (f64, f64)) {
    let (space, law, plain): (Arc<System>, _, PlainLaw) =
        (tensor(degree), coupled(), bound::coupled());
    let starts = fresh_starts(&law, 200, 991);
    let (mut ours, mut allowed) = (vec![0.0; 4], vec![0.0; 4]);
    let count = seeds.clone().count() as f64;
    for seed in seeds {
        let clean = first_samples(&coupled_noisy(0.0, seed));
        let covariance = plain.covariance(&clean, 4, SIGMA);
        let model = learn(&space, &coupled_noisy(SIGMA, seed));
        assert!(deviations(&law, &model).is_some(), "seed {seed}: {}", support(&model));
        let add = |sum: &mut Vec<f64>, part: Vec<f64>| {
            sum.iter_mut().zip(part).for_each(|(s, p)| *s += p / count);
        };
        add(&mut ours, one_step(&law, &space, &model, &starts));
        add(&mut allowed, plain.one_step(&starts, &covariance));
    }
    (halves(&ours), halves(&allowed))
}

#[test]
fn coupled_noisy_predicts_as_well_as_the_bound_allows() {
    let ((q, p), (bound_q, bound_p)) = coupled_errors(3, 0..20);
    println!("q {q:.2e} (bound {bound_q:.2e}), p {p:.2e} (bound {bound_p:.2e})");
    assert!(q < 1.2 * bound_q, "q: {q} where the bound allows {bound_q}");
    assert!(p < 1.2 * bound_p, "p: {p} where the bound allows {bound_p}");
}

#[test]
fn coupled_noisy_has_the_exact_support_in_large_spaces() {
    for (degree, seeds) in [(6, 100..103), (10, 200..202)] {
        let ((q, p), (bound_q, bound_p)) = coupled_errors(degree, seeds);
        println!("degree {degree}: q {q:.2e} ({bound_q:.2e}), p {p:.2e} ({bound_p:.2e})");
        assert!(q < 2.5 * bound_q && p < 2.5 * bound_p, "degree {degree}: {q}, {p}");
    }
}

#[test]
fn mass_spring_clean_prints_springs() {
    let law = mass_spring(1);
    let data = mass_spring_pairs(&law, 0.0, 1);
    for degree in [2, 4] {
        let space = pairs(degree);
        let model = learn(&space, &data);
        let error = largest_error(&law, &model);
        let text = printed(&space, &model, &data);
        println!("degree {degree}: largest error {error:.1e}\n{text}");
        assert!(error < 1e-6, "degree {degree}: {error}");
        for (i, j) in [(1, 2), (2, 3), (3, 4), (4, 5)] {
            let springs = [format!("(q[{i}] - q[{j}])^2"), format!("(q[{j}] - q[{i}])^2")];
            assert!(springs.iter().any(|s| text.contains(s)), "no spring {i}-{j} in {text}");
        }
    }
}

#[test]
fn mass_spring_noisy_predicts_no_worse_in_large_spaces() {
    let law = mass_spring(1);
    let data = mass_spring_pairs(&law, SIGMA, 1);
    let starts = first_samples(&mass_spring_pairs(&law, 0.0, 1));
    let mut small = None;
    for degree in [2, 4, 6] {
        let space = pairs(degree);
        let model = learn(&space, &data);
        let ahead = halves(&one_step(&law, &space, &model, &starts));
        let named = model.alternatives.len() + model.runners_up.len();
        println!("degree {degree}: {}, {named} alternatives named", short(&[ahead.0, ahead.1]));
        if degree == 2 {
            let sigmas = largest_in_standard_errors(&law, &model);
            assert!(sigmas < 3.5, "{sigmas} standard errors");
            small = Some(ahead);
        }
        let (q, p) = small.expect("degree 2 comes first");
        assert!(ahead.0 <= 1.01 * q && ahead.1 <= 1.01 * p, "degree {degree}: {ahead:?}");
        let exact = deviations(&law, &model).is_some();
        assert!(exact || named > 0, "neither exact nor said to be unsure: {}", support(&model));
    }
}

#[test]
fn pendulum_sine_is_printed_as_a_cosine() {
    let (space, data) = (pendulum_space(&PendulumSpace::Sine), pendulum_pairs());
    let model = learn(&space, &data);
    let error = pendulum_error(&model).unwrap_or_else(|| panic!("{}", support(&model)));
    let text = printed(&space, &model, &data);
    println!("largest error {error:.1e}\n{text}");
    assert!(error < 1e-8, "{error}");
    assert!(text.contains("- 2 cos(q)"), "{text}");
}

#[test]
fn pendulum_mixed_finds_the_true_potential() {
    let (space, data) = (pendulum_space(&PendulumSpace::Mixed), pendulum_pairs());
    let model = learn(&space, &data);
    let error = pendulum_error(&model).unwrap_or_else(|| panic!("{}", support(&model)));
    println!("largest error {error:.1e}");
    assert!(error < 1e-8, "{error}");
}

#[test]
fn pendulum_polynomial_is_recognised() {
    let (space, data) = (pendulum_space(&PendulumSpace::Polynomial), pendulum_pairs());
    let model = learn(&space, &data);
    let ahead = one_step(&pendulum(), &space, &model, &first_samples(&data));
    let best = best_quintic(&data);
    let said: Vec<String> =
        simplified(&space, &model, &data).parts.into_iter().flat_map(|part| part.shape).collect();
    println!("{}\none step {} (best p {best:.2e}); {said:?}", support(&model), short(&ahead));
    // The force of a quintic potential is a quartic; on this swing none comes closer to the
    // sine than 3e-4 a step, so the paper's 7e-5 is out of any quintic's reach for p.
    assert!(ahead[0] <= 7e-5, "q: {ahead:?}");
    assert!(ahead[1] <= 1.02 * best, "p: {} where a quintic can reach {best}", ahead[1]);
    assert!(said.iter().any(|s| s.contains("Taylor") && s.contains("cos")), "{said:?}");
}

#[test]
fn henon_heiles_trained_on_noise_is_followed_to_the_end() {
    let (space, law) = (tensor(3), henon_heiles());
    let model = learn(&space, &henon_heiles_pairs(5_000, SIGMA, 1));
    let times: Vec<f64> = (0..=80).map(|i| STEP * f64::from(i)).collect();
    let both = predict(&law, &space, &model, &[vec![-0.48, -0.02, -0.08, 0.18]], &times);
    let far = both.truth[0].iter().zip(&both.learned[0]);
    let far = far.flat_map(|(a, b)| a.iter().zip(b).map(|(x, y)| (x - y).abs()));
    let far = far.fold(0.0, f64::max);
    let energy = both.learned_energy[0].iter().zip(&both.true_energy[0]);
    let energy = energy.map(|(a, b)| ((a - b) / b).abs()).fold(0.0, f64::max);
    println!("largest error {far:.1e}, energy astray by {:.2} %", 100.0 * energy);
    assert!(far < 0.02, "{far}");
    assert!(energy < 0.02, "{energy}");
}

#[test]
fn models_are_small() {
    let model = learn(&tensor(3), &henon_heiles_pairs(500, 0.0, 1));
    let (file, needed) = bytes(&model);
    println!("{} learned, {needed} bytes, model file {file} bytes", model.evidence.learned);
    assert_eq!(model.evidence.learned, 6);
    assert!(needed < 100);
}

/// What integrator the fit is made with, one step for each transition, both of order 4.
fn ablation(name: &str) -> (f64, f64) {
    let (space, law) = (tensor(3), henon_heiles());
    let method = Method::by_name(name).expect("a row of METHODS");
    let options = Options { method: Some(method), longest_step: Some(STEP), ..Options::default() };
    let model = learn_with(&space, &henon_heiles_pairs(5_000, 0.0, 1), &options);
    // Terms that a wrong integrator asks for are errors, too.
    let mut error: f64 = 0.0;
    for term in &model.terms {
        let known = law.terms.iter().find(|(p, t, _)| *p == term.place && *t == term.term);
        error = error.max((term.coefficient - known.map_or(0.0, |(_, _, value)| *value)).abs());
    }
    let stray = energy_stray(&law, &space, &model, method, &[0.0, 0.1, 0.4, 0.2], 10_000.0);
    (error, stray)
}

#[test]
fn a_symplectic_integrator_keeps_the_energy_where_rk4_does_not() {
    let (rk4, rk4_stray) = ablation("rk4");
    let (symplectic, stray) = ablation("forest-ruth");
    println!("coefficients: rk4 {rk4:.1e}, forest-ruth {symplectic:.1e}");
    println!("energy astray at t = 10,000: rk4 {rk4_stray:.1e}, forest-ruth {stray:.1e}");
    assert!(rk4 < 1e-3 && symplectic < 1e-3);
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let data = henon_heiles_pairs(2_000, SIGMA, 3);
    let space = tensor(3);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        serde_json::to_vec(&pool.install(|| learn(&space, &data))).expect("plain data")
    };
    let one = with(1);
    assert_eq!(one, with(2), "models of one and of two threads differ");
    assert_eq!(one, with(1), "two fits of the same data differ");
}

/// Orbits that the classical Runge-Kutta method makes, four steps between samples: what it errs by
/// is 1e-9 to 1e-6 of the orbit, no noise, and looks like forces.
#[test]
fn errors_of_an_integrator_are_no_terms() {
    let slope = |z: [f64; 4]| {
        let [x, y, u, v] = z;
        [u, v, -x - 2.0 * x * y, -y - x * x + y * y]
    };
    let along = |z: [f64; 4], d: [f64; 4], h: f64| std::array::from_fn(|i| z[i] + h * d[i]);
    let step = |z: [f64; 4], h: f64| {
        let a = slope(z);
        let b = slope(along(z, a, h / 2.0));
        let c = slope(along(z, b, h / 2.0));
        let d = slope(along(z, c, h));
        std::array::from_fn(|i| z[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
    };
    for interval in [0.05, 0.1, 0.3] {
        let mut data = henon_heiles_pairs(8, 0.0, 3);
        for run in &mut data.runs {
            let mut z: [f64; 4] = std::array::from_fn(|i| run.values[i][0]);
            run.times = (0..200).map(|k| interval * f64::from(k)).collect();
            run.lines = vec![1; 200];
            run.values = vec![Vec::new(); 4];
            for _ in 0..200 {
                run.values.iter_mut().zip(z).for_each(|(column, x)| column.push(x));
                z = (0..4).fold(z, |z, _| step(z, interval / 4.0));
            }
        }
        let model = learn(&tensor(3), &data);
        let error = largest_error(&henon_heiles(), &model);
        println!("every {interval}: {error:.1e}, noise {:.1e}", model.noise[0].standard_deviation);
        assert!(error < 1e-5, "every {interval}: {error}");
    }
}
