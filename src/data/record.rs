//! What was measured of all runs, and what inputs did at any time of it.

use std::ops::Range;
use std::sync::OnceLock;

use super::Interpolation;

/// The columns of packed runs, one run after the other.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Record {
    pub(super) times: Vec<f64>,
    /// `[observable][sample]`, then the columns of the inputs; NaN where nothing was measured.
    pub(super) values: Vec<Vec<f64>>,
    /// First sample of each run, and the one after its last.
    pub(super) places: Vec<[usize; 2]>,
    /// Inputs, whose columns stand behind those of the observables.
    pub(super) inputs: Vec<PackedInput>,
    /// Of each input its polynomials from every sample on, laid out as the samples are; made when
    /// one is first looked up.
    pub(super) pieces: OnceLock<Vec<Vec<f64>>>,
}

/// An input among the columns of packed runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PackedInput {
    /// The first of its columns.
    pub column: usize,
    pub between: Interpolation,
}

impl Record {
    pub(super) fn samples_of(&self, run: usize) -> Range<usize> {
        self.places.get(run).map_or(0..0, |&[start, end]| start..end)
    }

    /// Sample times of a run since its clock's origin.
    pub fn times_of(&self, run: usize) -> &[f64] {
        self.times.get(self.samples_of(run)).unwrap_or_default()
    }

    fn values_of(&self, column: usize, run: usize) -> &[f64] {
        let column = self.values.get(column).map_or(&[][..], Vec::as_slice);
        column.get(self.samples_of(run)).unwrap_or_default()
    }

    /// Coefficients, lowest power first, of an input in the time since a sample of a run, until the
    /// next sample; where nothing is followed beyond that sample (`ends`), as it came there.
    pub(super) fn driving(
        &self,
        input: usize,
        run: usize,
        sample: usize,
        ends: bool,
        out: &mut [f64],
    ) {
        out.fill(0.0);
        let Some(PackedInput { column, between }) = self.inputs.get(input).copied() else { return };
        let Some(out) = out.get_mut(..between.coefficients()) else { return };
        let mut nodes = [[0.0; 4]; 2];
        let count = between.columns();
        let from = if ends && between != Interpolation::Hold { sample.max(1) - 1 } else { sample };
        for k in 0..count {
            let values = self.values_of(column + k, run);
            for (node, at) in nodes.iter_mut().zip([from, from + 1]) {
                if let (Some(place), Some(value)) = (node.get_mut(k), values.get(at)) {
                    *place = *value;
                }
            }
        }
        let times = self.times_of(run);
        let span = times.get(from + 1).zip(times.get(from)).map(|(next, here)| next - here);
        let [here, next] = &nodes;
        let (Some(here), next) = (here.get(..count), next.get(..count)) else { return };
        between.polynomial(here, next.zip(span), out);
        if let Some(span) = span.filter(|_| from < sample) {
            shift(out, span);
        }
    }

    /// An input, or its derivative by time of an order above 0, at a time since the origin of the
    /// run's clock. Nothing is known of it beyond the run: there it keeps its first or last value.
    pub fn input_at(&self, input: usize, order: usize, run: usize, time: f64) -> f64 {
        let samples = self.samples_of(run);
        let times = self.times.get(samples.clone()).unwrap_or_default();
        let (Some(first), Some(last)) = (times.first(), times.last()) else { return f64::NAN };
        let Some(between) = self.inputs.get(input).map(|input| input.between) else {
            return f64::NAN;
        };
        let outside = time < *first || time > *last;
        if outside && order > 0 {
            return 0.0;
        }
        let time = time.clamp(*first, *last);
        let sample = times.partition_point(|t| *t <= time).max(1) - 1;
        let since = time - times.get(sample).copied().unwrap_or(time);
        let count = between.coefficients();
        let start = (samples.start + sample) * count;
        let pieces = self.pieces.get_or_init(|| self.all_pieces());
        let piece = pieces.get(input).and_then(|pieces| pieces.get(start..start + count));
        let powers = piece.unwrap_or_default().iter().enumerate().skip(order).rev();
        powers.fold(0.0, |sum, (power, coefficient)| {
            let factor: f64 = (power - order + 1..=power).map(|k| k as f64).product();
            sum * since + factor * coefficient
        })
    }

    fn all_pieces(&self) -> Vec<Vec<f64>> {
        let of = |(input, packed): (usize, &PackedInput)| {
            let count = packed.between.coefficients();
            let mut out = vec![0.0; self.times.len() * count];
            for run in 0..self.places.len() {
                let samples = self.samples_of(run);
                let length = samples.len();
                let places = out.get_mut(samples.start * count..samples.end * count);
                let places = places.into_iter().flat_map(|all| all.chunks_exact_mut(count));
                for (sample, place) in places.enumerate() {
                    self.driving(input, run, sample, sample + 1 == length, place);
                }
            }
            out
        };
        self.inputs.iter().enumerate().map(of).collect()
    }
}

/// The same polynomial in the time since a later moment (Taylor shift by Horner's rule).
fn shift(coefficients: &mut [f64], by: f64) {
    for first in 0..coefficients.len() {
        let rest = coefficients.get_mut(first..).unwrap_or_default();
        let mut above = 0.0;
        for coefficient in rest.iter_mut().rev() {
            *coefficient += by * above;
            above = *coefficient;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{MeasuredInput, Packed};

    #[test]
    fn inputs_are_known_between_samples_and_kept_beyond_them() {
        for between in [Interpolation::Linear, Interpolation::Spline] {
            let times: Vec<f64> = (0..9).map(|i| 1.0 + 0.5 * f64::from(i)).collect();
            let values: Vec<f64> = times.iter().map(|t| 2.0 - 3.0 * t).collect();
            let columns = between.derivatives(&times, &values, f64::INFINITY);
            let inputs = [MeasuredInput { name: "u".into(), between }];
            let packed = Packed::run_of(times, columns).driven_by(0, &inputs);
            let at = |order, time| packed.record().input_at(0, order, 0, time);
            for time in [1.0, 1.3, 2.0, 4.99, 5.0] {
                assert!((at(0, time) - (2.0 - 3.0 * time)).abs() < 1e-12, "{between} {time}");
                assert!((at(1, time) + 3.0).abs() < 1e-12, "{between} {time}");
            }
            assert_eq!([at(0, 0.0), at(1, 0.0)], [-1.0, 0.0]);
            assert!((at(0, 7.0) + 13.0).abs() < 1e-12);
            assert!(packed.record().input_at(1, 0, 0, 2.0).is_nan());
        }
    }
}
