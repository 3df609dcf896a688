//! Records as people have them: without a time, in many files, and compressed.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::program::{good, json, run};

/// A swing of a plain oscillator from a start, a row every tenth of a second: `x,v` without a time.
fn rows(start: f64, count: usize) -> String {
    let row = |at: usize| {
        let t = 0.1 * at as f64;
        format!("{:.9},{:.9}\n", start * t.cos(), -start * t.sin())
    };
    (0..count).map(row).collect()
}

/// The same with the time in front.
fn timed(start: f64, count: usize) -> String {
    let row = |(at, row): (usize, &str)| format!("{:.1},{row}\n", 0.1 * at as f64);
    rows(start, count).lines().enumerate().map(row).collect()
}

fn spec(data: &str) -> String {
    format!(
        "system \"spring\"\ncoordinates x\nvelocities v\ndata {data}\nT = p_x^2/2\n\
         V = span{{ poly(x; 4) }}\n"
    )
}

fn write(folder: &Path, name: &str, text: &str) {
    fs::write(folder.join(name), text).expect("written");
}

/// What `check` says of the data of a spec.
fn checked(folder: &Path, text: &str) -> Value {
    write(folder, "s.ham", text);
    json(folder, &["check", "s.ham"], "leverrier.check/1")["data"].clone()
}

/// The sentence that a spec is refused with.
fn refused(folder: &Path, text: &str) -> String {
    write(folder, "s.ham", text);
    let done = run(folder, &["fit", "s.ham", "-o", "m.json"]);
    assert_eq!(done.code, Some(1), "{}\n{}", done.out, done.err);
    // Long sentences are broken into lines.
    done.err.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn terms(folder: &Path, text: &str, more: &[&str]) -> Value {
    write(folder, "s.ham", text);
    let all = [&["fit", "s.ham", "-o", "m.json"], more].concat();
    json(folder, &all, "leverrier.fit/1")["model"]["terms"].clone()
}

#[test]
fn a_record_without_a_time_has_a_sample_every_so_often() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    write(path, "plain.csv", &format!("x,v\n{}", rows(1.0, 80)));
    write(path, "timed.csv", &format!("t,x,v\n{}", timed(1.0, 80)));
    let counted = terms(path, &spec("\"plain.csv\" { every 0.1 }"), &[]);
    assert_eq!(counted, terms(path, &spec("\"timed.csv\" { time t }"), &[]));

    // In a unit, with runs that are counted each from zero, and a row of nothing measured.
    let with_runs = |start: f64, name: &str| {
        let cells = rows(start, 30);
        let named = |row: &str| format!("{name},{row}\n");
        cells.lines().map(named).collect::<String>()
    };
    let both = format!("run,x,v\n{}b,,\n{}", with_runs(1.0, "a"), with_runs(0.5, "b"));
    write(path, "runs.csv", &both);
    let text = spec("\"runs.csv\" { every 100 [ms], run run }").replace("data", "time t [s]\ndata");
    let data = checked(path, &text);
    assert_eq!(data["runs"][0]["end"], 2.9);
    assert_eq!((&data["runs"][1]["start"], &data["runs"][1]["end"]), (&0.1.into(), &3.0.into()));

    // A column that might have been meant is named.
    let data = checked(path, &spec("\"timed.csv\" { every 0.1 }"));
    assert!(data["warnings"].to_string().contains("the column `t` is not read"), "{data}");
    write(path, "s.ham", &spec("\"plain.csv\" { every 0.1, pairs }"));
    assert_eq!(
        json(path, &["check", "s.ham"], "leverrier.check/1")["data"]["runs"][39]["end"],
        0.1
    );
}

#[test]
fn a_counted_time_that_makes_no_sense_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    write(path, "plain.csv", &format!("x,v\n{}", rows(1.0, 80)));
    for (items, expected) in [
        ("time t, every 10 [ms]", "the time is in a column, or counted, but not both"),
        ("every 10 [ms], time t", "keep `time` if a column holds the time"),
        ("every 1, every 2", "the data statement says this twice"),
        ("every 10 [m]", "[m] is no unit of time"),
        ("every 50 [Hz]", "`every 0.02 [s]`"),
        ("every 0", "has to be above zero"),
        ("every -1 [s]", "has to be above zero"),
        ("every x", "every"),
        ("every", "expected"),
    ] {
        let said = refused(path, &spec(&format!("\"plain.csv\" {{ {items} }}")));
        assert!(said.contains(expected), "{items}: {said}");
    }
}

#[test]
fn a_first_spec_asks_how_far_apart_samples_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    write(path, "plain.csv", &format!("x [m],v [m/s]\n{}", rows(1.0, 80)));
    let text = json(path, &["new", "plain.csv"], "leverrier.new/1")["spec"].to_string();
    assert!(text.contains("How far apart are two samples?"), "{text}");
    assert!(text.contains("time sample"), "{text}");
    good(path, &["check", "plain.ham"]);
    // What the file says above its header is taken, and asked about.
    let above = "Sampling rate: 10 Hz\nOperator: AB\n\nx [m],v [m/s]\n";
    write(path, "told.csv", &format!("{above}{}", rows(1.0, 80)));
    let text = json(path, &["new", "told.csv"], "leverrier.new/1")["spec"].to_string();
    assert!(text.contains("every 0.1 [s]"), "{text}");
    assert!(text.contains("told by the line `Sampling rate: 10 Hz`. Is that so?"), "{text}");
    let data = json(path, &["check", "told.ham"], "leverrier.check/1")["data"].clone();
    let median = data["sampling"]["median"].as_f64().expect("a number");
    assert!((median - 0.1).abs() < 1e-12, "{median}");
}
