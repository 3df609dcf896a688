//! Equations as MathML, converted from their LaTeX.

use std::fmt::Write;

use math_core::{LatexToMathML, MathCoreConfig, MathDisplay};

use super::latex;
use super::{Export, Output};
use crate::error::{Error, Result};

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
pub fn export(export: &Export) -> Result<Output> {
    let mut out = String::new();
    for equation in latex::equations(export)? {
        let tex = format!("{} = {}", equation.left, equation.right.join(" "));
        let _ = writeln!(out, "{}", converted(&tex)?);
    }
    Ok(Output::Text(out))
}

/// The equations one by one; as LaTeX, those that are long on several lines.
pub fn formulas(export: &Export) -> Result<Vec<Formula>> {
    let formula = |equation: latex::Equation| {
        let motion = equation.left.starts_with(r"\dot");
        let whole = format!("{} = {}", equation.left, equation.right.join(" "));
        let mathml: Result<Vec<String>> = pieces(&whole).iter().map(|tex| converted(tex)).collect();
        let tex = if equation.right.len() > 1 {
            let right = equation.right.join(r" \\ & ");
            format!(r"\begin{{aligned}} {} &= {right} \end{{aligned}}", equation.left)
        } else {
            format!("{} = {}", equation.left, equation.right.concat())
        };
        Ok(Formula { motion, mathml: mathml?.join("<wbr>"), latex: tex })
    };
    latex::equations(export)?.into_iter().map(formula).collect()
}

/// Cuts a formula before every sign that stands in no bracket.
fn pieces(tex: &str) -> Vec<String> {
    let mut pieces = vec![String::new()];
    let mut depth = 0;
    let words: Vec<&str> = tex.split(' ').filter(|word| *word != r"\quad").collect();
    for (at, word) in words.iter().enumerate() {
        // What follows a relation is its right side's own sign.
        let signs = at > 0 && words[at - 1] != "=";
        if depth == 0 && signs && (*word == "+" || *word == "-") {
            // Nothing before it makes it the sign between two.
            pieces.push("{}".to_string());
        }
        let last = pieces.len() - 1;
        if !pieces[last].is_empty() {
            pieces[last].push(' ');
        }
        pieces[last] += word;
        for c in word.chars() {
            depth += i32::from("({[".contains(c)) - i32::from(")}]".contains(c));
        }
    }
    pieces
}

fn converted(tex: &str) -> Result<String> {
    let wrong = |message: String| {
        Error::fit(
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
}
