//! What every backend computes with: instructions over a block of points.

use crate::expr::{Expr, Function};

/// Result of an instruction, named by its place in the code.
pub(crate) type Value = u32;

/// One instruction over a block of points. Whatever multiplies and adds is fused: it rounds
/// once, on every backend and processor alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Instruction {
    /// A row of the points.
    Load { input: u32 },
    /// The same number at every point.
    Broadcast { slot: u32 },
    /// a * slot.
    Scale { a: Value, slot: u32 },
    /// a + slot.
    Shift { a: Value, slot: u32 },
    /// a * slot + shift.
    ScaleShift { a: Value, slot: u32, shift: u32 },
    /// a + b * slot.
    AddScaled { a: Value, b: Value, slot: u32 },
    /// a + b.
    Add { a: Value, b: Value },
    /// a - b.
    Subtract { a: Value, b: Value },
    /// a * b.
    Multiply { a: Value, b: Value },
    /// a * b + slot.
    MultiplyShift { a: Value, b: Value, slot: u32 },
    /// a * b + c.
    MultiplyAdd { a: Value, b: Value, c: Value },
    /// 1 / a.
    Reciprocal { a: Value },
    /// a ^ slot.
    Raise { a: Value, slot: u32 },
    /// a ^ b.
    Power { a: Value, b: Value },
    /// function(a).
    Apply { a: Value, function: Function },
}

impl Instruction {
    /// The values that the instruction reads.
    pub(crate) fn operands(self) -> impl Iterator<Item = Value> {
        let list = match self {
            Instruction::Load { .. } | Instruction::Broadcast { .. } => [None, None, None],
            Instruction::Scale { a, .. }
            | Instruction::Shift { a, .. }
            | Instruction::ScaleShift { a, .. }
            | Instruction::Reciprocal { a }
            | Instruction::Raise { a, .. }
            | Instruction::Apply { a, .. } => [Some(a), None, None],
            Instruction::AddScaled { a, b, .. }
            | Instruction::Add { a, b }
            | Instruction::Subtract { a, b }
            | Instruction::Multiply { a, b }
            | Instruction::MultiplyShift { a, b, .. }
            | Instruction::Power { a, b } => [Some(a), Some(b), None],
            Instruction::MultiplyAdd { a, b, c } => [Some(a), Some(b), Some(c)],
        };
        list.into_iter().flatten()
    }

    /// The same instruction on other values.
    pub(crate) fn renamed(mut self, name: impl Fn(Value) -> Value) -> Instruction {
        match &mut self {
            Instruction::Load { .. } | Instruction::Broadcast { .. } => {}
            Instruction::Scale { a, .. }
            | Instruction::Shift { a, .. }
            | Instruction::ScaleShift { a, .. }
            | Instruction::Reciprocal { a }
            | Instruction::Raise { a, .. }
            | Instruction::Apply { a, .. } => *a = name(*a),
            Instruction::AddScaled { a, b, .. }
            | Instruction::Add { a, b }
            | Instruction::Subtract { a, b }
            | Instruction::Multiply { a, b }
            | Instruction::MultiplyShift { a, b, .. }
            | Instruction::Power { a, b } => (*a, *b) = (name(*a), name(*b)),
            Instruction::MultiplyAdd { a, b, c } => {
                (*a, *b, *c) = (name(*a), name(*b), name(*c));
            }
        }
        self
    }

    /// The same instruction with slots counted from another place.
    #[cfg(target_arch = "x86_64")]
    pub(crate) fn with_slots_from(mut self, first: u32) -> Instruction {
        match &mut self {
            Instruction::Broadcast { slot }
            | Instruction::Scale { slot, .. }
            | Instruction::Shift { slot, .. }
            | Instruction::AddScaled { slot, .. }
            | Instruction::MultiplyShift { slot, .. }
            | Instruction::Raise { slot, .. } => *slot += first,
            Instruction::ScaleShift { slot, shift, .. } => {
                *slot += first;
                *shift += first;
            }
            _ => {}
        }
        self
    }

    /// Time for one point, in units of one multiplication.
    pub(crate) fn cost(self) -> u32 {
        match self {
            Instruction::Reciprocal { .. } => 4,
            Instruction::Raise { .. } | Instruction::Power { .. } => 40,
            Instruction::Apply { function, .. } => function.row().cost,
            _ => 1,
        }
    }
}

/// A number computed once a call: factor * product of expr ^ exponent, each expr uniform.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Slot {
    /// A number.
    pub factor: f64,
    /// Uniform expressions and their exponents.
    pub parts: Vec<(Expr, f64)>,
}

impl Slot {
    /// A number of the source.
    pub(crate) fn number(value: f64) -> Slot {
        Slot { factor: value, parts: Vec::new() }
    }

    /// Whether the number is 1, whatever the coefficients.
    pub(crate) fn is_one(&self) -> bool {
        self.parts.is_empty() && self.factor == 1.0
    }
}
