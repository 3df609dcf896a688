//! Numbers, ranges and states as they are written on the command line.

use super::console::usage;
use crate::error::Result;
use crate::expr::System;
use crate::facade::components::matching;
use crate::simulate::{Interval, NoiseLevel};
use crate::spec::ast::{Expression, ExpressionKind};

/// A whole initial state, as it may be written.
pub(super) fn example(names: &[String]) -> String {
    names.iter().map(|name| format!("{name}=0.1")).collect::<Vec<_>>().join(",")
}

/// `q=0.1,p=0` or `0.1,0`; `None` for what is not said.
pub(super) fn state(text: &str, names: &[String]) -> Result<Vec<Option<f64>>> {
    // A comma inside brackets belongs to a name.
    let mut parts = vec![String::new()];
    let mut depth = 0;
    for c in text.chars() {
        match c {
            ',' if depth == 0 => parts.push(String::new()),
            _ => {
                depth += i32::from(c == '[') - i32::from(c == ']');
                if let Some(last) = parts.last_mut() {
                    last.push(c);
                }
            }
        }
    }
    if !text.contains('=') {
        if parts.len() != names.len() {
            return Err(usage(
                format!("`{text}` has {} numbers, but the state has {}", parts.len(), names.len()),
                format!("give {}, in this order, or by name", names.join(", ")),
            ));
        }
        return parts.iter().map(|part| number(part).map(Some)).collect();
    }
    let mut out = vec![None; names.len()];
    for part in parts {
        let (name, value) = part.split_once('=').ok_or_else(|| {
            usage(format!("`{part}` is not NAME=NUMBER"), format!("write {}", example(names)))
        })?;
        let value = number(value)?;
        for at in matching(names, name.trim())? {
            if let Some(place) = out.get_mut(at) {
                *place = Some(value);
            }
        }
    }
    Ok(out)
}

/// A number, a fraction `1/12` or a multiple of pi: any constant of the mini-language.
fn number(text: &str) -> Result<f64> {
    let wrong = || usage(format!("`{}` is not a number", text.trim()), "write it as 0.1 or 1/12");
    let expression = crate::spec::expression(text.trim()).map_err(|_| wrong())?;
    constant(&expression).filter(|x| x.is_finite()).ok_or_else(wrong)
}

fn constant(expression: &Expression) -> Option<f64> {
    use ExpressionKind::{Name, Negate, Number, Power, Product, Sum};
    Some(match &expression.kind {
        Number(x) => *x,
        Name(name) if name == "pi" => std::f64::consts::PI,
        Negate(inner) => -constant(inner)?,
        Sum(terms) => {
            let mut sum = 0.0;
            for (minus, term) in terms {
                sum += constant(term)? * if *minus { -1.0 } else { 1.0 };
            }
            sum
        }
        Product(factors) => {
            let mut product = 1.0;
            for (over, factor) in factors {
                let value = constant(factor)?;
                product = if *over { product / value } else { product * value };
            }
            product
        }
        Power(base, exponent) => constant(base)?.powf(constant(exponent)?),
        _ => return None,
    })
}

/// `-1..1`.
pub(super) fn range_of(text: &str) -> Result<Interval> {
    let wrong = |message: String| usage(message, "write the range as LOW..HIGH, such as -1..1");
    let (lower, upper) =
        text.split_once("..").ok_or_else(|| wrong(format!("`{}` is not a range", text.trim())))?;
    let (lower, upper) = (number(lower)?, number(upper)?);
    if lower > upper {
        return Err(wrong(format!("the range {lower}..{upper} is empty")));
    }
    Ok(Interval { lower, upper })
}

/// `20`, or `5..20`.
pub(super) fn number_or_range(text: &str) -> Result<Interval> {
    if text.contains("..") {
        return range_of(text);
    }
    let value = number(text)?;
    Ok(Interval { lower: value, upper: value })
}

/// One noise for each observable.
pub(super) fn noise(system: &System, texts: &[String]) -> Result<Vec<NoiseLevel>> {
    let names = system.observables();
    let mut out = vec![NoiseLevel::Absolute(0.0); names.len()];
    for text in texts {
        let (name, amount) = match text.split_once('=') {
            Some((name, amount)) => (Some(name.trim()), amount),
            None => (None, text.as_str()),
        };
        let noise = match amount.trim().strip_suffix('%') {
            Some(percent) => NoiseLevel::Relative(number(percent)? / 100.0),
            None => NoiseLevel::Absolute(number(amount)?),
        };
        let at = match name {
            Some(name) => matching(&names, name)?,
            None => (0..names.len()).collect(),
        };
        for row in at {
            if let Some(place) = out.get_mut(row) {
                *place = noise;
            }
        }
    }
    Ok(out)
}
