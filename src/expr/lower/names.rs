//! Names in expressions: which quantity each one stands for, and where it may stand.

use super::super::graph::Symbol;
use super::super::system::{InputVariable, Variable};
use super::super::unit::Unit;
use super::units::at;
use super::value::Value;
use super::{Context, Lowering, Named};
use crate::diagnostic::{Diagnostic, Span};
use crate::spec::ast::{EnergyPart, Expression, ExpressionKind, Role};
use crate::spec::resolve::{Input, Meaning};

impl Lowering<'_> {
    /// The inputs of the spec, with their units.
    pub(super) fn input_variables(&self) -> Vec<InputVariable> {
        let variable = |(input, unit): (&Input, &Option<Unit>)| InputVariable {
            own: false,
            variable: Variable {
                name: input.name.text.clone(),
                unit: *unit,
                unit_text: input.unit.map(|unit| unit.text.clone()),
            },
            between: input.between.interpolation,
        };
        self.resolved.inputs.iter().zip(&self.inputs).map(variable).collect()
    }

    pub(super) fn named(&mut self, name: &str, span: Span) -> Option<Value> {
        if let Some(&(_, value)) = self.indices.iter().rev().find(|(index, _)| index == name) {
            let expr = self.graph.number(value as f64);
            return Some(Value { expr, unit: (value != 0).then_some(Unit::ONE) });
        }
        if name == "pi" {
            let expr = self.graph.number(std::f64::consts::PI);
            return Some(Value { expr, unit: Some(Unit::ONE) });
        }
        let resolved = self.resolved;
        let named = |named: Named| Value { expr: named.expr, unit: named.unit };
        match resolved.names.get(name).map(|&(meaning, _)| meaning) {
            Some(Meaning::Variable(role, i)) => self.variable(role, i, name, span),
            Some(Meaning::Time) if self.context != Context::Number => {
                Some(Value { expr: self.graph.symbol(Symbol::Time), unit: self.time })
            }
            Some(Meaning::Input(i)) if self.context != Context::Number => {
                let unit = self.inputs.get(i).copied().flatten();
                Some(Value { expr: self.graph.symbol(Symbol::Input(i, 0)), unit })
            }
            Some(Meaning::Measure(i)) => self.measured(i, name, span),
            Some(Meaning::Parameter(i)) if self.context != Context::Number => {
                self.parameters.get(i).copied().flatten().map(named)
            }
            Some(Meaning::Constant(i))
                if resolved.definitions.get(i).copied().flatten().is_some() =>
            {
                self.defined(i, name, span)
            }
            Some(Meaning::Constant(i)) => match self.constants.get(i) {
                Some(constant) => constant.map(named),
                None => {
                    self.no_value_yet(name, span);
                    None
                }
            },
            Some(Meaning::Family { first, count, .. }) => {
                self.report(
                    Diagnostic::error(span, format!("`{name}` stands for {count} variables"))
                        .label("an index is missing")
                        .hint(format!("write for example `{name}[{first}]`, or `{name}[i]` with `for i in {first}..{}`", first + count as i64 - 1)),
                );
                None
            }
            Some(Meaning::Body(_)) => {
                self.report(
                    Diagnostic::error(span, format!("`{name}` is a body, not a quantity"))
                        .label("it stands for all its coordinates")
                        .hint("write one of its coordinates; only effects act on whole bodies"),
                );
                None
            }
            Some(_) => {
                self.report(
                    Diagnostic::error(span, format!("`{name}` is not a known number"))
                        .label("a known number is needed here")
                        .hint("write numbers and constants only"),
                );
                None
            }
            None if resolved.lost_names => None,
            None => {
                let hint = resolved.hint_for(name, &["pi"]);
                self.report(
                    Diagnostic::error(span, format!("unknown name `{name}`"))
                        .label("nothing has this name")
                        .hint(hint),
                );
                None
            }
        }
    }

    /// What `let` put in the place of a name.
    fn defined(&mut self, i: usize, name: &str, span: Span) -> Option<Value> {
        if self.defining.is_some_and(|outer| i >= outer) {
            self.no_value_yet(name, span);
            return None;
        }
        if self.context == Context::Number {
            self.report(
                Diagnostic::error(span, format!("`{name}` is not a known number"))
                    .label("a known number is needed here")
                    .hint("write numbers and constants only"),
            );
            return None;
        }
        let constant = self.resolved.constants.get(i)?;
        let outer = self.defining.replace(i);
        let indices = std::mem::take(&mut self.indices);
        let value = self.value(constant.value);
        (self.defining, self.indices) = (outer, indices);
        value
    }

    pub(super) fn no_value_yet(&mut self, name: &str, span: Span) {
        self.report(
            Diagnostic::error(span, format!("`{name}` has no value yet"))
                .label("used before it is defined")
                .hint("move its definition up"),
        );
    }

    /// That every name in an expression stands for something, wherever it is used.
    pub(super) fn require_names(&mut self, expression: &Expression) {
        if let ExpressionKind::Name(name) | ExpressionKind::Index { name, .. } = &expression.kind
            && name != "pi"
            && !self.resolved.names.contains_key(name)
        {
            self.named(name, expression.site.0);
        }
        for part in expression.parts() {
            self.require_names(part);
        }
    }

    pub(super) fn indexed(&mut self, name: &str, index: &Expression, span: Span) -> Option<Value> {
        let resolved = self.resolved;
        let index = self.integer(index);
        match resolved.names.get(name).map(|&(meaning, _)| meaning) {
            Some(Meaning::Family { role, first, start, count }) => {
                let index = index?;
                let place = index.checked_sub(first).and_then(|i| usize::try_from(i).ok());
                match place.filter(|&place| place < count) {
                    Some(place) => self.variable(role, start + place, name, span),
                    None => {
                        let last = first + count as i64 - 1;
                        let label =
                            self.where_indices(&format!("`{name}[{index}]` does not exist"));
                        self.report(
                            Diagnostic::error(span, format!("the index {index} is out of range"))
                                .label(label)
                                .hint(format!("`{name}` has the indices {first}..{last}")),
                        );
                        None
                    }
                }
            }
            Some(_) => {
                self.report(
                    Diagnostic::error(span, format!("`{name}` has no index"))
                        .label("it is a single quantity")
                        .hint(format!("write `{name}`; a unit needs a space before its bracket")),
                );
                None
            }
            None if resolved.lost_names => None,
            None => {
                let hint = resolved.hint_for(name, &[]);
                self.report(
                    Diagnostic::error(span, format!("unknown name `{name}`"))
                        .label("nothing has this name")
                        .hint(hint),
                );
                None
            }
        }
    }

    fn where_indices(&self, label: &str) -> String {
        if self.indices.is_empty() {
            return label.to_string();
        }
        let values: Vec<String> =
            self.indices.iter().map(|(name, value)| format!("{name} = {value}")).collect();
        format!("{label} ({})", values.join(", "))
    }

    fn variable(&mut self, role: Role, i: usize, name: &str, span: Span) -> Option<Value> {
        let misplaced = |message: String, label: &str, hint: &str| {
            Diagnostic::error(span, message).label(label).hint(hint)
        };
        let energy_hint = "write `H = ...` for an energy that mixes coordinates and momenta";
        if role == Role::Velocities && matches!(self.context, Context::Sensor | Context::Rate) {
            return self.velocity(i);
        }
        match (self.context, role) {
            (Context::Velocities(_) | Context::Curve, Role::Velocities) => {
                return Some(self.own_velocity(i));
            }
            (Context::Force, Role::Velocities) => return self.velocity_in_force(i, name, span),
            _ => {}
        }
        let problem = match (self.context, role) {
            (Context::Number, _) => Some(misplaced(
                format!("`{name}` is not a known number"),
                "a known number is needed here",
                "write numbers and constants only",
            )),
            (_, Role::Velocities) => {
                let momentum = self.resolved.momenta.get(i).map_or("p", |own| own.name.as_str());
                let label = format!("the state holds its momentum `{momentum}`");
                let hint = format!("write it with `{momentum}`; the velocity follows as dH/dp");
                Some(misplaced(
                    format!("the velocity `{name}` is not part of the state"),
                    &label,
                    &hint,
                ))
            }
            (Context::Velocities(part), Role::Momenta) => Some(misplaced(
                format!("{} depends on a velocity and on the momentum `{name}`", part.letter()),
                "a momentum",
                "write it with velocities alone, `rate(x)` for that of `x`, or `H = ...` of momenta",
            )),
            (Context::Energy(EnergyPart::Kinetic), Role::Coordinates) => Some(misplaced(
                format!("T depends on the coordinate `{name}`"),
                "a coordinate",
                energy_hint,
            )),
            (Context::Energy(EnergyPart::Potential), Role::Momenta) => Some(misplaced(
                format!("V depends on the momentum `{name}`"),
                "a momentum",
                energy_hint,
            )),
            _ => None,
        };
        if let Some(problem) = problem {
            self.report(problem);
            return None;
        }
        let (symbol, unit) = match role {
            Role::Coordinates => (Symbol::Coordinate(i), at(&self.coordinates, i)),
            _ => (Symbol::Momentum(i), at(&self.momenta, i)),
        };
        Some(Value { expr: self.graph.symbol(symbol), unit })
    }
}
