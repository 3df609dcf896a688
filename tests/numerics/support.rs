//! Systems, random expressions and measures that several test files share.

use leverrier::internals::dynamics::Method;
use leverrier::internals::dynamics::systems::known_system;
use leverrier::internals::expr::{
    Bounds, Expr, Function, Graph, Node, Parameter, Place, Symbol, System, Term,
};
use proptest::prelude::*;
use std::collections::HashMap;

/// A system of two degrees of freedom with learned terms in T and V, an inner parameter in V
/// and one that nothing uses, and on request a learned drive, or a learned drag and coupling.
pub(crate) fn learned_system(driven: bool, separable: bool) -> System {
    let mut system = known_system("learned", 2, |g, q, p, _| {
        let zero = g.number(0.0);
        let t = g.power(p[0], 2.0);
        let v = g.product(0.3, &[(q[0], 2.0), (q[1], 2.0)]);
        (g.scale(0.5, t), v, zero, vec![])
    });
    let g = &mut system.graph;
    let q: Vec<_> = (0..2).map(|i| g.symbol(Symbol::Coordinate(i))).collect();
    let p: Vec<_> = (0..2).map(|i| g.symbol(Symbol::Momentum(i))).collect();
    let t = g.symbol(Symbol::Time);
    let a = g.symbol(Symbol::Parameter(1));
    let phase = g.linear(0.0, &[(1.0, q[0]), (1.0, a)]);
    let shifted = g.apply(Function::by_name("sin").unwrap(), phase);
    let mut exprs = vec![
        (Place::Kinetic, g.power(p[1], 2.0)),
        (Place::Kinetic, g.product(1.0, &[(p[0], 1.0), (p[1], 3.0)])),
        (Place::Potential, g.power(q[0], 2.0)),
        (Place::Potential, g.power(q[1], 2.0)),
        (Place::Potential, g.product(1.0, &[(q[0], 2.0), (q[1], 1.0)])),
        (Place::Potential, shifted),
    ];
    if driven {
        let time = g.scale(1.3, t);
        let cos = g.apply(Function::by_name("cos").unwrap(), time);
        exprs.push((Place::Force(1), g.multiply(cos, q[0])));
    }
    if !separable {
        exprs.push((Place::Force(0), p[0]));
        exprs.push((Place::Hamiltonian, g.product(1.0, &[(q[0], 1.0), (p[1], 2.0)])));
    }
    system.terms = exprs
        .into_iter()
        .map(|(place, expr)| Term {
            place,
            expr,
            also: Vec::new(),
            effect: None,
            label: String::new(),
            name: None,
            bounds: Bounds::FREE,
            unit: None,
            unit_text: None,
        })
        .collect();
    system.parameters = ["unused", "a"]
        .map(|name| Parameter {
            name: name.into(),
            start: 0.1,
            bounds: Bounds::FREE,
            per: None,
            unit: None,
            unit_text: None,
        })
        .to_vec();
    system
}

/// Largest entry of J^T Omega J - Omega of the state part of one lane's tangent.
pub(crate) fn symplectic_defect(
    tangent: &[f64],
    n: usize,
    columns: usize,
    lanes: usize,
    lane: usize,
) -> f64 {
    let j = |row: usize, column: usize| tangent[(row * columns + column) * lanes + lane];
    let mut worst: f64 = 0.0;
    for a in 0..2 * n {
        for b in 0..2 * n {
            let form: f64 = (0..n).map(|i| j(i, a) * j(n + i, b) - j(n + i, a) * j(i, b)).sum();
            let expected = match (a < n, b < n) {
                (true, false) if b == a + n => 1.0,
                (false, true) if a == b + n => -1.0,
                _ => 0.0,
            };
            let defect = (form - expected).abs();
            worst = if defect.is_nan() { f64::NAN } else { worst.max(defect) };
        }
    }
    worst
}

/// The shape of a random expression.
#[derive(Debug, Clone)]
pub(crate) enum Shape {
    Number(f64),
    /// q1, p1, t, the first coefficient or the first inner parameter.
    Symbol(usize),
    Sum(Vec<(f64, Shape)>),
    Product(Vec<(Shape, f64)>),
    Power(Box<Shape>, Box<Shape>),
    Apply(Function, Box<Shape>),
}

impl Shape {
    pub(crate) fn build(&self, graph: &mut Graph) -> Expr {
        match self {
            Shape::Number(value) => graph.number(*value),
            Shape::Symbol(which) => {
                let symbols = [
                    Symbol::Coordinate(0),
                    Symbol::Momentum(0),
                    Symbol::Time,
                    Symbol::Coefficient(0),
                    Symbol::Parameter(0),
                ];
                graph.symbol(symbols[which % symbols.len()])
            }
            Shape::Sum(parts) => {
                let parts: Vec<_> = parts.iter().map(|(c, part)| (*c, part.build(graph))).collect();
                graph.linear(0.25, &parts)
            }
            Shape::Product(parts) => {
                let parts: Vec<_> = parts.iter().map(|(part, e)| (part.build(graph), *e)).collect();
                graph.product(1.5, &parts)
            }
            Shape::Power(base, exponent) => {
                let (base, exponent) = (base.build(graph), exponent.build(graph));
                graph.power_of(base, exponent)
            }
            Shape::Apply(function, argument) => {
                let argument = argument.build(graph);
                graph.apply(*function, argument)
            }
        }
    }
}

/// Random expressions of every kind of node and every function.
pub(crate) fn shape() -> impl Strategy<Value = Shape> {
    let leaf = prop_oneof![
        1 => (-2.0..2.0_f64).prop_map(Shape::Number),
        4 => (0..5_usize).prop_map(Shape::Symbol),
    ];
    leaf.prop_recursive(4, 24, 3, |inner| {
        let exponent = prop::sample::select(vec![1.0, 2.0, 3.0, 5.0, -1.0, -2.0, 0.5, 1.5]);
        let functions: Vec<Function> = Function::all().collect();
        prop_oneof![
            prop::collection::vec((-2.0..2.0_f64, inner.clone()), 1..4).prop_map(Shape::Sum),
            prop::collection::vec((inner.clone(), exponent), 1..3).prop_map(Shape::Product),
            (inner.clone(), inner.clone())
                .prop_map(|(base, exponent)| Shape::Power(Box::new(base), Box::new(exponent))),
            (prop::sample::select(functions), inner)
                .prop_map(|(function, argument)| Shape::Apply(function, Box::new(argument))),
        ]
    })
}

/// How far rounding may carry a value: what the errors of its parts do to it, and what each
/// operation adds. Without bound where a part may leave the range of its function, or moves it by
/// more than a tenth: a few points say nothing of a pole or a wave between them.
pub(crate) fn rounding(graph: &Graph, expr: Expr, of: &dyn Fn(Symbol) -> f64) -> f64 {
    // An operation of doubles errs by 1e-16 of its parts, an approximated function by ten times
    // that: no more than a tenth of what is allowed.
    const OPERATION: f64 = 1e-14;
    const TENTH: f64 = 0.1;
    // Beyond it, and below its inverse, an order of operations may leave what doubles reach.
    const FAR: f64 = 1e100;
    let mut known: HashMap<Expr, (f64, f64)> = HashMap::new();
    for part in graph.topological(&[expr]) {
        // With one of its parts moved.
        let value = |moved: Expr, by: f64| {
            let at = |own: Expr| known[&own].0 + if own == moved { by } else { 0.0 };
            graph.value_of_parts(part, &at, of)
        };
        let here = graph.value_of_parts(part, &|own| known[&own].0, of);
        let added = match graph.node(part) {
            Node::Sum { constant, terms } => terms
                .iter()
                .map(|(t, c)| (c.value() * known[t].0).abs())
                .fold(constant.value().abs(), f64::max),
            _ => here.abs(),
        };
        let mut error = OPERATION * added + FAR.recip();
        // How far an argument may move, and what the value is compared with: near a pole, itself.
        let (argument, scale) = match graph.node(part) {
            Node::Apply(..) => (TENTH, 1.0 + here.abs()),
            Node::Product(_) | Node::Power(..) => (f64::MAX, here.abs()),
            _ => (f64::MAX, 1.0 + here.abs()),
        };
        for child in graph.children(part) {
            let range = known[&child].1;
            let farthest = [-1.0, -0.6, -0.25, 0.25, 0.6, 1.0]
                .map(|share| (value(child, share * range) - here).abs())
                .into_iter()
                .fold(0.0, |a: f64, b| if b.is_nan() { f64::INFINITY } else { a.max(b) });
            error += match range {
                0.0 => 0.0,
                _ if range > argument => f64::INFINITY,
                _ => farthest,
            };
        }
        let is_near = here.abs() < FAR && error <= TENTH * scale + 2.0 * FAR.recip();
        known.insert(part, (here, if is_near { error } else { f64::INFINITY }));
    }
    known[&expr].1
}

/// Whether errors after 2, 4, ... steps fall as a method's order says: the best order between two
/// of them that are not rounding yet is at least its own, but for what a limit is from.
pub(crate) fn keeps_its_order(method: Method, error: impl Fn(usize) -> f64) {
    let row = method.row();
    let errors: Vec<f64> =
        (1..9).map(|level| error(1 << level)).take_while(|error| *error > 1e-12).collect();
    let orders: Vec<f64> = errors.windows(2).map(|pair| (pair[0] / pair[1]).log2()).collect();
    let best = orders.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    assert!(best > f64::from(row.order) - 0.7, "{}: {orders:?}", row.name);
}
