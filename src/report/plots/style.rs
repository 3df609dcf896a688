//! Colours of figures, on light and on dark paper.
//!
//! Programs that draw SVG for print and slides know no variables in style sheets: colours are
//! put in as they are, once for light and once for dark.

/// Name of a colour in `figures.css`, what it is on light paper, and on dark. The hues are those
/// of Okabe and Ito (2008), which colour-blind readers tell apart, darkened or lightened for
/// contrast.
const PALETTE: &[(&str, &str, &str)] = &[
    ("$paper", "#ffffff", "#14171d"),
    ("$ink", "#1f2430", "#e6e9ef"),
    ("$soft", "#5a6272", "#a5adbb"),
    ("$grid", "#dfe3ea", "#2a303b"),
    ("$frame", "#9aa3b0", "#6b7484"),
    ("$blue", "#0072b2", "#56b4e9"),
    ("$vermilion", "#d55e00", "#ff8a4c"),
    ("$green", "#007f5c", "#3fcfa4"),
    ("$purple", "#a34f83", "#e39cc8"),
    ("$sky", "#2f93cf", "#4d9fd0"),
    ("$ochre", "#b57600", "#f0b73e"),
    ("$cloud", "#4c5566", "#b9c1cf"),
];

const FIGURES: &str = include_str!("figures.css");
const LIVE: &str = include_str!("live.css");

/// What a picture is drawn on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Background {
    /// White.
    #[default]
    Light,
    /// As screens have it at night, and many slides.
    Dark,
}

/// The script with which figures in a page answer to a pointer; pages work without it too.
pub const SCRIPT: &str = include_str!("figures.js");

/// The style sheet of figures in files of their own.
pub fn sheet() -> String {
    themed(FIGURES)
}

/// The style sheet of figures in a page, where [`SCRIPT`] works on them.
pub fn live_sheet() -> String {
    themed(&format!("{FIGURES}{LIVE}"))
}

/// The style sheet of figures on one kind of paper, whatever the reader prefers.
pub(super) fn print_sheet(paper: Background) -> String {
    coloured(FIGURES, paper)
}

fn coloured(text: &str, paper: Background) -> String {
    PALETTE.iter().fold(text.to_string(), |text, (name, light, dark)| {
        text.replace(
            name,
            match paper {
                Background::Light => light,
                Background::Dark => dark,
            },
        )
    })
}

fn themed(rules: &str) -> String {
    let colours: String =
        rules.lines().filter(|line| line.contains('$')).flat_map(|line| [line, "\n"]).collect();
    format!(
        "{}@media (prefers-color-scheme: dark) {{\n{}}}\n",
        coloured(rules, Background::Light),
        coloured(&colours, Background::Dark)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_colour_has_a_value() {
        for sheet in [sheet(), live_sheet(), print_sheet(Background::Dark)] {
            assert!(!sheet.contains('$'), "{sheet}");
            assert!(sheet.matches('{').count() == sheet.matches('}').count());
        }
    }

    /// WCAG 2's contrast of two colours.
    fn contrast(a: &str, b: &str) -> f64 {
        let luminance = |text: &str| {
            let channel = |at: usize| {
                let value = u8::from_str_radix(&text[at..at + 2], 16).expect("two digits");
                let share = f64::from(value) / 255.0;
                if share <= 0.03928 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
            };
            0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5)
        };
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn marks_stand_out_and_words_can_be_read() {
        let paper = PALETTE[0];
        for (name, light, dark) in &PALETTE[1..] {
            let least = match *name {
                "$grid" => 1.1,
                "$frame" => 2.3,
                "$ink" => 7.0,
                "$soft" => 4.5,
                _ => 3.0,
            };
            assert!(contrast(light, paper.1) >= least, "{name}: {}", contrast(light, paper.1));
            assert!(contrast(dark, paper.2) >= least, "{name}: {}", contrast(dark, paper.2));
        }
    }
}
