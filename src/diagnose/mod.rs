//! Where a model fails, and what is missing.

pub mod candidates;
pub mod compare;
pub mod context;
pub mod discover;
pub mod floor;
pub mod generic;
pub mod hats;
pub mod leader;
pub mod missing;
pub mod plane;
pub mod predictions;
pub mod round;
pub mod scan;
pub mod score;
pub mod view;
