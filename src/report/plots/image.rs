//! Kinds of picture files that figures are written as.

use super::figure::Figure;
#[cfg(feature = "pictures")]
use super::raster::png;
use super::style::Background;
use super::svg::{Medium, draw};
use crate::error::{Error, ErrorKind, Result};

/// Largest and smallest number of pixels of a picture for one of a screen.
pub const SCALES: std::ops::RangeInclusive<f64> = 0.25..=8.0;

/// How a picture is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureStyle {
    /// Light or dark; where there is none, what its reader prefers, or light.
    pub paper: Option<Background>,
    /// Pixels of the picture for each of a screen; drawings have none.
    pub scale: f64,
}

impl Default for PictureStyle {
    fn default() -> Self {
        PictureStyle { paper: None, scale: 2.0 }
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
    pub draw: fn(&Figure, PictureStyle) -> Result<Vec<u8>>,
}

/// Every kind. A new one is one function and one row here.
pub static IMAGES: &[Image] = &[
    Image {
        name: "svg",
        media: "image/svg+xml",
        description: "drawings, light or dark as their reader prefers",
        draw: |figure, look| {
            let target = look.paper.map_or(Medium::File, Medium::Print);
            Ok(draw(figure, target).into_bytes())
        },
    },
    #[cfg(feature = "pictures")]
    Image {
        name: "png",
        media: "image/png",
        description: "pixels, for slides",
        draw: |figure, look| {
            require_scale(look.scale)?;
            png(figure, look.paper.unwrap_or_default(), look.scale)
        },
    },
];

/// A kind by its name.
pub fn image(name: &str) -> Option<&'static Image> {
    IMAGES.iter().find(|row| row.name == name)
}

/// The kind that goes into documents for print.
///
/// # Errors
/// The program was built without pictures.
pub fn printable() -> Result<&'static Image> {
    image("png").ok_or_else(|| {
        Error::new(
            ErrorKind::NotBuiltIn,
            "pictures of pixels are left out of this program",
            "build it with the feature `pictures`",
        )
    })
}

/// That pictures can be drawn with so many pixels for each of a screen.
///
/// # Errors
/// The scale is not one of [`SCALES`].
pub fn require_scale(scale: f64) -> Result<()> {
    if SCALES.contains(&scale) {
        return Ok(());
    }
    Err(Error::new(
        ErrorKind::InvalidArgument,
        format!("a picture cannot be drawn at a scale of {scale}"),
        format!("give a scale from {} to {}", SCALES.start(), SCALES.end()),
    ))
}
