//! The loop in the situations that users are in: everything believed to be known, effects of
//! their own, edits by hand, commands that were killed, too little data, rigs that measure
//! velocities or coordinates alone.

use std::fs;
use std::path::Path;

use crate::support::program::{good, json, run};
use serde_json::Value;
use tempfile::TempDir;

const DRAG: &str = "force theta += -0.05*p";

/// Eight swings of a pendulum with a hidden force, as momenta or velocities.
fn swings(hidden: &str, more: &str) -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let truth =
        format!("coordinates theta\nmomenta p\ntime t\nT = p^2/2\nV = -1.3*cos(theta)\n{hidden}\n");
    fs::write(folder.path().join("truth.ham"), truth).expect("written");
    let make = format!(
        "simulate truth.ham --sample theta=-1.8..1.8 --sample p=-1..1 --dt=0.1 --noise=1% \
         --seed=5 -o swings.csv {more}"
    );
    good(folder.path(), &make.split_whitespace().collect::<Vec<_>>());
    folder
}

fn eight(hidden: &str) -> TempDir {
    swings(hidden, "--runs 8 --samples=120")
}

/// A spec of the pendulum, and its path.
fn spec(folder: &Path, name: &str, body: &str) {
    let run = if read(folder, "swings.csv").starts_with("run") { "  run run" } else { "" };
    let text = format!(
        "# notes\nsystem \"pendulum\"\ncoordinates theta\nmomenta p\ntime t\n\
         data \"swings.csv\" {{ time t{run} }}\nT = p^2/2\n{body}\n"
    );
    fs::write(folder.join(name), text).expect("written");
}

fn read(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).expect("it is there")
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn a_spec_in_which_all_is_known_can_be_asked_what_it_lacks() {
    let folder = eight(DRAG);
    let path = folder.path();
    // A comment that names an effect is a comment, whoever edits the spec.
    spec(path, "k.ham", "V = -1.3*cos(theta)  # next: effect viscous_drag(theta)");
    let before = read(path, "k.ham");
    let fitted = good(path, &["fit", "k.ham"]);
    assert!(fitted.out.contains("nothing to learn"), "{}", fitted.out);
    let fit = json(path, &["fit", "k.ham"], "leverrier.fit/1");
    assert_eq!(fit["model"]["terms"].as_array().map(Vec::len), Some(0));
    for noise in fit["model"]["noise"].as_array().expect("noise") {
        let sigma = number(&noise["standard_deviation"]);
        assert!((0.002..0.03).contains(&sigma), "{noise}");
    }
    assert!(path.join("k.model.json").exists());
    good(path, &["export", "k.ham", "latex"]);
    good(path, &["simulate", "k.ham", "--start", "1,0", "--duration", "1", "--dt", "0.1"]);
    let compared = json(path, &["compare", "k.ham"], "leverrier.compare/2");
    assert!(compared["findings"].to_string().contains("loses energy"), "{compared}");
    let found = json(path, &["diagnose", "k.ham"], "leverrier.diagnose/2");
    assert_eq!(found["verdict"], "missing");
    assert_eq!(found["ranking"][0]["effect"], "viscous_drag(theta)");
    let added = json(path, &["add", "k.ham", "viscous_drag"], "leverrier.add/2");
    assert_eq!(added["supported"], true, "{added}");
    good(path, &["undo", "k.ham"]);
    assert_eq!(read(path, "k.ham"), before);
    let loop_ = json(path, &["discover", "k.ham"], "leverrier.discover/2");
    assert_eq!(loop_["steps"][0]["effect"], "viscous_drag(theta)", "{loop_}");
    let after = read(path, "k.ham");
    assert!(
        after.contains("\neffect viscous_drag(theta)\n") && after.starts_with(before.trim_end())
    );
    good(path, &["remove", "k.ham", "viscous_drag"]);
    assert_eq!(read(path, "k.ham"), before);
}

#[test]
fn add_shows_before_and_after_in_the_same_units() {
    let folder = eight(DRAG);
    let path = folder.path();
    spec(path, "s.ham", "V = span{ cos(theta), theta^2, theta^4 }");
    let added = json(path, &["add", "s.ham", "viscous_drag"], "leverrier.add/2");
    assert_eq!(added["before"]["noise"], added["after"]["noise"]);
    for side in ["before", "after"] {
        assert_eq!(number(&added[side]["noise_floor"]), 1.0);
        let horizons = added[side]["horizons"].as_array().expect("horizons");
        assert!(horizons.len() >= 6, "{horizons:?}");
    }
    let last = |side: &str| {
        let horizons = added[side]["horizons"].as_array().expect("horizons");
        number(&horizons[horizons.len() - 1][1])
    };
    // The model before fails over a whole run, however much of it it took for noise.
    assert!(last("before") > 5.0 && last("after") < 1.15, "{added}");
    let noise = added["after"]["noise"].as_array().expect("noise");
    let fit = json(path, &["fit", "s.ham"], "leverrier.fit/1");
    for (unit, learned) in noise.iter().zip(fit["model"]["noise"].as_array().expect("noise")) {
        let ratio = number(&unit[1]) / number(&learned["standard_deviation"]);
        assert!((0.85..1.15).contains(&ratio), "{unit} {learned}");
    }
    let moved = added["moved"].as_array().expect("moved");
    let cosine = moved.iter().find(|m| m["term"] == "cos(theta)").expect("the cosine");
    assert!((number(&cosine["after"]) + 1.3).abs() < 5.0 * number(&cosine["after_error"]));
    // A warm start ends where a fit from nothing does.
    let terms = fit["model"]["terms"].as_array().expect("terms");
    assert_eq!(terms.len(), 2, "{terms:?}");
    let shown = good(path, &["history", "s.ham"]).out;
    assert!(shown.contains("add viscous_drag(theta)") && shown.contains("now"), "{shown}");
}

#[test]
fn a_drive_is_added_with_its_frequency() {
    let folder = eight("force theta += 0.08*cos(1.9*t)");
    let path = folder.path();
    spec(path, "s.ham", "V = span{ cos(theta) }");
    let added = json(path, &["add", "s.ham", "harmonic_drive"], "leverrier.add/2");
    assert_eq!(added["supported"], true, "{added}");
    let effect = added["effect"].as_array().expect("the effect");
    let frequency = effect
        .iter()
        .find(|term| term["term"].as_str().is_some_and(|name| name.contains("frequency")))
        .expect("the frequency is reported");
    assert!((number(&frequency["coefficient"]) - 1.9).abs() < 0.02, "{frequency}");
    assert!(number(&added["after"]["held_out_error"]) < 1.15, "{added}");
}

#[test]
fn ones_own_candidates_stand_beside_the_catalogue() {
    let folder = eight("force theta += -0.06*p*cos(theta)^2");
    let path = folder.path();
    let own = "V = span{ cos(theta) }
param w = 1 in 0.5..3
candidates {
    oil: force theta += span{ -p*cos(theta)^2 }
    ripple: V += span{ sin(w*theta) }
}";
    spec(path, "s.ham", own);
    let before = read(path, "s.ham");
    let found = json(path, &["diagnose", "s.ham"], "leverrier.diagnose/2");
    assert_eq!(found["verdict"], "missing", "{found}");
    let first = &found["ranking"][0];
    assert_eq!((&first["effect"], &first["snippet"]), (&"oil".into(), &"effect oil".into()));
    assert_eq!(first["on"], serde_json::json!(["theta"]));
    let (value, error) = (number(&first["coefficient"][0]), number(&first["standard_error"][0]));
    assert!((value - 0.06).abs() < 5.0 * error, "{value} +- {error}");
    let added = json(path, &["add", "s.ham", "oil"], "leverrier.add/2");
    assert_eq!(added["supported"], true, "{added}");
    let twice = run(path, &["add", "s.ham", "oil"]);
    assert_eq!(twice.code, Some(2));
    assert!(twice.err.contains("already"), "{}", twice.err);
    good(path, &["remove", "s.ham", "oil"]);
    assert_eq!(read(path, "s.ham"), before);
    let loop_ = json(path, &["discover", "s.ham"], "leverrier.discover/2");
    let steps: Vec<&Value> = loop_["steps"].as_array().expect("steps").iter().collect();
    assert_eq!(steps.len(), 1, "{steps:?}");
    assert_eq!(steps[0]["effect"], "oil");
    let wrong = run(path, &["add", "s.ham", "ripple_"]);
    assert!(wrong.err.contains("did you mean `ripple`?"), "{}", wrong.err);
}

#[test]
fn an_inner_parameter_of_ones_own_candidate_is_looked_for() {
    let folder = eight("force theta += -0.5*cos(2.7*theta)*2.7");
    let path = folder.path();
    let own = "V = span{ cos(theta) }
param w = 1 in 0.5..4
candidates { ripple: V += span{ sin(w*theta) } }";
    spec(path, "s.ham", own);
    let added = json(path, &["add", "s.ham", "ripple"], "leverrier.add/2");
    assert_eq!(added["supported"], true, "{added}");
    let effect = added["effect"].as_array().expect("the effect");
    let w = effect.iter().find(|term| term["term"] == "w").expect("w is reported");
    assert!((number(&w["coefficient"]) - 2.7).abs() < 0.02, "{w}");
}

#[test]
fn a_term_with_a_name_can_be_removed() {
    let folder = eight(DRAG);
    let path = folder.path();
    spec(
        path,
        "s.ham",
        "V = span{ gravity: cos(theta),  # the weight\n          spring: theta^2 }",
    );
    let before = read(path, "s.ham");
    let removed = json(path, &["remove", "s.ham", "spring"], "leverrier.remove/2");
    assert_eq!(removed["action"], "remove spring");
    assert_eq!(removed["supported"], true, "{removed}");
    let text = read(path, "s.ham");
    assert!(!text.contains("spring") && text.contains("# the weight"), "{text}");
    good(path, &["undo", "s.ham"]);
    assert_eq!(read(path, "s.ham"), before);
    for (name, says) in [
        ("gravty", "did you mean `gravity`?"),
        ("quadratic_drag", "what can be removed: gravity, spring"),
        ("nonsense_of_mine", "there is no effect"),
    ] {
        let wrong = run(path, &["remove", "s.ham", name]);
        assert_eq!(wrong.code, Some(2), "{name}");
        assert!(wrong.err.contains(says), "{name}: {}", wrong.err);
    }
    let constrained =
        before.replace("spring: theta^2 }", "spring: theta^2 }\nconstrain spring >= 0");
    fs::write(path.join("s.ham"), &constrained).expect("written");
    let wrong = run(path, &["remove", "s.ham", "spring"]);
    assert_eq!(wrong.code, Some(2), "{}", wrong.err);
    assert!(wrong.err.contains("spring") && wrong.err.contains("nothing was changed"));
    assert_eq!(read(path, "s.ham"), constrained);
}

#[test]
fn undo_never_destroys_what_was_edited_by_hand() {
    let folder = eight(DRAG);
    let path = folder.path();
    spec(path, "s.ham", "V = span{ cos(theta) }");
    let start = read(path, "s.ham");
    good(path, &["add", "s.ham", "viscous_drag"]);
    let edited = format!("{}# an afterthought\n", read(path, "s.ham"));
    fs::write(path.join("s.ham"), &edited).expect("written");
    assert!(good(path, &["history", "s.ham"]).out.contains("edited by hand since"));
    let refused = run(path, &["undo", "s.ham"]);
    assert_eq!(refused.code, Some(2));
    assert!(refused.err.contains("edited by hand") && refused.err.contains("--force"));
    assert_eq!(read(path, "s.ham"), edited);
    let done = json(path, &["undo", "s.ham", "--force"], "leverrier.undo/1");
    assert_eq!(done["undone"], "add viscous_drag(theta)");
    assert_eq!(done["edits_kept"], true);
    assert_eq!(read(path, "s.ham"), start);
    let history = json(path, &["history", "s.ham"], "leverrier.history/2");
    let kept = history["revisions"].as_array().expect("revisions").iter();
    let kept = kept.filter(|r| r["spec"] == edited.as_str()).collect::<Vec<_>>();
    assert_eq!(kept.len(), 1, "{history}");
    let number = kept[0]["number"].to_string();
    assert_eq!(good(path, &["history", "s.ham", "--show", &number]).out, edited);
    assert_eq!(run(path, &["history", "s.ham", "--show", "99"]).code, Some(2));
    assert_eq!(run(path, &["undo", "s.ham"]).code, Some(2));
}

#[test]
fn a_command_that_was_killed_leaves_what_the_next_one_understands() {
    let folder = eight(DRAG);
    let path = folder.path();
    spec(path, "s.ham", "V = span{ cos(theta) }");
    let start = read(path, "s.ham");
    good(path, &["add", "s.ham", "viscous_drag"]);
    let added = read(path, "s.ham");
    let ledger = read(path, "s.ledger.json");

    // Killed after the ledger, before the spec.
    fs::write(path.join("s.ham"), &start).expect("written");
    let shown = good(path, &["history", "s.ham"]).out;
    assert!(shown.contains("counts as undone") && shown.contains("undone"), "{shown}");
    let nothing = run(path, &["undo", "s.ham"]);
    assert_eq!(nothing.code, Some(2));
    assert!(nothing.err.contains("nothing to undo"), "{}", nothing.err);
    assert_eq!(read(path, "s.ham"), start);
    // The model belongs to the other text; asking goes on all the same.
    json(path, &["diagnose", "s.ham"], "leverrier.diagnose/2");
    let again = json(path, &["add", "s.ham", "viscous_drag"], "leverrier.add/2");
    assert_eq!(again["supported"], true);
    let history = json(path, &["history", "s.ham"], "leverrier.history/2");
    let actions: Vec<String> = history["revisions"]
        .as_array()
        .expect("revisions")
        .iter()
        .map(|r| format!("{} {}", r["action"].as_str().expect("text"), r["undone"]))
        .collect();
    assert_eq!(
        actions,
        ["start false", "add viscous_drag(theta) true", "add viscous_drag(theta) false"]
    );

    // Killed after the spec, before the model: no model, or one of another text.
    fs::write(path.join("s.ham"), &added).expect("written");
    fs::write(path.join("s.ledger.json"), &ledger).expect("written");
    fs::remove_file(path.join("s.model.json")).expect("removed");
    json(path, &["compare", "s.ham"], "leverrier.compare/2");
    good(path, &["undo", "s.ham"]);
    assert_eq!(read(path, "s.ham"), start);

    // Killed in `undo`, after the spec, before the ledger.
    fs::write(path.join("s.ledger.json"), &ledger).expect("written");
    assert_eq!(run(path, &["undo", "s.ham"]).code, Some(2));
    assert_eq!(read(path, "s.ham"), start);

    // A ledger that is cut off is refused, and left alone.
    fs::write(path.join("s.ledger.json"), &ledger[..ledger.len() / 2]).expect("written");
    let damaged = run(path, &["history", "s.ham"]);
    assert_eq!(damaged.code, Some(1));
    assert!(damaged.err.contains("s.ledger.json"), "{}", damaged.err);
    assert_eq!(run(path, &["add", "s.ham", "viscous_drag"]).code, Some(1));
    assert_eq!(read(path, "s.ham"), start);
}

#[test]
fn too_little_data_is_a_verdict() {
    for (more, arguments, says) in [
        ("--runs 1 --samples=4", &[][..], "independent residuals"),
        ("--runs 2 --samples=5", &[], "independent residuals"),
        ("--runs 8 --samples=120", &["--held-out", "0"], "no samples are left"),
    ] {
        let folder = swings(DRAG, more);
        let path = folder.path();
        spec(path, "s.ham", "V = span{ cos(theta) }");
        for (command, format) in
            [("diagnose", "leverrier.diagnose/2"), ("discover", "leverrier.discover/2")]
        {
            let mut words = vec![command, "s.ham"];
            words.extend(arguments);
            let found = json(path, &words, format);
            assert_eq!(found["verdict"], "too_little_data", "{more}: {found}");
            let why = if command == "diagnose" { &found["reason"] } else { &found["stop"] };
            let why = why.as_str().expect("a reason");
            assert!(why.contains(says) && why.contains("measure"), "{more}: {why}");
            let shown = good(path, &words).out;
            assert!(shown.starts_with("Too little data to say"), "{shown}");
        }
    }
}

#[test]
fn a_single_run_is_judged_on_blocks_in_time() {
    let folder = swings(DRAG, "--runs 1 --samples=600");
    let path = folder.path();
    spec(path, "s.ham", "V = span{ cos(theta) }");
    let found = json(path, &["diagnose", "s.ham"], "leverrier.diagnose/2");
    let how = found["split"]["how"].as_str().expect("a sentence");
    assert!(how.contains("of consecutive samples"), "{how}");
    assert_eq!(found["verdict"], "missing");
    assert_eq!(found["ranking"][0]["effect"], "viscous_drag(theta)", "{found}");
    assert!(good(path, &["diagnose", "s.ham"]).out.contains("of consecutive samples"));
}

/// The data as a rig would have them that measures velocities, or coordinates alone.
fn remade(folder: &Path, observed: &str) {
    let table = read(folder, "swings.csv");
    let lines = table.lines().map(|line| {
        let mut cells: Vec<&str> = line.split(',').collect();
        match (observed, cells.last().copied()) {
            ("velocities", Some("p")) => {
                cells.pop();
                cells.push("v");
            }
            ("coordinates", _) => {
                cells.pop();
            }
            _ => {}
        }
        cells.join(",") + "\n"
    });
    fs::write(folder.join("swings.csv"), lines.collect::<String>()).expect("written");
}

#[test]
fn velocities_or_coordinates_alone_name_a_hidden_force_with_its_size() {
    for (hidden, effect, size) in [
        (DRAG, "viscous_drag(theta)", 0.05),
        ("force theta += 0.08*cos(1.9*t)", "harmonic_drive(theta)", 0.08),
    ] {
        for observed in ["velocities", "coordinates"] {
            let folder = eight(hidden);
            let path = folder.path();
            // The mass is one: a velocity is a momentum in numbers, but not to the spec.
            remade(path, observed);
            let second = if observed == "velocities" { "velocities v" } else { "momenta p" };
            let momentum = if observed == "velocities" { "p_theta" } else { "p" };
            let text = format!(
                "coordinates theta\n{second}\ntime t\ndata \"swings.csv\" {{ time t  run run }}\n\
                 T = {momentum}^2/2\nV = span{{ cos(theta) }}\n"
            );
            fs::write(path.join("s.ham"), text).expect("written");
            let found = json(path, &["diagnose", "s.ham"], "leverrier.diagnose/2");
            assert_eq!(found["verdict"], "missing", "{observed}: {found}");
            let named = found["ranking"].as_array().expect("a ranking");
            let place = named.iter().position(|leader| leader["effect"] == effect);
            let tied = found["indistinguishable"].as_array().expect("a list");
            let leads = place == Some(0) || tied.iter().any(|name| *name == effect);
            assert!(leads, "{observed}, {effect}: {found}");
            let leader = &named[place.unwrap_or(0)];
            let at = |i: usize| number(&leader["coefficient"][i]);
            let found = if effect.starts_with("viscous") { at(0) } else { at(0).hypot(at(1)) };
            let error = number(&leader["standard_error"][0]);
            assert!((found - size).abs() < 5.0 * error, "{observed}: {found} +- {error}");
            assert!(error < 0.15 * size, "{observed}: {error}");
        }
    }
}

#[test]
fn momenta_without_a_column_are_no_error_beside_columns_to_spare() {
    let folder = eight("");
    let path = folder.path();
    // The momentum's column under another name: the fit takes positions alone, and says so.
    let table = read(path, "swings.csv").replacen(",p\n", ",turns\n", 1);
    fs::write(path.join("swings.csv"), table).expect("written");
    let spec = |columns: &str| {
        let text = format!(
            "coordinates theta\nmomenta p\ntime t\n\
             data \"swings.csv\" {{ time t  run run  {columns} }}\n\
             T = p^2/2\nV = span{{ cos(theta) }}\n"
        );
        fs::write(path.join("s.ham"), text).expect("written");
    };
    spec("");
    let output = good(path, &["fit", "s.ham"]);
    assert!(output.out.contains("cos(theta)"), "{}", output.out);
    let output = good(path, &["check", "s.ham"]);
    let note = "No column is called p: taken as not measured. If `turns` holds it, write";
    assert!(output.out.replace("\n", " ").contains(note), "{}", output.out);
    spec("p not measured");
    let output = good(path, &["check", "s.ham"]);
    assert!(!output.out.contains("No column is called"), "{}", output.out);
    // A column that the spec names has to be there.
    spec("p = momentum");
    let output = run(path, &["fit", "s.ham"]);
    assert!(
        output.code == Some(1) && output.err.contains("no column `momentum`"),
        "{}",
        output.err
    );
}
