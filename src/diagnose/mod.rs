//! Where a model fails, and what is missing.

pub mod candidates;
pub mod compare;
pub mod context;
pub mod design;
pub mod detectors;
pub mod discover;
pub mod floor;
pub mod generic;
pub mod hats;
pub mod leader;
pub mod missing;
mod own;
pub mod plan;
pub mod plane;
pub mod predictions;
mod reach;
pub mod rival;
pub mod round;
pub mod scan;
pub mod score;
mod search;
pub mod suffices;
mod trial;
pub mod view;
