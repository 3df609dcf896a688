//! What several test files share.

use leverrier::dynamics::systems::known_system;
use leverrier::expr::{Bounds, Function, Parameter, Place, Symbol, System, Term};

/// A system of two degrees of freedom with learned terms in T and V, an inner parameter in V
/// and one that nothing uses, and on request a learned drive, or a learned drag and coupling.
pub fn learned_system(driven: bool, separable: bool) -> System {
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
            unit: None,
            unit_text: None,
        })
        .to_vec();
    system
}

/// Largest entry of J^T Omega J - Omega of the state part of one lane's tangent.
pub fn symplectic_defect(
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
