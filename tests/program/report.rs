//! The report as a user asks for it.

use std::fs;

use crate::support::program::{good, json, listing, pendulum, run};
use resvg::tiny_skia::Pixmap;

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
    assert!(html.contains("leverrier report swings.ham --held-out 0.25 --seed 0"));
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
fn a_report_without_a_model_or_held_out_runs_is_still_one() {
    let folder = pendulum();
    let path = folder.path();
    let told = json(
        path,
        &["report", "swings.ham", "--held-out", "0", "-o", "page.html"],
        "leverrier.report/1",
    );
    assert!(told["verdict"].is_null(), "{told}");
    let html = fs::read_to_string(path.join("page.html")).expect("the page");
    assert!(html.contains("Nothing is held out") && !html.contains("id=\"missing\""));
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

#[test]
fn plots_are_pictures_too() {
    let folder = pendulum();
    let path = folder.path();
    let plain = ["report", "swings.ham", "--no-diagnosis", "--plots"];
    let with = |more: &[&str]| run(path, &[&plain[..], more].concat());
    let done = with(&["slides", "--as", "png,svg", "--dark", "--scale", "3"]);
    assert_eq!(done.code, Some(0), "{}", done.err);
    let names = listing(&path.join("slides"));
    let mut kinds = [0, 0];
    for name in &names {
        let bytes = fs::read(path.join("slides").join(name)).expect("a plot");
        if name.ends_with(".svg") {
            kinds[0] += 1;
            let text = String::from_utf8(bytes).expect("text");
            assert!(!text.contains("prefers-color-scheme") && text.contains("#14171d"), "{name}");
            continue;
        }
        kinds[1] += 1;
        let picture = Pixmap::decode_png(&bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(picture.width(), 3 * 430, "{name}");
        let corner = picture.pixel(0, 0).expect("a pixel");
        assert_eq!((corner.red(), corner.green(), corner.blue()), (0x14, 0x17, 0x1d), "{name}");
        let drawn = picture.pixels().iter().filter(|pixel| **pixel != corner).count();
        assert!(drawn > picture.pixels().len() / 100, "{name}: {drawn} pixels");
    }
    assert!(kinds[0] >= 7 && kinds[0] == kinds[1], "{names:?}");
    for wrong in [&["x", "--as", "gif"][..], &["x", "--as", "png", "--scale", "1e9"]] {
        assert_eq!(with(wrong).code, Some(2), "{wrong:?}");
    }
    assert!(!path.join("x").exists());
}

#[test]
fn a_report_is_a_document_for_latex() {
    let folder = pendulum();
    let path = folder.path();
    let told = json(path, &["report", "swings.ham", "-o", "a paper.tex"], "leverrier.report/1");
    let text = fs::read_to_string(path.join("a paper.tex")).expect("the document");
    assert_eq!(told["bytes"].as_u64(), Some(text.len() as u64));
    assert!(text.starts_with("% A report of Leverrier") && text.ends_with("\\end{document}\n"));
    assert!(text.contains("\\[ V = ") && text.contains("\\section*{Findings}"));
    // Every environment that is begun is ended, and braces match.
    for name in ["document", "tabular", "minipage", "itemize", "description"] {
        let (begun, ended) = (format!("\\begin{{{name}}}"), format!("\\end{{{name}}}"));
        assert_eq!(text.matches(&begun).count(), text.matches(&ended).count(), "{name}");
        assert!(text.contains(&begun), "no {name}");
    }
    let plain = text.replace("\\{", "").replace("\\}", "");
    assert_eq!(plain.matches('{').count(), plain.matches('}').count());
    // What is beyond the usual input encoding is written as a formula.
    let strange = text.chars().find(|c| !c.is_ascii() && !('\u{a1}'..='\u{17f}').contains(c));
    assert!(strange.is_none_or(|c| "–—‘’“”…".contains(c)), "{strange:?}");
    // Its pictures lie where it looks for them.
    let shown: Vec<&str> = text
        .split("\\includegraphics[width=\\textwidth]{")
        .skip(1)
        .filter_map(|rest| rest.split('}').next())
        .collect();
    assert_eq!(shown.len(), told["figures"].as_array().map_or(0, Vec::len));
    for name in shown {
        assert!(path.join(name).is_file(), "{name}");
    }
    assert_eq!(listing(&path.join("a_paper-figures")).len(), shown_count(&text));
    // It may be written again; other documents may not be lost.
    good(path, &["report", "swings.ham", "--no-diagnosis", "-o", "a paper.tex"]);
    fs::write(path.join("thesis.tex"), "\\documentclass{book}").expect("written");
    let done = run(path, &["report", "swings.ham", "--no-diagnosis", "-o", "thesis.tex"]);
    assert_eq!(done.code, Some(2), "{}", done.err);
}

fn shown_count(text: &str) -> usize {
    text.matches("\\includegraphics").count()
}
