//! Measures turned round: the curve q(t) that shows what was measured, without a law.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::banded::Banded;
use super::shown::{Row, Shown};
use crate::data::Packed;
use crate::expr::Symbol;

/// Weight of a coordinate by itself, in units of what its own measures weigh: where these show its
/// place it decides nothing; where they show rates alone it keeps slow waves out, which an
/// integration makes large. At the frequency of the motion it takes a hundredth away.
const SHRINK_PLACES: f64 = 1e-4;
const SHRINK_RATES: f64 = 0.1;
/// Weight of differences of the second order: they bridge samples without a value.
const SMOOTH: f64 = 1e-3;
/// Steps of a search, at most, for all samples together and for one.
const STEPS: usize = 40;
const STEPS_OF_ONE: usize = 25;
/// A search ends where a step takes less than this part of the misfit off.
const STILL: f64 = 1e-7;
/// Mean square of a sample's misfit, in units of the spread, above which other starts are tried.
const MISSED: f64 = 0.05;
/// A crossing of the mean counts once the signal was this part of its spread beyond it.
const BEYOND: f64 = 0.4;

/// By what part of itself the diagonal of a normal matrix grows (Marquardt, SIAM J. 11, 1963).
struct Damping(f64);

impl Damping {
    /// After a step that helped; never to nothing, for what nothing measures stays in the matrix.
    fn fall(&mut self) {
        self.0 = (0.1 * self.0).max(1e-12);
    }

    /// After one that did not; true where steps have become too short to go on.
    fn grow(&mut self) -> bool {
        self.0 *= 10.0;
        self.0 > 1e8
    }
}

/// A column with straight lines through what is missing, the shorter way round for an angle; the
/// nearest value at the ends.
fn filled(times: &[f64], column: &[f64], period: Option<f64>) -> Vec<f64> {
    let seen: Vec<usize> = (0..column.len()).filter(|&k| column[k].is_finite()).collect();
    let mut out = column.to_vec();
    let (Some(&first), Some(&last)) = (seen.first(), seen.last()) else { return out };
    out[..first].fill(column[first]);
    out[last..].fill(column[last]);
    for pair in seen.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let mut change = column[b] - column[a];
        if let Some(period) = period {
            change -= period * (change / period).round();
        }
        for k in a + 1..b {
            out[k] = column[a] + change * (times[k] - times[a]) / (times[b] - times[a]);
        }
    }
    out
}

/// How rates at a sample follow from three samples.
#[derive(Clone, Copy)]
struct Stencil {
    first: usize,
    count: usize,
    velocity: [f64; 3],
    acceleration: [f64; 3],
}

impl Stencil {
    /// Of the parabola through the three samples around one, or the first or last three.
    fn all(times: &[f64]) -> Vec<Stencil> {
        let m = times.len();
        let of = |k: usize| {
            let mut stencil =
                Stencil { first: 0, count: m.min(3), velocity: [0.0; 3], acceleration: [0.0; 3] };
            if m == 2 {
                let step = times[1] - times[0];
                stencil.velocity = [-1.0 / step, 1.0 / step, 0.0];
            }
            if m >= 3 {
                stencil.first = k.saturating_sub(1).min(m - 3);
                let t: Vec<f64> = times[stencil.first..stencil.first + 3].to_vec();
                for s in 0..3 {
                    let (a, b) = (t[(s + 1) % 3], t[(s + 2) % 3]);
                    let under = (t[s] - a) * (t[s] - b);
                    stencil.velocity[s] = (2.0 * times[k] - a - b) / under;
                    stencil.acceleration[s] = 2.0 / under;
                }
            }
            stencil
        };
        (0..m).map(of).collect()
    }
}

/// Velocity and acceleration at a sample by the two before it: each is so many times its own place,
/// and something of each coordinate beside.
struct Past {
    rates: [(f64, Vec<f64>); 2],
}

/// A stretch of a run whose curve is looked for.
pub(super) struct Curve<'a> {
    shown: &'a Shown,
    /// `[row][sample]`.
    measured: Vec<Vec<f64>>,
    /// The same with straight lines through what is missing: columns may have different rates.
    filled: Vec<Vec<f64>>,
    stencils: Vec<Stencil>,
    times: Vec<f64>,
    /// What drives, `[symbol][sample]`.
    driving: Vec<Vec<f64>>,
    /// The usual interval between samples.
    step: f64,
    duration: f64,
}

/// What a curve shows, and how that follows it.
struct Linear {
    /// Weighted predicted minus measured, `[row][sample]`; 0 where nothing was measured.
    residuals: Vec<Vec<f64>>,
    /// Weighted derivatives, `[row][component][sample]`.
    slopes: Vec<Vec<Vec<f64>>>,
}

impl Linear {
    fn squares(&self) -> f64 {
        self.residuals.iter().flatten().map(|r| r * r).sum()
    }
}

impl<'a> Curve<'a> {
    /// Samples of a run.
    pub(super) fn new(
        shown: &'a Shown,
        packed: &Packed,
        run: usize,
        samples: Range<usize>,
    ) -> Curve<'a> {
        let times = &packed.times_of(run)[samples.clone()];
        let measured = |row: &Row| packed.values_of(row.observable, run)[samples.clone()].to_vec();
        let powers = packed.driven().1;
        let driven = |symbol: &Symbol| {
            let clock = packed.clock_of(run);
            let mut coefficients = vec![0.0; powers];
            let value = |(k, time): (usize, &f64)| match *symbol {
                Symbol::Input(input, order) => {
                    packed.driving(input, run, samples.start + k, false, &mut coefficients);
                    let factor = (1..=order).map(|k| k as f64).product::<f64>();
                    coefficients.get(order).map_or(0.0, |x| x * factor)
                }
                Symbol::Delayed(input, order, by) => {
                    // A delay that is looked for is left out of a first guess.
                    let by = by.number().unwrap_or(0.0);
                    packed.record().input_at(input, order, run, time - by)
                }
                _ => clock.time(*time),
            };
            times.iter().enumerate().map(value).collect()
        };
        let duration = times.last().copied().unwrap_or(0.0) - times.first().copied().unwrap_or(0.0);
        let measured: Vec<Vec<f64>> = shown.rows.iter().map(measured).collect();
        let columns = shown.rows.iter().zip(&measured);
        Curve {
            shown,
            filled: columns.map(|(row, column)| filled(times, column, row.period)).collect(),
            measured,
            stencils: Stencil::all(times),
            times: times.to_vec(),
            driving: shown.driven.iter().map(driven).collect(),
            step: duration / (times.len().max(2) - 1) as f64,
            duration,
        }
    }

    /// The curve, `[sample][coordinate]`, from where the stretch `before` it ended.
    pub(super) fn found(&self, before: Option<&[f64]>) -> Vec<f64> {
        let first = self.placed(before, false);
        let rates = self.shown.rows.iter().any(|row| row.of_rates);
        let mut starts = vec![first.clone()];
        if rates {
            starts.push(self.placed(before, true));
            for phase in [0.0, 0.5, 1.0, 1.5] {
                starts.push(self.waved(&first, phase * std::f64::consts::PI));
            }
        }
        let mut best: Option<(f64, Vec<f64>)> = None;
        for start in starts {
            let (left, curve) = self.settled(start);
            if best.as_ref().is_none_or(|(least, _)| left < 0.99 * least) && left.is_finite() {
                best = Some((left, curve));
            }
        }
        best.map_or(first, |(_, curve)| curve)
    }

    /// Values and derivatives along a curve.
    fn linear(&self, curve: &[f64], of: Range<usize>) -> Linear {
        let (n, lanes) = (self.shown.degrees, of.len());
        let mut points = vec![0.0; (3 * n + self.shown.driven.len()) * lanes];
        for (lane, k) in of.clone().enumerate() {
            let stencil = &self.stencils[k];
            for i in 0..n {
                points[i * lanes + lane] = curve[k * n + i];
                for s in 0..stencil.count {
                    let x = curve[(stencil.first + s) * n + i];
                    points[(n + i) * lanes + lane] += stencil.velocity[s] * x;
                    points[(2 * n + i) * lanes + lane] += stencil.acceleration[s] * x;
                }
            }
            for (at, values) in self.driving.iter().enumerate() {
                points[(3 * n + at) * lanes + lane] = values[k];
            }
        }
        self.at(&points, of, &self.measured)
    }

    /// The same at points of the curve, `[component][lane]`, before some columns.
    fn at(&self, points: &[f64], of: Range<usize>, columns: &[Vec<f64>]) -> Linear {
        let (n, lanes, shown) = (self.shown.degrees, of.len(), self.shown);
        let mut out = vec![0.0; shown.evaluator.outputs() * lanes];
        shown.evaluator.evaluate(points, &shown.parameters, lanes, &mut out, &mut Vec::new());
        let count = shown.rows.len();
        let mut linear = Linear { residuals: Vec::new(), slopes: Vec::new() };
        for (r, row) in shown.rows.iter().enumerate() {
            let measured = &columns[r][of.clone()];
            let residual = |(lane, &measured): (usize, &f64)| {
                let mut apart = out[r * lanes + lane] - measured;
                if let Some(period) = row.period {
                    apart -= period * (apart / period).round();
                }
                if measured.is_finite() { row.weight * apart } else { 0.0 }
            };
            let residuals: Vec<f64> = measured.iter().enumerate().map(residual).collect();
            let slope = |component: usize| {
                let from = (count + r * 3 * n + component) * lanes;
                let slopes = out[from..from + lanes].iter().zip(measured);
                let of = |(x, m): (&f64, &f64)| if m.is_finite() { row.weight * x } else { 0.0 };
                slopes.map(of).collect()
            };
            linear.slopes.push((0..3 * n).map(slope).collect());
            linear.residuals.push(residuals);
        }
        linear
    }

    /// Places sample by sample, each from where those before it were going: by what shows places,
    /// and where rates are `followed` by these too, as differences to the samples before.
    fn placed(&self, before: Option<&[f64]>, followed: bool) -> Vec<f64> {
        let (n, m) = (self.shown.degrees, self.stencils.len());
        let mut curve = vec![0.0; m * n];
        if !followed && self.shown.rows.iter().all(|row| row.of_rates) {
            return curve;
        }
        let mut known = before.map(|before| vec![before.to_vec()]).unwrap_or_default();
        for k in 0..m {
            let from: Vec<f64> = match known.as_slice() {
                [] => vec![0.0; n],
                [.., a, b] => a.iter().zip(b).map(|(a, b)| 2.0 * b - a).collect(),
                [only] => only.clone(),
            };
            let past = self.past(k, &curve, followed);
            let looked = |row: &Row| past.is_some() || !row.of_rates;
            let there = |(r, row): (usize, &Row)| looked(row) && self.filled[r][k].is_finite();
            let place = if self.shown.rows.iter().enumerate().any(there) {
                self.place_among(k, from, &known, past.as_ref())
            } else {
                known.last().cloned().unwrap_or(from)
            };
            curve[k * n..(k + 1) * n].copy_from_slice(&place);
            known.push(place);
            if known.len() > 2 {
                known.remove(0);
            }
        }
        curve
    }

    /// What the two samples before one say of its rates; `None` where there are no two.
    fn past(&self, k: usize, curve: &[f64], followed: bool) -> Option<Past> {
        let n = self.shown.degrees;
        let first = k.checked_sub(2).filter(|_| followed)?;
        let [t0, t1, t2] = [self.times[first], self.times[first + 1], self.times[k]];
        let (whole, near, old) = (t2 - t0, t2 - t1, t1 - t0);
        let velocity =
            [near / (old * whole), -whole / (old * near), (near + whole) / (near * whole)];
        let acceleration = [2.0 / (old * whole), -2.0 / (old * near), 2.0 / (near * whole)];
        let of = |weights: [f64; 3]| {
            let rest = |i: usize| {
                weights[0] * curve[first * n + i] + weights[1] * curve[(first + 1) * n + i]
            };
            (weights[2], (0..n).map(rest).collect())
        };
        Some(Past { rates: [of(velocity), of(acceleration)] })
    }

    /// The place of one sample: from where the motion was going, and from all around where that
    /// misses what was measured.
    fn place_among(
        &self,
        k: usize,
        from: Vec<f64>,
        known: &[Vec<f64>],
        past: Option<&Past>,
    ) -> Vec<f64> {
        let (mut left, mut place) = self.place(k, &from, past);
        if left < MISSED && !known.is_empty() {
            return place;
        }
        for start in known.last().into_iter().chain(&self.candidates()) {
            if left < MISSED && !known.is_empty() {
                break;
            }
            let (other, found) = self.place(k, start, past);
            if other < 0.9 * left || !left.is_finite() {
                (left, place) = (other, found);
            }
        }
        place
    }

    /// Starts all around: along the axes and between them, of several sizes.
    fn candidates(&self) -> Vec<Vec<f64>> {
        let n = self.shown.degrees;
        let mut out = Vec::new();
        for &size in &self.shown.sizes {
            for i in 0..n {
                for sign in [1.0, -1.0] {
                    out.push(
                        (0..n).map(|j| if i == j { sign * size } else { 0.1 * size }).collect(),
                    );
                }
            }
            for turn in 0..4 {
                let of = |j: usize| size * (1.3 + 2.1 * turn as f64 + 1.7 * j as f64).sin();
                out.push((0..n).map(of).collect());
            }
        }
        out
    }

    /// Levenberg-Marquardt for one sample: what is left, and where. Without a past no rates count.
    fn place(&self, k: usize, start: &[f64], past: Option<&Past>) -> (f64, Vec<f64>) {
        let n = self.shown.degrees;
        let look = |place: &[f64]| {
            let mut points = vec![0.0; 3 * n + self.shown.driven.len()];
            points[..n].copy_from_slice(place);
            for (order, (weight, rest)) in past.iter().flat_map(|past| &past.rates).enumerate() {
                for i in 0..n {
                    points[(order + 1) * n + i] = weight * place[i] + rest[i];
                }
            }
            for (at, values) in self.driving.iter().enumerate() {
                points[3 * n + at] = values[k];
            }
            let mut linear = self.at(&points, k..k + 1, &self.filled);
            for (r, row) in self.shown.rows.iter().enumerate() {
                if row.of_rates && past.is_none() {
                    linear.residuals[r][0] = 0.0;
                    linear.slopes[r].iter_mut().for_each(|slope| slope[0] = 0.0);
                }
                for (order, (weight, _)) in past.iter().flat_map(|past| &past.rates).enumerate() {
                    for i in 0..n {
                        let by_rate = linear.slopes[r][(order + 1) * n + i][0];
                        linear.slopes[r][i][0] += weight * by_rate;
                    }
                }
            }
            (linear.squares(), linear)
        };
        let mut place = start.to_vec();
        let (mut left, mut linear) = look(&place);
        let mut damping = Damping(1e-3);
        for _ in 0..STEPS_OF_ONE {
            let mut normal = DMatrix::<f64>::zeros(n, n);
            let mut down = DVector::<f64>::zeros(n);
            for (residuals, slopes) in linear.residuals.iter().zip(&linear.slopes) {
                for i in 0..n {
                    let slope = slopes[i][0];
                    down[i] -= slope * residuals[0];
                    for j in 0..n {
                        normal[(i, j)] += slope * slopes[j][0];
                    }
                }
            }
            let size = normal.diagonal().max().max(f64::MIN_POSITIVE);
            for i in 0..n {
                normal[(i, i)] += damping.0 * normal[(i, i)] + 1e-9 * size;
            }
            let Some(step) = normal.cholesky().map(|factor| factor.solve(&down)) else { break };
            let trial: Vec<f64> = place.iter().zip(step.iter()).map(|(x, s)| x + s).collect();
            let (after, next) = look(&trial);
            if after <= left {
                let done = left - after <= STILL * left;
                (left, linear, place) = (after, next, trial);
                damping.fall();
                if done {
                    break;
                }
            } else {
                if damping.grow() {
                    break;
                }
            }
        }
        (if left.is_finite() { left } else { f64::INFINITY }, place)
    }

    /// A frequency of what was measured: half turns counted by crossings of the mean.
    fn frequency(&self) -> f64 {
        let mut most: f64 = 1.0;
        for (row, column) in self.shown.rows.iter().zip(&self.measured) {
            if row.period.is_some() {
                continue;
            }
            let seen: Vec<f64> = column.iter().copied().filter(|x| x.is_finite()).collect();
            let mean = seen.iter().sum::<f64>() / seen.len().max(1) as f64;
            let (mut side, mut crossings) = (0.0, 0.0);
            for x in seen.iter().map(|x| (x - mean) * row.weight).filter(|x| x.abs() > BEYOND) {
                if side != 0.0 && x.signum() != side {
                    crossings += 1.0;
                }
                side = x.signum();
            }
            most = most.max(crossings);
        }
        std::f64::consts::PI * most / self.duration.max(f64::MIN_POSITIVE)
    }

    /// Of each coordinate what its places, velocities and accelerations weigh along a curve, the
    /// rates at a frequency.
    fn responses(&self, linear: &Linear, frequency: f64) -> Vec<[f64; 3]> {
        let n = self.shown.degrees;
        let of = |i: usize| {
            let mut sizes = [0.0; 3];
            for (order, size) in sizes.iter_mut().enumerate() {
                let slopes = linear.slopes.iter().filter_map(|row| row.get(order * n + i));
                let (mut sum, mut count) = (0.0, 0.0);
                for x in slopes.flatten().filter(|x| x.is_finite() && **x != 0.0) {
                    sum += x * x;
                    count += 1.0;
                }
                if count > 0.0 {
                    *size = f64::sqrt(sum / count) * frequency.powi(order as i32);
                }
            }
            sizes
        };
        (0..n).map(of).collect()
    }

    /// A curve with a wave added to what no places are shown of.
    fn waved(&self, curve: &[f64], phase: f64) -> Vec<f64> {
        let n = self.shown.degrees;
        let frequency = self.frequency();
        let linear = self.linear(curve, 0..self.stencils.len());
        let responses = self.responses(&linear, frequency);
        let mut out = curve.to_vec();
        for (k, place) in out.chunks_exact_mut(n).enumerate() {
            for (i, (x, sizes)) in place.iter_mut().zip(&responses).enumerate() {
                if sizes[0] == 0.0 {
                    let size = sizes[1] + sizes[2];
                    let amplitude = if size > 0.0 { 1.4 / size } else { 1.0 };
                    let turn = frequency * self.step * k as f64 + phase + 0.7 * i as f64;
                    *x += amplitude * turn.sin();
                }
            }
        }
        out
    }

    /// Levenberg-Marquardt for all samples together: what is left, and the curve.
    fn settled(&self, mut curve: Vec<f64>) -> (f64, Vec<f64>) {
        let (n, m) = (self.shown.degrees, self.stencils.len());
        if m < 3 {
            return (self.linear(&curve, 0..m).squares(), curve);
        }
        let frequency = self.frequency();
        let mut linear = self.linear(&curve, 0..m);
        let responses = self.responses(&linear, frequency);
        // What each coordinate weighs by itself, and its second differences.
        let own: Vec<(f64, f64)> = (responses.iter())
            .map(|&[place, velocity, acceleration]| {
                let (rates, all) = (velocity + acceleration, place + velocity + acceleration);
                let all = if all > 0.0 { all } else { 1.0 };
                let shrink = match (place > 0.0, rates > 0.0) {
                    (false, true) => SHRINK_RATES * rates,
                    _ => SHRINK_PLACES * all,
                };
                (shrink, SMOOTH * all)
            })
            .collect();
        let mut left = linear.squares() + self.beside(&curve, &own);
        let mut damping = Damping(1e-4);
        for _ in 0..STEPS {
            let mut normal = Banded::new(m * n, 3 * n);
            let mut down = vec![0.0; m * n];
            self.gather(&linear, &mut normal, &mut down);
            self.gather_beside(&curve, &own, &mut normal, &mut down);
            let Some(step) = normal.solve_damped(damping.0, &down) else {
                if damping.grow() {
                    break;
                }
                continue;
            };
            let trial: Vec<f64> = curve.iter().zip(&step).map(|(x, s)| x + s).collect();
            let next = self.linear(&trial, 0..m);
            let after = next.squares() + self.beside(&trial, &own);
            if after <= left {
                let done = left - after <= STILL * left;
                (left, linear, curve) = (after, next, trial);
                damping.fall();
                if done {
                    break;
                }
            } else {
                if damping.grow() {
                    break;
                }
            }
        }
        (if left.is_finite() { left } else { f64::INFINITY }, curve)
    }

    /// Normal equations of what was measured.
    fn gather(&self, linear: &Linear, normal: &mut Banded, down: &mut [f64]) {
        let n = self.shown.degrees;
        let mut slopes = vec![0.0; 3 * n];
        for (k, stencil) in self.stencils.iter().enumerate() {
            for (residuals, by) in linear.residuals.iter().zip(&linear.slopes) {
                for s in 0..3 {
                    let here = if stencil.first + s == k { 1.0 } else { 0.0 };
                    for i in 0..n {
                        slopes[s * n + i] = here * by[i][k]
                            + stencil.velocity[s] * by[n + i][k]
                            + stencil.acceleration[s] * by[2 * n + i][k];
                    }
                }
                normal.add_square(stencil.first * n, &slopes);
                for (down, slope) in down[stencil.first * n..].iter_mut().zip(&slopes) {
                    *down -= slope * residuals[k];
                }
            }
        }
    }

    /// What a curve weighs by itself.
    fn beside(&self, curve: &[f64], own: &[(f64, f64)]) -> f64 {
        let n = self.shown.degrees;
        let mut sum = 0.0;
        for (k, stencil) in self.stencils.iter().enumerate() {
            for (i, (shrink, smooth)) in own.iter().enumerate() {
                sum += (shrink * curve[k * n + i]).powi(2);
                let of = |s: usize| stencil.acceleration[s] * curve[(stencil.first + s) * n + i];
                let bend = (0..3).map(of).sum::<f64>() * self.step * self.step;
                sum += (smooth * bend).powi(2);
            }
        }
        sum
    }

    fn gather_beside(
        &self,
        curve: &[f64],
        own: &[(f64, f64)],
        normal: &mut Banded,
        down: &mut [f64],
    ) {
        let n = self.shown.degrees;
        let mut slopes = vec![0.0; 3 * n];
        for (k, stencil) in self.stencils.iter().enumerate() {
            for (i, (shrink, smooth)) in own.iter().enumerate() {
                normal.add_square(k * n + i, &[*shrink]);
                down[k * n + i] -= shrink * shrink * curve[k * n + i];
                slopes.fill(0.0);
                let mut bend = 0.0;
                for s in 0..3 {
                    let slope = smooth * self.step * self.step * stencil.acceleration[s];
                    slopes[s * n + i] = slope;
                    bend += slope * curve[(stencil.first + s) * n + i];
                }
                normal.add_square(stencil.first * n, &slopes);
                for (down, slope) in down[stencil.first * n..].iter_mut().zip(&slopes) {
                    *down -= slope * bend;
                }
            }
        }
    }
}
