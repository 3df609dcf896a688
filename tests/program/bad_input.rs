//! Whatever can be wrong with the input: each a clear error that says where and what to do.

use std::fs;
use std::path::Path;

use crate::support::program::{UNKNOWN, good, listing, pendulum, run};
use serde_json::Value;

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

#[test]
fn an_evaluator_that_does_not_exist_is_named() {
    let folder = pendulum();
    let asked = |backend: &str| {
        assert_cmd::Command::cargo_bin("leverrier")
            .expect("the program is built")
            .env("LEVERRIER_BACKEND", backend)
            .args(["effects"])
            .current_dir(folder.path())
            .output()
            .expect("the program runs")
    };
    assert!(asked("batched").status.success() && asked("").status.success());
    let wrong = asked("quantum");
    let text = String::from_utf8_lossy(&wrong.stderr).into_owned();
    assert!(
        !wrong.status.success() && text.contains("quantum") && text.contains("batched"),
        "{text}"
    );
}

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
    spec(
        "duplicate term",
        "T = p^2/2\nV = span{ q^2, q^2 }",
        &["s.ham:5:16", "duplicate", "keep one"],
    ),
    spec(
        "unit clash",
        "coordinates x [m]\nmomenta px [kg*m/s]\ntime t [s]\nT = px^2\nV = 2*x",
        &["s.ham", "units clash", "[kg"],
    ),
    spec("span inside span", "T = p^2/2\nV = span{ span{ q } }", &["s.ham:5:", "span"]),
    spec("huge degree", "T = p^2/2\nV = span{ poly(q; 6000000) }", &["s.ham:5:", "terms"]),
    spec("nothing at all", "", &["s.ham", "no coordinates", "write for example"]),
    data("empty file", "", &["d.csv", "empty"]),
    data("header only", "run,t,q,p\n", &["d.csv", "row"]),
    data("ragged rows", "run,t,q,p\n1,0,1,0\n1,0.1,1\n", &["d.csv, line 3", "cell"]),
    data("text in a number", "run,t,q,p\n1,0,1,0\n1,0.1,x1,0\n", &["line 3", "`q`", "`x1`"]),
    data("infinity", "run,t,q,p\n1,0,1,0\n1,0.1,inf,0\n", &["line 3", "`q`", "infinite"]),
    data("no numbers", "run,t,q,p\n1,0,nan,nan\n1,0.1,nan,nan\n", &["d.csv", "measured"]),
    data(
        "time backwards",
        "run,t,q,p\n1,3,1,0\n1,2,2,0\n1,1,3,0\n",
        &["d.csv, line 3", "column `t`", "time runs backwards, from 3 to 2"],
    ),
    data("one-sample runs", "run,t,q,p\n1,0,1,0\n2,0,1,0\n", &["d.csv", "only one sample"]),
    data("missing column", "run,t,p,x\n1,0,1,0\n1,1,1,0\n", &["d.csv", "no column", "`q`"]),
    data("not text", "run,t,q,p\n\u{0}\u{1}\u{0}\u{2}\n", &["d.csv", "not a text file"]),
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
        what: "an diverging law",
        spec: "T = p^2/2\nV = -q^6",
        data: DATA,
        command: &["simulate", "s.ham", "--start", "q=1,p=1", "--dt=1", "--samples=30"],
        says: &["run 1 diverges", "shorten"],
    },
    Bad {
        what: "a series of a law with a jump",
        spec: "T = p^2/2\nV = q^2\nforce q += -0.1*sign(p)",
        data: DATA,
        command: &["simulate", "s.ham", "--start=1,1", "--dt=1", "--samples=3", "--method=taylor"],
        says: &["no Taylor series of `sign`", "leave --method out"],
    },
    Bad {
        what: "a series that ends",
        spec: "T = p^2/2\nV = -1/q",
        data: DATA,
        command: &["simulate", "s.ham", "--start=1,0", "--dt=1", "--samples=3", "--method=taylor"],
        says: &["the Taylor series of run 1 cannot be followed after t = 1", "singularities"],
    },
    Bad {
        what: "a tolerance without series",
        spec: "T = p^2/2\nV = q^2",
        data: DATA,
        command: &["simulate", "s.ham", "--start=1,1", "--dt=1", "--samples=3", "--tolerance=0"],
        says: &["--tolerance goes with --method taylor"],
    },
    Bad {
        what: "a tolerance of nothing",
        spec: "T = p^2/2\nV = q^2",
        data: DATA,
        command: &[
            "simulate",
            "s.ham",
            "--start=1,1",
            "--dt=1",
            "--samples=3",
            "--method=taylor",
            "--tolerance=nan",
        ],
        says: &["from 0 to 0.01"],
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
fn a_model_that_diverges_ends_finite_or_with_a_reason() {
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
    let mut words = done.out.split(|c: char| !c.is_alphanumeric());
    match done.code {
        Some(0) => assert!(words.all(|word| word != "NaN" && word != "inf"), "{}", done.out),
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
        (whole.replace("leverrier.model/2", "leverrier.model/99"), "leverrier.model/99"),
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
