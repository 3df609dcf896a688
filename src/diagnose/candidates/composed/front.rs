//! Composed terms weighed against one another: one or two together, price against what is left.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::expression::Composed;
use super::search::Search;

/// One or two composed terms with what they leave, to first order.
#[derive(Debug, Clone)]
pub(super) struct Choice {
    pub(super) terms: Vec<Composed>,
    /// A coefficient for each term.
    pub(super) coefficients: Vec<f64>,
    /// What is left of the squares.
    pub(super) left: f64,
    /// Description length of the expressions in nats, without that of their numbers.
    pub(super) price: f64,
}

impl Choice {
    /// Its terms, each with its coefficient.
    pub(super) fn with_coefficients(&self) -> Vec<(Composed, f64)> {
        self.terms.iter().cloned().zip(self.coefficients.iter().copied()).collect()
    }

    fn unknowns(&self) -> f64 {
        self.terms.iter().map(|term| 1.0 + term.inner().len() as f64).sum()
    }

    /// Description length in nats of what it says and of what it leaves unsaid.
    pub(super) fn whole(&self, variance: f64, rows: usize) -> f64 {
        0.5 * self.left / variance + self.cost(rows)
    }

    /// Description length in nats of expressions and numbers.
    pub(super) fn cost(&self, rows: usize) -> f64 {
        self.price + 0.5 * self.unknowns() * (rows.max(2) as f64).ln()
    }
}

/// All terms alone, and the best second ones beside the best of them.
fn choices(terms: &[(Composed, f64)], search: &Search, variance: f64) -> Vec<Choice> {
    let Search { jets, responses, tuning } = search;
    let tuning = &tuning.composed;
    let target = responses.target();
    let squares = target.norm_squared();
    let columns: Vec<DVector<f64>> = terms
        .par_iter()
        .map(|(term, _)| responses.column(&term.action(&jets.nodes, responses.channels)))
        .collect();
    let mut all = Vec::new();
    for ((term, fall), column) in terms.iter().zip(&columns) {
        let norm = column.norm_squared();
        if norm > 0.0 {
            all.push(Choice {
                terms: vec![term.clone()],
                coefficients: vec![column.dot(&target) / norm],
                left: (squares - fall).max(0.0),
                price: term.price,
            });
        }
    }
    let singles = all.len();
    let mut order: Vec<usize> = (0..singles).collect();
    order.sort_by(|&a, &b| {
        let whole = |i: usize| all[i].whole(variance, responses.rows);
        whole(a).total_cmp(&whole(b))
    });
    for &first in order.iter().take(tuning.beam) {
        let basis = columns[first].normalize();
        let height = basis.dot(&target);
        let mut best: Option<(usize, f64, f64)> = None;
        for (second, column) in columns.iter().enumerate().take(singles) {
            if second == first {
                continue;
            }
            let shadow = basis.dot(column);
            let own = column.norm_squared() - shadow * shadow;
            if own <= tuning.apart * column.norm_squared() {
                continue;
            }
            let gain = (column.dot(&target) - shadow * height).powi(2) / own;
            let merit = 0.5 * gain / variance - terms[second].0.price;
            if best.is_none_or(|(_, most, _)| merit > most) {
                best = Some((second, merit, gain));
            }
        }
        let Some((second, _, gain)) = best else { continue };
        let pair = [first, second];
        let Some(coefficients) = joint(&pair.map(|i| &columns[i]), &target) else { continue };
        all.push(Choice {
            terms: pair.iter().map(|&i| terms[i].0.clone()).collect(),
            coefficients,
            left: (squares - terms[first].1 - gain).max(0.0),
            // Either order says the same.
            price: terms[first].0.price + terms[second].0.price - std::f64::consts::LN_2,
        });
    }
    all
}

/// Coefficients of several columns together.
pub(super) fn joint(columns: &[&DVector<f64>], target: &DVector<f64>) -> Option<Vec<f64>> {
    let count = columns.len();
    let gram = DMatrix::from_fn(count, count, |i, j| columns[i].dot(columns[j]));
    let heights = DVector::from_fn(count, |i, _| columns[i].dot(target));
    let solved = gram.cholesky()?.solve(&heights);
    Some(solved.iter().copied().collect())
}

/// Forward selection of a few terms that together leave the least: what the motion is to be
/// followed by, not what it is to be explained by.
pub(super) fn together(
    terms: &[(Composed, f64)],
    search: &Search,
    variance: f64,
) -> Vec<(Composed, f64)> {
    let Search { jets, responses, tuning } = search;
    let tuning = &tuning.composed;
    let target = responses.target();
    let columns: Vec<DVector<f64>> = terms
        .par_iter()
        .map(|(term, _)| responses.column(&term.action(&jets.nodes, responses.channels)))
        .collect();
    let mut rests = columns.clone();
    let mut left = target.clone();
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < tuning.together {
        let mut best: Option<(usize, f64)> = None;
        for (at, rest) in rests.iter().enumerate() {
            let own = rest.norm_squared();
            if own <= tuning.apart_together * columns[at].norm_squared() || own == 0.0 {
                continue;
            }
            let merit = 0.5 * rest.dot(&left).powi(2) / own / variance - terms[at].0.price;
            if best.is_none_or(|(_, most)| merit > most) {
                best = Some((at, merit));
            }
        }
        let Some((at, merit)) = best else { break };
        if merit <= 0.0 && !chosen.is_empty() {
            break;
        }
        let basis = rests[at].normalize();
        let height = basis.dot(&left);
        left.axpy(-height, &basis, 1.0);
        for rest in &mut rests {
            let shadow = basis.dot(rest);
            rest.axpy(-shadow, &basis, 1.0);
        }
        chosen.push(at);
    }
    let of: Vec<&DVector<f64>> = chosen.iter().map(|&at| &columns[at]).collect();
    let coefficients = joint(&of, &target).unwrap_or_default();
    chosen.iter().zip(coefficients).map(|(&at, c)| (terms[at].0.clone(), c)).collect()
}

/// Those that no other is both cheaper and better than, and those whose whole description is less
/// than `rivals` nats longer than the shortest; the shortest first.
fn leaders(all: Vec<Choice>, variance: f64, rows: usize, rivals: f64) -> Vec<Choice> {
    let mut all = all;
    all.sort_by(|a, b| a.cost(rows).total_cmp(&b.cost(rows)).then(a.left.total_cmp(&b.left)));
    let whole = |choice: &Choice| choice.whole(variance, rows);
    let shortest = all.iter().map(whole).fold(f64::INFINITY, f64::min);
    let mut least = f64::INFINITY;
    all.retain(|choice| {
        let better = choice.left < least;
        least = least.min(choice.left);
        better || whole(choice) < shortest + rivals
    });
    all.sort_by(|a, b| whole(a).total_cmp(&whole(b)));
    all
}

/// The front of price against what is left, and rivals of its best place; that first, then
/// the others by how much worse they are. What is no better than to say nothing is not on it.
pub(super) fn chosen_terms(search: &Search, terms: &[(Composed, f64)]) -> Vec<Choice> {
    let rows = search.responses.rows;
    let few = &terms[..terms.len().min(search.tuning.composed.joined)];
    let variance = search.best_variance(few);
    let all = choices(few, search, variance);
    let least = all.iter().map(|choice| choice.left).fold(f64::INFINITY, f64::min);
    let variance = search.variance(least);
    let mut front = leaders(all, variance, rows, search.tuning.composed.rivals);
    let nothing = 0.5 * search.responses.squares / variance;
    front.retain(|choice| choice.whole(variance, rows) < nothing);
    front
}
