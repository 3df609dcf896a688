//! Measured against predicted, with the residual under it.

use super::axes::{Axis, extent};
use super::figure::{Figure, Mark, Panel, SeriesInfo, Shape, Style};
use super::{PlotData, label, times};
use crate::diagnose::comparison::predictions::Prediction;
use crate::diagnose::comparison::view::View;

/// Figures of a report, at most.
const MOST: usize = 8;

/// The runs that say most: the worst held-out one, the worst that the model was trained on, and
/// the one in the middle.
pub fn figures(material: &PlotData) -> Vec<Figure> {
    let view = material.view;
    let long = |p: &&Prediction| p.times.len() > 2 && p.error.is_finite();
    let mut order: Vec<usize> = (0..view.predictions.len())
        .filter(|&i| view.predictions.get(i).as_ref().is_some_and(long))
        .collect();
    if order.is_empty() {
        return pairs(view);
    }
    order.sort_by(|&a, &b| view.predictions[b].error.total_cmp(&view.predictions[a].error));
    let worst =
        |held_out: bool| order.iter().copied().find(|&i| view.predictions[i].held_out == held_out);
    let mut chosen: Vec<(usize, &str)> = Vec::new();
    let candidates = [
        (worst(true), "worst held-out run"),
        (worst(false), "worst training run"),
        (order.get(order.len() / 2).copied(), "median run"),
    ];
    for (run, why) in candidates {
        if let Some(run) = run
            && chosen.iter().all(|(other, _)| *other != run)
        {
            chosen.push((run, why));
        }
    }
    let mut out = Vec::new();
    for (run, why) in chosen {
        let own: Vec<Figure> = (0..view.observables.len())
            .filter_map(|observable| figure(view, run, observable, why))
            .take(MOST / 2)
            .collect();
        if out.is_empty() || out.len() + own.len() <= MOST {
            out.extend(own);
        }
    }
    out
}

/// One observable of one run; `why` says why this run. None where nothing was measured of it.
pub fn figure(view: &View, run: usize, observable: usize, why: &str) -> Option<Figure> {
    let prediction = view.predictions.get(run)?;
    let quantity = view.observables.get(observable)?;
    let noise = view.noise.get(observable).copied().unwrap_or(f64::NAN);
    let (measured, predicted) =
        (prediction.measured.get(observable)?, prediction.predicted.get(observable)?);
    let (low, high) = extent(measured.iter().copied())?;
    let unit = quantity.unit.as_deref();
    let name = label::plain(&quantity.name);
    let error = error(measured, predicted, noise);
    let title = format!("{name}: {}, {why}", run_name(&prediction.run));
    let caption = format!(
        "Measurements of {name} in {} ({why}) and the prediction of the whole run from its best \
         initial state; below, measured minus predicted, and the band of two standard deviations \
         of the noise. The residuals are {} times the noise.",
        run_name(&prediction.run),
        times(error),
    );
    let mut figure = Figure::new(&format!("predictions-{run}-{}", quantity.name), title, caption);
    figure.key(Style::Measured, Shape::Cloud, "measured");
    let style = if prediction.held_out { Style::HeldOut } else { Style::Model };
    let what = if prediction.held_out { "predicted, held-out run" } else { "predicted" };
    figure.key(style, Shape::Line, what);
    figure.key(Style::Reference, Shape::Area, "2σ of the noise");
    let points = |values: &[f64]| -> Vec<(f64, f64)> {
        prediction.times.iter().copied().zip(values.iter().copied()).collect()
    };
    // A prediction that goes far astray must not make the measurements small.
    let room = (high - low).max(4.0 * noise);
    let near = predicted.iter().copied().filter(|y| *y > low - room && *y < high + room);
    let time = || {
        let axis = Axis::linear(prediction.times.iter().copied(), 6);
        axis.variable(&view.time.name, view.time.unit.as_deref())
    };
    let y = Axis::linear(measured.iter().copied().chain(near), 4).variable(&quantity.name, unit);
    let mut above = Panel::new(0.64, time(), y);
    let about = SeriesInfo::run("predicted", &prediction.run);
    let cloud = SeriesInfo::run("measured", &prediction.run);
    above.marks = vec![
        Mark::Cloud { style: Style::Measured, points: points(measured), about: cloud },
        Mark::Line { style, points: broken(points(predicted), &prediction.starts), about },
    ];
    let residual: Vec<f64> = measured.iter().zip(predicted).map(|(a, b)| a - b).collect();
    let bounded = residual.iter().copied().filter(|r| r.abs() < 2.0 * room);
    let band = [-3.0 * noise, 3.0 * noise].into_iter();
    let y = Axis::linear(bounded.chain(band), 3).words("residual").unit(&label::unit(unit));
    let mut below = Panel::new(0.36, time(), y);
    let (start, end) = (below.x.low, below.x.high);
    let band = [start, end].map(|t| (t, -2.0 * noise, 2.0 * noise));
    below.marks = vec![
        Mark::Band { style: Style::Reference, points: band.to_vec() },
        Mark::Level { style: Style::Reference, y: 0.0 },
        Mark::Cloud {
            style: Style::Measured,
            points: points(&residual),
            about: SeriesInfo::run("residual", &prediction.run),
        },
    ];
    figure.panels = vec![above, below];
    Some(figure)
}

/// `run 3`, but a name that says so itself is left alone.
fn run_name(name: &str) -> String {
    if name.starts_with(|c: char| c.is_ascii_digit()) {
        format!("run {name}")
    } else {
        name.to_string()
    }
}

fn error(measured: &[f64], predicted: &[f64], noise: f64) -> f64 {
    let both = measured.iter().zip(predicted).filter(|(a, b)| a.is_finite() && b.is_finite());
    let (sum, count) = both
        .fold((0.0, 0.0), |(sum, count), (a, b)| (sum + ((a - b) / noise).powi(2), count + 1.0));
    (sum / count).sqrt()
}

/// A break before every start but the first.
fn broken(points: Vec<(f64, f64)>, starts: &[usize]) -> Vec<(f64, f64)> {
    let mut out = Vec::with_capacity(points.len() + starts.len());
    for (i, point) in points.into_iter().enumerate() {
        if i > 0 && starts.binary_search(&i).is_ok() {
            out.push((point.0, f64::NAN));
        }
        out.push(point);
    }
    out
}

/// Runs of two samples: the second one, measured against predicted.
fn pairs(view: &View) -> Vec<Figure> {
    let mut out = Vec::new();
    for (observable, quantity) in view.observables.iter().enumerate().take(MOST) {
        let part = |held_out: bool| -> Vec<(f64, f64)> {
            let runs = view.predictions.iter().filter(|p| p.held_out == held_out);
            runs.flat_map(|p| {
                let last = p.times.len().saturating_sub(1);
                let value = |all: &[Vec<f64>]| all.get(observable)?.get(last).copied();
                value(&p.predicted).zip(value(&p.measured))
            })
            .filter(|(a, b)| a.is_finite() && b.is_finite())
            .collect()
        };
        let (training, held_out) = (part(false), part(true));
        let all = || training.iter().chain(&held_out);
        if all().next().is_none() {
            continue;
        }
        let noise = view.noise.get(observable).copied().unwrap_or(f64::NAN);
        let name = label::plain(&quantity.name);
        let unit = quantity.unit.as_deref();
        let caption = format!(
            "The second sample of every pair: measured against predicted, and the difference \
             below with the band of two standard deviations of the noise. {} pairs.",
            all().count()
        );
        let title = format!("{name} of all pairs");
        let mut figure =
            Figure::new(&format!("predictions-pairs-{}", quantity.name), title, caption);
        figure.key(Style::Measured, Shape::Cloud, "training");
        if !held_out.is_empty() {
            figure.key(Style::HeldOut, Shape::Cloud, "held_out");
        }
        figure.key(Style::Reference, Shape::Area, "2σ of the noise");
        let x = || {
            let axis = Axis::linear(all().map(|p| p.0), 6).words(&format!("{name}, predicted"));
            axis.unit(&label::unit(unit))
        };
        let y = Axis::linear(all().map(|p| p.1), 4).words("measured").unit(&label::unit(unit));
        let mut above = Panel::new(0.64, x(), y);
        let band = [-3.0 * noise, 3.0 * noise].into_iter();
        let residuals = all().map(|p| p.1 - p.0).chain(band);
        let mut below = Panel::new(0.36, x(), Axis::linear(residuals, 3).words("difference"));
        let (low, high) = (above.x.low, above.x.high);
        let diagonal = vec![(low, low), (high, high)];
        let about = SeriesInfo::default();
        above.marks.push(Mark::Line { style: Style::Reference, points: diagonal, about });
        let band = [low, high].map(|x| (x, -2.0 * noise, 2.0 * noise));
        below.marks.push(Mark::Band { style: Style::Reference, points: band.to_vec() });
        below.marks.push(Mark::Level { style: Style::Reference, y: 0.0 });
        for (points, style, what) in
            [(&training, Style::Measured, "training"), (&held_out, Style::HeldOut, "held_out")]
        {
            let about = SeriesInfo::named(what);
            above.marks.push(Mark::Cloud { style, points: points.clone(), about: about.clone() });
            let points = points.iter().map(|p| (p.0, p.1 - p.0)).collect();
            below.marks.push(Mark::Cloud { style, points, about });
        }
        figure.panels = vec![above, below];
        out.push(figure);
    }
    out
}
