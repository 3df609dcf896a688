//! What hand-written Rust does: the measure of the benchmarks of one trajectory.

/// Steps of Hénon-Heiles by Forest and Ruth's method, as one writes it.
pub(crate) fn by_hand(state: &mut [f64; 4], step: f64, steps: usize) {
    let outer = 1.0 / (2.0 - 2.0_f64.cbrt());
    let weights = [outer, 1.0 - 2.0 * outer, outer];
    let drifts = [
        0.5 * weights[0] * step,
        0.5 * (weights[0] + weights[1]) * step,
        0.5 * (weights[1] + weights[2]) * step,
        0.5 * weights[2] * step,
    ];
    let [mut x, mut y, mut u, mut v] = *state;
    for _ in 0..steps {
        for (drift, weight) in drifts.iter().zip(weights) {
            x += drift * u;
            y += drift * v;
            let kick = weight * step;
            u -= kick * (x + 2.0 * x * y);
            v -= kick * (y + x * x - y * y);
        }
        x += drifts[3] * u;
        y += drifts[3] * v;
    }
    *state = [x, y, u, v];
}
