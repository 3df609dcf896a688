//! What may be chosen about a diagnosis. The defaults serve every system.

use super::tuning::Tuning;
use crate::fit;

/// Options of a diagnosis.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Options {
    /// The numbers that a diagnosis goes by.
    pub tuning: Tuning,
    /// The numbers that its own fits go by.
    pub fit: fit::Tuning,
}
