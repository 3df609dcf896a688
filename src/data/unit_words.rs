//! Units as people write them in headers, in the words of the mini-language.

/// Words for units (in lower case), and their symbols.
const WORDS: &[(&str, &str)] = &[
    ("sec", "s"),
    ("secs", "s"),
    ("second", "s"),
    ("seconds", "s"),
    ("sek", "s"),
    ("sekunde", "s"),
    ("sekunden", "s"),
    ("seconde", "s"),
    ("secondes", "s"),
    ("segundo", "s"),
    ("segundos", "s"),
    ("msec", "ms"),
    ("millis", "ms"),
    ("millisecond", "ms"),
    ("milliseconds", "ms"),
    ("millisekunden", "ms"),
    ("millisecondes", "ms"),
    ("milisegundos", "ms"),
    ("usec", "us"),
    ("microseconds", "us"),
    ("mins", "min"),
    ("minute", "min"),
    ("minutes", "min"),
    ("minuten", "min"),
    ("minutos", "min"),
    ("hour", "h"),
    ("hours", "h"),
    ("hr", "h"),
    ("hrs", "h"),
    ("stunden", "h"),
    ("heures", "h"),
    ("horas", "h"),
    ("days", "day"),
    ("tage", "day"),
    ("jours", "day"),
    ("dias", "day"),
    ("años", "year"),
    ("years", "year"),
    ("meter", "m"),
    ("meters", "m"),
    ("metre", "m"),
    ("metres", "m"),
    ("mètres", "m"),
    ("metros", "m"),
    ("millimeter", "mm"),
    ("millimeters", "mm"),
    ("millimetres", "mm"),
    ("centimeter", "cm"),
    ("centimeters", "cm"),
    ("centimetres", "cm"),
    ("in", "inch"),
    ("inches", "inch"),
    ("feet", "ft"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("degs", "deg"),
    ("grad", "deg"),
    ("degré", "deg"),
    ("degrés", "deg"),
    ("grado", "deg"),
    ("grados", "deg"),
    ("°", "deg"),
    ("º", "deg"),
    ("˚", "deg"),
    ("radian", "rad"),
    ("radians", "rad"),
    ("radianes", "rad"),
    ("bogenmaß", "rad"),
    ("pixels", "px"),
    ("pix", "px"),
    ("volt", "V"),
    ("volts", "V"),
    ("ampere", "A"),
    ("amperes", "A"),
    ("amps", "A"),
    ("newton", "N"),
    ("newtons", "N"),
    ("mps", "m/s"),
    ("dps", "deg/s"),
    ("rads", "rad/s"),
];

/// Symbols that SI prefixes may stand before, and those that stand alone.
const PREFIXED: &[&str] = &[
    "m", "g", "s", "A", "K", "mol", "cd", "rad", "Hz", "N", "Pa", "J", "eV", "W", "C", "V", "F",
    "Ohm", "Ω", "T", "Wb", "H", "L", "bar",
];
const ALONE: &[&str] = &[
    "px", "pixel", "deg", "rev", "turn", "%", "min", "h", "day", "d", "year", "rpm", "t", "inch",
    "ft", "au",
];
const PREFIXES: &[&str] =
    &["da", "G", "M", "k", "h", "d", "c", "m", "u", "µ", "μ", "n", "p", "f", "T"];

/// A unit in the words of the mini-language: `m s^-2` of `m s⁻²`, `deg` of `degrees`; none
/// where a word in it is no unit. `1` is what `-` says.
pub fn known_unit(text: &str) -> Option<String> {
    let text = text.trim();
    // `(en s)`, `millimetres per second`.
    let text = text.strip_prefix("in ").or_else(|| text.strip_prefix("en ")).unwrap_or(text);
    let text = &text.replace(" per ", "/").replace(" pro ", "/").replace(" par ", "/");
    if matches!(text.as_str(), "-" | "–" | "1" | "none" | "a.u." | "arb. units") {
        return Some("1".to_string());
    }
    let counts = text.starts_with(|c: char| c.is_ascii_digit()) && !text.starts_with("1/");
    if text.chars().count() > 24 || counts {
        return None;
    }
    let (mut out, mut word, mut words) = (String::new(), String::new(), 0);
    let mut raised = false;
    for character in text.chars().chain([' ']) {
        if character.is_alphabetic() || matches!(character, '°' | 'º' | '˚' | '%') {
            raised = false;
            word.push(character);
            continue;
        }
        if !word.is_empty() {
            out.push_str(&symbol(&word)?);
            words += 1;
            word.clear();
        }
        match character {
            '·' | '⋅' | '×' | '.' => out.push('*'),
            '*' | '/' | '(' | ')' | '^' | '0'..='9' => {
                // `s-1` and `s2` are powers, as `s^-1` is.
                let bare = character.is_ascii_digit()
                    && !raised
                    && out.ends_with(|c: char| c.is_alphabetic());
                if bare {
                    out.push('^');
                }
                raised |= character == '^' || bare;
                out.push(character);
            }
            '-' | '−' | '⁻' => {
                if !out.ends_with(['^', '(']) {
                    out.push('^');
                }
                raised = true;
                out.push('-');
            }
            '{' | '}' => {}
            character if character.is_whitespace() => {
                raised = false;
                out.push(' ');
            }
            character => {
                let digit = "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().position(|high| high == character)?;
                if !out.ends_with(['^', '-']) && !raised {
                    out.push('^');
                }
                raised = true;
                out.push_str(&digit.to_string());
            }
        }
    }
    // `m/s/s` is read from left to right, as it is meant.
    (words > 0).then(|| out.trim().to_string())
}

/// The symbol of a unit.
fn symbol(word: &str) -> Option<String> {
    let alone = |word: &str| PREFIXED.contains(&word) || ALONE.contains(&word);
    let prefixed = |word: &str| {
        let rest = |prefix: &&str| word.strip_prefix(*prefix);
        PREFIXES.iter().filter_map(rest).any(|rest| PREFIXED.contains(&rest))
    };
    if word == "Nm" {
        return Some("N*m".to_string());
    }
    if alone(word) || prefixed(word) {
        return Some(word.to_string());
    }
    let lower = word.to_lowercase();
    let row = WORDS.iter().find(|(name, _)| *name == lower);
    row.map(|(_, symbol)| (*symbol).to_string())
}

/// Whether it is a unit of time by itself.
pub fn is_time_unit(unit: &str) -> bool {
    const PREFIXES: [&str; 5] = ["", "m", "u", "µ", "n"];
    matches!(unit, "min" | "h" | "day" | "d" | "year")
        || unit.strip_suffix('s').is_some_and(|prefix| PREFIXES.contains(&prefix))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_as_people_write_them() {
        let rows = [
            ("s", Some("s")),
            ("Sekunden", Some("s")),
            ("ms", Some("ms")),
            ("m/s²", Some("m/s^2")),
            ("m s⁻²", Some("m s^-2")),
            ("m·s^-1", Some("m*s^-1")),
            ("m s-1", Some("m s^-1")),
            ("deg/sec", Some("deg/s")),
            ("°", Some("deg")),
            ("°/s", Some("deg/s")),
            ("Degrees", Some("deg")),
            ("Nm", Some("N*m")),
            ("nm", Some("nm")),
            ("µm", Some("µm")),
            ("m/s^{2}", Some("m/s^2")),
            ("-", Some("1")),
            ("x", None),
            ("theta", None),
            ("°C", None),
            ("0.1 s", None),
            ("1/s", Some("1/s")),
            ("m/s/s", Some("m/s/s")),
            ("millimeters per second", Some("mm/s")),
            ("rig 2", None),
        ];
        for (text, unit) in rows {
            assert_eq!(known_unit(text).as_deref(), unit, "{text}");
        }
        assert!(is_time_unit("ms") && is_time_unit("s") && !is_time_unit("m"));
    }
}
