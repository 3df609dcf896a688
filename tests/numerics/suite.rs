//! Golden tests: each `tests/suite/*.ham` holds a spec and, in lines that begin with `#=`,
//! what `check` says about it. `LEVERRIER_UPDATE=1` writes the expected lines anew.

use std::fs;
use std::path::{Path, PathBuf};

use leverrier::internals::error::Error;
use leverrier::internals::expr::{FunctionSpace, build};

const MARK: &str = "#=";

fn files(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let entries = fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "ham"))
        .collect();
    files.sort();
    files
}

/// What a user reads: the function space with its warnings, or every error.
fn outcome(name: &str, spec: &str) -> String {
    match build(name, spec) {
        Ok(compiled) => {
            let mut out = FunctionSpace::new(&compiled).text(100);
            for warning in &compiled.warnings {
                out.push('\n');
                out.push_str(&warning.render(name, spec, false));
                out.push('\n');
            }
            out
        }
        Err(Error::Spec { name, text, diagnostics }) => {
            assert!(!diagnostics.is_empty(), "{name} fails without a reason");
            let rendered: Vec<String> =
                diagnostics.iter().map(|d| d.render(&name, &text, false)).collect();
            rendered.join("\n\n")
        }
        Err(other) => panic!("{name}: {other}"),
    }
}

#[test]
fn every_spec_says_what_is_expected() {
    let update = std::env::var_os("LEVERRIER_UPDATE").is_some();
    let files = files("tests/suite");
    assert!(files.len() >= 25, "only {} specs", files.len());
    let mut wrong = Vec::new();
    for path in files {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{name}: {e}"));
        let at = text.find(&format!("\n{MARK}")).map_or(text.len(), |at| at + 1);
        let (spec, expected) = text.split_at(at);
        let found: String = outcome(&name, spec)
            .lines()
            .map(|line| format!("{MARK} {line}").trim_end().to_string() + "\n")
            .collect();
        if found == expected {
            continue;
        }
        if update {
            let end = if spec.ends_with('\n') { "" } else { "\n" };
            fs::write(&path, format!("{spec}{end}{found}"))
                .unwrap_or_else(|e| panic!("{name}: {e}"));
        } else {
            wrong.push(format!("--- {name}: expected\n{expected}\n--- found\n{found}"));
        }
    }
    assert!(wrong.is_empty(), "{}\n(LEVERRIER_UPDATE=1 accepts)", wrong.join("\n"));
}

/// Every message says what to do.
#[test]
fn every_error_has_a_label_and_a_hint_or_names_what_was_expected() {
    for path in files("tests/suite") {
        let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        if let Err(Error::Spec { diagnostics, .. }) = build("spec", &text) {
            for diagnostic in diagnostics {
                assert!(!diagnostic.label.is_empty(), "{}: {diagnostic:?}", path.display());
                let says = diagnostic.hint.is_some() || diagnostic.message.starts_with("expected");
                assert!(says, "{}: {diagnostic:?}", path.display());
            }
        }
    }
}
