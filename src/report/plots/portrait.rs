//! Phase portrait: energy contours of the learned H, and the data on them.

use super::axes::{Axis, nice_ticks};
use super::contour;
use super::figure::{Anchor, Figure, Mark, Panel, SeriesInfo, Shape, Style};
use super::{PlotData, label};
use crate::diagnose::comparison::predictions::Prediction;
use crate::diagnose::comparison::view::{Portrait, View};

/// Contours, more or less.
const LEVELS: usize = 9;
/// Components of the state that are told one by one.
const FEW: usize = 4;
/// Runs that are series of their own; more of them are one cloud.
const RUNS: usize = 40;

/// One figure for each plane.
pub(super) fn figures(material: &PlotData) -> Vec<Figure> {
    let view = material.view;
    view.portraits.iter().filter_map(|portrait| figure(view, portrait)).collect()
}

fn figure(view: &View, portrait: &Portrait) -> Option<Figure> {
    let (x, y) = (view.state.get(portrait.across)?, view.state.get(portrait.up)?);
    let (&left, &right) = (portrait.columns.first()?, portrait.columns.last()?);
    let (&low, &high) = (portrait.rows.first()?, portrait.rows.last()?);
    let (name_x, name_y) = (label::plain(&x.name), label::plain(&y.name));
    let coordinates = portrait.up < view.state.len() / 2;
    let title = if coordinates {
        format!("Potential energy and orbits: {name_x}, {name_y}")
    } else {
        format!("Phase portrait: {name_x}, {name_y}")
    };
    let held: Vec<String> = portrait
        .held
        .iter()
        .filter_map(|(row, value)| {
            let name = label::plain(&view.state.get(*row)?.name);
            Some(format!("{name} = {}", label::number(*value, 3)))
        })
        .collect();
    let mut caption = "Lines of equal energy of the learned H, and the motion on them.".to_string();
    if held.len() > FEW {
        caption += " H is shown with the other coordinates at their means and the other momenta at \
                    zero; the motion is projected.";
    } else if !held.is_empty() {
        caption += &format!(" H is shown at {}; the motion is projected.", held.join(", "));
    }
    let mut figure = Figure::new(&format!("portrait-{}-{}", x.name, y.name), title, caption);
    figure.height = 350.0;
    let across = Axis::between(left, right, 6).variable(&x.name, x.unit.as_deref());
    let up = Axis::between(low, high, 6).variable(&y.name, y.unit.as_deref());
    let mut panel = Panel::new(1.0, across, up);
    figure.key(Style::Contour, Shape::Line, "H = const.");
    tracks(view, portrait, &mut panel);
    let seen = view.predictions.iter().any(|p| !p.held_out);
    let what = if view.momenta_measured { "measured" } else { "fitted states" };
    if seen {
        figure.key(Style::Measured, Shape::Cloud, what);
    }
    if view.predictions.iter().any(|p| p.held_out) {
        figure.key(Style::HeldOut, Shape::Cloud, "held-out runs");
    }
    contours(portrait, &mut panel);
    figure.panels.push(panel);
    Some(figure)
}

fn component(prediction: &Prediction, row: usize) -> impl Iterator<Item = f64> + '_ {
    prediction.states.get(row).into_iter().flatten().copied()
}

fn tracks(view: &View, portrait: &Portrait, panel: &mut Panel) {
    let separate = view.predictions.len() <= RUNS;
    for held_out in [false, true] {
        let style = if held_out { Style::HeldOut } else { Style::Measured };
        let mut points = Vec::new();
        for prediction in view.predictions.iter().filter(|p| p.held_out == held_out) {
            let xs = component(prediction, portrait.across);
            let ys = component(prediction, portrait.up);
            points.extend(xs.zip(ys));
            if separate {
                let about = SeriesInfo {
                    times: prediction.times.clone(),
                    ..SeriesInfo::run("motion", &prediction.run)
                };
                let points = std::mem::take(&mut points);
                panel.marks.push(Mark::Cloud { style, points, about });
            }
        }
        if !points.is_empty() {
            let about = SeriesInfo::named(if held_out { "held_out" } else { "training" });
            panel.marks.push(Mark::Cloud { style, points, about });
        }
    }
}

/// Room of a number at a contour, as parts of the panel's width and height.
const ROOM: (f64, f64) = (0.12, 0.07);

/// Whether a number has room at a place, inside and beside the others.
fn free(panel: &Panel, words: &[Mark], place: (f64, f64)) -> bool {
    let of = |(x, y): (f64, f64)| (panel.x.place(x), panel.y.place(y));
    let (x, y) = of(place);
    let inside = |at: f64, room: f64| (0.6 * room..=1.0 - 0.6 * room).contains(&at);
    inside(x, ROOM.0)
        && inside(y, ROOM.1)
        && words.iter().all(|word| match word {
            Mark::Text { at, .. } => {
                let (other_x, other_y) = of(*at);
                (x - other_x).abs() > ROOM.0 || (y - other_y).abs() > ROOM.1
            }
            _ => true,
        })
}

fn contours(portrait: &Portrait, panel: &mut Panel) {
    let all = || portrait.energy.iter().flatten().copied().filter(|e| e.is_finite());
    let (Some(least), Some(most)) = (all().reduce(f64::min), all().reduce(f64::max)) else {
        return;
    };
    // Contours where the motion is, and somewhat beyond it.
    let (from, to) = match portrait.reached {
        Some((low, high)) => {
            let low = low.max(least).min(most);
            let beyond = 0.6 * (high - least.min(low)).max(1e-12 * high.abs());
            (least.max(low - 4.0 * (high - low).abs() - beyond), most.min(high + beyond))
        }
        None => (least, most),
    };
    if from.is_nan() || to.is_nan() || to <= from {
        return;
    }
    let ticks = nice_ticks(from, to, LEVELS);
    let every = ticks.len().div_ceil(5).max(1);
    let mut words = Vec::new();
    for (at, tick) in ticks.iter().enumerate() {
        let lines = contour::lines(&portrait.columns, &portrait.rows, &portrait.energy, tick.value);
        let longest = lines.iter().max_by_key(|line| line.len());
        if at % every == 0
            && let Some(place) = longest.and_then(|line| {
                // Each at the top of its line, or as near to it as others leave room.
                let mut places: Vec<(f64, f64)> = line.clone();
                places.sort_by(|a, b| b.1.total_cmp(&a.1));
                places.into_iter().find(|place| free(panel, &words, *place))
            })
        {
            words.push(Mark::Text {
                at: place,
                anchor: Anchor::Middle,
                style: Style::Contour,
                shift: (0.0, 4.0),
                text: tick.text.clone(),
            });
        }
        for points in lines {
            let about = SeriesInfo::named(&format!("H = {}", tick.text));
            panel.marks.push(Mark::Line { style: Style::Contour, points, about });
        }
    }
    panel.marks.append(&mut words);
}
