//! Residual force against each variable, with its band.

use super::axes::Axis;
use super::figure::{Figure, Mark, Panel, SeriesInfo, Shape, Style};
use super::{PlotData, label};
use crate::diagnose::comparison::ResidualMap;
use crate::diagnose::comparison::view::View;

/// Maps that a report draws, the most telling first.
const MOST: usize = 6;

/// The most telling maps.
pub(super) fn figures(material: &PlotData) -> Vec<Figure> {
    let mut maps: Vec<&ResidualMap> = material.comparison.maps.iter().collect();
    maps.sort_by(|a, b| a.p_value.total_cmp(&b.p_value).then(b.deviance.total_cmp(&a.deviance)));
    maps.iter().filter_map(|map| figure(material.view, map)).take(MOST).collect()
}

/// One map; none where no point of it is known.
pub(super) fn figure(view: &View, map: &ResidualMap) -> Option<Figure> {
    let points: Vec<(f64, f64, f64)> = map
        .points
        .iter()
        .copied()
        .filter(|(x, force, error)| x.is_finite() && force.is_finite() && error.is_finite())
        .collect();
    if points.len() < 2 {
        return None;
    }
    let (on, against) = (label::plain(&map.on), label::plain(&map.against));
    let worst = points
        .iter()
        .copied()
        .filter(|p| p.2 > 0.0)
        .max_by(|a, b| (a.1 / a.2).abs().total_cmp(&(b.1 / b.2).abs()));
    let mut caption = format!(
        "Force on {on} that the model lacks, as a function of {against}, and its band of two \
         standard errors. "
    );
    caption += &match worst {
        Some((x, force, error)) if map.p_value < 1e-3 => format!(
            "Largest at {against} = {}: {}, {:.0} standard errors from zero. If nothing were missing, noise alone would reach this with a probability (p-value) of {}.",
            label::number(x, 2),
            label::number(force, 3),
            (force / error).abs(),
            p_value_text(map.p_value)
        ),
        _ => {
            format!(
                "If nothing were missing, noise alone would reach this with a probability (p-value) of {}: not significant.",
                p_value_text(map.p_value)
            )
        }
    };
    let title = format!("Missing force on {on} against {against}");
    let id = format!("forces-{}-{}", map.on, map.against);
    let mut figure = Figure::new(&id, title, caption);
    figure.key(Style::Model, Shape::Both, "missing force");
    figure.key(Style::Model, Shape::Area, "two standard errors");
    let quantities = view.state.iter().chain([&view.time]);
    let unit =
        quantities.into_iter().find(|q| q.name == map.against).and_then(|q| q.unit.as_deref());
    let x = Axis::linear(points.iter().map(|p| p.0), 6).variable(&map.against, unit);
    let band: Vec<(f64, f64, f64)> =
        points.iter().map(|&(x, f, s)| (x, f - 2.0 * s, f + 2.0 * s)).collect();
    // Where next to nothing is known the band would make the rest small.
    let mut errors: Vec<f64> = points.iter().map(|p| p.2).collect();
    errors.sort_by(f64::total_cmp);
    let most = points.iter().map(|p| p.1.abs()).fold(3.0 * errors[errors.len() / 2], f64::max);
    let ends = band.iter().flat_map(|p| [p.1, p.2]).filter(|y| y.abs() <= 2.5 * most).chain([0.0]);
    let y = in_units_of(Axis::linear(ends, 5), "force", force_unit(view, &map.on));
    let mut panel = Panel::new(1.0, x, y);
    let curve: Vec<(f64, f64)> = points.iter().map(|p| (p.0, p.1)).collect();
    let texts = points
        .iter()
        .map(|&(x, force, error)| {
            let force = label::measured(force, error, 3);
            let unit = label::unit(force_unit(view, &map.on).as_deref());
            format!("{against} = {}: force {force} {unit}", label::number(x, 3)).trim_end().into()
        })
        .collect();
    panel.marks = vec![
        Mark::Level { style: Style::Reference, y: 0.0 },
        Mark::Band { style: Style::Model, points: band },
        Mark::Line {
            style: Style::Model,
            points: curve.clone(),
            about: SeriesInfo::named("force"),
        },
        Mark::Markers { style: Style::Model, points: curve, texts },
    ];
    figure.panels.push(panel);
    Some(figure)
}

/// Unit of the force on a coordinate: that of its momentum over time.
pub(super) fn force_unit(view: &View, on: &str) -> Option<String> {
    let at = view.state.iter().position(|quantity| quantity.name == on)?;
    let momentum = view.state.get(view.state.len() / 2 + at)?;
    label::product(&[(momentum.unit.as_deref(), 1), (view.time.unit.as_deref(), -1)])
}

/// An axis of a quantity that is derived from the spec's: with its unit, where the spec says any.
pub(super) fn in_units_of(axis: Axis, name: &str, unit: Option<String>) -> Axis {
    match unit.as_deref() {
        None => axis.words(&format!("{name}, in units of the data")),
        Some("1") => axis.words(name),
        unit => axis.words(name).unit(&label::unit(unit)),
    }
}

/// A p-value in words.
pub(super) fn p_value_text(p: f64) -> String {
    if !p.is_finite() {
        return "?".to_string();
    }
    if p < 1e-12 { "less than 10⁻¹²".to_string() } else { label::number(p, 2) }
}
