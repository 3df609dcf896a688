//! Parquet, and data larger than the memory allowed, at the command line.

use std::fs;

use crate::support::program::{MAKE_SWINGS, good, json, pendulum, run};

#[test]
fn parquet_serves_wherever_csv_does() {
    let folder = pendulum();
    let path = folder.path();
    let mut make = MAKE_SWINGS;
    for word in &mut make {
        if *word == "swings.csv" {
            *word = "swings.parquet";
        }
    }
    let made = good(path, &make);
    assert!(made.out.contains("written to swings.parquet"), "{}", made.out);
    let looked = good(path, &["check", "swings.ham", "--data", "swings.parquet"]);
    assert!(looked.out.contains("Parquet, 1 row group, written by leverrier"), "{}", looked.out);
    let from = |data: &str| {
        json(path, &["fit", "swings.ham", "--data", data, "-o", "m.json"], "leverrier.fit/1")
    };
    assert_eq!(from("swings.parquet")["model"], from("swings.csv")["model"]);
    let spec = json(path, &["new", "swings.parquet", "-o", "new.ham"], "leverrier.new/1");
    let text = spec["spec"].as_str().expect("a spec");
    assert!(text.contains("data \"swings.parquet\" { time t [s]  run run"), "{text}");
    good(path, &["check", "new.ham"]);

    // What is wrong is said with its place, to programs too.
    let bytes = fs::read(path.join("swings.parquet")).expect("made");
    fs::write(path.join("cut.parquet"), &bytes[..bytes.len() / 2]).expect("written");
    let done = run(path, &["fit", "swings.ham", "--data", "cut.parquet"]);
    assert_eq!(done.code, Some(1));
    assert!(done.err.contains("cut off"), "{}", done.err);
}

#[test]
fn data_that_take_more_memory_than_allowed_are_read_part_by_part() {
    let folder = pendulum();
    let path = folder.path();
    // A file of text that is larger than anything that is read at once.
    let text = fs::read_to_string(path.join("swings.csv")).expect("made");
    let (header, rows) = text.split_once('\n').expect("a header");
    let mut large = format!("# many swings\n{header}\n");
    for copy in 0..900 {
        for row in rows.lines() {
            large.push_str(&format!("{copy}-{row}\n"));
        }
    }
    fs::write(path.join("large.csv"), &large).expect("written");
    let from = |data: &str, more: &[&str]| {
        let mut all = vec!["fit", "swings.ham", "--data", data, "-o", "m.json"];
        all.extend(more);
        good(path, &all)
    };
    let done = from("large.csv", &["--memory", "64MiB", "--threads", "2"]);
    assert!(done.err.contains("64.0 MiB are allowed: they are read part by part"), "{}", done.err);
    assert!(done.out.contains("first searched for on"), "{}", done.out);
    let kept: serde_json::Value =
        serde_json::from_slice(&fs::read(path.join("m.json")).expect("written")).expect("JSON");
    assert_eq!(kept["evidence"]["samples"], 162_000);
    assert_eq!(kept["evidence"]["runs"], 2700);
    // The same 180 samples 900 times over: the coefficient is that of one copy.
    let small = json(path, &["fit", "swings.ham", "-o", "s.json"], "leverrier.fit/1");
    let one = small["model"]["terms"][0]["coefficient"].as_f64().expect("a number");
    let many = kept["terms"].as_array().expect("terms");
    let cosine = many.iter().find(|t| t["term"] == small["model"]["terms"][0]["term"]);
    let many = cosine.expect("the same term")["coefficient"].as_f64().expect("a number");
    assert!((many / one - 1.0).abs() < 0.01, "{many} {one}");

    // A bad cell far behind is found at its line.
    let bad = large.replacen("\n899-1,", "\n899-1,x", 1);
    fs::write(path.join("bad.csv"), &bad).expect("written");
    let line = 1 + bad.lines().position(|l| l.starts_with("899-1,x")).expect("there");
    let done =
        run(path, &["fit", "swings.ham", "--data", "bad.csv", "--memory", "64MiB", "-o", "b.json"]);
    assert_eq!(done.code, Some(1));
    assert!(done.err.contains(&format!("line {line}")), "{line}: {}", done.err);
    assert!(!path.join("b.json").exists());

    for (size, says) in [("1XB", "500MB or 2GiB"), ("1MB", "less than any fit takes")] {
        let done = run(path, &["fit", "swings.ham", "--memory", size]);
        assert_eq!(done.code, Some(2));
        assert!(done.err.contains(says), "{}", done.err);
    }
}
