//! From instructions to a tape: steps that work on an accumulator and on registers.
//!
//! Most values are needed once, and by the very next instruction. Such a value stays in the
//! accumulator, which the interpreter holds in registers of the processor; a register of the tape
//! is written only for what is needed later. Runs of one operation, as in Horner's scheme and in
//! sums of terms, are one step.

use crate::eval::instruction::{Instruction, Value};
use crate::eval::lower::Lowered;
use crate::expr::Function;

/// A register of the tape, which holds a row.
pub(super) type Place = u32;

/// What becomes of the accumulator. `Of` in a name: the accumulator is not read, only written.
/// `first` is the place of a step's numbers or pairs in the lists of the [`Program`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Step {
    /// A row of the points.
    Load { input: u32 },
    /// The number at every point.
    Broadcast { first: u32 },
    /// A register.
    Fetch { a: Place },
    /// accumulator * number.
    Scale { first: u32 },
    /// a * number.
    ScaleOf { a: Place, first: u32 },
    /// accumulator + number.
    Shift { first: u32 },
    /// accumulator * number + second number.
    ScaleShift { first: u32 },
    /// a + accumulator * number.
    ScaleAdd { a: Place, first: u32 },
    /// a + b * number.
    AddScaledOf { a: Place, b: Place, first: u32 },
    /// accumulator + b * number, for so many registers b of the list and their numbers.
    AddScaled { list: u32, first: u32, count: u32 },
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
    /// accumulator * b + number, for so many numbers one after the other.
    Horner { b: Place, first: u32, count: u32 },
    /// The polynomial of b with so many numbers, that of the highest power first.
    PolynomialOf { b: Place, first: u32, count: u32 },
    /// a * b + number.
    MultiplyShiftOf { a: Place, b: Place, first: u32 },
    /// accumulator * b + c.
    MultiplyAdd { b: Place, c: Place },
    /// a * b + c.
    MultiplyAddOf { a: Place, b: Place, c: Place },
    /// a * b + accumulator.
    AddProduct { a: Place, b: Place },
    /// 1 / accumulator.
    Reciprocal,
    /// a ^ number, into a register and the accumulator.
    RaiseOf { a: Place, to: Place, first: u32 },
    /// a ^ b, into a register and the accumulator.
    PowerOf { a: Place, b: Place, to: Place },
    /// function(a), into a register and the accumulator.
    ApplyOf { a: Place, to: Place, function: Function },
    /// The accumulator goes to a register as well.
    Store { to: Place },
    /// The accumulator is an output.
    Output { row: u32 },
}

/// Steps, and the lists that they refer to.
#[derive(Debug, Default)]
pub(super) struct Program {
    pub steps: Vec<Step>,
    /// The slots of the steps' numbers, in the order in which they are needed.
    pub slots: Vec<u32>,
    /// Registers of [`Step::AddScaled`].
    pub list: Vec<Place>,
    /// Registers that are in use at once, at most.
    pub registers: usize,
}

impl Program {
    pub(super) fn new(lowered: &Lowered) -> Program {
        let count = lowered.code.len();
        let mut last_use: Vec<usize> = (0..count).collect();
        for (at, instruction) in lowered.code.iter().enumerate() {
            for operand in instruction.operands() {
                last_use[operand as usize] = at;
            }
        }
        let mut outputs: Vec<(Value, u32)> =
            lowered.outputs.iter().zip(0..).map(|(&value, row)| (value, row)).collect();
        outputs.sort_unstable();
        let mut outputs = outputs.into_iter().peekable();
        let mut writer = Writer {
            program: Program::default(),
            held: None,
            place: vec![None; count],
            free: Vec::new(),
        };
        for (at, &instruction) in lowered.code.iter().enumerate() {
            if let Some(held) = writer.held {
                // What the accumulator holds goes to a register if it is needed later, or in a
                // way that only a register can be.
                let later = last_use[held as usize] > at;
                if later || !is_taken_once(instruction, held) {
                    writer.keep(held);
                }
            }
            writer.write(instruction, at as Value);
            writer.held = Some(at as Value);
            let mut ended: Vec<Value> =
                instruction.operands().filter(|&v| last_use[v as usize] == at).collect();
            if last_use[at] == at {
                ended.push(at as Value);
            }
            for value in ended {
                writer.free.extend(writer.place[value as usize].take());
            }
            while let Some((_, row)) = outputs.next_if(|output| output.0 as usize == at) {
                writer.push(Step::Output { row });
            }
        }
        writer.program
    }
}

/// Whether an instruction has no need of a register for what the accumulator holds.
fn is_taken_once(instruction: Instruction, held: Value) -> bool {
    match instruction {
        Instruction::Multiply { .. } => true,
        Instruction::Raise { a, .. } | Instruction::Apply { a, .. } => a != held,
        Instruction::Power { a, b } => a != held && b != held,
        other => other.operands().filter(|&operand| operand == held).count() < 2,
    }
}

struct Writer {
    program: Program,
    /// The value in the accumulator.
    held: Option<Value>,
    /// For each value, the register that it is in.
    place: Vec<Option<Place>>,
    free: Vec<Place>,
}

impl Writer {
    /// The register of a value; every value that is not taken from the accumulator has one.
    fn of(&self, value: Value) -> Place {
        self.place[value as usize].unwrap_or(0)
    }

    fn push(&mut self, step: Step) {
        self.program.steps.push(step);
    }

    /// A register for a value.
    fn give(&mut self, value: Value) -> Place {
        let to = self.free.pop().unwrap_or_else(|| {
            self.program.registers += 1;
            self.program.registers as Place - 1
        });
        self.place[value as usize] = Some(to);
        to
    }

    /// Puts the accumulator's value into a register, if it is in none.
    fn keep(&mut self, held: Value) {
        if self.place[held as usize].is_none() {
            let to = self.give(held);
            self.push(Step::Store { to });
        }
    }

    /// Writes down the number of a step.
    fn number(&mut self, slot: u32) -> u32 {
        self.program.slots.push(slot);
        self.program.slots.len() as u32 - 1
    }

    /// Brings a value into the accumulator.
    fn bring(&mut self, a: Value) {
        if self.held != Some(a) {
            self.push(Step::Fetch { a: self.of(a) });
        }
    }

    /// Steps of the instruction that makes a value.
    fn write(&mut self, instruction: Instruction, value: Value) {
        let held = self.held;
        let holds = |value: Value| held == Some(value);
        let step = match instruction {
            Instruction::Load { input } => Step::Load { input },
            Instruction::Broadcast { slot } => Step::Broadcast { first: self.number(slot) },
            Instruction::Scale { a, slot } => {
                let first = self.number(slot);
                if holds(a) {
                    Step::Scale { first }
                } else {
                    Step::ScaleOf { a: self.of(a), first }
                }
            }
            Instruction::Shift { a, slot } => {
                self.bring(a);
                Step::Shift { first: self.number(slot) }
            }
            Instruction::ScaleShift { a, slot, shift } => {
                let first = self.number(slot);
                self.number(shift);
                if holds(a) {
                    Step::ScaleShift { first }
                } else {
                    Step::PolynomialOf { b: self.of(a), first, count: 2 }
                }
            }
            Instruction::AddScaled { a, b, slot } => {
                let first = self.number(slot);
                if holds(a) {
                    return self.add_scaled(self.of(b), first);
                }
                let a = self.of(a);
                if holds(b) {
                    Step::ScaleAdd { a, first }
                } else {
                    Step::AddScaledOf { a, b: self.of(b), first }
                }
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
            Instruction::MultiplyShift { a, b, slot } => {
                let first = self.number(slot);
                if holds(a) {
                    return self.horner(self.of(b), first);
                }
                if holds(b) {
                    return self.horner(self.of(a), first);
                }
                Step::MultiplyShiftOf { a: self.of(a), b: self.of(b), first }
            }
            Instruction::MultiplyAdd { a, b, c } if holds(c) => {
                Step::AddProduct { a: self.of(a), b: self.of(b) }
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
                self.bring(a);
                Step::Reciprocal
            }
            Instruction::Raise { a, slot } => {
                let first = self.number(slot);
                Step::RaiseOf { a: self.of(a), to: self.give(value), first }
            }
            Instruction::Power { a, b } => {
                Step::PowerOf { a: self.of(a), b: self.of(b), to: self.give(value) }
            }
            Instruction::Apply { a, function } => {
                Step::ApplyOf { a: self.of(a), to: self.give(value), function }
            }
        };
        self.push(step);
    }

    fn horner(&mut self, b: Place, first: u32) {
        match self.program.steps.last_mut() {
            Some(
                Step::Horner { b: same, count, .. } | Step::PolynomialOf { b: same, count, .. },
            ) if *same == b => {
                *count += 1;
            }
            _ => self.push(Step::Horner { b, first, count: 1 }),
        }
    }

    fn add_scaled(&mut self, b: Place, first: u32) {
        let list = self.program.list.len() as u32;
        self.program.list.push(b);
        match self.program.steps.last_mut() {
            Some(Step::AddScaled { count, .. }) => *count += 1,
            _ => self.push(Step::AddScaled { list, first, count: 1 }),
        }
    }
}
