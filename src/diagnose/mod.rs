//! Where a model fails, and what is missing.

pub mod compare;
pub mod context;
pub mod hats;
pub mod score;
