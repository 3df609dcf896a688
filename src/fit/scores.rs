//! How well numbers are determined by residuals that need not be independent.
//!
//! The residuals of a law that lacks something go with the motion: those of neighbouring samples
//! are alike, and the inverse of the information is then no covariance. With J the derivatives of
//! the residuals r by theta, states eliminated, the estimate has the covariance
//! (J'J)^-1 V (J'J)^-1, where V is that of J'r (White, Econometrica 50, 1982, whose information
//! is named after Godambe). V is estimated from the scores of all samples in the order of time,
//! the covariances of later ones weighed down (Newey and West, Econometrica 55, 1987) over as many
//! samples as their memory asks for (Andrews, Econometrica 59, 1991, eq. 6.2 and 6.4). What is left
//! may go with the time, too, as a drive does that all runs begin with: then samples of different
//! runs are alike, and V is that of the sums of all scores of one time (Driscoll and Kraay, Review
//! of Economics and Statistics 80, 1998). The larger variance of the two counts.
//!
//! A number of a law that holds is the same in all parts of the data: what each [`Fold`] of them
//! says alone follows from its own scores, by one step of Gauss and Newton.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::block::Block;
use super::motion::{Equations, Propagation};
use super::pass::{Problem, block_width};
use super::rows::DesignRows;
use super::segments::{Segment, blocks};
use super::states::States;
use crate::dynamics::KeptScratch;

/// What each sample says of theta: J'r of its values.
pub struct Scores {
    /// J'J over all samples.
    information: DMatrix<f64>,
    /// The same for each of a few parts of the data, with the sum of its scores: runs that follow
    /// each other, then what comes early and what comes late in every run, then small motions and
    /// large ones.
    folds: Vec<(DMatrix<f64>, DVector<f64>)>,
    /// Of each run the scores of its samples, in the order of time.
    runs: Vec<Vec<DVector<f64>>>,
    /// The sums of what samples of all runs say that were taken at the same time, in its order.
    moments: Vec<DVector<f64>>,
}

/// What a part of the data says of theta by itself.
pub struct Fold {
    /// How far theta is from that of all data.
    pub step: DVector<f64>,
    /// Inverse of its information, not a covariance where residuals are alike.
    pub inverse: DMatrix<f64>,
}

/// Parts of the data that are asked for themselves: fewer would agree by chance too often, more
/// tell too little each.
const FOLDS: usize = 4;

/// What a segment says of theta.
struct Part {
    place: Segment,
    information: DMatrix<f64>,
    scores: Vec<DVector<f64>>,
}

impl Scores {
    /// At settled states. Segments whose motion is lost say nothing.
    pub fn of(problem: &Problem, law: Equations, states: &States) -> Scores {
        let (size, unknowns) = (2 * law.0.degrees(), law.0.unknowns());
        let width = block_width(problem, problem.segments.longest(), size + unknowns + 1);
        let mut parts: Vec<Part> = blocks(0..problem.segments.list.len(), width)
            .into_par_iter()
            .map_init(KeptScratch::new, |scratch, range| {
                let segments = &problem.segments.list[range.clone()];
                let block = Block::gather(problem, segments);
                let propagation = Propagation { present: law, by: Some(law) };
                let starts = states.part(range);
                let rows = DesignRows::integrate(problem, propagation, &block, starts, scratch);
                let of = |(lane, segment): (usize, &Segment)| part(problem, &rows, lane, *segment);
                let parts: Vec<Part> = segments.iter().enumerate().filter_map(of).collect();
                rows.recycle(scratch);
                parts
            })
            .flatten_iter()
            .collect();
        parts.sort_by_key(|part| (part.place.run, part.place.first));
        let nothing = || (DMatrix::zeros(unknowns, unknowns), DVector::zeros(unknowns));
        let mut scores = Scores {
            information: DMatrix::zeros(unknowns, unknowns),
            folds: (0..3 * FOLDS).map(|_| nothing()).collect(),
            runs: Vec::new(),
            moments: Vec::new(),
        };
        let mut moments: BTreeMap<i64, DVector<f64>> = BTreeMap::new();
        let mut last = None;
        let count = parts.len();
        let ends = ends(&parts);
        let ranks = ranks_by_size(problem, &parts);
        for (at, part) in parts.into_iter().enumerate() {
            let Segment { run, first, .. } = part.place;
            let end = ends.get(&run).copied().unwrap_or(1).max(1);
            // One of the parts of all runs, one of those of each run, one of those of one size.
            let early = FOLDS + (first * FOLDS / end).min(FOLDS - 1);
            let small = 2 * FOLDS + ranks[at] * FOLDS / count;
            for fold in [at * FOLDS / count, early, small] {
                let (information, sum) = &mut scores.folds[fold];
                *information += &part.information;
                *sum += part.scores.iter().sum::<DVector<f64>>();
            }
            scores.information += part.information;
            for (sample, score) in (part.place.first..).zip(&part.scores) {
                let moment = moments.entry(moment(problem, part.place.run, sample));
                *moment.or_insert_with(|| DVector::zeros(unknowns)) += score;
            }
            if last != Some(part.place.run) {
                scores.runs.push(Vec::new());
                last = Some(part.place.run);
            }
            if let Some(run) = scores.runs.last_mut() {
                run.extend(part.scores);
            }
        }
        scores.moments = moments.into_values().collect();
        scores
    }

    /// Inverse of the information: the covariance of theta if residuals were independent, of the
    /// size that they are weighed by. `None` where the samples do not determine it.
    pub fn inverse(&self) -> Option<DMatrix<f64>> {
        Some(self.information.clone().cholesky()?.inverse())
    }

    /// What consecutive parts of the data, and those from the beginning to the end of each run, say
    /// of theta by themselves; `None` where one does not determine it.
    pub fn folds(&self) -> Vec<Option<Fold>> {
        let of = |(information, sum): &(DMatrix<f64>, DVector<f64>)| {
            let factor = information.clone().cholesky()?;
            Some(Fold { step: factor.solve(sum), inverse: factor.inverse() })
        };
        self.folds.iter().map(of).collect()
    }

    /// Covariance of theta; `None` where the samples do not determine it.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        let inverse = self.inverse()?;
        let samples: usize = self.runs.iter().map(Vec::len).sum();
        let unknowns = self.information.nrows();
        let longest = self.runs.iter().map(Vec::len).max()?;
        if samples <= unknowns {
            return None;
        }
        let memory = self.memory(samples).min(longest as f64 - 1.0);
        let freedom = samples as f64 / (samples - unknowns) as f64;
        let by = |series: &[Vec<DVector<f64>>]| {
            let longest = series.iter().map(Vec::len).max().unwrap_or(0);
            let mut middle = self.products(series, 0);
            for lag in (1..longest).take_while(|&lag| (lag as f64) < memory + 1.0) {
                let later = self.products(series, lag);
                middle += (&later + later.transpose()) * (1.0 - lag as f64 / (memory + 1.0));
            }
            &inverse * middle * &inverse * freedom
        };
        let mut covariance = by(&self.runs);
        if self.runs.len() > 1 {
            let shared = by(std::slice::from_ref(&self.moments));
            let stretch = |k: usize| (shared[(k, k)] / covariance[(k, k)]).max(1.0).sqrt();
            let stretch = DVector::from_fn(unknowns, |k, _| stretch(k));
            covariance = covariance.component_mul(&(&stretch * stretch.transpose()));
        }
        covariance.iter().all(|x| x.is_finite()).then_some(covariance)
    }

    /// Sum over all samples of some series of their score times that of a sample that many later.
    fn products(&self, series: &[Vec<DVector<f64>>], lag: usize) -> DMatrix<f64> {
        let size = self.information.nrows();
        let mut sum = DMatrix::zeros(size, size);
        for run in series {
            for (now, later) in run.iter().zip(run.iter().skip(lag)) {
                sum.ger(1.0, later, now, 1.0);
            }
        }
        sum
    }

    /// Samples over which the weights of Newey and West fall to zero, by an autoregressive process
    /// of order one for the score of each number.
    fn memory(&self, samples: usize) -> f64 {
        let (at_once, next) = (self.products(&self.runs, 0), self.products(&self.runs, 1));
        let (mut above, mut below) = (0.0, 0.0);
        for k in 0..self.information.nrows() {
            if at_once[(k, k)] <= 0.0 {
                continue;
            }
            // Nearer to one a record is too short to tell.
            let rho = (next[(k, k)] / at_once[(k, k)]).clamp(-NEAREST, NEAREST);
            // In units of the information, that of a number says as much as that of another.
            let size = at_once[(k, k)] / self.information[(k, k)].max(f64::MIN_POSITIVE);
            let innovations = (size * (1.0 - rho * rho)).powi(2);
            above += 4.0 * rho * rho * innovations / ((1.0 - rho).powi(6) * (1.0 + rho).powi(2));
            below += innovations / (1.0 - rho).powi(4);
        }
        if below > 0.0 { 1.1447 * (above / below * samples as f64).cbrt() } else { 0.0 }
    }
}

/// The time of a sample on the clock of the file, in whole steps.
fn moment(problem: &Problem, run: usize, sample: usize) -> i64 {
    let since = problem.measured.times_of(run).get(sample).copied().unwrap_or(0.0);
    let time = problem.measured.clock_of(run).time(since);
    (time / problem.measured.typical_step()).round() as i64
}

/// Places of segments in the order of how far their motion goes from the middle of all motion, in
/// units of the noise.
fn ranks_by_size(problem: &Problem, parts: &[Part]) -> Vec<usize> {
    let middle = |observable: usize| {
        let known = problem.measured.column(observable).iter().filter(|x| x.is_finite());
        let (count, sum) = known.fold((0.0, 0.0), |(count, sum), x| (count + 1.0, sum + x));
        if count > 0.0 { sum / count } else { 0.0 }
    };
    let middles: Vec<f64> = (0..problem.weights.len()).map(middle).collect();
    let size = |part: &Part| {
        let Segment { run, first, last } = part.place;
        let of = |(observable, (middle, weight)): (usize, (&f64, &f64))| {
            let values = problem.measured.values_of(observable, run);
            let values = values.get(first..=last).unwrap_or_default().iter();
            let known = values.map(|x| (x - middle) * weight).filter(|x| x.is_finite());
            let (count, sum) = known.fold((0.0, 0.0), |(count, sum), x| (count + 1.0, sum + x * x));
            if count > 0.0 { sum / count } else { 0.0 }
        };
        middles.iter().zip(problem.weights).enumerate().map(of).sum::<f64>()
    };
    let sizes: Vec<f64> = parts.iter().map(size).collect();
    let mut order: Vec<usize> = (0..parts.len()).collect();
    order.sort_by(|&a, &b| sizes[a].total_cmp(&sizes[b]));
    let mut ranks = vec![0; parts.len()];
    for (rank, place) in order.into_iter().enumerate() {
        ranks[place] = rank;
    }
    ranks
}

/// The sample behind the last one of each run.
fn ends(parts: &[Part]) -> BTreeMap<usize, usize> {
    let mut ends = BTreeMap::new();
    for Part { place, .. } in parts {
        let end = ends.entry(place.run).or_insert(0);
        *end = place.first.saturating_add(place.samples()).max(*end);
    }
    ends
}

/// Largest correlation of neighbouring scores that the memory is taken from, that which Andrews
/// and Monahan (Econometrica 60, 1992) allow.
const NEAREST: f64 = 0.97;

/// What one lane says, the state taken out by least squares; `None` where its motion is lost.
fn part(problem: &Problem, rows: &DesignRows, lane: usize, place: Segment) -> Option<Part> {
    if !rows.losses[lane].is_finite() {
        return None;
    }
    let (observables, state) = (problem.weights.len(), rows.state);
    let size = place.samples() * observables;
    let unknowns = rows.columns - state - 1;
    // The measured state itself does not depend on theta: nothing is written there.
    let written = |row: usize| !(rows.shown && row < observables);
    let at = |row: usize, column: usize| rows.row_from(row, column)[lane];
    let by_state = DMatrix::from_fn(size, state, at);
    let by_theta = DMatrix::from_fn(size, unknowns, |row, k| match written(row) {
        true => at(row, state + k),
        false => 0.0,
    });
    if !by_state.iter().chain(&by_theta).all(|x| x.is_finite()) {
        return None;
    }
    let by_both = by_state.clone().svd(true, true).solve(&by_theta, SPANNED).ok()?;
    let left = by_theta - by_state * by_both;
    let scores = (0..place.samples()).map(|sample| {
        let rows = sample * observables..(sample + 1) * observables;
        let mut score = DVector::zeros(unknowns);
        rows.for_each(|row| score.axpy(at(row, state + unknowns), &left.row(row).transpose(), 1.0));
        score
    });
    let scores = scores.collect();
    Some(Part { place, information: left.tr_mul(&left), scores })
}

/// Singular values below this are directions in which a state moves nothing that was measured.
const SPANNED: f64 = 1e-12;

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    const RUNS: usize = 6;
    const SAMPLES: usize = 400;

    /// Scores of one number, each of the size one; those of runs at one time are the same or not.
    fn scores(seed: u64, shared: bool) -> Scores {
        let mut generator = Pcg64::seed_from_u64(seed);
        let mut series = || -> Vec<DVector<f64>> {
            let sign = |_| if generator.random::<bool>() { 1.0 } else { -1.0 };
            (0..SAMPLES).map(sign).map(|x| DVector::from_element(1, x)).collect()
        };
        let first = series();
        let runs: Vec<Vec<DVector<f64>>> =
            (0..RUNS).map(|_| if shared { first.clone() } else { series() }).collect();
        let sum = |at: usize| runs.iter().fold(DVector::zeros(1), |sum, run| sum + &run[at]);
        let moments = (0..SAMPLES).map(sum).collect();
        let information = DMatrix::from_element(1, 1, (RUNS * SAMPLES) as f64);
        Scores { information, folds: Vec::new(), runs, moments }
    }

    #[test]
    fn what_all_runs_share_counts_once() {
        let variance = |shared| {
            let all = (0..20).map(|seed| scores(seed, shared).covariance().expect("determined"));
            all.map(|covariance| covariance[(0, 0)]).sum::<f64>() / 20.0
        };
        let independent = 1.0 / (RUNS * SAMPLES) as f64;
        let (apart, shared) = (variance(false) / independent, variance(true) / independent);
        assert!((0.95..1.25).contains(&apart), "{apart}");
        assert!((shared / RUNS as f64 - 1.0).abs() < 0.1, "{shared}");
    }
}
