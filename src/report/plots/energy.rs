//! How the model's energy goes along the measurements: what drifts loses or gains it.

use super::axes::Axis;
use super::figure::{Figure, Mark, Panel, SeriesInfo, Shape, Style};
use super::{PlotData, forces, label};
use crate::diagnose::comparison::EnergyDrift;
use crate::diagnose::comparison::view::{EnergySeries, View};

/// Runs with a name; the others are faint.
const NAMED: usize = 5;
/// Runs that are drawn.
const MOST: usize = 60;

/// Unit of the energy: coordinate times momentum over time.
fn energy_unit(view: &View) -> Option<String> {
    let (coordinate, momentum) = (view.state.first()?, view.state.get(view.state.len() / 2)?);
    let time = view.time.unit.as_deref();
    label::product(&[(momentum.unit.as_deref(), 1), (coordinate.unit.as_deref(), 1), (time, -1)])
}

/// One figure of all runs that are long enough.
pub(super) fn figures(material: &PlotData) -> Vec<Figure> {
    let view = material.view;
    let drift = |series: &EnergySeries| -> Option<&EnergyDrift> {
        material.comparison.energy.iter().find(|e| !series.held_out && e.run == series.run)
    };
    let change = |series: &EnergySeries| -> f64 {
        match (series.points.first(), series.points.last()) {
            (Some(first), Some(last)) => (last.1 - first.1).abs(),
            _ => 0.0,
        }
    };
    let mut all: Vec<&EnergySeries> =
        view.energies.iter().filter(|series| series.points.len() >= 3).collect();
    all.sort_by(|a, b| change(b).total_cmp(&change(a)));
    all.truncate(MOST);
    if all.is_empty() {
        return Vec::new();
    }
    let drifting: Vec<&EnergyDrift> = material
        .comparison
        .energy
        .iter()
        .filter(|e| e.rate.abs() > 4.0 * e.rate_error && e.rate_error > 0.0)
        .collect();
    let judged = material.comparison.energy.len();
    let losing = drifting.iter().filter(|e| e.rate < 0.0).count();
    let caption = format!(
        "Energy of the model at the states that were measured: constant where the motion keeps \
         H and the model is right. It drifts in {} of {judged} training runs{}.",
        drifting.len(),
        if drifting.is_empty() {
            String::new()
        } else {
            format!(", downwards in {losing} of them")
        }
    );
    let mut figure = Figure::new("energy", "Energy along the measurements".into(), caption);
    let points = || all.iter().flat_map(|series| series.points.iter());
    let x =
        Axis::linear(points().map(|p| p.0), 6).variable(&view.time.name, view.time.unit.as_deref());
    let y = Axis::linear(points().map(|p| p.1), 5);
    let y = forces::in_units_of(y, "energy H", energy_unit(view));
    let mut panel = Panel::new(1.0, x, y);
    for (at, series) in all.iter().enumerate().rev() {
        let style = if at < NAMED { Style::Series(at as u8) } else { Style::Faint };
        let about = SeriesInfo::run("energy", &series.run);
        panel.marks.push(Mark::Line { style, points: series.points.clone(), about });
        if at < NAMED && series.points.len() <= 40 {
            let texts = series
                .points
                .iter()
                .map(|(t, e)| {
                    let (t, e) = (label::number(*t, 3), label::number(*e, 4));
                    format!("run {} at {t}: energy {e}", series.run)
                })
                .collect();
            panel.marks.push(Mark::Markers { style, points: series.points.clone(), texts });
        }
    }
    for (at, series) in all.iter().enumerate().take(NAMED) {
        let rate = drift(series).map_or(String::new(), |e| {
            format!(": dH/dt = {}", label::measured(e.rate, e.rate_error, 2))
        });
        let held_out = if series.held_out { " (held out)" } else { "" };
        let shape = if series.points.len() <= 40 { Shape::Both } else { Shape::Line };
        figure.key(Style::Series(at as u8), shape, &format!("run {}{held_out}{rate}", series.run));
    }
    if all.len() > NAMED {
        let text = format!("{} more", all.len() - NAMED);
        figure.key(Style::Faint, Shape::Line, &text);
    }
    figure.height += 17.0 * (figure.legend.len().saturating_sub(2) as f64);
    figure.panels.push(panel);
    vec![figure]
}
