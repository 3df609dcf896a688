//! Equations as MathML, converted from their LaTeX.

use std::fmt::Write;

use math_core::{LatexToMathML, MathCoreConfig, MathDisplay};

use super::latex;
use super::{Export, Output};
use crate::error::{Error, Result};

/// Writes one `math` element a line, each for one equation.
pub fn export(export: &Export) -> Result<Output> {
    let wrong = |message: String| {
        Error::fit(
            format!("an equation cannot be written as MathML: {message}"),
            "export it as LaTeX instead",
        )
    };
    let converter = LatexToMathML::new(MathCoreConfig::default())
        .map_err(|error| wrong(format!("{error:?}")))?;
    let mut out = String::new();
    for equation in latex::equations(export)? {
        let tex = format!("{} = {}", equation.left, equation.right.join(" "));
        let converted = converter
            .convert_with_local_state(&tex, MathDisplay::Block)
            .map_err(|error| wrong(format!("{error:?}")))?;
        let _ = writeln!(out, "{}", converted.mathml);
    }
    Ok(Output::Text(out))
}
