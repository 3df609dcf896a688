//! The batched evaluator: a tape of instructions, each run over a block of points.

use super::aligned::aligned_part;
use super::instruction::{Instruction, Value};
use super::lanes::REGISTER;
use super::lower::Lowered;
use super::processor::dispatched;
use super::uniform::Uniforms;
use super::{Backend, Evaluator, InstructionSet, elementary, power};

/// Whole blocks are multiples of this many points: the compiler makes vectors of them. What is left
/// over is filled up to whole registers.
const CHUNK: usize = 32;
/// Bytes of a block's registers: they share the first-level cache with rows that come and go.
const BLOCK_BYTES: usize = 24 << 10;
/// Most points of one block: more would not make the instructions' share any smaller.
const MOST_POINTS: usize = 256;

/// Registers are reused as soon as their value is no longer needed.
pub struct Tape {
    /// Instructions with registers in place of values, and the register each writes to.
    code: Vec<(Instruction, u32)>,
    /// Output rows that are stored right after an instruction: (instruction, output).
    stores: Vec<(u32, u32)>,
    uniforms: Uniforms,
    registers: usize,
    /// Points of one block.
    points: usize,
    outputs: usize,
    set: InstructionSet,
}

impl Tape {
    pub fn new(lowered: &Lowered, uniforms: Uniforms, set: InstructionSet) -> Tape {
        let Allocated { code, stores, registers } = allocate(lowered);
        let point_bytes = registers.max(1) * size_of::<f64>();
        let points = (BLOCK_BYTES / point_bytes / CHUNK * CHUNK).clamp(CHUNK, MOST_POINTS);
        let outputs = lowered.outputs.len();
        Tape { code, stores, uniforms, registers, points, outputs, set }
    }
}

impl Evaluator for Tape {
    fn outputs(&self) -> usize {
        self.outputs
    }

    fn backend(&self) -> Backend {
        Backend::Batched
    }

    fn evaluate(
        &self,
        points: &[f64],
        uniform: &[f64],
        lanes: usize,
        out: &mut [f64],
        workspace: &mut Vec<f64>,
    ) {
        let (slots, steps) = (self.uniforms.len(), self.uniforms.scratch());
        let most = self.points.min(lanes.next_multiple_of(REGISTER));
        let registers = self.registers.max(1) * most;
        let (memory, _) = aligned_part(workspace, registers + slots + steps);
        let (registers, rest) = memory.split_at_mut(registers);
        let (slots, steps) = rest.split_at_mut(slots);
        self.uniforms.evaluate(uniform, steps, |slot, value| slots[slot] = value);
        for start in (0..lanes).step_by(most.max(1)) {
            let width = most.min(lanes - start);
            let mut block = Block { points, slots, lanes, start, width, out: &mut *out };
            run(self.set, self, &mut block, registers);
        }
    }
}

/// What one run over the tape works on.
struct Block<'a> {
    points: &'a [f64],
    slots: &'a [f64],
    lanes: usize,
    start: usize,
    width: usize,
    out: &'a mut [f64],
}

dispatched! {
    /// Runs one block.
    fn run(tape: &Tape, block: &mut Block, registers: &mut [f64]) = run_block;
}

/// The registers that an instruction may read: all but the one that it writes to.
struct Others<'a> {
    before: &'a [f64],
    after: &'a [f64],
    width: usize,
}

impl<'a> Others<'a> {
    #[inline(always)]
    fn row(&self, register: Value) -> &'a [f64] {
        let at = register as usize * self.width;
        match self.before.get(at..at + self.width) {
            Some(row) => row,
            None => &self.after[at - self.before.len() - self.width..][..self.width],
        }
    }
}

/// `block.width` points of each row are real, what fills up the last register is not.
#[inline(always)]
fn run_block(tape: &Tape, block: &mut Block, registers: &mut [f64]) {
    let mut stores = tape.stores.iter().peekable();
    let width = block.width.next_multiple_of(REGISTER);
    let slot = |slot: u32| block.slots[slot as usize];
    for (at, &(instruction, to)) in tape.code.iter().enumerate() {
        let (before, rest) = registers.split_at_mut(to as usize * width);
        let (to, after) = rest.split_at_mut(width);
        let others = Others { before, after, width };
        let row = |register: Value| others.row(register);
        match instruction {
            Instruction::Load { input } => {
                let from = &block.points[input as usize * block.lanes + block.start..];
                to[..block.width].copy_from_slice(&from[..block.width]);
            }
            Instruction::Broadcast { slot: s } => to.fill(slot(s)),
            Instruction::Scale { a, slot: s } => {
                let s = slot(s);
                map(to, row(a), |x| x * s);
            }
            Instruction::Shift { a, slot: s } => {
                let s = slot(s);
                map(to, row(a), |x| x + s);
            }
            Instruction::ScaleShift { a, slot: s, shift } => {
                let (s, shift) = (slot(s), slot(shift));
                map(to, row(a), |x| x.mul_add(s, shift));
            }
            Instruction::AddScaled { a, b, slot: s } => {
                let s = slot(s);
                zip(to, row(a), row(b), |x, y| y.mul_add(s, x));
            }
            Instruction::Add { a, b } => zip(to, row(a), row(b), |x, y| x + y),
            Instruction::Subtract { a, b } => zip(to, row(a), row(b), |x, y| x - y),
            Instruction::Multiply { a, b } => zip(to, row(a), row(b), |x, y| x * y),
            Instruction::MultiplyShift { a, b, slot: s } => {
                let s = slot(s);
                zip(to, row(a), row(b), |x, y| x.mul_add(y, s));
            }
            Instruction::MultiplyAdd { a, b, c } => {
                for (((to, x), y), z) in to.iter_mut().zip(row(a)).zip(row(b)).zip(row(c)) {
                    *to = x.mul_add(*y, *z);
                }
            }
            Instruction::Reciprocal { a } => map(to, row(a), |x| 1.0 / x),
            Instruction::Raise { a, slot: s } => {
                power::raised(tape.set, row(a), slot(s), to);
            }
            Instruction::Power { a, b } => power::powers(tape.set, row(a), row(b), to),
            Instruction::Apply { a, function } => elementary::apply(tape.set, function, row(a), to),
        }
        while let Some(&&(_, output)) = stores.peek().filter(|s| s.0 == at as u32) {
            stores.next();
            let into = &mut block.out[output as usize * block.lanes + block.start..];
            into[..block.width].copy_from_slice(&to[..block.width]);
        }
    }
}

#[inline(always)]
fn map(to: &mut [f64], from: &[f64], f: impl Fn(f64) -> f64) {
    for (to, &x) in to.iter_mut().zip(from) {
        *to = f(x);
    }
}

#[inline(always)]
fn zip(to: &mut [f64], a: &[f64], b: &[f64], f: impl Fn(f64, f64) -> f64) {
    for ((to, &x), &y) in to.iter_mut().zip(a).zip(b) {
        *to = f(x, y);
    }
}

/// The tape after register allocation; the fields are those of [`Tape`].
struct Allocated {
    code: Vec<(Instruction, u32)>,
    stores: Vec<(u32, u32)>,
    registers: usize,
}

/// Gives each value a register, taking registers back after the last use.
fn allocate(lowered: &Lowered) -> Allocated {
    let mut last_use: Vec<usize> = (0..lowered.code.len()).collect();
    for (at, instruction) in lowered.code.iter().enumerate() {
        for operand in instruction.operands() {
            last_use[operand as usize] = at;
        }
    }
    let mut stores: Vec<(u32, u32)> =
        lowered.outputs.iter().enumerate().map(|(output, &value)| (value, output as u32)).collect();
    stores.sort_unstable();
    let mut free: Vec<u32> = Vec::new();
    let mut registers = 0;
    let mut register_of: Vec<u32> = Vec::with_capacity(lowered.code.len());
    let mut code = Vec::with_capacity(lowered.code.len());
    for (at, &instruction) in lowered.code.iter().enumerate() {
        let renamed = instruction.renamed(|value| register_of[value as usize]);
        let mut ended: Vec<u32> = instruction
            .operands()
            .filter(|&operand| last_use[operand as usize] == at)
            .map(|operand| register_of[operand as usize])
            .collect();
        ended.sort_unstable();
        ended.dedup();
        let mut take = |free: &mut Vec<u32>| {
            free.pop().unwrap_or_else(|| {
                registers += 1;
                registers - 1
            })
        };
        // Never one that the instruction reads: the compiler then sees that nothing overlaps.
        let to = take(&mut free);
        free.append(&mut ended);
        register_of.push(to);
        if last_use[at] == at {
            free.push(to);
        }
        code.push((renamed, to));
    }
    Allocated { code, stores, registers: registers as usize }
}
