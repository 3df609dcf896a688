//! What a figure is made of: panels with axes, and marks in the units of the axes.
//!
//! A figure is plain data. `svg` draws it; programs get it as JSON and may draw it
//! themselves.

use serde::Serialize;

use super::axes::Axis;

/// A picture, with the words that go with it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    /// Unique among the figures of a report; letters, digits and hyphens.
    pub id: String,
    /// What it shows, in a few words.
    pub title: String,
    /// How to read it, and what stands out, in sentences.
    pub caption: String,
    /// In units of a pixel of a screen.
    pub width: f64,
    /// In units of a pixel of a screen.
    pub height: f64,
    /// What the marks mean.
    pub legend: Vec<Key>,
    /// How panels lie.
    pub arrangement: Arrangement,
    /// Top to bottom, or left to right.
    pub panels: Vec<Panel>,
}

/// How the panels of a figure lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Arrangement {
    /// One above the other, with one horizontal axis.
    Stacked,
    /// Side by side, with one vertical axis.
    Beside,
}

/// An entry of the legend.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Key {
    /// How its marks look.
    pub style: Style,
    /// Which kind of mark.
    pub shape: Shape,
    /// What they mean.
    pub text: String,
}

/// The kind of mark that a legend shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// A line.
    Line,
    /// A point.
    Point,
    /// A line with points.
    Both,
    /// A filled area.
    Area,
    /// Many points.
    Cloud,
}

/// A rectangle with axes, and what is drawn in it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Panel {
    /// Share of the figure's height (stacked) or width (beside).
    pub share: f64,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// From back to front.
    pub marks: Vec<Mark>,
}

/// The roles that colours, dashes and markers stand for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Style {
    /// What was measured.
    Measured,
    /// What the model says.
    Model,
    /// Runs that the model was not trained on.
    HeldOut,
    /// The noise floor, zero: what to hold things against.
    Reference,
    /// A guess to beat.
    Baseline,
    /// What is not spoken of.
    Faint,
    /// What was chosen.
    Chosen,
    /// Contours.
    Contour,
    /// One of several of a kind, 0 to 6.
    Series(u8),
    /// Above zero.
    Positive,
    /// Below zero.
    Negative,
}

/// Something drawn, in the units of the panel's axes.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "mark", rename_all = "snake_case")]
pub enum Mark {
    /// A line; it is broken at points that are not finite.
    Line {
        /// How it looks.
        style: Style,
        /// Its points.
        points: Vec<(f64, f64)>,
        /// What it is, for whoever points at it.
        about: SeriesInfo,
    },
    /// Points, of which there may be very many.
    Cloud {
        /// How they look.
        style: Style,
        /// Where they are.
        points: Vec<(f64, f64)>,
        /// What they are, for whoever points at them.
        about: SeriesInfo,
    },
    /// Few points, each with a marker that differs from style to style.
    Markers {
        /// How they look.
        style: Style,
        /// Where they are.
        points: Vec<(f64, f64)>,
        /// A line of text for each.
        texts: Vec<String>,
    },
    /// The area between two curves over x.
    Band {
        /// How it looks.
        style: Style,
        /// (x, lower, upper).
        points: Vec<(f64, f64, f64)>,
    },
    /// A value with its standard error: (x, lower, upper).
    ErrorBars {
        /// How they look.
        style: Style,
        /// (x, lower, upper).
        points: Vec<(f64, f64, f64)>,
    },
    /// A horizontal bar from `from` to `to` around row `row`.
    Bar {
        /// How it looks.
        style: Style,
        /// Row of the vertical axis.
        row: f64,
        /// Where it starts.
        from: f64,
        /// Where it ends.
        to: f64,
        /// What it says, for whoever points at it.
        text: String,
    },
    /// An arrow along row `row`.
    Arrow {
        /// How it looks.
        style: Style,
        /// Row of the vertical axis.
        row: f64,
        /// Where it starts.
        from: f64,
        /// Where it ends.
        to: f64,
    },
    /// A rectangle whose colour has a strength.
    Cell {
        /// Left and right edge.
        x: (f64, f64),
        /// Lower and upper edge.
        y: (f64, f64),
        /// From -1 to 1.
        strength: f64,
        /// Written into it.
        label: String,
        /// What it says, for whoever points at it.
        text: String,
    },
    /// A line across the whole panel at one value of y.
    Level {
        /// How it looks.
        style: Style,
        /// The value.
        y: f64,
    },
    /// A line up the whole panel at one value of x.
    Upright {
        /// How it looks.
        style: Style,
        /// The value.
        x: f64,
    },
    /// Words.
    Text {
        /// Where they stand.
        at: (f64, f64),
        /// Which part of them stands there.
        anchor: Anchor,
        /// How they look.
        style: Style,
        /// Pixels to the right and down.
        shift: (f64, f64),
        /// The words.
        text: String,
    },
}

/// Which part of a text stands at its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Anchor {
    /// Its start.
    Start,
    /// Its middle.
    Middle,
    /// Its end.
    End,
}

/// What a series of points is: what links it to others.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct SeriesInfo {
    /// What it is called.
    pub name: String,
    /// The run that all of its points belong to.
    pub run: Option<String>,
    /// Time of every point that was kept, where that is not its x; else empty.
    pub times: Vec<f64>,
}

impl SeriesInfo {
    /// A series that belongs to no run.
    pub fn named(name: &str) -> SeriesInfo {
        SeriesInfo { name: name.to_string(), ..SeriesInfo::default() }
    }

    /// A series of a run.
    pub fn run(name: &str, run: &str) -> SeriesInfo {
        SeriesInfo { run: Some(run.to_string()), ..SeriesInfo::named(name) }
    }
}

/// Width of an ordinary figure: two of them stand side by side on a screen, one on a telephone.
pub const WIDTH: f64 = 430.0;
/// Height of an ordinary figure.
pub const HEIGHT: f64 = 310.0;

impl Figure {
    /// A figure of ordinary size without panels.
    pub fn new(id: &str, title: String, caption: String) -> Figure {
        let id = id.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
        Figure {
            id,
            title,
            caption,
            width: WIDTH,
            height: HEIGHT,
            legend: Vec::new(),
            arrangement: Arrangement::Stacked,
            panels: Vec::new(),
        }
    }

    /// Adds an entry to the legend.
    pub fn key(&mut self, style: Style, shape: Shape, text: &str) {
        self.legend.push(Key { style, shape, text: text.to_string() });
    }
}

impl Panel {
    /// An empty panel.
    pub fn new(share: f64, x: Axis, y: Axis) -> Panel {
        Panel { share, x, y, marks: Vec::new() }
    }
}
