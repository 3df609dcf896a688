//! Some lanes of arrays of rows of lanes.

/// Some lanes of rows of lanes.
pub(super) fn gathered(rows: &[f64], of: usize, lanes: &[usize]) -> Vec<f64> {
    let rows = rows.chunks_exact(of.max(1));
    rows.flat_map(|row| lanes.iter().map(|&lane| row[lane])).collect()
}

/// Sets some lanes of rows of lanes.
pub(super) fn scatter(rows: &mut [f64], of: usize, lanes: &[usize], some: &[f64]) {
    let some = some.chunks_exact(lanes.len().max(1));
    for (row, values) in rows.chunks_exact_mut(of.max(1)).zip(some) {
        lanes.iter().zip(values).for_each(|(&lane, value)| row[lane] = *value);
    }
}
