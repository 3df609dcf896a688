//! Numbers that every run, or every group of runs, has for itself.
//!
//! They are eliminated like the initial states of segments, so that the cost of a pass grows with
//! the number of runs as it does without them. Runs that share no number are apart from each
//! other. What is left of some that do share is a triangular factor of their numbers m and of
//! theta, `[R_m S r_m; 0 R r]`; the rows `[R r]` no longer know the numbers (block elimination of
//! an arrowhead system; Bjorck, Numerical Methods for Least Squares Problems, SIAM 1996, chapter
//! 6).

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector};

use super::factor::Factor;
use super::pass::{Linearised, Problem};
use super::rounding::{ABSORBED, UNDETERMINED};
use super::states::States;
use crate::data::{Dataset, Packed};
use crate::dynamics::Dynamics;
use crate::error::{Error, ErrorKind, Result};
use crate::expr::{Parameter, ParameterId, System, groupings};

/// A number that some runs have for themselves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct OwnNumber {
    /// The first of the runs.
    pub run: usize,
    /// Which of the parameters that are no run's alone it is a value of, counted among them.
    pub of: usize,
}

/// What the elimination of the numbers of some runs leaves to say of them.
#[derive(Debug, Clone)]
pub struct Eliminated {
    /// The numbers.
    pub numbers: Vec<OwnNumber>,
    /// Of each whether the runs determine it.
    pub determined: Vec<bool>,
    /// The inverse of R_m, zero for what is not determined.
    inverse: DMatrix<f64>,
    /// The inverse of R_m times S: how the numbers answer to theta.
    answers: DMatrix<f64>,
    /// The inverse of R_m times r_m: the step that the numbers have still to take.
    step: DVector<f64>,
}

impl Eliminated {
    /// Variances of the numbers for residuals of variance one, where `covariance` is that of
    /// theta; infinite for what the runs do not determine.
    pub fn variances(&self, covariance: &DMatrix<f64>) -> Vec<f64> {
        let own = &self.inverse * self.inverse.transpose();
        let shared = &self.answers * covariance * self.answers.transpose();
        let variance = |(j, determined): (usize, &bool)| match determined {
            true if shared[(j, j)].is_finite() => own[(j, j)] + shared[(j, j)],
            true => f64::INFINITY,
            false => f64::INFINITY,
        };
        self.determined.iter().enumerate().map(variance).collect()
    }
}

/// Positions of the parameters that runs or groups of runs have for themselves.
pub fn own(parameters: &[Parameter]) -> Vec<usize> {
    (0..parameters.len()).filter(|&j| parameters[j].per.is_some()).collect()
}

/// Of each of these parameters the grouping of the data that it goes by.
pub(super) fn groupings_of_own(parameters: &[Parameter]) -> Vec<usize> {
    let all = groupings(parameters);
    let by = |parameter: &Parameter| {
        let column = parameter.per.as_ref()?.column();
        all.iter().position(|other| *other == column)
    };
    parameters.iter().filter_map(by).collect()
}

/// Data that say which groups every run belongs to; where a program made them, and nothing but
/// runs is asked for, each run is one of its own.
///
/// # Errors
///
/// The system asks for groups that the data do not know of.
pub(super) fn grouped<'a>(system: &System, dataset: &'a Dataset) -> Result<Cow<'a, Dataset>> {
    let groupings = system.groupings();
    if dataset.runs.iter().all(|run| run.groups.len() == groupings.len()) {
        return Ok(Cow::Borrowed(dataset));
    }
    if let Some(column) = groupings.iter().flatten().next() {
        return Err(Error::new(
            ErrorKind::InvalidArgument,
            format!("the measurements do not say which `{column}` each run belongs to"),
            format!("give them as a table with a column `{column}`"),
        ));
    }
    let mut dataset = dataset.clone();
    for run in &mut dataset.runs {
        run.groups = vec![String::new(); groupings.len()];
    }
    Ok(Cow::Owned(dataset))
}

/// Where these parameters stand in the theta of a dynamics: the place there, and which it is.
pub(super) fn places(problem: &Problem, dynamics: &Dynamics) -> Vec<(usize, usize)> {
    let own = own(problem.parameters);
    let of = |(k, id): (usize, &ParameterId)| {
        let of = own.iter().position(|j| *j == id.position())?;
        Some((dynamics.active().len() + k, of))
    };
    dynamics.parameters().iter().enumerate().filter_map(of).collect()
}

/// Whether runs have numbers of their own in these equations.
pub(super) fn has(problem: &Problem, dynamics: &Dynamics) -> bool {
    dynamics.has_own_inputs() && !places(problem, dynamics).is_empty()
}

/// The median of each parameter that runs have for themselves: that of a run not yet seen,
/// whatever a few of them say that hardly determine it.
pub(super) fn medians(
    system: &System,
    eliminated: &[Eliminated],
    states: &States,
) -> Vec<(ParameterId, f64)> {
    let own = own(&system.parameters);
    let ids = system.parameter_ids();
    let median = |(of, &place): (usize, &usize)| {
        let parts = eliminated.iter().flat_map(|part| part.numbers.iter().zip(&part.determined));
        let mut values: Vec<f64> = parts
            .filter(|(number, determined)| number.of == of && **determined)
            .filter_map(|(number, _)| states.numbers.get(number.run * own.len() + of).copied())
            .collect();
        let middle = values.len() / 2;
        (!values.is_empty())
            .then(|| (ids[place], *values.select_nth_unstable_by(middle, f64::total_cmp).1))
    };
    own.iter().enumerate().filter_map(median).collect()
}

/// The numbers of the runs where they are expected to be best after a step of theta.
pub(super) fn follow(problem: &Problem, from: &Linearised, states: &mut States, change: &[f64]) {
    let own = own(problem.parameters);
    for part in &from.eliminated {
        for (at, number) in part.numbers.iter().enumerate() {
            let answers = part.answers.row(at);
            let moved: f64 = answers.iter().zip(change).map(|(answer, by)| answer * by).sum();
            let value = &mut states.numbers[number.run * own.len() + number.of];
            let parameter = &problem.parameters[own[number.of]];
            let reach = value.abs().max(parameter.start.abs());
            *value = parameter.bounds.near(*value, reach).clamp(*value + part.step[at] - moved);
        }
    }
}

/// What the numbers of all runs differ by from those of a law, `[run][number]`.
pub(super) fn deviations(
    parameters: &[Parameter],
    measured: &Packed,
    states: &States,
    of_law: &[f64],
) -> Vec<f64> {
    let by = groupings_of_own(parameters);
    let mut out = vec![0.0; measured.runs() * by.len()];
    if states.numbers.len() == out.len() {
        for (at, deviation) in out.iter_mut().enumerate() {
            let (run, of) = (at / by.len(), at % by.len());
            let first = measured.group_of(by[of], run);
            *deviation = states.numbers[first * by.len() + of] - of_law[of];
        }
    }
    out
}

/// The factor of theta alone, from that of some numbers and theta.
pub(super) fn eliminate(numbers: &[OwnNumber], factor: &Factor) -> (Factor, Eliminated) {
    let count = numbers.len();
    let unknowns = factor.columns() - count;
    let (triangle, norms) = (factor.triangle(), factor.norms());
    let is_determined =
        |j: usize| norms[j] > 0.0 && triangle[(j, j)].abs() > UNDETERMINED * norms[j];
    let determined: Vec<bool> = (0..count).map(is_determined).collect();
    let open: Vec<usize> = (0..count).filter(|&j| !determined[j]).collect();
    // The rows of the numbers go with them; that of one which is not determined tells of theta.
    let mut left = triangle.view((count, count), (unknowns + 1, unknowns + 1)).clone_owned();
    if !open.is_empty() {
        left = left.insert_rows(0, open.len(), 0.0);
        for (into, &row) in open.iter().enumerate() {
            left.row_mut(into).copy_from(&triangle.view((row, count), (1, unknowns + 1)));
        }
    }
    let mut reduced = Factor::new(unknowns);
    reduced.push(&left, factor.rows().saturating_sub(count - open.len()));
    // What the numbers can do all of is left to them: the rest of such a column is rounding.
    reduced.zero_columns(|k, norm| norm <= ABSORBED * norms[count + k.position()]);
    let mut square = triangle.view((0, 0), (count, count)).clone_owned();
    for &j in &open {
        square.row_mut(j).fill(0.0);
        square.column_mut(j).fill(0.0);
        square[(j, j)] = 1.0;
    }
    let inverse = square.solve_upper_triangular(&DMatrix::identity(count, count));
    let mut inverse = inverse.unwrap_or_else(|| DMatrix::zeros(count, count));
    open.iter().for_each(|&j| inverse[(j, j)] = 0.0);
    let answers = &inverse * triangle.view((0, count), (count, unknowns));
    let step = &inverse * triangle.view((0, count + unknowns), (count, 1)).column(0);
    (reduced, Eliminated { numbers: numbers.to_vec(), determined, inverse, answers, step })
}
