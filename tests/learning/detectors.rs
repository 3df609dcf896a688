//! Faults of the instrument that no term describes: found when there, silent when not; and
//! hidden forces where velocities, or coordinates alone, are measured.

use leverrier::internals::data::Dataset;
use leverrier::internals::diagnose;
use leverrier::internals::diagnose::LawOnData;
use leverrier::internals::diagnose::diagnosis::{Verdict, diagnose};
use leverrier::internals::diagnose::instrument::{Detection, detect};
use leverrier::internals::expr::{TermId, build};
use leverrier::internals::fit::{Law, Options, Silent, fit, resume};
use leverrier::internals::simulate::Simulator;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

const NOISE: f64 = 0.01;

/// Six swings of a pendulum with a hidden force and normal noise.
fn swings(hidden: &str, seed: u64) -> Dataset {
    let law = format!("coordinates q\nmomenta p\nT = p^2/2\nV = -cos(q)\n{hidden}\n");
    let truth = build("truth", &law).unwrap_or_else(|error| panic!("{error}"));
    let simulator = Simulator::known(&truth.system);
    let starts: Vec<Vec<f64>> = (0..6).map(|i| vec![0.5 + 0.2 * f64::from(i), 0.1]).collect();
    let times: Vec<f64> = (0..120).map(|i| 0.1 * f64::from(i)).collect();
    let trajectories = simulator.trajectories(&starts, &times).unwrap_or_else(|e| panic!("{e}"));
    let mut data = trajectories.dataset(&truth.system);
    let mut generator = Pcg64::seed_from_u64(seed);
    for x in data.runs.iter_mut().flat_map(|run| run.values.iter_mut().flatten()) {
        let draw: f64 = StandardNormal.sample(&mut generator);
        *x += NOISE * draw;
    }
    data
}

fn found(data: &Dataset) -> Vec<Detection> {
    let spec = "coordinates q\nmomenta p\nT = p^2/2\nV = span{ cos(q) }\n";
    let compiled = build("spec", spec).unwrap_or_else(|error| panic!("{error}"));
    let model = fit(&compiled.system, data, &Options::default(), &Silent)
        .unwrap_or_else(|error| panic!("{error}"));
    let law = model.law_of(&compiled.system).unwrap_or_else(|e| panic!("{e}"));
    detect(&LawOnData::of(law, data, &diagnose::Options::default()))
}

/// Makes a part of one column's readings wrong.
fn spoil(data: &mut Dataset, row: usize, share: f64, seed: u64) -> usize {
    let mut generator = Pcg64::seed_from_u64(seed + 1000);
    let mut spoilt = 0;
    for x in data.runs.iter_mut().flat_map(|run| run.values[row].iter_mut()) {
        if generator.random_range(0.0..1.0) < share {
            let size = generator.random_range(0.15..0.4);
            *x += if generator.random_range(0.0..1.0) < 0.5 { size } else { -size };
            spoilt += 1;
        }
    }
    spoilt
}

#[test]
fn outliers_are_found_in_their_column_and_counted() {
    for hidden in ["", "force q += -0.05*p"] {
        for seed in 0..10 {
            let mut data = swings(hidden, seed);
            let spoilt = spoil(&mut data, 0, 0.015, seed);
            let found = found(&data);
            assert_eq!(found.len(), 1, "{hidden}, {seed}: {found:?}");
            let first = &found[0];
            assert_eq!((first.effect.as_str(), first.on.as_str()), ("outliers", "q"));
            let count = first.share * 720.0;
            assert!((0.5..1.3).contains(&(count / spoilt as f64)), "{spoilt}: {first:?}");
            assert!(first.p_value < 1e-6 && (0.1..0.5).contains(&first.size), "{first:?}");
            assert!(first.sentence.contains("huber"));
        }
    }
}

#[test]
fn normal_noise_has_no_outliers_and_no_steps_whatever_the_model_lacks() {
    let hidden = [
        "",
        "force q += -0.05*p",
        "force q += -0.05*sign(p)",
        "force q += 0.3",
        "force q += 0.2*cos(2.3*t)",
        "force q += -20*(q - 0.5 + abs(q - 0.5))",
    ];
    let mut wrong = Vec::new();
    for (i, hidden) in hidden.iter().enumerate() {
        for seed in 0..8 {
            let found = found(&swings(hidden, 100 * i as u64 + seed));
            wrong.extend(found.into_iter().map(|found| format!("{hidden}: {}", found.sentence)));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn rounding_is_spoken_of_where_it_is_a_large_part_of_the_noise() {
    for seed in 0..6 {
        for (step, expected) in [(0.03, true), (0.05, true), (0.002, false)] {
            let mut data = swings("", seed);
            for x in data.runs.iter_mut().flat_map(|run| run.values[1].iter_mut()) {
                *x = (*x / step).round() * step;
            }
            let found = found(&data);
            if expected {
                assert_eq!(found.len(), 1, "{step}: {found:?}");
                assert_eq!((found[0].effect.as_str(), found[0].on.as_str()), ("quantisation", "p"));
                assert!((found[0].size - step).abs() < 1e-9, "{:?}", found[0]);
            } else {
                assert!(found.is_empty(), "{step}: {found:?}");
            }
        }
    }
}

#[test]
fn velocities_or_coordinates_alone_name_a_hidden_force() {
    let rows = [
        ("force q += -0.05*p", "viscous_drag(q)", 0.05),
        ("force q += 0.08*cos(1.7*t)", "harmonic_drive(q)", 0.08),
    ];
    for (hidden, effect, size) in rows {
        for observed in ["velocities v", "momenta p"] {
            let mut data = swings(hidden, 3);
            let momentum = if observed == "momenta p" { "p" } else { "p_q" };
            if observed == "momenta p" {
                data.runs.iter_mut().for_each(|run| run.values[1].fill(f64::NAN));
            }
            let spec =
                format!("coordinates q\n{observed}\nT = {momentum}^2/2\nV = span{{ cos(q) }}\n");
            let compiled = build("spec", &spec).unwrap_or_else(|error| panic!("{error}"));
            data.observables = compiled.system.observables();
            let split = data.split_held_out(0.25, 1);
            let model = fit(&compiled.system, &split.training, &Options::default(), &Silent)
                .unwrap_or_else(|error| panic!("{error}"));
            let (training, held_out) = (&split.training, &split.held_out);
            let law = model.law_of(&compiled.system).unwrap_or_else(|error| panic!("{error}"));
            let options = diagnose::Options::default();
            let found = diagnose(&compiled, &law, training, held_out, &options, &Silent)
                .unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(found.verdict, Verdict::Missing, "{observed}, {hidden}: {}", found.reason);
            let place = found.ranking.iter().position(|leader| leader.effect == effect);
            let tied = found.indistinguishable.iter().any(|name| name == effect);
            assert!(place == Some(0) || tied, "{observed}, {hidden}: {}", found.reason);
            let leader = &found.ranking[place.unwrap_or(0)];
            let first = leader.coefficient[0];
            let value = if size == 0.05 { first } else { first.hypot(leader.coefficient[1]) };
            let error = leader.standard_error[0];
            assert!((value - size).abs() < 5.0 * error, "{observed}: {value} +- {error}");
        }
    }
}

/// Going on from a model ends where learning from nothing does, and can change its mind.
#[test]
fn a_fit_that_goes_on_from_a_model_ends_where_a_fresh_one_does() {
    let data = swings("force q += -0.05*p", 2);
    let before = "coordinates q\nmomenta p\nT = p^2/2\nV = span{ poly(q; 6), cos(q) }\n";
    let after = format!("{before}effect viscous_drag(q)\n");
    let old = build("before", before).unwrap_or_else(|error| panic!("{error}"));
    let new = build("after", &after).unwrap_or_else(|error| panic!("{error}"));
    let options = Options::default();
    let model = fit(&old.system, &data, &options, &Silent).unwrap_or_else(|e| panic!("{e}"));
    let fresh = fit(&new.system, &data, &options, &Silent).unwrap_or_else(|e| panic!("{e}"));
    let added = new.system.terms_where(|term| term.effect.is_some());
    // From the model, and from one that holds a term too many.
    let with = |law: &Law, terms: &[TermId]| {
        let new = terms.iter().filter(|id| !law.support().contains(id));
        new.fold(law.clone(), |law, id| law.with_term(*id, 0.0).expect("its own term"))
    };
    let known = model.law(&old.system).expect("its own spec").on(&new.system);
    let start = with(&known, &added);
    let astray = with(&start, &new.system.term_ids()[..3]);
    for start in [start, astray] {
        let warm = resume(&start, &data, &options, &Silent).unwrap_or_else(|e| panic!("{e}"));
        let terms = |model: &leverrier::internals::fit::Model| -> Vec<String> {
            model.terms.iter().map(|t| format!("{} {}", t.place, t.term)).collect()
        };
        assert_eq!(terms(&warm), terms(&fresh));
        for (a, b) in warm.terms.iter().zip(&fresh.terms) {
            assert!((a.coefficient - b.coefficient).abs() < 0.1 * b.standard_error, "{a:?} {b:?}");
        }
        assert!((warm.evidence.error - fresh.evidence.error).abs() < 0.01);
    }
}
