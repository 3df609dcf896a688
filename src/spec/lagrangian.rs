//! Which energies are written as functions of velocities, and what `let` stands for.

use super::ast::{EnergyPart, Expression, ExpressionKind, Role};
use super::resolve::{Energy, Meaning, Resolved};

/// A statement `constant g = ...` or `let x = ...`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Constant<'a> {
    pub value: &'a Expression,
    /// It may stand for any expression.
    pub by_let: bool,
}

/// A name that `let` gives to an expression of what moves, drives or is learned. It is put in the
/// place of the name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Definition {
    /// A velocity stands in it.
    names_velocity: bool,
    /// What moves stands in it.
    pub(super) moves: bool,
}

impl Resolved<'_> {
    /// Tells definitions from constants; each may name those before it.
    pub(super) fn define(&mut self) {
        for constant in self.constants.clone() {
            let value = constant.value;
            let is_definition = constant.by_let && self.holds_no_number(value);
            self.definitions.push(is_definition.then(|| Definition {
                names_velocity: self.names_velocity(value),
                moves: self.moves(value),
            }));
        }
    }

    /// The definition that a name stands for.
    pub(super) fn definition(&self, name: &str) -> Option<Definition> {
        match self.names.get(name) {
            Some(&(Meaning::Constant(i), _)) => self.definitions.get(i).copied().flatten(),
            _ => None,
        }
    }

    /// Whether something else than numbers stands in an expression.
    fn holds_no_number(&self, expression: &Expression) -> bool {
        let named = match &expression.kind {
            ExpressionKind::Name(name)
            | ExpressionKind::Index { name, .. }
            | ExpressionKind::Slice { name, .. } => {
                let constant = matches!(self.names.get(name), Some((Meaning::Constant(_), _)));
                self.definition(name).is_some() || (!constant && name != "pi")
            }
            _ => false,
        };
        named || expression.parts().into_iter().any(|part| self.holds_no_number(part))
    }

    /// Whether an energy is a function of coordinates and velocities: L always, T where it names
    /// a velocity.
    pub(crate) fn is_of_velocities(&self, energy: &Energy) -> bool {
        match energy.part {
            EnergyPart::Lagrangian => true,
            EnergyPart::Kinetic => self.names_velocity(energy.value),
            EnergyPart::Potential | EnergyPart::Hamiltonian => false,
        }
    }

    /// Whether some energy is a function of velocities.
    pub(crate) fn has_lagrangian(&self) -> bool {
        self.energies.iter().any(|energy| self.is_of_velocities(energy))
    }

    /// Whether a velocity stands in an expression, by its name or as `rate(x)`.
    pub(crate) fn names_velocity(&self, expression: &Expression) -> bool {
        let named = match &expression.kind {
            ExpressionKind::Name(name)
            | ExpressionKind::Index { name, .. }
            | ExpressionKind::Slice { name, .. } => {
                let defined = self.definition(name).is_some_and(|of| of.names_velocity);
                defined || self.has_role(name, Role::Velocities)
            }
            ExpressionKind::Call { name, arguments, .. } if name == "rate" => {
                arguments.iter().any(|argument| self.moves(argument))
            }
            _ => false,
        };
        named || expression.parts().into_iter().any(|part| self.names_velocity(part))
    }

    /// Whether an expression names what moves. Hidden coordinates may not be declared yet: every
    /// name that stands for nothing else is taken for one.
    fn moves(&self, expression: &Expression) -> bool {
        let named = match &expression.kind {
            ExpressionKind::Name(name)
            | ExpressionKind::Index { name, .. }
            | ExpressionKind::Slice { name, .. } => {
                let meaning = self.names.get(name).map(|&(meaning, _)| meaning);
                let defined = self.definition(name).is_some_and(|of| of.moves);
                let moving =
                    matches!(meaning, None | Some(Meaning::Variable(..) | Meaning::Family { .. }));
                name != "pi" && (defined || moving)
            }
            _ => false,
        };
        named || expression.parts().into_iter().any(|part| self.moves(part))
    }

    fn has_role(&self, name: &str, wanted: Role) -> bool {
        match self.names.get(name) {
            Some((Meaning::Variable(role, _) | Meaning::Family { role, .. }, _)) => *role == wanted,
            _ => false,
        }
    }
}
