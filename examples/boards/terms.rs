//! Whether two laws have the same additive terms: both are expanded, each term is a coefficient
//! times a shape, and shapes are compared by their values at random points.

use std::collections::HashMap;

use leverrier::Law;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::expression::{Expression, Function, short};

/// Points at which shapes are compared: x and v between -3 and 3, where functions that look alike
/// on the data do not, and t between 0 and 6, about a turn of the drive.
const POINTS: usize = 300;
const REACH: f64 = 3.0;
const TURN: f64 = 6.0;

/// Shapes are one where they are proportional to so much: what rounding leaves of them.
const SAME: f64 = 1e-6;

/// A shape with fitted numbers in it is that of the truth where, scaled to it, it is off by no
/// more than this part of its size: a few per cent.
const NEAR: f64 = 0.05;

/// What cancels to less than this part of what was added is nothing.
const NOTHING: f64 = 1e-4;

/// Additive terms of a law: more are refused.
const MOST: usize = 200;

/// An additive term.
#[derive(Debug, Clone)]
pub(crate) struct Term {
    /// In parts of the size of the shape at the points.
    coefficient: f64,
    shape: Expression,
    /// The shape at the points, its root mean square 1, its first value that counts positive.
    values: Vec<f64>,
    /// What was added up to the coefficient, without signs.
    added: f64,
}

/// What two laws have in common.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Comparison {
    /// Terms of the truth that the law has not, as text.
    pub missing: Vec<String>,
    /// How many of these are in one of the forms that are named as explaining as much.
    pub named: usize,
    /// Terms of the law that the truth has not.
    pub beside: Vec<String>,
}

fn points() -> Vec<[f64; 3]> {
    let mut generator = Pcg64::seed_from_u64(1846);
    let mut point = || {
        let x = generator.random_range(-REACH..REACH);
        let v = generator.random_range(-REACH..REACH);
        [x, v, generator.random_range(0.0..TURN)]
    };
    (0..POINTS).map(|_| point()).collect()
}

/// An acceleration as its additive terms; those of one shape are one.
///
/// # Errors
/// It has too many, or is not finite where shapes are compared.
pub(crate) fn terms(acceleration: &Expression) -> Result<Vec<Term>, String> {
    let points = points();
    let mut found: Vec<Term> = Vec::new();
    for (factor, factors) in expanded(acceleration)? {
        let shape = Expression::Product(factors);
        let values: Vec<f64> = points.iter().map(|point| shape.value(point)).collect();
        let size = (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt();
        if size == 0.0 || factor == 0.0 {
            continue;
        }
        if !size.is_finite() {
            return Err(format!("`{shape}` is not finite everywhere: it cannot be compared"));
        }
        // The sign of the first value that is not nearly nothing.
        let first = values.iter().find(|x| x.abs() > 0.1 * size).copied().unwrap_or(1.0);
        let unit = size * first.signum();
        let values: Vec<f64> = values.iter().map(|x| x / unit).collect();
        let coefficient = factor * unit;
        let term = Term { coefficient, shape, values, added: coefficient.abs() };
        match found.iter_mut().find(|other| distance(&other.values, &term.values) < SAME) {
            Some(other) => {
                other.coefficient += coefficient;
                other.added += term.added;
            }
            None => found.push(term),
        }
    }
    found.retain(|term| term.coefficient.abs() > NOTHING * term.added);
    Ok(found)
}

/// Root mean square distance of two shapes of size 1.
fn distance(first: &[f64], second: &[f64]) -> f64 {
    let squares: f64 = first.iter().zip(second).map(|(a, b)| (a - b).powi(2)).sum();
    (squares / first.len() as f64).sqrt()
}

type Expanded = Vec<(f64, Vec<Expression>)>;

/// A sum of products: the number before each, and its other factors.
fn expanded(expression: &Expression) -> Result<Expanded, String> {
    let out = match expression {
        Expression::Number(number) => vec![(*number, Vec::new())],
        Expression::Sum(parts) => {
            let mut all = Vec::new();
            for part in parts {
                all.extend(expanded(part)?);
            }
            all
        }
        Expression::Product(parts) => {
            let mut all = vec![(1.0, Vec::new())];
            for part in parts {
                all = multiplied(&all, &expanded(part)?)?;
            }
            all
        }
        Expression::Power(base, exponent) => match exponent.as_ref() {
            Expression::Number(n) if n.fract() == 0.0 && (1.0..=6.0).contains(n) => {
                let one = expanded(base)?;
                match one.as_slice() {
                    [(number, factors)] if *number == 1.0 && factors.len() == 1 => {
                        vec![(1.0, vec![expression.clone()])]
                    }
                    _ => {
                        let mut all = vec![(1.0, Vec::new())];
                        for _ in 0..*n as usize {
                            all = multiplied(&all, &one)?;
                        }
                        all
                    }
                }
            }
            _ => vec![(1.0, vec![expression.clone()])],
        },
        other => vec![(1.0, vec![other.clone()])],
    };
    match out.len() > MOST {
        true => Err(format!("a law has more than {MOST} additive terms: too many to compare")),
        false => Ok(out),
    }
}

fn multiplied(first: &Expanded, second: &Expanded) -> Result<Expanded, String> {
    if first.len() * second.len() > MOST {
        return Err(format!("a law has more than {MOST} additive terms: too many to compare"));
    }
    let mut out = Vec::new();
    for (a, of_first) in first {
        for (b, of_second) in second {
            out.push((a * b, of_first.iter().chain(of_second).cloned().collect()));
        }
    }
    Ok(out)
}

/// A wave in time: its place among the factors, and its argument.
fn wave(shape: &Expression) -> Option<(usize, Expression)> {
    let Expression::Product(factors) = shape else { return None };
    factors.iter().enumerate().find_map(|(place, factor)| match factor {
        Expression::Call(Function::Sin | Function::Cos, argument)
            if argument.depends(2) && !argument.depends(0) && !argument.depends(1) =>
        {
            Some((place, (**argument).clone()))
        }
        _ => None,
    })
}

/// Sine and cosine of one frequency are one wave, whose phase is a fitted number.
fn with_phases(terms: Vec<Term>) -> Result<Vec<Term>, String> {
    let points = points();
    let others = |term: &Term, place: usize| -> Vec<f64> {
        let Expression::Product(factors) = &term.shape else { return Vec::new() };
        let mut rest = factors.clone();
        rest.remove(place);
        let rest = Expression::Product(rest);
        points.iter().map(|point| rest.value(point)).collect()
    };
    let mut out: Vec<Term> = Vec::new();
    for term in terms {
        let joined = wave(&term.shape).and_then(|(place, argument)| {
            out.iter().position(|other| {
                wave(&other.shape).is_some_and(|(at, wave)| {
                    wave == argument && others(other, at) == others(&term, place)
                })
            })
        });
        let Some(at) = joined else {
            out.push(term);
            continue;
        };
        let part = |term: &Term| {
            let size = term.coefficient * unit_of(term, &points);
            Expression::Product(vec![Expression::Number(size), term.shape.clone()])
        };
        let both = Expression::Sum(vec![part(&out[at]), part(&term)]);
        let values: Vec<f64> = points.iter().map(|point| both.value(point)).collect();
        let size = (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt();
        if size > 0.0 {
            let values = values.iter().map(|x| x / size).collect();
            let shape = Expression::Product(vec![both]);
            out[at] = Term { coefficient: size, shape, values, added: size };
        }
    }
    Ok(out)
}

/// The factor between a shape and its values.
fn unit_of(term: &Term, points: &[[f64; 3]]) -> f64 {
    let all = points.iter().zip(&term.values);
    let (mut over, mut under) = (0.0, 0.0);
    for (point, value) in all {
        let plain = term.shape.value(point);
        over += plain * value;
        under += plain * plain;
    }
    if under > 0.0 { over / under } else { 0.0 }
}

/// Functions in a shape, in order; what is one up to a phase, a sign or a way of writing is one.
fn functions(shape: &Expression) -> Vec<&'static str> {
    let mut out = Vec::new();
    shape.any(&mut |part| {
        match part {
            Expression::Call(Function::Sin | Function::Cos, _) => out.push("wave"),
            Expression::Call(Function::Sqrt, _) => out.push("power"),
            Expression::Call(Function::Abs | Function::Sign, _) => {}
            Expression::Call(Function::Log, _) => out.push("log"),
            Expression::Call(Function::Exp, _) => out.push("exp"),
            Expression::Call(..) => out.push("other"),
            Expression::Power(_, exponent) => match exponent.as_ref() {
                Expression::Number(n) if n.fract() == 0.0 && *n > 0.0 => {}
                _ => out.push("power"),
            },
            _ => {}
        }
        false
    });
    out.sort_unstable();
    out.dedup();
    out
}

/// Whether a number stands in a shape that was not written as a whole one.
fn has_numbers(shape: &Expression) -> bool {
    shape.any(&mut |part| matches!(part, Expression::Number(n) if n.fract() != 0.0))
}

/// How far a term of a law is from one of the truth; none where they are not the same.
fn apart(truth: &Term, law: &Term) -> Option<f64> {
    let plus = distance(&truth.values, &law.values);
    let minus: Vec<f64> = law.values.iter().map(|x| -x).collect();
    let apart = plus.min(distance(&truth.values, &minus));
    let alike = || has_numbers(&law.shape) && functions(&truth.shape) == functions(&law.shape);
    (apart < SAME || apart < NEAR && alike()).then_some(apart)
}

/// Compares the terms of a law with those of the truth: each of either has its one of the other.
/// `forms` are terms of what is named as explaining as much as members of the law.
///
/// # Errors
/// As for [`terms`].
pub(crate) fn compared(truth: &[Term], law: &[Term], forms: &[Term]) -> Result<Comparison, String> {
    let (truth, mut rest) = (with_phases(truth.to_vec())?, with_phases(law.to_vec())?);
    let mut missing = Vec::new();
    let mut named = 0;
    for term in &truth {
        let near = rest.iter().enumerate().filter_map(|(i, law)| Some((i, apart(term, law)?)));
        match near.min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((i, _)) => drop(rest.remove(i)),
            None => {
                named += usize::from(forms.iter().any(|form| apart(term, form).is_some()));
                missing.push(text(term));
            }
        }
    }
    Ok(Comparison { missing, named, beside: rest.iter().map(text).collect() })
}

/// A term with its number.
fn text(term: &Term) -> String {
    let size = term.coefficient * unit_of(term, &points());
    let shape = term.shape.to_string();
    match shape.is_empty() {
        true => short(size),
        false => format!("{} {shape}", short(size)),
    }
}

/// The acceleration of a law with T = v^2/2 in which `known` is known of V: its terms, and those
/// of its members that no acceleration of x and v has.
pub(crate) struct Learned {
    pub acceleration: Expression,
    pub strange: Vec<String>,
}

/// What a law learned, and what it knew, as an acceleration.
pub(crate) fn learned(law: &Law, known: Option<&Expression>) -> Learned {
    let pairs = law.parameters().iter().map(|one| (one.name.clone(), one.value));
    let numbers: HashMap<String, f64> = pairs.collect();
    let mut parts = Vec::new();
    let mut strange = Vec::new();
    let minus =
        |c: f64, part: Expression| Expression::Product(vec![Expression::Number(-c), part.by_x()]);
    parts.extend(known.map(|potential| minus(1.0, potential.clone())));
    for term in law.terms() {
        let c = term.coefficient;
        let read = Expression::parse(&term.term, &numbers);
        match (term.place.as_str(), read) {
            // A potential that depends on v moves x besides.
            ("V" | "H", Ok(read)) if !read.depends(1) => parts.push(minus(c, read)),
            ("force x", Ok(read)) => {
                parts.push(Expression::Product(vec![Expression::Number(c), read]));
            }
            _ => strange.push(format!("{} {}: {}", short(c), term.place, term.term)),
        }
    }
    Learned { acceleration: Expression::Sum(parts), strange }
}

/// The acceleration that an addition of the program brings, as its label says it; none of one that
/// says no expression.
pub(crate) fn form(label: &str) -> Option<Expression> {
    let read = |text: &str| Expression::parse(text, &HashMap::new()).ok();
    match (label.strip_prefix("force on x: "), label.strip_prefix("V ")) {
        (Some(force), _) => read(force),
        (None, Some(potential)) => read(potential).filter(|of| !of.depends(1)).map(|of| of.by_x()),
        _ => match label {
            "viscous_drag(x)" => read("v"),
            "cubic_drag(x)" => read("v^3"),
            _ => None,
        },
    }
}

/// Compares a law with the truth. `forms` are named as explaining as much as members of the law.
///
/// # Errors
/// As for [`terms`].
pub(crate) fn judged(
    truth: &Expression,
    law: &Learned,
    forms: &[Expression],
) -> Result<Comparison, String> {
    let forms: Vec<Term> = forms.iter().filter_map(|form| terms(form).ok()).flatten().collect();
    let mut found = compared(&terms(truth)?, &terms(&law.acceleration)?, &forms)?;
    found.beside.extend(law.strange.iter().cloned());
    Ok(found)
}
