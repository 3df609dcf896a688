//! The ledger: the error on held-out runs, falling with every addition.

use super::axes::Axis;
use super::figure::{Figure, Mark, Panel, SeriesInfo, Shape, Style};
use super::{HistoryPoint, PlotData, times};

/// Steps that are shown, the newest.
const MOST: usize = 24;

/// One figure, the first step on top.
pub(super) fn figures(material: &PlotData) -> Vec<Figure> {
    let known = |stage: &&HistoryPoint| stage.error.is_some_and(|e| e.is_finite() && e > 0.0);
    let all: Vec<&HistoryPoint> = material.history.iter().filter(known).collect();
    let stages = &all[all.len().saturating_sub(MOST)..];
    if stages.len() < 2 {
        return Vec::new();
    }
    let error = |stage: &HistoryPoint| stage.error.unwrap_or(f64::NAN);
    let kept: Vec<&&HistoryPoint> = stages.iter().filter(|stage| !stage.undone).collect();
    let ends = kept.first().zip(kept.last());
    let mut caption = "Error on held-out runs after every step, in units of the noise.".to_string();
    if let Some((first, last)) = ends {
        caption += &format!(" It went from {} to {}.", times(error(first)), times(error(last)));
    }
    let mut figure = Figure::new("ledger", "Error after every step".into(), caption);
    figure.height = 116.0 + 30.0 * stages.len() as f64;
    let row = |at: usize| (stages.len() - 1 - at) as f64;
    let names = stages.iter().rev().map(|stage| {
        if stage.undone { format!("({})", stage.action) } else { stage.action.clone() }
    });
    let x = Axis::logarithmic(stages.iter().map(|s| error(s)).chain([0.9, 1.2]))
        .words("error on held-out runs / noise");
    let mut panel = Panel::new(1.0, x, Axis::rows(names));
    panel.marks.push(Mark::Upright { style: Style::Reference, x: 1.0 });
    let mut points = Vec::new();
    for (at, stage) in stages.iter().enumerate() {
        let here = (error(stage), row(at));
        let style = if stage.undone { Style::Baseline } else { Style::Model };
        if !stage.undone {
            points.push(here);
        }
        let texts = vec![format!("{}: {} times the noise", stage.action, times(error(stage)))];
        panel.marks.push(Mark::Markers { style, points: vec![here], texts });
    }
    let about = SeriesInfo::named("error");
    panel.marks.insert(1, Mark::Line { style: Style::Model, points, about });
    figure.key(Style::Model, Shape::Both, "kept");
    if stages.iter().any(|stage| stage.undone) {
        figure.key(Style::Baseline, Shape::Point, "(taken back)");
    }
    figure.key(Style::Reference, Shape::Line, "noise floor");
    figure.panels.push(panel);
    vec![figure]
}
