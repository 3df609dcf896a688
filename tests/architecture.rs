//! The house rules that no compiler checks: the direction of imports and the length of files.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a panic is how a test fails"
)]

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
    "facade",
    "report",
    "project",
    "studio",
    "cli",
];

/// Longest file, in lines: what can be read in one sitting.
const LONGEST: usize = 600;
/// Columns of the widest comment: those of the formatter.
const WIDEST: usize = 100;

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

/// Whether a line is of a comment too wide to read; code in examples and tables may be wider.
fn is_too_wide(line: &str, within_code: bool) -> bool {
    let text = line.trim_start();
    let comment =
        text.starts_with("//") && !text.starts_with("/// |") && !text.starts_with("//! |");
    comment && !within_code && line.chars().count() > WIDEST
}

#[test]
fn comments_are_no_wider_than_code() {
    let mut paths = Vec::new();
    for folder in ["src", "tests", "examples", "benches"] {
        rust_files(&root().join(folder), &mut paths);
    }
    let mut wide = Vec::new();
    for path in &paths {
        let text = fs::read_to_string(path).unwrap_or_default();
        let mut within_code = false;
        for (number, line) in text.lines().enumerate() {
            let fence = line.trim_start().trim_start_matches(['/', '!']).trim().starts_with("```");
            within_code ^= fence;
            if is_too_wide(line, within_code) {
                wide.push(format!("{}: {}", path.display(), number + 1));
            }
        }
    }
    assert!(paths.len() > 100 && wide.is_empty(), "{}", wide.join("\n"));
    assert!(is_too_wide(&format!("    // {}", "word ".repeat(20)), false));
}

/// Names that the crate's root shows, each with the layer that it comes from: `pub use` of
/// `src/lib.rs`, a module with all that is public in it.
fn shown(sources: &[Source]) -> Vec<(String, String)> {
    let root = sources.iter().find(|source| source.name == "lib.rs").expect("src/lib.rs");
    let mut found = Vec::new();
    for line in root.text.lines().filter_map(|line| line.strip_prefix("pub use ")) {
        let (path, names) = line.trim_end_matches(';').rsplit_once("::").expect("a path");
        let layer = path.split("::").next().expect("a layer");
        for name in names.trim_matches(['{', '}']).split(',').map(str::trim) {
            let module = format!("{layer}/{name}.rs");
            match sources.iter().find(|source| source.name == module) {
                Some(module) => found.extend(
                    (module.text.lines())
                        .filter_map(|line| line.strip_prefix("pub struct "))
                        .map(|rest| (layer.to_string(), word(rest))),
                ),
                None => found.push((layer.to_string(), name.to_string())),
            }
        }
    }
    found
}

fn word(text: &str) -> String {
    text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
}

/// The type that the block which a line opens is of, if it opens one: `impl Law {`.
fn opens(line: &str) -> Option<String> {
    let rest = line.strip_prefix("impl")?.strip_suffix('{')?;
    let rest = if rest.starts_with('<') { rest.split_once("> ")?.1 } else { rest };
    (!rest.contains(" for ")).then(|| word(rest.trim()))
}

/// Every type and function at the crate's root, whichever layer it comes from, has an example that
/// runs as a test.
#[test]
fn what_is_public_has_an_example() {
    let sources = sources();
    let shown = shown(&sources);
    let mut wanting = Vec::new();
    let (mut types, mut functions) = (Vec::new(), 0);
    for source in &sources {
        let is_shown =
            |name: &str| shown.iter().any(|(layer, shown)| *layer == source.layer && shown == name);
        let (mut documentation, mut hidden, mut of) = (String::new(), false, None);
        for (line, text) in source.text.lines().enumerate() {
            if text == "#[cfg(test)]" {
                break;
            }
            if text.starts_with("impl") {
                of = opens(text);
            }
            if text == "}" {
                of = None;
            }
            let text = text.trim();
            if text.starts_with("///") {
                documentation.push_str(text);
                continue;
            }
            if text.starts_with("#[") {
                hidden |= text == "#[doc(hidden)]";
                continue;
            }
            let item = ["struct ", "enum ", "trait ", "type "]
                .iter()
                .find_map(|kind| text.strip_prefix("pub ")?.strip_prefix(kind).map(word))
                .filter(|name| is_shown(name));
            let function = of.as_deref().is_some_and(is_shown)
                && ["pub fn ", "pub const fn "].iter().any(|start| text.starts_with(start));
            if (item.is_some() || function && !hidden) && !documentation.contains("```") {
                wanting.push(format!("{}:{}: {text}", source.name, line + 1));
            }
            functions += usize::from(function && !hidden);
            types.extend(item);
            (documentation, hidden) = (String::new(), false);
        }
    }
    let lost: Vec<_> = shown.iter().filter(|(_, name)| !types.contains(name)).collect();
    assert!(lost.is_empty(), "where are {lost:?}?");
    assert!(functions > 50 && types.len() > 30, "{functions} functions, {} types", types.len());
    assert!(wanting.is_empty(), "without an example:\n{}", wanting.join("\n"));
}

/// Pages that say where things are.
const PAGES: &[&str] = &[
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "docs/architecture.md",
    "docs/glossary.md",
    "docs/security.md",
];

/// What the crate is built of, and what its page says of it: the same names.
#[test]
fn the_page_says_what_each_dependency_is_for() {
    let manifest = fs::read_to_string(root().join("Cargo.toml")).expect("a manifest");
    let mut depends = Vec::new();
    let mut within = false;
    for line in manifest.lines() {
        if line.starts_with('[') {
            within = line.ends_with("dependencies]") && !line.contains("dev-");
        } else if let Some((name, _)) = line.split_once('=')
            && within
            && !line.starts_with('#')
        {
            depends.push(name.trim().to_string());
        }
    }
    let page = fs::read_to_string(root().join("docs/security.md")).expect("a page");
    let table = page.lines().skip_while(|line| !line.starts_with("| crate |")).skip(2);
    let first = |line: &str| line.split('|').nth(1).map(str::to_string);
    let mut listed: Vec<String> = table
        .filter_map(first)
        .flat_map(|cell| cell.split(',').map(|name| name.trim().to_string()).collect::<Vec<_>>())
        .collect();
    depends.sort();
    listed.sort();
    assert!(depends.len() > 30, "{depends:?}");
    assert_eq!(depends, listed);
}

/// Every file with `unsafe` in it stands on the page on security, with how often.
#[test]
fn the_page_on_security_counts_what_is_unsafe() {
    let kinds = ["unsafe {", "unsafe fn", "unsafe impl", "unsafe trait"];
    let of = |source: &Source| {
        let lines = source.code().map(|(_, line)| line);
        lines.flat_map(|line| kinds.map(|kind| line.matches(kind).count())).sum::<usize>()
    };
    let sources = sources();
    let counted = sources.iter().map(|source| (format!("src/{}", source.name), of(source)));
    let counted: Vec<(String, usize)> = counted.filter(|(_, count)| *count > 0).collect();
    let page = fs::read_to_string(root().join("docs/security.md")).expect("a page");
    let table = page.lines().skip_while(|line| !line.starts_with("| file |")).skip(2);
    let mut told: Vec<(String, usize)> = table
        .map_while(|line| line.strip_prefix("| `"))
        .map(|line| {
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            let reason = cells[2].len() > 20;
            assert!(reason, "{line}");
            (cells[0].trim_end_matches('`').to_string(), cells[1].parse().expect("a number"))
        })
        .collect();
    told.sort();
    assert!(counted.len() > 5 && counted == told, "counted: {counted:#?}");
}

/// Whether an expression of licences (`MIT OR Apache-2.0`) can be met with those that are allowed.
fn is_allowed(expression: &str, allowed: &[&str]) -> bool {
    let spaced = expression.replace('(', " ( ").replace(')', " ) ").replace('/', " OR ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    any_of(&mut words.as_slice(), allowed)
}

fn any_of(words: &mut &[&str], allowed: &[&str]) -> bool {
    let mut met = all_of(words, allowed);
    while let Some(("OR", rest)) = words.split_first().map(|(word, rest)| (*word, rest)) {
        *words = rest;
        met |= all_of(words, allowed);
    }
    met
}

fn all_of(words: &mut &[&str], allowed: &[&str]) -> bool {
    let mut met = true;
    loop {
        let Some((first, rest)) = words.split_first() else { return false };
        *words = rest;
        met &= match (*first, rest) {
            ("(", _) => {
                let inner = any_of(words, allowed);
                *words = words.get(1..).unwrap_or(&[]);
                inner
            }
            (licence, ["WITH", exception, ..]) => {
                *words = &words[2..];
                let whole = format!("{licence} WITH {exception}");
                allowed.contains(&licence) || allowed.contains(&whole.as_str())
            }
            (licence, _) => allowed.contains(&licence),
        };
        match words.split_first() {
            Some((&"AND", rest)) => *words = rest,
            _ => return met,
        }
    }
}

/// The licences of all dependencies are of those that `deny.toml` allows: what `cargo deny` asks,
/// too, where it is installed.
#[test]
fn licences_of_dependencies_are_allowed() {
    let list = fs::read_to_string(root().join("deny.toml")).expect("deny.toml");
    let list = list.split("allow = [").nth(1).and_then(|rest| rest.split(']').next());
    let allowed: Vec<&str> = list.expect("a list").split('"').skip(1).step_by(2).collect();
    for (expression, expected) in [
        ("MIT OR Apache-2.0", true),
        ("GPL-3.0", false),
        ("MIT AND GPL-3.0", false),
        ("(MIT OR GPL-3.0) AND Unicode-3.0", true),
        ("Apache-2.0 WITH LLVM-exception", true),
        ("GPL-2.0 OR (GPL-3.0 AND MIT)", false),
        ("Unlicense/MIT", true),
    ] {
        assert_eq!(is_allowed(expression, &allowed), expected, "{expression}");
    }
    let said = |program: &str, arguments: &[&str]| {
        let mut command = std::process::Command::new(program);
        let output = command.args(arguments).current_dir(root()).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let about = said("rustc", &["-vV"]).unwrap_or_default();
    let host = about.lines().find_map(|line| line.strip_prefix("host: ")).unwrap_or_default();
    let cargo = std::env::var("CARGO").unwrap_or("cargo".to_string());
    let filter = ["metadata", "--format-version=1", "--offline", "--locked", "--filter-platform"];
    let Some(metadata) = said(&cargo, &[&filter[..], &[host]].concat()) else {
        println!("skipped: cargo cannot say what the dependencies are without a network");
        return;
    };
    let metadata: serde_json::Value = serde_json::from_str(&metadata).expect("JSON");
    let packages = metadata["packages"].as_array().expect("packages");
    assert!(packages.len() > 60, "{}", packages.len());
    for package in packages {
        let licence = package["license"].as_str().unwrap_or_default();
        assert!(is_allowed(licence, &allowed), "{}: {licence:?}", package["name"]);
    }
}

/// What a page puts between backticks or links to.
fn mentioned(page: &str) -> Vec<String> {
    let code = page.split("```").step_by(2).flat_map(|prose| prose.split('`').skip(1).step_by(2));
    let links = page.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    code.chain(links).map(str::to_string).collect()
}

#[test]
fn the_pages_name_files_that_exist() {
    let endings = [".rs", ".md", ".toml", ".ebnf", ".svg", ".csv", ".py", ".yml", ".json"];
    let folders = ["src/", "tests/", "docs/", "examples/", "benches/", "grammar/", ".ci/"];
    let names: Vec<String> = sources().into_iter().map(|source| source.name).collect();
    let mut wrong = Vec::new();
    let mut seen = 0;
    for page in PAGES {
        let text = fs::read_to_string(root().join(page)).unwrap_or_else(|e| panic!("{page}: {e}"));
        let beside = root().join(page);
        let beside = beside.parent().expect("a folder");
        for name in mentioned(&text) {
            let own = folders.iter().any(|folder| name.starts_with(folder));
            let source = name.ends_with(".rs");
            let file = endings.iter().any(|ending| name.ends_with(ending)) && name.contains('/');
            if name.contains([' ', '*', ':']) || !(own || source || file) {
                continue;
            }
            seen += 1;
            let here = root().join(&name).exists() || beside.join(&name).exists();
            let below = names.iter().any(|known| known.ends_with(&format!("/{name}")));
            if !(here || source && (below || names.contains(&name))) {
                wrong.push(format!("{page}: {name}"));
            }
        }
    }
    assert!(seen > 50 && wrong.is_empty(), "there is no such file:\n{}", wrong.join("\n"));
}
