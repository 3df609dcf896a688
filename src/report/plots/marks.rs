//! Marks of a panel as SVG: lines, clouds, bands, bars, cells, words.

use std::fmt::Write;

use super::figure::{Anchor, Mark, Panel, SeriesInfo, Style};
use super::thin;
use super::xml::escaped;

/// A rectangle in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

/// The name of a style in the style sheet.
pub(super) fn class(style: Style) -> String {
    match style {
        Style::Measured => "measured".to_string(),
        Style::Model => "model".to_string(),
        Style::HeldOut => "held_out".to_string(),
        Style::Reference => "reference".to_string(),
        Style::Baseline => "baseline".to_string(),
        Style::Faint => "faint".to_string(),
        Style::Chosen => "chosen".to_string(),
        Style::Contour => "contour".to_string(),
        Style::Series(i) => format!("s{}", i % 7),
        Style::Positive => "positive".to_string(),
        Style::Negative => "negative".to_string(),
    }
}

/// A marker whose form belongs to its style: colour never stands alone.
pub(super) fn marker(style: Style, x: f64, y: f64, text: &str) -> String {
    let class = class(style);
    let form = match style {
        Style::HeldOut | Style::Negative | Style::Series(1 | 5) => {
            format!("M{:.1} {:.1}h7v7h-7z", x - 3.5, y - 3.5)
        }
        Style::Baseline | Style::Series(2 | 6) => {
            format!("M{x:.1} {:.1}l4.3 7.4h-8.6z", y - 4.7)
        }
        Style::Series(3) => format!("M{x:.1} {:.1}l4.6 4.6l-4.6 4.6l-4.6 -4.6z", y - 4.6),
        Style::Series(4) => format!("M{x:.1} {:.1}l4.3 -7.4h-8.6z", y + 4.7),
        Style::Chosen => format!("M{:.1} {y:.1}a7 7 0 1 0 14 0a7 7 0 1 0 -14 0z", x - 7.0),
        _ => format!("M{:.1} {y:.1}a3.8 3.8 0 1 0 7.6 0a3.8 3.8 0 1 0 -7.6 0z", x - 3.8),
    };
    if text.is_empty() {
        return format!("<path class=\"marker {class}\" d=\"{form}\"/>");
    }
    format!("<path class=\"marker {class}\" d=\"{form}\"><title>{}</title></path>", escaped(text))
}

/// A panel's own coordinates.
pub(super) struct Pen<'a> {
    pub panel: &'a Panel,
    pub frame: Frame,
}

impl Pen<'_> {
    pub(super) fn x(&self, value: f64) -> f64 {
        self.frame.left + self.frame.width * self.panel.x.place(value)
    }

    pub(super) fn y(&self, value: f64) -> f64 {
        self.frame.top + self.frame.height * (1.0 - self.panel.y.place(value))
    }

    fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x(x), self.y(y))
    }

    pub(super) fn right(&self) -> f64 {
        self.frame.left + self.frame.width
    }

    pub(super) fn bottom(&self) -> f64 {
        self.frame.top + self.frame.height
    }

    /// Held inside the frame; NaN goes to its nearest corner.
    fn held(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let hold = |value: f64, low: f64, high: f64| {
            if value.is_nan() { low } else { value.clamp(low, high) }
        };
        (hold(x, self.frame.left, self.right()), hold(y, self.frame.top, self.bottom()))
    }

    fn inside(&self, (x, y): (f64, f64)) -> bool {
        let room = 0.5;
        x >= self.frame.left - room
            && x <= self.right() + room
            && y >= self.frame.top - room
            && y <= self.bottom() + room
    }

    /// The part of a straight line that lies inside the frame (Liang and Barsky).
    fn clip(&self, a: (f64, f64), b: (f64, f64)) -> Option<((f64, f64), (f64, f64))> {
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        let (mut from, mut to) = (0.0f64, 1.0f64);
        let sides = [
            (-dx, a.0 - self.frame.left),
            (dx, self.right() - a.0),
            (-dy, a.1 - self.frame.top),
            (dy, self.bottom() - a.1),
        ];
        for (slope, room) in sides {
            if slope == 0.0 {
                if room < 0.0 {
                    return None;
                }
            } else if slope < 0.0 {
                from = from.max(room / slope);
            } else {
                to = to.min(room / slope);
            }
        }
        let finite = from.is_finite() && to.is_finite();
        let point = |share: f64| (a.0 + share * dx, a.1 + share * dy);
        (finite && from <= to).then(|| (point(from), point(to)))
    }
}

/// Columns in which a line keeps its extremes, to a pixel.
const COLUMNS_A_PIXEL: f64 = 1.0;
/// More points than this are a crowd.
const CROWD: usize = 1500;
/// Side of the cells in which a cloud keeps one point, in pixels.
const CELL: f64 = 2.0;

/// Draws one mark into its panel.
pub(super) fn draw_mark(out: &mut String, pen: &Pen, mark: &Mark) {
    match mark {
        Mark::Line { style, points, about } => {
            let columns = (pen.frame.width * COLUMNS_A_PIXEL) as usize;
            let kept = if ascending(points) {
                thin::line(points, columns)
            } else {
                (0..points.len()).collect()
            };
            let path = line_path(pen, kept.iter().map(|&i| points[i]));
            if !path.is_empty() {
                let _ = writeln!(
                    out,
                    "<path class=\"line {}\"{} d=\"{path}\"/>",
                    class(*style),
                    series(about)
                );
            }
        }
        Mark::Cloud { style, points, about } => {
            let across = (pen.frame.width / CELL) as usize;
            let up = (pen.frame.height / CELL) as usize;
            let place = |(x, y)| (pen.panel.x.place(x), pen.panel.y.place(y));
            let kept = thin::cloud(points, &place, across, up);
            let mut path = String::new();
            let mut times = String::new();
            for &i in &kept {
                let at = pen.at(points[i]);
                if !pen.inside(at) {
                    continue;
                }
                let _ = write!(path, "M{:.1} {:.1}h0", at.0, at.1);
                if let Some(time) = about.times.get(i) {
                    let _ = write!(times, "{time:.4} ");
                }
            }
            if !path.is_empty() {
                let times = if times.is_empty() {
                    String::new()
                } else {
                    format!(" data-times=\"{}\"", times.trim_end())
                };
                // A crowd of points shows its density better when each is small.
                let dense = if kept.len() > CROWD { " dense" } else { "" };
                let _ = writeln!(
                    out,
                    "<path class=\"cloud {}{dense}\"{}{times} d=\"{path}\"/>",
                    class(*style),
                    series(about)
                );
            }
        }
        Mark::Markers { style, points, texts } => {
            for (i, &point) in points.iter().enumerate() {
                let at = pen.at(point);
                if pen.inside(at) {
                    let text = texts.get(i).map_or("", String::as_str);
                    let _ = writeln!(out, "{}", marker(*style, at.0, at.1, text));
                }
            }
        }
        Mark::Band { style, points } => draw_band(out, pen, *style, points),
        Mark::ErrorBars { style, points } => {
            let mut path = String::new();
            for &(x, low, high) in points.iter().filter(|p| p.1.is_finite() && p.2.is_finite()) {
                let (low, high) = (pen.held(pen.at((x, low))), pen.held(pen.at((x, high))));
                let _ = write!(path, "M{:.1} {:.1}V{:.1}", low.0, low.1, high.1);
            }
            if !path.is_empty() {
                let _ =
                    writeln!(out, "<path class=\"line error {}\" d=\"{path}\"/>", class(*style));
            }
        }
        Mark::Bar { style, row, from, to, text } => {
            let (from, to) = (pen.held((pen.x(*from), 0.0)).0, pen.held((pen.x(*to), 0.0)).0);
            let (low, high) = (pen.y(row + 0.3), pen.y(row - 0.3));
            let (top, height) = (low.min(high), (high - low).abs());
            let _ = writeln!(
                out,
                "<rect class=\"bar {}\" x=\"{:.1}\" y=\"{top:.1}\" width=\"{:.1}\" \
                 height=\"{height:.1}\"><title>{}</title></rect>",
                class(*style),
                from.min(to),
                (to - from).abs().max(1.0),
                escaped(text)
            );
        }
        Mark::Arrow { style, row, from, to } => {
            let a = pen.held(pen.at((*from, *row)));
            let b = pen.held(pen.at((*to, *row)));
            let head = 5.0 * (b.0 - a.0).signum();
            if (b.0 - a.0).abs() < 14.0 {
                return;
            }
            let _ = writeln!(
                out,
                "<path class=\"line arrow {}\" d=\"M{:.1} {:.1}H{:.1}m{:.1} -4l{head:.1} 4l{:.1} 4\"/>",
                class(*style),
                a.0 + head,
                a.1,
                b.0 - 1.4 * head,
                -head,
                -head,
            );
        }
        Mark::Cell { x, y, strength, label, text } => {
            draw_cell(out, pen, *x, *y, *strength, label, text);
        }
        Mark::Level { style, y } => {
            let y = pen.y(*y);
            if y.is_finite() && y >= pen.frame.top - 0.5 && y <= pen.bottom() + 0.5 {
                let (left, right) = (pen.frame.left, pen.right());
                let _ = writeln!(
                    out,
                    "<path class=\"line {}\" d=\"M{left:.1} {y:.1}H{right:.1}\"/>",
                    class(*style)
                );
            }
        }
        Mark::Upright { style, x } => {
            let x = pen.x(*x);
            if x.is_finite() && x >= pen.frame.left - 0.5 && x <= pen.right() + 0.5 {
                let (top, bottom) = (pen.frame.top, pen.bottom());
                let _ = writeln!(
                    out,
                    "<path class=\"line {}\" d=\"M{x:.1} {top:.1}V{bottom:.1}\"/>",
                    class(*style)
                );
            }
        }
        Mark::Text { at, anchor, style, shift, text } => {
            let at = pen.at(*at);
            if !pen.inside(at) {
                return;
            }
            let anchor = match anchor {
                Anchor::Start => "start",
                Anchor::Middle => "middle",
                Anchor::End => "end",
            };
            let _ = writeln!(
                out,
                "<text class=\"note {}\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">{}</text>",
                class(*style),
                at.0 + shift.0,
                at.1 + shift.1,
                escaped(text)
            );
        }
    }
}

fn ascending(points: &[(f64, f64)]) -> bool {
    points.windows(2).all(|pair| pair[0].0 <= pair[1].0 || pair[0].0.is_nan() || pair[1].0.is_nan())
}

fn series(about: &SeriesInfo) -> String {
    let mut out = String::new();
    if !about.name.is_empty() {
        let _ = write!(out, " data-series=\"{}\"", escaped(&about.name));
    }
    if let Some(run) = &about.run {
        let _ = write!(out, " data-run=\"{}\"", escaped(run));
    }
    out
}

/// A line in pixels, broken where it leaves the frame or the numbers.
fn line_path(pen: &Pen, points: impl Iterator<Item = (f64, f64)>) -> String {
    let mut path = String::new();
    let mut before: Option<(f64, f64)> = None;
    let mut end: Option<(f64, f64)> = None;
    for point in points {
        let (x, y) = pen.at(point);
        if !(x.is_finite() && y.is_finite()) {
            before = None;
            end = None;
            continue;
        }
        if let Some(last) = before
            && let Some((from, to)) = pen.clip(last, (x, y))
        {
            if end != Some(from) {
                let _ = write!(path, "M{:.1} {:.1}", from.0, from.1);
            }
            let _ = write!(path, "L{:.1} {:.1}", to.0, to.1);
            end = Some(to);
        }
        before = Some((x, y));
    }
    path
}

fn draw_band(out: &mut String, pen: &Pen, style: Style, points: &[(f64, f64, f64)]) {
    let all: Vec<((f64, f64), (f64, f64))> = points
        .iter()
        .filter(|p| p.0.is_finite() && p.1.is_finite() && p.2.is_finite())
        .map(|&(x, low, high)| (pen.held(pen.at((x, low))), pen.held(pen.at((x, high)))))
        .collect();
    if all.len() < 2 {
        return;
    }
    let mut path = String::new();
    let up = all.iter().map(|p| p.0);
    let back = all.iter().rev().map(|p| p.1);
    for (i, (x, y)) in up.chain(back).enumerate() {
        let _ = write!(path, "{}{x:.1} {y:.1}", if i == 0 { "M" } else { "L" });
    }
    let _ = writeln!(out, "<path class=\"band {}\" d=\"{path}z\"/>", class(style));
}

fn draw_cell(
    out: &mut String,
    pen: &Pen,
    x: (f64, f64),
    y: (f64, f64),
    strength: f64,
    label: &str,
    text: &str,
) {
    let (a, b) = (pen.held(pen.at((x.0, y.1))), pen.held(pen.at((x.1, y.0))));
    let style = if strength < 0.0 { Style::Negative } else { Style::Positive };
    let opacity = if strength.is_finite() { strength.abs().min(1.0) } else { 0.0 };
    let _ = writeln!(
        out,
        "<rect class=\"cell {}\" x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" \
         fill-opacity=\"{:.2}\"><title>{}</title></rect>",
        class(style),
        a.0,
        a.1,
        (b.0 - a.0).max(0.0),
        (b.1 - a.1).max(0.0),
        opacity,
        escaped(text)
    );
    if !label.is_empty() {
        let _ = writeln!(
            out,
            "<text class=\"inside\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            0.5 * (a.0 + b.0),
            0.5 * (a.1 + b.1) + 4.0,
            escaped(label)
        );
    }
}
