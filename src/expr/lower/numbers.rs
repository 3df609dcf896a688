//! Known numbers of a spec: each may be off, and can be learned in the place where it stands.

use std::sync::Arc;

use super::extension::{Extension, Scope};
use super::substitution::{forget_constant, replaced, value_of};
use super::{Compiled, compiled};
use crate::diagnostic::Span;
use crate::error::{Error, ErrorKind, Result};
use crate::expr::graph::Symbol;
use crate::expr::system::{Bounds, Place, System, Term, Variable};
use crate::spec::ast::*;

/// A number that a spec says is known.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownNumber {
    /// `mass` where it is a constant of the spec, else what stands there: `0.3`, `sqrt`.
    pub name: String,
    /// Its value in the spec.
    pub value: f64,
    /// Where it stands in the text of the spec.
    pub span: Span,
    /// Line of that place, from 1.
    pub line: usize,
    /// Column of that place, from 1.
    pub column: usize,
    form: Form,
    /// Place of its statement.
    statement: usize,
    /// That statement.
    whole: Statement,
    /// What stands at its place.
    node: Expression,
}

/// How a number is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    /// The value of a `constant`.
    Constant,
    /// Digits in an expression, exponents of what is never negative among them.
    Literal,
    /// `sqrt(x)`, the exponent 1/2 of x.
    Root,
    /// An even exponent of what may be negative: x^2, as |x|^2.
    EvenExponent,
}

impl KnownNumber {
    /// `mass`, or `0.3 at 4:12`: what it is called among candidates.
    pub fn label(&self) -> String {
        match self.form {
            Form::Constant => self.name.clone(),
            Form::Root => format!("exponent of sqrt at {}:{}", self.line, self.column),
            Form::EvenExponent => {
                format!("exponent {} at {}:{}", self.value, self.line, self.column)
            }
            Form::Literal => format!("{} at {}:{}", self.value, self.line, self.column),
        }
    }

    /// Whether the spec gives it a name.
    pub fn is_named(&self) -> bool {
        self.form == Form::Constant
    }

    /// What is written in the place of [`KnownNumber::span`] for another value.
    fn written(&self, value: f64) -> Expression {
        let site = self.node.site;
        let number = Expression { kind: ExpressionKind::Number(value.abs()), site };
        let number = match value < 0.0 {
            true => Expression { kind: ExpressionKind::Negate(Box::new(number)), site },
            false => number,
        };
        self.with_value(number)
    }

    /// The node of the syntax tree with something in the place of the number.
    fn with_value(&self, value: Expression) -> Expression {
        let node = &self.node;
        let site = node.site;
        let power = |base: Expression, value: Expression| Expression {
            kind: ExpressionKind::Power(Box::new(base), Box::new(value)),
            site,
        };
        match (&node.kind, self.form) {
            (ExpressionKind::Call { arguments, .. }, Form::Root) => {
                let base = arguments.first().cloned().unwrap_or_else(|| node.clone());
                power(base, value)
            }
            (ExpressionKind::Power(base, _), Form::EvenExponent) => {
                let arguments = vec![Expression::clone(base)];
                let kind = ExpressionKind::Call { name: "abs".to_string(), arguments, order: None };
                power(Expression { kind, site }, value)
            }
            // The unit stays behind a number that stays a number.
            (ExpressionKind::Quantity(_, unit), _) if is_plain(&value) => {
                Expression { kind: ExpressionKind::Quantity(Box::new(value), unit.clone()), site }
            }
            _ => value,
        }
    }

    /// The text of a spec with another value in its place; `text` is that of the spec in which it
    /// was found.
    pub fn edited(&self, text: &str, value: f64) -> String {
        let new = in_place(&self.written(short(value)));
        // Powers of powers are read from the right.
        let raised =
            text.get(self.span.end..).is_some_and(|rest| rest.trim_start().starts_with('^'));
        let root = raised && self.form == Form::Root;
        let new = if root { format!("({new})") } else { new };
        crate::spec::edit::replace(text, self.span, &new)
    }

    /// Its statement with another value in its place, and in those of numbers that were freed
    /// before it.
    pub fn rewritten(&self, value: f64, freed: &[(&KnownNumber, f64)]) -> String {
        let mut statement = Statement::clone(&self.whole);
        if let Some(place) = value_of(&mut statement.kind) {
            let new = self.written(short(value));
            let of = |node: &Expression| match &node.kind {
                ExpressionKind::Name(name) => {
                    let known = freed.iter().find(|(number, _)| {
                        number.form != Form::Constant && number.free_name() == *name
                    })?;
                    Some(Expression {
                        kind: ExpressionKind::Number(short(known.1)),
                        ..node.clone()
                    })
                }
                _ => self.is(node).then(|| new.clone()),
            };
            *place = replaced(place, &of);
        }
        statement.to_string()
    }

    /// What it is called where it is free.
    fn free_name(&self) -> String {
        match self.form {
            Form::Constant => self.name.clone(),
            _ => format!("number_{}_{}", self.line, self.column),
        }
    }

    /// Its statement in a syntax tree, with something else at its place.
    fn statement_with(&self, spec: &SyntaxTree, new: &Expression) -> Option<Statement> {
        let mut statement = spec.statements.get(self.statement)?.clone();
        if let Some(value) = value_of(&mut statement.kind) {
            *value = replaced(value, &|node| self.is(node).then(|| new.clone()));
        }
        Some(statement)
    }

    fn is(&self, node: &Expression) -> bool {
        node.site.0 == self.span
            && match self.form {
                Form::Root => matches!(node.kind, ExpressionKind::Call { .. }),
                Form::EvenExponent => matches!(node.kind, ExpressionKind::Power(..)),
                Form::Constant | Form::Literal => is_literal(node),
            }
    }
}

impl Scope {
    /// The numbers that the text of the spec gives, in its order. Whole numbers in indices and
    /// ranges, exponents of momenta and those in sums of squares are none.
    pub fn numbers(&self) -> Vec<KnownNumber> {
        let compiled = self.compiled();
        let system = &compiled.system;
        let mut momenta: Vec<&str> = system.momenta.iter().map(root).collect();
        let of_momenta = momenta.len();
        momenta.extend(system.velocities.iter().map(root));
        momenta.push("rate");
        let mut out = Vec::new();
        let written = compiled.spec.statements.iter().take(compiled.written).enumerate();
        for (statement, whole) in written {
            let kind = &whole.kind;
            let mut add = |name: &str, value: f64, node: &Expression, form: Form| {
                let span = node.site.0;
                let (line, column) = span.line_and_column(&compiled.text);
                let (name, whole, node) = (name.to_string(), whole.clone(), node.clone());
                out.push(KnownNumber {
                    name,
                    value,
                    span,
                    line,
                    column,
                    form,
                    statement,
                    whole,
                    node,
                });
            };
            if let StatementKind::Constant { name, value, .. } = kind {
                if let Some(number) = literal(value) {
                    add(&name.text, number, value, Form::Constant);
                }
                continue;
            }
            let kinetic = matches!(kind, StatementKind::Energy { part: EnergyPart::Kinetic, .. });
            for value in values_of(kind) {
                // What an instrument adds may be any power of a velocity.
                let sensor = matches!(kind, StatementKind::Sensor { .. });
                let own = momenta.get(..of_momenta).filter(|_| sensor);
                let momenta = own.unwrap_or(&momenta);
                numbers_in(value, &Surroundings { kinetic, momenta }, &mut add);
            }
        }
        out.retain(|number| number.value != 0.0);
        out
    }

    /// The scope in which a number is an inner parameter, the last one, that starts at a value.
    ///
    /// # Errors
    /// The number cannot be learned where it stands: an index is made of it, say.
    pub fn freed(&self, number: &KnownNumber, start: f64) -> Result<Scope> {
        Ok(Scope::of(&self.with_free(number, start)?))
    }

    /// The scope in which a number has another value.
    ///
    /// # Errors
    /// The spec makes no sense with it.
    pub fn with_number(&self, number: &KnownNumber, value: f64) -> Result<Scope> {
        let base = self.compiled();
        let refused = || not_free(number);
        let new = number.written(value);
        let mut spec = base.spec.clone();
        let statement = number.statement_with(&spec, &new).ok_or_else(refused)?;
        if let Some(place) = spec.statements.get_mut(number.statement) {
            *place = statement;
        }
        let mut changed = compiled(&base.system.name, &base.text, spec, Vec::new(), None)?;
        changed.keep(base);
        Ok(Scope::of(&changed))
    }

    /// What freeing a number changes in the system, and the first-order change of the motion with
    /// it: a term whose coefficient is the change of the number. Learned terms that the number is
    /// in stand there with their coefficients as symbols. Expressions are of the extension.
    ///
    /// # Errors
    /// As [`Scope::freed`], or the number moves nothing.
    pub fn extension_of(&self, number: &KnownNumber) -> Result<(Extension, Term)> {
        let base = &self.compiled().system;
        let free = self.with_free(number, number.value)?;
        let starts = free.starts.last().cloned().unwrap_or_default();
        let mut system = Arc::unwrap_or_clone(free.system);
        let last = base.parameters.len();
        let same = system.terms.len() == base.terms.len() && system.parameters.len() == last + 1;
        let parameter = system.parameters.pop().filter(|_| same).ok_or_else(|| not_free(number))?;
        let symbol = Symbol::Parameter(last);
        let mut known = Vec::new();
        let mut slopes: Vec<(Place, Vec<(f64, crate::expr::Expr)>)> = Vec::new();
        let mut add = |place: Place, expr| match slopes.iter_mut().find(|(at, _)| *at == place) {
            Some((_, parts)) => parts.push((1.0, expr)),
            None => slopes.push((place, vec![(1.0, expr)])),
        };
        for (place, expr) in system.known_parts() {
            let slope = system.graph.derivative(expr, symbol);
            if !system.graph.is_zero(slope) {
                known.push((place, expr));
                add(place, slope);
            }
        }
        let mut terms = Vec::new();
        for (k, (term, standing)) in system.terms.iter().zip(&base.terms).enumerate() {
            let parts: Vec<_> = term.parts().collect();
            let mut moves = false;
            for (place, expr) in parts {
                let slope = system.graph.derivative(expr, symbol);
                if !system.graph.is_zero(slope) {
                    moves = true;
                    let coefficient = system.graph.symbol(Symbol::Coefficient(k));
                    add(place, system.graph.multiply(coefficient, slope));
                }
            }
            if moves {
                // It stays the term that it was: only what is in it has changed.
                let (expr, also) = (term.expr, term.also.clone());
                terms.push((k, Term { expr, also, ..standing.clone() }));
            }
        }
        let mut parts =
            slopes.into_iter().map(|(place, parts)| (place, system.graph.linear(0.0, &parts)));
        let (place, expr) = parts.next().ok_or_else(|| not_free(number))?;
        let probe = Term {
            place,
            expr,
            also: parts.collect(),
            effect: None,
            label: number.label(),
            name: None,
            bounds: Bounds::FREE,
            unit: None,
            unit_text: None,
        };
        let parameters = vec![(last, (parameter, starts))];
        let energy = free.energy_unit;
        let extension = Extension::of_number(system.graph, terms, parameters, known, energy, base);
        Ok((extension, probe))
    }

    /// The spec with a number as its last inner parameter.
    fn with_free(&self, number: &KnownNumber, start: f64) -> Result<Compiled> {
        let base = self.compiled();
        let refused = || not_free(number);
        let site = Site(number.span);
        let name = number.free_name();
        let named = Expression { kind: ExpressionKind::Name(name.clone()), site };
        let mut spec = base.spec.clone();
        let start = match number.form {
            Form::Constant | Form::Literal => number.written(start),
            _ => Expression { kind: ExpressionKind::Number(start), site },
        };
        if number.form == Form::Constant {
            forget_constant(&mut spec, &name);
        } else {
            let new = number.with_value(named);
            let statement = number.statement_with(&spec, &new).ok_or_else(refused)?;
            if let Some(place) = spec.statements.get_mut(number.statement) {
                *place = statement;
            }
        }
        let name = Word { text: name, site };
        let free = Some((name.text.clone(), number.value));
        let kind = StatementKind::Parameter { name, starts: vec![start], per: None, bounds: None };
        spec.statements.push(Statement { kind, site, effect: None });
        let mut changed = compiled(&base.system.name, &base.text, spec, Vec::new(), free)?;
        changed.keep(base);
        Ok(changed)
    }
}

impl Compiled {
    /// Takes over what does not depend on a number.
    fn keep(&mut self, base: &Compiled) {
        self.candidates.clone_from(&base.candidates);
        self.written = base.written;
        let mut system = System::clone(&self.system);
        system.name.clone_from(&base.system.name);
        // Terms keep their names: a number in them is not what they are called by.
        for (term, was) in system.terms.iter_mut().zip(&base.system.terms) {
            term.label.clone_from(&was.label);
        }
        // What runs have for themselves are inputs in both, or in none.
        let of_runs = base.system.inputs.iter().any(|input| input.own);
        let changed = of_runs.then(|| system.with_own_inputs()).flatten();
        self.system = Arc::new(changed.unwrap_or(system));
    }

    /// The same spec for a system in which what runs have for themselves are inputs.
    pub(crate) fn with_system(&self, system: &Arc<System>) -> Compiled {
        Compiled { system: system.clone(), ..self.clone() }
    }
}

fn not_free(number: &KnownNumber) -> Error {
    Error::new(
        ErrorKind::NotApplicable,
        format!("{} cannot be learned where it stands", number.label()),
        "write it as a `param` yourself",
    )
}

/// The expression of a statement in which numbers are looked for.
fn values_of(kind: &StatementKind) -> Vec<&Expression> {
    match kind {
        StatementKind::Constant { value, .. }
        | StatementKind::Energy { value, .. }
        | StatementKind::Force { value, .. }
        | StatementKind::Sensor { value, .. } => vec![value],
        _ => Vec::new(),
    }
}

/// A number as it is written, with its unit.
fn literal(expression: &Expression) -> Option<f64> {
    match &expression.kind {
        ExpressionKind::Number(value) => Some(*value),
        ExpressionKind::Quantity(inner, _) => literal(inner),
        ExpressionKind::Negate(inner) => literal(inner).map(|value| -value),
        _ => None,
    }
}

fn is_literal(expression: &Expression) -> bool {
    literal(expression).is_some()
}

/// A number without a unit.
fn is_plain(expression: &Expression) -> bool {
    match &expression.kind {
        ExpressionKind::Number(_) => true,
        ExpressionKind::Negate(inner) => is_plain(inner),
        _ => false,
    }
}

/// Text that can stand where a factor or an exponent stood.
fn in_place(expression: &Expression) -> String {
    match expression.kind {
        ExpressionKind::Negate(_) => format!("({expression})"),
        _ => expression.to_string(),
    }
}

/// What numbers are found in.
struct Surroundings<'a> {
    kinetic: bool,
    /// Names of momenta and velocities, and of families of them.
    momenta: &'a [&'a str],
}

/// Every number of an expression.
fn numbers_in(
    expression: &Expression,
    within: &Surroundings,
    add: &mut dyn FnMut(&str, f64, &Expression, Form),
) {
    match &expression.kind {
        ExpressionKind::Number(_) | ExpressionKind::Quantity(..) => {
            if let Some(value) = literal(expression) {
                add(&value.to_string(), value, expression, Form::Literal);
            }
        }
        ExpressionKind::Negate(inner) => numbers_in(inner, within, add),
        ExpressionKind::Sum(parts) => {
            let square = |(_, part): &&(bool, Expression)| is_square(part);
            let squares = parts.iter().filter(square).count();
            for (_, part) in parts {
                match &part.kind {
                    // A distance is no sum of other powers.
                    ExpressionKind::Power(base, _) if squares > 1 && is_square(part) => {
                        numbers_in(base, within, add);
                    }
                    _ => numbers_in(part, within, add),
                }
            }
        }
        ExpressionKind::Product(parts) => {
            parts.iter().for_each(|(_, part)| numbers_in(part, within, add));
        }
        ExpressionKind::Power(base, exponent) => {
            numbers_in(base, within, add);
            if within.kinetic || base.mentions(within.momenta) {
                return;
            }
            match literal(exponent) {
                _ if is_never_negative(base) => numbers_in(exponent, within, add),
                Some(value) if value % 2.0 == 0.0 => {
                    add(&value.to_string(), value, expression, Form::EvenExponent);
                }
                _ => {}
            }
        }
        ExpressionKind::Call { name, arguments, .. } => {
            if name == "sqrt" && arguments.len() == 1 && !within.kinetic {
                let inside = arguments.iter().any(|inside| inside.mentions(within.momenta));
                if !inside {
                    add("sqrt", 0.5, expression, Form::Root);
                }
            }
            arguments.iter().for_each(|argument| numbers_in(argument, within, add));
        }
        ExpressionKind::SumOver { body, .. } => numbers_in(body, within, add),
        ExpressionKind::Span(items) => {
            for item in items {
                // Families have an order, and it is no number of the law.
                let family = matches!(&item.body.kind, ExpressionKind::Call { order: Some(_), .. });
                if !family {
                    numbers_in(&item.body, within, add);
                }
            }
        }
        ExpressionKind::Name(_) | ExpressionKind::Index { .. } | ExpressionKind::Slice { .. } => {}
    }
}

/// The name of a variable, or that of its family.
fn root(variable: &Variable) -> &str {
    variable.name.split('[').next().unwrap_or_default()
}

fn is_square(expression: &Expression) -> bool {
    match &expression.kind {
        ExpressionKind::Power(_, exponent) => literal(exponent) == Some(2.0),
        _ => false,
    }
}

/// Whether an expression is positive or zero whatever the state is, as it is written.
fn is_never_negative(expression: &Expression) -> bool {
    match &expression.kind {
        ExpressionKind::Number(value) => *value >= 0.0,
        ExpressionKind::Quantity(inner, _) => is_never_negative(inner),
        ExpressionKind::Sum(parts) => {
            parts.iter().all(|(minus, part)| !minus && is_never_negative(part))
        }
        ExpressionKind::Product(parts) => parts.iter().all(|(_, part)| is_never_negative(part)),
        ExpressionKind::Power(base, exponent) => {
            literal(exponent).is_some_and(|value| value % 2.0 == 0.0) || is_never_negative(base)
        }
        ExpressionKind::Call { name, .. } => {
            matches!(name.as_str(), "sqrt" | "abs" | "exp" | "cosh")
        }
        _ => false,
    }
}

/// A number with the digits that a spec needs.
fn short(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value)
}
