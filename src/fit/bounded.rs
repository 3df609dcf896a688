//! Small least-squares problems on a triangular factor, within bounds.

use nalgebra::DVector;

use super::column::Column;
use super::factor::Factor;
use super::rounding::{NO_SLOPE, SPANNED};
use crate::expr::Bounds;

/// Least squares within bounds.
pub struct Bounded {
    /// The unknowns x, `[column of the factor]`.
    pub values: DVector<f64>,
    /// |A x - b|^2 at the solution.
    pub squares: f64,
    /// Unknowns that ended on a bound.
    pub bound: Vec<Column>,
}

/// Solves `min |A x - b|` with `lower <= x <= upper` by an active set: what leaves its bounds
/// is fixed on them, what pulls back inside is freed again
/// (Stark and Parker, "Bounded-variable least squares", Comput. Stat. 10, 1995).
pub fn solve_bounded(factor: &Factor, bounds: impl Fn(Column) -> Bounds) -> Bounded {
    let size = factor.columns();
    let values = solve_triangle(factor);
    if Column::all(size).all(|k| bounds(k).clamp(values[k]) == values[k]) {
        return Bounded { squares: factor.squares(&values), values, bound: Vec::new() };
    }
    let mut fixed: Vec<Option<f64>> = vec![None; size];
    let mut values = DVector::zeros(size);
    for _ in 0..=3 * size {
        let free: Vec<Column> = Column::all(size).filter(|&k| fixed[k].is_none()).collect();
        let mut reduced = factor.clone();
        let held = DVector::from_fn(size, |k, _| fixed[k].unwrap_or(0.0));
        reduced.shift(&held);
        let solution = solve_triangle(&reduced.select(&free));
        values = held;
        for (&k, &x) in free.iter().zip(solution.iter()) {
            values[k] = x;
        }
        let outside = free.iter().copied().find(|&k| bounds(k).clamp(values[k]) != values[k]);
        if let Some(k) = outside {
            fixed[k] = Some(bounds(k).clamp(values[k]));
            continue;
        }
        let slope = factor.design().tr_mul(&(factor.target() - factor.design() * &values));
        let release = Column::all(size).find(|&k| {
            let inward = match fixed[k] {
                Some(x) if x <= bounds(k).lower => slope[k],
                Some(_) => -slope[k],
                None => return false,
            };
            bounds(k).lower < bounds(k).upper && inward > NO_SLOPE * slope.amax()
        });
        match release {
            Some(k) => fixed[k] = None,
            None => break,
        }
    }
    let bound = Column::all(size).filter(|&k| fixed[k].is_some()).collect();
    Bounded { squares: factor.squares(&values), values, bound }
}

/// Back substitution; an unknown that the data do not touch, or that earlier ones span, is zero.
pub fn solve_triangle(factor: &Factor) -> DVector<f64> {
    let triangle = factor.triangle();
    let size = factor.columns();
    // What is left of the target, column after column.
    let mut left = factor.target();
    let mut solution = DVector::zeros(size);
    for k in (0..size).rev() {
        let column = &triangle.column(k);
        let pivot = column[k];
        if pivot == 0.0 || pivot.abs() <= SPANNED * column.rows(0, k + 1).norm() {
            continue;
        }
        let value = left[k] / pivot;
        solution[k] = value;
        left.rows_mut(0, k).axpy(-value, &column.rows(0, k), 1.0);
    }
    solution
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    #[test]
    fn a_bound_that_matters_is_kept_and_the_rest_adapts() {
        // x + y = 3 and x - y = 1, twice as sure of the sum: the free optimum is (2, 1).
        let rows = DMatrix::from_row_slice(2, 3, &[2.0, 2.0, 6.0, 1.0, -1.0, 1.0]);
        let mut factor = Factor::new(2);
        factor.push(&rows, 2);
        let free = solve_bounded(&factor, |_| Bounds::FREE);
        assert!((free.values[0] - 2.0).abs() < 1e-12 && free.bound.is_empty());
        let at_most = |k: Column| {
            if k.position() == 0 { Bounds { lower: 0.0, upper: 1.5 } } else { Bounds::FREE }
        };
        let held = solve_bounded(&factor, at_most);
        // With x = 1.5 the squares 4 (y - 1.5)^2 + (0.5 - y)^2 are least at y = 1.3.
        assert_eq!(held.values[0], 1.5);
        assert!((held.values[1] - 1.3).abs() < 1e-12);
        assert_eq!(held.bound, vec![Column::new(0)]);
    }
}
