//! Elementary functions. Everything that the crate knows about one stands in its row of
//! [`FUNCTIONS`]: its value and derivative, symmetries, units and signs, how it is compiled, and
//! how every target language writes it. A new function is one new row.

mod of_two;
mod rows;

pub use of_two::{FUNCTIONS_OF_TWO, FunctionOfTwo};
pub use rows::FUNCTIONS;

use super::graph::{Expr, Graph};

/// Where a function is defined on the real line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    /// Every real number.
    Real,
    /// x > 0.
    Positive,
    /// x >= 0.
    NonNegative,
    /// -1 <= x <= 1.
    UnitInterval,
}

impl Domain {
    /// An interval on which the function may be sampled, for tests and checks.
    pub fn sample_interval(self) -> (f64, f64) {
        match self {
            Domain::Real => (-1.4, 1.4),
            Domain::Positive | Domain::NonNegative => (0.1, 3.0),
            Domain::UnitInterval => (-0.95, 0.95),
        }
    }
}

/// What a function asks of the unit of its argument, and the unit of its value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UnitRule {
    /// A number without a unit, whose function is one too.
    Number,
    /// Any unit, which the value has as well.
    Kept,
    /// Any unit; the value is a number without one.
    Dropped,
    /// Any unit; the value has this power of it, numerator and denominator.
    Power(i32, i32),
}

/// What is certain about the sign of a value, wherever the function is defined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SignRule {
    /// Nothing.
    Unknown,
    /// It is positive everywhere.
    Positive,
    /// It is never negative, and positive where the argument is.
    NonNegative,
    /// It is that of the argument: positive, zero or negative together.
    OfArgument,
}

/// Vectorised code of a function in `eval::elementary`: fused arithmetic without a branch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Kernel {
    Sine,
    Cosine,
    Tangent,
    Exponential,
    Logarithm,
    HyperbolicSine,
    HyperbolicCosine,
    HyperbolicTangent,
    SquareRoot,
    AbsoluteValue,
    Sign,
}

/// A single instruction of the processor that computes a function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MachineInstruction {
    /// The square root.
    SquareRoot,
    /// The number without its sign bit.
    ClearSign,
}

/// How LaTeX sets a function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Latex {
    /// A command before the argument in parentheses, as in `\sin`.
    Command(&'static str),
    /// A radical sign over the argument.
    Radical,
    /// A bar on both sides of the argument.
    Bars,
}

/// What a target language calls a function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Target {
    /// The name.
    pub name: &'static str,
    /// The definition that goes into the generated source, where the language's own library
    /// has no such function.
    pub definition: Option<&'static str>,
}

impl Target {
    /// A function of the language's library.
    const fn library(name: &'static str) -> Target {
        Target { name, definition: None }
    }

    /// A function that is generated with the model.
    const fn defined(name: &'static str, definition: &'static str) -> Target {
        Target { name, definition: Some(definition) }
    }
}

/// One elementary function.
pub struct FunctionRow {
    /// Its name in the mini-language.
    pub name: &'static str,
    /// Other names that the mini-language takes for it.
    pub aliases: &'static [&'static str],
    /// Its value at a number; NaN outside its domain.
    pub value: fn(f64) -> f64,
    /// Its derivative at an expression. The recurrence of its Taylor series is made from it.
    pub derivative: fn(&mut Graph, Expr) -> Expr,
    /// Where it is defined.
    pub domain: Domain,
    /// f(-x) = -f(x).
    pub odd: bool,
    /// f(-x) = f(x).
    pub even: bool,
    /// For one with a kink or a jump where its argument passes zero: what it is on one side,
    /// from its argument and the sign of that side.
    pub of_side: Option<fn(&mut Graph, Expr, Expr) -> Expr>,
    /// f(x + pi) / f(x), where that is the same for all x.
    pub half_turn: Option<f64>,
    /// Whole numbers whose function is whole: (argument, value).
    pub exact: &'static [(i64, i64)],
    /// The sign of its values.
    pub sign: SignRule,
    /// The units of its argument and of its value.
    pub unit: UnitRule,
    /// Its vectorised code; without it `value` is called for one number after the other.
    pub kernel: Option<Kernel>,
    /// What machine code does in line; without it a function is a call.
    pub instruction: Option<MachineInstruction>,
    /// Time relative to one multiplication.
    pub cost: u32,
    /// How LaTeX sets it.
    pub latex: Latex,
    /// Method of f64 in Rust, or a function that is generated.
    pub rust: Target,
    /// Function of C's math.h, or one that is generated.
    pub c: Target,
    /// Function of SymPy.
    pub sympy: &'static str,
}

impl FunctionRow {
    /// Whether it has neither kinks nor jumps where it is defined.
    pub fn is_smooth(&self) -> bool {
        self.of_side.is_none()
    }
}

/// An elementary function: a row of [`FUNCTIONS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Function(u8);

impl Function {
    /// The sine.
    pub const SIN: Function = Function::named("sin");
    /// The cosine.
    pub const COS: Function = Function::named("cos");
    /// The tangent.
    pub const TAN: Function = Function::named("tan");
    /// The inverse of the tangent.
    pub const ATAN: Function = Function::named("atan");
    /// The hyperbolic sine.
    pub const SINH: Function = Function::named("sinh");
    /// The hyperbolic cosine.
    pub const COSH: Function = Function::named("cosh");
    /// The hyperbolic tangent.
    pub const TANH: Function = Function::named("tanh");
    /// The exponential function.
    pub const EXP: Function = Function::named("exp");
    /// The natural logarithm.
    pub const LOG: Function = Function::named("log");
    /// The square root.
    pub const SQRT: Function = Function::named("sqrt");
    /// The absolute value.
    pub const ABS: Function = Function::named("abs");
    /// The sign: -1, 0 or 1.
    pub const SIGN: Function = Function::named("sign");

    /// Looks a name of the mini-language up.
    pub fn by_name(name: &str) -> Option<Function> {
        Function::all().find(|function| function.row().name == name)
    }

    /// Looks a name or another name of the mini-language up.
    pub fn by_any_name(name: &str) -> Option<Function> {
        let known = |row: &FunctionRow| row.name == name || row.aliases.contains(&name);
        Function::all().find(|function| known(function.row()))
    }

    /// Every function of the table.
    pub fn all() -> impl Iterator<Item = Function> {
        (0..FUNCTIONS.len()).map(|i| Function(i as u8))
    }

    /// The function's row of [`FUNCTIONS`].
    pub fn row(self) -> &'static FunctionRow {
        &FUNCTIONS[self.0 as usize]
    }

    /// The row of a name, while compiling: a name that is missing is an error of the compiler.
    const fn named(name: &str) -> Function {
        let mut row = 0;
        while !same(FUNCTIONS[row].name.as_bytes(), name.as_bytes()) {
            row += 1;
        }
        Function(row as u8)
    }
}

/// Whether two texts are the same; `==` cannot be used while compiling.
const fn same(a: &[u8], b: &[u8]) -> bool {
    let mut at = 0;
    while at < a.len() && at < b.len() && a[at] == b[at] {
        at += 1;
    }
    at == a.len() && at == b.len()
}
