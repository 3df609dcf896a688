//! The triangular factor of a least-squares problem: all that training keeps of the data.
//!
//! A problem `min |A x - b|` with any number of rows is kept as the upper triangle R of
//! the QR decomposition of `[A b]`. Factors merge (stack, decompose again), so that data
//! stream through, blocks of data are worked on side by side, and folds of the data can be
//! recombined. The condition number is that of A; the Gram matrix would have its square.

use nalgebra::{DMatrix, DVector};

use super::blocking::BLOCKING;
use super::column::Column;
use super::rectangle::Rectangle;
use crate::eval::{GROUP, InstructionSet, Reflections, multiply, product, reflect};

/// R of `[A b]`: `columns` + 1 square, upper triangular, b last.
#[derive(Debug, Clone, PartialEq)]
pub struct Factor {
    triangle: DMatrix<f64>,
    /// Independent rows that went in: the number of residuals.
    rows: usize,
}

impl Factor {
    /// The factor of no data for `columns` unknowns.
    pub fn new(columns: usize) -> Self {
        Factor { triangle: DMatrix::zeros(columns + 1, columns + 1), rows: 0 }
    }

    /// The factor whose R is known: upper triangular, b last. `rows` residuals went into it.
    pub(super) fn of_triangle(triangle: DMatrix<f64>, rows: usize) -> Self {
        Factor { triangle, rows }
    }

    /// Number of unknowns K.
    pub fn columns(&self) -> usize {
        self.triangle.ncols() - 1
    }

    /// Number of residuals.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Takes rows `[A b]` in (m x (K + 1)). `count` of them are residuals, the rest is padding
    /// with zeros.
    pub fn push(&mut self, rows: &DMatrix<f64>, count: usize) {
        self.take(&mut Rectangle::from(rows), rows.nrows(), count);
    }

    /// The same for the first `filled` rows, which are overwritten; whatever stands below them is
    /// left alone.
    ///
    /// Elimination of a rectangle under a triangle by block reflectors: Schreiber and
    /// Van Loan, "A storage-efficient WY representation", SIAM J. Sci. Stat. Comput. 10
    /// (1989), in the triangle-over-rectangle form.
    pub fn take(&mut self, rows: &mut Rectangle, filled: usize, count: usize) {
        let width = self.triangle.ncols();
        debug_assert_eq!(rows.columns(), width);
        self.rows += count;
        if filled == 0 {
            return;
        }
        let panel = if width <= BLOCKING.one_panel { width } else { BLOCKING.panel };
        for start in (0..width).step_by(panel) {
            let size = panel.min(width - start);
            // Below the last row that is not zero nothing happens: triangles cost a third.
            let heights = heights(rows, filled, start..start + size);
            let height = heights.iter().copied().max().unwrap_or(0);
            if height == 0 {
                continue;
            }
            let rest = width - start - size;
            let reflector = self.eliminate(rows, start, &heights, rest > 0);
            if rest > 0 {
                let (done, mut trailing) = rows.panel_and_rest(start, size, height);
                let mut top = self.triangle.view_mut((start, start + size), (size, rest));
                let mut projected = top.clone_owned();
                // A product with a transposed view is slow in nalgebra, with a copy fast.
                projected.gemm(1.0, &done.transpose(), &trailing, 1.0);
                let projected = reflector.transpose() * projected;
                top -= &projected;
                trailing.gemm(-1.0, &done, &projected, 1.0);
            }
        }
    }

    /// Reflects the panel's rectangle to zero; leaves the reflectors in it and returns
    /// the small triangle T of Q = I - V T V', whole only if that is `wanted` for columns to the
    /// right of the panel.
    fn eliminate(
        &mut self,
        rows: &mut Rectangle,
        start: usize,
        heights: &[usize],
        wanted: bool,
    ) -> DMatrix<f64> {
        let (size, width, stride) = (heights.len(), self.triangle.nrows(), rows.stride());
        let set = InstructionSet::widest();
        let values = rows.values_mut();
        let mut t = DMatrix::zeros(size, size);
        let mut height = 0;
        for j in 0..size {
            let column = start + j;
            // Further columns of a triangle reach further down: no row is touched too early.
            height = heights[j].max(height);
            // The reflections of a group reach the columns to its right together.
            let first = j / GROUP * GROUP;
            let end = (first + GROUP).min(size);
            t[(j, j)] = self.eliminate_column(values, stride, height, column..start + end);
            let before = if wanted { 0 } else { first };
            if t[(j, j)] != 0.0 {
                let vector = |k: usize| &values[(start + k) * stride..][..height];
                for l in before..j {
                    let overlap = product(set, vector(l), vector(j));
                    // T times the overlaps, column by column: T_il is zero for l < i.
                    let factor = overlap * t[(j, j)];
                    let (known, new) = t.as_mut_slice().split_at_mut(j * size);
                    let known = &known[l * size..][before..=l];
                    new[before..=l].iter_mut().zip(known).for_each(|(t, x)| *t -= x * factor);
                }
            }
            if j + 1 == end && end < size {
                let (vectors, columns) = values.split_at_mut((column + 1) * stride);
                let triangle = |m: usize| std::array::from_fn(|l| t[(first + l, first + m)]);
                let by: Reflections<GROUP> = Reflections {
                    vectors: &vectors[(start + first) * stride..],
                    height,
                    stride,
                    triangle: std::array::from_fn(triangle),
                };
                let heads = (column + 1) * width + start + first;
                let heads = &mut self.triangle.as_mut_slice()[heads..];
                reflect(set, &by, heads, width, &mut columns[..(size - end) * stride]);
            }
        }
        t
    }

    /// Reflects the first of some columns to zero, below the triangle's own row, and takes the
    /// reflection to the others. Returns tau of I - tau v v', zero where there was nothing.
    fn eliminate_column(
        &mut self,
        values: &mut [f64],
        stride: usize,
        height: usize,
        columns: std::ops::Range<usize>,
    ) -> f64 {
        let set = InstructionSet::widest();
        let (column, width) = (columns.start, self.triangle.nrows());
        let (done, others) = values.split_at_mut((column + 1) * stride);
        let vector = &mut done[column * stride..][..height];
        let below = product(set, vector, vector);
        if below == 0.0 {
            return 0.0;
        }
        let alpha = self.triangle[(column, column)];
        let beta = -(alpha * alpha + below).sqrt().copysign(alpha);
        let tau = (beta - alpha) / beta;
        let inverse = 1.0 / (alpha - beta);
        multiply(set, vector, inverse);
        self.triangle[(column, column)] = beta;
        let count = columns.len() - 1;
        if count > 0 {
            let by = Reflections { vectors: vector, height, stride, triangle: [[tau]] };
            let heads = &mut self.triangle.as_mut_slice()[(column + 1) * width + column..];
            reflect(set, &by, heads, width, &mut others[..count * stride]);
        }
        tau
    }

    /// Factors of the same unknowns together, each taken so many times.
    pub fn together<'a>(columns: usize, parts: impl Iterator<Item = (&'a Factor, u32)>) -> Factor {
        let parts: Vec<(&Factor, u32)> = parts.filter(|(_, times)| *times > 0).collect();
        let width = columns + 1;
        if width > 4 * BLOCKING.panel {
            // Memory counts more than the many small products.
            let mut all = Factor::new(columns);
            parts.iter().for_each(|(part, times)| all.merge(&part.repeated(*times)));
            return all;
        }
        // First rows first, then second rows: what is below them in a column is then zero.
        let mut rows = Rectangle::zeros(width * parts.len(), width);
        for (at, (part, times)) in parts.iter().enumerate() {
            let scale = f64::from(*times).sqrt();
            for (k, from) in part.triangle.column_iter().enumerate() {
                let into = rows.column_mut(k);
                for (row, x) in from.iter().enumerate() {
                    into[row * parts.len() + at] = scale * x;
                }
            }
        }
        let mut all = Factor::new(columns);
        let count = parts.iter().map(|(part, times)| part.rows * *times as usize).sum();
        let filled = rows.rows();
        all.take(&mut rows, filled, count);
        all
    }

    /// Takes another factor of the same unknowns in.
    pub fn merge(&mut self, other: &Factor) {
        self.push(&other.triangle, other.rows);
    }

    /// The same problem with only some of the unknowns, in the order given; the others are zero.
    pub fn select(&self, unknowns: &[Column]) -> Factor {
        if unknowns.iter().copied().eq(Column::all(self.columns())) {
            return self.clone();
        }
        let unknowns = unknowns.iter().map(|column| column.position());
        let columns: Vec<usize> = unknowns.chain([self.columns()]).collect();
        let mut selected = Factor::new(columns.len() - 1);
        selected.push(&self.triangle.select_columns(&columns), self.rows);
        selected
    }

    /// R itself, b last.
    pub fn triangle(&self) -> &DMatrix<f64> {
        &self.triangle
    }

    /// The upper triangle of A alone (K x K).
    pub fn design(&self) -> DMatrix<f64> {
        let k = self.columns();
        self.triangle.view((0, 0), (k, k)).clone_owned()
    }

    /// The right-hand side that belongs to [`Factor::design`].
    pub fn target(&self) -> DVector<f64> {
        let k = self.columns();
        self.triangle.view((0, k), (k, 1)).column(0).clone_owned()
    }

    /// Sum of squared residuals that no choice of the unknowns can remove.
    pub fn least(&self) -> f64 {
        let k = self.columns();
        self.triangle[(k, k)].powi(2)
    }

    /// Sum of squared residuals at `unknowns`.
    pub fn squares(&self, unknowns: &DVector<f64>) -> f64 {
        let mut misfit = -self.target();
        for (j, &x) in unknowns.iter().enumerate() {
            let column = self.triangle.view((0, j), (j + 1, 1));
            misfit.rows_mut(0, j + 1).axpy(x, &column.column(0), 1.0);
        }
        misfit.norm_squared() + self.least()
    }

    /// Moves the origin: the unknowns are from now on counted from `origin`.
    pub fn shift(&mut self, origin: &DVector<f64>) {
        let k = self.columns();
        let moved = self.target() - self.design() * origin;
        self.triangle.view_mut((0, k), (k, 1)).copy_from(&moved);
    }

    /// The factor of the same data taken `count` times.
    pub fn repeated(&self, count: u32) -> Factor {
        Factor {
            triangle: &self.triangle * f64::from(count).sqrt(),
            rows: self.rows * count as usize,
        }
    }

    /// Sets the columns of A to zero that `negligible(column, norm)` names.
    pub fn zero_columns(&mut self, negligible: impl Fn(Column, f64) -> bool) {
        for (k, norm) in self.norms().into_iter().enumerate() {
            if norm > 0.0 && negligible(Column::new(k), norm) {
                self.triangle.column_mut(k).fill(0.0);
            }
        }
    }

    /// Euclidean norm of each column of A.
    pub fn norms(&self) -> Vec<f64> {
        (0..self.columns()).map(|k| self.triangle.view((0, k), (k + 1, 1)).norm()).collect()
    }
}

/// Rows of each of some columns up to the last that is not zero.
fn heights(rows: &Rectangle, filled: usize, columns: std::ops::Range<usize>) -> Vec<usize> {
    let last =
        |k: usize| rows.column(k)[..filled].iter().rposition(|x| *x != 0.0).map_or(0, |at| at + 1);
    columns.map(last).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    fn random(rows: usize, columns: usize, seed: u64) -> DMatrix<f64> {
        let mut rng = Pcg64::seed_from_u64(seed);
        DMatrix::from_fn(rows, columns, |_, _| rng.random_range(-1.0..1.0))
    }

    #[test]
    fn agrees_with_a_plain_decomposition_whatever_the_blocks() {
        for columns in [1, 5, 31, 32, 33, 70] {
            let all = random(200, columns + 1, columns as u64);
            let mut factor = Factor::new(columns);
            for (from, to) in [(0, 3), (3, 90), (90, 90), (90, 200)] {
                factor.push(&all.rows(from, to - from).clone_owned(), to - from);
            }
            let gram = all.transpose() * &all;
            let ours = factor.triangle.transpose() * &factor.triangle;
            assert!((gram - ours).amax() < 1e-12 * 200.0);
            for column in 0..=columns {
                for row in column + 1..=columns {
                    assert_eq!(factor.triangle[(row, column)], 0.0);
                }
            }
        }
    }

    #[test]
    fn merging_equals_stacking() {
        let all = random(60, 8, 7);
        let mut whole = Factor::new(7);
        whole.push(&all, 60);
        let mut parts = Factor::new(7);
        for block in 0..3 {
            let mut part = Factor::new(7);
            part.push(&all.rows(block * 20, 20).clone_owned(), 20);
            parts.merge(&part);
        }
        let x = DVector::from_fn(7, |i, _| i as f64 / 7.0);
        assert!((whole.squares(&x) - parts.squares(&x)).abs() < 1e-11);
        assert_eq!(whole.rows(), parts.rows());
    }

    #[test]
    fn selection_keeps_the_squares() {
        let mut whole = Factor::new(6);
        whole.push(&random(40, 7, 3), 40);
        let picked = whole.select(&[4, 1].map(Column::new));
        let x = DVector::from_vec(vec![0.0, 0.3, 0.0, 0.0, -0.8, 0.0]);
        let y = DVector::from_vec(vec![-0.8, 0.3]);
        assert!((whole.squares(&x) - picked.squares(&y)).abs() < 1e-12);
    }
}
