//! Inputs on their way into the equations of motion.

use std::sync::Arc;

use super::lanes::{gathered, scatter};
use crate::data::Record;

/// What inputs do in one interval: of each lane and each input a polynomial in the time since the
/// beginning of the interval.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Drive {
    powers: usize,
    lanes: usize,
    /// `[input][power][lane]`.
    coefficients: Vec<f64>,
    /// Where delayed inputs are looked up; nothing where none was given.
    past: Option<Past>,
}

/// What inputs did before the present interval.
#[derive(Debug, Clone)]
struct Past {
    record: Arc<Record>,
    /// Of each lane its run, and the time at the beginning of the interval.
    places: Vec<(usize, f64)>,
}

impl PartialEq for Past {
    fn eq(&self, other: &Past) -> bool {
        Arc::ptr_eq(&self.record, &other.record) && self.places == other.places
    }
}

impl Drive {
    /// Inputs that are zero; polynomials of `powers` coefficients.
    pub fn new(inputs: usize, powers: usize, lanes: usize) -> Drive {
        let coefficients = vec![0.0; inputs * powers * lanes];
        Drive { powers, lanes, coefficients, past: None }
    }

    /// All coefficients, `[input][power][lane]`, lowest power first.
    pub fn coefficients_mut(&mut self) -> &mut [f64] {
        &mut self.coefficients
    }

    /// Sets the polynomial of an input in one lane; higher coefficients are zero.
    pub fn set(&mut self, input: usize, lane: usize, coefficients: &[f64]) {
        let start = input * self.powers * self.lanes + lane;
        let places = self.coefficients[start..].iter_mut().step_by(self.lanes).take(self.powers);
        let given = coefficients.iter().copied().chain(std::iter::repeat(0.0));
        places.zip(given).for_each(|(place, x)| *place = x);
    }

    /// Says where a lane stands in a record: the run, and the time since the origin of its clock.
    pub fn stand(&mut self, record: &Arc<Record>, lane: usize, run: usize, time: f64) {
        let lanes = self.lanes;
        let past = self.past.get_or_insert_with(|| Past {
            record: record.clone(),
            places: vec![(run, time); lanes],
        });
        if !Arc::ptr_eq(&past.record, record) {
            past.record = record.clone();
        }
        if let Some(place) = past.places.get_mut(lane) {
            *place = (run, time);
        }
    }

    /// The same of some lanes.
    pub(super) fn of(&self, lanes: &[usize]) -> Drive {
        let past = self.past.as_ref().map(|past| Past {
            record: past.record.clone(),
            places: lanes.iter().map(|&lane| past.places[lane]).collect(),
        });
        let coefficients = gathered(&self.coefficients, self.lanes, lanes);
        Drive { powers: self.powers, lanes: lanes.len(), coefficients, past }
    }

    /// Takes some lanes back.
    pub(super) fn take_back(&mut self, lanes: &[usize], some: &Drive) {
        scatter(&mut self.coefficients, self.lanes, lanes, &some.coefficients);
        if let (Some(past), Some(some)) = (&mut self.past, &some.past) {
            lanes.iter().zip(&some.places).for_each(|(&lane, place)| past.places[lane] = *place);
        }
    }

    /// Makes the end of a span of time the beginning (Taylor shift by Horner's rule).
    pub fn go_on(&mut self, span: &[f64]) {
        if let Some(past) = &mut self.past {
            past.places.iter_mut().zip(span).for_each(|((_, time), span)| *time += span);
        }
        if self.lanes == 0 || self.powers < 2 {
            return;
        }
        for rows in self.coefficients.chunks_exact_mut(self.powers * self.lanes) {
            for first in 0..self.powers - 1 {
                for power in (first..self.powers - 1).rev() {
                    let (low, high) = rows.split_at_mut((power + 1) * self.lanes);
                    let low = &mut low[power * self.lanes..];
                    for ((low, high), span) in low.iter_mut().zip(high).zip(span) {
                        *low += span * *high;
                    }
                }
            }
        }
    }

    /// Puts the derivative of the given order of an input at the times `since` the beginning,
    /// `[lanes]`, behind what stands in `out`. An input that is not there is not a number.
    pub(super) fn append(&self, input: usize, order: usize, since: &[f64], out: &mut Vec<f64>) {
        let size = self.powers * self.lanes;
        let Some(rows) = self.coefficients.get(input * size..(input + 1) * size) else {
            return out.resize(out.len() + since.len(), f64::NAN);
        };
        let first = out.len();
        out.resize(first + since.len(), 0.0);
        let values = &mut out[first..];
        for power in (order..self.powers).rev() {
            let row = &rows[power * self.lanes..(power + 1) * self.lanes];
            let factor: f64 = (power - order + 1..=power).map(|k| k as f64).product();
            for ((value, since), coefficient) in values.iter_mut().zip(since).zip(row) {
                *value = *value * since + factor * coefficient;
            }
        }
    }

    /// The same of what an input did `by` before. Without a record of the past it was at rest.
    pub(super) fn append_delayed(
        &self,
        (input, order, by): (usize, usize, f64),
        since: &[f64],
        out: &mut Vec<f64>,
    ) {
        let Some(Past { record, places }) = &self.past else {
            return out.resize(out.len() + since.len(), 0.0);
        };
        let at = |((run, time), since): (&(usize, f64), &f64)| {
            record.input_at(input, order, *run, time + since - by)
        };
        out.extend(places.iter().zip(since).map(at));
    }
}
