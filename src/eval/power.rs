//! Powers of many numbers at once, base and exponent both real.
//!
//! x^y is exp(y ln x), and all errors of y ln x become relative ones. So the logarithm is a sum of
//! two numbers (Dekker, Numerische Mathematik 18, 1971), wrong by less than 2^-62 of itself. The
//! arrangement is that of fdlibm (Sun Microsystems, 1993: e_pow.c) without its tables, for fused
//! multiply-add. The error is at most 1 unit in the last place, against numbers of twice the
//! length in the tests. What the straight line cannot do (bases that are not positive and normal,
//! results near overflow) the standard library does again.

use super::InstructionSet;
use super::elementary::{LN_2, SHORT_LN_2, WHOLE, exponential_tail, taken_apart};
use super::processor::dispatched;
use crate::expr::raise;

/// Numbers that are worked on together.
const CHUNK: usize = 16;

dispatched! {
    /// bases^exponents, number by number.
    pub(super) fn powers(bases: &[f64], exponents: &[f64], to: &mut [f64]) = rows;
}

dispatched! {
    /// bases^exponent for an exponent that is not whole.
    fn powers_of_one(bases: &[f64], exponent: f64, to: &mut [f64]) = row;
}

/// bases^exponent as [`raise`] means it: exact for small whole exponents.
pub(super) fn raised(set: InstructionSet, bases: &[f64], exponent: f64, to: &mut [f64]) {
    if exponent.fract() == 0.0 {
        to.iter_mut().zip(bases).for_each(|(to, &x)| *to = raise(x, exponent));
    } else {
        powers_of_one(set, bases, exponent, to);
    }
}

#[inline(always)]
fn rows(bases: &[f64], exponents: &[f64], to: &mut [f64]) {
    let (bases, last_bases) = bases.as_chunks::<CHUNK>();
    let (exponents, last_exponents) = exponents.as_chunks::<CHUNK>();
    let (to, last_to) = to.as_chunks_mut::<CHUNK>();
    for ((x, y), to) in bases.iter().zip(exponents).zip(to) {
        chunk(x, y, to);
    }
    if last_to.is_empty() {
        return;
    }
    let (mut x, mut y, mut to) = ([1.0; CHUNK], [1.0; CHUNK], [0.0; CHUNK]);
    x[..last_bases.len()].copy_from_slice(last_bases);
    y[..last_exponents.len()].copy_from_slice(last_exponents);
    chunk(&x, &y, &mut to);
    last_to.copy_from_slice(&to[..last_bases.len()]);
}

#[inline(always)]
fn row(bases: &[f64], exponent: f64, to: &mut [f64]) {
    let exponents = [exponent; CHUNK];
    for (x, to) in bases.chunks(CHUNK).zip(to.chunks_mut(CHUNK)) {
        rows(x, &exponents[..x.len()], to);
    }
}

#[inline(always)]
fn chunk(x: &[f64; CHUNK], y: &[f64; CHUNK], to: &mut [f64; CHUNK]) {
    let mut fitting = [true; CHUNK];
    for i in 0..CHUNK {
        (to[i], fitting[i]) = straight(x[i], y[i]);
    }
    if fitting.contains(&false) {
        again(x, y, &fitting, to);
    }
}

/// The standard library on what the straight line cannot do.
#[inline(never)]
fn again(x: &[f64; CHUNK], y: &[f64; CHUNK], fitting: &[bool; CHUNK], to: &mut [f64; CHUNK]) {
    for i in 0..CHUNK {
        if !fitting[i] {
            to[i] = x[i].powf(y[i]);
        }
    }
}

/// x^y for machine code alone, which runs only where AVX2 is; the same bits as of a row.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
extern "sysv64" fn one(x: f64, y: f64) -> f64 {
    let (value, fits) = straight(x, y);
    if fits { value } else { x.powf(y) }
}

/// The same for an exponent that is the same for all points: exact where it is small and whole.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
extern "sysv64" fn one_raised(x: f64, exponent: f64) -> f64 {
    if exponent.fract() == 0.0 { raise(x, exponent) } else { one(x, exponent) }
}

/// Where machine code finds the power of one number.
#[cfg(target_arch = "x86_64")]
pub(super) fn entry() -> usize {
    one as unsafe extern "sysv64" fn(f64, f64) -> f64 as usize
}

/// Where machine code finds that of an exponent that may be whole.
#[cfg(target_arch = "x86_64")]
pub(super) fn entry_raised() -> usize {
    one_raised as unsafe extern "sysv64" fn(f64, f64) -> f64 as usize
}

/// y ln x of this size is far from where exp overflows or becomes subnormal.
const LARGEST: f64 = 700.0;

/// x^y, and whether that is so.
#[inline(always)]
fn straight(x: f64, y: f64) -> (f64, bool) {
    let (high, low) = logarithm(x);
    let product = y * high;
    let rest = y.mul_add(low, y.mul_add(high, -product));
    let fits = (f64::MIN_POSITIVE..f64::INFINITY).contains(&x) && product.abs() <= LARGEST;
    (exponential(product, rest), fits)
}

/// ln x in two parts, for x that is positive and normal.
///
/// With x = 2^k m and s = (m - 1) / (m + 1), ln x = k ln 2 + s (2 + 2/3 s^2 + s^4 P(s^2)).
#[inline(always)]
fn logarithm(x: f64) -> (f64, f64) {
    let (exponent, m) = taken_apart(x);
    let (k, f) = (exponent - 1023.0, m - 1.0);
    let d = m + 1.0;
    let d_low = m - (d - 1.0);
    let inverse = 1.0 / d;
    let s = f * inverse;
    let s_low = (-s).mul_add(d_low, (-s).mul_add(d, f)) * inverse;
    let z = s * s;
    let z_low = (2.0 * s).mul_add(s_low, s.mul_add(s, -z));
    // The least relative error up to s^2 = 0.02945 (Remez), 2^-57.
    let p = 1.172_384_082_515_385_1e-1_f64
        .mul_add(z, 1.170_617_125_799_128_8e-1)
        .mul_add(z, 1.333_480_720_059_326e-1)
        .mul_add(z, 1.538_459_491_476_976_4e-1)
        .mul_add(z, 1.818_181_833_585_828_2e-1)
        .mul_add(z, 2.222_222_222_165_373e-1)
        .mul_add(z, 2.857_142_857_142_937e-1)
        .mul_add(z, 0.4);
    const TWO_THIRDS: [f64; 2] = [2.0 / 3.0, 3.700_743_415_417_188e-17];
    let tail = z * p;
    let q = TWO_THIRDS[0] + tail;
    let q_low = (TWO_THIRDS[0] - q) + tail + TWO_THIRDS[1];
    let a = z * q;
    let a_low = z.mul_add(q_low, z_low.mul_add(q, z.mul_add(q, -a)));
    let b = 2.0 + a;
    let b_low = (2.0 - b) + a + a_low;
    let ln = s * b;
    let ln_low = s.mul_add(b_low, s_low.mul_add(b, s.mul_add(b, -ln)));
    let whole = k * SHORT_LN_2[0];
    let high = whole + ln;
    let low = (whole - high) + ln + k.mul_add(SHORT_LN_2[1], ln_low);
    // The second part is to be small beside the first.
    let sum = high + low;
    (sum, (high - sum) + low)
}

/// exp(high + low) for |high| up to [`LARGEST`].
#[inline(always)]
fn exponential(high: f64, low: f64) -> f64 {
    let shifted = high.mul_add(std::f64::consts::LOG2_E, WHOLE);
    let k = shifted - WHOLE;
    let first = (-k).mul_add(LN_2[0], high);
    let second = (-k).mul_add(LN_2[1], low);
    let r = first + second;
    let r_low = (first - r) + second;
    let sum = 1.0 + r;
    let value = sum + ((1.0 - sum) + r + (r * r).mul_add(exponential_tail(r), r_low));
    let power = shifted.to_bits().wrapping_sub(WHOLE.to_bits()).wrapping_add(1023) << 52;
    value * f64::from_bits(power)
}
