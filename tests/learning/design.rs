//! The next run worth measuring: what is promised of it, and whether it keeps that.

use leverrier::internals::data::Dataset;
use leverrier::internals::diagnose;
use leverrier::internals::diagnose::LawOnData;
use leverrier::internals::diagnose::design::rival::Rival;
use leverrier::internals::diagnose::design::{Allowed, Goal, Plan, Proposal, design, standings};
use leverrier::internals::diagnose::diagnosis::{Diagnosis, diagnose};
use leverrier::internals::error::Error;
use leverrier::internals::expr::{Compiled, build};
use leverrier::internals::fit::{Law, Model, Options, Silent, fit};
use leverrier::internals::simulate::{Interval, NoiseLevel, Simulator, add_noise};

const VARIABLES: &str = "coordinates q\nmomenta p\n";
const SPACE: &str = "T = p^2/2\nV = span{ cos(q) }\n";
const LAW: &str = "T = p^2/2\nV = -cos(q)\n";
const NOISE: f64 = 0.02;

const VISCOUS: (&str, &str) = ("viscous_drag(q)", "force q += -0.03*p\n");
const COULOMB: (&str, &str) = ("coulomb_friction(q)", "force q += -0.02*sign(p)\n");

fn ok<T>(result: Result<T, Error>) -> T {
    result.unwrap_or_else(|error| panic!("{error}"))
}

/// Runs of a law from each start, with noise.
fn runs(law: &str, starts: &[Vec<f64>], times: &[f64], seed: u64) -> Dataset {
    let truth = ok(build("truth", &format!("{VARIABLES}{law}")));
    let simulator = Simulator::known(&truth.system);
    let mut data = ok(simulator.trajectories(starts, times)).dataset(&truth.system);
    ok(add_noise(&mut data, &[NoiseLevel::Absolute(NOISE); 2], seed));
    data
}

fn times(count: usize, step: f64) -> Vec<f64> {
    (0..count).map(|i| step * i as f64).collect()
}

/// Two swings of one amplitude.
fn swings(force: &str, seed: u64) -> Dataset {
    runs(&format!("{LAW}{force}"), &[vec![0.9, 0.0], vec![0.93, 0.0]], &times(81, 0.1), seed)
}

fn with_run(data: &Dataset, run: &Dataset) -> Dataset {
    let mut all = data.clone();
    all.runs.extend(run.runs.iter().cloned());
    all
}

/// A spec with its measurements and its model.
struct Bench {
    compiled: Compiled,
    data: Dataset,
    model: Model,
}

fn bench(space: &str, data: Dataset, options: &Options) -> Bench {
    let text = format!("{VARIABLES}{space}");
    let compiled = ok(build("learned", &text));
    let model = ok(fit(&compiled.system, &data, options, &Silent));
    Bench { compiled, data, model }
}

impl Bench {
    fn law(&self) -> Law {
        ok(self.model.law_of(&self.compiled.system))
    }

    fn diagnosis(&self, held_out: &Dataset) -> Diagnosis {
        let options = diagnose::Options::default();
        ok(diagnose(&self.compiled, &self.law(), &self.data, held_out, &options, &Silent))
    }

    fn rival(&self, label: &str, statement: &str, start: &[f64]) -> Rival {
        let options = diagnose::Options::default();
        let model = LawOnData::of(self.law(), &self.data, &options);
        ok(Rival::with_effect(&model, &self.compiled, label, statement, start))
    }

    /// The leaders that a diagnosis cannot tell apart.
    fn tied(&self, found: &Diagnosis) -> Vec<Rival> {
        let first = &found.ranking[0].effect;
        let leaders = found.ranking.iter();
        leaders
            .filter(|l| l.effect == *first || found.indistinguishable.contains(&l.effect))
            .map(|l| self.rival(&l.effect, &l.snippet, &l.coefficient))
            .collect()
    }

    fn pair(&self) -> Vec<Rival> {
        let both = [VISCOUS.0, COULOMB.0];
        both.iter().map(|label| self.rival(label, &format!("effect {label}"), &[])).collect()
    }

    fn plan(&self, rivals: &[Rival], goal: &Goal, allowed: &Allowed) -> Result<Plan, Error> {
        let (data, window) = (&self.data, self.model.evidence.window);
        design(rivals, goal, data, window, allowed, &diagnose::Options::default(), &Silent)
    }
}

/// Starts from which dry friction does not bring the motion to rest within the run.
fn lively() -> Allowed {
    let q = Interval { lower: 0.4, upper: 0.95 };
    let p = Interval { lower: -0.9, upper: 0.9 };
    Allowed { start: vec![Some(q), Some(p)], ..Allowed::default() }
}

fn start_of(run: &Proposal) -> Vec<f64> {
    run.start.iter().map(|s| s.value).collect()
}

fn measured(force: &str, run: &Proposal, seed: u64) -> Dataset {
    runs(&format!("{LAW}{force}"), &[start_of(run)], &times(run.samples, run.step), seed)
}

fn behind(rivals: &[Rival], data: &Dataset, window: usize, label: &str) -> f64 {
    let standings = ok(standings(rivals, data, window, &diagnose::Options::default()));
    standings.iter().find(|s| s.effect == label).map_or(f64::NAN, |s| s.excess_deviance)
}

#[test]
fn the_run_that_is_proposed_settles_what_a_repeat_leaves_open() {
    for ((label, force), other, seed) in [(VISCOUS, COULOMB.0, 3), (COULOMB, VISCOUS.0, 4)] {
        let held_out = swings(force, seed + 100);
        let before = bench(SPACE, swings(force, seed), &Options::default());
        let found = before.diagnosis(&held_out);
        let tied = before.tied(&found);
        let has = |label: &str| tied.iter().any(|rival| rival.label == label);
        assert!(has(label) && has(other), "{label}: {:?}", found.indistinguishable);

        let plan = ok(before.plan(&tied, &Goal::Rivals, &lively()));
        let alike =
            |a: &str, b: &str| plan.indistinguishable.iter().any(|pair| pair.0 == a && pair.1 == b);
        assert!(!alike(label, other) && !alike(other, label), "{:?}", plan.indistinguishable);
        let of = |gains: &[leverrier::internals::diagnose::design::Gain]| {
            let gain = gains.iter().find(|g| g.truth == label && g.against == other).unwrap();
            gain.deviance
        };
        let promised = of(&plan.best.expected.gains);
        let repeated = of(&plan.repeat.as_ref().unwrap().gains);
        assert!(promised > 4.0 * repeated && promised > 6.0, "{label}: {promised} {repeated}");

        let window = before.model.evidence.window;
        let new = measured(force, &plan.best, seed + 50);
        let after = with_run(&before.data, &new);
        for rival in tied.iter().filter(|r| r.label != label && !alike(label, &r.label)) {
            let gap =
                behind(&tied, &after, window, &rival.label) - behind(&tied, &after, window, label);
            assert!(gap > 6.0, "{label}: {} is only {gap} behind", rival.label);
        }
        let settled = bench(SPACE, after, &Options::default()).diagnosis(&held_out);
        assert_eq!(settled.ranking[0].effect, label, "{settled:?}");
        assert!(!settled.indistinguishable.iter().any(|l| l == other), "{settled:?}");

        // The control: the old run again, with as much time at the bench.
        let again = swings(force, seed + 50);
        let again = Dataset { runs: again.runs[..1].to_vec(), ..again };
        let control = with_run(&before.data, &again);
        let gap = behind(&tied, &control, window, other) - behind(&tied, &control, window, label);
        assert!(gap < 6.0, "{label}: a repeat settles it too, by {gap}");
    }
}

/// The mean growth over many new runs of noise is the expected one. A growth of expectation G
/// has a standard deviation of 2 sqrt(G); the band is three of the mean's, and one unit for
/// what the rivals' own unknowns take up.
#[test]
fn the_expected_gain_is_the_mean_of_what_is_gained() {
    const SEEDS: u64 = 24;
    let before = bench(SPACE, swings(VISCOUS.1, 3), &Options::default());
    let window = before.model.evidence.window;
    let rivals = before.pair();
    let plan = ok(before.plan(&rivals, &Goal::Rivals, &lively()));
    let noise: Vec<NoiseLevel> = (0..2)
        .map(|row| {
            NoiseLevel::Absolute(rivals.iter().map(|r| r.law.noise()[row]).fold(1.0, f64::min))
        })
        .collect();
    let difference = |data: &Dataset, truth: usize| {
        let standings = ok(standings(&rivals, data, window, &diagnose::Options::default()));
        standings[1 - truth].excess_deviance - standings[truth].excess_deviance
    };
    for (truth, rival) in rivals.iter().enumerate() {
        let gain = plan.best.expected.gains.iter().find(|g| g.truth == rival.label).unwrap();
        let (system, simulator) = (rival.law.system(), rival.law.simulator());
        let times = times(plan.best.samples, plan.best.step);
        let clean = ok(simulator.trajectories(&[start_of(&plan.best)], &times)).dataset(system);
        let now = difference(&before.data, truth);
        let grown = (0..SEEDS).map(|seed| {
            let mut new = clean.clone();
            ok(add_noise(&mut new, &noise, seed));
            difference(&with_run(&before.data, &new), truth) - now
        });
        let mean = grown.sum::<f64>() / SEEDS as f64;
        let band = 3.0 * 2.0 * (gain.deviance / SEEDS as f64).sqrt() + 1.0;
        let expected = gain.deviance;
        println!("{}: expected {expected:.2}, mean {mean:.2}, band {band:.2}", rival.label);
        assert!(expected > 6.0 && (mean - expected).abs() < band, "{expected} {mean} {band}");
    }
}

#[test]
fn a_coefficient_becomes_as_certain_as_was_said() {
    const STIFF: &str = "T = p^2/2\nV = q^2/2 + 0.1*q^4\n";
    const SPRING: &str = "T = p^2/2\nV = span{ linear: q^2, cubic: q^4 }\n";
    let starts = [vec![0.7, 0.0], vec![0.6, 0.3], vec![0.4, -0.5]];
    let data = runs(STIFF, &starts, &times(101, 0.1), 5);
    let whole = Options { sparse: false, window: Some(32), ..Options::default() };
    let before = bench(SPRING, data, &whole);
    let rival = [Rival::as_it_is(&before.law(), "the model")];
    let wide = Interval { lower: -1.1, upper: 1.1 };
    let allowed = Allowed { start: vec![Some(wide); 2], ..Allowed::default() };
    let plan = ok(before.plan(&rival, &Goal::Coefficient(None), &allowed));
    let sought = plan.coefficient.as_ref().unwrap();
    assert_eq!(sought.what, "cubic");
    let error_of = |model: &Model| {
        model.terms.iter().find(|t| t.term == "q^4").map_or(f64::NAN, |t| t.standard_error)
    };
    let close = |a: f64, b: f64| (a / b - 1.0).abs() < 0.1;
    let now = error_of(&before.model);
    assert!(close(sought.standard_error, now), "{} {now}", sought.standard_error);
    let promised = plan.best.expected.standard_error.unwrap();
    let repeated = plan.repeat.as_ref().unwrap().standard_error.unwrap();
    assert!(promised < 0.5 * repeated && repeated < sought.standard_error, "{plan:?}");

    let start = start_of(&plan.best);
    let new = runs(STIFF, &[start], &times(plan.best.samples, plan.best.step), 6);
    let after = bench(SPRING, with_run(&before.data, &new), &whole);
    let kept = error_of(&after.model);
    println!("now {now:.4}, promised {promised:.4}, kept {kept:.4}, a repeat {repeated:.4}");
    assert!(close(promised, kept), "{promised} {kept}");
    let value = after.model.terms.iter().find(|t| t.term == "q^4").unwrap().coefficient;
    assert!((value - 0.1).abs() < 4.0 * kept, "{value} +- {kept}");
    let named = Goal::Coefficient(Some("q^2".to_string()));
    let plan = ok(before.plan(&rival, &named, &allowed));
    assert_eq!(plan.coefficient.unwrap().what, "linear");
}

#[test]
fn a_run_stays_within_what_is_allowed() {
    let before = bench(SPACE, swings(VISCOUS.1, 3), &Options::default());
    let rivals = before.pair();
    let allowed = Allowed {
        start: vec![
            Some(Interval { lower: 0.2, upper: 0.7 }),
            Some(Interval { lower: -0.31, upper: 0.52 }),
        ],
        motion: vec![Some(Interval { lower: -0.75, upper: 0.75 }), None],
        from: Some(3.0),
        durations: vec![4.0, 6.0],
        steps: vec![0.1, 0.2],
    };
    let plan = ok(before.plan(&rivals, &Goal::Rivals, &allowed));
    let law = format!("{LAW}{}", VISCOUS.1);
    assert!(plan.alternatives.len() > 2);
    for run in std::iter::once(&plan.best).chain(&plan.alternatives) {
        let start = start_of(run);
        assert!((0.2..=0.7).contains(&start[0]) && (-0.31..=0.52).contains(&start[1]), "{start:?}");
        assert!(run.from == 3.0 && [4.0, 6.0].contains(&run.duration), "{run:?}");
        assert_eq!(run.samples, (run.duration / run.step).round() as usize + 1);
        assert_eq!(run.at_rest, start[1] == 0.0);
        let motion = runs(&law, &[start], &times(run.samples, run.step), 1);
        assert!(motion.runs[0].values[0].iter().all(|q| q.abs() < 0.75 + 5.0 * NOISE));
    }
    // Motions of bounded energy cannot stay where none of them is.
    let nowhere = Allowed { motion: vec![Some(Interval { lower: 0.19, upper: 0.2 })], ..allowed };
    let error = before.plan(&rivals, &Goal::Rivals, &nowhere).unwrap_err().to_string();
    assert!(error.contains("stays within its bounds"), "{error}");
    let error = before.plan(&rivals[..1], &Goal::Rivals, &lively()).unwrap_err().to_string();
    assert!(error.contains("name at least two"), "{error}");
    let wrong = Goal::Coefficient(Some("sin(q)".to_string()));
    let error = before.plan(&rivals[..1], &wrong, &lively()).unwrap_err().to_string();
    assert!(error.contains("no coefficient `sin(q)`"), "{error}");
    let slow = Allowed { durations: vec![1.0], steps: vec![2.0], ..lively() };
    let error = before.plan(&rivals, &Goal::Rivals, &slow).unwrap_err().to_string();
    assert!(error.contains("is not possible"), "{error}");
}

#[test]
fn what_includes_another_cannot_be_spoken_against() {
    let before = bench(SPACE, swings(VISCOUS.1, 3), &Options::default());
    let wider = before.rival("negative_damping(q)", "effect negative_damping(q)", &[]);
    let rivals = [before.rival(VISCOUS.0, "effect viscous_drag(q)", &[]), wider];
    let plan = ok(before.plan(&rivals, &Goal::Rivals, &lively()));
    let pair = (VISCOUS.0.to_string(), "negative_damping(q)".to_string());
    assert!(plan.indistinguishable.contains(&pair), "{:?}", plan.indistinguishable);
}

#[test]
fn the_plan_does_not_depend_on_the_number_of_threads() {
    let before = bench(SPACE, swings(VISCOUS.1, 3), &Options::default());
    let rivals = before.pair();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| ok(before.plan(&rivals, &Goal::Rivals, &lively())))
    };
    assert_eq!(with(1), with(3));
}
