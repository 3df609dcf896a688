//! Error against length of prediction, with the noise floor and a guess to beat.

use super::axes::Axis;
use super::figure::{Figure, Mark, Panel, SeriesInfo, Shape, Style};
use super::{PlotData, label, times};
use crate::diagnose::comparison::Horizon;

/// One figure: training, held-out, persistence.
pub(super) fn figures(material: &PlotData) -> Vec<Figure> {
    let horizons = &material.comparison.horizons;
    let (Some(last), true) = (horizons.last(), horizons.len() > 1) else { return Vec::new() };
    let time = &material.view.time;
    let of = |value: &dyn Fn(&Horizon) -> Option<f64>| -> Vec<(f64, f64)> {
        let points = horizons.iter().filter_map(|h| value(h).map(|error| (h.duration, error)));
        points.filter(|(t, error)| error.is_finite() && *error > 0.0 && *t > 0.0).collect()
    };
    let curves = [
        (Style::Model, "training", of(&|h| Some(h.training))),
        (Style::HeldOut, "held-out runs", of(&|h| h.held_out)),
        (Style::Baseline, "persistence", of(&|h| Some(h.baseline))),
    ];
    let all = || curves.iter().flat_map(|(_, _, points)| points.iter());
    if all().next().is_none() {
        return Vec::new();
    }
    let mut caption = format!(
        "Root mean square error of predictions from their best initial state, in units of the \
         noise: 1 is the noise floor. Over the longest prediction ({}) it is ",
        label::amount(last.duration, 3, time.unit.as_deref()),
    );
    // Before the training runs are judged again, only the held-out ones are known.
    let training = (!last.training.is_nan()).then_some((last.training, "training runs"));
    let judged = training.into_iter().chain(last.held_out.map(|error| (error, "held-out runs")));
    let judged: Vec<String> =
        judged.map(|(error, runs)| format!("{} on {runs}", times(error))).collect();
    caption += &format!("{}.", judged.join(" and "));
    let mut figure = Figure::new("horizons", "Error by length of prediction".into(), caption);
    let x = Axis::logarithmic(all().map(|p| p.0))
        .words("length of the prediction")
        .unit(&label::unit(time.unit.as_deref()));
    let y = Axis::logarithmic(all().map(|p| p.1).chain([0.8, 1.2])).words("error / noise");
    let mut panel = Panel::new(1.0, x, y);
    panel.marks.push(Mark::Level { style: Style::Reference, y: 1.0 });
    for (style, name, points) in curves {
        if points.is_empty() {
            continue;
        }
        figure.key(style, Shape::Both, name);
        let texts = points
            .iter()
            .map(|(t, error)| {
                format!("{name}: {} times the noise over {}", times(*error), label::number(*t, 3))
            })
            .collect();
        panel.marks.push(Mark::Line {
            style,
            points: points.clone(),
            about: SeriesInfo::named(name),
        });
        panel.marks.push(Mark::Markers { style, points, texts });
    }
    figure.key(Style::Reference, Shape::Line, "noise floor");
    figure.panels.push(panel);
    vec![figure]
}
