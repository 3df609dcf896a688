//! The trainer: proximal Gauss-Newton over the whole function space.
//!
//! A round linearises the integrator map by every term at the present model, searches the
//! support on the triangular factor, and refits the winner to convergence. Rounds go on
//! until the refit finds what the factor predicted of the support and the noise stands still;
//! the integrator is made as accurate as the noise asks for.

use std::collections::HashMap;
use std::sync::Arc;

use super::column::Column;
use super::compiled::Compiled;
use super::criterion::{Criterion, choice_costs, complexity};
use super::curve::identifiable;
use super::driving::OwnInputs;
use super::factor::Factor;
use super::gauge;
use super::gauss_newton::{LeastGain, Refit, StopReason, invisible, refit};
use super::law::Law;
use super::masses::first_masses;
use super::monitor::{Monitor, Silent};
use super::options::Options;
use super::own_values::is_said;
use super::pass::{Linearised, Problem, Sums, settle_and_linearise};
use super::per_run::medians;
use super::scales::{fewest_samples, measurable, nothing_left, scales, spreads};
use super::segments::{Reach, Segment, Segments, cut, packed};
use super::states::States;
use super::stepping::{self, Accuracy, Choice};
use super::stream::Stream;
use super::support::{self, Columns, SearchProblem, SupportFit};
use super::tuning::RefitTuning;
use crate::data::{Dataset, Packed};
use crate::dynamics::Dynamics;
use crate::error::{Error, ErrorKind, Result};
use crate::expr::{Bounds, ParameterId, Symbol, System, TermId};

pub use super::round::{Extent, Round};

/// A model under training, with everything that the next round starts from.
#[derive(Clone)]
pub struct Training<'a> {
    /// What is learned: the present model.
    pub(super) law: Law,
    /// What it is learned from.
    pub measured: Arc<Packed>,
    /// How it is learned.
    pub options: &'a Options,
    /// Segments of the current round.
    pub segments: Segments,
    /// Initial states of the segments.
    pub states: States,
    /// Spread of each observable's measurements (1 where there are none).
    pub spread: Vec<f64>,
    /// What the integrator of the current round can resolve.
    pub accuracy: Accuracy,
    /// Whether every term of the function space leaves H = T(p) + V(q).
    pub separable: bool,
    /// Rounds that were made.
    pub rounds: usize,
    /// How far the search for the support looks.
    pub extent: Extent,
    /// All data, where they are larger than memory; `measured` is then a sample of them.
    pub stream: Option<&'a Stream<'a>>,
    /// Whether the next round first learns the noise from many of its segments: what is known of
    /// it comes from few.
    pub(super) reweigh: bool,
    /// What rounding does to each observable.
    pub(super) rounding: Vec<f64>,
    /// Terms that were left out for what they do is below the precision of the data.
    pub(super) below_precision: Vec<TermId>,
    compiled: Compiled,
}

/// Segments, if there are any.
fn not_empty(segments: Segments) -> Result<Segments> {
    if segments.list.is_empty() {
        return Err(Error::new(
            ErrorKind::InsufficientData,
            "the data have no two samples close enough in time to learn from",
            "check the time column and its unit",
        ));
    }
    Ok(segments)
}

impl<'a> Training<'a> {
    /// Starts from nothing: no term, parameters at their start values.
    ///
    /// # Errors
    ///
    /// When no coordinate is measured, or no two samples are near enough in time.
    pub fn new(system: &Arc<System>, dataset: &Dataset, options: &'a Options) -> Result<Self> {
        let compile = || Compiled::whole(system, options);
        let (measured, compiled) =
            rayon::join(|| packed(dataset, &options.tuning.segments), compile);
        Training::begin(system, Arc::new(measured), options, compiled)
    }

    /// Starts from a law, of measurements that are packed already: its terms and numbers, its
    /// noise and its steps are the first, and the segments as long as the options say.
    ///
    /// # Errors
    ///
    /// As [`Training::new`].
    pub fn from_law(law: &Law, measured: Arc<Packed>, options: &'a Options) -> Result<Self> {
        let mut training = Training::begin(law.system(), measured, options, Compiled::default())?;
        training.start_from(law);
        Ok(training)
    }

    /// Makes a law of the same system the present model. The length of the segments stays.
    pub fn start_from(&mut self, law: &Law) {
        let window = self.law.window();
        self.law = law.clone().with_window(window);
    }

    fn begin(
        system: &Arc<System>,
        measured: Arc<Packed>,
        options: &'a Options,
        compiled: Compiled,
    ) -> Result<Self> {
        let degrees = system.degrees();
        let (scales, typical) =
            rayon::join(|| scales(&measured, system.observed_count()), || measured.typical_step());
        let shown = scales[..degrees].iter().chain(&scales[2 * degrees..]);
        if shown.into_iter().all(|scale| scale.spread.is_none()) {
            return Err(Error::new(
                ErrorKind::InsufficientData,
                "no coordinate is measured",
                "name the columns of the coordinates in the spec's data block",
            ));
        }
        measurable(&measured, &system.observables(), typical)?;
        let longest = measured.longest_run();
        let mut shortest = fewest_samples(&scales, 2 * degrees, measured.samples()).min(longest);
        if !system.hidden.is_empty() {
            // A few samples tell nothing of what acts unseen; nor does a long motion by no force
            // yet.
            let part = if system.terms.is_empty() { 1 } else { 16 };
            shortest = shortest.max(options.tuning.segments.hidden / part).min(longest);
        }
        let window = options.window.unwrap_or(shortest).clamp(2, longest.max(2));
        let rounding: Vec<f64> = scales.iter().map(|scale| scale.rounding).collect();
        let (segments, separable) = rayon::join(
            || not_empty(cut(&measured, Reach::of(window), &options.tuning.segments)),
            || compiled.of_all(system).separable(),
        );
        let segments = segments?;
        let mut states = States::measured(&measured, &segments.list, degrees);
        let spread = spreads(&scales, &states);
        let mut first_squares = first_masses(system, &measured, &options.tuning.masses);
        let told: Vec<TermId> = first_squares.iter().map(|(id, _)| *id).collect();
        let unit = gauge::unit_masses(system, &measured).into_iter();
        first_squares.extend(unit.filter(|(id, _)| !told.contains(id)));
        let Choice { stepping, accuracy } =
            stepping::coarse(system, options, separable, typical, &rounding)?;
        let law = Law::new(
            system.clone(),
            first_squares,
            system.parameters.iter().map(|p| p.bounds.clamp(p.start)).collect(),
            spread.clone(),
            (stepping, window),
        )?;
        if system.measures.is_empty() {
            states.weigh(&measured, &law);
            states.set_hidden(&law, &measured, &segments.list);
        } else {
            identifiable(system, &scales)?;
            states = States::measured_by(&law, &measured, &segments.list);
        }
        Ok(Training {
            law,
            options,
            states,
            segments,
            spread,
            accuracy,
            separable,
            rounds: 0,
            extent: Extent::Whole,
            stream: None,
            measured,
            reweigh: false,
            rounding,
            below_precision: Vec::new(),
            compiled,
        })
    }

    /// What is learned: the present model. Its covariance is not known before the end.
    pub fn law(&self) -> &Law {
        &self.law
    }

    /// What it is a model of.
    pub fn system(&self) -> &Arc<System> {
        self.law.system()
    }

    /// Cuts the data anew; every segment starts from its own measurements.
    pub fn recut(&mut self, window: usize) -> Result<()> {
        self.recut_to(Reach { window, ..self.law.reach() })
    }

    /// The same with the holes that segments bridge.
    pub(super) fn recut_to(&mut self, reach: Reach) -> Result<()> {
        let segments = not_empty(cut(&self.measured, reach, &self.options.tuning.segments))?;
        let before = std::mem::replace(&mut self.segments, segments);
        self.law.set_reach(reach);
        // Over many periods the misfit has many minima: what a state was before is a nearer start
        // than what was measured first.
        let place = |segment: &Segment| (segment.run, segment.first);
        let known: HashMap<_, _> = before.list.iter().map(place).zip(&self.states).collect();
        let mut states = self.first_states();
        for (at, segment) in self.segments.list.iter().enumerate() {
            let settled = known.get(&place(segment));
            if let Some(settled) = settled.filter(|s| s.iter().all(|x| x.is_finite())) {
                states.of_mut(at).copy_from_slice(settled);
            }
        }
        self.states = states;
        Ok(())
    }

    /// Works on a part of the segments from now on; gives those of before.
    pub fn thin(&mut self, most: usize) -> Segments {
        let part = self.segments.thinned(most);
        let before = std::mem::replace(&mut self.segments, part);
        self.states = self.first_states();
        before
    }

    pub(super) fn weights(&self) -> Vec<f64> {
        let noise = self.law.noise().iter().zip(&self.accuracy.resolution);
        noise.map(|(s, floor)| 1.0 / s.max(*floor)).collect()
    }

    /// Resolution in units of the noise, the same for all observables.
    pub fn floor(&self) -> f64 {
        let noise = self.law.noise();
        let parts = self.accuracy.resolution.iter().zip(noise);
        let squares: f64 = parts.map(|(f, s)| (f / s.max(*f)).powi(2)).sum();
        (squares / noise.len().max(1) as f64).sqrt()
    }

    /// The problem that a pass works on, with one weight for each observable.
    pub fn problem<'b>(&'b self, weights: &'b [f64]) -> Problem<'b> {
        Problem {
            measured: &self.measured,
            segments: &self.segments,
            observed: self.system().observed,
            weights,
            loss: self.options.loss,
            stepping: self.law.stepping(),
            floor: self.floor(),
            stream: self.stream,
            window: self.law.window(),
            parameters: &self.system().parameters,
            own: OwnInputs::default(),
            tuning: &self.options.tuning,
            halt: &Silent,
        }
    }

    /// The dynamics of the present model, and its theta.
    pub(super) fn compile(&self) -> (Arc<Dynamics>, Vec<f64>) {
        self.prepared(self.compiled.of(&self.law))
    }

    /// The dynamics of the whole function space, and the present model as its theta.
    pub(super) fn compile_whole(&self) -> (Arc<Dynamics>, Vec<f64>) {
        self.prepared(self.compiled.of_all(self.system()))
    }

    fn prepared(&self, dynamics: Arc<Dynamics>) -> (Arc<Dynamics>, Vec<f64>) {
        dynamics.prepare(self.law.stepping().method);
        let theta = self.law.theta(&dynamics);
        (dynamics, theta)
    }

    /// Linearises by the whole function space, searches the support, refits the best.
    pub fn round(&mut self, monitor: &dyn Monitor) -> Result<Round> {
        let (whole, theta) = self.compile_whole();
        let (present, present_theta) = self.compile();
        let mut states = std::mem::take(&mut self.states);
        let noise = self.law.noise().iter().zip(&self.accuracy.resolution);
        let finest = noise.into_iter().all(|(s, floor)| s <= floor);
        if std::mem::take(&mut self.reweigh) && self.stream.is_none() && !finest {
            let noise = self.noise_of_a_part(&present, &present_theta);
            self.law.set_noise(noise);
        }
        let noise = self.law.noise().to_vec();
        let weights = self.weights();
        let (folds, sums) = {
            let problem = Problem { halt: monitor, ..self.problem(&weights) };
            let (present, whole) = ((&*present, &*present_theta), (&*whole, &*theta));
            let linearised = settle_and_linearise(&problem, present, whole, &mut states);
            (linearised.folds, linearised.sums)
        };
        self.states = states;
        if sums.rows == 0 {
            let halted = monitor.halted();
            return Err(if halted { Error::Interrupted } else { nothing_left(sums.diverged) });
        }
        let columns = self.columns(&whole);
        let criterion = Criterion { floor: self.floor() };
        // Coefficients are looked for as they are, parameters as increments.
        let present = Column::all(theta.len())
            .map(|column| if columns.is_term(column) { -theta[column] } else { 0.0 });
        let origin = nalgebra::DVector::from_iterator(theta.len(), present);
        let folds: Vec<Factor> = folds
            .into_iter()
            .map(|mut fold| {
                fold.shift(&origin);
                fold
            })
            .collect();
        let merged = Factor::together(theta.len(), folds.iter().map(|fold| (fold, 1)));
        let tuning = &self.options.tuning;
        let problem = SearchProblem {
            factor: &merged,
            columns: &columns,
            criterion,
            tuning: &tuning.support,
        };
        let mut search = match self.extent {
            _ if !self.options.sparse => support::whole(problem),
            Extent::Whole => support::search(problem),
            Extent::Rough => support::rough(problem),
            Extent::Near => support::near(problem, &self.law.columns()),
        };
        if self.options.selection == super::options::Selection::HeldOut {
            super::held_out::prefer_held_out(
                &mut search.candidates,
                &folds,
                &columns,
                &tuning.support,
            );
        }
        let mut best = search.candidates.first().cloned().ok_or_else(|| {
            Error::new(
                ErrorKind::NothingFound,
                "no model was found",
                "check that the function space is not empty",
            )
        })?;
        // With numbers inside terms the factor holds only near to where it was linearised.
        let bent = self.extent == Extent::Near && !self.system().parameters.is_empty();
        let value = |law: &Law, sums: &Sums| problem.value(&law.columns(), sums.loss);
        let present = bent.then(|| {
            (self.law.clone(), self.states.clone(), value(&self.law, &sums), sums.diverged)
        });
        let mut refit = match self.confirmed(&best, &merged, &sums) {
            true => self.settle_on(&best, &columns, &folds, sums),
            false => self.adopt(&best, &whole, monitor),
        };
        if let Some((law, states, before, lost)) = present
            && law.support() != self.law.support()
            && (refit.sums().diverged > lost || value(&self.law, refit.sums()) > before)
        {
            self.law = law;
            refit = self.refit_from(states, self.promise().into(), monitor);
            self.take(&mut refit);
            let own = self.law.columns();
            if let Some(at) = search.candidates.iter().position(|fit| fit.support == own) {
                search.candidates[..=at].rotate_right(1);
                best = search.candidates[0].clone();
            }
        }
        self.rounds += 1;
        let predicted = criterion.agree(
            best.squares,
            refit.sums().loss,
            refit.sums().rows,
            tuning.support.same_loss,
        );
        Ok(Round { search, refit, folds, merged, columns, criterion, predicted, noise })
    }

    /// Whether a candidate is the present model but for what the data cannot see.
    fn confirmed(&self, candidate: &SupportFit, merged: &Factor, sums: &Sums) -> bool {
        if !self.system().parameters.is_empty() {
            // The motion is bent in a number inside a term: a refit has to look.
            return false;
        }
        let mut change = -nalgebra::DVector::from_vec(self.law.coefficient_of_each_term());
        candidate.values.iter().for_each(|&(column, value)| change[column] += value);
        let moved = (merged.design() * change).norm_squared();
        invisible(
            moved,
            self.promise().into(),
            sums,
            (self.floor(), self.options.tuning.refit.rounding),
        )
    }

    /// Takes the coefficients of a candidate that is confirmed: what a refit would find is known.
    fn settle_on(
        &mut self,
        candidate: &SupportFit,
        columns: &Columns,
        folds: &[Factor],
        sums: Sums,
    ) -> Refit {
        let chosen = columns.of(&candidate.support);
        let theta: Vec<f64> = candidate.values.iter().map(|&(_, value)| value).collect();
        let origin = nalgebra::DVector::from_column_slice(&theta);
        let at_theta = |fold: &Factor| {
            let mut own = fold.select(&chosen);
            own.shift(&origin);
            own
        };
        let folds = folds.iter().map(at_theta).collect();
        let linearised = Linearised { folds, sums, responses: None, eliminated: Vec::new() };
        let states = std::mem::take(&mut self.states);
        let stop = StopReason::Converged;
        let mut refit = Refit { theta, states, linearised, iterations: 1, stop };
        self.law.set_support(&self.terms_of(candidate));
        self.take(&mut refit);
        refit
    }

    /// Terms of a candidate with their coefficients: the first columns of the whole factor are
    /// those of the terms, in their order.
    fn terms_of(&self, candidate: &SupportFit) -> Vec<(TermId, f64)> {
        let ids = self.system().term_ids();
        let value = |k: Column| candidate.values.iter().find(|(column, _)| *column == k);
        let term = |&k: &Column| (ids[k], value(k).map_or(0.0, |(_, value)| *value));
        candidate.support.iter().map(term).collect()
    }

    /// A step that promises less than this part of the loss ends a refit.
    fn promise(&self) -> f64 {
        let RefitTuning { rough, converged, .. } = self.options.tuning.refit;
        if self.extent == Extent::Rough { rough } else { converged }
    }

    /// Makes a candidate the present model and refits it.
    fn adopt(&mut self, candidate: &SupportFit, whole: &Dynamics, monitor: &dyn Monitor) -> Refit {
        let terms = self.system().terms.len();
        let moved = candidate.values.iter().filter_map(|&(column, change)| {
            let id = *whole.parameters().get(column.position().checked_sub(terms)?)?;
            let bounds = self.system().parameter(id)?.bounds;
            Some((id, bounds.clamp(self.law.parameter(id)? + change)))
        });
        let moved: Vec<(ParameterId, f64)> = moved.collect();
        self.law.set_support(&self.terms_of(candidate));
        self.law.set_parameters(&moved);
        let states = std::mem::take(&mut self.states);
        let mut refit = self.refit_from(states, self.promise().into(), monitor);
        self.take(&mut refit);
        refit
    }

    /// Refits the present support from the present values.
    pub fn refit(&self, monitor: &dyn Monitor) -> Refit {
        self.refit_until(self.promise().into(), monitor)
    }

    /// The same until a step promises less than the least gain.
    pub fn refit_until(&self, least: LeastGain, monitor: &dyn Monitor) -> Refit {
        self.refit_from(self.states.clone(), least, monitor)
    }

    fn refit_from(&self, states: States, least: LeastGain, monitor: &dyn Monitor) -> Refit {
        let (dynamics, theta) = self.compile();
        let weights = self.weights();
        let problem = self.problem(&weights);
        let bounds = self.law.bounds(&dynamics);
        refit(&problem, &dynamics, &bounds, &theta, states, least, monitor)
    }

    /// Makes the result of a refit the present model, moves its states here, and estimates the
    /// noise anew.
    pub fn take(&mut self, refit: &mut Refit) {
        let (dynamics, _) = self.compile();
        self.law.set_theta(&dynamics, &refit.theta);
        self.states = std::mem::take(&mut refit.states);
        let medians = medians(self.system(), &refit.linearised.eliminated, &self.states);
        self.law.set_parameters(&medians);
        let noise = self.noise_estimate(refit.sums(), refit.theta.len());
        self.law.set_noise(noise);
    }

    /// What the columns of the whole space's factor mean.
    pub(super) fn columns(&self, whole: &Dynamics) -> Columns {
        let system = self.system();
        let terms = system.terms.len();
        let mut companions = vec![Vec::new(); terms];
        let inner: Vec<Column> =
            Column::all(terms + whole.parameters().len()).skip(terms).collect();
        let mut forced = inner.clone();
        for (k, term) in system.terms.iter().enumerate() {
            if system.parameters.is_empty() {
                break;
            }
            let symbols = system.graph.symbols(&[term.expr]);
            for (&column, id) in inner.iter().zip(whole.parameters()) {
                if symbols.contains(&Symbol::Parameter(id.position())) {
                    companions[k].push(column);
                    forced.retain(|&other| other != column);
                }
            }
        }
        let mut bounds: Vec<Bounds> = system.terms.iter().map(|t| t.bounds).collect();
        bounds.extend(whole.parameters().iter().map(|id| {
            let j = id.position();
            let (present, parameter) = (self.law.parameters()[j], &system.parameters[j]);
            let reach = present.abs().max(parameter.start.abs());
            let Bounds { lower, upper } = parameter.bounds.near(present, reach);
            Bounds { lower: lower - present, upper: upper - present }
        }));
        let complexity: Vec<u32> =
            system.terms.iter().map(|t| complexity(&system.graph, t.expr)).collect();
        let costs = choice_costs(&complexity);
        let unseen = gauge::unseen_squares(system, &self.measured).into_iter();
        let said = system.term_ids().into_iter().filter(|&id| is_said(system, id));
        let required = unseen.chain(said).map(|id| Column::new(id.position())).collect();
        Columns { terms, companions, forced, required, bounds, complexity, costs }
    }

    /// Rounds until the support and the noise stand still.
    pub fn rounds(&mut self, monitor: &dyn Monitor) -> Result<Round> {
        let tuning = &self.options.tuning.rounds;
        let mut seen: Vec<Vec<TermId>> = Vec::new();
        let mut last: Option<Round> = None;
        loop {
            let before = self.law.support().to_vec();
            let stepping = self.law.stepping();
            let mut round = match (self.round(monitor), last.take()) {
                (Err(Error::Interrupted), Some(mut last)) => {
                    last.refit.stop = StopReason::Interrupted;
                    return Ok(last);
                }
                (round, _) => round?,
            };
            let same = self.law.support() == before;
            let known = same || round.predicted;
            let steady = |(a, b): (&f64, &f64)| (a / b).ln().abs() < tuning.noise_steady.ln();
            let chosen = self.accuracy.error.iter().all(|error| error.is_finite());
            let still = same && self.law.noise().iter().zip(&round.noise).all(steady);
            if !(chosen && still) {
                self.sharpen();
            }
            let quiet = (self.law.noise().iter())
                .zip(&round.noise)
                .zip(&self.accuracy.resolution)
                .all(|((a, b), floor)| {
                    let least = tuning.above_resolution * floor;
                    a.max(least) < tuning.noise_steady * b.max(least)
                });
            // A support that comes back in a circle is settled by the criterion of the round.
            let circling = seen.len() + 1 >= tuning.most
                || (!same && seen.iter().any(|support| support == self.law.support()));
            // Rounds that others follow need not confirm what they found.
            let known = known || self.extent == Extent::Rough;
            let done = known && quiet && stepping == self.law.stepping();
            if monitor.stopped() && !(done || circling) {
                round.refit.stop = StopReason::Interrupted;
            }
            if done || circling || round.refit.stop == StopReason::Interrupted {
                return Ok(round);
            }
            seen.push(self.law.support().to_vec());
            last = Some(round);
        }
    }

    /// A model that turned out separable ends with a splitting, whatever the space needed, and
    /// one whose motion all comes from H with a symplectic method; the integrator of each leaves
    /// the numbers where an exact one would.
    pub(super) fn finish(&mut self, round: &mut Round, monitor: &dyn Monitor) {
        if round.refit.stop == StopReason::Interrupted {
            return;
        }
        let before = (self.law.stepping(), self.accuracy.clone());
        if !self.integrate_for_result() {
            return;
        }
        let refit = self.refit(monitor);
        let (new, old) = (refit.sums(), round.refit.sums());
        if new.loss.is_finite() && new.diverged <= old.diverged {
            round.refit = refit;
            self.take(&mut round.refit);
        } else {
            self.law.set_stepping(before.0);
            self.accuracy = before.1;
        }
    }

    /// Samples of all data.
    pub fn samples(&self) -> usize {
        self.stream.map_or_else(|| self.measured.samples(), |stream| stream.counts().1)
    }
}
