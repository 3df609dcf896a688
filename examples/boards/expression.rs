//! Laws as others write them: text, read into an expression of x, v and t that can be evaluated,
//! differentiated by x, and printed. It shares nothing with the library, which it judges.

use std::collections::HashMap;
use std::fmt;

/// Nested parentheses and signs of a text: more are refused, for the reader calls itself.
const DEEPEST: usize = 60;

/// An expression of the coordinate, its velocity and the time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Expression {
    Number(f64),
    /// `x`, `v` or `t`: 0, 1 or 2.
    Variable(usize),
    Sum(Vec<Expression>),
    Product(Vec<Expression>),
    Power(Box<Expression>, Box<Expression>),
    Call(Function, Box<Expression>),
}

/// A function of one argument.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Function {
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Exp,
    Log,
    Sqrt,
    Abs,
    Sign,
    Asinh,
}

/// Every function, by the name that texts have for it.
const FUNCTIONS: [(&str, Function); 17] = [
    ("sin", Function::Sin),
    ("cos", Function::Cos),
    ("tan", Function::Tan),
    ("asin", Function::Asin),
    ("acos", Function::Acos),
    ("atan", Function::Atan),
    ("sinh", Function::Sinh),
    ("cosh", Function::Cosh),
    ("tanh", Function::Tanh),
    ("exp", Function::Exp),
    ("log", Function::Log),
    ("ln", Function::Log),
    ("sqrt", Function::Sqrt),
    ("abs", Function::Abs),
    ("Abs", Function::Abs),
    ("sign", Function::Sign),
    ("asinh", Function::Asinh),
];

const VARIABLES: [&str; 3] = ["x", "v", "t"];

impl Expression {
    /// Reads a text; names other than x, v and t stand for the given numbers.
    ///
    /// # Errors
    /// What cannot be read, in a sentence.
    pub(crate) fn parse(text: &str, numbers: &HashMap<String, f64>) -> Result<Expression, String> {
        let mut reader = Reader { text, at: 0, depth: 0, numbers };
        let read = reader.sum()?;
        match reader.next() {
            None => Ok(read),
            Some(strange) => Err(format!("`{text}` cannot be read from `{strange}` on")),
        }
    }

    /// Its value at (x, v, t).
    pub(crate) fn value(&self, at: &[f64; 3]) -> f64 {
        match self {
            Expression::Number(number) => *number,
            Expression::Variable(i) => at.get(*i).copied().unwrap_or(f64::NAN),
            Expression::Sum(parts) => parts.iter().map(|part| part.value(at)).sum(),
            Expression::Product(parts) => parts.iter().map(|part| part.value(at)).product(),
            Expression::Power(base, exponent) => match exponent.as_ref() {
                Expression::Number(n) if n.fract() == 0.0 && n.abs() <= 64.0 => {
                    base.value(at).powi(*n as i32)
                }
                exponent => base.value(at).powf(exponent.value(at)),
            },
            Expression::Call(function, argument) => function.value(argument.value(at)),
        }
    }

    /// Its derivative by x.
    pub(crate) fn by_x(&self) -> Expression {
        match self {
            Expression::Variable(0) => Expression::Number(1.0),
            Expression::Number(_) | Expression::Variable(_) => Expression::Number(0.0),
            Expression::Sum(parts) => Expression::Sum(parts.iter().map(Self::by_x).collect()),
            Expression::Product(parts) => {
                let each = (0..parts.len()).filter(|i| parts[*i].depends(0)).map(|i| {
                    let mut factors = parts.clone();
                    factors[i] = parts[i].by_x();
                    Expression::Product(factors)
                });
                Expression::Sum(each.collect())
            }
            // b^e: e b^(e - 1) b' + log(b) b^e e'.
            Expression::Power(base, exponent) => {
                let lower = Expression::Sum(vec![(**exponent).clone(), Expression::Number(-1.0)]);
                let lower = match exponent.as_ref() {
                    Expression::Number(number) => Expression::Number(number - 1.0),
                    _ => lower,
                };
                let of_base = Expression::Product(vec![
                    (**exponent).clone(),
                    Expression::Power(base.clone(), Box::new(lower)),
                    base.by_x(),
                ]);
                let of_exponent = || {
                    let logarithm = Expression::Call(Function::Log, base.clone());
                    Expression::Product(vec![logarithm, self.clone(), exponent.by_x()])
                };
                let mut parts = Vec::new();
                if base.depends(0) {
                    parts.push(of_base);
                }
                if exponent.depends(0) {
                    parts.push(of_exponent());
                }
                Expression::Sum(parts)
            }
            Expression::Call(_, argument) if !argument.depends(0) => Expression::Number(0.0),
            Expression::Call(function, argument) => {
                Expression::Product(vec![function.derivative(argument), argument.by_x()])
            }
        }
    }

    /// Whether a variable occurs in it.
    pub(crate) fn depends(&self, variable: usize) -> bool {
        self.any(&mut |part| *part == Expression::Variable(variable))
    }

    /// Whether a part of it is such.
    pub(crate) fn any(&self, is: &mut dyn FnMut(&Expression) -> bool) -> bool {
        if is(self) {
            return true;
        }
        match self {
            Expression::Number(_) | Expression::Variable(_) => false,
            Expression::Sum(parts) | Expression::Product(parts) => {
                parts.iter().any(|part| part.any(is))
            }
            Expression::Power(base, exponent) => base.any(is) || exponent.any(is),
            Expression::Call(_, argument) => argument.any(is),
        }
    }
}

fn call(function: Function, argument: &Expression) -> Expression {
    Expression::Call(function, Box::new(argument.clone()))
}

fn power(base: Expression, exponent: f64) -> Expression {
    Expression::Power(Box::new(base), Box::new(Expression::Number(exponent)))
}

fn times(number: f64, expression: Expression) -> Expression {
    Expression::Product(vec![Expression::Number(number), expression])
}

impl Function {
    fn name(self) -> &'static str {
        FUNCTIONS.iter().find(|(_, function)| *function == self).map_or("", |(name, _)| name)
    }

    fn value(self, x: f64) -> f64 {
        match self {
            Function::Sin => x.sin(),
            Function::Cos => x.cos(),
            Function::Tan => x.tan(),
            Function::Asin => x.asin(),
            Function::Acos => x.acos(),
            Function::Atan => x.atan(),
            Function::Sinh => x.sinh(),
            Function::Cosh => x.cosh(),
            Function::Tanh => x.tanh(),
            Function::Exp => x.exp(),
            Function::Log => x.ln(),
            Function::Sqrt => x.sqrt(),
            Function::Abs => x.abs(),
            Function::Sign if x == 0.0 => 0.0,
            Function::Sign => x.signum(),
            Function::Asinh => x.asinh(),
        }
    }

    /// Its derivative at an argument.
    fn derivative(self, x: &Expression) -> Expression {
        let one_and = |factor: f64| {
            Expression::Sum(vec![Expression::Number(1.0), times(factor, power(x.clone(), 2.0))])
        };
        match self {
            Function::Sin => call(Function::Cos, x),
            Function::Cos => times(-1.0, call(Function::Sin, x)),
            Function::Tan => power(call(Function::Cos, x), -2.0),
            Function::Asin => power(one_and(-1.0), -0.5),
            Function::Acos => times(-1.0, power(one_and(-1.0), -0.5)),
            Function::Atan => power(one_and(1.0), -1.0),
            Function::Sinh => call(Function::Cosh, x),
            Function::Cosh => call(Function::Sinh, x),
            Function::Tanh => power(call(Function::Cosh, x), -2.0),
            Function::Exp => call(Function::Exp, x),
            Function::Log => power(x.clone(), -1.0),
            Function::Sqrt => times(0.5, power(x.clone(), -0.5)),
            Function::Abs => call(Function::Sign, x),
            Function::Sign => Expression::Number(0.0),
            Function::Asinh => power(one_and(1.0), -0.5),
        }
    }
}

/// Reads by recursive descent: sums of products of powers.
struct Reader<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
    numbers: &'a HashMap<String, f64>,
}

impl Reader<'_> {
    fn rest(&mut self) -> &str {
        let rest = self.text.get(self.at..).unwrap_or("");
        let trimmed = rest.trim_start();
        self.at += rest.len() - trimmed.len();
        trimmed
    }

    fn next(&mut self) -> Option<char> {
        self.rest().chars().next()
    }

    /// Steps over a text if it is what comes next.
    fn takes(&mut self, wanted: &str) -> bool {
        let found = self.rest().starts_with(wanted);
        if found {
            self.at += wanted.len();
        }
        found
    }

    fn deeper(&mut self) -> Result<(), String> {
        self.depth += 1;
        match self.depth > DEEPEST {
            true => Err(format!("`{}` is nested too deeply to be read", self.text)),
            false => Ok(()),
        }
    }

    fn sum(&mut self) -> Result<Expression, String> {
        self.deeper()?;
        let mut parts = vec![self.product()?];
        loop {
            if self.takes("+") {
                parts.push(self.product()?);
            } else if self.takes("-") {
                parts.push(times(-1.0, self.product()?));
            } else {
                break;
            }
        }
        self.depth -= 1;
        Ok(single(parts, Expression::Sum))
    }

    fn product(&mut self) -> Result<Expression, String> {
        let mut parts = vec![self.signed()?];
        loop {
            // `**` is a power, and was taken as one.
            if self.takes("*") {
                parts.push(self.signed()?);
            } else if self.takes("/") {
                let divisor = self.signed()?;
                parts.push(match divisor {
                    Expression::Number(number) => Expression::Number(1.0 / number),
                    other => power(other, -1.0),
                });
            } else {
                break;
            }
        }
        Ok(single(parts, Expression::Product))
    }

    fn signed(&mut self) -> Result<Expression, String> {
        self.deeper()?;
        let read = if self.takes("-") {
            match self.signed()? {
                Expression::Number(number) => Expression::Number(-number),
                other => times(-1.0, other),
            }
        } else if self.takes("+") {
            self.signed()?
        } else {
            let base = self.atom()?;
            match self.takes("**") || self.takes("^") {
                true => Expression::Power(Box::new(base), Box::new(self.exponent()?)),
                false => base,
            }
        };
        self.depth -= 1;
        Ok(read)
    }

    /// An exponent; where it is a number, that number.
    fn exponent(&mut self) -> Result<Expression, String> {
        let read = self.signed()?;
        let constant = !(0..VARIABLES.len()).any(|i| read.depends(i));
        Ok(if constant { Expression::Number(read.value(&[0.0; 3])) } else { read })
    }

    fn atom(&mut self) -> Result<Expression, String> {
        if self.takes("(") {
            let inner = self.sum()?;
            return self.closed(inner);
        }
        match self.next() {
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() || c == '_' => self.named(),
            Some(strange) => Err(format!("`{}` has `{strange}` for a number", self.text)),
            None => Err(format!("`{}` ends where a number should follow", self.text)),
        }
    }

    fn closed(&mut self, inner: Expression) -> Result<Expression, String> {
        match self.takes(")") {
            true => Ok(inner),
            false => Err(format!("a parenthesis of `{}` is not closed", self.text)),
        }
    }

    fn number(&mut self) -> Result<Expression, String> {
        let mut before = ' ';
        let mut end = 0;
        for c in self.rest().chars() {
            let signs = "+-".contains(c) && "eE".contains(before);
            if !(c.is_ascii_digit() || ".eE".contains(c) || signs) {
                break;
            }
            (before, end) = (c, end + c.len_utf8());
        }
        let digits = self.rest().get(..end).unwrap_or("").to_string();
        self.at += end;
        let number = digits.parse().map_err(|_| format!("`{digits}` is no number"))?;
        Ok(Expression::Number(number))
    }

    fn named(&mut self) -> Result<Expression, String> {
        let is_part = |c: &char| c.is_alphanumeric() || *c == '_';
        let name: String = self.rest().chars().take_while(is_part).collect();
        self.at += name.len();
        if self.takes("(") {
            let known = FUNCTIONS.iter().find(|(known, _)| *known == name);
            let Some((_, function)) = known else {
                return Err(format!("`{name}` is no function that this program knows"));
            };
            let inner = self.sum()?;
            let argument = self.closed(inner)?;
            return Ok(Expression::Call(*function, Box::new(argument)));
        }
        if let Some(i) = VARIABLES.iter().position(|variable| *variable == name) {
            return Ok(Expression::Variable(i));
        }
        let number = self.numbers.get(&name).copied();
        number.map(Expression::Number).ok_or_else(|| {
            format!("`{name}` is not known: laws are of x, v and t, and functions like sin(x)")
        })
    }
}

fn single(mut parts: Vec<Expression>, many: fn(Vec<Expression>) -> Expression) -> Expression {
    match parts.len() {
        1 => parts.remove(0),
        _ => many(parts),
    }
}

/// A number to four digits.
pub(crate) fn short(number: f64) -> String {
    let rounded: f64 = format!("{number:.3e}").parse().unwrap_or(number);
    match (1e-4..1e5).contains(&rounded.abs()) || rounded == 0.0 {
        true => format!("{rounded}"),
        false => format!("{rounded:e}"),
    }
}

impl fmt::Display for Expression {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Expression::Number(number) => out.write_str(&short(*number)),
            Expression::Variable(i) => out.write_str(VARIABLES.get(*i).unwrap_or(&"?")),
            Expression::Sum(parts) => {
                out.write_str("(")?;
                for (i, part) in parts.iter().enumerate() {
                    write!(out, "{}{part}", if i > 0 { " + " } else { "" })?;
                }
                out.write_str(")")
            }
            Expression::Product(parts) => {
                let (sign, parts) = match parts.split_first() {
                    Some((Expression::Number(-1.0), rest)) if !rest.is_empty() => ("-", rest),
                    _ => ("", parts.as_slice()),
                };
                out.write_str(sign)?;
                for (i, part) in parts.iter().enumerate() {
                    write!(out, "{}{part}", if i > 0 { "*" } else { "" })?;
                }
                Ok(())
            }
            Expression::Power(base, exponent) if **exponent == Expression::Number(1.0) => {
                write!(out, "{base}")
            }
            Expression::Power(base, exponent) => {
                let tight = matches!(**base, Expression::Variable(_) | Expression::Call(..));
                let sum = matches!(**base, Expression::Sum(_));
                match tight || sum {
                    true => write!(out, "{base}")?,
                    false => write!(out, "({base})")?,
                }
                match exponent.as_ref() {
                    Expression::Number(number) if *number >= 0.0 => write!(out, "^{exponent}"),
                    _ => write!(out, "^({exponent})"),
                }
            }
            Expression::Call(function, argument) => match argument.as_ref() {
                sum @ Expression::Sum(_) => write!(out, "{}{sum}", function.name()),
                other => write!(out, "{}({other})", function.name()),
            },
        }
    }
}
