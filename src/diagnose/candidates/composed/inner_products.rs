//! Inner products of many columns, panel by panel on all cores.

use nalgebra::DMatrix;
use rayon::prelude::*;

/// Columns that are multiplied with others at once; it changes cost alone.
const PANEL: usize = 128;

/// Inner products of some columns with one another, each of them computed once.
pub(super) fn inner_products(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let all = columns.ncols();
    let firsts: Vec<usize> = (0..all).step_by(PANEL).collect();
    // `tr_mul` takes one inner product after another; a product of matrices is blocked.
    let panel = |&first: &usize| {
        let own = columns.columns(first, PANEL.min(all - first));
        own.transpose() * columns.columns(first, all - first)
    };
    let panels: Vec<DMatrix<f64>> = firsts.par_iter().map(panel).collect();
    let mut products = DMatrix::zeros(all, all);
    for (first, panel) in firsts.into_iter().zip(panels) {
        products.view_mut((first, first), panel.shape()).copy_from(&panel);
    }
    products.fill_lower_triangle_with_upper_triangle();
    products
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_products_of_any_number_of_columns_are_there() {
        for count in [1, PANEL, 2 * PANEL + 5] {
            let columns = DMatrix::from_fn(7, count, |i, j| ((3 * i + 5 * j) as f64).sin());
            let expected = columns.tr_mul(&columns);
            assert!((inner_products(&columns) - expected).amax() < 1e-12, "{count}");
        }
    }
}
