//! Headers of columns: names and units.

/// "1 cell", "2 cells".
pub(super) fn counted(count: usize, noun: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {noun}{plural}")
}

/// Name and unit of a header: `theta [rad]`, `theta (rad)` or `theta / rad`.
pub(super) fn split_unit(header: &str) -> (String, Option<String>) {
    let whole = || (header.to_string(), None);
    let split = [('[', ']'), ('(', ')')].iter().find_map(|(open, close)| {
        let inner = header.strip_suffix(*close)?;
        // The bracket that belongs to the last one: `v (m/(s))` has one inside another.
        let mut depth = 1;
        let at = inner.char_indices().rev().find_map(|(at, character)| {
            depth += i32::from(character == *close) - i32::from(character == *open);
            (depth == 0).then_some(at)
        })?;
        Some((&inner[..at], &inner[at + open.len_utf8()..]))
    });
    let Some((name, unit)) = split.or_else(|| header.split_once(" / ")) else {
        return whole();
    };
    let unit = match unit.trim() {
        "" | "-" | "–" | "1" => "1".to_string(),
        unit if unit == "°" || unit.starts_with("°/") => unit.replacen('°', "deg", 1),
        unit => unit.to_string(),
    };
    (name.trim().to_string(), Some(unit))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_split_into_name_and_unit() {
        let rows = [
            ("t", "t", None),
            ("t [s]", "t", Some("s")),
            ("theta(rad)", "theta", Some("rad")),
            ("v (m/(s))", "v", Some("m/(s)")),
            ("omega / rad/s", "omega", Some("rad/s")),
            ("friction [-]", "friction", Some("1")),
            ("Winkel [°]", "Winkel", Some("deg")),
            ("rate (°/s)", "rate", Some("deg/s")),
            ("room [°C]", "room", Some("°C")),
            ("x ]", "x ]", None),
            ("[s]", "", Some("s")),
        ];
        for (header, name, unit) in rows {
            assert_eq!(
                split_unit(header),
                (name.to_string(), unit.map(str::to_string)),
                "{header}"
            );
        }
    }
}
