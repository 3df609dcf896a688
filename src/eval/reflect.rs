//! Householder reflections of tall columns: the arithmetic of a triangular factor.
//!
//! The columns lie one after the other in memory, and so their rows fill registers: inner
//! products are taken in eight sums side by side, the last rows padded with zeros. What compilers
//! make of such loops depends on chance, so AVX-512 has its own, with the same bits.

#![allow(unsafe_code, reason = "instructions of AVX-512, on columns whose length was checked")]

use super::processor::{InstructionSet, dispatched};

/// Numbers that are summed side by side.
const PARTS: usize = 8;
/// Times that many sums of one inner product.
const CHAINS: usize = 4;
/// Reflections that are taken to a column at once, at best.
pub(crate) const GROUP: usize = 4;

/// `M` Householder reflections as one block reflector Q' = I - V T' V'.
#[derive(Clone, Copy)]
pub(crate) struct Reflections<'a, const M: usize> {
    /// `[reflection][height]` with `stride` between the reflections; their heads are 1.
    pub vectors: &'a [f64],
    /// Rows of the vectors.
    pub height: usize,
    /// Numbers from one vector, or column, to the next.
    pub stride: usize,
    /// T by columns; `triangle[m][l]` is zero for l > m.
    pub triangle: [[f64; M]; M],
}

impl<const M: usize> Reflections<'_, M> {
    fn vector(&self, m: usize) -> &[f64] {
        &self.vectors[m * self.stride..][..self.height]
    }

    /// How far a column moves along each vector, from its products with them.
    #[inline(always)]
    fn moves(&self, products: [f64; M]) -> [f64; M] {
        let mut moves = [0.0; M];
        for (moves, column) in moves.iter_mut().zip(&self.triangle) {
            for (t, product) in column.iter().zip(&products) {
                *moves -= t * product;
            }
        }
        moves
    }
}

/// Takes reflections to columns, `[column][height]`, whose entries above the rectangle (one for
/// each reflection) begin every column of `heads`, `[column][head_stride]`.
pub(crate) fn reflect<const M: usize>(
    set: InstructionSet,
    by: &Reflections<M>,
    heads: &mut [f64],
    head_stride: usize,
    columns: &mut [f64],
) {
    #[cfg(target_arch = "x86_64")]
    if set.min(InstructionSet::widest()) == InstructionSet::Avx512 {
        // SAFETY: `widest` has just found the instruction set on this processor.
        return unsafe { wide::reflect(by, heads, head_stride, columns) };
    }
    for (column, heads) in columns.chunks_mut(by.stride).zip(heads.chunks_mut(head_stride)) {
        let column = &mut column[..by.height];
        let mut products = [0.0; M];
        for m in 0..M {
            let mut parts = [0.0; PARTS];
            add_products(set, &mut parts, by.vector(m), column);
            products[m] = heads[m] + together(&parts);
        }
        let moves = by.moves(products);
        for m in 0..M {
            heads[m] += moves[m];
            add_multiple(set, column, by.vector(m), moves[m]);
        }
    }
}

/// The inner product of two columns of the same height.
pub(crate) fn product(set: InstructionSet, a: &[f64], b: &[f64]) -> f64 {
    #[cfg(target_arch = "x86_64")]
    if set.min(InstructionSet::widest()) == InstructionSet::Avx512 {
        // SAFETY: `widest` has just found the instruction set on this processor.
        return unsafe { wide::product(a, &b[..a.len()]) };
    }
    let mut parts = [[0.0; PARTS]; CHAINS];
    let rows = PARTS * CHAINS;
    for (a, b) in a.chunks(rows).zip(b.chunks(rows)) {
        for ((parts, a), b) in parts.iter_mut().zip(a.chunks(PARTS)).zip(b.chunks(PARTS)) {
            add_products(set, parts, a, b);
        }
    }
    parts.iter().map(together).sum()
}

dispatched! {
    /// Adds the products of each eight numbers to eight sums.
    fn add_products(parts: &mut [f64; PARTS], a: &[f64], b: &[f64]) = add_products_body;
}

#[inline(always)]
fn add_products_body(parts: &mut [f64; PARTS], a: &[f64], b: &[f64]) {
    for (a, b) in a.chunks(PARTS).zip(b.chunks(PARTS)) {
        for ((sum, a), b) in parts.iter_mut().zip(a).zip(b) {
            *sum = a.mul_add(*b, *sum);
        }
    }
}

dispatched! {
    /// column += vector * factor, number by number, each rounded once.
    fn add_multiple(column: &mut [f64], vector: &[f64], factor: f64) = add_multiple_body;
}

#[inline(always)]
fn add_multiple_body(column: &mut [f64], vector: &[f64], factor: f64) {
    for (x, v) in column.iter_mut().zip(vector) {
        *x = v.mul_add(factor, *x);
    }
}

/// Their sum, by halves: no addition waits for all before it.
#[inline(always)]
fn together([a, b, c, d, e, f, g, h]: &[f64; PARTS]) -> f64 {
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

/// The same in registers of eight numbers.
#[cfg(target_arch = "x86_64")]
mod wide {
    use std::arch::x86_64::{
        __m512d, __mmask8, _mm512_fmadd_pd, _mm512_loadu_pd, _mm512_mask_storeu_pd,
        _mm512_maskz_loadu_pd, _mm512_set1_pd, _mm512_setzero_pd, _mm512_storeu_pd,
    };

    use super::{CHAINS, PARTS, Reflections, together};

    /// The mask of the numbers that are left from a place on, eight at most.
    fn left(length: usize, at: usize) -> __mmask8 {
        (0xff_u16 >> (PARTS - (length - at).min(PARTS))) as __mmask8
    }

    /// Up to eight numbers from a place on, zeros where the slice has ended.
    #[inline]
    #[target_feature(enable = "avx512f")]
    fn load(from: &[f64], at: usize) -> __m512d {
        debug_assert!(at < from.len());
        // SAFETY: nothing is read beyond the slice, which the mask is counted from.
        unsafe { _mm512_maskz_loadu_pd(left(from.len(), at), from.as_ptr().add(at)) }
    }

    /// Eight numbers from a place on.
    #[inline]
    #[target_feature(enable = "avx512f")]
    fn eight(from: &[f64], at: usize) -> __m512d {
        debug_assert!(at + PARTS <= from.len());
        // SAFETY: every caller counts its places from the length of the slice, in eights.
        unsafe { _mm512_loadu_pd(from.as_ptr().add(at)) }
    }

    #[inline]
    #[target_feature(enable = "avx512f")]
    fn sum(parts: __m512d) -> f64 {
        let mut numbers = [0.0; PARTS];
        // SAFETY: the array holds eight numbers.
        unsafe { _mm512_storeu_pd(numbers.as_mut_ptr(), parts) };
        together(&numbers)
    }

    #[target_feature(enable = "avx512f")]
    pub(super) fn product(a: &[f64], b: &[f64]) -> f64 {
        let mut parts = [_mm512_setzero_pd(); CHAINS];
        let mut at = 0;
        while at + PARTS * CHAINS <= a.len() {
            for (chain, parts) in parts.iter_mut().enumerate() {
                let place = at + chain * PARTS;
                *parts = _mm512_fmadd_pd(eight(a, place), eight(b, place), *parts);
            }
            at += PARTS * CHAINS;
        }
        for parts in &mut parts {
            if at < a.len() {
                *parts = _mm512_fmadd_pd(load(a, at), load(b, at), *parts);
                at += PARTS;
            }
        }
        let mut all = 0.0;
        for parts in parts {
            all += sum(parts);
        }
        all
    }

    #[target_feature(enable = "avx512f")]
    pub(super) fn reflect<const M: usize>(
        by: &Reflections<M>,
        heads: &mut [f64],
        head_stride: usize,
        columns: &mut [f64],
    ) {
        // Columns side by side: products need not wait for those before them.
        let mut columns = columns.chunks_mut(by.stride);
        let mut heads = heads.chunks_mut(head_stride);
        let mut next = || Some((&mut columns.next()?[..by.height], &mut heads.next()?[..M]));
        while let Some(first) = next() {
            // The last ones wait for each other as little as they can.
            match [next(), next(), next()] {
                [Some(second), Some(third), Some(fourth)] => {
                    reflect_columns(by, [first, second, third, fourth]);
                }
                [Some(second), Some(third), None] => reflect_columns(by, [first, second, third]),
                [Some(second), ..] => reflect_columns(by, [first, second]),
                [None, ..] => reflect_columns(by, [first]),
            }
        }
    }

    #[inline]
    #[target_feature(enable = "avx512f")]
    fn reflect_columns<const M: usize, const C: usize>(
        by: &Reflections<M>,
        columns: [(&mut [f64], &mut [f64]); C],
    ) {
        let whole = by.height / PARTS * PARTS;
        let mut vectors: [&[f64]; M] = [&[]; M];
        for (m, vector) in vectors.iter_mut().enumerate() {
            *vector = by.vector(m);
        }
        let mut parts = [[_mm512_setzero_pd(); M]; C];
        for at in (0..whole).step_by(PARTS) {
            for m in 0..M {
                let v = eight(vectors[m], at);
                for c in 0..C {
                    parts[c][m] = _mm512_fmadd_pd(v, eight(columns[c].0, at), parts[c][m]);
                }
            }
        }
        if whole < by.height {
            for m in 0..M {
                let v = load(vectors[m], whole);
                for c in 0..C {
                    parts[c][m] = _mm512_fmadd_pd(v, load(columns[c].0, whole), parts[c][m]);
                }
            }
        }
        let mut factors = [[_mm512_setzero_pd(); M]; C];
        for c in 0..C {
            let heads = &mut columns[c].1[..M];
            let mut products = [0.0; M];
            for m in 0..M {
                products[m] = heads[m] + sum(parts[c][m]);
            }
            let moves = by.moves(products);
            for m in 0..M {
                heads[m] += moves[m];
                factors[c][m] = _mm512_set1_pd(moves[m]);
            }
        }
        for at in (0..whole).step_by(PARTS) {
            // Before anything is stored: for all the compiler knows it could be theirs.
            let mut v = [_mm512_setzero_pd(); M];
            for m in 0..M {
                v[m] = eight(vectors[m], at);
            }
            for c in 0..C {
                let mut x = eight(columns[c].0, at);
                for m in 0..M {
                    x = _mm512_fmadd_pd(v[m], factors[c][m], x);
                }
                let place = &mut columns[c].0[at..][..PARTS];
                // SAFETY: the place has room for eight numbers.
                unsafe { _mm512_storeu_pd(place.as_mut_ptr(), x) };
            }
        }
        if whole < by.height {
            let mask = left(by.height, whole);
            for c in 0..C {
                let mut x = load(columns[c].0, whole);
                for m in 0..M {
                    x = _mm512_fmadd_pd(load(vectors[m], whole), factors[c][m], x);
                }
                let place = columns[c].0[whole..].as_mut_ptr();
                // SAFETY: nothing is written beyond the slice, which the mask is counted from.
                unsafe { _mm512_mask_storeu_pd(place, mask, x) };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(count: usize, seed: f64) -> Vec<f64> {
        (0..count).map(|i| (seed + 1.7 * i as f64).sin()).collect()
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        for height in [1, 7, 8, 9, 40, 129] {
            let (stride, vectors) = (height + 3, numbers(GROUP * (height + 3), 0.3));
            let mut triangle = [[0.0; GROUP]; GROUP];
            for (m, column) in triangle.iter_mut().enumerate() {
                for (l, t) in column.iter_mut().take(m + 1).enumerate() {
                    *t = (1.0 + m as f64 - 0.3 * l as f64).cos();
                }
            }
            let by = Reflections { vectors: &vectors, height, stride, triangle };
            let run = |set| {
                let (mut heads, mut columns) = (numbers(21, 0.9), numbers(3 * stride, 0.1));
                reflect(set, &by, &mut heads, 7, &mut columns);
                let product = product(set, by.vector(0), by.vector(1));
                (heads, columns, product)
            };
            let plain = run(InstructionSet::Plain);
            for set in InstructionSet::available() {
                assert_eq!(run(set), plain, "{set:?}, {height} rows");
            }
        }
    }

    #[test]
    fn a_reflection_keeps_the_length_of_a_column() {
        let vector = numbers(20, 0.4);
        let tau = 2.0 / (1.0 + vector.iter().map(|v| v * v).sum::<f64>());
        let by = Reflections { vectors: &vector, height: 20, stride: 20, triangle: [[tau]] };
        let (mut head, mut column) = ([0.7], numbers(20, 2.0));
        let squares =
            |head: f64, column: &[f64]| head * head + column.iter().map(|x| x * x).sum::<f64>();
        let before = squares(head[0], &column);
        reflect(InstructionSet::widest(), &by, &mut head, 1, &mut column);
        assert!((squares(head[0], &column) - before).abs() < 1e-13 * before);
    }
}
