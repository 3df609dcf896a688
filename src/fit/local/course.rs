//! The course of a fit by sparse algebra.
//!
//! Every pass linearises by the whole function space. The support is searched on what it leaves,
//! theta goes to the solution, and the next pass begins there, until neither changes. As in
//! [`train`](super::super::train), the noise and the integrator follow from round to round, and
//! segments grow for as long as the model follows them.

use std::sync::Arc;

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::super::column::Column;
use super::super::conclude::{Findings, record, sentence, variance};
use super::super::criterion::Criterion;
use super::super::factor::Factor;
use super::super::gauss_newton::{Refit, StopReason, invisible};
use super::super::model::Model;
use super::super::monitor::Monitor;
use super::super::options::{Options, Selection, Trainer};
use super::super::pass::{Linearised, Sums};
use super::super::round::Round;
use super::super::states::States;
use super::super::support::{Columns, SupportFit, SupportSearch};
use super::super::train::Training;
use super::super::tuning::LocalTuning;
use super::super::uncertainty::Unlearnable;
use super::normal::Normal;
use super::pass::{Quadratic, Tails, pass, tails};
use super::plan::{Plan, share_of_dense};
use super::search::{Found, Space, State};
use crate::data::Dataset;
use crate::dynamics::{Couplings, Dynamics, MethodKind};
use crate::error::Result;
use crate::expr::{System, TermId};

/// Learns a system whose couplings are local; `None` where they are not, or where the data hardly
/// tell unknowns apart: the dense factor has to look then.
///
/// # Errors
///
/// As [`fit`](super::super::fit).
pub(in super::super) fn learn(
    system: &Arc<System>,
    dataset: &Dataset,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Option<Model>> {
    if !may_be_local(system, options) {
        return Ok(None);
    }
    let training = Training::new(system, dataset, options)?;
    let (whole, _) = training.compile_whole();
    let method = training.law().stepping().method;
    let splits = matches!(method.row().kind, MethodKind::Splitting(_));
    if !splits || !whole.separable() || !whole.shows_state(system.observed) {
        return Ok(None);
    }
    let columns = training.columns(&whole);
    let couplings = Arc::new(whole.couplings());
    let course = Course::new(training, (whole, columns, couplings), monitor);
    let tuning = &options.tuning.local;
    for finer in [1.0, tuning.finer.sqrt(), tuning.finer] {
        let mut course = course.with(finer);
        if let Some(end) = course.train()? {
            return Ok(Some(course.conclude(end)));
        }
    }
    Ok(None)
}

/// Whether a system is one that sparse algebra may pay for.
fn may_be_local(system: &System, options: &Options) -> bool {
    let free = system.terms.iter().all(|term| term.bounds.is_free());
    let tuning = &options.tuning.local;
    system.degrees() >= tuning.degrees
        && free
        && (1..=tuning.terms).contains(&system.terms.len())
        && system.parameters.is_empty()
        && system.inputs.is_empty()
        && system.hidden.is_empty()
        && system.constraints.is_empty()
        && system.observables().len() == 2 * system.degrees()
        && options.trainer == Trainer::GaussNewton
        && options.selection == Selection::Information
        && options.loss.is_squares()
}

/// A fit under way.
#[derive(Clone)]
struct Course<'a> {
    training: Training<'a>,
    columns: Columns,
    whole: Arc<Dynamics>,
    monitor: &'a dyn Monitor,
    couplings: Arc<Couplings>,
    plan: Option<Arc<Plan>>,
    /// What is left out, as a part of what usually is.
    finer: f64,
    /// Whether a pass was stopped on its way.
    cut: bool,
    /// What a step promised over what the one before it had, on the same support: how much is left
    /// after a step. One where it is not known.
    contraction: f64,
}

/// A pass at a theta.
struct Passed {
    theta: Vec<f64>,
    /// Where the folds were linearised: theta, but for a last small step.
    at: Vec<f64>,
    plan: Arc<Plan>,
    folds: Vec<Quadratic>,
    normal: Normal,
    sums: Sums,
    /// Segments that it went over.
    of: usize,
}

/// Where rounds ended.
struct End {
    passed: Passed,
    stop: StopReason,
    iterations: usize,
    noise: Vec<f64>,
}

impl<'a> Course<'a> {
    fn new(
        training: Training<'a>,
        (whole, columns, couplings): (Arc<Dynamics>, Columns, Arc<Couplings>),
        monitor: &'a dyn Monitor,
    ) -> Course<'a> {
        let (finer, contraction, cut) = (1.0, 1.0, false);
        let plan = None;
        Course { training, columns, whole, monitor, couplings, plan, finer, cut, contraction }
    }

    fn with(&self, finer: f64) -> Course<'a> {
        Course { finer, plan: None, ..self.clone() }
    }

    fn tuning(&self) -> &'a LocalTuning {
        &self.training.options.tuning.local
    }

    fn train(&mut self) -> Result<Option<End>> {
        self.monitor.stage("searching the function space", 0.2);
        let part = self.training.options.tuning.course.first_segments;
        let end = if self.segments() >= 2 * part {
            // A part of the segments brings the model near.
            let states = std::mem::take(&mut self.training.states);
            let segments = self.training.thin(part);
            let Some(rough) = self.rounds(None)? else { return Ok(None) };
            if rough.stop == StopReason::Interrupted {
                return Ok(Some(rough));
            }
            let part = self.clone();
            self.training.segments = segments;
            self.training.states = states;
            let end = self.rounds(Some(rough))?;
            if self.cut && end.as_ref().is_some_and(|end| end.passed.of < self.segments()) {
                // Not one pass over all of them was made: the model of a part is what there is.
                *self = part;
                return Ok(end);
            }
            end
        } else {
            self.rounds(None)?
        };
        let Some(mut end) = end else { return Ok(None) };
        let longest = self.training.measured.longest_run();
        let longest = longest.min(self.training.options.tuning.course.longest);
        while self.training.options.window.is_none()
            && self.training.law().window() < longest
            && end.stop != StopReason::Interrupted
        {
            let window = (2 * self.training.law().window()).min(longest);
            let fraction = 0.4 + 0.5 * window as f64 / longest as f64;
            self.monitor.stage(&format!("segments of {window} samples"), fraction);
            let mut longer = self.clone();
            longer.training.recut(window)?;
            let Some(next) = longer.rounds(None)? else {
                if longer.cut {
                    end.stop = StopReason::Interrupted;
                }
                break;
            };
            let tuning = &self.training.options.tuning.course;
            let before = self.training.law().noise().iter();
            let resolution = &longer.training.accuracy.resolution;
            let allowed = before
                .zip(resolution)
                .map(|(old, floor)| tuning.follows * old.max(tuning.above_resolution * floor));
            let follows = longer.training.law().noise().iter().zip(allowed).all(|(a, b)| *a <= b);
            if !follows || next.passed.sums.diverged > end.passed.sums.diverged {
                break;
            }
            *self = longer;
            end = next;
        }
        let (law, accuracy) = (self.training.law.clone(), self.training.accuracy.clone());
        if end.stop != StopReason::Interrupted && self.training.integrate_for_result() {
            let noise = self.training.law().noise().to_vec();
            if let Some(last) = self.refit(noise, true) {
                self.take_noise(&last);
                end = last;
            } else if self.cut {
                (self.training.law, self.training.accuracy) = (law, accuracy);
                end.stop = StopReason::Interrupted;
            } else {
                return Ok(None);
            }
        }
        Ok(Some(end))
    }

    fn take_noise(&mut self, end: &End) {
        let unknowns = self.training.law().support().len();
        let estimate = self.training.noise_estimate(&end.passed.sums, unknowns);
        self.training.law.set_noise(estimate);
    }

    fn segments(&self) -> usize {
        self.training.segments.list.len()
    }

    /// Rounds until the support and the noise stand still; `last` is where earlier ones ended,
    /// which counts where these are stopped before they have come to anything.
    fn rounds(&mut self, mut last: Option<End>) -> Result<Option<End>> {
        let tuning = &self.training.options.tuning.rounds;
        let mut rounds = 0;
        loop {
            let before_it = self.training.law.clone();
            let before = self.training.law().support().to_vec();
            let stepping = self.training.law().stepping();
            let noise = self.training.law().noise().to_vec();
            let Some(end) = self.refit(noise.clone(), last.is_some()) else {
                if !self.cut {
                    return Ok(None);
                }
                self.training.law = before_it;
                return Ok(last.map(|end| End { stop: StopReason::Interrupted, ..end }));
            };
            rounds += 1;
            self.training.rounds += 1;
            self.take_noise(&end);
            let same = self.training.law().support() == before;
            let now = self.training.law().noise();
            let pairs = || now.iter().zip(&noise);
            let still = pairs().all(|(a, b)| (a / b).ln().abs() < tuning.noise_steady.ln());
            let chosen = self.training.accuracy.error.iter().all(|error| error.is_finite());
            let resolution = &self.training.accuracy.resolution;
            let quiet = pairs().zip(resolution).all(|((a, b), floor)| {
                let least = tuning.above_resolution * floor;
                a.max(least) < tuning.noise_steady * b.max(least)
            });
            if !(chosen && still && same) {
                self.training.sharpen();
            }
            let done = same && quiet && stepping == self.training.law().stepping();
            let interrupted = end.stop == StopReason::Interrupted;
            if done || rounds >= tuning.most || interrupted {
                return Ok(Some(end));
            }
            last = Some(end);
        }
    }

    /// Gauss-Newton with the support searched anew in every step, for the present noise. Its first
    /// pass may be stopped if there is something to keep without it, `may_stop`.
    fn refit(&mut self, noise: Vec<f64>, may_stop: bool) -> Option<End> {
        let tuning = &self.training.options.tuning.refit;
        let mut here = self.pass(self.training.law().theta(&self.whole), may_stop)?;
        let mut support: Vec<usize> = self.training.law().positions();
        let mut iterations = 0;
        let mut before: Option<f64> = None;
        let stop = loop {
            let found = self.searched(&here, |state| state.found())?;
            let change: Vec<f64> =
                found.theta.iter().zip(&here.theta).map(|(new, old)| new - old).collect();
            let slope: f64 = change.iter().zip(&here.normal.slopes).map(|(d, v)| d * v).sum();
            let pull = here.normal.times(&change);
            let bend: f64 = change.iter().zip(&pull).map(|(d, x)| d * x).sum();
            let floor = (self.training.floor(), tuning.rounding);
            let moved = (2.0 * slope - bend).abs().max(bend);
            let same = found.support == support;
            if same && invisible(moved, tuning.converged.into(), &here.sums, floor) {
                break StopReason::Converged;
            }
            if let Some(before) = before.filter(|_| same) {
                self.contraction = (moved / before).min(1.0);
            }
            let small = moved <= self.tuning().unconfirmed * here.sums.loss;
            let rest = moved * self.contraction;
            if same && small && invisible(rest, tuning.converged.into(), &here.sums, floor) {
                // Nothing would be left to do after this step: no pass need confirm it.
                here.normal.slopes.iter_mut().zip(&pull).for_each(|(slope, x)| *slope -= x);
                here.sums.loss -= 2.0 * slope - bend;
                here.theta = found.theta;
                break StopReason::Converged;
            }
            before = same.then_some(moved);
            // A first step must be made: before it there is nothing to keep.
            if !support.is_empty() && self.monitor.stopped() {
                break StopReason::Interrupted;
            }
            if iterations == tuning.iterations {
                break StopReason::IterationLimit;
            }
            iterations += 1;
            let Some(next) = self.step(&here, &support, &found, &change) else {
                if !self.cut {
                    return None;
                }
                break StopReason::Interrupted;
            };
            let Some(next) = next else {
                let stopped = self.monitor.stopped();
                break if stopped { StopReason::Interrupted } else { StopReason::NoProgress };
            };
            here = next;
            support = found.support;
            self.set_support(&support, &here.theta);
        };
        self.set_support(&support, &here.theta);
        Some(End { passed: here, stop, iterations, noise })
    }

    /// The pass at the end of a step that pays, shortened where it has to be; outer `None` where
    /// normal equations will not do, inner where no step pays.
    fn step(
        &mut self,
        here: &Passed,
        support: &[usize],
        found: &Found,
        change: &[f64],
    ) -> Option<Option<Passed>> {
        let tuning = &self.training.options.tuning;
        let mut length = 1.0;
        while length >= tuning.settling.shortest {
            let theta = here.theta.iter().zip(change).map(|(x, d)| x + length * d).collect();
            let next = self.pass(theta, !support.is_empty())?;
            let space = self.space(here);
            let before = space.criterion_of(support, here.sums.loss);
            let after = space.criterion_of(&found.support, next.sums.loss);
            let sane = next.sums.diverged <= here.sums.diverged && next.sums.loss.is_finite();
            let fewer = next.sums.diverged < here.sums.diverged;
            if sane && (fewer || after < before + tuning.support.same_loss) {
                return Some(Some(next));
            }
            if self.monitor.stopped() {
                break;
            }
            length *= tuning.settling.shorter;
        }
        Some(None)
    }

    fn set_support(&mut self, support: &[usize], theta: &[f64]) {
        let ids = self.training.system().term_ids();
        let terms: Vec<(TermId, f64)> = support.iter().map(|&k| (ids[k], theta[k])).collect();
        self.training.law.set_support(&terms);
    }

    fn space<'b>(&'b self, passed: &'b Passed) -> Space<'b> {
        Space {
            normal: &passed.normal,
            order: &[],
            columns: &self.columns,
            criterion: Criterion { floor: self.training.floor() },
            theta: &passed.theta,
            loss: passed.sums.loss,
            rows: passed.sums.rows,
            sparse: self.training.options.sparse,
            least_pivot: self.finer * self.tuning().response * self.tuning().apart,
        }
    }

    /// What `look` sees of the best support on a pass; `None` where normal equations will not do.
    fn searched<T>(&self, passed: &Passed, look: impl FnOnce(&State) -> T) -> Option<T> {
        let order = order(&passed.plan, self.whole.unknowns());
        let space = Space { order: &order, ..self.space(passed) };
        Some(look(&space.search()?))
    }

    /// A pass at a theta, with patterns that reach far enough for it; `None` where these would be
    /// no cheaper than all of it, or numbers are not finite, or it was stopped, `cut`.
    fn pass(&mut self, theta: Vec<f64>, may_stop: bool) -> Option<Passed> {
        let weights = self.training.weights();
        let law = (&*self.whole, &theta[..]);
        let mut states = std::mem::take(&mut self.training.states);
        let problem = self.training.problem(&weights);
        let tuning = self.tuning();
        let unknowns = self.whole.unknowns();
        let new = |reach: usize, halo: usize| {
            let share = share_of_dense(&self.couplings, unknowns, reach, halo);
            let pays = share <= tuning.share;
            pays.then(|| Arc::new(Plan::new(&self.whole, reach, halo)))
        };
        let mut plan = match &self.plan {
            Some(plan) => plan.clone(),
            None => new(tuning.reach, tuning.reach + 1)?,
        };
        let mut probe = true;
        let folds = loop {
            let mut folds = Vec::new();
            let found = if probe {
                tails(&problem, &plan, law, &states)
            } else {
                let stopped = || may_stop && self.monitor.stopped();
                let Some(passed) = pass(&problem, &plan, law, &mut states, &stopped) else {
                    self.cut = true;
                    self.training.states = states;
                    return None;
                };
                folds = passed;
                folds.iter().fold(Tails::default(), |all, fold| all.with(fold.tails))
            };
            let margin = self.finer * if probe { 1.0 } else { tuning.margin };
            let far = found.reach > tuning.negligible * margin;
            let wide = found.halo > tuning.response * margin;
            let most = tuning.farthest;
            if !(far && plan.reach < most || wide && plan.halo < 2 * most) {
                if !probe {
                    break folds;
                }
                probe = false;
                continue;
            }
            let reach = plan.reach + usize::from(far && plan.reach < most);
            let halo = plan.halo + usize::from(wide && plan.halo < 2 * most);
            plan = new(reach, halo)?;
        };
        let mut sums = Sums::new(weights.len());
        folds.iter().for_each(|fold| sums.add(&fold.sums));
        let normal = Normal::of(&plan, unknowns, folds.iter().map(|fold| (fold, 1.0)));
        self.plan = Some(plan.clone());
        self.training.states = states;
        let at = theta.clone();
        let of = self.segments();
        normal.is_finite().then_some(Passed { theta, at, plan, folds, normal, sums, of })
    }

    /// The model of where rounds ended.
    fn conclude(&self, end: End) -> Model {
        let (training, system) = (&self.training, self.training.system());
        let tuning = &training.options.tuning.conclusion;
        let End { passed, stop, iterations, noise } = end;
        let support = training.law().positions();
        let found =
            self.searched(&passed, |state| (state.found(), state.rivals(tuning.runners_up)));
        let mut tried = 1;
        let own = Found {
            theta: passed.theta.clone(),
            squares: passed.sums.loss,
            criterion: self.space(&passed).criterion_of(&support, passed.sums.loss),
            support: support.clone(),
            tried: 1,
        };
        let mut candidates = vec![candidate(&own)];
        if let Some((best, rivals)) = found {
            tried = best.tried;
            if best.support == support {
                candidates = std::iter::once(&best).chain(&rivals).map(candidate).collect();
            }
        }
        let order: Vec<usize> = order(&passed.plan, self.whole.unknowns());
        let order = order.into_iter().filter(|k| support.binary_search(k).is_ok()).collect();
        let factor = passed.normal.factor(order);
        let inverse = factor.inverse();
        let size = support.len();
        let place = |k: &usize| factor.unknowns.iter().position(|other| other == k);
        let places: Vec<usize> = support.iter().filter_map(place).collect();
        let frequency = self.inclusion(&passed, &places, &inverse);
        let untouched = (0..passed.theta.len()).filter(|&k| passed.normal.diagonal[k] == 0.0);
        let untouched = untouched.map(|k| Unlearnable::Untouched { column: Column::new(k) });
        let unlearnable =
            untouched.filter_map(|open| sentence(system, &open, tuning.spelled_out)).collect();
        let refit = Refit {
            theta: support.iter().map(|&k| passed.theta[k]).collect(),
            states: States::default(),
            linearised: Linearised {
                folds: Vec::new(),
                sums: passed.sums,
                responses: None,
                eliminated: Vec::new(),
            },
            iterations,
            stop,
        };
        let round = Round {
            search: SupportSearch { candidates, path: Vec::new(), supports_tried: tried },
            refit,
            folds: Vec::new(),
            merged: Factor::new(0),
            columns: self.columns.clone(),
            criterion: Criterion { floor: training.floor() },
            predicted: true,
            noise,
        };
        let variance = variance(&round);
        let entry = |a: usize, b: usize| {
            let of = |a: usize, b: usize| variance * inverse[places[a] * size + places[b]];
            // Beyond what derivatives were cut off at, it is not known that it is not zero.
            let least = self.finer * self.tuning().response;
            let known = of(a, b).abs() > least * (of(a, a) * of(b, b)).sqrt();
            if known { of(a, b) } else { 0.0 }
        };
        let covariance = DMatrix::from_fn(size, size, entry);
        let law = training.law().clone().with_covariance_of(&[], &covariance);
        let (alternatives, distributions) = (Vec::new(), Vec::new());
        let found = Findings { law, frequency, alternatives, unlearnable, distributions };
        record(training, &round, found)
    }

    /// How often each term of the support is kept when the data are resampled: the folds are drawn
    /// with replacement, and the support is solved for anew.
    fn inclusion(&self, passed: &Passed, places: &[usize], inverse: &[f64]) -> Option<Vec<f64>> {
        if passed.folds.len() < 2 {
            return None;
        }
        let support = self.training.law().positions();
        let tuning = &self.training.options.tuning.conclusion;
        let (unknowns, size) = (self.whole.unknowns(), support.len());
        let mut frequency = vec![0.0; unknowns];
        let space = self.space(passed);
        let mut generator = Pcg64::seed_from_u64(self.training.options.seed);
        let mut draw = || {
            let mut times = vec![0.0; passed.folds.len()];
            for _ in 0..times.len() {
                times[generator.random_range(0..passed.folds.len())] += 1.0;
            }
            times
        };
        let draws: Vec<Vec<f64>> = (0..tuning.draws).map(|_| draw()).collect();
        let mut order = vec![0; size];
        places.iter().zip(&support).for_each(|(&place, &k)| order[place] = k);
        let kept = |times: &Vec<f64>| {
            let folds = passed.folds.iter().zip(times.iter().copied());
            let drawn = Normal::of(&passed.plan, unknowns, folds);
            let factor = drawn.factor(order.clone());
            if factor.least.is_nan() || factor.least <= 0.0 {
                return Vec::new();
            }
            let mut change: Vec<f64> = order.iter().map(|&k| drawn.slopes[k]).collect();
            factor.solve(&mut change, 0);
            let is_kept = |&(&k, &place): &(&usize, &usize)| {
                let value = passed.at[k] + change[place];
                let growth = value * value / inverse[place * size + place];
                space.pays(k, growth)
            };
            support.iter().zip(places).filter(is_kept).map(|(&k, _)| k).collect()
        };
        let kept: Vec<Vec<usize>> = draws.par_iter().map(kept).collect();
        let sound = kept.iter().filter(|kept| !kept.is_empty()).count().max(1);
        kept.into_iter().flatten().for_each(|k| frequency[k] += 1.0 / sound as f64);
        Some(frequency)
    }
}

/// As the search on a factor would have it.
fn candidate(found: &Found) -> SupportFit {
    let value = |&k: &usize| (Column::new(k), found.theta[k]);
    SupportFit {
        support: found.support.iter().map(|&k| Column::new(k)).collect(),
        values: found.support.iter().map(value).collect(),
        squares: found.squares,
        criterion: found.criterion,
    }
}

/// Unknowns in the order of the places where they act: from the end of the graph inwards.
fn order(plan: &Plan, unknowns: usize) -> Vec<usize> {
    let couplings = &plan.couplings;
    let sites = couplings.neighbours.len();
    let mut rank = vec![usize::MAX; sites];
    let mut next = 0;
    while let Some(start) = rank.iter().position(|&rank| rank == usize::MAX) {
        // The site that is farthest from any other is at an end.
        let last = couplings.around(&[start], sites).last().map_or(start, |&(site, _)| site);
        for (site, _) in couplings.around(&[last], sites) {
            rank[site] = next;
            next += 1;
        }
    }
    let mut first = vec![(0, usize::MAX); unknowns];
    for piece in &couplings.pieces {
        let (pieces, place) = &mut first[piece.unknown];
        *pieces += 1;
        let own = piece.sites.iter().map(|&site| rank[site]).min().unwrap_or(0);
        *place = own.min(*place);
    }
    let mut order: Vec<usize> = (0..unknowns).collect();
    // What acts everywhere comes last.
    order.sort_by_key(|&k| (first[k].0 > 1, first[k].1, k));
    order
}
