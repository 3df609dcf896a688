//! Kinds of picture files that figures are written as.

use super::figure::Figure;
use super::raster::png;
use super::style::Paper;
use super::svg::{For, draw};
use crate::error::Result;

/// How a picture is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// Light or dark; where there is none, what its reader prefers, or light.
    pub paper: Option<Paper>,
    /// Pixels of the picture for each of a screen; drawings have none.
    pub scale: f64,
}

impl Default for Look {
    fn default() -> Self {
        Look { paper: None, scale: 2.0 }
    }
}

/// One kind of picture file.
pub struct Image {
    /// Its name, which is what its files end in.
    pub name: &'static str,
    /// What browsers call it.
    pub media: &'static str,
    /// One line of help.
    pub description: &'static str,
    /// Draws a figure as the bytes of a file.
    pub draw: fn(&Figure, Look) -> Result<Vec<u8>>,
}

/// Every kind. A new one is one function and one row here.
pub static IMAGES: &[Image] = &[
    Image {
        name: "svg",
        media: "image/svg+xml",
        description: "drawings, light or dark as their reader prefers",
        draw: |figure, look| {
            let target = look.paper.map_or(For::File, For::Print);
            Ok(draw(figure, target).into_bytes())
        },
    },
    Image {
        name: "png",
        media: "image/png",
        description: "pixels, for slides",
        draw: |figure, look| png(figure, look.paper.unwrap_or_default(), look.scale),
    },
];

/// A kind by its name.
pub fn image(name: &str) -> Option<&'static Image> {
    IMAGES.iter().find(|row| row.name == name)
}
