//! What the instrument adds, rates of the state, and coefficients that several places share.

use std::collections::HashMap;

use super::super::graph::{Expr, Symbol};
use super::super::system::Place;
use super::super::unit::Unit;
use super::terms::{DraftTerm, TermPart};
use super::value::Value;
use super::{Context, Lowering};
use crate::diagnostic::{Diagnostic, Span};
use crate::spec::ast::{Expression, ExpressionKind, Role};
use crate::spec::resolve::{Meaning, Sensor};

impl Lowering<'_> {
    /// A `sensor` statement, for every combination of its indices.
    pub(super) fn sensor(&mut self, sensor: &Sensor) {
        let one = |lowering: &mut Self| {
            if let Some(i) = lowering.observable(sensor.observable) {
                lowering.side(Place::Sensor(i), sensor.value, false);
            }
        };
        match sensor.comprehension {
            Some(comprehension) => {
                self.each(comprehension, &mut { one });
            }
            None => one(self),
        }
    }

    /// The number of the observable that an expression names; `None` after a diagnostic.
    fn observable(&mut self, expression: &Expression) -> Option<usize> {
        let resolved = self.resolved;
        let meaning = |name: &String| resolved.names.get(name).map(|&(meaning, _)| meaning);
        // Whatever is wrong with the name itself is said by its value.
        self.value(expression)?;
        let found = match &expression.kind {
            ExpressionKind::Name(name) => match meaning(name) {
                Some(Meaning::Variable(role, i)) => Some((role, i)),
                Some(Meaning::Measure(i)) => return Some(2 * resolved.coordinates.len() + i),
                _ => None,
            },
            ExpressionKind::Index { name, index } => {
                let index = self.integer(index)?;
                match meaning(name) {
                    Some(Meaning::Family { role, first, start, .. }) => {
                        let place = index.checked_sub(first).and_then(|i| usize::try_from(i).ok());
                        place.map(|place| (role, start + place))
                    }
                    _ => None,
                }
            }
            _ => None,
        };
        let n = resolved.coordinates.len();
        match found {
            Some((Role::Coordinates, i)) => return Some(i),
            Some((Role::Velocities, i)) => return Some(n + i),
            Some((Role::Momenta, i)) if resolved.velocities.is_empty() => return Some(n + i),
            _ => {}
        }
        let second =
            if resolved.velocities.is_empty() { &resolved.momenta } else { &resolved.velocities };
        let names =
            resolved.coordinates.iter().chain(second).map(|declared| declared.name.as_str());
        let measures = resolved.measures.iter().map(|measure| measure.name.text.as_str());
        let names: Vec<&str> = names.chain(measures).take(8).collect();
        self.report(
            Diagnostic::error(expression.site.0, format!("`{expression}` is not observed"))
                .label("no instrument measures it")
                .hint(format!("observed are {}", names.join(", "))),
        );
        None
    }

    /// The unit of an observable.
    fn observable_unit(&self, i: usize) -> Option<Unit> {
        let n = self.coordinates.len();
        if let Some(measure) = i.checked_sub(2 * n) {
            return self.measure_unit(measure);
        }
        let second = if self.velocities.is_empty() { &self.momenta } else { &self.velocities };
        self.coordinates.get(i).or_else(|| second.get(i.checked_sub(n)?)).copied().flatten()
    }

    /// What an instrument is known to add is in the unit of its observable.
    pub(super) fn check_known_sensors(&mut self) {
        for (place, value, span) in self.known.clone() {
            let Place::Sensor(i) = place else { continue };
            let (Some(unit), Some(expected)) = (value.unit, self.observable_unit(i)) else {
                continue;
            };
            if !expected.agrees(unit) {
                if i >= 2 * self.coordinates.len() {
                    self.measure_clash(i - 2 * self.coordinates.len(), (unit, expected), span);
                    continue;
                }
                self.report(
                    Diagnostic::error(
                        span,
                        format!("units clash: this is in [{unit}], but the observable is in [{expected}]"),
                    )
                    .label(format!("in [{unit}]"))
                    .hint(format!("what is added to a reading has its unit; write for example `0.1 [{expected}]`")),
                );
            }
        }
    }

    /// `rate(x)`: the time derivative of a function of the state, by the model.
    pub(super) fn rate_of(
        &mut self,
        arguments: &[Expression],
        order: Option<&Expression>,
        span: Span,
    ) -> Option<Value> {
        let ([argument], None) = (arguments, order) else {
            self.wrong_arity("rate", "one argument", arguments.len(), span, "write `rate(x)`");
            return None;
        };
        if self.context == Context::Number {
            return self.value(argument).and(None);
        }
        let value = self.value(argument)?;
        let symbols = self.graph.symbols(&[value.expr]);
        let of_state = |s: &Symbol| matches!(s, Symbol::Coordinate(_) | Symbol::Momentum(_));
        let moves = symbols.iter().any(|s| of_state(s) || matches!(s, Symbol::Velocity(_)));
        match self.context {
            Context::Rate | Context::Velocities(_) | Context::Force => {
                self.require_velocity(&symbols, span)?;
            }
            Context::Energy(_) if moves => {
                self.report(
                    Diagnostic::error(span, "`rate` cannot stand here")
                        .label("V and H are functions of coordinates and momenta")
                        .hint("write T or L of velocities, or this with momenta"),
                );
                return None;
            }
            _ => {}
        }
        self.require_rates(&symbols, argument.site.0)?;
        if self.context == Context::Curve {
            let expr = self.rate_on_curve(value.expr, &symbols)?;
            return Some(Value { expr, unit: None });
        }
        // What the motion goes by has no part in the rate of what drives it.
        let expr = if matches!(self.context, Context::Velocities(_) | Context::Force) && moves {
            self.rate_by_velocities(value.expr, &symbols, span)?
        } else if symbols.iter().any(of_state) {
            self.rate(value.expr)
        } else {
            self.rate_of_driver(value.expr)
        };
        let unit = value.unit.zip(self.time).and_then(|(unit, time)| unit.over(time));
        Some(Value { expr, unit })
    }

    /// The velocity of coordinate i, dH/dp.
    pub(super) fn velocity(&mut self, i: usize) -> Option<Value> {
        let coordinate = self.graph.symbol(Symbol::Coordinate(i));
        let expr = self.rate(coordinate);
        Some(Value { expr, unit: self.velocities.get(i).copied().flatten() })
    }

    /// d/dt by the chain rule.
    fn rate(&mut self, expr: Expr) -> Expr {
        let flow = self.flow();
        let mut parts = vec![(1.0, self.rate_of_driver(expr))];
        for (symbol, rate) in flow {
            if self.graph.depends_on(expr, symbol) {
                let slope = self.graph.derivative(expr, symbol);
                parts.push((1.0, self.graph.multiply(slope, rate)));
            }
        }
        self.graph.linear(0.0, &parts)
    }

    /// The part of d/dt that comes from the time and the inputs.
    pub(super) fn rate_of_driver(&mut self, expr: Expr) -> Expr {
        let mut parts = vec![(1.0, self.graph.derivative(expr, Symbol::Time))];
        for symbol in self.graph.symbols(&[expr]) {
            if let Some(rate) = symbol.input_rate() {
                let slope = self.graph.derivative(expr, symbol);
                let rate = self.graph.symbol(rate);
                parts.push((1.0, self.graph.multiply(slope, rate)));
            }
        }
        self.graph.linear(0.0, &parts)
    }

    /// That what is derived has a derivative between its samples; `None` after a diagnostic.
    fn require_rates(&mut self, symbols: &[Symbol], span: Span) -> Option<()> {
        let resolved = self.resolved;
        for symbol in symbols {
            let (Symbol::Input(i, order) | Symbol::Delayed(i, order, _)) = *symbol else {
                continue;
            };
            let Some(input) = resolved.inputs.get(i) else { continue };
            if order + 1 < input.between.interpolation.coefficients() {
                continue;
            }
            let name = &input.name.text;
            self.report(
                Diagnostic::error(span, format!("`{name}` has no such rate"))
                    .label(format!("it is `{}` between samples", input.between.interpolation))
                    .hint("`spline` and `band_limited` have rates that do not jump")
                    .related(input.between.word.site.0, "said here"),
            );
            return None;
        }
        Some(())
    }

    /// dq/dt = dH/dp and dp/dt = -dH/dq + F with every term, its coefficient as a symbol.
    ///
    /// Sensors are lowered last, so that the terms and their order are final here.
    pub(super) fn flow(&mut self) -> Vec<(Symbol, Expr)> {
        if let Some(flow) = &self.flow {
            return flow.clone();
        }
        let n = self.coordinates.len();
        let mut energy: Vec<(f64, Expr)> = Vec::new();
        let mut forces: Vec<Vec<(f64, Expr)>> = vec![Vec::new(); n];
        // Nothing but its own law moves an internal state.
        let internal = self.resolved.hidden.iter().filter(|hidden| hidden.rate.is_some());
        let mut rates: HashMap<usize, Vec<(f64, Expr)>> =
            internal.map(|hidden| (hidden.coordinate, Vec::new())).collect();
        let mut take = |place: Place, expr: Expr| match place {
            Place::Force(i) => forces.get_mut(i).into_iter().for_each(|f| f.push((1.0, expr))),
            Place::Rate(i) => rates.entry(i).or_default().push((1.0, expr)),
            Place::Sensor(_) => {}
            _ => energy.push((1.0, expr)),
        };
        self.known.iter().for_each(|&(place, value, _)| take(place, value.expr));
        for (k, draft) in self.drafts.iter().enumerate() {
            let own = std::iter::once((draft.place, draft.expr));
            for (place, expr) in own.chain(draft.also.iter().map(|part| (part.place, part.expr))) {
                let coefficient = self.graph.symbol(Symbol::Coefficient(k));
                take(place, self.graph.multiply(coefficient, expr));
            }
        }
        let energy = self.graph.linear(0.0, &energy);
        let mut flow = Vec::with_capacity(2 * n);
        for i in 0..n {
            let rate = match rates.get(&i) {
                Some(parts) => self.graph.linear(0.0, parts),
                None => self.graph.derivative(energy, Symbol::Momentum(i)),
            };
            flow.push((Symbol::Coordinate(i), rate));
        }
        for (i, mut force) in forces.into_iter().enumerate() {
            if rates.contains_key(&i) {
                flow.push((Symbol::Momentum(i), self.graph.number(0.0)));
                continue;
            }
            force.push((-1.0, self.graph.derivative(energy, Symbol::Coordinate(i))));
            flow.push((Symbol::Momentum(i), self.graph.linear(0.0, &force)));
        }
        self.hold(&mut flow);
        self.flow = Some(flow.clone());
        flow
    }

    /// Names of coefficients that stand in more than one span.
    pub(super) fn find_shared(&mut self) {
        let mut seen = std::collections::HashSet::new();
        for items in self.spans() {
            let here: std::collections::HashSet<&str> =
                items.iter().filter_map(|item| Some(item.name.as_ref()?.text.as_str())).collect();
            for name in here {
                if !seen.insert(name) {
                    self.shared.entry(name.to_string()).or_default();
                }
            }
        }
    }

    /// Whether a coefficient, `k` or `k[2]`, has a name that stands in several spans.
    pub(super) fn is_shared(&self, name: &str) -> bool {
        !self.shared.is_empty() && self.shared.contains_key(name.split('[').next().unwrap_or(name))
    }

    /// Takes up a place of a shared coefficient; true where it is the first one, which is
    /// the next term.
    pub(super) fn first_of_shared(&mut self, name: &str, part: TermPart) -> bool {
        let next = self.drafts.len();
        let Some(at) = *self.shared.entry(name.to_string()).or_default() else {
            self.shared.insert(name.to_string(), Some(next));
            return true;
        };
        self.same_as_shared(at, name, &part);
        let Some(draft) = self.drafts.get_mut(at) else { return true };
        if draft.place == part.place {
            draft.expr = self.graph.add(draft.expr, part.expr);
            draft.text = None;
        } else if let Some(other) = draft.also.iter_mut().find(|other| other.place == part.place) {
            other.expr = self.graph.add(other.expr, part.expr);
        } else {
            draft.also.push(part);
        }
        false
    }

    /// What one coefficient multiplies in one place is added: it must have one unit.
    fn same_as_shared(&mut self, at: usize, name: &str, part: &TermPart) {
        let Some(draft) = self.drafts.get(at) else { return };
        let own =
            TermPart { place: draft.place, expr: draft.expr, unit: draft.unit, span: draft.span };
        let mut others = std::iter::once(&own).chain(&draft.also);
        let Some(other) = others.find(|other| other.place == part.place).copied() else { return };
        let Some((unit, there)) = part.unit.zip(other.unit) else { return };
        if !unit.agrees(there) {
            self.report(
                Diagnostic::error(
                    part.span,
                    format!(
                        "units clash: the coefficient `{name}` multiplies [{there}] and [{unit}]"
                    ),
                )
                .label(format!("in [{unit}] here"))
                .hint("what has one coefficient in one place has one unit: give them two names")
                .related(other.span, format!("in [{there}] here")),
            );
        }
    }

    /// The unit of a coefficient; all its places must agree on it.
    pub(super) fn coefficient_unit(
        &mut self,
        draft: &DraftTerm,
        energy: Option<Unit>,
    ) -> Option<Unit> {
        let own =
            TermPart { place: draft.place, expr: draft.expr, unit: draft.unit, span: draft.span };
        let mut first: Option<(Unit, Span)> = None;
        for part in std::iter::once(&own).chain(&draft.also) {
            let whole = match part.place {
                Place::Force(i) => energy
                    .zip(self.coordinates.get(i).copied().flatten())
                    .and_then(|(h, q)| h.over(q)),
                Place::Rate(i) => self.rate_unit(i),
                Place::Sensor(i) => self.observable_unit(i),
                _ => energy,
            };
            let Some(unit) = whole.zip(part.unit).and_then(|(whole, unit)| whole.over(unit)) else {
                continue;
            };
            match first {
                None => first = Some((unit, part.span)),
                Some((other, at)) if !other.agrees(unit) => {
                    let name = draft.name.as_deref().unwrap_or("?");
                    self.report(
                        Diagnostic::error(
                            part.span,
                            format!("units clash: the coefficient `{name}` is in [{other}] and in [{unit}]"),
                        )
                        .label(format!("in [{unit}] here"))
                        .hint("one name is one coefficient: give them two names, or correct a unit")
                        .related(at, format!("in [{other}] here")),
                    );
                }
                Some(_) => {}
            }
        }
        first.map(|(unit, _)| unit)
    }
}
