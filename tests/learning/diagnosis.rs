//! What is missing: effects hidden in data, and whether they are named.

use std::sync::atomic::{AtomicBool, Ordering};

use leverrier::internals::data::Dataset;
use leverrier::internals::diagnose::comparison::compare;
use leverrier::internals::diagnose::diagnosis::{Diagnosis, Verdict, diagnose};
use leverrier::internals::diagnose::discover::{DiscoveryOptions, discover};
use leverrier::internals::diagnose::{self, LawOnData, Measurements};
use leverrier::internals::expr::{Compiled, build};
use leverrier::internals::fit::{Law, Model, Monitor, Options, Silent, fit};
use leverrier::internals::simulate::Simulator;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// A system as it is known, and as it is learned.
pub(crate) struct Base {
    variables: &'static str,
    law: &'static str,
    space: &'static str,
    degrees: usize,
}

pub(crate) const PENDULUM: Base = Base {
    variables: "coordinates q\nmomenta p\n",
    law: "T = p^2/2\nV = -cos(q)\n",
    space: "T = p^2/2\nV = span{ cos(q) }\n",
    degrees: 1,
};

pub(crate) const TRAP: Base = Base {
    variables: "coordinates x, y\nmomenta px, py\n",
    law: "T = (px^2 + py^2)/2\nV = x^2/2 + 0.7*y^2\n",
    space: "T = (px^2 + py^2)/2\nV = span{ x^2, y^2 }\n",
    degrees: 2,
};

pub(crate) struct Case {
    text: String,
    compiled: Compiled,
    training: Dataset,
    held_out: Dataset,
    model: Model,
}

/// Eight runs of 200 samples of a system with a hidden effect, noise in parts of each column's
/// spread, and the model that does not know of the effect.
fn case(base: &Base, hidden: &str, noise: f64, seed: u64) -> Case {
    read_by(base, hidden, seed, |run, spread, generator| {
        for x in run {
            let draw: f64 = StandardNormal.sample(generator);
            *x += noise * spread * draw;
        }
    })
}

/// The same as an instrument reads it: `read` gets each run of each column, and the column's
/// spread.
pub(crate) fn read_by(
    base: &Base,
    hidden: &str,
    seed: u64,
    read: impl Fn(&mut [f64], f64, &mut Pcg64),
) -> Case {
    let law = format!("{}{}{hidden}\n", base.variables, base.law);
    let truth = build("truth", &law).unwrap_or_else(|error| panic!("{error}"));
    let simulator = Simulator::known(&truth.system);
    let starts: Vec<Vec<f64>> = (0..8)
        .map(|run| {
            let reach = 0.4 + 0.15 * run as f64;
            let q = (0..base.degrees).map(|i| reach * (1.0 - 0.4 * i as f64));
            let p = (0..base.degrees).map(|i| 0.3 - 0.1 * (run + 2 * i) as f64);
            q.chain(p).collect()
        })
        .collect();
    let times: Vec<f64> = (0..200).map(|i| 0.1 * i as f64).collect();
    let trajectories = simulator.trajectories(&starts, &times).unwrap_or_else(|e| panic!("{e}"));
    let mut data = trajectories.dataset(&truth.system);
    let mut generator = Pcg64::seed_from_u64(seed);
    for row in 0..2 * base.degrees {
        let all: Vec<f64> = data.runs.iter().flat_map(|r| r.values[row].iter().copied()).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let variance = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / all.len() as f64;
        for run in &mut data.runs {
            read(&mut run.values[row], variance.sqrt(), &mut generator);
        }
    }
    let text = format!("{}{}", base.variables, base.space);
    let compiled = build("learned", &text).unwrap_or_else(|error| panic!("{error}"));
    let split = data.split_held_out(0.25, seed);
    let model = fit(&compiled.system, &split.training, &Options::default(), &Silent)
        .unwrap_or_else(|error| panic!("{error}"));
    Case { text, compiled, training: split.training, held_out: split.held_out, model }
}

impl Case {
    pub(crate) fn diagnosis(&self) -> Diagnosis {
        self.diagnosis_by(&diagnose::Options::default())
    }

    pub(crate) fn diagnosis_by(&self, options: &diagnose::Options) -> Diagnosis {
        let law = self.law();
        let (training, held_out) = (&self.training, &self.held_out);
        diagnose(&self.compiled, &law, training, held_out, options, &Silent)
            .unwrap_or_else(|error| panic!("{error}"))
    }

    fn law(&self) -> Law {
        self.model.law_of(&self.compiled.system).unwrap_or_else(|error| panic!("{error}"))
    }
}

#[test]
fn hidden_effects_are_named_with_their_size() {
    // Base, hidden statement, effect, size of its first coefficient.
    let rows: [(&Base, &str, &str, f64); 5] = [
        (&PENDULUM, "force q += -0.05*p", "viscous_drag(q)", 0.05),
        (&PENDULUM, "force q += 0.1", "constant_force(q)", 0.1),
        (&PENDULUM, "force q += 0.05*cos(1.7*t)", "harmonic_drive(q)", 0.05),
        (&TRAP, "force x += -0.04*px*abs(px)", "quadratic_drag(x)", 0.04),
        (&TRAP, "force x += 0.2*py\nforce y += -0.2*px", "magnetic_force(x, y)", 0.2),
    ];
    for (base, hidden, effect, size) in rows {
        let diagnosis = case(base, hidden, 0.01, 3).diagnosis();
        assert_eq!(diagnosis.verdict, Verdict::Missing, "{hidden}");
        let named: Vec<&str> = diagnosis.ranking.iter().map(|l| l.effect.as_str()).collect();
        let close = named.iter().position(|name| *name == effect);
        let tied = diagnosis.indistinguishable.iter().any(|name| name == effect);
        assert!(close == Some(0) || tied, "{hidden}: {named:?}");
        let leader = &diagnosis.ranking[close.unwrap_or(0)];
        let (found, error) = (leader.coefficient[0], leader.standard_error[0]);
        assert!((found.abs() - size).abs() < 5.0 * error, "{hidden}: {found} +- {error}");
        assert!(leader.p_value < 1e-6);
        assert!(leader.held_out_error_after < leader.held_out_error_before);
    }
}

/// With the springs of both coordinates free, a spring between them and a product of them are the
/// same motion: what rounding makes of them is not to choose.
#[test]
fn of_two_names_for_the_same_motion_the_first_of_the_catalogue_is_given() {
    for seed in 1..=4 {
        let diagnosis = case(&TRAP, "V += 0.05*(y - x)^2", 0.01, seed).diagnosis();
        let named = diagnosis.ranking.first().map(|leader| leader.effect.as_str());
        assert_eq!(named, Some("coupling_spring(x, y)"), "seed {seed}");
        let same = "bilinear_coupling(x, y)".to_string();
        assert!(diagnosis.indistinguishable.contains(&same), "{:?}", diagnosis.indistinguishable);
    }
}

#[test]
fn nothing_is_named_where_nothing_is_hidden() {
    for seed in 1..6 {
        let case = case(&PENDULUM, "", 0.02, seed);
        let diagnosis = case.diagnosis();
        assert_eq!(diagnosis.verdict, Verdict::NothingMissing, "{diagnosis:?}");
        assert!(diagnosis.ranking.is_empty());
        assert!((diagnosis.held_out_error - 1.0).abs() < 0.1, "{}", diagnosis.held_out_error);
    }
}

#[test]
fn a_comparison_sees_lost_energy_and_a_right_model_at_the_noise_floor() {
    let damped = case(&PENDULUM, "force q += -0.05*p", 0.01, 4);
    let options = diagnose::Options::default();
    let model = LawOnData::of(damped.law(), &damped.training, &options);
    let held_out = model.with_data(&Measurements::of(&damped.held_out, &options));
    let report = compare(&model, Some(&held_out)).unwrap_or_else(|error| panic!("{error}"));
    assert!(report.findings.iter().any(|line| line.contains("loses energy")), "{report:?}");
    assert!(report.energy.iter().all(|drift| drift.rate < 0.0));
    let last = report.horizons.last().unwrap();
    assert!(last.training > 2.0 && last.held_out.unwrap() > 2.0 && last.baseline > last.training);
    // The residual force against the momentum is a straight line of slope -0.05.
    let map = report.maps.iter().find(|map| map.against == "p").unwrap();
    assert!(map.p_value < 1e-9);

    let right = case(&PENDULUM, "", 0.01, 4);
    let model = LawOnData::of(right.law(), &right.training, &options);
    let report = compare(&model, None).unwrap_or_else(|error| panic!("{error}"));
    for horizon in &report.horizons {
        assert!((horizon.training - 1.0).abs() < 0.1, "{horizon:?}");
    }
}

#[test]
fn two_effects_at_once_are_found_and_nothing_else() {
    let hidden = "force q += -0.05*p\nforce q += 0.08";
    let mut case = case(&PENDULUM, hidden, 0.01, 6);
    // A comment that names them is left alone, whatever is tried in their places.
    case.text =
        format!("# not effect viscous_drag(q), nor effect constant_force(q)\n{}", case.text);
    let found = discover(
        "learned",
        &case.text,
        &case.training,
        &case.held_out,
        &DiscoveryOptions::default(),
        &Silent,
    )
    .unwrap_or_else(|error| panic!("{error}"));
    let mut effects: Vec<&str> = found.steps.iter().map(|step| step.effect.as_str()).collect();
    effects.sort_unstable();
    assert_eq!(effects, ["constant_force(q)", "viscous_drag(q)"], "{found:?}");
    assert_eq!(found.verdict, Verdict::NothingMissing, "{}", found.stop);
    assert!(found.text.starts_with(case.text.trim_end()));
    let (before, after) = found.held_out_error;
    assert!(before > 2.0 && (after - 1.0).abs() < 0.1, "{before} {after}");
}

/// Stops a computation when a stage begins.
struct StopAt(&'static str, AtomicBool);

impl Monitor for StopAt {
    fn stage(&self, what: &str, _: f64) {
        if what == self.0 {
            self.1.store(true, Ordering::Relaxed);
        }
    }

    fn stopped(&self) -> bool {
        self.1.load(Ordering::Relaxed)
    }
}

#[test]
fn an_interrupted_search_says_what_it_had_found_and_how_far_it_had_come() {
    let case = case(&PENDULUM, "force q += -0.05*p", 0.01, 6);
    let options = DiscoveryOptions::default();
    let monitor = StopAt("refitting the leaders", AtomicBool::new(false));
    let (training, held_out) = (&case.training, &case.held_out);
    let found = discover("learned", &case.text, training, held_out, &options, &monitor)
        .unwrap_or_else(|error| panic!("{error}"));
    assert!(found.interrupted && found.steps.is_empty(), "{found:?}");
    for part in ["interrupted in round 1", "viscous_drag(q)", "times the noise"] {
        assert!(found.stop.contains(part), "{}", found.stop);
    }
    assert_eq!(found.verdict, Verdict::Interrupted);
}
