//! A representative part of the benchmark of hidden effects: `cargo run --release --example
//! hidden_effects` runs the whole of it.

use std::collections::HashSet;

use crate::hidden::bases::{BASES, base};
use crate::hidden::design::{Colour, Kind, NOISES, PERIODS, Plan, REACHES, plans};
use crate::hidden::outcome::{Outcome, outcome};
use crate::hidden::pairs::PAIRS;
use crate::hidden::score::{Mark, Record, scored};
use crate::hidden::strangers::STRANGERS;
use crate::hidden::{case, statement};
use leverrier::internals::diagnose::diagnosis::Verdict;
use rayon::prelude::*;

use leverrier::internals::spec::effects::{ActsOn, EffectRow, by_name, catalogue};

fn hidden_in(name: &str, effect: &str, on: &[&str], noise: f64, seed: u64) -> Outcome {
    let arguments: Vec<String> = on.iter().map(|argument| argument.to_string()).collect();
    let label = by_name(effect).unwrap_or_else(|| panic!("no effect {effect}")).label(&arguments);
    outcome(&case(base(name), &statement(effect, on), noise, seed), &label)
}

/// Effects with states have tests of their own, and so have those of an input, which no system of
/// the benchmark has, and those that are a second one of another.
fn is_hidden_here(row: &EffectRow) -> bool {
    let alone = row.second_of.is_none() && row.on != ActsOn::Driven;
    !row.template.is_empty() && !row.has_states() && alone
}

#[test]
fn every_effect_with_a_statement_is_hidden_somewhere() {
    let hidden: HashSet<&str> =
        BASES.iter().flat_map(|base| base.hidden.iter().map(|(effect, _)| *effect)).collect();
    for row in catalogue().filter(|row| is_hidden_here(row)) {
        assert!(hidden.contains(row.name), "{} is hidden in no base", row.name);
    }
}

#[test]
fn effects_of_every_kind_are_named_and_bring_held_out_runs_to_the_noise() {
    let rows: [(&str, &str, &[&str]); 7] = [
        ("pendulum", "coulomb_friction", &["q"]),
        ("pendulum", "sensor_scale", &["q"]),
        ("Duffing", "contact_above", &["q"]),
        ("Duffing", "relativistic_kinetic", &["q"]),
        ("trap", "magnetic_gradient", &["x", "y"]),
        ("Kepler", "rotating_frame", &["x", "y"]),
        ("Henon-Heiles", "harmonic_drive", &["x"]),
    ];
    for (name, effect, on) in rows {
        let outcome = hidden_in(name, effect, on, 0.01, 1);
        let found = format!("{name}, {effect}: {:?} {:?}", outcome.place, outcome.group);
        assert_eq!(outcome.verdict, Verdict::Missing, "{found}");
        assert!(outcome.place.is_named(), "{found}");
        assert!(outcome.after.is_some_and(|after| after <= 1.1), "{found}: {:?}", outcome.after);
    }
}

#[test]
fn states_that_a_jump_kept_from_their_best_place_are_not_something_missing() {
    for (name, effect) in [("pendulum", "stribeck_friction"), ("Duffing", "coulomb_friction")] {
        let outcome = hidden_in(name, effect, &["q"], 0.01, 2);
        let found = format!("{name}, {effect}: {:?} {:?}", outcome.place, outcome.group);
        assert_eq!(outcome.verdict, Verdict::Missing, "{found}");
        assert!(outcome.place.is_named(), "{found}");
    }
}

#[test]
fn nothing_is_named_where_nothing_is_hidden() {
    for name in ["pendulum", "Duffing", "trap", "Kepler", "Henon-Heiles"] {
        for (noise, seed) in [(0.01, 1), (0.05, 2)] {
            let outcome = outcome(&case(base(name), "", noise, seed), "");
            let reason = &outcome.diagnosis.reason;
            assert_eq!(outcome.verdict, Verdict::NothingMissing, "{name}, noise {noise}: {reason}");
        }
    }
}

#[test]
#[ignore = "long"]
fn what_no_catalogue_has_is_composed_where_a_term_says_it() {
    for stranger in STRANGERS.iter().filter(|stranger| stranger.name == "bump") {
        let outcome = outcome(&stranger.case(0.01, 1), stranger.name);
        let reason = &outcome.diagnosis.reason;
        assert_eq!(outcome.verdict, Verdict::Missing, "{}: {reason}", stranger.base);
        let story = &outcome.diagnosis.story;
        // With its centre as a number of its own, or at one that it happens to have.
        let is_bump = |label: &str| label.starts_with("V exp(") || label.starts_with("bump");
        assert!(story.len() == 1 && is_bump(&story[0].effect), "{}: {reason}", stranger.base);
    }
}

#[test]
#[ignore = "long"]
fn what_no_term_says_is_not_explained() {
    // A force that comes late by d is -d times its derivative along the motion to first order: for
    // a pendulum a damping that feeds energy for small angles and takes it beyond, and to second
    // order another spring. That part is there.
    let late = ["self_excitation(q)", "negative_damping(q)", "linear_spring(q)"];
    for stranger in STRANGERS.iter().filter(|stranger| stranger.name != "bump") {
        let outcome = outcome(&stranger.case(0.01, 1), stranger.name);
        let reason = &outcome.diagnosis.reason;
        let whole = matches!(outcome.verdict, Verdict::Missing | Verdict::NothingMissing);
        assert!(!whole && outcome.diagnosis.story.is_empty(), "{}: {reason}", stranger.base);
        let is_there = |part: &str| stranger.name == "delay" && late.contains(&part);
        let mut parts = outcome.diagnosis.partial.iter().map(|part| part.effect.as_str());
        assert!(parts.all(is_there), "{} of {}: {reason}", stranger.name, stranger.base);
    }
}

#[test]
#[ignore = "long"]
fn two_effects_at_once_are_discovered_and_nothing_else() {
    for pair in PAIRS {
        let (found, effects) = pair.discovered(0.01, 1);
        assert_eq!(effects, pair.effects, "{}", found.stop);
    }
}

#[test]
fn any_first_part_of_the_design_is_a_sample_of_it() {
    let all = plans(2400);
    for count in [240, 2400] {
        let here = &all[..count];
        let of = |kind: Kind| here.iter().filter(|plan| plan.kind == kind).count();
        for (kind, share) in Kind::SHARES {
            assert_eq!(of(kind), share * count / 24, "{kind:?}");
        }
        let evenly = |what: &str, levels: usize, is: &dyn Fn(&Plan, usize) -> bool| {
            for level in 0..levels {
                let met = here.iter().filter(|plan| is(plan, level)).count();
                let expected = count / levels;
                assert!(met.abs_diff(expected) < count / 20, "{what} {level}: {met} of {count}");
            }
        };
        evenly("strength", REACHES.len(), &|plan, level| plan.reach == REACHES[level]);
        evenly("noise", NOISES.len(), &|plan, level| plan.noise == NOISES[level]);
        evenly("turns", PERIODS.len(), &|plan, level| plan.periods == PERIODS[level]);
    }
    let alone: HashSet<String> = all
        .iter()
        .filter(|plan| plan.kind == Kind::Single)
        .flat_map(Plan::labels)
        .filter_map(|label| Some(label.split_once('(')?.0.to_string()))
        .collect();
    for row in catalogue().filter(|row| is_hidden_here(row)) {
        assert!(alone.contains(row.name), "{} is hidden nowhere", row.name);
    }
}

/// A part of the design that takes little: the shortest runs of at most two coordinates before
/// white noise. The example runs the whole of it.
#[test]
#[ignore = "long"]
fn of_a_part_of_the_design_nothing_false_is_told() {
    let cheap = |plan: &&Plan| {
        let short = plan.periods == PERIODS[0] && plan.base.starts.len() <= 4;
        let at_once = matches!(plan.kind, Kind::Nothing | Kind::Single | Kind::Group);
        let white = plan.noise > 0.0 && plan.colour == Colour::White;
        let moderate = plan.kind == Kind::Nothing || (0.1..1.5).contains(&plan.reach);
        short && at_once && white && moderate
    };
    let all = plans(800);
    let part: Vec<&Plan> = all.iter().filter(cheap).take(20).collect();
    // Threads that wait take up other cases: how long one takes says little here.
    let whole = |plan: &Plan| scored(plan, f64::INFINITY);
    let records: Vec<Record> = part.into_par_iter().map(whole).collect();
    let count = |mark: Mark| records.iter().filter(|one| one.mark() == mark).count();
    let told: Vec<String> = records
        .iter()
        .map(|one| format!("{} {:?} {:.1} s: {}", one.number, one.mark(), one.seconds, one.reason))
        .collect();
    let told = told.join("\n");
    println!("{told}");
    let named = |one: &&Record| one.is(Kind::Nothing) && one.mark() != Mark::Right;
    assert_eq!(records.iter().filter(named).count(), 0, "{told}");
    assert!(count(Mark::Wrong) + count(Mark::Beside) <= 1, "{told}");
    assert!(count(Mark::Right) >= 14, "{told}");
}
