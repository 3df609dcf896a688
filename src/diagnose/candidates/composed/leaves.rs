//! What composed terms begin from: coordinates, momenta, their sums, differences and distances,
//! and the subexpressions of the user's own spec.

use rustc_hash::FxHashSet;

use super::states::PhasePoints;
use crate::eval::{Backend, Inputs, compile};
use crate::expr::{Expr, Function, Graph, Node, Symbol, System};

/// An argument of a shape.
pub(super) struct Leaf {
    /// As it is written in a spec.
    pub(super) text: String,
    /// Whether that is a plain name.
    pub(super) name: bool,
    /// The component of the state that it is, if it is one: coordinates, then momenta.
    pub(super) component: Option<usize>,
    /// Its description length in nats.
    pub(super) length: f64,
    expr: Expr,
    /// Components of the state that it depends on.
    depends: Vec<bool>,
}

impl Leaf {
    /// Whether it depends on a component of the state.
    pub(super) fn depends(&self, component: usize) -> bool {
        self.depends[component]
    }
}

/// All leaves of a system.
pub(super) struct Leaves {
    pub(super) list: Vec<Leaf>,
    graph: Graph,
    state: Vec<Symbol>,
    parameters: Vec<Symbol>,
}

/// A function of the state with its gradient at some points.
#[derive(Debug, Clone)]
pub(super) struct Jet {
    /// At each point.
    pub(super) value: Vec<f64>,
    /// Derivative by each component of the state that it depends on, at each point.
    pub(super) slopes: Vec<Option<Vec<f64>>>,
}

impl Jet {
    /// Whether every number is finite.
    pub(super) fn is_finite(&self) -> bool {
        let rows = std::iter::once(&self.value).chain(self.slopes.iter().flatten());
        rows.into_iter().flatten().all(|x| x.is_finite())
    }
}

/// Subexpressions of the spec that become leaves, at most: the largest ones are rarely what
/// another term is made of.
const MOST_KNOWN: usize = 24;

/// Coordinates up to which squares of pairs of pairs are leaves.
const MOST_OF_PLANES: usize = 6;

impl Leaves {
    /// The leaves of a system.
    pub(super) fn of(system: &System) -> Leaves {
        let n = system.degrees();
        let state = system.state();
        let mut graph = system.graph.clone();
        let symbols: Vec<Expr> = state.iter().map(|&symbol| graph.symbol(symbol)).collect();
        let names = system.names();
        let mut found: Vec<(Expr, f64)> = Vec::new();
        let mut seen = FxHashSet::default();
        let mut add = |exprs: Vec<Expr>, class: f64| {
            let new: Vec<Expr> = exprs.into_iter().filter(|expr| seen.insert(*expr)).collect();
            let length = class + (new.len().max(1) as f64).ln();
            found.extend(new.into_iter().map(|expr| (expr, length)));
        };
        let ln_2 = std::f64::consts::LN_2;
        add(symbols.clone(), ln_2);
        add(known_parts(system), 2.0 * ln_2);
        let (coordinates, momenta) = symbols.split_at(n);
        let pairs = |of: &[Expr]| -> Vec<(Expr, Expr)> {
            let first = of.iter().enumerate();
            first.flat_map(|(i, &a)| of[i + 1..].iter().map(move |&b| (a, b))).collect()
        };
        let square = |graph: &mut Graph, x: Expr| graph.power(x, 2.0);
        let mut near = Vec::new();
        for of in [coordinates, momenta] {
            for (a, b) in pairs(of) {
                near.push(graph.subtract(a, b));
                near.push(graph.add(a, b));
                let squares = [square(&mut graph, a), square(&mut graph, b)];
                let sum = graph.sum(&squares);
                near.push(sum);
                near.push(graph.apply(Function::SQRT, sum));
                near.push(graph.multiply(a, b));
            }
            if n > 2 {
                let squares: Vec<Expr> = of.iter().map(|&x| square(&mut graph, x)).collect();
                let sum = graph.sum(&squares);
                near.push(sum);
                near.push(graph.apply(Function::SQRT, sum));
            }
        }
        add(near, 3.0 * ln_2);
        let mut far = Vec::new();
        // Distances of two bodies in a plane.
        if (4..=MOST_OF_PLANES).contains(&n) {
            let all = pairs(coordinates);
            for (i, &(a, b)) in all.iter().enumerate() {
                for &(c, d) in &all[i + 1..] {
                    if [c, d].contains(&a) || [c, d].contains(&b) {
                        continue;
                    }
                    let apart = [graph.subtract(a, b), graph.subtract(c, d)];
                    let squares = apart.map(|x| square(&mut graph, x));
                    let sum = graph.sum(&squares);
                    far.push(sum);
                    far.push(graph.apply(Function::SQRT, sum));
                }
            }
        }
        // Sums and differences of monomials of unlike degree, and of coordinates with momenta.
        for (a, b) in pairs(&symbols) {
            let (a2, b2) = (square(&mut graph, a), square(&mut graph, b));
            far.push(graph.subtract(a2, b2));
            far.push(graph.multiply(a, b));
            far.push(graph.sum(&[a2, b2]));
            for (x, y) in [(a, b2), (b, a2)] {
                far.push(graph.add(x, y));
                far.push(graph.subtract(x, y));
            }
            far.push(graph.add(a, b));
            far.push(graph.subtract(a, b));
        }
        for &a in &symbols {
            let a2 = square(&mut graph, a);
            far.push(graph.add(a, a2));
            far.push(graph.subtract(a, a2));
        }
        add(far, 4.0 * ln_2);
        let list = found.into_iter().map(|(expr, length)| {
            let of = graph.symbols(&[expr]);
            let component = symbols.iter().position(|&symbol| symbol == expr);
            Leaf {
                text: graph.text(expr, &names),
                name: component.is_some(),
                component,
                length,
                expr,
                depends: state.iter().map(|symbol| of.contains(symbol)).collect(),
            }
        });
        let list: Vec<Leaf> = list.collect();
        let parameters = (0..system.parameters.len()).map(Symbol::Parameter).collect();
        Leaves { list, graph, state, parameters }
    }

    /// All leaves with their gradients at some points.
    pub(super) fn jets(&self, parameters: &[f64], points: &PhasePoints) -> Vec<Jet> {
        let mut graph = self.graph.clone();
        let mut outputs = Vec::new();
        for leaf in &self.list {
            outputs.push(leaf.expr);
            let slopes = graph.gradient(leaf.expr, &self.state);
            outputs.extend(slopes.iter().zip(&leaf.depends).filter(|(_, d)| **d).map(|(s, _)| *s));
        }
        let inputs = Inputs { varying: self.state.clone(), uniform: self.parameters.clone() };
        let compiled = compile(&graph, &inputs, &outputs, Backend::default());
        let count = points.count;
        let mut out = vec![0.0; outputs.len() * count];
        compiled.evaluate(&points.states, parameters, count, &mut out, &mut Vec::new());
        let mut rows = out.chunks_exact(count.max(1)).map(<[f64]>::to_vec);
        let mut next = || rows.next().unwrap_or_default();
        let jet = |leaf: &Leaf| Jet {
            value: next(),
            slopes: leaf.depends.iter().map(|&depends| depends.then(&mut next)).collect(),
        };
        self.list.iter().map(jet).collect()
    }
}

/// Subexpressions of the known parts and of the function space that depend on the state and not
/// on time, the shortest first.
fn known_parts(system: &System) -> Vec<Expr> {
    let graph = &system.graph;
    let roots: Vec<Expr> = [system.kinetic, system.potential, system.hamiltonian]
        .into_iter()
        .chain(system.forces.iter().copied())
        .chain(system.sensors.iter().copied())
        .chain(system.terms.iter().flat_map(|term| term.parts().map(|(_, expr)| expr)))
        .collect();
    let state = system.state();
    let wanted = |expr: &Expr| {
        let node = graph.node(*expr);
        let plain = matches!(node, Node::Number(_) | Node::Symbol(_));
        // A square or a multiple of a leaf is made of that leaf.
        let single = match node {
            Node::Product(parts) => parts.len() == 1,
            Node::Sum { terms, constant } => terms.len() == 1 && constant.value() == 0.0,
            _ => false,
        };
        let of = graph.symbols(&[*expr]);
        let coefficients = of.iter().any(|s| matches!(s, Symbol::Coefficient(_) | Symbol::Time));
        !plain && !single && !coefficients && of.iter().any(|symbol| state.contains(symbol))
    };
    let mut parts: Vec<(usize, Expr)> = graph
        .topological(&roots)
        .into_iter()
        .filter(wanted)
        .map(|expr| (graph.topological(&[expr]).len(), expr))
        .collect();
    parts.sort_by_key(|&(size, expr)| (size, expr));
    parts.into_iter().take(MOST_KNOWN).map(|(_, expr)| expr).collect()
}
