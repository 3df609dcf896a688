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

#[test]
fn every_file_of_a_pattern_is_a_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    for (number, start) in [(1, 1.0), (2, 0.7), (10, 0.4)] {
        write(path, &format!("swing_{number}.csv"), &format!("t,x,v\n{}", timed(start, 40)));
    }
    write(path, "other.txt", "nothing of a table");
    let text = spec("\"swing_*.csv\" { time t }");
    let data = checked(path, &text);
    let names = |data: &Value| -> Vec<String> {
        let runs = data["runs"].as_array().expect("runs");
        runs.iter().map(|run| run["name"].as_str().expect("a name").to_string()).collect()
    };
    assert_eq!(names(&data), ["swing_1", "swing_2", "swing_10"]);
    let source = &data["source"];
    assert_eq!((&source["files"], &source["rows"]), (&3.into(), &120.into()));
    let shown = good(path, &["check", "s.ham"]).out;
    assert!(shown.contains("swing_*.csv: 3 files, 120 rows"), "{shown}");

    // The very law of one file with a run column.
    let rows = |number: u32, start: f64| {
        let named = |row: &str| format!("swing_{number},{row}\n");
        timed(start, 40).lines().map(named).collect::<String>()
    };
    let all = [rows(1, 1.0), rows(2, 0.7), rows(10, 0.4)].concat();
    write(path, "all.csv", &format!("run,t,x,v\n{all}"));
    let one = terms(path, &spec("\"all.csv\" { time t  run run }"), &[]);
    assert_eq!(terms(path, &text, &[]), one);
    // Given by hand, and by a folder.
    let asked = terms(path, &spec("\"none.csv\" { time t }"), &["--data", "swing_*.csv"]);
    assert_eq!(asked, one);
    fs::create_dir(path.join("d")).expect("a folder");
    for number in [1, 2, 10] {
        let name = format!("swing_{number}.csv");
        fs::rename(path.join(&name), path.join("d").join(&name)).expect("moved");
    }
    assert_eq!(terms(path, &spec("\"d\" { time t }"), &[]), one);
    assert_eq!(terms(path, &spec("\"d/swing_*\" { time t }"), &[]), one);

    // A run column within each file; the same file twice counts once.
    write(path, "d/a.csv", &format!("run,t,x,v\n{all}"));
    fs::copy(path.join("d/a.csv"), path.join("d/b.csv")).expect("copied");
    let data = checked(path, &spec("\"d/?.csv\" { time t  run run }"));
    assert_eq!(names(&data), ["a/swing_1", "a/swing_2", "a/swing_10"]);
    assert!(data["warnings"].to_string().contains("b/swing_1, a copy of run a/swing_1"), "{data}");
}

#[test]
fn files_that_do_not_go_together_are_refused_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    write(path, "r_1.csv", &format!("t [s],x [m],v [m/s]\n{}", timed(1.0, 40)));
    let text = spec("\"r_*.csv\" { time t }");
    let refused_with = |second: &str, expected: &[&str]| {
        write(path, "r_2.csv", second);
        let said = refused(path, &text);
        for part in expected {
            assert!(said.contains(part), "{part}: {said}");
        }
    };
    refused_with(
        &format!("t [s],x [mm],v [m/s]\n{}", timed(1.0, 40)),
        &["r_2.csv", "`x` is in [mm] here (`x [mm]`), but in [m] in r_1.csv (`x [m]`)"],
    );
    refused_with(
        &format!("t [ms],x [m],v [m/s]\n{}", timed(1.0, 40)),
        &["the time is in [ms] here", "r_1.csv"],
    );
    refused_with(
        &format!("t [s],x [m],w [m/s]\n{}", timed(1.0, 40)),
        &["r_2.csv", "no column holds `v` here, but `v [m/s]` does in r_1.csv"],
    );
    refused_with("t,x,v\n0,a,b\n1,2,3\n", &["r_2.csv", "line 2"]);
    fs::remove_file(path.join("r_2.csv")).expect("removed");
    fs::create_dir(path.join("empty")).expect("a folder");
    for (data, expected) in [
        ("\"q_*.csv\"", "no file has such a name"),
        ("\"nowhere/*.csv\"", "no file has such a name"),
        ("\"*/r.csv\"", "in the name of a folder"),
        ("\"r_1.csv/\"", "r_1.csv"),
        ("\"empty\"", "this is a folder, and no file in it"),
    ] {
        let said = refused(path, &spec(&format!("{data} {{ time t }}")));
        assert!(said.contains(expected), "{data}: {said}");
    }
}

#[test]
fn statements_have_columns_and_rates_of_their_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    write(path, "a.csv", &format!("t,x,v\n{}", timed(1.0, 40)));
    write(path, "b.csv", &format!("place,speed\n{}", rows(0.5, 40)));
    let text = spec("\"a.csv\" { time t }\ndata \"b.csv\" { every 0.1, x = place, v = speed }");
    let data = checked(path, &text);
    assert_eq!((&data["runs"][0]["name"], &data["runs"][1]["name"]), (&"a".into(), &"b".into()));
    assert_eq!(data["source"]["file"], "a.csv, b.csv");
    write(path, "c.csv", &format!("t,x,v\n{}", timed(0.5, 40)));
    let both = spec("\"a.csv\" { time t }\ndata \"c.csv\" { time t }");
    assert_eq!(terms(path, &text, &[]), terms(path, &both, &[]));
}

#[test]
fn compressed_files_are_read_as_they_were() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    write(path, "plain.csv", &format!("t,x,v\n{}", timed(1.0, 60)));
    // `simulate` writes what is compressed, too.
    let known = spec("\"plain.csv\" { time t }").replace("span{ poly(x; 4) }", "x^2/2");
    write(path, "known.ham", &known);
    let made = |name: &str| {
        let start = ["--start", "x=1,p_x=0", "--dt=0.1", "--samples=60"];
        good(path, &[&["simulate", "known.ham", "-o", name], &start[..]].concat());
    };
    made("s.csv");
    made("s.csv.gz");
    let (plain, packed) = (path.join("s.csv"), path.join("s.csv.gz"));
    let (plain, packed) = (fs::read(plain).expect("made"), fs::read(packed).expect("made"));
    assert!(packed.len() < plain.len() && packed.starts_with(b"\x1f\x8b"));
    let of = |name: &str| terms(path, &spec(&format!("\"{name}\" {{ time t }}")), &[]);
    assert_eq!(of("s.csv.gz"), of("s.csv"));
    let made = json(path, &["new", "s.csv.gz", "-o", "n.ham"], "leverrier.new/1");
    assert!(made["spec"].to_string().contains("data \\\"s.csv.gz\\\""), "{made}");
    good(path, &["new", "s.csv.gz", "--force"]);
    assert!(path.join("s.ham").exists());

    fs::write(path.join("cut.csv.gz"), &packed[..packed.len() / 2]).expect("written");
    let mut broken = packed.clone();
    let middle = broken.len() / 2;
    broken[middle..].iter_mut().for_each(|byte| *byte ^= 0x55);
    fs::write(path.join("broken.csv.gz"), &broken).expect("written");
    fs::write(path.join("fake.csv.gz"), &plain).expect("written");
    for (name, expected) in [("cut.csv.gz", "cut off"), ("broken.csv.gz", "damaged")] {
        let said = refused(path, &spec(&format!("\"{name}\" {{ time t }}")));
        assert!(said.contains(expected), "{name}: {said}");
        let done = run(path, &["new", name, "-o", "x.ham"]);
        assert!(done.code == Some(1) && done.err.contains(expected), "{}", done.err);
    }
    // Somebody unpacked it, and left the name.
    assert_eq!(of("fake.csv.gz"), of("s.csv"));
}

#[test]
fn a_first_spec_of_many_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    write(path, "swing_1.csv", &format!("t [s],x [m],v [m/s]\n{}", timed(1.0, 40)));
    write(path, "swing_2.csv", &format!("t [s],x [m],v [m/s]\n{}", timed(0.5, 40)));
    let made = json(path, &["new", "swing_*.csv"], "leverrier.new/1");
    assert!(made["spec"].to_string().contains("data \\\"swing_*.csv\\\""), "{made}");
    assert!(made["assumed"].to_string().contains("2 files are a run each"), "{made}");
    good(path, &["check", "swing.ham"]);
    write(path, "swing_3.csv", "t,y\n0,1\n1,2\n");
    let done = good(path, &["new", "swing_*.csv", "--force"]);
    assert!(done.err.contains("they are no files of one kind"), "{}", done.err);
    let done = run(path, &["new", "swing_1.csv", "swing_2.csv"]);
    assert!(done.code == Some(2) && done.err.contains("quotation marks"), "{}", done.err);
}

#[test]
fn records_are_the_same_part_by_part() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    // More than what is read at once: runs go on from one block to the next.
    let mut runs = String::new();
    for name in 0..100 {
        let start = 0.3 + 0.01 * f64::from(name);
        rows(start, 600).lines().for_each(|row| runs.push_str(&format!("{name},{row}\n")));
    }
    for name in ["a", "b"] {
        write(path, &format!("{name}.csv"), &format!("run,x,v\n{runs}"));
    }
    let spec = |data: &str| {
        format!(
            "coordinates x\nvelocities v\ndata \"{data}\" {{ every 0.1, run run }}\nT = p_x^2/2\n\
             V = span{{ poly(x; 2) }}\n"
        )
    };
    let fitted = |data: &str, memory: &str| {
        write(path, "s.ham", &spec(data));
        let done = good(path, &["fit", "s.ham", "-o", "m.json", "--memory", memory]);
        let model: Value =
            serde_json::from_slice(&fs::read(path.join("m.json")).expect("written")).expect("JSON");
        (done.err.contains("part by part"), model)
    };
    let (streamed, parts) = fitted("?.csv", "64MiB");
    let (whole, all) = fitted("?.csv", "4GiB");
    assert!(streamed && !whole);
    // Read whole, copies of runs count once.
    assert_eq!((&parts["evidence"]["runs"], &all["evidence"]["runs"]), (&200.into(), &100.into()));
    assert_eq!(parts["evidence"]["samples"], 120_000);
    let number = |model: &Value| model["terms"][0]["coefficient"].as_f64().expect("a number");
    assert!((number(&parts) / number(&all) - 1.0).abs() < 1e-6, "{parts} {all}");
    assert_eq!(parts["origin"]["data"]["sha256"], all["origin"]["data"]["sha256"]);
}

#[test]
fn headers_that_stand_again_begin_runs_part_by_part() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    let one = |name: u32| {
        let cells = rows(0.3 + 0.005 * f64::from(name), 1000).replace(',', "\t");
        format!("x\tv\n{cells}")
    };
    let text: String = (0..130).map(one).collect();
    // More than two blocks.
    assert!(text.len() > 2 << 20);
    write(path, "again.txt", &text);
    let spec = spec("\"again.txt\" { every 0.1 }").replace("4)", "2)");
    write(path, "s.ham", &spec);
    for memory in ["64MiB", "4GiB"] {
        let done = good(path, &["fit", "s.ham", "-o", "m.json", "--memory", memory]);
        assert_eq!(done.err.contains("part by part"), memory == "64MiB", "{}", done.err);
        let model: Value =
            serde_json::from_slice(&fs::read(path.join("m.json")).expect("written")).expect("JSON");
        assert_eq!(model["evidence"]["runs"], 130, "{memory}");
        assert_eq!(model["evidence"]["samples"], 130_000, "{memory}");
    }
}

#[test]
fn a_wrong_cell_is_refused_in_the_words_that_new_warns_with() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    let text = format!("t,x,v\n{}", timed(1.0, 40));
    write(path, "a.csv", &text.replacen("\n0.3,", "\n0.3,bad", 1));
    let done = good(path, &["new", "a.csv"]);
    let plain = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let said = plain(&done.err);
    assert!(
        said.contains("Before the first fit, put this right: a.csv, line 5, column `x`:"),
        "{said}"
    );
    let refused = run(path, &["check", "a.ham"]);
    assert_eq!(refused.code, Some(1));
    let sentence = plain(&refused.err);
    let sentence = sentence.trim_start_matches("Error: ");
    assert!(said.contains(sentence), "{said}\n{sentence}");
    // A header that is one name short.
    write(path, "b.csv", &text.replacen("t,x,v", "x,v", 1));
    let done = run(path, &["new", "b.csv"]);
    assert!(done.code == Some(1) && done.err.contains("`row`"), "{}", done.err);
}
