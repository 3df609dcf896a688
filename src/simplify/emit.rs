//! From the language of the e-graph back to a graph, with a table of the numbers in it.

use std::collections::HashMap;

use egg::{Id, RecExpr};

use super::DerivedNumber;
use super::lang::{Math, Rational};
use super::numbers::Numbers;
use super::snap::NiceNumber;
use crate::expr::{Expr, Graph, Symbol};

/// What two numbers must share to be one row of the table.
#[derive(PartialEq, Eq, Hash, Clone, Copy)]
enum Key {
    /// Row of the numbers of one part.
    Row(usize, usize),
    NiceNumber(NiceNumber),
}

/// Where a sum or term stands in print.
type Rank = (bool, f64, Vec<Symbol>);

/// Collects the numbers of all parts, then builds their expressions.
#[derive(Default)]
pub(super) struct Emitter {
    pub numbers: Vec<DerivedNumber>,
    index: HashMap<Key, usize>,
    /// Numbers that multiply something; the others are offsets and print after variables.
    multiplies: Vec<bool>,
}

/// A product taken apart: its sign, its rational factor and power of pi, the rest.
struct Factors {
    negative: bool,
    number: Option<NiceNumber>,
    rest: Vec<Id>,
}

fn factors(expr: &RecExpr<Math>, id: Id) -> Factors {
    let mut out = Factors { negative: false, number: None, rest: Vec::new() };
    let mut rational = Rational::ONE;
    let mut pi = false;
    let mut stack = vec![id];
    while let Some(id) = stack.pop() {
        match &expr[id] {
            Math::Multiply([a, b]) => stack.extend([*b, *a]),
            Math::Negate([a]) => {
                out.negative = !out.negative;
                stack.push(*a);
            }
            Math::Rational(value) => match rational.times(*value) {
                Some(product) => rational = product,
                None => out.rest.push(id),
            },
            Math::Pi if !pi => pi = true,
            _ => out.rest.push(id),
        }
    }
    if rational.value() < 0.0
        && let Some(positive) = rational.negated()
    {
        out.negative = !out.negative;
        rational = positive;
    }
    if rational != Rational::ONE || pi || out.rest.is_empty() {
        out.number = Some(NiceNumber::of(rational, pi));
    }
    out
}

/// A sum taken apart, signs in front: (negative, term).
fn addends(expr: &RecExpr<Math>, id: Id) -> Vec<(bool, Id)> {
    let mut out = Vec::new();
    let mut stack = vec![(false, id)];
    while let Some((negative, id)) = stack.pop() {
        match &expr[id] {
            Math::Add([a, b]) => stack.extend([(negative, *b), (negative, *a)]),
            Math::Negate([a]) => stack.push((!negative, *a)),
            _ => out.push((negative, id)),
        }
    }
    out
}

fn rank(expr: &RecExpr<Math>, id: Id) -> Rank {
    match &expr[id] {
        Math::Variable(variable) => (false, 1.0, vec![variable.0]),
        Math::Pi | Math::Rational(_) | Math::Fitted(_) => (false, 0.0, Vec::new()),
        Math::Negate([a]) => rank(expr, *a),
        Math::Add([a, b]) => {
            let (a, b) = (rank(expr, *a), rank(expr, *b));
            // Both parts of a difference name it: q1, then q1 and q2, then q2.
            let mut letters = [a.2, b.2].concat();
            letters.sort();
            (a.0 || b.0, a.1.max(b.1), letters)
        }
        Math::Multiply([a, b]) => {
            let (a, b) = (rank(expr, *a), rank(expr, *b));
            let mut letters = [a.2, b.2].concat();
            letters.sort();
            (a.0 || b.0, a.1 + b.1, letters)
        }
        Math::Raise([base, exponent]) => {
            let (special, degree, letters) = rank(expr, *base);
            match &expr[*exponent] {
                Math::Rational(e) if e.value() >= 1.0 && e.value() <= 64.0 => {
                    let times = if letters.len() == 1 { e.value() as usize } else { 1 };
                    (special, degree * e.value(), letters.repeat(times))
                }
                _ => (true, degree, letters),
            }
        }
        Math::Apply(_, [a]) => {
            let (_, _, letters) = rank(expr, *a);
            (true, 0.0, letters)
        }
    }
}

/// Terms in the order of print; a constant comes last.
fn ordered(expr: &RecExpr<Math>, id: Id) -> Vec<(bool, Id)> {
    let mut terms: Vec<(Rank, (bool, Id))> =
        addends(expr, id).into_iter().map(|term| (rank(expr, term.1), term)).collect();
    terms.sort_by(|(a, _), (b, _)| {
        let constant = |r: &Rank| r.2.is_empty();
        constant(a)
            .cmp(&constant(b))
            .then(a.0.cmp(&b.0))
            .then(a.1.total_cmp(&b.1))
            .then_with(|| a.2.cmp(&b.2))
    });
    terms.into_iter().map(|(_, term)| term).collect()
}

impl Emitter {
    /// Enters the numbers of part `part` into the table, in the order of print.
    pub(super) fn collect(&mut self, expr: &RecExpr<Math>, numbers: &Numbers, part: usize) {
        if !expr.is_empty() {
            self.collect_sum(expr, expr.root(), numbers, part);
        }
    }

    fn collect_sum(&mut self, expr: &RecExpr<Math>, id: Id, numbers: &Numbers, part: usize) {
        for (_, term) in ordered(expr, id) {
            let found = factors(expr, term);
            let lonely = found.rest.len() + usize::from(found.number.is_some()) == 1;
            if let Some(nice) = found.number {
                self.enter(Key::NiceNumber(nice), numbers, !lonely);
            }
            for factor in found.rest {
                self.collect_factor(expr, factor, numbers, part, !lonely);
            }
        }
    }

    fn collect_factor(
        &mut self,
        expr: &RecExpr<Math>,
        id: Id,
        numbers: &Numbers,
        part: usize,
        multiplies: bool,
    ) {
        match &expr[id] {
            Math::Fitted(row) => self.enter(Key::Row(part, row.0), numbers, multiplies),
            Math::Raise([base, exponent]) => {
                self.collect_sum(expr, *base, numbers, part);
                if !matches!(expr[*exponent], Math::Rational(_)) {
                    self.collect_sum(expr, *exponent, numbers, part);
                }
            }
            Math::Apply(_, [argument]) => self.collect_sum(expr, *argument, numbers, part),
            Math::Add(_) => self.collect_sum(expr, id, numbers, part),
            _ => {}
        }
    }

    fn enter(&mut self, key: Key, numbers: &Numbers, multiplies: bool) {
        if let Some(&number) = self.index.get(&key) {
            self.multiplies[number] |= multiplies;
            return;
        }
        let number = match key {
            Key::NiceNumber(nice) => {
                DerivedNumber { value: nice.value(), standard_error: 0.0, snapped: Some(nice) }
            }
            Key::Row(_, row) => {
                let shown = &numbers.rows[row].shown;
                let standard_error = numbers.error(shown);
                DerivedNumber { value: shown.value, standard_error, snapped: None }
            }
        };
        self.index.insert(key, self.numbers.len());
        self.numbers.push(number);
        self.multiplies.push(multiplies);
    }

    /// Fixes the order of print: numbers in front, then the state, then offsets.
    pub(super) fn prepare(&self, graph: &mut Graph, degrees: usize) {
        for (number, multiplies) in self.multiplies.iter().enumerate() {
            if *multiplies {
                graph.symbol(Symbol::Coefficient(number));
            }
        }
        for i in 0..degrees {
            graph.symbol(Symbol::Coordinate(i));
        }
        for i in 0..degrees {
            graph.symbol(Symbol::Momentum(i));
        }
        graph.symbol(Symbol::Time);
    }

    /// The expression of part `part`, numbers as `Symbol::Coefficient`.
    pub(super) fn build(&self, graph: &mut Graph, expr: &RecExpr<Math>, part: usize) -> Expr {
        if expr.is_empty() {
            return graph.number(0.0);
        }
        self.build_sum(graph, expr, expr.root(), part)
    }

    fn build_sum(&self, graph: &mut Graph, expr: &RecExpr<Math>, id: Id, part: usize) -> Expr {
        let mut parts = Vec::new();
        for (negative, term) in ordered(expr, id) {
            let (minus, product) = self.build_product(graph, expr, term, part);
            parts.push((if negative ^ minus { -1.0 } else { 1.0 }, product));
        }
        graph.linear(0.0, &parts)
    }

    fn build_product(
        &self,
        graph: &mut Graph,
        expr: &RecExpr<Math>,
        id: Id,
        part: usize,
    ) -> (bool, Expr) {
        let found = factors(expr, id);
        let mut list = Vec::new();
        let mut factor = 1.0;
        match found.number {
            // Zero and one need no row of the table.
            Some(nice) if !nice.pi && (nice.numerator == 0 || nice.value() == 1.0) => {
                factor = nice.value();
            }
            Some(nice) => list.push((self.placeholder(graph, Key::NiceNumber(nice)), 1.0)),
            None => {}
        }
        let mut rest = found.rest;
        rest.sort_by(|&a, &b| {
            let (a, b) = (rank(expr, a), rank(expr, b));
            a.0.cmp(&b.0).then_with(|| a.2.cmp(&b.2))
        });
        for id in rest {
            let (base, exponent) = match &expr[id] {
                Math::Raise([base, exponent]) => {
                    let inner = self.build_sum(graph, expr, *base, part);
                    match &expr[*exponent] {
                        Math::Rational(e) => (inner, e.value()),
                        _ => {
                            let exponent = self.build_sum(graph, expr, *exponent, part);
                            (graph.power_of(inner, exponent), 1.0)
                        }
                    }
                }
                Math::Apply(name, [argument]) => {
                    let argument = self.build_sum(graph, expr, *argument, part);
                    (graph.apply(name.0, argument), 1.0)
                }
                Math::Add(_) => (self.build_sum(graph, expr, id, part), 1.0),
                Math::Fitted(row) => (self.placeholder(graph, Key::Row(part, row.0)), 1.0),
                Math::Variable(variable) => (graph.symbol(variable.0), 1.0),
                Math::Rational(value) => (graph.number(value.value()), 1.0),
                Math::Pi | Math::Multiply(_) | Math::Negate(_) => {
                    (graph.number(std::f64::consts::PI), 1.0)
                }
            };
            list.push((base, exponent));
        }
        (found.negative, graph.product(factor, &list))
    }

    fn placeholder(&self, graph: &mut Graph, key: Key) -> Expr {
        match self.index.get(&key) {
            Some(&number) => graph.symbol(Symbol::Coefficient(number)),
            None => graph.number(f64::NAN),
        }
    }
}
