//! The house rules that a compiler does not check: the direction of imports, the length of
//! files, where `unsafe` and panics may stand.

use std::fs;
use std::path::{Path, PathBuf};

/// The layers, each with what it may import: itself and everything above it.
const LAYERS: &[&str] = &[
    "diagnostic",
    "error",
    "data",
    "spec",
    "expr",
    "eval",
    "dynamics",
    "simulate",
    "fit",
    "diagnose",
    "simplify",
    "export",
    "report",
    "project",
    "studio",
    "cli",
];

/// Longest file, in lines: what can be read in one sitting.
const LONGEST: usize = 600;

/// The one layer that may use `unsafe`: it asks the processor what it can do.
const UNSAFE: &str = "eval";

/// Calls that panic, outside tests, and why none of them can.
const PANICS: &[(&str, &str, &str)] = &[
    ("diagnose/hats.rs", "expect(\"a row of FUNCTIONS\")", "the name is a literal of the table"),
    ("fit/stepping.rs", "expect(\"a row of METHODS\")", "the name is a literal of the table"),
    (
        "expr/functions.rs",
        "expect(\"a name that",
        "names in source code; the derivative tests take every row",
    ),
];

struct Source {
    /// Below `src`, with forward slashes.
    name: String,
    layer: String,
    text: String,
}

impl Source {
    /// The lines of code that run: without comments and without the tests at the end.
    fn code(&self) -> impl Iterator<Item = (usize, &str)> {
        self.text
            .lines()
            .enumerate()
            .take_while(|(_, line)| *line != "#[cfg(test)]")
            .map(|(at, line)| (at + 1, line))
            .filter(|(_, line)| !line.trim_start().starts_with("//"))
    }
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    files(folder, "rs", found);
}

fn files(folder: &Path, wanted: &str, found: &mut Vec<PathBuf>) {
    let entries = fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    for entry in entries.flatten() {
        let path = entry.path();
        if path.is_dir() {
            files(&path, wanted, found);
        } else if path.extension().is_some_and(|extension| extension == wanted) {
            found.push(path);
        }
    }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn sources() -> Vec<Source> {
    let folder = root().join("src");
    let mut paths = Vec::new();
    rust_files(&folder, &mut paths);
    paths.sort();
    let read = |path: &PathBuf| {
        let below = path.strip_prefix(&folder).expect("found below it");
        let parts: Vec<String> =
            below.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        let layer = parts[0].trim_end_matches(".rs").to_string();
        let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        Source { name: parts.join("/"), layer, text }
    };
    paths.iter().map(read).collect()
}

/// The layers that a line names: `crate::expr::...`, or the members of `use crate::{...}`.
fn named(line: &str) -> Vec<String> {
    let word = |text: &str| {
        text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>()
    };
    let mut found = Vec::new();
    for (at, _) in line.match_indices("crate::") {
        let rest = &line[at + "crate::".len()..];
        match rest.strip_prefix('{') {
            Some(list) => found.extend(list.split(',').map(|part| word(part.trim()))),
            None => found.push(word(rest)),
        }
    }
    found.retain(|name| LAYERS.contains(&name.as_str()));
    found
}

#[test]
fn a_layer_imports_only_what_comes_before_it() {
    let place = |layer: &str| LAYERS.iter().position(|known| *known == layer);
    let mut wrong = Vec::new();
    for source in sources() {
        if ["lib", "main"].contains(&source.layer.as_str()) {
            continue;
        }
        let Some(own) = place(&source.layer) else {
            wrong.push(format!("{}: the layer `{}` is not in the list", source.name, source.layer));
            continue;
        };
        for (line, code) in source.code() {
            for other in named(code) {
                if place(&other).is_some_and(|other| other > own) {
                    wrong.push(format!("{}:{line}: {} imports {other}", source.name, source.layer));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_check_of_imports_sees_both_spellings() {
    assert_eq!(named("use crate::expr::Graph;"), ["expr"]);
    assert_eq!(named("use crate::{fit::Model, cli};"), ["fit", "cli"]);
    assert_eq!(named("    let a = crate::report::text(crate::eval::x);"), ["report", "eval"]);
    assert!(named("use std::path::Path;").is_empty());
}

#[test]
fn every_layer_of_the_list_exists() {
    let sources = sources();
    for layer in LAYERS {
        assert!(sources.iter().any(|s| s.layer == *layer), "no file of the layer `{layer}`");
    }
}

#[test]
fn files_can_be_read_in_one_sitting() {
    let mut paths = Vec::new();
    for folder in ["src", "tests", "examples", "benches"] {
        if root().join(folder).is_dir() {
            rust_files(&root().join(folder), &mut paths);
            files(&root().join(folder), "py", &mut paths);
        }
    }
    let long: Vec<String> = paths
        .iter()
        .map(|path| (path, fs::read_to_string(path).unwrap_or_default().lines().count()))
        .filter(|(_, lines)| *lines > LONGEST)
        .map(|(path, lines)| format!("{}: {lines} lines", path.display()))
        .collect();
    assert!(paths.len() > 100 && long.is_empty(), "{}", long.join("\n"));
}

#[test]
fn only_the_evaluators_are_unsafe() {
    for source in sources().iter().filter(|source| source.layer != UNSAFE) {
        for (line, code) in source.code() {
            let block = ["unsafe {", "unsafe fn", "unsafe impl", "unsafe extern"];
            assert!(!block.iter().any(|b| code.contains(b)), "{}:{line}: {code}", source.name);
        }
    }
}

#[test]
fn nothing_panics_but_what_cannot() {
    let calls = [".unwrap()", ".expect(", "panic!(", "todo!(", "unimplemented!(", "unreachable!("];
    let mut wrong = Vec::new();
    let mut used = vec![false; PANICS.len()];
    for source in sources() {
        for (line, code) in source.code() {
            if !calls.iter().any(|call| code.contains(call)) {
                continue;
            }
            let allowed = PANICS
                .iter()
                .position(|(file, call, _)| source.name == *file && code.contains(call));
            match allowed {
                Some(row) => used[row] = true,
                None => wrong.push(format!("{}:{line}: {}", source.name, code.trim())),
            }
        }
    }
    assert!(wrong.is_empty(), "these may panic:\n{}", wrong.join("\n"));
    for (row, used) in PANICS.iter().zip(used) {
        assert!(used, "{} has no `{}` any more: take it off the list", row.0, row.1);
    }
}

/// Lower layers say what is wrong in their own words; which option that is on the command line
/// only its own layer knows.
#[test]
fn only_the_command_line_names_its_options() {
    let option = |code: &str| {
        code.match_indices("--").any(|(at, dashes)| {
            code[at + dashes.len()..].starts_with(|c: char| c.is_ascii_lowercase())
                && !code[..at].ends_with('-')
        })
    };
    for source in sources().iter().filter(|source| source.layer != "cli") {
        for (line, code) in source.code() {
            let named = option(code) || code.contains("clap::") || code.contains(" -o\"");
            assert!(!named, "{}:{line}: {code}", source.name);
        }
    }
    assert!(option("give --force") && !option("a -- b") && !option("%---x"));
}
