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
    /// Its `math` element.
    pub mathml: String,
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

/// The equations one by one; those that are long on several lines.
pub fn formulas(export: &Export) -> Result<Vec<Formula>> {
    let formula = |equation: latex::Equation| {
        let motion = equation.left.starts_with(r"\dot");
        let tex = if equation.right.len() > 1 {
            let right = equation.right.join(r" \\ & ");
            format!(r"\begin{{aligned}} {} &= {right} \end{{aligned}}", equation.left)
        } else {
            format!("{} = {}", equation.left, equation.right.concat())
        };
        Ok(Formula { motion, mathml: converted(&tex)? })
    };
    latex::equations(export)?.into_iter().map(formula).collect()
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
