//! Rows on their way into a factor.

use nalgebra::DMatrix;

use super::factor::Factor;
use super::rows::Rows;

/// Rows on their way into a factor, gathered until a product of matrices pays.
pub(super) struct Gathered {
    /// Gathered rows, then what is left of rows that went into the factor before.
    stacked: DMatrix<f64>,
    rows: usize,
    /// Residuals among the rows.
    count: usize,
}

impl Gathered {
    pub(super) fn new(width: usize) -> Gathered {
        Gathered { stacked: DMatrix::zeros(0, width), rows: 0, count: 0 }
    }

    /// Takes the rows below the eliminated states.
    pub(super) fn take(&mut self, rows: &Rows, factor: &mut Factor) {
        let kept = rows.rows.saturating_sub(rows.state);
        if kept == 0 {
            return;
        }
        let (width, lanes) = (self.stacked.ncols(), rows.lanes);
        let end = self.rows + kept * lanes;
        if self.stacked.nrows() < end {
            let mut larger = DMatrix::zeros(end.max(enough(width) + kept * lanes), width);
            larger.rows_mut(0, self.rows).copy_from(&self.stacked.rows(0, self.rows));
            self.stacked = larger;
        }
        for (column, mut stacked) in (rows.state..rows.columns).zip(self.stacked.column_iter_mut())
        {
            let into = &mut stacked.as_mut_slice()[self.rows..end];
            for (row, into) in (rows.state..rows.rows).zip(into.chunks_exact_mut(lanes)) {
                let at = (row * rows.columns + column) * lanes;
                into.copy_from_slice(&rows.values[at..at + lanes]);
            }
        }
        self.rows = end;
        self.count += (0..lanes)
            .filter(|&lane| rows.losses[lane].is_finite())
            .map(|lane| rows.independent(lane))
            .sum::<usize>();
        if self.rows >= enough(width) {
            self.flush(factor);
        }
    }

    pub(super) fn flush(&mut self, factor: &mut Factor) {
        if self.rows == 0 {
            return;
        }
        factor.push_upper(&mut self.stacked, self.rows, self.count);
        self.rows = 0;
        self.count = 0;
    }
}

/// Rows that are worth a product.
fn enough(width: usize) -> usize {
    (4 * width).max(256)
}
