//! Where a model fails, and what is missing.

pub mod candidates;
pub mod compare;
pub mod context;
pub mod discover;
pub mod hats;
pub mod missing;
pub mod score;
