//! From instructions to a tape: steps that work on an accumulator and on registers.
//!
//! Most values are needed once, and by the very next instruction. Such a value stays in the
//! accumulator, which the interpreter holds in registers of the processor; a register of the tape
//! is written only for what is needed later. Runs of one operation, as in Horner's scheme and in
//! sums of terms, are one step.

use crate::eval::instruction::{Instruction, Value};
use crate::eval::lower::Lowered;
use crate::expr::Function;

/// A register of the tape.
pub type Place = u32;

/// What becomes of the accumulator. `Of` in a name: the accumulator is not read, only written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// A row of the points.
    Load { input: u32 },
    /// The same number at every point.
    Broadcast { slot: u32 },
    /// A register.
    Fetch { a: Place },
    /// accumulator * slot.
    Scale { slot: u32 },
    /// a * slot.
    ScaleOf { a: Place, slot: u32 },
    /// accumulator + slot.
    Shift { slot: u32 },
    /// accumulator * slot + shift.
    ScaleShift { slot: u32, shift: u32 },
    /// a * slot + shift.
    ScaleShiftOf { a: Place, slot: u32, shift: u32 },
    /// a + accumulator * slot.
    ScaleAdd { a: Place, slot: u32 },
    /// a + b * slot.
    AddScaledOf { a: Place, b: Place, slot: u32 },
    /// accumulator + b * slot for so many (b, slot) of the pairs.
    AddScaled { first: u32, count: u32 },
    /// accumulator + b.
    Add { b: Place },
    /// a + b.
    AddOf { a: Place, b: Place },
    /// accumulator - b.
    Subtract { b: Place },
    /// a - accumulator.
    SubtractFrom { a: Place },
    /// a - b.
    SubtractOf { a: Place, b: Place },
    /// accumulator * accumulator.
    Square,
    /// accumulator * b.
    Multiply { b: Place },
    /// a * b.
    MultiplyOf { a: Place, b: Place },
    /// accumulator * b + slot for so many slots of the list, one after the other.
    Horner { b: Place, first: u32, count: u32 },
    /// a * b + slot.
    MultiplyShiftOf { a: Place, b: Place, slot: u32 },
    /// accumulator * b + c.
    MultiplyAdd { b: Place, c: Place },
    /// a * b + c.
    MultiplyAddOf { a: Place, b: Place, c: Place },
    /// accumulator + a * b for so many (a, b) of the pairs.
    AddProducts { first: u32, count: u32 },
    /// 1 / accumulator.
    Reciprocal,
    /// accumulator ^ slot.
    Raise { slot: u32 },
    /// accumulator ^ b.
    Power { b: Place },
    /// function(accumulator).
    Apply { function: Function },
    /// The accumulator goes to a register as well.
    Store { to: Place },
    /// The accumulator is an output.
    Output { row: u32 },
}

/// Steps, and the lists that runs refer to.
#[derive(Debug, Default)]
pub struct Program {
    pub steps: Vec<Step>,
    /// Slots of [`Step::Horner`].
    pub slots: Vec<u32>,
    /// Pairs of [`Step::AddScaled`] and [`Step::AddProducts`].
    pub pairs: Vec<(u32, u32)>,
    /// Registers that are in use at once, at most.
    pub registers: usize,
}

impl Program {
    pub fn new(lowered: &Lowered) -> Program {
        let count = lowered.code.len();
        let mut uses = vec![0_u32; count];
        let mut last_use: Vec<usize> = (0..count).collect();
        for (at, instruction) in lowered.code.iter().enumerate() {
            for operand in instruction.operands() {
                uses[operand as usize] += 1;
                last_use[operand as usize] = at;
            }
        }
        let mut outputs: Vec<(Value, u32)> =
            lowered.outputs.iter().zip(0..).map(|(&value, row)| (value, row)).collect();
        outputs.sort_unstable();
        let mut outputs = outputs.into_iter().peekable();
        let mut writer = Writer { program: Program::default(), place: vec![None; count] };
        let mut free: Vec<Place> = Vec::new();
        for (at, &instruction) in lowered.code.iter().enumerate() {
            // What the last instruction made is in the accumulator. It is taken from there once;
            // whoever else needs it finds it in a register.
            if let Some(held) = at.checked_sub(1)
                && uses[held] > taken(instruction, held as Value)
            {
                let to = free.pop().unwrap_or_else(|| {
                    writer.program.registers += 1;
                    writer.program.registers as Place - 1
                });
                writer.place[held] = Some(to);
                writer.program.steps.push(Step::Store { to });
            }
            writer.write(instruction, at.checked_sub(1).map(|held| held as Value));
            let mut ended: Vec<Value> =
                instruction.operands().filter(|&v| last_use[v as usize] == at).collect();
            ended.sort_unstable();
            ended.dedup();
            free.extend(ended.into_iter().filter_map(|v| writer.place[v as usize].take()));
            while let Some((_, row)) = outputs.next_if(|output| output.0 as usize == at) {
                writer.program.steps.push(Step::Output { row });
            }
        }
        writer.program
    }
}

/// How often an instruction takes a value from the accumulator, where that holds it.
fn taken(instruction: Instruction, held: Value) -> u32 {
    match instruction {
        Instruction::Multiply { a, b } if a == held && b == held => 2,
        Instruction::Power { a, b } => u32::from(a == held && b != held),
        other => u32::from(other.operands().any(|operand| operand == held)),
    }
}

struct Writer {
    program: Program,
    /// For each value, the register that it is in.
    place: Vec<Option<Place>>,
}

impl Writer {
    /// The register of a value; every value that is not taken from the accumulator has one.
    fn of(&self, value: Value) -> Place {
        self.place[value as usize].unwrap_or(0)
    }

    fn push(&mut self, step: Step) {
        self.program.steps.push(step);
    }

    /// Steps of an instruction; `held` is the value in the accumulator.
    fn write(&mut self, instruction: Instruction, held: Option<Value>) {
        let holds = |value: Value| held == Some(value);
        let step = match instruction {
            Instruction::Load { input } => Step::Load { input },
            Instruction::Broadcast { slot } => Step::Broadcast { slot },
            Instruction::Scale { a, slot } if holds(a) => Step::Scale { slot },
            Instruction::Scale { a, slot } => Step::ScaleOf { a: self.of(a), slot },
            Instruction::Shift { a, slot } => {
                self.bring(a, held);
                Step::Shift { slot }
            }
            Instruction::ScaleShift { a, slot, shift } if holds(a) => {
                Step::ScaleShift { slot, shift }
            }
            Instruction::ScaleShift { a, slot, shift } => {
                Step::ScaleShiftOf { a: self.of(a), slot, shift }
            }
            Instruction::AddScaled { a, b, slot } if holds(a) => {
                return self.add_scaled(self.of(b), slot);
            }
            Instruction::AddScaled { a, b, slot } if holds(b) => {
                Step::ScaleAdd { a: self.of(a), slot }
            }
            Instruction::AddScaled { a, b, slot } => {
                Step::AddScaledOf { a: self.of(a), b: self.of(b), slot }
            }
            Instruction::Add { a, b } if holds(a) => Step::Add { b: self.of(b) },
            Instruction::Add { a, b } if holds(b) => Step::Add { b: self.of(a) },
            Instruction::Add { a, b } => Step::AddOf { a: self.of(a), b: self.of(b) },
            Instruction::Subtract { a, b } if holds(a) => Step::Subtract { b: self.of(b) },
            Instruction::Subtract { a, b } if holds(b) => Step::SubtractFrom { a: self.of(a) },
            Instruction::Subtract { a, b } => Step::SubtractOf { a: self.of(a), b: self.of(b) },
            Instruction::Multiply { a, b } if holds(a) && holds(b) => Step::Square,
            Instruction::Multiply { a, b } if holds(a) => Step::Multiply { b: self.of(b) },
            Instruction::Multiply { a, b } if holds(b) => Step::Multiply { b: self.of(a) },
            Instruction::Multiply { a, b } => Step::MultiplyOf { a: self.of(a), b: self.of(b) },
            Instruction::MultiplyShift { a, b, slot } if holds(a) => {
                return self.horner(self.of(b), slot);
            }
            Instruction::MultiplyShift { a, b, slot } if holds(b) => {
                return self.horner(self.of(a), slot);
            }
            Instruction::MultiplyShift { a, b, slot } => {
                Step::MultiplyShiftOf { a: self.of(a), b: self.of(b), slot }
            }
            Instruction::MultiplyAdd { a, b, c } if holds(c) => {
                return self.add_product(self.of(a), self.of(b));
            }
            Instruction::MultiplyAdd { a, b, c } if holds(a) => {
                Step::MultiplyAdd { b: self.of(b), c: self.of(c) }
            }
            Instruction::MultiplyAdd { a, b, c } if holds(b) => {
                Step::MultiplyAdd { b: self.of(a), c: self.of(c) }
            }
            Instruction::MultiplyAdd { a, b, c } => {
                Step::MultiplyAddOf { a: self.of(a), b: self.of(b), c: self.of(c) }
            }
            Instruction::Reciprocal { a } => {
                self.bring(a, held);
                Step::Reciprocal
            }
            Instruction::Raise { a, slot } => {
                self.bring(a, held);
                Step::Raise { slot }
            }
            Instruction::Power { a, b } => {
                if a == b || !holds(a) {
                    self.push(Step::Fetch { a: self.of(a) });
                }
                Step::Power { b: self.of(b) }
            }
            Instruction::Apply { a, function } => {
                self.bring(a, held);
                Step::Apply { function }
            }
        };
        self.push(step);
    }

    /// Brings a value into the accumulator.
    fn bring(&mut self, a: Value, held: Option<Value>) {
        if held != Some(a) {
            self.push(Step::Fetch { a: self.of(a) });
        }
    }

    fn horner(&mut self, b: Place, slot: u32) {
        let first = self.program.slots.len() as u32;
        self.program.slots.push(slot);
        match self.program.steps.last_mut() {
            Some(Step::Horner { b: same, count, .. }) if *same == b => *count += 1,
            _ => self.push(Step::Horner { b, first, count: 1 }),
        }
    }

    fn add_scaled(&mut self, b: Place, slot: u32) {
        let first = self.program.pairs.len() as u32;
        self.program.pairs.push((b, slot));
        match self.program.steps.last_mut() {
            Some(Step::AddScaled { count, .. }) => *count += 1,
            _ => self.push(Step::AddScaled { first, count: 1 }),
        }
    }

    fn add_product(&mut self, a: Place, b: Place) {
        let first = self.program.pairs.len() as u32;
        self.program.pairs.push((a, b));
        match self.program.steps.last_mut() {
            Some(Step::AddProducts { count, .. }) => *count += 1,
            _ => self.push(Step::AddProducts { first, count: 1 }),
        }
    }
}
