//! What the e-graph knows about the value of each class: the rational that it is, and its sign.

use egg::{Analysis, DidMerge, EGraph, Id, Language};

use super::lang::{Math, Rational};
use crate::expr::{Function, SignRule};

/// What is certain about the sign of a value, wherever it is defined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Sign {
    #[default]
    Unknown,
    NonNegative,
    Positive,
}

/// What is known of a class.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ClassData {
    pub rational: Option<Rational>,
    pub sign: Sign,
    /// Whether no variable stands in it.
    pub number: bool,
}

/// Folds rationals and keeps signs.
#[derive(Debug, Clone, Copy, Default)]
pub struct Folding;

fn sign_of(rational: Rational) -> Sign {
    match rational.value() {
        v if v > 0.0 => Sign::Positive,
        0.0 => Sign::NonNegative,
        _ => Sign::Unknown,
    }
}

/// function(argument), where the function's row says that it is exact.
fn exact(function: Function, argument: Rational) -> Option<Rational> {
    let whole = argument.0.is_integer().then(|| *argument.0.numer())?;
    let row = function.row().exact.iter().find(|(argument, _)| *argument == whole)?;
    Rational::new(row.1.into(), 1)
}

impl Analysis<Math> for Folding {
    type Data = ClassData;

    fn make(egraph: &mut EGraph<Math, Self>, node: &Math, _: Id) -> ClassData {
        let of = |id: &Id| egraph[*id].data;
        let rational = match node {
            Math::Rational(rational) => Some(*rational),
            Math::Add([a, b]) => of(a).rational.zip(of(b).rational).and_then(|(a, b)| a.plus(b)),
            Math::Multiply([a, b]) => {
                of(a).rational.zip(of(b).rational).and_then(|(a, b)| a.times(b))
            }
            Math::Negate([a]) => of(a).rational.and_then(Rational::negated),
            Math::Raise([a, b]) => {
                of(a).rational.zip(of(b).rational).and_then(|(a, b)| a.raised(b))
            }
            Math::Apply(name, [a]) => of(a).rational.and_then(|a| exact(name.0, a)),
            _ => None,
        };
        if let Some(rational) = rational {
            return ClassData { rational: Some(rational), sign: sign_of(rational), number: true };
        }
        let sign = match node {
            Math::Pi | Math::Fitted(_) => Sign::Positive,
            Math::Add([a, b]) => match (of(a).sign, of(b).sign) {
                (Sign::Unknown, _) | (_, Sign::Unknown) => Sign::Unknown,
                (a, b) => a.max(b),
            },
            Math::Multiply([a, b]) => of(a).sign.min(of(b).sign),
            Math::Raise([base, exponent]) => match (of(base).sign, of(exponent).rational) {
                (Sign::Positive, _) => Sign::Positive,
                (_, Some(e)) if e.0.is_integer() && e.0.numer() % 2 == 0 => Sign::NonNegative,
                (sign, _) => sign,
            },
            Math::Apply(name, [a]) => match name.0.row().sign {
                SignRule::Positive => Sign::Positive,
                SignRule::NonNegative => of(a).sign.max(Sign::NonNegative),
                SignRule::OfArgument => of(a).sign,
                SignRule::Unknown => Sign::Unknown,
            },
            _ => Sign::Unknown,
        };
        let number = match node {
            Math::Variable(_) => false,
            _ => node.all(|child| egraph[child].data.number),
        };
        ClassData { rational: None, sign, number }
    }

    fn merge(&mut self, a: &mut ClassData, b: ClassData) -> DidMerge {
        let before = *a;
        a.rational = a.rational.or(b.rational);
        a.sign = a.sign.max(b.sign);
        a.number |= b.number;
        DidMerge(*a != before, *a != b)
    }

    fn modify(egraph: &mut EGraph<Math, Self>, id: Id) {
        if let Some(rational) = egraph[id].data.rational {
            let folded = egraph.add(Math::Rational(rational));
            egraph.union(id, folded);
            // Other ways to write a rational help nobody, and those of zero grow without end:
            // 0 = 0 x = 0 (x + y) = ...
            egraph[id].nodes.retain(Language::is_leaf);
        }
    }
}
