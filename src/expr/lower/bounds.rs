//! Constraints: signs and bounds of coefficients and parameters, by name.

use std::collections::HashMap;

use super::super::system::{Bounds, Parameter, Place, Term};
use super::Lowering;
use crate::diagnostic::{Diagnostic, Span};
use crate::spec::ast::*;
use crate::spec::nearest;
use crate::spec::resolve::{Constraint, Meaning};

/// What a constraint speaks of.
enum Bounded {
    Terms(Vec<usize>),
    Parameter(usize),
}

impl<'a> Lowering<'a> {
    /// Applies every `constrain` statement.
    pub(super) fn constrain(
        &mut self,
        terms: &mut [Term],
        parameters: &mut [(Parameter, Vec<f64>)],
    ) {
        for constraint in
            self.resolved.constraints.iter().filter(|one| !self.resolved.is_holonomic(one))
        {
            self.one_constraint(constraint, terms, parameters);
        }
    }

    /// A coefficient shares its name with no variable and no other one of its span.
    pub(super) fn unique_names(&mut self) {
        for items in self.spans() {
            let mut seen: HashMap<&str, Span> = HashMap::new();
            for word in items.iter().filter_map(|item| item.name.as_ref()) {
                let taken = self.resolved.names.get(&word.text).map(|&(_, span)| span);
                let first = taken.or_else(|| seen.get(word.text.as_str()).copied());
                seen.entry(&word.text).or_insert(word.site.0);
                if let Some(first) = first {
                    self.report(
                        Diagnostic::error(
                            word.site.0,
                            format!("the name `{}` is taken", word.text),
                        )
                        .label("named again here")
                        .hint("give every coefficient of one span a name of its own")
                        .related(first, "first named here"),
                    );
                }
            }
        }
    }

    /// Every span of the spec, in the order of the text.
    pub(super) fn spans(&self) -> Vec<&'a [Item]> {
        let resolved = self.resolved;
        let energies = resolved.energies.iter().map(|energy| energy.value);
        let forces = resolved.forces.iter().map(|force| force.value);
        let sensors = resolved.sensors.iter().map(|sensor| sensor.value);
        let mut stack: Vec<&'a Expression> = energies.chain(forces).chain(sensors).collect();
        stack.reverse();
        let mut out: Vec<&'a [Item]> = Vec::new();
        while let Some(expression) = stack.pop() {
            match &expression.kind {
                ExpressionKind::Sum(parts) => {
                    stack.extend(parts.iter().rev().map(|(_, part)| part))
                }
                ExpressionKind::Negate(inner) => stack.push(inner),
                ExpressionKind::Span(items) => out.push(items),
                _ => {}
            }
        }
        out
    }

    fn one_constraint(
        &mut self,
        constraint: &Constraint,
        terms: &mut [Term],
        parameters: &mut [(Parameter, Vec<f64>)],
    ) {
        let &Constraint { first, rest, span } = constraint;
        let operands: Vec<&Operand> =
            std::iter::once(first).chain(rest.iter().map(|(_, operand)| operand)).collect();
        let middle = usize::from(operands.len() == 3);
        let at = if operands.len() == 3 {
            1
        } else {
            let is = |at: usize| operands.get(at).is_some_and(|one| self.is_target(one));
            usize::from(!is(0) && is(1))
        };
        let target = operands.get(at).and_then(|one| self.target(one, terms, parameters));
        let Some(target) = target else { return };
        let mut bounds = Bounds::FREE;
        for (i, (relation, _)) in rest.iter().enumerate() {
            // Each relation stands between operand i and i + 1; one of them is the target.
            let (other, flipped) = if i + 1 == at || (middle == 1 && i == 0) {
                (operands.get(i), true)
            } else {
                (operands.get(i + 1), false)
            };
            let Some(Operand::Value(value)) = other else {
                self.report(
                    Diagnostic::error(span, "a constraint compares with numbers")
                        .label("two unknowns are compared here")
                        .hint("write for example `constrain k >= 0`"),
                );
                return;
            };
            let Some((number, ..)) = self.number(value) else { return };
            match (relation, flipped) {
                (Relation::Less | Relation::LessOrEqual, false)
                | (Relation::Greater | Relation::GreaterOrEqual, true) => {
                    bounds.upper = bounds.upper.min(number);
                }
                (Relation::Greater | Relation::GreaterOrEqual, false)
                | (Relation::Less | Relation::LessOrEqual, true) => {
                    bounds.lower = bounds.lower.max(number);
                }
                (Relation::Equal, _) => bounds = Bounds { lower: number, upper: number },
                (Relation::Unequal, _) => {
                    self.report(
                        Diagnostic::error(span, "`!=` bounds nothing")
                            .label("not a bound")
                            .hint("write `<=` or `>=`"),
                    );
                    return;
                }
            }
        }
        let mut empty = bounds.lower > bounds.upper;
        let mut narrow = |old: &mut Bounds| {
            old.lower = old.lower.max(bounds.lower);
            old.upper = old.upper.min(bounds.upper);
            empty |= old.lower > old.upper;
        };
        match target {
            Bounded::Terms(list) => {
                let all = terms.iter_mut().enumerate();
                all.filter(|(k, _)| list.contains(k)).for_each(|(_, one)| narrow(&mut one.bounds));
            }
            Bounded::Parameter(i) => {
                let Some((parameter, starts)) = parameters.get_mut(i) else { return };
                narrow(&mut parameter.bounds);
                if !empty {
                    let bounds = parameter.bounds;
                    starts.iter_mut().for_each(|start| *start = bounds.clamp(*start));
                    parameter.start = bounds.clamp(parameter.start);
                }
            }
        }
        if empty {
            self.report(
                Diagnostic::error(span, "no number satisfies this constraint")
                    .label("with the bounds given elsewhere, nothing is left")
                    .hint("widen the bounds"),
            );
        }
    }

    /// Whether an operand is a name that may be bounded, and no number.
    fn is_target(&self, operand: &Operand) -> bool {
        match operand {
            Operand::Terms(..) => true,
            Operand::Value(value) => match &value.kind {
                ExpressionKind::Name(name) | ExpressionKind::Index { name, .. } => {
                    let meaning = self.resolved.names.get(name).map(|&(meaning, _)| meaning);
                    let number = matches!(meaning, Some(Meaning::Constant(_)));
                    !number && name != "pi"
                }
                _ => false,
            },
        }
    }

    fn target(
        &mut self,
        operand: &Operand,
        terms: &[Term],
        parameters: &[(Parameter, Vec<f64>)],
    ) -> Option<Bounded> {
        let value = match operand {
            Operand::Value(value) => value,
            Operand::Terms(target, _) => {
                let place = match target {
                    Target::Energy(EnergyPart::Kinetic) => Place::Kinetic,
                    // The terms of L are functions of coordinates: they stand in V.
                    Target::Energy(EnergyPart::Potential | EnergyPart::Lagrangian) => {
                        Place::Potential
                    }
                    Target::Energy(EnergyPart::Hamiltonian) => Place::Hamiltonian,
                    Target::Force(coordinate) => {
                        self.context = super::Context::Force;
                        Place::Force(self.coordinate(coordinate)?)
                    }
                };
                let all = terms.iter().enumerate().filter(|(_, one)| one.part(place).is_some());
                return Some(Bounded::Terms(all.map(|(k, _)| k).collect()));
            }
        };
        let (name, wanted) = match &value.kind {
            ExpressionKind::Name(name) => (name, None),
            ExpressionKind::Index { name, index } => {
                let index = self.integer(index)?;
                (name, Some(format!("{name}[{index}]")))
            }
            _ => {
                self.report(
                    Diagnostic::error(
                        value.site.0,
                        "a constraint speaks of one coefficient or parameter",
                    )
                    .label("this is neither")
                    .hint("write for example `constrain k >= 0`, or `constrain terms of T >= 0`"),
                );
                return None;
            }
        };
        if let Some(i) = parameters.iter().position(|(parameter, _)| parameter.name == *name) {
            return Some(Bounded::Parameter(i));
        }
        let family = format!("{name}[");
        let named = |term: &Term| {
            term.name.as_ref().is_some_and(|own| match &wanted {
                Some(wanted) => own == wanted,
                None => own == name || own.starts_with(&family),
            })
        };
        let all = terms.iter().enumerate().filter(|(_, term)| named(term));
        let of_name: Vec<usize> = all.map(|(k, _)| k).collect();
        if !of_name.is_empty() {
            return Some(Bounded::Terms(of_name));
        }
        let shown = wanted.as_ref().unwrap_or(name);
        let known: Vec<&str> = terms
            .iter()
            .filter_map(|term| term.name.as_deref())
            .chain(parameters.iter().map(|(parameter, _)| parameter.name.as_str()))
            .collect();
        let hint = match nearest(shown, known.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => "name a coefficient in its span, as in `span{ k: q^2 }`".to_string(),
        };
        self.report(
            Diagnostic::error(
                value.site.0,
                format!("no coefficient or parameter is called `{shown}`"),
            )
            .label("unknown here")
            .hint(hint),
        );
        None
    }
}
