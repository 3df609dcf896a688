//! Rows on their way into a factor.

use nalgebra::DMatrix;

use super::factor::Factor;
use super::rows::Rows;

/// Rows on their way into a factor, gathered until a product of matrices pays.
pub(super) struct Gathered {
    width: usize,
    blocks: Vec<(Vec<f64>, usize)>,
    rows: usize,
    count: usize,
}

impl Gathered {
    pub(super) fn new(width: usize) -> Gathered {
        Gathered { width, blocks: Vec::new(), rows: 0, count: 0 }
    }

    /// Takes the rows below the eliminated states.
    pub(super) fn take(&mut self, rows: &Rows, factor: &mut Factor) {
        let kept = rows.rows.saturating_sub(rows.state);
        if kept == 0 {
            return;
        }
        // Column-major within the block: [column][row][lane].
        let mut block = Vec::with_capacity(kept * rows.lanes * self.width);
        for column in rows.state..rows.columns {
            for row in rows.state..rows.rows {
                let at = (row * rows.columns + column) * rows.lanes;
                block.extend_from_slice(&rows.values[at..at + rows.lanes]);
            }
        }
        self.rows += kept * rows.lanes;
        self.count += (0..rows.lanes)
            .filter(|&lane| rows.losses[lane].is_finite())
            .map(|lane| rows.independent(lane))
            .sum::<usize>();
        self.blocks.push((block, kept * rows.lanes));
        if self.rows >= (4 * self.width).max(512) {
            self.flush(factor);
        }
    }

    pub(super) fn flush(&mut self, factor: &mut Factor) {
        let mut stacked = DMatrix::zeros(self.rows, self.width);
        let mut start = 0;
        for (block, rows) in self.blocks.drain(..) {
            for (column, values) in block.chunks_exact(rows).enumerate() {
                stacked.view_mut((start, column), (rows, 1)).copy_from_slice(values);
            }
            start += rows;
        }
        factor.push(&mut stacked, self.count);
        self.rows = 0;
        self.count = 0;
    }
}
