//! Whole numbers in indices and ranges.

use super::ast::{Expression, ExpressionKind};
use crate::diagnostic::Diagnostic;

/// The whole number that an index expression stands for.
///
/// # Errors
/// Where it is no whole number, or names something that is none.
pub(crate) fn integer(
    expression: &Expression,
    look_up: &dyn Fn(&str) -> Option<i64>,
) -> Result<i64, Diagnostic> {
    let span = expression.site.0;
    let too_large = || {
        Diagnostic::error(span, "this index is too large")
            .label("beyond 64 bits")
            .hint("make it smaller")
    };
    match &expression.kind {
        ExpressionKind::Number(value) if value.fract() == 0.0 && value.abs() < 1e15 => {
            Ok(*value as i64)
        }
        ExpressionKind::Name(name) => look_up(name).ok_or_else(|| {
            Diagnostic::error(span, format!("`{name}` is not a whole number"))
                .label("an index is made of whole numbers and names of indices")
                .hint("give it a range with `for`, or a value with `constant`")
        }),
        ExpressionKind::Negate(inner) => {
            integer(inner, look_up)?.checked_neg().ok_or_else(too_large)
        }
        ExpressionKind::Sum(parts) => parts.iter().try_fold(0_i64, |sum, (minus, part)| {
            let value = integer(part, look_up)?;
            let next = if *minus { sum.checked_sub(value) } else { sum.checked_add(value) };
            next.ok_or_else(too_large)
        }),
        ExpressionKind::Product(parts) => {
            parts.iter().try_fold(1_i64, |product, (divide, part)| {
                let value = integer(part, look_up)?;
                if !divide {
                    return product.checked_mul(value).ok_or_else(too_large);
                }
                match product.checked_rem(value) {
                    Some(0) => Ok(product / value),
                    _ => Err(Diagnostic::error(span, "this index is not a whole number")
                        .label(format!("{product} divided by {value}"))
                        .hint("an index is a whole number")),
                }
            })
        }
        _ => Err(Diagnostic::error(span, "this is not a whole number")
            .label("an index is made of whole numbers, +, - and *")
            .hint("write for example `q[i+1]`")),
    }
}
