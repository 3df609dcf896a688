//! Files of earlier versions: what they wrote is read today.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::killing::{good, ran};

/// Folders of tests/fixtures/versions, each written by the program of one version: `fit`, `add`,
/// `history` and what else writes, on the same spec.
fn versions() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/versions");
    let entries = fs::read_dir(folder).expect("a folder").flatten().map(|entry| entry.path());
    let mut folders: Vec<PathBuf> = entries.filter(|path| path.is_dir()).collect();
    folders.sort();
    folders
}

/// A copy of a version's folder.
fn copied(version: &Path) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for entry in fs::read_dir(version).expect("a folder").flatten() {
        fs::copy(entry.path(), folder.path().join(entry.file_name())).expect("a copy");
    }
    folder
}

#[test]
fn files_of_every_version_are_read() {
    assert!(versions().len() >= 2);
    for version in versions() {
        let folder = copied(&version);
        let path = folder.path();
        let history = good(path, "history fit.ham");
        assert!(history.contains("viscous_drag"), "{}: {history}", version.display());
        let exported = good(path, "export fit.ham python");
        let model = fs::read_to_string(path.join("fit.model.json")).expect("a model");
        let model: Value = serde_json::from_str(&model).expect("JSON");
        let printed = model["terms"][0]["coefficient"].as_f64().expect("a number").to_string();
        assert!(exported.contains(&printed[..6]), "{printed} is not in {exported}");
        for line in ["compare fit.ham", "simulate fit.ham --start 1,0 --duration 1 --dt 0.1"] {
            good(path, line);
        }
        // They go on from there, and back.
        good(path, "undo fit.ham");
        let text = fs::read_to_string(path.join("fit.ham")).expect("a spec");
        assert!(!text.contains("viscous_drag"), "{}: {text}", version.display());
        good(path, "add fit.ham viscous_drag");
        let again = fs::read_to_string(path.join("fit.model.json")).expect("a model");
        let again: Value = serde_json::from_str(&again).expect("JSON");
        for (old, new) in terms(&model).iter().zip(terms(&again)) {
            let apart = (old.1 - new.1).abs();
            assert!(old.0 == new.0 && apart < 0.5 * old.2, "{old:?} {new:?}");
        }
    }
}

/// Terms of a model, with coefficient and standard error.
fn terms(model: &Value) -> Vec<(String, f64, f64)> {
    let number = |value: &Value| value.as_f64().expect("a number");
    let one = |term: &Value| {
        let name = term["term"].as_str().expect("a name").to_string();
        (name, number(&term["coefficient"]), number(&term["standard_error"]))
    };
    model["terms"].as_array().expect("terms").iter().map(one).collect()
}

/// A file of a version that is still to come says so.
#[test]
fn files_of_later_versions_are_refused_with_a_sentence() {
    let folder = copied(versions().last().expect("a version"));
    let path = folder.path();
    for (name, line) in
        [("fit.model.json", "export fit.ham latex"), ("fit.ledger.json", "history fit.ham")]
    {
        let text = fs::read_to_string(path.join(name)).expect("a file");
        let kind = name.split('.').nth(1).expect("a kind");
        let later = text.replace(&format!("leverrier.{kind}/2"), &format!("leverrier.{kind}/99"));
        assert_ne!(later, text);
        fs::write(path.join(name), later).expect("written");
        let output = ran(path, line);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("/99") && said.contains("this version reads"), "{said}");
    }
}
