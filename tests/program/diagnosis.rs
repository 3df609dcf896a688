//! Where a model fails, what is missing, adding it, taking it back: as a user does it.

use std::fs;

use crate::support::program::{good, json, run};
use tempfile::TempDir;

const TRUTH: &str = "system \"pendulum\"
coordinates theta
momenta p
time t
T = p^2/2
V = -1.3*cos(theta)
force theta += -0.05*p
";

const SPEC: &str = "# a bench, a Tuesday
system \"pendulum\"
coordinates theta
momenta p
time t
data \"swings.csv\" { time t  run run }   # eight swings

T = p^2/2
V = span{ cos(theta) }   # no drag here
";

/// Eight swings of a pendulum with a drag that the spec does not have.
fn bench() -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("truth.ham"), TRUTH).expect("written");
    fs::write(folder.path().join("s.ham"), SPEC).expect("written");
    let make = "simulate truth.ham --runs 8 --sample theta=-1.8..1.8 --sample p=-1..1 --dt=0.1 \
                --samples=120 --noise=1% --seed=5 -o swings.csv";
    good(folder.path(), &make.split_whitespace().collect::<Vec<_>>());
    folder
}

#[test]
fn the_loop_finds_adds_and_takes_back_a_hidden_drag() {
    let folder = bench();
    let path = folder.path();
    let compared = json(path, &["compare", "s.ham"], "leverrier.compare/2");
    let findings = compared["findings"].as_array().expect("findings");
    let loses = findings.iter().filter_map(|f| f.as_str()).any(|f| f.contains("loses energy"));
    assert!(loses, "{findings:?}");
    assert_eq!(compared["split"]["held_out"].as_array().map(Vec::len), Some(2));

    let found = json(path, &["diagnose", "s.ham"], "leverrier.diagnose/2");
    assert_eq!(found["verdict"], "missing", "{found}");
    assert_eq!(found["ranking"][0]["effect"], "viscous_drag(theta)", "{found}");

    let added = json(path, &["add", "s.ham", "viscous_drag"], "leverrier.add/2");
    let error = |side: &str| added[side]["held_out_error"].as_f64().expect("an error");
    let floor = added["after"]["noise_floor"].as_f64().expect("a floor");
    assert!(error("before") > 1.5 * error("after"), "{added}");
    assert!(error("after") < 1.1 * floor, "{added}");
    assert_eq!(added["supported"], true, "{added}");
    let value = added["effect"][0]["coefficient"].as_f64().expect("a coefficient");
    assert!((value - 0.05).abs() < 0.005, "{value}");
    let text = fs::read_to_string(path.join("s.ham")).expect("the spec");
    assert_eq!(text.replace("effect viscous_drag(theta)\n", ""), SPEC);

    let twice = run(path, &["add", "s.ham", "viscous_drag(theta)"]);
    assert_eq!(twice.code, Some(2));
    assert!(twice.err.contains("already"), "{}", twice.err);
    let listed = json(path, &["history", "s.ham"], "leverrier.history/2");
    assert_eq!(listed["revisions"].as_array().map(Vec::len), Some(2));
    assert!(good(path, &["history", "s.ham"]).out.contains("add viscous_drag(theta)"));

    good(path, &["undo", "s.ham"]);
    assert_eq!(fs::read_to_string(path.join("s.ham")).expect("the spec"), SPEC);
    assert!(!path.join("s.model.json").exists());
    let again = run(path, &["undo", "s.ham"]);
    assert_eq!(again.code, Some(2));
    assert!(again.err.contains("nothing to undo"), "{}", again.err);
}

#[test]
fn the_catalogue_is_listed_and_explained() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let all = json(folder.path(), &["effects"], "leverrier.effects/1");
    let effects = all["effects"].as_array().expect("effects");
    assert!(effects.len() >= 36);
    for effect in effects {
        let name = effect["name"].as_str().expect("a name");
        let done = good(folder.path(), &["effects", name]);
        for field in ["physics", "reference"] {
            let words = effect[field].as_str().expect("a text").split(' ').take(2);
            assert!(words.into_iter().all(|word| done.out.contains(word)), "{name}: {}", done.out);
        }
        assert!(!done.out.contains('{') || done.out.contains("span{"), "{}", done.out);
    }
    let wrong = run(folder.path(), &["effects", "viscos_drag"]);
    assert_eq!(wrong.code, Some(2));
    assert!(wrong.err.contains("did you mean `viscous_drag`?"), "{}", wrong.err);
}

#[test]
fn effects_that_cannot_be_are_refused_with_the_reason() {
    let folder = bench();
    for (command, effect, says) in [
        ("add", "viscos_drag", "did you mean `viscous_drag`?"),
        ("add", "magnetic_force", "it needs two coordinates"),
        ("add", "viscous_drag(phi)", "cannot be on `phi`"),
        ("add", "viscous_drag(theta, theta)", "not on `theta` twice"),
        ("add", "outliers", "no term of a model"),
        ("remove", "viscous_drag", "does not have"),
    ] {
        let done = run(folder.path(), &[command, "s.ham", effect]);
        assert_eq!(done.code, Some(2), "{effect}: {}", done.err);
        assert!(done.err.contains(says), "{effect}: {}", done.err);
    }
    assert_eq!(fs::read_to_string(folder.path().join("s.ham")).expect("the spec"), SPEC);
    assert!(good(folder.path(), &["history", "s.ham"]).out.contains("no revisions"));
}

#[test]
fn the_demo_ends_at_the_noise_floor_with_the_truth_beside() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let shown = good(folder.path(), &["demo", "--quick"]).out;
    for line in
        ["loses energy", "Missing: viscous_drag(q)", "The data support it", "The truth, and"]
    {
        assert!(shown.contains(line), "{line} in {shown}");
    }
    assert!(shown.contains("Nothing is missing"), "{shown}");
    // The last lines: part, term, truth, found, off by.
    let row = |term: &str| {
        let line = shown.lines().rev().find(|line| line.contains(term)).expect("a row");
        line.split_whitespace().last().and_then(|x| x.parse::<f64>().ok()).expect("a number")
    };
    assert!(row(" cos(q) ").abs() < 4.0 && row(" -p ").abs() < 4.0, "{shown}");
    assert!(!shown.contains(&*folder.path().to_string_lossy()) && !shown.contains("/tmp"));
    let object = json(folder.path(), &["demo", "--quick"], "leverrier.demo/2");
    assert_eq!(object["demo"], "missing-drag");
    assert_eq!(object["steps"][0]["effect"], object["truth"]["hidden"]);
}

#[test]
fn discover_writes_what_pays_and_keeps_the_comments() {
    let folder = bench();
    let found = json(folder.path(), &["discover", "s.ham"], "leverrier.discover/2");
    assert_eq!(found["verdict"], "nothing_missing");
    assert_eq!(found["steps"].as_array().map(Vec::len), Some(1));
    assert_eq!(found["steps"][0]["effect"], "viscous_drag(theta)");
    let text = fs::read_to_string(folder.path().join("s.ham")).expect("the spec");
    assert!(text.contains("# a bench, a Tuesday") && text.contains("effect viscous_drag(theta)"));
    good(folder.path(), &["undo", "s.ham"]);
    assert_eq!(fs::read_to_string(folder.path().join("s.ham")).expect("the spec"), SPEC);
}

/// Numbers of a JSON value, in the order in which they stand.
fn numbers(value: &serde_json::Value, found: &mut Vec<f64>) {
    match value {
        serde_json::Value::Number(number) => found.extend(number.as_f64()),
        serde_json::Value::Array(items) => items.iter().for_each(|item| numbers(item, found)),
        serde_json::Value::Object(fields) => fields.values().for_each(|v| numbers(v, found)),
        _ => {}
    }
}

#[test]
fn the_order_of_the_runs_and_copies_of_them_change_no_answer() {
    let folder = bench();
    let path = folder.path();
    let ask = |name: &str| {
        let found = json(path, &["diagnose", name], "leverrier.diagnose/2");
        let mut all = Vec::new();
        numbers(&found["ranking"], &mut all);
        let effects: Vec<String> = found["ranking"]
            .as_array()
            .expect("a ranking")
            .iter()
            .map(|one| one["effect"].as_str().expect("a name").to_string())
            .collect();
        (found["verdict"].clone(), effects, all)
    };
    let plain = ask("s.ham");
    let text = fs::read_to_string(path.join("swings.csv")).expect("measurements");
    let (header, rows) = text.split_once('\n').expect("a header");
    let mut runs: Vec<Vec<&str>> = Vec::new();
    for row in rows.lines() {
        let run = |row: &str| row.split(',').next().map(str::to_string);
        match runs.last_mut().filter(|last| run(last[0]) == run(row)) {
            Some(last) => last.push(row),
            None => runs.push(vec![row]),
        }
    }
    let write = |name: &str, runs: &[Vec<&str>]| {
        let rows: String = runs.concat().iter().map(|row| format!("{row}\n")).collect();
        fs::write(path.join(format!("{name}.csv")), format!("{header}\n{rows}")).expect("written");
        let spec = SPEC.replace("swings.csv", &format!("{name}.csv"));
        fs::write(path.join(format!("{name}.ham")), spec).expect("written");
    };
    let turned: Vec<Vec<&str>> = runs.iter().rev().cloned().collect();
    write("turned", &turned);
    let copies: Vec<String> = runs[2].iter().map(|row| format!("again{row}")).collect();
    let copied = [runs.clone(), vec![copies.iter().map(String::as_str).collect()]].concat();
    write("copied", &copied);
    for name in ["turned.ham", "copied.ham"] {
        let other = ask(name);
        assert_eq!((&other.0, &other.1), (&plain.0, &plain.1), "{name}");
        assert_eq!(other.2.len(), plain.2.len());
        // A friction that jumps is integrated differently where segments meet in another order.
        for (a, b) in other.2.iter().zip(&plain.2) {
            assert!((a - b).abs() <= 5e-3 * b.abs().max(1e-6), "{name}: {a} {b}");
        }
    }
    for command in ["check", "fit"] {
        let said = good(path, &[command, "copied.ham"]);
        let said = said.out + &said.err;
        assert!(said.contains("copy of run"), "{command}: {said}");
    }
}
