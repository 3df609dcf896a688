//! Forms that machines compute fast: Horner's scheme over several variables, shared powers.

use std::collections::{BTreeMap, HashMap};

use super::cost::machine;
use super::normal::{Atom, Atoms, Monomial, Polynomial};
use crate::expr::{Expr, Graph, Number, Symbol};

/// The same expressions, cheaper to compute, in a graph of their own.
///
/// Each is compared with the original at sampled points; one that differs by more than
/// rounding, or is not cheaper, is left as it was. Symbols keep their meaning.
pub fn for_machines(graph: &Graph, exprs: &[Expr]) -> (Graph, Vec<Expr>) {
    let degrees = graph
        .symbols(exprs)
        .iter()
        .map(|symbol| match symbol {
            Symbol::Coordinate(i) | Symbol::Momentum(i) => i + 1,
            _ => 0,
        })
        .max()
        .unwrap_or(0);
    let mut out = graph.clone();
    let mut atoms = Atoms::new(degrees, true);
    let mut cache = HashMap::new();
    let mut results = Vec::with_capacity(exprs.len());
    for &expr in exprs {
        let form = atoms.expand(graph, expr, &|_| None, &mut cache);
        let nested = horner(&mut out, &atoms, &form);
        let cheaper = machine(&out, &[nested]) < machine(&out, &[expr]);
        results.push(if cheaper && agree(&out, expr, nested) { nested } else { expr });
    }
    // Separately cheaper forms may share less than the originals did.
    if machine(&out, &results) >= machine(&out, exprs) {
        results = exprs.to_vec();
    }
    (out, results)
}

/// Largest relative difference that counts as rounding.
const ROUNDING: f64 = 1e-11;

fn agree(graph: &Graph, a: Expr, b: Expr) -> bool {
    let symbols = graph.symbols(&[a, b]);
    let mut scale: f64 = 1e-300;
    let mut largest: f64 = 0.0;
    for point in 0..24 {
        let of = |symbol: Symbol| {
            let index = symbols.binary_search(&symbol).unwrap_or(0);
            let x = super::check::coordinate(point, index);
            if point % 2 == 0 { 2.8 * x - 1.4 } else { 0.1 + 2.0 * x }
        };
        let (x, y) = (graph.value(a, &of), graph.value(b, &of));
        if x.is_finite() {
            if !y.is_finite() {
                return false;
            }
            scale = scale.max(x.abs());
            largest = largest.max((x - y).abs());
        }
    }
    largest <= ROUNDING * scale
}

/// Takes the most frequent factor out, again and again: a + x (b + x c).
fn horner(graph: &mut Graph, atoms: &Atoms, form: &Polynomial) -> Expr {
    let terms: Vec<(Monomial, f64)> =
        form.0.iter().map(|(monomial, quantity)| (monomial.clone(), quantity.value)).collect();
    nest(graph, atoms, terms)
}

fn nest(graph: &mut Graph, atoms: &Atoms, mut terms: Vec<(Monomial, f64)>) -> Expr {
    let mut parts: Vec<(f64, Expr)> = Vec::new();
    // Each round takes one factor out of the terms that have it; the rest go on.
    while let Some((atom, least)) = most_frequent(&terms) {
        let (with, without): (Vec<_>, Vec<_>) = terms
            .into_iter()
            .partition(|(m, _)| m.iter().any(|&(a, e)| a == atom && e.value() >= least));
        terms = without;
        let inner: Vec<(Monomial, f64)> = with
            .into_iter()
            .map(|(monomial, factor)| (lowered(&monomial, atom, least), factor))
            .collect();
        let inner = nest(graph, atoms, inner);
        let base = base(graph, atoms, atom);
        let product = graph.product(1.0, &[(base, least), (inner, 1.0)]);
        parts.push((1.0, product));
    }
    for (monomial, factor) in terms {
        let powers: Vec<(Expr, f64)> =
            monomial.iter().map(|&(a, e)| (base(graph, atoms, a), e.value())).collect();
        parts.push((factor, graph.product(1.0, &powers)));
    }
    graph.linear(0.0, &parts)
}

/// The atom that stands in most terms with a positive exponent, and its least exponent there;
/// `None` where no atom stands in two terms.
fn most_frequent(terms: &[(Monomial, f64)]) -> Option<(usize, f64)> {
    let mut counts: BTreeMap<usize, (usize, f64)> = BTreeMap::new();
    for (monomial, _) in terms {
        for &(atom, exponent) in monomial {
            if exponent.value() >= 1.0 {
                let entry = counts.entry(atom).or_insert((0, f64::INFINITY));
                entry.0 += 1;
                entry.1 = entry.1.min(exponent.value());
            }
        }
    }
    // Ties go to the first variable.
    let (atom, (count, least)) =
        counts.into_iter().max_by_key(|&(atom, (count, _))| (count, std::cmp::Reverse(atom)))?;
    (count >= 2).then_some((atom, least))
}

fn lowered(monomial: &Monomial, atom: usize, by: f64) -> Monomial {
    monomial
        .iter()
        .map(|&(a, e)| (a, if a == atom { e.value() - by } else { e.value() }))
        .filter(|&(_, e)| e != 0.0)
        .map(|(a, e)| (a, Number::new(e)))
        .collect()
}

fn base(graph: &mut Graph, atoms: &Atoms, atom: usize) -> Expr {
    match atoms.get(atom) {
        Atom::Symbol(symbol) => graph.symbol(*symbol),
        Atom::Apply(function, argument) => {
            let argument = horner(graph, atoms, argument);
            graph.apply(*function, argument)
        }
        Atom::Sum(sum) => horner(graph, atoms, sum),
        Atom::Power(base, exponent) => {
            let (base, exponent) = (horner(graph, atoms, base), horner(graph, atoms, exponent));
            graph.power_of(base, exponent)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn horner_is_equal_and_cheaper() {
        let mut graph = Graph::new();
        let (x, y) = (graph.symbol(Symbol::Coordinate(0)), graph.symbol(Symbol::Momentum(0)));
        let mut parts = Vec::new();
        for i in 0..6 {
            for j in 0..4 {
                let term = graph.product(1.0, &[(x, f64::from(i)), (y, f64::from(j))]);
                parts.push((0.3 + f64::from(i) - 0.7 * f64::from(j), term));
            }
        }
        let sum = graph.linear(0.0, &parts);
        let sine = graph.apply(crate::expr::Function::SIN, sum);
        let product = graph.multiply(sine, sum);
        let (new, forms) = for_machines(&graph, &[sum, product]);
        assert!(machine(&new, &forms) < 0.7 * machine(&graph, &[sum, product]));
        for k in 0..50 {
            let of = |symbol| match symbol {
                Symbol::Coordinate(_) => 1.3 - 0.05 * f64::from(k),
                _ => 0.04 * f64::from(k) - 0.9,
            };
            for (&old, &form) in [sum, product].iter().zip(&forms) {
                let (a, b) = (graph.value(old, &of), new.value(form, &of));
                assert!((a - b).abs() <= 1e-12 * a.abs().max(100.0), "{a} and {b}");
            }
        }
    }

    #[test]
    fn what_cannot_be_nested_stays() {
        let mut graph = Graph::new();
        let x = graph.symbol(Symbol::Coordinate(0));
        let log = graph.apply(crate::expr::Function::LOG, x);
        let (_, forms) = for_machines(&graph, &[log, x]);
        assert_eq!(forms, vec![log, x]);
        assert_eq!(for_machines(&graph, &[]).1, vec![]);
    }
}
