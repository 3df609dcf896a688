//! Expressions as statements of a programming language.
//!
//! The statements do the evaluator's own operations in the evaluator's own order, so that
//! generated code agrees with the fitted model to rounding. Values that are used more than
//! once, or that would make a line too long, become numbered locals.

use std::collections::BTreeSet;

use super::model::{Identifiers, Model};
use crate::eval::{Inputs, Instruction, Lowered, Slot, Value};
use crate::expr::{Expr, Function, Graph, Node, Symbol};

/// How a language writes what is not common to all.
pub(super) struct Dialect {
    /// function(argument); the argument is text that binds like a name when `atom`.
    pub apply: fn(Function, &str, bool) -> String,
    /// base ^ exponent for a whole exponent.
    pub whole_power: fn(&str, i32, bool) -> String,
    /// base ^ exponent for any exponent.
    pub power: fn(&str, &str, bool) -> String,
}

/// Longest text that stands in a line.
const LINE: usize = 70;
/// Longest text of an operand inside a line that is too long, and of an argument.
const OPERAND: usize = 32;

/// The body of a function: locals in their order, then the outputs.
pub(super) struct Body {
    pub locals: Vec<(String, String)>,
    pub outputs: Vec<String>,
    /// Coordinates, momenta, time and inputs that occur.
    pub variables: BTreeSet<Symbol>,
}

/// The statements that compute the outputs from q, p and t.
pub(super) fn body(
    model: &Model,
    names: &Identifiers,
    dialect: &Dialect,
    outputs: &[Expr],
) -> Body {
    let graph = &model.graph;
    let variables: BTreeSet<Symbol> = graph
        .symbols(outputs)
        .into_iter()
        .filter(|s| !matches!(s, Symbol::Parameter(_) | Symbol::Coefficient(_)))
        .collect();
    let inputs = Inputs { varying: variables.iter().copied().collect(), uniform: Vec::new() };
    let lowered = Lowered::expanded(graph, &inputs, outputs);
    let mut uses = vec![0_u32; lowered.code.len()];
    for instruction in &lowered.code {
        for operand in instruction.operands() {
            uses[operand as usize] += 1;
        }
    }
    for &output in &lowered.outputs {
        uses[output as usize] += 1;
    }
    let mut writer = CodeWriter {
        graph,
        names,
        dialect,
        prefix: names.local_prefix(),
        texts: Vec::with_capacity(lowered.code.len()),
        locals: Vec::new(),
    };
    for (at, &instruction) in lowered.code.iter().enumerate() {
        // A value that nothing uses is a factor of a power that was built on the way.
        let text = writer.instruction(instruction, &inputs, &lowered);
        writer.texts.push(text);
        let plain = matches!(instruction, Instruction::Load { .. } | Instruction::Broadcast { .. });
        if uses[at] > 1 && !plain {
            writer.make_local(at as Value);
        }
    }
    let outputs = lowered.outputs.iter().map(|&v| writer.texts[v as usize].text.clone()).collect();
    Body { locals: writer.locals, outputs, variables }
}

/// How tightly a text holds together.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Precedence {
    Sum,
    Product,
    Atom,
}

#[derive(Clone)]
struct CodeText {
    text: String,
    strength: Precedence,
}

impl CodeText {
    fn new(text: impl Into<String>, strength: Precedence) -> CodeText {
        CodeText { text: text.into(), strength }
    }

    /// With parentheses when it is looser than `least`.
    fn within(&self, least: Precedence) -> String {
        if self.strength < least { format!("({})", self.text) } else { self.text.clone() }
    }

    fn is_atom(&self) -> bool {
        self.strength == Precedence::Atom
    }
}

struct CodeWriter<'a> {
    graph: &'a Graph,
    names: &'a Identifiers,
    dialect: &'a Dialect,
    prefix: &'static str,
    /// What each value is written as.
    texts: Vec<CodeText>,
    locals: Vec<(String, String)>,
}

impl CodeWriter<'_> {
    fn make_local(&mut self, value: Value) {
        let name = format!("{}{}", self.prefix, self.locals.len() + 1);
        let text = std::mem::replace(
            &mut self.texts[value as usize],
            CodeText::new(name.clone(), Precedence::Atom),
        );
        self.locals.push((name, text.text));
    }

    /// Writes an instruction; operands become locals until it fits in a line.
    fn instruction(
        &mut self,
        instruction: Instruction,
        inputs: &Inputs,
        lowered: &Lowered,
    ) -> CodeText {
        let operands: Vec<Value> = instruction.operands().collect();
        if let Instruction::Apply { a, .. }
        | Instruction::Raise { a, .. }
        | Instruction::Power { a, .. } = instruction
            && self.texts[a as usize].text.len() > OPERAND
        {
            self.make_local(a);
        }
        let text = self.compose(instruction, inputs, lowered);
        if text.text.len() <= LINE {
            return text;
        }
        for operand in operands {
            if self.texts[operand as usize].text.len() > OPERAND {
                self.make_local(operand);
            }
        }
        self.compose(instruction, inputs, lowered)
    }

    fn compose(&self, instruction: Instruction, inputs: &Inputs, lowered: &Lowered) -> CodeText {
        let of = |value: Value| &self.texts[value as usize];
        let slot = |slot: u32| &lowered.slots[slot as usize];
        match instruction {
            Instruction::Load { input } => {
                CodeText::new(self.names.of(inputs.varying[input as usize]), Precedence::Atom)
            }
            Instruction::Broadcast { slot: s } => {
                let (negative, text) = self.slot(slot(s));
                signed(negative, text.unwrap_or(CodeText::new("1.0", Precedence::Atom)))
            }
            Instruction::Scale { a, slot: s } => self.scaled(slot(s), of(a)),
            Instruction::AddScaled { a, b, slot: s } => {
                let (negative, factor) = self.slot(slot(s));
                let product = times(factor, of(b));
                let sign = if negative { '-' } else { '+' };
                let text = format!("{} {sign} {}", of(a).text, product.within(Precedence::Product));
                CodeText::new(text, Precedence::Sum)
            }
            Instruction::Shift { a, slot: s } => self.shifted(of(a), slot(s)),
            Instruction::Multiply { a, b } => product(of(a), of(b)),
            Instruction::Add { a, b } => {
                let text = format!("{} + {}", of(a).text, of(b).within(Precedence::Product));
                CodeText::new(text, Precedence::Sum)
            }
            Instruction::Subtract { a, b } => {
                let text = format!("{} - {}", of(a).text, of(b).within(Precedence::Product));
                CodeText::new(text, Precedence::Sum)
            }
            Instruction::MultiplyAdd { a, b, c } => {
                let text = format!("{} + {}", of(c).text, product(of(a), of(b)).text);
                CodeText::new(text, Precedence::Sum)
            }
            Instruction::MultiplyShift { a, b, slot: s } => {
                self.shifted(&product(of(a), of(b)), slot(s))
            }
            Instruction::ScaleShift { a, slot: s, shift } => {
                self.shifted(&self.scaled(slot(s), of(a)), slot(shift))
            }
            Instruction::Reciprocal { a } => CodeText::new(
                format!("1.0 / {}", of(a).within(Precedence::Atom)),
                Precedence::Product,
            ),
            Instruction::Raise { a, slot: s } => self.raise(of(a), slot(s).factor),
            Instruction::Power { a, b } => {
                let (a, b) = (of(a), of(b));
                CodeText::new((self.dialect.power)(&a.text, &b.text, a.is_atom()), Precedence::Atom)
            }
            Instruction::Apply { a, function } => self.apply(function, of(a)),
        }
    }

    fn shifted(&self, a: &CodeText, slot: &Slot) -> CodeText {
        let (negative, text) = self.slot(slot);
        let text = text.unwrap_or(CodeText::new("1.0", Precedence::Atom));
        let sign = if negative { '-' } else { '+' };
        let text = format!("{} {sign} {}", a.text, text.within(Precedence::Product));
        CodeText::new(text, Precedence::Sum)
    }

    fn scaled(&self, slot: &Slot, a: &CodeText) -> CodeText {
        let (negative, factor) = self.slot(slot);
        signed(negative, times(factor, a))
    }

    fn apply(&self, function: Function, argument: &CodeText) -> CodeText {
        let text = (self.dialect.apply)(function, &argument.text, argument.is_atom());
        CodeText::new(text, Precedence::Atom)
    }

    fn raise(&self, base: &CodeText, exponent: f64) -> CodeText {
        let whole = exponent.fract() == 0.0 && exponent.abs() <= 64.0;
        let text = if whole {
            (self.dialect.whole_power)(&base.text, exponent as i32, base.is_atom())
        } else {
            (self.dialect.power)(&base.text, &number(exponent), base.is_atom())
        };
        CodeText::new(text, Precedence::Atom)
    }

    /// A number that is the same at every point: whether it is negative, and its size;
    /// `None` for 1.
    fn slot(&self, slot: &Slot) -> (bool, Option<CodeText>) {
        let size = slot.factor.abs();
        let mut text: Option<CodeText> =
            (size != 1.0).then(|| CodeText::new(number(size), Precedence::Atom));
        let mut parts = slot.parts.iter().map(|&(expr, exponent)| {
            let base = self.uniform(expr);
            if exponent == 1.0 { base } else { self.raise(&base, exponent) }
        });
        let product = parts.next().map(|first| {
            parts.fold(first, |product, part| {
                let (a, b) = (product.within(Precedence::Product), part.within(Precedence::Atom));
                CodeText::new(format!("{a} * {b}"), Precedence::Product)
            })
        });
        if let Some(product) = product {
            text = Some(times(text, &product));
        }
        (slot.factor < 0.0, text)
    }

    /// An expression of learned numbers alone, in the order of the evaluator's scalar program.
    fn uniform(&self, expr: Expr) -> CodeText {
        match self.graph.node(expr) {
            Node::Number(value) => signed(
                value.value() < 0.0,
                CodeText::new(number(value.value().abs()), Precedence::Atom),
            ),
            Node::Symbol(symbol) => CodeText::new(self.names.of(*symbol), Precedence::Atom),
            Node::Sum { constant, terms } => {
                let mut sum = String::new();
                for &(term, factor) in terms.iter() {
                    let factor = factor.value();
                    let size = factor.abs();
                    let size = (size != 1.0).then(|| CodeText::new(number(size), Precedence::Atom));
                    let product = times(size, &self.uniform(term)).within(Precedence::Product);
                    sum += match (sum.is_empty(), factor < 0.0) {
                        (true, true) => "-",
                        (true, false) => "",
                        (false, true) => " - ",
                        (false, false) => " + ",
                    };
                    sum += &product;
                }
                let constant = constant.value();
                if constant != 0.0 {
                    let sign = if constant < 0.0 { '-' } else { '+' };
                    sum += &format!(" {sign} {}", number(constant.abs()));
                }
                CodeText::new(sum, Precedence::Sum)
            }
            Node::Product(parts) => {
                let slot = Slot {
                    factor: 1.0,
                    parts: parts.iter().map(|&(base, e)| (base, e.value())).collect(),
                };
                self.slot(&slot).1.unwrap_or(CodeText::new("1.0", Precedence::Atom))
            }
            Node::Power(base, exponent) => {
                let (base, exponent) = (self.uniform(*base), self.uniform(*exponent));
                let text = (self.dialect.power)(&base.text, &exponent.text, base.is_atom());
                CodeText::new(text, Precedence::Atom)
            }
            Node::Apply(function, argument) => self.apply(*function, &self.uniform(*argument)),
        }
    }
}

fn product(a: &CodeText, b: &CodeText) -> CodeText {
    let (a, b) = (a.within(Precedence::Product), b.within(Precedence::Atom));
    CodeText::new(format!("{a} * {b}"), Precedence::Product)
}

/// factor * a, multiplied from left to right with a as a whole.
fn times(factor: Option<CodeText>, a: &CodeText) -> CodeText {
    match factor {
        None => a.clone(),
        Some(factor) => {
            let (factor, a) = (factor.within(Precedence::Product), a.within(Precedence::Atom));
            CodeText::new(format!("{factor} * {a}"), Precedence::Product)
        }
    }
}

fn signed(negative: bool, text: CodeText) -> CodeText {
    if !negative {
        return text;
    }
    // A minus sign stands in front of a product only: it binds like a sum inside another.
    CodeText::new(format!("-{}", text.within(Precedence::Product)), Precedence::Sum)
}

/// The shortest decimal with a point or an exponent that reads back as the same number.
pub(super) fn number(value: f64) -> String {
    let plain = value == 0.0 || (1e-5..1e16).contains(&value.abs());
    if plain { format!("{value:?}") } else { format!("{value:e}") }
}
