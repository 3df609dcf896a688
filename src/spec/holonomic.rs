//! Which `constrain` statements are equations between coordinates, and no bounds of numbers.

use super::ast::{Expression, ExpressionKind, Operand, Relation, Role};
use super::resolve::{Constraint, Holonomic, Meaning, Resolved};

impl<'a> Resolved<'a> {
    /// The equations between coordinates, in the order of the text.
    pub(crate) fn holonomic(&self) -> impl Iterator<Item = Holonomic<'a>> {
        self.constraints.iter().filter_map(|one| self.equation(one))
    }

    /// Whether a statement is one of them.
    pub(crate) fn is_holonomic(&self, constraint: &Constraint<'a>) -> bool {
        self.equation(constraint).is_some()
    }

    fn equation(&self, constraint: &Constraint<'a>) -> Option<Holonomic<'a>> {
        let &Constraint { first: Operand::Value(left), rest, span } = constraint else {
            return None;
        };
        let [(Relation::Equal, Operand::Value(right))] = rest else { return None };
        let of_motion = self.names_coordinate(left) || self.names_coordinate(right);
        of_motion.then_some(Holonomic { left, right, span })
    }

    /// Whether a coordinate stands in an expression, or a name that is defined by one.
    fn names_coordinate(&self, expression: &Expression) -> bool {
        let named = match &expression.kind {
            ExpressionKind::Name(name)
            | ExpressionKind::Index { name, .. }
            | ExpressionKind::Slice { name, .. } => {
                let meaning = self.names.get(name).map(|&(meaning, _)| meaning);
                let coordinate = matches!(
                    meaning,
                    Some(
                        Meaning::Variable(Role::Coordinates, _)
                            | Meaning::Family { role: Role::Coordinates, .. }
                    )
                );
                coordinate || self.definition(name).is_some_and(|of| of.moves)
            }
            _ => false,
        };
        named || expression.parts().into_iter().any(|part| self.names_coordinate(part))
    }
}
