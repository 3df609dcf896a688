//! Rows on their way into a factor, as its arithmetic wants them.

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, Dyn, U1};

use crate::eval::{Aligned, REGISTER};

/// A matrix `[A b]` whose columns lie one after the other, each from the beginning of a line of the
/// cache on: no register straddles two lines, which would cost a third of the speed.
#[derive(Clone)]
pub struct Rectangle {
    values: Aligned,
    rows: usize,
    stride: usize,
    columns: usize,
}

impl Rectangle {
    /// So many rows and columns of zeros.
    pub fn zeros(rows: usize, columns: usize) -> Rectangle {
        let stride = rows.next_multiple_of(REGISTER);
        Rectangle { values: Aligned::zeros(stride * columns), rows, stride, columns }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns, b included.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Numbers in memory from one column to the next.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// One column.
    pub fn column(&self, k: usize) -> &[f64] {
        &self.values[k * self.stride..][..self.rows]
    }

    /// One column, to be changed.
    pub fn column_mut(&mut self, k: usize) -> &mut [f64] {
        &mut self.values[k * self.stride..][..self.rows]
    }

    /// All columns, with `stride` numbers from one to the next.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// The first `height` rows of `size` columns from `start` on, and of all columns after those.
    pub fn panel_and_rest(
        &mut self,
        start: usize,
        size: usize,
        height: usize,
    ) -> (View<'_>, ViewMut<'_>) {
        let stride = self.stride;
        let rest = self.columns - start - size;
        let (done, trailing) = self.values.split_at_mut((start + size) * stride);
        let done = &done[start * stride..];
        let shape = |columns: usize| (Dyn(height), Dyn(columns));
        let (r, c) = shape(size);
        let done = View::from_slice_with_strides_generic(done, r, c, U1, Dyn(stride));
        let (r, c) = shape(rest);
        let trailing = ViewMut::from_slice_with_strides_generic(trailing, r, c, U1, Dyn(stride));
        (done, trailing)
    }
}

/// Some rows and columns of a rectangle.
pub type View<'a> = DMatrixView<'a, f64, U1, Dyn>;
/// The same, to be changed.
pub type ViewMut<'a> = DMatrixViewMut<'a, f64, U1, Dyn>;

impl From<&DMatrix<f64>> for Rectangle {
    fn from(matrix: &DMatrix<f64>) -> Rectangle {
        let mut rectangle = Rectangle::zeros(matrix.nrows(), matrix.ncols());
        for (k, column) in matrix.column_iter().enumerate() {
            rectangle.column_mut(k).copy_from_slice(column.as_slice());
        }
        rectangle
    }
}
