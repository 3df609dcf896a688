//! Machine code made at run time for the expressions at hand.
//!
//! The code does the interpreter's operations in the interpreter's order, so that results are
//! the same bits; it keeps values in registers, where the interpreter goes through memory.
//! Elementary functions are not part of it: the code is cut into *phases*, and between them a
//! function runs over a whole row as in the interpreter.

#![allow(unsafe_code, reason = "machine code is made and called")]

mod assembler;
mod memory;
pub(super) mod steps;
mod straight;

use std::io;

use iced_x86::{Code, Instruction as Machine, Register};
use memmap2::Mmap;

use self::assembler::{Assembler, Width};
use self::memory::{Mapper, map};
use self::straight::{Constants, Frame, Home, Straight};
use super::aligned::aligned_part;
use super::instruction::{Instruction, Value};
use super::lower::Lowered;
use super::uniform::Uniforms;
use super::{Backend, Evaluator, InstructionSet, elementary, power};

/// Most instructions that are made machine code of.
const LONGEST: usize = 100_000;
/// Most phases: functions of functions of functions.
const MOST_PHASES: usize = 64;
/// Bytes of the rows between phases.
const BLOCK_BYTES: usize = 24 << 10;

/// A function in machine code.
pub(super) struct Machinecode {
    memory: Mmap,
    width: Width,
    /// Points that the code does at once: those of a register, or of two.
    at_once: usize,
    set: InstructionSet,
    /// Place of each phase's code, if it has any, and the calls after it.
    phases: Vec<Phase>,
    uniforms: Uniforms,
    inputs: usize,
    outputs: usize,
    /// Rows between phases.
    rows: usize,
    spills: usize,
}

struct Phase {
    entry: Option<usize>,
    calls: Vec<Call>,
}

/// A function of whole rows.
struct Call {
    /// The instruction, with rows in place of values.
    instruction: Instruction,
    to: u32,
    /// Output rows that the result is copied to.
    outputs: Vec<u32>,
}

/// What a plan becomes.
struct Written {
    bytes: Vec<u8>,
    at_once: usize,
    phases: Vec<Phase>,
    /// Registers that have to wait in memory.
    spills: u32,
}

/// A phase in machine code: rows, slots, spills, first point, end, outputs of a single point.
type Entry = unsafe extern "sysv64" fn(*const u64, *const f64, *mut f64, usize, usize, *mut f64);

const FRAME: Frame = Frame {
    table: Register::RDI,
    slots: Register::RSI,
    spills: Register::RDX,
    index: Register::RCX,
    state: Register::R9,
};

/// Whether the instruction is a call between phases.
fn is_call(instruction: Instruction) -> bool {
    match instruction {
        Instruction::Raise { .. } | Instruction::Power { .. } => true,
        Instruction::Apply { function, .. } => function.row().instruction.is_none(),
        _ => false,
    }
}

/// Whether a value is at hand in memory without being computed.
fn is_at_hand(instruction: Instruction) -> bool {
    matches!(instruction, Instruction::Load { .. } | Instruction::Broadcast { .. })
}

impl Machinecode {
    /// Machine code for the instruction set; `None` where there can be none: on a processor
    /// without AVX2, if the operating system refuses, for code that is too long.
    pub(super) fn new(
        lowered: &Lowered,
        uniforms: Uniforms,
        set: InstructionSet,
    ) -> Option<Machinecode> {
        let set = set.min(InstructionSet::widest());
        let width = match set {
            InstructionSet::Plain => return None,
            InstructionSet::Avx2 => Width::Four,
            InstructionSet::Avx512 => Width::Eight,
        };
        Machinecode::with(lowered, uniforms, set, width, map)
    }

    /// Machine code that does one point at a time.
    pub(super) fn for_one_point(lowered: &Lowered, uniforms: Uniforms) -> Option<Machinecode> {
        match InstructionSet::widest() {
            InstructionSet::Plain => None,
            set => Machinecode::with(lowered, uniforms, set, Width::One, map),
        }
    }

    fn with(
        lowered: &Lowered,
        uniforms: Uniforms,
        set: InstructionSet,
        width: Width,
        map: Mapper,
    ) -> Option<Machinecode> {
        let plan = Plan::new(lowered)?;
        // Two registers for each value hide what one instruction waits for the other, if all
        // values have room in them.
        let Written { bytes, at_once, phases, spills } = match width {
            Width::One => plan.write(lowered, width, 1)?,
            _ => plan.write(lowered, width, 2).or_else(|| plan.write(lowered, width, 1))?,
        };
        let memory: io::Result<Mmap> = map(&bytes);
        Some(Machinecode {
            memory: memory.ok()?,
            width,
            at_once,
            set,
            phases,
            uniforms,
            inputs: plan.inputs,
            outputs: lowered.outputs.len(),
            rows: plan.rows,
            spills: spills as usize,
        })
    }

    fn entry(&self, at: usize) -> Entry {
        // SAFETY: `at` is the first byte of a function that `Plan::emit` wrote with this
        // signature, in memory that is executable as long as `self` lives.
        unsafe { std::mem::transmute::<*const u8, Entry>(self.memory.as_ptr().add(at)) }
    }

    /// Points of a block.
    fn block(&self) -> usize {
        if self.phases.len() == 1 {
            return usize::MAX;
        }
        (BLOCK_BYTES / (8 * self.rows.max(1))).clamp(64, 1024) / 64 * 64
    }
}

/// Addresses of rows that stand one after the other, `apart` numbers from start to start.
fn look_up(table: &mut [f64], first: usize, apart: usize) {
    for (row, entry) in table.iter_mut().enumerate() {
        *entry = f64::from_bits(first.wrapping_add(8 * apart * row) as u64);
    }
}

/// Places in the workspace, in numbers.
struct Layout {
    slots: usize,
    spills: usize,
    rows: usize,
    table: usize,
    end: usize,
}

impl Evaluator for Machinecode {
    fn outputs(&self) -> usize {
        self.outputs
    }

    fn backend(&self) -> Backend {
        Backend::Machine
    }

    fn evaluate(
        &self,
        points: &[f64],
        uniform: &[f64],
        lanes: usize,
        out: &mut [f64],
        workspace: &mut Vec<f64>,
    ) {
        workspace.clear();
        self.evaluate_again(points, uniform, lanes, out, workspace);
    }

    fn evaluate_again(
        &self,
        points: &[f64],
        uniform: &[f64],
        lanes: usize,
        out: &mut [f64],
        workspace: &mut Vec<f64>,
    ) {
        let (width, at_once) = (self.width.lanes(), self.at_once);
        if self.width == Width::One && lanes > 1 {
            // The outputs of a point stand side by side there.
            let mut one = vec![0.0; self.outputs];
            for lane in 0..lanes {
                let point: Vec<f64> = (0..self.inputs).map(|i| points[i * lanes + lane]).collect();
                self.evaluate_again(&point, uniform, 1, &mut one, workspace);
                one.iter().enumerate().for_each(|(row, x)| out[row * lanes + lane] = *x);
            }
            return;
        }
        let points = &points[..self.inputs * lanes];
        let out = &mut out[..self.outputs * lanes];
        let block = self.block().min(lanes.next_multiple_of(at_once));
        let steps = self.uniforms.scratch();
        let count = self.uniforms.len() + 2;
        // Registers are stored whole: their places begin where a cache line does.
        let line = |at: usize| at.next_multiple_of(8);
        let slots = line(steps);
        let spills = line(slots + count * width);
        let rows = line(spills + self.spills * width);
        let table = line(rows + self.rows * block);
        let end = table + self.inputs + self.outputs + self.rows;
        let layout = Layout { slots, spills, rows, table, end };
        let last = (self.inputs + self.outputs) * at_once;
        let (memory, again) = aligned_part(workspace, layout.end + last);
        let (memory, last) = memory.split_at_mut(layout.end);
        if !again {
            let (values, rest) = memory.split_at_mut(layout.slots);
            let slots = &mut rest[..count * width];
            let mut store = |slot: usize, value: f64| slots[slot * width..][..width].fill(value);
            self.uniforms.evaluate(uniform, values, &mut store);
            store(count - 2, 1.0);
            store(count - 1, f64::from_bits(!(1 << 63)));
        }

        let whole = lanes / at_once * at_once;
        for start in (0..whole).step_by(block.max(1)) {
            let end = whole.min(start + block);
            self.run(memory, &layout, points, lanes, out, start..end, block);
        }
        if whole < lanes {
            // The last points, filled up with zeros to as many as the code does at once.
            let left = lanes - whole;
            let (from, to) = last.split_at_mut(self.inputs * at_once);
            for (input, row) in from.chunks_exact_mut(at_once).enumerate() {
                row[..left].copy_from_slice(&points[input * lanes + whole..][..left]);
                row[left..].fill(0.0);
            }
            self.run(memory, &layout, from, at_once, to, 0..at_once, block);
            for (output, row) in to.chunks_exact(at_once).enumerate() {
                out[output * lanes + whole..][..left].copy_from_slice(&row[..left]);
            }
        }
    }
}

impl Machinecode {
    /// All phases for the points `range`, whose length is a multiple of those done at once.
    #[allow(clippy::too_many_arguments)]
    fn run(
        &self,
        memory: &mut [f64],
        layout: &Layout,
        points: &[f64],
        lanes: usize,
        out: &mut [f64],
        range: std::ops::Range<usize>,
        block: usize,
    ) {
        let (inputs, outputs) = (self.inputs, self.outputs);
        let row_at = |row: usize| layout.rows + row * block;
        // Rows between phases hold one block: its first point is their first.
        let first = memory[layout.rows..].as_mut_ptr().expose_provenance();
        let first = first.wrapping_sub(8 * range.start);
        let table = &mut memory[layout.table..][..inputs + outputs + self.rows];
        let (of_inputs, rest) = table.split_at_mut(inputs);
        let (of_outputs, between) = rest.split_at_mut(outputs);
        look_up(of_inputs, points.as_ptr().expose_provenance(), lanes);
        if self.width != Width::One {
            // One point's outputs are not looked up.
            look_up(of_outputs, out.as_mut_ptr().expose_provenance(), lanes);
        }
        look_up(between, first, block);
        for phase in &self.phases {
            if let Some(at) = phase.entry {
                let memory = memory.as_mut_ptr();
                // SAFETY: the code reads `inputs` rows and writes `outputs` rows of `lanes`
                // numbers and the rows between phases at points of `range` alone, which is
                // inside `lanes` and no longer than a block; it reads the slots and uses the
                // spills. `evaluate` made all of them that large, and `new` found the
                // instruction set on this processor. Code for one point at a time is run with
                // one lane, so that `outputs` numbers at `out` are those of that point.
                unsafe {
                    self.entry(at)(
                        memory.add(layout.table).cast(),
                        memory.add(layout.slots),
                        memory.add(layout.spills),
                        range.start,
                        range.end,
                        out.as_mut_ptr(),
                    );
                }
            }
            for call in &phase.calls {
                self.call(call, memory, layout, points, lanes, range.clone(), block);
                let row = row_at(call.to as usize - inputs - outputs);
                for &output in &call.outputs {
                    out[output as usize * lanes..][range.clone()]
                        .copy_from_slice(&memory[row..][..range.len()]);
                }
            }
        }
    }

    /// A function of whole rows.
    #[allow(clippy::too_many_arguments)]
    fn call(
        &self,
        call: &Call,
        memory: &mut [f64],
        layout: &Layout,
        points: &[f64],
        lanes: usize,
        range: std::ops::Range<usize>,
        block: usize,
    ) {
        let count = range.len();
        let between = self.inputs + self.outputs;
        let (head, rows) = memory.split_at_mut(layout.rows);
        let to = (call.to as usize - between) * block;
        // The result's row is apart from those of the arguments.
        let (left, rest) = rows.split_at_mut(to);
        let (to, right) = rest.split_at_mut(block);
        let to = &mut to[..count];
        let (left, right) = (&*left, &*right);
        let row = |row: Value| -> &[f64] {
            let row = row as usize;
            if row < self.inputs {
                return &points[row * lanes..][range.clone()];
            }
            let at = (row - between) * block;
            let row = if at < left.len() { &left[at..] } else { &right[at - left.len() - block..] };
            &row[..count]
        };
        match call.instruction {
            Instruction::Apply { a, function } => elementary::apply(self.set, function, row(a), to),
            Instruction::Raise { a, slot } => {
                let exponent = head[layout.slots + slot as usize * self.width.lanes()];
                power::raised(self.set, row(a), exponent, to);
            }
            Instruction::Power { a, b } => power::powers(self.set, row(a), row(b), to),
            _ => {}
        }
    }
}

/// What is computed when, and where it waits in between.
struct Plan {
    phases: usize,
    inputs: usize,
    rows: usize,
    /// Phase of each value; that of a call is the one before it.
    phase: Vec<u32>,
    /// Row of each value that waits for a later phase.
    row: Vec<Option<u32>>,
}

impl Plan {
    fn new(lowered: &Lowered) -> Option<Plan> {
        let code = &lowered.code;
        if code.len() > LONGEST {
            return None;
        }
        let inputs = code.iter().map(|instruction| match instruction {
            Instruction::Load { input } => *input as usize + 1,
            _ => 0,
        });
        let inputs = inputs.max().unwrap_or(0);
        // When a value can be used: after a call, in the next phase.
        let mut ready = vec![0_u32; code.len()];
        let mut phase = vec![0_u32; code.len()];
        for (at, &instruction) in code.iter().enumerate() {
            phase[at] = instruction.operands().map(|v| ready[v as usize]).max().unwrap_or(0);
            ready[at] = phase[at] + u32::from(is_call(instruction));
        }
        let phases = ready.iter().max().map_or(0, |&last| last as usize) + 1;
        if phases > MOST_PHASES {
            return None;
        }
        // A value waits in a row if a call or a later phase needs it.
        let mut waits: Vec<Option<u32>> = vec![None; code.len()];
        for (at, &instruction) in code.iter().enumerate() {
            for operand in instruction.operands() {
                let v = operand as usize;
                // What is at hand in memory need not wait; but a call takes rows alone.
                let waiting = match code[v] {
                    Instruction::Load { .. } => false,
                    Instruction::Broadcast { .. } => is_call(instruction),
                    other => is_call(instruction) || is_call(other) || phase[at] > phase[v],
                };
                if waiting {
                    waits[v] = Some(waits[v].map_or(phase[at], |until| until.max(phase[at])));
                }
            }
            if is_call(instruction) {
                waits[at].get_or_insert(phase[at] + 1);
            }
        }
        // Rows are used again once nothing waits in them.
        let first = (inputs + lowered.outputs.len()) as u32;
        let mut row: Vec<Option<u32>> = vec![None; code.len()];
        let mut taken: Vec<u32> = Vec::new();
        let mut by_phase: Vec<usize> = (0..code.len()).filter(|&v| waits[v].is_some()).collect();
        by_phase.sort_by_key(|&v| phase[v]);
        for v in by_phase {
            let until = waits[v].unwrap_or(0);
            let place = match taken.iter().position(|&busy| busy < phase[v]) {
                Some(place) => place,
                None => {
                    taken.push(0);
                    taken.len() - 1
                }
            };
            taken[place] = until;
            row[v] = Some(first + place as u32);
        }
        Some(Plan { phases, inputs, rows: taken.len(), phase, row })
    }

    /// All phases in machine code. Two copies of each instruction are made only if nothing has
    /// to wait in memory: `None` otherwise.
    fn write(&self, lowered: &Lowered, width: Width, copies: u8) -> Option<Written> {
        let mut assembler = Assembler::new(width, copies);
        let at_once = assembler.lanes();
        let slots = lowered.slots.len() as u32;
        let constants = Constants { one: slots, magnitude: slots + 1 };
        let mut phases = Vec::new();
        let mut spills = 0;
        for phase in 0..self.phases {
            let (back, entry, used) = self.emit(lowered, phase as u32, assembler, constants)?;
            assembler = back;
            spills = spills.max(used);
            phases.push(Phase { entry, calls: self.calls(lowered, phase as u32) });
        }
        Some(Written { bytes: assembler.finish()?, at_once, phases, spills })
    }

    /// Writes a phase; returns the place of its code, if it has any, and its spills. `None` if
    /// copies do not fit into the registers.
    fn emit(
        &self,
        lowered: &Lowered,
        phase: u32,
        assembler: Assembler,
        constants: Constants,
    ) -> Option<(Assembler, Option<usize>, u32)> {
        let code = &lowered.code;
        let mut home = vec![None; code.len()];
        let mut stores = vec![Vec::new(); code.len()];
        let mut uses = vec![Vec::new(); code.len()];
        let mut outputs: Vec<Vec<Home>> = vec![Vec::new(); code.len()];
        for (output, &value) in lowered.outputs.iter().enumerate() {
            // One point's outputs stand side by side: no table is needed for them.
            outputs[value as usize].push(match assembler.width {
                Width::One => Home::State(output as u32),
                _ => Home::Row((self.inputs + output) as u32),
            });
        }
        let mut list = Vec::new();
        for (at, &instruction) in code.iter().enumerate() {
            let own = self.phase[at] == phase && !is_call(instruction);
            if is_at_hand(instruction) {
                home[at] = Some(match instruction {
                    Instruction::Load { input } => Home::Row(input),
                    Instruction::Broadcast { slot } => Home::Slot(slot),
                    _ => Home::Spill(0),
                });
            } else if !own && let Some(row) = self.row[at] {
                home[at] = Some(Home::Row(row));
            }
            if own {
                stores[at] = std::mem::take(&mut outputs[at]);
                stores[at].extend(self.row[at].map(Home::Row));
                if !is_at_hand(instruction) || !stores[at].is_empty() {
                    instruction.operands().for_each(|v| uses[v as usize].push(at));
                    list.push(at);
                }
            }
        }
        if list.is_empty() {
            return Some((assembler, None, 0));
        }
        let entry = assembler.position();
        let (lanes, copies) = (assembler.lanes(), assembler.copies());
        let mut straight = Straight::new(assembler, FRAME, constants, home, uses, &stores);
        for at in list {
            straight.instruction(at, at as Value, code[at]);
            if straight.spills > 0 && copies > 1 {
                return None;
            }
        }
        let spills = straight.spills;
        let mut assembler = straight.assembler;
        assembler.emit(Machine::with2(Code::Add_rm64_imm32, Register::RCX, lanes as i32));
        assembler.emit(Machine::with2(Code::Cmp_r64_rm64, Register::RCX, Register::R8));
        assembler.jump_if_below(entry);
        assembler.leave();
        Some((assembler, Some(entry as usize), spills))
    }

    /// The calls after a phase.
    fn calls(&self, lowered: &Lowered, phase: u32) -> Vec<Call> {
        let place = |value: Value| match lowered.code[value as usize] {
            Instruction::Load { input } => input,
            _ => self.row[value as usize].unwrap_or(0),
        };
        let of_phase = lowered
            .code
            .iter()
            .enumerate()
            .filter(|&(at, &instruction)| self.phase[at] == phase && is_call(instruction));
        let outputs = |at: usize| {
            let all = lowered.outputs.iter().enumerate();
            all.filter(|&(_, &value)| value as usize == at).map(|(o, _)| o as u32).collect()
        };
        of_phase
            .map(|(at, &instruction)| Call {
                instruction: instruction.renamed(place),
                to: place(at as Value),
                outputs: outputs(at),
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eval::Inputs;
    use crate::expr::{Function, Graph, Symbol};

    /// sin(q) nested `depth` times.
    fn lowered(depth: usize) -> (Lowered, Uniforms) {
        let mut graph = Graph::new();
        let mut expr = graph.symbol(Symbol::Coordinate(0));
        for _ in 0..depth {
            expr = graph.apply(Function::SIN, expr);
        }
        let inputs = Inputs { varying: vec![Symbol::Coordinate(0)], uniform: Vec::new() };
        let lowered = Lowered::new(&graph, &inputs, &[expr]);
        let uniforms = Uniforms::new(&graph, &inputs, &lowered.slots);
        (lowered, uniforms)
    }

    #[test]
    fn without_executable_memory_there_is_no_machine_code() {
        let set = InstructionSet::widest();
        let (lowered, uniforms) = lowered(2);
        let compile = |map: Mapper| {
            Machinecode::with(&lowered, uniforms.clone(), set, Width::Four, map).is_some()
        };
        assert!(compile(map));
        assert!(!compile(|_| Err(io::Error::from(io::ErrorKind::PermissionDenied))));
    }

    #[test]
    fn what_would_be_cut_too_often_is_left_to_the_tape() {
        let set = InstructionSet::widest();
        for (depth, possible) in [(MOST_PHASES - 1, true), (MOST_PHASES, false)] {
            let (lowered, uniforms) = lowered(depth);
            let machine = Machinecode::new(&lowered, uniforms, set);
            assert_eq!(machine.is_some(), possible && set != InstructionSet::Plain);
        }
    }
}
