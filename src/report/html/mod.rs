//! The report: one page that needs nothing but itself.

pub(super) mod sections;
pub(super) mod tables;

use std::fmt::Write;

use crate::data::DataReport;
use crate::export::Formula;
use crate::fit::Model;
use crate::report::plots::{Figure, Medium, PLOTS, PlotData, SCRIPT, draw, escaped, live_sheet};
use crate::simplify::Simplified;

const PAGE_STYLE: &str = include_str!("page.css");

/// Everything that a report tells.
pub struct Page<'a> {
    /// Name of the system.
    pub title: &'a str,
    /// What the plots are drawn from.
    pub material: PlotData<'a>,
    /// The learned law: its numbers, uncertainties and search.
    pub model: Option<&'a Model>,
    /// Its printed form.
    pub simplified: &'a Simplified,
    /// Its equations, typeset.
    pub formulas: &'a [Formula],
    /// What was done to the printed form.
    pub notes: &'a [String],
    /// What was learned from.
    pub data: &'a DataReport,
    /// How the measurements were split.
    pub split: &'a str,
    /// Where the judged model comes from.
    pub terms_from: &'a str,
    /// The text of the spec.
    pub spec: &'a str,
    /// Dates and actions of the ledger, oldest first.
    pub history: &'a [HistoryEntry],
    /// What it takes to make the page again: name and value.
    pub facts: &'a [(String, String)],
    /// Commands that make the page again.
    pub commands: &'a [String],
}

/// A line of the ledger.
pub struct HistoryEntry {
    /// When, in UTC.
    pub date: String,
    /// What was done.
    pub action: String,
    /// Error on held-out runs before, in units of the noise.
    pub before: Option<f64>,
    /// The same after.
    pub after: Option<f64>,
    /// Whether it was taken back.
    pub undone: bool,
}

/// The page, and the figures in it by the name of their plot.
pub struct RenderedPage {
    /// HTML.
    pub html: String,
    /// Every plot of [`PLOTS`], in that order.
    pub figures: Vec<(&'static str, Vec<Figure>)>,
}

/// Figures of every plot, in the order of [`PLOTS`].
pub fn figures(material: &PlotData) -> Vec<(&'static str, Vec<Figure>)> {
    PLOTS.iter().map(|row| (row.name, (row.figures)(material))).collect()
}

/// Draws the page.
pub fn page(page: &Page) -> RenderedPage {
    let figures = figures(&page.material);
    let mut out = String::new();
    let title = if page.title.is_empty() { "A learned model" } else { page.title };
    let _ = write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; \
         style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:\">\n\
         <title>{} - Leverrier</title>\n<style>\n{PAGE_STYLE}{}</style>\n</head>\n<body>\n",
        escaped(title),
        live_sheet(),
    );
    let _ = write!(
        out,
        "<header>\n<h1>{}</h1>\n<p class=\"soft\">What was learned from the measurements, and how \
         far it holds. Leverrier {}.</p>\n",
        escaped(title),
        env!("CARGO_PKG_VERSION"),
    );
    let sections = sections::all(page, &figures);
    out += "<nav aria-label=\"Sections\">\n";
    for section in &sections {
        let _ = writeln!(out, "<a href=\"#{}\">{}</a>", section.id, escaped(section.title));
    }
    out += "</nav>\n";
    out += &sections::cards(page);
    out += "</header>\n<main>\n";
    for section in &sections {
        let _ = write!(
            out,
            "<section id=\"{}\">\n<h2>{}</h2>\n{}</section>\n",
            section.id,
            escaped(section.title),
            section.body
        );
    }
    let _ = write!(
        out,
        "</main>\n<footer>Point at a curve to read its values; drag over a stretch of time to see \
         it in every figure of the same run, Escape to let it go.</footer>\n\
         <script>\n{SCRIPT}</script>\n</body>\n</html>\n"
    );
    RenderedPage { html: out, figures }
}

/// Parts of the page as HTML, for pages that are arranged in another way.
pub struct PageParts {
    /// The numbers that a reader looks for first.
    pub cards: String,
    /// The law, typeset.
    pub equations: String,
    /// Its coefficients, and what was done to print it.
    pub numbers: String,
    /// Where it fails, in sentences.
    pub findings: String,
    /// What was learned from.
    pub data: String,
}

/// The page's parts.
pub fn parts(page: &Page) -> PageParts {
    PageParts {
        cards: sections::cards(page),
        equations: sections::equations(page),
        numbers: sections::numbers(page),
        findings: sections::findings(page),
        data: sections::data(page),
    }
}

/// Figures with their captions.
fn shown(figures: &[Figure]) -> String {
    if figures.is_empty() {
        return String::new();
    }
    let mut out = String::from("<div class=\"figures\">\n");
    for figure in figures {
        let _ = write!(
            out,
            "<figure>\n{}<figcaption>{}</figcaption>\n</figure>\n",
            draw(figure, Medium::Page),
            escaped(&figure.caption)
        );
    }
    out + "</div>\n"
}
