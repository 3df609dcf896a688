//! Everything that the README tells a reader to type, typed: its commands run in a fresh
//! folder, one after the other, and print what it shows. Its tables keep up with the program.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;

use assert_cmd::Command;
use leverrier::internals::expr::Function;
use leverrier::internals::spec::families::FAMILIES;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn page() -> String {
    fs::read_to_string(root().join("README.md")).expect("the README")
}

/// The fenced blocks of the page: language and text, in order.
fn blocks(page: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut open: Option<(String, String)> = None;
    for line in page.lines() {
        match (line.strip_prefix("```"), &mut open) {
            (Some(language), None) => open = Some((language.to_string(), String::new())),
            (Some(_), Some(_)) => found.extend(open.take()),
            (None, Some((_, text))) => {
                text.push_str(line);
                text.push('\n');
            }
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "a block of the README has no end");
    found
}

/// One command of a console block, with the lines that are shown of its output.
struct Typed {
    words: Vec<String>,
    shown: Vec<String>,
}

fn typed(block: &str) -> Vec<Typed> {
    let mut found: Vec<Typed> = Vec::new();
    for line in block.lines() {
        if let Some(command) = line.strip_prefix("$ ") {
            let words = command.split_whitespace().map(String::from).collect();
            found.push(Typed { words, shown: Vec::new() });
        } else if let Some(last) = found.last_mut().filter(|_| line != "...") {
            last.shown.push(line.trim().to_string());
        }
    }
    found
}

/// The arguments for the program itself; `None` for what only cargo can do.
fn arguments(words: &[String]) -> Option<&[String]> {
    if words[0] == "leverrier" {
        return Some(&words[1..]);
    }
    let runs = words.starts_with(&["cargo", "run", "--release", "--"].map(String::from));
    runs.then(|| &words[4..])
}

fn copy_tree(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a folder");
    for entry in fs::read_dir(from).expect("a folder").flatten() {
        let (source, target) = (entry.path(), to.join(entry.file_name()));
        if source.is_dir() {
            copy_tree(&source, &target);
        } else {
            fs::copy(&source, &target).expect("a copy");
        }
    }
}

/// What serves until it is ended is ended when it has printed what is shown.
fn serves(folder: &Path, arguments: &[String], shown: &[String]) {
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_leverrier"))
        .current_dir(folder)
        .args(arguments)
        .arg("--no-open")
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("it runs");
    let mut lines = BufReader::new(child.stdout.take().expect("its output")).lines();
    let found = shown
        .iter()
        .all(|wanted| lines.next().is_some_and(|line| line.is_ok_and(|l| l.contains(wanted))));
    child.kill().expect("it was running");
    child.wait().expect("it ended");
    assert!(found, "{arguments:?} does not print {shown:?}");
}

#[test]
fn every_command_does_what_the_readme_shows() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    copy_tree(&root().join("examples"), &folder.path().join("examples"));
    let mut run = 0;
    for (language, text) in blocks(&page()) {
        if language == "ham" {
            // `# name.ham` in the first line: the file is edited to read like this.
            if let Some(name) = text.lines().next().and_then(|line| line.strip_prefix("# ")) {
                fs::write(folder.path().join(name), &text).expect("written");
            }
        }
        if language != "console" {
            continue;
        }
        for Typed { words, shown } in typed(&text) {
            if let [command, option, from, to] = words.as_slice()
                && (command.as_str(), option.as_str()) == ("cp", "-r")
            {
                copy_tree(&folder.path().join(from), &folder.path().join(to));
                continue;
            }
            let Some(arguments) = arguments(&words) else {
                let known = ["test", "install", "run"].contains(&words[1].as_str());
                assert!(words[0] == "cargo" && known, "who runs {words:?}?");
                continue;
            };
            if arguments.first().is_some_and(|word| word == "studio") {
                serves(folder.path(), arguments, &shown);
                run += 1;
                continue;
            }
            let output = Command::cargo_bin("leverrier")
                .expect("built with the tests")
                .current_dir(folder.path())
                .args(arguments)
                .output()
                .expect("it runs");
            let (out, err) =
                (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
            assert!(output.status.success(), "{words:?}\n{out}\n{err}");
            for line in shown {
                assert!(out.contains(&line), "{words:?} does not print `{line}`, but\n{out}");
            }
            run += 1;
        }
    }
    assert!(run >= 8, "only {run} commands");
    // What the README writes into is a copy: its Python lines find the example as it was.
    let example = "examples/damped-pendulum/fit.ham";
    let read = |path: &Path| fs::read_to_string(path).expect("a spec");
    assert_eq!(read(&folder.path().join(example)), read(&root().join(example)));
}

#[test]
fn every_spec_of_the_readme_is_in_order() {
    for (language, text) in blocks(&page()) {
        if language == "ham" {
            leverrier::internals::expr::build("README", &text)
                .unwrap_or_else(|e| panic!("{e}\n{text}"));
        }
    }
}

#[test]
fn the_tables_name_every_family_and_every_function() {
    let page = page();
    for family in FAMILIES {
        let line = page.lines().find(|line| line.starts_with(&format!("| `{}(", family.name)));
        let line = line.unwrap_or_else(|| panic!("the README does not name {}", family.name));
        assert!(line.contains(family.doc), "{}: {}", family.name, family.doc);
    }
    for function in Function::all() {
        let name = function.row().name;
        assert!(page.contains(&format!("`{name}`")), "the README does not name {name}");
    }
}

#[test]
fn every_file_that_the_readme_links_exists() {
    let page = page();
    for (at, _) in page.match_indices("](") {
        let link: String = page[at + 2..].chars().take_while(|c| *c != ')').collect();
        if !link.starts_with("http") {
            assert!(root().join(&link).exists(), "{link} is not there");
        }
    }
}

#[test]
fn the_first_commands_are_the_documented_ones() {
    let page = page();
    assert!(page.contains("$ cargo run --release -- fit examples/henon-heiles/fit.ham\n"));
    assert!(page.contains("$ cargo test --tests -- --include-ignored\n$ cargo test --doc\n"));
    let check = fs::read_to_string(root().join(".ci/run")).expect("the check");
    for part in
        ["part tests cargo test --tests -- --include-ignored", "part examples cargo test --doc"]
    {
        assert!(check.lines().any(|line| line.trim() == part), "{part}");
    }
}

#[test]
fn the_readme_counts_the_effects() {
    let output = Command::new(env!("CARGO_BIN_EXE_leverrier"))
        .args(["effects", "--format", "json"])
        .output()
        .expect("the program runs");
    let listed: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let count = listed["effects"].as_array().map_or(0, Vec::len);
    assert!(count > 0 && page().contains(&format!("The {count} effects ")), "{count}");
}
