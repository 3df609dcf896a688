//! Machine instructions for registers of three widths under one name each.

use iced_x86::{Code, Encoder, Instruction, MemoryOperand, Register};

/// How many numbers a register holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Width {
    /// One, for a single trajectory.
    One,
    /// Four: AVX2.
    Four,
    /// Eight: AVX-512.
    Eight,
}

impl Width {
    /// Numbers in a register.
    pub(super) fn lanes(self) -> usize {
        match self {
            Width::One => 1,
            Width::Four => 4,
            Width::Eight => 8,
        }
    }

    /// Bytes of a register in memory.
    pub(super) fn bytes(self) -> i64 {
        8 * self.lanes() as i64
    }

    /// Number of registers.
    pub(super) fn registers(self) -> usize {
        if self == Width::Eight { 32 } else { 16 }
    }

    fn register(self, index: u8) -> Register {
        let first = match self {
            Width::One => Register::XMM0,
            Width::Four => Register::YMM0,
            Width::Eight => Register::ZMM0,
        };
        first + u32::from(index)
    }
}

/// A place in memory, as large as a register.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    /// That of the first copy.
    pub first: MemoryOperand,
    /// Bytes from one copy to the next; 0 if all copies share it.
    pub apart: i64,
}

impl Place {
    fn of(self, copy: u8) -> MemoryOperand {
        let mut place = self.first;
        place.displacement += i64::from(copy) * self.apart;
        place.displ_size = 1;
        place
    }
}

/// The last operand of an instruction.
#[derive(Debug, Clone, Copy)]
pub(super) enum Operand {
    /// A vector register by its number.
    Register(u8),
    /// A place in memory.
    Memory(Place),
}

/// Two operands and a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    /// The bits that both have.
    And,
}

/// A product and a sum in one rounding, named by the order of target, middle and last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fused {
    /// target = middle * last + target.
    Accumulate,
    /// target = middle * target + last.
    Append,
    /// target = target * last + middle.
    Scale,
}

/// Machine code as it grows.
///
/// Every instruction on vector registers can be written twice, for the next points too: the
/// processor then has something to do while an instruction waits for the one before it.
pub(super) struct Assembler {
    pub width: Width,
    copies: u8,
    encoder: Encoder,
    length: u64,
    /// Something could not be encoded: the code is of no use.
    failed: bool,
}

impl Assembler {
    /// Writes every instruction on vector registers `copies` times, once or twice.
    pub(super) fn new(width: Width, copies: u8) -> Assembler {
        Assembler { width, copies, encoder: Encoder::new(64), length: 0, failed: false }
    }

    /// How often an instruction is written.
    pub(super) fn copies(&self) -> usize {
        usize::from(self.copies)
    }

    /// Numbers that a register and its copies hold.
    pub(super) fn lanes(&self) -> usize {
        self.width.lanes() * self.copies()
    }

    /// Registers that each copy has to itself; one that they share is behind them.
    pub(super) fn registers(&self) -> usize {
        match self.copies {
            1 => self.width.registers(),
            _ => self.width.registers() / 2 - 1,
        }
    }

    fn register(&self, index: u8, copy: u8) -> Register {
        self.width.register(index + copy * self.registers() as u8)
    }

    /// Bytes so far.
    pub(super) fn position(&self) -> u64 {
        self.length
    }

    /// The code, if all of it could be encoded.
    pub(super) fn finish(mut self) -> Option<Vec<u8>> {
        (!self.failed).then(|| self.encoder.take_buffer())
    }

    pub(super) fn emit(&mut self, instruction: Result<Instruction, iced_x86::IcedError>) {
        let Ok(instruction) = instruction else {
            self.failed = true;
            return;
        };
        match self.encoder.encode(&instruction, self.length) {
            Ok(bytes) => self.length += bytes as u64,
            Err(_) => self.failed = true,
        }
    }

    fn by_width(&self, codes: [Code; 3]) -> Code {
        codes[match self.width {
            Width::One => 0,
            Width::Four => 1,
            Width::Eight => 2,
        }]
    }

    pub(super) fn load(&mut self, to: u8, from: Place) {
        for copy in 0..self.copies {
            self.load_one(self.register(to, copy), from.of(copy));
        }
    }

    fn load_one(&mut self, to: Register, from: MemoryOperand) {
        let code = self.by_width([
            Code::VEX_Vmovsd_xmm_m64,
            Code::VEX_Vmovupd_ymm_ymmm256,
            Code::EVEX_Vmovupd_zmm_k1z_zmmm512,
        ]);
        self.emit(Instruction::with2(code, to, from));
    }

    pub(super) fn store(&mut self, to: Place, from: u8) {
        let code = self.by_width([
            Code::VEX_Vmovsd_m64_xmm,
            Code::VEX_Vmovupd_ymmm256_ymm,
            Code::EVEX_Vmovupd_zmmm512_k1z_zmm,
        ]);
        for copy in 0..self.copies {
            self.emit(Instruction::with2(code, to.of(copy), self.register(from, copy)));
        }
    }

    pub(super) fn copy(&mut self, to: u8, from: u8) {
        let code = self.by_width([
            Code::VEX_Vmovapd_xmm_xmmm128,
            Code::VEX_Vmovapd_ymm_ymmm256,
            Code::EVEX_Vmovapd_zmm_k1z_zmmm512,
        ]);
        for copy in 0..self.copies {
            let (to, from) = (self.register(to, copy), self.register(from, copy));
            self.emit(Instruction::with2(code, to, from));
        }
    }

    pub(super) fn binary(&mut self, operation: Binary, to: u8, a: u8, b: Operand) {
        let code = match operation {
            Binary::Add => self.by_width([
                Code::VEX_Vaddsd_xmm_xmm_xmmm64,
                Code::VEX_Vaddpd_ymm_ymm_ymmm256,
                Code::EVEX_Vaddpd_zmm_k1z_zmm_zmmm512b64_er,
            ]),
            Binary::Subtract => self.by_width([
                Code::VEX_Vsubsd_xmm_xmm_xmmm64,
                Code::VEX_Vsubpd_ymm_ymm_ymmm256,
                Code::EVEX_Vsubpd_zmm_k1z_zmm_zmmm512b64_er,
            ]),
            Binary::Multiply => self.by_width([
                Code::VEX_Vmulsd_xmm_xmm_xmmm64,
                Code::VEX_Vmulpd_ymm_ymm_ymmm256,
                Code::EVEX_Vmulpd_zmm_k1z_zmm_zmmm512b64_er,
            ]),
            Binary::Divide => self.by_width([
                Code::VEX_Vdivsd_xmm_xmm_xmmm64,
                Code::VEX_Vdivpd_ymm_ymm_ymmm256,
                Code::EVEX_Vdivpd_zmm_k1z_zmm_zmmm512b64_er,
            ]),
            Binary::And => self.by_width([
                Code::VEX_Vandpd_xmm_xmm_xmmm128,
                Code::VEX_Vandpd_ymm_ymm_ymmm256,
                Code::EVEX_Vpandq_zmm_k1z_zmm_zmmm512b64,
            ]),
        };
        self.three(code, to, a, b);
    }

    pub(super) fn fused(&mut self, order: Fused, target: u8, middle: u8, last: Operand) {
        let code = match order {
            Fused::Accumulate => self.by_width([
                Code::VEX_Vfmadd231sd_xmm_xmm_xmmm64,
                Code::VEX_Vfmadd231pd_ymm_ymm_ymmm256,
                Code::EVEX_Vfmadd231pd_zmm_k1z_zmm_zmmm512b64_er,
            ]),
            Fused::Append => self.by_width([
                Code::VEX_Vfmadd213sd_xmm_xmm_xmmm64,
                Code::VEX_Vfmadd213pd_ymm_ymm_ymmm256,
                Code::EVEX_Vfmadd213pd_zmm_k1z_zmm_zmmm512b64_er,
            ]),
            Fused::Scale => self.by_width([
                Code::VEX_Vfmadd132sd_xmm_xmm_xmmm64,
                Code::VEX_Vfmadd132pd_ymm_ymm_ymmm256,
                Code::EVEX_Vfmadd132pd_zmm_k1z_zmm_zmmm512b64_er,
            ]),
        };
        self.three(code, target, middle, last);
    }

    pub(super) fn square_root(&mut self, to: u8, from: u8) {
        for copy in 0..self.copies {
            let (to, from) = (self.register(to, copy), self.register(from, copy));
            self.emit(match self.width {
                Width::One => Instruction::with3(Code::VEX_Vsqrtsd_xmm_xmm_xmmm64, to, from, from),
                Width::Four => Instruction::with2(Code::VEX_Vsqrtpd_ymm_ymmm256, to, from),
                Width::Eight => {
                    Instruction::with2(Code::EVEX_Vsqrtpd_zmm_k1z_zmmm512b64_er, to, from)
                }
            });
        }
    }

    fn three(&mut self, code: Code, to: u8, a: u8, b: Operand) {
        // What both copies read from memory is read once.
        let shared = match b {
            Operand::Memory(place) if self.copies > 1 && place.apart == 0 => {
                let register = self.register(0, self.copies);
                self.load_one(register, place.first);
                Some(register)
            }
            _ => None,
        };
        for copy in 0..self.copies {
            let (to, a) = (self.register(to, copy), self.register(a, copy));
            self.emit(match (b, shared) {
                (_, Some(b)) => Instruction::with3(code, to, a, b),
                (Operand::Register(b), _) => {
                    Instruction::with3(code, to, a, self.register(b, copy))
                }
                (Operand::Memory(place), _) => Instruction::with3(code, to, a, place.of(copy)),
            });
        }
    }

    /// A jump back to `position` as long as the last comparison found less (unsigned).
    pub(super) fn jump_if_below(&mut self, position: u64) {
        self.emit(Instruction::with_branch(Code::Jb_rel32_64, position));
    }

    /// A jump back to `position` as long as the last result was not zero.
    pub(super) fn jump_if_not_zero(&mut self, position: u64) {
        self.emit(Instruction::with_branch(Code::Jne_rel32_64, position));
    }

    /// Calls a function that lives as long as the program.
    pub(super) fn call(&mut self, address: usize) {
        self.emit(Instruction::with2(Code::Mov_r64_imm64, Register::RAX, address as u64));
        self.emit(Instruction::with1(Code::Call_rm64, Register::RAX));
    }

    /// Ends the function.
    pub(super) fn leave(&mut self) {
        if self.width != Width::One {
            self.emit(Ok(Instruction::with(Code::VEX_Vzeroupper)));
        }
        self.emit(Ok(Instruction::with(Code::Retnq)));
    }
}
