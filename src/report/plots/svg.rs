//! Draws a [`Figure`] as SVG: text stays text, colours come from a style sheet that knows light
//! and dark, and every series says what it is, so that a script can read values back.

use std::fmt::Write;

use super::axes::Axis;
use super::figure::{Arrangement, Figure, Key, Panel, Shape};
use super::label;
use super::marks::{Frame, Pen, class, draw_mark, marker};
use super::style::{self, Background};
use super::xml::escaped;

/// Where the drawing goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Medium {
    /// A file of its own, with its style sheet and a background: light or dark as the reader
    /// prefers.
    File,
    /// The same, light or dark for good.
    Print(Background),
    /// A page that has [`sheet`](super::sheet) already.
    Page,
}

/// Height of a line of text.
const LINE: f64 = 17.0;
/// Width of a letter, more or less.
const LETTER: f64 = 6.7;
/// Space between panels.
const GAP: f64 = 14.0;
const RIGHT: f64 = 16.0;
/// Longest name at the left of a row, in letters.
const LONGEST_NAME: usize = 26;

/// The figure as one `svg` element.
pub fn draw(figure: &Figure, target: Medium) -> String {
    let (keys, legend_lines) = legend(figure);
    let top = 26.0 + LINE * legend_lines as f64 + if legend_lines > 0 { 8.0 } else { 6.0 };
    let frames = frames(figure, top);
    let mut out = String::new();
    let (width, height) = (figure.width, figure.height);
    let id = &figure.id;
    let _ = write!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"figure\" viewBox=\"0 0 {width} {height}\" \
         width=\"{width}\" height=\"{height}\" role=\"img\" \
         aria-labelledby=\"{id}-title {id}-desc\">\n\
         <title id=\"{id}-title\">{}</title>\n<desc id=\"{id}-desc\">{}</desc>\n",
        escaped(&figure.title),
        escaped(&figure.caption),
    );
    let sheet = match target {
        Medium::File => Some(style::sheet()),
        Medium::Print(paper) => Some(style::print_sheet(paper)),
        Medium::Page => None,
    };
    if let Some(sheet) = sheet {
        let _ = write!(
            out,
            "<style>{sheet}</style>\n\
             <rect class=\"paper\" width=\"{width}\" height=\"{height}\"/>\n",
        );
    }
    let _ = writeln!(
        out,
        "<text class=\"title\" x=\"10\" y=\"19\">{}</text>",
        escaped(&shortened(&figure.title, ((width - 20.0) / 7.6) as usize))
    );
    out += &keys;
    let last = figure.panels.len().saturating_sub(1);
    for (at, (panel, frame)) in figure.panels.iter().zip(&frames).enumerate() {
        let stacked = figure.arrangement == Arrangement::Stacked;
        let (numbers_x, numbers_y) = (!stacked || at == last, stacked || at == 0);
        draw_panel(&mut out, panel, *frame, numbers_x, numbers_y);
    }
    out += "</svg>\n";
    out
}

/// At most so many letters, with an ellipsis in place of the rest.
fn shortened(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_string();
    }
    let kept: String = text.chars().take(most.saturating_sub(1)).collect();
    format!("{}…", kept.trim_end())
}

/// Where the panels lie below `top`.
fn frames(figure: &Figure, top: f64) -> Vec<Frame> {
    let widest = |axis: &Axis| {
        let longest = axis.ticks.iter().map(|tick| tick.text.chars().count()).max().unwrap_or(0);
        longest.min(LONGEST_NAME) as f64
    };
    let labelled: Vec<&Panel> = match figure.arrangement {
        Arrangement::Stacked => figure.panels.iter().collect(),
        Arrangement::Beside => figure.panels.iter().take(1).collect(),
    };
    let letters = labelled.iter().map(|panel| widest(&panel.y)).fold(2.0, f64::max);
    let named = labelled.iter().any(|panel| !panel.y.name.is_empty());
    let left = 12.0 + LETTER * letters + if named { 18.0 } else { 0.0 };
    let below =
        if figure.panels.iter().any(|panel| !panel.x.name.is_empty()) { 42.0 } else { 24.0 };
    let all: f64 = figure.panels.iter().map(|panel| panel.share).sum();
    let gaps = GAP * figure.panels.len().saturating_sub(1) as f64;
    let (width, height) = (figure.width - left - RIGHT, figure.height - top - below);
    let mut frames = Vec::new();
    let mut at = 0.0;
    for panel in &figure.panels {
        let share = panel.share / all;
        frames.push(match figure.arrangement {
            Arrangement::Stacked => {
                let own = share * (height - gaps);
                let frame = Frame { left, top: top + at, width, height: own };
                at += own + GAP;
                frame
            }
            Arrangement::Beside => {
                let own = share * (width - gaps);
                let frame = Frame { left: left + at, top, width: own, height };
                at += own + GAP;
                frame
            }
        });
    }
    frames
}

/// The legend, and how many lines it takes.
fn legend(figure: &Figure) -> (String, usize) {
    if figure.legend.is_empty() {
        return (String::new(), 0);
    }
    let mut out = String::from("<g class=\"legend\">\n");
    let (mut x, mut lines) = (12.0, 1);
    let most = ((figure.width - 60.0) / LETTER) as usize;
    for Key { style, shape, text } in &figure.legend {
        let text = shortened(text, most);
        let size = 30.0 + LETTER * text.chars().count() as f64 + 14.0;
        if x > 12.0 && x + size - 14.0 > figure.width - 8.0 {
            x = 12.0;
            lines += 1;
        }
        let y = 26.0 + LINE * lines as f64 - 5.0;
        let class = class(*style);
        if matches!(shape, Shape::Line | Shape::Both) {
            let _ = write!(out, "<path class=\"line {class}\" d=\"M{x} {y}h24\"/>");
        }
        if *shape == Shape::Area {
            let _ = write!(
                out,
                "<rect class=\"band {class}\" x=\"{x}\" y=\"{:.1}\" width=\"24\" height=\"10\"/>",
                y - 5.0
            );
        }
        if *shape == Shape::Cloud {
            let _ = write!(out, "<path class=\"cloud {class}\" d=\"");
            for (right, down) in [(4.0, 2.0), (12.0, -2.0), (20.0, 1.0)] {
                let _ = write!(out, "M{:.1} {:.1}h0", x + right, y + down);
            }
            out += "\"/>";
        }
        if matches!(shape, Shape::Point | Shape::Both) {
            out += &marker(*style, x + 12.0, y, "");
        }
        let _ = writeln!(
            out,
            "<text class=\"key\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            x + 30.0,
            y + 4.0,
            escaped(&text)
        );
        x += size;
    }
    out += "</g>\n";
    (out, lines)
}

fn draw_panel(out: &mut String, panel: &Panel, frame: Frame, numbers_x: bool, numbers_y: bool) {
    let pen = Pen { panel, frame };
    let scale = |axis: &Axis| match axis.scale {
        super::axes::Scale::Linear => "linear",
        super::axes::Scale::Logarithmic => "logarithmic",
    };
    let name = |axis: &Axis| {
        let name = if axis.variable { label::plain(&axis.name) } else { axis.name.clone() };
        escaped(&name)
    };
    let _ = writeln!(
        out,
        "<g class=\"panel\" data-frame=\"{:.1} {:.1} {:.1} {:.1}\" data-x=\"{:e} {:e} {}\" \
         data-y=\"{:e} {:e} {}\" data-names=\"{}|{}|{}|{}\">",
        frame.left,
        frame.top,
        frame.width,
        frame.height,
        panel.x.low,
        panel.x.high,
        scale(&panel.x),
        panel.y.low,
        panel.y.high,
        scale(&panel.y),
        name(&panel.x),
        escaped(&panel.x.unit),
        name(&panel.y),
        escaped(&panel.y.unit),
    );
    draw_axes(out, &pen, numbers_x, numbers_y);
    for mark in &panel.marks {
        draw_mark(out, &pen, mark);
    }
    let _ = writeln!(
        out,
        "<rect class=\"frame\" x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\"/>\n</g>",
        frame.left, frame.top, frame.width, frame.height
    );
}

fn draw_axes(out: &mut String, pen: &Pen, numbers_x: bool, numbers_y: bool) {
    let (frame, panel) = (pen.frame, pen.panel);
    let (right, bottom) = (pen.right(), pen.bottom());
    let mut grid = String::new();
    for tick in &panel.x.ticks {
        let _ = write!(grid, "M{:.1} {:.1}V{bottom:.1}", pen.x(tick.value), frame.top);
    }
    for tick in &panel.y.ticks {
        let _ = write!(grid, "M{:.1} {:.1}H{right:.1}", frame.left, pen.y(tick.value));
    }
    if !grid.is_empty() {
        let _ = writeln!(out, "<path class=\"grid\" d=\"{grid}\"/>");
    }
    if numbers_x && panel.x.shown {
        // Numbers that would touch the one before are left out.
        let mut free = f64::NEG_INFINITY;
        for tick in &panel.x.ticks {
            let half = 0.5 * LETTER * tick.text.chars().count() as f64;
            let x = pen.x(tick.value).clamp(half, right + RIGHT - half);
            if x - half < free {
                continue;
            }
            free = x + half + 4.0;
            let _ = writeln!(
                out,
                "<text class=\"tick\" x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                bottom + 16.0,
                escaped(&tick.text)
            );
        }
        if !panel.x.name.is_empty() {
            let _ = writeln!(
                out,
                "<text class=\"name\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                frame.left + 0.5 * frame.width,
                bottom + 35.0,
                axis_name(&panel.x)
            );
        }
    }
    if numbers_y && panel.y.shown {
        for tick in &panel.y.ticks {
            let _ = writeln!(
                out,
                "<text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                frame.left - 6.0,
                pen.y(tick.value) + 4.0,
                escaped(&shortened(&tick.text, LONGEST_NAME))
            );
        }
        if !panel.y.name.is_empty() {
            let (x, y) = (14.0, frame.top + 0.5 * frame.height);
            let _ = writeln!(
                out,
                "<text class=\"name\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\" \
                 transform=\"rotate(-90 {x:.1} {y:.1})\">{}</text>",
                axis_name(&panel.y)
            );
        }
    }
}

/// A variable in italics with its subscript, and its unit.
fn axis_name(axis: &Axis) -> String {
    let mut out = String::new();
    if axis.variable {
        let (letter, subscript) = label::parts(&axis.name);
        let _ = write!(out, "<tspan class=\"variable\">{}</tspan>", escaped(&letter));
        if !subscript.is_empty() {
            let _ = write!(
                out,
                "<tspan class=\"subscript\" dy=\"3\">{}</tspan><tspan dy=\"-3\">\u{200b}</tspan>",
                escaped(&subscript)
            );
        }
    } else {
        out += &escaped(&axis.name);
    }
    if !axis.unit.is_empty() {
        let _ = write!(out, " [{}]", escaped(&axis.unit));
    }
    out
}
