//! Many steps of a splitting for one trajectory, in one loop of machine code.
//!
//! Every stage evaluates its functions, multiplies them by the stage's scale and adds them to
//! half of the state, carrying what rounding took: operation by operation what the integrator
//! does for a batch, so that the trajectory is the same to the last bit.

#![allow(unsafe_code, reason = "machine code is made and called")]

use iced_x86::{Code, Instruction as Machine, Register};
use memmap2::Mmap;

use super::assembler::{Assembler, Width};
use super::is_call;
use super::memory::{Mapper, map};
use super::straight::{Constants, Frame, Home, Source, Straight};
use crate::eval::instruction::{Instruction, Value};
use crate::eval::lower::Lowered;
use crate::eval::uniform::Uniforms;
use crate::eval::{Inputs, InstructionSet, Pace, StepSource, Steps, elementary, power};
use crate::expr::{FunctionRow, Symbol};

/// Registers that keep their value from one step to the next; the others do the work.
const PINNED: usize = 9;
/// Most instructions of a step.
const LONGEST: usize = 20_000;

const FRAME: Frame = Frame {
    table: Register::R14,
    index: Register::R14,
    slots: Register::RBX,
    spills: Register::RBP,
    state: Register::R12,
};

/// What a called function must leave as it is, and so must we.
const SAVED: [Register; 5] =
    [Register::RBX, Register::RBP, Register::R12, Register::R13, Register::R14];

/// The loop: what goes from step to step, slots, spills, number of steps.
type Entry = unsafe extern "sysv64" fn(*mut f64, *const f64, *mut f64, usize);

/// A loop of steps in machine code.
pub(crate) struct MachineSteps {
    memory: Mmap,
    /// Of drift and kick.
    uniforms: [Uniforms; 2],
    stages: usize,
    rows: usize,
    spills: usize,
}

/// A function without machine code of its own.
extern "sysv64" fn function(x: f64, row: &'static FunctionRow) -> f64 {
    (row.value)(x)
}

impl MachineSteps {
    /// Machine code for a composition; `None` where there can be none.
    pub(crate) fn new(source: &StepSource) -> Option<MachineSteps> {
        if InstructionSet::widest() == InstructionSet::Plain {
            return None;
        }
        MachineSteps::with(source, map)
    }

    fn with(source: &StepSource, map: Mapper) -> Option<MachineSteps> {
        let rows = source.state.len();
        let lowered = [&source.drift, &source.kick].map(|(functions, inputs)| {
            let lowered = Lowered::new(source.graph, inputs, functions);
            let uniforms = Uniforms::new(source.graph, inputs, &lowered.slots);
            (lowered, uniforms)
        });
        let plan = Plan::new(source, &lowered[0].0, &lowered[1].0);
        if plan.code.len() > LONGEST {
            return None;
        }
        let (bytes, spills) = plan.emit()?;
        Some(MachineSteps {
            memory: map(&bytes).ok()?,
            uniforms: lowered.map(|(_, uniforms)| uniforms),
            stages: source.stages.len(),
            rows,
            spills: spills as usize,
        })
    }
}

impl Steps for MachineSteps {
    fn run(&self, state: &mut [f64], carry: &mut [f64], uniform: &[f64], pace: &Pace) {
        let rows = self.rows;
        let mut memory = vec![0.0; 2 * rows + 1];
        memory[..rows].copy_from_slice(&state[..rows]);
        memory[rows..2 * rows].copy_from_slice(&carry[..rows]);
        memory[2 * rows] = pace.first;
        let mut slots = Vec::new();
        for uniforms in &self.uniforms {
            let start = slots.len();
            slots.resize(start + uniforms.len(), 0.0);
            let mut scratch = vec![0.0; uniforms.scratch()];
            uniforms.evaluate(uniform, &mut scratch, |slot, value| slots[start + slot] = value);
        }
        slots.extend_from_slice(&pace.scales[..self.stages]);
        slots.extend_from_slice(&pace.times[..self.stages]);
        slots.extend([pace.step, pace.start, 1.0, f64::from_bits(!(1 << 63))]);
        let mut spills = vec![0.0; self.spills];
        if pace.steps > 0 {
            // SAFETY: the memory holds one function, with this signature, that uses AVX2 and
            // FMA, which `new` found; it reads and writes `2 * rows + 1` numbers, the spills
            // that its code counts, and reads the slots in the order of `Plan::new`.
            unsafe {
                let run = std::mem::transmute::<*const u8, Entry>(self.memory.as_ptr());
                run(memory.as_mut_ptr(), slots.as_ptr(), spills.as_mut_ptr(), pace.steps);
            }
        }
        state[..rows].copy_from_slice(&memory[..rows]);
        carry[..rows].copy_from_slice(&memory[rows..2 * rows]);
    }
}

/// One step as a straight line. Values 0, 1, ... are what goes from step to step: the state,
/// what it carries, the number of the step.
struct Plan {
    code: Vec<Instruction>,
    /// What goes from step to step, as it is at the end.
    last: Vec<Value>,
    constants: Constants,
}

impl Plan {
    fn new(source: &StepSource, drift: &Lowered, kick: &Lowered) -> Plan {
        let rows = source.state.len();
        let stages = source.stages.len() as u32;
        let first_scale = (drift.slots.len() + kick.slots.len()) as u32;
        let first_time = first_scale + stages;
        let step = first_time + stages;
        let (start, one, magnitude) = (step + 1, step + 2, step + 3);
        let mut last: Vec<Value> = (0..=2 * rows as Value).collect();
        let mut code: Vec<Instruction> = Vec::new();
        let base = last.len() as Value;
        let push = |code: &mut Vec<Instruction>, instruction| {
            code.push(instruction);
            base + code.len() as Value - 1
        };
        for (stage, &is_drift) in (0..).zip(source.stages) {
            let (lowered, inputs, first_slot): (_, &Inputs, u32) = if is_drift {
                (drift, &source.drift.1, 0)
            } else {
                (kick, &source.kick.1, drift.slots.len() as u32)
            };
            let mut named: Vec<Value> = Vec::with_capacity(lowered.code.len());
            for &instruction in &lowered.code {
                let value = match instruction {
                    Instruction::Load { input } => {
                        let symbol = inputs.varying[input as usize];
                        match source.state.iter().position(|&of| of == symbol) {
                            Some(row) => last[row],
                            None => {
                                debug_assert_eq!(symbol, Symbol::Time);
                                let a = last[2 * rows];
                                let slot = first_time + stage;
                                let a = push(&mut code, Instruction::Shift { a, slot });
                                let a = push(&mut code, Instruction::Scale { a, slot: step });
                                push(&mut code, Instruction::Shift { a, slot: start })
                            }
                        }
                    }
                    other => {
                        let other = other.renamed(|v| named[v as usize]);
                        push(&mut code, other.with_slots_from(first_slot))
                    }
                };
                named.push(value);
            }
            let target = if is_drift { 0 } else { rows / 2 };
            for (i, &output) in lowered.outputs.iter().enumerate() {
                let (state, carry) = (target + i, rows + target + i);
                let slot = first_scale + stage;
                let (a, b) = (last[carry], named[output as usize]);
                let moved = push(&mut code, Instruction::AddScaled { a, b, slot });
                let (a, b) = (last[state], moved);
                let sum = push(&mut code, Instruction::Add { a, b });
                let taken = push(&mut code, Instruction::Subtract { a: sum, b: last[state] });
                let left = push(&mut code, Instruction::Subtract { a: moved, b: taken });
                (last[state], last[carry]) = (sum, left);
            }
        }
        let a = last[2 * rows];
        last[2 * rows] = push(&mut code, Instruction::Shift { a, slot: one });
        Plan { code, last, constants: Constants { one, magnitude } }
    }

    /// The code and the number of its spills.
    fn emit(&self) -> Option<(Vec<u8>, u32)> {
        let going = self.last.len();
        let pinned = going.min(PINNED);
        let total = going + self.code.len();
        let mut home: Vec<Option<Home>> = vec![None; total];
        for (value, home) in home.iter_mut().enumerate().take(going).skip(pinned) {
            *home = Some(Home::State(value as u32));
        }
        let mut uses = vec![Vec::new(); total];
        for (at, instruction) in self.code.iter().enumerate() {
            instruction.operands().for_each(|v| uses[v as usize].push(at + 1));
        }
        let end = self.code.len() + 1;
        self.last.iter().for_each(|&v| uses[v as usize].push(end));
        let stores = vec![Vec::new(); total];

        let mut assembler = Assembler::new(Width::One, 1);
        for register in SAVED {
            assembler.emit(Machine::with1(Code::Push_r64, register));
        }
        let arguments = [
            (Register::R12, Register::RDI),
            (Register::RBX, Register::RSI),
            (Register::RBP, Register::RDX),
            (Register::R13, Register::RCX),
        ];
        for (to, from) in arguments {
            assembler.emit(Machine::with2(Code::Mov_r64_rm64, to, from));
        }
        let mut straight = Straight::new(assembler, FRAME, self.constants, home, uses, &stores);
        for register in 0..pinned as u8 {
            let from = straight.memory(Home::State(register.into()));
            straight.assembler.load(register, from);
            straight.hold(register.into(), register);
        }
        let top = straight.assembler.position();
        for (at, &instruction) in self.code.iter().enumerate() {
            let value = (going + at) as Value;
            if is_call(instruction) {
                straight.move_to(at + 1);
                straight.keep(instruction);
                call(&mut straight, instruction);
                straight.define(value, 0);
            } else {
                straight.instruction(at + 1, value, instruction);
            }
        }
        self.close(&mut straight, pinned);
        let Straight { mut assembler, spills, .. } = straight;
        assembler.emit(Machine::with2(Code::Sub_rm64_imm32, Register::R13, 1));
        assembler.jump_if_not_zero(top);
        let mut straight =
            Straight::new(assembler, FRAME, self.constants, Vec::new(), Vec::new(), &stores);
        for register in 0..pinned as u8 {
            let to = straight.memory(Home::State(register.into()));
            straight.assembler.store(to, register);
        }
        let mut assembler = straight.assembler;
        for &register in SAVED.iter().rev() {
            assembler.emit(Machine::with1(Code::Pop_r64, register));
        }
        assembler.leave();
        Some((assembler.finish()?, spills))
    }

    /// Brings what goes on to the next step to where that expects it.
    fn close(&self, straight: &mut Straight, pinned: usize) {
        straight.move_to(self.code.len());
        for (row, &value) in self.last.iter().enumerate().skip(pinned) {
            let from = straight.in_register(Source::Value(value));
            let to = straight.memory(Home::State(row as u32));
            straight.assembler.store(to, from);
            straight.move_to(self.code.len());
        }
        // Registers that change places: first those that nobody waits for.
        let mut moves: Vec<(u8, u8)> = Vec::new();
        let mut loads: Vec<(u8, Value)> = Vec::new();
        for (row, &value) in (0..).zip(self.last.iter().take(pinned)) {
            match straight.register_of(value) {
                Some(from) if from == row => {}
                Some(from) => moves.push((row, from)),
                None => loads.push((row, value)),
            }
        }
        // A register that no value of the next step is in, to break circles.
        let spare = straight.assembler.registers() as u8 - 1;
        if moves.iter().any(|&(to, from)| to == spare || from == spare) {
            // It may hold one of them: that one goes through memory.
            for at in (0..moves.len()).rev() {
                if moves[at].1 == spare {
                    loads.push((moves[at].0, self.last[moves[at].0 as usize]));
                    straight.send_away(spare);
                    moves.remove(at);
                }
            }
        }
        while !moves.is_empty() {
            let free = moves.iter().position(|m| !moves.iter().any(|other| other.1 == m.0));
            match free {
                Some(at) => {
                    let (to, from) = moves.remove(at);
                    straight.assembler.copy(to, from);
                }
                None => {
                    let from = moves[0].1;
                    straight.assembler.copy(spare, from);
                    moves[0].1 = spare;
                }
            }
        }
        for (to, value) in loads {
            let from = straight.memory_of(Source::Value(value));
            straight.assembler.load(to, from);
        }
    }
}

/// Calls a function; its result is in register 0.
fn call(straight: &mut Straight, instruction: Instruction) {
    let (first, second) = match instruction {
        Instruction::Raise { a, slot } => (Source::Value(a), Some(Source::Slot(slot))),
        Instruction::Power { a, b } => (Source::Value(a), Some(Source::Value(b))),
        Instruction::Apply { a, .. } => (Source::Value(a), None),
        _ => return,
    };
    let a = straight.in_register(first);
    let b = second.map(|second| straight.in_register(second));
    straight.send_all_away();
    let assembler = &mut straight.assembler;
    match b {
        Some(b) => {
            // Through a register that neither is in.
            let spare = (2..).find(|&r| r != a && r != b).unwrap_or(2);
            assembler.copy(spare, b);
            assembler.copy(0, a);
            assembler.copy(1, spare);
        }
        None if a != 0 => assembler.copy(0, a),
        None => {}
    }
    let address = match instruction {
        Instruction::Power { .. } => power::entry(),
        Instruction::Apply { function: f, .. } => match elementary::code(f) {
            Some(code) => (code.entry)(),
            None => {
                let row: *const FunctionRow = f.row();
                let row = Machine::with2(Code::Mov_r64_imm64, Register::RDI, row as u64);
                assembler.emit(row);
                function as extern "sysv64" fn(f64, &'static FunctionRow) -> f64 as usize
            }
        },
        _ => power::entry_raised(),
    };
    assembler.call(address);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::Graph;

    #[test]
    fn without_executable_memory_there_is_no_loop() {
        let mut graph = Graph::new();
        let state = [Symbol::Coordinate(0), Symbol::Momentum(0)];
        let [q, p] = state.map(|symbol| graph.symbol(symbol));
        let inputs = |symbol| Inputs { varying: vec![symbol], uniform: Vec::new() };
        let source = StepSource {
            graph: &graph,
            state: &state,
            drift: (&[p], inputs(state[1])),
            kick: (&[q], inputs(state[0])),
            stages: &[true, false],
        };
        let refuse: Mapper = |_| Err(std::io::Error::from(std::io::ErrorKind::PermissionDenied));
        assert!(MachineSteps::with(&source, refuse).is_none());
        let loops = InstructionSet::widest() != InstructionSet::Plain;
        assert_eq!(MachineSteps::new(&source).is_some(), loops);
    }
}
