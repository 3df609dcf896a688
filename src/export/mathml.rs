//! Equations as MathML, converted from their LaTeX.

use std::fmt::Write;

use math_core::{LatexToMathML, MathCoreConfig, MathDisplay};

use super::latex;
use super::tex::width;
use super::{Export, Output};
use crate::error::{Error, ErrorKind, Result};

/// One equation of a model.
pub struct Formula {
    /// Whether it is an equation of motion, rather than a part of H or a force.
    pub motion: bool,
    /// Its `math` elements: one for each summand, so that a browser may break the line between.
    pub mathml: String,
    /// The same in LaTeX.
    pub latex: String,
}

/// Writes one `math` element a line, each for one equation.
pub(super) fn export(export: &Export) -> Result<Output> {
    let mut out = String::new();
    for equation in latex::equations(export)? {
        let tex = format!("{} = {}", equation.left, equation.right.join(" "));
        let _ = writeln!(out, "{}", converted(&tex)?);
    }
    Ok(Output::Text(out))
}

/// The equations one by one, ready to be broken into lines.
pub fn formulas(export: &Export) -> Result<Vec<Formula>> {
    let formula = |equation: latex::Equation| {
        let motion = equation.left.starts_with(r"\dot");
        let pieces = pieces(&format!("{} = {}", equation.left, equation.right.join(" ")));
        let mathml: Result<Vec<String>> = pieces.iter().map(|tex| converted(tex)).collect();
        Ok(Formula { motion, mathml: mathml?.join("<wbr>"), latex: lines(&pieces) })
    };
    latex::equations(export)?.into_iter().map(formula).collect()
}

/// A summand wider than this, in letters, is broken inside its bracket.
const LONG: usize = 24;
/// Letters of a line of LaTeX.
const LINE: usize = 62;
/// Brackets that are open to breaks, while pieces are cut.
const OPEN: (char, char) = ('\u{1}', '\u{2}');

/// Pieces on as many lines as they need.
fn lines(pieces: &[String]) -> String {
    let mut lines: Vec<(usize, String)> = Vec::new();
    for piece in pieces {
        let size = width(piece);
        match lines.last_mut() {
            Some((used, line)) if *used + size <= LINE => {
                *used += size;
                *line += &format!(" {piece}");
            }
            _ => lines.push((size, piece.clone())),
        }
    }
    let lines: Vec<String> = lines.into_iter().map(|(_, line)| line).collect();
    if lines.len() < 2 {
        return lines.concat();
    }
    let lines = lines.join(r" \\ & \quad ").replacen(" = ", " &= ", 1);
    format!(r"\begin{{aligned}} {lines} \end{{aligned}}")
}

/// Cuts a formula before every sign that stands in no bracket, or in one that is very wide.
fn pieces(tex: &str) -> Vec<String> {
    let opened = cut(tex).into_iter().flat_map(|piece| match width(&piece) > LONG {
        true => cut(&opened(&piece)),
        false => vec![piece],
    });
    // A bracket whose ends stand on two lines does not know how high it is to be.
    opened.map(|piece| piece.replace(OPEN.0, "(").replace(OPEN.1, ")")).collect()
}

/// How brackets open and close in a piece of a formula.
fn depth(text: &str) -> i32 {
    text.chars().map(|c| i32::from("({[".contains(c)) - i32::from(")}]".contains(c))).sum()
}

/// The formula with its first outermost bracket marked as open to breaks.
fn opened(tex: &str) -> String {
    let (left, right) = (r"\left(", r"\right)");
    let start = tex.match_indices(left).map(|(at, _)| at).find(|at| depth(&tex[..*at]) == 0);
    let Some(start) = start else { return tex.to_string() };
    let inside = start + left.len();
    let closing = |at: &usize| depth(&tex[inside..*at]) == 0;
    let Some(end) =
        tex.match_indices(right).map(|(at, _)| at).filter(|at| *at >= inside).find(closing)
    else {
        return tex.to_string();
    };
    let rest = &tex[end + right.len()..];
    format!("{}{}{}{}{rest}", &tex[..start], OPEN.0, &tex[inside..end], OPEN.1)
}

/// Cuts a formula before every sign that stands in no bracket.
fn cut(tex: &str) -> Vec<String> {
    let mut pieces = vec![String::new()];
    let mut level = 0;
    let words: Vec<&str> = tex.split(' ').filter(|word| *word != r"\quad").collect();
    for (at, word) in words.iter().enumerate() {
        // What follows a relation or opens a bracket is its own sign.
        let signs = at > 0 && words[at - 1] != "=" && words[at - 1] != "{}";
        if level == 0 && signs && (*word == "+" || *word == "-") {
            // Nothing before it makes it the sign between two.
            pieces.push("{}".to_string());
        }
        let last = pieces.len() - 1;
        if !pieces[last].is_empty() {
            pieces[last].push(' ');
        }
        pieces[last] += word;
        level += depth(word);
    }
    pieces
}

/// A formula whose round and square brackets grow with what stands in them only where that is a
/// fraction.
///
/// Where no mathematical font is installed, browsers build a bracket that grows of pieces, and the
/// smallest that can be built is twice as high as a line.
fn unstretched(tex: &str) -> String {
    let (left, right) = (r"\left", r"\right");
    let mut out = String::new();
    // Where brackets that are open begin in `out`.
    let mut open: Vec<usize> = Vec::new();
    let mut rest = tex;
    while let Some(letter) = rest.chars().next() {
        let bracket = |command: &str, pair: [char; 2]| {
            rest.strip_prefix(command).filter(|after| after.starts_with(pair))
        };
        if let Some(after) = bracket(left, ['(', '[']) {
            open.push(out.len());
            out.push_str(left);
            rest = after;
        } else if let Some(after) = bracket(right, [')', ']']) {
            match open.pop() {
                Some(start)
                    if !out.get(start..).is_some_and(|inside| inside.contains(r"\frac")) =>
                {
                    out.replace_range(start..start + left.len(), "");
                }
                _ => out.push_str(right),
            }
            rest = after;
        } else {
            out.push(letter);
            rest = rest.get(letter.len_utf8()..).unwrap_or("");
        }
    }
    out
}

fn converted(tex: &str) -> Result<String> {
    let tex = &unstretched(tex);
    let wrong = |message: String| {
        Error::new(
            ErrorKind::Export,
            format!("an equation cannot be written as MathML: {message}"),
            "export it as LaTeX instead",
        )
    };
    let converter = LatexToMathML::new(MathCoreConfig::default())
        .map_err(|error| wrong(format!("{error:?}")))?;
    let converted = converter
        .convert_with_local_state(tex, MathDisplay::Block)
        .map_err(|error| wrong(format!("{error:?}")))?;
    Ok(converted.mathml)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_break_between_summands_alone() {
        let cut =
            pieces(r"V = - a \left( x + y \right)^{2} + \frac{b - c}{2} \cos(x + 1) \quad - d");
        assert_eq!(
            cut,
            [r"V = - a \left( x + y \right)^{2}", r"{} + \frac{b - c}{2} \cos(x + 1)", "{} - d"]
        );
    }

    #[test]
    fn brackets_grow_around_fractions_alone() {
        for (tex, expected) in [
            (r"\cos\left(q + 1\right)", r"\cos(q + 1)"),
            (r"\left(q^{2} - \left[p + 1\right]\right)^{2}", r"(q^{2} - [p + 1])^{2}"),
            (r"\left(\frac{q}{2} + \left(p\right)\right)", r"\left(\frac{q}{2} + (p)\right)"),
            (r"\left|q\right|", r"\left|q\right|"),
        ] {
            assert_eq!(unstretched(tex), expected);
        }
        let mathml = |tex: &str| converted(tex).unwrap();
        let plain = mathml(r"\cos\left(q^{2} + 1\right)");
        assert!(plain.contains("<mo stretchy=\"false\">(</mo>"), "{plain}");
        let tall = mathml(r"\left(\frac{q}{2}\right)^{2}");
        assert!(tall.contains("<mo>(</mo>"), "{tall}");
    }
}
