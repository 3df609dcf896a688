//! The batched evaluator: a tape of steps, run over one block of points after the other.
//!
//! A step does the same to all points of a block, so that what it costs to tell steps apart is
//! shared by them. Blocks are of a fixed number of points: the accumulator of a block is then a
//! number of registers of the processor.

mod program;
mod vector;

use self::program::{Program, Step};
use self::vector::Vector;
use super::aligned::aligned_part;
use super::lower::Lowered;
use super::uniform::Uniforms;
use super::{Backend, Evaluator, InstructionSet, elementary, power};

/// Registers of the processor that hold the accumulator of a whole block. As many are left for
/// operands where there are least, sixteen.
const WIDTH: usize = 8;
/// Most points of a block: those of [`WIDTH`] of the widest registers.
const MOST_POINTS: usize = 8 * WIDTH;

/// A function as a tape.
pub struct Tape {
    program: Program,
    uniforms: Uniforms,
    outputs: usize,
    set: InstructionSet,
    /// Numbers in a register of the processor.
    lanes: usize,
}

impl Tape {
    pub fn new(lowered: &Lowered, uniforms: Uniforms, set: InstructionSet) -> Tape {
        let set = set.min(InstructionSet::widest());
        let lanes = match set {
            InstructionSet::Plain => 1,
            InstructionSet::Avx2 => 4,
            InstructionSet::Avx512 => 8,
        };
        let program = Program::new(lowered);
        Tape { program, uniforms, outputs: lowered.outputs.len(), set, lanes }
    }

    /// All blocks. `again`: the slots in the workspace are those of the uniform numbers.
    fn run(
        &self,
        points: &[f64],
        uniform: &[f64],
        lanes: usize,
        out: &mut [f64],
        workspace: &mut Vec<f64>,
        again: bool,
    ) {
        let registers = self.program.registers * self.lanes * WIDTH;
        let (slots, steps) = (self.uniforms.len(), self.uniforms.scratch());
        let (memory, there) = aligned_part(workspace, registers + slots + steps);
        let (registers, rest) = memory.split_at_mut(registers);
        let (slots, steps) = rest.split_at_mut(slots);
        if !(again && there) {
            self.uniforms.evaluate(uniform, steps, |slot, value| slots[slot] = value);
        }
        let mut start = 0;
        while start < lanes {
            let left = lanes - start;
            let whole = left > self.lanes;
            let count = left.min(if whole { self.lanes * WIDTH } else { self.lanes });
            let mut block =
                Block { set: self.set, points, slots, lanes, start, count, out: &mut *out };
            if whole {
                run_for_set::<WIDTH>(&self.program, &mut block, registers);
            } else {
                run_for_set::<1>(&self.program, &mut block, registers);
            }
            start += count;
        }
    }
}

/// Runs a tape for one block, in registers of the block's instruction set.
#[allow(unsafe_code, reason = "code for an instruction set runs where the set was found")]
fn run_for_set<const W: usize>(program: &Program, block: &mut Block, registers: &mut [f64]) {
    match block.set {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `Tape::new` found the instruction set on this processor.
        InstructionSet::Avx512 => unsafe { avx512::<W>(program, block, registers) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        InstructionSet::Avx2 => unsafe { avx2::<W>(program, block, registers) },
        _ => run_block::<f64, W>(program, block, registers),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx2,fma")]
fn avx512<const W: usize>(program: &Program, block: &mut Block, registers: &mut [f64]) {
    run_block::<std::arch::x86_64::__m512d, W>(program, block, registers);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn avx2<const W: usize>(program: &Program, block: &mut Block, registers: &mut [f64]) {
    run_block::<std::arch::x86_64::__m256d, W>(program, block, registers);
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
        self.run(points, uniform, lanes, out, workspace, false);
    }

    fn evaluate_again(
        &self,
        points: &[f64],
        uniform: &[f64],
        lanes: usize,
        out: &mut [f64],
        workspace: &mut Vec<f64>,
    ) {
        let again = !workspace.is_empty();
        self.run(points, uniform, lanes, out, workspace, again);
    }
}

/// What one run over the tape works on.
struct Block<'a> {
    set: InstructionSet,
    points: &'a [f64],
    slots: &'a [f64],
    lanes: usize,
    start: usize,
    /// Points that are real; what fills up the block is not.
    count: usize,
    out: &'a mut [f64],
}

/// Numbers of a block.
type Row<V, const W: usize> = [V; W];

/// Runs a tape for one block of `W` registers of kind `V`.
#[inline(always)]
fn run_block<V: Vector, const W: usize>(
    program: &Program,
    block: &mut Block,
    registers: &mut [f64],
) {
    let size = V::LANES * W;
    let slot = |slot: u32| V::splat(block.slots[slot as usize]);
    let mut x: Row<V, W> = [V::splat(0.0); W];
    for &step in &program.steps {
        let of = |place: u32| -> Row<V, W> { read(&registers[place as usize * size..][..size]) };
        match step {
            Step::Load { input } => {
                let from = &block.points[input as usize * block.lanes + block.start..];
                x = if block.count == size {
                    read(&from[..size])
                } else {
                    let mut whole = [0.0; MOST_POINTS];
                    whole[..block.count].copy_from_slice(&from[..block.count]);
                    read(&whole[..size])
                };
            }
            Step::Broadcast { slot: s } => x = [slot(s); W],
            Step::Fetch { a } => x = of(a),
            Step::Scale { slot: s } => x = with(x, slot(s), V::times),
            Step::ScaleOf { a, slot: s } => x = with(of(a), slot(s), V::times),
            Step::Shift { slot: s } => x = with(x, slot(s), V::plus),
            Step::ScaleShift { slot: s, shift } => x = fused(x, [slot(s); W], [slot(shift); W]),
            Step::ScaleShiftOf { a, slot: s, shift } => {
                x = fused(of(a), [slot(s); W], [slot(shift); W]);
            }
            Step::ScaleAdd { a, slot: s } => x = fused(x, [slot(s); W], of(a)),
            Step::AddScaledOf { a, b, slot: s } => x = fused(of(b), [slot(s); W], of(a)),
            Step::AddScaled { first, count } => {
                for &(b, s) in &program.pairs[first as usize..][..count as usize] {
                    x = fused(of(b), [slot(s); W], x);
                }
            }
            Step::Add { b } => x = both(x, of(b), V::plus),
            Step::AddOf { a, b } => x = both(of(a), of(b), V::plus),
            Step::Subtract { b } => x = both(x, of(b), V::minus),
            Step::SubtractFrom { a } => x = both(of(a), x, V::minus),
            Step::SubtractOf { a, b } => x = both(of(a), of(b), V::minus),
            Step::Square => x = both(x, x, V::times),
            Step::Multiply { b } => x = both(x, of(b), V::times),
            Step::MultiplyOf { a, b } => x = both(of(a), of(b), V::times),
            Step::Horner { b, first, count } => {
                let b = of(b);
                for &s in &program.slots[first as usize..][..count as usize] {
                    x = fused(x, b, [slot(s); W]);
                }
            }
            Step::MultiplyShiftOf { a, b, slot: s } => x = fused(of(a), of(b), [slot(s); W]),
            Step::MultiplyAdd { b, c } => x = fused(x, of(b), of(c)),
            Step::MultiplyAddOf { a, b, c } => x = fused(of(a), of(b), of(c)),
            Step::AddProducts { first, count } => {
                for &(a, b) in &program.pairs[first as usize..][..count as usize] {
                    x = fused(of(a), of(b), x);
                }
            }
            Step::Reciprocal => x = both([V::splat(1.0); W], x, V::over),
            Step::Raise { slot: s } => {
                let exponent = block.slots[s as usize];
                x = by_rows(x, |from, to| power::raised(block.set, from, exponent, to));
            }
            Step::Power { b } => {
                let exponents = &registers[b as usize * size..][..size];
                x = by_rows(x, |from, to| power::powers(block.set, from, exponents, to));
            }
            Step::Apply { function } => {
                x = by_rows(x, |from, to| elementary::apply(block.set, function, from, to));
            }
            Step::Store { to } => write(x, &mut registers[to as usize * size..][..size]),
            Step::Output { row } => {
                let to = &mut block.out[row as usize * block.lanes + block.start..];
                if block.count == size {
                    write(x, &mut to[..size]);
                } else {
                    let mut whole = [0.0; MOST_POINTS];
                    write(x, &mut whole[..size]);
                    to[..block.count].copy_from_slice(&whole[..block.count]);
                }
            }
        }
    }
}

#[inline(always)]
fn read<V: Vector, const W: usize>(from: &[f64]) -> Row<V, W> {
    std::array::from_fn(|i| V::load(&from[i * V::LANES..]))
}

#[inline(always)]
fn write<V: Vector, const W: usize>(x: Row<V, W>, to: &mut [f64]) {
    for (i, x) in x.into_iter().enumerate() {
        x.store(&mut to[i * V::LANES..]);
    }
}

#[inline(always)]
fn with<V: Vector, const W: usize>(a: Row<V, W>, b: V, f: fn(V, V) -> V) -> Row<V, W> {
    std::array::from_fn(|i| f(a[i], b))
}

#[inline(always)]
fn both<V: Vector, const W: usize>(a: Row<V, W>, b: Row<V, W>, f: fn(V, V) -> V) -> Row<V, W> {
    std::array::from_fn(|i| f(a[i], b[i]))
}

/// a * b + c.
#[inline(always)]
fn fused<V: Vector, const W: usize>(a: Row<V, W>, b: Row<V, W>, c: Row<V, W>) -> Row<V, W> {
    std::array::from_fn(|i| a[i].fused(b[i], c[i]))
}

/// A function of rows of numbers in memory.
#[inline(always)]
fn by_rows<V: Vector, const W: usize>(
    x: Row<V, W>,
    f: impl FnOnce(&[f64], &mut [f64]),
) -> Row<V, W> {
    let size = V::LANES * W;
    let (mut from, mut to) = ([0.0; MOST_POINTS], [0.0; MOST_POINTS]);
    write(x, &mut from[..size]);
    f(&from[..size], &mut to[..size]);
    read(&to[..size])
}
