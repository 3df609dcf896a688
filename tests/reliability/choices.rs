//! Choices made from bytes: those of a generator of random numbers.

use rand::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg64;

/// Bytes that are used up one by one; where they end, every choice is the first.
pub(crate) struct Choices<'a> {
    bytes: &'a [u8],
}

impl<'a> Choices<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Choices { bytes }
    }

    pub(crate) fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.bytes.split_first() else { return 0 };
        self.bytes = rest;
        *first
    }

    /// A number below `most`, which is at most 256.
    pub(crate) fn below(&mut self, most: usize) -> usize {
        usize::from(self.byte()) % most
    }

    pub(crate) fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }

    /// True in one case of `many`, and where no byte is left never.
    pub(crate) fn one_in(&mut self, many: usize) -> bool {
        self.below(many) == many - 1
    }

    /// A number of a size that measurements and specs have; now and then one that they have not.
    pub(crate) fn number(&mut self) -> f64 {
        let sign = if self.one_in(4) { -1.0 } else { 1.0 };
        sign * match self.below(8) {
            0..=3 => f64::from(self.byte()) / 64.0,
            4 => f64::from(self.byte()),
            5 => 0.0,
            6 => f64::from(self.byte()) * 1e-6,
            _ => self.pick(&[1e300, 1e-300, 1e18, 1e9, 1e-12, f64::MAX, f64::MIN_POSITIVE]),
        }
    }
}

/// Random bytes of a seed.
pub(crate) fn bytes(seed: u64, count: usize) -> Vec<u8> {
    let mut out = vec![0; count];
    Pcg64::seed_from_u64(seed).fill_bytes(&mut out);
    out
}
