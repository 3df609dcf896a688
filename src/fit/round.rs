//! A round of training: how far it searches, and what it ends with.

use super::criterion::Criterion;
use super::factor::Factor;
use super::gauss_newton::Refit;
use super::options::Options;
use super::support::{Columns, SearchProblem, SupportSearch};

/// How far the search for a support looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// Everywhere.
    Whole,
    /// Where the best support is most likely, in rounds that others follow.
    Rough,
    /// Around the present support, no further than it must.
    Near,
}

/// What a round ended with.
pub struct Round {
    /// The supports that the round found.
    pub search: SupportSearch,
    /// The model, refitted on its support.
    pub refit: Refit,
    /// The factor of the whole space at the model before the round; coefficients absolute,
    /// parameters as increments.
    pub folds: Vec<Factor>,
    /// All folds together.
    pub merged: Factor,
    /// What the columns of the factors mean.
    pub columns: Columns,
    /// What the search chose by.
    pub criterion: Criterion,
    /// Whether the refit found what the factor had predicted of its best support: the search was
    /// then not misled by where it was linearised.
    pub predicted: bool,
    /// Standard deviation of the noise of each observable that the residuals were weighed by.
    pub noise: Vec<f64>,
}

impl Round {
    /// What its support was searched for on.
    pub(super) fn search_problem<'a>(&'a self, options: &'a Options) -> SearchProblem<'a> {
        let Round { merged, columns, criterion, .. } = self;
        SearchProblem {
            factor: merged,
            columns,
            criterion: *criterion,
            tuning: &options.tuning.support,
        }
    }
}
