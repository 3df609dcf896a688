//! How far motions are from switching surfaces, and when they come to them by a cubic.

use super::batch::{Batch, Scratch};
use super::flow::Flow;

/// Bisections for the root of a polynomial.
const BISECTIONS: usize = 24;

/// Margins of a batch, and how fast they change.
pub(super) struct Margins {
    /// `[margin][lane]`.
    pub(super) value: Vec<f64>,
    /// `[margin][lane]`.
    pub(super) rate: Vec<f64>,
    /// What was evaluated.
    out: Vec<f64>,
    rows: usize,
}

impl Margins {
    /// Of the first `count` functions of a flow, behind which their derivatives by the time
    /// stand; `field` is how fast the state changes.
    pub(super) fn of(
        flow: &Flow,
        count: usize,
        batch: &Batch,
        field: &[f64],
        theta: &[f64],
        scratch: &mut Scratch,
    ) -> Margins {
        let lanes = batch.lanes;
        scratch.stand_at(batch);
        flow.evaluate(&batch.state, lanes, theta, true, scratch);
        let out = scratch.out[..flow.outputs() * lanes].to_vec();
        let value = out[..count * lanes].to_vec();
        let mut rate = out[count * lanes..2 * count * lanes].to_vec();
        for (entry, &(row, from)) in flow.jacobian.iter().enumerate() {
            if row < count {
                for lane in 0..lanes {
                    let slope = out[(flow.rows + entry) * lanes + lane];
                    rate[row * lanes + lane] += slope * field[from * lanes + lane];
                }
            }
        }
        Margins { value, rate, out, rows: flow.rows }
    }

    /// Derivatives by the state, entry by entry of the flow's Jacobian.
    pub(super) fn jacobian(&self, lanes: usize) -> impl Iterator<Item = &[f64]> {
        self.out.chunks_exact(lanes).skip(self.rows)
    }

    /// Derivatives by the unknowns, entry by entry.
    pub(super) fn mixed(&self, flow: &Flow, lanes: usize) -> impl Iterator<Item = &[f64]> {
        self.out.chunks_exact(lanes).skip(self.rows + flow.jacobian.len())
    }
}

/// The cubic through two values with two slopes, over a span of one: a + b t + c t^2 + d t^3.
fn cubic([a, b]: [f64; 2], [da, db]: [f64; 2]) -> [f64; 4] {
    [a, da, 3.0 * (b - a) - 2.0 * da - db, 2.0 * (a - b) + da + db]
}

fn value_of([a, b, c, d]: [f64; 4], at: f64) -> f64 {
    a + at * (b + at * (c + at * d))
}

/// Whether the cubic through two positive values is negative in between.
pub(super) fn dips(ends: [f64; 2], slopes: [f64; 2]) -> bool {
    lowest(ends, slopes).is_some_and(|at| value_of(cubic(ends, slopes), at) < 0.0)
}

/// Where the cubic between a fall and a rise is lowest.
fn lowest(ends: [f64; 2], slopes: [f64; 2]) -> Option<f64> {
    if !(slopes[0] < 0.0 && slopes[1] > 0.0) {
        return None;
    }
    let [_, b, c, d] = cubic(ends, slopes);
    // Written so that no difference of near numbers is taken.
    let at = -b / (c + (c * c - 3.0 * d * b).sqrt());
    (0.0..=1.0).contains(&at).then_some(at)
}

/// Where the first of some cubics becomes negative, and which; NaN where none says.
pub(super) fn first_root(count: usize, of: impl Fn(usize) -> ([f64; 2], [f64; 2])) -> (f64, usize) {
    let mut first = (f64::NAN, 0);
    for k in 0..count {
        let (mut ends, slopes) = of(k);
        // A start on the surface itself is inside.
        ends[0] = ends[0].max(0.0);
        let below = if ends[1] < 0.0 { Some(1.0) } else { lowest(ends, slopes) };
        let Some(mut outside) = below else { continue };
        let all = cubic(ends, slopes);
        if value_of(all, outside) >= 0.0 {
            continue;
        }
        let mut inside = 0.0;
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (inside + outside);
            if value_of(all, middle) >= 0.0 { inside = middle } else { outside = middle }
        }
        if first.0.is_nan() || inside < first.0 {
            first = (inside, k);
        }
    }
    first
}
