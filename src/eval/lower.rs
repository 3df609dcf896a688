//! From expressions to a list of instructions in single-assignment form.
//!
//! Whatever is the same at every point (numbers, coefficients and what is made of
//! them) becomes a *slot*, computed once a call. Powers are chains of products, and
//! products of the same leading factors are shared.

use std::collections::HashMap;

use super::Inputs;
use crate::expr::{Expr, Function, Graph, Node, Symbol};

/// Result of an instruction, named by its place in [`Lowered::code`].
pub type Value = u32;

/// One instruction over a block of points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Instruction {
    /// A row of the points.
    Load {
        input: u32,
    },
    /// The same number at every point.
    Broadcast {
        slot: u32,
    },
    /// a * slot.
    Scale {
        a: Value,
        slot: u32,
    },
    /// a + b * slot.
    AddScaled {
        a: Value,
        b: Value,
        slot: u32,
    },
    /// a + slot.
    Shift {
        a: Value,
        slot: u32,
    },
    Multiply {
        a: Value,
        b: Value,
    },
    Reciprocal {
        a: Value,
    },
    /// a ^ slot.
    Raise {
        a: Value,
        slot: u32,
    },
    /// a ^ b.
    Power {
        a: Value,
        b: Value,
    },
    Apply {
        a: Value,
        function: Function,
    },
}

impl Instruction {
    /// The values that the instruction reads.
    pub fn operands(self) -> [Option<Value>; 2] {
        match self {
            Instruction::Load { .. } | Instruction::Broadcast { .. } => [None, None],
            Instruction::Scale { a, .. }
            | Instruction::Shift { a, .. }
            | Instruction::Reciprocal { a }
            | Instruction::Raise { a, .. }
            | Instruction::Apply { a, .. } => [Some(a), None],
            Instruction::AddScaled { a, b, .. }
            | Instruction::Multiply { a, b }
            | Instruction::Power { a, b } => [Some(a), Some(b)],
        }
    }
}

/// A number computed once a call: factor * product of expr ^ exponent, each expr uniform.
#[derive(Debug, Clone, PartialEq)]
pub struct Slot {
    pub factor: f64,
    pub parts: Vec<(Expr, f64)>,
}

/// Largest whole exponent that becomes a chain of products.
const LONGEST_CHAIN: f64 = 64.0;

/// Expressions as instructions.
pub struct Lowered {
    pub code: Vec<Instruction>,
    pub slots: Vec<Slot>,
    /// For each output, the value to store.
    pub outputs: Vec<Value>,
}

impl Lowered {
    pub fn new(graph: &Graph, inputs: &Inputs, outputs: &[Expr]) -> Lowered {
        let varying = inputs.varying.iter().enumerate().map(|(i, &s)| (s, i as u32)).collect();
        let mut lowering = Lowering {
            graph,
            varying,
            uniform: HashMap::new(),
            code: Vec::new(),
            slots: Vec::new(),
            slot_index: HashMap::new(),
            values: HashMap::new(),
            products: HashMap::new(),
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
        Lowered { code: lowering.code, slots: lowering.slots, outputs }
    }
}

struct Lowering<'a> {
    graph: &'a Graph,
    varying: HashMap<Symbol, u32>,
    uniform: HashMap<Expr, bool>,
    code: Vec<Instruction>,
    slots: Vec<Slot>,
    slot_index: HashMap<(u64, Vec<(Expr, u64)>), u32>,
    values: HashMap<Expr, Value>,
    /// Products by their leading factors.
    products: HashMap<Vec<(Expr, u64)>, Value>,
}

impl Lowering<'_> {
    fn emit(&mut self, instruction: Instruction) -> Value {
        self.code.push(instruction);
        (self.code.len() - 1) as Value
    }

    fn slot(&mut self, factor: f64, parts: Vec<(Expr, f64)>) -> u32 {
        let key = (factor.to_bits(), parts.iter().map(|&(e, x)| (e, x.to_bits())).collect());
        if let Some(&slot) = self.slot_index.get(&key) {
            return slot;
        }
        let slot = self.slots.len() as u32;
        self.slots.push(Slot { factor, parts });
        self.slot_index.insert(key, slot);
        slot
    }

    fn value(&mut self, expr: Expr) -> Value {
        if let Some(&value) = self.values.get(&expr) {
            return value;
        }
        let value = if self.uniform[&expr] {
            let slot = self.slot(1.0, vec![(expr, 1.0)]);
            self.emit(Instruction::Broadcast { slot })
        } else {
            match self.graph.node(expr).clone() {
                Node::Number(number) => {
                    let slot = self.slot(number.value(), Vec::new());
                    self.emit(Instruction::Broadcast { slot })
                }
                Node::Symbol(symbol) => {
                    let input = self.varying[&symbol];
                    self.emit(Instruction::Load { input })
                }
                Node::Sum { constant, terms } => {
                    let terms: Vec<_> = terms.iter().map(|&(t, c)| (t, c.value())).collect();
                    self.sum(constant.value(), &terms)
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
    fn split(&self, factor: f64, term: Expr) -> (Slot, Vec<(Expr, f64)>) {
        let parts: Vec<(Expr, f64)> = match self.graph.node(term) {
            Node::Product(parts) => parts.iter().map(|&(b, e)| (b, e.value())).collect(),
            _ => vec![(term, 1.0)],
        };
        let (same, varying) = parts.into_iter().partition(|(base, _)| self.uniform[base]);
        (Slot { factor, parts: same }, varying)
    }

    fn scaled(&mut self, a: Value, slot: Slot) -> Value {
        if slot.parts.is_empty() && slot.factor == 1.0 {
            return a;
        }
        let slot = self.slot(slot.factor, slot.parts);
        self.emit(Instruction::Scale { a, slot })
    }

    fn sum(&mut self, constant: f64, terms: &[(Expr, f64)]) -> Value {
        let mut total: Option<Value> = None;
        let mut shifts: Vec<u32> = Vec::new();
        if constant != 0.0 {
            shifts.push(self.slot(constant, Vec::new()));
        }
        for &(term, factor) in terms {
            let (slot, factors) = self.split(factor, term);
            if factors.is_empty() {
                shifts.push(self.slot(slot.factor, slot.parts));
                continue;
            }
            let b = self.chain(&factors);
            total = Some(match total {
                None => self.scaled(b, slot),
                Some(a) => {
                    let slot = self.slot(slot.factor, slot.parts);
                    self.emit(Instruction::AddScaled { a, b, slot })
                }
            });
        }
        let mut total = total.expect("a varying sum has a varying term");
        for slot in shifts {
            total = self.emit(Instruction::Shift { a: total, slot });
        }
        total
    }

    /// The product of varying powers; products with the same leading factors share them.
    fn chain(&mut self, factors: &[(Expr, f64)]) -> Value {
        let key: Vec<(Expr, u64)> = factors.iter().map(|&(b, e)| (b, e.to_bits())).collect();
        if let Some(&value) = self.products.get(&key) {
            return value;
        }
        let value = match *factors {
            [(base, exponent)] => self.power(base, exponent),
            [ref leading @ .., last] => {
                let a = self.chain(leading);
                let b = self.chain(&[last]);
                self.emit(Instruction::Multiply { a, b })
            }
            [] => {
                let slot = self.slot(1.0, Vec::new());
                self.emit(Instruction::Broadcast { slot })
            }
        };
        self.products.insert(key, value);
        value
    }

    fn power(&mut self, base: Expr, exponent: f64) -> Value {
        let a = self.value(base);
        if exponent == 1.0 {
            return a;
        }
        let size = exponent.abs();
        if exponent.fract() != 0.0 || size > LONGEST_CHAIN {
            let slot = self.slot(exponent, Vec::new());
            return self.emit(Instruction::Raise { a, slot });
        }
        if exponent < 0.0 {
            let a = self.chain(&[(base, size)]);
            return self.emit(Instruction::Reciprocal { a });
        }
        let below = [(base, (size - 1.0).to_bits())];
        let (low, high) = if self.products.contains_key(&below[..]) {
            (1.0, size - 1.0)
        } else {
            ((size / 2.0).floor(), (size / 2.0).ceil())
        };
        let a = self.chain(&[(base, low)]);
        let b = self.chain(&[(base, high)]);
        self.emit(Instruction::Multiply { a, b })
    }
}
