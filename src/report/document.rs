//! The report as a LaTeX document, for papers, print and PDF.
//!
//! It tells what the page tells; its figures lie in a folder beside it. Every LaTeX of the last
//! ten years compiles it with nothing but `amsmath`, `graphicx` and `geometry`.

use std::fmt::Write;

use super::html::sections::{amount_of_data, found, sentence};
use super::html::tables::{self, Table};
use super::html::{Page, RenderedPage};
use crate::diagnose::diagnosis::Diagnosis;
use crate::export::escape;
use crate::report::plots::{Figure, escaped_id};
use crate::report::present;

/// How every document begins: by this it is known as one that may be written over.
pub const FIRST_LINE: &str = "% A report of Leverrier";

/// Widest table, in letters, that a line of text takes in small print.
const WIDE: usize = 96;

/// The document; `folder` is where its figures lie, seen from it.
pub fn latex(page: &Page, figures: &[(&'static str, Vec<Figure>)], folder: &str) -> String {
    let title = if page.title.is_empty() { "A learned model" } else { page.title };
    let mut out = format!(
        "{FIRST_LINE} {}\n\\documentclass[a4paper]{{article}}\n\\usepackage[T1]{{fontenc}}\n\
         \\usepackage[utf8]{{inputenc}}\n\\usepackage{{amsmath,amssymb,graphicx}}\n\
         \\usepackage[margin=22mm]{{geometry}}\n\\usepackage{{parskip}}\n\\allowdisplaybreaks\n\
         \\setlength{{\\emergencystretch}}{{3em}}\n\\title{{{}}}\n\\author{{Leverrier {}}}\n\
         \\date{{}}\n\\begin{{document}}\n\\maketitle\n",
        env!("CARGO_PKG_VERSION"),
        text(title),
        env!("CARGO_PKG_VERSION"),
    );
    section(&mut out, "The law");
    for (motion, heading) in [(false, ""), (true, "\\subsection*{Equations of motion}\n")] {
        let own: Vec<_> = page.formulas.iter().filter(|f| f.motion == motion).collect();
        if !own.is_empty() {
            out += heading;
        }
        for formula in own {
            let _ = writeln!(out, "\\[ {} \\]", formula.latex);
        }
    }
    if page.formulas.is_empty() {
        let law = page.simplified.text(crate::simplify::Style::default());
        paragraph(&mut out, &law);
    }
    paragraph(&mut out, "Digits in parentheses are the standard error of the last digits.");
    list(&mut out, page.notes.iter().take(12).map(|note| sentence(note)));
    if let Some(model) = page.model {
        table(&mut out, &tables::coefficients(model));
    }
    table(&mut out, &tables::noise(page));
    section(&mut out, "Findings");
    list(&mut out, found(page).iter().map(|finding| sentence(finding)));
    paragraph(
        &mut out,
        &format!("Split: {} The model that is judged: {}.", page.split, page.terms_from),
    );
    let own = |names: &[&str]| -> Vec<&Figure> {
        let named = names.iter().filter_map(|name| figures.iter().find(|(plot, _)| plot == name));
        named.flat_map(|(_, own)| own).collect()
    };
    section(&mut out, "How far it predicts");
    pictures(&mut out, &own(&["horizons", "predictions"]), folder);
    table(&mut out, &tables::horizons(page.material.comparison));
    let forces = own(&["forces", "force-map"]);
    if !forces.is_empty() {
        section(&mut out, "Where it fails");
        pictures(&mut out, &forces, folder);
    }
    if let Some(diagnosis) = page.material.diagnosis {
        section(&mut out, "What is missing");
        missing(&mut out, diagnosis, &own(&["ranking"]), folder);
    }
    section(&mut out, "The motion");
    pictures(&mut out, &own(&["portrait", "energy"]), folder);
    if let Some(model) = page.model {
        section(&mut out, "How the terms were found");
        let evidence = &model.evidence;
        paragraph(
            &mut out,
            &format!(
                "Function space of {} terms; {} models tried; chosen by the {}.",
                evidence.function_space, evidence.supports_tried, evidence.selection
            ),
        );
        pictures(&mut out, &own(&["front", "path"]), folder);
        table(&mut out, &tables::runners_up(model));
    }
    if !page.history.is_empty() {
        section(&mut out, "History of the spec");
        pictures(&mut out, &own(&["ledger"]), folder);
        table(&mut out, &tables::ledger(page.history));
    }
    section(&mut out, "The data");
    paragraph(&mut out, &amount_of_data(page));
    table(&mut out, &tables::columns(page.data));
    list(&mut out, page.data.warnings.iter().map(|warning| sentence(warning)));
    section(&mut out, "To reproduce this report");
    out += "{\\small\\begin{description}\n";
    for (name, value) in page.facts {
        // Hashes are longer than a line.
        let value: Vec<String> = value.split(' ').map(breakable).collect();
        let _ = writeln!(out, "\\item[{}] \\texttt{{{}}}", text(name), value.join(" "));
    }
    out += "\\end{description}}\n";
    verbatim(&mut out, page.commands.join("\n").as_str());
    verbatim(&mut out, page.spec);
    out += "\\end{document}\n";
    out
}

fn missing(out: &mut String, diagnosis: &Diagnosis, ranking: &[&Figure], folder: &str) {
    paragraph(out, &sentence(&diagnosis.reason));
    pictures(out, ranking, folder);
    table(out, &tables::leaders(diagnosis));
    if let Some(first) = diagnosis.ranking.first() {
        if let Some(sentence) = present::indistinguishable(diagnosis) {
            paragraph(out, &sentence);
        }
        paragraph(out, "To add it, write into the spec:");
        verbatim(out, &first.snippet);
    }
}

/// Files of the figures, in the order of the page.
pub fn files(drawn: &RenderedPage) -> impl Iterator<Item = (String, &Figure)> {
    let figures = drawn.figures.iter().flat_map(|(_, figures)| figures);
    figures.map(|figure| (file(figure), figure))
}

fn file(figure: &Figure) -> String {
    escaped_id(&figure.id) + ".png"
}

fn section(out: &mut String, title: &str) {
    let _ = writeln!(out, "\n\\section*{{{}}}", text(title));
}

fn paragraph(out: &mut String, words: &str) {
    let _ = writeln!(out, "\n{}\n", text(words));
}

fn list(out: &mut String, items: impl Iterator<Item = String>) {
    let items: String = items.map(|item| format!("\\item {}\n", text(&item))).collect();
    if !items.is_empty() {
        let _ = write!(out, "\\begin{{itemize}}\n{items}\\end{{itemize}}\n");
    }
}

/// Two figures beside each other, each with its caption.
fn pictures(out: &mut String, figures: &[&Figure], folder: &str) {
    for pair in figures.chunks(2) {
        *out += "\n\\noindent";
        for (at, figure) in pair.iter().enumerate() {
            let _ = write!(
                out,
                "{}\\begin{{minipage}}[t]{{0.485\\textwidth}}\\vspace{{0pt}}\n\
                 \\includegraphics[width=\\textwidth]{{{folder}/{}}}\\\\\n{{\\footnotesize {}}}\n\
                 \\end{{minipage}}",
                if at == 0 { "" } else { "\\hfill\n" },
                file(figure),
                text(&figure.caption),
            );
        }
        *out += "\n\n\\medskip\n";
    }
}

/// A table; one that is too wide for the page is shrunk to it.
fn table(out: &mut String, table: &Table) {
    let (rows, more) = table.shown();
    if rows.is_empty() {
        return;
    }
    let columns: String = (0..table.head.len())
        .map(|at| if table.numbers.contains(&at) { 'r' } else { 'l' })
        .collect();
    let head: Vec<String> = table.head.iter().map(|cell| text(cell)).collect();
    let longest = |at: usize| {
        let cells = rows.iter().filter_map(|row| row.get(at)).map(|cell| cell.chars().count());
        cells.chain([table.head[at].chars().count()]).max().unwrap_or(0) + 2
    };
    let wide = (0..table.head.len()).map(longest).sum::<usize>() > WIDE;
    let (before, after) =
        if wide { ("\\resizebox{\\textwidth}{!}{", "}") } else { ("{\\small", "}") };
    let _ = write!(
        out,
        "\n\\noindent{before}\\begin{{tabular}}{{@{{}}{columns}@{{}}}}\n\\hline\n{} \\\\\n\\hline\n",
        head.join(" & ")
    );
    for row in rows {
        let cells: Vec<String> = row.iter().map(|cell| text(cell)).collect();
        let _ = writeln!(out, "{} \\\\", cells.join(" & "));
    }
    let _ = writeln!(out, "\\hline\n\\end{{tabular}}{after}\n");
    if more > 0 {
        paragraph(out, &format!("and {more} more"));
    }
}

/// Lines as they are, in letters that every font has.
fn verbatim(out: &mut String, lines: &str) {
    *out += "\n{\\small\\ttfamily\\raggedright\\noindent\n";
    for line in lines.lines() {
        // Spaces at the beginning of a line mean something in a spec.
        let rest = line.trim_start();
        let indent = "~".repeat(line.chars().count() - rest.chars().count());
        let rest = if rest.is_empty() { "~".to_string() } else { typed(rest) };
        let _ = writeln!(out, "{indent}{rest}\\\\");
    }
    *out += "}\n";
}

/// What is to be typed as it stands: two hyphens are two.
fn typed(words: &str) -> String {
    text(words).replace("--", "-{}-")
}

/// A long word that may be broken anywhere.
fn breakable(word: &str) -> String {
    if word.len() < 40 || !word.is_ascii() {
        return typed(word);
    }
    let pieces: Vec<String> =
        word.as_bytes().chunks(8).map(|c| text(&String::from_utf8_lossy(c))).collect();
    pieces.join("\\allowbreak{}")
}

/// Words as LaTeX: commands are escaped, and letters that its fonts lack are written as formulas.
fn text(words: &str) -> String {
    let mut out = String::new();
    for c in escape::latex(words).chars() {
        match formula(c) {
            Some(formula) => {
                let _ = write!(out, "\\ensuremath{{{formula}}}");
            }
            // What the usual input encoding knows; others would stop the compilation.
            None if c.is_ascii()
                || ('\u{a1}'..='\u{17f}').contains(&c)
                || "–—‘’“”…".contains(c) =>
            {
                out.push(c);
            }
            None => out.push('?'),
        }
    }
    out
}

/// A letter of mathematics.
fn formula(c: char) -> Option<String> {
    const GREEK: &str = "αβγδεζηθικλμνξπρστυφχψωΓΔΘΛΞΠΣΦΨΩ";
    const NAMES: &[&str] = &[
        "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa",
        "lambda", "mu", "nu", "xi", "pi", "rho", "sigma", "tau", "upsilon", "phi", "chi", "psi",
        "omega", "Gamma", "Delta", "Theta", "Lambda", "Xi", "Pi", "Sigma", "Phi", "Psi", "Omega",
    ];
    const SIGNS: &[(char, &str)] = &[
        ('−', "-"),
        ('·', r"\cdot"),
        ('×', r"\times"),
        ('±', r"\pm"),
        ('≤', r"\le"),
        ('≥', r"\ge"),
        ('≈', r"\approx"),
        ('°', r"^\circ"),
        ('µ', r"\mu"),
        ('¹', "^1"),
        ('²', "^2"),
        ('³', "^3"),
        ('⁻', "^-"),
        ('∞', r"\infty"),
        ('√', r"\surd"),
        ('ₓ', "_x"),
    ];
    if let Some(at) = GREEK.chars().position(|letter| letter == c) {
        return NAMES.get(at).map(|name| format!("\\{name}"));
    }
    if let Some((_, sign)) = SIGNS.iter().find(|(own, _)| *own == c) {
        return Some((*sign).to_string());
    }
    let digit = |zero: char| {
        let at = (c as u32).checked_sub(zero as u32)?;
        char::from_digit(at, 10)
    };
    if let Some(digit) = digit('₀') {
        return Some(format!("_{digit}"));
    }
    digit('⁰').map(|digit| format!("^{digit}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_become_latex() {
        for (words, expected) in [
            ("q₁² & θ", r"q\ensuremath{_1}\ensuremath{^2} \& \ensuremath{\theta}"),
            ("viscous_drag", r"viscous\_drag"),
            ("−1.2·10⁻⁷", r"\ensuremath{-}1.2\ensuremath{\cdot}10\ensuremath{^-}\ensuremath{^7}"),
            ("Poincaré 日本", "Poincaré ??"),
        ] {
            assert_eq!(text(words), expected);
        }
    }
}
