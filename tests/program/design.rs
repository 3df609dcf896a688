//! The next run worth measuring, as a user asks for it.

use std::fs;

use crate::support::program::{good, json, run};
use tempfile::TempDir;

const TRUTH: &str = "coordinates theta\nmomenta p\nT = p^2/2\nV = -cos(theta)\n";
const SPEC: &str = "system \"pendulum\"
coordinates theta
momenta p
data \"swings.csv\" { time t  run run }
T = p^2/2
V = span{ weight: cos(theta) }
";

/// Swings of a pendulum with a force in it, and a spec that does not know of the force.
fn bench(force: &str) -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let write = |name: &str, text: &str| {
        fs::write(folder.path().join(name), text).expect("written");
    };
    write("truth.ham", &format!("{TRUTH}{force}"));
    write("s.ham", SPEC);
    write("known.ham", &format!("{TRUTH}data \"swings.csv\" {{ time t  run run }}\n"));
    write("bare.ham", "coordinates theta\nmomenta p\nT = p^2/2\nV = span{ cos(theta) }\n");
    let make = "simulate truth.ham --start 0.9,0 --start 0.93,0 --start 0.9,0.1 --start 0.92,0.05 \
                --dt=0.1 --samples=61 --noise=0.02 --seed=3 -o swings.csv";
    good(folder.path(), &make.split_whitespace().collect::<Vec<_>>());
    folder
}

#[test]
fn a_run_is_proposed_between_two_effects_and_can_be_simulated() {
    let folder = bench("force theta += -0.03*p\n");
    let words = "design s.ham --between viscous_drag coulomb_friction(theta) --within theta=0.4..1.1 \
                 --within p=-0.2..0.5 --duration 8 --step 0.1";
    let words: Vec<&str> = words.split_whitespace().collect();
    let plan = json(folder.path(), &words, "leverrier.design/2");
    assert_eq!(plan["rivals"][0]["effect"], "viscous_drag(theta)");
    assert_eq!(plan["rivals"][1]["effect"], "coulomb_friction(theta)");
    let best = &plan["best"];
    let start = |at: usize| best["start"][at]["value"].as_f64().expect("a number");
    assert!((0.4..=1.1).contains(&start(0)) && (-0.2..=0.5).contains(&start(1)), "{best}");
    assert_eq!((&best["duration"], &best["samples"]), (&8.0.into(), &81.into()));
    let gain = |of: &serde_json::Value, at: usize| {
        of["gains"][at]["deviance"].as_f64().expect("a deviance")
    };
    for at in 0..2 {
        assert!(gain(&best["expected"], at) > gain(&plan["repeat"], at), "{plan}");
    }

    let text = good(folder.path(), &words).out;
    for part in ["as asked for", "Measure a run that starts at", "true effect", "a repeat"] {
        assert!(text.contains(part), "{part} in {text}");
    }
    good(folder.path(), &["fit", "s.ham"]);
    let line = plan["simulate"].as_str().expect("a command");
    assert!(text.contains(line), "{text}");
    let words: Vec<&str> = line.split_whitespace().skip(1).collect();
    assert_eq!(good(folder.path(), &words).out.lines().count(), 82);
}

#[test]
fn what_is_tied_is_settled_by_the_run_that_is_proposed() {
    let folder = bench("force theta += -0.03*p\n");
    let rivals = |plan: &serde_json::Value| -> Vec<String> {
        let rivals = plan["rivals"].as_array().expect("rivals").iter();
        rivals.map(|rival| rival["effect"].as_str().expect("a name").to_string()).collect()
    };
    let before = json(folder.path(), &["design", "s.ham"], "leverrier.design/2");
    let tied = rivals(&before);
    assert!(tied.contains(&"viscous_drag(theta)".to_string()) && tied.len() > 2, "{before}");
    let line = before["simulate"].as_str().expect("a command").replace("s.ham", "truth.ham");
    let line = format!("{line} --noise 0.02 --seed 77 -o next.csv");
    good(folder.path(), &line.split_whitespace().skip(1).collect::<Vec<_>>());
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).expect("a table");
    let new = read("next.csv");
    let rows: String = new.lines().skip(1).map(|row| format!("5,{row}\n")).collect();
    fs::write(folder.path().join("swings.csv"), read("swings.csv") + &rows).expect("written");
    // Whichever runs are held out.
    for seed in ["0", "1", "2"] {
        let words = ["design", "s.ham", "--seed", seed];
        let after = json(folder.path(), &words, "leverrier.design/2");
        let why = after["why"].as_str().expect("a sentence");
        assert!(why.contains("viscous_drag(theta) is missing"), "{why}");
        assert_eq!(rivals(&after).len(), 0, "{after}");
    }
}

#[test]
fn without_a_tie_the_worst_coefficient_is_measured() {
    let folder = bench("");
    let plan = json(folder.path(), &["design", "s.ham"], "leverrier.design/2");
    assert!(plan["why"].as_str().expect("a sentence").contains("Nothing is missing"), "{plan}");
    assert_eq!(plan["coefficient"]["what"], "weight");
    let error = |of: &serde_json::Value| of.as_f64().expect("an error");
    let promised = error(&plan["best"]["expected"]["standard_error"]);
    assert!(promised < error(&plan["coefficient"]["standard_error"]), "{plan}");
    assert!(promised <= error(&plan["repeat"]["standard_error"]), "{plan}");
    let asked = ["design", "s.ham", "--coefficient", "cos(theta)"];
    let text = good(folder.path(), &asked).out;
    assert!(text.contains("The standard error of weight"), "{text}");
}

#[test]
fn bad_wishes_are_refused_with_the_reason() {
    let folder = bench("");
    for (wish, code, says) in [
        ("s.ham --within thta=-1..1", 2, "did you mean `theta`?"),
        ("s.ham --within theta=1..-1", 2, "the range 1..-1 is empty"),
        ("s.ham --within theta", 2, "--within theta=-1..1"),
        ("s.ham --stay theta=5..6 --coefficient weight", 1, "stays within its bounds"),
        ("s.ham --duration=-1", 2, "--duration must be positive"),
        ("s.ham --duration 1..x", 2, "is not a number"),
        ("s.ham --duration 1 --step 2 --coefficient weight", 2, "is not possible"),
        ("s.ham --coefficient wight", 2, "did you mean `weight`?"),
        ("s.ham --between viscous_drag", 2, "two or more"),
        ("s.ham --between viscous_drag viscous_drag(theta)", 2, "named twice"),
        ("s.ham --between viscous_drag viscos_drag", 2, "did you mean `viscous_drag`?"),
        ("s.ham --between viscous_drag magnetic_force", 2, "it needs two coordinates"),
        ("s.ham --between viscous_drag tilt --coefficient weight", 2, "cannot be used with"),
        ("bare.ham", 2, "does not name its data"),
        ("known.ham", 1, "nothing is missing and nothing is learned"),
        ("none.ham", 1, "there is no such file"),
    ] {
        let words: Vec<&str> = ["design"].into_iter().chain(wish.split_whitespace()).collect();
        let done = run(folder.path(), &words);
        assert_eq!(done.code, Some(code), "{wish}: {}", done.err);
        assert!(done.err.contains(says), "{wish}: {}", done.err);
        assert_eq!(done.out, "", "{wish}");
    }
}
