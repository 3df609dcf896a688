//! Inputs on their way into the equations of motion.

/// What inputs do in one interval: of each lane and each input a polynomial in the time since the
/// beginning of the interval.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Drive {
    powers: usize,
    lanes: usize,
    /// `[input][power][lane]`.
    coefficients: Vec<f64>,
}

impl Drive {
    /// Inputs that are zero; polynomials of `powers` coefficients.
    pub fn new(inputs: usize, powers: usize, lanes: usize) -> Drive {
        Drive { powers, lanes, coefficients: vec![0.0; inputs * powers * lanes] }
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

    /// Makes the end of a span of time the beginning (Taylor shift by Horner's rule).
    pub fn go_on(&mut self, span: &[f64]) {
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
}
