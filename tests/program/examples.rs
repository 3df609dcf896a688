//! Every command of every example runs, and makes the data that is shipped, byte for byte.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;

fn folders() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let mut found: Vec<PathBuf> = fs::read_dir(&root)
        .expect("the examples")
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.join("README.md").is_file())
        .collect();
    found.sort();
    found
}

/// The commands of a page, as lists of words.
fn commands(page: &str) -> Vec<Vec<String>> {
    let lines = page.lines().filter_map(|line| line.strip_prefix("$ leverrier "));
    lines.map(|line| line.split_whitespace().map(String::from).collect()).collect()
}

fn copied(folder: &Path) -> tempfile::TempDir {
    let copy = tempfile::tempdir().expect("a temporary folder");
    for entry in fs::read_dir(folder).expect("a folder").flatten() {
        fs::copy(entry.path(), copy.path().join(entry.file_name())).expect("a copy");
    }
    copy
}

/// Runs the page's commands in a copy of the folder; the copy, and what was printed.
fn walked(folder: &Path) -> (tempfile::TempDir, Vec<(Vec<String>, String)>) {
    let copy = copied(folder);
    let page = fs::read_to_string(folder.join("README.md")).expect("a page");
    let mut printed = Vec::new();
    for words in commands(&page) {
        let output = Command::cargo_bin("leverrier")
            .expect("built with the tests")
            .current_dir(copy.path())
            .args(&words)
            .output()
            .expect("it runs");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{}: {words:?}\n{said}", folder.display());
        printed.push((words, String::from_utf8_lossy(&output.stdout).into_owned()));
    }
    (copy, printed)
}

#[test]
fn every_example_does_what_its_page_says() {
    let folders = folders();
    assert_eq!(folders.len(), 6);
    for folder in folders {
        let (copy, printed) = walked(&folder);
        assert!(printed.len() >= 2, "{}: the page shows no fit", folder.display());
        assert!(folder.join("truth.ham").is_file() && folder.join("fit.ham").is_file());
        let mut data = 0;
        for entry in fs::read_dir(&folder).expect("a folder").flatten() {
            let path = entry.path();
            if path.extension().is_some_and(|extension| extension == "csv") {
                data += 1;
                let shipped = fs::read(&path).expect("shipped");
                let made = fs::read(copy.path().join(entry.file_name())).expect("made anew");
                assert!(shipped == made, "{} is not what its command makes", path.display());
                let name = entry.file_name().to_string_lossy().into_owned();
                let makes = |words: &[String]| words[0] == "simulate" && words.contains(&name);
                assert!(printed.iter().any(|(words, _)| makes(words)), "{name}: made by nothing");
            }
        }
        assert!(data > 0, "{} ships no data", folder.display());
    }
}

#[test]
fn every_spec_of_the_examples_is_in_order() {
    for folder in folders() {
        for entry in fs::read_dir(&folder).expect("a folder").flatten() {
            let path = entry.path();
            if path.extension().is_some_and(|extension| extension == "ham") {
                Command::cargo_bin("leverrier")
                    .expect("built with the tests")
                    .arg("check")
                    .arg(&path)
                    .assert()
                    .success();
            }
        }
    }
}

#[test]
fn the_printed_laws_are_the_true_ones() {
    let law = |folder: &str, spec: &str| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples").join(folder);
        let copy = copied(&folder);
        let output = Command::cargo_bin("leverrier")
            .expect("built with the tests")
            .current_dir(copy.path())
            .args(["fit", spec])
            .output()
            .expect("it runs");
        String::from_utf8_lossy(&output.stdout).split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let henon_heiles = "H = (p[1]^2 + p[2]^2)/2 + (q[1]^2 + q[2]^2)/2 + q[1]^2 q[2] - q[2]^3/3";
    assert!(law("henon-heiles", "fit.ham").contains(henon_heiles));
    assert!(law("henon-heiles", "degree6.ham").contains(henon_heiles));
    assert!(law("pendulum", "fit.ham").contains("H = p^2/4 - 2 cos(q)"));
    assert!(law("pendulum", "mixed.ham").contains("H = p^2/4 - 2 cos(q)"));
    let chain = law("mass-spring", "fit.ham");
    for spring in ["(q[2] - q[1])^2", "(q[3] - q[2])^2", "(q[4] - q[3])^2", "(q[5] - q[4])^2"] {
        assert!(chain.contains(spring), "{spring} in {chain}");
    }
    let polynomial = law("pendulum", "polynomial.ham");
    assert!(polynomial.contains("Taylor polynomial"), "{polynomial}");
}
