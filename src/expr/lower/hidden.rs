//! What moves and is not measured: coordinates, and internal states of first order.

use super::super::graph::Symbol;
use super::super::system::{Hidden as HiddenPart, Place};
use super::super::unit::Unit;
use super::{Context, Lowering};
use crate::diagnostic::{Diagnostic, Span};
use crate::spec::ast::HiddenStart;
use crate::spec::resolve::Hidden;

impl Lowering<'_> {
    /// The laws of internal states. They are lowered after what moves the coordinates, whose
    /// velocities they may name.
    pub(super) fn internal_states(&mut self, states: &[Hidden]) {
        let laws = states.iter().filter_map(|hidden| Some((hidden, hidden.rate?)));
        for (hidden, rate) in laws {
            self.context = Context::Rate;
            self.effect = hidden.effect.map(str::to_string);
            self.side(Place::Rate(hidden.coordinate), rate, false);
            // So far the flow lacks it.
            self.flow = None;
        }
    }

    /// That a rate in the law of an internal state is that of coordinates: what moves by forces
    /// has an acceleration, and other internal states have laws, that are not settled yet.
    pub(super) fn require_velocity(&mut self, symbols: &[Symbol], span: Span) -> Option<()> {
        let internal = |i: usize| {
            self.resolved
                .hidden
                .iter()
                .any(|hidden| hidden.coordinate == i && hidden.rate.is_some())
        };
        let wrong = symbols.iter().any(|symbol| match symbol {
            Symbol::Coordinate(i) => internal(*i),
            Symbol::Momentum(_) => true,
            _ => false,
        });
        if !wrong {
            return Some(());
        }
        self.report(
            Diagnostic::error(span, "only rates of coordinates may stand here")
                .label("not a rate of momenta or of other states")
                .hint("write what that rate is by its own law"),
        );
        None
    }

    /// The unit of the rate of an internal state.
    pub(super) fn rate_unit(&self, coordinate: usize) -> Option<Unit> {
        self.coordinates.get(coordinate).copied().flatten()?.over(self.time?)
    }

    /// The law of an internal state is in its unit over that of time.
    pub(super) fn check_known_rates(&mut self) {
        for (place, value, span) in self.known.clone() {
            let Place::Rate(i) = place else { continue };
            let (Some(unit), Some(expected)) = (value.unit, self.rate_unit(i)) else { continue };
            if !expected.agrees(unit) {
                let message = format!(
                    "units clash: this is in [{unit}], but the rate of this state is in [{expected}]"
                );
                self.report(
                    Diagnostic::error(span, message)
                        .label(format!("in [{unit}]"))
                        .hint("a rate has the unit of its state over that of time"),
                );
            }
        }
    }

    /// All that is hidden, with its starts.
    pub(super) fn hidden_parts(&mut self) -> Vec<HiddenPart> {
        let resolved = self.resolved;
        let mut parts = Vec::new();
        for hidden in &resolved.hidden {
            let i = hidden.coordinate;
            let own = self.coordinates.get(i).copied().flatten();
            let of_momentum = self.momenta.get(i).copied().flatten();
            let start = self.hidden_start(Some(hidden.of), own);
            let momentum = self.hidden_start(hidden.momentum, of_momentum);
            let rate = hidden.rate.map(|_| self.known_part(Place::Rate(i)));
            parts.push(HiddenPart { coordinate: i, start, momentum, rate });
        }
        parts
    }

    fn hidden_start(&mut self, of: Option<&HiddenStart>, unit: Option<Unit>) -> f64 {
        let Some(start) = of.and_then(|of| of.start.as_ref()) else { return 0.0 };
        let Some((value, own, span)) = self.number(start) else { return 0.0 };
        let (Some(unit), Some(own)) = (unit, own) else { return value };
        if !own.is_number() && !unit.agrees(own) {
            self.report(
                Diagnostic::error(span, format!("units clash: [{own}] is not [{unit}]"))
                    .label(format!("in [{own}]"))
                    .hint("a start has the unit of what it is the start of"),
            );
        }
        value
    }
}
