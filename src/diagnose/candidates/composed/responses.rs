//! What any force would do to all predictions, to first order, prepared once.
//!
//! A term with coefficient c changes the rate of the state by c u(z). To first order predictions
//! at time t change by c times the integral of Phi(t, s) u(z(s)) ds along the model's own
//! trajectory, Phi being the derivative of the state at t by that at s: linear in the values of u.
//! So each segment has a matrix that takes the values of u at a few *nodes* of the trajectory to
//! changes of its residuals; the initial state and the model's unknowns are eliminated from it.
//! The score of a term is then a quotient of two forms in these values, and costs no pass over the
//! data. Between nodes u is interpolated by cubics; products with Phi are integrated by Simpson's
//! rule over finer points.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::actions::{Action, Channels};
use super::course::{Course, courses, frequency, interpolation, trust};
use super::fine::{self, Fine};
use super::named::of_unknowns;
use super::states::{Along, PhasePoints, Points};
use crate::diagnose::settling::Settled;
use crate::eval::{InstructionSet, add_weighted_rows};
use crate::expr::Observed;
use crate::fit::column::Column;

/// Terms that are scored side by side; it changes cost alone.
pub(super) const TOGETHER: usize = 32;

/// One segment.
struct Segment {
    /// Its first node among all.
    first: usize,
    nodes: usize,
    /// Residuals by values at nodes, `[row][channel, node]`, initial state eliminated.
    design: DMatrix<f64>,
    /// Residuals, initial state eliminated.
    target: DVector<f64>,
    /// Residuals by the model's unknowns: first as they are, then an orthonormal basis.
    base: DMatrix<f64>,
    /// Residuals by what no interpolation follows.
    fine: Fine,
    /// design' target, the unknowns eliminated from the latter.
    gain: DVector<f64>,
    /// design' base.
    shadow: DMatrix<f64>,
    /// design' design for kicks and drifts.
    information: DMatrix<f64>,
    /// The same for each sensor by itself.
    of_sensors: Vec<DMatrix<f64>>,
}

/// What any force would do to all predictions.
pub(super) struct Responses {
    /// Nodes of all segments, and finer points.
    pub(super) points: Points,
    /// Channels of the system.
    pub(super) channels: Channels,
    /// Squares of the residuals with the model's unknowns free.
    pub(super) squares: f64,
    /// Independent residuals beside the model's unknowns.
    pub(super) rows: usize,
    segments: Vec<Segment>,
    /// Columns of the model's unknowns that are eliminated and not spanned by others, by their
    /// places, and these columns by an orthonormal basis of theirs.
    free: Vec<usize>,
    by_basis: DMatrix<f64>,
    /// What is to be explained by this basis.
    heights: DVector<f64>,
    /// An action that keeps less than this part of its squares beside the model is spanned by it.
    spanned: f64,
}

/// What an action does to all residuals.
pub(super) struct Response {
    /// What it does with the model's unknowns free, in the order of [`Responses::target`].
    pub(super) column: DVector<f64>,
    /// What these would have to take over, by an orthonormal basis of what they do.
    pub(super) heights: DVector<f64>,
}

/// Points from sample to sample, at least: Simpson's rule takes them in twos.
const PANEL: usize = 2;

impl Responses {
    /// From the model on some segments, nodes `spacing` radians of the fastest motion apart.
    ///
    /// `kept` are the columns of the model's unknowns that are eliminated. Forces act along the
    /// motion that is said.
    pub(super) fn of(settled: &Settled, kept: &[Column], spacing: f64, along: Along) -> Responses {
        let model = &settled.model;
        let mut found = courses(settled, PANEL);
        let turning = frequency(&found);
        let span = model.data.packed.typical_step();
        let tuning = &model.tuning().composed;
        let panels = (turning * span / tuning.panel_angle).ceil() as usize;
        let panels = panels.clamp(1, tuning.panels.max(1));
        if panels > 1 {
            found = courses(settled, PANEL * panels);
        }
        let between = PANEL * panels;
        let channels = Channels { degrees: model.system().degrees(), along };
        let velocities = model.system().observed == Observed::Velocities;
        let apart = spacing / turning.max(f64::MIN_POSITIVE);
        let trust = match along {
            Along::Model => None,
            Along::Measured => Some(trust(&found)),
        };
        let of = |course: &Course| {
            let off = trust.as_ref().map(|trust| Off::of(course, between, trust));
            let (segment, places, fine) =
                segment(course, channels, between, apart, kept, velocities, off.as_ref());
            (segment, Nodes::of(course, &places, off.as_ref()), fine)
        };
        let built: Vec<(Segment, Nodes, fine::Points)> = found.par_iter().map(of).collect();
        let (mut nodes, mut forced, mut times) = (Vec::new(), Vec::new(), Vec::new());
        let (mut fine_states, mut fine_times) = (Vec::new(), Vec::new());
        let mut list = Vec::with_capacity(built.len());
        for (mut segment, own, fine) in built {
            segment.first = nodes.len();
            segment.fine.first = fine_states.len();
            fine_states.extend(fine.0);
            fine_times.extend(fine.1);
            nodes.extend(own.states);
            forced.extend(own.forced);
            times.extend(own.times);
            list.push(segment);
        }
        let size = channels.moving();
        let known = |course: &Course| course.weights.iter().flatten().filter(|w| **w > 0.0).count();
        let rows: usize = found.iter().map(|c| known(c).saturating_sub(size)).sum();
        let mut responses = Responses {
            points: Points {
                nodes: PhasePoints::of(&nodes, &forced, times),
                fine: PhasePoints::of(&fine_states, &[], fine_times),
            },
            channels,
            squares: 0.0,
            rows,
            segments: list,
            free: Vec::new(),
            by_basis: DMatrix::zeros(0, 0),
            heights: DVector::zeros(0),
            spanned: tuning.spanned,
        };
        // What candidates do is known at the nodes, and so is what the unknowns do: one that does
        // the same as some of them is spanned by them to the last digit.
        let own = of_unknowns(&model.law, kept, &responses.points, channels);
        for segment in &mut responses.segments {
            for (place, action) in own.iter().enumerate() {
                if let Some(action) = action {
                    let column = segment.column(action);
                    segment.base.set_column(place, &column);
                }
            }
        }
        responses.orthonormalise(kept.len(), tuning.spanned_unknowns);
        responses.rows = responses.rows.saturating_sub(kept.len());
        responses.finish();
        responses
    }

    /// Adds what some actions do to the residuals: what the model explains by them is asked for
    /// anew.
    pub(super) fn restore(&mut self, actions: &[(f64, Action)]) {
        for (coefficient, action) in actions {
            for segment in &mut self.segments {
                let column = segment.column(action);
                segment.target.axpy(*coefficient, &column, 1.0);
            }
        }
        self.finish();
    }

    /// An orthonormal basis of the unknowns' columns over all segments (modified Gram-Schmidt,
    /// each column twice); columns that others span but for the part `spanned` are left out.
    fn orthonormalise(&mut self, unknowns: usize, spanned: f64) {
        let dot = |segments: &[Segment], a: usize, b: usize| -> f64 {
            segments.iter().map(|s| s.base.column(a).dot(&s.base.column(b))).sum()
        };
        let mut free = Vec::new();
        let mut by_basis = DMatrix::zeros(unknowns, unknowns);
        for column in 0..unknowns {
            let count = free.len();
            let whole = dot(&self.segments, column, column);
            by_basis.column_mut(count).fill(0.0);
            for _ in 0..2 {
                for earlier in 0..count {
                    let shadow = dot(&self.segments, earlier, column);
                    by_basis[(earlier, count)] += shadow;
                    for segment in &mut self.segments {
                        let basis = segment.base.column(earlier).clone_owned();
                        segment.base.column_mut(column).axpy(-shadow, &basis, 1.0);
                    }
                }
            }
            let left = dot(&self.segments, column, column);
            if left > spanned * whole && left > 0.0 {
                let scale = left.sqrt().recip();
                by_basis[(count, count)] = left.sqrt();
                for segment in &mut self.segments {
                    let basis = segment.base.column(column) * scale;
                    segment.base.set_column(count, &basis);
                }
                free.push(column);
            }
        }
        let count = free.len();
        for segment in &mut self.segments {
            segment.base = segment.base.columns(0, count).clone_owned();
        }
        self.by_basis = by_basis.view((0, 0), (count, count)).clone_owned();
        self.heights = DVector::zeros(count);
        self.free = free;
    }

    /// The forms that scores are quotients of.
    fn finish(&mut self) {
        let mut heights = DVector::zeros(self.free.len());
        for segment in &self.segments {
            heights += segment.base.tr_mul(&segment.target);
        }
        self.heights += &heights;
        let channels = self.channels;
        self.segments.par_iter_mut().for_each(|segment| {
            let nodes = segment.nodes;
            segment.target -= &segment.base * &heights;
            segment.gain = segment.design.tr_mul(&segment.target);
            segment.shadow = segment.design.transpose() * &segment.base;
            let moving = segment.design.columns(0, channels.moving() * nodes);
            segment.information = moving.transpose() * moving;
            let of = |observable: usize| {
                let first = channels.sensor(observable) * nodes;
                let columns = segment.design.columns(first, nodes);
                columns.transpose() * columns
            };
            segment.of_sensors = (0..2 * channels.degrees).map(of).collect();
        });
        self.squares = self.segments.iter().map(|segment| segment.target.norm_squared()).sum();
    }

    /// By how much the squares fall with each of up to so many actions on the same channels; zero
    /// for those that the model spans.
    pub(super) fn falls<const LANES: usize>(&self, actions: &[Action]) -> [f64; LANES] {
        let Some(first) = actions.first() else { return [0.0; LANES] };
        let (channels, count) = (&first.channels, self.points.nodes.count);
        let set = InstructionSet::widest();
        let mut gain = [0.0; LANES];
        let mut whole = [0.0; LANES];
        let mut shadows = vec![[0.0; LANES]; self.free.len()];
        let mut values: Vec<[f64; LANES]> = Vec::new();
        for segment in &self.segments {
            let nodes = segment.nodes;
            values.clear();
            for at in 0..channels.len() {
                for place in at * count + segment.first..at * count + segment.first + nodes {
                    let mut row = [0.0; LANES];
                    for (x, action) in row.iter_mut().zip(actions) {
                        *x = action.values[place];
                    }
                    values.push(row);
                }
            }
            for (&channel, rows) in channels.iter().zip(values.chunks_exact(nodes)) {
                let (places, rows) = (channel * nodes..(channel + 1) * nodes, rows.as_flattened());
                let gains = &segment.gain.as_slice()[places.clone()];
                add_weighted_rows(set, &mut gain, gains, rows);
                for (column, shadow) in segment.shadow.column_iter().zip(&mut shadows) {
                    let column = column.as_slice();
                    add_weighted_rows(set, shadow, &column[places.clone()], rows);
                }
            }
            segment.add_information(self.channels, channels, &values, &mut whole);
        }
        let mut falls = [0.0; LANES];
        for lane in 0..LANES {
            let spanned: f64 = shadows.iter().map(|shadow| shadow[lane].powi(2)).sum();
            let own = whole[lane] - spanned;
            let seen = own > self.spanned * whole[lane] && own.is_finite();
            // Squares of large numbers are none.
            falls[lane] = if seen { (gain[lane] / own.sqrt()).powi(2) } else { 0.0 };
        }
        falls
    }

    /// The fall of the squares with one action.
    pub(super) fn fall(&self, action: &Action) -> f64 {
        let [fall] = self.falls(std::slice::from_ref(action));
        fall
    }

    /// What an action does to all residuals with the model's unknowns free; zeros where the model
    /// spans it.
    pub(super) fn column(&self, action: &Action) -> DVector<f64> {
        self.response(action).column
    }

    /// What an action does to all residuals; nothing where the model spans it.
    pub(super) fn response(&self, action: &Action) -> Response {
        let parts: Vec<DVector<f64>> =
            self.segments.iter().map(|segment| segment.column(action)).collect();
        let mut heights = DVector::zeros(self.free.len());
        for (segment, part) in self.segments.iter().zip(&parts) {
            heights += segment.base.tr_mul(part);
        }
        let size = parts.iter().map(|part| part.len()).sum();
        let whole: f64 = parts.iter().map(|part| part.norm_squared()).sum();
        let mut column = Vec::with_capacity(size);
        for (segment, part) in self.segments.iter().zip(parts) {
            column.extend_from_slice((part - &segment.base * &heights).as_slice());
        }
        let column = DVector::from_vec(column);
        let seen = column.norm_squared() > self.spanned * whole;
        if seen {
            Response { column, heights }
        } else {
            Response { column: DVector::zeros(size), heights: self.no_heights() }
        }
    }

    /// The heights of what does nothing.
    pub(super) fn no_heights(&self) -> DVector<f64> {
        DVector::zeros(self.free.len())
    }

    /// The columns of the model's unknowns, those of [`Responses::unknowns_beside`], by an
    /// orthonormal basis: an upper triangle.
    pub(super) fn by_basis(&self) -> &DMatrix<f64> {
        &self.by_basis
    }

    /// Changes of the model's unknowns, with their places among those that are eliminated, by which
    /// it takes over what `added` leaves to it of what is to be explained.
    pub(super) fn unknowns_beside(&self, added: &DVector<f64>) -> Vec<(usize, f64)> {
        let Some(changes) = self.by_basis.solve_upper_triangular(&(&self.heights - added)) else {
            return Vec::new();
        };
        self.free.iter().copied().zip(changes.iter().copied()).collect()
    }

    /// Rows of each segment among those of all.
    pub(super) fn lengths(&self) -> Vec<usize> {
        self.segments.iter().map(|segment| segment.target.len()).collect()
    }

    /// Residuals with the model's unknowns free, in the order of [`Responses::column`].
    pub(super) fn target(&self) -> DVector<f64> {
        let all = self.segments.iter().flat_map(|segment| segment.target.iter().copied());
        DVector::from_vec(all.collect())
    }
}

impl Segment {
    fn column(&self, action: &Action) -> DVector<f64> {
        if action.fine {
            return self.fine.column(action);
        }
        let count = action.values.len() / action.channels.len().max(1);
        let mut column = DVector::zeros(self.target.len());
        for (at, channel) in action.channels.iter().enumerate() {
            for node in 0..self.nodes {
                let value = action.values[at * count + self.first + node];
                column.axpy(value, &self.design.column(channel * self.nodes + node), 1.0);
            }
        }
        column
    }

    /// Adds u' M u of each lane, u being the values on some channels, `[channel, node]`.
    fn add_information<const LANES: usize>(
        &self,
        all: Channels,
        channels: &[usize],
        values: &[[f64; LANES]],
        whole: &mut [f64; LANES],
    ) {
        let (set, nodes) = (InstructionSet::widest(), self.nodes);
        let sensed = channels.first().and_then(|&channel| all.sensed(channel));
        let (matrix, shift) = match sensed {
            Some(observable) => (&self.of_sensors[observable], all.sensor(observable)),
            None => (&self.information, 0),
        };
        for (at, &channel) in channels.iter().enumerate() {
            for node in 0..nodes {
                // The matrix is symmetric: half of its diagonal, and what stands after it.
                let column = matrix.column((channel - shift) * nodes + node);
                let own = &values[at * nodes + node];
                let mut row = own.map(|u| 0.5 * column[(channel - shift) * nodes + node] * u);
                for (later, &other) in channels.iter().enumerate().skip(at) {
                    let from = if later == at { node + 1 } else { 0 };
                    let places = (other - shift) * nodes + from..(other - shift + 1) * nodes;
                    let rows = values[later * nodes + from..(later + 1) * nodes].as_flattened();
                    add_weighted_rows(set, &mut row, &column.as_slice()[places], rows);
                }
                for ((sum, x), y) in whole.iter_mut().zip(own).zip(&row) {
                    *sum += 2.0 * x * y;
                }
            }
        }
    }
}

/// By how much the motion was measured to be off the model's in one segment.
struct Off {
    samples: Vec<f64>,
    by: Vec<DVector<f64>>,
}

impl Off {
    fn of(course: &Course, between: usize, trust: &[f64]) -> Off {
        let samples = course.times.iter().copied().step_by(between).collect();
        Off { samples, by: course.off(between, trust) }
    }

    /// At a time from the first point on.
    fn at(&self, time: f64) -> DVector<f64> {
        let size = self.by.first().map_or(0, |by| by.len());
        let weights = interpolation(&self.samples, time).into_iter();
        weights.fold(DVector::zeros(size), |sum, (sample, weight)| sum + &self.by[sample] * weight)
    }
}

/// Nodes of a segment.
struct Nodes {
    states: Vec<Vec<f64>>,
    /// Where forces act; none where that is along the model's motion.
    forced: Vec<Vec<f64>>,
    times: Vec<f64>,
}

impl Nodes {
    fn of(course: &Course, places: &[usize], off: Option<&Off>) -> Nodes {
        let state = |&place: &usize| course.states[place].clone();
        let measured = |off: &Off| -> Vec<Vec<f64>> {
            let moved = |place: &usize| {
                let moved = DVector::from_vec(state(place)) + off.at(course.times[*place]);
                moved.as_slice().to_vec()
            };
            places.iter().map(moved).collect()
        };
        Nodes {
            states: places.iter().map(state).collect(),
            forced: off.map(measured).unwrap_or_default(),
            times: places.iter().map(|&place| course.start + course.times[place]).collect(),
        }
    }
}

/// The matrices of a segment, the places of its nodes among the points of its course, and finer
/// points.
fn segment(
    course: &Course,
    channels: Channels,
    between: usize,
    apart: f64,
    kept: &[Column],
    velocities: bool,
    off: Option<&Off>,
) -> (Segment, Vec<usize>, fine::Points) {
    let (size, n) = (channels.moving(), channels.degrees);
    let last = course.times.len() - 1;
    let duration = course.times[last];
    let wanted = (duration / apart).ceil().max(0.0);
    let intervals =
        if wanted < last as f64 { (wanted as usize).clamp(3.min(last), last) } else { last };
    let places: Vec<usize> = (0..=intervals).map(|k| k * last / intervals.max(1)).collect();
    let times: Vec<f64> = places.iter().map(|&place| course.times[place]).collect();
    let nodes = times.len();
    let observables = course.weights.first().map_or(0, Vec::len);
    let rows = course.residuals.len() * observables;
    let mut design = DMatrix::zeros(rows, channels.count() * nodes);
    // The integral of Phi(s, 0)^-1 u(z(s)) ds so far, by the values of u at the nodes.
    let mut integral = DMatrix::<f64>::zeros(size, size * nodes);
    let weights: Vec<Vec<(usize, f64)>> =
        course.times.iter().map(|&time| interpolation(&times, time)).collect();
    for (sample, tangent) in course.tangents.iter().enumerate() {
        let end = sample * between;
        let start = end.saturating_sub(between);
        for panel in (start..end).step_by(PANEL) {
            let third = (course.times[panel + PANEL] - course.times[panel]) / 6.0;
            for (point, part) in (panel..).zip([1.0, 4.0, 1.0]) {
                let inverse = &course.inverses[point];
                for &(node, weight) in &weights[point] {
                    let factor = third * part * weight;
                    for channel in 0..size {
                        // A kick acts on a momentum, a drift on a coordinate.
                        let acted = if channel < n { n + channel } else { channel - n };
                        let mut column = integral.column_mut(channel * nodes + node);
                        column.axpy(factor, &inverse.column(acted), 1.0);
                    }
                }
            }
        }
        let by_state = tangent.columns(0, size);
        let moved = by_state * &integral;
        design.view_mut((sample * observables, 0), (observables, size * nodes)).copy_from(&moved);
        for observable in 0..observables {
            let row = sample * observables + observable;
            for &(node, weight) in &weights[end] {
                let shown = weight * course.weights[sample][observable];
                design[(row, channels.sensor(observable) * nodes + node)] += shown;
                if velocities && observable >= n {
                    design[(row, channels.drift(observable - n) * nodes + node)] += shown;
                }
            }
        }
    }
    let stack = |columns: &dyn Fn(&DMatrix<f64>, usize, usize) -> f64, count: usize| {
        DMatrix::from_fn(rows, count, |row, column| {
            columns(&course.tangents[row / observables], row % observables, column)
        })
    };
    let states = stack(&|tangent, row, column| tangent[(row, column)], size);
    let mut base =
        stack(&|tangent, row, column| tangent[(row, size + kept[column].position())], kept.len());
    let mut target =
        DVector::from_fn(rows, |row, _| course.residuals[row / observables][row % observables]);
    // A state that the rows do not determine has a direction that is rounding: it is left out.
    let basis = orthonormal(states);
    design -= &basis * basis.tr_mul(&design);
    base -= &basis * basis.tr_mul(&base);
    target -= &basis * basis.tr_mul(&target);
    let nothing = DMatrix::zeros(0, 0);
    let (fine, points) = Fine::of(course, between, basis, |time| off.map(|off| off.at(time)));
    let segment = Segment {
        first: 0,
        nodes,
        design,
        target,
        base,
        fine,
        gain: DVector::zeros(0),
        shadow: nothing.clone(),
        information: nothing,
        of_sensors: Vec::new(),
    };
    (segment, places, points)
}

/// An orthonormal basis of some columns, those left out that others span.
fn orthonormal(mut columns: DMatrix<f64>) -> DMatrix<f64> {
    let mut count = 0;
    for column in 0..columns.ncols() {
        let mut rest = columns.column(column).clone_owned();
        let whole = rest.norm();
        for _ in 0..2 {
            for earlier in 0..count {
                let basis = columns.column(earlier);
                let shadow = basis.dot(&rest);
                rest.axpy(-shadow, &basis, 1.0);
            }
        }
        let left = rest.norm();
        // What is less is rounding: derivatives are known to 1e-15 or so times their growth.
        if left > 1e-9 * whole && left > 0.0 {
            columns.set_column(count, &(rest / left));
            count += 1;
        }
    }
    columns.columns(0, count).clone_owned()
}
