//! Rows on their way into a factor.

use super::factor::Factor;
use super::rectangle::Rectangle;
use super::rows::DesignRows;

/// Rows on their way into a factor, gathered until a product of matrices pays.
#[derive(Clone)]
pub(super) struct Gathered {
    /// Gathered rows, then what is left of rows that went into the factor before.
    stacked: Rectangle,
    rows: usize,
    /// Residuals among the rows.
    count: usize,
}

impl Gathered {
    pub(super) fn new(width: usize) -> Gathered {
        Gathered { stacked: Rectangle::zeros(0, width), rows: 0, count: 0 }
    }

    /// Takes the rows below the eliminated states.
    pub(super) fn take(&mut self, rows: &DesignRows, factor: &mut Factor) {
        let (width, lanes) = (self.stacked.columns(), rows.lanes);
        let enough = enough(width);
        if self.stacked.rows() < enough + lanes {
            self.flush(factor);
            self.stacked = Rectangle::zeros(enough + lanes, width);
        }
        self.count += (0..lanes)
            .filter(|&lane| rows.losses[lane].is_finite())
            .map(|lane| rows.independent(lane))
            .sum::<usize>();
        for row in rows.state..rows.rows {
            let columns = rows.row_from(row, rows.state).chunks_exact(lanes);
            for (k, from) in columns.enumerate() {
                self.stacked.column_mut(k)[self.rows..][..lanes].copy_from_slice(from);
            }
            self.rows += lanes;
            if self.rows >= enough {
                self.flush(factor);
            }
        }
    }

    /// Brings all rows into the factor and gives their memory back.
    pub(super) fn release(&mut self, factor: &mut Factor) {
        self.flush(factor);
        self.stacked = Rectangle::zeros(0, self.stacked.columns());
    }

    fn flush(&mut self, factor: &mut Factor) {
        if self.rows == 0 {
            return;
        }
        factor.take(&mut self.stacked, self.rows, self.count);
        self.rows = 0;
        self.count = 0;
    }
}

/// Rows that are worth a product, and few enough for the nearest cache where columns are few.
fn enough(width: usize) -> usize {
    (4 * width).max(128)
}
