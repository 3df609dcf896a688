//! Elementary functions: one row each, and everything that the crate knows about it.

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

/// One elementary function.
pub struct FunctionRow {
    /// Its name in the mini-language.
    pub name: &'static str,
    /// Its value at a number; NaN outside its domain.
    pub value: fn(f64) -> f64,
    /// Its derivative at an expression.
    pub derivative: fn(&mut Graph, Expr) -> Expr,
    /// Where it is defined.
    pub domain: Domain,
    /// f(-x) = -f(x).
    pub odd: bool,
    /// f(-x) = f(x).
    pub even: bool,
    /// It has neither kinks nor jumps where it is defined.
    pub smooth: bool,
    /// LaTeX command before the argument, as in `\sin`.
    pub latex: &'static str,
    /// Method of f64 in Rust.
    pub rust: &'static str,
    /// Function of C's math.h.
    pub c: &'static str,
    /// Function of SymPy.
    pub sympy: &'static str,
    /// Time relative to one multiplication.
    pub cost: u32,
}

/// An elementary function: a row of [`FUNCTIONS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Function(u8);

impl Function {
    /// Looks a name of the mini-language up.
    pub fn by_name(name: &str) -> Option<Function> {
        FUNCTIONS.iter().position(|row| row.name == name).map(|i| Function(i as u8))
    }

    /// Every function of the table.
    pub fn all() -> impl Iterator<Item = Function> {
        (0..FUNCTIONS.len()).map(|i| Function(i as u8))
    }

    /// The function's row of [`FUNCTIONS`].
    pub fn row(self) -> &'static FunctionRow {
        &FUNCTIONS[self.0 as usize]
    }

    /// A function that the source code names; the name must stand in the table.
    pub(crate) fn known(name: &str) -> Function {
        Function::by_name(name).expect("a name that the source code gives stands in FUNCTIONS")
    }
}

fn apply(graph: &mut Graph, name: &str, x: Expr) -> Expr {
    graph.apply(Function::known(name), x)
}

/// -1, 0 or 1; `f64::signum` would say 1 at zero.
fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

/// The elementary functions of the mini-language. A new one is one row here.
pub static FUNCTIONS: &[FunctionRow] = &[
    FunctionRow {
        name: "sin",
        value: f64::sin,
        derivative: |g, x| apply(g, "cos", x),
        domain: Domain::Real,
        odd: true,
        even: false,
        smooth: true,
        latex: r"\sin",
        rust: "sin",
        c: "sin",
        sympy: "sin",
        cost: 8,
    },
    FunctionRow {
        name: "cos",
        value: f64::cos,
        derivative: |g, x| {
            let sin = apply(g, "sin", x);
            g.negate(sin)
        },
        domain: Domain::Real,
        odd: false,
        even: true,
        smooth: true,
        latex: r"\cos",
        rust: "cos",
        c: "cos",
        sympy: "cos",
        cost: 8,
    },
    FunctionRow {
        name: "tan",
        value: f64::tan,
        derivative: |g, x| {
            let tan = apply(g, "tan", x);
            let square = g.power(tan, 2.0);
            let one = g.number(1.0);
            g.add(one, square)
        },
        domain: Domain::Real,
        odd: true,
        even: false,
        smooth: true,
        latex: r"\tan",
        rust: "tan",
        c: "tan",
        sympy: "tan",
        cost: 10,
    },
    FunctionRow {
        name: "asin",
        value: f64::asin,
        derivative: |g, x| one_plus_square(g, x, -1.0, -0.5),
        domain: Domain::UnitInterval,
        odd: true,
        even: false,
        smooth: true,
        latex: r"\arcsin",
        rust: "asin",
        c: "asin",
        sympy: "asin",
        cost: 12,
    },
    FunctionRow {
        name: "acos",
        value: f64::acos,
        derivative: |g, x| {
            let derivative = one_plus_square(g, x, -1.0, -0.5);
            g.negate(derivative)
        },
        domain: Domain::UnitInterval,
        odd: false,
        even: false,
        smooth: true,
        latex: r"\arccos",
        rust: "acos",
        c: "acos",
        sympy: "acos",
        cost: 12,
    },
    FunctionRow {
        name: "atan",
        value: f64::atan,
        derivative: |g, x| one_plus_square(g, x, 1.0, -1.0),
        domain: Domain::Real,
        odd: true,
        even: false,
        smooth: true,
        latex: r"\arctan",
        rust: "atan",
        c: "atan",
        sympy: "atan",
        cost: 12,
    },
    FunctionRow {
        name: "sinh",
        value: f64::sinh,
        derivative: |g, x| apply(g, "cosh", x),
        domain: Domain::Real,
        odd: true,
        even: false,
        smooth: true,
        latex: r"\sinh",
        rust: "sinh",
        c: "sinh",
        sympy: "sinh",
        cost: 12,
    },
    FunctionRow {
        name: "cosh",
        value: f64::cosh,
        derivative: |g, x| apply(g, "sinh", x),
        domain: Domain::Real,
        odd: false,
        even: true,
        smooth: true,
        latex: r"\cosh",
        rust: "cosh",
        c: "cosh",
        sympy: "cosh",
        cost: 12,
    },
    FunctionRow {
        name: "tanh",
        value: f64::tanh,
        derivative: |g, x| {
            let tanh = apply(g, "tanh", x);
            let square = g.power(tanh, 2.0);
            let one = g.number(1.0);
            g.subtract(one, square)
        },
        domain: Domain::Real,
        odd: true,
        even: false,
        smooth: true,
        latex: r"\tanh",
        rust: "tanh",
        c: "tanh",
        sympy: "tanh",
        cost: 12,
    },
    FunctionRow {
        name: "exp",
        value: f64::exp,
        derivative: |g, x| apply(g, "exp", x),
        domain: Domain::Real,
        odd: false,
        even: false,
        smooth: true,
        latex: r"\exp",
        rust: "exp",
        c: "exp",
        sympy: "exp",
        cost: 8,
    },
    FunctionRow {
        name: "log",
        value: f64::ln,
        derivative: |g, x| g.power(x, -1.0),
        domain: Domain::Positive,
        odd: false,
        even: false,
        smooth: true,
        latex: r"\ln",
        rust: "ln",
        c: "log",
        sympy: "log",
        cost: 8,
    },
    FunctionRow {
        name: "sqrt",
        value: f64::sqrt,
        derivative: |g, x| {
            let sqrt = apply(g, "sqrt", x);
            let inverse = g.power(sqrt, -1.0);
            g.scale(0.5, inverse)
        },
        domain: Domain::NonNegative,
        odd: false,
        even: false,
        smooth: true,
        latex: r"\sqrt",
        rust: "sqrt",
        c: "sqrt",
        sympy: "sqrt",
        cost: 4,
    },
    FunctionRow {
        name: "abs",
        value: f64::abs,
        derivative: |g, x| apply(g, "sign", x),
        domain: Domain::Real,
        odd: false,
        even: true,
        smooth: false,
        latex: r"\operatorname{abs}",
        rust: "abs",
        c: "fabs",
        sympy: "Abs",
        cost: 1,
    },
    FunctionRow {
        // The derivative at the jump is taken as zero: a trajectory crosses it in no time.
        name: "sign",
        value: sign,
        derivative: |g, _| g.number(0.0),
        domain: Domain::Real,
        odd: true,
        even: false,
        smooth: false,
        latex: r"\operatorname{sign}",
        rust: "sign",
        c: "sign",
        sympy: "sign",
        cost: 2,
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
