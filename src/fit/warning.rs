//! Why a number of a model may not be what it looks like.

use serde::{Deserialize, Serialize};

/// A reason to look twice at a model before its numbers are used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Warning {
    /// A number ended at a bound that the spec gives it: the data pull it further.
    AtBound {
        /// The name of the parameter, or the term of the coefficient.
        name: String,
        /// Its value.
        value: f64,
    },
    /// A mass or a moment of inertia is negative: a coordinate moves against its momentum.
    NegativeMass {
        /// The coordinate.
        coordinate: String,
    },
    /// A force that depends on the speed alone drives the motion rather than brakes it.
    FeedsEnergy {
        /// The term, in the mini-language.
        term: String,
        /// The coordinate that it acts on.
        coordinate: String,
        /// Its coefficient.
        coefficient: f64,
        /// Standard error of the coefficient.
        standard_error: f64,
    },
    /// The law follows the measurements within their noise over short segments only.
    FollowsBriefly {
        /// Samples of the longest segments that it follows.
        samples: usize,
        /// How long that is, in the unit of the time.
        time: f64,
        /// Period of the fastest motion, in the same unit; `None` where nothing swings.
        period: Option<f64>,
        /// Samples of the segments that the numbers are from.
        numbers_from: usize,
    },
    /// A number from the segments that the law follows is not that from longer ones, which count.
    WindowsDisagree {
        /// The name of the parameter, or the term of the coefficient.
        name: String,
        /// What segments say that the law follows.
        short: OfWindow,
        /// What the model has.
        long: OfWindow,
    },
    /// Residuals of neighbouring samples are alike: they are no noise.
    NotWhite {
        /// The observable.
        observable: String,
        /// Correlation of its residuals from one sample to the next.
        correlation: f64,
    },
    /// One run leaves more than the others together say that there is noise.
    OneRun {
        /// The run.
        run: String,
        /// Its residuals in units of those of the others, root mean squares.
        error: f64,
    },
}

/// A number as segments of one length give it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OfWindow {
    /// Samples of the segments, at most.
    pub samples: usize,
    /// The number.
    pub value: f64,
    /// Its standard error, for residuals that are alike too.
    pub standard_error: f64,
}
