//! Numbers that a register of the processor holds, side by side.

/// Arithmetic on the numbers of one register; every operation rounds once, and as it does on any
/// other kind of register.
pub trait Vector: Copy {
    /// Numbers in a register.
    const LANES: usize;

    /// The same number everywhere.
    fn splat(number: f64) -> Self;
    /// The first numbers of a slice that has enough.
    fn load(from: &[f64]) -> Self;
    /// Writes them to the beginning of a slice that has room.
    fn store(self, to: &mut [f64]);
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    fn times(self, other: Self) -> Self;
    fn over(self, other: Self) -> Self;
    /// self * factor + summand, rounded once.
    fn fused(self, factor: Self, summand: Self) -> Self;
}

/// One number: what every processor has.
impl Vector for f64 {
    const LANES: usize = 1;

    #[inline(always)]
    fn splat(number: f64) -> f64 {
        number
    }

    #[inline(always)]
    fn load(from: &[f64]) -> f64 {
        from[0]
    }

    #[inline(always)]
    fn store(self, to: &mut [f64]) {
        to[0] = self;
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
    ($register:ident, $lanes:expr, $splat:ident, $load:ident, $store:ident, $add:ident,
     $subtract:ident, $multiply:ident, $divide:ident, $fused:ident) => {
        #[allow(unsafe_code, reason = "only functions compiled for the instruction set name it")]
        impl Vector for std::arch::x86_64::$register {
            const LANES: usize = $lanes;

            #[inline(always)]
            fn splat(number: f64) -> Self {
                // SAFETY: here and below: this is inlined into `dispatched` functions alone,
                // which run where the processor has these operations.
                unsafe { std::arch::x86_64::$splat(number) }
            }

            #[inline(always)]
            fn load(from: &[f64]) -> Self {
                let from: &[f64; $lanes] = &from.as_chunks().0[0];
                // SAFETY: so many numbers are there.
                unsafe { std::arch::x86_64::$load(from.as_ptr()) }
            }

            #[inline(always)]
            fn store(self, to: &mut [f64]) {
                let to: &mut [f64; $lanes] = &mut to.as_chunks_mut().0[0];
                // SAFETY: there is room for so many numbers.
                unsafe { std::arch::x86_64::$store(to.as_mut_ptr(), self) }
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
    _mm256_set1_pd,
    _mm256_loadu_pd,
    _mm256_storeu_pd,
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
    _mm512_set1_pd,
    _mm512_loadu_pd,
    _mm512_storeu_pd,
    _mm512_add_pd,
    _mm512_sub_pd,
    _mm512_mul_pd,
    _mm512_div_pd,
    _mm512_fmadd_pd
);
