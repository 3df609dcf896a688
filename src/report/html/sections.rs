//! Sections of the report, each with its words, tables and figures.

use std::fmt::Write;

use super::{Page, shown, tables};
use crate::diagnose::diagnosis::Verdict;
use crate::report::plots::{Figure, amount, escaped, number, plot, term, times, unit};
use crate::report::present;
use crate::simplify::Style;

/// A heading and what stands below it.
pub(crate) struct Section {
    pub id: &'static str,
    pub title: &'static str,
    pub body: String,
}

type Drawn = [(&'static str, Vec<Figure>)];

/// All sections that have something to say.
pub(crate) fn all(page: &Page, figures: &Drawn) -> Vec<Section> {
    let mut sections = vec![
        Section { id: "law", title: "The law", body: law(page) },
        Section { id: "findings", title: "Findings", body: findings(page) },
        Section {
            id: "predictions",
            title: "How far it predicts",
            body: predictions(page, figures),
        },
        Section { id: "forces", title: "Where it fails", body: forces(page, figures) },
        Section { id: "missing", title: "What is missing", body: missing(page, figures) },
        Section {
            id: "motion",
            title: "The motion",
            body: several(figures, &["portrait", "energy"]),
        },
        Section { id: "search", title: "How the terms were found", body: search(page, figures) },
        Section { id: "ledger", title: "History of the spec", body: ledger(page, figures) },
        Section { id: "data", title: "The data", body: data(page) },
        Section { id: "again", title: "To reproduce this page", body: again(page) },
    ];
    sections.retain(|section| !section.body.is_empty());
    sections
}

/// The numbers that a reader looks for first.
pub(crate) fn cards(page: &Page) -> String {
    let mut out = String::from("<div class=\"cards\">\n");
    let mut card = |number: &str, words: &str| {
        // The name of an effect breaks before its arguments.
        let number = escaped(number).replace('(', "<wbr/>(");
        let words = escaped(words);
        let _ = writeln!(out, "<div class=\"card\"><b>{number}</b><span>{words}</span></div>");
    };
    let comparison = page.material.comparison;
    if let Some(last) = comparison.horizons.last() {
        let over = amount(last.duration, 3, page.material.view.time.unit.as_deref());
        let (error, runs) = match last.held_out {
            Some(error) => (error, "held-out runs"),
            None => (last.training, "training runs"),
        };
        card(
            &format!("{} × noise", times(error)),
            &format!("error on {runs}, predicted over a time of {over}"),
        );
    }
    if let Some(model) = page.model {
        let evidence = &model.evidence;
        card(
            &format!("{} of {}", model.terms.len(), evidence.function_space),
            "terms of the function space are in the law",
        );
    }
    if let Some(diagnosis) = page.material.diagnosis {
        let first = diagnosis.ranking.first().map_or("", |leader| leader.effect.as_str());
        match diagnosis.verdict {
            Verdict::Missing => card(first, "is missing, as far as these data can say"),
            Verdict::ExplainedInPart => {
                let parts = diagnosis.partial.iter().map(|leader| leader.effect.as_str());
                let parts: Vec<&str> = parts.collect();
                card(&parts.join(", "), "explains a part of what is missing");
            }
            Verdict::NothingMissing => card("nothing", "is missing that stands out of the noise"),
            Verdict::Unexplained => {
                card("unnamed", "something is missing that the catalogue lacks")
            }
            Verdict::TooLittleData => card("too little", "data to say whether anything is missing"),
            Verdict::Interrupted => card("interrupted", "before it was known what is missing"),
        }
    }
    card(
        &page.data.samples.to_string(),
        &format!("samples in {}", count(page.data.runs.len(), "run")),
    );
    out + "</div>\n"
}

fn count(number: usize, noun: &str) -> String {
    format!("{number} {noun}{}", if number == 1 { "" } else { "s" })
}

fn law(page: &Page) -> String {
    equations(page) + &numbers(page)
}

/// The law, typeset.
pub(crate) fn equations(page: &Page) -> String {
    let mut out = String::new();
    let (motion, energy): (Vec<_>, Vec<_>) = page.formulas.iter().partition(|f| f.motion);
    if energy.is_empty() {
        let text = escaped(&page.simplified.text(Style::default()));
        let _ = writeln!(out, "<pre>{text}</pre>");
    } else {
        out += "<div class=\"law\">\n";
        for formula in energy {
            let _ = writeln!(out, "<p>{}</p>", formula.mathml);
        }
        out += "</div>\n";
    }
    if !motion.is_empty() {
        out += "<details><summary>Equations of motion</summary>\n<div class=\"law\">\n";
        for formula in motion {
            let _ = writeln!(out, "<p>{}</p>", formula.mathml);
        }
        out += "</div></details>\n";
    }
    out
}

/// What was done to the printed law, and the numbers in it.
pub(crate) fn numbers(page: &Page) -> String {
    let mut out = String::new();
    out +=
        "<p class=\"soft\">Digits in parentheses are the standard error of the last digits.</p>\n";
    let notes = sentences(page.notes.iter().cloned());
    out += &match page.notes.len() {
        0..=4 => notes,
        many => format!(
            "<details><summary>{many} numbers are printed as nice ones</summary>\n{notes}</details>\n"
        ),
    };
    if let Some(model) = page.model {
        out += &tables::coefficients(model).html();
        for found in &model.distributions {
            out += &sentences(std::iter::once(present::distribution(found)));
            out += &tables::own_values(found).html();
        }
    }
    out + &tables::noise(page).html()
}

/// A sentence with its capital letter, its full stop and its minus signs.
pub(crate) fn sentence(text: &str) -> String {
    let mut letters = text.trim().chars();
    let first: String = letters.next().map(|c| c.to_uppercase().collect()).unwrap_or_default();
    // Names of effects and terms stay as they are.
    let named = text.split_whitespace().next().is_some_and(|word| word.contains(['_', '(', '^']));
    let text = match named {
        true => text.trim().to_string(),
        false => format!("{first}{}", letters.as_str()),
    };
    let text = text.replace(" -", " −");
    let end = if text.ends_with(['.', '!', '?']) { "" } else { "." };
    text + end
}

/// A list of sentences.
fn sentences(all: impl Iterator<Item = String>) -> String {
    let mut out = String::new();
    for text in all {
        let _ = writeln!(out, "<li>{}</li>", escaped(&sentence(&text)));
    }
    if out.is_empty() { out } else { format!("<ul class=\"findings\">\n{out}</ul>\n") }
}

/// Where the model fails, what is missing and what is odd about the data.
pub(crate) fn found(page: &Page) -> Vec<String> {
    let mut all = page.material.comparison.findings.clone();
    if let Some(diagnosis) = page.material.diagnosis {
        all.push(format!("{}: {}", verdict(diagnosis.verdict), diagnosis.reason));
    }
    all.extend(page.data.warnings.iter().take(8).map(|w| format!("About the data: {w}")));
    all
}

pub(crate) fn findings(page: &Page) -> String {
    let how = format!(
        "<p class=\"soft\">Split: {} The model that is judged: {}.</p>\n",
        escaped(page.split),
        escaped(page.terms_from)
    );
    sentences(found(page).into_iter()) + &how
}

fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Missing => "Something is missing",
        Verdict::ExplainedInPart => "A part of what is missing is explained",
        Verdict::NothingMissing => "Nothing is missing",
        Verdict::Unexplained => "Something is missing that the catalogue does not have",
        Verdict::TooLittleData => "Too little data to say what is missing",
        Verdict::Interrupted => "The diagnosis was interrupted",
    }
}

/// Figures of one plot, or the sentence that says why there are none.
fn drawn(figures: &Drawn, name: &str) -> String {
    let Some((_, own)) = figures.iter().find(|(plot, _)| *plot == name) else {
        return String::new();
    };
    if own.is_empty() {
        let why = plot(name).map_or("", |row| row.absent);
        return format!("<p class=\"soft\">{}</p>\n", escaped(why));
    }
    shown(own)
}

/// Figures of several plots in one grid.
fn several(figures: &Drawn, names: &[&str]) -> String {
    let mut all = Vec::new();
    let mut absent = String::new();
    for name in names {
        match figures.iter().find(|(plot, own)| plot == name && !own.is_empty()) {
            Some((_, own)) => all.extend(own.iter().cloned()),
            None => absent += &drawn(figures, name),
        }
    }
    shown(&all) + &absent
}

fn predictions(page: &Page, figures: &Drawn) -> String {
    let table = tables::horizons(page.material.comparison).html();
    several(figures, &["horizons", "predictions"])
        + &format!("<details><summary>The errors as a table</summary>\n{table}</details>\n")
}

fn forces(page: &Page, figures: &Drawn) -> String {
    let mut out = several(figures, &["forces", "force-map"]);
    let table = tables::forces(page.material.comparison).html();
    if !table.is_empty() {
        let _ = write!(out, "<details><summary>All maps as a table</summary>\n{table}</details>\n");
    }
    out
}

fn missing(page: &Page, figures: &Drawn) -> String {
    let Some(diagnosis) = page.material.diagnosis else { return String::new() };
    let class = match diagnosis.verdict {
        Verdict::Missing | Verdict::ExplainedInPart => "missing",
        Verdict::Unexplained => "unexplained",
        Verdict::NothingMissing | Verdict::TooLittleData | Verdict::Interrupted => "quiet",
    };
    let mut out = format!(
        "<p class=\"verdict {class}\"><strong>{}</strong>: {}.</p>\n",
        verdict(diagnosis.verdict),
        escaped(diagnosis.reason.trim_end_matches('.'))
    );
    if figures.iter().any(|(name, own)| *name == "ranking" && !own.is_empty()) {
        let (plot, table) = (drawn(figures, "ranking"), tables::leaders(diagnosis).html());
        let _ = writeln!(out, "<div class=\"beside\">{plot}{table}</div>");
    }
    if let Some(sentence) = present::indistinguishable(diagnosis) {
        let _ = writeln!(out, "<p>{}</p>", escaped(&sentence));
    }
    let told = diagnosis.story.iter().chain(&diagnosis.partial);
    let snippets = told.map(|one| one.snippet.as_str());
    let snippets: Vec<&str> = snippets.filter(|text| !text.is_empty()).collect();
    if !snippets.is_empty() {
        let _ = writeln!(
            out,
            "<p>To add it, write into the spec:</p>\n<pre>{}</pre>",
            escaped(&snippets.join("\n"))
        );
    }
    if !diagnosis.further.is_empty() {
        let further: Vec<&str> =
            diagnosis.further.iter().map(|leader| leader.effect.as_str()).collect();
        let _ = writeln!(
            out,
            "<p>It takes these with it, which explain what the first leaves: {}.</p>",
            escaped(&further.join(", then "))
        );
    }
    if !diagnosis.partial.is_empty() {
        let _ = writeln!(out, "<p>{}</p>", escaped(&present::in_part(diagnosis)));
    }
    if let Some(unnamed) = &diagnosis.unnamed {
        let _ = writeln!(
            out,
            "<p>The best term outside the catalogue ({}), to be understood before it is used:</p>\n\
             <pre>{}</pre>",
            escaped(&unnamed.effect),
            escaped(&unnamed.snippet)
        );
    }
    let _ = writeln!(out, "<p class=\"soft\">{}</p>", escaped(&present::tested(diagnosis)));
    out
}

fn search(page: &Page, figures: &Drawn) -> String {
    let Some(model) = page.model else { return String::new() };
    let evidence = &model.evidence;
    let mut out = format!(
        "<p>Function space: {}; models tried: {}; chosen by the {}. Training {} ({}).</p>\n",
        count(evidence.function_space, "term"),
        evidence.supports_tried,
        escaped(&evidence.selection),
        escaped(model.stop.sentence.trim_end_matches('.')),
        count(model.stop.rounds, "round"),
    );
    out += &several(figures, &["front", "path"]);
    out += &tables::runners_up(model).html();
    let doubts = model.alternatives.iter().take(12).map(|exchange| {
        format!(
            "These data can hardly distinguish {} from {} (criterion +{:.1})",
            term(&exchange.term),
            term(&exchange.instead),
            exchange.difference
        )
    });
    out + &sentences(doubts.chain(model.unlearnable.iter().take(12).cloned()))
}

fn ledger(page: &Page, figures: &Drawn) -> String {
    if page.history.is_empty() {
        return String::new();
    }
    drawn(figures, "ledger") + &tables::ledger(page.history).html()
}

/// How much was measured, in a sentence.
pub(crate) fn amount_of_data(page: &Page) -> String {
    let data = page.data;
    let sampling = data.sampling;
    let time = unit(page.material.view.time.unit.as_deref());
    let every = if sampling.is_regular {
        format!("one every {} {time}", number(sampling.median, 4))
    } else {
        format!(
            "irregular, one every {} {time} in the median (from {} to {})",
            number(sampling.median, 4),
            number(sampling.minimum, 4),
            number(sampling.maximum, 4)
        )
    };
    format!(
        "{} in {}; {}.",
        count(data.samples, "sample"),
        count(data.runs.len(), "run"),
        every.trim_end()
    )
}

pub(crate) fn data(page: &Page) -> String {
    let data = page.data;
    let mut out = format!("<p>{}</p>\n", escaped(&amount_of_data(page)));
    out += &tables::columns(data).html();
    out += &tables::gaps(data).html();
    out + &sentences(data.warnings.iter().cloned())
}

fn again(page: &Page) -> String {
    let mut out = tables::facts(page.facts);
    let _ = write!(
        out,
        "<pre>{}</pre>\n<details><summary>The spec</summary>\n<pre>{}</pre></details>\n",
        lines(&page.commands.join("\n")),
        lines(page.spec)
    );
    out
}

/// A text with its lines as they are.
fn lines(text: &str) -> String {
    text.lines().map(|line| escaped(line) + "\n").collect()
}
