//! Which terms of a function space are not identifiable, whatever is measured.
//!
//! The equations of motion are linear in the coefficients: term k moves the state by a
//! vector field (dphi_k/dp, -dphi_k/dq), or (0, psi_k) for a force. Where these fields are
//! linearly dependent, no measurement tells their coefficients. The fields are evaluated
//! at random states, and the dependences read off a pivoted QR factorisation.

use std::collections::HashMap;

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;

use super::graph::{Expr, Node, Symbol, raise};
use super::system::{Place, System};

/// Function spaces with more terms are not examined: the factorisation is cubic in them.
pub const MOST_EXAMINED: usize = 600;

/// A column is dependent when less than this of its length is not spanned by others.
const TOLERANCE: f64 = 1e-11;

/// Coefficients below this part of the largest are rounding errors.
const NEGLIGIBLE: f64 = 1e-7;

/// A combination of terms that moves nothing: sum of factor * term has no effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Dependence {
    /// (term of the system, factor); the last factor is 1.
    pub combination: Vec<(usize, f64)>,
}

/// Every independent combination of terms without effect on the equations of motion.
///
/// `None` for function spaces of more than [`MOST_EXAMINED`] terms, and where too few
/// random states lie in the domain of every term.
pub fn dependences(system: &System) -> Option<Vec<Dependence>> {
    let count = system.terms.len();
    if count > MOST_EXAMINED {
        return None;
    }
    if count == 0 {
        return Some(Vec::new());
    }
    let fields = sample_fields(system)?;
    let norms: Vec<f64> = fields.column_iter().map(|column| column.norm()).collect();
    let mut scaled = fields;
    for (mut column, &norm) in scaled.column_iter_mut().zip(&norms) {
        if norm > 0.0 {
            column /= norm;
        }
    }
    let factorised = scaled.col_piv_qr();
    let upper = factorised.r();
    let mut order = nalgebra::RowDVector::from_iterator(count, (0..count).map(|k| k as f64));
    factorised.p().permute_columns(&mut order);
    let order: Vec<usize> = order.iter().map(|&k| k as usize).collect();
    let largest = upper[(0, 0)].abs();
    let rank = (0..count).take_while(|&k| upper[(k, k)].abs() > TOLERANCE * largest).count();
    let leading = upper.view((0, 0), (rank, rank)).into_owned();
    let mut out = Vec::new();
    for column in rank..count {
        let right = DVector::from_iterator(rank, (0..rank).map(|row| upper[(row, column)]));
        let Some(weights) = leading.solve_upper_triangular(&right) else { continue };
        // In terms of the fields as they are, not scaled to length 1.
        let own = order[column];
        let unscaled = |k: usize| if norms[k] > 0.0 { 1.0 / norms[k] } else { 1.0 };
        let of_own = unscaled(own);
        let largest = weights.iter().fold(0.0_f64, |a, w| a.max(w.abs())).max(1.0);
        let mut combination: Vec<(usize, f64)> = weights
            .iter()
            .enumerate()
            .filter(|(_, weight)| weight.abs() > NEGLIGIBLE * largest)
            .map(|(row, weight)| (order[row], -weight * unscaled(order[row]) / of_own))
            .collect();
        combination.sort_by_key(|&(k, _)| k);
        combination.push((own, 1.0));
        out.push(Dependence { combination });
    }
    out.sort_by_key(|dependence| dependence.combination.first().map(|&(k, _)| k));
    Some(out)
}

/// The vector field of every term at random states: `[state component of a sample][term]`.
fn sample_fields(system: &System) -> Option<DMatrix<f64>> {
    let (n, count) = (system.degrees(), system.terms.len());
    let mut graph = system.graph.clone();
    let state = system.state();
    let mut roots: Vec<(usize, usize, f64, Expr)> = Vec::new();
    let parts = |wanted: fn(Place) -> bool| {
        let terms = system.terms.iter().enumerate();
        terms.flat_map(move |(k, term)| {
            term.parts().filter(move |part| wanted(part.0)).map(move |(place, e)| (k, place, e))
        })
    };
    let (energies, exprs): (Vec<usize>, Vec<Expr>) =
        parts(Place::is_energy).map(|(k, _, expr)| (k, expr)).unzip();
    for (i, &symbol) in state.iter().enumerate() {
        // dq/dt = dH/dp and dp/dt = -dH/dq.
        let (component, sign) = if i < n { (n + i, -1.0) } else { (i - n, 1.0) };
        for (&k, derivative) in energies.iter().zip(graph.derivatives(&exprs, symbol)) {
            if !graph.is_zero(derivative) {
                roots.push((k, component, sign, derivative));
            }
        }
    }
    // What is measured comes after what moves.
    for (k, place, expr) in parts(|place| !place.is_energy()) {
        match place {
            Place::Force(i) => roots.push((k, n + i, 1.0, expr)),
            Place::Rate(i) => roots.push((k, i, 1.0, expr)),
            Place::Sensor(i) => roots.push((k, 2 * n + i, 1.0, expr)),
            _ => {}
        }
    }
    let sensors =
        if parts(Place::is_sensor).next().is_some() { system.observed_count() } else { 0 };
    let height = 2 * n + sensors;
    let exprs: Vec<Expr> = roots.iter().map(|root| root.3).collect();
    let program = graph.topological(&exprs);
    let mut driven = graph.symbols(&exprs);
    driven.retain(|symbol| symbol.is_driving());
    let samples = (2 * count).div_ceil(2 * n) + 20;
    let mut rng = Pcg64::seed_from_u64(0x4c65_7665);
    let around = Uniform::new(-1.4, 1.4).ok()?;
    let mut rows = DMatrix::zeros(samples * height, count);
    let mut values: Vec<f64> = vec![0.0; graph.len()];
    let mut kept = 0;
    for _ in 0..50 * samples {
        let mut symbols: HashMap<Symbol, f64> = HashMap::new();
        for &symbol in &state {
            symbols.insert(symbol, around.sample(&mut rng));
        }
        symbols.insert(Symbol::Time, around.sample(&mut rng));
        for &input in &driven {
            symbols.insert(input, around.sample(&mut rng));
        }
        // Rates of the state hold coefficients.
        for k in 0..count {
            symbols.insert(Symbol::Coefficient(k), around.sample(&mut rng));
        }
        for (i, parameter) in system.parameters.iter().enumerate() {
            let near = parameter.start + 0.3 * around.sample(&mut rng);
            symbols.insert(Symbol::Parameter(i), parameter.bounds.clamp(near));
        }
        for &part in &program {
            let value = match graph.node(part) {
                Node::Number(number) => number.value(),
                Node::Symbol(symbol) => symbols.get(symbol).copied().unwrap_or(f64::NAN),
                Node::Sum { constant, terms } => {
                    let sum: f64 =
                        terms.iter().map(|(t, c)| c.value() * values[t.0 as usize]).sum();
                    constant.value() + sum
                }
                Node::Product(parts) => {
                    parts.iter().map(|(b, e)| raise(values[b.0 as usize], e.value())).product()
                }
                Node::Power(base, exponent) => {
                    values[base.0 as usize].powf(values[exponent.0 as usize])
                }
                Node::Apply(function, x) => (function.row().value)(values[x.0 as usize]),
            };
            values[part.0 as usize] = value;
        }
        if roots.iter().any(|root| !values[root.3.0 as usize].is_finite()) {
            continue;
        }
        for &(k, component, sign, expr) in &roots {
            rows[(kept * height + component, k)] += sign * values[expr.0 as usize];
        }
        kept += 1;
        if kept == samples {
            return Some(rows);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Vec<Vec<(String, f64)>> {
        let compiled = super::super::build("test", text).unwrap_or_else(|e| panic!("{e}"));
        let found = dependences(&compiled.system).unwrap_or_default();
        let label = |k: usize| compiled.system.terms[k].label.clone();
        found
            .into_iter()
            .map(|d| d.combination.into_iter().map(|(k, f)| (label(k), f)).collect())
            .collect()
    }

    #[test]
    fn a_completed_square_and_its_parts_are_dependent() {
        let found = of("coordinates q[1..2]; momenta p[1..2]; T = p[1]^2 + p[2]^2
            V = span{ (q[2] - q[1])^2, q[1]^2, q[2]^2, q[1]*q[2] }");
        assert_eq!(found.len(), 1);
        let mut factors: Vec<f64> = found[0].iter().map(|&(_, f)| f).collect();
        // (q2 - q1)^2 - q1^2 - q2^2 + 2 q1 q2 = 0, up to a factor.
        let smallest = factors.iter().fold(f64::INFINITY, |a, f| a.min(f.abs()));
        factors.iter_mut().for_each(|f| *f = f.abs() / smallest);
        factors.sort_by(f64::total_cmp);
        for (found, expected) in factors.iter().zip([1.0, 1.0, 1.0, 2.0]) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
    }

    #[test]
    fn a_force_that_has_a_potential_is_dependent_on_it() {
        let found =
            of("coordinates q; momenta p; T = p^2/2; V = span{ q^2 }; force q += span{ q }");
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].len(), 2);
    }

    #[test]
    fn high_degrees_are_independent() {
        assert!(
            of("coordinates q[1..2]; momenta p[1..2]
            T = span{ tensor(p; 10) }; V = span{ tensor(q; 10) }")
            .is_empty()
        );
        assert!(
            of("coordinates x; momenta p; param a = 0; param b = 0
            T = p^2/2; V = span{ poly(x; 3), sin((1 + a)*x + b) }")
            .is_empty()
        );
        assert!(
            of("coordinates x; momenta p; T = p^2/2; V = span{ log(x), 1/x, sqrt(x) }").is_empty()
        );
    }
}
