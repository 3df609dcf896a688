//! How much memory data may take: as asked for, or a part of the machine's.

use sysinfo::{MemoryRefreshKind, RefreshKind, System};

use crate::error::{Error, ErrorKind, Result};

/// Without a word from the user, data may take this part of the memory that is free.
const SHARE: u64 = 2;
/// Taken for free where the system does not say.
const USUAL: u64 = 4 << 30;

/// Units of `--memory`, longest first: decimal and binary.
const UNITS: &[(&str, u64)] = &[
    ("KIB", 1 << 10),
    ("MIB", 1 << 20),
    ("GIB", 1 << 30),
    ("TIB", 1 << 40),
    ("KB", 1_000),
    ("MB", 1_000_000),
    ("GB", 1_000_000_000),
    ("TB", 1_000_000_000_000),
    ("B", 1),
];

/// Reads `1GiB`, `500 MB` or a number of bytes.
pub(crate) fn parse(text: &str) -> std::result::Result<u64, String> {
    let upper = text.trim().to_uppercase();
    let (number, unit) = UNITS
        .iter()
        .find_map(|(name, unit)| upper.strip_suffix(name).map(|number| (number.trim(), *unit)))
        .unwrap_or((upper.as_str(), 1));
    match number.parse::<f64>() {
        Ok(number) if number > 0.0 && number.is_finite() => Ok((number * unit as f64) as u64),
        _ => Err("give a size such as 500MB or 2GiB".to_string()),
    }
}

/// What may be taken when nothing was asked for.
pub(crate) fn usual() -> u64 {
    let memory = MemoryRefreshKind::nothing().with_ram();
    let system = System::new_with_specifics(RefreshKind::nothing().with_memory(memory));
    let free = system.map_or(0, |system| system.available_memory());
    let free = if free == 0 { USUAL } else { free };
    free / SHARE
}

/// The least that a fit to data of any size takes.
pub(crate) const LEAST: u64 = 64 << 20;

/// What was asked for, or else the usual.
///
/// # Errors
/// Less than any fit takes.
pub(crate) fn allowed(asked: Option<u64>) -> Result<u64> {
    match asked {
        Some(bytes) if bytes < LEAST => Err(Error::new(
            ErrorKind::InvalidArgument,
            "the memory allowed is less than any fit takes",
            "allow 64MiB or more; data that take more are read part by part",
        )),
        Some(bytes) => Ok(bytes),
        None => Ok(usual()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_machine_says_what_is_free() {
        assert!(usual() > 1 << 20 && usual() != USUAL / SHARE, "{}", usual());
    }

    #[test]
    fn sizes_are_read() {
        let rows = [("1GiB", 1 << 30), ("1.5 kb", 1500), ("64mib", 64 << 20), ("77", 77)];
        for (text, bytes) in rows {
            assert_eq!(parse(text), Ok(bytes), "{text}");
        }
        for text in ["", "GiB", "-1GB", "1XB", "inf"] {
            assert!(parse(text).is_err(), "{text}");
        }
    }
}
