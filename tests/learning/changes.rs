//! Changes of a story beyond one effect on one coordinate: groups, bodies, known numbers.

use leverrier::internals::diagnose::diagnosis::{Diagnosis, Verdict};

use crate::hidden::bases::Base;
use crate::hidden::case_of;

const TWO: Base = Base {
    name: "two",
    variables: "coordinates x1, y1, x2, y2\nmomenta px1, py1, px2, py2\n",
    law: "",
    space: "T = (px1^2 + py1^2)/2 + (px2^2 + py2^2)/(2*0.6)\n\
            V = (x1^2 + y1^2)/2 + 0.7*(x2^2 + y2^2)/2 + 0.3*((x1 - x2)^2 + (y1 - y2)^2)/2\n",
    starts: &[
        (-1.0, 1.0),
        (-1.0, 1.0),
        (-1.0, 1.0),
        (-1.0, 1.0),
        (-0.7, 0.7),
        (-0.7, 0.7),
        (-0.7, 0.7),
        (-0.7, 0.7),
    ],
    step: 0.1,
    hidden: &[],
};

const BALL: Base = Base {
    name: "ball",
    variables: "coordinates x, y\nmomenta px, py\n",
    law: "",
    space: "T = (px^2 + py^2)/2\nV = 1.5*y\n",
    starts: &[(0.0, 0.1), (0.0, 0.1), (0.8, 2.0), (0.8, 2.5)],
    step: 0.03,
    hidden: &[],
};

const RING: Base = Base {
    name: "ring",
    variables: "coordinates q1, q2\nmomenta p1, p2\n",
    law: "",
    space: "T = (p1^2 + p2^2)/2\nV = (q1^2 + q2^2)/2\n",
    starts: &[(-1.0, 1.0), (-1.0, 1.0), (-0.6, 0.6), (-0.6, 0.6)],
    step: 0.1,
    hidden: &[],
};

const MASSES: Base = Base {
    name: "masses",
    variables: "coordinates q1, q2\nmomenta p1, p2\n\
                constant first_mass = 1\nconstant second_mass = 1\n",
    law: "",
    space: "T = p1^2/(2*first_mass) + p2^2/(2*second_mass)\n\
            V = q1^2/2 + 0.8*q2^2/2 + 0.4*(q1 - q2)^2/2 + 0.1*q1^4\n",
    ..RING
};

/// What is said of data of a base whose spec differs from the truth by replaced texts.
fn said(base: &Base, changes: &[(&str, &str)], more: &str, noise: f64, seed: u64) -> Diagnosis {
    let known = format!("{}{}", base.variables, base.space);
    let truth = changes.iter().fold(known, |text, (from, to)| {
        assert!(text.contains(from), "{from} is not in {text}");
        text.replacen(from, to, 1)
    });
    let case = case_of(base, &format!("{truth}{more}"), noise, seed);
    case.diagnosis(&case.fit())
}

/// The first of the ranking has this label, and a number within 4 standard errors of the truth.
fn assert_first(found: &Diagnosis, label: &str, truth: f64) {
    assert_eq!(found.verdict, Verdict::Missing, "{}", found.reason);
    let first = &found.ranking[0];
    assert_eq!(first.effect, label, "{}", found.reason);
    let (value, error) = (first.coefficient[0], first.standard_error[0]);
    assert!((value - truth).abs() < 4.0 * error, "{label}: {value} +- {error}, not {truth}");
    assert!(error < 0.1 * truth.abs(), "{label}: {value} +- {error}");
    assert!(found.further.is_empty(), "{}", found.reason);
}

#[test]
fn a_drag_along_the_velocity_is_found_on_a_ball() {
    for (strength, noise, seed) in [(0.08, 0.01, 3), (0.03, 0.002, 11), (0.2, 0.02, 5)] {
        let more = format!(
            "force x += -{strength}*sqrt(px^2 + py^2)*px\n\
             force y += -{strength}*sqrt(px^2 + py^2)*py\n"
        );
        let found = said(&BALL, &[], &more, noise, seed);
        assert_first(&found, "drag_along_velocity(x, y)", strength);
    }
}

#[test]
fn a_drag_on_one_coordinate_stays_there() {
    let found = said(&BALL, &[], "force x += -0.1*px\n", 0.01, 4);
    assert_first(&found, "viscous_drag(x)", 0.1);
}

#[test]
fn one_drag_on_two_bodies_is_one_effect() {
    let each = ["x1", "y1", "x2", "y2"].map(|q| format!("force {q} += -0.03*p{q}\n"));
    let found = said(&TWO, &[], &each.concat(), 0.01, 6);
    assert_first(&found, "viscous_drag(x1, y1, x2, y2)", 0.03);
}

#[test]
fn a_ring_is_found_without_a_declared_body() {
    let found = said(&RING, &[], "V += 0.3*(q1^2 + q2^2)^2/4\n", 0.01, 5);
    assert_first(&found, "central_quartic(q1, q2)", 0.3);
}

#[test]
fn a_known_number_that_is_off_is_said_to_be_off() {
    for (mass, noise, seed) in [("1.15", 0.01, 7), ("0.9", 0.005, 8)] {
        let change = ("second_mass = 1", format!("second_mass = {mass}"));
        let found = said(&MASSES, &[(change.0, &change.1)], "", noise, seed);
        assert_first(&found, "number(second_mass)", mass.parse().expect("a number"));
        let number = found.ranking[0].number.clone().expect("a number");
        assert_eq!((number.was, number.line, number.column), (1.0, 4, 24));
        assert!(found.ranking[0].snippet.starts_with("constant second_mass = "));
    }
}
