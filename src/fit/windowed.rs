//! A law held against its data over segments of one length: its numbers with honest errors, and
//! what the segments leave.

use nalgebra::DMatrix;

use super::law::Law;
use super::model::Model;
use super::motion::Equations;
use super::options::Options;
use super::pass::{Problem, residuals, settle};
use super::scores::Scores;
use super::states::States;
use super::stepping::Aim;
use super::train::Training;
use crate::data::{Dataset, Packed};
use crate::error::Result;
use crate::expr::{ParameterId, System, TermId};

/// A law held against its data over segments of one length.
#[derive(Clone)]
pub(super) struct Held<'a> {
    /// The law with the numbers that these segments give, and their noise; segments and states.
    pub(super) training: Training<'a>,
    /// Covariance of its numbers, coefficients of its support first, then of parameters in use.
    covariance: DMatrix<f64>,
    /// What the segments leave.
    pub(super) residuals: Residuals,
}

/// A number of a law.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Number {
    /// The coefficient of a term.
    Coefficient(TermId),
    /// An inner parameter.
    Parameter(ParameterId),
}

/// A number with its value and its standard error.
pub(super) type Known = (Number, f64, f64);

/// Errors of both together beyond which two values of a number are not the same: by chance one
/// pair in 370 is.
const DISAGREES: f64 = 3.0;

/// Whether two are values of the same number that differ beyond their errors.
pub(super) fn differ(a: &Known, b: &Known) -> bool {
    a.0 == b.0 && (a.1 - b.1).abs() > DISAGREES * a.2.hypot(b.2)
}

/// Noise below this many times what is resolved is that of the digits.
const ABOVE_RESOLUTION: f64 = 2.0;

/// Samples over which a state is brought near first: over many periods the misfit has many minima.
const FIRST_LOOK: usize = 8;

/// A law has lost the motion where it leaves more of an observable's variance beyond the noise
/// than this part: a tenth is an error of its phase by 13 degrees. Its numbers are those of a
/// neighbouring minimum then, as likely as not.
const LOST: f64 = 0.1;

impl<'a> Held<'a> {
    /// A law over the segments of its window; `None` where they do not determine it.
    pub(super) fn of(
        law: &Law,
        dataset: &Dataset,
        options: &'a Options,
    ) -> Result<Option<Held<'a>>> {
        let mut training = Training::new(law.system(), dataset, options)?;
        training.start_from(law);
        training.recut(law.window())?;
        training.choose_integrator(Aim::Round);
        let (dynamics, theta) = training.compile();
        let weights = training.weights();
        let mut states = std::mem::take(&mut training.states);
        let mut look = FIRST_LOOK.min(law.window());
        loop {
            let short = training.segments.shortened(look);
            let problem = Problem { segments: &short, ..training.problem(&weights) };
            settle(&problem, &dynamics, &theta, &mut states);
            // A segment may have one sample more than its window.
            if look > law.window() {
                break;
            }
            look = (2 * look).min(law.window() + 1);
        }
        training.states = states;
        Ok(Held::at(&training))
    }

    /// A training as it stands; `None` where its segments do not determine its numbers.
    pub(super) fn at(training: &Training<'a>) -> Option<Held<'a>> {
        let (dynamics, theta) = training.compile();
        let weights = training.weights();
        let problem = training.problem(&weights);
        let law = (&*dynamics, &*theta);
        let covariance = Scores::of(&problem, law, &training.states).covariance()?;
        let residuals = Residuals::of(&problem, law, &training.states, training.system());
        Some(Held { training: training.clone(), covariance, residuals })
    }

    pub(super) fn window(&self) -> usize {
        self.training.law.window()
    }

    /// How long a segment takes.
    pub(super) fn duration(&self) -> f64 {
        (self.window() - 1) as f64 * self.training.measured.typical_step()
    }

    /// Whether it leaves the motion itself, beyond the noise that shorter segments leave.
    pub(super) fn is_lost(&self, followed: &Held) -> bool {
        let Training { law, spread, .. } = &self.training;
        let noise = law.noise().iter().zip(followed.training.law.noise()).zip(spread).enumerate();
        let seen = |row: usize| self.training.measured.column(row).iter().any(|x| x.is_finite());
        noise.filter(|(row, _)| seen(*row)).any(|(_, ((now, before), spread))| {
            now * now - before * before > LOST * spread * spread || !now.is_finite()
        })
    }

    /// Whether the numbers that both have are better known here: by the mean of the logarithms of
    /// their variances, which no unit changes.
    pub(super) fn tells_more(&self, other: &Held) -> bool {
        let known = other.numbers();
        let ratios: Vec<f64> = (self.numbers().iter())
            .filter_map(|(number, _, error)| {
                let (_, _, before) = known.iter().find(|(same, ..)| same == number)?;
                Some((error / before).ln())
            })
            .filter(|ratio| ratio.is_finite())
            .collect();
        !ratios.is_empty() && ratios.iter().sum::<f64>() < 0.0
    }

    /// Whether a number that both have is another here, beyond the errors of both.
    pub(super) fn disagrees(&self, other: &Held) -> bool {
        let others = other.numbers();
        self.numbers().iter().any(|number| others.iter().any(|known| differ(number, known)))
    }

    /// Whether something is left beside the digits of the data and the integrator's errors.
    pub(super) fn is_above_resolution(&self) -> bool {
        let mut noise = self.training.law.noise().iter().zip(&self.training.accuracy.resolution);
        noise.any(|(noise, resolution)| *noise > ABOVE_RESOLUTION * resolution)
    }

    /// Its numbers, each with its standard error.
    pub(super) fn numbers(&self) -> Vec<Known> {
        let coefficients =
            self.training.law.terms().map(|(id, _, value)| (Number::Coefficient(id), value));
        let used = self.training.law.dynamics().parameters().to_vec();
        let value = |id: ParameterId| self.training.law.parameter(id).unwrap_or(f64::NAN);
        let inner = used.into_iter().map(|id| (Number::Parameter(id), value(id)));
        let errors = self.covariance.diagonal();
        let both = coefficients.chain(inner).zip(errors.iter());
        both.map(|((number, value), variance)| (number, value, variance.sqrt())).collect()
    }

    /// Period of the fastest motion of a measured coordinate; `None` where none swings.
    pub(super) fn period(&self) -> Option<f64> {
        let degrees = self.training.law.system().degrees();
        let of = |row: usize| swings(&self.training.measured, row, self.training.spread[row]);
        (0..degrees).filter_map(of).min_by(f64::total_cmp)
    }

    /// Gives a model the errors of these segments, where they are larger than those for residuals
    /// that are independent.
    pub(super) fn give_errors(&self, model: &mut Model) {
        let size = model.covariance.len();
        if self.covariance.nrows() != size {
            return;
        }
        let variance = |k: usize| self.covariance[(k, k)].max(f64::MIN_POSITIVE);
        let raised: Vec<f64> = (0..size)
            .map(|k| (model.covariance[k][k] / variance(k)).sqrt())
            .map(|ratio| if ratio.is_finite() { ratio.max(1.0) } else { 1.0 })
            .collect();
        for a in 0..size {
            for b in 0..size {
                if model.covariance[a][b].is_finite() {
                    model.covariance[a][b] = self.covariance[(a, b)] * raised[a] * raised[b];
                }
            }
        }
        let errors: Vec<f64> = (0..size).map(|k| model.covariance[k][k].sqrt()).collect();
        let terms = model.terms.iter_mut().map(|term| &mut term.standard_error);
        let inner = model.parameters.iter_mut().map(|one| &mut one.standard_error);
        terms.chain(inner).zip(errors).for_each(|(place, error)| *place = error);
    }
}

/// What segments leave, as far as it is looked at.
#[derive(Debug, Clone, Default)]
pub(crate) struct Residuals {
    /// Of each observable its name, the correlation of its residuals from one sample to the next,
    /// and the pairs that it is from.
    pub(crate) neighbours: Vec<(String, f64, usize)>,
    /// Of each run its sum of weighted squares, and the values that are in it.
    pub(super) runs: Vec<(f64, usize)>,
}

/// Standard errors that a correlation has to be from zero, and a run's misfit from that of the
/// others, to be no chance: five, since it is asked of many.
pub(super) const SIGNIFICANT: f64 = 5.0;

/// Whether a correlation of so many pairs is above zero, and by no chance.
pub(crate) fn is_significant(correlation: f64, pairs: usize) -> bool {
    correlation * (pairs as f64).sqrt() > SIGNIFICANT
}

impl Residuals {
    /// Whether those of neighbouring samples are alike: no noise that is white leaves such.
    pub(super) fn are_correlated(&self) -> bool {
        self.neighbours.iter().any(|(_, correlation, pairs)| is_significant(*correlation, *pairs))
    }

    pub(crate) fn of(
        problem: &Problem,
        law: Equations,
        states: &States,
        system: &System,
    ) -> Residuals {
        let all = residuals(problem, law.0, law.1, states);
        let neighbours = |(row, name): (usize, String)| {
            let (mut both, mut squares, mut pairs, mut count) = (0.0, 0.0, 0, 0);
            for series in all.iter().filter_map(|segment| segment.get(row)) {
                let known = series.iter().filter(|x| x.is_finite());
                squares += known.clone().map(|x| x * x).sum::<f64>();
                count += known.count();
                for pair in series.windows(2).filter(|pair| pair.iter().all(|x| x.is_finite())) {
                    both += pair[0] * pair[1];
                    pairs += 1;
                }
            }
            let each = squares / count.max(1) as f64;
            (name, both / pairs.max(1) as f64 / each.max(f64::MIN_POSITIVE), pairs)
        };
        let mut runs = vec![(0.0, 0); problem.measured.runs()];
        for (segment, residuals) in problem.segments.list.iter().zip(&all) {
            let known = residuals.iter().flatten().filter(|x| x.is_finite());
            if let Some((squares, count)) = runs.get_mut(segment.run) {
                *squares += known.clone().map(|x| x * x).sum::<f64>();
                *count += known.count();
            }
        }
        let neighbours = system.observables().into_iter().enumerate().map(neighbours).collect();
        Residuals { neighbours, runs }
    }
}

/// Period of an observable's motion about its mean: from the times at which it has gone from half
/// its spread on one side to half its spread on the other, so that noise does not count.
fn swings(measured: &Packed, row: usize, spread: f64) -> Option<f64> {
    let column = measured.column(row).iter().filter(|x| x.is_finite());
    let mean = column.clone().sum::<f64>() / column.count().max(1) as f64;
    let (mut turns, mut time) = (0usize, 0.0);
    for run in 0..measured.runs() {
        let (times, values) = (measured.times_of(run), measured.values_of(row, run));
        let sides = times.iter().zip(values).filter_map(|(t, x)| {
            let off = (x - mean) / (0.5 * spread);
            (off.abs() > 1.0).then_some((*t, off > 0.0))
        });
        let mut changes: Vec<f64> = Vec::new();
        let mut side = None;
        for (t, above) in sides {
            if side.is_some_and(|side| side != above) {
                changes.push(t);
            }
            side = Some(above);
        }
        if let (Some(first), Some(last)) = (changes.first(), changes.last()) {
            turns += changes.len() - 1;
            time += last - first;
        }
    }
    (turns >= 2 && time > 0.0).then(|| 2.0 * time / turns as f64)
}
