//! SIGINT and SIGTERM: whoever sends one gets the best so far, soon, and an answer that says so.

#![cfg(unix)]

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

use crate::support::program::good;

/// Two bodies whose momenta nobody measures and whose drags are not in the spec: to ask what is
/// missing takes minutes.
fn two_bodies() -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let bodies = "coordinates x, y, u, w\nmomenta px, py, pu, pw\ntime t\n\
                  T = (px^2 + py^2)/2 + (pu^2 + pw^2)/4\n";
    let truth = format!(
        "{bodies}V = -2/sqrt((x - u)^2 + (y - w)^2)\nforce x += -0.002*px\nforce u += -0.004*pu\n"
    );
    let spec = format!(
        "{bodies}body a = (x, y)\nbody b = (u, w)\n\
         data \"d.csv\" {{ time t\n px not measured, py not measured\n pu not measured, \
         pw not measured }}\nV = span{{ -1/sqrt((x - u)^2 + (y - w)^2) }}\n"
    );
    fs::write(folder.path().join("truth.ham"), truth).expect("written");
    fs::write(folder.path().join("s.ham"), spec).expect("written");
    let make = "simulate truth.ham --start x=1,y=0,u=-0.5,w=0,px=0,py=0.9,pu=0,pw=-0.9 --dt=0.02 \
                --samples=6000 --noise=0.1% --seed=3 -o d.csv";
    good(folder.path(), &make.split_whitespace().collect::<Vec<_>>());
    folder
}

/// Longer than it takes on any machine, and shorter than an answer that does not stop.
const PATIENCE: Duration = Duration::from_secs(60);

/// What a command says that gets a signal after some time; it ends within [`PATIENCE`].
fn signalled(folder: &Path, arguments: &[&str], after: Duration, signal: &str) -> Output {
    let mut child: Child = Command::new(env!("CARGO_BIN_EXE_leverrier"))
        .current_dir(folder)
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    std::thread::sleep(after);
    let pid = child.id().to_string();
    let sent = Command::new("kill").args([signal, &pid]).status().expect("kill");
    let begun = Instant::now();
    while sent.success() && child.try_wait().expect("a state").is_none() {
        if begun.elapsed() > PATIENCE {
            child.kill().expect("killed");
            panic!("{arguments:?} goes on for {PATIENCE:?} after {signal}");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    child.wait_with_output().expect("its output")
}

/// The answer of a command that is interrupted. How soon it begins depends on the machine: a signal
/// that comes before there is anything to stop ends the process, and the next comes later.
fn interrupted(folder: &Path, arguments: &[&str], signal: &str) -> Value {
    let before = fs::read(folder.join("s.ham")).expect("the spec");
    for quarters in [4, 8, 16, 32, 64] {
        let after = Duration::from_millis(250 * quarters);
        let output = signalled(folder, arguments, after, signal);
        assert_eq!(fs::read(folder.join("s.ham")).expect("the spec"), before, "{arguments:?}");
        if output.status.code().is_none() {
            continue;
        }
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        let answer: Value = serde_json::from_str(&said).unwrap_or_else(|error| {
            panic!("{arguments:?}: {error}: {said}{}", String::from_utf8_lossy(&output.stderr))
        });
        if output.status.code() == Some(0) {
            return answer;
        }
        // Before the first model there is nothing to keep.
        assert!(said.contains("before there was a result"), "{said}");
    }
    panic!("{arguments:?} came to nothing in time")
}

#[test]
fn a_signal_gets_the_best_so_far_of_a_diagnosis() {
    let folder = two_bodies();
    let dry = ["discover", "--dry-run", "--format", "json", "s.ham"];
    for (arguments, signal) in
        [(&dry[..], "-INT"), (&["diagnose", "--format", "json", "s.ham"], "-TERM")]
    {
        let answer = interrupted(folder.path(), arguments, signal);
        assert_eq!(answer["verdict"], "interrupted", "{answer}");
        let why = if arguments == dry { &answer["stop"] } else { &answer["reason"] };
        assert!(why.as_str().is_some_and(|why| why.contains("interrupted")), "{answer}");
    }
}
