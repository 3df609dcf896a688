//! Regenerates docs/planets.md and its picture: what Uranus did wrong, and where Neptune was.
//!
//! ```console
//! $ cargo run --release --example planets
//! ```

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "an example that fails stops"
)]

use std::fmt::Write as _;
use std::path::Path;

use leverrier::{Data, Law, Options, Spec};

/// A point of an orbit in the plane of the picture.
type Point = [f64; 2];

/// Width and height of the picture.
const SIZE: f64 = 640.0;

fn main() {
    let folder = Path::new("examples/planets");
    let open = |name: &str| -> (Spec, Data) {
        let spec = Spec::open(folder.join(name)).expect("a sound spec");
        let data = spec.data().expect("its data");
        (spec, data)
    };
    let (found, data) = open("found.ham");
    let options = Options { starts: 0, ..Options::default() };
    let law = found.fit_with(&data, &options).expect("a law");
    let (truth, judged) = open("truth.ham");
    drop(truth);
    let last = data.samples() - 1;
    let place = |name: &str| -> Vec<f64> {
        ["x", "y", "z"]
            .iter()
            .map(|axis| judged.values(0, &format!("{name}_{axis}")).expect("a column")[last])
            .collect()
    };
    let (sun, neptune) = (place("sun"), place("neptune"));
    let end: Vec<f64> = hidden(&law, "unseen").iter().map(|values| values.1).collect();
    let from_sun = |at: &[f64]| -> Vec<f64> { at.iter().zip(&sun).map(|(a, s)| a - s).collect() };
    let (seen, true_place) = (from_sun(&end), from_sun(&neptune));
    let angle = angle(&seen, &true_place);
    let mass = law.parameters()[0].value;
    let ratio = 2.959_122_082_855_911e-4 / mass;
    let picture = picture(&judged, &end, last);
    std::fs::write("docs/planets.svg", picture).expect("docs/ is writable");
    let page = format!(
        "# The outer planets\n\nMade by `cargo run --release --example planets` from \
         `examples/planets`: the places of the Sun, Jupiter, Saturn and Uranus from 1781 to 1846, \
         each with a noise of one second of arc, and a spec with one hidden body, written by hand. Its \
         fit starts 2 au beside where Neptune was in 1781, with a mass that is 15 % off; a search that \
         finds such a start is not there yet.\n\n\
         | | found | Neptune |\n|---|---|---|\n\
         | mass of the Sun over its mass | {ratio:.0} | 19412 |\n\
         | distance from the Sun on 1846-09-23, au | {:.2} | {:.2} |\n\
         | angle between the two places on that day, seen from the Sun | {angle:.2} degrees | |\n\n\
         Le Verrier's place was 1 degree off, Adams's 2.5 degrees.\n\n\
         ![The orbits of Jupiter, Saturn, Uranus and Neptune in the plane of the equator, with the \
         place that was found](planets.svg)\n",
        norm(&seen),
        norm(&true_place),
    );
    print!("{page}");
    std::fs::write("docs/planets.md", page).expect("docs/ is writable");
}

/// Values of the coordinates of a hidden body, at the start and the end.
fn hidden(law: &Law, name: &str) -> Vec<(f64, f64)> {
    let of = |axis: &str| {
        let wanted = format!("{name}_{axis}");
        let part = law.hidden().iter().find(|part| part.name == wanted);
        part.unwrap_or_else(|| panic!("no {wanted}")).values
    };
    ["x", "y", "z"].map(of).to_vec()
}

fn norm(a: &[f64]) -> f64 {
    a.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The angle between two directions, in degrees.
fn angle(a: &[f64], b: &[f64]) -> f64 {
    let product: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    (product / (norm(a) * norm(b))).clamp(-1.0, 1.0).acos().to_degrees()
}

/// A text beside a point, on the side of it where the picture has room.
fn label([x, y]: Point, colour: &str, text: &str) -> String {
    let (anchor, x) = if x > 0.7 * SIZE { ("end", x - 12.0) } else { ("start", x + 12.0) };
    format!(
        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" fill=\"{colour}\">{text}</text>"
    )
}

/// The sky from above: paths of the planets, a point where each stood on the last day, a ring where
/// the unseen one was found.
fn picture(data: &Data, found: &[f64], last: usize) -> String {
    const REACH: f64 = 34.0;
    let at = |[x, y]: Point| -> Point {
        [SIZE / 2.0 * (1.0 + x / REACH), SIZE / 2.0 * (1.0 - y / REACH)]
    };
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {SIZE} {SIZE}\" \
         font-family=\"sans-serif\" font-size=\"14\">\n\
         <style>text {{ paint-order: stroke; stroke: #0b1026; stroke-width: 5px }}</style>\n\
         <rect width=\"{SIZE}\" height=\"{SIZE}\" fill=\"#0b1026\"/>\n"
    );
    let planets = [
        ("jupiter", "#e0b080"),
        ("saturn", "#e8d890"),
        ("uranus", "#90d8e0"),
        ("neptune", "#6088e8"),
    ];
    for (name, colour) in planets {
        let column = |axis: &str| data.values(0, &format!("{name}_{axis}")).expect("a column");
        let (x, y) = (column("x"), column("y"));
        let path: Vec<String> = x
            .iter()
            .zip(y)
            .step_by(4)
            .map(|(x, y)| {
                let [x, y] = at([*x, *y]);
                format!("{x:.1},{y:.1}")
            })
            .collect();
        let [px, py] = at([x[last], y[last]]);
        let (dash, title) = match name {
            "neptune" => (" stroke-dasharray=\"3 5\"", "Neptune, seen by nobody"),
            "uranus" => ("", "Uranus"),
            "saturn" => ("", "Saturn"),
            _ => ("", "Jupiter"),
        };
        let _ = writeln!(
            out,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\"{dash}/>\n\
             <circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"4\" fill=\"{colour}\"/>\n\
             {}",
            path.join(" "),
            label([px, py + 24.0], colour, title)
        );
    }
    let [fx, fy] = at([found[0], found[1]]);
    let _ = writeln!(
        out,
        "<circle cx=\"{fx:.1}\" cy=\"{fy:.1}\" r=\"9\" fill=\"none\" stroke=\"#ffffff\"/>\n\
         {}\n\
         <circle cx=\"{c}\" cy=\"{c}\" r=\"6\" fill=\"#fff0b0\"/>\n\
         <text x=\"14\" y=\"26\" fill=\"#c0c8e0\">1781 to 23 September 1846</text>\n</svg>",
        label([fx, fy - 16.0], "#ffffff", "where it was found to be"),
        c = SIZE / 2.0
    );
    out
}
