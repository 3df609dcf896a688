//! Residual force over the plane of a coordinate and its momentum.

use super::axes::Axis;
use super::figure::{Figure, Mark, Panel};
use super::forces::{force_unit, p_value_text};
use super::{PlotData, label};
use crate::diagnose::comparison::plane::{ForceNode, ForcePlane};
use crate::diagnose::comparison::view::View;

/// p-value below which the numbers of a map are drawn.
const TELLING: f64 = 1e-3;

/// One figure for each coordinate whose plane is known, the most telling first.
pub(super) fn figures(material: &PlotData) -> Vec<Figure> {
    let view = material.view;
    let mut planes: Vec<&ForcePlane> = view.planes.iter().collect();
    planes.sort_by(|a, b| a.p_value.total_cmp(&b.p_value));
    planes.into_iter().filter_map(|plane| figure(view, plane)).collect()
}

fn figure(view: &View, plane: &ForcePlane) -> Option<Figure> {
    let q = view.state.get(plane.coordinate)?;
    let p = view.state.get(view.state.len() / 2 + plane.coordinate)?;
    let known = |node: &&ForceNode| node.force.is_finite() && node.standard_error.is_finite();
    let nodes: Vec<&ForceNode> = plane.nodes.iter().filter(known).collect();
    let sure = |force: f64, error: f64| force.abs() > 2.0 * error;
    let largest = |all: &dyn Fn(&ForceNode) -> bool| {
        nodes.iter().filter(|n| all(n)).map(|n| n.force.abs()).fold(0.0, f64::max)
    };
    // What is not known sets no scale.
    let most = match largest(&|n| sure(n.force, n.standard_error)) {
        most if most > 0.0 => most,
        _ => largest(&|_| true),
    };
    if nodes.is_empty() || most <= 0.0 || plane.across.len() < 2 || plane.up.len() < 2 {
        return None;
    }
    let name = label::plain(&q.name);
    let title = format!("Missing force on {name} over phase space");
    let significant = nodes.iter().filter(|n| sure(n.force, n.standard_error)).count();
    let telling = plane.p_value < TELLING;
    let mut caption = format!(
        "Force on {name} that the model lacks, over {name} and {}. The stronger the colour, the \
         larger the force (vermilion and + push up, blue and − push down). If nothing were missing, noise alone would reach this with a probability (p-value) of {}",
        label::plain(&p.name),
        p_value_text(plane.p_value),
    );
    caption += &if telling {
        format!(
            "; numbers stand where it is more than two standard errors from zero, at \
             {significant} of {} places.",
            nodes.len()
        )
    } else {
        ": not significant.".to_string()
    };
    let mut figure = Figure::new(&format!("force-map-{}", q.name), title, caption);
    let half = |all: &[f64]| 0.5 * (all[1] - all[0]);
    let (half_x, half_y) = (half(&plane.across), half(&plane.up));
    let ends = |all: &[f64], half: f64| (all[0] - half, all[all.len() - 1] + half);
    let ((left, right), (low, high)) = (ends(&plane.across, half_x), ends(&plane.up, half_y));
    let x = Axis::between(left, right, 6).variable(&q.name, q.unit.as_deref());
    let y = Axis::between(low, high, 5).variable(&p.name, p.unit.as_deref());
    let mut panel = Panel::new(1.0, x, y);
    // One power of ten for all numbers, so that they fit into their cells.
    let power = most.log10().floor();
    let shift = if (-2.0..3.0).contains(&power) { 0.0 } else { power };
    for node in nodes {
        let (Some(&x), Some(&y)) = (plane.across.get(node.column), plane.up.get(node.row)) else {
            continue;
        };
        let scaled = node.force / 10f64.powf(shift);
        let label = if telling && sure(node.force, node.standard_error) {
            let digits = (1.0 - (most.log10().floor() - shift)).clamp(0.0, 3.0) as usize;
            format!("{scaled:+.digits$}").replace('-', "−")
        } else {
            String::new()
        };
        let text = format!(
            "{name} = {}, {} = {}: force {}, {} samples",
            label::number(x, 3),
            label::plain(&p.name),
            label::number(y, 3),
            label::measured(node.force, node.standard_error, 3),
            node.samples
        );
        // What is not known is not coloured as if it were.
        let trust =
            (node.force.abs() / (2.0 * node.standard_error).max(f64::MIN_POSITIVE)).min(1.0);
        panel.marks.push(Mark::Cell {
            x: (x - half_x, x + half_x),
            y: (y - half_y, y + half_y),
            strength: if telling { 0.75 } else { 0.2 }
                * trust
                * (node.force / most).clamp(-1.0, 1.0),
            label,
            text,
        });
    }
    let unit = label::unit(force_unit(view, &q.name).as_deref());
    let power = match shift {
        0.0 => String::new(),
        shift => label::power_of_ten(shift as i32),
    };
    let of =
        [power, unit].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ");
    if !of.is_empty() {
        figure.title += &format!(", in {of}");
    }
    figure.panels.push(panel);
    Some(figure)
}
