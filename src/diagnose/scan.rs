//! Scores of all candidates over the grids of their inner parameters.

use super::candidates::Candidate;
use super::law_on_data::LawOnData;
use super::score_test::{Score, Scores};
use super::settling::{Parts, Settled, settle_parts};
use super::window::longer;
use crate::error::Result;
use crate::expr::{System, Term};
use crate::fit::Monitor;
use crate::fit::column::Column;

/// The best grid point of one candidate.
#[derive(Debug, Clone)]
pub struct Scored {
    /// Index of the candidate.
    pub candidate: usize,
    /// Its inner parameters there.
    pub values: Vec<f64>,
    /// What it would take off the misfit.
    pub score: Score,
    /// p-value after the look-elsewhere correction for everything that was tried.
    pub p_value: f64,
    /// Everything that was tried.
    pub tests: f64,
    /// Deviance less the price of its unknowns.
    pub merit: f64,
}

/// Scores of all candidates.
pub struct Scan {
    /// The best grid point of each candidate that can be told from the model, best first.
    pub scored: Vec<Scored>,
    /// Candidates times grid points.
    pub tests: usize,
    /// Variance of the weighted residuals once the best of all candidates are in.
    pub variance: f64,
}

/// Candidates that explain more than noise would.
pub struct Significant<'a> {
    /// The model on the segments that they were scored on.
    pub data: Parts<'a>,
    /// The best grid point of each of them, best first.
    pub best: Vec<Scored>,
    /// Candidates times grid points, on segments of every length that was tried.
    pub tests: usize,
    /// As [`Scan::variance`].
    pub variance: f64,
}

/// Scores all candidates.
///
/// A small effect needs time to show. Where nothing is significant, the segments grow beyond
/// those that the model was trained on, until something is.
///
/// # Errors
///
/// When the data do not suffice to score anything.
pub fn significant<'a>(
    model: &LawOnData<'a>,
    candidates: &[Candidate],
    monitor: &dyn Monitor,
) -> Result<Significant<'a>> {
    let most = model.tuning().scan.significant;
    let mut data = settle_parts(model.clone());
    let mut scores = scan(&data.all, data.part.as_ref(), candidates)?;
    let mut tests = scores.tests;
    while !scores.scored.iter().any(|s| s.p_value < most) && !monitor.stopped() {
        let Some(window) = longer(&data.all.model) else { break };
        data = settle_parts(model.with_window(window));
        scores = scan(&data.all, data.part.as_ref(), candidates)?;
        tests += scores.tests;
    }
    // Every length that was tried is a look elsewhere.
    let lengths = tests as f64 / scores.tests.max(1) as f64;
    let best = scores.scored.into_iter().filter(|s| lengths * s.p_value < most).collect();
    Ok(Significant { data, best, tests, variance: scores.variance })
}

/// Index of a candidate, and values of its inner parameters.
type GridPoint = (usize, Vec<f64>);

/// Scores every candidate at every grid point.
///
/// Grids are looked through on a part of the data; the best point of each candidate is then
/// judged on all of them. `few` is the model before that part, where there are more.
pub fn scan(settled: &Settled, few: Option<&Settled>, all: &[Candidate]) -> Result<Scan> {
    let tuning = &settled.model.tuning().scan;
    let tests = all.iter().map(|candidate| candidate.grid.len()).sum();
    let every: Vec<(usize, Vec<Vec<f64>>)> =
        all.iter().map(|candidate| candidate.grid.clone()).enumerate().collect();
    let points = if let Some(few) = few {
        let (grids, plain): (Vec<_>, Vec<_>) = every.into_iter().partition(|(_, g)| g.len() > 1);
        let (found, _) = score(few, all, &grids, tests, tuning.columns_apart)?;
        let best = found.into_iter().map(|scored| (scored.candidate, vec![scored.values]));
        plain.into_iter().chain(best).collect()
    } else {
        every
    };
    let (mut scored, variance) = score(settled, all, &points, tests, tuning.columns_together)?;
    scored.sort_by(|a, b| b.merit.total_cmp(&a.merit).then(a.candidate.cmp(&b.candidate)));
    Ok(Scan { scored, tests, variance })
}

/// Scores candidates at some points of their grids, so many `columns` at a time; the best point of
/// each, and the variance of the weighted residuals where the most is explained.
fn score(
    settled: &Settled,
    all: &[Candidate],
    points: &[(usize, Vec<Vec<f64>>)],
    tests: usize,
    columns: usize,
) -> Result<(Vec<Scored>, f64)> {
    let of_grid = |(c, grid): &(usize, Vec<Vec<f64>>)| {
        let c = *c;
        grid.clone().into_iter().map(move |values| (c, values))
    };
    let queue: Vec<GridPoint> = points.iter().flat_map(of_grid).collect();
    let width_of = |(c, _): &GridPoint| all[*c].columns();
    let mut probed = Vec::new();
    let mut start = 0;
    while start < queue.len() {
        let mut end = start;
        let mut width = 0;
        while end < queue.len() && (end == start || width + width_of(&queue[end]) <= columns) {
            width += width_of(&queue[end]);
            end += 1;
        }
        probe_range(settled, all, &queue[start..end], settled.sums.diverged, &mut probed)?;
        start = end;
        if settled.model.monitor.stopped() {
            break;
        }
    }
    // One yardstick for all: what is left where the most is explained.
    let least = probed.iter().map(|(_, scores)| scores.variance).fold(f64::INFINITY, f64::min);
    let smallest = settled.model.tuning().scan.least_variance;
    let each = settled.model.autocorrelation_time;
    let variance = each * if least.is_finite() { least.max(smallest) } else { 1.0 };
    let mut best: Vec<Option<Scored>> = vec![None; all.len()];
    for (tries, mut scores) in probed {
        scores.variance = variance;
        choose(&scores, all, tries, tests, &mut best);
    }
    Ok((best.into_iter().flatten().collect(), variance))
}

/// Probes some tries together. Where they lose more segments than the model itself, which loses
/// `lost`, or leave something that is no number, they are taken apart, and the try that does (it
/// divides by zero, say) is left out.
fn probe_range<'t>(
    settled: &Settled,
    all: &[Candidate],
    tries: &'t [GridPoint],
    lost: usize,
    probed: &mut Vec<(&'t [GridPoint], Scores)>,
) -> Result<()> {
    let mut system = System::clone(settled.model.system());
    let law = &settled.model.law;
    let probes = tries.iter().flat_map(|(c, values)| all[*c].probes(&mut system, law, values));
    let terms: Vec<Term> = probes.collect();
    match settled.probe(system, &terms) {
        Ok(found) if found.diverged <= lost && found.scores.is_finite() => {
            probed.push((tries, found.scores));
        }
        _ if tries.len() == 1 => {}
        _ => {
            // How the model's own unknowns act may be lost too.
            let alone = settled.probe(System::clone(settled.model.system()), &[])?;
            let lost = lost.max(alone.diverged);
            let (first, second) = tries.split_at(tries.len() / 2);
            probe_range(settled, all, first, lost, probed)?;
            probe_range(settled, all, second, lost, probed)?;
        }
    }
    Ok(())
}

/// Keeps the best grid point of every candidate.
fn choose(
    scores: &Scores,
    all: &[Candidate],
    tries: &[GridPoint],
    tests: usize,
    best: &mut [Option<Scored>],
) {
    let mut column = 0;
    for (c, values) in tries {
        let count = all[*c].columns();
        let columns: Vec<Column> = (column..column + count).map(Column::new).collect();
        column += count;
        let score = scores.group(&columns);
        let unknowns = score.degrees + values.len();
        let merit = score.deviance - unknowns as f64 * (scores.rows.max(1) as f64).ln();
        if score.degrees > 0 && best[*c].as_ref().is_none_or(|b| merit > b.merit) {
            let tests = tests as f64;
            let p_value = (score.p_value * tests).min(1.0);
            let values = values.clone();
            best[*c] = Some(Scored { candidate: *c, values, score, p_value, tests, merit });
        }
    }
}
