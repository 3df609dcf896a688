//! Expressions in LaTeX's mathematics mode.

use super::letters::name;
use super::number::{Measured, fraction, shortest, significant};
use super::pretty::PrettyNumber;
use crate::expr::{
    Delay, Expr, FUNCTIONS, Function, Graph, Latex, Names, Node, Precedence, Symbol,
};

/// Largest denominator of a number that is printed as a fraction.
const LARGEST_DENOMINATOR: u32 = 100;
/// Width of a line of an equation, in characters as they are printed.
const LINE: usize = 64;

/// Writes expressions of one graph.
pub struct TexWriter<'a> {
    /// The graph that the expressions belong to.
    pub graph: &'a Graph,
    /// What symbols are called.
    pub names: &'a Names,
    /// What `Symbol::Coefficient(j)` stands for; one without an entry is written by its name.
    pub numbers: &'a [PrettyNumber],
}

impl TexWriter<'_> {
    /// The expression on one line.
    pub fn expression(&self, expr: Expr) -> String {
        self.write(expr).0
    }

    /// The expression on as many lines as it needs, each to stand behind an alignment mark.
    pub fn lines(&self, expr: Expr) -> Vec<String> {
        let mut lines = vec![String::new()];
        let mut used = 0;
        for (negative, body) in self.terms(expr) {
            let size = width(&body);
            let last = lines.len() - 1;
            if used > 0 && used + size > LINE {
                lines.push(format!(r"\quad {} {body}", if negative { '-' } else { '+' }));
                used = size;
            } else {
                append(&mut lines[last], negative, &body);
                used += size + 3;
            }
        }
        lines
    }

    /// The terms of a sum with their signs; of anything else, the whole.
    fn terms(&self, expr: Expr) -> Vec<(bool, String)> {
        match self.graph.node(expr) {
            Node::Sum { constant, terms } => {
                let mut out: Vec<(bool, String)> =
                    terms.iter().map(|&(term, factor)| self.term(factor.value(), term)).collect();
                if constant.value() != 0.0 || out.is_empty() {
                    out.push((constant.value() < 0.0, plain(constant.value().abs())));
                }
                out
            }
            Node::Number(number) => {
                vec![(number.value() < 0.0, plain(number.value().abs()))]
            }
            _ => vec![self.term(1.0, expr)],
        }
    }

    fn write(&self, expr: Expr) -> (String, Precedence) {
        match self.graph.node(expr) {
            Node::Number(_) | Node::Sum { .. } | Node::Product(_) => {
                let mut terms = self.terms(expr);
                // 1 - x reads better than -x + 1.
                if terms.first().is_some_and(|term| term.0)
                    && let Some(positive) = terms.iter().position(|term| !term.0)
                {
                    terms[..=positive].rotate_right(1);
                }
                let mut out = String::new();
                for (negative, body) in &terms {
                    append(&mut out, *negative, body);
                }
                let strength = match (&terms[..], self.graph.node(expr)) {
                    ([(false, _)], Node::Number(_)) => Precedence::Atom,
                    ([(false, _)], Node::Product(parts)) if parts.len() == 1 => Precedence::Power,
                    ([(false, _)], _) => Precedence::Product,
                    _ => Precedence::Sum,
                };
                (out, strength)
            }
            Node::Symbol(Symbol::Coefficient(j)) => {
                let (negative, text) = self.number(*j, 1.0);
                let sign = if negative { "-" } else { "" };
                let loose = negative || text.contains(' ');
                (format!("{sign}{text}"), if loose { Precedence::Sum } else { Precedence::Atom })
            }
            Node::Symbol(Symbol::Input(i, order)) => {
                let plain = name(&self.names.of(Symbol::Input(*i, 0)));
                let derived = match order {
                    0 => plain,
                    1 => format!("\\dot{{{plain}}}"),
                    2 => format!("\\ddot{{{plain}}}"),
                    _ => format!("{{{plain}}}^{{({order})}}"),
                };
                (format!("{derived}(t)"), Precedence::Atom)
            }
            Node::Symbol(Symbol::Delayed(i, order, by)) => {
                let plain = name(&self.names.of(Symbol::Input(*i, 0)));
                let by = match by {
                    Delay::Number(number) => number.short(),
                    Delay::Parameter(j) => name(&self.names.of(Symbol::Parameter(*j))),
                };
                let derived = match order {
                    0 => plain,
                    1 => format!("\\dot{{{plain}}}"),
                    _ => format!("{{{plain}}}^{{({order})}}"),
                };
                (format!("{derived}(t - {by})"), Precedence::Atom)
            }
            Node::Symbol(Symbol::Velocity(i)) => {
                let n = self.names.coordinates.len().max(1);
                let plain = name(&self.names.of(Symbol::Coordinate(i % n)));
                let dots = if *i < n { "dot" } else { "ddot" };
                (format!("\\{dots}{{{plain}}}"), Precedence::Atom)
            }
            // Behind the momenta stand their rates.
            Node::Symbol(Symbol::Momentum(i)) if (1..=*i).contains(&self.names.momenta.len()) => {
                let n = self.names.momenta.len();
                let plain = name(&self.names.of(Symbol::Momentum(i % n)));
                (format!("\\dot{{{plain}}}"), Precedence::Atom)
            }
            Node::Symbol(symbol) => (name(&self.names.of(*symbol)), Precedence::Atom),
            Node::Power(base, exponent) => {
                let base = self.wrapped(*base, Precedence::Atom);
                (format!("{base}^{{{}}}", self.expression(*exponent)), Precedence::Power)
            }
            Node::Apply(function, argument) => self.call(*function, *argument, ""),
        }
    }

    /// factor * expr: its sign and what is written behind it.
    fn term(&self, factor: f64, expr: Expr) -> (bool, String) {
        let parts: Vec<(Expr, f64)> = match self.graph.node(expr) {
            Node::Product(parts) => parts.iter().map(|&(b, e)| (b, e.value())).collect(),
            _ => vec![(expr, 1.0)],
        };
        let learned = parts.iter().position(|&(base, exponent)| {
            exponent == 1.0 && matches!(self.graph.node(base), Node::Symbol(Symbol::Coefficient(_)))
        });
        let mut over = Vec::new();
        let mut under = Vec::new();
        for (i, &(base, exponent)) in parts.iter().enumerate() {
            if Some(i) == learned {
                continue;
            }
            let list = if exponent > 0.0 { &mut over } else { &mut under };
            list.push(self.power(base, exponent.abs()));
        }
        if let Some(at) = learned
            && let Node::Symbol(Symbol::Coefficient(j)) = self.graph.node(parts[at].0)
        {
            if let Some(value) = self.exact(*j, factor) {
                return (value < 0.0, fraction_of(&over, &under, Some(value.abs())));
            }
            let (negative, number) = self.number(*j, factor);
            let rest = fraction_of(&over, &under, None);
            let body = match (number.as_str(), rest.as_str()) {
                (_, "1") => number,
                ("1", _) => rest,
                _ => format!("{number} \\, {rest}"),
            };
            return (negative, body);
        }
        (factor < 0.0, fraction_of(&over, &under, Some(factor.abs())))
    }

    /// A snapped number times a factor, where that is a plain fraction.
    fn exact(&self, j: usize, factor: f64) -> Option<f64> {
        let number = self.numbers.get(j).filter(|number| number.snapped.is_some())?;
        let value = number.value * factor;
        fraction(value, LARGEST_DENOMINATOR).map(|_| value)
    }

    /// A learned number times a factor: its sign and its size with uncertainty.
    fn number(&self, j: usize, factor: f64) -> (bool, String) {
        let Some(number) = self.numbers.get(j) else {
            let text = name(&self.names.of(Symbol::Coefficient(j)));
            let size = factor.abs();
            let text = if size == 1.0 { text } else { format!(r"{} \, {text}", plain(size)) };
            return (factor < 0.0, text);
        };
        let value = number.value * factor;
        let text = match &number.snapped {
            Some(snapped) if fraction(value.abs(), LARGEST_DENOMINATOR).is_none() => {
                let exact = snapped_tex(snapped.trim().trim_start_matches('-'));
                let size = factor.abs();
                if size == 1.0 { exact } else { format!(r"{} \cdot {exact}", plain(size)) }
            }
            Some(_) => plain(value.abs()),
            None => Measured::new(value.abs(), number.standard_error * factor.abs()).tex(),
        };
        (value < 0.0, text)
    }

    fn power(&self, base: Expr, exponent: f64) -> String {
        if exponent == 1.0 {
            return self.wrapped(base, Precedence::Power);
        }
        if exponent == 0.5 {
            return format!(r"\sqrt{{{}}}", self.expression(base));
        }
        let exponent = plain(exponent);
        if let Node::Apply(function, argument) = self.graph.node(base) {
            return self.call(*function, *argument, &exponent).0;
        }
        format!("{}^{{{exponent}}}", self.wrapped(base, Precedence::Atom))
    }

    /// function(argument) ^ exponent; no exponent when it is empty.
    fn call(&self, function: Function, argument: Expr, exponent: &str) -> (String, Precedence) {
        let inside = self.expression(argument);
        let row = function.row();
        let raised = if exponent.is_empty() { String::new() } else { format!("^{{{exponent}}}") };
        let text = match row.latex {
            Latex::Radical if exponent.is_empty() => format!(r"\sqrt{{{inside}}}"),
            Latex::Radical => format!(r"\left(\sqrt{{{inside}}}\right){raised}"),
            Latex::Bars => format!(r"\left|{inside}\right|{raised}"),
            Latex::Command(command) => format!(r"{command}{raised}\left({inside}\right)"),
        };
        (text, Precedence::Power)
    }

    fn wrapped(&self, expr: Expr, least: Precedence) -> String {
        let (text, strength) = self.write(expr);
        if strength < least { format!(r"\left({text}\right)") } else { text }
    }
}

fn append(out: &mut String, negative: bool, body: &str) {
    match (out.is_empty(), negative) {
        (true, false) => {}
        (true, true) => out.push('-'),
        (false, false) => out.push_str(" + "),
        (false, true) => out.push_str(" - "),
    }
    out.push_str(body);
}

/// number * over / under.
fn fraction_of(over: &[String], under: &[String], number: Option<f64>) -> String {
    let number = number.filter(|&x| x != 1.0);
    let (numerator, denominator) = match number.map(|x| (x, nice_fraction(x))) {
        Some((_, Some((n, d)))) => {
            let show = |x: i64| (x != 1).then(|| x.to_string());
            (show(n), show(d))
        }
        Some((x, None)) => (Some(plain(x)), None),
        None => (None, None),
    };
    let join = |number: Option<String>, factors: &[String]| {
        let mut all: Vec<String> = number.into_iter().collect();
        all.extend_from_slice(factors);
        if all.is_empty() { "1".to_string() } else { all.join(r" \, ") }
    };
    if under.is_empty() {
        // A number stands before the rest, not over it: \frac{1}{2} p^{2}.
        let Some(denominator) = denominator else {
            return join(numerator, over);
        };
        let number = format!(r"\frac{{{}}}{{{denominator}}}", numerator.unwrap_or("1".to_string()));
        return join(Some(number), over);
    }
    let (over, under) = (join(numerator, over), join(denominator, under));
    format!(r"\frac{{{}}}{{{}}}", without_parentheses(&over), without_parentheses(&under))
}

/// The bar of a fraction holds together what stands over and under it.
fn without_parentheses(text: &str) -> &str {
    let inside = text.strip_prefix(r"\left(").and_then(|rest| rest.strip_suffix(r"\right)"));
    let Some(inside) = inside else {
        return text;
    };
    // The first parenthesis must be the one that the last one closes.
    let mut depth = 0;
    for (at, _) in inside.match_indices('\\') {
        if inside[at..].starts_with(r"\left") {
            depth += 1;
        } else if inside[at..].starts_with(r"\right") {
            depth -= 1;
        }
        if depth < 0 {
            return text;
        }
    }
    inside
}

/// A fraction where that reads better than the decimal: 1/3 and 1/2, but 0.4 and 1.7.
fn nice_fraction(value: f64) -> Option<(i64, i64)> {
    let (n, d) = fraction(value, LARGEST_DENOMINATOR)?;
    let short = shortest(value).0.len() <= 6;
    (!short || [1, 2, 4, 8, 16].contains(&d)).then_some((n, d))
}

/// A number without an uncertainty: a fraction where it is one.
fn plain(value: f64) -> String {
    if !value.is_finite() {
        return r"\infty".to_string();
    }
    if let Some((n, d)) = nice_fraction(value) {
        let sign = if n < 0 { "-" } else { "" };
        let n = n.abs();
        return if d == 1 { format!("{sign}{n}") } else { format!(r"{sign}\frac{{{n}}}{{{d}}}") };
    }
    // The last digits of a known number are rounding: 0.4 * 0.4 is to read 0.16.
    let (digits, exponent) = significant(value, 15);
    Measured { digits, uncertainty: None, exponent }.tex()
}

/// An exact number in the mini-language, `pi/2` or `sqrt(2)`, in LaTeX.
fn snapped_tex(text: &str) -> String {
    if let Some((over, under)) = text.split_once('/')
        && !under.contains(['/', '+', '-', '*'])
        && !over.contains(['+', '-'])
    {
        return format!(r"\frac{{{}}}{{{}}}", snapped_tex(over), snapped_tex(under));
    }
    let mut out = String::new();
    let mut rest = text.trim();
    while let Some(c) = rest.chars().next() {
        if let Some(inside) = rest.strip_prefix("sqrt(")
            && let Some((argument, behind)) = inside.split_once(')')
        {
            out += &format!(r"\sqrt{{{}}}", snapped_tex(argument));
            rest = behind;
        } else if let Some(behind) = rest.strip_prefix("pi") {
            out += r"\pi ";
            rest = behind;
        } else {
            match c {
                '*' => out += r" \, ",
                '{' | '}' | '\\' | '$' | '%' | '#' | '&' | '_' => {}
                c => out.push(c),
            }
            rest = &rest[c.len_utf8()..];
        }
    }
    out.trim().to_string()
}

/// Whether a command, without its backslash, is the name of a function and printed as such.
fn is_function(command: &str) -> bool {
    FUNCTIONS.iter().any(|row| match row.latex {
        Latex::Command(text) => text.strip_prefix('\\') == Some(command),
        Latex::Radical | Latex::Bars => false,
    })
}

/// About how many characters are printed.
pub(super) fn width(tex: &str) -> usize {
    let mut count = 0;
    let mut rest = tex;
    while let Some(c) = rest.chars().next() {
        if c == '\\' {
            let length = rest[1..].chars().take_while(char::is_ascii_alphabetic).count();
            let command = &rest[1..1 + length];
            count += match command {
                "left" | "right" | "frac" | "mathrm" | "sqrt" | "operatorname" => 0,
                _ if is_function(command) => length,
                _ => 1,
            };
            let escaped = usize::from(length == 0 && rest.len() > 1);
            rest = rest.get(1 + length + escaped..).unwrap_or("");
        } else {
            count += usize::from(!matches!(c, '{' | '}' | '^' | '_' | ' '));
            rest = &rest[c.len_utf8()..];
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_are_as_short_as_they_can_be() {
        for (value, expected) in [
            (0.5, r"\frac{1}{2}"),
            (1.0 / 3.0, r"\frac{1}{3}"),
            (1.7, "1.7"),
            (0.4 * 0.4, "0.16"),
            (-2.0, "-2"),
            (1.5e-9, r"1.5 \times 10^{-9}"),
        ] {
            assert_eq!(plain(value), expected);
        }
        assert_eq!(without_parentheses(r"\left(a\right)"), "a");
        let two = r"\left(a\right) \, \left(b\right)";
        assert_eq!(without_parentheses(two), two);
    }

    fn tex(build: impl FnOnce(&mut Graph) -> Expr) -> String {
        let mut graph = Graph::new();
        let expr = build(&mut graph);
        let numbers = [
            PrettyNumber { value: 0.501_2, standard_error: 0.001_3, snapped: None },
            PrettyNumber { value: -2.0, standard_error: 0.0, snapped: Some("-2".into()) },
            PrettyNumber {
                value: std::f64::consts::PI / 2.0,
                standard_error: 0.0,
                snapped: Some("pi/2".into()),
            },
        ];
        TexWriter { graph: &graph, names: &Names::default(), numbers: &numbers }.expression(expr)
    }

    #[test]
    fn expressions_read_as_in_a_paper() {
        let q = Symbol::Coordinate(0);
        let half_square = tex(|g| {
            let p = g.symbol(Symbol::Momentum(0));
            let square = g.power(p, 2.0);
            g.scale(0.5, square)
        });
        assert_eq!(half_square, r"\frac{1}{2} \, p_{1}^{2}");
        let learned = tex(|g| {
            let (q, c) = (g.symbol(q), g.symbol(Symbol::Coefficient(0)));
            let square = g.power(q, 2.0);
            let product = g.multiply(c, square);
            let (d, three) = (g.symbol(Symbol::Coefficient(1)), g.power(q, 3.0));
            let second = g.multiply(d, three);
            let doubled = g.scale(2.0, product);
            g.add(doubled, second)
        });
        assert_eq!(learned, r"1.0024(26) \, q_{1}^{2} - 2 \, q_{1}^{3}");
        let functions = tex(|g| {
            let q = g.symbol(q);
            let shifted = g.linear(1.0, &[(1.0, q)]);
            let sin = g.apply(Function::SIN, shifted);
            let square = g.power(sin, 2.0);
            let abs = g.apply(Function::ABS, q);
            let root = g.apply(Function::SQRT, shifted);
            let product = g.product(-1.0, &[(square, 1.0), (abs, 1.0), (root, -1.0)]);
            let half = g.power(shifted, 1.5);
            g.add(product, half)
        });
        assert_eq!(
            functions,
            r"\left(q_{1} + 1\right)^{\frac{3}{2}} - \frac{\sin^{2}\left(q_{1} + 1\right) \, \left|q_{1}\right|}{\sqrt{q_{1} + 1}}"
        );
        assert_eq!(tex(|g| g.symbol(Symbol::Coefficient(2))), r"\frac{\pi}{2}");
        let inverse = tex(|g| {
            let q = g.symbol(q);
            g.product(-3.0, &[(q, -2.0)])
        });
        assert_eq!(inverse, r"-\frac{3}{q_{1}^{2}}");
    }

    /// Every `{` is closed, and every `\left` has its `\right`.
    fn balanced(tex: &str) -> bool {
        let mut depth = 0_i32;
        for c in tex.chars() {
            depth += i32::from(c == '{') - i32::from(c == '}');
            if depth < 0 {
                return false;
            }
        }
        depth == 0 && tex.matches(r"\left").count() == tex.matches(r"\right").count()
    }

    /// A random expression, made by a little stack machine.
    fn random(graph: &mut Graph, code: &[(u8, i8)]) -> Expr {
        let mut stack = vec![graph.symbol(Symbol::Coordinate(0))];
        for &(what, number) in code {
            let a = stack.pop().unwrap_or(graph.number(1.0));
            let x = f64::from(number) / 4.0;
            match what % 8 {
                0 => stack.extend([a, graph.symbol(Symbol::Momentum(usize::from(what) % 3))]),
                1 => stack.extend([a, graph.symbol(Symbol::Coefficient(usize::from(what) % 4))]),
                2 => stack.push(graph.linear(x, &[(2.0 - x, a)])),
                3 => stack.push(graph.power(a, x)),
                4 => {
                    let all: Vec<Function> = Function::all().collect();
                    stack.push(graph.apply(all[usize::from(what) % all.len()], a));
                }
                5 => {
                    let b = stack.pop().unwrap_or(a);
                    stack.push(graph.power_of(b, a));
                }
                6 => {
                    let b = stack.pop().unwrap_or(a);
                    stack.push(graph.multiply(a, b));
                }
                _ => {
                    let b = stack.pop().unwrap_or(a);
                    stack.push(graph.subtract(b, a));
                }
            }
        }
        graph.sum(&stack)
    }

    proptest! {
        #[test]
        fn braces_balance(code in prop::collection::vec(any::<(u8, i8)>(), 0..40)) {
            let mut graph = Graph::new();
            let expr = random(&mut graph, &code);
            let numbers = [PrettyNumber { value: -1e-9, standard_error: 1e-10, snapped: None }];
            let writer = TexWriter { graph: &graph, names: &Names::default(), numbers: &numbers };
            let text = writer.expression(expr);
            prop_assert!(balanced(&text), "{}", text);
            prop_assert!(!text.contains("NaN") && !text.contains("inf "), "{}", text);
            for line in writer.lines(expr) {
                prop_assert!(balanced(&line), "{}", line);
            }
        }
    }
}
