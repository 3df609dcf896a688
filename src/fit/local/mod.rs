//! Fits of systems with many degrees of freedom whose couplings are local: chains, lattices,
//! beams cut into elements.
//!
//! Where each coordinate is coupled to few others, a state follows the start of far ones, and the
//! terms that act there, by next to nothing over a short segment. So tangents reach as far as they
//! act ([`plan`]), states are eliminated domain by domain ([`pass`]), and what is left for theta
//! is a sparse matrix ([`normal`]) on which the support is searched ([`search`]): a transition
//! costs in proportion to the degrees of freedom, and not to their cube.
//!
//! What is left out is looked at in every pass: it is below a part
//! ([`LocalTuning::negligible`](super::tuning::LocalTuning::negligible)) of the largest of its
//! column, in derivatives alone. Residuals and losses are those of the whole motion, so that what
//! Gauss-Newton converges to moves by that part of a standard error. Normal equations are trusted
//! only while every unknown stands apart from the others by much more than that; otherwise, and
//! for systems without such a structure, everything goes by the dense triangular factor.

mod course;
mod motion;
mod normal;
mod pass;
mod plan;
mod search;
pub(super) mod tuning;

pub(super) use course::learn;
