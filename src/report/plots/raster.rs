//! Figures as PNG, for slides and for programs that draw no SVG.
//!
//! The picture is the SVG's, in fonts that come with the program, so that it is the same on
//! every machine; letters that these lack are taken from the machine's own fonts.

use std::sync::{Arc, LazyLock};

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::fontdb::Database;
use resvg::usvg::{Options, Tree};

use super::figure::Figure;
use super::style::Background;
use super::svg::{Medium, draw};
use crate::error::{Error, ErrorKind, Result};

const SANS: &str = "DejaVu Sans";
const SERIF: &str = "DejaVu Serif";

/// Letters beyond this are in none of the program's own fonts: Chinese, Japanese, Korean and
/// others of the kind.
const OWN: char = '\u{2bff}';

static FONTS: LazyLock<Arc<Database>> = LazyLock::new(|| Arc::new(own_fonts()));

static ALL_FONTS: LazyLock<Arc<Database>> = LazyLock::new(|| {
    let mut fonts = own_fonts();
    fonts.load_system_fonts();
    Arc::new(fonts)
});

fn own_fonts() -> Database {
    let mut fonts = Database::new();
    let faces = [
        dejavu::sans::regular(),
        dejavu::sans::bold(),
        dejavu::serif::regular(),
        dejavu::serif::italic(),
    ];
    for face in faces {
        fonts.load_font_data(face.to_vec());
    }
    fonts.set_sans_serif_family(SANS);
    fonts.set_serif_family(SERIF);
    fonts
}

/// The figure as a PNG file, with `scale` pixels for each of a screen.
///
/// # Errors
/// The picture cannot be drawn.
pub(super) fn png(figure: &Figure, paper: Background, scale: f64) -> Result<Vec<u8>> {
    let failed = |why: String| {
        Error::new(
            ErrorKind::Export,
            format!("the figure `{}` cannot be drawn as PNG: {why}", figure.id),
            "write it as SVG instead",
        )
    };
    let svg = draw(figure, Medium::Print(paper));
    let fonts = if svg.chars().any(|c| c > OWN) { &ALL_FONTS } else { &FONTS };
    let options =
        Options { font_family: SANS.to_string(), fontdb: Arc::clone(fonts), ..Options::default() };
    let tree = Tree::from_str(&svg, &options).map_err(|error| failed(error.to_string()))?;
    let size = |length: f32| (f64::from(length) * scale).round().max(1.0) as u32;
    let (width, height) = (size(tree.size().width()), size(tree.size().height()));
    let mut picture = Pixmap::new(width, height).ok_or_else(|| failed("it is too large".into()))?;
    let transform = Transform::from_scale(scale as f32, scale as f32);
    resvg::render(&tree, transform, &mut picture.as_mut());
    picture.encode_png().map_err(|error| failed(error.to_string()))
}

#[cfg(test)]
mod tests {
    use resvg::usvg::{Group, Node};

    use super::*;
    use crate::report::plots::axes::Axis;
    use crate::report::plots::figure::Panel;
    use crate::report::plots::image::require_scale;

    /// Pieces of text in a group that no font has a form for.
    fn formless(group: &Group, seen: &mut usize, found: &mut Vec<String>) {
        for node in group.children() {
            match node {
                Node::Group(inner) => formless(inner, seen, found),
                Node::Text(text) => {
                    let glyphs = text.layouted().iter().flat_map(|span| &span.positioned_glyphs);
                    for glyph in glyphs {
                        *seen += 1;
                        if glyph.id.0 == 0 {
                            found.push(glyph.text.clone());
                        }
                    }
                }
                _ => {}
            }
        }
    }

    #[test]
    fn every_letter_that_is_printed_has_a_form() {
        let letters =
            "αβγδεζηθικλμνξπρστυφχψω ΓΔΘΛΞΠΣΦΨΩ ₀₁₂₃₄₅₆₇₈₉ₓ ⁰¹²³⁴⁵⁶⁷⁸⁹⁻ −·×±≤≥≈°µ… λ² 10⁻¹² é ł Ж";
        let mut figure = Figure::new("letters", letters.into(), String::new());
        figure.width = 1200.0;
        let axis = Axis::between(-1.0, 1.0, 5).variable("p_theta", Some("kg*m^2/s"));
        figure.panels.push(Panel::new(1.0, axis.clone(), axis));
        let options = Options { fontdb: Arc::clone(&FONTS), ..Options::default() };
        let tree = Tree::from_str(&draw(&figure, Medium::Print(Background::Light)), &options);
        let (mut seen, mut found) = (0, Vec::new());
        formless(tree.expect("a drawing").root(), &mut seen, &mut found);
        assert!(seen > letters.chars().count(), "{seen}");
        assert_eq!(found, Vec::<String>::new());
    }

    #[test]
    fn scales_without_sense_are_refused() {
        for scale in [0.0, -1.0, 9.0, f64::NAN, f64::INFINITY] {
            assert!(require_scale(scale).is_err(), "{scale}");
        }
    }
}
