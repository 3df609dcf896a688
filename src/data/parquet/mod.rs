//! Parquet: typed columns in groups of rows, as data frames are kept.
//!
//! Names of columns may carry units like the headers of a text file (`theta [rad]`). A null is
//! a missing cell, and so is NaN.

mod decode;
mod file;
mod write;

pub(super) use file::{Blocks, MAGIC, read, read_bytes};
pub use write::{ParquetWriter, to_parquet};
