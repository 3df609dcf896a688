//! The table of elementary functions.

use super::super::graph::{Expr, Graph};
use super::{
    Domain, Function, FunctionRow, Kernel, Latex, MachineInstruction, SignRule, Target, UnitRule,
};

/// -1, 0 or 1; `f64::signum` would say 1 at zero.
fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

const RUST_SIGN: &str = "\
/// -1, 0 or 1.
fn sign(x: f64) -> f64 {
    if x == 0.0 {
        0.0
    } else {
        x.signum()
    }
}
";

const C_SIGN: &str = "\
/* -1, 0 or 1. */
static double sign(double x) {
    return (double)((x > 0.0) - (x < 0.0));
}
";

/// What most functions have in common. Whatever a row does not say is as here: true of every
/// function, if not all that is true of it. The fields without a usual value are left empty.
const USUAL: FunctionRow = FunctionRow {
    name: "",
    aliases: &[],
    value: |_| f64::NAN,
    derivative: |_, x| x,
    domain: Domain::Real,
    odd: false,
    even: false,
    of_side: None,
    half_turn: None,
    exact: &[],
    sign: SignRule::Unknown,
    unit: UnitRule::Number,
    kernel: None,
    instruction: None,
    cost: 12,
    latex: Latex::Command(""),
    rust: Target::library(""),
    c: Target::library(""),
    sympy: "",
};

/// The elementary functions of the mini-language. A new one is one row here.
pub static FUNCTIONS: &[FunctionRow] = &[
    FunctionRow {
        name: "sin",
        value: f64::sin,
        derivative: |g, x| g.apply(Function::COS, x),
        odd: true,
        half_turn: Some(-1.0),
        exact: &[(0, 0)],
        kernel: Some(Kernel::Sine),
        cost: 8,
        latex: Latex::Command(r"\sin"),
        rust: Target::library("sin"),
        c: Target::library("sin"),
        sympy: "sin",
        ..USUAL
    },
    FunctionRow {
        name: "cos",
        value: f64::cos,
        derivative: |g, x| {
            let sin = g.apply(Function::SIN, x);
            g.negate(sin)
        },
        even: true,
        half_turn: Some(-1.0),
        exact: &[(0, 1)],
        kernel: Some(Kernel::Cosine),
        cost: 8,
        latex: Latex::Command(r"\cos"),
        rust: Target::library("cos"),
        c: Target::library("cos"),
        sympy: "cos",
        ..USUAL
    },
    FunctionRow {
        name: "tan",
        value: f64::tan,
        derivative: |g, x| {
            let tan = g.apply(Function::TAN, x);
            let square = g.power(tan, 2.0);
            let one = g.number(1.0);
            g.add(one, square)
        },
        odd: true,
        half_turn: Some(1.0),
        exact: &[(0, 0)],
        kernel: Some(Kernel::Tangent),
        cost: 10,
        latex: Latex::Command(r"\tan"),
        rust: Target::library("tan"),
        c: Target::library("tan"),
        sympy: "tan",
        ..USUAL
    },
    FunctionRow {
        name: "asin",
        aliases: &["arcsin"],
        value: f64::asin,
        derivative: |g, x| one_plus_square(g, x, -1.0, -0.5),
        domain: Domain::UnitInterval,
        odd: true,
        exact: &[(0, 0)],
        sign: SignRule::OfArgument,
        cost: 12,
        latex: Latex::Command(r"\arcsin"),
        rust: Target::library("asin"),
        c: Target::library("asin"),
        sympy: "asin",
        ..USUAL
    },
    FunctionRow {
        name: "acos",
        aliases: &["arccos"],
        value: f64::acos,
        derivative: |g, x| {
            let derivative = one_plus_square(g, x, -1.0, -0.5);
            g.negate(derivative)
        },
        domain: Domain::UnitInterval,
        exact: &[(1, 0)],
        cost: 12,
        latex: Latex::Command(r"\arccos"),
        rust: Target::library("acos"),
        c: Target::library("acos"),
        sympy: "acos",
        ..USUAL
    },
    FunctionRow {
        name: "atan",
        aliases: &["arctan"],
        value: f64::atan,
        derivative: |g, x| one_plus_square(g, x, 1.0, -1.0),
        odd: true,
        exact: &[(0, 0)],
        sign: SignRule::OfArgument,
        cost: 12,
        latex: Latex::Command(r"\arctan"),
        rust: Target::library("atan"),
        c: Target::library("atan"),
        sympy: "atan",
        ..USUAL
    },
    FunctionRow {
        name: "sinh",
        value: f64::sinh,
        derivative: |g, x| g.apply(Function::COSH, x),
        odd: true,
        exact: &[(0, 0)],
        sign: SignRule::OfArgument,
        kernel: Some(Kernel::HyperbolicSine),
        cost: 12,
        latex: Latex::Command(r"\sinh"),
        rust: Target::library("sinh"),
        c: Target::library("sinh"),
        sympy: "sinh",
        ..USUAL
    },
    FunctionRow {
        name: "cosh",
        value: f64::cosh,
        derivative: |g, x| g.apply(Function::SINH, x),
        even: true,
        exact: &[(0, 1)],
        sign: SignRule::Positive,
        kernel: Some(Kernel::HyperbolicCosine),
        cost: 12,
        latex: Latex::Command(r"\cosh"),
        rust: Target::library("cosh"),
        c: Target::library("cosh"),
        sympy: "cosh",
        ..USUAL
    },
    FunctionRow {
        name: "tanh",
        value: f64::tanh,
        derivative: |g, x| {
            let tanh = g.apply(Function::TANH, x);
            let square = g.power(tanh, 2.0);
            let one = g.number(1.0);
            g.subtract(one, square)
        },
        odd: true,
        exact: &[(0, 0)],
        sign: SignRule::OfArgument,
        kernel: Some(Kernel::HyperbolicTangent),
        cost: 12,
        latex: Latex::Command(r"\tanh"),
        rust: Target::library("tanh"),
        c: Target::library("tanh"),
        sympy: "tanh",
        ..USUAL
    },
    FunctionRow {
        name: "exp",
        value: f64::exp,
        derivative: |g, x| g.apply(Function::EXP, x),
        exact: &[(0, 1)],
        sign: SignRule::Positive,
        kernel: Some(Kernel::Exponential),
        cost: 8,
        latex: Latex::Command(r"\exp"),
        rust: Target::library("exp"),
        c: Target::library("exp"),
        sympy: "exp",
        ..USUAL
    },
    FunctionRow {
        name: "log",
        aliases: &["ln"],
        value: f64::ln,
        derivative: |g, x| g.power(x, -1.0),
        domain: Domain::Positive,
        exact: &[(1, 0)],
        kernel: Some(Kernel::Logarithm),
        cost: 8,
        latex: Latex::Command(r"\ln"),
        rust: Target::library("ln"),
        c: Target::library("log"),
        sympy: "log",
        ..USUAL
    },
    FunctionRow {
        name: "sqrt",
        value: f64::sqrt,
        derivative: |g, x| {
            let sqrt = g.apply(Function::SQRT, x);
            let inverse = g.power(sqrt, -1.0);
            g.scale(0.5, inverse)
        },
        domain: Domain::NonNegative,
        exact: &[(0, 0), (1, 1)],
        sign: SignRule::NonNegative,
        unit: UnitRule::Power(1, 2),
        kernel: Some(Kernel::SquareRoot),
        instruction: Some(MachineInstruction::SquareRoot),
        cost: 4,
        latex: Latex::Radical,
        rust: Target::library("sqrt"),
        c: Target::library("sqrt"),
        sympy: "sqrt",
        ..USUAL
    },
    FunctionRow {
        name: "abs",
        value: f64::abs,
        derivative: |g, x| g.apply(Function::SIGN, x),
        even: true,
        of_side: Some(|g, x, side| g.multiply(side, x)),
        exact: &[(0, 0), (1, 1)],
        sign: SignRule::NonNegative,
        unit: UnitRule::Kept,
        kernel: Some(Kernel::AbsoluteValue),
        instruction: Some(MachineInstruction::ClearSign),
        cost: 1,
        latex: Latex::Bars,
        rust: Target::library("abs"),
        c: Target::library("fabs"),
        sympy: "Abs",
        ..USUAL
    },
    FunctionRow {
        // The derivative at the jump is taken as zero: a trajectory crosses it in no time.
        name: "sign",
        aliases: &["sgn", "signum"],
        value: sign,
        derivative: |g, _| g.number(0.0),
        odd: true,
        of_side: Some(|_, _, side| side),
        exact: &[(0, 0), (1, 1)],
        sign: SignRule::OfArgument,
        unit: UnitRule::Dropped,
        kernel: Some(Kernel::Sign),
        cost: 2,
        latex: Latex::Command(r"\operatorname{sign}"),
        rust: Target::defined("sign", RUST_SIGN),
        c: Target::defined("sign", C_SIGN),
        sympy: "sign",
        ..USUAL
    },
    FunctionRow {
        name: "asinh",
        aliases: &["arsinh"],
        value: f64::asinh,
        derivative: |g, x| one_plus_square(g, x, 1.0, -0.5),
        odd: true,
        exact: &[(0, 0)],
        sign: SignRule::OfArgument,
        cost: 14,
        latex: Latex::Command(r"\operatorname{arsinh}"),
        rust: Target::library("asinh"),
        c: Target::library("asinh"),
        sympy: "asinh",
        ..USUAL
    },
];

/// (1 + c x^2)^exponent.
fn one_plus_square(graph: &mut Graph, x: Expr, c: f64, exponent: f64) -> Expr {
    let square = graph.power(x, 2.0);
    let scaled = graph.scale(c, square);
    let one = graph.number(1.0);
    let sum = graph.add(one, scaled);
    graph.power(sum, exponent)
}
