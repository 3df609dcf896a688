//! The search for the support: which terms of the function space the data ask for.
//!
//! Everything happens on the triangular factor, where trying a support costs microseconds.
//! Candidates come from the L1 path, from backward elimination of the whole space and of the
//! nested spaces of its simplest terms, and from forward selection; the best by the criterion
//! are polished by additions, removals and exchanges until none of them pays.

use std::collections::{BTreeMap, HashMap};

use nalgebra::{DMatrix, DVector};

use super::bounded::solve_bounded;
use super::column::Column;
use super::criterion::Criterion;
use super::elimination::Elimination;
use super::factor::Factor;
use super::path::{PathPoint, path};
use super::rounding::{FEW_DIGITS_LEFT, NOTHING_LEFT};
use super::selection;
use super::tuning::SupportTuning;
use crate::expr::Bounds;

/// What the columns of a factor mean to the search.
#[derive(Debug, Clone)]
pub struct Columns {
    /// Columns 0 .. terms are coefficients, the rest inner parameters.
    pub terms: usize,
    /// The inner parameters that come with each term.
    pub companions: Vec<Vec<Column>>,
    /// Columns that every support holds (parameters of known parts).
    pub forced: Vec<Column>,
    /// Terms that every support holds.
    pub required: Vec<Column>,
    /// Allowed values, for each column.
    pub bounds: Vec<Bounds>,
    /// [`complexity`](super::criterion::complexity) of each term.
    pub complexity: Vec<u32>,
    /// [`choice_costs`](super::criterion::choice_costs) of each term.
    pub costs: Vec<f64>,
}

impl Columns {
    /// The factor's columns that belong to a support.
    pub fn of(&self, support: &[Column]) -> Vec<Column> {
        let mut columns = support.to_vec();
        let extra = support.iter().flat_map(|&k| self.companions[k].iter().copied());
        let mut parameters: Vec<Column> = self.forced.iter().copied().chain(extra).collect();
        parameters.sort_unstable();
        parameters.dedup();
        columns.extend(parameters);
        columns
    }

    /// So many plain terms, for tests: nothing is bounded, and all are equally simple.
    #[cfg(test)]
    pub(super) fn plain(terms: usize) -> Columns {
        Columns {
            terms,
            companions: vec![Vec::new(); terms],
            forced: Vec::new(),
            required: Vec::new(),
            bounds: vec![Bounds::FREE; terms],
            complexity: vec![1; terms],
            costs: vec![0.0; terms],
        }
    }

    /// The columns of all terms.
    pub fn of_terms(&self) -> impl DoubleEndedIterator<Item = Column> + ExactSizeIterator + use<> {
        Column::all(self.terms)
    }

    /// Whether a column is that of a coefficient.
    pub fn is_term(&self, column: Column) -> bool {
        column.position() < self.terms
    }

    /// Whether a column is that of a coefficient that a support can do without.
    pub fn may_leave(&self, column: Column) -> bool {
        self.is_term(column) && !self.required.contains(&column)
    }

    /// Whether no value is out of bounds, and no term must stay.
    pub fn all_free(&self) -> bool {
        self.required.is_empty() && self.bounds.iter().all(|bound| bound.is_free())
    }

    /// The same for a factor that kept only the columns `kept`, which begin with `terms`.
    pub fn narrow(&self, terms: &[Column], kept: &[Column]) -> Columns {
        let place = |column: &Column| kept.iter().position(|c| c == column).map(Column::new);
        Columns {
            terms: terms.len(),
            companions: terms
                .iter()
                .map(|&k| self.companions[k].iter().filter_map(place).collect())
                .collect(),
            forced: self.forced.iter().filter_map(place).collect(),
            required: self.required.iter().filter_map(place).collect(),
            bounds: kept.iter().map(|&c| self.bounds[c]).collect(),
            complexity: terms.iter().map(|&k| self.complexity[k]).collect(),
            costs: terms.iter().map(|&k| self.costs[k]).collect(),
        }
    }
}

/// What a support is searched for on, and how.
#[derive(Debug, Clone, Copy)]
pub struct SearchProblem<'a> {
    /// The factor, its unknowns absolute (not increments).
    pub factor: &'a Factor,
    /// What its columns mean.
    pub columns: &'a Columns,
    /// What supports are compared by.
    pub criterion: Criterion,
    /// How far the search looks.
    pub tuning: &'a SupportTuning,
}

impl SearchProblem<'_> {
    /// The criterion of a support that leaves a sum of `squares`.
    pub fn value(&self, support: &[Column], squares: f64) -> f64 {
        let choice = support.iter().map(|&k| self.columns.costs[k]).sum();
        let unknowns = self.columns.of(support).len();
        self.criterion.value(squares, self.factor.rows(), unknowns, choice)
    }
}

/// A support with its unpenalised solution on the factor.
#[derive(Debug, Clone, PartialEq)]
pub struct SupportFit {
    /// The columns of its terms, sorted.
    pub support: Vec<Column>,
    /// Every unknown that belongs to it, with its value.
    pub values: Vec<(Column, f64)>,
    /// Sum of squares that the support leaves, in squares of the noise.
    pub squares: f64,
    /// Value of the criterion (a deviance; smaller is better).
    pub criterion: f64,
}

/// What the search found.
#[derive(Debug, Clone)]
pub struct SupportSearch {
    /// Distinct supports, best first.
    pub candidates: Vec<SupportFit>,
    /// The solutions of the L1 problem, from strong to weak penalties.
    pub path: Vec<PathPoint>,
    /// Supports that were tried.
    pub supports_tried: usize,
}

/// Searches the supports of a factor.
pub fn search(problem: SearchProblem) -> SupportSearch {
    let mut supports = EvaluatedSupports::new(problem);
    let mut nested = EvaluatedSupports::new(problem);
    supports.try_support(Vec::new());
    let (path, ()) = rayon::join(|| supports.follow_path(), || nested.eliminate_levels());
    nested.evaluated.into_iter().for_each(|(support, candidate)| {
        supports.evaluated.entry(support).or_insert(candidate);
    });
    supports.grow();
    for candidate in supports.best(problem.tuning.polished) {
        supports.polish(candidate);
    }
    let supports_tried = supports.evaluated.len();
    SupportSearch { candidates: supports.best(usize::MAX), path, supports_tried }
}

/// Backward elimination of the whole space and forward selection, the best of them polished.
pub fn rough(problem: SearchProblem) -> SupportSearch {
    let mut supports = EvaluatedSupports::new(problem);
    supports.try_support(Vec::new());
    supports.eliminate_quickly();
    supports.grow();
    for candidate in supports.best(1) {
        supports.polish(candidate);
    }
    let supports_tried = supports.evaluated.len();
    SupportSearch { candidates: supports.best(usize::MAX), path: Vec::new(), supports_tried }
}

/// Searches around a support: its own sub-supports, then additions, removals and exchanges.
pub fn near(problem: SearchProblem, support: &[Column]) -> SupportSearch {
    let mut supports = EvaluatedSupports::new(problem);
    supports.try_support(Vec::new());
    supports.try_support(support.to_vec());
    supports.eliminate(support.to_vec());
    for candidate in supports.best(problem.tuning.polished) {
        supports.polish(candidate);
    }
    let supports_tried = supports.evaluated.len();
    SupportSearch { candidates: supports.best(usize::MAX), path: Vec::new(), supports_tried }
}

/// Complexities up to which nested spaces are taken, the largest last.
fn levels(complexity: &[u32], most: usize) -> Vec<u32> {
    let mut levels = complexity.to_vec();
    levels.sort_unstable();
    levels.dedup();
    if levels.len() > most {
        let last = levels.len() - 1;
        let spread = (0..most).map(|i| levels[i * last / (most - 1)]).collect();
        levels = spread;
    }
    levels
}

/// The best support of backward elimination and forward selection alone: for resampling, where
/// speed counts.
pub fn quick_search(problem: SearchProblem) -> Vec<Column> {
    if problem.columns.all_free() {
        return selection::quickest(problem);
    }
    let mut supports = EvaluatedSupports::new(problem);
    supports.try_support(Vec::new());
    supports.eliminate_quickly();
    supports.grow();
    supports.best(1).swap_remove(0).support
}

/// A term of the support, and one outside it that could stand in its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternative {
    /// The term of the support.
    pub term: Column,
    /// The term that could stand in its place.
    pub instead: Column,
    /// How much worse the criterion gets by the exchange.
    pub difference: f64,
}

/// Exchanges of one term that cost the criterion less than `within`, cheapest first.
pub fn alternatives(problem: SearchProblem, support: &[Column], within: f64) -> Vec<Alternative> {
    let mut supports = EvaluatedSupports::new(problem);
    let best = supports.try_support(support.to_vec()).criterion;
    let mut found = Vec::new();
    let moves = supports.moves(support);
    for (&term, exchanges) in support.iter().zip(&moves.exchanges) {
        let rest: Vec<Column> = support.iter().copied().filter(|&k| k != term).collect();
        for &(instead, _) in exchanges.iter().take(problem.tuning.exchanges) {
            let mut exchanged = rest.clone();
            exchanged.push(instead);
            let difference = supports.try_support(exchanged).criterion - best;
            if difference < within {
                found.push(Alternative { term, instead, difference });
            }
        }
    }
    found.sort_by(|a, b| a.difference.total_cmp(&b.difference));
    found
}

/// The whole function space as the only candidate: a fit without sparsity.
pub fn whole(problem: SearchProblem) -> SupportSearch {
    let mut supports = EvaluatedSupports::new(problem);
    supports.try_support(problem.columns.of_terms().collect());
    SupportSearch { candidates: supports.best(usize::MAX), path: Vec::new(), supports_tried: 1 }
}

/// The best candidate of every size: error against number of terms.
pub fn front(candidates: &[SupportFit]) -> Vec<SupportFit> {
    let mut best: BTreeMap<usize, &SupportFit> = BTreeMap::new();
    for candidate in candidates {
        let slot = best.entry(candidate.support.len()).or_insert(candidate);
        if candidate.squares < slot.squares {
            *slot = candidate;
        }
    }
    let mut least = f64::INFINITY;
    best.into_values()
        .filter(|candidate| {
            let better = candidate.squares < least;
            least = least.min(candidate.squares);
            better
        })
        .cloned()
        .collect()
}

/// The factor of some of the unknowns.
struct Reduced {
    factor: Factor,
    /// Columns of the whole factor, in the order of the reduced one.
    columns: Vec<Column>,
}

impl Reduced {
    /// The factor of some of its columns, which are named as in the whole factor.
    fn select(&self, columns: &[Column]) -> Factor {
        let place =
            |column: &Column| self.columns.iter().position(|c| c == column).map(Column::new);
        self.factor.select(&columns.iter().filter_map(place).collect::<Vec<Column>>())
    }
}

struct EvaluatedSupports<'a> {
    problem: SearchProblem<'a>,
    evaluated: HashMap<Vec<Column>, SupportFit>,
    design: DMatrix<f64>,
    target: DVector<f64>,
    norms: Vec<f64>,
}

impl<'a> EvaluatedSupports<'a> {
    fn new(problem: SearchProblem<'a>) -> Self {
        let factor = problem.factor;
        EvaluatedSupports {
            problem,
            evaluated: HashMap::new(),
            design: factor.design(),
            target: factor.target(),
            norms: factor.norms(),
        }
    }

    /// Refits a support without penalty; a coefficient that ends on a bound of zero leaves it.
    fn try_support(&mut self, support: Vec<Column>) -> SupportFit {
        self.try_on(None, support)
    }

    /// Refits supports that have most of their terms in common: on the triangle of their union,
    /// which has far fewer rows than that of the whole space.
    fn try_all(&mut self, supports: &[Vec<Column>]) {
        let required = &self.problem.columns.required;
        let mut union: Vec<Column> = supports.iter().flatten().chain(required).copied().collect();
        union.sort_unstable();
        union.dedup();
        let columns = self.problem.columns.of(&union);
        let reduced = Reduced { factor: self.problem.factor.select(&columns), columns };
        for support in supports {
            self.try_on(Some(&reduced), support.clone());
        }
    }

    fn try_on(&mut self, reduced: Option<&Reduced>, mut support: Vec<Column>) -> SupportFit {
        support.extend(&self.problem.columns.required);
        self.try_exactly(reduced, support)
    }

    fn try_exactly(&mut self, reduced: Option<&Reduced>, mut support: Vec<Column>) -> SupportFit {
        support.sort_unstable();
        support.dedup();
        if let Some(known) = self.evaluated.get(&support) {
            return known.clone();
        }
        let columns = self.problem.columns.of(&support);
        let selected = match reduced {
            Some(reduced) => reduced.select(&columns),
            None => self.problem.factor.select(&columns),
        };
        let solution = solve_bounded(&selected, |i| self.problem.columns.bounds[columns[i]]);
        let values: Vec<(Column, f64)> =
            columns.iter().copied().zip(solution.values.iter().copied()).collect();
        let stuck = |k: Column| {
            values
                .iter()
                .any(|&(c, x)| c == k && x == 0.0 && !self.problem.columns.bounds[k].is_free())
        };
        if support.iter().any(|&k| stuck(k)) {
            let smaller = support.iter().copied().filter(|&k| !stuck(k)).collect();
            return self.try_exactly(reduced, smaller);
        }
        let criterion = self.problem.value(&support, solution.squares);
        let candidate =
            SupportFit { support: support.clone(), values, squares: solution.squares, criterion };
        self.evaluated.insert(support, candidate.clone());
        candidate
    }

    fn best(&self, count: usize) -> Vec<SupportFit> {
        let mut all: Vec<SupportFit> = self.evaluated.values().cloned().collect();
        // Ties are broken by the support itself: the order of a hash map is not repeatable.
        all.sort_by(|a, b| {
            a.criterion.total_cmp(&b.criterion).then_with(|| a.support.cmp(&b.support))
        });
        all.truncate(count);
        all
    }

    /// Tries the supports of the L1 path, and those of backward elimination from its end.
    fn follow_path(&mut self) -> Vec<PathPoint> {
        let penalised: Vec<bool> = Column::all(self.problem.factor.columns())
            .map(|k| self.problem.columns.is_term(k))
            .collect();
        let path = path(
            self.problem.factor,
            &penalised,
            &self.problem.columns.bounds,
            self.problem.tuning,
        );
        let support = |point: &PathPoint| -> Vec<Column> {
            point.support().into_iter().filter(|&k| self.problem.columns.is_term(k)).collect()
        };
        let mut along: Vec<Vec<Column>> = path.iter().map(support).collect();
        let widest = along.last().cloned();
        along.retain(|support| support.len() <= self.problem.tuning.largest);
        self.try_all(&along);
        if let Some(widest) = widest {
            self.eliminate(widest);
        }
        path
    }

    /// Backward elimination of the nested spaces of the simplest terms.
    fn eliminate_levels(&mut self) {
        let complexity = &self.problem.columns.complexity;
        for level in levels(complexity, self.problem.tuning.nested) {
            self.eliminate(
                self.problem.columns.of_terms().filter(|&k| complexity[k] <= level).collect(),
            );
        }
    }

    /// Removes the least useful term again and again; keeps the small supports on the way.
    fn eliminate(&mut self, start: Vec<Column>) {
        let mut elimination = Elimination::new(self.problem, start);
        let mut small = Vec::new();
        loop {
            if elimination.support.len() <= self.problem.tuning.largest {
                small.push(elimination.support.clone());
            }
            if elimination.support.is_empty() {
                break;
            }
            elimination.remove_weakest(self.problem.columns);
        }
        self.try_all(&small);
    }

    /// The same from the whole space; looks closely only at the best of the supports on the way.
    fn eliminate_quickly(&mut self) {
        if !self.problem.columns.all_free() {
            return self.eliminate(self.problem.columns.of_terms().collect());
        }
        let mut found = selection::backward(self.problem);
        found.sort_by(selection::better);
        for (_, support) in found.into_iter().take(self.problem.tuning.closely) {
            self.try_support(support);
        }
    }

    /// Adds the most useful term again and again, until three in a row do not pay.
    fn grow(&mut self) {
        selection::forward(self.problem, |support, _| {
            let SupportFit { criterion, support, .. } = self.try_support(support);
            (criterion, support)
        });
    }

    /// What additions to a support and exchanges of one of its terms would do to the squares.
    fn moves(&self, support: &[Column]) -> Moves {
        let columns = self.problem.columns.of(support);
        let chosen = selected(&self.design, &columns);
        let (basis, duals) = basis_and_duals(&chosen);
        let residual = &self.target - &basis * basis.tr_mul(&self.target);
        let terms: Vec<Column> =
            self.problem.columns.of_terms().filter(|k| support.binary_search(k).is_err()).collect();
        let outside = selected(&self.design, &terms);
        let shadows = basis.transpose() * &outside;
        let along = duals.transpose() * &outside;
        let slopes = outside.tr_mul(&residual);
        let heights = duals.tr_mul(&self.target);
        // What is left of a column outside the support's span; below rounding nothing is.
        let left: Vec<f64> = terms
            .iter()
            .enumerate()
            .map(|(c, &k)| {
                let norm = self.norms[k] * self.norms[k];
                let left = norm - shadows.column(c).norm_squared();
                if left > FEW_DIGITS_LEFT * norm {
                    return left;
                }
                let deflated = outside.column(c) - &basis * shadows.column(c);
                let left = deflated.norm_squared();
                if left > NOTHING_LEFT * norm { left } else { 0.0 }
            })
            .collect();
        let mut additions: Vec<(Column, f64)> = terms
            .iter()
            .enumerate()
            .filter(|&(c, _)| left[c] > 0.0)
            .map(|(c, &k)| (k, slopes[c] * slopes[c] / left[c]))
            .collect();
        additions.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let exchanges = (0..support.len())
            .map(|out| {
                let height = heights[out];
                let mut rises: Vec<(Column, f64)> = terms
                    .iter()
                    .enumerate()
                    .filter(|&(c, _)| left[c] + along[(out, c)].powi(2) > 0.0)
                    .map(|(c, &k)| {
                        let d = along[(out, c)];
                        let slope = slopes[c] + height * d;
                        (k, height * height - slope * slope / (left[c] + d * d))
                    })
                    .collect();
                rises.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
                rises
            })
            .collect();
        Moves { additions, exchanges }
    }

    /// Additions, removals and exchanges until none of them pays.
    fn polish(&mut self, start: SupportFit) {
        let mut current = start;
        for _ in 0..self.problem.tuning.rounds {
            let moves = self.moves(&current.support);
            let mut neighbours = Vec::new();
            for &(add, _) in moves.additions.iter().take(self.problem.tuning.additions) {
                let mut support = current.support.clone();
                support.push(add);
                neighbours.push(support);
            }
            for (out, exchanges) in moves.exchanges.iter().enumerate() {
                let mut rest = current.support.clone();
                rest.remove(out);
                for &(add, _) in exchanges.iter().take(self.problem.tuning.replacements) {
                    let mut support = rest.clone();
                    support.push(add);
                    neighbours.push(support);
                }
                neighbours.push(rest);
            }
            let best =
                neighbours.into_iter().map(|support| self.try_support(support)).min_by(|a, b| {
                    a.criterion.total_cmp(&b.criterion).then_with(|| a.support.cmp(&b.support))
                });
            match best {
                Some(better) if better.criterion < current.criterion => current = better,
                _ => return,
            }
        }
    }
}

/// Changes of a support by one term, by what they do to the sum of squares.
struct Moves {
    /// (term, fall), best first.
    additions: Vec<(Column, f64)>,
    /// For each term of the support: (term in its place, rise), best first.
    exchanges: Vec<Vec<(Column, f64)>>,
}

/// Some columns of a matrix, in the order given.
fn selected(matrix: &DMatrix<f64>, columns: &[Column]) -> DMatrix<f64> {
    let columns: Vec<usize> = columns.iter().map(|column| column.position()).collect();
    matrix.select_columns(&columns)
}

/// An orthonormal basis of the columns' span, and for each column the unit vector of the span
/// that all other columns are perpendicular to (zero where a column depends on the others).
fn basis_and_duals(columns: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let (rows, size) = columns.shape();
    if size == 0 {
        return (DMatrix::zeros(rows, 0), DMatrix::zeros(rows, 0));
    }
    let decomposition = columns.clone().qr();
    let (q, r) = (decomposition.q(), decomposition.r());
    let mut duals = match r.solve_upper_triangular(&DMatrix::identity(size, size)) {
        Some(inverse) => &q * inverse.transpose(),
        None => DMatrix::zeros(rows, size),
    };
    for mut dual in duals.column_iter_mut() {
        let norm = dual.norm();
        dual.scale_mut(if norm > 0.0 && norm.is_finite() { 1.0 / norm } else { 0.0 });
    }
    (q, duals)
}
