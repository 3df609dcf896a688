//! What a function space takes in memory, asked before it is taken.

use super::blocking::BLOCKING;
use super::options::{Options, Trainer};
use super::pass::shares;
use crate::error::{Error, ErrorKind, Result};
use crate::expr::System;

/// Bytes that the triangular factors of a function space take while it is searched, its data in
/// so many folds.
pub fn factors(unknowns: usize, folds: usize) -> u64 {
    let triangles = folds * shares(unknowns)
        + BLOCKING.copies
        + BLOCKING.gathered * rayon::current_num_threads();
    let side = unknowns as u64 + 1;
    8u64.saturating_mul(side.saturating_mul(side)).saturating_mul(triangles as u64)
}

/// Refuses a function space whose factors do not fit.
///
/// # Errors
///
/// Says the size, and the trainer that can do it.
pub fn check(system: &System, options: &Options) -> Result<()> {
    let (terms, tuning) = (system.terms.len(), &options.tuning);
    let by_parts = terms > tuning.course.largest_factor && options.sparse;
    let Some(allowed) = options.memory else { return Ok(()) };
    if by_parts || options.trainer == Trainer::FirstOrder {
        return Ok(());
    }
    let needed = factors(terms + system.parameters.len(), tuning.segments.folds);
    if needed <= allowed {
        return Ok(());
    }
    Err(Error::new(
        ErrorKind::MemoryLimit,
        format!(
            "the function space has {terms} terms, and their triangular factors take {} of \
             memory, but {} are allowed",
            size(needed),
            size(allowed)
        ),
        "train with the first-order trainer whose memory grows with \
         the number of terms and not with its square; or allow more memory; or write a smaller \
         function space",
    ))
}

/// Bytes for people: "1.5 GiB".
pub fn size(bytes: u64) -> String {
    const UNITS: [&str; 5] = ["bytes", "KiB", "MiB", "GiB", "TiB"];
    let mut value = bytes as f64;
    let mut unit = 0;
    while value >= 1024.0 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    let digits = if unit == 0 || value >= 100.0 { 0 } else { 1 };
    format!("{value:.digits$} {}", UNITS[unit])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_read_well() {
        let rows =
            [(12, "12 bytes"), (1536, "1.5 KiB"), (3 << 30, "3.0 GiB"), (300 << 20, "300 MiB")];
        for (bytes, text) in rows {
            assert_eq!(size(bytes), text);
        }
    }
}
