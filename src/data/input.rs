//! Inputs: what is measured and drives the motion, and what it does between its samples.
//!
//! Between two samples an input is a polynomial in time. It is made of the values and
//! derivatives at both, which stand beside the samples like any other column: a run that is
//! cut into parts keeps the input that it had as a whole.

use std::fmt;

/// What an input does between two of its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Interpolation {
    /// It keeps the value of the sample before, and jumps at the next: a converter that holds.
    Hold,
    /// A straight line from sample to sample.
    Linear,
    /// The cubic spline with a continuous second derivative; its first two pieces are one
    /// polynomial, and so are its last two.
    Spline,
    /// The signal without frequencies above half the sampling rate (Shannon), as polynomials of
    /// degree 7 with its first three derivatives. Samples must be evenly spaced.
    BandLimited,
}

impl Interpolation {
    /// All of them.
    pub const ALL: [Interpolation; 4] = [
        Interpolation::Hold,
        Interpolation::Linear,
        Interpolation::Spline,
        Interpolation::BandLimited,
    ];

    /// As it stands in a spec.
    pub fn keyword(self) -> &'static str {
        match self {
            Interpolation::Hold => "hold",
            Interpolation::Linear => "linear",
            Interpolation::Spline => "spline",
            Interpolation::BandLimited => "band_limited",
        }
    }

    /// The one that a word of a spec stands for.
    pub fn by_keyword(word: &str) -> Option<Interpolation> {
        Interpolation::ALL.into_iter().find(|one| one.keyword() == word)
    }

    /// Columns that a run keeps of an input: its values, then its derivatives by time.
    pub fn columns(self) -> usize {
        match self {
            Interpolation::Hold | Interpolation::Linear => 1,
            Interpolation::Spline => 2,
            Interpolation::BandLimited => 4,
        }
    }

    /// Coefficients of its polynomials, one more than their degree.
    pub fn coefficients(self) -> usize {
        match self {
            Interpolation::Hold => 1,
            _ => 2 * self.columns(),
        }
    }

    /// The columns of a run at `times` (ascending): the values, then the derivatives by time.
    /// Nothing is told about one stretch of time by another where `gap` lies between two samples.
    pub fn derivatives(self, times: &[f64], values: &[f64], gap: f64) -> Vec<Vec<f64>> {
        let mut columns = vec![Vec::with_capacity(values.len()); self.columns()];
        let mut from = 0;
        while from < values.len() {
            let rest = times.get(from..).unwrap_or_default();
            let steps = rest.array_windows().take_while(|[a, b]| b - a <= gap).count();
            let end = (from + steps + 1).min(values.len());
            let (times, values) =
                (rest.get(..end - from).unwrap_or_default(), values.get(from..end));
            let values = values.unwrap_or_default();
            let found = match self {
                Interpolation::Hold | Interpolation::Linear => Vec::new(),
                Interpolation::Spline => vec![spline_slopes(times, values)],
                Interpolation::BandLimited => band_limited_derivatives(times, values),
            };
            let found = std::iter::once(values.to_vec()).chain(found);
            columns.iter_mut().zip(found).for_each(|(all, found)| all.extend(found));
            from = end;
        }
        columns
    }

    /// Coefficients of the polynomial in the time since a sample, lowest power first, from the
    /// columns' entries there and at the next one, `span` later. Without a next one it goes on as
    /// the derivatives say.
    pub fn polynomial(self, here: &[f64], next: Option<(&[f64], f64)>, out: &mut [f64]) {
        out.fill(0.0);
        let mut factorial = 1.0;
        for (k, (out, derivative)) in out.iter_mut().zip(here).enumerate() {
            factorial *= k.max(1) as f64;
            *out = derivative / factorial;
        }
        let Some((next, span)) = next.filter(|(_, span)| *span > 0.0) else { return };
        if self != Interpolation::Hold {
            meet(out, here.len(), next, span);
        }
    }
}

impl fmt::Display for Interpolation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.keyword())
    }
}

/// Hermite's polynomial: given the first `known` coefficients, the next as many, so that it meets
/// the derivatives `next` after the time `span`.
///
/// In x = time / span the rest is x^m g(x), and g is expanded about x = 1.
fn meet(out: &mut [f64], known: usize, next: &[f64], span: f64) {
    let mut scaled: Vec<f64> = Vec::with_capacity(known);
    let mut power = 1.0;
    for coefficient in out.iter().take(known) {
        scaled.push(coefficient * power);
        power *= span;
    }
    // What the known part leaves of each derivative at x = 1.
    let mut rest = Vec::with_capacity(known);
    let mut power = 1.0;
    for (k, derivative) in next.iter().take(known).enumerate() {
        let falling = |j: usize| (0..k).map(|i| j.saturating_sub(i) as f64).product::<f64>();
        let of_known: f64 = scaled.iter().enumerate().map(|(j, c)| c * falling(j)).sum();
        rest.push(derivative * power - of_known);
        power *= span;
    }
    // Taylor coefficients of g at 1 by Leibniz' rule for rest * x^-m.
    let mut about_one = Vec::with_capacity(known);
    for k in 0..known {
        let mut total = 0.0;
        let mut weight = 1.0;
        for i in 0..=k {
            // (-1)^i m (m + 1) .. (m + i - 1) / i!, over (k - i)!.
            let factorial: f64 = (1..=k - i).map(|n| n as f64).product();
            total += weight * rest.get(k - i).copied().unwrap_or(0.0) / factorial;
            weight *= -((known + i) as f64) / (i + 1) as f64;
        }
        about_one.push(total);
    }
    // From powers of x - 1 to powers of x, by Horner's rule.
    let mut of_x = vec![0.0; known];
    for coefficient in about_one.iter().rev() {
        let mut carried = *coefficient;
        for place in of_x.iter_mut() {
            let before = *place;
            *place = carried - before;
            carried = before;
        }
    }
    let mut power = span.powi(known as i32);
    for (place, coefficient) in out.iter_mut().skip(known).zip(of_x) {
        *place = coefficient / power;
        power *= span;
    }
}

/// Slopes of the cubic spline ("not a knot": C. de Boor, A Practical Guide to Splines, chapter IV)
/// at its samples. Two samples make a line, three a parabola.
fn spline_slopes(times: &[f64], values: &[f64]) -> Vec<f64> {
    let steps: Vec<f64> = times.array_windows().map(|[a, b]| b - a).collect();
    let rises: Vec<f64> =
        values.array_windows().zip(&steps).map(|([a, b], step)| (b - a) / step).collect();
    match (steps.as_slice(), rises.as_slice()) {
        ([], _) | (_, []) => return vec![0.0; values.len()],
        ([_], [rise]) => return vec![*rise; 2],
        ([a, b], [left, right]) => {
            let bend = (right - left) / (a + b);
            return vec![left - a * bend, left + a * bend, right + b * bend];
        }
        _ => {}
    }
    // Rows (below, on, above the diagonal, right side), eliminated from the top as they come.
    let mut rows: Vec<[f64; 3]> = Vec::with_capacity(values.len());
    let mut eliminate = |[below, on, above, right]: [f64; 4]| {
        let row = match rows.last() {
            None => [on, above, right],
            Some([pivot, beside, known]) => {
                let factor = below / pivot;
                [on - factor * beside, above, right - factor * known]
            }
        };
        rows.push(row);
    };
    if let ([a, b, ..], [left, right, ..]) = (steps.as_slice(), rises.as_slice()) {
        let both = a + b;
        eliminate([0.0, *b, both, ((a + 2.0 * both) * b * left + a * a * right) / both]);
    }
    for ([a, b], [left, right]) in steps.array_windows().zip(rises.array_windows()) {
        eliminate([*b, 2.0 * (a + b), *a, 3.0 * (b * left + a * right)]);
    }
    if let ([.., a, b], [.., left, right]) = (steps.as_slice(), rises.as_slice()) {
        let both = a + b;
        eliminate([both, *a, 0.0, (b * b * left + (2.0 * both + b) * a * right) / both]);
    }
    let mut slopes = vec![0.0; values.len()];
    let mut after = 0.0;
    for (slope, [on, above, right]) in slopes.iter_mut().zip(&rows).rev() {
        after = (right - above * after) / on;
        *slope = after;
    }
    slopes
}

/// Samples on either side that a band-limited value is made of.
const REACH: usize = 40;
/// Variance of the window in squared samples. Of what oscillates at a part f of the highest
/// frequency it loses erfc((1 - f) pi sqrt(variance / 2)): 1e-13 at 0.7, 1e-2 at 0.9.
const WINDOW: f64 = 64.0;

/// First to third derivatives of the band-limited signal at its evenly spaced samples.
///
/// Shannon's series with a Gaussian window (L. Qian, Proc. Am. Math. Soc. 131, 2003). Beyond its
/// ends a record is continued by turning it about its last sample.
fn band_limited_derivatives(times: &[f64], values: &[f64]) -> Vec<Vec<f64>> {
    let count = values.len();
    let mut columns = vec![vec![0.0; count]; 3];
    let (Some(first), Some(last)) = (times.first(), times.last()) else { return columns };
    if count < 2 {
        return columns;
    }
    let step = (last - first) / (count - 1) as f64;
    let weights = shannon_weights();
    let extended: Vec<f64> =
        (0..count + 2 * REACH).map(|at| continued(values, at as isize - REACH as isize)).collect();
    for (at, around) in extended.windows(2 * REACH + 1).enumerate() {
        let mut scale = 1.0;
        for (column, weights) in columns.iter_mut().zip(&weights) {
            scale /= step;
            let sum: f64 = weights.iter().zip(around).map(|(w, x)| w * x).sum();
            if let Some(place) = column.get_mut(at) {
                *place = scale * sum;
            }
        }
    }
    columns
}

/// What the samples from `REACH` before to `REACH` after weigh in each derivative.
fn shannon_weights() -> [Vec<f64>; 3] {
    let mut weights = [(); 3].map(|()| Vec::with_capacity(2 * REACH + 1));
    for at in 0..=2 * REACH {
        // The sample's own sinc, centred there, is looked at from this distance.
        let x = REACH as f64 - at as f64;
        let square = std::f64::consts::PI.powi(2);
        let (first, second, third) = if x == 0.0 {
            (0.0, -square / 3.0, 0.0)
        } else {
            let sign = if at.abs_diff(REACH).is_multiple_of(2) { 1.0 } else { -1.0 };
            (sign / x, -2.0 * sign / (x * x), sign * (6.0 / x.powi(3) - square / x))
        };
        let own = if x == 0.0 { 1.0 } else { 0.0 };
        let window = (-0.5 * x * x / WINDOW).exp();
        let slope = -x / WINDOW * window;
        let bend = (x * x / WINDOW - 1.0) / WINDOW * window;
        let derivatives = [
            first * window + own * slope,
            second * window + 2.0 * first * slope + own * bend,
            third * window + 3.0 * second * slope + 3.0 * first * bend,
        ];
        weights.iter_mut().zip(derivatives).for_each(|(list, weight)| list.push(weight));
    }
    weights
}

/// A sample of a record that goes on beyond both ends, turned about them.
fn continued(values: &[f64], at: isize) -> f64 {
    let last = values.len() as isize - 1;
    let of = |at: isize| values.get(at as usize).copied().unwrap_or(0.0);
    let (mut at, mut sign, mut added) = (at, 1.0, 0.0);
    while at < 0 || at > last {
        let end = if at < 0 { 0 } else { last };
        added += sign * 2.0 * of(end);
        sign = -sign;
        at = 2 * end - at;
    }
    added + sign * of(at)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The input at a time between samples.
    fn value(between: Interpolation, times: &[f64], columns: &[Vec<f64>], time: f64) -> f64 {
        let at = times.partition_point(|t| *t <= time).clamp(1, times.len() - 1) - 1;
        let node = |at: usize| columns.iter().map(|c| c[at]).collect::<Vec<f64>>();
        let mut out = vec![0.0; between.coefficients()];
        let span = times[at + 1] - times[at];
        between.polynomial(&node(at), Some((&node(at + 1), span)), &mut out);
        out.iter().rev().fold(0.0, |sum, c| sum * (time - times[at]) + c)
    }

    fn worst(between: Interpolation, times: &[f64], of: impl Fn(f64) -> f64) -> f64 {
        let values: Vec<f64> = times.iter().map(|t| of(*t)).collect();
        let columns = between.derivatives(times, &values, f64::INFINITY);
        let (first, last) = (times[0], times[times.len() - 1]);
        (0..=1000)
            .map(|k| first + (last - first) * (0.3 + 0.4 * f64::from(k) / 1000.0))
            .map(|t| (value(between, times, &columns, t) - of(t)).abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn each_is_exact_for_the_polynomials_that_it_is_made_of() {
        let times = [0.0, 0.7, 1.0, 2.2, 2.9, 4.0, 4.1];
        for (between, degree) in
            [(Interpolation::Hold, 0), (Interpolation::Linear, 1), (Interpolation::Spline, 3)]
        {
            let of = |t: f64| (1.0 - 0.3 * t).powi(degree);
            let values = times.map(of);
            let columns = between.derivatives(&times, &values, f64::INFINITY);
            for k in 0..=410 {
                let t = 0.01 * f64::from(k);
                assert!((value(between, &times, &columns, t) - of(t)).abs() < 1e-12, "{between}");
            }
        }
    }

    #[test]
    fn a_spline_is_of_the_fourth_order_and_smooth() {
        let error = |n: usize| {
            let times: Vec<f64> = (0..=n).map(|i| 6.0 * i as f64 / n as f64).collect();
            worst(Interpolation::Spline, &times, |t| (2.0 * t).sin())
        };
        let order = (error(40) / error(80)).log2();
        assert!((3.7..4.5).contains(&order), "{order}");
    }

    #[test]
    fn a_band_limited_signal_comes_back() {
        let times: Vec<f64> = (0..400).map(|i| 0.1 * f64::from(i)).collect();
        let highest = std::f64::consts::PI / 0.1;
        // What the window loses at 0.9 is erfc(0.1 pi sqrt(32)) = 0.012; below 0.7 it is the
        // polynomials between the samples that err.
        for (part, tolerance) in [(0.1, 1e-8), (0.5, 2e-5), (0.7, 2e-4), (0.9, 0.013)] {
            let worst = worst(Interpolation::BandLimited, &times, |t| (part * highest * t).sin());
            assert!(worst < tolerance, "{part}: {worst}");
        }
    }

    #[test]
    fn nothing_crosses_a_gap() {
        let times = [0.0, 1.0, 2.0, 3.0, 100.0, 101.0, 102.0, 103.0];
        let values = [0.0, 1.0, 4.0, 9.0, 0.0, 5.0, 5.0, -7.0];
        let all = Interpolation::Spline.derivatives(&times, &values, 10.0);
        let before = Interpolation::Spline.derivatives(&times[..4], &values[..4], 10.0);
        assert_eq!(all[1][..4], before[1]);
        assert_eq!(Interpolation::Hold.derivatives(&times, &values, 10.0), [values.to_vec()]);
    }
}
