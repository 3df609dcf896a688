//! The effects that could be missing: how much evidence there is for each, and what each does
//! to the error on held-out runs.

use super::axes::Axis;
use super::figure::{Arrangement, Figure, Mark, Panel, Shape, Style};
use super::{PlotData, forces, tenths, times};
use crate::diagnose::diagnosis::Diagnosis;
use crate::report::present;

/// The leaders, the best on top; and the force that is left when all that has a name is in.
pub(super) fn figures(material: &PlotData) -> Vec<Figure> {
    let Some(diagnosis) = material.diagnosis else { return Vec::new() };
    let shape = diagnosis.shape.as_ref().and_then(|map| forces::figure(material.view, map));
    let shape = shape.map(|mut figure| {
        figure.id = "ranking-shape".to_string();
        figure.title = format!("Not in the catalogue: {}", figure.title);
        figure
    });
    ranking(diagnosis).into_iter().chain(shape).collect()
}

fn ranking(diagnosis: &Diagnosis) -> Option<Figure> {
    let ranking = &diagnosis.ranking;
    let first = ranking.first()?;
    let mut caption = format!(
        "Left, the evidence for each effect: by how much the deviance of the training runs falls \
         when it is added and all is fitted again. Right, the error on held-out runs before and \
         after, in units of the noise. {}",
        present::tested(diagnosis)
    );
    if let Some(sentence) = present::indistinguishable(diagnosis) {
        caption += &format!(" {sentence}");
    }
    let mut figure = Figure::new("ranking", "Effects that could be missing".into(), caption);
    figure.height = 122.0 + 30.0 * ranking.len() as f64;
    figure.arrangement = Arrangement::Beside;
    // The best stands on top: rows count upwards.
    let row = |at: usize| (ranking.len() - 1 - at) as f64;
    let rows = || Axis::rows(ranking.iter().rev().map(|leader| leader.effect.clone()));
    let most = ranking.iter().map(|l| l.deviance).filter(|d| d.is_finite()).fold(1.0, f64::max);
    let x = Axis::between(0.0, 1.06 * most, 3).words("evidence");
    let mut evidence = Panel::new(0.5, x, rows());
    let errors = ranking.iter().flat_map(|l| [l.held_out_error_before, l.held_out_error_after]);
    let x = Axis::logarithmic(errors.chain([0.9, 1.2])).words("held-out error");
    let mut error = Panel::new(0.5, x, rows());
    error.marks.push(Mark::Upright { style: Style::Reference, x: 1.0 });
    let like_first = |effect: &str| {
        effect == first.effect || diagnosis.indistinguishable.iter().any(|e| e == effect)
    };
    for (at, leader) in ranking.iter().enumerate() {
        let row = row(at);
        let style = if like_first(&leader.effect) { Style::Chosen } else { Style::Faint };
        let text = format!(
            "{}: deviance falls by {}; held-out error {} to {}",
            leader.effect,
            tenths(leader.deviance),
            times(leader.held_out_error_before),
            times(leader.held_out_error_after)
        );
        evidence.marks.push(Mark::Bar {
            style,
            row,
            from: 0.0,
            to: leader.deviance.clamp(0.0, most),
            text: text.clone(),
        });
        let (before, after) = (leader.held_out_error_before, leader.held_out_error_after);
        if !(before > 0.0 && after > 0.0 && before.is_finite() && after.is_finite()) {
            continue;
        }
        error.marks.push(Mark::Arrow { style: Style::Measured, row, from: before, to: after });
        for (style, x) in [(Style::Baseline, before), (Style::Model, after)] {
            let texts = vec![text.clone()];
            error.marks.push(Mark::Markers { style, points: vec![(x, row)], texts });
        }
    }
    figure.key(Style::Chosen, Shape::Area, "best, and effects indistinguishable from it");
    figure.key(Style::Baseline, Shape::Point, "before");
    figure.key(Style::Model, Shape::Point, "after");
    figure.key(Style::Reference, Shape::Line, "noise floor");
    figure.panels = vec![evidence, error];
    Some(figure)
}
