//! The rewrites: one row each, tested one by one in `tests/numerics/rules.rs`.

use std::sync::LazyLock;

use egg::{ConditionalApplier, EGraph, Id, Pattern, RecExpr, Rewrite, Subst, Var};

use super::analysis::{Folding, Sign};
use super::lang::{Math, evaluate};
use crate::expr::Symbol;

/// When a rewrite holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Condition {
    /// Wherever both sides are defined.
    Always,
    /// This variable is not negative.
    NonNegative(&'static str),
    /// This variable is positive.
    Positive(&'static str),
    /// This variable stands for a number. Not needed for truth: people take 1/2 out of a
    /// sum, but not q^2.
    Number(&'static str),
}

/// What a rewrite is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RuleKind {
    /// Neutral elements, signs, powers.
    Arithmetic,
    /// Common factors and squares.
    Factor,
    /// Shifts and parities of periodic functions, and their identities.
    Trigonometric,
    /// Exponentials, logarithms, roots, absolute values.
    Transcendental,
    /// Order of sums and products: small expressions only, since they multiply.
    Reorder,
}

/// A rewrite from `left` to `right`, in prefix notation: `(+ ?x (- ?y))`, pattern variables with a
/// question mark.
#[derive(Debug, Clone, Copy)]
pub struct Rule {
    /// Its own name.
    pub name: &'static str,
    /// What is found.
    pub left: &'static str,
    /// What it equals.
    pub right: &'static str,
    /// When it holds.
    pub condition: Condition,
    /// What it is for.
    pub kind: RuleKind,
}

const fn rule(
    kind: RuleKind,
    name: &'static str,
    left: &'static str,
    right: &'static str,
    condition: Condition,
) -> Rule {
    Rule { name, left, right, condition, kind }
}

use Condition::{Always, NonNegative, Number, Positive};
use RuleKind::{Arithmetic, Factor, Reorder, Transcendental, Trigonometric};

/// Every rewrite. A new one is one row here.
#[rustfmt::skip]
pub static RULES: &[Rule] = &[
    rule(Arithmetic, "add zero",            "(+ ?x 0)",                           "?x",                      Always),
    rule(Arithmetic, "zero add",            "(+ 0 ?x)",                           "?x",                      Always),
    rule(Arithmetic, "multiply by one",     "(* ?x 1)",                           "?x",                      Always),
    rule(Arithmetic, "one multiplied",      "(* 1 ?x)",                           "?x",                      Always),
    rule(Arithmetic, "multiply by zero",    "(* 0 ?x)",                           "0",                       Always),
    rule(Arithmetic, "multiply by minus one", "(* -1 ?x)",                        "(- ?x)",                  Always),
    rule(Arithmetic, "first power",         "(^ ?x 1)",                           "?x",                      Always),
    rule(Arithmetic, "double minus",        "(- (- ?x))",                         "?x",                      Always),
    rule(Arithmetic, "minus zero",          "(- 0)",                              "0",                       Always),
    rule(Arithmetic, "cancel",              "(+ ?x (- ?x))",                      "0",                       Always),
    rule(Arithmetic, "cancel before",       "(+ (- ?x) ?x)",                      "0",                       Always),
    rule(Arithmetic, "minus out of right",  "(* ?x (- ?y))",                      "(- (* ?x ?y))",           Always),
    rule(Arithmetic, "minus out of left",   "(* (- ?x) ?y)",                      "(- (* ?x ?y))",           Always),
    rule(Arithmetic, "minus out of sum",    "(+ (- ?x) (- ?y))",                  "(- (+ ?x ?y))",           Always),
    rule(Arithmetic, "square of minus",     "(^ (- ?x) 2)",                       "(^ ?x 2)",                Always),
    rule(Arithmetic, "product with itself", "(* ?x ?x)",                          "(^ ?x 2)",                Always),
    rule(Arithmetic, "power of square",     "(^ (^ ?x 2) 2)",                     "(^ ?x 4)",                Always),
    rule(Arithmetic, "numbers together",    "(* ?x (* ?y ?z))",                   "(* (* ?x ?y) ?z)",        Always),

    rule(Factor, "common factor",           "(+ (* ?c ?x) (* ?c ?y))",            "(* ?c (+ ?x ?y))",        Number("?c")),
    rule(Factor, "common factor, minus",    "(+ (* ?c ?x) (- (* ?c ?y)))",        "(* ?c (+ ?x (- ?y)))",    Number("?c")),
    rule(Factor, "common factor, minus first", "(+ (- (* ?c ?x)) (* ?c ?y))",     "(* ?c (+ (- ?x) ?y))",    Number("?c")),
    rule(Factor, "twice",                   "(+ ?x ?x)",                          "(* 2 ?x)",                Always),
    rule(Factor, "square of sum",           "(+ (+ (^ ?x 2) (* 2 (* ?x ?y))) (^ ?y 2))",     "(^ (+ ?x ?y) 2)",     Always),
    rule(Factor, "square of difference",    "(+ (+ (^ ?x 2) (- (* 2 (* ?x ?y)))) (^ ?y 2))", "(^ (+ ?x (- ?y)) 2)", Always),

    rule(Trigonometric, "sine is odd",      "(sin (- ?x))",                       "(- (sin ?x))",            Always),
    rule(Trigonometric, "cosine is even",   "(cos (- ?x))",                       "(cos ?x)",                Always),
    rule(Trigonometric, "tangent is odd",   "(tan (- ?x))",                       "(- (tan ?x))",            Always),
    rule(Trigonometric, "sine, quarter turn",      "(sin (+ ?x (* 1/2 pi)))",     "(cos ?x)",                Always),
    rule(Trigonometric, "sine, quarter turn back", "(sin (+ ?x (- (* 1/2 pi))))", "(- (cos ?x))",            Always),
    rule(Trigonometric, "sine, half turn",         "(sin (+ ?x pi))",             "(- (sin ?x))",            Always),
    rule(Trigonometric, "sine, half turn back",    "(sin (+ ?x (- pi)))",         "(- (sin ?x))",            Always),
    rule(Trigonometric, "cosine, quarter turn",    "(cos (+ ?x (* 1/2 pi)))",     "(- (sin ?x))",            Always),
    rule(Trigonometric, "cosine, quarter turn back", "(cos (+ ?x (- (* 1/2 pi))))", "(sin ?x)",              Always),
    rule(Trigonometric, "cosine, half turn",       "(cos (+ ?x pi))",             "(- (cos ?x))",            Always),
    rule(Trigonometric, "cosine, half turn back",  "(cos (+ ?x (- pi)))",         "(- (cos ?x))",            Always),
    rule(Trigonometric, "tangent, half turn",      "(tan (+ ?x pi))",             "(tan ?x)",                Always),
    rule(Trigonometric, "tangent, half turn back", "(tan (+ ?x (- pi)))",         "(tan ?x)",                Always),
    rule(Trigonometric, "Pythagoras",       "(+ (^ (sin ?x) 2) (^ (cos ?x) 2))",  "1",                       Always),
    rule(Trigonometric, "Pythagoras, swapped", "(+ (^ (cos ?x) 2) (^ (sin ?x) 2))", "1",                     Always),
    rule(Trigonometric, "cosine of double", "(+ (^ (cos ?x) 2) (- (^ (sin ?x) 2)))", "(cos (* 2 ?x))",       Always),
    rule(Trigonometric, "sine of double",   "(* (sin ?x) (cos ?x))",              "(* 1/2 (sin (* 2 ?x)))",  Always),
    rule(Trigonometric, "sine over cosine", "(* (sin ?x) (^ (cos ?x) -1))",       "(tan ?x)",                Always),

    rule(Transcendental, "hyperbolic Pythagoras", "(+ (^ (cosh ?x) 2) (- (^ (sinh ?x) 2)))", "1",            Always),
    rule(Transcendental, "hyperbolic sine is odd", "(sinh (- ?x))",               "(- (sinh ?x))",           Always),
    rule(Transcendental, "hyperbolic cosine is even", "(cosh (- ?x))",            "(cosh ?x)",               Always),
    rule(Transcendental, "hyperbolic tangent is odd", "(tanh (- ?x))",            "(- (tanh ?x))",           Always),
    rule(Transcendental, "product of exponentials", "(* (exp ?x) (exp ?y))",      "(exp (+ ?x ?y))",         Always),
    rule(Transcendental, "inverse exponential", "(^ (exp ?x) -1)",                "(exp (- ?x))",            Always),
    rule(Transcendental, "logarithm of exponential", "(log (exp ?x))",            "?x",                      Always),
    rule(Transcendental, "exponential of logarithm", "(exp (log ?x))",            "?x",                      Positive("?x")),
    rule(Transcendental, "square of root",  "(^ (sqrt ?x) 2)",                    "?x",                      NonNegative("?x")),
    rule(Transcendental, "root of square",  "(sqrt (^ ?x 2))",                    "(abs ?x)",                Always),
    rule(Transcendental, "absolute of nonnegative", "(abs ?x)",                   "?x",                      NonNegative("?x")),
    rule(Transcendental, "absolute of minus", "(abs (- ?x))",                     "(abs ?x)",                Always),
    rule(Transcendental, "square of absolute", "(^ (abs ?x) 2)",                  "(^ ?x 2)",                Always),
    rule(Transcendental, "sign times value", "(* ?x (sign ?x))",                  "(abs ?x)",                Always),
    rule(Transcendental, "sign times absolute", "(* (abs ?x) (sign ?x))",         "?x",                      Always),

    rule(Reorder, "sums commute",           "(+ ?x ?y)",                          "(+ ?y ?x)",               Always),
    rule(Reorder, "products commute",       "(* ?x ?y)",                          "(* ?y ?x)",               Always),
    rule(Reorder, "sums associate",         "(+ (+ ?x ?y) ?z)",                   "(+ ?x (+ ?y ?z))",        Always),
    rule(Reorder, "products associate",     "(* (* ?x ?y) ?z)",                   "(* ?x (* ?y ?z))",        Always),
];

impl Rule {
    /// The names of the pattern variables of both sides, as in `?x`.
    pub fn variables(&self) -> Vec<String> {
        let mut names: Vec<String> = [self.left, self.right]
            .iter()
            .flat_map(|side| side.split(|c: char| c.is_whitespace() || c == '(' || c == ')'))
            .filter(|word| word.starts_with('?'))
            .map(str::to_string)
            .collect();
        names.sort();
        names.dedup();
        names
    }

    /// Both sides with numbers for the pattern variables; NaN where a side does not parse.
    pub fn values(&self, of: &dyn Fn(&str) -> f64) -> (f64, f64) {
        let names = self.variables();
        let side = |text: &str| {
            // Every pattern variable becomes a variable of the language.
            let mut text = text.to_string();
            for (i, name) in names.iter().enumerate() {
                text = text.replace(name.as_str(), &format!("@q{i}"));
            }
            let expr: RecExpr<Math> = text.parse().unwrap_or_default();
            evaluate(&expr, &|_| f64::NAN, &|symbol| match symbol {
                Symbol::Coordinate(i) => of(&names[i]),
                _ => f64::NAN,
            })
        };
        (side(self.left), side(self.right))
    }

    /// As a rewrite of egg; `None` where the row does not parse, which the tests exclude.
    fn rewrite(&self) -> Option<Rewrite<Math, Folding>> {
        let left: Pattern<Math> = self.left.parse().ok()?;
        let right: Pattern<Math> = self.right.parse().ok()?;
        let (name, least) = match self.condition {
            Always => return Rewrite::new(self.name, left, right).ok(),
            Number(name) => (name, None),
            NonNegative(name) => (name, Some(Sign::NonNegative)),
            Positive(name) => (name, Some(Sign::Positive)),
        };
        let variable: Var = name.parse().ok()?;
        let condition = move |egraph: &mut EGraph<Math, Folding>, _: Id, subst: &Subst| {
            let known = egraph[subst[variable]].data;
            least.map_or(known.number, |least| known.sign >= least)
        };
        Rewrite::new(self.name, left, ConditionalApplier { condition, applier: right }).ok()
    }
}

static ORDERED: LazyLock<Vec<Rewrite<Math, Folding>>> = LazyLock::new(|| {
    RULES.iter().filter(|rule| rule.kind != Reorder).filter_map(Rule::rewrite).collect()
});

static REORDERED: LazyLock<Vec<Rewrite<Math, Folding>>> =
    LazyLock::new(|| RULES.iter().filter_map(Rule::rewrite).collect());

/// The compiled rewrites, with those that change the order of sums and products or without.
pub fn rewrites(reorder: bool) -> &'static [Rewrite<Math, Folding>] {
    if reorder { &REORDERED } else { &ORDERED }
}

/// How many rows the compiled tables hold, for the test that no row was lost.
pub fn compiled() -> (usize, usize) {
    (ORDERED.len(), REORDERED.len())
}
