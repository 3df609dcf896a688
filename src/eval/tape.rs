//! The batched evaluator: a tape of instructions, each run over a block of points.

use super::instruction::{Instruction, Value};
use super::lower::Lowered;
use super::processor::dispatched;
use super::uniform::Uniforms;
use super::{Backend, Evaluator, InstructionSet, elementary};
use crate::expr::raise;

/// Points that one arithmetic operation takes at a time; the compiler makes vectors of them.
const CHUNK: usize = 16;
/// Bytes of a block's registers: they share the first-level cache with rows that come and go.
const BLOCK_BYTES: usize = 24 << 10;
/// Most chunks of one block: more would not make the instructions' share any smaller.
const MOST_CHUNKS: usize = 16;

type Chunk = [f64; CHUNK];

/// Registers are reused as soon as their value is no longer needed.
pub struct Tape {
    /// Instructions with registers in place of values, and the register each writes to.
    code: Vec<(Instruction, u32)>,
    /// Output rows that are stored right after an instruction: (instruction, output).
    stores: Vec<(u32, u32)>,
    uniforms: Uniforms,
    registers: usize,
    /// Chunks of one block.
    chunks: usize,
    outputs: usize,
    set: InstructionSet,
}

impl Tape {
    pub fn new(lowered: &Lowered, uniforms: Uniforms, set: InstructionSet) -> Tape {
        let Allocated { code, stores, registers } = allocate(lowered);
        let chunk_bytes = registers.max(1) * CHUNK * size_of::<f64>();
        let chunks = (BLOCK_BYTES / chunk_bytes).clamp(2, MOST_CHUNKS);
        let outputs = lowered.outputs.len();
        Tape { code, stores, uniforms, registers, chunks, outputs, set }
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
        let registers = self.registers.max(1) * self.chunks * CHUNK;
        workspace.resize(workspace.len().max(registers + slots + steps), 0.0);
        let (registers, rest) = workspace.split_at_mut(registers);
        let (slots, steps) = rest.split_at_mut(slots);
        self.uniforms.evaluate(uniform, steps, |slot, value| slots[slot] = value);
        let (registers, _) = registers.as_chunks_mut::<CHUNK>();
        let most = self.chunks * CHUNK;
        for start in (0..lanes).step_by(most) {
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
    fn run(tape: &Tape, block: &mut Block, registers: &mut [Chunk]) = run_block;
}

/// `width` points of each row from `start` are real; the last chunk is padded.
#[inline(always)]
fn run_block(tape: &Tape, block: &mut Block, registers: &mut [Chunk]) {
    let mut stores = tape.stores.iter().peekable();
    let used = block.width.div_ceil(CHUNK);
    let slot = |slot: u32| block.slots[slot as usize];
    for (at, &(instruction, to)) in tape.code.iter().enumerate() {
        let row = |r: Value| r as usize * tape.chunks;
        let to = row(to);
        match instruction {
            Instruction::Load { input } => {
                let from = &block.points[input as usize * block.lanes + block.start..];
                for (c, chunk) in from[..block.width].chunks(CHUNK).enumerate() {
                    registers[to + c][..chunk.len()].copy_from_slice(chunk);
                }
            }
            Instruction::Broadcast { slot: s } => {
                registers[to..to + used].fill([slot(s); CHUNK]);
            }
            Instruction::Scale { a, slot: s } => {
                let s = slot(s);
                map(registers, used, to, row(a), |x| x * s);
            }
            Instruction::Shift { a, slot: s } => {
                let s = slot(s);
                map(registers, used, to, row(a), |x| x + s);
            }
            Instruction::ScaleShift { a, slot: s, shift } => {
                let (s, shift) = (slot(s), slot(shift));
                map(registers, used, to, row(a), |x| x.mul_add(s, shift));
            }
            Instruction::AddScaled { a, b, slot: s } => {
                let s = slot(s);
                zip(registers, used, to, row(a), row(b), |x, y| y.mul_add(s, x));
            }
            Instruction::Add { a, b } => {
                zip(registers, used, to, row(a), row(b), |x, y| x + y);
            }
            Instruction::Subtract { a, b } => {
                zip(registers, used, to, row(a), row(b), |x, y| x - y);
            }
            Instruction::Multiply { a, b } => {
                zip(registers, used, to, row(a), row(b), |x, y| x * y);
            }
            Instruction::MultiplyShift { a, b, slot: s } => {
                let s = slot(s);
                zip(registers, used, to, row(a), row(b), |x, y| x.mul_add(y, s));
            }
            Instruction::MultiplyAdd { a, b, c } => {
                let (a, b, c) = (row(a), row(b), row(c));
                for i in 0..used {
                    let (x, y, z) = (registers[a + i], registers[b + i], registers[c + i]);
                    let mut result = [0.0; CHUNK];
                    for i in 0..CHUNK {
                        result[i] = x[i].mul_add(y[i], z[i]);
                    }
                    registers[to + i] = result;
                }
            }
            Instruction::Reciprocal { a } => map(registers, used, to, row(a), |x| 1.0 / x),
            Instruction::Raise { a, slot: s } => {
                let exponent = slot(s);
                map(registers, used, to, row(a), |x| raise(x, exponent));
            }
            Instruction::Power { a, b } => {
                zip(registers, used, to, row(a), row(b), |x, y| x.powf(y));
            }
            Instruction::Apply { a, function } => {
                let a = row(a);
                // A function never writes to the register that it reads.
                let (from, to) = if a < to {
                    let (left, right) = registers.split_at_mut(to);
                    (&left[a..a + used], &mut right[..used])
                } else {
                    let (left, right) = registers.split_at_mut(a);
                    (&right[..used], &mut left[to..to + used])
                };
                elementary::apply(tape.set, function, from.as_flattened(), to.as_flattened_mut());
            }
        }
        while let Some(&&(_, output)) = stores.peek().filter(|s| s.0 == at as u32) {
            stores.next();
            let into = &mut block.out[output as usize * block.lanes + block.start..];
            for (c, chunk) in into[..block.width].chunks_mut(CHUNK).enumerate() {
                chunk.copy_from_slice(&registers[to + c][..chunk.len()]);
            }
        }
    }
}

/// Operands are copied to locals first: the compiler then sees that nothing overlaps.
#[inline(always)]
fn map(registers: &mut [Chunk], used: usize, to: usize, a: usize, f: impl Fn(f64) -> f64) {
    for c in 0..used {
        let x = registers[a + c];
        let mut result = [0.0; CHUNK];
        for i in 0..CHUNK {
            result[i] = f(x[i]);
        }
        registers[to + c] = result;
    }
}

#[inline(always)]
fn zip(
    registers: &mut [Chunk],
    used: usize,
    to: usize,
    a: usize,
    b: usize,
    f: impl Fn(f64, f64) -> f64,
) {
    for c in 0..used {
        let (x, y) = (registers[a + c], registers[b + c]);
        let mut result = [0.0; CHUNK];
        for i in 0..CHUNK {
            result[i] = f(x[i], y[i]);
        }
        registers[to + c] = result;
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
        let to = if matches!(instruction, Instruction::Apply { .. }) {
            let to = take(&mut free);
            free.append(&mut ended);
            to
        } else {
            free.append(&mut ended);
            take(&mut free)
        };
        register_of.push(to);
        if last_use[at] == at {
            free.push(to);
        }
        code.push((renamed, to));
    }
    Allocated { code, stores, registers: registers as usize }
}
