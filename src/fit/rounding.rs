//! What rounding leaves of numbers that are zero in exact arithmetic.
//!
//! Each bound is a multiple of the unit roundoff of a double, u = 1.1e-16, that follows from how
//! the number is computed: none is a choice about the data, so that no option of a fit holds them.

/// A pivot of a triangular factor below this part of its column's norm is rounding: the column is
/// spanned by those before it, and its unknown is zero.
///
/// A reflection leaves errors of a few u of a column's norm, and K of them about u sqrt(K): 1e-14
/// is 90 u, that of some thousand columns (Higham, Accuracy and Stability of Numerical
/// Algorithms, 2nd ed., section 19.3).
pub(super) const SPANNED: f64 = 1e-14;

/// The same where a covariance is asked for: an unknown whose pivot is below this part of its
/// column's norm is left open.
///
/// Ten times [`SPANNED`]: a smaller pivot is known to a tenth of itself at best, and so would be
/// the standard error.
pub(super) const UNDETERMINED: f64 = 1e-13;

/// What is left of a column's squared norm outside the span of others, over its squared norm, below
/// which nothing is.
///
/// Projected out explicitly, a column keeps rounding of about u times its norm for each of those
/// it is projected on, 1e-14 for a hundred of them, and their directions are as wrong as they are
/// nearly dependent: 1e-11 of the norm leaves room for a condition of a thousand.
pub(super) const NOTHING_LEFT: f64 = 1e-22;

/// Where so little of a column's squared norm is left, it must be projected out explicitly.
///
/// A difference of two squared norms is wrong by u of them: at a part 1e-8 it has eight digits,
/// half of a double's, which is more than an order of merit needs.
pub(super) const FEW_DIGITS_LEFT: f64 = 1e-8;

/// A slope of the loss on a bound, over the largest slope, that does not pull inside.
///
/// A slope is the product of a column with the residual, wrong by u sqrt(K) of the product of their
/// norms: 1e-14 for ten thousand rows, and a hundred times that where all slopes are small beside
/// it.
pub(super) const NO_SLOPE: f64 = 1e-12;

/// What elimination of the initial states leaves of a column's norm where the states do all that
/// the column does: rounding of a double times the condition of the states' own columns, 1e4.
/// `learning::settling`.
pub(super) const ABSORBED: f64 = 1e-12;

/// Degrees of freedom that are none: sums of leverages, each wrong by some u, over as many as ten
/// million values.
pub(super) const NO_FREEDOM: f64 = 1e-9;

/// What a span of a whole number of steps may be longer or shorter by, as a part of itself: its
/// ends may be a million times as large, each of them rounded.
pub(super) const WHOLE_STEPS: f64 = 1e-9;

/// Denominators are at least this, in units of normalised columns: far below all that is compared.
pub(super) const NOT_ZERO: f64 = 1e-12;
