//! Memory that machine code runs in: written first, then executable and never both.

use std::io;

use memmap2::{Mmap, MmapMut};

/// Puts machine code into executable memory; tests replace it by one that fails.
pub(super) type Mapper = fn(&[u8]) -> io::Result<Mmap>;

/// What the operating system gives.
pub(super) fn map(bytes: &[u8]) -> io::Result<Mmap> {
    let mut memory = MmapMut::map_anon(bytes.len().max(1))?;
    memory[..bytes.len()].copy_from_slice(bytes);
    memory.make_exec()
}
