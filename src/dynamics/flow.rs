//! A part of the equations of motion as a compiled function, with its sparse Jacobian.

use std::ops::Range;
use std::sync::OnceLock;

use super::batch::Scratch;
use crate::eval::{
    Backend, Evaluator, Inputs, InstructionSet, add, add_weighted, add_weighted_pair, compile,
    set_weighted,
};
use crate::expr::{Expr, Graph, Symbol};

/// Functions of some rows of the state, time and theta, with their derivatives.
pub(super) struct Flow {
    /// Compiled when it is first asked for: a function space moves by its derivatives alone.
    value: OnceLock<Box<dyn Evaluator>>,
    source: (Graph, Inputs, Vec<Expr>, Backend),
    /// Values, then Jacobian entries, then mixed entries.
    tangent: Box<dyn Evaluator>,
    /// Rows of the state that the functions may depend on.
    pub inputs: Range<usize>,
    /// Number of functions.
    pub rows: usize,
    /// (function, row of the state) of each derivative that is not zero, sorted.
    pub jacobian: Vec<(usize, usize)>,
    /// (function, unknown) of each derivative that is not zero, sorted.
    pub mixed: Vec<(usize, usize)>,
    /// The time and the inputs that the functions or their derivatives name.
    driven: Vec<Symbol>,
}

/// Products that are added at once.
const PRODUCTS: usize = 2;
/// Columns of a tangent that stay in the nearest cache from row to row.
const TILE: usize = 12;

/// What a flow is compiled from.
pub(super) struct FlowSource<'a> {
    pub functions: &'a [Expr],
    /// `linear[row]`: derivatives by coefficients, as (unknown, expression).
    pub linear: &'a [Vec<(usize, Expr)>],
    pub state: &'a [Symbol],
    pub inputs: Range<usize>,
    pub unknowns: &'a [Symbol],
}

impl Flow {
    pub(super) fn new(mut graph: Graph, source: &FlowSource, backend: Backend) -> Flow {
        let rows = source.functions.len();
        let mut jacobian = Vec::new();
        for column in source.inputs.clone() {
            let derivatives = graph.derivatives(source.functions, source.state[column]);
            for (row, derivative) in derivatives.into_iter().enumerate() {
                if !graph.is_zero(derivative) {
                    jacobian.push((row, column, derivative));
                }
            }
        }
        jacobian.sort_unstable();
        let mut mixed = Vec::new();
        for (row, list) in source.linear.iter().enumerate() {
            mixed.extend(list.iter().map(|&(unknown, expr)| (row, unknown, expr)));
        }
        for (unknown, &symbol) in source.unknowns.iter().enumerate() {
            if let Symbol::Parameter(_) = symbol {
                let derivatives = graph.derivatives(source.functions, symbol);
                mixed.extend(derivatives.into_iter().enumerate().map(|(row, d)| (row, unknown, d)));
            }
        }
        mixed.retain(|&(_, _, expr)| !graph.is_zero(expr));
        mixed.sort_unstable();

        let mut outputs = source.functions.to_vec();
        outputs.extend(jacobian.iter().chain(&mixed).map(|&(_, _, expr)| expr));
        let mut driven = graph.symbols(&outputs);
        driven.retain(|symbol| symbol.is_of_time());
        let inputs = sources(source.state, source.inputs.clone(), &driven, source.unknowns);
        Flow {
            value: OnceLock::new(),
            tangent: compile(&graph, &inputs, &outputs, backend),
            source: (graph, inputs, source.functions.to_vec(), backend),
            inputs: source.inputs.clone(),
            rows,
            jacobian: jacobian.into_iter().map(|(row, column, _)| (row, column)).collect(),
            mixed: mixed.into_iter().map(|(row, unknown, _)| (row, unknown)).collect(),
            driven,
        }
    }

    /// Where the compiled functions take the symbols' values from.
    pub(super) fn sources(&self, state: &[Symbol], unknowns: &[Symbol]) -> Inputs {
        sources(state, self.inputs.clone(), &self.driven, unknowns)
    }

    fn value(&self) -> &dyn Evaluator {
        let (graph, inputs, functions, backend) = &self.source;
        &**self.value.get_or_init(|| compile(graph, inputs, functions, *backend))
    }

    /// Whether the functions or their derivatives name the time or an input.
    pub(super) fn timed(&self) -> bool {
        !self.driven.is_empty()
    }

    /// Number of values and derivatives together.
    pub(super) fn outputs(&self) -> usize {
        self.rows + self.jacobian.len() + self.mixed.len()
    }

    /// Evaluates into `scratch.out`: `[rows][lanes]`, and with `derivatives` the Jacobian and
    /// the mixed entries after it. `state` is `[2n][lanes]`, `scratch.time` the times,
    /// `scratch.since` those since the beginning of what `scratch.drive` says.
    pub(super) fn evaluate(
        &self,
        state: &[f64],
        lanes: usize,
        theta: &[f64],
        derivatives: bool,
        scratch: &mut Scratch,
    ) {
        scratch.workspace.clear();
        self.evaluate_again(state, lanes, theta, derivatives, scratch);
    }

    /// The same after an evaluation by this flow with the same theta, lanes and `derivatives`,
    /// if `scratch.workspace` is not empty.
    pub(super) fn evaluate_again(
        &self,
        state: &[f64],
        lanes: usize,
        theta: &[f64],
        derivatives: bool,
        scratch: &mut Scratch,
    ) {
        let (_, inputs, ..) = &self.source;
        let Scratch { out, points, time, since, drive, workspace, .. } = scratch;
        let rows = &state[self.inputs.start * lanes..self.inputs.end * lanes];
        let points = if self.timed() {
            points.clear();
            points.extend_from_slice(rows);
            for symbol in &self.driven {
                match *symbol {
                    Symbol::Input(input, order) => drive.append(input, order, since, points),
                    Symbol::Delayed(input, order, by) => {
                        let by = by.among(&inputs.uniform, theta);
                        drive.append_delayed((input, order, by), since, points);
                    }
                    _ => points.extend_from_slice(time),
                }
            }
            &points[..]
        } else {
            rows
        };
        let evaluator = if derivatives { &*self.tangent } else { self.value() };
        let size = evaluator.outputs() * lanes;
        if out.len() < size {
            out.reshape(size);
        }
        evaluator.evaluate_again(points, theta, lanes, &mut out[..size], workspace);
    }

    /// target += entries * source, and the mixed entries into their own columns.
    ///
    /// `target` holds `[rows][columns][lanes]`, `source` the rows `inputs` of a tangent in the
    /// same layout; `entries` is the Jacobian, then the mixed entries, `[entry][lanes]`, scaled
    /// as wanted. Unknown k has column `first + k`; without such columns there are only the
    /// derivatives by the initial state.
    pub(super) fn push(
        &self,
        target: &mut [f64],
        source: &[f64],
        entries: &[f64],
        first: usize,
        columns: usize,
        lanes: usize,
    ) {
        self.move_tangents(target, source, entries, (first, columns), lanes, true);
    }

    /// The same with nothing in `target` before: target = entries * source, and the mixed entries.
    pub(super) fn map(
        &self,
        target: &mut [f64],
        source: &[f64],
        entries: &[f64],
        first: usize,
        columns: usize,
        lanes: usize,
    ) {
        let width = columns * lanes;
        let mut rows = target.chunks_exact_mut(width.max(1)).enumerate().take(self.rows);
        for of_row in self.jacobian.chunk_by(|a, b| a.0 == b.0) {
            // Rows between those that depend on the state do not.
            let constant = rows.by_ref().take_while(|(row, _)| *row != of_row[0].0);
            constant.for_each(|(_, values)| values.fill(0.0));
        }
        rows.for_each(|(_, values)| values.fill(0.0));
        self.move_tangents(target, source, entries, (first, columns), lanes, false);
    }

    fn move_tangents(
        &self,
        target: &mut [f64],
        source: &[f64],
        entries: &[f64],
        (first, columns): (usize, usize),
        lanes: usize,
        add_to: bool,
    ) {
        if lanes == 0 {
            return;
        }
        let start = self.inputs.start;
        let set = InstructionSet::widest();
        let width = columns * lanes;
        // A few columns at a time: every row needs the same ones of the source.
        for tile in (0..width).step_by(TILE * lanes) {
            let size = (TILE * lanes).min(width - tile);
            let part =
                |&(_, from): &(usize, usize)| &source[(from - start) * width + tile..][..size];
            let mut entry = 0;
            for of_row in self.jacobian.chunk_by(|a, b| a.0 == b.0) {
                let into = &mut target[of_row[0].0 * width + tile..][..size];
                let mut products = of_row;
                if let (false, [alone, rest @ ..]) = (add_to, products) {
                    set_weighted(set, into, part(alone), &entries[entry * lanes..][..lanes]);
                    (products, entry) = (rest, entry + 1);
                }
                for some in products.chunks(PRODUCTS) {
                    let weights = &entries[entry * lanes..][..some.len() * lanes];
                    match some {
                        [a, b] => add_weighted_pair(set, into, part(a), part(b), weights),
                        _ => some.iter().for_each(|a| add_weighted(set, into, part(a), weights)),
                    }
                    entry += some.len();
                }
            }
        }
        if columns == first {
            return;
        }
        let weights = entries.chunks_exact(lanes).skip(self.jacobian.len());
        for (&(row, unknown), weight) in self.mixed.iter().zip(weights) {
            let into = (row * columns + first + unknown) * lanes;
            add(set, &mut target[into..into + lanes], weight);
        }
    }

    /// The transpose of [`Flow::push`]: source += entries^T * target for the rows `inputs`, and
    /// the mixed entries, summed over the lanes in order, into `gradient`, `[P]`.
    ///
    /// `target` is `[rows][lanes]`, `source` is `[inputs][lanes]`. Products that are not finite
    /// are left out of the gradient: they belong to lanes that are lost.
    pub(super) fn pull(
        &self,
        target: &[f64],
        source: &mut [f64],
        entries: &[f64],
        gradient: &mut [f64],
        lanes: usize,
    ) {
        if lanes == 0 {
            return;
        }
        let mut weights = entries.chunks_exact(lanes);
        for (&(row, from), weight) in self.jacobian.iter().zip(&mut weights) {
            let from = (from - self.inputs.start) * lanes;
            let target = &target[row * lanes..(row + 1) * lanes];
            for ((s, t), w) in source[from..from + lanes].iter_mut().zip(target).zip(weight) {
                *s += w * t;
            }
        }
        let weights = entries.chunks_exact(lanes).skip(self.jacobian.len());
        for (&(row, unknown), weight) in self.mixed.iter().zip(weights) {
            let target = &target[row * lanes..(row + 1) * lanes];
            let products = target.iter().zip(weight).map(|(t, w)| t * w);
            gradient[unknown] += products.filter(|product| product.is_finite()).sum::<f64>();
        }
    }
}

fn sources(state: &[Symbol], rows: Range<usize>, driven: &[Symbol], unknowns: &[Symbol]) -> Inputs {
    let mut varying = state[rows].to_vec();
    varying.extend_from_slice(driven);
    Inputs { varying, uniform: unknowns.to_vec() }
}
