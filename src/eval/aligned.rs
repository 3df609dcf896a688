//! Numbers that begin where a line of the processor's cache does.

use std::fmt;
use std::ops::{Deref, DerefMut};

/// Bytes of a line of the cache, and of the widest register.
const LINE: usize = 64;
/// Numbers that may stand before the first line begins.
const SLACK: usize = LINE / size_of::<f64>() - 1;

/// A slice of numbers on the heap: whole registers of it never straddle two lines.
#[derive(Default)]
pub struct Aligned {
    memory: Vec<f64>,
    start: usize,
    length: usize,
}

impl Aligned {
    /// So many zeros.
    pub fn zeros(length: usize) -> Aligned {
        let memory = vec![0.0; length + SLACK];
        let start = memory.as_ptr().align_offset(LINE).min(SLACK);
        Aligned { memory, start, length }
    }

    /// Numbers that there is memory for.
    pub(crate) fn capacity(&self) -> usize {
        self.memory.len()
    }

    /// Changes the length; which numbers then stand there is left open.
    pub fn reshape(&mut self, length: usize) {
        if self.start + length > self.memory.len() {
            *self = Aligned::zeros(length);
        }
        self.length = length;
    }
}

/// The part of `memory` with so many numbers that begins where a line does, and whether it was
/// there before: memory that is too small grows, and the part may move.
pub(super) fn aligned_part(memory: &mut Vec<f64>, length: usize) -> (&mut [f64], bool) {
    let again = memory.len() >= length + SLACK;
    memory.resize(memory.len().max(length + SLACK), 0.0);
    let start = memory.as_ptr().align_offset(LINE).min(SLACK);
    (&mut memory[start..start + length], again)
}

impl Deref for Aligned {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.memory[self.start..self.start + self.length]
    }
}

impl DerefMut for Aligned {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.memory[self.start..self.start + self.length]
    }
}

impl Clone for Aligned {
    fn clone(&self) -> Aligned {
        let mut copy = Aligned::default();
        copy.clone_from(self);
        copy
    }

    fn clone_from(&mut self, other: &Aligned) {
        self.reshape(other.length);
        self.copy_from_slice(other);
    }
}

impl PartialEq for Aligned {
    fn eq(&self, other: &Aligned) -> bool {
        **self == **other
    }
}

impl fmt::Debug for Aligned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_length_begins_at_a_line() {
        let mut numbers = Aligned::default();
        for length in [0, 1, 7, 100, 3, 1000] {
            numbers.reshape(length);
            assert_eq!(numbers.len(), length);
            assert!(length == 0 || (numbers.as_ptr() as usize).is_multiple_of(LINE));
            numbers.fill(length as f64);
            assert_eq!(numbers.clone(), numbers);
        }
    }
}
