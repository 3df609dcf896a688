//! The picture of the README: the orbit predicted by the learned law on the true one, and how
//! far coordinates and energy go astray. Readable on light and on dark pages.

use std::fmt::Write as _;

use crate::paper::figures::Predicted;

const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 400.0;

const STYLE: &str = "
  text { font: 13px system-ui, sans-serif; fill: #3d4450; }
  .title { font-weight: 600; font-size: 14px; }
  .small { font-size: 12px; }
  .axis { stroke: #9aa3b0; stroke-width: 1; fill: none; }
  .grid { stroke: #9aa3b0; stroke-opacity: 0.28; stroke-width: 1; }
  .true { stroke: #b9c4d6; stroke-width: 7; fill: none; stroke-linecap: round; stroke-linejoin: round; }
  .learned { stroke: #c2410c; stroke-width: 2; fill: none; stroke-linecap: round; stroke-linejoin: round; }
  .energy { stroke: #2563eb; stroke-width: 2; fill: none; stroke-linejoin: round; }
  .start { fill: #c2410c; }
  @media (prefers-color-scheme: dark) {
    text { fill: #d5dbe5; }
    .axis, .grid { stroke: #7b8696; }
    .true { stroke: #56647c; }
    .learned { stroke: #fb923c; }
    .start { fill: #fb923c; }
    .energy { stroke: #60a5fa; }
  }
";

/// A rectangle of the page, and the numbers at its edges.
struct Panel {
    left: f64,
    top: f64,
    width: f64,
    height: f64,
    x: (f64, f64),
    y: (f64, f64),
}

impl Panel {
    fn at(&self, x: f64, y: f64) -> (f64, f64) {
        let part = |value: f64, (low, high): (f64, f64)| (value - low) / (high - low);
        (self.left + self.width * part(x, self.x), self.top + self.height * (1.0 - part(y, self.y)))
    }

    fn curve(&self, class: &str, points: impl Iterator<Item = (f64, f64)>) -> String {
        let mut path = String::new();
        for (i, (x, y)) in points.enumerate() {
            let (x, y) = self.at(x, y);
            let _ = write!(path, "{}{x:.1} {y:.1}", if i == 0 { "M" } else { "L" });
        }
        format!("<path class=\"{class}\" d=\"{path}\"/>\n")
    }

    /// Frame, grid lines and numbers.
    fn frame(&self, ticks_x: &[f64], ticks_y: &[f64], name_x: &str, name_y: &str) -> String {
        let mut out = String::new();
        let (bottom, right) = (self.top + self.height, self.left + self.width);
        for &tick in ticks_x {
            let (x, _) = self.at(tick, self.y.0);
            let _ = write!(
                out,
                "<line class=\"grid\" x1=\"{x:.1}\" y1=\"{}\" x2=\"{x:.1}\" y2=\"{bottom}\"/>\n\
                 <text class=\"small\" x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n",
                self.top,
                bottom + 17.0,
                number(tick)
            );
        }
        for &tick in ticks_y {
            let (_, y) = self.at(self.x.0, tick);
            let _ = write!(
                out,
                "<line class=\"grid\" x1=\"{}\" y1=\"{y:.1}\" x2=\"{right}\" y2=\"{y:.1}\"/>\n\
                 <text class=\"small\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>\n",
                self.left,
                self.left - 7.0,
                y + 4.0,
                number(tick)
            );
        }
        let _ = write!(
            out,
            "<rect class=\"axis\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/>\n\
             <text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{name_x}</text>\n\
             <text x=\"{}\" y=\"{}\">{name_y}</text>\n",
            self.left,
            self.top,
            self.width,
            self.height,
            self.left + self.width / 2.0,
            bottom + 35.0,
            self.left,
            self.top - 8.0,
        );
        out
    }
}

/// A number without the zeros that say nothing, with a real minus sign.
fn number(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    text.replace('-', "\u{2212}")
}

/// Multiples of `step` between two numbers.
fn ticks((low, high): (f64, f64), step: f64) -> Vec<f64> {
    let first = (low / step).ceil() as i64;
    let last = (high / step).floor() as i64;
    (first..=last).map(|i| i as f64 * step).collect()
}

/// The smallest of 1, 2 or 5 times a power of ten that is at least `value`.
fn round_up(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|x| *x >= value).unwrap_or(value)
}

/// The whole picture.
pub(crate) fn draw(times: &[f64], both: &Predicted) -> String {
    let (truth, learned) = (&both.truth[0], &both.learned[0]);
    let last = times.last().copied().unwrap_or(1.0);
    let orbit = Panel {
        left: 56.0,
        top: 64.0,
        width: 330.0,
        height: 280.0,
        x: (-0.66, 0.66),
        y: (-0.56, 0.56),
    };
    let distance: Vec<f64> = truth
        .iter()
        .zip(learned)
        .map(|(a, b)| ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)).sqrt())
        .collect();
    let energy: Vec<f64> = both.true_energy[0]
        .iter()
        .zip(&both.learned_energy[0])
        .map(|(a, b)| 100.0 * (b - a) / a)
        .collect();
    let most = |values: &[f64]| values.iter().fold(1e-9, |most: f64, v| most.max(v.abs()));
    let (far, astray) = (round_up(most(&distance)), round_up(most(&energy)));
    let side = |top: f64, y: (f64, f64)| Panel {
        left: 490.0,
        top,
        width: 346.0,
        height: 112.0,
        x: (0.0, last),
        y,
    };
    let (above, below) = (side(64.0, (0.0, far)), side(232.0, (-astray, astray)));

    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
         width=\"{WIDTH}\" height=\"{HEIGHT}\" role=\"img\" aria-label=\"The orbit that the \
         learned law predicts lies on the true one; distance and energy error stay small.\">\n\
         <style>{STYLE}</style>\n"
    );
    let _ = writeln!(
        out,
        "<text class=\"title\" x=\"56\" y=\"24\">H\u{e9}non-Heiles, learned from 5,000 noisy \
         pairs: a new orbit, predicted to t = {last}</text>"
    );
    out += &orbit.frame(&ticks(orbit.x, 0.2), &ticks(orbit.y, 0.2), "q\u{2081}", "q\u{2082}");
    out += &orbit.curve("true", truth.iter().map(|s| (s[0], s[1])));
    out += &orbit.curve("learned", learned.iter().map(|s| (s[0], s[1])));
    if let Some(start) = truth.first() {
        let (x, y) = orbit.at(start[0], start[1]);
        let _ = writeln!(out, "<circle class=\"start\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\"/>");
    }
    let _ = write!(
        out,
        "<line class=\"true\" x1=\"230\" y1=\"51\" x2=\"256\" y2=\"51\"/>\
         <text x=\"264\" y=\"55\">true</text>\n\
         <line class=\"learned\" x1=\"306\" y1=\"51\" x2=\"332\" y2=\"51\"/>\
         <text x=\"340\" y=\"55\">learned</text>\n"
    );
    out += &above.frame(
        &ticks(above.x, 2.0),
        &ticks(above.y, far / 2.0),
        "",
        "distance of the prediction from the truth",
    );
    out += &above.curve("learned", times.iter().copied().zip(distance));
    out += &below.frame(
        &ticks(below.x, 2.0),
        &ticks(below.y, astray),
        "t",
        "error of the true energy along the prediction, %",
    );
    out += &below.curve("energy", times.iter().copied().zip(energy));
    out + "</svg>\n"
}
