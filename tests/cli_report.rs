//! The report as a user asks for it.

mod common;

use std::fs;

use common::program::{good, json, listing, pendulum, run};

#[test]
fn a_report_is_one_page_with_its_plots_beside() {
    let folder = pendulum();
    let path = folder.path();
    good(path, &["fit", "swings.ham"]);
    let told = json(path, &["report", "swings.ham", "--plots", "figures"], "leverrier.report/1");
    let html = fs::read_to_string(path.join("swings.report.html")).expect("the page");
    assert_eq!(told["bytes"].as_u64(), Some(html.len() as u64));
    assert!(html.starts_with("<!DOCTYPE html>") && html.trim_end().ends_with("</html>"));
    // The law, typeset, with its units and where it comes from.
    assert!(html.contains("<math") && html.contains("[rad/s]"));
    assert!(html.contains("leverrier report swings.ham --unseen 0.25 --seed 0"));
    assert!(html.matches("SHA-256").count() >= 2);
    assert!(html.contains("span{ poly(theta; 2), cos(theta) }"));
    let place = path.to_string_lossy();
    assert!(!html.contains(place.as_ref()), "a place on this machine");
    let figures = told["figures"].as_array().expect("figures");
    let files = listing(&path.join("figures"));
    assert_eq!(files.len(), figures.len());
    for figure in figures {
        let name = format!("{}.svg", figure["id"].as_str().expect("an id"));
        let svg = fs::read_to_string(path.join("figures").join(&name)).expect("a plot");
        roxmltree::Document::parse(&svg).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(svg.contains("<style>"), "{name}");
    }
    let plots: Vec<&str> = figures.iter().filter_map(|figure| figure["plot"].as_str()).collect();
    for name in ["predictions", "horizons", "forces", "portrait", "energy", "path", "front"] {
        assert!(plots.contains(&name), "{name}: {plots:?}");
    }
    let absent = told["absent"].as_array().expect("a list");
    assert!(absent.iter().any(|plot| plot["plot"] == "ledger"), "{absent:?}");
    // The same again: the page does not depend on when or where it is made.
    let said = good(path, &["report", "swings.ham", "-o", "again.html"]).out;
    assert!(said.contains("figures written to again.html"), "{said}");
    assert_eq!(fs::read_to_string(path.join("again.html")).expect("the page"), html);
}

#[test]
fn a_report_without_a_model_or_unseen_runs_is_still_one() {
    let folder = pendulum();
    let path = folder.path();
    let told = json(
        path,
        &["report", "swings.ham", "--unseen", "0", "-o", "page.html"],
        "leverrier.report/1",
    );
    assert!(told["verdict"].is_null(), "{told}");
    let html = fs::read_to_string(path.join("page.html")).expect("the page");
    assert!(html.contains("Nothing is unseen") && !html.contains("id=\"missing\""));
    assert!(!path.join("swings.model.json").exists());
    good(path, &["report", "swings.ham", "--no-diagnosis", "-o", "page.html"]);
    let html = fs::read_to_string(path.join("page.html")).expect("the page");
    assert!(html.contains("--no-diagnosis") && !html.contains("id=\"missing\""));
}

#[test]
fn a_report_overwrites_nothing_but_pages() {
    let folder = pendulum();
    let path = folder.path();
    let before = fs::read(path.join("swings.csv")).expect("the data");
    let done = run(path, &["report", "swings.ham", "-o", "swings.csv"]);
    assert_eq!(done.code, Some(2), "{}", done.err);
    assert!(done.err.contains("not a page"), "{}", done.err);
    assert_eq!(fs::read(path.join("swings.csv")).expect("the data"), before);
    let done =
        run(path, &["report", "swings.ham", "--no-diagnosis", "-o", "no/such/folder/a.html"]);
    assert_eq!(done.code, Some(1), "{}", done.err);
    fs::write(path.join("file"), "").expect("written");
    let done = run(path, &["report", "swings.ham", "--no-diagnosis", "--plots", "file"]);
    assert_eq!(done.code, Some(1), "{}", done.err);
}
