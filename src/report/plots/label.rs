//! Names, units and numbers as they stand in a figure.

/// Names that mean a Greek letter, and the letter.
const GREEK: &[(&str, &str)] = &[
    ("alpha", "α"),
    ("beta", "β"),
    ("gamma", "γ"),
    ("delta", "δ"),
    ("epsilon", "ε"),
    ("zeta", "ζ"),
    ("eta", "η"),
    ("theta", "θ"),
    ("iota", "ι"),
    ("kappa", "κ"),
    ("lambda", "λ"),
    ("mu", "μ"),
    ("nu", "ν"),
    ("xi", "ξ"),
    ("pi", "π"),
    ("rho", "ρ"),
    ("sigma", "σ"),
    ("tau", "τ"),
    ("upsilon", "υ"),
    ("phi", "φ"),
    ("chi", "χ"),
    ("psi", "ψ"),
    ("omega", "ω"),
    ("Gamma", "Γ"),
    ("Delta", "Δ"),
    ("Theta", "Θ"),
    ("Lambda", "Λ"),
    ("Xi", "Ξ"),
    ("Pi", "Π"),
    ("Sigma", "Σ"),
    ("Phi", "Φ"),
    ("Psi", "Ψ"),
    ("Omega", "Ω"),
];

/// The letter of a name, and its subscript (which may be empty): `q[1]` is q and 1.
pub(super) fn parts(name: &str) -> (String, String) {
    let mut pieces = name.split(['_', '[', ']', ',', ' ']).filter(|piece| !piece.is_empty());
    let Some(first) = pieces.next() else { return (name.to_string(), String::new()) };
    let stem = first.trim_end_matches(|c: char| c.is_ascii_digit());
    let (stem, digits) = if stem.is_empty() { (first, "") } else { first.split_at(stem.len()) };
    let digits = (!digits.is_empty()).then(|| digits.to_string());
    let subscripts: Vec<String> = digits.into_iter().chain(pieces.map(greek)).collect();
    (greek(stem), subscripts.join(","))
}

fn greek(word: &str) -> String {
    let letter = GREEK.iter().find(|(name, _)| *name == word).map(|(_, letter)| *letter);
    letter.unwrap_or(word).to_string()
}

/// A name on one line: `q[1]` is q₁, `p_theta` is p_θ.
pub fn plain(name: &str) -> String {
    let (letter, subscript) = parts(name);
    if subscript.is_empty() {
        return letter;
    }
    let small: Option<String> = subscript.chars().map(lowered).collect();
    match small {
        Some(small) => letter + &small,
        None => format!("{letter}_{subscript}"),
    }
}

fn lowered(c: char) -> Option<char> {
    Some(match c {
        '0'..='9' => char::from_u32('₀' as u32 + c as u32 - '0' as u32)?,
        'x' => 'ₓ',
        ',' => ' ',
        _ => return None,
    })
}

/// A unit as it is printed: `kg*m^2/s` is kg·m²/s; nothing where there is none.
pub fn unit(text: Option<&str>) -> String {
    let Some(text) = text.filter(|text| !text.is_empty() && *text != "1") else {
        return String::new();
    };
    let mut out = String::new();
    let mut raised = false;
    for c in text.chars() {
        match c {
            '^' => raised = true,
            '*' => {
                raised = false;
                out.push('·');
            }
            c if raised && (c.is_ascii_digit() || c == '-') => out.push(superscript(c)),
            c => {
                raised = false;
                out.push(c);
            }
        }
    }
    out
}

/// A product of units to powers, as a unit of the mini-language: `kg*m/s` over `s` is `kg*m/s^2`.
/// None where one of them is not known.
pub(super) fn product(units: &[(Option<&str>, i32)]) -> Option<String> {
    let mut powers: Vec<(String, i32)> = Vec::new();
    for (unit, power) in units {
        // Brackets and broken powers are not taken apart.
        let unit = unit.filter(|unit| !unit.contains(['(', '.', ' ']))?;
        let mut sign = 1;
        for (at, factor) in unit.split_inclusive(['*', '/']).enumerate() {
            let name = factor.trim_end_matches(['*', '/']);
            let (name, own) = name.split_once('^').unwrap_or((name, "1"));
            let own: i32 = own.parse().ok()?;
            if !name.is_empty() && name != "1" {
                match powers.iter_mut().find(|(known, _)| known == name) {
                    Some((_, sum)) => *sum += sign * own * power,
                    None => powers.push((name.to_string(), sign * own * power)),
                }
            } else if at > 0 {
                return None;
            }
            sign = if factor.ends_with('/') { -1 } else { 1 };
        }
    }
    let written = |name: &str, power: i32| match power {
        1 => name.to_string(),
        power => format!("{name}^{power}"),
    };
    let over: Vec<String> =
        powers.iter().filter(|p| p.1 > 0).map(|(name, power)| written(name, *power)).collect();
    let under = powers.iter().filter(|p| p.1 < 0);
    let mut out = if over.is_empty() { "1".to_string() } else { over.join("*") };
    for (name, power) in under {
        out += &format!("/{}", written(name, -power));
    }
    Some(out)
}

fn superscript(c: char) -> char {
    match c {
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '-' => '⁻',
        '0' | '4'..='9' => char::from_u32('⁰' as u32 + c as u32 - '0' as u32).unwrap_or(c),
        c => c,
    }
}

/// 10 to a power: `10⁻³`.
pub(super) fn power_of_ten(exponent: i32) -> String {
    format!("10{}", exponent.to_string().chars().map(superscript).collect::<String>())
}

/// A number of a few digits with a real minus sign: `−0.0123`, `1.2·10⁻⁷`.
pub fn number(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "?".to_string();
    }
    let text = crate::simplify::significant(value, digits);
    let text = match text.split_once('e') {
        Some((digits, exponent)) => match exponent.parse() {
            Ok(exponent) => format!("{digits}·{}", power_of_ten(exponent)),
            Err(_) => text,
        },
        None => text,
    };
    text.replace('-', "−")
}

/// A value with its standard error, `0.5012(13)`, and a real minus sign.
pub fn measured(value: f64, standard_error: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "?".to_string();
    }
    crate::simplify::uncertain(value, standard_error, digits).replace('-', "−")
}

/// A number with one decimal.
pub fn tenths(value: f64) -> String {
    if value.is_finite() { format!("{value:.1}").replace('-', "−") } else { "?".to_string() }
}

/// A number with its unit, if it has one.
pub fn amount(value: f64, digits: usize, unit: Option<&str>) -> String {
    let unit = self::unit(unit);
    let number = number(value, digits);
    if unit.is_empty() { number } else { format!("{number} {unit}") }
}

/// A term of the mini-language as a line of text: `q[1]^2*cos(theta)` is q₁² cos(θ).
pub fn term(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        if c.is_alphabetic() {
            let mut end =
                rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
            if rest[end..].starts_with('[') {
                end = rest[end..].find(']').map_or(rest.len(), |close| end + close + 1);
            }
            out += &plain(&rest[..end]);
            rest = &rest[end..];
        } else if c == '^' {
            let digits: String = rest[1..].chars().take_while(|c| c.is_ascii_digit()).collect();
            if digits.is_empty() {
                out.push('^');
            }
            out.extend(digits.chars().map(superscript));
            rest = &rest[1 + digits.len()..];
        } else {
            match c {
                '*' => out.push(' '),
                '-' => out.push('−'),
                c => out.push(c),
            }
            rest = &rest[c.len_utf8()..];
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_units_and_terms_read_as_in_print() {
        for (name, expected) in
            [("q[1]", "q₁"), ("theta", "θ"), ("p_theta", "p_θ"), ("q12", "q₁₂"), ("x", "x")]
        {
            assert_eq!(plain(name), expected);
        }
        assert_eq!(unit(Some("kg*m^2/s")), "kg·m²/s");
        assert_eq!(unit(Some("m*s^-2")), "m·s⁻²");
        assert_eq!(unit(None) + &unit(Some("1")), "");
        let force = product(&[(Some("kg*m/s"), 1), (Some("s"), -1)]);
        assert_eq!(force.as_deref(), Some("kg*m/s^2"));
        let energy = product(&[(Some("rad/s"), 1), (Some("rad"), 1), (Some("s"), -1)]);
        assert_eq!(energy.as_deref(), Some("rad^2/s^2"));
        assert_eq!(product(&[(Some("1/s"), 1), (Some("s"), 1)]).as_deref(), Some("1"));
        assert_eq!(product(&[(Some("m"), 1), (None, -1)]), None);
        assert_eq!(term("q[1]^2*cos(theta)"), "q₁² cos(θ)");
        assert_eq!(number(-1.5e-9, 3), "−1.5·10⁻⁹");
        assert_eq!(number(0.25, 3), "0.25");
    }
}
