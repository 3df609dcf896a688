//! Expressions as text of the mini-language, which the parser reads back.

use std::fmt::Write;

use super::graph::{Delay, Expr, Graph, Node, Symbol};

/// What symbols are called in print.
#[derive(Debug, Clone, Default)]
pub struct Names {
    /// Name of each `Symbol::Coordinate`.
    pub coordinates: Vec<String>,
    /// Name of each `Symbol::Momentum`.
    pub momenta: Vec<String>,
    /// Name of each input.
    pub inputs: Vec<String>,
    /// Name of each `Symbol::Parameter`.
    pub parameters: Vec<String>,
    /// Name of each `Symbol::Coefficient`.
    pub coefficients: Vec<String>,
}

impl Names {
    /// The name of a symbol; one without a name gets its kind and number.
    pub fn of(&self, symbol: Symbol) -> String {
        let (list, kind, i) = match symbol {
            Symbol::Time => return "t".to_string(),
            Symbol::Input(i, order) => {
                let name = self.inputs.get(i).cloned().unwrap_or_else(|| format!("u[{}]", i + 1));
                return (0..order).fold(name, |inner, _| format!("rate({inner})"));
            }
            Symbol::Delayed(i, order, by) => {
                let by = match by {
                    Delay::Number(number) => number.short(),
                    Delay::Parameter(j) => self.of(Symbol::Parameter(j)),
                };
                let name = format!("delayed({}, {by})", self.of(Symbol::Input(i, 0)));
                return (0..order).fold(name, |inner, _| format!("rate({inner})"));
            }
            Symbol::Velocity(i) => return format!("rate({})", self.of(Symbol::Coordinate(i))),
            Symbol::Coordinate(i) => (&self.coordinates, "q", i),
            Symbol::Momentum(i) => (&self.momenta, "p", i),
            Symbol::Parameter(i) => (&self.parameters, "a", i),
            Symbol::Coefficient(i) => (&self.coefficients, "c", i),
        };
        list.get(i).cloned().unwrap_or_else(|| format!("{kind}[{}]", i + 1))
    }
}

/// How tightly a text holds together; a looser one gets parentheses inside a tighter one.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
pub(crate) enum Precedence {
    Sum,
    Product,
    Power,
    Atom,
}

impl Graph {
    /// The expression in the syntax of the mini-language.
    pub fn text(&self, expr: Expr, names: &Names) -> String {
        self.write(expr, names).0
    }

    fn write(&self, expr: Expr, names: &Names) -> (String, Precedence) {
        match self.node(expr) {
            Node::Number(number) => number_text(number.value()),
            Node::Symbol(symbol) => (names.of(*symbol), Precedence::Atom),
            Node::Sum { constant, terms } => {
                let mut out = String::new();
                // The first term that is added leads: q[3] - q[2], not -q[2] + q[3].
                let lead = terms.iter().position(|(_, factor)| factor.value() > 0.0).unwrap_or(0);
                let others = terms[..lead].iter().chain(&terms[lead + 1..]);
                for &(term, factor) in std::iter::once(&terms[lead]).chain(others) {
                    self.write_term(&mut out, term, factor.value(), names);
                }
                let constant = constant.value();
                if constant != 0.0 {
                    let sign = if constant < 0.0 { '-' } else { '+' };
                    let _ = write!(out, " {sign} {}", number_text(constant.abs()).0);
                }
                let single = terms.len() == 1 && constant == 0.0;
                // A leading minus binds like a sum: it needs parentheses inside a product.
                let strength = if single && !out.starts_with('-') {
                    Precedence::Product
                } else {
                    Precedence::Sum
                };
                (out, strength)
            }
            Node::Product(parts) => {
                let over: Vec<String> = parts
                    .iter()
                    .filter(|(_, e)| e.value() > 0.0)
                    .map(|&(b, e)| self.write_power(b, e.value(), names))
                    .collect();
                let under: Vec<String> = parts
                    .iter()
                    .filter(|(_, e)| e.value() < 0.0)
                    .map(|&(b, e)| self.write_power(b, -e.value(), names))
                    .collect();
                let single_power = parts.len() == 1 && under.is_empty();
                let mut out = if over.is_empty() { "1".to_string() } else { over.join("*") };
                for factor in under {
                    let _ = write!(out, "/{factor}");
                }
                (out, if single_power { Precedence::Power } else { Precedence::Product })
            }
            Node::Power(base, exponent) => {
                let base = self.wrapped(*base, names, Precedence::Atom);
                let exponent = self.wrapped(*exponent, names, Precedence::Atom);
                (format!("{base}^{exponent}"), Precedence::Power)
            }
            Node::Apply(function, argument) => {
                let argument = self.text(*argument, names);
                (format!("{}({argument})", function.row().name), Precedence::Atom)
            }
        }
    }

    fn write_term(&self, out: &mut String, term: Expr, factor: f64, names: &Names) {
        let first = out.is_empty();
        let sign = match (first, factor < 0.0) {
            (true, true) => "-",
            (true, false) => "",
            (false, true) => " - ",
            (false, false) => " + ",
        };
        let text = self.wrapped(term, names, Precedence::Product);
        let size = factor.abs();
        let inverse = 1.0 / size;
        let _ = if size == 1.0 {
            write!(out, "{sign}{text}")
        } else if inverse.fract() == 0.0 && inverse <= 1000.0 && 1.0 / inverse == size {
            write!(out, "{sign}{text}/{inverse}")
        } else {
            write!(out, "{sign}{}*{text}", number_text(size).0)
        };
    }

    fn write_power(&self, base: Expr, exponent: f64, names: &Names) -> String {
        let text = self.wrapped(base, names, Precedence::Atom);
        if exponent == 1.0 {
            return text;
        }
        let (exponent, strength) = number_text(exponent);
        if strength == Precedence::Atom {
            format!("{text}^{exponent}")
        } else {
            format!("{text}^({exponent})")
        }
    }

    fn wrapped(&self, expr: Expr, names: &Names, least: Precedence) -> String {
        let (text, strength) = self.write(expr, names);
        if strength < least { format!("({text})") } else { text }
    }
}

/// The shortest decimal that reads back as the same number.
fn number_text(value: f64) -> (String, Precedence) {
    let plain = value == 0.0 || (1e-5..1e16).contains(&value.abs());
    let text = if plain { format!("{value}") } else { format!("{value:e}") };
    (text, if value < 0.0 { Precedence::Sum } else { Precedence::Atom })
}
