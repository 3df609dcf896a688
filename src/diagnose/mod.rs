//! Where a model fails, and what is missing.

pub mod candidates;
pub mod compare;
pub mod context;
pub mod detectors;
pub mod discover;
pub mod floor;
pub mod generic;
pub mod hats;
pub mod leader;
pub mod missing;
mod own;
pub mod scan;
pub mod score;
pub mod suffices;
