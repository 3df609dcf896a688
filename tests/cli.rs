//! The program as a user meets it: every command, and whatever can be wrong with its input.

mod common;

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

/// What a command did.
struct Done {
    code: Option<i32>,
    out: String,
    err: String,
}

fn run(folder: &Path, arguments: &[&str]) -> Done {
    let output = Command::cargo_bin("leverrier")
        .expect("the program is built")
        .current_dir(folder)
        .env_remove("NO_COLOR")
        .args(arguments)
        .output()
        .expect("the program runs");
    let done = Done {
        code: output.status.code(),
        out: String::from_utf8(output.stdout).expect("text"),
        err: String::from_utf8(output.stderr).expect("text"),
    };
    assert!(!done.err.contains("panicked"), "{arguments:?}: {}", done.err);
    assert!(!done.err.contains('\x1b'), "colours in a pipe: {}", done.err);
    done
}

fn good(folder: &Path, arguments: &[&str]) -> Done {
    let done = run(folder, arguments);
    assert_eq!(done.code, Some(0), "{arguments:?}\n{}\n{}", done.out, done.err);
    done
}

fn json(folder: &Path, arguments: &[&str], format: &str) -> Value {
    let mut all = arguments.to_vec();
    all.extend(["--format", "json"]);
    let done = good(folder, &all);
    assert_eq!(done.err, "", "{arguments:?}");
    let value: Value = serde_json::from_str(&done.out).expect("one JSON object");
    assert_eq!(value["format"], format, "{arguments:?}");
    value
}

const KNOWN: &str = "system \"pendulum\"
coordinates theta [rad]
velocities omega [rad/s]
time t [s]
T = p_theta^2/2
V = -1.3 [1/s^2]*cos(theta)
";

const UNKNOWN: &str = "system \"pendulum\"
coordinates theta [rad]
velocities omega [rad/s]
time t [s]
data \"swings.csv\" { time t [s]  run run }
T = p_theta^2/2
V = span{ poly(theta; 2), cos(theta) }
";

/// A folder with a known and an unknown pendulum, and data made by `simulate`.
fn pendulum() -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("known.ham"), KNOWN).expect("written");
    fs::write(folder.path().join("swings.ham"), UNKNOWN).expect("written");
    good(folder.path(), &MAKE_SWINGS);
    folder
}

const MAKE_SWINGS: [&str; 15] = [
    "simulate",
    "known.ham",
    "--runs",
    "3",
    "--sample",
    "theta=-1.5..1.5",
    "--sample",
    "p_theta=-1..1",
    "--dt=0.1",
    "--samples=60",
    "--noise=0.005",
    "--seed=7",
    "-o",
    "swings.csv",
    "--force",
];

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
    assert!(done.err.contains("strays by"), "{}", done.err);
}

#[test]
fn fit_learns_prints_and_keeps_the_model() {
    let folder = pendulum();
    let path = folder.path();
    let done = good(path, &["fit", "swings.ham"]);
    for part in ["H = p_theta^2/2 - 1.", "cos(theta)", "included", "noise of", "forest-ruth", "->"]
    {
        assert!(done.out.contains(part), "{part} is not in\n{}", done.out);
    }
    assert!(done.err.contains("swings.model.json"));
    let first = fs::read(path.join("swings.model.json")).expect("the model file");
    good(path, &["fit", "swings.ham", "--threads", "1"]);
    assert_eq!(first, fs::read(path.join("swings.model.json")).expect("the model file"));
    let kept: Value = serde_json::from_slice(&first).expect("JSON");
    assert_eq!(kept["format"], "leverrier.model/1");
    assert_eq!(kept["origin"]["data"]["name"], "swings.csv");

    let fitted = json(path, &["fit", "swings.ham", "-o", "other.json"], "leverrier.fit/1");
    assert!(path.join("other.json").exists());
    let terms = fitted["model"]["terms"].as_array().expect("terms");
    assert_eq!(terms.len(), 1, "{terms:?}");
    let number = |field: &str| terms[0][field].as_f64().expect("a number");
    assert!((number("coefficient") + 1.3).abs() < 5.0 * number("standard_error"));

    let dense = json(path, &["fit", "swings.ham", "--dense"], "leverrier.fit/1");
    assert_eq!(dense["model"]["terms"].as_array().expect("terms").len(), 3);
    for loss in ["huber", "absolute", "cauchy"] {
        good(path, &["fit", "swings.ham", "--loss", loss, "--select", "unseen"]);
    }
}

#[test]
fn a_fitted_model_simulates_and_exports() {
    let folder = pendulum();
    let path = folder.path();
    good(path, &["fit", "swings.ham"]);
    let moved = good(path, &["simulate", "swings.ham", "--start=1,0", "--dt=0.1", "--samples=5"]);
    assert_eq!(moved.out.lines().count(), 6);
    for row in leverrier::export::EXPORTERS {
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
    ] {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let columns = header.split(',').count();
        let mut text = format!("{header}\n");
        for i in 0..40 {
            let t = 0.1 * f64::from(i);
            let mut cells = vec![t.to_string(), t.cos().to_string(), (-t.sin()).to_string()];
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
    let object = json(folder.path(), &["demo", "--quick", "-o", "kept"], "leverrier.demo/1");
    assert_eq!(object["model"]["terms"].as_array().expect("terms").len(), 6);
    assert!(folder.path().join("kept/henon-heiles.model.json").is_file());
    let told = good(folder.path(), &["demo", "--quick"]);
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

/// A bad file, the command that meets it, and what its error must say.
struct Bad {
    what: &'static str,
    spec: &'static str,
    data: &'static str,
    command: &'static [&'static str],
    says: &'static [&'static str],
}

const HEAD: &str = "coordinates q\nmomenta p\ndata \"d.csv\" { time t  run run }\n";
const FIT: &[&str] = &["fit", "s.ham"];
const CHECK: &[&str] = &["check", "s.ham"];
const SPEC: &str = "T = p^2/2\nV = span{ q^2 }\n";
const DATA: &str = "run,t,q,p\n1,0,1,0\n1,0.1,0.99,-0.1\n1,0.2,0.98,-0.2\n";

/// A spec that is wrong, with good data.
const fn spec(what: &'static str, spec: &'static str, says: &'static [&'static str]) -> Bad {
    Bad { what, spec, data: DATA, command: CHECK, says }
}

/// Data that are wrong, with a good spec.
const fn data(what: &'static str, data: &'static str, says: &'static [&'static str]) -> Bad {
    Bad { what, spec: SPEC, data, command: FIT, says }
}

const BAD: &[Bad] = &[
    spec("unknown name", "T = p^2/2\nV = span{ qq^2 }", &["s.ham:5:11", "`qq`", "did you mean"]),
    spec("wrong arity", "T = p^2/2\nV = span{ sin(q, 2) }", &["s.ham:5:", "sin"]),
    spec("duplicate term", "T = p^2/2\nV = span{ q^2, q^2 }", &["s.ham:5:", "twice"]),
    spec("unit clash", "coordinates x [m]\nmomenta px [kg*m/s]\nT = px + x", &["s.ham", "unit"]),
    spec("span inside span", "T = p^2/2\nV = span{ span{ q } }", &["s.ham:5:", "span"]),
    spec("huge degree", "T = p^2/2\nV = span{ poly(q, p; 60000) }", &["s.ham:5:", "terms"]),
    spec("nothing at all", "", &["s.ham", "no energy"]),
    data("empty file", "", &["d.csv", "empty"]),
    data("header only", "run,t,q,p\n", &["d.csv", "row"]),
    data("ragged rows", "run,t,q,p\n1,0,1,0\n1,0.1,1\n", &["d.csv, line 3", "cell"]),
    data("text in a number", "run,t,q,p\n1,0,1,0\n1,0.1,x1,0\n", &["line 3", "`q`", "`x1`"]),
    data("infinity", "run,t,q,p\n1,0,1,0\n1,0.1,inf,0\n", &["line 3", "`q`", "infinite"]),
    data("no numbers", "run,t,q,p\n1,0,nan,nan\n1,0.1,nan,nan\n", &["d.csv", "measured"]),
    data(
        "time backwards",
        "run,t,q,p\n1,0,1,0\n1,2,1,0\n1,3,1,0\n1,0.5,1,0\n1,0.7,1,0\n1,0.2,1,0\n1,9,1,1\n",
        &["d.csv", "line", "time"],
    ),
    data("one-sample runs", "run,t,q,p\n1,0,1,0\n2,0,1,0\n", &["d.csv", "only one sample"]),
    data("missing column", "run,t,q,x\n1,0,1,0\n1,1,1,0\n", &["d.csv", "no column", "`p`"]),
    data("not text", "run,t,q,p\n\u{0}\u{1}\u{0}\u{2}\n", &["d.csv", "not a text file"]),
    Bad {
        what: "nothing to learn",
        spec: "T = p^2/2\nV = q^2",
        data: DATA,
        command: FIT,
        says: &["nothing to learn", "span{...}"],
    },
    Bad {
        what: "no model yet",
        spec: SPEC,
        data: DATA,
        command: &["export", "s.ham", "latex"],
        says: &["s.model.json", "leverrier fit s.ham"],
    },
    Bad {
        what: "no spec",
        spec: SPEC,
        data: DATA,
        command: &["fit", "x.ham"],
        says: &["x.ham", "no such file"],
    },
    Bad { what: "a folder", spec: SPEC, data: DATA, command: &["fit", "."], says: &["folder"] },
    Bad {
        what: "no data file",
        spec: SPEC,
        data: DATA,
        command: &["fit", "s.ham", "--data", "x.csv"],
        says: &["x.csv", "no such file"],
    },
    Bad {
        what: "no folder for the model",
        spec: SPEC,
        data: DATA,
        command: &["fit", "s.ham", "-o", "nowhere/m.json"],
        says: &["nowhere/m.json", "no such folder"],
    },
    Bad {
        what: "unknown format",
        spec: SPEC,
        data: DATA,
        command: &["export", "s.ham", "word"],
        says: &["word", "latex"],
    },
    Bad {
        what: "half a start",
        spec: "T = p^2/2\nV = q^2",
        data: DATA,
        command: &["simulate", "s.ham", "--start", "q=1", "--dt=1", "--samples=3"],
        says: &["does not say p", "--start q=0.1,p=0.1"],
    },
    Bad {
        what: "unknown component",
        spec: "T = p^2/2\nV = q^2",
        data: DATA,
        command: &["simulate", "s.ham", "--start", "q=1,pp=0", "--dt=1", "--samples=3"],
        says: &["`pp`", "did you mean `p`"],
    },
    Bad {
        what: "unreachable energies",
        spec: "T = p^2/2\nV = q^2",
        data: DATA,
        command: &[
            "simulate",
            "s.ham",
            "--sample",
            "q=0..1",
            "--sample",
            "p=0..1",
            "--energy=7..8",
            "--dt=1",
            "--samples=3",
        ],
        says: &["--energy"],
    },
    Bad {
        what: "an exploding law",
        spec: "T = p^2/2\nV = -q^6",
        data: DATA,
        command: &["simulate", "s.ham", "--start", "q=1,p=1", "--dt=1", "--samples=30"],
        says: &["run 1 leaves the finite numbers", "shorten"],
    },
];

#[test]
fn bad_input_is_refused_with_place_and_advice() {
    for bad in BAD {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path();
        let whole = bad.spec.is_empty() || bad.spec.contains("coordinates");
        let text = if whole { bad.spec.to_string() } else { format!("{HEAD}{}", bad.spec) };
        fs::write(path.join("s.ham"), text).expect("written");
        fs::write(path.join("d.csv"), bad.data).expect("written");
        let before = listing(path);
        let done = run(path, bad.command);
        assert!(matches!(done.code, Some(1 | 2)), "{}: {:?}\n{}", bad.what, done.code, done.out);
        for part in bad.says {
            assert!(done.err.contains(part), "{}: {part} is not in\n{}", bad.what, done.err);
        }
        let mut as_json = bad.command.to_vec();
        as_json.extend(["--format", "json"]);
        let done = run(path, &as_json);
        assert_eq!(done.out, "", "{}", bad.what);
        let error: Value = serde_json::from_str(&done.err).expect("JSON");
        assert_eq!(error["format"], "leverrier.error/1");
        assert_eq!(error["exit_code"].as_i64().map(|x| x as i32), done.code);
        assert_eq!(listing(path), before, "{}: something was written", bad.what);
    }
}

fn listing(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut names: Vec<String> =
        entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn all_errors_of_a_spec_come_at_once() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let text = format!("{HEAD}T = span{{ sin(p, 2), foo }}\nV = span{{ q^2, q^2, bar }}\n");
    fs::write(folder.path().join("s.ham"), text).expect("written");
    let done = run(folder.path(), &["check", "s.ham", "--format", "json"]);
    let error: Value = serde_json::from_str(&done.err).expect("JSON");
    let diagnostics = error["diagnostics"].as_array().expect("a list");
    assert_eq!(diagnostics.len(), 4, "{diagnostics:#?}");
    for diagnostic in diagnostics {
        assert!(diagnostic["line"].as_u64() > Some(3) && diagnostic["column"].as_u64() > Some(1));
    }
}

#[test]
fn nesting_without_end_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (open, close) = ("(".repeat(100_000), ")".repeat(100_000));
    fs::write(folder.path().join("s.ham"), format!("{HEAD}T = p^2\nV = span{{ {open}q{close} }}"))
        .expect("written");
    let done = run(folder.path(), &["check", "s.ham"]);
    assert_eq!(done.code, Some(1));
    assert!(done.err.contains("line 5") && done.err.contains("levels deep"), "{}", done.err);
    assert!(done.err.len() < 1000, "the message is not drawn");
}

#[test]
fn constant_columns_are_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path();
    let rows: String = (0..30).map(|i| format!("1,{},{},0\n", 0.1 * f64::from(i), i)).collect();
    fs::write(path.join("d.csv"), format!("run,t,q,p\n{rows}")).expect("written");
    fs::write(path.join("s.ham"), format!("{HEAD}{SPEC}")).expect("written");
    let done = run(path, FIT);
    assert!(done.err.contains("p is always 0"), "{}", done.err);
    assert!(good(path, &["new", "d.csv"]).err.contains("`p` is always 0"));
}

#[test]
fn a_model_that_explodes_ends_finite_or_with_a_reason() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path();
    let mut text = "run,t,q,p\n".to_string();
    let mut x: f64 = 0.3;
    for i in 0..60 {
        x = (1e3 * x).sin();
        text.push_str(&format!(
            "1,{},{:e},{:e}\n",
            5.0 * f64::from(i),
            1e6 * x,
            1e9 * (7.0 * x).cos()
        ));
    }
    fs::write(path.join("d.csv"), text).expect("written");
    fs::write(
        path.join("s.ham"),
        format!("{HEAD}T = span{{ poly(p; 4) }}\nV = span{{ poly(q; 6), exp(q) }}"),
    )
    .expect("written");
    let done = run(path, FIT);
    match done.code {
        Some(0) => assert!(!done.out.contains("NaN") && !done.out.contains("inf"), "{}", done.out),
        _ => assert!(done.err.contains("Error:"), "{}", done.err),
    }
}

#[test]
fn models_of_other_specs_and_damaged_ones_are_refused() {
    let folder = pendulum();
    let path = folder.path();
    good(path, &["fit", "swings.ham"]);
    let whole = fs::read_to_string(path.join("swings.model.json")).expect("the model");
    let export = ["export", "swings.ham", "latex"];
    for (text, says) in [
        (whole[..whole.len() / 2].to_string(), "cut off"),
        (String::new(), "cut off"),
        ("hello".to_string(), "not a model file"),
        ("[1]".to_string(), "not a model file"),
        (whole.replace("leverrier.model/1", "leverrier.model/99"), "leverrier.model/99"),
        (whole.replace("\"inclusion\"", "\"exclusion\""), "damaged"),
    ] {
        fs::write(path.join("swings.model.json"), text).expect("written");
        let done = run(path, &export);
        assert_eq!(done.code, Some(1));
        assert!(done.err.contains(says) && done.err.contains("fit swings.ham"), "{}", done.err);
        assert_eq!(done.out, "");
    }
    fs::write(path.join("swings.model.json"), &whole).expect("written");
    // A comment changes nothing; another function space does.
    fs::write(path.join("swings.ham"), format!("# mine\n{UNKNOWN}")).expect("written");
    good(path, &export);
    fs::write(path.join("swings.ham"), UNKNOWN.replace("; 2", "; 3")).expect("written");
    let done = run(path, &export);
    assert!(done.err.contains("another spec") && done.err.contains("again"), "{}", done.err);
}

#[test]
fn a_full_disk_is_an_error() {
    if !Path::new("/dev/full").exists() {
        println!("there is no /dev/full here");
        return;
    }
    let folder = pendulum();
    let path = folder.path();
    let before = listing(path);
    let fit = run(path, &["fit", "swings.ham", "-o", "/dev/full"]);
    assert_eq!(fit.code, Some(1));
    assert!(fit.err.contains("/dev/full") && fit.out.contains("cos(theta)"), "{}", fit.err);
    let made = run(
        path,
        &["simulate", "known.ham", "--start=1,0", "--dt=1", "--samples=3", "-o", "/dev/full"],
    );
    assert_eq!(made.code, Some(1));
    assert_eq!(listing(path), before);
    let full = fs::OpenOptions::new().write(true).open("/dev/full").expect("it is there");
    let program = assert_cmd::cargo::cargo_bin("leverrier");
    let check = std::process::Command::new(program)
        .current_dir(path)
        .args(["check", "swings.ham"])
        .stdout(full)
        .output()
        .expect("the program runs");
    assert_eq!(check.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&check.stderr).contains("standard output"));
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
    let Some(file) = common::shared_data("real_pendulum.csv") else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let spec = "coordinates theta [rad]\nvelocities omega [rad/s]\ntime t [s]\n\
                data \"swings.csv\" { time t [s]  run trial }\n\
                T = p_theta^2/2\nV = span{ -cos(theta) }\n";
    fs::write(folder.path().join("s.ham"), spec).expect("written");
    let file = file.display().to_string();
    let fitted = json(folder.path(), &["fit", "s.ham", "--data", &file], "leverrier.fit/1");
    let a = fitted["model"]["terms"][0]["coefficient"].as_f64().expect("a number");
    assert!((1.29..=1.33).contains(&a), "{a}");
    assert_eq!(fitted["data"]["gaps"].as_array().expect("gaps").len(), 10);
}
