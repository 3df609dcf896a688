//! The support on a sparse normal matrix: backward elimination by the inverse, then additions.
//!
//! An unknown that leaves changes the inverse by one outer product, in which only what stands
//! near to it takes part. So elimination of hundreds from thousands costs what their
//! neighbourhoods do.

use super::super::column::Column;
use super::super::criterion::Criterion;
use super::super::support::Columns;
use super::normal::Normal;

/// Entries of the inverse below this part of what their unknowns allow change nothing.
const NOTHING: f64 = 1e-10;

/// What is searched.
#[derive(Clone, Copy)]
pub(super) struct Space<'a> {
    pub(super) normal: &'a Normal,
    /// Unknowns in the order of their places.
    pub(super) order: &'a [usize],
    pub(super) columns: &'a Columns,
    pub(super) criterion: Criterion,
    /// Where it was linearised, one number an unknown, and what it left there.
    pub(super) theta: &'a [f64],
    pub(super) loss: f64,
    pub(super) rows: usize,
    /// Unknowns outside may stay there (all are in a fit without sparsity).
    pub(super) sparse: bool,
    /// A pivot that is a smaller part of its diagonal is not to be trusted.
    pub(super) least_pivot: f64,
}

/// A support with its solution.
#[derive(Debug, Clone)]
pub(super) struct Found {
    /// Ascending.
    pub(super) support: Vec<usize>,
    /// One number an unknown, zero outside the support.
    pub(super) theta: Vec<f64>,
    pub(super) squares: f64,
    /// Its criterion.
    pub(super) criterion: f64,
    /// Supports that were tried on the way.
    pub(super) tried: usize,
}

impl Space<'_> {
    /// The best support that single changes lead to from the whole space; `None` where unknowns
    /// can hardly be told apart, so that normal equations will not do.
    pub(super) fn search(&self) -> Option<State<'_>> {
        let all: Vec<usize> =
            self.order.iter().copied().filter(|&k| self.normal.diagonal[k] > 0.0).collect();
        let factor = self.normal.factor(all);
        if factor.least.is_nan() || factor.least < self.least_pivot {
            return None;
        }
        let mut state = State::new(self, factor.inverse(), factor.unknowns);
        if self.sparse {
            // Every change betters the criterion, so that no support comes twice.
            while state.remove_weakest() || state.add_strongest() {}
        }
        Some(state)
    }

    fn price(&self, k: usize) -> f64 {
        (self.rows.max(1) as f64).ln() + self.columns.costs[Column::new(k)]
    }

    /// The criterion of a support that leaves a sum of squares.
    pub(super) fn criterion_of(&self, support: &[usize], squares: f64) -> f64 {
        self.value(squares) + support.iter().map(|&k| self.price(k)).sum::<f64>()
    }

    /// Whether an unknown pays its price whose absence makes the squares grow by so much.
    pub(super) fn pays(&self, k: usize, growth: f64) -> bool {
        self.value(self.loss + growth) - self.value(self.loss) > self.price(k)
    }

    fn value(&self, squares: f64) -> f64 {
        self.criterion.value(squares, self.rows, 0, 0.0)
    }
}

/// A support with the inverse of its normal matrix.
pub(super) struct State<'a> {
    space: &'a Space<'a>,
    /// The unknown of each row, and the row of each unknown.
    unknowns: Vec<usize>,
    places: Vec<usize>,
    inside: Vec<bool>,
    /// Inverse for the unknowns inside; zero elsewhere.
    inverse: Vec<f64>,
    solution: Vec<f64>,
    squares: f64,
    /// Slopes with coefficients counted from zero.
    target: Vec<f64>,
    tried: usize,
}

impl<'a> State<'a> {
    fn new(space: &'a Space<'a>, inverse: Vec<f64>, unknowns: Vec<usize>) -> State<'a> {
        let mut places = vec![usize::MAX; space.theta.len()];
        unknowns.iter().enumerate().for_each(|(at, &k)| places[k] = at);
        // What the data do not tell stays where it is, at zero.
        let pull = space.normal.times(space.theta);
        let slopes = space.normal.slopes.iter().zip(&pull);
        let target: Vec<f64> = slopes.map(|(slope, pull)| slope + pull).collect();
        let size = unknowns.len();
        let solution: Vec<f64> = inverse
            .chunks_exact(size.max(1))
            .map(|row| row.iter().zip(&unknowns).map(|(w, &k)| w * target[k]).sum())
            .collect();
        let fall = |(x, &k): (&f64, &usize)| (x - space.theta[k]) * space.normal.slopes[k];
        let fall: f64 = solution.iter().zip(&unknowns).map(fall).sum();
        State {
            squares: (space.loss - fall).max(0.0),
            inside: vec![true; size],
            tried: 1,
            space,
            unknowns,
            places,
            inverse,
            solution,
            target,
        }
    }

    fn size(&self) -> usize {
        self.unknowns.len()
    }

    fn spread(&self, at: usize) -> f64 {
        self.inverse[at * self.size() + at]
    }

    /// Removes the unknown whose loss betters the criterion most, if one does.
    fn remove_weakest(&mut self) -> bool {
        let before = self.space.value(self.squares);
        let change = |at: usize| {
            let growth = self.solution[at].powi(2) / self.spread(at);
            let after = self.space.value(self.squares + growth);
            (at, growth, after - before - self.space.price(self.unknowns[at]))
        };
        let inside = (0..self.size()).filter(|&at| self.inside[at]).map(change);
        let least = inside.min_by(|a, b| a.2.total_cmp(&b.2).then(a.0.cmp(&b.0)));
        let Some((at, growth, _)) = least.filter(|(_, _, change)| *change < 0.0) else {
            return false;
        };
        self.squares += growth;
        let spread = self.spread(at);
        let row = self.row_of(at);
        let moved = self.solution[at] / spread;
        row.iter().for_each(|&(other, w)| self.solution[other] -= w * moved);
        self.add_product(&row, -1.0 / spread);
        let size = self.size();
        for other in 0..size {
            self.inverse[at * size + other] = 0.0;
            self.inverse[other * size + at] = 0.0;
        }
        self.solution[at] = 0.0;
        self.inside[at] = false;
        self.tried += 1;
        true
    }

    /// Entries of a row of the inverse that are not nothing.
    fn row_of(&self, at: usize) -> Vec<(usize, f64)> {
        let row = self.inverse[at * self.size()..][..self.size()].iter().copied().enumerate();
        let own = self.spread(at);
        row.filter(|&(other, w)| w * w > (NOTHING * own * NOTHING) * self.spread(other)).collect()
    }

    fn add_product(&mut self, row: &[(usize, f64)], factor: f64) {
        let size = self.size();
        for &(i, w) in row {
            let into = &mut self.inverse[i * size..][..size];
            row.iter().for_each(|&(j, v)| into[j] += factor * w * v);
        }
    }

    /// Adds the unknown that betters the criterion most, if one does.
    fn add_strongest(&mut self) -> bool {
        let before = self.space.value(self.squares);
        let outside = (0..self.size()).filter(|&at| !self.inside[at]);
        let best = outside
            .filter_map(|at| {
                let (slope, left) = self.addition(at)?;
                let squares = (self.squares - slope * slope / left).max(0.0);
                let change =
                    self.space.value(squares) - before + self.space.price(self.unknowns[at]);
                Some((at, slope, left, squares, change))
            })
            .min_by(|a, b| a.4.total_cmp(&b.4).then(a.0.cmp(&b.0)));
        let Some((at, slope, left, squares, change)) = best else { return false };
        // What rounding alone changes would go round in circles.
        if change >= -1e-9 {
            return false;
        }
        let along = self.along(at);
        let value = slope / left;
        along.iter().for_each(|&(other, u)| self.solution[other] -= u * value);
        self.solution[at] = value;
        self.add_product(&along, 1.0 / left);
        let size = self.size();
        for &(other, u) in &along {
            self.inverse[at * size + other] = -u / left;
            self.inverse[other * size + at] = -u / left;
        }
        self.inverse[at * size + at] = 1.0 / left;
        self.inside[at] = true;
        self.squares = squares;
        self.tried += 1;
        true
    }

    /// Entries of a row of the matrix whose unknowns are inside.
    fn entries(&self, at: usize) -> Vec<(usize, f64)> {
        let row = self.space.normal.rows[self.unknowns[at]].iter();
        let entry = |&(k, x): &(u32, f64)| (self.places[k as usize], x);
        row.map(entry).filter(|(other, _)| self.inside.get(*other) == Some(&true)).collect()
    }

    /// The slope of an unknown outside at the solution, and what is left of its column beside
    /// those inside; `None` where next to nothing is.
    fn addition(&self, at: usize) -> Option<(f64, f64)> {
        let (k, size) = (self.unknowns[at], self.size());
        let entries = self.entries(at);
        let pull: f64 = entries.iter().map(|&(other, x)| x * self.solution[other]).sum();
        let mut left = self.space.normal.diagonal[k];
        for &(i, x) in &entries {
            let row = &self.inverse[i * size..][..size];
            left -= x * entries.iter().map(|&(j, y)| y * row[j]).sum::<f64>();
        }
        let sound = left > self.space.least_pivot * self.space.normal.diagonal[k];
        sound.then_some((self.target[k] - pull, left))
    }

    /// The inverse times the row of an unknown outside.
    fn along(&self, at: usize) -> Vec<(usize, f64)> {
        let size = self.size();
        let mut along = vec![0.0; size];
        for (i, x) in self.entries(at) {
            let row = &self.inverse[i * size..][..size];
            along.iter_mut().zip(row).for_each(|(u, w)| *u += x * w);
        }
        along.into_iter().enumerate().filter(|(_, u)| *u != 0.0).collect()
    }

    /// What the search ended with.
    pub(super) fn found(&self) -> Found {
        let inside = |at: &usize| self.inside[*at];
        let all = || (0..self.size()).filter(inside);
        let mut theta = vec![0.0; self.space.theta.len()];
        all().for_each(|at| theta[self.unknowns[at]] = self.solution[at]);
        self.as_found(all().collect(), theta, self.squares)
    }

    fn as_found(&self, places: Vec<usize>, theta: Vec<f64>, squares: f64) -> Found {
        let mut support: Vec<usize> = places.into_iter().map(|at| self.unknowns[at]).collect();
        support.sort_unstable();
        let criterion = self.space.criterion_of(&support, squares);
        Found { support, theta, squares, criterion, tried: self.tried }
    }

    /// The supports that differ by one unknown and come nearest, the best first.
    pub(super) fn rivals(&self, count: usize) -> Vec<Found> {
        let before = self.space.value(self.squares);
        let change = |at: usize| {
            let price = self.space.price(self.unknowns[at]);
            if self.inside[at] {
                let squares = self.squares + self.solution[at].powi(2) / self.spread(at);
                return Some((self.space.value(squares) - before - price, at, squares));
            }
            let (slope, left) = self.addition(at)?;
            let squares = (self.squares - slope * slope / left).max(0.0);
            Some((self.space.value(squares) - before + price, at, squares))
        };
        let mut changes: Vec<(f64, usize, f64)> = (0..self.size()).filter_map(change).collect();
        changes.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        changes.truncate(count);
        let rival = |(_, at, squares): (f64, usize, f64)| {
            let mut theta = self.found().theta;
            let mut places: Vec<usize> = (0..self.size()).filter(|&k| self.inside[k]).collect();
            if self.inside[at] {
                let moved = self.solution[at] / self.spread(at);
                let row = self.row_of(at);
                row.iter().for_each(|&(other, w)| theta[self.unknowns[other]] -= w * moved);
                theta[self.unknowns[at]] = 0.0;
                places.retain(|&k| k != at);
            } else if let Some((slope, left)) = self.addition(at) {
                let along = self.along(at);
                let value = slope / left;
                along.iter().for_each(|&(other, u)| theta[self.unknowns[other]] -= u * value);
                theta[self.unknowns[at]] = value;
                places.push(at);
            }
            self.as_found(places, theta, squares)
        };
        changes.into_iter().map(rival).collect()
    }
}
