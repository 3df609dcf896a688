//! The normal form: a polynomial over atoms, with quantities as coefficients.
//!
//! Sums and products are flattened, expanded and collected here, so that the
//! e-graph never has to search through the orders of a long sum.

use std::collections::{BTreeMap, HashMap};

use super::quantity::Quantity;
use crate::expr::{Expr, Function, Graph, Node, Number, Symbol};

/// A product of atoms with exponents, sorted by atom.
pub(super) type Monomial = Vec<(usize, Number)>;

/// A sum of monomials. The empty monomial carries the constant.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Polynomial(pub BTreeMap<Monomial, Quantity>);

/// What the normal form does not look into.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Atom {
    Symbol(Symbol),
    Apply(Function, Polynomial),
    /// A sum that stands under an exponent and is not expanded.
    Sum(Polynomial),
    /// base ^ exponent with an exponent that is not a number.
    Power(Polynomial, Polynomial),
}

/// Numbers bit by bit: equal keys, equal atoms.
type Key = Vec<(Monomial, u64)>;

#[derive(PartialEq, Eq, Hash)]
enum AtomKey {
    Symbol(Symbol),
    Apply(Function, Key),
    Sum(Key),
    Power(Key, Key),
}

/// Every atom of a model, each once; a monomial names them by index.
#[derive(Default)]
pub(super) struct Atoms {
    /// Whether products and powers of sums are multiplied out.
    expands: bool,
    list: Vec<Atom>,
    index: HashMap<AtomKey, usize>,
}

/// Larger products of sums are left as they are.
const LARGEST_EXPANSION: usize = 400;
/// Higher powers of sums are left as they are: expanded, they only grow and cancel.
const HIGHEST_EXPANSION: f64 = 4.0;

impl Polynomial {
    pub(super) fn constant(value: Quantity) -> Self {
        let mut out = Polynomial::default();
        out.add_term(Vec::new(), &value);
        out
    }

    pub(super) fn add_term(&mut self, monomial: Monomial, quantity: &Quantity) {
        let entry = self.0.entry(monomial).or_default();
        *entry = entry.plus(quantity);
        if entry.value == 0.0 && entry.is_known() {
            self.0.retain(|_, q| q.value != 0.0 || !q.is_known());
        }
    }

    pub(super) fn add_scaled(&mut self, other: &Polynomial, factor: &Quantity) {
        for (monomial, quantity) in &other.0 {
            self.add_term(monomial.clone(), &quantity.times(factor));
        }
    }

    fn times(&self, other: &Polynomial) -> Polynomial {
        let mut out = Polynomial::default();
        for (a, x) in &self.0 {
            for (b, y) in &other.0 {
                out.add_term(multiply(a, b), &x.times(y));
            }
        }
        out
    }

    /// The only term, where there is one.
    fn single(&self) -> Option<(&Monomial, &Quantity)> {
        match self.0.len() {
            1 => self.0.iter().next(),
            _ => None,
        }
    }

    /// The value, where nothing but a constant is left.
    pub(super) fn as_constant(&self) -> Option<Quantity> {
        match self.single() {
            None if self.0.is_empty() => Some(Quantity::known(0.0)),
            Some((monomial, quantity)) if monomial.is_empty() => Some(quantity.clone()),
            _ => None,
        }
    }

    fn key(&self) -> Key {
        self.0.iter().map(|(m, q)| (m.clone(), q.value.to_bits())).collect()
    }
}

/// The product of two monomials.
fn multiply(a: &Monomial, b: &Monomial) -> Monomial {
    let mut powers: BTreeMap<usize, f64> = a.iter().map(|&(i, e)| (i, e.value())).collect();
    for &(atom, exponent) in b {
        *powers.entry(atom).or_insert(0.0) += exponent.value();
    }
    powers.retain(|_, e| *e != 0.0);
    powers.into_iter().map(|(i, e)| (i, Number::new(e))).collect()
}

impl Atoms {
    /// Atoms in the order of print: the state, then time.
    pub(super) fn new(degrees: usize, expands: bool) -> Self {
        let mut atoms = Atoms { expands, ..Atoms::default() };
        for i in 0..degrees {
            atoms.of(Atom::Symbol(Symbol::Coordinate(i)));
        }
        for i in 0..degrees {
            atoms.of(Atom::Symbol(Symbol::Momentum(i)));
        }
        atoms.of(Atom::Symbol(Symbol::Time));
        atoms
    }

    pub(super) fn get(&self, atom: usize) -> &Atom {
        &self.list[atom]
    }

    /// The coordinate that an atom is.
    pub(super) fn coordinate(&self, atom: usize) -> Option<usize> {
        match self.list[atom] {
            Atom::Symbol(Symbol::Coordinate(i)) => Some(i),
            _ => None,
        }
    }

    pub(super) fn of(&mut self, atom: Atom) -> usize {
        let key = match &atom {
            Atom::Symbol(symbol) => AtomKey::Symbol(*symbol),
            Atom::Apply(function, argument) => AtomKey::Apply(*function, argument.key()),
            Atom::Sum(sum) => AtomKey::Sum(sum.key()),
            Atom::Power(base, exponent) => AtomKey::Power(base.key(), exponent.key()),
        };
        let list = &mut self.list;
        *self.index.entry(key).or_insert_with(|| {
            list.push(atom);
            list.len() - 1
        })
    }

    /// The atom itself, as a polynomial.
    pub(super) fn alone(&mut self, atom: Atom) -> Polynomial {
        let monomial = vec![(self.of(atom), Number::new(1.0))];
        let mut out = Polynomial::default();
        out.add_term(monomial, &Quantity::known(1.0));
        out
    }

    /// The normal form of an expression; `number` gives symbols that stand for numbers their value.
    pub(super) fn expand(
        &mut self,
        graph: &Graph,
        expr: Expr,
        number: &dyn Fn(Symbol) -> Option<Quantity>,
        known: &mut HashMap<Expr, Polynomial>,
    ) -> Polynomial {
        for part in graph.topological(&[expr]) {
            if known.contains_key(&part) {
                continue;
            }
            let form = match graph.node(part) {
                Node::Number(value) => Polynomial::constant(Quantity::known(value.value())),
                Node::Symbol(symbol) => match number(*symbol) {
                    Some(value) => Polynomial::constant(value),
                    None => self.alone(Atom::Symbol(*symbol)),
                },
                Node::Sum { constant, terms } => {
                    let mut sum = Polynomial::constant(Quantity::known(constant.value()));
                    for (term, factor) in terms.iter() {
                        sum.add_scaled(&known[term], &Quantity::known(factor.value()));
                    }
                    sum
                }
                Node::Product(parts) => {
                    let mut product = Polynomial::constant(Quantity::known(1.0));
                    for (base, exponent) in parts.iter() {
                        let power = self.power(&known[base], exponent.value());
                        product = self.product(product, power);
                    }
                    product
                }
                Node::Power(base, exponent) => match known[exponent].as_constant() {
                    Some(e) if e.is_known() => self.power(&known[base], e.value),
                    _ => {
                        let atom = Atom::Power(known[base].clone(), known[exponent].clone());
                        self.alone(atom)
                    }
                },
                Node::Apply(function, argument) => self.apply(*function, &known[argument]),
            };
            known.insert(part, form);
        }
        known[&expr].clone()
    }

    fn apply(&mut self, function: Function, argument: &Polynomial) -> Polynomial {
        if let Some(x) = argument.as_constant() {
            let value = (function.row().value)(x.value);
            let mut graph = Graph::new();
            let inner = graph.symbol(Symbol::Time);
            let slope = (function.row().derivative)(&mut graph, inner);
            let slope = graph.value(slope, &|_| x.value);
            if value.is_finite() && slope.is_finite() {
                return Polynomial::constant(x.mapped(value, slope));
            }
        }
        self.alone(Atom::Apply(function, argument.clone()))
    }

    fn product(&mut self, a: Polynomial, b: Polynomial) -> Polynomial {
        let small = a.0.len() * b.0.len() <= LARGEST_EXPANSION;
        let plain = a.0.len() <= 1 || b.0.len() <= 1;
        let one = |sum: &Polynomial| sum.as_constant().is_some();
        if small
            && (self.expands
                || (plain && (one(&a) || one(&b)))
                || (a.0.len() <= 1 && b.0.len() <= 1))
        {
            return a.times(&b);
        }
        let mut whole = Polynomial::constant(Quantity::known(1.0));
        for sum in [a, b] {
            let factor = if sum.0.len() == 1 { sum } else { self.alone(Atom::Sum(sum)) };
            whole = whole.times(&factor);
        }
        whole
    }

    fn power(&mut self, base: &Polynomial, exponent: f64) -> Polynomial {
        let whole = exponent.fract() == 0.0;
        if exponent == 1.0 {
            return base.clone();
        }
        if let Some((monomial, quantity)) = base.single() {
            let bare = monomial.iter().all(|&(_, e)| e.value() == 1.0);
            // (b^e)^k = b^(e k), and (a b)^k = a^k b^k, hold everywhere only for whole k.
            let splits = whole || (quantity.value > 0.0 && monomial.len() <= 1 && bare);
            let scale = quantity.raised(exponent);
            if splits && scale.value.is_finite() {
                let powers =
                    monomial.iter().map(|&(i, e)| (i, Number::new(e.value() * exponent))).collect();
                let mut out = Polynomial::default();
                out.add_term(powers, &scale);
                return out;
            }
        }
        let size = (base.0.len() as f64).powf(exponent);
        let expands = self.expands && whole && (0.0..=HIGHEST_EXPANSION).contains(&exponent);
        if expands && size <= LARGEST_EXPANSION as f64 && !base.0.is_empty() {
            let mut out = Polynomial::constant(Quantity::known(1.0));
            for _ in 0..exponent as usize {
                out = out.times(base);
            }
            return out;
        }
        let atom = self.of(Atom::Sum(base.clone()));
        let mut out = Polynomial::default();
        out.add_term(vec![(atom, Number::new(exponent))], &Quantity::known(1.0));
        out
    }

    /// The form as an expression with plain numbers.
    pub(super) fn expression(&self, graph: &mut Graph, form: &Polynomial) -> Expr {
        let mut parts = Vec::with_capacity(form.0.len());
        for (monomial, quantity) in self.ordered(form) {
            let mut factors = Vec::with_capacity(monomial.len());
            for &(atom, exponent) in monomial {
                let base = match self.get(atom) {
                    Atom::Symbol(symbol) => graph.symbol(*symbol),
                    Atom::Apply(function, argument) => {
                        let argument = self.expression(graph, argument);
                        graph.apply(*function, argument)
                    }
                    Atom::Sum(sum) => self.expression(graph, sum),
                    Atom::Power(base, exponent) => {
                        let base = self.expression(graph, base);
                        let exponent = self.expression(graph, exponent);
                        graph.power_of(base, exponent)
                    }
                };
                factors.push((base, exponent.value()));
            }
            parts.push((quantity.value, graph.product(1.0, &factors)));
        }
        graph.linear(0.0, &parts)
    }

    /// Terms in the order of print: polynomials by degree, then what holds functions.
    pub(super) fn ordered<'a>(&self, form: &'a Polynomial) -> Vec<(&'a Monomial, &'a Quantity)> {
        let mut terms: Vec<_> = form.0.iter().collect();
        terms.sort_by(|(a, _), (b, _)| {
            let (x, y) = (self.rank(a), self.rank(b));
            x.0.cmp(&y.0).then(x.1.total_cmp(&y.1)).then(x.2.cmp(&y.2))
        });
        terms
    }

    fn rank(&self, monomial: &Monomial) -> (bool, f64, Vec<usize>) {
        let special = monomial.iter().any(|&(a, _)| !matches!(self.get(a), Atom::Symbol(_)));
        let degree = monomial.iter().map(|(_, e)| e.value()).sum();
        let mut letters = Vec::new();
        for &(atom, exponent) in monomial {
            letters.extend(std::iter::repeat_n(atom, exponent.value().clamp(1.0, 64.0) as usize));
        }
        (special, degree, letters)
    }
}
