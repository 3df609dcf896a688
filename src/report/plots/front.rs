//! The Pareto front: error against number of terms, and the model that was chosen.

use super::axes::Axis;
use super::figure::{Anchor, Figure, Mark, Panel, SeriesInfo, Shape, Style};
use super::{PlotData, label, times};
use crate::fit::model::FrontPoint;

/// One figure of all sizes.
pub(super) fn figures(material: &PlotData) -> Vec<Figure> {
    let mut front: Vec<&FrontPoint> = material
        .model
        .front
        .iter()
        .filter(|point| point.error.is_finite() && point.error > 0.0)
        .collect();
    front.sort_by_key(|point| point.terms.len());
    if front.len() < 2 {
        return Vec::new();
    }
    let place = |point: &FrontPoint| (point.terms.len() as f64, point.error);
    let chosen = front.iter().find(|point| point.chosen);
    let caption = match chosen {
        Some(point) => format!(
            "The smallest error that a model of each size reaches, in units of the noise. The \
             chosen one has {} terms and an error of {}: with fewer the error grows, with more \
             it hardly falls.",
            point.terms.len(),
            times(point.error),
        ),
        None => "The smallest error that a model of each size reaches, in units of the noise."
            .to_string(),
    };
    let mut figure = Figure::new("front", "Error against number of terms".into(), caption);
    let last = front.last().map_or(1, |point| point.terms.len()) as f64;
    let first = front.first().map_or(0, |point| point.terms.len()) as f64;
    let mut x = Axis::between(first - 0.5, last + 0.5, 7).words("terms in the model");
    x.ticks.retain(|tick| tick.value.fract() == 0.0);
    x.ticks.iter_mut().for_each(|tick| tick.text = format!("{:.0}", tick.value));
    let y =
        Axis::logarithmic(front.iter().map(|p| p.error).chain([0.9, 1.1])).words("error / noise");
    let mut panel = Panel::new(1.0, x, y);
    let points: Vec<(f64, f64)> = front.iter().map(|point| place(point)).collect();
    let texts = front
        .iter()
        .map(|point| {
            let mut terms: Vec<String> = point.terms.iter().map(|t| label::term(t)).collect();
            let more = terms.len().saturating_sub(8);
            terms.truncate(8);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            format!("error {}: {}{more}", times(point.error), terms.join(", "))
        })
        .collect();
    panel.marks = vec![
        Mark::Level { style: Style::Reference, y: 1.0 },
        Mark::Line {
            style: Style::Model,
            points: points.clone(),
            about: SeriesInfo::named("front"),
        },
        Mark::Markers { style: Style::Model, points, texts },
    ];
    figure.key(Style::Model, Shape::Both, "best model of each size");
    figure.key(Style::Reference, Shape::Line, "noise floor");
    if let Some(point) = chosen {
        let at = place(point);
        figure.key(Style::Chosen, Shape::Point, "chosen");
        panel.marks.push(Mark::Markers {
            style: Style::Chosen,
            points: vec![at],
            texts: vec!["chosen".to_string()],
        });
        let mut terms: Vec<String> = point.terms.iter().map(|t| label::term(t)).collect();
        if terms.len() > 3 {
            terms.truncate(3);
            terms.push("…".to_string());
        }
        let left = at.0 > 0.55 * (first + last);
        panel.marks.push(Mark::Text {
            at,
            anchor: if left { Anchor::End } else { Anchor::Start },
            style: Style::Measured,
            shift: (if left { -4.0 } else { 4.0 }, -13.0),
            text: terms.join(", "),
        });
    }
    figure.panels.push(panel);
    vec![figure]
}
