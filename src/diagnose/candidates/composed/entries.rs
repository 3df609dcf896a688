//! What sets are made of: named candidates at points of their grids and composed terms, each with
//! what it does to all residuals around one motion.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::actions::Action;
use super::expression::Composed;
use super::gram::{Known, Limits, Pool};
use super::named::{NamedAction, at_all_points, finer};
use super::responses::Response;
use super::search::Search;
use crate::diagnose::candidates::Candidate;
use crate::diagnose::tuning;
use crate::fit::Law;

/// What a member of a set is.
#[derive(Clone, PartialEq)]
pub(super) enum Change {
    /// A candidate, by its place in the list.
    Named(usize),
    /// A composed term.
    Composed(Composed),
}

/// Something that a set may have.
pub(super) struct Entry {
    pub(super) change: Change,
    /// Its inner numbers.
    pub(super) values: Vec<f64>,
    /// Entries of one kind differ in their inner numbers alone.
    pub(super) kind: usize,
    /// Whether a set may have two of its kind.
    twice: bool,
    /// What it costs, in nats.
    pub(super) price: f64,
    /// What it does, one response for each of its coefficients.
    pub(super) responses: Vec<Response>,
    /// The least and the largest of these: to which first order says anything, and of a sign that
    /// the name allows.
    limits: Vec<Limits>,
    /// By how much the squares fall with it alone.
    fall: f64,
}

/// One motion that entries are made around.
pub(super) struct Motion<'s, 't> {
    pub(super) search: &'s Search<'t>,
    /// The model as it is, with the numbers that it has there.
    pub(super) law: &'s Law,
    pub(super) candidates: &'s [Candidate],
    /// Spreads of the observables.
    pub(super) spreads: &'s [f64],
    /// Whether a set may have two of what can be there twice.
    pub(super) twice: bool,
    pub(super) tuning: &'t tuning::Sets,
}

impl<'t> Motion<'_, 't> {
    /// Named candidates: those `fitted`, and the best points of their grids. What was fitted beside
    /// others need not explain much alone.
    pub(super) fn named(&self, fitted: &[(usize, Vec<f64>)]) -> Vec<Entry> {
        let of = |place: usize| {
            let stand = fitted.iter().filter(|(at, own)| *at == place && !own.is_empty());
            let stand: Vec<Vec<f64>> = stand.map(|(_, own)| own.clone()).collect();
            let stand = self.at_points(place, &stand).into_iter().map(|entry| (0, entry));
            stand.chain(self.best_points(place)).collect::<Vec<_>>()
        };
        let places = (0..self.candidates.len()).into_par_iter();
        let mut all: Vec<(usize, Entry)> = places.flat_map_iter(of).collect();
        // The best point of each comes first.
        all.sort_by(|(a, one), (b, other)| {
            (*a > 0).cmp(&(*b > 0)).then(other.fall.total_cmp(&one.fall))
        });
        all.truncate(self.tuning.named);
        all.into_iter().map(|(_, entry)| entry).collect()
    }

    /// The best points of the grid of a named candidate, each with how many are better. Of one that
    /// may be there twice, half of them are the best beside the first.
    fn best_points(&self, place: usize) -> Vec<(usize, Entry)> {
        let candidate = &self.candidates[place];
        let most = self.tuning.points;
        let mut all = self.at_points(place, &finer(&candidate.grid, self.tuning.between));
        all.sort_by(|a, b| b.fall.total_cmp(&a.fall));
        let half = most.div_ceil(2).min(all.len());
        let mut seconds = Vec::new();
        if self.may_be_twice(candidate) {
            let beside = Beside::of(all.first().into_iter(), &self.search.responses.target());
            let rest = all.split_off(half);
            let mut falls: Vec<(f64, Entry)> =
                rest.into_iter().map(|entry| (beside.fall(&entry), entry)).collect();
            falls.sort_by(|(a, _), (b, _)| b.total_cmp(a));
            seconds.extend(falls.into_iter().map(|(_, entry)| entry));
            seconds.truncate(most - half);
        }
        all.truncate(most);
        all.into_iter().enumerate().chain(seconds.into_iter().enumerate()).collect()
    }

    fn may_be_twice(&self, candidate: &Candidate) -> bool {
        self.twice && candidate.second.is_some()
    }

    /// A named candidate at some choices of its inner numbers, those left out that do nothing.
    fn at_points(&self, place: usize, grid: &[Vec<f64>]) -> Vec<Entry> {
        let responses = &self.search.responses;
        let candidate = &self.candidates[place];
        let rows = (responses.rows.max(2) as f64).ln();
        let choices = (candidate.grid.len().max(1) as f64).ln();
        let target = responses.target();
        let found = at_all_points(candidate, grid, self.law, &responses.points, responses.channels);
        let entry = |one: NamedAction| {
            let own: Vec<Response> =
                one.actions.iter().map(|action| responses.response(action)).collect();
            let (unknowns, limits) = match candidate.number() {
                Some(number) => {
                    let most = self.tuning.linear * number.value.abs();
                    (1.0, vec![(-most, most)])
                }
                None => {
                    let limits = one.actions.iter().map(|action| {
                        let most = self.limit(action);
                        (if candidate.is_positive() { 0.0 } else { -most }, most)
                    });
                    ((own.len() + one.values.len()) as f64, limits.collect())
                }
            };
            Entry {
                change: Change::Named(place),
                values: one.values,
                kind: place,
                twice: self.may_be_twice(candidate),
                price: candidate.choice + choices + 0.5 * unknowns * rows,
                fall: fall(&own, &target),
                responses: own,
                limits,
            }
        };
        found.into_iter().map(entry).filter(|one| one.fall > 0.0).collect()
    }

    /// Composed terms.
    pub(super) fn composed(&self, terms: &[Composed]) -> Vec<Entry> {
        let responses = &self.search.responses;
        let rows = (responses.rows.max(2) as f64).ln();
        let target = responses.target();
        let of = |(place, term): (usize, &Composed)| {
            let action = term.action(&self.search.jets.nodes, responses.channels);
            let own = vec![responses.response(&action)];
            let most = self.limit(&action);
            let unknowns = 1.0 + term.inner().len() as f64;
            // Forms that differ in their numbers alone are of one kind.
            let form = terms[..place].iter().position(|other| other.has_form_of(term));
            Entry {
                change: Change::Composed(term.clone()),
                values: term.numbers(),
                kind: self.candidates.len() + form.unwrap_or(place),
                twice: false,
                price: term.price + 0.5 * unknowns * rows,
                fall: fall(&own, &target),
                responses: own,
                limits: vec![(-most, most)],
            }
        };
        let all = terms.par_iter().enumerate().map(of);
        all.filter(|entry| entry.fall > 0.0).collect()
    }

    /// Members of a set between the points of their grids, where they explain more beside the
    /// others: by the distance of two points a drive is out of step at the end of a run, which
    /// looks like something that drifts. Each with its place among `entries`.
    pub(super) fn sharpened(&self, entries: &[Entry], set: &[usize]) -> Vec<(usize, Entry)> {
        let target = self.search.responses.target();
        let of = |&at: &usize| {
            let Change::Named(place) = entries[at].change else { return None };
            if self.candidates[place].number().is_some() || entries[at].values.is_empty() {
                return None;
            }
            let others = set.iter().filter(|&&other| other != at).map(|&other| &entries[other]);
            let beside = Beside::of(others, &target);
            let first = beside.fall(&entries[at]);
            let mut best: Option<(f64, Entry)> = None;
            for number in 0..entries[at].values.len() {
                let values = best.as_ref().map_or(&entries[at].values, |(_, one)| &one.values);
                let own = values[number];
                let grid = finer(&self.candidates[place].grid, self.tuning.between);
                let (mut below, mut above) = (f64::NEG_INFINITY, f64::INFINITY);
                for value in grid.iter().map(|values| values[number]) {
                    if value < own {
                        below = below.max(value);
                    } else if value > own {
                        above = above.min(value);
                    }
                }
                let mut from = if below.is_finite() { below } else { own };
                let mut to = if above.is_finite() { above } else { own };
                for _ in 0..self.tuning.divisions {
                    let values = best.as_ref().map_or(&entries[at].values, |(_, one)| &one.values);
                    let middle = values[number];
                    let part = |k: usize| from + (to - from) * k as f64 / 8.0;
                    let points = (0..=8).map(|k| {
                        let mut values = values.clone();
                        values[number] = part(k);
                        values
                    });
                    for entry in self.at_points(place, &points.collect::<Vec<_>>()) {
                        let fall = beside.fall(&entry);
                        if fall > best.as_ref().map_or(first, |(most, _)| *most) {
                            best = Some((fall, entry));
                        }
                    }
                    let centre = best.as_ref().map_or(middle, |(_, one)| one.values[number]);
                    let reach = (to - from) / 8.0;
                    (from, to) = (centre - reach, centre + reach);
                }
            }
            best.map(|(_, entry)| (at, entry))
        };
        set.par_iter().filter_map(of).collect()
    }

    /// The largest coefficient with which an action says what it does: what a sensor shows beside
    /// the truth bends the motion that follows from it, unless it is small beside that motion.
    fn limit(&self, action: &Action) -> f64 {
        let channels = self.search.responses.channels;
        let of = |channel: &usize| channels.sensed(*channel);
        let Some(observables) = action.channels.iter().map(of).collect::<Option<Vec<usize>>>()
        else {
            return f64::INFINITY;
        };
        let count = (action.values.len() / observables.len().max(1)).max(1);
        let ratios =
            observables.iter().zip(action.values.chunks(count)).map(|(&observable, shown)| {
                let mean = shown.iter().sum::<f64>() / count as f64;
                let squares: f64 = shown.iter().map(|x| (x - mean).powi(2)).sum();
                let spread = self.spreads.get(observable).copied().unwrap_or(f64::INFINITY);
                spread / (squares / count as f64).sqrt()
            });
        self.tuning.linear * ratios.fold(f64::INFINITY, f64::min)
    }

    /// Entries as a pool.
    pub(super) fn pool(&self, entries: &[Entry]) -> Pool<'t> {
        let responses = &self.search.responses;
        let members = entries.iter().map(Entry::member).collect();
        let twice = entries.iter().filter(|entry| entry.twice).map(|entry| entry.kind).collect();
        Pool::of(members, &responses.target(), responses.rows, self.tuning).taking_twice(twice)
    }

    /// A pool with more entries.
    pub(super) fn pool_with(&self, pool: Pool<'t>, entries: &[Entry]) -> Pool<'t> {
        let members = entries.iter().map(Entry::member).collect();
        pool.with(members, &self.search.responses.target())
    }
}

impl Entry {
    /// As a member of a pool.
    fn member(&self) -> (usize, f64, Vec<Known>) {
        let columns = self.responses.iter().map(|response| response.column.clone());
        (self.kind, self.price, columns.zip(self.limits.iter().copied()).collect())
    }
}

/// What some entries leave.
struct Beside {
    /// An orthonormal basis of what they do.
    basis: Vec<DVector<f64>>,
    left: DVector<f64>,
}

impl Beside {
    fn of<'e>(entries: impl Iterator<Item = &'e Entry>, target: &DVector<f64>) -> Beside {
        let mut beside = Beside { basis: Vec::new(), left: target.clone() };
        for response in entries.flat_map(|entry| &entry.responses) {
            let rest = beside.rest(&response.column);
            let norm = rest.norm();
            if norm > 0.0 {
                beside.basis.push(rest / norm);
            }
        }
        beside.left = beside.rest(target);
        beside
    }

    /// The part of a column that is at right angles to all of the basis.
    fn rest(&self, column: &DVector<f64>) -> DVector<f64> {
        let mut rest = column.clone();
        for _ in 0..2 {
            for basis in &self.basis {
                rest.axpy(-basis.dot(&rest), basis, 1.0);
            }
        }
        rest
    }

    /// By how much what is left falls with one more entry.
    fn fall(&self, entry: &Entry) -> f64 {
        let columns: Vec<DVector<f64>> =
            entry.responses.iter().map(|response| self.rest(&response.column)).collect();
        fall_of(&columns.iter().collect::<Vec<_>>(), &self.left)
    }
}

/// By how much the squares fall with some responses.
fn fall(responses: &[Response], target: &DVector<f64>) -> f64 {
    fall_of(&responses.iter().map(|response| &response.column).collect::<Vec<_>>(), target)
}

/// By how much the squares fall with some columns; 0 where they span one another.
fn fall_of(columns: &[&DVector<f64>], target: &DVector<f64>) -> f64 {
    let norms: Vec<f64> = columns.iter().map(|column| column.norm()).collect();
    if norms.iter().any(|norm| !(*norm > 0.0 && norm.is_finite())) {
        return 0.0;
    }
    match columns {
        [one] => (one.dot(target) / norms[0]).powi(2),
        _ => {
            let count = columns.len();
            let gram = DMatrix::from_fn(count, count, |i, j| {
                columns[i].dot(columns[j]) / norms[i] / norms[j]
            });
            let heights = DVector::from_fn(count, |i, _| columns[i].dot(target) / norms[i]);
            gram.cholesky().map_or(0.0, |factor| factor.solve(&heights).dot(&heights))
        }
    }
}
