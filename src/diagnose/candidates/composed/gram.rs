//! Sets of columns chosen on one Gram matrix.
//!
//! What any member of a pool does to all residuals is a few columns, computed once. The squares
//! that a set leaves then follow from their inner products alone: a set costs microseconds, and
//! a search over sets can add, drop, exchange and merge members freely. What is left is the
//! variance that the likelihood is taken with: while most is missing, a small member must not look
//! significant beside a noise that nothing has reached yet.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use rustc_hash::FxHashSet;

use super::found_set::{Addition, FoundSet, Set, cheapest, count, shorten, with, without};
use super::inner_products::inner_products;
use crate::diagnose::tuning;

/// A member that a set may have.
pub(super) struct PoolMember {
    /// Its first column.
    first: usize,
    /// How many columns it has.
    count: usize,
    /// What it costs in nats, its coefficients and inner numbers among it.
    price: f64,
    /// Members of one kind differ in their inner numbers alone: a set has one of them, or two.
    kind: usize,
    /// Inner products of its columns with one another.
    own: DMatrix<f64>,
}

/// A column, and the least and the largest coefficient that it may have.
pub(super) type Known = (DVector<f64>, Limits);

/// The least and the largest coefficient of a column.
pub(super) type Limits = (f64, f64);

/// Any coefficient.
const ANY: Limits = (f64::NEG_INFINITY, f64::INFINITY);

/// Columns that sets are made of.
pub(super) struct Pool<'a> {
    members: Vec<PoolMember>,
    /// All columns, each brought to length 1.
    design: DMatrix<f64>,
    /// Their inner products.
    gram: DMatrix<f64>,
    /// Those with themselves.
    diagonal: DVector<f64>,
    /// Their inner products with what is to be explained.
    heights: DVector<f64>,
    /// Lengths of the columns.
    norms: Vec<f64>,
    /// The least and the largest coefficients of columns, brought to length 1.
    limits: Vec<Limits>,
    /// Kinds of which a set may have two members; it has one of any other.
    twice: FxHashSet<usize>,
    /// Squares of what is to be explained.
    squares: f64,
    /// Independent residuals.
    rows: usize,
    /// How many of them say as much as one that is independent of the others.
    inflation: f64,
    tuning: &'a tuning::Sets,
}

impl<'a> Pool<'a> {
    /// Each member with its kind, its price in nats and its columns.
    pub(super) fn of(
        members: Vec<(usize, f64, Vec<Known>)>,
        target: &DVector<f64>,
        rows: usize,
        tuning: &'a tuning::Sets,
    ) -> Pool<'a> {
        let nothing = Pool {
            members: Vec::new(),
            design: DMatrix::zeros(target.len(), 0),
            gram: DMatrix::zeros(0, 0),
            diagonal: DVector::zeros(0),
            heights: DVector::zeros(0),
            norms: Vec::new(),
            limits: Vec::new(),
            twice: FxHashSet::default(),
            squares: target.norm_squared(),
            rows,
            inflation: 1.0,
            tuning,
        };
        nothing.with(members, target)
    }

    /// The same where a set may have two members of some kinds.
    pub(super) fn taking_twice(self, kinds: FxHashSet<usize>) -> Pool<'a> {
        Pool { twice: kinds, ..self }
    }

    /// The same with more members, which come last.
    pub(super) fn with(
        mut self,
        members: Vec<(usize, f64, Vec<Known>)>,
        target: &DVector<f64>,
    ) -> Pool<'a> {
        let before = self.norms.len();
        let mut columns: Vec<DVector<f64>> = Vec::new();
        for (kind, price, own) in members {
            let (at, count) = (columns.len(), own.len());
            for (column, (least, most)) in own {
                let norm = column.norm();
                self.norms.push(norm);
                self.limits.push((least * norm, most * norm));
                columns.push(if norm > 0.0 { column / norm } else { column });
            }
            let of = |i: usize, j: usize| columns[at + i].dot(&columns[at + j]);
            let own = DMatrix::from_fn(count, count, of);
            self.members.push(PoolMember { first: before + at, count, price, kind, own });
        }
        if columns.is_empty() {
            return self;
        }
        let (count, all) = (columns.len(), before + columns.len());
        let added = DMatrix::from_columns(&columns);
        let own = inner_products(&added);
        let crossed = self.design.transpose() * &added;
        let mut gram = self.gram.resize(all, all, 0.0);
        gram.view_mut((before, before), (count, count)).copy_from(&own);
        gram.view_mut((0, before), (before, count)).copy_from(&crossed);
        gram.view_mut((before, 0), (count, before)).copy_from(&crossed.transpose());
        let mut heights = self.heights.resize_vertically(all, 0.0);
        heights.rows_mut(before, count).copy_from(&added.tr_mul(target));
        let mut design = self.design.resize_horizontally(all, 0.0);
        design.columns_mut(before, count).copy_from(&added);
        Pool { design, diagonal: gram.diagonal(), gram, heights, ..self }
    }

    fn columns(&self, set: &[usize]) -> Vec<usize> {
        let of = |&at: &usize| {
            let member = &self.members[at];
            member.first..member.first + member.count
        };
        set.iter().flat_map(of).collect()
    }

    /// The best sets, the shortest description first, and one alone of those that differ in inner
    /// numbers. The search begins with no member and with those of `standing`, which need not be in
    /// order; all pairs are looked at, as two that tell little alone may explain all together.
    pub(super) fn search(&self, standing: &[usize]) -> Vec<FoundSet> {
        let all = 0..self.members.len();
        let pairs = all.into_par_iter().flat_map_iter(|at| self.added(&[at], self.tuning.paired));
        self.search_from(standing, pairs.collect())
    }

    /// The same from those of `standing` and the sets that were `found` before.
    pub(super) fn search_from(&self, standing: &[usize], found: Vec<FoundSet>) -> Vec<FoundSet> {
        let tuning = self.tuning;
        let mut standing = standing.to_vec();
        standing.sort_unstable();
        let mut pool: Vec<FoundSet> =
            [Vec::new(), standing].into_iter().filter_map(|members| self.found(members)).collect();
        pool.dedup_by(|a, b| a.members == b.members);
        let mut seen: FxHashSet<Set> = pool.iter().map(|one| one.members.clone()).collect();
        let mut front = pool.clone();
        pool.extend(found.into_iter().filter(|one| seen.insert(one.members.clone())));
        for _ in 0..tuning.rounds {
            let moves: Vec<FoundSet> =
                front.par_iter().flat_map_iter(|one| self.moves(&one.members)).collect();
            let new = moves.into_iter().filter(|one| seen.insert(one.members.clone()));
            pool.extend(new);
            pool.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.members.cmp(&b.members)));
            shorten(&mut pool, tuning.kept);
            let next: Vec<FoundSet> = pool.iter().take(tuning.beam).cloned().collect();
            let same = next.iter().map(|one| &one.members).eq(front.iter().map(|one| &one.members));
            if same {
                break;
            }
            front = next;
        }
        let mut kinds = FxHashSet::default();
        pool.retain(|one| kinds.insert(self.kinds(&one.members)));
        pool
    }

    fn kinds(&self, set: &[usize]) -> Vec<usize> {
        let mut kinds: Vec<usize> = set.iter().map(|&at| self.members[at].kind).collect();
        kinds.sort_unstable();
        kinds
    }

    /// Whether a set has all members of another, but for their inner numbers.
    pub(super) fn holds(&self, set: &FoundSet, other: &FoundSet) -> bool {
        let (kinds, others) = (self.kinds(&set.members), self.kinds(&other.members));
        others.iter().all(|&kind| count(&kinds, kind) >= count(&others, kind))
    }

    /// The sets one move away: a member added, dropped, exchanged, one exchanged for two or
    /// two for one.
    fn moves(&self, set: &[usize]) -> Vec<FoundSet> {
        let tuning = self.tuning;
        let mut found = Vec::new();
        if set.len() < tuning.members {
            found.extend(self.added_apart(set, tuning.added));
        }
        for (at, _) in set.iter().enumerate() {
            let rest = without(set, &[at]);
            found.extend(self.found(rest.clone()).filter(|one| self.is_within(&one.members)));
            found.extend(self.added(&rest, tuning.exchanged));
            if set.len() < tuning.members {
                for one in self.added_apart(&rest, tuning.split) {
                    found.extend(self.added(&one.members, tuning.split));
                }
            }
            for other in at + 1..set.len() {
                found.extend(self.added(&without(set, &[at, other]), tuning.merged));
            }
        }
        found
    }

    /// The set where each member, the dearest first, is exchanged for the cheapest that does nearly
    /// the same beside the others, as long as it leaves so many times the squares at most. First
    /// order may tell a form from its limiting form by no more than its own error.
    pub(super) fn simplest(&self, found: &FoundSet, times: f64) -> Option<FoundSet> {
        let price = |at: usize| self.members[at].price;
        let most = times * self.left(&found.members)?;
        let mut order = found.members.clone();
        order.sort_by(|&a, &b| price(b).total_cmp(&price(a)));
        let mut set = found.members.clone();
        for own in order {
            let rest: Set = set.iter().copied().filter(|&at| at != own).collect();
            let beside = self.beside(&rest)?;
            let all = self.costs(&rest, &beside).into_iter();
            let simpler = all.filter(|&(cost, at)| {
                let more = with(&rest, &(cost, at)).members;
                price(at) < price(own)
                    && self.is_alike(at, own, &beside)
                    && self.is_within(&more)
                    && self.left(&more).is_some_and(|left| left <= most)
            });
            let cheapest = simpler.min_by(|&(cost, a), &(other, b)| {
                price(a).total_cmp(&price(b)).then(cost.total_cmp(&other)).then(a.cmp(&b))
            });
            if let Some(one) = cheapest {
                set = with(&rest, &one).members;
            }
        }
        if set == found.members { None } else { self.found(set) }
    }

    /// The set with one of its members exchanged for each of the cheapest of another kind that are
    /// `wanted` and leave nearly as little: what they cost aside, they are `behind` at most.
    pub(super) fn exchanges(
        &self,
        set: &FoundSet,
        own: usize,
        (most, behind): (usize, f64),
        wanted: impl Fn(usize) -> bool,
    ) -> Vec<FoundSet> {
        let rest: Set = set.members.iter().copied().filter(|&at| at != own).collect();
        let least = self.misfit(set) + behind;
        let kind = |at: usize| self.members[at].kind;
        let misfit = |at: usize, beside: &Beside| {
            let left = (self.squares - beside.explained).max(0.0);
            self.fall(&self.members[at], beside).map(|fall| self.cost_of(left - fall, 0.0))
        };
        self.added_where(&rest, most, |at, taken, beside| {
            let is_new = kind(at) != kind(own) && !taken.iter().any(|&one| kind(one) == kind(at));
            is_new && wanted(at) && misfit(at, beside).is_some_and(|misfit| misfit <= least)
        })
    }

    fn found(&self, members: Set) -> Option<FoundSet> {
        let left = self.left(&members)?;
        Some(FoundSet { cost: self.cost(left, &members), members, saved: 0.0 })
    }

    /// The set with each of the members that it is best with.
    fn added(&self, set: &[usize], most: usize) -> Vec<FoundSet> {
        self.added_where(set, most, |_, _, _| true)
    }

    /// The same with members that do different things beside the set, the cheapest of each: many
    /// may do nearly the same, and one that tells little alone is not to be crowded out by them.
    fn added_apart(&self, set: &[usize], most: usize) -> Vec<FoundSet> {
        self.added_where(set, most, |at, taken, beside| {
            !taken.iter().any(|&other| self.is_alike(at, other, beside))
        })
    }

    /// The set with each of the cheapest members that are wanted beside it and those taken before.
    fn added_where(
        &self,
        set: &[usize],
        most: usize,
        wanted: impl Fn(usize, &[usize], &Beside) -> bool,
    ) -> Vec<FoundSet> {
        let Some(beside) = self.beside(set) else { return Vec::new() };
        let mut all = self.costs(set, &beside);
        let mut taken: Vec<usize> = Vec::with_capacity(most);
        let mut found: Vec<FoundSet> = Vec::with_capacity(most);
        let mut rest = &mut all[..];
        // Most are never looked at: only the cheapest are brought into order.
        while found.len() < most && !rest.is_empty() {
            let (first, then) = cheapest(rest, 4 * most);
            for one in first.iter() {
                if found.len() == most {
                    break;
                }
                let more = with(set, one);
                if wanted(one.1, &taken, &beside) && self.is_within(&more.members) {
                    found.push(more);
                    taken.push(one.1);
                }
            }
            rest = then;
        }
        found
    }

    /// What a set costs with each member of a kind that it may have one more of.
    fn costs(&self, set: &[usize], beside: &Beside) -> Vec<Addition> {
        let left = (self.squares - beside.explained).max(0.0);
        let kinds = self.kinds(set);
        let base: f64 = set.iter().map(|&at| self.members[at].price).sum();
        let others = self.members.iter().enumerate();
        let most = |kind| 1 + usize::from(self.twice.contains(&kind));
        let others = others.filter(|(_, member)| count(&kinds, member.kind) < most(member.kind));
        others
            .filter_map(|(at, member)| {
                let fall = self.fall(member, beside)?;
                Some((self.cost_of(left - fall, base + member.price), at))
            })
            .collect()
    }

    /// Whether two members do nearly the same beside a set.
    fn is_alike(&self, one: usize, other: usize, beside: &Beside) -> bool {
        let (one, other) = (&self.members[one], &self.members[other]);
        if one.kind == other.kind {
            return true;
        }
        if one.count > 1 || other.count > 1 {
            return false;
        }
        let (i, j) = (one.first, other.first);
        let product = self.gram[(i, j)] - beside.product_of_shadows(i, j);
        product.powi(2) > self.tuning.alike * beside.left[i] * beside.left[j]
    }

    /// Whether all coefficients of a set are within the limits of their columns.
    fn is_within(&self, set: &[usize]) -> bool {
        let own = self.columns(set);
        if own.iter().all(|&at| self.limits[at] == ANY) {
            return true;
        }
        let Some(values) = self.solved(&own) else { return false };
        own.iter().zip(values.iter()).all(|(&at, value)| {
            let (least, most) = self.limits[at];
            least <= *value && *value <= most
        })
    }

    /// By how much the squares fall with a member beside a set; `None` where the set nearly spans
    /// one of its columns.
    fn fall(&self, member: &PoolMember, beside: &Beside) -> Option<f64> {
        let (first, count) = (member.first, member.count);
        if beside.left.rows(first, count).iter().any(|left| *left <= self.tuning.apart) {
            return None;
        }
        let heights = beside.heights.rows(first, count);
        if count == 1 {
            return Some(heights[0].powi(2) / beside.left[first]);
        }
        let left = |i: usize, j: usize| {
            member.own[(i, j)] - beside.product_of_shadows(first + i, first + j)
        };
        let factor = DMatrix::from_fn(count, count, left).cholesky()?;
        let lower = factor.l_dirty();
        let apart = (0..count).all(|i| lower[(i, i)].powi(2) > self.tuning.apart);
        apart.then(|| factor.solve(&heights).dot(&heights))
    }

    /// All columns beside those of a set; `None` where these nearly span one another.
    fn beside(&self, set: &[usize]) -> Option<Beside> {
        let own = self.columns(set);
        let (mut heights, mut left) = (self.heights.clone(), self.diagonal.clone());
        let mut shadows: Vec<DVector<f64>> = Vec::with_capacity(own.len());
        if own.is_empty() {
            return Some(Beside { heights, shadows, left, explained: 0.0 });
        }
        let lower = self.factor(&own)?;
        let by_basis = DVector::from_fn(own.len(), |i, _| self.heights[own[i]]);
        let by_basis = lower.solve_lower_triangular(&by_basis)?;
        for (at, &column) in own.iter().enumerate() {
            let mut shadow = self.gram.column(column).clone_owned();
            for (before, known) in shadows.iter().enumerate() {
                shadow.axpy(-lower[(at, before)], known, 1.0);
            }
            shadow /= lower[(at, at)];
            heights.axpy(-by_basis[at], &shadow, 1.0);
            left.zip_apply(&shadow, |left, shadow| *left -= shadow * shadow);
            shadows.push(shadow);
        }
        Some(Beside { heights, shadows, left, explained: by_basis.norm_squared() })
    }

    fn factor(&self, own: &[usize]) -> Option<DMatrix<f64>> {
        let gram = DMatrix::from_fn(own.len(), own.len(), |i, j| self.gram[(own[i], own[j])]);
        let lower = gram.cholesky()?.l();
        let apart = (0..own.len()).all(|i| lower[(i, i)].powi(2) > self.tuning.apart);
        apart.then_some(lower)
    }

    /// Squares that columns explain; `None` where they nearly span one another.
    fn explained(&self, own: &[usize]) -> Option<f64> {
        if own.is_empty() {
            return Some(0.0);
        }
        let heights = DVector::from_fn(own.len(), |i, _| self.heights[own[i]]);
        Some(self.factor(own)?.solve_lower_triangular(&heights)?.norm_squared())
    }

    /// Squares that a set leaves.
    pub(super) fn left(&self, set: &[usize]) -> Option<f64> {
        Some((self.squares - self.explained(&self.columns(set))?).max(0.0))
    }

    /// How many members there are to choose from.
    pub(super) fn size(&self) -> usize {
        self.members.len()
    }

    /// Coefficients of a set's members, those of each for themselves.
    pub(super) fn coefficients(&self, set: &[usize]) -> Option<Vec<Vec<f64>>> {
        let own = self.columns(set);
        let solved = self.solved(&own)?;
        let mut values = own.iter().zip(solved.iter()).map(|(&at, x)| x / self.norms[at]);
        let of = |&at: &usize| values.by_ref().take(self.members[at].count).collect();
        Some(set.iter().map(of).collect())
    }

    /// Coefficients of columns that are brought to length 1.
    fn solved(&self, own: &[usize]) -> Option<DVector<f64>> {
        let heights = DVector::from_fn(own.len(), |i, _| self.heights[own[i]]);
        let lower = self.factor(own)?;
        lower.tr_solve_lower_triangular(&lower.solve_lower_triangular(&heights)?)
    }

    fn cost(&self, left: f64, set: &[usize]) -> f64 {
        self.cost_of(left, self.price(set))
    }

    /// What the members of a set cost, in nats.
    fn price(&self, set: &[usize]) -> f64 {
        set.iter().map(|&at| self.members[at].price).sum()
    }

    /// Twice the nats by which a set describes what is left of the data, without what its members
    /// cost and terms of the model save.
    pub(super) fn misfit(&self, set: &FoundSet) -> f64 {
        set.cost + set.saved - 2.0 * self.price(&set.members)
    }

    /// The cost of a set that leaves so many squares more without `dropped` numbers of the model.
    pub(super) fn cost_without(&self, set: &[usize], more: f64, dropped: usize) -> Option<f64> {
        let number = (self.rows.max(1) as f64).ln();
        Some(self.cost(self.left(set)? + more, set) - dropped as f64 * number)
    }

    /// Rows that go with the columns of a set, by an orthonormal basis of these: `[row][column]`.
    pub(super) fn orthonormal(&self, set: &[usize], rows: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let own = self.columns(set);
        let mut rows = rows.transpose();
        for (mut row, &at) in rows.row_iter_mut().zip(&own) {
            row /= self.norms[at];
        }
        Some(self.factor(&own)?.solve_lower_triangular(&rows)?.transpose())
    }

    /// Twice the nats of a description: what is left is the variance.
    fn cost_of(&self, left: f64, price: f64) -> f64 {
        let rows = self.rows.max(1) as f64;
        let floor = self.tuning.floor * self.squares / rows;
        let nats = (left / rows).max(floor).max(f64::MIN_POSITIVE).ln();
        rows / self.inflation * nats + 2.0 * price
    }

    /// The pool where so many residuals say as much as one independent one.
    fn counting(self, inflation: f64) -> Pool<'a> {
        Pool { inflation, ..self }
    }

    /// Sets found anew with residuals that resemble each other as those do which the best leaves,
    /// as long as the best becomes smaller: a large set leaves less that does.
    pub(super) fn counting_what_is_left(
        mut self,
        mut found: Vec<FoundSet>,
        target: &DVector<f64>,
        lengths: &[usize],
    ) -> (Pool<'a>, Vec<FoundSet>) {
        while let Some(best) = found.first().filter(|best| !best.members.is_empty()).cloned() {
            let inflation = self.inflation(&best.members, target, lengths);
            self = self.counting(inflation);
            found = self.search(&[]);
            if found.first().is_none_or(|first| first.members.len() >= best.members.len()) {
                break;
            }
        }
        (self, found)
    }

    /// How many residuals say as much as an independent one about the members of a set: how many
    /// times their variances by what it leaves of each of some stretches, of so many `lengths`, are
    /// those of independent residuals. What a law leaves of a rig resembles itself from one sample
    /// to the next.
    ///
    /// Source: H. White, Econometrica 50, 1 (1982), for sums over stretches.
    fn inflation(&self, set: &[usize], target: &DVector<f64>, lengths: &[usize]) -> f64 {
        let own = self.columns(set);
        let (Some(values), Some(lower)) = (self.solved(&own), self.factor(&own)) else {
            return self.inflation;
        };
        let columns = self.design.select_columns(&own);
        let rest = target - &columns * values;
        // An orthonormal basis of what the set does.
        let Some(basis) = lower.solve_lower_triangular(&columns.transpose()) else {
            return self.inflation;
        };
        let mut start = 0;
        let mut squares = 0.0;
        for &length in lengths {
            let score = basis.columns(start, length) * rest.rows(start, length);
            squares += score.norm_squared();
            start += length;
        }
        let variance = rest.norm_squared() / self.rows.max(1) as f64;
        let inflation = squares / own.len().max(1) as f64 / variance;
        if inflation.is_finite() { inflation.max(self.inflation) } else { self.inflation }
    }
}

/// All columns beside those of a set.
struct Beside {
    /// Their inner products with what the set leaves.
    heights: DVector<f64>,
    /// Their shadows on an orthonormal basis of the set's columns: `[basis][column]`.
    shadows: Vec<DVector<f64>>,
    /// What the set leaves of their squares.
    left: DVector<f64>,
    /// Squares that the set explains.
    explained: f64,
}

impl Beside {
    /// The inner product of the shadows of two columns.
    fn product_of_shadows(&self, i: usize, j: usize) -> f64 {
        self.shadows.iter().map(|shadow| shadow[i] * shadow[j]).sum()
    }
}

#[cfg(test)]
#[path = "gram_tests.rs"]
mod tests;
