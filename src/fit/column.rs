//! Columns of a least-squares problem.

use std::ops::{Index, IndexMut};

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use crate::expr::TermId;

/// A column of a design matrix and of its triangular factor: one unknown of a least-squares
/// problem, by its number from 0.
///
/// In the factor of the whole function space the coefficients of all terms come first, in the
/// terms' order, then the inner parameters; a factor of some of these columns numbers them anew.
/// Which of the two a column is of is not in its type. What it keeps apart is columns from terms
/// ([`TermId`]), inner parameters ([`ParameterId`](crate::expr::ParameterId)), rows and counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(transparent)]
#[repr(transparent)]
pub struct Column(usize);

impl Column {
    /// The column with so many before it.
    pub const fn new(position: usize) -> Column {
        Column(position)
    }

    /// All columns of a factor that has so many, in their order.
    pub fn all(count: usize) -> impl DoubleEndedIterator<Item = Column> + ExactSizeIterator {
        (0..count).map(Column)
    }

    /// How many columns stand before it: its number in the matrices of `nalgebra`.
    pub const fn position(self) -> usize {
        self.0
    }
}

/// The column of a term's coefficient in the factor of the whole function space.
impl From<TermId> for Column {
    fn from(id: TermId) -> Column {
        Column(id.position())
    }
}

// Lists with one entry for each column are read by the column.
impl<T> Index<Column> for [T] {
    type Output = T;

    fn index(&self, column: Column) -> &T {
        &self[column.0]
    }
}

impl<T> Index<Column> for Vec<T> {
    type Output = T;

    fn index(&self, column: Column) -> &T {
        &self[column.0]
    }
}

impl<T> IndexMut<Column> for Vec<T> {
    fn index_mut(&mut self, column: Column) -> &mut T {
        &mut self[column.0]
    }
}

impl Index<Column> for DVector<f64> {
    type Output = f64;

    fn index(&self, column: Column) -> &f64 {
        &self[column.0]
    }
}

impl IndexMut<Column> for DVector<f64> {
    fn index_mut(&mut self, column: Column) -> &mut f64 {
        &mut self[column.0]
    }
}
