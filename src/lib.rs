//! Leverrier learns equations of motion from measurements.

pub mod cli;
pub mod data;
pub mod diagnostic;
pub mod dynamics;
pub mod error;
pub mod eval;
pub mod export;
pub mod expr;
pub mod fit;
pub mod report;
pub mod simplify;
pub mod simulate;
pub mod spec;
