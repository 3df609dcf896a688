//! The search for the support: which terms of the function space the data ask for.
//!
//! Everything happens on the triangular factor, where trying a support costs microseconds.
//! Candidates come from the L1 path, from backward elimination of the whole space and from
//! forward selection; the best by the criterion is polished by additions, removals and
//! exchanges until none of them pays.

use std::collections::{BTreeMap, HashMap};

use nalgebra::{DMatrix, DVector};

use super::factor::Factor;
use super::path::{PathPoint, Settings, path};
use crate::expr::Bounds;

/// What the columns of a factor mean to the search.
#[derive(Debug, Clone)]
pub struct Columns {
    /// Columns 0 .. terms are coefficients, the rest inner parameters.
    pub terms: usize,
    /// Inner parameters (as columns) that come with each term.
    pub companions: Vec<Vec<usize>>,
    /// Columns that every support holds (parameters of known parts).
    pub forced: Vec<usize>,
    /// Allowed values, for each column.
    pub bounds: Vec<Bounds>,
}

impl Columns {
    /// The factor's columns that belong to a support.
    pub fn of(&self, support: &[usize]) -> Vec<usize> {
        let mut columns = support.to_vec();
        let extra = support.iter().flat_map(|&k| self.companions[k].iter().copied());
        let mut parameters: Vec<usize> = self.forced.iter().copied().chain(extra).collect();
        parameters.sort_unstable();
        parameters.dedup();
        columns.extend(parameters);
        columns
    }
}

impl Columns {
    /// The same for a factor that kept only the columns `kept`, which begin with `terms`.
    pub fn narrow(&self, terms: &[usize], kept: &[usize]) -> Columns {
        let place = |column: &usize| kept.iter().position(|c| c == column);
        Columns {
            terms: terms.len(),
            companions: terms
                .iter()
                .map(|&k| self.companions[k].iter().filter_map(place).collect())
                .collect(),
            forced: self.forced.iter().filter_map(place).collect(),
            bounds: kept.iter().map(|&c| self.bounds[c]).collect(),
        }
    }
}

/// How supports are compared: smaller is better.
///
/// `rows log(squares / rows + floor^2) + unknowns log(rows) + 2 terms log(space)`: the extended
/// Bayesian information criterion (Chen and Chen, Biometrika 95, 2008, eq. 2.2, gamma = 1) with
/// `space ^ terms` for the number of supports, as if every term were the first to be looked
/// for: a term that is noise gets in about once in a thousand fits, whatever the size of the
/// space. Residuals below the floor (rounding, the integrator's own error) earn nothing.
#[derive(Debug, Clone, Copy)]
pub struct Criterion {
    /// In units of the weighted residuals.
    pub floor: f64,
    /// Size of the function space.
    pub terms: usize,
}

impl Criterion {
    pub fn value(&self, squares: f64, rows: usize, terms: usize, parameters: usize) -> f64 {
        let n = rows.max(1) as f64;
        let variance = (squares / n + self.floor * self.floor).max(f64::MIN_POSITIVE);
        let choice = 2.0 * terms as f64 * (self.terms.max(1) as f64).ln();
        n * variance.ln() + (terms + parameters) as f64 * n.ln() + choice
    }
}

/// A support with its unpenalised solution on the factor.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Terms, sorted.
    pub support: Vec<usize>,
    /// (column, value) of every unknown that belongs to it.
    pub values: Vec<(usize, f64)>,
    pub squares: f64,
    pub criterion: f64,
}

/// What the search found.
#[derive(Debug, Clone)]
pub struct Search {
    /// Distinct supports, best first.
    pub candidates: Vec<Candidate>,
    pub path: Vec<PathPoint>,
    /// Supports that were tried.
    pub tried: usize,
}

/// The largest support that is looked at closely.
const LARGEST: usize = 80;
/// Rounds of additions, removals and exchanges before the search gives up.
const ROUNDS: usize = 60;
/// How many of the best candidates are polished.
const POLISHED: usize = 3;

/// Searches the supports of a factor whose unknowns are absolute (not increments).
pub fn search(factor: &Factor, columns: &Columns, criterion: Criterion) -> Search {
    let mut pool = Pool { factor, columns, criterion, known: HashMap::new() };
    let penalised: Vec<bool> = (0..factor.columns()).map(|k| k < columns.terms).collect();
    let settings = Settings { most_terms: LARGEST, ..Settings::default() };
    let path = path(factor, &penalised, &columns.bounds, &settings);

    pool.try_support(Vec::new());
    for point in &path {
        let support: Vec<usize> =
            point.support().into_iter().filter(|&k| k < columns.terms).collect();
        if support.len() <= LARGEST {
            pool.try_support(support);
        }
    }
    if let Some(widest) = path.iter().rev().map(PathPoint::support).next() {
        let start: Vec<usize> = widest.into_iter().filter(|&k| k < columns.terms).collect();
        pool.eliminate(start);
    }
    pool.eliminate((0..columns.terms).collect());
    pool.grow();
    for candidate in pool.best(POLISHED) {
        pool.polish(candidate);
    }
    let tried = pool.known.len();
    Search { candidates: pool.best(usize::MAX), path, tried }
}

/// Backward elimination and forward selection alone: for resampling, where speed counts.
pub fn quick_search(factor: &Factor, columns: &Columns, criterion: Criterion) -> Candidate {
    let mut pool = Pool { factor, columns, criterion, known: HashMap::new() };
    pool.try_support(Vec::new());
    pool.eliminate((0..columns.terms).collect());
    pool.grow();
    pool.best(1).swap_remove(0)
}

/// A term of the support, and one outside it that could stand in its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternative {
    pub term: usize,
    pub instead: usize,
    /// How much worse the criterion gets by the exchange.
    pub difference: f64,
}

/// Exchanges of one term that cost the criterion less than `within`, cheapest first.
pub fn alternatives(
    factor: &Factor,
    columns: &Columns,
    criterion: Criterion,
    support: &[usize],
    within: f64,
) -> Vec<Alternative> {
    const EACH: usize = 4;
    let mut pool = Pool { factor, columns, criterion, known: HashMap::new() };
    let best = pool.try_support(support.to_vec()).criterion;
    let mut found = Vec::new();
    for &term in support {
        let rest: Vec<usize> = support.iter().copied().filter(|&k| k != term).collect();
        for (instead, _) in pool.gains(&rest).into_iter().filter(|g| g.0 != term).take(EACH) {
            let mut exchanged = rest.clone();
            exchanged.push(instead);
            let difference = pool.try_support(exchanged).criterion - best;
            if difference < within {
                found.push(Alternative { term, instead, difference });
            }
        }
    }
    found.sort_by(|a, b| a.difference.total_cmp(&b.difference));
    found
}

/// The whole function space as the only candidate: a fit without sparsity.
pub fn whole(factor: &Factor, columns: &Columns, criterion: Criterion) -> Search {
    let mut pool = Pool { factor, columns, criterion, known: HashMap::new() };
    pool.try_support((0..columns.terms).collect());
    Search { candidates: pool.best(usize::MAX), path: Vec::new(), tried: 1 }
}

/// The best candidate of every size: error against number of terms.
pub fn front(candidates: &[Candidate]) -> Vec<Candidate> {
    let mut best: BTreeMap<usize, &Candidate> = BTreeMap::new();
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

struct Pool<'a> {
    factor: &'a Factor,
    columns: &'a Columns,
    criterion: Criterion,
    known: HashMap<Vec<usize>, Candidate>,
}

impl Pool<'_> {
    /// Refits a support without penalty; a coefficient that ends on a bound of zero leaves it.
    fn try_support(&mut self, mut support: Vec<usize>) -> Candidate {
        support.sort_unstable();
        support.dedup();
        if let Some(known) = self.known.get(&support) {
            return known.clone();
        }
        let columns = self.columns.of(&support);
        let solution =
            solve_bounded(&self.factor.select(&columns), |i| self.columns.bounds[columns[i]]);
        let values: Vec<(usize, f64)> =
            columns.iter().copied().zip(solution.values.iter().copied()).collect();
        let stuck = |k: usize| {
            values.iter().any(|&(c, x)| c == k && x == 0.0 && !self.columns.bounds[k].is_free())
        };
        if support.iter().any(|&k| stuck(k)) {
            let smaller = support.iter().copied().filter(|&k| !stuck(k)).collect();
            return self.try_support(smaller);
        }
        let parameters = columns.len() - support.len();
        let criterion =
            self.criterion.value(solution.squares, self.factor.rows(), support.len(), parameters);
        let candidate =
            Candidate { support: support.clone(), values, squares: solution.squares, criterion };
        self.known.insert(support, candidate.clone());
        candidate
    }

    fn best(&self, count: usize) -> Vec<Candidate> {
        let mut all: Vec<Candidate> = self.known.values().cloned().collect();
        // Ties are broken by the support itself: the order of a hash map is not repeatable.
        all.sort_by(|a, b| {
            a.criterion.total_cmp(&b.criterion).then_with(|| a.support.cmp(&b.support))
        });
        all.truncate(count);
        all
    }

    /// Removes the least useful term again and again; keeps the small supports on the way.
    fn eliminate(&mut self, start: Vec<usize>) {
        let mut elimination = Elimination::new(self.factor, self.columns, start);
        loop {
            if elimination.support.len() <= LARGEST {
                self.try_support(elimination.support.clone());
            }
            if elimination.support.is_empty() {
                return;
            }
            elimination.remove_weakest(self.columns);
        }
    }

    /// Adds the most useful term again and again, until three in a row do not pay.
    fn grow(&mut self) {
        let mut current = self.try_support(Vec::new());
        let mut best = current.criterion;
        let mut idle = 0;
        while idle < 3 && current.support.len() < LARGEST.min(self.columns.terms) {
            let Some(&(add, _)) = self.gains(&current.support).first() else { return };
            let mut support = current.support.clone();
            support.push(add);
            let next = self.try_support(support);
            if next.support == current.support {
                return;
            }
            current = next;
            idle = if current.criterion < best { 0 } else { idle + 1 };
            best = best.min(current.criterion);
        }
    }

    /// Terms outside a support by how much each alone would take off the squares, best first.
    fn gains(&self, support: &[usize]) -> Vec<(usize, f64)> {
        let columns = self.columns.of(support);
        let basis = orthonormal(&self.factor.design().select_columns(&columns));
        let design = self.factor.design();
        let target = self.factor.target();
        let residual = &target - &basis * basis.tr_mul(&target);
        let shadows = basis.tr_mul(&design);
        let mut gains: Vec<(usize, f64)> = (0..self.columns.terms)
            .filter(|k| support.binary_search(k).is_err())
            .filter_map(|k| {
                let norm = design.column(k).norm_squared();
                let left = norm - shadows.column(k).norm_squared();
                // A column inside the span of the support cannot help; what is left is rounding.
                (left > 1e-20 * norm && left > 0.0).then(|| {
                    let deflated = design.column(k) - &basis * shadows.column(k);
                    let left = deflated.norm_squared();
                    (k, deflated.dot(&residual).powi(2) / left.max(f64::MIN_POSITIVE))
                })
            })
            .collect();
        gains.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        gains
    }

    /// Additions, removals and exchanges until none of them pays.
    fn polish(&mut self, start: Candidate) {
        let mut current = start;
        for _ in 0..ROUNDS {
            let mut neighbours = Vec::new();
            for &(add, _) in self.gains(&current.support).iter().take(3) {
                let mut support = current.support.clone();
                support.push(add);
                neighbours.push(support);
            }
            for out in 0..current.support.len() {
                let mut rest = current.support.clone();
                rest.remove(out);
                for &(add, _) in self.gains(&rest).iter().take(2) {
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

/// Backward elimination: the inverse triangle is updated with every column that leaves.
struct Elimination {
    support: Vec<usize>,
    /// Factor columns in the order of the triangle.
    columns: Vec<usize>,
    triangle: DMatrix<f64>,
    inverse: DMatrix<f64>,
    target: DVector<f64>,
}

impl Elimination {
    fn new(factor: &Factor, columns: &Columns, support: Vec<usize>) -> Self {
        let chosen: Vec<usize> =
            columns.of(&support).into_iter().filter(|&k| factor.norms()[k] > 0.0).collect();
        let mut selected = factor.select(&chosen);
        // A trace of ridge keeps dependent columns apart; it is far below what is looked at.
        let norms = selected.norms();
        let mut ridge = DMatrix::zeros(chosen.len(), chosen.len() + 1);
        for (k, norm) in norms.iter().enumerate() {
            ridge[(k, k)] = 1e-13 * norm;
        }
        selected.push(&mut ridge, 0);
        let triangle = selected.design();
        let size = chosen.len();
        let inverse = triangle
            .solve_upper_triangular(&DMatrix::identity(size, size))
            .unwrap_or_else(|| DMatrix::identity(size, size));
        let support = support.into_iter().filter(|k| chosen.contains(k)).collect();
        Elimination { support, columns: chosen, triangle, inverse, target: selected.target() }
    }

    fn remove_weakest(&mut self, columns: &Columns) {
        let solution = &self.inverse * &self.target;
        let weakest = self
            .columns
            .iter()
            .enumerate()
            .filter(|&(_, &c)| c < columns.terms)
            .map(|(i, &c)| {
                let spread = self.inverse.row(i).norm_squared();
                (i, c, solution[i] * solution[i] / spread)
            })
            .min_by(|a, b| a.2.total_cmp(&b.2));
        let Some((at, term, _)) = weakest else {
            self.support.clear();
            return;
        };
        self.remove(at);
        self.support.retain(|&k| k != term);
        let keep = columns.of(&self.support);
        while let Some(at) = self.columns.iter().position(|c| !keep.contains(c)) {
            self.remove(at);
        }
    }

    /// Takes one column out and rotates the triangle back into shape.
    fn remove(&mut self, at: usize) {
        let size = self.columns.len();
        self.columns.remove(at);
        let mut triangle = std::mem::replace(&mut self.triangle, DMatrix::zeros(0, 0));
        triangle = triangle.remove_column(at);
        for k in at..size - 1 {
            let (a, b) = (triangle[(k, k)], triangle[(k + 1, k)]);
            let length = a.hypot(b);
            if length == 0.0 {
                continue;
            }
            let (c, s) = (a / length, b / length);
            for column in k..size - 1 {
                let (x, y) = (triangle[(k, column)], triangle[(k + 1, column)]);
                triangle[(k, column)] = c * x + s * y;
                triangle[(k + 1, column)] = c * y - s * x;
            }
            let (x, y) = (self.target[k], self.target[k + 1]);
            self.target[k] = c * x + s * y;
            self.target[k + 1] = c * y - s * x;
            let (mut left, mut right) = self.inverse.columns_range_pair_mut(k, k + 1);
            for row in 0..size {
                let (x, y) = (left[row], right[row]);
                left[row] = c * x + s * y;
                right[row] = c * y - s * x;
            }
        }
        self.triangle = triangle.remove_row(size - 1);
        let inverse = std::mem::replace(&mut self.inverse, DMatrix::zeros(0, 0));
        self.inverse = inverse.remove_row(at).remove_column(size - 1);
        let target = std::mem::replace(&mut self.target, DVector::zeros(0));
        self.target = target.remove_row(size - 1);
    }
}

/// An orthonormal basis of the columns' span.
fn orthonormal(columns: &DMatrix<f64>) -> DMatrix<f64> {
    if columns.ncols() == 0 {
        return DMatrix::zeros(columns.nrows(), 0);
    }
    columns.clone().qr().q()
}

/// Least squares within bounds.
pub struct Bounded {
    pub values: DVector<f64>,
    pub squares: f64,
    /// Unknowns that ended on a bound.
    pub bound: Vec<usize>,
}

/// Solves `min |A x - b|` with `lower <= x <= upper` by an active set: what leaves its bounds
/// is fixed on them, what pulls back inside is freed again
/// (Stark and Parker, "Bounded-variable least squares", Comput. Stat. 10, 1995).
pub fn solve_bounded(factor: &Factor, bounds: impl Fn(usize) -> Bounds) -> Bounded {
    let size = factor.columns();
    let mut fixed: Vec<Option<f64>> = vec![None; size];
    let mut values = DVector::zeros(size);
    for _ in 0..=3 * size {
        let free: Vec<usize> = (0..size).filter(|&k| fixed[k].is_none()).collect();
        let mut reduced = factor.clone();
        let held = DVector::from_fn(size, |k, _| fixed[k].unwrap_or(0.0));
        reduced.shift(&held);
        let solution = solve_triangle(&reduced.select(&free));
        values = held;
        for (&k, &x) in free.iter().zip(solution.iter()) {
            values[k] = x;
        }
        let outside = free.iter().copied().find(|&k| bounds(k).clamp(values[k]) != values[k]);
        if let Some(k) = outside {
            fixed[k] = Some(bounds(k).clamp(values[k]));
            continue;
        }
        let slope = factor.design().tr_mul(&(factor.target() - factor.design() * &values));
        let release = (0..size).find(|&k| {
            let inward = match fixed[k] {
                Some(x) if x <= bounds(k).lower => slope[k],
                Some(_) => -slope[k],
                None => return false,
            };
            bounds(k).lower < bounds(k).upper && inward > 1e-12 * slope.amax()
        });
        match release {
            Some(k) => fixed[k] = None,
            None => break,
        }
    }
    let bound = (0..size).filter(|&k| fixed[k].is_some()).collect();
    Bounded { squares: factor.squares(&values), values, bound }
}

/// Back substitution; an unknown that the data do not touch, or that earlier ones span, is zero.
pub fn solve_triangle(factor: &Factor) -> DVector<f64> {
    let triangle = factor.design();
    let target = factor.target();
    let norms = factor.norms();
    let size = factor.columns();
    let mut solution = DVector::zeros(size);
    for k in (0..size).rev() {
        let pivot = triangle[(k, k)];
        if pivot.abs() <= 1e-14 * norms[k] || pivot == 0.0 {
            continue;
        }
        let mut sum = target[k];
        for j in k + 1..size {
            sum -= triangle[(k, j)] * solution[j];
        }
        solution[k] = sum / pivot;
    }
    solution
}
