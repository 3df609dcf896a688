//! The simplified model as text for people.

use std::fmt::Write;

use super::measured::Measured;
use super::{DerivedNumber, Part, Simplified};
use crate::expr::{Expr, Node, Place, Precedence, Symbol};

/// How numbers are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Style {
    /// Print uncertain numbers as 0.5012(13): the last digits' standard error in brackets.
    pub uncertainties: bool,
    /// Significant digits of numbers without an uncertainty.
    pub digits: usize,
}

impl Default for Style {
    fn default() -> Self {
        Style { uncertainties: true, digits: 10 }
    }
}

impl DerivedNumber {
    /// The number as it is printed.
    pub fn text(&self, style: Style) -> String {
        match self.snapped {
            Some(nice) => nice.to_string(),
            None if style.uncertainties => uncertain(self.value, self.standard_error, style.digits),
            None => significant(self.value, style.digits),
        }
    }

    /// The value that is printed: the nice one where the number snapped.
    pub fn printed_value(&self) -> f64 {
        self.snapped.map_or(self.value, super::NiceNumber::value)
    }
}

/// `0.5012(13)` as [`Measured`] has it; a number without a standard error (zero, infinite or lost
/// in rounding) with that many significant digits.
pub fn uncertain(value: f64, standard_error: f64, digits: usize) -> String {
    let size = value.abs().max(1e-300);
    if !(standard_error > 1e-12 * size && standard_error.is_finite() && value.is_finite()) {
        return significant(value, digits);
    }
    Measured::new(value, standard_error).text()
}

/// That many significant digits at most, no trailing zeros.
pub fn significant(value: f64, digits: usize) -> String {
    let text = format!("{value:.*e}", digits.max(1) - 1);
    let rounded: f64 = text.parse().unwrap_or(value);
    let plain = rounded == 0.0 || (1e-5..1e16).contains(&rounded.abs());
    if plain { format!("{rounded}") } else { format!("{rounded:e}") }
}

impl Simplified {
    /// H on one line, then the force on each coordinate that has one; what the instrument
    /// adds is no part of the motion and stands in the parts only.
    ///
    /// Close to the mini-language, with a space for products: `H = p^2/2 - 0.5012(13) cos(q)`.
    pub fn text(&self, style: Style) -> String {
        let mut out = String::new();
        for part in self.parts.iter().filter(|part| part.place.is_energy()) {
            let text = self.part_text(part, style);
            match (out.is_empty(), text.strip_prefix('-')) {
                (true, _) => {
                    let _ = write!(out, "H = {text}");
                }
                (false, Some(rest)) => {
                    let _ = write!(out, " - {rest}");
                }
                (false, None) => {
                    let _ = write!(out, " + {text}");
                }
            }
        }
        if out.is_empty() {
            out.push_str("H = 0");
        }
        for part in &self.parts {
            if let Place::Force(i) = part.place {
                let name = self.names.of(Symbol::Coordinate(i));
                let _ = write!(out, "\nforce {name} = {}", self.part_text(part, style));
            }
        }
        out
    }

    /// One part, without its name.
    pub fn part_text(&self, part: &Part, style: Style) -> String {
        self.write(part.pretty, style, false).0
    }

    fn write(&self, expr: Expr, style: Style, inner: bool) -> (String, Precedence) {
        match self.graph.node(expr) {
            Node::Number(number) => (significant(number.value(), style.digits), Precedence::Atom),
            Node::Symbol(Symbol::Coefficient(j)) => match self.numbers.get(*j) {
                Some(number) => {
                    let text = number.text(style);
                    let product = number.snapped.is_some() && text.contains(['/', '*']);
                    (text, if product { Precedence::Product } else { Precedence::Atom })
                }
                None => ("?".to_string(), Precedence::Atom),
            },
            Node::Symbol(symbol) => (self.names.of(*symbol), Precedence::Atom),
            Node::Sum { constant, terms } => {
                let mut terms: Vec<(Expr, f64)> =
                    terms.iter().map(|&(t, c)| (t, c.value())).collect();
                // (q2 - q1) rather than (-q1 + q2); whole parts keep their order.
                if inner
                    && terms.first().is_some_and(|t| t.1 < 0.0)
                    && let Some(first) = terms.iter().position(|t| t.1 > 0.0)
                {
                    let term = terms.remove(first);
                    terms.insert(0, term);
                }
                let mut out = String::new();
                for (term, factor) in terms {
                    let (text, strength) = self.write(term, style, true);
                    let text = if strength == Precedence::Sum { format!("({text})") } else { text };
                    let text = match factor.abs() {
                        1.0 => text,
                        size => format!("{} {text}", significant(size, style.digits)),
                    };
                    push_signed(&mut out, factor < 0.0, &text);
                }
                if constant.value() != 0.0 {
                    let text = significant(constant.value().abs(), style.digits);
                    push_signed(&mut out, constant.value() < 0.0, &text);
                }
                (out, Precedence::Sum)
            }
            Node::Product(parts) => self.write_product(parts, style),
            Node::Power(base, exponent) => {
                let base = self.wrapped(*base, style, Precedence::Atom);
                let exponent = self.wrapped(*exponent, style, Precedence::Atom);
                (format!("{base}^{exponent}"), Precedence::Power)
            }
            Node::Apply(function, argument) => {
                let argument = self.write(*argument, style, true).0;
                (format!("{}({argument})", function.row().name), Precedence::Atom)
            }
        }
    }

    fn write_product(
        &self,
        parts: &[(Expr, crate::expr::Number)],
        style: Style,
    ) -> (String, Precedence) {
        let (mut over, mut under) = (Vec::new(), Vec::new());
        for &(base, exponent) in parts {
            let exponent = exponent.value();
            // 1/2 x is x/2, and 3/4 x is 3 x/4.
            let nice = match self.graph.node(base) {
                Node::Symbol(Symbol::Coefficient(j)) => {
                    self.numbers.get(*j).and_then(|number| number.snapped)
                }
                _ => None,
            };
            if let (Some(nice), 1.0) = (nice, exponent) {
                if nice.numerator != 1 {
                    over.push(nice.numerator.to_string());
                }
                if nice.pi {
                    over.push("pi".to_string());
                }
                if nice.denominator != 1 {
                    under.push(nice.denominator.to_string());
                }
                continue;
            }
            let text = self.wrapped(base, style, Precedence::Atom);
            let power = |e: f64| match e {
                1.0 => text.clone(),
                e if e.fract() == 0.0 => format!("{text}^{e}"),
                e => format!("{text}^({})", significant(e, style.digits)),
            };
            if exponent < 0.0 { under.push(power(-exponent)) } else { over.push(power(exponent)) }
        }
        let single = over.len() == 1 && under.is_empty();
        let mut out = if over.is_empty() { "1".to_string() } else { over.join(" ") };
        for divisor in under {
            let _ = write!(out, "/{divisor}");
        }
        (out, if single { Precedence::Power } else { Precedence::Product })
    }

    fn wrapped(&self, expr: Expr, style: Style, least: Precedence) -> String {
        let (text, strength) = self.write(expr, style, true);
        if strength < least { format!("({text})") } else { text }
    }
}

fn push_signed(out: &mut String, negative: bool, text: &str) {
    out.push_str(match (out.is_empty(), negative) {
        (true, true) => "-",
        (true, false) => "",
        (false, true) => " - ",
        (false, false) => " + ",
    });
    out.push_str(text);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uncertainties_stand_in_brackets() {
        for (value, error, text) in [
            (0.501_23, 0.001_3, "0.5012(13)"),
            (-2.0, 0.000_996, "-2.0000(10)"),
            (123.4, 5.6, "123.4(5.6)"),
            (1234.0, 56.0, "1234(56)"),
            (0.5, 0.0, "0.5"),
            (1.0 / 3.0, 0.0, "0.3333333333"),
            (123_456.0, 1_200.0, "1.235(12)e5"),
        ] {
            assert_eq!(uncertain(value, error, 10), text);
        }
        assert_eq!(significant(f64::NAN, 3), "NaN");
    }
}
