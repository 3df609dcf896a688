//! Expressions of a spec as expressions of the graph, with their units.

use super::super::functions::{FUNCTIONS, FUNCTIONS_OF_TWO, Function, FunctionOfTwo, UnitRule};
use super::super::graph::{Expr, Symbol};
use super::super::unit::{Unit, simple_fraction};
use super::{Context, Lowering, MOST_STEPS};
use crate::diagnostic::{Diagnostic, Span};
use crate::spec::ast::*;
use crate::spec::families;

/// An expression and its unit; `None` where the unit is not known and nothing is checked.
#[derive(Debug, Clone, Copy)]
pub(super) struct Value {
    pub expr: Expr,
    pub unit: Option<Unit>,
}

impl Lowering<'_> {
    /// A number, its unit and its place; `None` after a diagnostic.
    pub(in crate::expr) fn number(
        &mut self,
        expression: &Expression,
    ) -> Option<(f64, Option<Unit>, Span)> {
        let context = std::mem::replace(&mut self.context, Context::Number);
        let value = self.value(expression);
        self.context = context;
        let value = value?;
        let span = expression.site.0;
        match self.graph.as_number(value.expr) {
            Some(number) if number.is_finite() => Some((number, value.unit, span)),
            _ => {
                self.report(
                    Diagnostic::error(span, "this is not a finite number")
                        .label("its value must be known here")
                        .hint("write numbers and constants only"),
                );
                None
            }
        }
    }

    /// Counts work, so that a short text cannot ask for an endless expansion.
    pub(super) fn step(&mut self, span: Span) -> Option<()> {
        self.steps += 1;
        if self.steps <= MOST_STEPS {
            return Some(());
        }
        if self.steps == MOST_STEPS + 1 {
            self.report(
                Diagnostic::error(span, "this expands to too much")
                    .label(format!("the spec has more than {MOST_STEPS} parts when written out"))
                    .hint("make the ranges of `for` smaller"),
            );
        }
        None
    }

    /// Lowers an expression; `None` after a diagnostic.
    pub(super) fn value(&mut self, expression: &Expression) -> Option<Value> {
        let span = expression.site.0;
        self.step(span)?;
        match &expression.kind {
            ExpressionKind::Number(value) => {
                // Zero is zero in every unit.
                let unit = (*value != 0.0).then_some(Unit::ONE);
                Some(Value { expr: self.graph.number(*value), unit })
            }
            ExpressionKind::Name(name) => self.named(name, span),
            ExpressionKind::Index { name, index } => self.indexed(name, index, span),
            ExpressionKind::Slice { name, .. } => {
                self.report(
                    Diagnostic::error(span, format!("`{name}` stands here with a whole range"))
                        .label("one index is needed")
                        .hint("a range may only be an argument of poly, tensor, pairs or trig"),
                );
                None
            }
            ExpressionKind::Quantity(inner, text) => {
                let inner = self.value(inner)?;
                let unit = self.unit(Some(text))?;
                let known = self.graph.as_number(inner.expr).is_some();
                if !known || inner.unit.is_some_and(|unit| !unit.is_number()) {
                    self.report(
                        Diagnostic::error(
                            span,
                            "a unit stands after something that is no bare number",
                        )
                        .label("only numbers are given units here")
                        .hint("give variables their units where they are declared"),
                    );
                    return None;
                }
                Some(Value { expr: inner.expr, unit: Some(unit) })
            }
            ExpressionKind::Negate(inner) => {
                let inner = self.value(inner)?;
                Some(Value { expr: self.graph.negate(inner.expr), ..inner })
            }
            ExpressionKind::Sum(parts) => self.sum(parts),
            ExpressionKind::Product(parts) => self.product(parts, span),
            ExpressionKind::Power(base, exponent) => self.power(base, exponent, span),
            ExpressionKind::Call { name, arguments, order } => {
                self.call(name, arguments, order.as_deref(), span)
            }
            ExpressionKind::SumOver { body, comprehension } => {
                let mut parts = Vec::new();
                let mut unit: Option<(Unit, Span)> = None;
                self.each(comprehension, &mut |lowering| {
                    if let Some(value) = lowering.value(body) {
                        parts.push((1.0, value.expr));
                        lowering.same_unit(&mut unit, value.unit, body.site.0);
                    }
                })?;
                let expr = self.graph.linear(0.0, &parts);
                Some(Value { expr, unit: unit.map(|(unit, _)| unit) })
            }
            ExpressionKind::Span(_) => {
                self.report(
                    Diagnostic::error(span, "span{ } does not stand on its own here")
                        .label("a function space is a summand of T, V, H or a force")
                        .hint("write `known + span{ ... }`; put factors inside, on each item"),
                );
                None
            }
        }
    }

    /// Keeps the unit of a sum: the first known one, with which all others agree.
    pub(super) fn same_unit(
        &mut self,
        sum: &mut Option<(Unit, Span)>,
        unit: Option<Unit>,
        span: Span,
    ) {
        match (*sum, unit) {
            (None, Some(unit)) => *sum = Some((unit, span)),
            (Some((first, at)), Some(unit)) if !first.agrees(unit) => {
                let hint = "what is added must have the same unit; correct a unit or add a constant that has one";
                self.clash((first, at), (unit, span), hint);
            }
            _ => {}
        }
    }

    fn sum(&mut self, parts: &[(bool, Expression)]) -> Option<Value> {
        let mut lowered = Vec::with_capacity(parts.len());
        let mut unit = None;
        let mut sound = true;
        for (minus, part) in parts {
            match self.value(part) {
                Some(value) => {
                    lowered.push((if *minus { -1.0 } else { 1.0 }, value.expr));
                    self.same_unit(&mut unit, value.unit, part.site.0);
                }
                None => sound = false,
            }
        }
        let expr = self.graph.linear(0.0, &lowered);
        sound.then_some(Value { expr, unit: unit.map(|(unit, _)| unit) })
    }

    fn product(&mut self, parts: &[(bool, Expression)], span: Span) -> Option<Value> {
        let mut factors = Vec::with_capacity(parts.len());
        let mut unit = Some(Unit::ONE);
        let mut sound = true;
        for (divide, part) in parts {
            let Some(value) = self.value(part) else {
                sound = false;
                continue;
            };
            if *divide && self.graph.is_zero(value.expr) {
                self.report(
                    Diagnostic::error(part.site.0, "this divides by zero")
                        .label("always zero")
                        .hint("take it away"),
                );
                sound = false;
                continue;
            }
            factors.push((value.expr, if *divide { -1.0 } else { 1.0 }));
            unit = match (unit, value.unit) {
                (Some(unit), Some(other)) => {
                    let result = if *divide { unit.over(other) } else { unit.times(other) };
                    if result.is_none() {
                        self.absurd(span);
                    }
                    result
                }
                _ => None,
            };
        }
        // The first factor keeps its scale exact: 1/3 is a third, not 1 * 0.333.
        sound.then(|| Value { expr: self.exact_product(&factors), unit })
    }

    fn exact_product(&mut self, factors: &[(Expr, f64)]) -> Expr {
        let (mut over, mut under) = (1.0, 1.0);
        let mut rest = Vec::new();
        for &(expr, sign) in factors {
            match self.graph.as_number(expr) {
                Some(number) if sign > 0.0 => over *= number,
                Some(number) => under *= number,
                None => rest.push((expr, sign)),
            }
        }
        self.graph.product(over / under, &rest)
    }

    fn absurd(&mut self, span: Span) {
        self.report(
            Diagnostic::error(span, "the unit of this is no unit of anything")
                .label("its powers are too large")
                .hint("make the exponents smaller"),
        );
    }

    fn power(&mut self, base: &Expression, exponent: &Expression, span: Span) -> Option<Value> {
        let (base_value, exponent_value) = (self.value(base), self.value(exponent));
        let (base_value, exponent_value) = (base_value?, exponent_value?);
        self.require_number(exponent_value.unit, exponent.site.0, "an exponent");
        let known = self.known_exponent(exponent_value.expr);
        let unit = match (base_value.unit, known) {
            (None, _) => None,
            (Some(unit), _) if unit.is_number() => Some(Unit::ONE),
            (Some(unit), Some(number)) => match simple_fraction(number) {
                Some(fraction) => {
                    let result = unit.power(fraction);
                    if result.is_none() {
                        self.absurd(span);
                    }
                    result
                }
                None => {
                    self.require_number(Some(unit), base.site.0, "what has such an exponent");
                    None
                }
            },
            (Some(unit), None) => {
                self.require_number(Some(unit), base.site.0, "what has an unknown exponent");
                None
            }
        };
        let expr = self.graph.power_of(base_value.expr, exponent_value.expr);
        let poisoned = self.graph.as_number(base_value.expr) == Some(0.0) && known < Some(0.0);
        if poisoned {
            self.report(
                Diagnostic::error(span, "this divides by zero")
                    .label("zero to a negative power")
                    .hint("take it away"),
            );
            return None;
        }
        Some(Value { expr, unit })
    }

    /// The number that an exponent is, or was before it was learned.
    fn known_exponent(&self, exponent: Expr) -> Option<f64> {
        if let Some(number) = self.graph.as_number(exponent) {
            return Some(number);
        }
        let (name, value) = self.freed.as_ref()?;
        let named = |parameter: &crate::spec::resolve::Parameter| parameter.name.text == *name;
        let freed = self.resolved.parameters.iter().position(named)?;
        let only = |symbol: &Symbol| *symbol == Symbol::Parameter(freed);
        let own = self.graph.symbols(&[exponent]).iter().all(only);
        own.then(|| self.graph.value(exponent, &|_| *value))
    }

    /// Reports a unit where a pure number must stand.
    pub(super) fn require_number(&mut self, unit: Option<Unit>, span: Span, what: &str) {
        let Some(unit) = unit.filter(|unit| !unit.is_number()) else { return };
        let hint = if unit.same_kind(Unit::ONE) {
            "convert to radians: declare the variable in [rad], and give the data column its own unit"
        } else {
            "divide by a constant of that unit, or multiply with a `param` that has the inverse unit"
        };
        self.report(
            Diagnostic::error(
                span,
                format!("units clash: {what} must be a number [1], but this is in [{unit}]"),
            )
            .label(format!("in [{unit}]"))
            .hint(hint),
        );
    }

    fn call(
        &mut self,
        name: &str,
        arguments: &[Expression],
        order: Option<&Expression>,
        span: Span,
    ) -> Option<Value> {
        if let Some(row) = families::by_name(name) {
            self.report(
                Diagnostic::error(span, format!("`{name}` does not stand on its own here"))
                    .label("a family is an item of span{ }")
                    .hint(format!("write span{{ {} }}, without factors", row.signature)),
            );
            return None;
        }
        if name == "rate" {
            return self.rate_of(arguments, order, span);
        }
        if name == "delayed" {
            return self.delayed(arguments, order, span);
        }
        if let Some(function) = FunctionOfTwo::by_name(name) {
            return self.call_of_two(function, arguments, order, span);
        }
        let Some(function) = Function::by_any_name(name) else {
            let functions = FUNCTIONS.iter().map(|row| row.name);
            let functions = functions.chain(FUNCTIONS_OF_TWO.iter().map(|row| row.name));
            let functions = functions.chain(["delayed"]);
            let all: Vec<&str> =
                functions.chain(families::FAMILIES.iter().map(|row| row.name)).collect();
            let hint = match crate::spec::nearest(name, all.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("known are {}", all.join(", ")),
            };
            let message = format!("unknown function `{name}`");
            let diagnostic =
                Diagnostic::error(span, message).label("no function has this name").hint(hint);
            self.report(diagnostic);
            return None;
        };
        let [argument] = arguments else {
            self.wrong_arity(
                name,
                "one argument",
                arguments.len(),
                span,
                &format!("write `{name}(x)`"),
            );
            return None;
        };
        if let Some(order) = order {
            self.report(
                Diagnostic::error(order.site.0, format!("`{name}` has no order"))
                    .label("nothing may follow a semicolon here")
                    .hint(format!("write `{name}(x)`")),
            );
            return None;
        }
        let value = self.value(argument)?;
        let unit = match function.row().unit {
            UnitRule::Kept => value.unit,
            UnitRule::Dropped => Some(Unit::ONE),
            UnitRule::Power(over, under) => {
                value.unit.and_then(|unit| unit.power(num_rational::Ratio::new(over, under)))
            }
            UnitRule::Number => {
                let what = format!("the argument of `{name}`");
                self.require_number(value.unit, argument.site.0, &what);
                Some(Unit::ONE)
            }
        };
        let expr = self.graph.apply(function, value.expr);
        let outside = self.graph.as_number(value.expr).is_some_and(|x| {
            let result = (function.row().value)(x);
            !result.is_finite()
        });
        if outside {
            self.report(
                Diagnostic::error(span, format!("`{name}` is not defined here"))
                    .label("its argument is outside the domain")
                    .hint("correct the argument"),
            );
            return None;
        }
        Some(Value { expr, unit })
    }

    /// A function of two arguments, which have one unit.
    fn call_of_two(
        &mut self,
        function: &FunctionOfTwo,
        arguments: &[Expression],
        order: Option<&Expression>,
        span: Span,
    ) -> Option<Value> {
        let hint = format!("write `{}({})`", function.name, function.arguments);
        let ([first, second], None) = (arguments, order) else {
            self.wrong_arity(function.name, "two arguments", arguments.len(), span, &hint);
            return None;
        };
        let (a, b) = (self.value(first), self.value(second));
        let (a, b) = (a?, b?);
        let mut unit = None;
        self.same_unit(&mut unit, a.unit, first.site.0);
        self.same_unit(&mut unit, b.unit, second.site.0);
        if self.graph.is_zero(a.expr) && self.graph.is_zero(b.expr) {
            self.report(
                Diagnostic::error(span, format!("`{}` is not defined here", function.name))
                    .label("both arguments are zero")
                    .hint("correct the arguments"),
            );
            return None;
        }
        let expr = (function.build)(&mut self.graph, a.expr, b.expr);
        Some(Value { expr, unit: Some(Unit::ONE) })
    }

    pub(super) fn wrong_arity(
        &mut self,
        name: &str,
        wants: &str,
        has: usize,
        span: Span,
        hint: &str,
    ) {
        let message = format!("`{name}` takes {wants}");
        let label = match has {
            0 => "none is given".to_string(),
            1 => "one is given".to_string(),
            _ => format!("{has} are given"),
        };
        self.report(Diagnostic::error(span, message).label(label).hint(hint));
    }
}
