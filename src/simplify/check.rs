//! Comparison of forms with the fitted model at sampled points.

use egg::RecExpr;

use super::FittedLaw;
use super::lang::{Math, evaluate};
use crate::expr::{Delay, Expr, Place, Symbol};

/// Largest difference that counts as rounding, relative to the largest value.
pub(super) const ROUNDING: f64 = 1e-9;

/// Points with the model's values there.
pub(super) struct Samples {
    degrees: usize,
    points: Vec<Vec<f64>>,
    values: Vec<f64>,
    /// Energies are compared up to a constant.
    energy: bool,
}

/// How many points are tried; those outside the model's domain are left out.
const TRIED: usize = 48;

/// Points of the additive recurrence of the golden ratio's relatives, the same every time.
pub(super) fn coordinate(point: usize, component: usize) -> f64 {
    let step = (component as f64 + 2.0).sqrt() * 0.618_033_988_749_894_9 + 0.377 * component as f64;
    ((point + 1) as f64 * step + 0.31 * component as f64).fract()
}

impl Samples {
    pub(super) fn new(fitted: &FittedLaw, place: Place) -> Self {
        let law = fitted.law;
        let system = law.system();
        let degrees = system.degrees();
        let known = match place {
            Place::Kinetic => Some(system.kinetic),
            Place::Potential => Some(system.potential),
            Place::Hamiltonian => Some(system.hamiltonian),
            Place::Force(i) => system.forces.get(i).copied(),
            Place::Rate(i) => system.internal(i).and_then(|state| state.rate),
            Place::Sensor(i) => system.sensors.get(i).copied(),
        };
        let mut terms: Vec<(f64, Expr)> = known.into_iter().map(|known| (1.0, known)).collect();
        terms.extend(
            law.terms().filter_map(|(_, term, value)| term.part(place).map(|expr| (value, expr))),
        );
        let energy = place.is_energy();
        let mut out = Samples { degrees, points: Vec::new(), values: Vec::new(), energy };
        for k in 0..TRIED {
            // Half of the points in a box around the origin, half where all is positive, for
            // roots and logarithms.
            let (low, high) = if k % 2 == 0 { (-1.4, 1.4) } else { (0.1, 2.1) };
            let point: Vec<f64> =
                (0..=2 * degrees).map(|i| low + (high - low) * coordinate(k, i)).collect();
            let of = |symbol| match symbol {
                Symbol::Parameter(i) => law.parameters().get(i).copied().unwrap_or(f64::NAN),
                symbol => variable(&point, degrees, symbol),
            };
            let value: f64 = terms.iter().map(|&(c, term)| c * system.graph.value(term, &of)).sum();
            if value.is_finite() {
                out.points.push(point);
                out.values.push(value);
            }
        }
        out
    }

    pub(super) fn len(&self) -> usize {
        self.points.len()
    }

    fn evaluate(&self, expr: &RecExpr<Math>, number: &dyn Fn(usize) -> f64) -> Vec<f64> {
        let at = |point: &Vec<f64>| {
            evaluate(expr, number, &|symbol| variable(point, self.degrees, symbol))
        };
        self.points.iter().map(at).collect()
    }

    /// Largest difference of a form from the model, relative to the largest value.
    pub(super) fn against_model(&self, expr: &RecExpr<Math>, number: &dyn Fn(usize) -> f64) -> f64 {
        self.difference(&self.values, &self.evaluate(expr, number))
    }

    /// Largest difference of two forms.
    pub(super) fn between(
        &self,
        a: &RecExpr<Math>,
        b: &RecExpr<Math>,
        number: &dyn Fn(usize) -> f64,
    ) -> f64 {
        self.difference(&self.evaluate(a, number), &self.evaluate(b, number))
    }

    /// Points where the first is not finite say nothing; one where only the second is not
    /// is an infinite difference.
    fn difference(&self, a: &[f64], b: &[f64]) -> f64 {
        let mut scale = 1e-300;
        let mut offset = None;
        let mut largest: f64 = 0.0;
        for (x, y) in a.iter().zip(b).filter(|(x, _)| x.is_finite()) {
            if !y.is_finite() {
                return f64::INFINITY;
            }
            let shift = if self.energy { *offset.get_or_insert(x - y) } else { 0.0 };
            scale = f64::max(scale, x.abs()).max(y.abs());
            largest = largest.max((x - y - shift).abs());
        }
        largest / scale
    }
}

fn variable(point: &[f64], degrees: usize, symbol: Symbol) -> f64 {
    let index = match symbol {
        Symbol::Coordinate(i) => i,
        Symbol::Momentum(i) => degrees + i,
        Symbol::Time => 2 * degrees,
        // Any number that differs from point to point and from input to input.
        Symbol::Input(i, order) => {
            let along: f64 = point.iter().sum();
            return (97.0 * along + 1.3 * i as f64 + 0.7 * order as f64).sin();
        }
        Symbol::Delayed(i, order, by) => {
            let by = match by {
                Delay::Number(number) => number.value(),
                Delay::Parameter(j) => 2.1 + j as f64,
            };
            let along: f64 = point.iter().sum();
            return (97.0 * along + 1.3 * i as f64 + 0.7 * order as f64 + 11.0 * by).sin();
        }
        Symbol::Velocity(_) | Symbol::Parameter(_) | Symbol::Coefficient(_) => return f64::NAN,
    };
    point.get(index).copied().unwrap_or(f64::NAN)
}
