//! Every command of the program, as a user meets it.

use std::fs;

use crate::support::program::{MAKE_SWINGS, good, json, pendulum, run};
use serde_json::Value;

#[test]
fn simulate_is_deterministic_and_exact() {
    let folder = pendulum();
    let path = folder.path();
    let first = fs::read(path.join("swings.csv")).expect("made");
    good(path, &MAKE_SWINGS);
    assert_eq!(first, fs::read(path.join("swings.csv")).expect("made again"));
    assert!(
        String::from_utf8_lossy(&first).starts_with("run,t [s],theta [rad],omega [rad/s]\n1,0,")
    );

    let made = json(
        path,
        &["simulate", "known.ham", "--start", "1.4,0", "--duration=20", "--dt=0.5"],
        "leverrier.simulate/1",
    );
    assert!(made["energy_drift"]["relative"].as_f64().expect("a number") < 1e-13);
    let run = &made["data"][0];
    assert_eq!(run["times"].as_array().expect("times").len(), 41);
    // The energy is kept by what was written, too.
    let at = |row: usize, sample: usize| run["values"][row][sample].as_f64().expect("a number");
    for sample in 0..41 {
        let energy = at(1, sample).powi(2) / 2.0 - 1.3 * at(0, sample).cos();
        assert!((energy + 1.3 * 1.4f64.cos()).abs() < 1e-12);
    }
}

/// The pendulum of `support::program::KNOWN` by the classical Runge-Kutta method.
fn runge_kutta(start: [f64; 2], time: f64, steps: usize) -> [f64; 2] {
    let rate = |[angle, speed]: [f64; 2]| [speed, -1.3 * angle.sin()];
    let ahead = |z: [f64; 2], h: f64, f: [f64; 2]| [z[0] + h * f[0], z[1] + h * f[1]];
    let h = time / steps as f64;
    (0..steps).fold(start, |z, _| {
        let a = rate(z);
        let b = rate(ahead(z, h / 2.0, a));
        let c = rate(ahead(z, h / 2.0, b));
        let d = rate(ahead(z, h, c));
        std::array::from_fn(|i| z[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
    })
}

#[test]
fn simulate_by_taylor_series_agrees_with_other_integrators() {
    let folder = pendulum();
    let path = folder.path();
    let motion = ["simulate", "known.ham", "--start=1.4,0", "--start=0,1.5", "--duration=20"];
    let motion = [&motion[..], &["--dt=0.5"]].concat();
    let series = [&motion[..], &["--method", "taylor"]].concat();
    let chosen = json(path, &motion, "leverrier.simulate/1");
    let made = json(path, &series, "leverrier.simulate/1");
    let rough = [&series[..], &["--tolerance", "1e-5"]].concat();
    let rough = json(path, &rough, "leverrier.simulate/1");
    let steps = |made: &Value| made["integrator"]["steps"].as_u64().expect("a number");
    assert_eq!(made["integrator"]["method"], "taylor");
    assert!(made["integrator"]["steps_per_sample"].is_null());
    assert!(steps(&made) > 40 && steps(&made) < steps(&chosen));
    let order = |made: &Value| made["integrator"]["order"].as_u64().expect("a number");
    assert!(order(&rough) < order(&made));
    let at = |made: &Value, run: usize, row: usize| {
        made["data"][run]["values"][row][40].as_f64().expect("a number")
    };
    for (run, start) in [[1.4, 0.0], [0.0, 1.5]].into_iter().enumerate() {
        let end = runge_kutta(start, 20.0, 40_000);
        for (row, end) in end.into_iter().enumerate() {
            let found = at(&made, run, row);
            assert!((found - end).abs() < 1e-11, "{found} against {end}");
            assert!((found - at(&chosen, run, row)).abs() < 1e-12);
            let apart = (found - at(&rough, run, row)).abs();
            assert!(apart > 1e-12 && apart < 1e-3, "{apart:e}");
        }
    }
    let said = good(path, &[&series[..], &["--check-energy"]].concat()).err;
    assert!(said.contains("taylor of order") && said.contains(" steps"), "{said}");
}

#[test]
fn simulate_makes_pairs_within_energies() {
    let folder = pendulum();
    let path = folder.path();
    let draw = ["--sample", "theta=-3..3", "--sample", "p_theta=-2..2", "--energy", "-1/2..1/2"];
    let mut arguments = vec!["simulate", "known.ham", "--pairs", "--runs=50", "--dt=0.1"];
    arguments.extend(draw);
    let made = json(path, &arguments, "leverrier.simulate/1");
    assert_eq!((&made["runs"], &made["samples"]), (&Value::from(50), &Value::from(100)));
    for run in made["data"].as_array().expect("runs") {
        let at = |row: usize| run["values"][row][0].as_f64().expect("a number");
        let energy = at(1).powi(2) / 2.0 - 1.3 * at(0).cos();
        assert!((-0.5..=0.5).contains(&energy));
    }
    let chain = ["simulate", "known.ham", "--start=1,0", "--dt=0.1", "--samples=11"];
    let mut pairs = chain.to_vec();
    pairs.extend(["--consecutive-pairs", "--noise", "1%"]);
    let made = json(path, &pairs, "leverrier.simulate/1");
    assert_eq!(made["runs"], 10);
    // A sample in two runs has independent noise in each.
    assert_ne!(made["data"][0]["values"][0][1], made["data"][1]["values"][0][0]);
    assert_eq!(made["data"][0]["times"][1], made["data"][1]["times"][0]);
    let mut gaps = chain.to_vec();
    gaps.extend(["--gaps=0.4", "--check-energy"]);
    let done = good(path, &gaps);
    assert!((6..=8).contains(&done.out.lines().count()), "{}", done.out);
    assert!(done.err.contains("stays within"), "{}", done.err);
}

#[test]
fn fit_learns_prints_and_keeps_the_model() {
    let folder = pendulum();
    let path = folder.path();
    let done = good(path, &["fit", "swings.ham"]);
    for part in
        ["H = p_theta^2/2 - 1.", "cos(theta)", "included", "noise of", "Integrated with", "->"]
    {
        assert!(done.out.contains(part), "{part} is not in\n{}", done.out);
    }
    assert!(done.err.contains("swings.model.json"));
    let first = fs::read(path.join("swings.model.json")).expect("the model file");
    good(path, &["fit", "swings.ham", "--threads", "1"]);
    assert_eq!(first, fs::read(path.join("swings.model.json")).expect("the model file"));
    let kept: Value = serde_json::from_slice(&first).expect("JSON");
    assert_eq!(kept["format"], "leverrier.model/2");
    assert_eq!(kept["origin"]["data"]["name"], "swings.csv");
    // What version 1 of the file called otherwise is still read.
    let text = String::from_utf8(first).expect("text");
    let old = text.replace("leverrier.model/2", "leverrier.model/1");
    let old = old.replace("\"diverged\"", "\"exploded\"");
    assert!(old.contains("exploded"));
    fs::write(path.join("swings.model.json"), old).expect("written");
    good(path, &["export", "swings.ham", "latex"]);

    let fitted = json(path, &["fit", "swings.ham", "-o", "other.json"], "leverrier.fit/1");
    assert!(path.join("other.json").exists());
    let terms = fitted["model"]["terms"].as_array().expect("terms");
    assert_eq!(terms.len(), 1, "{terms:?}");
    let number = |field: &str| terms[0][field].as_f64().expect("a number");
    assert!((number("coefficient") + 1.3).abs() < 5.0 * number("standard_error"));

    let dense = json(path, &["fit", "swings.ham", "--dense"], "leverrier.fit/1");
    assert_eq!(dense["model"]["terms"].as_array().expect("terms").len(), 3);
    for loss in ["huber", "absolute", "cauchy"] {
        good(path, &["fit", "swings.ham", "--loss", loss, "--select", "held-out"]);
    }
}

#[test]
fn a_fitted_model_simulates_and_exports() {
    let folder = pendulum();
    let path = folder.path();
    good(path, &["fit", "swings.ham"]);
    let moved = good(path, &["simulate", "swings.ham", "--start=1,0", "--dt=0.1", "--samples=5"]);
    assert_eq!(moved.out.lines().count(), 6);
    for row in leverrier::internals::export::EXPORTERS {
        let made = json(path, &["export", "swings.ham", row.name], "leverrier.export-command/1");
        match made["text"].as_str() {
            Some(text) => assert!(text.contains("cos"), "{}: {text}", row.name),
            None => {
                let files = made["files"].as_array().expect("files");
                let folder = path.join(made["path"].as_str().expect("a path"));
                for file in files {
                    assert!(folder.join(file.as_str().expect("a name")).is_file());
                }
                let again = run(path, &["export", "swings.ham", row.name]);
                assert_eq!(again.code, Some(2));
                assert!(again.err.contains("not empty") && again.err.contains("--force"));
                good(path, &["export", "swings.ham", row.name, "--force"]);
            }
        }
    }
    let document = good(path, &["export", "swings.ham", "latex", "--document", "-o", "swings.tex"]);
    assert!(document.out.contains("swings.tex"));
    assert!(fs::read_to_string(path.join("swings.tex")).expect("made").contains("documentclass"));
    // A fully known spec needs no model.
    assert!(good(path, &["export", "known.ham", "python"]).out.contains("1.3"));
}

#[test]
fn check_shows_space_units_and_data() {
    let folder = pendulum();
    let path = folder.path();
    let done = good(path, &["check", "swings.ham"]);
    for part in ["theta^2", "cos(theta)", "cannot be learned", "180 samples in 3 runs"] {
        assert!(done.out.contains(part), "{part} is not in\n{}", done.out);
    }
    assert!(!good(path, &["check", "swings.ham", "--no-data"]).out.contains("samples"));
    let object = json(path, &["check", "swings.ham"], "leverrier.check/1");
    assert_eq!(object["terms"].as_array().expect("terms").len(), 3);
    assert_eq!(object["data"]["samples"], 180);
}

#[test]
fn new_writes_a_spec_that_can_be_fitted() {
    for (header, parts) in [
        ("t [s],theta [rad],omega [rad/s]", vec!["velocities", "theta [rad]", "cos(theta)"]),
        ("time,q,p", vec!["momenta", "T = p^2/2"]),
        ("time [s],angle [deg],rate [deg/s]", vec!["angle [rad]", "[deg]"]),
        ("t,x 1,v 1", vec!["x_1 = \"x 1\"", "velocities"]),
        ("seconds,x,x_dot", vec!["coordinates x", "velocities  x_dot"]),
        ("T ime,t,x,vx,note", vec!["velocities  vx"]),
        ("Zeit [s],Winkel [°]", vec!["Winkel [rad]", "p_Winkel [rad/s]", "[deg]", "not measured"]),
        ("t,x,y", vec!["coordinates x, y ", "momenta     p_x, p_y"]),
        // Without a unit of time nothing is converted: no cosine of degrees.
        ("t,Winkel [deg]", vec!["span{ poly(Winkel; 4) }"]),
    ] {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let columns = header.split(',').count();
        let mut text = format!("{header}\n");
        for i in 0..40 {
            let t = 0.1 * f64::from(i);
            let mut cells = vec![t.to_string(), t.cos().to_string(), (-t.sin()).to_string()];
            cells.truncate(columns);
            if columns == 5 {
                cells.insert(0, "0".to_string());
                cells.push("words".to_string());
            }
            text.push_str(&format!("{}\n", cells.join(",")));
        }
        fs::write(folder.path().join("d.csv"), text).expect("written");
        let made = json(folder.path(), &["new", "d.csv"], "leverrier.new/1");
        let spec = fs::read_to_string(folder.path().join("d.ham")).expect("the spec");
        assert_eq!(made["spec"], spec);
        for part in parts {
            assert!(spec.contains(part), "{header}: {part} is not in\n{spec}");
        }
        good(folder.path(), &["fit", "d.ham"]);
        let again = run(folder.path(), &["new", "d.csv"]);
        assert_eq!(again.code, Some(2));
        assert!(again.err.contains("d.ham exists") && again.err.contains("--force"));
        good(folder.path(), &["new", "d.csv", "--force"]);
    }
}

#[test]
fn demo_learns_the_truth() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let object =
        json(folder.path(), &["demo", "henon-heiles", "--quick", "-o", "kept"], "leverrier.demo/2");
    assert_eq!(object["model"]["terms"].as_array().expect("terms").len(), 6);
    assert!(folder.path().join("kept/henon-heiles.model.json").is_file());
    let told = good(folder.path(), &["demo", "henon-heiles", "--quick"]);
    assert!(told.out.contains("truth") && !told.out.contains("missed"), "{}", told.out);
    json(folder.path(), &["demo", "--list"], "leverrier.demo-list/1");
    assert_eq!(run(folder.path(), &["demo", "nonsense"]).code, Some(2));
}

#[test]
fn help_and_version() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    assert!(good(folder.path(), &["--version"]).out.contains(env!("CARGO_PKG_VERSION")));
    for command in ["new", "check", "fit", "simulate", "export", "demo"] {
        assert!(good(folder.path(), &[command, "--help"]).out.contains("Examples:"), "{command}");
    }
    assert_eq!(run(folder.path(), &[]).code, Some(2));
    let wrong = run(folder.path(), &["fit", "--nonsense", "--format", "json"]);
    assert_eq!(wrong.code, Some(2));
    let error: Value = serde_json::from_str(&wrong.err).expect("JSON");
    assert_eq!(error["format"], "leverrier.error/1");
}

#[test]
fn a_closed_pipe_is_no_error() {
    let folder = pendulum();
    let program = assert_cmd::cargo::cargo_bin("leverrier");
    let mut child = std::process::Command::new(program)
        .current_dir(folder.path())
        .args(["simulate", "known.ham", "--start=1,0", "--dt=0.1", "--samples=100000"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("the program runs");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}

#[test]
fn coordinates_alone_will_do() {
    let folder = pendulum();
    let path = folder.path();
    let data = fs::read_to_string(path.join("swings.csv")).expect("made");
    let without = data.lines().map(|line| line.rsplit_once(',').expect("columns").0);
    fs::write(path.join("swings.csv"), without.collect::<Vec<_>>().join("\n")).expect("written");
    let done = good(path, &["fit", "swings.ham"]);
    assert!(done.err.contains("omega was never measured"), "{}", done.err);
    assert!(
        done.out.contains("H = p_theta^2/2 - 1.") && done.out.contains("not measured"),
        "{}",
        done.out
    );
}

#[test]
fn pairs_need_no_run_column() {
    let folder = pendulum();
    let path = folder.path();
    let mut text = "t,theta,omega\n".to_string();
    for i in 0..200 {
        // Small pairs of a free rotation: omega is constant.
        let (theta, omega) = (0.1 * f64::from(i), 0.01 * f64::from(i % 13) + 0.2);
        text.push_str(&format!("0,{theta},{omega}\n0.5,{},{omega}\n", theta + 0.5 * omega));
    }
    fs::write(path.join("pairs.csv"), &text).expect("written");
    let spec = "coordinates theta\nmomenta omega\ndata \"pairs.csv\" { time t pairs }\n\
                T = span{ omega^2 }\n";
    fs::write(path.join("p.ham"), spec).expect("written");
    let fitted = json(path, &["fit", "p.ham"], "leverrier.fit/1");
    let value = fitted["model"]["terms"][0]["coefficient"].as_f64().expect("a number");
    assert!((value - 0.5).abs() < 1e-9, "{value}");
    fs::write(path.join("pairs.csv"), format!("{text}0,1,1\n")).expect("written");
    let done = run(path, &["fit", "p.ham"]);
    assert!(done.err.contains("line 402") && done.err.contains("even number"), "{}", done.err);
}

#[test]
fn a_real_pendulum_is_fitted_from_its_file() {
    let Some(file) = crate::measurements::shared_data("real_pendulum.csv") else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let spec = "coordinates theta [rad]\nvelocities omega [rad/s]\ntime t [s]\n\
                data \"swings.csv\" { time t [s]  run trial }\n\
                T = p_theta^2/2\nV = span{ -cos(theta) }\n";
    fs::write(folder.path().join("s.ham"), spec).expect("written");
    let file = file.display().to_string();
    let fitted = json(folder.path(), &["fit", "s.ham", "--data", &file], "leverrier.fit/1");
    let a = fitted["model"]["terms"][0]["coefficient"].as_f64().expect("a number");
    // 1.355 with drag, a tilt and the scale of the velocities, which are 4 percent too small: what
    // this law follows within the noise, half a second, gives 1.295.
    assert!((a - 1.355).abs() < 0.02, "{a}");
    let warned = fitted["warnings"].as_array().expect("warnings");
    assert!(warned.iter().any(|w| w["kind"] == "follows_briefly"), "{warned:?}");
    assert_eq!(fitted["data"]["gaps"].as_array().expect("gaps").len(), 10);
}

#[test]
fn every_demo_runs_and_says_what_it_found() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let list = json(folder.path(), &["demo", "--list"], "leverrier.demo-list/1");
    let names: Vec<&str> = list["demos"]
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|d| d["name"].as_str())
        .collect();
    assert_eq!(names.len(), 5);
    for name in names {
        let found = json(folder.path(), &["demo", name, "--quick"], "leverrier.demo/2");
        assert!(!found["truth"].is_null(), "{name}");
    }
    let shown = good(folder.path(), &["demo", "pendulum"]).out;
    assert!(shown.contains("H = p^2/4 - 2 cos(q)"), "{shown}");
}

#[cfg(unix)]
#[test]
fn files_of_many_columns_are_looked_at_in_proportion_to_their_number() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path();
    // Nothing in them is a coordinate by its name; then half of them are, far too many for a spec.
    let alone = |at: usize| format!("channel_{at}");
    let paired = |at: usize| format!("{}{}", ["x", "v"][at % 2], at / 2);
    let names: [(&dyn Fn(usize) -> String, &str); 2] =
        [(&alone, "more columns. Left out."), (&paired, "is one coordinate too many. Left out.")];
    for (name, says) in names {
        let mut text = String::from("t");
        for at in 0..100_000 {
            text.push(',');
            text.push_str(&name(at));
        }
        for row in 0..3 {
            text.push_str(&format!("\n{row}"));
            for at in 0..100_000 {
                text.push_str(&format!(",{}", (row * 7 + at) % 10));
            }
        }
        fs::write(path.join("wide.csv"), text).expect("a file");
        // A second of a processor; over a minute where every pair of columns is compared. What
        // others take of a busy machine does not count.
        let done = std::process::Command::new("sh")
            .args(["-c", "ulimit -t 20 && exec \"$@\"", "sh", env!("CARGO_BIN_EXE_leverrier")])
            .args(["new", "wide.csv", "--force"])
            .current_dir(path)
            .output()
            .expect("a shell");
        let err = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(0), "{}: {err}", done.status);
        let spec = fs::read_to_string(path.join("wide.ham")).expect("a spec");
        assert!(spec.contains(says) && spec.len() < 10_000, "{spec}");
    }
}

#[test]
fn what_was_not_measured_has_no_noise() {
    let folder = pendulum();
    let path = folder.path();
    let all = fs::read_to_string(path.join("swings.csv")).expect("data");
    let positions: String = all
        .lines()
        .map(|line| line.rsplit_once(',').map_or(line, |(first, _)| first).to_string() + "\n")
        .collect();
    fs::write(path.join("swings.csv"), positions).expect("data");
    let compared = json(path, &["compare", "swings.ham"], "leverrier.compare/2");
    assert_eq!(compared["noise_floor"][1][1], Value::Null, "{compared}");
    let shown = good(path, &["compare", "swings.ham"]).out;
    assert!(shown.contains("not measured"), "{shown}");
}
