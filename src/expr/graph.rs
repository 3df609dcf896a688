//! The hash-consed expression graph.
//!
//! Every expression is stored once and named by an [`Expr`]. Constructors keep a
//! normal form, so that equal sums and products of the same parts are the same
//! expression: sums are flat lists of scaled terms, products are flat lists of powers.

use std::collections::HashMap;
use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::functions::Function;

/// An expression of a [`Graph`]; equal expressions of one graph have equal names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Expr(pub(crate) u32);

/// A quantity that gets its value from outside the graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Symbol {
    /// Generalised coordinate q_i, counted from 0.
    Coordinate(usize),
    /// Conjugate momentum p_i, counted from 0.
    Momentum(usize),
    /// Velocity dq_i/dt, counted from 0: only in energies of velocities, until momenta stand in
    /// their place. No part of a [`super::System`] holds one.
    Velocity(usize),
    /// The time t.
    Time,
    /// A measured input, counted from 0, or its derivative by time of the order that comes second.
    Input(usize, usize),
    /// A measured input some time ago, or its derivative by time: as [`Symbol::Input`], then how
    /// long ago.
    Delayed(usize, usize, Delay),
    /// Inner parameter: learned, not penalised.
    Parameter(usize),
    /// Coefficient of the k-th learned term.
    Coefficient(usize),
}

/// How long ago a delayed input was measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Delay {
    /// A known time.
    Number(Number),
    /// An inner parameter.
    Parameter(usize),
}

impl Delay {
    /// The time, where it is known.
    pub fn number(self) -> Option<f64> {
        match self {
            Delay::Number(number) => Some(number.value()),
            Delay::Parameter(_) => None,
        }
    }

    /// The time by the values of some unknowns; NaN where they do not hold it.
    pub fn among(self, unknowns: &[Symbol], values: &[f64]) -> f64 {
        match self {
            Delay::Number(number) => number.value(),
            Delay::Parameter(j) => {
                let at = unknowns.iter().position(|symbol| *symbol == Symbol::Parameter(j));
                at.and_then(|at| values.get(at)).copied().unwrap_or(f64::NAN)
            }
        }
    }

    /// The time by the values of all inner parameters; NaN for one without.
    pub fn number_or(self, parameters: &[f64]) -> f64 {
        match self {
            Delay::Number(number) => number.value(),
            Delay::Parameter(j) => parameters.get(j).copied().unwrap_or(f64::NAN),
        }
    }
}

impl Symbol {
    /// Whether its value is a function of the time that the motion has no part in.
    pub fn is_of_time(self) -> bool {
        self == Symbol::Time || self.is_driving()
    }

    /// Whether it is an input, a rate of one, or either of them delayed.
    pub fn is_driving(self) -> bool {
        matches!(self, Symbol::Input(..) | Symbol::Delayed(..))
    }

    /// The derivative by time of an input.
    pub fn input_rate(self) -> Option<Symbol> {
        match self {
            Symbol::Input(input, order) => Some(Symbol::Input(input, order + 1)),
            Symbol::Delayed(input, order, by) => Some(Symbol::Delayed(input, order + 1, by)),
            _ => None,
        }
    }

    /// The parameter that its value depends on beside the time.
    fn inner(self) -> Option<Symbol> {
        match self {
            Symbol::Delayed(.., Delay::Parameter(j)) => Some(Symbol::Parameter(j)),
            _ => None,
        }
    }

    /// The same input, by a delay that is another expression; `None` where it is neither a number
    /// nor a parameter.
    fn delayed_by(self, graph: &Graph, delay: Expr) -> Option<Symbol> {
        let Symbol::Delayed(input, order, _) = self else { return None };
        let by = match *graph.node(delay) {
            Node::Number(number) => Delay::Number(number),
            Node::Symbol(Symbol::Parameter(j)) => Delay::Parameter(j),
            _ => return None,
        };
        Some(Symbol::Delayed(input, order, by))
    }
}

/// A real number that can be hashed; -0 is stored as 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Number(u64);

impl Number {
    /// The number; NaN is allowed, -0 becomes 0.
    pub fn new(value: f64) -> Self {
        Number((value + 0.0).to_bits())
    }

    /// The number as floating point.
    pub fn value(self) -> f64 {
        f64::from_bits(self.0)
    }

    /// The number to six digits.
    pub fn short(self) -> String {
        let value = self.value();
        format!("{}", format!("{value:.5e}").parse::<f64>().unwrap_or(value))
    }
}

/// How an expression is made of others. Lists are sorted and hold no repetition.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Node {
    /// A constant.
    Number(Number),
    /// A quantity from outside.
    Symbol(Symbol),
    /// constant + sum of factor * term. A single scaled term is a sum of one.
    Sum {
        /// The number that is added to the terms.
        constant: Number,
        /// (term, factor) of every term.
        terms: Arc<[(Expr, Number)]>,
    },
    /// Product of base ^ constant exponent. A single power is a product of one.
    Product(Arc<[(Expr, Number)]>),
    /// base ^ exponent with an exponent that is not a number.
    Power(Expr, Expr),
    /// An elementary function of one argument.
    Apply(Function, Expr),
}

/// Expressions that share their common parts.
///
/// A clone shares all that is stored until one of the two stores something new.
#[derive(Debug, Clone, Default)]
pub struct Graph {
    stored: Arc<Stored>,
}

#[derive(Debug, Clone, Default)]
struct Stored {
    nodes: Vec<Node>,
    index: FxHashMap<Node, Expr>,
}

impl Graph {
    /// A graph without expressions.
    pub fn new() -> Self {
        Graph::default()
    }

    /// How an expression of this graph is made.
    pub fn node(&self, expr: Expr) -> &Node {
        &self.stored.nodes[expr.0 as usize]
    }

    /// How many distinct expressions are stored.
    pub fn len(&self) -> usize {
        self.stored.nodes.len()
    }

    /// Whether no expression is stored.
    pub fn is_empty(&self) -> bool {
        self.stored.nodes.is_empty()
    }

    fn intern(&mut self, node: Node) -> Expr {
        if let Some(&expr) = self.stored.index.get(&node) {
            return expr;
        }
        let stored = Arc::make_mut(&mut self.stored);
        let expr = Expr(stored.nodes.len() as u32);
        stored.nodes.push(node.clone());
        stored.index.insert(node, expr);
        expr
    }

    /// Takes back what was stored last, but for the first `len` expressions.
    pub(super) fn truncate(&mut self, len: usize) {
        if len >= self.len() {
            return;
        }
        let stored = Arc::make_mut(&mut self.stored);
        for node in stored.nodes.drain(len..) {
            stored.index.remove(&node);
        }
    }

    /// A constant.
    pub fn number(&mut self, value: f64) -> Expr {
        self.intern(Node::Number(Number::new(value)))
    }

    /// A quantity from outside.
    pub fn symbol(&mut self, symbol: Symbol) -> Expr {
        self.intern(Node::Symbol(symbol))
    }

    /// The value of an expression that is a number.
    pub fn as_number(&self, expr: Expr) -> Option<f64> {
        match self.node(expr) {
            Node::Number(number) => Some(number.value()),
            _ => None,
        }
    }

    /// Whether an expression is the number 0.
    pub fn is_zero(&self, expr: Expr) -> bool {
        self.as_number(expr) == Some(0.0)
    }

    /// constant + sum of factor_i * term_i, flattened and collected.
    pub fn linear(&mut self, constant: f64, parts: &[(f64, Expr)]) -> Expr {
        let mut constant = constant;
        let mut terms: Vec<(Expr, f64)> = Vec::with_capacity(parts.len());
        for &(factor, part) in parts {
            match self.node(part) {
                Node::Number(number) => constant += factor * number.value(),
                Node::Sum { constant: inner, terms: inner_terms } => {
                    constant += factor * inner.value();
                    terms.extend(inner_terms.iter().map(|&(t, c)| (t, factor * c.value())));
                }
                _ => terms.push((part, factor)),
            }
        }
        let terms = collect(terms);
        if terms.is_empty() {
            return self.number(constant);
        }
        if let [(only, factor)] = terms[..]
            && constant == 0.0
            && factor == 1.0
        {
            return only;
        }
        let terms = terms.into_iter().map(|(t, c)| (t, Number::new(c))).collect();
        self.intern(Node::Sum { constant: Number::new(constant), terms })
    }

    /// Product of base_i ^ exponent_i times a number, flattened and collected.
    pub fn product(&mut self, factor: f64, parts: &[(Expr, f64)]) -> Expr {
        let mut factor = factor;
        let mut bases: Vec<(Expr, f64)> = Vec::with_capacity(parts.len());
        for &(base, exponent) in parts {
            self.gather(base, exponent, &mut factor, &mut bases);
        }
        if factor == 0.0 {
            return self.number(0.0);
        }
        let bases = collect(bases);
        let product = match bases[..] {
            [] => return self.number(factor),
            [(base, 1.0)] => base,
            _ => {
                let parts = bases.into_iter().map(|(b, e)| (b, Number::new(e))).collect();
                self.intern(Node::Product(parts))
            }
        };
        if factor == 1.0 { product } else { self.linear(0.0, &[(factor, product)]) }
    }

    /// Takes `base ^ exponent` apart into a number and powers.
    fn gather(&self, base: Expr, exponent: f64, factor: &mut f64, out: &mut Vec<(Expr, f64)>) {
        let whole = exponent.fract() == 0.0;
        match self.node(base) {
            Node::Number(number) => {
                let value = number.value().powf(exponent);
                // 0^-1 and (-1)^0.5 stay as they are: they are for the evaluator to report.
                if value.is_finite() { *factor *= value } else { out.push((base, exponent)) }
            }
            Node::Sum { constant, terms } if constant.value() == 0.0 && terms.len() == 1 => {
                let (term, scale) = terms[0];
                let scaled = scale.value().powf(exponent);
                if (whole || scale.value() > 0.0) && scaled.is_finite() {
                    *factor *= scaled;
                    self.gather(term, exponent, factor, out);
                } else {
                    out.push((base, exponent));
                }
            }
            // (b^e)^k = b^(e k) holds everywhere only for whole k.
            Node::Product(parts) if whole => {
                out.extend(parts.iter().map(|&(b, e)| (b, e.value() * exponent)));
            }
            _ => out.push((base, exponent)),
        }
    }

    /// a + b.
    pub fn add(&mut self, a: Expr, b: Expr) -> Expr {
        self.linear(0.0, &[(1.0, a), (1.0, b)])
    }

    /// a - b.
    pub fn subtract(&mut self, a: Expr, b: Expr) -> Expr {
        self.linear(0.0, &[(1.0, a), (-1.0, b)])
    }

    /// Sum of all parts; 0 for none.
    pub fn sum(&mut self, parts: &[Expr]) -> Expr {
        let parts: Vec<_> = parts.iter().map(|&part| (1.0, part)).collect();
        self.linear(0.0, &parts)
    }

    /// -a.
    pub fn negate(&mut self, a: Expr) -> Expr {
        self.linear(0.0, &[(-1.0, a)])
    }

    /// factor * a.
    pub fn scale(&mut self, factor: f64, a: Expr) -> Expr {
        self.linear(0.0, &[(factor, a)])
    }

    /// a * b.
    pub fn multiply(&mut self, a: Expr, b: Expr) -> Expr {
        match (self.as_number(a), self.as_number(b)) {
            (Some(factor), _) => self.scale(factor, b),
            (_, Some(factor)) => self.scale(factor, a),
            _ => self.product(1.0, &[(a, 1.0), (b, 1.0)]),
        }
    }

    /// a / b; a division by the number 0 stays as b ^ -1.
    pub fn divide(&mut self, a: Expr, b: Expr) -> Expr {
        match self.as_number(b) {
            Some(divisor) if divisor != 0.0 => self.scale(1.0 / divisor, a),
            _ => self.product(1.0, &[(a, 1.0), (b, -1.0)]),
        }
    }

    /// base ^ exponent for a constant exponent.
    pub fn power(&mut self, base: Expr, exponent: f64) -> Expr {
        self.product(1.0, &[(base, exponent)])
    }

    /// base ^ exponent for any exponent.
    pub fn power_of(&mut self, base: Expr, exponent: Expr) -> Expr {
        match self.as_number(exponent) {
            Some(value) => self.power(base, value),
            None => self.intern(Node::Power(base, exponent)),
        }
    }

    /// function(argument); a number argument inside the domain is evaluated.
    pub fn apply(&mut self, function: Function, argument: Expr) -> Expr {
        if let Some(x) = self.as_number(argument) {
            let value = (function.row().value)(x);
            if value.is_finite() {
                return self.number(value);
            }
        }
        self.intern(Node::Apply(function, argument))
    }

    /// The expressions that `expr` is directly made of.
    pub fn children(&self, expr: Expr) -> Vec<Expr> {
        match self.node(expr) {
            Node::Number(_) | Node::Symbol(_) => Vec::new(),
            Node::Sum { terms, .. } => terms.iter().map(|&(t, _)| t).collect(),
            Node::Product(parts) => parts.iter().map(|&(b, _)| b).collect(),
            Node::Power(base, exponent) => vec![*base, *exponent],
            Node::Apply(_, argument) => vec![*argument],
        }
    }

    /// Every expression that the roots are made of, parts before wholes, each once.
    pub fn topological(&self, roots: &[Expr]) -> Vec<Expr> {
        let mut order = Vec::new();
        let mut seen = vec![false; self.len()];
        let mut stack: Vec<(Expr, bool)> = roots.iter().rev().map(|&r| (r, false)).collect();
        while let Some((expr, done)) = stack.pop() {
            if done {
                order.push(expr);
                continue;
            }
            if std::mem::replace(&mut seen[expr.0 as usize], true) {
                continue;
            }
            stack.push((expr, true));
            stack.extend(self.children(expr).into_iter().rev().map(|child| (child, false)));
        }
        order
    }

    /// Name of a function inside some expressions that has a kink or a jump.
    pub fn kink(&self, roots: &[Expr]) -> Option<&'static str> {
        self.topological(roots).into_iter().find_map(|expr| match self.node(expr) {
            Node::Apply(function, _) if !function.row().is_smooth() => Some(function.row().name),
            _ => None,
        })
    }

    /// The symbols that the roots depend on, sorted.
    pub fn symbols(&self, roots: &[Expr]) -> Vec<Symbol> {
        let mut symbols: Vec<Symbol> = self
            .topological(roots)
            .into_iter()
            .filter_map(|expr| match self.node(expr) {
                Node::Symbol(symbol) => Some(*symbol),
                _ => None,
            })
            .collect();
        symbols.extend(symbols.clone().into_iter().filter_map(Symbol::inner));
        symbols.sort_unstable();
        symbols.dedup();
        symbols
    }

    /// Whether a symbol occurs in an expression.
    pub fn depends_on(&self, expr: Expr, symbol: Symbol) -> bool {
        self.symbols(&[expr]).binary_search(&symbol).is_ok()
    }

    /// Replaces symbols by expressions; symbols without an entry stay.
    pub fn substitute(&mut self, expr: Expr, replace: &HashMap<Symbol, Expr>) -> Expr {
        self.replace_symbols(expr, |_, symbol| replace.get(&symbol).copied())
    }

    /// Replaces symbols by numbers and folds what becomes constant.
    pub fn substitute_numbers(&mut self, expr: Expr, values: &HashMap<Symbol, f64>) -> Expr {
        let number = |graph: &mut Graph, symbol| values.get(&symbol).map(|&x| graph.number(x));
        self.replace_symbols(expr, number)
    }

    fn replace_symbols(
        &mut self,
        expr: Expr,
        mut replace: impl FnMut(&mut Graph, Symbol) -> Option<Expr>,
    ) -> Expr {
        self.rebuild(expr, |graph, part, _| {
            let Node::Symbol(symbol) = *graph.node(part) else { return None };
            replace(graph, symbol).or_else(|| {
                let delay = symbol.inner().and_then(|inner| replace(graph, inner))?;
                let delayed = symbol.delayed_by(graph, delay)?;
                Some(graph.symbol(delayed))
            })
        })
    }

    /// Replaces parts that are functions of an argument by expressions, given the argument and what
    /// it has become.
    pub(crate) fn replace_functions(
        &mut self,
        expr: Expr,
        mut replace: impl FnMut(&mut Graph, Expr, Function, [Expr; 2]) -> Option<Expr>,
    ) -> Expr {
        self.rebuild(expr, |graph, part, image| match *graph.node(part) {
            Node::Apply(function, argument) => {
                replace(graph, part, function, [argument, image[&argument]])
            }
            _ => None,
        })
    }

    /// Builds an expression anew, some of its parts as they are given.
    fn rebuild(
        &mut self,
        expr: Expr,
        mut replace: impl FnMut(&mut Graph, Expr, &FxHashMap<Expr, Expr>) -> Option<Expr>,
    ) -> Expr {
        let mut image: FxHashMap<Expr, Expr> = FxHashMap::default();
        for part in self.topological(&[expr]) {
            if let Some(new) = replace(self, part, &image) {
                image.insert(part, new);
                continue;
            }
            let new = match self.node(part).clone() {
                Node::Number(_) | Node::Symbol(_) => part,
                Node::Sum { constant, terms } => {
                    let parts: Vec<_> = terms.iter().map(|(t, c)| (c.value(), image[t])).collect();
                    self.linear(constant.value(), &parts)
                }
                Node::Product(parts) => {
                    let parts: Vec<_> = parts.iter().map(|(b, e)| (image[b], e.value())).collect();
                    self.product(1.0, &parts)
                }
                Node::Power(base, exponent) => self.power_of(image[&base], image[&exponent]),
                Node::Apply(function, argument) => self.apply(function, image[&argument]),
            };
            image.insert(part, new);
        }
        image[&expr]
    }

    /// The same expression as one of another graph, symbols replaced by numbers where given.
    pub fn import(&mut self, other: &Graph, expr: Expr, values: &HashMap<Symbol, f64>) -> Expr {
        let mut image: FxHashMap<Expr, Expr> = FxHashMap::default();
        for part in other.topological(&[expr]) {
            let new = match other.node(part) {
                Node::Number(number) => self.number(number.value()),
                Node::Symbol(symbol) => match values.get(symbol) {
                    Some(&value) => self.number(value),
                    None => {
                        let delay = symbol.inner().and_then(|inner| values.get(&inner));
                        let known = delay.map(|&delay| self.number(delay));
                        let delayed = known.and_then(|known| symbol.delayed_by(self, known));
                        self.symbol(delayed.unwrap_or(*symbol))
                    }
                },
                Node::Sum { constant, terms } => {
                    let parts: Vec<_> = terms.iter().map(|(t, c)| (c.value(), image[t])).collect();
                    self.linear(constant.value(), &parts)
                }
                Node::Product(parts) => {
                    let parts: Vec<_> = parts.iter().map(|(b, e)| (image[b], e.value())).collect();
                    self.product(1.0, &parts)
                }
                Node::Power(base, exponent) => self.power_of(image[base], image[exponent]),
                Node::Apply(function, argument) => self.apply(*function, image[argument]),
            };
            image.insert(part, new);
        }
        image[&expr]
    }

    /// The value of an expression; slow and plain, the truth for tests of the evaluators.
    pub fn value(&self, expr: Expr, of: &dyn Fn(Symbol) -> f64) -> f64 {
        let mut values: FxHashMap<Expr, f64> = FxHashMap::default();
        for part in self.topological(&[expr]) {
            let value = self.value_of_parts(part, &|child| values[&child], of);
            values.insert(part, value);
        }
        values[&expr]
    }

    /// The value of an expression whose own parts have these values.
    pub fn value_of_parts(
        &self,
        expr: Expr,
        part: &dyn Fn(Expr) -> f64,
        of: &dyn Fn(Symbol) -> f64,
    ) -> f64 {
        match self.node(expr) {
            Node::Number(number) => number.value(),
            Node::Symbol(symbol) => of(*symbol),
            Node::Sum { constant, terms } => {
                constant.value() + terms.iter().map(|(t, c)| c.value() * part(*t)).sum::<f64>()
            }
            Node::Product(parts) => parts.iter().map(|(b, e)| raise(part(*b), e.value())).product(),
            Node::Power(base, exponent) => part(*base).powf(part(*exponent)),
            Node::Apply(function, argument) => (function.row().value)(part(*argument)),
        }
    }
}

/// base ^ exponent, exact for small whole exponents.
pub fn raise(base: f64, exponent: f64) -> f64 {
    if exponent.fract() == 0.0 && exponent.abs() <= 64.0 {
        base.powi(exponent as i32)
    } else {
        base.powf(exponent)
    }
}

/// Sorts by expression, adds the numbers of equal ones and drops zeros.
fn collect(mut items: Vec<(Expr, f64)>) -> Vec<(Expr, f64)> {
    items.sort_by_key(|&(expr, _)| expr);
    let mut out: Vec<(Expr, f64)> = Vec::with_capacity(items.len());
    for (expr, value) in items {
        match out.last_mut() {
            Some((last, total)) if *last == expr => *total += value,
            _ => out.push((expr, value)),
        }
    }
    out.retain(|&(_, value)| value != 0.0);
    out
}
