//! Text that would be code if it were not escaped, in every field of an export: every format is
//! compiled or parsed, and nothing of it stands outside a comment or a string.

use std::collections::BTreeSet;
use std::process::Command;
use std::sync::Arc;

use leverrier::internals::export::{EXPORTERS, Export, exporter};
use leverrier::internals::expr::System;
use leverrier::internals::fit::Law;

use crate::export_cases::{Case, cases};
use crate::exporters::{files, installed, run, write};

/// What stands where only escaped text may stand.
const MARK: &str = "HOSTILE";

/// Ways out of a comment, a string, a document, an element.
const WAYS_OUT: &[&str] = &[
    "a\nHOSTILE!(); fn x() {}",
    "a\r\nHOSTILE = 1\r",
    "a\u{2028}HOSTILE\u{2029}b\u{85}c\u{b}d\u{c}e",
    "*/ HOSTILE /*",
    "*\\\n/ HOSTILE",
    "\" HOSTILE \"",
    "\\\" HOSTILE \\",
    "\"\"\" HOSTILE '''",
    "' HOSTILE",
    "\\write18{HOSTILE}\\input{HOSTILE}",
    "}\\end{document} HOSTILE % {",
    "^^5cwrite18{HOSTILE}",
    "[HOSTILE]",
    "$HOSTILE$ & # _ ~",
    "</script><script>HOSTILE</script>",
    "<!-- HOSTILE --> ]]> <![CDATA[",
    "&lt;HOSTILE onload=&quot;",
    "\u{202e}HOSTILE\u{2066}\u{200f}\u{feff}",
    "```\nHOSTILE\n```",
    "    HOSTILE",
    "@name @provenance HOSTILE {HOSTILE} {{}} %s ${HOSTILE}",
    "??/\n??' HOSTILE",
    "\0HOSTILE\u{1b}[31m",
];

/// A case with the text in every field that takes one.
fn hostile(case: &mut Case, text: &str) {
    let law = &case.law;
    let system = &mut System::clone(law.system());
    system.name = text.to_string();
    let variables = system.coordinates.iter_mut().chain(&mut system.momenta);
    for variable in variables.chain([&mut system.time]) {
        // A name becomes an identifier of its letters: these are not looked for.
        variable.name = format!("{}{}", variable.name, text.replace(MARK, "own"));
        variable.unit_text = Some(text.to_string());
    }
    for term in &mut system.terms {
        term.label = text.to_string();
        term.name = term.name.as_ref().map(|name| name.clone() + &text.replace(MARK, "own"));
        term.unit_text = Some(text.to_string());
    }
    for parameter in &mut system.parameters {
        parameter.name = parameter.name.clone() + &text.replace(MARK, "own");
        parameter.unit_text = Some(text.to_string());
    }
    let ids = system.term_ids();
    let terms = law.terms().map(|(id, _, value)| (ids[id.position()], value)).collect();
    let (parameters, noise) = (law.parameters().to_vec(), law.noise().to_vec());
    let known = (law.stepping(), law.window());
    let hostile = Law::new(Arc::new(system.clone()), terms, parameters, noise, known).unwrap();
    case.law = hostile.with_covariance(law.covariance().unwrap().clone()).unwrap();
    case.pretty.notes.push(text.to_string());
}

fn with_hostile_origin<'a>(case: &'a Case, text: &str) -> Export<'a> {
    let mut export = case.export();
    export.integrator.name = text.to_string();
    export.provenance.version = text.to_string();
    export.provenance.spec = (text.to_string(), text.to_string());
    export.provenance.data = Some((text.to_string(), text.to_string()));
    export
}

fn hostile_files(format: &str, case: &Case, text: &str) -> Vec<(String, String)> {
    files((exporter(format).unwrap().export)(&with_hostile_origin(case, text)).unwrap())
}

/// Every way out in one text: one compilation for all of them.
fn all_at_once() -> String {
    WAYS_OUT.concat()
}

/// How a language opens and closes what is not code, and whether a backslash escapes there.
const RUST_AND_C: &[(&str, &str, bool)] =
    &[("//", "\n", false), ("/*", "*/", false), ("\"", "\"", true)];
const PYTHON: &[(&str, &str, bool)] =
    &[("#", "\n", false), ("\"\"\"", "\"\"\"", true), ("\"", "\"", true), ("'", "'", true)];
const TOML: &[(&str, &str, bool)] = &[("#", "\n", false), ("\"", "\"", true)];

/// The text without comments and strings.
fn code(text: &str, language: &[(&str, &str, bool)]) -> String {
    let mut out = String::new();
    let mut rest = text;
    'next: while let Some(c) = rest.chars().next() {
        for (open, close, escapes) in language {
            if let Some(inside) = rest.strip_prefix(open) {
                let mut at = inside;
                while !at.is_empty() && !at.starts_with(close) {
                    let skip = if *escapes && at.starts_with('\\') { 2 } else { 1 };
                    let end = at.char_indices().nth(skip).map_or(at.len(), |(end, _)| end);
                    at = &at[end..];
                }
                rest = at.strip_prefix(close).unwrap_or("");
                out.push('\n');
                continue 'next;
            }
        }
        // A character literal, which may be a quote.
        if language == RUST_AND_C && (rest.starts_with("'\"'") || rest.starts_with("'\\''")) {
            rest = &rest[rest[1..].find('\'').unwrap() + 2..];
            continue;
        }
        out.push(c);
        rest = &rest[c.len_utf8()..];
    }
    out
}

#[test]
fn no_text_stands_outside_comments_and_strings() {
    for text in WAYS_OUT {
        for mut case in cases() {
            hostile(&mut case, text);
            for row in EXPORTERS {
                let written = files((row.export)(&with_hostile_origin(&case, text)).unwrap());
                for (path, content) in &written {
                    let place = format!("{}, {path}, {text:?}:\n{content}", row.name);
                    let language = match path.rsplit_once('.').map(|(_, end)| end) {
                        Some("rs" | "c" | "h") => RUST_AND_C,
                        Some("toml") => TOML,
                        _ if row.name == "python" => PYTHON,
                        _ => continue,
                    };
                    assert!(!code(content, language).contains(MARK), "{place}");
                    let turned = |c| leverrier::internals::data::is_invisible(c);
                    assert!(!content.contains(turned), "{place}");
                    // Code blocks of doc comments are run as tests.
                    let block = |line: &str| line.contains("```") || line.starts_with("///     ");
                    let fenced = |line: &str| line.trim_start().starts_with("//") && block(line);
                    assert!(language != RUST_AND_C || !content.lines().any(fenced), "{place}");
                }
            }
        }
    }
}

#[test]
fn rust_and_c_with_hostile_text_compile() {
    let cargo = std::env::var("CARGO").unwrap_or("cargo".to_string());
    let folder = tempfile::tempdir().unwrap();
    for (i, mut case) in cases().into_iter().enumerate().take(3) {
        hostile(&mut case, &all_at_once());
        let project = folder.path().join(format!("rust-{i}"));
        write(&project, &hostile_files("rust", &case, &all_at_once()));
        run(Command::new(&cargo)
            .args(["check", "--offline", "--quiet", "--all-targets"])
            .current_dir(&project)
            .env("CARGO_TARGET_DIR", folder.path().join("target"))
            .env("RUSTFLAGS", "-D warnings"));
        let tests = run(Command::new(&cargo)
            .args(["test", "--offline", "--doc"])
            .current_dir(&project)
            .env("CARGO_TARGET_DIR", folder.path().join("target")));
        assert!(tests.contains("running 0 tests"), "{tests}");
        if installed("gcc") {
            let project = folder.path().join(format!("c-{i}"));
            write(&project, &hostile_files("c", &case, &all_at_once()));
            run(Command::new("gcc")
                .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-trigraphs"])
                .args(["-fsyntax-only", "example.c", "model.c"])
                .current_dir(&project));
        }
    }
}

#[test]
fn python_with_hostile_text_has_it_in_strings_and_comments() {
    if !installed("python3") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (i, mut case) in cases().into_iter().enumerate() {
        for (j, text) in
            WAYS_OUT.iter().map(|text| text.to_string()).chain([all_at_once()]).enumerate()
        {
            hostile(&mut case, &text);
            let name = format!("model_{i}_{j}.py");
            let module = &hostile_files("python", &case, &text)[0].1;
            std::fs::write(folder.path().join(name), module).unwrap();
        }
    }
    let script = "import glob, tokenize\n\
        for path in sorted(glob.glob('*.py')):\n\
        \x20   source = open(path, newline='').read()\n\
        \x20   compile(source, path, 'exec')\n\
        \x20   for token in tokenize.tokenize(open(path, 'rb').readline):\n\
        \x20       inside = token.type in (tokenize.STRING, tokenize.COMMENT)\n\
        \x20       assert inside or 'HOSTILE' not in token.string, (path, token)\n\
        print('done')\n";
    let printed = run(Command::new("python3").args(["-c", script]).current_dir(folder.path()));
    assert_eq!(printed.trim(), "done");
}

/// Commands of a LaTeX text.
fn commands(text: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for piece in text.split('\\').skip(1) {
        let length = piece.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(piece.len());
        found.insert(piece[..length].to_string());
    }
    found
}

#[test]
fn latex_with_hostile_text_has_no_command_of_it() {
    let escapes = ["textbackslash", "textasciitilde", "textasciicircum", "textless"];
    let escapes = escapes.into_iter().chain(["textgreater", "textbar", "mathrm", "quad", ""]);
    let escapes: BTreeSet<String> = escapes.map(str::to_string).collect();
    for row in ["latex", "latex-document"] {
        for text in WAYS_OUT {
            for mut case in cases() {
                let mut known =
                    commands(&files((exporter(row).unwrap().export)(&case.export()).unwrap())[0].1);
                known.extend(escapes.clone());
                hostile(&mut case, text);
                let document = &hostile_files(row, &case, text)[0].1;
                let place = format!("{row}, {text:?}:\n{document}");
                let more: Vec<_> = commands(document).difference(&known).cloned().collect();
                assert!(more.is_empty(), "{more:?} in {place}");
                let plain = document.replace(r"\textbackslash{}", "");
                let plain = [r"\{", r"\}", r"\%", r"\_", r"\$", r"\&", r"\#"]
                    .iter()
                    .fold(plain, |plain, escaped| plain.replace(escaped, ""));
                assert_eq!(plain.matches('{').count(), plain.matches('}').count(), "{place}");
                assert!(!plain.contains(['%', '#']) && !plain.contains("^^"), "{place}");
                assert!(document.lines().all(|line| !line.starts_with(['[', '*'])), "{place}");
                assert!(row != "latex-document" || document.ends_with("\\end{document}\n"));
                assert!(document.matches("\\end{document}").count() <= 1, "{place}");
            }
        }
    }
}

#[test]
fn mathml_and_json_with_hostile_text_are_well_formed() {
    for text in WAYS_OUT {
        for mut case in cases() {
            hostile(&mut case, text);
            let mathml = &hostile_files("mathml", &case, text)[0].1;
            let xml = format!("<all>{}</all>", mathml.replace("&nbsp;", " "));
            let document = roxmltree::Document::parse(&xml)
                .unwrap_or_else(|error| panic!("{error}, {text:?}:\n{mathml}"));
            for node in document.descendants().filter(|node| node.is_element()) {
                let name = node.tag_name().name();
                assert!(name == "all" || name.starts_with('m') || name == "semantics", "{name}");
            }
            let json = &hostile_files("json", &case, text)[0].1;
            let value: serde_json::Value = serde_json::from_str(json).unwrap();
            assert_eq!(value["system"], *text);
            assert_eq!(value["provenance"]["data"]["name"], *text);
        }
    }
}
