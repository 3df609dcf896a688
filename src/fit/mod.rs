//! Training.
pub mod factor;
pub mod path;
pub mod support;
