//! Taylor series of the solution of x' = f(x, t), as instructions.
//!
//! Every part of f becomes a series whose coefficient k is computed from lower ones and from
//! those of its parts (automatic differentiation of Moore, "Interval Analysis", 1966; rules as
//! in Jorba and Zou, Experimental Mathematics 14, 2005, section 2). Functions need no rule of
//! their own: w = f(u) obeys w' = f'(u) u', and f' stands in the table of functions.

use rustc_hash::FxHashMap;

use super::instruction::{Instruction, Slot, Value};
use super::lower::Lowered;
use super::uniform::Uniforms;
use super::{Backend, Evaluator, Inputs, for_one_point};
use crate::expr::{Expr, Function, Graph, Node, Symbol};

/// Most instructions of the series up to the order wanted.
const LONGEST: usize = 60_000;

/// The series of a solution, compiled.
pub(crate) struct Series {
    evaluator: Box<dyn Evaluator>,
}

impl Series {
    /// Compiles the series up to an order; see [`lower_series`]. `uniform` lists the symbols
    /// that have one value along the solution.
    pub(crate) fn new(
        graph: &mut Graph,
        state: &[Symbol],
        uniform: &[Symbol],
        rates: &[Expr],
        order: usize,
        backend: Backend,
    ) -> Option<Series> {
        let lowered = lower_series(graph, state, rates, order)?;
        let mut varying = state.to_vec();
        varying.push(Symbol::Time);
        let inputs = Inputs { varying, uniform: uniform.to_vec() };
        let uniforms = Uniforms::new(graph, &inputs, &lowered.slots);
        Some(Series { evaluator: for_one_point(&lowered, uniforms, backend) })
    }

    /// The same for given values of the uniform symbols.
    pub(crate) fn at<'a>(&'a self, uniform: &'a [f64]) -> SeriesAt<'a> {
        let out = vec![0.0; self.evaluator.outputs()];
        SeriesAt { series: self, uniform, out, workspace: Vec::new() }
    }
}

/// A series with values for everything but the state and the time.
pub(crate) struct SeriesAt<'a> {
    series: &'a Series,
    uniform: &'a [f64],
    out: Vec<f64>,
    workspace: Vec<f64>,
}

impl SeriesAt<'_> {
    /// Coefficients 1, 2, ... of every component, `[order][component]`, at a state and a time,
    /// which comes last in `point`.
    pub(crate) fn evaluate(&mut self, point: &[f64]) -> &[f64] {
        let (out, workspace) = (&mut self.out, &mut self.workspace);
        self.series.evaluator.evaluate_again(point, self.uniform, 1, out, workspace);
        &self.out
    }

    /// What the last evaluation found.
    pub(crate) fn coefficients(&self) -> &[f64] {
        &self.out
    }
}

/// A coefficient of a series.
#[derive(Clone)]
enum Coefficient {
    Zero,
    Uniform(Slot),
    Value(Value),
}

/// How the coefficients of a series are computed; operands are places in the list of parts.
#[derive(Clone)]
enum Part {
    /// A component of the state.
    State(usize),
    Time,
    Uniform(Slot),
    /// Sum of slots and of slots times parts.
    Linear(Vec<Slot>, Vec<(Slot, usize)>),
    Product(usize, usize),
    Reciprocal(usize),
    /// A power with an exponent that is not whole.
    Raise(usize, f64),
    /// A function of a part, and the part that is its derivative.
    Apply(Function, usize, usize),
}

/// Coefficients 1 to `order` of every component of the state, `[order][component]`, from the
/// state (and the time, the last input); `None` for what has kinks or jumps, and for what would
/// take too many instructions.
pub(super) fn lower_series(
    graph: &mut Graph,
    state: &[Symbol],
    rates: &[Expr],
    order: usize,
) -> Option<Lowered> {
    let mut parts = Parts { graph, state, list: Vec::new(), known: FxHashMap::default(), open: 0 };
    let rates: Vec<usize> = rates.iter().map(|&rate| parts.of(rate)).collect::<Option<_>>()?;
    let mut unrolled = Unrolled::new(parts.list);
    let mut outputs = Vec::new();
    for k in 0..order {
        for part in 0..unrolled.parts.len() {
            let coefficient = unrolled.coefficient(part, k, &rates);
            unrolled.series[part].push(coefficient);
        }
        if unrolled.code.len() > LONGEST {
            return None;
        }
        for &rate in &rates {
            let next = unrolled.next(rate, k);
            outputs.push(unrolled.as_value(next));
        }
    }
    let Unrolled { code, slots, .. } = unrolled;
    Some(Lowered { code, slots, outputs }.without_dead_code())
}

struct Parts<'a> {
    graph: &'a mut Graph,
    state: &'a [Symbol],
    list: Vec<Part>,
    known: FxHashMap<(Expr, u64), usize>,
    /// Expressions that are being taken apart.
    open: usize,
}

/// Deepest nesting that is taken apart.
const DEEPEST: usize = 500;

impl Parts<'_> {
    fn push(&mut self, part: Part) -> usize {
        self.list.push(part);
        self.list.len() - 1
    }

    /// The part that an expression is.
    fn of(&mut self, expr: Expr) -> Option<usize> {
        self.power(expr, 1.0)
    }

    /// The part that base^exponent is.
    fn power(&mut self, base: Expr, exponent: f64) -> Option<usize> {
        let key = (base, exponent.to_bits());
        if let Some(&part) = self.known.get(&key) {
            return Some(part);
        }
        self.open += 1;
        if self.open > DEEPEST {
            return None;
        }
        let part = if exponent == 1.0 {
            self.whole(base)?
        } else if exponent.fract() != 0.0 || exponent.abs() > 64.0 {
            let a = self.of(base)?;
            self.push(Part::Raise(a, exponent))
        } else if exponent < 0.0 {
            let a = self.power(base, -exponent)?;
            self.push(Part::Reciprocal(a))
        } else {
            let low = self.power(base, (exponent / 2.0).floor())?;
            let high = self.power(base, (exponent / 2.0).ceil())?;
            self.push(Part::Product(low, high))
        };
        self.open -= 1;
        self.known.insert(key, part);
        Some(part)
    }

    fn whole(&mut self, expr: Expr) -> Option<usize> {
        let varies = self.graph.symbols(&[expr]).iter().any(|&symbol| self.varies(symbol));
        if !varies {
            return Some(self.push(Part::Uniform(Slot { factor: 1.0, parts: vec![(expr, 1.0)] })));
        }
        Some(match self.graph.node(expr).clone() {
            Node::Number(number) => self.push(Part::Uniform(Slot::number(number.value()))),
            Node::Symbol(Symbol::Time) => self.push(Part::Time),
            Node::Symbol(symbol) => {
                let row = self.state.iter().position(|&of| of == symbol)?;
                self.push(Part::State(row))
            }
            Node::Sum { constant, terms } => {
                let mut slots = Vec::new();
                if constant.value() != 0.0 {
                    slots.push(Slot::number(constant.value()));
                }
                let mut scaled = Vec::new();
                for (term, factor) in terms.iter().copied() {
                    let (slot, product) = self.split(factor.value(), term)?;
                    match product {
                        Some(product) => scaled.push((slot, product)),
                        None => slots.push(slot),
                    }
                }
                self.push(Part::Linear(slots, scaled))
            }
            Node::Product(_) => {
                let (slot, product) = self.split(1.0, expr)?;
                match product {
                    Some(product) if slot.is_one() => product,
                    Some(product) => self.push(Part::Linear(Vec::new(), vec![(slot, product)])),
                    None => self.push(Part::Uniform(slot)),
                }
            }
            Node::Power(base, exponent) => {
                let log = self.graph.apply(Function::LOG, base);
                let product = self.graph.multiply(exponent, log);
                let exp = self.graph.apply(Function::EXP, product);
                self.of(exp)?
            }
            Node::Apply(function, argument) => {
                let a = self.of(argument)?;
                let part = self.push(Part::Apply(function, a, usize::MAX));
                // The derivative may be made of the function itself.
                self.known.insert((expr, 1.0_f64.to_bits()), part);
                let derivative = (function.row().derivative)(self.graph, argument);
                if self.graph.is_zero(derivative) {
                    return None;
                }
                let derivative = self.of(derivative)?;
                self.list[part] = Part::Apply(function, a, derivative);
                part
            }
        })
    }

    fn varies(&self, symbol: Symbol) -> bool {
        symbol == Symbol::Time || self.state.contains(&symbol)
    }

    /// What is the same everywhere, and the product of the rest.
    fn split(&mut self, factor: f64, term: Expr) -> Option<(Slot, Option<usize>)> {
        let factors: Vec<(Expr, f64)> = match self.graph.node(term) {
            Node::Product(factors) => factors.iter().map(|&(b, e)| (b, e.value())).collect(),
            _ => vec![(term, 1.0)],
        };
        let mut slot = Slot::number(factor);
        let mut product: Option<usize> = None;
        for (base, exponent) in factors {
            if !self.graph.symbols(&[base]).iter().any(|&symbol| self.varies(symbol)) {
                slot.parts.push((base, exponent));
                continue;
            }
            let part = self.power(base, exponent)?;
            product = Some(match product {
                Some(before) => self.push(Part::Product(before, part)),
                None => part,
            });
        }
        Some((slot, product))
    }
}

/// The series, coefficient by coefficient.
struct Unrolled {
    parts: Vec<Part>,
    series: Vec<Vec<Coefficient>>,
    code: Vec<Instruction>,
    numbered: FxHashMap<Instruction, Value>,
    slots: Vec<Slot>,
}

impl Unrolled {
    fn new(parts: Vec<Part>) -> Unrolled {
        let series = vec![Vec::new(); parts.len()];
        Unrolled {
            parts,
            series,
            code: Vec::new(),
            numbered: FxHashMap::default(),
            slots: Vec::new(),
        }
    }

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
        if let Some(at) = self.slots.iter().position(|known| *known == slot) {
            return at as u32;
        }
        self.slots.push(slot);
        (self.slots.len() - 1) as u32
    }

    fn as_value(&mut self, coefficient: Coefficient) -> Value {
        let slot = match coefficient {
            Coefficient::Value(value) => return value,
            Coefficient::Uniform(slot) => slot,
            Coefficient::Zero => Slot::number(0.0),
        };
        let slot = self.slot(slot);
        self.emit(Instruction::Broadcast { slot })
    }

    fn scaled(&mut self, factor: f64, coefficient: Coefficient) -> Coefficient {
        match coefficient {
            Coefficient::Zero => Coefficient::Zero,
            coefficient if factor == 1.0 => coefficient,
            Coefficient::Uniform(slot) => {
                Coefficient::Uniform(Slot { factor: factor * slot.factor, ..slot })
            }
            Coefficient::Value(a) => {
                let slot = self.slot(Slot::number(factor));
                Coefficient::Value(self.emit(Instruction::Scale { a, slot }))
            }
        }
    }

    /// total + a * b.
    fn add_product(&mut self, total: Coefficient, a: &Coefficient, b: &Coefficient) -> Coefficient {
        use Coefficient::{Uniform, Value, Zero};
        match (a, b, total) {
            (Zero, _, total) | (_, Zero, total) => total,
            (Uniform(a), Uniform(b), total) => {
                let mut slot = Slot { factor: a.factor * b.factor, parts: a.parts.clone() };
                slot.parts.extend_from_slice(&b.parts);
                self.add(total, Uniform(slot))
            }
            (Uniform(slot), &Value(b), total) | (&Value(b), Uniform(slot), total) => {
                let slot = self.slot(slot.clone());
                Value(match total {
                    Zero => self.emit(Instruction::Scale { a: b, slot }),
                    Value(a) => self.emit(Instruction::AddScaled { a, b, slot }),
                    Uniform(shift) => {
                        let shift = self.slot(shift);
                        self.emit(Instruction::ScaleShift { a: b, slot, shift })
                    }
                })
            }
            (&Value(a), &Value(b), total) => Value(match total {
                Zero => self.emit(Instruction::Multiply { a, b }),
                Value(c) => self.emit(Instruction::MultiplyAdd { a, b, c }),
                Uniform(slot) => {
                    let slot = self.slot(slot);
                    self.emit(Instruction::MultiplyShift { a, b, slot })
                }
            }),
        }
    }

    fn add(&mut self, a: Coefficient, b: Coefficient) -> Coefficient {
        use Coefficient::{Uniform, Value, Zero};
        match (a, b) {
            (Zero, other) | (other, Zero) => other,
            (Value(a), Value(b)) => Value(self.emit(Instruction::Add { a, b })),
            (Value(a), Uniform(slot)) | (Uniform(slot), Value(a)) => {
                let slot = self.slot(slot);
                Value(self.emit(Instruction::Shift { a, slot }))
            }
            (Uniform(a), b) => {
                let a = self.as_value(Uniform(a));
                self.add(Value(a), b)
            }
        }
    }

    /// Sum of a_j b_(k-j) for j from `first` to `last`; what became known last comes last, so
    /// that nothing waits for it.
    fn convolution(
        &mut self,
        a: usize,
        b: usize,
        k: usize,
        first: usize,
        last: usize,
    ) -> Coefficient {
        let mut order: Vec<usize> = (first..=last).collect();
        order.sort_by_key(|&j| j.max(k - j));
        let mut total = Coefficient::Zero;
        for j in order {
            let (x, y) = (self.series[a][j].clone(), self.series[b][k - j].clone());
            total = self.add_product(total, &x, &y);
        }
        total
    }

    /// Coefficient k + 1 of what has the rate `rate`.
    fn next(&mut self, rate: usize, k: usize) -> Coefficient {
        let factor = 1.0 / (k + 1) as f64;
        let whole = k + 1 == 3;
        if let Part::Linear(slots, terms) = self.parts[rate].clone() {
            let total = self.linear(if whole { 1.0 } else { factor }, slots, terms, k);
            return if whole { self.third(total) } else { total };
        }
        let rate = self.series[rate][k].clone();
        if whole { self.third(rate) } else { self.scaled(factor, rate) }
    }

    /// A third, rounded once. The number nearest to 1/3 is too small: over many steps that error,
    /// always to the same side, would be the largest of all. Thirds are divided out early, where
    /// the series is still large; what 1/5 and 1/7 do is lost among random errors.
    fn third(&mut self, coefficient: Coefficient) -> Coefficient {
        let Coefficient::Value(b) = coefficient else { return self.scaled(1.0 / 3.0, coefficient) };
        let rest = self.slot(Slot::number(f64::EPSILON / 12.0));
        let slot = self.slot(Slot::number(1.0 / 3.0));
        let a = self.emit(Instruction::Scale { a: b, slot: rest });
        Coefficient::Value(self.emit(Instruction::AddScaled { a, b, slot }))
    }

    /// Coefficient k of factor times a sum; what is known last comes last.
    fn linear(
        &mut self,
        factor: f64,
        slots: Vec<Slot>,
        mut terms: Vec<(Slot, usize)>,
        k: usize,
    ) -> Coefficient {
        let mut total = Coefficient::Zero;
        for slot in slots.into_iter().filter(|_| k == 0) {
            let slot = Slot { factor: factor * slot.factor, ..slot };
            total = self.add(total, Coefficient::Uniform(slot));
        }
        terms.sort_by_key(|&(_, term)| !matches!(self.parts[term], Part::State(_) | Part::Time));
        for (slot, term) in terms {
            let slot = Slot { factor: factor * slot.factor, ..slot };
            let term = self.series[term][k].clone();
            total = if slot.is_one() {
                self.add(total, term)
            } else {
                self.add_product(total, &Coefficient::Uniform(slot), &term)
            };
        }
        total
    }

    fn coefficient(&mut self, part: usize, k: usize, rates: &[usize]) -> Coefficient {
        let first = k == 0;
        match self.parts[part].clone() {
            Part::State(row) if first => {
                Coefficient::Value(self.emit(Instruction::Load { input: row as u32 }))
            }
            Part::State(row) => self.next(rates[row], k - 1),
            Part::Time if first => {
                let input = rates.len() as u32;
                Coefficient::Value(self.emit(Instruction::Load { input }))
            }
            Part::Time if k == 1 => Coefficient::Uniform(Slot::number(1.0)),
            Part::Uniform(slot) if first => Coefficient::Uniform(slot),
            Part::Time | Part::Uniform(_) => Coefficient::Zero,
            Part::Linear(slots, terms) => self.linear(1.0, slots, terms, k),
            Part::Product(a, b) if a == b && k > 0 => {
                // Every product but the middle one comes twice.
                let half = self.convolution(a, a, k, 0, (k - 1) / 2);
                let twice = self.scaled(2.0, half);
                if k % 2 == 1 {
                    return twice;
                }
                let middle = self.series[a][k / 2].clone();
                self.add_product(twice, &middle, &middle)
            }
            Part::Product(a, b) => self.convolution(a, b, k, 0, k),
            Part::Reciprocal(a) if first => {
                let a = self.series[a][0].clone();
                let a = self.as_value(a);
                Coefficient::Value(self.emit(Instruction::Reciprocal { a }))
            }
            Part::Reciprocal(a) => {
                let sum = self.convolution(a, part, k, 1, k);
                let inverse = self.series[part][0].clone();
                let inverse = self.scaled(-1.0, inverse);
                self.add_product(Coefficient::Zero, &sum, &inverse)
            }
            Part::Raise(a, exponent) if first => {
                let a = self.series[a][0].clone();
                let a = self.as_value(a);
                let slot = self.slot(Slot::number(exponent));
                Coefficient::Value(self.emit(Instruction::Raise { a, slot }))
            }
            Part::Raise(a, exponent) => {
                let mut total = Coefficient::Zero;
                for j in 1..=k {
                    let (x, y) = (self.series[a][j].clone(), self.series[part][k - j].clone());
                    let product = self.add_product(Coefficient::Zero, &x, &y);
                    let weight = (exponent * j as f64 - (k - j) as f64) / k as f64;
                    let weight = Coefficient::Uniform(Slot::number(weight));
                    total = self.add_product(total, &weight, &product);
                }
                let base = self.series[a][0].clone();
                let a = self.as_value(base);
                let inverse = Coefficient::Value(self.emit(Instruction::Reciprocal { a }));
                self.add_product(Coefficient::Zero, &total, &inverse)
            }
            Part::Apply(function, a, _) if first => {
                let a = self.series[a][0].clone();
                let a = self.as_value(a);
                Coefficient::Value(self.emit(Instruction::Apply { a, function }))
            }
            Part::Apply(_, a, derivative) => {
                // k w_k = sum of j u_j d_(k-j).
                let mut total = Coefficient::Zero;
                for j in 1..=k {
                    let x = self.series[a][j].clone();
                    let x = self.scaled(j as f64, x);
                    let y = self.series[derivative][k - j].clone();
                    total = self.add_product(total, &x, &y);
                }
                self.scaled(1.0 / k as f64, total)
            }
        }
    }
}
