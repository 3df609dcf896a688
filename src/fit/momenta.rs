//! Momenta of measured velocities, where masses depend on the coordinates or couple them.

use nalgebra::{DMatrix, DVector};

use super::law::Law;
use crate::eval::{Backend, Evaluator, Inputs, compile};
use crate::expr::{Expr, Symbol, System};

/// A and c of v = A p + c, as functions of the state.
pub(super) struct Momenta {
    evaluator: Box<dyn Evaluator>,
    /// What they depend on, beside the numbers of the law.
    symbols: Vec<Symbol>,
    /// Parameters of the law, then its coefficients.
    numbers: Vec<f64>,
    /// Coordinates that have momenta.
    mechanical: Vec<usize>,
    degrees: usize,
}

impl Momenta {
    /// Those of a law; `None` where every velocity is its momentum over one number, which
    /// [`Law::masses`] tells, or where velocities are not linear in the momenta.
    pub(super) fn of(law: &Law) -> Option<Momenta> {
        let mut system = System::clone(law.system());
        let energy = system.energy(law.support()).ok()?;
        let mechanical = system.mechanical();
        let graph = &mut system.graph;
        let momenta: Vec<Symbol> = mechanical.iter().map(|&i| Symbol::Momentum(i)).collect();
        let velocities = graph.gradient(energy, &momenta);
        let mut outputs = graph.hessian(energy, &momenta).concat();
        let of_state = |s: &Symbol| matches!(s, Symbol::Coordinate(_) | Symbol::Momentum(_));
        let all = graph.symbols(&outputs);
        if all.iter().any(|symbol| momenta.contains(symbol)) {
            return None;
        }
        let n = mechanical.len();
        let coupled = (0..n * n).any(|k| k / n != k % n && !graph.is_zero(outputs[k]));
        if !coupled && !all.iter().any(of_state) {
            return None;
        }
        let zero = graph.number(0.0);
        let at_rest = momenta.iter().map(|&p| (p, zero)).collect();
        let linear: Vec<Expr> =
            velocities.into_iter().map(|v| graph.substitute(v, &at_rest)).collect();
        outputs.extend(linear);
        let symbols: Vec<Symbol> = (graph.symbols(&outputs).into_iter())
            .filter(|symbol| !matches!(symbol, Symbol::Parameter(_) | Symbol::Coefficient(_)))
            .collect();
        let coefficients = law.coefficient_of_each_term();
        let parameters = (0..law.parameters().len()).map(Symbol::Parameter);
        let uniform = parameters.chain((0..coefficients.len()).map(Symbol::Coefficient)).collect();
        let inputs = Inputs { varying: symbols.clone(), uniform };
        Some(Momenta {
            evaluator: compile(graph, &inputs, &outputs, Backend::default()),
            symbols,
            numbers: [law.parameters(), coefficients.as_slice()].concat(),
            mechanical,
            degrees: system.degrees(),
        })
    }

    /// Puts momenta in the place of the velocities of a state, where there are finite ones. What
    /// drives the motion counts as 0: this is a first guess.
    pub(super) fn put(&self, state: &mut [f64]) {
        let of = |symbol: &Symbol| match symbol {
            Symbol::Coordinate(i) => state[*i],
            _ => 0.0,
        };
        let points: Vec<f64> = self.symbols.iter().map(of).collect();
        let mut out = vec![0.0; self.evaluator.outputs()];
        self.evaluator.evaluate(&points, &self.numbers, 1, &mut out, &mut Vec::new());
        let n = self.mechanical.len();
        let (inverse_mass, linear) = out.split_at(n * n);
        let right =
            DVector::from_fn(n, |k, _| state[self.degrees + self.mechanical[k]] - linear[k]);
        let solved = DMatrix::from_row_slice(n, n, inverse_mass).lu().solve(&right);
        let Some(momenta) = solved.filter(|p| p.iter().all(|x| x.is_finite())) else { return };
        for (&i, &momentum) in self.mechanical.iter().zip(momenta.iter()) {
            state[self.degrees + i] = momentum;
        }
    }
}
