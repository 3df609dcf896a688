//! The language of the e-graph: exact rationals, and fitted numbers as symbols.

use std::collections::HashMap;
use std::fmt;
use std::str::FromStr;

use egg::{Id, RecExpr, define_language};
use num_rational::Ratio;

use crate::expr::{Delay, Function, Number, Symbol, raise};

/// An exact rational number. Arithmetic that overflows is not done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Rational(pub Ratio<i64>);

impl Rational {
    pub const ZERO: Rational = Rational(Ratio::new_raw(0, 1));
    pub const ONE: Rational = Rational(Ratio::new_raw(1, 1));

    /// numerator / denominator; `None` where the denominator is zero or something overflows.
    pub fn new(numerator: i128, denominator: i128) -> Option<Self> {
        if denominator == 0 {
            return None;
        }
        let ratio = Ratio::new(numerator, denominator);
        let numerator = i64::try_from(*ratio.numer()).ok()?;
        let denominator = i64::try_from(*ratio.denom()).ok()?;
        Some(Rational(Ratio::new_raw(numerator, denominator)))
    }

    fn parts(self) -> (i128, i128) {
        ((*self.0.numer()).into(), (*self.0.denom()).into())
    }

    pub fn plus(self, other: Self) -> Option<Self> {
        let ((a, b), (c, d)) = (self.parts(), other.parts());
        Rational::new(a * d + c * b, b * d)
    }

    pub fn times(self, other: Self) -> Option<Self> {
        let ((a, b), (c, d)) = (self.parts(), other.parts());
        Rational::new(a * c, b * d)
    }

    pub fn negated(self) -> Option<Self> {
        let (a, b) = self.parts();
        Rational::new(-a, b)
    }

    /// self ^ exponent for a small whole exponent; 0 ^ 0 and 0 ^ -1 are left alone.
    pub fn raised(self, exponent: Self) -> Option<Self> {
        let (a, b) = self.parts();
        let power = u32::try_from(exponent.0.numer().unsigned_abs()).ok()?;
        if *exponent.0.denom() != 1 || power > 16 || a == 0 {
            return None;
        }
        let (top, bottom) = (a.checked_pow(power)?, b.checked_pow(power)?);
        if *exponent.0.numer() >= 0 {
            Rational::new(top, bottom)
        } else {
            Rational::new(bottom, top)
        }
    }

    pub fn value(self) -> f64 {
        *self.0.numer() as f64 / *self.0.denom() as f64
    }

    /// The rational of a small denominator that this number is to the last bit.
    pub fn exactly(value: f64) -> Option<Self> {
        (1..=12i32).chain([16, 20, 24, 32, 64]).find_map(|denominator| {
            let numerator = (value * f64::from(denominator)).round();
            let same = numerator.abs() < 1e12 && numerator / f64::from(denominator) == value;
            if same { Rational::new(numerator as i128, denominator.into()) } else { None }
        })
    }
}

impl fmt::Display for Rational {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for Rational {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let (numerator, denominator) = text.split_once('/').unwrap_or((text, "1"));
        let numerator: i64 = numerator.parse().map_err(|_| ())?;
        let denominator: i64 = denominator.parse().map_err(|_| ())?;
        Rational::new(numerator.into(), denominator.into()).ok_or(())
    }
}

/// A positive number that is not merged with others: `#3` is row 3 of the table of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FittedNumber(pub usize);

impl fmt::Display for FittedNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{}", self.0)
    }
}

impl FromStr for FittedNumber {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let digits = text.strip_prefix('#').ok_or(())?;
        digits.parse().map(FittedNumber).map_err(|_| ())
    }
}

/// A coordinate, a momentum or time: `@q0`, `@p0`, `@t`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Variable(pub Symbol);

impl fmt::Display for Variable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Symbol::Coordinate(i) => write!(f, "@q{i}"),
            Symbol::Momentum(i) => write!(f, "@p{i}"),
            Symbol::Velocity(i) => write!(f, "@v{i}"),
            Symbol::Time => write!(f, "@t"),
            Symbol::Input(i, order) => write!(f, "@u{i}.{order}"),
            Symbol::Delayed(i, order, Delay::Number(by)) => {
                write!(f, "@d{i}.{order}.{:x}", by.value().to_bits())
            }
            Symbol::Delayed(i, order, Delay::Parameter(by)) => write!(f, "@e{i}.{order}.{by}"),
            Symbol::Parameter(i) => write!(f, "@a{i}"),
            Symbol::Coefficient(i) => write!(f, "@c{i}"),
        }
    }
}

impl FromStr for Variable {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let name = text.strip_prefix('@').ok_or(())?;
        if name == "t" {
            return Ok(Variable(Symbol::Time));
        }
        if let Some(input) = name.strip_prefix('u') {
            let (index, order) = input.split_once('.').ok_or(())?;
            let number = |text: &str| text.parse().map_err(|_| ());
            return Ok(Variable(Symbol::Input(number(index)?, number(order)?)));
        }
        if let Some(delayed) = name.strip_prefix(['d', 'e']) {
            let (index, rest) = delayed.split_once('.').ok_or(())?;
            let (order, by) = rest.split_once('.').ok_or(())?;
            let number = |text: &str| text.parse().map_err(|_| ());
            let by = if name.starts_with('d') {
                let bits = u64::from_str_radix(by, 16).map_err(|_| ())?;
                Delay::Number(Number::new(f64::from_bits(bits)))
            } else {
                Delay::Parameter(number(by)?)
            };
            return Ok(Variable(Symbol::Delayed(number(index)?, number(order)?, by)));
        }
        let index = name.get(1..).ok_or(())?.parse().map_err(|_| ())?;
        match name.as_bytes().first() {
            Some(b'q') => Ok(Variable(Symbol::Coordinate(index))),
            Some(b'p') => Ok(Variable(Symbol::Momentum(index))),
            Some(b'v') => Ok(Variable(Symbol::Velocity(index))),
            Some(b'a') => Ok(Variable(Symbol::Parameter(index))),
            Some(b'c') => Ok(Variable(Symbol::Coefficient(index))),
            _ => Err(()),
        }
    }
}

/// An elementary function, by its name in the mini-language.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Name(pub Function);

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.row().name)
    }
}

impl FromStr for Name {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        Function::by_name(text).map(Name).ok_or(())
    }
}

define_language! {
    /// Expressions of the e-graph; `x - y` is `x + (- y)`, `x / y` is `x * y^-1`.
    pub enum Math {
        "pi" = Pi,
        "+" = Add([Id; 2]),
        "*" = Multiply([Id; 2]),
        "-" = Negate([Id; 1]),
        "^" = Raise([Id; 2]),
        Rational(Rational),
        Fitted(FittedNumber),
        Variable(Variable),
        Apply(Name, [Id; 1]),
    }
}

/// The value of an expression; NaN for what has no value.
pub(super) fn evaluate(
    expr: &RecExpr<Math>,
    fitted: &dyn Fn(usize) -> f64,
    variable: &dyn Fn(Symbol) -> f64,
) -> f64 {
    let mut values: HashMap<Id, f64> = HashMap::with_capacity(expr.len());
    let mut last = f64::NAN;
    for (id, node) in expr.items() {
        let of = |id: &Id| values.get(id).copied().unwrap_or(f64::NAN);
        last = match node {
            Math::Pi => std::f64::consts::PI,
            Math::Add([a, b]) => of(a) + of(b),
            Math::Multiply([a, b]) => of(a) * of(b),
            Math::Negate([a]) => -of(a),
            Math::Raise([a, b]) => raise(of(a), of(b)),
            Math::Rational(rational) => rational.value(),
            Math::Fitted(number) => fitted(number.0),
            Math::Variable(name) => variable(name.0),
            Math::Apply(name, [a]) => (name.0.row().value)(of(a)),
        };
        values.insert(id, last);
    }
    last
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rationals_fold_exactly_or_not_at_all() {
        let r = |a, b| Rational::new(a, b);
        let half = r(1, 2).unwrap_or(Rational::ONE);
        let third = r(-1, 3).unwrap_or(Rational::ONE);
        assert_eq!(half.plus(third), r(1, 6));
        assert_eq!(half.times(third), r(-1, 6));
        assert_eq!(half.raised(Rational(Ratio::from(-3))), r(8, 1));
        assert_eq!(Rational::ZERO.raised(Rational(Ratio::from(-1))), None);
        assert_eq!(half.raised(half), None);
        let huge = Rational(Ratio::from(i64::MAX));
        assert_eq!(huge.plus(huge), None);
        assert_eq!(huge.times(huge), None);
        assert_eq!(Rational(Ratio::from(i64::MIN)).negated(), None);
        assert_eq!(Rational::exactly(1.0 / 3.0), r(1, 3));
        assert_eq!(Rational::exactly(0.333), None);
    }

    #[test]
    fn leaves_read_back() {
        for text in ["(+ (* #3 (^ @q0 2)) (- (sin (+ @p1 (* 1/2 pi)))))", "(abs @t)"] {
            let expr: RecExpr<Math> = text.parse().unwrap_or_default();
            assert_eq!(expr.to_string(), text);
        }
    }
}
