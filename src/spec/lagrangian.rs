//! Which energies are written as functions of velocities.

use super::ast::{EnergyPart, Expression, ExpressionKind, Role};
use super::resolve::{Energy, Meaning, Resolved};

impl Resolved<'_> {
    /// Whether an energy is a function of coordinates and velocities: L always, T where it names
    /// a velocity.
    pub fn is_of_velocities(&self, energy: &Energy) -> bool {
        match energy.part {
            EnergyPart::Lagrangian => true,
            EnergyPart::Kinetic => self.names_velocity(energy.value),
            EnergyPart::Potential | EnergyPart::Hamiltonian => false,
        }
    }

    /// Whether some energy is a function of velocities.
    pub fn has_lagrangian(&self) -> bool {
        self.energies.iter().any(|energy| self.is_of_velocities(energy))
    }

    /// Whether a velocity stands in an expression, by its name or as `rate(x)`.
    pub fn names_velocity(&self, expression: &Expression) -> bool {
        let named = match &expression.kind {
            ExpressionKind::Name(name)
            | ExpressionKind::Index { name, .. }
            | ExpressionKind::Slice { name, .. } => self.has_role(name, Role::Velocities),
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
                name != "pi"
                    && matches!(
                        meaning,
                        None | Some(Meaning::Variable(..) | Meaning::Family { .. })
                    )
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
