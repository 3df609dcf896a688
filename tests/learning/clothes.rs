//! The same answer in any clothes: units of length, mass and time, signs, the order of runs, and a
//! run that was recorded in two parts.

use leverrier::internals::data::Dataset;
use leverrier::internals::diagnose::diagnosis::{Diagnosis, Verdict};
use leverrier::internals::expr::{System, build};
use leverrier::internals::simulate::Simulator;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use crate::hidden::bases::base;
use crate::hidden::{Case, case, statement};
use crate::paper::{henon_heiles, learn};

/// A pendulum with a drag that the spec lacks.
fn plain() -> Case {
    case(base("pendulum"), &statement("viscous_drag", &["q"]), 0.01, 2)
}

/// The case in other units: those of length, mass and time are so many times smaller.
fn dressed(length: f64, mass: f64, time: f64) -> Case {
    let plain = plain();
    let momentum = mass * length / time;
    let energy = momentum * length / time;
    let text = format!(
        "coordinates q\nmomenta p\n\
         T = {energy:e}*(p/({momentum:e}))^2/2\nV = span{{ cos(q/({length:e})) }}\n"
    );
    let dress = |data: &leverrier::internals::data::Dataset| {
        let mut data = data.clone();
        for run in &mut data.runs {
            run.times.iter_mut().for_each(|t| *t *= time);
            for (values, unit) in run.values.iter_mut().zip([length, momentum]) {
                values.iter_mut().for_each(|x| *x *= unit);
            }
        }
        data
    };
    Case {
        compiled: build("dressed", &text).unwrap_or_else(|error| panic!("{text}\n{error}")),
        text,
        training: dress(&plain.training),
        held_out: dress(&plain.held_out),
        noise: vec![plain.noise[0] * length.abs(), plain.noise[1] * momentum.abs()],
    }
}

fn diagnosis(case: &Case) -> Diagnosis {
    let found = case.diagnosis(&case.fit());
    assert_eq!(found.verdict, Verdict::Missing, "{}", found.reason);
    let names: Vec<&str> = found.story.iter().map(|one| one.effect.as_str()).collect();
    assert_eq!(names, ["viscous_drag(q)"], "{}", found.reason);
    found
}

#[test]
fn units_and_signs_change_neither_names_nor_numbers() {
    let told = diagnosis(&plain());
    let as_before = |found: &Diagnosis| {
        let others = |found: &Diagnosis| found.indistinguishable.clone();
        assert_eq!(others(found), others(&told));
        (found.story[0].coefficient[0], found.story[0].standard_error[0])
    };
    let (drag, error) = as_before(&told);
    for (length, mass, time) in [
        (1e12, 1.0, 1.0),
        (1e-12, 1.0, 1.0),
        (1.0, 1e12, 1.0),
        (1.0, 1e-12, 1.0),
        (1.0, 1.0, 1e12),
        (1.0, 1.0, 1e-12),
        (-1.0, 1.0, 1.0),
    ] {
        let (dressed, its_error) = as_before(&diagnosis(&dressed(length, mass, time)));
        // A drag is one over a time.
        let (value, of_error) = (dressed * time / drag, its_error * time / error);
        assert!((value - 1.0).abs() < 1e-6, "{length} {mass} {time}: {value}");
        assert!((of_error - 1.0).abs() < 1e-3, "{length} {mass} {time}: {of_error}");
    }
}

#[test]
fn neither_the_order_of_runs_nor_a_pause_changes_a_name() {
    let told = diagnosis(&plain());
    let (drag, error) = (told.story[0].coefficient[0], told.story[0].standard_error[0]);
    let mut turned = plain();
    turned.training.runs.reverse();
    turned.held_out.runs.reverse();
    let mut paused = plain();
    let mut second = paused.training.runs[0].clone();
    let first = &mut paused.training.runs[0];
    let half = first.times.len() / 2;
    let rest = (second.times.split_off(half), second.lines.split_off(half));
    first.times.truncate(half);
    first.lines.truncate(half);
    (second.times, second.lines) = rest;
    for (before, after) in first.values.iter_mut().zip(&mut second.values) {
        *after = before.split_off(half);
    }
    second.name += " again";
    paused.training.runs.push(second);
    for (case, apart) in [(turned, 1e-3), (paused, 0.5)] {
        let found = diagnosis(&case);
        let value = found.story[0].coefficient[0];
        assert!((value - drag).abs() < apart * error, "{value} {drag} +- {error}");
    }
}

/// The spec of orbits of which nobody measures a momentum.
const UNSEEN: &str = "coordinates q[1..2]\nmomenta p[1..2]\n\
                      data \"orbits.csv\" { time t, run run, p not measured }\n\
                      T = span{ tensor(p; 3) }\nV = span{ tensor(q; 3) }\n";

/// Eight orbits of 200 samples, their coordinates with noise and nothing of their momenta.
fn orbits(truth: &System, step: f64, sigma: f64) -> Dataset {
    let mut generator = Pcg64::seed_from_u64(5);
    let starts: Vec<Vec<f64>> =
        (0..8).map(|_| (0..4).map(|_| generator.random_range(-0.25..0.25)).collect()).collect();
    let times: Vec<f64> = (0..200).map(|i| step * f64::from(i)).collect();
    let simulator = Simulator::new(truth, &[], &[], &[]).expect("the law is whole");
    let mut data = simulator.trajectories(&starts, &times).expect("bound").dataset(truth);
    for run in &mut data.runs {
        let (coordinates, momenta) = run.values.split_at_mut(2);
        for x in coordinates.iter_mut().flatten() {
            let noise: f64 = StandardNormal.sample(&mut generator);
            *x += sigma * noise;
        }
        momenta.iter_mut().for_each(|column| column.fill(f64::NAN));
    }
    data
}

/// Where momenta are not measured: numbers learned from runs in one order are those from another,
/// whatever integrators were chosen on the way, and no start of a segment matters.
#[test]
fn coordinates_alone_give_one_law_in_any_order_of_runs() {
    let compiled = build("galaxy", UNSEEN).unwrap_or_else(|error| panic!("{error}"));
    let law = henon_heiles();
    let truth = build("truth", &law.spec).unwrap_or_else(|error| panic!("{error}")).system;
    for (step, noise) in [(0.2, 0.002), (0.4, 0.0006)] {
        let data = orbits(&truth, step, noise);
        let learned = |data: &Dataset| learn(&compiled.system, data);
        let model = learned(&data);
        let names: Vec<&str> = model.terms.iter().map(|term| term.term.as_str()).collect();
        assert_eq!(names, ["p[1]^2", "p[2]^2", "q[1]^2", "q[2]^2", "q[1]^2*q[2]", "q[2]^3"]);
        for first in [2, 4, 6] {
            let mut turned = data.clone();
            turned.runs.rotate_left(first);
            let turned = learned(&turned);
            assert_eq!(turned.terms.len(), model.terms.len());
            for (one, other) in turned.terms.iter().zip(&model.terms).skip(1) {
                assert_eq!(one.term, other.term);
                let apart = (one.coefficient - other.coefficient).abs() / other.standard_error;
                assert!(apart < 0.02, "{}: {apart} standard errors", one.term);
            }
        }
    }
}
