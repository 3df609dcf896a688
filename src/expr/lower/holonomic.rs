//! Holonomic constraints: `constrain x^2 + y^2 == l^2`.

use super::super::graph::{Expr, Symbol};
use super::super::system::{Constraint, Term};
use super::{Context, Lowering};
use crate::diagnostic::{Diagnostic, Span};
use crate::spec::ast::{Expression, ExpressionKind};
use crate::spec::resolve::Holonomic;

impl Lowering<'_> {
    /// The equations between coordinates that every motion satisfies. They are lowered before what
    /// names the rates of momenta, which they change.
    pub(super) fn holonomic(&mut self) {
        self.context = Context::Force;
        for holonomic in self.resolved.holonomic() {
            let found = self.equation(&holonomic);
            self.constraints.extend(found);
        }
    }

    fn equation(&mut self, &Holonomic { left, right, span }: &Holonomic) -> Option<Constraint> {
        let parts = vec![(false, left.clone()), (true, right.clone())];
        let difference = Expression { kind: ExpressionKind::Sum(parts), site: left.site };
        let value = self.value(&difference)?;
        self.require_finite(value.expr, span);
        let internal = |i: usize| {
            self.resolved.hidden.iter().any(|part| part.coordinate == i && part.rate.is_some())
        };
        let symbols = self.graph.symbols(&[value.expr]);
        let allowed = |symbol: &Symbol| match symbol {
            Symbol::Coordinate(i) => !internal(*i),
            Symbol::Parameter(_) => true,
            _ => false,
        };
        if !symbols.iter().all(allowed) {
            self.report(
                Diagnostic::error(span, "a constraint on the motion is one of coordinates")
                    .label("something else stands in it")
                    .hint("name coordinates, numbers and parameters only"),
            );
            return None;
        }
        // A number that no derivative keeps moves nothing: the start of a run says where it moves.
        let slopes: Vec<Expr> = symbols
            .iter()
            .filter(|symbol| matches!(symbol, Symbol::Coordinate(_)))
            .map(|&symbol| self.graph.derivative(value.expr, symbol))
            .collect();
        let felt = self.graph.symbols(&slopes);
        let idle =
            |symbol: &&Symbol| matches!(symbol, Symbol::Parameter(_)) && !felt.contains(symbol);
        if symbols.iter().any(|symbol| idle(&symbol)) {
            self.report(
                Diagnostic::error(span, "a parameter of this constraint cannot be learned by it")
                    .label("it moves nothing: every run starts where the constraint holds")
                    .hint("write a number in its place, about what it is"),
            );
            return None;
        }
        if self.constraints.iter().any(|other| other.expr == value.expr) {
            self.report(
                Diagnostic::error(span, "this constraint stands there already")
                    .label("the same equation")
                    .hint("keep one of them"),
            );
            return None;
        }
        Some(Constraint { expr: value.expr, label: format!("{left} == {right}") })
    }

    /// What a constraint asks of the rest: masses that are known, and an equation of its own.
    pub(super) fn check_holonomic(&mut self, terms: &[Term]) {
        let Some(span) = self.resolved.holonomic().map(|one| one.span).reduce(Span::join) else {
            return;
        };
        let of_momenta = |symbol: &Symbol| matches!(symbol, Symbol::Momentum(_));
        let massive = terms.iter().filter(|term| term.effect.is_none()).any(|term| {
            let parts: Vec<_> = term.parts().filter(|(place, _)| place.is_energy()).collect();
            parts.iter().any(|&(_, expr)| self.graph.symbols(&[expr]).iter().any(of_momenta))
        });
        // The rates of the momenta say whether forces hold it.
        if !massive && self.flow.is_none() {
            self.flow();
        }
        if massive {
            self.report(
                Diagnostic::error(span, "the force of a constraint needs masses that are known")
                    .label("it divides by them")
                    .hint("write T without span{ }, an unknown mass as `param m = 1 in 0..`"),
            );
        }
    }

    /// Adds the forces that hold the constraints to the rates of the momenta; says so where there
    /// are none.
    pub(super) fn hold(&mut self, flow: &mut [(Symbol, Expr)]) {
        if self.constraints.is_empty() {
            return;
        }
        let held: Vec<Expr> = self.constraints.iter().map(|constraint| constraint.expr).collect();
        let (velocities, pushes): (Vec<_>, Vec<_>) =
            flow.iter().partition(|(symbol, _)| matches!(symbol, Symbol::Coordinate(_)));
        let rates = |list: Vec<(Symbol, Expr)>| list.into_iter().map(|(_, rate)| rate).collect();
        let (velocities, pushes): (Vec<Expr>, Vec<Expr>) = (rates(velocities), rates(pushes));
        match self.graph.holding_forces(&held, &velocities, &pushes) {
            Some(holding) => {
                let momenta = flow.iter_mut().skip(velocities.len());
                for ((_, rate), force) in momenta.zip(holding) {
                    *rate = self.graph.sum(&[*rate, force]);
                }
            }
            None => self.not_held(),
        }
    }

    fn not_held(&mut self) {
        let Some(span) = self.resolved.holonomic().map(|one| one.span).reduce(Span::join) else {
            return;
        };
        self.report(
            Diagnostic::error(span, "no forces hold these constraints")
                .label("they repeat one another, or name what has no mass")
                .hint("write each condition once, of coordinates that T gives a mass"),
        );
    }
}
