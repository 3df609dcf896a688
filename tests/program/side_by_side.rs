//! Several commands at once on one spec: nothing that one of them wrote is lost by another.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::time::Duration;

use serde_json::Value;
use tempfile::TempDir;

use crate::support::program::{good, json};

/// A pendulum with a hidden drag and torque, its measurements, and a model of it.
fn pendulum() -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let truth = "coordinates theta\nmomenta p\ntime t\nT = p^2/2\nV = -1.3*cos(theta)\n\
                 force theta += -0.05*p + 0.08\n";
    let spec = "# notes\ncoordinates theta\nmomenta p\ntime t\n\
                data \"swings.csv\" { time t  run run }\nT = p^2/2\nV = span{ cos(theta) }\n";
    fs::write(folder.path().join("truth.ham"), truth).expect("written");
    fs::write(folder.path().join("s.ham"), spec).expect("written");
    let make = "simulate truth.ham --sample theta=-1.8..1.8 --sample p=-1..1 --dt=0.1 --noise=1% \
                --seed=5 -o swings.csv --runs 8 --samples=60";
    good(folder.path(), &make.split_whitespace().collect::<Vec<_>>());
    good(folder.path(), &["fit", "s.ham"]);
    folder
}

fn start(folder: &Path, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_leverrier"))
        .current_dir(folder)
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts")
}

/// Reads until it says that it waits; what comes after that is read from what is returned.
fn waits(child: &mut Child) -> BufReader<ChildStderr> {
    let mut words = BufReader::new(child.stderr.take().expect("its words"));
    let mut said = String::new();
    while !said.contains("waiting until it is done") {
        assert!(words.read_line(&mut said).expect("text") > 0, "it did not wait: {said}");
    }
    words
}

/// What it wrote to standard error.
fn ended(child: Child, arguments: &[&str]) -> String {
    let done = child.wait_with_output().expect("the program ends");
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(done.status.success(), "{arguments:?}: {said}");
    said
}

fn actions(folder: &Path) -> Vec<(String, bool)> {
    let history = json(folder, &["history", "s.ham"], "leverrier.history/2");
    let revisions = history["revisions"].as_array().expect("revisions").iter();
    let one = |revision: &Value| {
        let action = revision["action"].as_str().expect("an action").to_string();
        (action, revision["undone"].as_bool().expect("whether it was undone"))
    };
    revisions.map(one).collect()
}

#[test]
fn two_additions_at_once_are_both_kept() {
    let folder = pendulum();
    let path = folder.path();
    let [first, second] = [["add", "s.ham", "viscous_drag"], ["add", "s.ham", "constant_force"]];
    // The test holds the spec until both wait for it, however quick either is.
    let lock = fs::File::create(path.join("s.lock")).expect("a lock");
    lock.lock().expect("held");
    let (mut one, mut other) = (start(path, &first), start(path, &second));
    let _words = [waits(&mut one), waits(&mut other)];
    drop(lock);
    let said = ended(one, &first) + &ended(other, &second);
    let text = fs::read_to_string(path.join("s.ham")).expect("a spec");
    assert!(text.contains("viscous_drag") && text.contains("constant_force"), "{text}\n{said}");
    let actions = actions(path);
    assert_eq!(actions.len(), 3, "{actions:?}\n{said}");
    assert!(actions.iter().all(|(_, undone)| !undone), "{actions:?}\n{said}");
    // One of them is taken back while the spec is learned anew.
    let [undo, fit] = [["undo", "s.ham"], ["fit", "s.ham"]];
    let (one, other) = (start(path, &undo), start(path, &fit));
    ended(one, &undo);
    ended(other, &fit);
    let text = fs::read_to_string(path.join("s.ham")).expect("a spec");
    let left = ["viscous_drag", "constant_force"].iter().filter(|effect| text.contains(**effect));
    assert_eq!(left.count(), 1, "{text}");
    assert!(!cfg!(unix) || !path.join("s.lock").exists());
    good(path, &["fit", "s.ham"]);
}

#[test]
fn a_command_that_is_killed_leaves_no_lock() {
    let add = ["add", "s.ham", "viscous_drag"];
    // One that was done before it was killed, as on a busy machine, is tried again.
    let interrupted = (0..20).find_map(|_| {
        let folder = pendulum();
        let path = folder.path();
        let mut killed = start(path, &add);
        let done = |killed: &mut Child| killed.try_wait().expect("its state").is_some();
        while !path.join("s.lock").exists() && !done(&mut killed) {
            std::thread::sleep(Duration::from_millis(2));
        }
        killed.kill().expect("killed");
        killed.wait().expect("gone");
        let text = fs::read_to_string(path.join("s.ham")).expect("a spec");
        (!text.contains("viscous_drag")).then_some(folder)
    });
    let folder = interrupted.expect("one that was killed in time");
    let path = folder.path();
    let said = ended(start(path, &add), &add);
    assert!(!said.contains("waiting"), "{said}");
    let text = fs::read_to_string(path.join("s.ham")).expect("a spec");
    assert_eq!(text.matches("viscous_drag").count(), 1, "{text}");
}
