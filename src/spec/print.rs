//! The syntax tree as text of the mini-language, which parses back to the same tree.

use std::fmt::{self, Display, Formatter};

use super::ast::*;

/// Writes parts with a separator between them.
fn list<T: Display>(f: &mut Formatter, parts: &[T], separator: &str) -> fmt::Result {
    for (i, part) in parts.iter().enumerate() {
        if i > 0 {
            f.write_str(separator)?;
        }
        part.fmt(f)?;
    }
    Ok(())
}

impl Display for SyntaxTree {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        self.statements.iter().try_for_each(|statement| writeln!(f, "{statement}"))
    }
}

fn bracket(f: &mut Formatter, unit: &Option<UnitText>) -> fmt::Result {
    unit.iter().try_for_each(|unit| write!(f, " [{}]", unit.text))
}

fn equals(adds: bool) -> &'static str {
    if adds { "+=" } else { "=" }
}

impl Display for Statement {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match &self.kind {
            StatementKind::System(title) => write!(f, "system \"{}\"", title.text),
            StatementKind::Variables { role, list: declarations } => {
                write!(f, "{} ", role.keyword())?;
                list(f, declarations, ", ")
            }
            StatementKind::Time { name, unit } => {
                write!(f, "time {}", name.text)?;
                bracket(f, unit)
            }
            StatementKind::Input { name, unit, between } => {
                write!(f, "input {}", name.text)?;
                bracket(f, unit)?;
                write!(f, " {{ {} }}", between.interpolation)
            }
            StatementKind::Hidden(coordinate, momentum) => {
                write!(f, "hidden {coordinate}")?;
                momentum.iter().try_for_each(|momentum| write!(f, " with {momentum}"))
            }
            StatementKind::State { of, rate } => {
                write!(f, "state {of} {{ {}' = {rate} }}", of.name.text)
            }
            StatementKind::Data { file, items } => {
                write!(f, "data \"{}\"", file.text)?;
                if items.is_empty() {
                    return Ok(());
                }
                f.write_str(" { ")?;
                list(f, items, ", ")?;
                f.write_str(" }")
            }
            StatementKind::Constant { name, value, by_let } => {
                let word = if *by_let { "let" } else { "constant" };
                write!(f, "{word} {} = {value}", name.text)
            }
            StatementKind::Parameter { name, starts, per, bounds } => {
                write!(f, "param {}", name.text)?;
                per.iter().try_for_each(|per| write!(f, " per {}", ColumnName(per)))?;
                if !starts.is_empty() {
                    f.write_str(" = ")?;
                    list(f, starts, ", ")?;
                }
                bounds.iter().try_for_each(|bounds| write!(f, " in {bounds}"))
            }
            StatementKind::Energy { part, adds, value } => {
                write!(f, "{} {} {value}", part.letter(), equals(*adds))
            }
            StatementKind::Force { coordinate, adds, value, comprehension } => {
                write!(f, "force {coordinate} {} {value}", equals(*adds))?;
                comprehension.iter().try_for_each(|comprehension| write!(f, " {comprehension}"))
            }
            StatementKind::Sensor { observable, value, comprehension } => {
                write!(f, "sensor {observable} += {value}")?;
                comprehension.iter().try_for_each(|comprehension| write!(f, " {comprehension}"))
            }
            StatementKind::Measure { name, unit, value, wrapped } => {
                write!(f, "measure {}", name.text)?;
                bracket(f, unit)?;
                write!(f, " = {value}{}", if *wrapped { " { wrapped }" } else { "" })
            }
            StatementKind::Body { name, coordinates } => {
                write!(f, "body {} = (", name.text)?;
                list(f, coordinates, ", ")?;
                f.write_str(")")
            }
            StatementKind::Effect { name, arguments, settings } => {
                f.write_str("effect ")?;
                f.write_str(&name.text)?;
                if arguments.is_empty() && settings.is_empty() {
                    return Ok(());
                }
                f.write_str("(")?;
                list(f, arguments, ", ")?;
                f.write_str(if settings.is_empty() { "" } else { "; " })?;
                list(f, settings, ", ")?;
                f.write_str(")")
            }
            StatementKind::Candidates(candidates) => {
                f.write_str("candidates { ")?;
                list(f, candidates, "; ")?;
                f.write_str(if candidates.is_empty() { "}" } else { " }" })
            }
            StatementKind::Constrain { first, rest } => {
                write!(f, "constrain {first}")?;
                rest.iter()
                    .try_for_each(|(relation, operand)| write!(f, " {} {operand}", relation.sign()))
            }
        }
    }
}

impl Display for HiddenStart {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        f.write_str(&self.name.text)?;
        bracket(f, &self.unit)?;
        self.start.iter().try_for_each(|start| write!(f, " = {start}"))
    }
}

impl Display for Argument {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            Argument::Variable(variable) => variable.fmt(f),
            Argument::Body(variables, _) => {
                f.write_str("(")?;
                list(f, variables, ", ")?;
                f.write_str(")")
            }
        }
    }
}

impl Display for Setting {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        write!(f, "{} = {}", self.name.text, self.value)
    }
}

impl Display for Candidate {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        write!(f, "{}: ", self.name.text)?;
        list(f, &self.statements, "; ")
    }
}

impl Display for Declaration {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        f.write_str(&self.name.text)?;
        self.range.iter().try_for_each(|range| write!(f, "[{range}]"))?;
        bracket(f, &self.unit)
    }
}

impl Display for Range {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        write!(f, "{}..{}", self.first, self.last)
    }
}

impl Display for Limits {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        self.lower.iter().try_for_each(|lower| lower.fmt(f))?;
        f.write_str("..")?;
        self.upper.iter().try_for_each(|upper| upper.fmt(f))
    }
}

/// A column's name, in quotes so that any name can stand there.
struct ColumnName<'a>(&'a Word);

impl Display for ColumnName<'_> {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        write!(f, "\"{}\"", self.0.text)
    }
}

impl Display for DataItem {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match &self.kind {
            DataItemKind::Time { column, unit } => {
                write!(f, "time {}", ColumnName(column))?;
                bracket(f, unit)
            }
            DataItemKind::Every(period) => write!(f, "every {period}"),
            DataItemKind::Run(column) => write!(f, "run {}", ColumnName(column)),
            DataItemKind::Pairs => f.write_str("pairs"),
            DataItemKind::Column { variable, column, unit, error } => {
                write!(f, "{variable} = {}", ColumnName(column))?;
                bracket(f, unit)?;
                let Some(error) = error else { return Ok(()) };
                write!(f, " error {}", ColumnName(&error.column))?;
                bracket(f, &error.unit)
            }
            DataItemKind::NotMeasured(variable) => write!(f, "{variable} not measured"),
        }
    }
}

impl Display for Operand {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            Operand::Value(value) => value.fmt(f),
            Operand::Terms(Target::Energy(part), _) => write!(f, "terms of {}", part.letter()),
            Operand::Terms(Target::Force(variable), _) => write!(f, "terms of force {variable}"),
        }
    }
}

impl Display for Item {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        self.name.iter().try_for_each(|name| write!(f, "{}: ", name.text))?;
        self.body.fmt(f)?;
        self.comprehension.iter().try_for_each(|comprehension| write!(f, " {comprehension}"))?;
        if self.alike { f.write_str(" alike") } else { Ok(()) }
    }
}

impl Display for Comprehension {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        f.write_str("for ")?;
        list(f, &self.bindings, ", ")?;
        if !self.conditions.is_empty() {
            f.write_str(" where ")?;
            list(f, &self.conditions, " and ")?;
        }
        Ok(())
    }
}

impl Display for Binding {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        write!(f, "{} in {}", self.name.text, self.range)
    }
}

impl Display for Comparison {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        write!(f, "{} {} {}", self.left, self.relation.sign(), self.right)
    }
}

/// The production that an expression needs to stand in without parentheses.
#[derive(PartialEq, PartialOrd)]
enum Level {
    Sum,
    Term,
    Factor,
    Power,
    Quantity,
    Primary,
}

impl ExpressionKind {
    fn level(&self) -> Level {
        match self {
            ExpressionKind::Sum(_) => Level::Sum,
            ExpressionKind::Product(_) => Level::Term,
            ExpressionKind::Negate(_) => Level::Factor,
            ExpressionKind::Power(..) => Level::Power,
            ExpressionKind::Quantity(..) => Level::Quantity,
            _ => Level::Primary,
        }
    }
}

/// An expression in a place that asks for a level.
struct At<'a>(&'a Expression, Level);

impl Display for At<'_> {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        if self.0.kind.level() < self.1 { write!(f, "({})", self.0) } else { self.0.fmt(f) }
    }
}

impl Display for Expression {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match &self.kind {
            ExpressionKind::Number(value) if *value == 0.0 || (1e-5..1e16).contains(value) => {
                write!(f, "{value}")
            }
            ExpressionKind::Number(value) => write!(f, "{value:e}"),
            ExpressionKind::Name(name) => f.write_str(name),
            ExpressionKind::Index { name, index } => write!(f, "{name}[{index}]"),
            ExpressionKind::Slice { name, range } => write!(f, "{name}[{range}]"),
            ExpressionKind::Quantity(inner, unit) => {
                write!(f, "{} [{}]", At(inner, Level::Primary), unit.text)
            }
            ExpressionKind::Negate(inner) => write!(f, "-{}", At(inner, Level::Factor)),
            ExpressionKind::Sum(parts) => {
                for (i, (minus, part)) in parts.iter().enumerate() {
                    let sign = if *minus { " - " } else { " + " };
                    write!(f, "{}{}", if i == 0 { "" } else { sign }, At(part, Level::Term))?;
                }
                Ok(())
            }
            ExpressionKind::Product(parts) => {
                for (i, (divide, part)) in parts.iter().enumerate() {
                    let sign = if *divide { "/" } else { "*" };
                    write!(f, "{}{}", if i == 0 { "" } else { sign }, At(part, Level::Factor))?;
                }
                Ok(())
            }
            ExpressionKind::Power(base, exponent) => {
                write!(f, "{}^{}", At(base, Level::Quantity), At(exponent, Level::Factor))
            }
            ExpressionKind::Call { name, arguments, order } => {
                write!(f, "{name}(")?;
                list(f, arguments, ", ")?;
                order.iter().try_for_each(|order| write!(f, "; {order}"))?;
                f.write_str(")")
            }
            ExpressionKind::SumOver { body, comprehension } => {
                write!(f, "sum({body} {comprehension})")
            }
            ExpressionKind::Span(items) => {
                f.write_str("span{ ")?;
                list(f, items, ", ")?;
                f.write_str(" }")
            }
        }
    }
}
