//! Plots: what a model, its data and its doubts look like.
//!
//! A plot is one file and one row of [`PLOTS`]: a function from plain data ([`PlotData`]) to
//! [`Figure`]s, which are plain data too. [`draw`] makes SVG of them. Terminal commands, the
//! report and whatever shows them live take the same figures.

mod axes;
mod contour;
mod energy;
pub mod figure;
mod force_map;
mod forces;
mod front;
mod horizons;
mod image;
mod label;
mod ledger;
mod marks;
mod path;
mod portrait;
pub mod predictions;
mod ranking;
#[cfg(feature = "pictures")]
mod raster;
mod style;
mod svg;
mod thin;
mod xml;

use serde::Serialize;

pub use axes::{Axis, Scale, Tick};
pub use figure::Figure;
pub use image::{IMAGES, Image, PictureStyle, SCALES, image, printable, require_scale};
pub use label::{amount, measured, number, plain, tenths, term, unit};
pub use style::{Background, SCRIPT, live_sheet, sheet};
pub use svg::{Medium, draw};
pub use xml::escaped;

/// The id of a figure in letters that every file system and header takes.
pub fn escaped_id(id: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_' || c == '.';
    id.chars().map(|c| if plain(c) { c } else { '_' }).collect()
}

use crate::diagnose::comparison::Comparison;
use crate::diagnose::comparison::view::View;
use crate::diagnose::diagnosis::Diagnosis;
use crate::fit::Model;

/// What plots are drawn from.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct PlotData<'a> {
    /// The model on its data.
    pub view: &'a View,
    /// Its errors.
    pub comparison: &'a Comparison,
    /// The search that it came from: the L1 path and the Pareto front.
    pub model: &'a Model,
    /// What is missing, where that was asked.
    pub diagnosis: Option<&'a Diagnosis>,
    /// How the spec came about, oldest first.
    pub history: &'a [HistoryPoint],
}

/// A state of the spec, and the error on held-out runs that its model had.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HistoryPoint {
    /// What was done: `start`, `add viscous_drag(theta)`.
    pub action: String,
    /// Error on held-out runs in units of the noise; none where it was not judged.
    pub error: Option<f64>,
    /// Whether it was taken back.
    pub undone: bool,
}

/// One kind of plot.
pub struct Plot {
    /// Its name in file names and programs.
    pub name: &'static str,
    /// What it shows.
    pub title: &'static str,
    /// Why there may be nothing to draw, in a sentence.
    pub absent: &'static str,
    /// Draws it: several figures where there are several things of the kind, none where there
    /// is nothing.
    pub figures: fn(&PlotData) -> Vec<Figure>,
}

/// Every plot, in the order of a report. A new one is one file and one row here.
pub static PLOTS: &[Plot] = &[
    Plot {
        name: "predictions",
        title: "Measured and predicted",
        absent: "No run has a sample that could be predicted.",
        figures: predictions::figures,
    },
    Plot {
        name: "horizons",
        title: "Error by length of prediction",
        absent: "All predictions are of one length: there is no curve to draw.",
        figures: horizons::figures,
    },
    Plot {
        name: "forces",
        title: "The force that is missing, variable by variable",
        absent: "The data do not spread enough to show a residual force.",
        figures: forces::figures,
    },
    Plot {
        name: "force-map",
        title: "The force that is missing, over phase space",
        absent: "The data do not fill enough of the phase space to show a residual force over it.",
        figures: force_map::figures,
    },
    Plot {
        name: "portrait",
        title: "Phase portrait",
        absent: "The state does not move in these data.",
        figures: portrait::figures,
    },
    Plot {
        name: "energy",
        title: "Energy along the measurements",
        absent: "The runs are too short to see their energy change.",
        figures: energy::figures,
    },
    Plot {
        name: "path",
        title: "Coefficients along the regularization path",
        absent: "The terms were not searched along a regularization path.",
        figures: path::figures,
    },
    Plot {
        name: "front",
        title: "Error against number of terms",
        absent: "There is only one size of model.",
        figures: front::figures,
    },
    Plot {
        name: "ranking",
        title: "Effects that could be missing",
        absent: "No effect of the catalogue explains more than noise would.",
        figures: ranking::figures,
    },
    Plot {
        name: "ledger",
        title: "Error after every step",
        absent: "Nothing was added to the spec yet.",
        figures: ledger::figures,
    },
];

/// A plot by its name.
pub fn plot(name: &str) -> Option<&'static Plot> {
    PLOTS.iter().find(|row| row.name == name)
}

/// A number of times the noise, in words.
pub fn times(error: f64) -> String {
    if error.is_finite() { crate::diagnose::times::times(error) } else { "diverges".to_string() }
}
