//! Forward selection, and what a search can do without solving for a single coefficient.

use nalgebra::{DMatrix, DVector};

use super::column::Column;
use super::elimination::Elimination;
use super::rounding::NOTHING_LEFT;
use super::support::SearchProblem;

/// A support with the value of the criterion; smaller is better.
pub type Judged = (f64, Vec<Column>);

/// The supports that backward elimination of the whole space goes through, for free bounds.
pub fn backward(problem: SearchProblem) -> Vec<Judged> {
    let SearchProblem { columns, tuning, .. } = problem;
    let mut elimination = Elimination::new(problem, columns.of_terms().collect());
    let mut found = Vec::new();
    while !elimination.support.is_empty() {
        if elimination.support.len() <= tuning.largest {
            let support = elimination.support.clone();
            let value = problem.value(&support, elimination.squares);
            found.push((value, support));
        }
        elimination.remove_weakest(columns);
    }
    found
}

/// Adds the most useful term again and again, until three in a row do not pay.
///
/// `judge` gets a support and the squares that it leaves where no bound holds; what it gives
/// back is the support as it ended, and its criterion.
pub fn forward(problem: SearchProblem, mut judge: impl FnMut(Vec<Column>, f64) -> Judged) {
    let SearchProblem { factor, columns, tuning, .. } = problem;
    let mut forward = Forward::new(factor.design(), factor.target());
    columns.of(&columns.required).into_iter().for_each(|column| forward.take(column));
    let least = factor.least();
    let (mut best, mut current) = judge(Vec::new(), forward.squares() + least);
    let mut idle = 0;
    while idle < tuning.idle && current.len() < tuning.largest.min(columns.terms) {
        let Some(add) = forward.best(columns.terms) else { return };
        let mut support = current.clone();
        support.push(add);
        support.sort_unstable();
        columns.of(&support).into_iter().for_each(|column| forward.take(column));
        let (value, next) = judge(support, forward.squares() + least);
        if next == current {
            return;
        }
        current = next;
        idle = if value < best { 0 } else { idle + 1 };
        best = best.min(value);
    }
}

/// The better of backward elimination and forward selection, for free bounds.
pub fn quickest(problem: SearchProblem) -> Vec<Column> {
    let mut found = backward(problem);
    forward(problem, |support, squares| {
        let judged = (problem.value(&support, squares), support);
        found.push(judged.clone());
        judged
    });
    let least = found.into_iter().min_by(better);
    least.map_or_else(Vec::new, |(_, support)| support)
}

/// The order of supports: ties are broken by the support itself.
pub fn better(a: &Judged, b: &Judged) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1))
}

/// Columns and target, with what a growing set of the columns spans projected out.
struct Forward {
    columns: DMatrix<f64>,
    target: DVector<f64>,
    /// Squares of the columns as they were.
    norms: Vec<f64>,
    taken: Vec<bool>,
}

impl Forward {
    fn new(columns: DMatrix<f64>, target: DVector<f64>) -> Forward {
        Forward {
            norms: columns.column_iter().map(|column| column.norm_squared()).collect(),
            taken: vec![false; columns.ncols()],
            columns,
            target,
        }
    }

    /// What the taken columns leave of the target.
    fn squares(&self) -> f64 {
        self.target.norm_squared()
    }

    /// What is left of a column; below rounding nothing is.
    fn left(&self, column: Column) -> f64 {
        let left = self.columns.column(column.position()).norm_squared();
        if left > NOTHING_LEFT * self.norms[column] { left } else { 0.0 }
    }

    /// Takes a column into the basis, once.
    fn take(&mut self, column: Column) {
        if self.taken[column] {
            return;
        }
        self.taken[column] = true;
        let left = self.left(column);
        if left == 0.0 {
            return;
        }
        let unit = self.columns.column(column.position()) / left.sqrt();
        for (mut other, taken) in self.columns.column_iter_mut().zip(&self.taken) {
            if !taken {
                let shadow = unit.dot(&other);
                other.axpy(-shadow, &unit, 1.0);
            }
        }
        let shadow = unit.dot(&self.target);
        self.target.axpy(-shadow, &unit, 1.0);
    }

    /// The term, of the first `terms` columns, that lowers the squares most.
    fn best(&self, terms: usize) -> Option<Column> {
        let fall = |k: Column| {
            let left = self.left(k);
            (left > 0.0)
                .then(|| (k, self.columns.column(k.position()).dot(&self.target).powi(2) / left))
        };
        Column::all(terms)
            .filter(|&k| !self.taken[k])
            .filter_map(fall)
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
            .map(|(k, _)| k)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::criterion::Criterion;
    use crate::fit::factor::Factor;
    use crate::fit::support::Columns;
    use crate::fit::tuning::SupportTuning;

    #[test]
    fn the_squares_of_every_support_are_those_of_a_fit() {
        let rows = DMatrix::from_fn(40, 7, |i, j| (0.7 * ((i + 1) * (j + 1)) as f64).sin());
        let mut factor = Factor::new(6);
        factor.push(&rows, 40);
        let columns = Columns::plain(6);
        let mut sizes = Vec::new();
        let (criterion, tuning) = (Criterion { floor: 0.0 }, &SupportTuning::default());
        let problem = SearchProblem { factor: &factor, columns: &columns, criterion, tuning };
        forward(problem, |support, squares| {
            let fitted = factor.select(&support).least();
            assert!((squares - fitted).abs() < 1e-12 * fitted, "{support:?}");
            sizes.push(support.len());
            // Every addition pays.
            (-(support.len() as f64), support)
        });
        assert_eq!(sizes, (0..=6).collect::<Vec<_>>());
    }
}
