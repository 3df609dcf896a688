//! Indices: their whole numbers, and `for` over ranges of them.

use super::Lowering;
use super::terms::FoundTerm;
use super::value::Value;
use crate::diagnostic::{Diagnostic, Span};
use crate::expr::unit::Unit;
use crate::expr::{Expr, Place};
use crate::spec::ast::{Binding, Comparison, Comprehension, Expression, Item, Relation};
use crate::spec::families::FamilyRow;
use crate::spec::resolve::integer;

impl Lowering<'_> {
    /// The whole number that an index stands for; `None` after a diagnostic.
    pub(super) fn integer(&mut self, expression: &Expression) -> Option<i64> {
        let (indices, integers) = (&self.indices, &self.resolved.integers);
        let look_up = |name: &str| {
            let index = indices.iter().rev().find(|(index, _)| index == name).map(|&(_, i)| i);
            index.or_else(|| integers.get(name).copied())
        };
        match integer(expression, &look_up) {
            Ok(value) => Some(value),
            Err(diagnostic) => {
                self.report(diagnostic);
                None
            }
        }
    }

    /// Runs `body` for every combination of indices; `None` when a range is wrong.
    pub(super) fn each(
        &mut self,
        comprehension: &Comprehension,
        body: &mut dyn FnMut(&mut Self),
    ) -> Option<()> {
        let outside = self.indices.len();
        let done = self.bind(&comprehension.bindings, &comprehension.conditions, body);
        self.indices.truncate(outside);
        done
    }

    /// The terms of an item whose loop has one coefficient: the sum of all that it makes, and of a
    /// family one for each member.
    pub(super) fn alike(
        &mut self,
        (place, sign): (Place, f64),
        item: &Item,
        comprehension: &Comprehension,
        family: Option<(&FamilyRow, &[Expression], Option<&Expression>)>,
    ) -> Vec<FoundTerm> {
        /// Parts of a sum, and its unit.
        type Sum = (Vec<(f64, Expr)>, Option<(Unit, Span)>);
        let span = item.body.site.0;
        let mut sums: Vec<Sum> = Vec::new();
        self.each(comprehension, &mut |lowering| {
            let members = match family {
                Some((row, arguments, order)) => {
                    lowering.family(row, arguments, order, span).unwrap_or_default()
                }
                None => lowering.value(&item.body).into_iter().collect(),
            };
            sums.resize(sums.len().max(members.len()), Sum::default());
            for ((parts, unit), value) in sums.iter_mut().zip(members) {
                parts.push((1.0, value.expr));
                lowering.same_unit(unit, value.unit, span);
            }
        });
        let name = |member: usize| {
            let own = &item.name.as_ref()?.text;
            Some(if family.is_some() { format!("{own}[{}]", member + 1) } else { own.clone() })
        };
        let text = || {
            let sign = if sign < 0.0 { "-" } else { "" };
            family.is_none().then(|| format!("{sign}{} {comprehension} alike", item.body))
        };
        let found = |(member, (parts, unit)): (usize, Sum)| {
            let expr = self.graph.linear(0.0, &parts);
            let value = Value { expr, unit: unit.map(|(unit, _)| unit) };
            FoundTerm { place, value, sign, name: name(member), span, text: text() }
        };
        sums.into_iter().enumerate().map(found).collect()
    }

    fn bind(
        &mut self,
        bindings: &[Binding],
        conditions: &[Comparison],
        body: &mut dyn FnMut(&mut Self),
    ) -> Option<()> {
        let Some((binding, inner)) = bindings.split_first() else {
            for condition in conditions {
                let (left, right) =
                    (self.integer(&condition.left)?, self.integer(&condition.right)?);
                let holds = match condition.relation {
                    Relation::Less => left < right,
                    Relation::LessOrEqual => left <= right,
                    Relation::Greater => left > right,
                    Relation::GreaterOrEqual => left >= right,
                    Relation::Equal => left == right,
                    Relation::Unequal => left != right,
                };
                if !holds {
                    return Some(());
                }
            }
            body(self);
            return Some(());
        };
        let (first, last) = (self.integer(&binding.range.first), self.integer(&binding.range.last));
        let (first, last) = (first?, last?);
        if let Some(&(_, taken)) = self.resolved.names.get(&binding.name.text) {
            self.report(
                Diagnostic::error(
                    binding.name.site.0,
                    format!("the name `{}` is taken", binding.name.text),
                )
                .label("an index needs a name of its own")
                .hint("choose another letter")
                .related(taken, "named here"),
            );
            return None;
        }
        let mut index = first;
        while index <= last {
            self.step(binding.range.site.0)?;
            self.indices.push((binding.name.text.clone(), index));
            let done = self.bind(inner, conditions, body);
            self.indices.pop();
            done?;
            match index.checked_add(1) {
                Some(next) => index = next,
                None => break,
            }
        }
        Some(())
    }
}
