//! `delayed(u, delay)`: what an input was some time ago.

use super::super::graph::{Delay, Node, Number, Symbol};
use super::value::Value;
use super::{Context, Lowering};
use crate::data::Interpolation;
use crate::diagnostic::{Diagnostic, Span};
use crate::spec::ast::{Expression, ExpressionKind};
use crate::spec::resolve::Meaning;

/// How it is written.
const WRITTEN: &str = "write `delayed(u, 0.02)` for an input u, or with a `param` for the delay";

impl Lowering<'_> {
    /// An input some time ago; `None` after a diagnostic.
    pub(super) fn delayed(
        &mut self,
        arguments: &[Expression],
        order: Option<&Expression>,
        span: Span,
    ) -> Option<Value> {
        let ([of, by], None) = (arguments, order) else {
            self.wrong_arity("delayed", "an input and a time", arguments.len(), span, WRITTEN);
            return None;
        };
        if self.context == Context::Number {
            return self.value(of).and(None);
        }
        let resolved = self.resolved;
        let meaning = match &of.kind {
            ExpressionKind::Name(name) => resolved.names.get(name).map(|&(meaning, _)| meaning),
            _ => None,
        };
        let Some(Meaning::Input(input)) = meaning else {
            // An unknown name is told as such.
            self.value(of)?;
            self.report(
                Diagnostic::error(of.site.0, "only an input can be delayed")
                    .label("not an input")
                    .hint(WRITTEN),
            );
            return None;
        };
        let time = self.value(by)?;
        if let (Some(own), Some(wanted)) = (time.unit, self.time)
            && !own.agrees(wanted)
        {
            self.report(
                Diagnostic::error(
                    by.site.0,
                    format!("units clash: a delay is in [{wanted}], but this is in [{own}]"),
                )
                .label(format!("in [{own}]"))
                .hint("give it in the unit of the time"),
            );
            return None;
        }
        let delay = match *self.graph.node(time.expr) {
            Node::Number(number) if number.value() >= 0.0 => Delay::Number(number),
            Node::Number(Number { .. }) => {
                self.report(
                    Diagnostic::error(by.site.0, "this delay is below zero")
                        .label("an input cannot be known before it is there")
                        .hint("write a time of zero or more"),
                );
                return None;
            }
            Node::Symbol(Symbol::Parameter(j)) => Delay::Parameter(j),
            _ => {
                self.report(
                    Diagnostic::error(by.site.0, "a delay is a number or one parameter")
                        .label("neither of them")
                        .hint("declare a `param` for the whole delay"),
                );
                return None;
            }
        };
        if let Delay::Parameter(j) = delay {
            self.require_learnable(input, j, span)?;
        }
        let unit = self.inputs.get(input).copied().flatten();
        Some(Value { expr: self.graph.symbol(Symbol::Delayed(input, 0, delay)), unit })
    }

    /// That a delay can be found from data: one for all runs, of an input that does not jump.
    fn require_learnable(&mut self, input: usize, parameter: usize, span: Span) -> Option<()> {
        let resolved = self.resolved;
        let parameter = resolved.parameters.get(parameter)?;
        if parameter.per.is_some() {
            self.report(
                Diagnostic::error(span, format!("`{}` is not one delay", parameter.name.text))
                    .label("each run would have its own")
                    .hint("declare it without `per`"),
            );
            return None;
        }
        let input = resolved.inputs.get(input)?;
        if input.between.interpolation == Interpolation::Hold {
            let name = &input.name.text;
            self.report(
                Diagnostic::error(span, format!("the delay of `{name}` cannot be learned"))
                    .label("it jumps at every sample, and has no rate")
                    .hint("write the delay as a number, or say `linear` where it is declared")
                    .related(input.between.word.site.0, "said here"),
            );
            return None;
        }
        Some(())
    }
}
