//! Exact partial derivatives, as expressions of the same graph.

use rustc_hash::FxHashMap;

use super::functions::Function;
use super::graph::{Delay, Expr, Graph, Node, Symbol};

impl Graph {
    /// The partial derivative of `expr` by `symbol`.
    pub fn derivative(&mut self, expr: Expr, symbol: Symbol) -> Expr {
        self.derivatives(&[expr], symbol)[0]
    }

    /// The partial derivatives of several expressions by one symbol; shared parts are derived once.
    pub fn derivatives(&mut self, exprs: &[Expr], symbol: Symbol) -> Vec<Expr> {
        let zero = self.number(0.0);
        let mut known: FxHashMap<Expr, Expr> = FxHashMap::default();
        for part in self.topological(exprs) {
            let derivative = match self.node(part).clone() {
                Node::Number(_) => zero,
                Node::Symbol(s) => self.derivative_of_symbol(s, symbol),
                Node::Sum { terms, .. } => {
                    let parts: Vec<_> = terms.iter().map(|(t, c)| (c.value(), known[t])).collect();
                    self.linear(0.0, &parts)
                }
                Node::Product(parts) => {
                    let mut sum = Vec::new();
                    for (i, &(base, exponent)) in parts.iter().enumerate() {
                        let inner = known[&base];
                        if self.is_zero(inner) {
                            continue;
                        }
                        let mut factors: Vec<(Expr, f64)> =
                            parts.iter().map(|&(b, e)| (b, e.value())).collect();
                        factors[i].1 -= 1.0;
                        factors.push((inner, 1.0));
                        sum.push(self.product(exponent.value(), &factors));
                    }
                    self.sum(&sum)
                }
                Node::Power(base, exponent) => self.power_rule(part, base, exponent, &known),
                Node::Apply(function, argument) => {
                    let inner = known[&argument];
                    if self.is_zero(inner) {
                        zero
                    } else {
                        let outer = (function.row().derivative)(self, argument);
                        self.multiply(outer, inner)
                    }
                }
            };
            known.insert(part, derivative);
        }
        exprs.iter().map(|expr| known[expr]).collect()
    }

    /// A symbol by another one; u(t - d) by its delay d is -u'(t - d).
    fn derivative_of_symbol(&mut self, of: Symbol, by: Symbol) -> Expr {
        if of == by {
            return self.number(1.0);
        }
        match (of, by) {
            (Symbol::Delayed(input, order, Delay::Parameter(j)), Symbol::Parameter(other))
                if j == other =>
            {
                let rate = self.symbol(Symbol::Delayed(input, order + 1, Delay::Parameter(j)));
                self.negate(rate)
            }
            _ => self.number(0.0),
        }
    }

    /// (b^e)' = b^e (e' log b + e b' / b).
    fn power_rule(
        &mut self,
        whole: Expr,
        base: Expr,
        exponent: Expr,
        known: &FxHashMap<Expr, Expr>,
    ) -> Expr {
        let (of_base, of_exponent) = (known[&base], known[&exponent]);
        let mut sum = Vec::new();
        if !self.is_zero(of_exponent) {
            let log = self.apply(Function::LOG, base);
            sum.push(self.product(1.0, &[(whole, 1.0), (of_exponent, 1.0), (log, 1.0)]));
        }
        if !self.is_zero(of_base) {
            let minus_one = self.number(-1.0);
            let lowered = self.add(exponent, minus_one);
            let power = self.power_of(base, lowered);
            sum.push(self.product(1.0, &[(power, 1.0), (exponent, 1.0), (of_base, 1.0)]));
        }
        self.sum(&sum)
    }

    /// First derivatives by each symbol, in the order given.
    pub fn gradient(&mut self, expr: Expr, symbols: &[Symbol]) -> Vec<Expr> {
        symbols.iter().map(|&symbol| self.derivative(expr, symbol)).collect()
    }

    /// Second derivatives, row by row: `out[i][j]` is by symbol i, then symbol j.
    pub fn hessian(&mut self, expr: Expr, symbols: &[Symbol]) -> Vec<Vec<Expr>> {
        let gradient = self.gradient(expr, symbols);
        let mut rows = vec![Vec::with_capacity(symbols.len()); symbols.len()];
        for &symbol in symbols {
            for (row, second) in rows.iter_mut().zip(self.derivatives(&gradient, symbol)) {
                row.push(second);
            }
        }
        rows
    }
}
