//! Names of a user in LaTeX.

/// Names that mean a Greek letter; LaTeX's command is the name itself.
const GREEK: &[&str] = &[
    "alpha",
    "beta",
    "gamma",
    "delta",
    "epsilon",
    "zeta",
    "eta",
    "theta",
    "iota",
    "kappa",
    "lambda",
    "mu",
    "nu",
    "xi",
    "pi",
    "rho",
    "sigma",
    "tau",
    "upsilon",
    "phi",
    "chi",
    "psi",
    "omega",
    "Gamma",
    "Delta",
    "Theta",
    "Lambda",
    "Xi",
    "Pi",
    "Sigma",
    "Upsilon",
    "Phi",
    "Psi",
    "Omega",
    "varepsilon",
    "vartheta",
    "varphi",
    "varrho",
    "varsigma",
    "ell",
    "hbar",
];

/// Greek letters as characters, in the order alpha to omega without the final sigma.
const GREEK_CHARACTERS: &str = "αβγδεζηθικλμνξοπρστυφχψω";
const GREEK_CHARACTER_NAMES: &[&str] = &[
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa",
    "lambda", "mu", "nu", "xi", "o", "pi", "rho", "sigma", "tau", "upsilon", "phi", "chi", "psi",
    "omega",
];

/// A name of the mini-language: `q[1]` is q_{1}, `p_theta` is p_{\theta}, `drag` is upright.
pub fn name(name: &str) -> String {
    // Digits at the end, indices and what follows an underscore are subscripts.
    let mut parts = name.split(['_', '[', ']', ',', ' ']).filter(|part| !part.is_empty());
    let Some(first) = parts.next() else {
        return r"\mathrm{x}".to_string();
    };
    let stem = first.trim_end_matches(|c: char| c.is_ascii_digit());
    let (stem, digits) = if stem.is_empty() { (first, "") } else { first.split_at(stem.len()) };
    let mut subscripts: Vec<String> = Vec::new();
    if !digits.is_empty() {
        subscripts.push(digits.to_string());
    }
    subscripts.extend(parts.map(word));
    if subscripts.is_empty() {
        word(stem)
    } else {
        format!("{}_{{{}}}", word(stem), subscripts.join(","))
    }
}

/// The time derivative of a name: the dot stands over the letter, not over its subscript.
pub fn dotted(text: &str) -> String {
    let whole = name(text);
    match whole.split_once('_') {
        Some((letter, subscript)) => format!(r"\dot{{{letter}}}_{subscript}"),
        None => format!(r"\dot{{{whole}}}"),
    }
}

fn word(text: &str) -> String {
    if GREEK.contains(&text) {
        return format!(r"\{text}");
    }
    let mut characters = text.chars();
    if let (Some(only), None) = (characters.next(), characters.next()) {
        if only.is_ascii_alphanumeric() {
            return only.to_string();
        }
        let place = GREEK_CHARACTERS.chars().position(|greek| greek == only);
        if let Some(name) = place.and_then(|i| GREEK_CHARACTER_NAMES.get(i)) {
            return if *name == "o" { "o".to_string() } else { format!(r"\{name}") };
        }
    }
    if text.chars().all(|c| c.is_ascii_digit()) {
        return text.to_string();
    }
    let plain: String =
        text.chars()
            .map(|c| {
                if c.is_ascii_alphanumeric() {
                    c.to_string()
                } else {
                    format!("u{:x}", u32::from(c))
                }
            })
            .collect();
    format!(r"\mathrm{{{plain}}}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn names_become_letters_and_subscripts() {
        for (text, expected) in [
            ("q", "q"),
            ("q[1]", "q_{1}"),
            ("q[12]", "q_{12}"),
            ("theta", r"\theta"),
            ("theta2", r"\theta_{2}"),
            ("p_theta", r"p_{\theta}"),
            ("p_theta[3]", r"p_{\theta,3}"),
            ("omega_dot", r"\omega_{\mathrm{dot}}"),
            ("drag", r"\mathrm{drag}"),
            ("θ", r"\theta"),
            ("k1", "k_{1}"),
            ("", r"\mathrm{x}"),
            ("Ж", r"\mathrm{u416}"),
        ] {
            assert_eq!(name(text), expected, "{text}");
        }
    }

    #[test]
    fn dots_stand_over_letters() {
        assert_eq!(dotted("q[1]"), r"\dot{q}_{1}");
        assert_eq!(dotted("theta"), r"\dot{\theta}");
        assert_eq!(dotted("p_theta"), r"\dot{p}_{\theta}");
    }

    proptest! {
        #[test]
        fn names_are_plain_latex(text in "\\PC{0,12}") {
            let name = name(&text);
            prop_assert!(name.is_ascii() && !name.contains(['$', '%', '&', '#', '~']), "{}", name);
            prop_assert_eq!(name.matches('{').count(), name.matches('}').count(), "{}", name);
        }
    }
}
