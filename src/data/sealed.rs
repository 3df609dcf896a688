//! Bytes that travel between the processes that share a fit.
//!
//! Four bytes say what it is, two the version, sixteen are the first of the SHA-256 of what
//! follows: the fields of a type in the wire format of postcard. Bytes that were damaged on the way
//! are told by their sum, and those of another version by their number.

use serde::Serialize;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use crate::error::{Error, ErrorKind, Result};

/// Version of all kinds of bytes: it changes when a field does.
const VERSION: u16 = 1;
/// Bytes of the sum.
const SUM: usize = 16;
/// Bytes before the fields.
const HEADER: usize = 4 + 2 + SUM;

/// A type that travels as bytes.
pub trait Sealed: Serialize + DeserializeOwned {
    /// The first four bytes.
    const MARK: &'static [u8; 4];
    /// What it is, for errors.
    const WHAT: &'static str;

    /// Says what is wrong with fields that only a program that is not this one could have written.
    ///
    /// # Errors
    /// In a few words.
    fn checked(&self) -> std::result::Result<(), &'static str>;

    /// The bytes.
    ///
    /// # Errors
    /// None that is known.
    fn sealed(&self) -> Result<Vec<u8>> {
        let fields = postcard::to_allocvec(self).map_err(|error| {
            let message = format!("{} cannot be written ({error})", Self::WHAT);
            Error::new(ErrorKind::Internal, message, "report this")
        })?;
        let mut bytes = Vec::with_capacity(HEADER + fields.len());
        bytes.extend_from_slice(Self::MARK);
        bytes.extend_from_slice(&VERSION.to_le_bytes());
        bytes.extend_from_slice(&sum(&fields));
        bytes.extend_from_slice(&fields);
        Ok(bytes)
    }

    /// What bytes stand for.
    ///
    /// # Errors
    /// They are of another kind or version, or damaged ([`ErrorKind::Model`]).
    fn unsealed(bytes: &[u8]) -> Result<Self> {
        let wrong = |what: &str, hint: &str| {
            Err(Error::new(
                ErrorKind::Model,
                format!("these bytes are no {}: {what}", Self::WHAT),
                hint,
            ))
        };
        const DAMAGED: &str = "hand on what the functions for parts of the data gave, as it is";
        let Some((mark, rest)) = bytes.split_first_chunk::<4>() else {
            return wrong("there are too few", DAMAGED);
        };
        if mark != Self::MARK {
            return wrong("they do not begin as such", DAMAGED);
        }
        let Some((version, rest)) = rest.split_first_chunk::<2>() else {
            return wrong("they are cut off", DAMAGED);
        };
        if u16::from_le_bytes(*version) != VERSION {
            return wrong(
                "they are of another version of this program",
                "let all processes run the same version",
            );
        }
        let Some((told, fields)) = rest.split_first_chunk::<SUM>() else {
            return wrong("they are cut off", DAMAGED);
        };
        if *told != sum(fields) {
            return wrong("they were damaged on the way", DAMAGED);
        }
        let Ok((value, [])) = postcard::take_from_bytes::<Self>(fields) else {
            return wrong("their fields cannot be read", DAMAGED);
        };
        match value.checked() {
            Ok(()) => Ok(value),
            Err(what) => wrong(what, DAMAGED),
        }
    }
}

/// The first bytes of a SHA-256.
pub fn sum(bytes: &[u8]) -> [u8; SUM] {
    let all = Sha256::digest(bytes);
    let mut first = [0; SUM];
    first.iter_mut().zip(all).for_each(|(first, byte)| *first = byte);
    first
}

/// Counts above this are nobody's: sums of two of them do not overflow.
pub const MOST: u64 = 1 << 53;
