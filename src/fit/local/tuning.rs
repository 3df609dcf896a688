//! The numbers that fits by sparse algebra go by.

/// Systems whose couplings are local. docs/growth.md; `learning::local` holds what they leave
/// against the dense factor.
///
/// ```
/// let mut options = leverrier::Options::default();
/// // The dense factor for every system.
/// options.tuning.local.degrees = usize::MAX;
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LocalTuning {
    /// Degrees of freedom from which on sparse algebra is thought of: fewer fill no register more
    /// cheaply than all of their columns do.
    pub degrees: usize,
    /// Terms up to which their inverse is held in memory: 8 bytes times the square of their number.
    pub terms: usize,
    /// What is left out of a derivative, as a part of the largest of its column: theta moves by
    /// this part of a standard error. Derivatives are approximate anyway
    /// ([`TangentTuning::deviation`](crate::tuning::TangentTuning::deviation)).
    pub negligible: f64,
    /// What is left out where states are eliminated, as a part of the largest of a column: what
    /// Gauss-Newton converges to does not depend on it, errors do in proportion.
    pub response: f64,
    /// Both where unknowns hardly stand apart, as a part of it. Its root is tried first.
    pub finer: f64,
    /// What unknowns keep beside the others, in units of `response`, at least: below that less is
    /// left out, and then the dense factor is asked.
    pub apart: f64,
    /// Segments at large may leave out so many times what those that were looked at first may.
    pub margin: f64,
    /// Products that a transition takes, as a part of those by the dense factor, at most: they go
    /// from place to place and not through whole registers (chains of 10 to 30 masses).
    pub share: f64,
    /// A step that changes the loss by less than this part may go without a pass at its end, where
    /// steps are known to shrink: noise and states stay as they are to half of it.
    pub unconfirmed: f64,
    /// How far tangents reach at first, in sites.
    pub reach: usize,
    /// How far they reach at most.
    pub farthest: usize,
}

impl LocalTuning {
    pub(in super::super) const USUAL: LocalTuning = LocalTuning {
        degrees: 12,
        terms: 12_000,
        negligible: 1e-5,
        response: 3e-5,
        finer: 1e-4,
        apart: 100.0,
        margin: 10.0,
        share: 0.25,
        unconfirmed: 1e-5,
        reach: 2,
        farthest: 24,
    };
}

impl Default for LocalTuning {
    fn default() -> LocalTuning {
        LocalTuning::USUAL
    }
}
