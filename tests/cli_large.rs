//! Parquet at the command line.

mod common;

use std::fs;

use common::program::{MAKE_SWINGS, good, json, pendulum, run};

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
