//! What composed terms begin from: coordinates, momenta, their sums, differences and distances,
//! and the subexpressions of the user's own spec.

use rustc_hash::FxHashSet;

use super::shapes::Shape;
use super::states::PhasePoints;
use crate::diagnose::tuning;
use crate::eval::{Backend, Inputs, compile};
use crate::expr::{Expr, Function, Graph, Node, Symbol, System, Variable};

/// An argument of a shape.
pub(super) struct Leaf {
    /// As it is written in a spec.
    pub(super) text: String,
    /// Whether that holds together without parentheses.
    pub(super) name: bool,
    /// The component of the state that it is, if it is one: coordinates, then momenta.
    pub(super) component: Option<usize>,
    /// Whether it is a product of such: its powers are monomials, which have a list of their own.
    pub(super) monomial: bool,
    /// Its description length in nats.
    pub(super) length: f64,
    /// What it is measured in.
    pub(super) unit: LeafUnit,
    expr: Expr,
    /// Components of the state that it depends on.
    depends: Vec<bool>,
}

/// What a leaf is measured in.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum LeafUnit {
    /// It is a pure number, or nothing about its unit is checked.
    Number,
    /// In a unit, as a spec has it.
    Of(String),
    /// In some unit.
    Unknown,
}

impl LeafUnit {
    fn of(variable: &Variable) -> LeafUnit {
        match (&variable.unit, &variable.unit_text) {
            (Some(unit), Some(text)) if !unit.is_number() => LeafUnit::Of(text.clone()),
            (Some(unit), None) if !unit.is_number() => LeafUnit::Unknown,
            _ => LeafUnit::Number,
        }
    }

    fn squared(&self) -> LeafUnit {
        match self {
            LeafUnit::Of(text) => LeafUnit::Of(format!("({text})^2")),
            other => other.clone(),
        }
    }

    /// Whether a shape may be asked of an argument in this unit.
    pub(super) fn allows(&self, shape: &Shape) -> bool {
        match self {
            LeafUnit::Number => true,
            LeafUnit::Of(_) => shape.is_homogeneous() || shape.has_lengths(),
            LeafUnit::Unknown => shape.is_homogeneous(),
        }
    }
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

impl Leaves {
    /// The leaves of a system.
    pub(super) fn of(system: &System, tuning: &tuning::Composed) -> Leaves {
        let n = system.degrees();
        let state = system.state();
        let mut graph = system.graph.clone();
        let symbols: Vec<Expr> = state.iter().map(|&symbol| graph.symbol(symbol)).collect();
        let names = system.names();
        let units: Vec<LeafUnit> =
            system.coordinates.iter().chain(&system.momenta).map(LeafUnit::of).collect();
        let mut found: Vec<(Expr, LeafUnit, f64)> = Vec::new();
        let mut seen = FxHashSet::default();
        let mut add = |drafts: Vec<(Expr, LeafUnit)>, class: f64| {
            let new: Vec<_> = drafts.into_iter().filter(|(expr, _)| seen.insert(*expr)).collect();
            let length = class + (new.len().max(1) as f64).ln();
            found.extend(new.into_iter().map(|(expr, unit)| (expr, unit, length)));
        };
        let ln_2 = std::f64::consts::LN_2;
        add(symbols.iter().copied().zip(units.iter().cloned()).collect(), ln_2);
        let unknown = if units.iter().all(|unit| *unit == LeafUnit::Number) {
            LeafUnit::Number
        } else {
            LeafUnit::Unknown
        };
        let known =
            known_parts(system, tuning.known_parts).into_iter().map(|expr| (expr, unknown.clone()));
        add(known.collect(), 2.0 * ln_2);
        let mut near = Vec::new();
        for of in [0..n, n..2 * n] {
            for (a, b) in pairs(of.clone()).filter(|&(a, b)| units[a] == units[b]) {
                let unit = &units[a];
                let (x, y) = (symbols[a], symbols[b]);
                near.push((graph.subtract(x, y), unit.clone()));
                near.push((graph.add(x, y), unit.clone()));
                near.extend(distance(&mut graph, &[x, y], unit));
                near.push((graph.multiply(x, y), unit.squared()));
            }
            let alike = units[of.clone()].windows(2).all(|pair| pair[0] == pair[1]);
            if n > 2 && alike {
                near.extend(distance(&mut graph, &symbols[of.clone()], &units[of.start]));
            }
        }
        add(near, 3.0 * ln_2);
        let mut far = Vec::new();
        // Distances of two bodies in a plane.
        if (4..=tuning.plane_coordinates).contains(&n) {
            let all: Vec<(usize, usize)> = pairs(0..n).collect();
            for (i, &(a, b)) in all.iter().enumerate() {
                for &(c, d) in &all[i + 1..] {
                    let alike = [b, c, d].iter().all(|&other| units[other] == units[a]);
                    if [c, d].contains(&a) || [c, d].contains(&b) || !alike {
                        continue;
                    }
                    let apart = [(a, b), (c, d)];
                    let apart = apart.map(|(a, b)| graph.subtract(symbols[a], symbols[b]));
                    far.extend(distance(&mut graph, &apart, &units[a]));
                }
            }
        }
        // Sums and differences of monomials of unlike degree, and of coordinates with momenta:
        // of pure numbers.
        let numbers: Vec<usize> = (0..2 * n).filter(|&i| units[i] == LeafUnit::Number).collect();
        let mut add_number = |expr: Expr| far.push((expr, LeafUnit::Number));
        for (a, b) in pairs(0..numbers.len()) {
            let (a, b) = (symbols[numbers[a]], symbols[numbers[b]]);
            let (a2, b2) = (graph.power(a, 2.0), graph.power(b, 2.0));
            add_number(graph.subtract(a2, b2));
            add_number(graph.multiply(a, b));
            add_number(graph.add(a2, b2));
            for (x, y) in [(a, b2), (b, a2), (a, b)] {
                add_number(graph.add(x, y));
                add_number(graph.subtract(x, y));
            }
        }
        for &a in &numbers {
            let a = symbols[a];
            let a2 = graph.power(a, 2.0);
            add_number(graph.add(a, a2));
            add_number(graph.subtract(a, a2));
        }
        add(far, 4.0 * ln_2);
        let list = found.into_iter().map(|(expr, unit, length)| {
            let of = graph.symbols(&[expr]);
            let component = symbols.iter().position(|&symbol| symbol == expr);
            Leaf {
                text: graph.text(expr, &names),
                name: component.is_some() || matches!(graph.node(expr), Node::Apply(..)),
                component,
                monomial: component.is_some() || is_monomial(&graph, expr),
                length,
                unit,
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
        let count = points.values();
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

/// All pairs of different places, the smaller one first.
fn pairs(of: std::ops::Range<usize>) -> impl Iterator<Item = (usize, usize)> {
    let end = of.end;
    of.flat_map(move |a| (a + 1..end).map(move |b| (a, b)))
}

/// The square of a vector's length, and the length.
fn distance(graph: &mut Graph, along: &[Expr], unit: &LeafUnit) -> [(Expr, LeafUnit); 2] {
    let squares: Vec<Expr> = along.iter().map(|&x| graph.power(x, 2.0)).collect();
    let sum = graph.sum(&squares);
    [(sum, unit.squared()), (graph.apply(Function::SQRT, sum), unit.clone())]
}

/// Whether an expression is a product of positive whole powers of variables.
fn is_monomial(graph: &Graph, expr: Expr) -> bool {
    let variable = |expr: Expr| matches!(graph.node(expr), Node::Symbol(_));
    match graph.node(expr) {
        Node::Product(parts) => parts.iter().all(|&(base, exponent)| {
            variable(base) && exponent.value() > 0.0 && exponent.value().fract() == 0.0
        }),
        _ => false,
    }
}

/// Subexpressions of the known parts and of the function space that depend on the state and not
/// on time, the shortest first, `most` of them.
fn known_parts(system: &System, most: usize) -> Vec<Expr> {
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
    parts.into_iter().take(most).map(|(_, expr)| expr).collect()
}
