//! The batched evaluator: a tape of instructions, each run over a block of points.

use std::collections::HashMap;

use super::lower::{Instruction, Lowered, Value};
use super::{Evaluator, Inputs};
use crate::expr::{Expr, Function, Graph, Node, Number, Symbol, raise};

/// Points that one arithmetic operation takes at a time; the compiler makes vectors of them.
const CHUNK: usize = 16;
/// Chunks of one block: a few dozen registers of a block fit the first-level cache.
const CHUNKS: usize = 8;
/// Points of one block, at most.
const BLOCK: usize = CHUNK * CHUNKS;

type Chunk = [f64; CHUNK];

/// Registers are reused as soon as their value is no longer needed.
pub struct Tape {
    /// Instructions with registers in place of values, and the register each writes to.
    code: Vec<(Instruction, u32)>,
    /// Output rows that are stored right after an instruction: (instruction, output).
    stores: Vec<(u32, u32)>,
    slots: Vec<(f64, Vec<(usize, f64)>)>,
    scalars: Vec<Scalar>,
    registers: usize,
    outputs: usize,
}

/// A step of the program that computes uniform expressions; operands are earlier steps.
enum Scalar {
    Number(f64),
    /// A row of `uniform`; `None` for a symbol that is no input.
    Uniform(Option<usize>),
    Sum(f64, Vec<(usize, f64)>),
    Product(Vec<(usize, f64)>),
    Power(usize, usize),
    Apply(Function, usize),
}

impl Tape {
    pub fn new(graph: &Graph, inputs: &Inputs, outputs: &[Expr]) -> Tape {
        let lowered = Lowered::new(graph, inputs, outputs);
        let (scalars, place) = scalar_program(graph, inputs, &lowered);
        let slots = lowered
            .slots
            .iter()
            .map(|slot| {
                (slot.factor, slot.parts.iter().map(|&(e, power)| (place[&e], power)).collect())
            })
            .collect();
        let Allocated { code, stores, registers } = allocate(&lowered);
        Tape { code, stores, slots, scalars, registers, outputs: outputs.len() }
    }

    fn slot_values(&self, uniform: &[f64]) -> Vec<f64> {
        let mut values: Vec<f64> = Vec::with_capacity(self.scalars.len());
        for step in &self.scalars {
            let value = match step {
                Scalar::Number(value) => *value,
                Scalar::Uniform(row) => {
                    row.and_then(|row| uniform.get(row)).copied().unwrap_or(f64::NAN)
                }
                Scalar::Sum(constant, terms) => {
                    constant + terms.iter().map(|&(i, c)| c * values[i]).sum::<f64>()
                }
                Scalar::Product(parts) => parts.iter().map(|&(i, e)| raise(values[i], e)).product(),
                Scalar::Power(base, exponent) => values[*base].powf(values[*exponent]),
                Scalar::Apply(function, argument) => (function.row().value)(values[*argument]),
            };
            values.push(value);
        }
        self.slots
            .iter()
            .map(|(factor, parts)| {
                factor * parts.iter().map(|&(i, e)| raise(values[i], e)).product::<f64>()
            })
            .collect()
    }

    /// Runs one block. `width` points of each row from `start` are real; the last chunk is padded.
    #[inline(always)]
    fn run(&self, block: &mut Block, registers: &mut [Chunk]) {
        let mut stores = self.stores.iter().peekable();
        let used = block.width.div_ceil(CHUNK);
        for (at, &(instruction, to)) in self.code.iter().enumerate() {
            let to = to as usize * CHUNKS;
            let row = |r: Value| r as usize * CHUNKS;
            match instruction {
                Instruction::Load { input } => {
                    let from = &block.points[input as usize * block.lanes + block.start..];
                    for (c, chunk) in from[..block.width].chunks(CHUNK).enumerate() {
                        registers[to + c][..chunk.len()].copy_from_slice(chunk);
                    }
                }
                Instruction::Broadcast { slot } => {
                    registers[to..to + used].fill([block.slots[slot as usize]; CHUNK]);
                }
                Instruction::Scale { a, slot } => {
                    let s = block.slots[slot as usize];
                    map(registers, used, to, row(a), |x| x * s);
                }
                Instruction::Shift { a, slot } => {
                    let s = block.slots[slot as usize];
                    map(registers, used, to, row(a), |x| x + s);
                }
                Instruction::AddScaled { a, b, slot } => {
                    let s = block.slots[slot as usize];
                    zip(registers, used, to, row(a), row(b), |x, y| x + y * s);
                }
                Instruction::Multiply { a, b } => {
                    zip(registers, used, to, row(a), row(b), |x, y| x * y);
                }
                Instruction::Reciprocal { a } => map(registers, used, to, row(a), |x| 1.0 / x),
                Instruction::Raise { a, slot } => {
                    let exponent = block.slots[slot as usize];
                    map(registers, used, to, row(a), |x| raise(x, exponent));
                }
                Instruction::Power { a, b } => {
                    zip(registers, used, to, row(a), row(b), |x, y| x.powf(y));
                }
                Instruction::Apply { a, function } => {
                    map(registers, used, to, row(a), function.row().value);
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

    /// The same arithmetic in wider registers. Nothing is fused, so results are the same bits.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn run_avx2(&self, block: &mut Block, registers: &mut [Chunk]) {
        self.run(block, registers);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f")]
    fn run_avx512(&self, block: &mut Block, registers: &mut [Chunk]) {
        self.run(block, registers);
    }

    fn run_widest(&self, block: &mut Block, registers: &mut [Chunk]) {
        #[cfg(target_arch = "x86_64")]
        {
            if std::arch::is_x86_feature_detected!("avx512f") {
                // SAFETY: the instruction set was just found on this processor.
                return unsafe { self.run_avx512(block, registers) };
            }
            if std::arch::is_x86_feature_detected!("avx2") {
                // SAFETY: the instruction set was just found on this processor.
                return unsafe { self.run_avx2(block, registers) };
            }
        }
        self.run(block, registers);
    }
}

impl Evaluator for Tape {
    fn outputs(&self) -> usize {
        self.outputs
    }

    fn evaluate(
        &self,
        points: &[f64],
        uniform: &[f64],
        lanes: usize,
        out: &mut [f64],
        workspace: &mut Vec<f64>,
    ) {
        let slots = self.slot_values(uniform);
        workspace.resize((self.registers.max(1)) * BLOCK, 0.0);
        let (registers, _) = workspace.as_chunks_mut::<CHUNK>();
        for start in (0..lanes).step_by(BLOCK) {
            let width = BLOCK.min(lanes - start);
            let mut block = Block { points, slots: &slots, lanes, start, width, out: &mut *out };
            self.run_widest(&mut block, registers);
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

/// Operands are copied to locals first: the compiler then sees that nothing overlaps.
#[inline(always)]
fn map(registers: &mut [Chunk], used: usize, to: usize, a: usize, f: impl Fn(f64) -> f64) {
    for c in 0..used {
        let x = registers[a + c];
        registers[to + c] = std::array::from_fn(|i| f(x[i]));
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
        let x = registers[a + c];
        let y = registers[b + c];
        registers[to + c] = std::array::from_fn(|i| f(x[i], y[i]));
    }
}

/// The steps that compute every uniform expression the slots ask for, and where each stands.
fn scalar_program(
    graph: &Graph,
    inputs: &Inputs,
    lowered: &Lowered,
) -> (Vec<Scalar>, HashMap<Expr, usize>) {
    let roots: Vec<Expr> =
        lowered.slots.iter().flat_map(|slot| slot.parts.iter().map(|&(e, _)| e)).collect();
    let row_of: HashMap<Symbol, usize> =
        inputs.uniform.iter().enumerate().map(|(i, &s)| (s, i)).collect();
    let mut place: HashMap<Expr, usize> = HashMap::new();
    let mut steps = Vec::new();
    for expr in graph.topological(&roots) {
        let pairs = |list: &[(Expr, Number)]| -> Vec<(usize, f64)> {
            list.iter().map(|(e, c)| (place[e], c.value())).collect()
        };
        let step = match graph.node(expr) {
            Node::Number(number) => Scalar::Number(number.value()),
            Node::Symbol(symbol) => Scalar::Uniform(row_of.get(symbol).copied()),
            Node::Sum { constant, terms } => Scalar::Sum(constant.value(), pairs(terms)),
            Node::Product(parts) => Scalar::Product(pairs(parts)),
            Node::Power(base, exponent) => Scalar::Power(place[base], place[exponent]),
            Node::Apply(function, argument) => Scalar::Apply(*function, place[argument]),
        };
        place.insert(expr, steps.len());
        steps.push(step);
    }
    (steps, place)
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
        for operand in instruction.operands().into_iter().flatten() {
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
        let renamed = rename(instruction, &register_of);
        let mut operands: Vec<Value> = instruction.operands().into_iter().flatten().collect();
        operands.dedup();
        for operand in operands {
            if last_use[operand as usize] == at {
                free.push(register_of[operand as usize]);
            }
        }
        let to = free.pop().unwrap_or_else(|| {
            registers += 1;
            registers - 1
        });
        register_of.push(to);
        if last_use[at] == at {
            free.push(to);
        }
        code.push((renamed, to));
    }
    Allocated { code, stores, registers: registers as usize }
}

fn rename(instruction: Instruction, register_of: &[u32]) -> Instruction {
    let r = |value: Value| register_of[value as usize];
    match instruction {
        Instruction::Load { .. } | Instruction::Broadcast { .. } => instruction,
        Instruction::Scale { a, slot } => Instruction::Scale { a: r(a), slot },
        Instruction::Shift { a, slot } => Instruction::Shift { a: r(a), slot },
        Instruction::Reciprocal { a } => Instruction::Reciprocal { a: r(a) },
        Instruction::Raise { a, slot } => Instruction::Raise { a: r(a), slot },
        Instruction::Apply { a, function } => Instruction::Apply { a: r(a), function },
        Instruction::AddScaled { a, b, slot } => Instruction::AddScaled { a: r(a), b: r(b), slot },
        Instruction::Multiply { a, b } => Instruction::Multiply { a: r(a), b: r(b) },
        Instruction::Power { a, b } => Instruction::Power { a: r(a), b: r(b) },
    }
}
