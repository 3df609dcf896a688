//! Model files, specs, data and names of files by somebody who means harm: what they hold never
//! becomes code of an export, an element of a page, or a command of a document.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::program::{good, pendulum, run};

/// Every text of a JSON value, by its pointer.
fn texts(value: &Value, pointer: &str, found: &mut Vec<String>) {
    match value {
        Value::String(_) => found.push(pointer.to_string()),
        Value::Array(items) => {
            for (at, item) in items.iter().enumerate() {
                texts(item, &format!("{pointer}/{at}"), found);
            }
        }
        Value::Object(fields) => {
            for (name, field) in fields {
                texts(field, &format!("{pointer}/{name}"), found);
            }
        }
        _ => {}
    }
}

/// Everything that lies in a folder, as one text.
fn everything(folder: &Path) -> String {
    let mut out = String::new();
    for entry in fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        match path.is_dir() {
            true => out += &everything(&path),
            false => out += &fs::read_to_string(path).expect("text"),
        }
    }
    out
}

#[test]
fn text_with_line_breaks_in_a_model_file_is_refused() {
    let folder = pendulum();
    let path = folder.path();
    good(path, &["fit", "swings.ham"]);
    let model = fs::read_to_string(path.join("swings.model.json")).expect("a model");
    let model: Value = serde_json::from_str(&model).expect("JSON");
    let mut fields = Vec::new();
    texts(&model, "", &mut fields);
    assert!(fields.len() > 20, "{fields:?}");
    for field in &fields {
        for text in ["x\npub fn hostile() {}\n//", "\u{202e}hostile", "\u{2028}hostile"] {
            let mut changed = model.clone();
            *changed.pointer_mut(field).expect("a field") = Value::String(text.to_string());
            fs::write(path.join("m.json"), changed.to_string()).expect("written");
            let done =
                run(path, &["export", "swings.ham", "rust", "--model", "m.json", "-o", "exported"]);
            assert_eq!(done.code, Some(1), "{field} {text:?}: {}{}", done.out, done.err);
            assert!(!path.join("exported").exists(), "{field} {text:?}");
        }
    }
}

#[test]
fn a_hash_is_a_hash_and_a_number_is_in_its_bounds() {
    let folder = pendulum();
    let path = folder.path();
    good(path, &["fit", "swings.ham"]);
    let model = fs::read_to_string(path.join("swings.model.json")).expect("a model");
    let model: Value = serde_json::from_str(&model).expect("JSON");
    for (field, value) in [
        ("/origin/data/sha256", Value::from("not a hash")),
        ("/origin/spec/sha256", Value::from("")),
        ("/origin/data/name", Value::from("../../elsewhere.csv")),
        ("/fingerprint", Value::from("0")),
        ("/version", Value::from("0.1.0; rm")),
        ("/integrator/longest_step", Value::from(0.0)),
        ("/integrator/longest_step", Value::from(-1.0)),
        ("/terms/0/inclusion", Value::from(7.0)),
        ("/terms/0/standard_error", Value::from(-1.0)),
        ("/terms/0/coefficient", Value::Null),
        ("/noise/0/standard_deviation", Value::from(-0.5)),
        ("/covariance", Value::Array(Vec::new())),
    ] {
        let mut changed = model.clone();
        *changed.pointer_mut(field).expect("a field") = value;
        fs::write(path.join("m.json"), changed.to_string()).expect("written");
        let done = run(path, &["export", "swings.ham", "c", "--model", "m.json", "-o", "exported"]);
        assert_eq!(done.code, Some(1), "{field}: {}", done.err);
        assert!(done.err.contains("damaged") && done.err.contains("leverrier fit"), "{}", done.err);
    }
}

/// Names of files, headers and texts of a spec that people can really make.
#[test]
fn hostile_specs_data_and_file_names_are_written_as_text() {
    let hostile = "*/ \\write18{HOSTILE} ``` <script>HOSTILE</script> ]]> \u{202e}\u{2028}'";
    let folder = pendulum();
    let path = folder.path();
    let file = |text: &str| text.replace('/', "_");
    let data = format!("{} data.csv", file(hostile));
    let spec = format!("{} spec.ham", file(hostile));
    let swings = fs::read_to_string(path.join("swings.csv")).expect("measurements");
    // The column of the runs has a hostile name, and so has every run.
    let mut lines = swings.lines();
    let header = lines.next().expect("a header").replacen("run", &format!("\"run {hostile}\""), 1);
    let rows: String = lines
        .map(|line| {
            let (run, rest) = line.split_once(',').expect("cells");
            format!("\"{run} {hostile}\",{rest}\n")
        })
        .collect();
    fs::write(path.join(&data), format!("{header}\n{rows}")).expect("written");
    let text = fs::read_to_string(path.join("swings.ham")).expect("a spec");
    let text = text
        .replace("system \"pendulum\"", &format!("system \"{hostile}\""))
        .replace("\"swings.csv\"", &format!("\"{data}\""))
        .replace("run run", &format!("run \"run {hostile}\""));
    fs::write(path.join(&spec), text).expect("written");
    good(path, &["fit", &spec]);
    for format in ["latex", "latex-document", "mathml", "python", "json"] {
        let out = good(path, &["export", &spec, format]).out;
        let latex = format.starts_with("latex");
        assert!(!latex || !out.contains("\\write18"), "{format}: {out}");
        let script = out.contains("<script");
        assert!(!script || ["python", "json"].contains(&format), "{format}: {out}");
        let turned = out.contains(['\u{202e}', '\u{2028}']);
        assert!(!turned || format == "json", "{format}: {out}");
    }
    for format in ["rust", "c"] {
        good(path, &["export", &spec, format, "-o", format]);
        let all = everything(&path.join(format));
        assert!(all.contains("HOSTILE") && !all.contains(['\u{202e}', '\u{2028}']), "{all}");
        assert!(format != "c" || !all.contains("*/ \\write18"), "{all}");
        assert!(!all.lines().any(|line| line.starts_with("//") && line.contains("```")), "{all}");
    }
    let plain = good(path, &["report", "swings.ham", "--no-diagnosis", "-o", "plain.html"]);
    drop(plain);
    good(path, &["report", &spec, "--no-diagnosis", "-o", "page.html"]);
    good(path, &["report", &spec, "--no-diagnosis", "-o", "page.tex"]);
    let scripts = |name: &str| {
        let page = fs::read_to_string(path.join(name)).expect("a page");
        (page.matches("<script").count(), page.matches("</script").count())
    };
    assert_eq!(scripts("page.html"), scripts("plain.html"));
    let document = fs::read_to_string(path.join("page.tex")).expect("a document");
    assert!(!document.contains("\\write18") && document.contains("HOSTILE"));
}
