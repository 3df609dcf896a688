//! One expression in the place of another, in the syntax tree of a spec.

use crate::spec::ast::*;

/// The expression of a statement, to be changed.
pub(super) fn value_of(kind: &mut StatementKind) -> Option<&mut Expression> {
    match kind {
        StatementKind::Constant { value, .. }
        | StatementKind::Energy { value, .. }
        | StatementKind::Force { value, .. }
        | StatementKind::Sensor { value, .. } => Some(value),
        _ => None,
    }
}

/// An expression with some of its nodes replaced.
pub(super) fn replaced(
    expression: &Expression,
    by: &dyn Fn(&Expression) -> Option<Expression>,
) -> Expression {
    if let Some(new) = by(expression) {
        return new;
    }
    let again = |part: &Expression| replaced(part, by);
    let all = |parts: &[(bool, Expression)]| {
        parts.iter().map(|(sign, part)| (*sign, again(part))).collect::<Vec<_>>()
    };
    let kind = match &expression.kind {
        ExpressionKind::Quantity(inner, unit) => {
            ExpressionKind::Quantity(Box::new(again(inner)), unit.clone())
        }
        ExpressionKind::Negate(inner) => ExpressionKind::Negate(Box::new(again(inner))),
        ExpressionKind::Sum(parts) => ExpressionKind::Sum(all(parts)),
        ExpressionKind::Product(parts) => ExpressionKind::Product(all(parts)),
        ExpressionKind::Power(base, exponent) => {
            ExpressionKind::Power(Box::new(again(base)), Box::new(again(exponent)))
        }
        ExpressionKind::Call { name, arguments, order } => ExpressionKind::Call {
            name: name.clone(),
            arguments: arguments.iter().map(again).collect(),
            order: order.clone(),
        },
        ExpressionKind::SumOver { body, comprehension } => ExpressionKind::SumOver {
            body: Box::new(again(body)),
            comprehension: comprehension.clone(),
        },
        ExpressionKind::Span(items) => {
            let item = |item: &Item| Item { body: again(&item.body), ..item.clone() };
            ExpressionKind::Span(items.iter().map(item).collect())
        }
        other => other.clone(),
    };
    Expression { kind, site: expression.site }
}

/// Takes a constant's statement away. Constants that are made of it are written out where they
/// stand, since they are no constants any more.
pub(super) fn forget_constant(spec: &mut SyntaxTree, name: &str) {
    // Other statements keep their places.
    let nothing = || StatementKind::Candidates(Vec::new());
    let own = |s: &&mut Statement| matches!(&s.kind, StatementKind::Constant { name: other, .. } if other.text == name);
    if let Some(statement) = spec.statements.iter_mut().find(own) {
        statement.kind = nothing();
    }
    loop {
        let depends = |statement: &&mut Statement| match &statement.kind {
            StatementKind::Constant { value, .. } => value.mentions(&[name]),
            _ => false,
        };
        let Some(statement) = spec.statements.iter_mut().find(depends) else { break };
        let kind = std::mem::replace(&mut statement.kind, nothing());
        let StatementKind::Constant { name: dependent, value, .. } = kind else { break };
        for statement in &mut spec.statements {
            if let Some(place) = value_of(&mut statement.kind) {
                *place = replaced(place, &|node| match &node.kind {
                    ExpressionKind::Name(other) if *other == dependent.text => Some(value.clone()),
                    _ => None,
                });
            }
        }
    }
}
