//! What a small force does to predictions, along the motion of a model whose states are settled.
//!
//! With the transition T_k of the state from one node to the next a force F moves it by d, where
//! d_(k+1) = T_k (d_k + h/2 B F_k) + h/2 B F_(k+1). What the initial states take up of it is no
//! news: it is projected out, as it is of what the model leaves.

use nalgebra::{DMatrix, DVector};

/// A component of the state that was measured at a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Row {
    /// Place of the node in its stretch.
    pub(super) node: usize,
    /// Component of the state: coordinates, then momenta.
    pub(super) component: usize,
    /// What it is multiplied by to be in units of the noise.
    pub(super) weight: f64,
}

/// A segment with a free initial state.
pub(super) struct Stretch {
    /// Place of its first node on the path.
    pub(super) first: usize,
    times: Vec<f64>,
    transitions: Vec<DMatrix<f64>>,
    rows: Vec<Row>,
    /// What its initial state takes up: orthonormal columns.
    basis: DMatrix<f64>,
}

impl Stretch {
    /// Nodes, transitions between them and what was measured there; `None` where the initial state
    /// takes up everything.
    pub(super) fn new(
        first: usize,
        times: Vec<f64>,
        transitions: Vec<DMatrix<f64>>,
        rows: Vec<Row>,
    ) -> Option<Stretch> {
        let size = transitions.first()?.nrows();
        if rows.len() <= size {
            return None;
        }
        let mut from_start = vec![DMatrix::identity(size, size)];
        for (k, transition) in transitions.iter().enumerate() {
            from_start.push(transition * &from_start[k]);
        }
        let mut responses = DMatrix::from_fn(rows.len(), size, |r, c| {
            rows[r].weight * from_start[rows[r].node][(rows[r].component, c)]
        });
        for mut column in responses.column_iter_mut() {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
        }
        let finite = responses.iter().all(|x| x.is_finite());
        finite.then(|| Stretch { first, times, transitions, rows, basis: responses.qr().q() })
    }

    /// Number of nodes.
    pub(super) fn nodes(&self) -> usize {
        self.times.len()
    }

    /// What forces at the nodes, `[node][coordinate]`, do to what was measured, in units of the
    /// noise, beyond what the initial state takes up.
    pub(super) fn response(&self, forces: &[f64]) -> DVector<f64> {
        let n = forces.len() / self.nodes();
        let mut moved = DMatrix::zeros(2 * n, self.nodes());
        let mut state = DVector::zeros(2 * n);
        let mut kicked = state.clone();
        let kick = |state: &mut DVector<f64>, node: usize, half: f64| {
            for (i, force) in forces[node * n..(node + 1) * n].iter().enumerate() {
                state[n + i] += half * force;
            }
        };
        for (k, transition) in self.transitions.iter().enumerate() {
            let half = 0.5 * (self.times[k + 1] - self.times[k]);
            kicked.copy_from(&state);
            kick(&mut kicked, k, half);
            state.gemv(1.0, transition, &kicked, 0.0);
            kick(&mut state, k + 1, half);
            moved.set_column(k + 1, &state);
        }
        let rows = self.rows.iter().map(|row| row.weight * moved[(row.component, row.node)]);
        self.beyond_start(DVector::from_iterator(self.rows.len(), rows))
    }

    /// What the initial state does not take up of a column.
    pub(super) fn beyond_start(&self, mut column: DVector<f64>) -> DVector<f64> {
        let taken = self.basis.tr_mul(&column);
        column.gemv(-1.0, &self.basis, &taken, 1.0);
        column
    }
}
