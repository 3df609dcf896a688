//! Elementary functions of many numbers at once.
//!
//! Each is a straight line of fused arithmetic without a branch, so that the compiler makes
//! vectors of it, and the result is the same bits in registers of every width. Arguments that
//! the straight line cannot do (huge angles) are done again by the standard library.
//! Polynomials and reductions are those of fdlibm (Sun Microsystems, 1993: e_log.c, k_sin.c,
//! k_cos.c) and Taylor's for exp, arranged for fused multiply-add. Errors against numbers of
//! twice the length are in the tests: 1 unit in the last place for sin, cos, exp and log, 2 for
//! tan, sinh, cosh and tanh. Subnormal numbers are results and arguments like any other.

use super::InstructionSet;
use super::processor::dispatched;
use crate::expr::{Function, Kernel};

/// The code of a [`Kernel`].
pub(super) struct Code {
    /// The function of every number of a row.
    pub row: fn(InstructionSet, &[f64], &mut [f64]),
    /// Where machine code finds the function of one number.
    #[cfg(target_arch = "x86_64")]
    pub entry: fn() -> usize,
}

/// The straight line of a function, if it has one.
pub(super) fn code(function: Function) -> Option<Code> {
    function.row().kernel.map(code_of)
}

/// function(x) for every number of a row.
pub(super) fn apply(set: InstructionSet, function: Function, from: &[f64], to: &mut [f64]) {
    match code(function) {
        Some(code) => (code.row)(set, from, to),
        None => {
            let value = function.row().value;
            to.iter_mut().zip(from).for_each(|(to, &x)| *to = value(x));
        }
    }
}

/// Numbers that are worked on together.
const CHUNK: usize = 16;

/// `fast` on every number, and `slow` on those that `fits` refuses.
#[inline(always)]
fn row(
    from: &[f64],
    to: &mut [f64],
    fast: impl Fn(f64) -> f64,
    fits: impl Fn(f64) -> bool,
    slow: fn(f64) -> f64,
) {
    let (from, last) = from.as_chunks::<CHUNK>();
    let (to, last_to) = to.as_chunks_mut::<CHUNK>();
    // Straight from row to row: a copy in between would be waited for.
    for (from, to) in from.iter().zip(to) {
        let mut all = true;
        for i in 0..CHUNK {
            to[i] = fast(from[i]);
            all &= fits(from[i]);
        }
        if !all {
            again(from, to, &fits, slow);
        }
    }
    if last.is_empty() {
        return;
    }
    let (mut from, mut to) = ([0.0; CHUNK], [0.0; CHUNK]);
    from[..last.len()].copy_from_slice(last);
    for i in 0..CHUNK {
        to[i] = fast(from[i]);
    }
    again(&from, &mut to, &fits, slow);
    last_to.copy_from_slice(&to[..last.len()]);
}

/// `slow` on the numbers that `fits` refuses.
#[inline(never)]
fn again(
    from: &[f64; CHUNK],
    to: &mut [f64; CHUNK],
    fits: impl Fn(f64) -> bool,
    slow: fn(f64) -> f64,
) {
    for (to, &x) in to.iter_mut().zip(from) {
        if !fits(x) {
            *to = slow(x);
        }
    }
}

macro_rules! kernels {
    ($($kernel:ident, $name:ident: $fast:path, $fits:path, $slow:path;)*) => {
        fn code_of(kernel: Kernel) -> Code {
            match kernel {
                $(Kernel::$kernel => Code {
                    row: $name::row_of,
                    #[cfg(target_arch = "x86_64")]
                    entry: $name::entry,
                },)*
            }
        }

        $(mod $name {
            use super::*;

            #[inline(always)]
            fn body(from: &[f64], to: &mut [f64]) {
                row(from, to, |x| $fast(x), |x| $fits(x), $slow);
            }

            dispatched! {
                pub(super) fn row_of(from: &[f64], to: &mut [f64]) = body;
            }

            /// For machine code alone, which runs only where AVX2 is.
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,fma")]
            extern "sysv64" fn one(x: f64) -> f64 {
                if $fits(x) { $fast(x) } else { $slow(x) }
            }

            #[cfg(target_arch = "x86_64")]
            pub(super) fn entry() -> usize {
                one as unsafe extern "sysv64" fn(f64) -> f64 as usize
            }
        })*
    };
}

kernels! {
    Sine, sin: super::sine, super::is_small_angle, f64::sin;
    Cosine, cos: super::cosine, super::is_small_angle, f64::cos;
    Tangent, tan: super::tangent, super::is_small_angle, f64::tan;
    Exponential, exp: super::exponential, super::always, f64::exp;
    Logarithm, log: super::logarithm, super::always, f64::ln;
    HyperbolicSine, sinh: super::hyperbolic_sine, super::always, f64::sinh;
    HyperbolicCosine, cosh: super::hyperbolic_cosine, super::always, f64::cosh;
    HyperbolicTangent, tanh: super::hyperbolic_tangent, super::always, f64::tanh;
    SquareRoot, sqrt: f64::sqrt, super::always, f64::sqrt;
    AbsoluteValue, abs: f64::abs, super::always, f64::abs;
    Sign, sign: super::sign, super::always, super::sign;
}

#[inline(always)]
fn always(_: f64) -> bool {
    true
}

#[inline(always)]
fn sign(x: f64) -> f64 {
    if x == 0.0 {
        0.0
    } else if x.is_nan() {
        x
    } else {
        1.0_f64.copysign(x)
    }
}

/// Added to a number and taken away again it leaves the nearest whole number, whose last bits
/// meanwhile are those of the sum.
pub(super) const WHOLE: f64 = 6_755_399_441_055_744.0;

/// Angles up to this are reduced by three parts of pi/2.
const LARGEST_ANGLE: f64 = 1e7;
const HALF_PI: [f64; 3] =
    [std::f64::consts::FRAC_PI_2, 6.123_233_995_736_766e-17, -1.497_384_904_859_169_8e-33];

#[inline(always)]
fn is_small_angle(x: f64) -> bool {
    x.abs() <= LARGEST_ANGLE
}

/// x - k pi/2 in two parts, and the last bits of k.
#[inline(always)]
fn reduced(x: f64) -> (f64, f64, u64) {
    let shifted = x.mul_add(std::f64::consts::FRAC_2_PI, WHOLE);
    let k = shifted - WHOLE;
    let first = (-k).mul_add(HALF_PI[0], x);
    // Of the second part nothing may be lost: near a multiple of pi/2 it is all that is left.
    // `first` is a whole number of last places of `second`, so that `taken` is exact (Dekker,
    // Numerische Mathematik 18, 1971) and one rounding is left.
    let second = k * HALF_PI[1];
    let high = first - second;
    let taken = first - high;
    let low = (-k).mul_add(HALF_PI[2], (-k).mul_add(HALF_PI[1], taken));
    (high, low, shifted.to_bits())
}

/// sin(high + low) for |high| <= pi/4.
#[inline(always)]
fn sine_kernel(high: f64, low: f64) -> f64 {
    let z = high * high;
    let cube = z * high;
    let r = 1.589_690_995_211_55e-10_f64
        .mul_add(z, -2.505_076_025_340_686_4e-8)
        .mul_add(z, 2.755_731_370_707_006_7e-6)
        .mul_add(z, -1.984_126_982_985_795e-4)
        .mul_add(z, 8.333_333_333_322_49e-3);
    let tail = cube.mul_add(-r, 0.5 * low).mul_add(z, -low);
    high - cube.mul_add(1.666_666_666_666_663_2e-1, tail)
}

/// cos(high + low) for |high| <= pi/4.
#[inline(always)]
fn cosine_kernel(high: f64, low: f64) -> f64 {
    let z = high * high;
    let r = (-1.135_964_755_778_819_5e-11_f64)
        .mul_add(z, 2.087_572_321_298_175e-9)
        .mul_add(z, -2.755_731_435_139_066_3e-7)
        .mul_add(z, 2.480_158_728_947_673e-5)
        .mul_add(z, -1.388_888_888_887_411e-3)
        .mul_add(z, 4.166_666_666_666_66e-2);
    let half = 0.5 * z;
    let near = 1.0 - half;
    near + (z * z).mul_add(r, (-high).mul_add(low, (1.0 - near) - half))
}

/// The sine of a quarter turn further on: sin, cos, -sin, -cos for 0, 1, 2, 3.
#[inline(always)]
fn quarter(high: f64, low: f64, quarters: u64) -> f64 {
    let (sine, cosine) = (sine_kernel(high, low), cosine_kernel(high, low));
    let value = if quarters & 1 == 0 { sine } else { cosine };
    f64::from_bits(value.to_bits() ^ (quarters & 2) << 62)
}

#[inline(always)]
fn sine(x: f64) -> f64 {
    let (high, low, quarters) = reduced(x);
    let value = quarter(high, low, quarters);
    // -0 is its own sine; the reduction makes 0 of it.
    if x == 0.0 { x } else { value }
}

#[inline(always)]
fn cosine(x: f64) -> f64 {
    let (high, low, quarters) = reduced(x);
    quarter(high, low, quarters.wrapping_add(1))
}

#[inline(always)]
fn tangent(x: f64) -> f64 {
    let (high, low, quarters) = reduced(x);
    let (sine, cosine) = (sine_kernel(high, low), cosine_kernel(high, low));
    let odd = quarters & 1 == 1;
    let value = if odd { -cosine } else { sine } / if odd { sine } else { cosine };
    if x == 0.0 { x } else { value }
}

pub(super) const LN_2: [f64; 2] = [std::f64::consts::LN_2, 2.319_046_813_846_299_6e-17];

/// (bits of k, exp(r) - 1) with x = k ln 2 + r.
#[inline(always)]
fn exponential_parts(x: f64) -> (u64, f64) {
    let shifted = x.mul_add(std::f64::consts::LOG2_E, WHOLE);
    let k = shifted - WHOLE;
    let r = (-k).mul_add(LN_2[1], (-k).mul_add(LN_2[0], x));
    (shifted.to_bits().wrapping_sub(WHOLE.to_bits()), (r * r).mul_add(exponential_tail(r), r))
}

/// (exp(r) - 1 - r) / r^2 for |r| <= ln(2)/2.
#[inline(always)]
pub(super) fn exponential_tail(r: f64) -> f64 {
    (1.0 / 6_227_020_800.0_f64)
        .mul_add(r, 1.0 / 479_001_600.0)
        .mul_add(r, 1.0 / 39_916_800.0)
        .mul_add(r, 1.0 / 3_628_800.0)
        .mul_add(r, 1.0 / 362_880.0)
        .mul_add(r, 1.0 / 40_320.0)
        .mul_add(r, 1.0 / 5_040.0)
        .mul_add(r, 1.0 / 720.0)
        .mul_add(r, 1.0 / 120.0)
        .mul_add(r, 1.0 / 24.0)
        .mul_add(r, 1.0 / 6.0)
        .mul_add(r, 0.5)
}

/// 2^shift exp(x); the power of two comes in two halves, so that neither overflows and
/// a subnormal result is rounded once.
#[inline(always)]
fn scaled_exponential(x: f64, shift: i64) -> f64 {
    let x = if x > 712.0 { 712.0 } else { x };
    let x = if x < -747.0 { -747.0 } else { x };
    let (k, p) = exponential_parts(x);
    let biased = k.wrapping_add(4096_i64.wrapping_add(shift) as u64);
    let half = biased >> 1;
    let first = f64::from_bits(half.wrapping_sub(1025) << 52);
    let second = f64::from_bits(biased.wrapping_sub(half).wrapping_sub(1025) << 52);
    (1.0 + p) * first * second
}

#[inline(always)]
fn exponential(x: f64) -> f64 {
    scaled_exponential(x, 0)
}

/// exp(x) - 1 for |x| < 50.
#[inline(always)]
fn exponential_less_one(x: f64) -> f64 {
    let (k, p) = exponential_parts(x);
    let power = f64::from_bits(k.wrapping_add(1023) << 52);
    power.mul_add(p, power - 1.0)
}

/// ln 2 in a part that whole numbers multiply without rounding, and the rest.
pub(super) const SHORT_LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];

/// (k + 1023, m) with x = 2^k m and m between sqrt(1/2) and sqrt(2), for x positive and normal.
#[inline(always)]
pub(super) fn taken_apart(x: f64) -> (f64, f64) {
    // Bits of sqrt(1/2).
    const CENTRE: u64 = 0x3fe6_a09e_0000_0000;
    let bits = x.to_bits().wrapping_add(0x3ff0_0000_0000_0000 - CENTRE);
    let exponent = f64::from_bits(0x4330_0000_0000_0000 | (bits >> 52)) - 4_503_599_627_370_496.0;
    (exponent, f64::from_bits((bits & 0x000f_ffff_ffff_ffff).wrapping_add(CENTRE)))
}

#[inline(always)]
fn logarithm(x: f64) -> f64 {
    let subnormal = x < f64::MIN_POSITIVE;
    let scaled = if subnormal { x * 18_014_398_509_481_984.0 } else { x };
    let offset = if subnormal { 1023.0 + 54.0 } else { 1023.0 };
    let (exponent, m) = taken_apart(scaled);
    let (k, f) = (exponent - offset, m - 1.0);
    let s = f / (2.0 + f);
    let z = s * s;
    let r = 1.479_819_860_511_658_6e-1_f64
        .mul_add(z, 1.531_383_769_920_937_3e-1)
        .mul_add(z, 1.818_357_216_161_805e-1)
        .mul_add(z, 2.222_219_843_214_978_4e-1)
        .mul_add(z, 2.857_142_874_366_239e-1)
        .mul_add(z, 3.999_999_999_940_942e-1)
        .mul_add(z, 6.666_666_666_666_735e-1)
        * z;
    let half = 0.5 * f * f;
    let [high, low] = SHORT_LN_2;
    let value = k.mul_add(high, f - (half - s.mul_add(half + r, k * low)));
    let value = if x == 0.0 { f64::NEG_INFINITY } else { value };
    let value = if x < 0.0 { f64::NAN } else { value };
    // Infinity, and what is not a number.
    if x < f64::INFINITY { value } else { x }
}

#[inline(always)]
fn hyperbolic_sine(x: f64) -> f64 {
    let size = x.abs();
    let less = exponential_less_one(if size < 40.0 { size } else { 40.0 });
    let small = 0.5 * (less + less / (less + 1.0));
    let large = scaled_exponential(size, -1);
    if size < 22.0 { small } else { large }.copysign(x)
}

#[inline(always)]
fn hyperbolic_cosine(x: f64) -> f64 {
    let half = scaled_exponential(x.abs(), -1);
    half + 0.25 / half
}

#[inline(always)]
fn hyperbolic_tangent(x: f64) -> f64 {
    let size = x.abs();
    // 22 and more have the tangent 1; what is not a number stays so.
    let less = exponential_less_one(if size > 22.0 { 44.0 } else { 2.0 * size });
    let value = less / (less + 2.0);
    if size > 22.0 { 1.0 } else { value }.copysign(x)
}
