//! The trainer on what real measurements are like: gaps, irregular clocks, missing cells,
//! outliers, velocities, awkward units, and function spaces that the data cannot settle.

use std::sync::atomic::{AtomicUsize, Ordering};

use leverrier::internals::data::Dataset;
use leverrier::internals::expr::{Compiled, build};
use leverrier::internals::fit::{
    Loss, Model, Monitor, Options, Selection, Silent, StopReason, Trainer, first_order, fit,
};
use leverrier::internals::simulate::{NoiseLevel, Simulator, add_noise, consecutive_pairs};

pub(super) const PENDULUM: &str = "coordinates q\nmomenta p\nT = p^2/2\nV = -1.3*cos(q)\n";
pub(super) const PENDULUM_SPACE: &str =
    "coordinates q\nmomenta p\nT = span{ poly(p; 3) }\nV = span{ poly(q; 3), cos(q), sin(q) }\n";
pub(super) const DUFFING: &str = "coordinates q\nmomenta p\nT = p^2/2\nV = q^2/2 + 0.3*q^4\n";
const DUFFING_SPACE: &str =
    "coordinates q\nmomenta p\nT = span{ poly(p; 4) }\nV = span{ poly(q; 6) }\n";

pub(super) fn spec(text: &str) -> Compiled {
    build("trainer", text).unwrap_or_else(|error| panic!("{error}"))
}

/// What an instrument without noise measures of a known law.
pub(super) fn measure(law: &str, starts: &[Vec<f64>], times: &[f64]) -> Dataset {
    let law = spec(law);
    Simulator::known(&law.system)
        .trajectories(starts, times)
        .unwrap_or_else(|error| panic!("{error}"))
        .dataset(&law.system)
}

pub(super) fn even(count: usize, step: f64) -> Vec<f64> {
    (0..count).map(|i| i as f64 * step).collect()
}

/// Starts on a spiral, so that many amplitudes are met.
pub(super) fn spiral(count: usize, degrees: usize, reach: f64) -> Vec<Vec<f64>> {
    (0..count)
        .map(|i| {
            let radius = reach * ((i + 1) as f64 / count as f64).sqrt();
            (0..2 * degrees).map(|c| radius * (2.4 * i as f64 + 1.7 * c as f64).sin()).collect()
        })
        .collect()
}

pub(super) fn noisy(mut data: Dataset, sigma: f64, seed: u64) -> Dataset {
    let noise = vec![NoiseLevel::Absolute(sigma); data.observables.len()];
    add_noise(&mut data, &noise, seed).expect("a positive sigma");
    data
}

pub(super) fn learn(space: &str, data: &Dataset, options: &Options) -> Model {
    let model =
        fit(&spec(space).system, data, options, &Silent).unwrap_or_else(|error| panic!("{error}"));
    assert_sound(&model);
    model
}

pub(super) fn assert_sound(model: &Model) {
    for term in &model.terms {
        assert!(term.coefficient.is_finite(), "{term:?}");
        assert!(term.standard_error >= 0.0, "{term:?}");
        assert!(term.inclusion.is_none_or(|part| (0.0..=1.0).contains(&part)), "{term:?}");
    }
    assert!(model.parameters.iter().all(|p| p.value.is_finite()));
    assert!(model.noise.iter().all(|n| n.standard_deviation.is_finite()));
}

/// "V q^2" for each term of the model.
fn support(model: &Model) -> Vec<String> {
    let mut names: Vec<String> =
        model.terms.iter().map(|t| format!("{} {}", t.place, t.term)).collect();
    names.sort();
    names
}

fn coefficient(model: &Model, name: &str) -> f64 {
    let named = |t: &&leverrier::internals::fit::model::LearnedTerm| {
        format!("{} {}", t.place, t.term) == name
    };
    model.terms.iter().find(named).map_or(0.0, |t| t.coefficient)
}

#[track_caller]
fn assert_recovers(model: &Model, truth: &[(&str, f64)], tolerance: f64) {
    let mut names: Vec<&str> = truth.iter().map(|(name, _)| *name).collect();
    names.sort_unstable();
    assert_eq!(support(model), names, "{:#?}", model.terms);
    for &(name, value) in truth {
        let found = coefficient(model, name);
        assert!((found - value).abs() <= tolerance, "{name}: {found} for {value}");
    }
}

/// Within so many standard errors, each.
#[track_caller]
pub(super) fn assert_within(model: &Model, truth: &[(&str, f64)], errors: f64) {
    assert_recovers(model, truth, f64::INFINITY);
    for term in &model.terms {
        let name = format!("{} {}", term.place, term.term);
        let value = truth.iter().find(|(n, _)| *n == name).map_or(0.0, |t| t.1);
        let distance = (term.coefficient - value).abs() / term.standard_error;
        assert!(distance < errors, "{name}: {distance} standard errors");
    }
}

const PENDULUM_TRUTH: [(&str, f64); 2] = [("T p^2", 0.5), ("V cos(q)", -1.3)];
const DUFFING_TRUTH: [(&str, f64); 3] = [("T p^2", 0.5), ("V q^2", 0.5), ("V q^4", 0.3)];

#[test]
fn the_result_is_the_same_bit_for_bit_whatever_the_threads() {
    let data = noisy(measure(DUFFING, &spiral(9, 1, 1.5), &even(40, 0.1)), 0.01, 3);
    let models: Vec<Model> = [1, 2, 3, 3]
        .into_iter()
        .map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let options = Options { seed: 5, ..Options::default() };
            pool.expect("threads").install(|| learn(DUFFING_SPACE, &data, &options))
        })
        .collect();
    let text = |model: &Model| serde_json::to_string(model).expect("a model");
    for model in &models[1..] {
        assert_eq!(*model, models[0]);
        assert_eq!(text(model), text(&models[0]));
    }
}

/// A clock that limps, three runs of unequal length.
fn limping() -> Vec<Dataset> {
    let starts = spiral(3, 1, 2.0);
    [4, 23, 61]
        .into_iter()
        .zip(starts)
        .map(|(count, start)| {
            let mut t = 0.0;
            let times: Vec<f64> = (0..count)
                .map(|i| {
                    t += 0.06 + 0.07 * (1.0 + (2.9 * i as f64).sin());
                    t
                })
                .collect();
            measure(PENDULUM, &[start], &times)
        })
        .collect()
}

fn joined(parts: Vec<Dataset>) -> Dataset {
    let observables = parts[0].observables.clone();
    Dataset {
        observables,
        runs: parts.into_iter().flat_map(|d| d.runs).collect(),
        inputs: Vec::new(),
    }
}

#[test]
fn irregular_runs_of_unequal_length_lose_nothing() {
    let data = joined(limping());
    let model = learn(PENDULUM_SPACE, &data, &Options::default());
    assert_recovers(&model, &PENDULUM_TRUTH, 1e-8);
    let model = learn(PENDULUM_SPACE, &noisy(data, 0.003, 1), &Options::default());
    assert_within(&model, &PENDULUM_TRUTH, 4.0);
}

#[test]
fn a_large_gap_is_not_bridged_and_breaks_nothing() {
    let mut data = measure(PENDULUM, &[vec![1.9, 0.0]], &even(120, 0.1));
    // Forty samples are lost, and the clock was set forward by a day meanwhile.
    let run = &mut data.runs[0];
    let keep = |i: usize| !(40..80).contains(&i);
    let pick = |all: &[f64]| -> Vec<f64> {
        all.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, x)| *x).collect()
    };
    run.times = pick(&run.times);
    run.times.iter_mut().skip(40).for_each(|t| *t += 86_400.0);
    run.values = run.values.iter().map(|column| pick(column)).collect();
    run.lines.truncate(run.times.len());
    let model = learn(PENDULUM_SPACE, &noisy(data, 0.002, 4), &Options::default());
    assert_within(&model, &PENDULUM_TRUTH, 4.0);
}

#[test]
fn missing_cells_and_clocks_out_of_phase() {
    let full = measure(DUFFING, &spiral(6, 1, 1.4), &even(60, 0.1));
    // q and p are never measured at the same time, and every seventh sample is lost.
    let mut data = noisy(full, 0.002, 8);
    for run in &mut data.runs {
        for i in 0..run.times.len() {
            run.values[i % 2][i] = f64::NAN;
            if i % 7 == 3 {
                run.values.iter_mut().for_each(|column| column[i] = f64::NAN);
            }
        }
    }
    let model = learn(DUFFING_SPACE, &data, &Options::default());
    assert_within(&model, &DUFFING_TRUTH, 4.0);
}

#[test]
fn coordinates_alone_suffice_when_the_mass_is_known() {
    let mut data = noisy(measure(DUFFING, &spiral(6, 1, 1.4), &even(60, 0.1)), 1e-4, 2);
    data.runs.iter_mut().for_each(|run| run.values[1].fill(f64::NAN));
    let space = "coordinates q\nmomenta p\nT = p^2/2\nV = span{ poly(q; 6) }\n";
    let model = learn(space, &data, &Options::default());
    assert_within(&model, &[("V q^2", 0.5), ("V q^4", 0.3)], 4.0);
}

const OSCILLATOR: &str = "coordinates q\nvelocities v\nT = p_q^2/4\nV = 0.8*q^2 + 0.2*q^4\n";

#[test]
fn velocities_with_a_known_mass() {
    let data = noisy(measure(OSCILLATOR, &spiral(6, 1, 1.4), &even(50, 0.1)), 1e-3, 2);
    let space = "coordinates q\nvelocities v\nT = p_q^2/4\nV = span{ poly(q; 6) }\n";
    let model = learn(space, &data, &Options::default());
    assert_within(&model, &[("V q^2", 0.8), ("V q^4", 0.2)], 4.0);
}

#[test]
fn velocities_leave_the_scale_open_and_the_model_says_so() {
    let data = noisy(measure(OSCILLATOR, &spiral(6, 1, 1.4), &even(50, 0.1)), 1e-3, 2);
    let space = "coordinates q\nvelocities v\nT = span{ p_q^2 }\nV = span{ poly(q; 6) }\n";
    let compiled = spec(space);
    let model = learn(space, &data, &Options::default());
    // In the gauge of a unit mass (the truth has mass 2) everything is half.
    assert_recovers(&model, &[("T p_q^2", 0.5), ("V q^2", 0.4), ("V q^4", 0.1)], 0.01);
    assert!(model.unlearnable.iter().any(|s| s.contains("scale")), "{:?}", model.unlearnable);
    assert!(model.law(&compiled.system).is_some());
    assert_eq!(model.covariance.len(), model.terms.len());
}

#[test]
fn the_zero_of_a_momentum_is_open_when_velocities_are_measured() {
    let data = noisy(measure(OSCILLATOR, &spiral(6, 1, 1.4), &even(50, 0.1)), 1e-3, 2);
    let space =
        "coordinates q\nvelocities v\nT = p_q^2/4 + span{ p_q, p_q^3 }\nV = span{ poly(q; 4) }\n";
    let model = learn(space, &data, &Options::default());
    assert_recovers(&model, &[("V q^2", 0.8), ("V q^4", 0.2)], 0.02);
    let named = |s: &String| s.contains("`p_q`") && s.contains("cannot be learned");
    assert!(model.unlearnable.iter().any(named), "{:?}", model.unlearnable);
}

#[test]
fn energies_that_do_not_separate() {
    let law = "coordinates q\nmomenta p\nH = (q^2 + 1)*(p^2 + 1)/2\n";
    let data = measure(law, &spiral(8, 1, 1.2), &even(20, 0.05));
    let space = "coordinates q\nmomenta p\nH = span{ tensor(q, p; 3) }\n";
    let model = learn(space, &data, &Options::default());
    let truth = [("H p^2", 0.5), ("H q^2", 0.5), ("H q^2*p^2", 0.5)];
    assert_recovers(&model, &truth, 1e-7);
    assert!(model.integrator.method.starts_with("gauss-legendre"), "{:?}", model.integrator);
}

#[test]
fn forces_that_depend_on_velocity_and_time() {
    let law = "coordinates q\nmomenta p\ntime t\nT = p^2/2\nV = q^2/2\n\
               force q += -0.15*p + 0.4*cos(1.7*t)\n";
    let data = noisy(measure(law, &spiral(5, 1, 1.4), &even(80, 0.1)), 2e-3, 6);
    let space = "coordinates q\nmomenta p\ntime t\nT = p^2/2\nV = span{ poly(q; 4) }\n\
                 force q += span{ p, p*abs(p), p^3, cos(1.7*t), sin(1.7*t) }\n";
    let model = learn(space, &data, &Options::default());
    let truth = [("V q^2", 0.5), ("force q p", -0.15), ("force q cos(1.7*t)", 0.4)];
    assert_within(&model, &truth, 4.0);
}

#[test]
fn parameters_inside_terms_and_the_starts_that_the_spec_lists() {
    let law = "coordinates q\nmomenta p\nT = p^2/2\nV = -cos(3*q)/3\n";
    let data = measure(law, &spiral(8, 1, 1.0), &even(40, 0.05));
    let space = "coordinates q\nmomenta p\nparam k = 1, 2.8 in 0.1..8\nT = p^2/2\n\
                 V = span{ cos(k*q) }\n";
    let compiled = spec(space);
    let listed =
        Options { parameter_starts: compiled.starts.clone(), starts: 0, ..Options::default() };
    let model = learn(space, &data, &listed);
    assert!((model.parameters[0].value - 3.0).abs() < 1e-7, "{:?}", model.parameters);
    assert!((coefficient(&model, "V cos(k*q)") + 1.0 / 3.0).abs() < 1e-7);
    // The random starts find it as well.
    let model = learn(space, &data, &Options::default());
    assert!((model.parameters[0].value - 3.0).abs() < 1e-7, "{:?}", model.parameters);
}

#[test]
fn a_term_stays_whose_coefficient_and_inner_number_are_nearly_one() {
    // At these speeds a hyperbolic tangent is nearly linear: neither number is known alone.
    let truth = "coordinates x\nmomenta v\nT = v^2/2\nV = -cos(x)\nforce x += -v\n";
    let space = "coordinates x\nmomenta v\nT = v^2/2\nV = -cos(x)\nparam scale = 2.5\n\
                 force x += span{ tanh(v/scale) }\n";
    let data = measure(truth, &[vec![0.45, 0.9], vec![1.3, 0.1]], &even(150, 0.067));
    for seed in 0..8 {
        let model = learn(space, &noisy(data.clone(), 0.015, seed), &Options::default());
        assert_eq!(support(&model).len(), 1, "seed {seed}: {:?}", model.front);
    }
}

#[test]
fn bounds_are_kept_and_those_that_do_not_matter_do_no_harm() {
    let data = noisy(measure(DUFFING, &spiral(6, 1, 1.4), &even(60, 0.1)), 1e-3, 2);
    let with = |constraint: &str| {
        let space = format!(
            "coordinates q\nmomenta p\nT = p^2/2\nV = span{{ a: q^2, b: q^4, c: q }}\n{constraint}\n"
        );
        learn(&space, &data, &Options::default())
    };
    let harmless = with("constrain terms of V >= 0");
    assert_within(&harmless, &[("V q^2", 0.5), ("V q^4", 0.3)], 4.0);
    // The truth is outside: the coefficient ends on the bound, the rest adapts.
    let held = with("constrain b <= 0.2");
    assert_eq!(coefficient(&held, "V q^4"), 0.2);
    assert!(coefficient(&held, "V q^2") > 0.5);
    let sign = with("constrain b <= 0");
    assert_eq!(coefficient(&sign, "V q^4"), 0.0);
    assert!(coefficient(&sign, "V q^2") > 0.5);
}

#[test]
fn robust_losses_stand_outliers_that_squares_do_not() {
    let mut data = noisy(measure(DUFFING, &spiral(12, 1, 1.4), &even(60, 0.1)), 2e-3, 2);
    // Five in a hundred values are off by hundreds of standard deviations.
    let mut cells = 0;
    for run in &mut data.runs {
        for x in run.values.iter_mut().flatten() {
            cells += 1;
            if cells * 7 % 20 == 3 {
                *x += if cells % 3 == 0 { 1.5 } else { -0.9 };
            }
        }
    }
    let space = "coordinates q\nmomenta p\nT = span{ p^2 }\nV = span{ q^2, q^4 }\n";
    let worst = |loss: &str| {
        let loss = Loss::by_name(loss).expect("a row of LOSSES");
        let model = learn(space, &data, &Options { loss, sparse: false, ..Options::default() });
        let error = |(name, value): &(&str, f64)| (coefficient(&model, name) - value).abs();
        DUFFING_TRUTH.iter().map(error).fold(0.0, f64::max)
    };
    let squares = worst("squares");
    for loss in ["huber", "absolute", "cauchy"] {
        let robust = worst(loss);
        assert!(4.0 * robust < squares, "{loss}: {robust} against {squares}");
        assert!(robust < 0.02, "{loss}: {robust}");
    }
}

#[test]
fn selection_by_held_out_folds_recovers_too() {
    let data = noisy(measure(DUFFING, &spiral(24, 1, 1.4), &even(30, 0.1)), 2e-3, 2);
    let options = Options { selection: Selection::HeldOut, ..Options::default() };
    let model = learn(DUFFING_SPACE, &data, &options);
    assert_within(&model, &DUFFING_TRUTH, 4.0);
}

#[test]
fn a_dense_fit_keeps_every_term() {
    let data = noisy(measure(DUFFING, &spiral(12, 1, 1.4), &even(40, 0.1)), 1e-3, 2);
    let model = learn(DUFFING_SPACE, &data, &Options { sparse: false, ..Options::default() });
    assert_eq!(model.terms.len(), spec(DUFFING_SPACE).system.terms.len());
    for term in &model.terms {
        let name = format!("{} {}", term.place, term.term);
        let value = DUFFING_TRUTH.iter().find(|(n, _)| *n == name).map_or(0.0, |t| t.1);
        assert!((term.coefficient - value).abs() < 4.0 * term.standard_error, "{term:?}");
    }
}

pub(super) const HENON_HEILES: &str = "coordinates q[1..2]\nmomenta p[1..2]\n\
    T = (p[1]^2 + p[2]^2)/2\nV = (q[1]^2 + q[2]^2)/2 + q[1]^2*q[2] - q[2]^3/3\n";
pub(super) const HENON_HEILES_TRUTH: [(&str, f64); 6] = [
    ("T p[1]^2", 0.5),
    ("T p[2]^2", 0.5),
    ("V q[1]^2", 0.5),
    ("V q[2]^2", 0.5),
    ("V q[1]^2*q[2]", 1.0),
    ("V q[2]^3", -1.0 / 3.0),
];

fn tensors(degree: usize) -> String {
    format!(
        "coordinates q[1..2]\nmomenta p[1..2]\n\
         T = span{{ tensor(p; {degree}) }}\nV = span{{ tensor(q; {degree}) }}\n"
    )
}

#[test]
fn the_first_order_trainer_recovers_the_support_of_thirty_terms() {
    let data = measure(HENON_HEILES, &spiral(600, 2, 0.35), &even(2, 0.1));
    let options = Options { trainer: Trainer::FirstOrder, ..Options::default() };
    let model = learn(&tensors(3), &data, &options);
    assert_recovers(&model, &HENON_HEILES_TRUTH, 1e-7);
    assert_eq!(model.evidence.function_space, 30);
    let compiled = spec(&tensors(3));
    let screening = first_order::screen(&compiled.system, &data, &options, &Silent)
        .unwrap_or_else(|error| panic!("{error}"));
    let losses: Vec<f64> = screening.history.iter().map(|entry| entry.1).collect();
    assert!(losses.len() > 2);
    assert!(losses[..losses.len() - 1].windows(2).all(|w| w[1] < w[0]), "{losses:?}");
}

#[test]
fn a_space_of_thousands_of_terms_is_screened() {
    // tensor(;44) of two variables has 2024 members each.
    let data = measure(HENON_HEILES, &spiral(120, 2, 0.5), &even(2, 0.1));
    let model = learn(&tensors(44), &data, &Options::default());
    assert_eq!(model.evidence.function_space, 4048);
    assert_recovers(&model, &HENON_HEILES_TRUTH, 1e-5);
}

/// Stops after a number of questions.
struct Impatient(AtomicUsize, usize);

impl Monitor for Impatient {
    fn stage(&self, _: &str, _: f64) {}

    fn stopped(&self) -> bool {
        self.0.fetch_add(1, Ordering::Relaxed) >= self.1
    }
}

#[test]
fn an_interrupted_fit_keeps_a_model() {
    let data = noisy(measure(DUFFING, &spiral(6, 1, 1.4), &even(60, 0.1)), 1e-3, 2);
    let compiled = spec(DUFFING_SPACE);
    for trainer in [Trainer::GaussNewton, Trainer::FirstOrder] {
        for patience in [0, 1, 2, 5, 9] {
            let monitor = Impatient(AtomicUsize::new(0), patience);
            let options = Options { trainer, ..Options::default() };
            let model = fit(&compiled.system, &data, &options, &monitor)
                .unwrap_or_else(|error| panic!("{error}"));
            assert_sound(&model);
            assert_eq!(model.stop.reason, StopReason::Interrupted, "{trainer:?} {patience}");
        }
    }
}

#[test]
fn terms_that_do_the_same_are_named() {
    let data = measure(PENDULUM, &spiral(30, 1, 1.5), &even(6, 0.1));
    let space = "coordinates q\nmomenta p\nT = span{ p^2, 3*p^2 + p, p }\n\
                 V = span{ cos(q), sin(q/2)^2, cos(q)^2, sin(q)^2 }\n";
    let model = learn(space, &data, &Options::default());
    assert_eq!(model.unlearnable.len(), 3, "{:?}", model.unlearnable);
    assert!(model.unlearnable.iter().all(|s| s.contains("not identifiable")));
    assert!(model.unlearnable.iter().any(|s| s.contains("sin(q/2)^2") && s.contains("cos(q)")));
}

/// The same data with time and columns in other units.
fn rescaled(data: &Dataset, time: f64, columns: &[f64]) -> Dataset {
    let mut data = data.clone();
    for run in &mut data.runs {
        run.times.iter_mut().for_each(|t| *t *= time);
        for (column, scale) in run.values.iter_mut().zip(columns) {
            column.iter_mut().for_each(|x| *x *= scale);
        }
    }
    data
}

#[test]
fn units_do_not_matter() {
    let data = noisy(measure(DUFFING, &spiral(8, 1, 1.4), &even(40, 0.1)), 2e-3, 2);
    let reference = learn(DUFFING_SPACE, &data, &Options::default());
    assert_within(&reference, &DUFFING_TRUTH, 4.0);
    for (time, q, p) in
        [(1e-9, 1.0, 1.0), (1e7, 1.0, 1.0), (1.0, 1e-6, 1e6), (1.0, 1e6, 1e-6), (1e-3, 1e5, 1e5)]
    {
        let model = learn(DUFFING_SPACE, &rescaled(&data, time, &[q, p]), &Options::default());
        assert_eq!(support(&model), support(&reference), "time {time}, q {q}, p {p}");
        for (ours, theirs) in model.terms.iter().zip(&reference.terms) {
            let relative = |t: &leverrier::internals::fit::model::LearnedTerm| {
                t.standard_error / t.coefficient
            };
            let ratio = relative(ours) / relative(theirs);
            assert!((ratio - 1.0).abs() < 1e-3, "{}: {ratio}", ours.term);
        }
    }
}

#[test]
fn noise_that_differs_by_a_thousand_between_columns() {
    let mut data = measure(DUFFING, &spiral(20, 1, 1.4), &even(60, 0.1));
    add_noise(&mut data, &[NoiseLevel::Absolute(5e-5), NoiseLevel::Absolute(5e-2)], 4)
        .expect("noise");
    let model = learn(DUFFING_SPACE, &data, &Options::default());
    assert_within(&model, &DUFFING_TRUTH, 4.0);
    let sigma = |i: usize| model.noise[i].standard_deviation;
    assert!((sigma(0) / 5e-5 - 1.0).abs() < 0.15, "{}", sigma(0));
    assert!((sigma(1) / 5e-2 - 1.0).abs() < 0.15, "{}", sigma(1));
}

#[test]
fn pairs_and_trajectories_agree() {
    let data = measure(DUFFING, &spiral(5, 1, 1.4), &even(60, 0.1));
    let pairs = noisy(consecutive_pairs(&data), 1e-3, 2);
    assert_within(&learn(DUFFING_SPACE, &pairs, &Options::default()), &DUFFING_TRUTH, 4.0);
    let long = learn(DUFFING_SPACE, &noisy(data, 1e-3, 2), &Options::default());
    assert_within(&long, &DUFFING_TRUTH, 4.0);
    assert!(long.evidence.window > 8, "{:?}", long.evidence);
}

#[test]
fn one_number_of_the_tuning_is_what_the_fit_goes_by() {
    let data = noisy(measure(DUFFING, &spiral(5, 1, 1.4), &even(60, 0.1)), 1e-3, 2);
    let mut options = Options::default();
    options.tuning.course.longest = 8;
    let short = learn(DUFFING_SPACE, &data, &options);
    assert!(short.evidence.window <= 8, "{:?}", short.evidence);
    options.tuning.segments.folds = 0;
    let refused = fit(&spec(DUFFING_SPACE).system, &data, &options, &Silent);
    assert!(refused.is_err_and(|error| error.to_string().contains("segments.folds")));
}

/// Positions alone, as a camera in pixels or in metres has them.
#[test]
fn positions_alone_give_the_same_law_in_other_units() {
    let law = "coordinates q\nmomenta p\nT = p^2/2\nV = q^2/2 + 0.3*q^4\n";
    let space = "coordinates q\nmomenta p\nT = p^2/2\nV = span{ poly(q; 4) }\n";
    let mut data = noisy(measure(law, &spiral(6, 1, 1.2), &even(80, 0.1)), 0.004, 11);
    for run in &mut data.runs {
        run.values[1].fill(f64::NAN);
    }
    let plain = learn(space, &data, &Options::default());
    for unit in [1e3, 1e-4] {
        let mut scaled = data.clone();
        scaled.runs.iter_mut().for_each(|run| run.values[0].iter_mut().for_each(|x| *x *= unit));
        let other = learn(space, &scaled, &Options::default());
        assert_eq!(support(&other), support(&plain), "{unit}");
        for (term, one) in plain.terms.iter().zip(&other.terms) {
            let degree = if term.term == "q" { 1 } else { term.term[2..].parse().unwrap_or(0) };
            let back = unit.powi(degree - 2);
            let moved = (one.coefficient * back - term.coefficient).abs() / term.standard_error;
            let error = one.standard_error * back / term.standard_error - 1.0;
            println!("{unit}: {} moves by {moved:.1e}, its error by {error:.1e}", term.term);
            assert!(moved < 1e-6 && error.abs() < 1e-6, "{unit}: {term:?} {one:?}");
        }
    }
}

#[test]
fn of_one_whole_run_nothing_is_drawn_anew() {
    let clean = measure(PENDULUM, &[vec![1.4, 0.0]], &even(201, 0.1));
    let model = learn(PENDULUM_SPACE, &noisy(clean, 0.005, 1), &Options::default());
    assert_eq!(model.evidence.segments, 1);
    assert!(model.terms.iter().all(|term| term.inclusion.is_none()), "{:?}", model.terms);
    // Several runs can be drawn, and tell.
    let clean = measure(PENDULUM, &spiral(6, 1, 1.6), &even(60, 0.1));
    let model = learn(PENDULUM_SPACE, &noisy(clean, 0.005, 1), &Options::default());
    assert!(model.terms.iter().all(|term| term.inclusion > Some(0.5)), "{:?}", model.terms);
}
