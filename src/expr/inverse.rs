//! Quadratic forms of the inverse of a symmetric matrix of expressions.

use nalgebra::DMatrix;

use super::graph::{Expr, Graph};

impl Graph {
    /// x^T A^-1 x for a symmetric matrix A and a vector x of expressions; `None` where A is
    /// singular whatever its symbols are.
    ///
    /// Coordinates that no entry couples make blocks of their own. One and two are solved by
    /// Cramer's rule, as books print them; more by symmetric elimination (LDL^T), which needs no
    /// back substitution: the form is the sum of the squares of what is eliminated over the
    /// pivots. What pivots share is stored once.
    pub(super) fn inverse_form(&mut self, matrix: &[Vec<Expr>], vector: &[Expr]) -> Option<Expr> {
        let mut parts = Vec::new();
        for block in self.blocks(matrix) {
            if let Some(known) = self.known_inverse(matrix, &block) {
                for (k, row) in block.iter().enumerate() {
                    for (l, column) in block.iter().enumerate().skip(k) {
                        let times = if k == l { 1.0 } else { 2.0 };
                        let product = self.multiply(vector[*row], vector[*column]);
                        parts.push((times * known[(k, l)], product));
                    }
                }
                continue;
            }
            let mut rest = Rest { matrix: matrix.to_vec(), vector: vector.to_vec(), open: block };
            while !rest.open.is_empty() {
                parts.push((1.0, rest.eliminate(self)?));
            }
        }
        Some(self.linear(0.0, &parts))
    }

    /// The inverse of a block of numbers.
    fn known_inverse(&self, matrix: &[Vec<Expr>], block: &[usize]) -> Option<DMatrix<f64>> {
        let numbers: Option<Vec<f64>> = block
            .iter()
            .flat_map(|&i| block.iter().map(move |&j| self.as_number(matrix[i][j])))
            .collect();
        let inverse = DMatrix::from_vec(block.len(), block.len(), numbers?).try_inverse()?;
        inverse.iter().all(|x| x.is_finite()).then_some(inverse)
    }

    /// The rows of a symmetric matrix in groups that no entry couples.
    fn blocks(&self, matrix: &[Vec<Expr>]) -> Vec<Vec<usize>> {
        let mut blocks: Vec<Vec<usize>> = Vec::new();
        let mut seen = vec![false; matrix.len()];
        for first in 0..matrix.len() {
            let mut block = Vec::new();
            let mut stack = vec![first];
            while let Some(row) = stack.pop() {
                if !std::mem::replace(&mut seen[row], true) {
                    block.push(row);
                    let coupled = (0..matrix.len()).filter(|&j| !self.is_zero(matrix[row][j]));
                    stack.extend(coupled);
                }
            }
            block.sort_unstable();
            if !block.is_empty() {
                blocks.push(block);
            }
        }
        blocks
    }
}

/// What is left of a matrix and a vector once some rows are eliminated.
struct Rest {
    matrix: Vec<Vec<Expr>>,
    vector: Vec<Expr>,
    /// Rows that are left.
    open: Vec<usize>,
}

impl Rest {
    /// Eliminates one row or two, and gives their part of the form.
    fn eliminate(&mut self, graph: &mut Graph) -> Option<Expr> {
        if let &[i, j] = self.open.as_slice() {
            self.open.clear();
            return self.of_two(graph, i, j);
        }
        match self.pivot(graph) {
            Some(k) => {
                let square =
                    graph.product(1.0, &[(self.vector[k], 2.0), (self.matrix[k][k], -1.0)]);
                self.open.retain(|&row| row != k);
                self.subtract(graph, |rest, graph, row| {
                    vec![(rest.vector[k], graph.divide(rest.matrix[row][k], rest.matrix[k][k]), k)]
                });
                Some(square)
            }
            // Every diagonal entry is zero: two rows that are coupled go together.
            None => {
                let open = self.open.clone();
                let pairs = open.iter().flat_map(|&i| open.iter().map(move |&j| (i, j)));
                let (i, j) = pairs.into_iter().find(|&(i, j)| !graph.is_zero(self.matrix[i][j]))?;
                let coupling = self.matrix[i][j];
                let form = self.of_two(graph, i, j)?;
                self.open.retain(|&row| row != i && row != j);
                self.subtract(graph, |rest, graph, row| {
                    let by_i = graph.divide(rest.matrix[row][j], coupling);
                    let by_j = graph.divide(rest.matrix[row][i], coupling);
                    vec![(rest.vector[i], by_i, i), (rest.vector[j], by_j, j)]
                });
                Some(form)
            }
        }
    }

    /// The part of two rows that nothing else is coupled to, or whose couplings go next.
    fn of_two(&self, graph: &mut Graph, i: usize, j: usize) -> Option<Expr> {
        let (a, b, c) = (self.matrix[i][i], self.matrix[i][j], self.matrix[j][j]);
        let (x, y) = (self.vector[i], self.vector[j]);
        let first = graph.product(1.0, &[(a, 1.0), (c, 1.0)]);
        let second = graph.power(b, 2.0);
        let determinant = graph.subtract(first, second);
        let determinant = graph.with_merged_angles(determinant);
        if graph.is_zero(determinant) {
            return None;
        }
        let parts = [
            (1.0, graph.product(1.0, &[(c, 1.0), (x, 2.0)])),
            (-2.0, graph.product(1.0, &[(b, 1.0), (x, 1.0), (y, 1.0)])),
            (1.0, graph.product(1.0, &[(a, 1.0), (y, 2.0)])),
        ];
        let over = graph.linear(0.0, &parts);
        Some(graph.divide(over, determinant))
    }

    /// The row to eliminate next: a number on the diagonal before an expression, then the one
    /// that is coupled to the fewest others.
    fn pivot(&self, graph: &Graph) -> Option<usize> {
        let free = self.open.iter().copied().filter(|&k| !graph.is_zero(self.matrix[k][k]));
        free.min_by_key(|&k| {
            let coupled = self.open.iter().filter(|&&j| !graph.is_zero(self.matrix[k][j])).count();
            (graph.as_number(self.matrix[k][k]).is_none(), coupled, k)
        })
    }

    /// Takes from every row that is left what the eliminated ones say of it: for each of those its
    /// vector entry, the multiple of its row, and its place.
    fn subtract(
        &mut self,
        graph: &mut Graph,
        by: impl Fn(&Rest, &mut Graph, usize) -> Vec<(Expr, Expr, usize)>,
    ) {
        let open = self.open.clone();
        let multiples: Vec<_> = open.iter().map(|&row| by(self, graph, row)).collect();
        for (&row, multiples) in open.iter().zip(multiples) {
            for (entry, multiple, eliminated) in multiples {
                if graph.is_zero(multiple) {
                    continue;
                }
                let part = graph.multiply(multiple, entry);
                self.vector[row] = graph.subtract(self.vector[row], part);
                for &column in &open {
                    let part = graph.multiply(multiple, self.matrix[eliminated][column]);
                    let less = graph.subtract(self.matrix[row][column], part);
                    self.matrix[row][column] = graph.with_merged_angles(less);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::graph::Symbol;
    use super::*;
    use nalgebra::DVector;

    /// Compares with a dense solution at a point, some entries on and above the diagonal zero.
    fn agrees(size: usize, zero: impl Fn(usize, usize) -> bool) {
        let mut graph = Graph::new();
        let value = |symbol: Symbol| match symbol {
            Symbol::Coordinate(i) => 1.0 + (3.1 * i as f64).sin(),
            Symbol::Momentum(i) => (1.7 + i as f64).cos(),
            _ => 0.0,
        };
        let mut entry = |i: usize, j: usize| {
            let (i, j) = (i.min(j), i.max(j));
            match zero(i, j) {
                true => graph.number(0.0),
                false => graph.symbol(Symbol::Coordinate(size * i + j)),
            }
        };
        let matrix: Vec<Vec<Expr>> =
            (0..size).map(|i| (0..size).map(|j| entry(i, j)).collect()).collect();
        let vector: Vec<Expr> = (0..size).map(|i| graph.symbol(Symbol::Momentum(i))).collect();
        let form = graph.inverse_form(&matrix, &vector).unwrap_or_else(|| panic!("singular"));
        let dense = DMatrix::from_fn(size, size, |i, j| graph.value(matrix[i][j], &value));
        let right = DVector::from_fn(size, |i, _| graph.value(vector[i], &value));
        let solved = dense.lu().solve(&right).unwrap_or_else(|| panic!("singular"));
        let expected = right.dot(&solved);
        let found = graph.value(form, &value);
        assert!((found - expected).abs() < 1e-10 * expected.abs().max(1.0), "{found} {expected}");
    }

    #[test]
    fn every_pattern_agrees_with_a_dense_solution() {
        for size in 1..6 {
            agrees(size, |_, _| false);
            agrees(size, |i, j| i != j);
            agrees(size, |i, j| j > i + 1);
            agrees(size, |i, j| i != 0 && i != j);
        }
        for size in [2, 3, 4, 5] {
            // Nothing on the diagonal, but for the last row of odd ones.
            agrees(size, |i, j| i == j && !(size % 2 == 1 && i + 1 == size));
        }
        agrees(4, |i, j| !(i / 2 == j / 2 && i != j));
    }

    #[test]
    fn what_is_singular_for_all_values_is_refused() {
        let mut graph = Graph::new();
        let one = graph.number(1.0);
        let zero = graph.number(0.0);
        let p = graph.symbol(Symbol::Momentum(0));
        assert!(graph.inverse_form(&[vec![one, one], vec![one, one]], &[p, p]).is_none());
        assert!(graph.inverse_form(&[vec![zero]], &[p]).is_none());
    }
}
