//! Units: that of H, and what must agree with it.

use super::super::system::Place;
use super::super::unit::Unit;
use super::Lowering;
use crate::diagnostic::{Diagnostic, Span};
use crate::spec::resolve::Declared;

/// The unit of a variable, where it is known and where there is such a variable.
pub(super) fn at(units: &[Option<Unit>], i: usize) -> Option<Unit> {
    units.get(i).copied().flatten()
}

impl Lowering<'_> {
    /// [q] [p] / [t], which is the unit of H, and where it comes from.
    pub(super) fn canonical_unit(&mut self) -> Option<(Unit, Span)> {
        let time = self.time?;
        let mut first: Option<(Unit, Span)> = None;
        let resolved = self.resolved;
        let pairs = resolved.coordinates.iter().zip(&resolved.momenta);
        for (i, (coordinate, momentum)) in pairs.enumerate() {
            let (Some(q), Some(p)) = (at(&self.coordinates, i), at(&self.momenta, i)) else {
                continue;
            };
            let Some(unit) = q.times(p).and_then(|action| action.over(time)) else { continue };
            let span = momentum.span;
            match first {
                None => first = Some((unit, span)),
                Some((energy, from)) if !energy.agrees(unit) => {
                    let name = &coordinate.name;
                    let message = format!(
                        "units clash: [{energy}] and [{unit}] cannot both be the unit of H"
                    );
                    let hint = format!(
                        "coordinate * momentum / time must be the same for all; with `{name}` it is [{unit}]"
                    );
                    self.report(
                        Diagnostic::error(span, message)
                            .label(format!("makes H a quantity in [{unit}]"))
                            .hint(hint)
                            .related(from, format!("makes H a quantity in [{energy}]")),
                    );
                }
                Some(_) => {}
            }
        }
        first
    }

    /// A velocity is measured in units of its coordinate over time.
    pub(super) fn check_velocities(&mut self) {
        let Some(time) = self.time else { return };
        let resolved = self.resolved;
        // One too many of either is an error of its own.
        let pairs = resolved.coordinates.iter().zip(&resolved.velocities);
        for (i, (coordinate, declared)) in pairs.enumerate() {
            let (Some(q), Some(v)) = (at(&self.coordinates, i), at(&self.velocities, i)) else {
                continue;
            };
            let Some(expected) = q.over(time) else { continue };
            if !expected.agrees(v) {
                let message = format!("units clash: [{v}] is not a velocity in [{expected}]");
                let label = format!("`{}` is in [{v}]", declared.name);
                let diagnostic = Diagnostic::error(declared.span, message)
                    .label(label)
                    .hint("a velocity has the unit of its coordinate over that of time")
                    .related(coordinate.span, format!("`{}` is in [{q}]", coordinate.name));
                self.report(diagnostic);
            }
        }
    }

    /// The coordinates of a body are in one unit, and so are their momenta.
    pub(super) fn check_bodies(&mut self) {
        let resolved = self.resolved;
        for body in &resolved.bodies {
            for (declared, units) in [
                (&resolved.coordinates, self.coordinates.clone()),
                (&resolved.momenta, self.momenta.clone()),
            ] {
                let known = |&i: &usize| Some((at(&units, i)?, declared.get(i)?));
                let known: Vec<(Unit, &Declared)> =
                    body.coordinates.iter().filter_map(known).collect();
                let Some(&(first, from)) = known.first() else { continue };
                let other = known.iter().find(|(unit, _)| !first.agrees(*unit));
                let Some(&(unit, other)) = other else { continue };
                let name = &body.name.text;
                let message = format!("units clash: the body `{name}` has [{first}] and [{unit}]");
                let diagnostic = Diagnostic::error(body.name.site.0, message)
                    .label("its axes cannot be turned")
                    .hint("only coordinates of one unit make a body")
                    .related(from.span, format!("`{}` is in [{first}]", from.name))
                    .related(other.span, format!("`{}` is in [{unit}]", other.name));
                self.report(diagnostic);
                break;
            }
        }
    }

    /// The unit of H: from the variables, or else from the first known part that has one.
    pub(super) fn energy_unit(&self, canonical: Option<(Unit, Span)>) -> Option<(Unit, Span)> {
        canonical.or_else(|| {
            let known = self.known.iter().copied().chain(self.lagrangian.parts());
            known
                .filter(|(place, ..)| place.is_energy())
                .find_map(|(_, value, span)| value.unit.map(|unit| (unit, span)))
        })
    }

    /// Every known part of H is in the unit of H, every known force in that of a force.
    pub(super) fn check_known(&mut self, energy: Option<(Unit, Span)>, canonical: bool) {
        self.check_known_sensors();
        self.check_known_rates();
        let Some((energy, from)) = energy else { return };
        let origin = if canonical {
            format!("coordinate, momentum and time make H a quantity in [{energy}]")
        } else {
            format!("this part makes H a quantity in [{energy}]")
        };
        let parts: Vec<_> = self.known.iter().copied().chain(self.lagrangian.parts()).collect();
        for (place, value, span) in parts {
            let Some(unit) = value.unit else { continue };
            let (expected, what) = match place {
                Place::Force(i) => match at(&self.coordinates, i) {
                    Some(q) => (energy.over(q), "a force here"),
                    None => continue,
                },
                Place::Sensor(_) | Place::Rate(_) => continue,
                _ => (Some(energy), "H"),
            };
            let Some(expected) = expected.filter(|expected| !expected.agrees(unit)) else {
                continue;
            };
            self.report(
                Diagnostic::error(
                    span,
                    format!("units clash: this is in [{unit}], but {what} is in [{expected}]"),
                )
                .label(format!("in [{unit}]"))
                .hint(if unit.is_number() {
                    format!("give its numbers their units, as in `2 [{expected}]`")
                } else if unit.same_kind(expected) {
                    "both measure the same; write all units in one size".to_string()
                } else {
                    "correct a unit, or give a constant the one that is missing".to_string()
                })
                .related(from, origin.clone()),
            );
        }
    }
}
