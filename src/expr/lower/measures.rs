//! What columns show that is no part of the state: by the model, and on any curve.

use super::super::functions::FunctionOfTwo;
use super::super::graph::{Expr, Symbol};
use super::super::system::{Measure as SystemMeasure, Place, Variable};
use super::super::unit::Unit;
use super::terms::holds_span;
use super::value::Value;
use super::{Context, Lowering};
use crate::diagnostic::{Diagnostic, Span};
use crate::spec::ast::{Expression, ExpressionKind};
use crate::spec::resolve::{Meaning, Measure, Resolved};

/// A whole turn.
const TURN: f64 = std::f64::consts::TAU;

impl Lowering<'_> {
    /// All `measure` statements, as known parts of sensors that show nothing else.
    ///
    /// They are lowered after what moves, whose rates they may name.
    pub(super) fn measures(&mut self) {
        let resolved = self.resolved;
        self.effect = None;
        for (i, measure) in resolved.measures.iter().enumerate() {
            if let Some(span) = holds_span(measure.value) {
                self.report(
                    Diagnostic::error(span, "what a column shows is no function space")
                        .label("span{ } stands in a measure")
                        .hint("write unknown numbers in it as `param`s"),
                );
                continue;
            }
            self.context = Context::Sensor;
            let Some(value) = self.measure_value(i, measure.value) else { continue };
            self.require_state(value.expr, measure);
            self.require_angle(value.unit, measure);
            self.require_finite(value.expr, measure.value.site.0);
            let place = Place::Sensor(2 * self.coordinates.len() + i);
            self.known.push((place, value, measure.value.site.0));
        }
    }

    /// The expression of a measure, which may name those before it.
    fn measure_value(&mut self, i: usize, expression: &Expression) -> Option<Value> {
        let outer = self.measuring.replace(i);
        let value = self.value(expression);
        self.measuring = outer;
        value
    }

    /// What the name of a measure stands for: in a measure behind it, and in what its instrument
    /// adds.
    pub(super) fn measured(&mut self, i: usize, name: &str, span: Span) -> Option<Value> {
        if !matches!(self.context, Context::Sensor | Context::Curve) {
            self.report(
                Diagnostic::error(span, format!("`{name}` is what a column shows"))
                    .label("nothing moves by it")
                    .hint("write what it is made of, or give that a name with `let`"),
            );
            return None;
        }
        if self.measuring.is_some_and(|outer| i >= outer) {
            self.no_value_yet(name, span);
            return None;
        }
        let measure = self.resolved.measures.get(i)?;
        let value = self.measure_value(i, measure.value)?;
        Some(Value { unit: self.measure_unit(i).or(value.unit), ..value })
    }

    /// That what a column shows depends on what moves.
    fn require_state(&mut self, expr: Expr, measure: &Measure) {
        let of_state = |s: &Symbol| matches!(s, Symbol::Coordinate(_) | Symbol::Momentum(_));
        if self.graph.symbols(&[expr]).iter().any(of_state) {
            return;
        }
        self.report(
            Diagnostic::error(
                measure.value.site.0,
                format!("`{}` shows nothing of the motion", measure.name.text),
            )
            .label("no coordinate and no momentum stands here")
            .hint("take the measure away, or declare an `input` if it drives the motion"),
        );
    }

    /// That what is wrapped is an angle.
    fn require_angle(&mut self, unit: Option<Unit>, measure: &Measure) {
        let declared = measure.unit.and_then(|text| self.unit(Some(text)));
        let Some(unit) = declared.or(unit).filter(|_| self.resolved.is_wrapped(measure)) else {
            return;
        };
        if unit.same_kind(Unit::ONE) {
            return;
        }
        let name = &measure.name.text;
        self.report(
            Diagnostic::error(
                measure.name.site.0,
                format!("units clash: `{name}` is in [{unit}], and only an angle is wrapped"),
            )
            .label("whole turns are lost of it")
            .hint("declare it in [rad], or take `wrapped` away"),
        );
    }

    /// Says that a measure, or what its instrument adds, is not in its unit.
    pub(super) fn measure_clash(&mut self, i: usize, (unit, own): (Unit, Unit), span: Span) {
        let Some(measure) = self.resolved.measures.get(i) else { return };
        let name = &measure.name.text;
        let hint = if unit.same_kind(own) {
            "declare it in the unit of its expression; the data block says what the column is in"
        } else {
            "correct a unit, or give a number in it the one that is missing"
        };
        let message = format!("units clash: this is in [{unit}], but `{name}` is in [{own}]");
        self.report(
            Diagnostic::error(span, message)
                .label(format!("in [{unit}]"))
                .hint(hint)
                .related(measure.name.site.0, "declared here"),
        );
    }

    /// The unit of a measure: as it was declared.
    pub(super) fn measure_unit(&self, i: usize) -> Option<Unit> {
        Unit::parse(&self.resolved.measures.get(i)?.unit?.text).ok()
    }

    /// The measures as the system has them, once all names are known.
    pub(super) fn measures_of_system(&mut self) -> Vec<SystemMeasure> {
        let resolved = self.resolved;
        let n = self.coordinates.len();
        let mut out = Vec::with_capacity(resolved.measures.len());
        for (i, measure) in resolved.measures.iter().enumerate() {
            let known = |(place, ..): &&(Place, Value, Span)| *place == Place::Sensor(2 * n + i);
            let of = self.known.iter().find(known).and_then(|(_, value, _)| value.unit);
            let unit = self.measure_unit(i).or(of);
            let turn = || TURN / unit.map_or(1.0, |unit| unit.scale);
            // What is wrong with it was said when it was lowered by the model.
            let said = self.diagnostics.len();
            self.context = Context::Curve;
            let on_curve = self.measure_value(i, measure.value).map(|value| value.expr);
            let direction = self.arguments_of_direction(measure.value);
            self.diagnostics.truncate(said);
            out.push(SystemMeasure {
                variable: Variable {
                    name: measure.name.text.clone(),
                    unit,
                    unit_text: (measure.unit.map(|text| text.text.clone()))
                        .or_else(|| unit.map(|unit| unit.to_string())),
                },
                text: measure.value.to_string(),
                period: resolved.is_wrapped(measure).then(turn),
                on_curve,
                direction,
            });
        }
        out
    }

    /// The arguments of atan2, where an expression is that.
    fn arguments_of_direction(&mut self, expression: &Expression) -> Option<[Expr; 2]> {
        let ExpressionKind::Call { name, arguments, .. } = &expression.kind else { return None };
        let [y, x] = arguments.as_slice() else { return None };
        let turns = FunctionOfTwo::by_name(name).is_some_and(|function| function.turns);
        Some([self.value(y)?.expr, self.value(x)?.expr]).filter(|_| turns)
    }

    /// d/dt along a curve; `None` for more than an acceleration.
    pub(super) fn rate_on_curve(&mut self, expr: Expr, symbols: &[Symbol]) -> Option<Expr> {
        let n = self.coordinates.len();
        let mut parts = vec![(1.0, self.rate_of_driver(expr))];
        for &symbol in symbols {
            let rate = match symbol {
                Symbol::Coordinate(i) => Symbol::Velocity(i),
                Symbol::Velocity(i) if i < n => Symbol::Velocity(n + i),
                Symbol::Momentum(i) if i < n => Symbol::Momentum(n + i),
                Symbol::Velocity(_) | Symbol::Momentum(_) => return None,
                _ => continue,
            };
            let slope = self.graph.derivative(expr, symbol);
            let rate = self.graph.symbol(rate);
            parts.push((1.0, self.graph.multiply(slope, rate)));
        }
        Some(self.graph.linear(0.0, &parts))
    }
}

impl Resolved<'_> {
    /// Whether whole turns of a measure are lost: it says so, or is what atan2 gives.
    pub(crate) fn is_wrapped(&self, measure: &Measure) -> bool {
        let before = (self.constants.len(), self.measures.len());
        measure.wrapped || self.is_direction(measure.value, before)
    }

    /// Whether an expression is an angle of atan2, but for what is added to it. Names stand for
    /// the definitions and the measures before some places in their lists.
    fn is_direction(&self, expression: &Expression, before: (usize, usize)) -> bool {
        match &expression.kind {
            ExpressionKind::Call { name, .. } => {
                FunctionOfTwo::by_name(name).is_some_and(|f| f.turns)
            }
            ExpressionKind::Negate(inner) => self.is_direction(inner, before),
            ExpressionKind::Sum(parts) => {
                parts.iter().any(|(_, part)| self.is_direction(part, before))
            }
            ExpressionKind::Name(name) => {
                let (named, before) = match self.names.get(name) {
                    Some(&(Meaning::Constant(i), _)) if i < before.0 => {
                        (self.constants.get(i).map(|constant| constant.value), (i, before.1))
                    }
                    Some(&(Meaning::Measure(i), _)) if i < before.1 => (
                        self.measures.get(i).map(|measure| measure.value),
                        (self.constants.len(), i),
                    ),
                    _ => return false,
                };
                named.is_some_and(|named| self.is_direction(named, before))
            }
            _ => false,
        }
    }
}
