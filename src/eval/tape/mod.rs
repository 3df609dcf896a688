//! The batched evaluator: a tape of steps, run over one block of points after the other.
//!
//! A step does the same to all points of a block, so that what it costs to tell steps apart is
//! shared by them. Blocks are of a fixed number of points: the accumulator of a block is then a
//! number of registers of the processor.

mod program;
mod vector;

use self::program::{Program, Step};
use self::vector::{Row, Vector, horner, load, numbers, numbers_mut, put, rows, store};
use super::aligned::aligned_part;
use super::lower::Lowered;
use super::uniform::Uniforms;
use super::{Backend, Evaluator, InstructionSet, elementary, power};

/// A function as a tape.
pub(super) struct Tape {
    program: Program,
    uniforms: Uniforms,
    outputs: usize,
    set: InstructionSet,
}

/// Runs a tape for one block, with memory for the registers of the tape.
type Run = fn(&Program, &mut Block, &mut [f64]);

/// How an instruction set runs a tape.
struct Runs {
    /// Numbers in a register of the processor.
    lanes: usize,
    /// Registers of the processor that hold a row of a block, widest block first, and the code.
    /// The widest leaves room for operands, where the registers are known.
    widths: [(usize, Run); 4],
}

impl Runs {
    fn of(set: InstructionSet) -> Runs {
        match set {
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512 => Runs {
                lanes: 8,
                widths: [(8, avx512::<8>), (4, avx512::<4>), (2, avx512::<2>), (1, avx512::<1>)],
            },
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2 => Runs {
                lanes: 4,
                widths: [(12, avx2::<12>), (4, avx2::<4>), (2, avx2::<2>), (1, avx2::<1>)],
            },
            // Loops that the compiler makes vectors of, as wide as the processor has them.
            _ => Runs {
                lanes: 1,
                widths: [(64, plain::<64>), (16, plain::<16>), (8, plain::<8>), (1, plain::<1>)],
            },
        }
    }
}

impl Tape {
    pub(super) fn new(lowered: &Lowered, uniforms: Uniforms, set: InstructionSet) -> Tape {
        let set = set.min(InstructionSet::widest());
        Tape { program: Program::new(lowered), uniforms, outputs: lowered.outputs.len(), set }
    }

    /// All blocks. `again`: the numbers of the steps may be in the workspace from last time.
    fn run(
        &self,
        points: &[f64],
        uniform: &[f64],
        lanes: usize,
        out: &mut [f64],
        workspace: &mut Vec<f64>,
        again: bool,
    ) {
        let runs = Runs::of(self.set);
        let count = self.program.slots.len();
        let (slots, steps) = (self.uniforms.len(), self.uniforms.scratch());
        let [(widest, _), ..] = runs.widths;
        let registers = self.program.registers * widest * runs.lanes;
        let (memory, there) = aligned_part(workspace, registers + count + slots + steps);
        let (registers, rest) = memory.split_at_mut(registers);
        let (numbers, rest) = rest.split_at_mut(count);
        if !(again && there) {
            let (slots, steps) = rest.split_at_mut(slots);
            self.uniforms.evaluate(uniform, steps, |slot, value| slots[slot] = value);
            for (number, &slot) in numbers.iter_mut().zip(&self.program.slots) {
                *number = slots[slot as usize];
            }
        }
        let mut done = 0;
        while done < lanes {
            // The widest block of which more than half is filled; the narrowest always is.
            let left = (lanes - done).div_ceil(runs.lanes);
            let [.., narrowest] = runs.widths;
            let fitting = runs.widths.into_iter().find(|&(width, _)| 2 * left > width);
            let (width, run) = fitting.unwrap_or(narrowest);
            let size = width * runs.lanes;
            // Points before are done once more, with the same results, rather than a part of a
            // block be filled up.
            let start = done.min(lanes.saturating_sub(size));
            let count = size.min(lanes - start);
            let set = self.set;
            let mut block = Block { set, points, numbers, lanes, start, count, out: &mut *out };
            run(&self.program, &mut block, registers);
            done = start + count;
        }
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
        self.run(points, uniform, lanes, out, workspace, true);
    }
}

/// What one run over the tape works on.
struct Block<'a> {
    set: InstructionSet,
    points: &'a [f64],
    /// Numbers of the steps.
    numbers: &'a [f64],
    lanes: usize,
    start: usize,
    /// Points that are real; what fills up the block is not.
    count: usize,
    out: &'a mut [f64],
}

fn plain<const W: usize>(program: &Program, block: &mut Block, registers: &mut [f64]) {
    run_block::<f64, W>(program, block, registers);
}

/// Defines a function for an instruction set and a kind of register.
#[cfg(target_arch = "x86_64")]
macro_rules! compiled_for {
    ($name:ident, $register:ident, $features:literal) => {
        #[allow(unsafe_code, reason = "code for an instruction set runs where the set was found")]
        fn $name<const W: usize>(program: &Program, block: &mut Block, registers: &mut [f64]) {
            #[target_feature(enable = $features)]
            fn run<const W: usize>(program: &Program, block: &mut Block, registers: &mut [f64]) {
                run_block::<std::arch::x86_64::$register, W>(program, block, registers);
            }
            // SAFETY: `Tape::new` found the instruction set on this processor.
            unsafe { run::<W>(program, block, registers) }
        }
    };
}

#[cfg(target_arch = "x86_64")]
compiled_for!(avx2, __m256d, "avx2,fma");
#[cfg(target_arch = "x86_64")]
compiled_for!(avx512, __m512d, "avx512f,avx2,fma");

/// Runs a tape for one block of `W` registers of kind `V`.
#[inline(always)]
fn run_block<V: Vector, const W: usize>(
    program: &Program,
    block: &mut Block,
    registers: &mut [f64],
) {
    let registers = rows::<V, W>(registers);
    let given = block.numbers;
    let mut x: Row<V, W> = [V::splat(0.0); W];
    /// The accumulator at each of its registers.
    macro_rules! each {
        ($i:ident => $value:expr) => {
            for $i in 0..W {
                x[$i] = $value;
            }
        };
    }
    macro_rules! of {
        ($place:expr) => {
            &registers[$place as usize]
        };
    }
    macro_rules! number {
        ($first:expr) => {
            V::splat(given[$first as usize])
        };
    }
    for &step in &program.steps {
        match step {
            Step::Load { input } => {
                let from = &block.points[input as usize * block.lanes + block.start..];
                load(&mut x, &from[..block.count]);
            }
            Step::Broadcast { first } => x = [number!(first); W],
            Step::Fetch { a } => put(&mut x, of!(a)),
            Step::Scale { first } => {
                let s = number!(first);
                each!(i => x[i].times(s));
            }
            Step::ScaleOf { a, first } => {
                let (a, s) = (of!(a), number!(first));
                each!(i => a[i].times(s));
            }
            Step::Shift { first } => {
                let s = number!(first);
                each!(i => x[i].plus(s));
            }
            Step::ScaleShift { first } => {
                let (s, shift) = (number!(first), number!(first + 1));
                each!(i => x[i].fused(s, shift));
            }
            Step::ScaleAdd { a, first } => {
                let (a, s) = (of!(a), number!(first));
                each!(i => x[i].fused(s, a[i]));
            }
            Step::AddScaledOf { a, b, first } => {
                let (a, b, s) = (of!(a), of!(b), number!(first));
                each!(i => b[i].fused(s, a[i]));
            }
            Step::AddScaled { list, first, count } => {
                let list = &program.list[list as usize..][..count as usize];
                for (&b, &s) in list.iter().zip(&given[first as usize..]) {
                    let (b, s) = (of!(b), V::splat(s));
                    each!(i => b[i].fused(s, x[i]));
                }
            }
            Step::Add { b } => {
                let b = of!(b);
                each!(i => x[i].plus(b[i]));
            }
            Step::AddOf { a, b } => {
                let (a, b) = (of!(a), of!(b));
                each!(i => a[i].plus(b[i]));
            }
            Step::Subtract { b } => {
                let b = of!(b);
                each!(i => x[i].minus(b[i]));
            }
            Step::SubtractFrom { a } => {
                let a = of!(a);
                each!(i => a[i].minus(x[i]));
            }
            Step::SubtractOf { a, b } => {
                let (a, b) = (of!(a), of!(b));
                each!(i => a[i].minus(b[i]));
            }
            Step::Square => each!(i => x[i].times(x[i])),
            Step::Multiply { b } => {
                let b = of!(b);
                each!(i => x[i].times(b[i]));
            }
            Step::MultiplyOf { a, b } => {
                let (a, b) = (of!(a), of!(b));
                each!(i => a[i].times(b[i]));
            }
            Step::Horner { b, first, count } => {
                let b = of!(b);
                horner(&mut x, b, &given[first as usize..][..count as usize]);
            }
            Step::PolynomialOf { b, first, count } => {
                let b = of!(b);
                let (s, shift) = (number!(first), number!(first + 1));
                each!(i => b[i].fused(s, shift));
                horner(&mut x, b, &given[first as usize..][2..count as usize]);
            }
            Step::MultiplyShiftOf { a, b, first } => {
                let (a, b, s) = (of!(a), of!(b), number!(first));
                each!(i => a[i].fused(b[i], s));
            }
            Step::MultiplyAdd { b, c } => {
                let (b, c) = (of!(b), of!(c));
                each!(i => x[i].fused(b[i], c[i]));
            }
            Step::MultiplyAddOf { a, b, c } => {
                let (a, b, c) = (of!(a), of!(b), of!(c));
                each!(i => a[i].fused(b[i], c[i]));
            }
            Step::AddProduct { a, b } => {
                let (a, b) = (of!(a), of!(b));
                each!(i => a[i].fused(b[i], x[i]));
            }
            Step::Reciprocal => {
                let one = V::splat(1.0);
                each!(i => one.over(x[i]));
            }
            Step::RaiseOf { a, to, first } => {
                let (from, exponent) = (*of!(a), given[first as usize]);
                let to = &mut registers[to as usize];
                power::raised(block.set, numbers(&from), exponent, numbers_mut(to));
                put(&mut x, to);
            }
            Step::PowerOf { a, b, to } => {
                let (bases, exponents) = (*of!(a), *of!(b));
                let to = &mut registers[to as usize];
                power::powers(block.set, numbers(&bases), numbers(&exponents), numbers_mut(to));
                put(&mut x, to);
            }
            Step::ApplyOf { a, to, function } => {
                let from = *of!(a);
                let to = &mut registers[to as usize];
                elementary::apply(block.set, function, numbers(&from), numbers_mut(to));
                put(&mut x, to);
            }
            Step::Store { to } => put(&mut registers[to as usize], &x),
            Step::Output { row } => {
                let to = &mut block.out[row as usize * block.lanes + block.start..];
                store(&x, &mut to[..block.count]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::{Inputs, compile_for};
    use crate::expr::{Function, Graph, Symbol};

    /// Horner's scheme, sums, products, quotients, powers and functions of two variables.
    fn compiled(set: InstructionSet) -> Box<dyn Evaluator> {
        let mut graph = Graph::new();
        let variables = [Symbol::Coordinate(0), Symbol::Momentum(0)];
        let [x, y] = variables.map(|symbol| graph.symbol(symbol));
        let mut terms = Vec::new();
        for k in 0..16 {
            let c = graph.symbol(Symbol::Coefficient(k));
            let powers = [(c, 1.0), (x, (k / 4) as f64), (y, (k % 4) as f64)];
            terms.push((1.0, graph.product(1.0, &powers)));
        }
        let polynomial = graph.linear(0.5, &terms);
        let sine = graph.apply(Function::SIN, polynomial);
        let square = graph.product(1.0, &[(x, 2.0)]);
        let above_one = graph.linear(1.5, &[(1.0, square)]);
        let quotient = graph.product(1.0, &[(sine, 1.0), (above_one, -1.0)]);
        let power = graph.product(1.0, &[(above_one, 0.3), (y, 1.0)]);
        let outputs = [polynomial, quotient, power, x];
        let inputs = Inputs {
            varying: variables.to_vec(),
            uniform: (0..16).map(Symbol::Coefficient).collect(),
        };
        compile_for(&graph, &inputs, &outputs, Backend::Batched, set)
    }

    #[test]
    fn every_number_of_points_is_worked_on_alike() {
        const MOST: usize = 150;
        let value = |i: usize| (0.7 * i as f64).sin();
        let given: Vec<f64> = (0..16).map(|k| 0.3 + value(k)).collect();
        let mut expected = vec![[0.0; 4]; MOST];
        for (i, out) in expected.iter_mut().enumerate() {
            let tape = compiled(InstructionSet::Plain);
            tape.evaluate(&[value(i), value(i + MOST)], &given, 1, out, &mut Vec::new());
        }
        for set in InstructionSet::available() {
            let tape = compiled(set);
            for lanes in 1..=MOST {
                let points: Vec<f64> =
                    (0..lanes).map(value).chain((MOST..MOST + lanes).map(value)).collect();
                let (mut out, mut workspace) = (vec![0.0; 4 * lanes], Vec::new());
                tape.evaluate(&points, &given, lanes, &mut out, &mut workspace);
                let first = out.clone();
                out.fill(0.0);
                tape.evaluate_again(&points, &given, lanes, &mut out, &mut workspace);
                assert_eq!(out, first, "{set:?}, {lanes} points");
                for (row, found) in out.chunks(lanes).enumerate() {
                    let alike = found.iter().zip(&expected).all(|(x, of)| *x == of[row]);
                    assert!(alike, "{set:?}, {lanes} points, output {row}");
                }
            }
        }
    }
}
