//! Forces with kinks and jumps, integrated over points so close that it hardly matters where
//! between two of them a jump lies: a cubic through nodes rounds it off.

use nalgebra::{DMatrix, DVector};

use super::actions::Action;
use super::course::{Course, interpolation};

/// Points from place to place of a course.
const POINTS: usize = 8;

/// One segment.
pub(super) struct Fine {
    /// Its first point among those of all segments.
    pub(super) first: usize,
    /// Places of the course from sample to sample.
    between: usize,
    /// The time that each point stands for.
    spans: Vec<f64>,
    /// Neighbouring places of the course, and the weight of each in a cubic, at each point.
    weights: Vec<Vec<(usize, f64)>>,
    /// Inverse of the derivative of the state at each place by the first.
    inverses: Vec<DMatrix<f64>>,
    /// Derivatives of what is predicted at each sample by the first state.
    tangents: Vec<DMatrix<f64>>,
    /// What the first state can do, orthonormal.
    basis: DMatrix<f64>,
}

/// Points of one segment where forces act, and their times.
pub(super) type Points = (Vec<Vec<f64>>, Vec<f64>);

impl Fine {
    /// Of a course with so many places from sample to sample; forces act on its states, each moved
    /// by as much as `moved` says for a time.
    pub(super) fn of(
        course: &Course,
        between: usize,
        basis: DMatrix<f64>,
        moved: impl Fn(f64) -> Option<DVector<f64>>,
    ) -> (Fine, Points) {
        let size = course.states.first().map_or(0, Vec::len);
        let (mut spans, mut times) = (Vec::new(), Vec::new());
        for pair in course.times.windows(2) {
            let span = (pair[1] - pair[0]) / POINTS as f64;
            for point in 0..POINTS {
                spans.push(span);
                times.push(pair[0] + (point as f64 + 0.5) * span);
            }
        }
        let weights: Vec<Vec<(usize, f64)>> =
            times.iter().map(|&time| interpolation(&course.times, time)).collect();
        let state = |(weights, &time): (&Vec<(usize, f64)>, &f64)| {
            let component =
                |i: usize| weights.iter().map(|(at, w)| w * course.states[*at][i]).sum();
            let here: DVector<f64> = DVector::from_fn(size, |i, _| component(i));
            let here = moved(time).map_or(here.clone(), |by| &here + by);
            here.as_slice().to_vec()
        };
        let states = weights.iter().zip(&times).map(state).collect();
        let by_state = |tangent: &DMatrix<f64>| tangent.columns(0, size).clone_owned();
        let fine = Fine {
            first: 0,
            between,
            spans,
            weights,
            inverses: course.inverses.clone(),
            tangents: course.tangents.iter().map(by_state).collect(),
            basis,
        };
        (fine, (states, times.iter().map(|time| course.start + time).collect()))
    }

    /// What kicks do to the residuals, the first state free.
    pub(super) fn column(&self, action: &Action) -> DVector<f64> {
        let count = action.values.len() / action.channels.len().max(1);
        let size = self.inverses.first().map_or(0, DMatrix::nrows);
        let mut reached = DVector::zeros(size);
        let mut column = DVector::zeros(self.basis.nrows());
        let mut first = 0;
        for (sample, tangent) in self.tangents.iter().enumerate() {
            let end = sample * self.between * POINTS;
            for point in std::mem::replace(&mut first, end)..end {
                for (at, &channel) in action.channels.iter().enumerate() {
                    let value = action.values[at * count + self.first + point];
                    for &(place, weight) in &self.weights[point] {
                        // A kick acts on a momentum.
                        let push = self.inverses[place].column(size / 2 + channel);
                        reached.axpy(self.spans[point] * value * weight, &push, 1.0);
                    }
                }
            }
            let rows = tangent.nrows();
            column.rows_mut(sample * rows, rows).copy_from(&(tangent * &reached));
        }
        let spanned = &self.basis * self.basis.tr_mul(&column);
        column - spanned
    }
}
