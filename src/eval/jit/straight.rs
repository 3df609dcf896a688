//! Straight-line machine code: which value is in which register, and when.
//!
//! Registers are given away as Belady would (IBM Systems Journal 5, 1966): the value that is
//! needed last leaves first, to a place in memory if it has none there already. An operand
//! that is needed once is read from memory by the instruction that needs it.

use iced_x86::{Code, Instruction as Machine, MemoryOperand, Register};

use super::assembler::{Assembler, Binary, Fused, Operand, Place};
use crate::eval::instruction::{Instruction, Value};
use crate::expr::MachineInstruction;

/// Where a value is in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Home {
    /// A row of numbers, one for each point, by its place in the table of rows.
    Row(u32),
    /// A number that is the same at every point.
    Slot(u32),
    /// A register that was needed for something else.
    Spill(u32),
    /// One of the numbers of a single point: a component of its state, or an output.
    State(u32),
}

/// Machine registers that hold addresses while the code runs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// Addresses of the rows.
    pub table: Register,
    /// Number of the point.
    pub index: Register,
    pub slots: Register,
    pub spills: Register,
    pub state: Register,
}

/// Slots behind those of the program, with numbers that the code itself needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Constants {
    /// 1.
    pub one: u32,
    /// All bits but the sign.
    pub magnitude: u32,
}

/// An operand before it is known where it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Source {
    Value(Value),
    Slot(u32),
}

/// The code of a straight line as it grows.
pub(super) struct Straight<'a> {
    pub assembler: Assembler,
    frame: Frame,
    constants: Constants,
    /// What each register holds.
    held: Vec<Option<Value>>,
    /// For each value, the register that holds it.
    register: Vec<Option<u8>>,
    /// For each value, where it is in memory.
    home: Vec<Option<Home>>,
    /// For each value, the places in the code that need it, first first.
    uses: Vec<Vec<usize>>,
    /// Registers that the present instruction works with.
    busy: Vec<u8>,
    free_spills: Vec<u32>,
    pub spills: u32,
    /// Where a value goes as soon as it is there.
    stores: &'a [Vec<Home>],
    at: usize,
}

impl<'a> Straight<'a> {
    /// For each value: where it is from the start, the places in the code (ascending) that need
    /// it, and where it goes as soon as it is there.
    pub(super) fn new(
        assembler: Assembler,
        frame: Frame,
        constants: Constants,
        home: Vec<Option<Home>>,
        uses: Vec<Vec<usize>>,
        stores: &'a [Vec<Home>],
    ) -> Self {
        let held = vec![None; assembler.registers()];
        Straight {
            assembler,
            frame,
            constants,
            held,
            register: vec![None; home.len()],
            home,
            uses,
            busy: Vec::new(),
            free_spills: Vec::new(),
            spills: 0,
            stores,
            at: 0,
        }
    }

    /// Says that a value is in a register from the start.
    pub(super) fn hold(&mut self, value: Value, register: u8) {
        self.held[register as usize] = Some(value);
        self.register[value as usize] = Some(register);
    }

    /// The register that holds a value.
    pub(super) fn register_of(&self, value: Value) -> Option<u8> {
        self.register[value as usize]
    }

    /// Code of one instruction; calls are for others to write.
    pub(super) fn instruction(&mut self, at: usize, value: Value, instruction: Instruction) {
        use Source::{Slot as S, Value as V};
        self.move_to(at);
        self.keep(instruction);
        let to = match instruction {
            Instruction::Load { input } => {
                self.home[value as usize].get_or_insert(Home::Row(input));
                return self.store_at_once(value, None);
            }
            Instruction::Broadcast { slot } => {
                self.home[value as usize] = Some(Home::Slot(slot));
                return self.store_at_once(value, None);
            }
            Instruction::Scale { a, slot } => self.binary(Binary::Multiply, V(a), S(slot)),
            Instruction::Shift { a, slot } => self.binary(Binary::Add, V(a), S(slot)),
            Instruction::Add { a, b } => self.binary(Binary::Add, V(a), V(b)),
            Instruction::Subtract { a, b } => self.binary(Binary::Subtract, V(a), V(b)),
            Instruction::Multiply { a, b } => self.binary(Binary::Multiply, V(a), V(b)),
            Instruction::Reciprocal { a } => {
                self.binary(Binary::Divide, S(self.constants.one), V(a))
            }
            Instruction::ScaleShift { a, slot, shift } => self.fused(V(a), S(slot), S(shift)),
            Instruction::AddScaled { a, b, slot } => self.fused(V(b), S(slot), V(a)),
            Instruction::MultiplyShift { a, b, slot } => self.fused(V(a), V(b), S(slot)),
            Instruction::MultiplyAdd { a, b, c } => self.fused(V(a), V(b), V(c)),
            Instruction::Apply { a, function } => match function.row().instruction {
                Some(MachineInstruction::ClearSign) => {
                    self.binary(Binary::And, V(a), S(self.constants.magnitude))
                }
                Some(MachineInstruction::SquareRoot) => {
                    let from = self.in_register(V(a));
                    self.release(V(a));
                    let to = self.take();
                    self.assembler.square_root(to, from);
                    self.ended(V(a));
                    to
                }
                None => return,
            },
            Instruction::Raise { .. } | Instruction::Power { .. } => return,
        };
        self.define(value, to);
    }

    /// A value has been computed into a register.
    pub(super) fn define(&mut self, value: Value, to: u8) {
        self.hold(value, to);
        self.store_at_once(value, Some(to));
        if self.next_use(value).is_none() {
            self.drop_value(value);
        }
    }

    fn store_at_once(&mut self, value: Value, register: Option<u8>) {
        let places = &self.stores[value as usize];
        if places.is_empty() {
            return;
        }
        let from = match register {
            Some(register) => register,
            None => self.in_register(Source::Value(value)),
        };
        for &place in places {
            let to = self.memory(place);
            self.assembler.store(to, from);
            self.home[value as usize].get_or_insert(place);
        }
    }

    fn binary(&mut self, operation: Binary, a: Source, b: Source) -> u8 {
        // The second may stay in memory; of two that commute it is the one that is there.
        let commutes = !matches!(operation, Binary::Divide | Binary::Subtract);
        let (a, b) = if commutes && self.is_here(b) && !self.is_here(a) { (b, a) } else { (a, b) };
        let first = self.in_register(a);
        let second = self.anywhere(b);
        // Their registers may take the result, but not their places in memory what leaves a
        // register for it: the instruction has yet to read them.
        self.release(a);
        self.release(b);
        let to = self.take();
        self.assembler.binary(operation, to, first, second);
        self.ended(a);
        self.ended(b);
        to
    }

    /// x * y + z in one rounding, into a register that one of them can spare.
    fn fused(&mut self, x: Source, y: Source, z: Source) -> u8 {
        // A register whose value ends here is overwritten; or else a value from memory is
        // loaded for it; or else one is copied.
        let spare = |this: &Self, s: Source| this.is_here(s) && this.ends(s);
        let order = if spare(self, z) {
            (z, Fused::Accumulate)
        } else if spare(self, x) {
            (x, Fused::Append)
        } else if spare(self, y) {
            (y, Fused::Append)
        } else if !self.is_here(z) {
            (z, Fused::Accumulate)
        } else if !self.is_here(y) {
            (y, Fused::Append)
        } else if !self.is_here(x) {
            (x, Fused::Append)
        } else {
            (z, Fused::Accumulate)
        };
        let (target, mut form) = order;
        let (mut middle, mut last) = match form {
            Fused::Accumulate => (x, y),
            _ if target == x => (y, z),
            _ => (x, z),
        };
        if !self.is_here(middle) && self.is_here(last) {
            (middle, last) = (last, middle);
            if form == Fused::Append {
                form = Fused::Scale;
            }
        }
        let middle_register = self.in_register(middle);
        // The middle stays where it is even if it is the target's value too.
        let to = if spare(self, target) && !(target == middle) && !(target == last) {
            let register = self.in_register(target);
            self.forget_register(register);
            register
        } else {
            let from = self.is_here(target).then(|| self.in_register(target));
            let to = self.take();
            match (from, target) {
                (Some(from), _) => self.assembler.copy(to, from),
                (None, source) => {
                    let place = self.memory_of(source);
                    self.assembler.load(to, place);
                }
            }
            to
        };
        self.busy.push(to);
        let last_operand = self.anywhere(last);
        self.assembler.fused(form, to, middle_register, last_operand);
        for source in [x, y, z] {
            self.ended(source);
        }
        to
    }

    /// Whether an operand is in a register.
    fn is_here(&self, source: Source) -> bool {
        matches!(source, Source::Value(value) if self.register_of(value).is_some())
    }

    /// Whether nothing after the present instruction needs an operand.
    fn ends(&self, source: Source) -> bool {
        matches!(source, Source::Value(value) if self.next_use(value).is_none())
    }

    /// The next place after the present one that needs a value.
    fn next_use(&self, value: Value) -> Option<usize> {
        let uses = &self.uses[value as usize];
        uses.get(uses.partition_point(|&at| at <= self.at)).copied()
    }

    /// Brings an operand into a register and keeps it there for this instruction.
    pub(super) fn in_register(&mut self, source: Source) -> u8 {
        if let Source::Value(value) = source
            && let Some(register) = self.register_of(value)
        {
            self.busy.push(register);
            return register;
        }
        let place = self.memory_of(source);
        let to = self.take();
        self.assembler.load(to, place);
        self.busy.push(to);
        if let Source::Value(value) = source {
            self.hold(value, to);
        }
        to
    }

    /// An operand in a register or in memory; one that is needed again is brought in if
    /// there is a register to spare.
    fn anywhere(&mut self, source: Source) -> Operand {
        let again = !self.ends(source) && matches!(source, Source::Value(_));
        if self.is_here(source) || again && self.held.iter().any(Option::is_none) {
            return Operand::Register(self.in_register(source));
        }
        Operand::Memory(self.memory_of(source))
    }

    pub(super) fn memory_of(&mut self, source: Source) -> Place {
        let home = match source {
            Source::Slot(slot) => Home::Slot(slot),
            // Every value is somewhere: in a register, or where it was put from there.
            Source::Value(value) => self.home[value as usize].unwrap_or(Home::Spill(0)),
        };
        self.memory(home)
    }

    /// The address of a place; that of a row is first looked up in the table.
    pub(super) fn memory(&mut self, home: Home) -> Place {
        let bytes = self.assembler.width.bytes();
        // Slots are the same at every point; other places have one for each copy.
        let (copies, apart) = match home {
            Home::Slot(_) => (1, 0),
            _ => (self.assembler.copies() as i64, bytes),
        };
        let at = |base: Register, index: u32, bytes: i64| {
            MemoryOperand::with_base_displ(base, i64::from(index) * bytes)
        };
        let bytes = bytes * copies;
        let first = match home {
            Home::Slot(slot) => at(self.frame.slots, slot, bytes),
            Home::Spill(place) => at(self.frame.spills, place, bytes),
            Home::State(component) => at(self.frame.state, component, bytes),
            Home::Row(row) => {
                let entry = at(self.frame.table, row, 8);
                self.assembler.emit(Machine::with2(Code::Mov_r64_rm64, Register::RAX, entry));
                MemoryOperand::with_base_index_scale(Register::RAX, self.frame.index, 8)
            }
        };
        Place { first, apart }
    }

    /// A free register, if need be by sending a value away. Not one that is busy.
    pub(super) fn take(&mut self) -> u8 {
        if let Some(free) = (0..self.held.len())
            .find(|&r| self.held[r].is_none() && !self.busy.contains(&(r as u8)))
        {
            return free as u8;
        }
        let far = |register: usize| {
            let value = self.held[register]?;
            (!self.busy.contains(&(register as u8)))
                .then(|| self.next_use(value).unwrap_or(usize::MAX))
        };
        // At most four registers are busy: there is another one.
        let register = (0..self.held.len()).max_by_key(|&r| far(r)).unwrap_or(0) as u8;
        self.send_away(register);
        register
    }

    /// Frees a register; its value goes to memory if it is needed and not there.
    pub(super) fn send_away(&mut self, register: u8) {
        let Some(value) = self.held[register as usize] else { return };
        if self.next_use(value).is_some() && self.home[value as usize].is_none() {
            let place = self.free_spills.pop().unwrap_or_else(|| {
                self.spills += 1;
                self.spills - 1
            });
            self.home[value as usize] = Some(Home::Spill(place));
            let to = self.memory(Home::Spill(place));
            self.assembler.store(to, register);
        }
        self.forget_register(register);
    }

    /// Sends every value away that is needed after the present instruction: a call follows.
    /// What the registers hold stays there until then.
    pub(super) fn send_all_away(&mut self) {
        self.busy.clear();
        for register in 0..self.held.len() as u8 {
            self.send_away(register);
        }
    }

    fn forget_register(&mut self, register: u8) {
        if let Some(value) = self.held[register as usize].take() {
            self.register[value as usize] = None;
        }
    }

    /// Gives back the register of an operand, if nothing needs it any more.
    fn release(&mut self, source: Source) {
        if let Source::Value(value) = source
            && self.next_use(value).is_none()
            && let Some(register) = self.register_of(value)
        {
            self.busy.retain(|&busy| busy != register);
            self.forget_register(register);
        }
    }

    /// Gives back all that an operand took, if nothing needs it any more.
    fn ended(&mut self, source: Source) {
        self.release(source);
        if let Source::Value(value) = source
            && self.next_use(value).is_none()
        {
            self.drop_value(value);
        }
    }

    fn drop_value(&mut self, value: Value) {
        if let Some(register) = self.register_of(value) {
            self.forget_register(register);
        }
        if let Some(Home::Spill(place)) = self.home[value as usize] {
            self.home[value as usize] = None;
            self.free_spills.push(place);
        }
    }

    /// Keeps the operands of an instruction in their registers until it is done.
    pub(super) fn keep(&mut self, instruction: Instruction) {
        let operands = instruction.operands();
        let here: Vec<u8> = operands.filter_map(|value| self.register_of(value)).collect();
        self.busy.extend(here);
    }

    /// The present place in the code.
    pub(super) fn move_to(&mut self, at: usize) {
        self.at = at;
        self.busy.clear();
    }
}
