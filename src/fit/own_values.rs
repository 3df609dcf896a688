//! The values that runs have for themselves at the end of a training, with their errors.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::DMatrix;

use super::column::Column;
use super::distribution::{Distribution, OwnValue};
use super::factor::Factor;
use super::gauss_newton::Refit;
use super::law::Law;
use super::options::Options;
use super::pass::settle;
use super::per_run::{deviations, grouped, groupings_of_own, own};
use super::segments::packed;
use super::states::States;
use super::train::Training;
use super::uncertainty::covariance;
use crate::data::{Dataset, MeasuredInput};
use crate::error::Result;
use crate::expr::{ParameterId, System, TermId};

/// A law and measurements in which what runs have for themselves are inputs that never change:
/// what holds of the one law holds of the other, and no number is a run's alone. `None` where
/// there are none.
///
/// A value that the law knows, by the name of its group, stays as it is. That of a group which it
/// was not learned from is fitted to the runs of that group, as their initial states are; the law
/// is held.
pub fn as_inputs(law: &Law, dataset: &Dataset) -> Option<(Law, Dataset)> {
    let system = law.system();
    let of_runs = Arc::new(system.with_own_inputs()?);
    let own = own(&system.parameters);
    let by = groupings_of_own(&system.parameters);
    let grouped =
        grouped(system, dataset).map_or_else(|_| dataset.clone(), |data| data.into_owned());
    // Of a group that shows nothing the mean is the best that is known.
    let fitted = fitted(law, &grouped).unwrap_or_default();
    let mut dataset = grouped;
    let recorded = MeasuredInput::places(&system.measured_inputs()).1;
    dataset.inputs.truncate(system.inputs.len());
    dataset.runs.iter_mut().for_each(|run| run.inputs.truncate(recorded));
    for (of, &j) in own.iter().enumerate() {
        let parameter = &system.parameters[j];
        let known = law.distributions().iter().find(|found| found.name == parameter.name);
        let known: HashMap<&str, f64> = known
            .into_iter()
            .flat_map(|found| &found.values)
            .filter(|value| value.is_determined())
            .map(|value| (value.group.as_str(), value.value))
            .collect();
        let mean = law.parameters()[j];
        let input = of_runs.measured_inputs().remove(system.inputs.len() + of);
        for (at, run) in dataset.runs.iter_mut().enumerate() {
            let found = known.get(run.group(by[of])).copied();
            let found = found.or_else(|| fitted.get(at * own.len() + of).copied());
            let difference = found.map_or(0.0, |value| value - mean);
            run.inputs.extend(input.columns(&run.times, &vec![difference; run.times.len()]));
        }
        dataset.inputs.push(input);
    }
    Some((law.on(&of_runs), dataset))
}

/// The numbers of all runs that go best with a law, `[run][number]`: over short segments first,
/// then over those of the law's window.
fn fitted(law: &Law, dataset: &Dataset) -> Result<Vec<f64>> {
    let options = Options::default();
    let measured = Arc::new(packed(dataset, &options.tuning.segments));
    let mut training = Training::from_law(law, measured, &options)?;
    training.settle();
    let longest = law.window().clamp(2, training.measured.longest_run().max(2));
    while training.law().window() < longest {
        training.recut((2 * training.law().window()).min(longest))?;
        training.settle();
    }
    let measured = &training.measured;
    let by = groupings_of_own(&law.system().parameters);
    let number = |at: usize| {
        let (run, of) = (at / by.len(), at % by.len());
        training.states.numbers.get(measured.group_of(by[of], run) * by.len() + of).copied()
    };
    Ok((0..measured.runs() * by.len()).filter_map(number).collect())
}

/// What a training leaves to say of all runs, and of each.
pub(super) struct Shared {
    /// Of the coefficients, then of the inner parameters in use; one that runs have for themselves
    /// stands there with the variance of its mean.
    pub covariance: DMatrix<f64>,
    /// Values of the inner parameters in use that runs have for themselves.
    pub distributions: Vec<Distribution>,
    /// Their means.
    pub means: Vec<(ParameterId, f64)>,
}

/// From the factor of the unknowns at the end of a training, whose inner parameters are those that
/// are `used`, and the variance of its residuals.
pub(super) fn shared(
    training: &Training,
    refit: &Refit,
    (used, factor, variance): (&[ParameterId], &Factor, f64),
) -> Shared {
    let system = training.system();
    let own = own(&system.parameters);
    let mut out =
        Shared { covariance: DMatrix::zeros(0, 0), distributions: Vec::new(), means: Vec::new() };
    let support = training.law().support();
    if !used.iter().any(|id| own.contains(&id.position())) {
        out.covariance = covariance_of_shared(system, (support, used), factor, variance);
        return out;
    }
    let first = factor.columns() - used.len();
    let mut all = covariance_of_shared(system, (support, used), factor, 1.0);
    let eliminated = &refit.linearised.eliminated;
    let errors: Vec<Vec<f64>> = eliminated.iter().map(|part| part.variances(&all)).collect();
    all *= variance;
    for (place, id) in used.iter().enumerate() {
        let Some(of) = own.iter().position(|j| *j == id.position()) else { continue };
        let parameter = &system.parameters[id.position()];
        let Some(per) = &parameter.per else { continue };
        let numbers = eliminated.iter().zip(&errors).flat_map(|(part, errors)| {
            part.numbers.iter().zip(errors).filter(|(number, _)| number.of == of)
        });
        let measured = &training.measured;
        let by = groupings_of_own(&system.parameters)[of];
        let mut runs = vec![0; measured.runs()];
        (0..measured.runs()).for_each(|run| runs[measured.group_of(by, run)] += 1);
        let mut values: Vec<(usize, OwnValue)> = numbers
            .map(|(number, error)| {
                let value = OwnValue {
                    group: measured.group_name(by, number.run),
                    runs: runs[number.run],
                    value: training.states.numbers[number.run * own.len() + of],
                    standard_error: (error * variance).sqrt(),
                };
                (number.run, value)
            })
            .collect();
        values.sort_by_key(|(run, _)| *run);
        let values = values.into_iter().map(|(_, value)| value).collect();
        let mut found =
            Distribution::of(&parameter.name, per.word(), parameter.unit_text.clone(), values);
        all[(first + place, first + place)] = found.mean_error.powi(2);
        if !found.mean.is_finite() {
            // No run says anything: what it was looked for from is all that there is.
            found.mean = training.law().parameters()[id.position()];
        }
        out.means.push((*id, found.mean));
        out.distributions.push(found);
    }
    Shared { covariance: all, ..out }
}

/// The covariance of the unknowns of a factor, of which the last are the inner parameters that are
/// `used`; zero of those that runs have for themselves, which are eliminated from it, and of
/// coefficients that constraints say.
pub(crate) fn covariance_of_shared(
    system: &System,
    (support, used): (&[TermId], &[ParameterId]),
    factor: &Factor,
    variance: f64,
) -> DMatrix<f64> {
    let own = own(&system.parameters);
    let first = factor.columns() - used.len();
    let is_own = |k: usize| k >= first && own.contains(&used[k - first].position());
    let is_said = |k: usize| support.get(k).is_some_and(|id| is_said(system, *id));
    let rest: Vec<Column> = Column::all(factor.columns())
        .filter(|k| !is_own(k.position()) && !is_said(k.position()))
        .collect();
    if rest.len() == factor.columns() {
        return covariance(factor, variance);
    }
    let of_rest = covariance(&factor.select(&rest), variance);
    let mut all = DMatrix::zeros(factor.columns(), factor.columns());
    for (a, row) in rest.iter().enumerate() {
        for (b, column) in rest.iter().enumerate() {
            all[(row.position(), column.position())] = of_rest[(a, b)];
        }
    }
    all
}

/// Whether the constraints on a coefficient leave one value.
pub(crate) fn is_said(system: &System, term: TermId) -> bool {
    let bounds = system.terms.get(term.position()).map(|term| term.bounds);
    bounds.is_some_and(|bounds| bounds.lower == bounds.upper)
}

/// Whether the constraints on a coefficient let it be nothing, and something else.
pub(crate) fn may_be_left_out(system: &System, term: TermId) -> bool {
    let bounds = system.terms.get(term.position()).map(|term| term.bounds);
    bounds.is_some_and(|bounds| bounds.lower <= 0.0 && bounds.upper >= 0.0)
        && !is_said(system, term)
}

impl Training<'_> {
    /// The start of every segment as it was measured; what runs have for themselves stays.
    pub(super) fn first_states(&self) -> States {
        let mut first = States::measured_by(&self.law, &self.measured, &self.segments.list);
        first.numbers.clone_from(&self.states.numbers);
        first
    }

    /// What runs have for themselves beside the present law: how much each has, and
    /// `[run][number]`.
    pub(super) fn own_inputs(&self) -> (usize, Vec<f64>) {
        let own = own(&self.system().parameters);
        let of_law: Vec<f64> = own.iter().map(|&j| self.law.parameters()[j]).collect();
        (own.len(), deviations(&self.system().parameters, &self.measured, &self.states, &of_law))
    }

    /// Settles all states, and the numbers that runs have for themselves, for the present model.
    pub(super) fn settle(&mut self) {
        let (dynamics, theta) = self.compile();
        let weights = self.weights();
        let mut states = std::mem::take(&mut self.states);
        settle(&self.problem(&weights), &dynamics, &theta, &mut states);
        self.states = states;
    }
}
