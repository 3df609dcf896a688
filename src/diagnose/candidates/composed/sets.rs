//! Several changes at once: sets of named candidates and composed terms, chosen together.
//!
//! What any of them would do to all predictions is known along one motion (`Responses`), so all
//! stand side by side in one `Pool`, and sets of them are chosen there. The best are handed on
//! to be fitted in full; around the motion of the best of these, all is asked again.

use rustc_hash::FxHashSet;

use super::actions::Action;
use super::around::linear;
use super::entries::{Change, Entry, Motion};
use super::enumerate::enumerate;
use super::expression::Composed;
use super::first_order::{Unknown, first_order, unknowns};
use super::found_set::FoundSet;
use super::gram::Pool;
use super::idle::without_idle_terms;
use super::leaves::Leaves;
use super::library::Library;
use super::named::at_all_points;
use super::proposed::{Around, Placed, Proposed, ProposedSet};
use super::refine::refined_leaders;
use super::responses::Responses;
use super::search::Search;
use super::statements::candidate_of;
use super::states::Along;
use crate::diagnose::candidates::{Candidate, NumberChange};
use crate::diagnose::effect::RankedEffect;
use crate::diagnose::law_on_data::LawOnData;
use crate::diagnose::settling::{Settled, settle_moving};
use crate::diagnose::tuning::{self, Tuning};
use crate::error::Result;
use crate::expr::{Scope, System};
use crate::fit::column::Column;
use crate::fit::{Law, Monitor};

/// First order does not tell sets apart that leave less than so many times the squares of one
/// another, where a change is strong.
const AS_GOOD: f64 = 2.0;

/// What sets are made of.
pub struct SetSearch<'a, 'b> {
    candidates: &'b [Candidate],
    leaves: Leaves,
    terms: Vec<Composed>,
    first: Settled<'a>,
    /// Of each observable.
    spreads: Vec<f64>,
    /// Changes for which stand-ins are among the terms, and whether these were looked for around a
    /// motion that leaves noise.
    asked: Vec<(Change, bool)>,
    /// Whether sets are of named candidates alone, chosen by what counts what they leave: the law
    /// of a real rig lacks more than can be named.
    in_part: bool,
    /// Where forces act in the first look: later ones are around a motion that is near.
    along: Along,
    tuning: &'a Tuning,
}

impl<'a, 'b> SetSearch<'a, 'b> {
    /// From the model as it is and its candidates. `None` where responses are not known: under
    /// constraints, with columns that show something else than the state, in many coordinates.
    pub fn of(
        model: &LawOnData<'a>,
        candidates: &'b [Candidate],
        monitor: &dyn Monitor,
    ) -> Option<SetSearch<'a, 'b>> {
        SetSearch::in_part(model, candidates)?.along(Along::Model, monitor)
    }

    /// The same where forces act along the measured motion; `None` also where the model's is
    /// nearer to it than noise is.
    pub fn of_measured(
        model: &LawOnData<'a>,
        candidates: &'b [Candidate],
        monitor: &dyn Monitor,
    ) -> Option<SetSearch<'a, 'b>> {
        let named = SetSearch::in_part(model, candidates)?;
        let sums = &named.first.sums;
        let mut both = sums.squares.iter().zip(&sums.freedom);
        // Noise beside a misfit as large as it is doubles the squares.
        let far = both.any(|(squares, freedom)| *squares > 2.0 * freedom.max(1.0));
        if far { named.along(Along::Measured, monitor) } else { None }
    }

    /// Composed terms beside the named candidates, forces acting along a motion.
    fn along(self, along: Along, monitor: &dyn Monitor) -> Option<SetSearch<'a, 'b>> {
        monitor.stage("sets of changes", 0.65);
        let SetSearch { first, leaves, tuning, .. } = &self;
        let kept: Vec<Column> = Column::all(first.model.law.dynamics().unknowns()).collect();
        let search = Search::of(first, leaves, &kept, tuning.composed.first_spacing, along, &[]);
        if search.responses.rows == 0 {
            return None;
        }
        let library = Library::of(leaves, &search.jets, &tuning.composed);
        let variance = search.variance(search.responses.squares);
        let seen = enumerate(&library, &search.responses, variance, &tuning.composed, monitor);
        let mut terms: Vec<Composed> = refined_leaders(&search, seen.found)
            .into_iter()
            .take(tuning.sets.leading)
            .map(|(term, _)| term)
            .collect();
        for term in seen.shortest {
            if !terms.contains(&term) {
                terms.push(term);
            }
        }
        Some(SetSearch { terms, in_part: false, along, ..self })
    }

    /// The same for sets of named candidates that explain a part of what is missing.
    pub fn in_part(
        model: &LawOnData<'a>,
        candidates: &'b [Candidate],
    ) -> Option<SetSearch<'a, 'b>> {
        let tuning = model.tuning();
        let system = model.system();
        let unlike = !system.constraints.is_empty() || !system.measures.is_empty();
        if unlike || system.degrees() > tuning.sets.coordinates {
            return None;
        }
        let model = &model.thinned(model.data.most.min(tuning.scan.samples));
        Some(SetSearch {
            candidates,
            leaves: Leaves::of(model.system(), &tuning.composed),
            terms: Vec::new(),
            first: linear(model),
            spreads: model.spreads(),
            asked: Vec::new(),
            in_part: true,
            along: Along::Model,
            tuning,
        })
    }

    /// Samples of the segments that the first sets are chosen on.
    pub fn window(&self) -> usize {
        self.first.model.law.window()
    }

    /// All members side by side, around the motion of the baseline over segments so short that it
    /// follows them, or around that of a model with some changes.
    pub fn look(&mut self, around: Option<&Around<'a>>, monitor: &dyn Monitor) -> Look<'_, 'a> {
        let composed = &self.tuning.composed;
        let base = self.first.model.system().clone();
        let (search, law, unknowns) = match around {
            None => {
                let law = self.first.model.law.clone();
                let kept: Vec<Column> = Column::all(law.dynamics().unknowns()).collect();
                let spacing = composed.first_spacing;
                let search = Search::of(&self.first, &self.leaves, &kept, spacing, self.along, &[]);
                let unknowns = unknowns(&law, &kept);
                (search, law, unknowns)
            }
            Some(around) => {
                let law = around.model.law.on(&base);
                if !self.in_part {
                    self.look_for_stand_ins(around, &law, monitor);
                }
                let settled = settle_moving(around.model.clone());
                let kept = standing(&settled, &base);
                let spacing = composed.second_spacing;
                let mut search =
                    Search::of(&settled, &self.leaves, &kept, spacing, Along::Model, &[]);
                let restored = self.restored(&around.changes, &search, &law);
                search.responses.restore(&restored);
                let unknowns = unknowns(&settled.model.law, &kept);
                (search, law, unknowns)
            }
        };
        let mut terms = self.terms.clone();
        // The numbers that were fitted lie between the points of the grids.
        let mut fitted: Vec<(usize, Vec<f64>)> = Vec::new();
        for Placed { proposed, numbers, .. } in around.iter().flat_map(|around| &around.changes) {
            let inner = &numbers[numbers.len() - proposed.inner..];
            match &proposed.change {
                Change::Named(place) if self.candidates[*place].number().is_none() => {
                    fitted.push((*place, inner.to_vec()));
                }
                Change::Named(_) => {}
                Change::Composed(term) => terms.push(term.with_numbers(inner)),
            }
        }
        let motion = Motion {
            search: &search,
            law: &law,
            candidates: self.candidates,
            spreads: &self.spreads,
            // What is clear of a part is told first, a second one beside it when that stands.
            twice: !self.in_part,
            tuning: &self.tuning.sets,
        };
        let mut entries = motion.named(&fitted);
        entries.extend(motion.composed(&terms));
        let changes = around.iter().flat_map(|around| &around.changes);
        let standing: Vec<usize> =
            changes.filter_map(|change| self.nearest(change, &entries)).collect();
        let mut pool = motion.pool(&entries);
        let mut found = pool.search(&standing);
        for _ in 0..self.tuning.sets.sharpened {
            let Some(best) = found.first() else { break };
            let sharp = motion.sharpened(&entries, &best.members);
            if sharp.is_empty() {
                break;
            }
            let in_place = |&at: &usize| {
                let same = sharp.iter().position(|(own, _)| *own == at);
                same.map_or(at, |place| entries.len() + place)
            };
            let standing: Vec<usize> = best.members.iter().map(in_place).collect();
            let sharp: Vec<Entry> = sharp.into_iter().map(|(_, entry)| entry).collect();
            pool = motion.pool_with(pool, &sharp);
            entries.extend(sharp);
            found = pool.search_from(&standing, found);
        }
        if self.in_part {
            let responses = &search.responses;
            (pool, found) =
                pool.counting_what_is_left(found, &responses.target(), &responses.lengths());
        } else {
            let all = (&search.responses, &pool, &entries[..]);
            found = without_idle_terms(found, all, &law, &unknowns);
        }
        let explains = around.is_some_and(|around| around.explains);
        let responses = search.responses;
        let is_first = around.is_none();
        Look { of: self, responses, law, unknowns, entries, pool, found, explains, is_first }
    }

    /// Adds to the terms those that may stand in the place of a change of a model, or that explain
    /// most of what it leaves. Many are looked at before a part of the data; sets are made of the
    /// best of them before all.
    fn look_for_stand_ins(&mut self, around: &Around, law: &Law, monitor: &dyn Monitor) {
        let few = settle_moving(around.model.thinned(self.tuning.sets.samples));
        let mut found = Vec::new();
        if !around.explains {
            found.extend(self.in_place_of(None, &few, law, monitor));
        }
        for change in &around.changes {
            // Beside all that explains the data, other forms stand in than beside a part of it.
            let asked = (change.proposed.change.clone(), around.explains);
            if !self.asked.contains(&asked) {
                found.extend(self.in_place_of(Some(change), &few, law, monitor));
                self.asked.push(asked);
            }
        }
        for term in found {
            if !self.terms.contains(&term) {
                self.terms.push(term);
            }
        }
    }

    /// The place among `entries` of a change, at the numbers that are nearest to those it has.
    fn nearest(&self, change: &Placed, entries: &[Entry]) -> Option<usize> {
        let Placed { proposed, numbers, .. } = change;
        let inner = &numbers[numbers.len() - proposed.inner..];
        let same = |entry: &Entry| match (&proposed.change, &entry.change) {
            (Change::Named(own), Change::Named(other)) => own == other,
            (Change::Composed(own), Change::Composed(other)) => own.has_form_of(other),
            _ => false,
        };
        let apart = |entry: &Entry| -> f64 {
            inner.iter().zip(&entry.values).map(|(own, other)| (own - other).powi(2)).sum()
        };
        let alike = entries.iter().enumerate().filter(|(_, entry)| same(entry));
        let nearest = alike.min_by(|(_, a), (_, b)| apart(a).total_cmp(&apart(b)));
        nearest.map(|(place, _)| place)
    }

    /// The composed terms that explain most of what a model with some changes leaves, or of what it
    /// leaves without one of them, the others being free.
    fn in_place_of(
        &self,
        change: Option<&Placed>,
        settled: &Settled,
        law: &Law,
        monitor: &dyn Monitor,
    ) -> Vec<Composed> {
        let sets = &self.tuning.sets;
        let composed = tuning::Composed { expressions: sets.expressions, ..self.tuning.composed };
        let own = |column: &Column| change.is_some_and(|one| one.columns.contains(column));
        let kept: Vec<Column> = Column::all(settled.model.law.dynamics().unknowns())
            .filter(|column| !own(column))
            .collect();
        let mut search =
            Search::of(settled, &self.leaves, &kept, composed.first_spacing, Along::Model, &[]);
        if search.responses.rows == 0 || monitor.stopped() {
            return Vec::new();
        }
        let restored = self.restored(change, &search, law);
        search.responses.restore(&restored);
        let library = Library::of(&self.leaves, &search.jets, &composed);
        let variance = search.variance(search.responses.squares);
        let seen = enumerate(&library, &search.responses, variance, &composed, monitor);
        let terms = refined_leaders(&search, seen.found);
        let most = if change.is_some() { sets.instead } else { sets.beside };
        terms.into_iter().take(most).map(|(term, _)| term).collect()
    }

    /// What changes of a model do along its motion.
    fn restored<'p>(
        &self,
        changes: impl IntoIterator<Item = &'p Placed>,
        search: &Search,
        law: &Law,
    ) -> Vec<(f64, Action)> {
        let Responses { points, channels, .. } = &search.responses;
        let mut all = Vec::new();
        for Placed { proposed, numbers, .. } in changes {
            let (coefficients, inner) = numbers.split_at(numbers.len() - proposed.inner);
            match &proposed.change {
                Change::Named(place) => {
                    let candidate = &self.candidates[*place];
                    let grid = [inner.to_vec()];
                    let found = at_all_points(candidate, &grid, law, points, *channels);
                    let actions = found.into_iter().flat_map(|one| one.actions);
                    match candidate.number() {
                        // The change of a number is what its first-order action is times.
                        Some(number) => {
                            let by = inner.first().map_or(0.0, |value| value - number.value);
                            all.extend(actions.map(|action| (by, action)));
                        }
                        None => all.extend(coefficients.iter().copied().zip(actions)),
                    }
                }
                Change::Composed(term) => {
                    let action = term.with_numbers(inner).action(&search.jets.nodes, *channels);
                    all.extend(coefficients.first().map(|&c| (c, action)));
                }
            }
        }
        all
    }
}

/// Sets chosen around one motion.
pub struct Look<'s, 'a> {
    of: &'s SetSearch<'a, 's>,
    responses: Responses,
    /// The model as it is, with the numbers that it has there, and its unknowns.
    law: Law,
    unknowns: Vec<Unknown>,
    entries: Vec<Entry>,
    pool: Pool<'a>,
    found: Vec<FoundSet>,
    /// Whether the motion leaves noise.
    explains: bool,
    /// Whether it is that of the baseline.
    is_first: bool,
}

impl Look<'_, '_> {
    /// The best sets, the best first.
    ///
    /// # Errors
    ///
    /// When a member makes no sense in the spec.
    pub fn proposed(&self, scope: &Scope) -> Result<Vec<ProposedSet>> {
        let Look { responses, law, unknowns, entries, pool, found, .. } = self;
        let tuning = self.of.tuning;
        let mut sets = Vec::new();
        let mut taken: Vec<&FoundSet> = Vec::new();
        let is_far = self.of.along == Along::Measured;
        // Noisy data are asked for larger sets only around a motion that is near: here, far from
        // the truth, they explain by accident.
        let by_size =
            self.is_first && !self.of.in_part && (is_far || self.of.first.model.is_computed());
        let best_of_sizes;
        let found = if by_size {
            best_of_sizes = self.best_of_sizes();
            &best_of_sizes
        } else {
            found
        };
        let mut rivals = if self.explains { self.rivals() } else { Vec::new() };
        if self.explains && !self.of.in_part {
            rivals.extend(self.smaller().cloned());
        }
        let leaders = found.iter().filter(|one| !one.members.is_empty()).map(|one| (one, false));
        let mut leading = 0;
        for (one, rival) in leaders.chain(rivals.iter().map(|one| (one, true))) {
            // Around a motion that leaves noise, first order says what a set is worth.
            let leads = !self.explains || self.may_lead(one);
            let enough = !by_size && leading == tuning.sets.proposed;
            if !rival && (enough || !leads) {
                continue;
            }
            // What holds a better set says nothing else: its other members come later, if at all.
            if !by_size && taken.iter().any(|better| pool.holds(one, better)) {
                continue;
            }
            let Some(members) = self.written(scope, one)? else { continue };
            let law = first_order(responses, pool, entries, one, law, unknowns)?;
            let FoundSet { cost, saved, .. } = *one;
            sets.push(ProposedSet { members, law, cost, saved, rival });
            taken.push(one);
            leading += usize::from(!rival);
        }
        Ok(sets)
    }

    /// The best set of each smaller size, the largest first: the more of what a motion was fitted
    /// with is taken away, the more first order is wrong about what is left, and the members of a
    /// wrong set make up for one another.
    fn smaller(&self) -> impl Iterator<Item = &FoundSet> {
        let largest = self.found.first().map_or(0, |best| best.members.len());
        (1..largest)
            .rev()
            .filter_map(|size| self.found.iter().find(|one| one.members.len() == size))
    }

    /// The best set with a member that has inner numbers exchanged for another form that leaves as
    /// little, with no more numbers: such forms bend to one another.
    fn rivals(&self) -> Vec<FoundSet> {
        let Look { responses, law, unknowns, entries, pool, .. } = self;
        let Some(best) = self.found.first() else { return Vec::new() };
        let (sets, ranking) = (&self.of.tuning.sets, &self.of.tuning.ranking);
        let numbers = |at: usize| entries[at].responses.len() + entries[at].values.len();
        let shaped = best.members.iter().filter(|&&own| !entries[own].values.is_empty());
        let found = shaped.flat_map(|&own| {
            let simple = |at: usize| numbers(at) <= numbers(own);
            pool.exchanges(best, own, (sets.rivals, ranking.indistinguishable), simple)
        });
        without_idle_terms(found.collect(), (responses, pool, &entries[..]), law, unknowns)
    }

    /// Whether a set that is fitted may come out first: it is hardly behind the best, or behind for
    /// what it costs and leaves less.
    fn may_lead(&self, set: &FoundSet) -> bool {
        let (sets, ranking) = (&self.of.tuning.sets, &self.of.tuning.ranking);
        self.found.first().is_none_or(|best| {
            let behind = set.cost - best.cost;
            let leaves_less = self.pool.misfit(best) - self.pool.misfit(set) > ranking.same;
            behind <= ranking.indistinguishable || behind <= sets.near && leaves_less
        })
    }

    /// The best set of each size up to that of the best, with the simplest that does nearly the
    /// same, and beside them some of the best; along the measured motion those of all sizes and no
    /// others. First order may be far from what a strong change does, and then bends to that.
    fn best_of_sizes(&self) -> Vec<FoundSet> {
        let (largest, beside) = match self.of.along {
            Along::Model => {
                let largest = self.found.first().map_or(0, |best| best.members.len());
                (largest, self.of.tuning.sets.proposed / 2)
            }
            Along::Measured => (usize::MAX, 0),
        };
        let mut sizes = FxHashSet::default();
        let of_sizes = self
            .found
            .iter()
            .filter(|one| one.members.len() <= largest && sizes.insert(one.members.len()));
        let mut all: Vec<FoundSet> = Vec::new();
        for one in of_sizes {
            let simpler = [AS_GOOD, f64::INFINITY].map(|times| self.pool.simplest(one, times));
            for set in [Some(one.clone())].into_iter().chain(simpler).flatten() {
                if all.iter().all(|other| other.members != set.members) {
                    all.push(set);
                }
            }
        }
        let known: FxHashSet<Vec<usize>> = all.iter().map(|one| one.members.clone()).collect();
        let others = self.found.iter().take(beside).filter(|one| !known.contains(&one.members));
        all.extend(others.cloned());
        all
    }

    /// A set as changes to a spec, each in the scope of those before it; `None` where the language
    /// does not take a term beside the others, or where they nearly span one another.
    fn written(&self, scope: &Scope, found: &FoundSet) -> Result<Option<Vec<Proposed>>> {
        let Look { entries, pool, .. } = self;
        let SetSearch { candidates, leaves, .. } = self.of;
        let Some(coefficients) = pool.coefficients(&found.members) else { return Ok(None) };
        let mut scope = scope.clone();
        let mut all = Vec::new();
        let is_second = |at: usize| {
            let own = &entries[at];
            let before = |one: &Entry| one.change == own.change && one.values < own.values;
            found.members.iter().any(|&other| before(&entries[other]))
        };
        let mut members: Vec<(usize, Vec<f64>)> =
            found.members.iter().copied().zip(coefficients).collect();
        members.sort_by_key(|(at, _)| is_second(*at));
        for (at, coefficients) in members {
            let entry = &entries[at];
            let own;
            let (candidate, named) = match &entry.change {
                Change::Named(place) => {
                    let first = &candidates[*place];
                    let second = first.second.as_deref().filter(|_| is_second(at));
                    (second.unwrap_or(first), true)
                }
                Change::Composed(term) => {
                    let terms = std::slice::from_ref(term);
                    let Some(found) = candidate_of(&mut scope, leaves, terms, false) else {
                        return Ok(None);
                    };
                    own = found;
                    (&own, false)
                }
            };
            let change = coefficients.first().copied().unwrap_or(0.0);
            let (numbers, inner) = match candidate.start_of_number(change) {
                Some(value) => (vec![value], 1),
                None => {
                    let inner = entry.values.len();
                    (coefficients.iter().chain(&entry.values).copied().collect(), inner)
                }
            };
            let values = &numbers[numbers.len() - inner..];
            let effect = RankedEffect {
                effect: candidate.label.clone(),
                on: candidate.on.clone(),
                snippet: candidate.snippet(values),
                number: candidate.number().map(NumberChange::of),
                left_out: candidate.left_out().cloned(),
                standard_error: vec![f64::NAN; numbers.len()],
                coefficient: numbers,
                p_value: 1.0,
                tests: pool.size() as f64,
                deviance: 0.0,
                held_out_error_before: f64::NAN,
                held_out_error_after: f64::NAN,
                indistinguishable: Vec::new(),
            };
            // Between the points of a grid may lie what the language does not take.
            let Ok(with) = effect.added_to(&scope) else { return Ok(None) };
            scope = with;
            let (price, positive) = (entry.price, candidate.is_positive());
            let (change, kind) = (entry.change.clone(), entry.kind);
            let ranges = candidate.ranges(&self.of.tuning.ranking);
            all.push(Proposed { effect, inner, ranges, price, named, positive, change, kind });
        }
        Ok(Some(all))
    }
}

/// Columns of the unknowns of a model that the system `base` has, too.
fn standing(settled: &Settled, base: &System) -> Vec<Column> {
    let law = &settled.model.law;
    let dynamics = law.dynamics();
    let terms = dynamics.active().iter().enumerate();
    let terms = terms.filter(|(_, id)| id.position() < base.terms.len()).map(|(at, _)| at);
    let count = dynamics.active().len();
    let inner = dynamics.parameters().iter().enumerate();
    let inner = inner.filter(|(_, id)| id.position() < base.parameters.len());
    terms.chain(inner.map(|(at, _)| count + at)).map(Column::new).collect()
}
