//! The gain of an input in the forces that a spec says, where it is a known number.

use super::ast::{Expression, ExpressionKind, Operand, Relation, Site, Statement, StatementKind};
use super::resolve::{Meaning, Resolved};

/// That the coefficient `name` is the gain of an input in the force on a coordinate: nothing is
/// unknown then of how much a delayed or a limited command gives. `None` where no such gain is said
/// in one place, or it is learned.
pub(super) fn tie(
    resolved: &Resolved,
    (coordinate, input): (&str, &str),
    name: &str,
    site: Site,
) -> Option<Statement> {
    let mut gains = Vec::new();
    for force in resolved.forces.iter().filter(|force| is(force.coordinate, coordinate)) {
        let parts = match &force.value.kind {
            ExpressionKind::Sum(parts) => parts.clone(),
            _ => vec![(false, force.value.clone())],
        };
        for (minus, part) in parts.iter().filter(|(_, part)| part.mentions(&[input])) {
            gains.push(factor(resolved, part, input, *minus)?);
        }
    }
    let [gain] = gains.as_slice() else { return None };
    let operand = |kind: &ExpressionKind| Operand::Value(Expression { kind: kind.clone(), site });
    let own = ExpressionKind::Name(name.to_string());
    let kind = StatementKind::Constrain {
        first: operand(gain),
        rest: vec![(Relation::LessOrEqual, operand(&own)), (Relation::LessOrEqual, operand(gain))],
    };
    Some(Statement { kind, site, effect: None })
}

/// Whether an expression is a name and nothing else.
fn is(expression: &Expression, wanted: &str) -> bool {
    matches!(&expression.kind, ExpressionKind::Name(name) if name == wanted)
}

/// What an input is multiplied by in a part of a sum, where that is known.
fn factor(
    resolved: &Resolved,
    part: &Expression,
    input: &str,
    minus: bool,
) -> Option<ExpressionKind> {
    let one = |kind: ExpressionKind| Expression { kind, site: part.site };
    let kind = match &part.kind {
        ExpressionKind::Name(_) => ExpressionKind::Number(1.0),
        ExpressionKind::Negate(inner) => {
            let inner = factor(resolved, inner, input, false)?;
            ExpressionKind::Negate(Box::new(one(inner)))
        }
        ExpressionKind::Product(factors) => {
            let at = factors.iter().position(|(divide, factor)| !divide && is(factor, input))?;
            let mut rest = factors.clone();
            rest.remove(at);
            if !rest.iter().all(|(_, factor)| is_known(resolved, factor)) {
                return None;
            }
            rest.insert(0, (false, one(ExpressionKind::Number(1.0))));
            ExpressionKind::Product(rest)
        }
        _ => return None,
    };
    Some(if minus { ExpressionKind::Negate(Box::new(one(kind))) } else { kind })
}

/// Whether an expression is made of numbers and constants.
fn is_known(resolved: &Resolved, expression: &Expression) -> bool {
    match &expression.kind {
        ExpressionKind::Number(_) => true,
        ExpressionKind::Name(name) => {
            let meaning = resolved.names.get(name).map(|&(meaning, _)| meaning);
            let Some(Meaning::Constant(at)) = meaning else { return false };
            resolved.constants.get(at).is_some_and(|constant| !constant.by_let)
        }
        ExpressionKind::Quantity(inner, _) | ExpressionKind::Negate(inner) => {
            is_known(resolved, inner)
        }
        ExpressionKind::Product(factors) => factors.iter().all(|(_, one)| is_known(resolved, one)),
        _ => false,
    }
}
