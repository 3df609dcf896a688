//! Numbers that a register of the processor holds, side by side.
//!
//! There are no closures here, nor function pointers: they are compiled for the plain instruction
//! set, and then a call is made where one operation should stand.

#![allow(unsafe_code, reason = "the processor's own operations, and memory that they run on")]
#![allow(
    clippy::manual_memcpy,
    clippy::needless_range_loop,
    reason = "register by register: of a whole row the compiler makes a copy in memory"
)]

/// Arithmetic on the numbers of one register. Every operation rounds once, and as it does on any
/// other kind of register.
///
/// # Safety
///
/// The type is `LANES` numbers side by side and nothing else; every pattern of bits is one of it.
pub(super) unsafe trait Vector: Copy {
    /// Numbers in a register.
    const LANES: usize;
    /// Whether the processor has too few registers for an operand of a whole block beside the
    /// accumulator.
    const FEW: bool;

    /// The same number everywhere.
    fn splat(number: f64) -> Self;
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    fn times(self, other: Self) -> Self;
    fn over(self, other: Self) -> Self;
    /// self * factor + summand, rounded once.
    fn fused(self, factor: Self, summand: Self) -> Self;
}

/// The numbers of one value at the points of a block.
pub(super) type Row<V, const W: usize> = [V; W];

/// The numbers of a row, one for each point.
#[inline(always)]
pub(super) fn numbers<V: Vector, const W: usize>(row: &Row<V, W>) -> &[f64] {
    // SAFETY: a row is so many numbers side by side.
    unsafe { std::slice::from_raw_parts(row.as_ptr().cast(), W * V::LANES) }
}

/// The same to be written.
#[inline(always)]
pub(super) fn numbers_mut<V: Vector, const W: usize>(row: &mut Row<V, W>) -> &mut [f64] {
    // SAFETY: as above; a row may hold any numbers.
    unsafe { std::slice::from_raw_parts_mut(row.as_mut_ptr().cast(), W * V::LANES) }
}

/// The rows that memory has room for, from the first place on where one may stand.
#[inline(always)]
pub(super) fn rows<V: Vector, const W: usize>(memory: &mut [f64]) -> &mut [Row<V, W>] {
    // SAFETY: a row is so many numbers side by side and may hold any.
    unsafe { memory.align_to_mut().1 }
}

/// Reads a register from the first numbers of a slice that has so many.
#[inline(always)]
fn read<V: Vector>(from: &[f64], at: usize) -> V {
    let from = &from[at..at + V::LANES];
    // SAFETY: so many numbers are there, and any of them make a register.
    unsafe { from.as_ptr().cast::<V>().read_unaligned() }
}

/// Puts one row into another.
#[inline(always)]
pub(super) fn put<V: Vector, const W: usize>(to: &mut Row<V, W>, from: &Row<V, W>) {
    for i in 0..W {
        to[i] = from[i];
    }
}

/// x * b + number, for one number after the other.
#[inline(always)]
pub(super) fn horner<V: Vector, const W: usize>(x: &mut Row<V, W>, b: &Row<V, W>, given: &[f64]) {
    for &number in given {
        let number = V::splat(number);
        for i in 0..W {
            let factor = if V::FEW {
                // Read anew for each number: read once, the row would be put aside to memory and
                // the accumulator with it.
                // SAFETY: what a reference points to may be read.
                unsafe { std::ptr::from_ref(&b[i]).read_volatile() }
            } else {
                b[i]
            };
            x[i] = x[i].fused(factor, number);
        }
    }
}

/// The row of the first numbers of a slice; zeros where there are not enough.
#[inline(always)]
pub(super) fn load<V: Vector, const W: usize>(row: &mut Row<V, W>, from: &[f64]) {
    if from.len() == W * V::LANES {
        for i in 0..W {
            row[i] = read(from, i * V::LANES);
        }
    } else {
        let mut whole = [V::splat(0.0); W];
        numbers_mut(&mut whole)[..from.len()].copy_from_slice(from);
        put(row, &whole);
    }
}

/// As many numbers of a row as a slice has room for.
#[inline(always)]
pub(super) fn store<V: Vector, const W: usize>(row: &Row<V, W>, to: &mut [f64]) {
    if to.len() == W * V::LANES {
        for i in 0..W {
            let to = &mut to[i * V::LANES..][..V::LANES];
            // SAFETY: there is room for so many numbers.
            unsafe { to.as_mut_ptr().cast::<V>().write_unaligned(row[i]) };
        }
    } else {
        let mut whole = [V::splat(0.0); W];
        put(&mut whole, row);
        to.copy_from_slice(&numbers(&whole)[..to.len()]);
    }
}

// SAFETY: one number is one number.
unsafe impl Vector for f64 {
    const LANES: usize = 1;
    const FEW: bool = false;

    #[inline(always)]
    fn splat(number: f64) -> f64 {
        number
    }

    #[inline(always)]
    fn plus(self, other: f64) -> f64 {
        self + other
    }

    #[inline(always)]
    fn minus(self, other: f64) -> f64 {
        self - other
    }

    #[inline(always)]
    fn times(self, other: f64) -> f64 {
        self * other
    }

    #[inline(always)]
    fn over(self, other: f64) -> f64 {
        self / other
    }

    #[inline(always)]
    fn fused(self, factor: f64, summand: f64) -> f64 {
        self.mul_add(factor, summand)
    }
}

/// Implements [`Vector`] for a register by the processor's own operations.
#[cfg(target_arch = "x86_64")]
macro_rules! register {
    ($register:ident, $lanes:expr, $few:expr, $splat:ident, $add:ident, $subtract:ident, $multiply:ident,
     $divide:ident, $fused:ident) => {
        // SAFETY: the processor's registers are so many numbers.
        unsafe impl Vector for std::arch::x86_64::$register {
            const LANES: usize = $lanes;
            const FEW: bool = $few;

            #[inline(always)]
            fn splat(number: f64) -> Self {
                // SAFETY: here and below: this is inlined into functions that are compiled for
                // the instruction set, and they run where the processor has it.
                unsafe { std::arch::x86_64::$splat(number) }
            }

            #[inline(always)]
            fn plus(self, other: Self) -> Self {
                // SAFETY: as in `splat`.
                unsafe { std::arch::x86_64::$add(self, other) }
            }

            #[inline(always)]
            fn minus(self, other: Self) -> Self {
                // SAFETY: as in `splat`.
                unsafe { std::arch::x86_64::$subtract(self, other) }
            }

            #[inline(always)]
            fn times(self, other: Self) -> Self {
                // SAFETY: as in `splat`.
                unsafe { std::arch::x86_64::$multiply(self, other) }
            }

            #[inline(always)]
            fn over(self, other: Self) -> Self {
                // SAFETY: as in `splat`.
                unsafe { std::arch::x86_64::$divide(self, other) }
            }

            #[inline(always)]
            fn fused(self, factor: Self, summand: Self) -> Self {
                // SAFETY: as in `splat`.
                unsafe { std::arch::x86_64::$fused(self, factor, summand) }
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
register!(
    __m256d,
    4,
    true,
    _mm256_set1_pd,
    _mm256_add_pd,
    _mm256_sub_pd,
    _mm256_mul_pd,
    _mm256_div_pd,
    _mm256_fmadd_pd
);
#[cfg(target_arch = "x86_64")]
register!(
    __m512d,
    8,
    false,
    _mm512_set1_pd,
    _mm512_add_pd,
    _mm512_sub_pd,
    _mm512_mul_pd,
    _mm512_div_pd,
    _mm512_fmadd_pd
);
