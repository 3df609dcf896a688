//! Runs the program as a user does.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

/// What a command did.
pub(crate) struct Done {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

pub(crate) fn run(folder: &Path, arguments: &[&str]) -> Done {
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

pub(crate) fn good(folder: &Path, arguments: &[&str]) -> Done {
    let done = run(folder, arguments);
    assert_eq!(done.code, Some(0), "{arguments:?}\n{}\n{}", done.out, done.err);
    done
}

pub(crate) fn json(folder: &Path, arguments: &[&str], format: &str) -> Value {
    let mut all = arguments.to_vec();
    all.extend(["--format", "json"]);
    let done = good(folder, &all);
    assert_eq!(done.err, "", "{arguments:?}");
    let value: Value = serde_json::from_str(&done.out).expect("one JSON object");
    assert_eq!(value["format"], format, "{arguments:?}");
    value
}

pub(crate) const KNOWN: &str = "system \"pendulum\"
coordinates theta [rad]
velocities omega [rad/s]
time t [s]
T = p_theta^2/2
V = -1.3 [1/s^2]*cos(theta)
";

pub(crate) const UNKNOWN: &str = "system \"pendulum\"
coordinates theta [rad]
velocities omega [rad/s]
time t [s]
data \"swings.csv\" { time t [s]  run run }
T = p_theta^2/2
V = span{ poly(theta; 2), cos(theta) }
";

/// A folder with a known and an unknown pendulum, and data made by `simulate`.
pub(crate) fn pendulum() -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("known.ham"), KNOWN).expect("written");
    fs::write(folder.path().join("swings.ham"), UNKNOWN).expect("written");
    good(folder.path(), &MAKE_SWINGS);
    folder
}

pub(crate) const MAKE_SWINGS: [&str; 15] = [
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
    "--seed=8",
    "-o",
    "swings.csv",
    "--force",
];

/// Names of the files of a folder.
pub(crate) fn listing(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut names: Vec<String> =
        entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}
