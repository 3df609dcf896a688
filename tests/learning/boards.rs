//! How the example `boards` judges: whether a law has the terms of the truth.

#[allow(dead_code, reason = "the example uses the rest")]
#[path = "../../examples/boards/expression.rs"]
mod expression;
#[allow(dead_code, reason = "the example uses the rest")]
#[path = "../../examples/boards/motion.rs"]
mod motion;
#[allow(dead_code, reason = "the example uses the rest")]
#[path = "../../examples/boards/terms.rs"]
mod terms;

use std::collections::HashMap;

use expression::Expression;
use leverrier::Spec;
use terms::{compared, form, judged, learned};

fn read(text: &str) -> Expression {
    Expression::parse(text, &HashMap::new()).unwrap_or_else(|error| panic!("{error}"))
}

/// How many terms are missing, and how many are beside.
fn counts(truth: &str, law: &str) -> (usize, usize) {
    let terms = |text| terms::terms(&read(text)).expect("few terms");
    let found = compared(&terms(truth), &terms(law), &[]).expect("few terms");
    (found.missing.len(), found.beside.len())
}

#[test]
fn laws_written_otherwise_have_the_same_terms() {
    for (truth, law) in [
        ("-0.7*v*(1 - x^2) - 1.4*x", "0.3*x*x*v - 2*v + 5*x"),
        ("(cos(x) - 0.93)*sin(x)", "sin(x)*cos(x)/2 - 3*sin(x)"),
        ("-x*(0.05*t + 1) - x", "-2*x - 0.1*t*x"),
        ("-x**3 + sin(t)", "-(x^3) + 0.9*sin(1.002*t) + 0.01*cos(1.002*t)"),
        ("-abs(v)^0.333333333333333", "-0.5*abs(v)^0.34"),
        ("-x*exp(-abs(x))", "-1.1*x*exp(-abs(x)/1.01)"),
        ("v - v^3 + v^3 - 2e-3*v", "v"),
    ] {
        assert_eq!(counts(truth, law), (0, 0), "{truth} and {law}");
    }
}

#[test]
fn other_functions_are_other_terms() {
    for (truth, law) in [
        ("-sin(v)", "-v"),
        ("-sin(v)", "-tanh(0.9*v)"),
        ("-log(abs(v) + 1)", "-0.69*abs(v)^0.65"),
        ("-exp(-abs(x))", "-exp(-x^2/1.1)"),
        ("sin(t)", "sin(t) + cos(t)"),
        ("-abs(v)^0.333333333333333", "-sign(v)*abs(v)^0.34"),
    ] {
        assert_eq!(counts(truth, law), (1, 1), "{truth} and {law}");
    }
    assert_eq!(counts("-x - v", "-x"), (1, 0));
    assert_eq!(counts("-x", "-x - 0.01*v"), (0, 1));
}

#[test]
fn a_learned_potential_is_compared_by_its_force() {
    let truth = read("-4*x^3 - 0.5*x");
    let spec = Spec::parse("coordinates x; momenta v; time t\nT = v^2/2\nV = span{ poly(x; 4) }")
        .expect("a sound spec");
    let times = motion::times(10.0, 200);
    let run = motion::motion(&truth, [1.0, 0.0], &times).expect("a bounded motion");
    let column = |i: usize| run.iter().map(|state| state[i]).collect::<Vec<f64>>();
    let data = leverrier::Data::from_slices(&spec, &times, &[&column(0), &column(1)]);
    let law = spec.fit(&data.expect("columns of one length")).expect("a law");
    let same = |truth: &str| judged(&read(truth), &learned(&law, None), &[]).expect("few terms");
    let found = same("-4*x^3 - 0.5*x");
    assert!(found.missing.is_empty() && found.beside.is_empty(), "{found:?}");
    assert_eq!(same("-4*x^3 - 0.5*x - v").missing, ["-1 v"]);
    assert_eq!(same("-4*x^3").beside.len(), 1);
    let off = motion::error(&law, &[run], &times).expect("a motion of x and v");
    assert!(off < 1e-8, "{off}");
}

#[test]
fn forms_that_are_named_beside_a_law_are_found_among_what_it_lacks() {
    let terms = |text| terms::terms(&read(text)).expect("few terms");
    let (truth, law) = (terms("-x - 0.3*v*exp(-abs(x)) + 0.1*v"), terms("-x + 0.2*v*abs(x)"));
    let named = |labels: &[&str]| {
        let forms: Vec<Expression> = labels.iter().filter_map(|label| form(label)).collect();
        let forms: Vec<_> =
            forms.iter().flat_map(|form| terms::terms(form).expect("few terms")).collect();
        compared(&truth, &law, &forms).expect("few terms").named
    };
    assert_eq!(named(&[]), 0);
    assert_eq!(named(&["force on x: v*exp(-abs(x))", "harmonic_drive(x)"]), 1);
    assert_eq!(named(&["force on x: v*exp(-abs(x))", "viscous_drag(x)", "V x^4"]), 2);
    assert_eq!(named(&["V x^2", "force on x: v*exp(-x^2)"]), 0);
}

/// Asks noisy motions of a law for it, drawn from two seeds; all of it must be there, and nothing
/// else.
fn found_in_noise(truth: &str, (motions, noise): (&str, &str)) {
    let truth = read(truth);
    let times = motion::times(20.0, 300);
    let starts = motion::Square { inner: 0.0, outer: 1.5 };
    let runs = motion::drawn(&truth, starts, 6, &times, motion::seed(motions));
    let runs = motion::noisy(&runs.expect("bounded motions"), 0.01, motion::seed(noise));
    let spec = Spec::parse("coordinates x; momenta v; time t\nT = v^2/2\nV = span{ poly(x; 4) }")
        .expect("a sound spec");
    let mut data = leverrier::Data::empty(&spec);
    for run in &runs {
        let column = |i: usize| run.iter().map(|state| state[i]).collect::<Vec<f64>>();
        data = data.with_run(&times, &[&column(0), &column(1)]).expect("columns of one length");
    }
    let (training, held_out) = data.split(0.25, 0).expect("whole runs");
    let options = leverrier::DiscoveryOptions::default();
    let found = spec.discover(&training, &held_out, &options, &leverrier::Silent).expect("a law");
    assert_eq!(found.verdict(), leverrier::Verdict::NothingMissing);
    let terms = judged(&truth, &learned(found.law(), None), &[]).expect("few terms");
    assert!(terms.missing.is_empty() && terms.beside.is_empty(), "{terms:?}");
}

#[test]
fn a_drive_and_two_drags_and_a_spring_are_found_in_noise() {
    let truth = "-2.9*x^3 - 0.09*v^3 - 0.6*v*exp(-abs(v)) + 0.57*sin(t)";
    found_in_noise(truth, ("two drags", "two drags"));
}

/// `v/(1 + x^2)`, another mass, an excitation and the scale of a sensor explain these motions to
/// 1.04 times the noise.
#[test]
fn two_members_are_found_where_five_others_explain_the_data() {
    let truth = "-0.372947617362308*v*exp(-abs(x)) + 0.156062620221068*sin(t)";
    found_in_noise(truth, ("PO36", "PO36, noise of 1 %"));
}

#[test]
fn motions_are_exact_and_end_where_they_leave_every_bound() {
    let times = motion::times(20.0, 300);
    let run = motion::motion(&read("-x"), [1.0, 0.0], &times).expect("a bounded motion");
    for (time, state) in times.iter().zip(&run) {
        assert!((state[0] - time.cos()).abs() < 1e-9, "{time}: {state:?}");
    }
    assert_eq!(motion::motion(&read("x^3"), [1.0, 1.0], &times), None);
}

#[test]
fn what_is_no_law_is_refused_in_a_sentence() {
    let deep = "(".repeat(4000);
    for text in ["", "x +", "(x", "x)", "foo(x)", "y", "1e", "x ? 2", "-", "sin", "é", &deep] {
        let error = Expression::parse(text, &HashMap::new()).expect_err(text);
        assert!(error.contains(' '), "{error}");
    }
}
