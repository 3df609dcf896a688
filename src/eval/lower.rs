//! From expressions to a list of instructions in single-assignment form.
//!
//! Whatever is the same at every point (numbers, coefficients and what is made of
//! them) becomes a *slot*, computed once a call. Powers are chains of products, and
//! products of the same leading factors are shared. Sums come in two forms: term after
//! term, which shares products between sums, or nested as Horner does, which needs no
//! powers at all; [`Lowered::new`] takes the one that costs less over all outputs.

use rustc_hash::FxHashMap;

use super::Inputs;
use super::instruction::{Instruction, Slot, Value};
use crate::expr::{Expr, Function, Graph, Node, Symbol};

/// Largest whole exponent that becomes a chain of products.
const LONGEST_CHAIN: f64 = 64.0;
/// Largest half-integer exponent that becomes a square root and a chain of products.
const LONGEST_ROOT: f64 = 8.0;

/// Expressions as instructions.
#[derive(Clone)]
pub(crate) struct Lowered {
    pub code: Vec<Instruction>,
    pub slots: Vec<Slot>,
    /// For each output, the value to store.
    pub outputs: Vec<Value>,
}

/// How sums are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    /// Term after term.
    Expanded,
    /// Common factors taken out, innermost first.
    Nested,
}

impl Lowered {
    /// The cheaper of the two forms.
    pub(crate) fn new(graph: &Graph, inputs: &Inputs, outputs: &[Expr]) -> Lowered {
        let expanded = Lowered::of(graph, inputs, outputs, Form::Expanded);
        let nested = Lowered::of(graph, inputs, outputs, Form::Nested);
        if nested.cost() < expanded.cost() { nested } else { expanded }
    }

    /// Sums term after term, as they are printed.
    pub(crate) fn expanded(graph: &Graph, inputs: &Inputs, outputs: &[Expr]) -> Lowered {
        Lowered::of(graph, inputs, outputs, Form::Expanded)
    }

    /// Time for one point, in units of one multiplication.
    pub(crate) fn cost(&self) -> u32 {
        self.code.iter().map(|instruction| instruction.cost()).sum()
    }

    fn of(graph: &Graph, inputs: &Inputs, outputs: &[Expr], form: Form) -> Lowered {
        let varying = inputs.varying.iter().enumerate().map(|(i, &s)| (s, i as u32)).collect();
        let mut lowering = Lowering {
            graph,
            varying,
            form,
            uniform: FxHashMap::default(),
            code: Vec::new(),
            numbered: FxHashMap::default(),
            slots: Vec::new(),
            slot_index: FxHashMap::default(),
            values: FxHashMap::default(),
            products: FxHashMap::default(),
        };
        for expr in graph.topological(outputs) {
            let uniform = match graph.node(expr) {
                Node::Symbol(symbol) => !lowering.varying.contains_key(symbol),
                _ => graph.children(expr).iter().all(|child| lowering.uniform[child]),
            };
            lowering.uniform.insert(expr, uniform);
        }
        // Parts come before wholes, so that no expression is deep enough to exhaust the stack.
        for expr in graph.topological(outputs) {
            if !lowering.uniform[&expr] && !matches!(graph.node(expr), Node::Product(_)) {
                lowering.value(expr);
            }
        }
        let outputs = outputs.iter().map(|&output| lowering.value(output)).collect();
        Lowered { code: lowering.code, slots: lowering.slots, outputs }.without_dead_code()
    }

    /// Drops what no output needs: monomials that only a nested sum was made of.
    pub(super) fn without_dead_code(mut self) -> Lowered {
        let mut needed = vec![false; self.code.len()];
        for &output in &self.outputs {
            needed[output as usize] = true;
        }
        for (at, instruction) in self.code.iter().enumerate().rev() {
            if needed[at] {
                for operand in instruction.operands() {
                    needed[operand as usize] = true;
                }
            }
        }
        let mut place = vec![0; self.code.len()];
        let mut kept = 0;
        for (at, &needed) in needed.iter().enumerate() {
            place[at] = kept;
            kept += Value::from(needed);
        }
        let code = std::mem::take(&mut self.code);
        self.code = code
            .into_iter()
            .zip(&needed)
            .filter(|&(_, &needed)| needed)
            .map(|(instruction, _)| instruction.renamed(|value| place[value as usize]))
            .collect();
        self.outputs.iter_mut().for_each(|output| *output = place[*output as usize]);
        self
    }
}

struct Lowering<'a> {
    graph: &'a Graph,
    varying: FxHashMap<Symbol, u32>,
    form: Form,
    uniform: FxHashMap<Expr, bool>,
    code: Vec<Instruction>,
    /// Instructions that were emitted before: the same is not computed twice.
    numbered: FxHashMap<Instruction, Value>,
    slots: Vec<Slot>,
    slot_index: FxHashMap<(u64, Vec<(Expr, u64)>), u32>,
    values: FxHashMap<Expr, Value>,
    /// Products by their leading factors.
    products: FxHashMap<Vec<(Expr, u64)>, Value>,
}

/// A term of a sum: what is uniform, and the varying powers.
type Term = (Slot, Vec<(Expr, f64)>);

/// A sum of which some terms may be uniform.
struct Partial {
    value: Option<Value>,
    /// Uniform terms that are not added yet.
    rest: Vec<Slot>,
}

impl Lowering<'_> {
    fn emit(&mut self, instruction: Instruction) -> Value {
        if let Some(&value) = self.numbered.get(&instruction) {
            return value;
        }
        self.code.push(instruction);
        let value = (self.code.len() - 1) as Value;
        self.numbered.insert(instruction, value);
        value
    }

    fn slot(&mut self, slot: Slot) -> u32 {
        let parts: Vec<(Expr, u64)> = slot.parts.iter().map(|&(e, x)| (e, x.to_bits())).collect();
        let key = (slot.factor.to_bits(), parts);
        if let Some(&known) = self.slot_index.get(&key) {
            return known;
        }
        let index = self.slots.len() as u32;
        self.slots.push(slot);
        self.slot_index.insert(key, index);
        index
    }

    fn broadcast(&mut self, slot: Slot) -> Value {
        let slot = self.slot(slot);
        self.emit(Instruction::Broadcast { slot })
    }

    fn value(&mut self, expr: Expr) -> Value {
        if let Some(&value) = self.values.get(&expr) {
            return value;
        }
        let value = if self.uniform[&expr] {
            self.broadcast(Slot { factor: 1.0, parts: vec![(expr, 1.0)] })
        } else {
            match self.graph.node(expr).clone() {
                Node::Number(number) => self.broadcast(Slot::number(number.value())),
                Node::Symbol(symbol) => {
                    let input = self.varying[&symbol];
                    self.emit(Instruction::Load { input })
                }
                Node::Sum { constant, terms } => {
                    let constant = constant.value();
                    let mut list: Vec<Term> =
                        terms.iter().map(|&(term, c)| self.split(c.value(), term)).collect();
                    if constant != 0.0 {
                        list.push((Slot::number(constant), Vec::new()));
                    }
                    let sum = self.sum(list, None);
                    self.finished(sum)
                }
                Node::Product(_) => {
                    let (slot, factors) = self.split(1.0, expr);
                    let product = self.chain(&factors);
                    self.scaled(product, slot)
                }
                Node::Power(base, exponent) => {
                    let a = self.value(base);
                    let b = self.value(exponent);
                    self.emit(Instruction::Power { a, b })
                }
                Node::Apply(function, argument) => {
                    let a = self.value(argument);
                    self.emit(Instruction::Apply { a, function })
                }
            }
        };
        self.values.insert(expr, value);
        value
    }

    /// Takes a scaled term apart into what is uniform and the varying factors.
    fn split(&self, factor: f64, term: Expr) -> Term {
        let parts: Vec<(Expr, f64)> = match self.graph.node(term) {
            Node::Product(parts) => parts.iter().map(|&(b, e)| (b, e.value())).collect(),
            _ => vec![(term, 1.0)],
        };
        let (same, varying) = parts.into_iter().partition(|(base, _)| self.uniform[base]);
        (Slot { factor, parts: same }, varying)
    }

    fn scaled(&mut self, a: Value, slot: Slot) -> Value {
        if slot.is_one() {
            return a;
        }
        let slot = self.slot(slot);
        self.emit(Instruction::Scale { a, slot })
    }

    /// A sum of terms; `outer` is what the sum around it was last divided by.
    fn sum(&mut self, terms: Vec<Term>, outer: Option<Expr>) -> Partial {
        // Taken out one after the other: (power, what it multiplies).
        let mut groups: Vec<(Vec<(Expr, f64)>, Partial)> = Vec::new();
        let mut rest = terms;
        let mut last = outer;
        while self.form == Form::Nested
            && let Some(factor) = most_common(&rest, last)
        {
            last = Some(factor);
            let power = |term: &Term| exponent(term, factor);
            let (mut with, without): (Vec<Term>, Vec<Term>) =
                rest.into_iter().partition(|term| power(term) > 0.0);
            let least = with.iter().map(power).fold(f64::INFINITY, f64::min);
            for (_, factors) in &mut with {
                factors.iter_mut().filter(|f| f.0 == factor).for_each(|f| f.1 -= least);
                factors.retain(|f| f.1 != 0.0);
            }
            let inner = self.sum(with, Some(factor));
            groups.push((vec![(factor, least)], inner));
            rest = without;
        }
        let mut total = self.term_by_term(rest);
        for (power, inner) in groups.into_iter().rev() {
            total = self.multiply_add(&power, inner, total);
        }
        total
    }

    fn term_by_term(&mut self, terms: Vec<Term>) -> Partial {
        let mut total = Partial { value: None, rest: Vec::new() };
        for (slot, factors) in terms {
            if factors.is_empty() {
                total.rest.push(slot);
                continue;
            }
            total = match total.value {
                Some(a) if slot.is_one() && !self.products.contains_key(&key(&factors)) => {
                    let (value, last) = self.open_chain(&factors);
                    let value = match last {
                        Some(b) => self.emit(Instruction::MultiplyAdd { a: value, b, c: a }),
                        None => self.emit(Instruction::Add { a, b: value }),
                    };
                    Partial { value: Some(value), rest: total.rest }
                }
                _ => {
                    let inner = Partial { value: None, rest: vec![slot] };
                    self.multiply_add(&factors, inner, total)
                }
            };
        }
        total
    }

    /// factors * inner + total.
    fn multiply_add(
        &mut self,
        factors: &[(Expr, f64)],
        mut inner: Partial,
        mut total: Partial,
    ) -> Partial {
        let power = self.chain(factors);
        if inner.value.is_none() && inner.rest.len() == 1 {
            let slot = inner.rest.remove(0);
            let value = match total.value {
                Some(a) if slot.is_one() => self.emit(Instruction::Add { a, b: power }),
                Some(a) => {
                    let slot = self.slot(slot);
                    self.emit(Instruction::AddScaled { a, b: power, slot })
                }
                // A constant that the sum has anyway comes in with the first product.
                None if self.form == Form::Nested
                    && !slot.is_one()
                    && let Some(shift) = total.rest.pop() =>
                {
                    let (slot, shift) = (self.slot(slot), self.slot(shift));
                    self.emit(Instruction::ScaleShift { a: power, slot, shift })
                }
                None => self.scaled(power, slot),
            };
            return Partial { value: Some(value), rest: total.rest };
        }
        let inner = self.finished(inner);
        let value = match total.value {
            Some(c) => self.emit(Instruction::MultiplyAdd { a: inner, b: power, c }),
            None => match total.rest.pop() {
                Some(slot) => {
                    let slot = self.slot(slot);
                    self.emit(Instruction::MultiplyShift { a: inner, b: power, slot })
                }
                None => self.emit(Instruction::Multiply { a: inner, b: power }),
            },
        };
        Partial { value: Some(value), rest: total.rest }
    }

    fn finished(&mut self, sum: Partial) -> Value {
        let mut rest = sum.rest.into_iter();
        let mut total = match sum.value {
            Some(value) => value,
            None => {
                let first = rest.next().unwrap_or(Slot::number(0.0));
                self.broadcast(first)
            }
        };
        for slot in rest {
            let slot = self.slot(slot);
            total = self.emit(Instruction::Shift { a: total, slot });
        }
        total
    }

    /// The product of varying powers; products with the same leading factors share them.
    fn chain(&mut self, factors: &[(Expr, f64)]) -> Value {
        let key = key(factors);
        if let Some(&value) = self.products.get(&key) {
            return value;
        }
        let value = match self.open_chain(factors) {
            (value, None) => value,
            (a, Some(b)) => self.emit(Instruction::Multiply { a, b }),
        };
        self.products.insert(key, value);
        value
    }

    /// A product but for its last multiplication.
    fn open_chain(&mut self, factors: &[(Expr, f64)]) -> (Value, Option<Value>) {
        match *factors {
            [(base, exponent)] => self.power(base, exponent),
            [ref leading @ .., last] => {
                let a = self.chain(leading);
                (a, Some(self.chain(&[last])))
            }
            [] => (self.broadcast(Slot::number(1.0)), None),
        }
    }

    fn power(&mut self, base: Expr, exponent: f64) -> (Value, Option<Value>) {
        let size = exponent.abs();
        let root = size.fract() == 0.5 && size <= LONGEST_ROOT;
        if !(root || exponent.fract() == 0.0 && size <= LONGEST_CHAIN) {
            let a = self.value(base);
            let slot = self.slot(Slot::number(exponent));
            return (self.emit(Instruction::Raise { a, slot }), None);
        }
        if exponent < 0.0 {
            let a = self.chain(&[(base, size)]);
            return (self.emit(Instruction::Reciprocal { a }), None);
        }
        let a = self.value(base);
        if exponent == 1.0 {
            return (a, None);
        }
        if root {
            let function = Function::SQRT;
            let root = self.emit(Instruction::Apply { a, function });
            let whole = size.floor();
            return match whole {
                0.0 => (root, None),
                _ => (self.chain(&[(base, whole)]), Some(root)),
            };
        }
        let below = [(base, (size - 1.0).to_bits())];
        let (low, high) = if self.products.contains_key(&below[..]) {
            (1.0, size - 1.0)
        } else {
            ((size / 2.0).floor(), (size / 2.0).ceil())
        };
        (self.chain(&[(base, low)]), Some(self.chain(&[(base, high)])))
    }
}

fn key(factors: &[(Expr, f64)]) -> Vec<(Expr, u64)> {
    factors.iter().map(|&(base, exponent)| (base, exponent.to_bits())).collect()
}

/// The whole exponent of a factor in a term, or 0.
fn exponent(term: &Term, factor: Expr) -> f64 {
    let whole = |e: f64| e > 0.0 && e.fract() == 0.0 && e <= LONGEST_CHAIN;
    term.1.iter().find(|f| f.0 == factor && whole(f.1)).map_or(0.0, |f| f.1)
}

/// The factor of most terms, if it stands in two at least; among equals the one that was
/// taken out last, so that the terms of one power stay together.
fn most_common(terms: &[Term], last: Option<Expr>) -> Option<Expr> {
    let mut counts: FxHashMap<Expr, usize> = FxHashMap::default();
    for term in terms {
        for &(factor, _) in &term.1 {
            if exponent(term, factor) > 0.0 {
                *counts.entry(factor).or_default() += 1;
            }
        }
    }
    let best = counts.into_iter().filter(|&(_, count)| count > 1);
    let order =
        |&(factor, count): &(Expr, usize)| (count, Some(factor) == last, std::cmp::Reverse(factor));
    best.max_by_key(order).map(|(factor, _)| factor)
}
